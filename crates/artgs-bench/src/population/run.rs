//! The objects of some seeds one after another, and their tables.

use super::object::measured;
use super::read::{row_files, rows_of_folder, write_rows};
use super::row::{Row, Status};
use crate::bench::BenchError;
use crate::counted::counted;
use crate::marker::{Kind, claim};
use artgs_io::digest::tree_digest;
use artgs_io::run_folder::{load_json, remove_file, remove_folder, save_json};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

/// Seeds from here on are kept for judging a finished program: nobody may look at their objects before.
pub const RESERVED: u64 = 10_000;
/// Digits of the hash of a program, in which its builds differ.
const DIGITS: usize = 7;

/// Options of a population.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder for everything.
    pub out: PathBuf,
    /// Seeds of the objects, below [`RESERVED`], in rising order.
    pub seeds: Vec<u64>,
    /// How objects are recorded, as `artgs synth --random --sensor` reads it; [`Options::ANY`]: as their seeds draw it.
    pub sensor: String,
    /// Width of the photos, pixels; as `artgs synth` chooses it if absent.
    pub size: Option<u32>,
    /// Nothing moves.
    pub still: bool,
    /// Stop runs when parts and joints are found.
    pub stop_after_discover: bool,
    /// Time after which making an object, or its run, counts as failed.
    pub timeout: Option<Duration>,
    /// Objects at a time. Times are comparable only with one.
    pub jobs: usize,
    /// Threads of a process; all cores if absent.
    pub threads: Option<usize>,
    /// Device for training, as in `artgs reconstruct --device`; the best available one if absent.
    pub device: Option<String>,
    /// Keep captures and runs.
    pub keep: bool,
    /// Replace rows of these seeds that were made with other settings instead of refusing them.
    pub force: bool,
    /// Repeat failed objects. Refused ones are results.
    pub retry_failed: bool,
}

impl Options {
    /// Half of the objects exact, half in rooms.
    pub const ANY: &'static str = "any";
}

/// Progress of a population.
#[derive(Debug)]
pub enum Event<'a> {
    /// Rows of an earlier bench are reused.
    Kept {
        /// Number of objects that are done or refused.
        objects: usize,
        /// Number of objects that failed and are not repeated.
        failed: usize,
    },
    /// An object starts.
    Started {
        /// Its seed.
        seed: u64,
        /// Position among the objects to do, from 1.
        number: usize,
        /// Number of objects to do.
        of: usize,
    },
    /// The row of an object is written.
    Finished {
        /// The row.
        row: &'a Row,
    },
}

/// The rows of the folder, those of earlier benches included.
#[derive(Debug)]
pub struct Finished {
    /// By seed.
    pub rows: Vec<Row>,
    /// Seeds of this bench without a row, because it was stopped.
    pub missing: usize,
    /// The tables: Parquet and lines of JSON; none without rows.
    pub tables: Option<[PathBuf; 2]>,
}

/// What rows of one table must have in common.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Settings {
    program: String,
    sensor: String,
    size: Option<u32>,
    #[serde(default)]
    still: bool,
    stop_after_discover: bool,
}

impl Settings {
    fn new(options: &Options, program: String) -> Self {
        let Options { sensor, size, still, stop_after_discover, .. } = options.clone();
        Self { program, sensor, size, still, stop_after_discover }
    }

    /// Names of the fields that differ.
    fn differences(&self, other: &Self) -> Vec<&'static str> {
        let fields = [
            ("program", self.program != other.program),
            ("--sensor", self.sensor != other.sensor),
            ("--size", self.size != other.size),
            ("--still", self.still != other.still),
            ("--stop-after", self.stop_after_discover != other.stop_after_discover),
        ];
        fields.into_iter().filter(|field| field.1).map(|field| field.0).collect()
    }
}

/// A file of the folder `rows`.
#[derive(Debug, Serialize, Deserialize)]
struct RowFile {
    settings: Settings,
    #[serde(flatten)]
    row: Row,
}

/// Makes, runs and scores the objects whose rows are missing, and writes the tables of all rows in the folder. Failures are rows, too.
/// `program` executes `artgs`. `stop` ends the processes in progress and the bench; a later call resumes it.
pub fn run(
    options: &Options,
    program: &Path,
    stop: &AtomicBool,
    observe: &(dyn Fn(Event<'_>) + Sync),
) -> Result<Finished, BenchError> {
    if options.seeds.last().is_some_and(|last| *last >= RESERVED) {
        return Err(BenchError::ReservedSeeds);
    }
    let _lock = claim(&options.out, Kind::Population)?;
    let settings = Settings::new(options, version(program)?);
    let Plan { wanted, failed } = plan(options, &settings)?;
    if !options.keep {
        remove_unfinished(&options.out, &wanted)?;
    }
    let kept = options.seeds.len() - wanted.len();
    if kept > 0 {
        observe(Event::Kept { objects: kept - failed, failed });
    }
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let worker = || -> Result<(), BenchError> {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(seed) = wanted.get(index).filter(|_| !stop.load(Ordering::Relaxed)) else { return Ok(()) };
            observe(Event::Started { seed: *seed, number: index + 1, of: wanted.len() });
            let Some(row) = measured(*seed, options, program, &settings.program, stop)? else { return Ok(()) };
            let file = RowFile { settings: settings.clone(), row };
            save_json(&row_path(&options.out, *seed), &file)?;
            done.fetch_add(1, Ordering::Relaxed);
            observe(Event::Finished { row: &file.row });
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..options.jobs.max(1)).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().try_for_each(|w| w.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })?;
    let rows = rows_of_folder(&options.out.join("rows"))?;
    let tables = if rows.is_empty() { None } else { Some(write_rows(&options.out, &rows)?) };
    Ok(Finished { missing: wanted.len() - done.into_inner(), rows, tables })
}

fn row_path(out: &Path, seed: u64) -> PathBuf {
    out.join("rows").join(format!("{seed}.json"))
}

/// Version of a program, and the begin of the hash of its file: rows of two builds are not mixed.
fn version(program: &Path) -> Result<String, BenchError> {
    let digest = tree_digest("", &[program.to_path_buf()])?;
    Ok(format!("{} ({})", env!("CARGO_PKG_VERSION"), digest.get(..DIGITS).unwrap_or(&digest)))
}

/// What is to be done.
struct Plan {
    /// Seeds without a usable row.
    wanted: Vec<u64>,
    /// Number of the other seeds whose objects failed.
    failed: usize,
}

/// A row that was made with other settings.
struct Other {
    seed: u64,
    path: PathBuf,
    /// Names of the settings that differ.
    fields: Vec<&'static str>,
}

/// Compares the rows of the folder with the settings. Rows with other settings are refused, or removed if they are to be replaced.
fn plan(options: &Options, settings: &Settings) -> Result<Plan, BenchError> {
    let is_asked = |seed: u64| options.seeds.binary_search(&seed).is_ok();
    let (mut kept, mut others, mut failed) = (Vec::new(), Vec::new(), 0);
    for (seed, path) in row_files(&options.out.join("rows"))? {
        // A row that cannot be read counts as unfinished.
        match load_json::<RowFile>(&path) {
            Ok(Some(file)) if file.settings == *settings => {
                let has_failed = file.row.status == Status::Failed;
                if !(has_failed && options.retry_failed) {
                    kept.push(seed);
                    failed += usize::from(has_failed && is_asked(seed));
                }
            }
            Ok(Some(file)) => others.push(Other { seed, path, fields: file.settings.differences(settings) }),
            _ if is_asked(seed) => remove_file(&path)?,
            _ => {}
        }
    }
    replace(&others, options)?;
    let wanted = options.seeds.iter().copied().filter(|seed| kept.binary_search(seed).is_err()).collect();
    Ok(Plan { wanted, failed })
}

/// Removes rows with other settings if they are to be replaced, and refuses them if not, or if a seed was not asked for.
fn replace(others: &[Other], options: &Options) -> Result<(), BenchError> {
    let outside: Vec<&Other> =
        others.iter().filter(|other| options.seeds.binary_search(&other.seed).is_err()).collect();
    if let Some(first) = outside.first() {
        let (row, fields) = (first.path.display().to_string(), first.fields.join(", "));
        return Err(BenchError::OtherSeeds { row, fields, rows: counted(outside.len(), "row") });
    }
    if let (Some(first), false) = (others.first(), options.force) {
        let (folder, fields) = (first.path.display().to_string(), first.fields.join(", "));
        return Err(BenchError::OtherSettings { folder, fields, runs: counted(others.len(), "such run") });
    }
    Ok(others.iter().try_for_each(|other| remove_file(&other.path))?)
}

/// Removes captures and runs that an interrupted bench has left: those of seeds that have no row and are not wanted now.
fn remove_unfinished(out: &Path, wanted: &[u64]) -> Result<(), BenchError> {
    let folder = out.join("objects");
    let Ok(entries) = std::fs::read_dir(&folder) else { return Ok(()) };
    for entry in entries.filter_map(Result::ok) {
        let seed = entry.file_name().to_str().and_then(|name| name.parse::<u64>().ok());
        let is_left = |seed: &u64| wanted.binary_search(seed).is_err() && !row_path(out, *seed).exists();
        if seed.as_ref().is_some_and(is_left) {
            remove_folder(&entry.path())?;
        }
    }
    Ok(())
}

#[cfg(all(test, unix))]
#[path = "run_tests.rs"]
mod tests;
