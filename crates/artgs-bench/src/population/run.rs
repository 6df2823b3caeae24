//! The objects of some seeds one after another, and their tables.

use super::object::measured;
use super::read::{row_files, rows_of_folder, write_rows};
use super::row::{Row, Status};
use crate::bench::{BenchError, claim};
use artgs_io::digest::tree_digest;
use artgs_io::run_folder::{load_json, remove_file, save_json};
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
    /// Replace rows that were made with other settings instead of refusing them.
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
        /// Number of objects.
        objects: usize,
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
    stop_after_discover: bool,
}

impl Settings {
    fn new(options: &Options, program: String) -> Self {
        let Options { sensor, size, stop_after_discover, .. } = options.clone();
        Self { program, sensor, size, stop_after_discover }
    }

    /// Names of the fields that differ.
    fn differences(&self, other: &Self) -> Vec<&'static str> {
        let fields = [
            ("program", self.program != other.program),
            ("--sensor", self.sensor != other.sensor),
            ("--size", self.size != other.size),
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
    let _lock = claim(&options.out)?;
    let settings = Settings::new(options, version(program)?);
    let wanted = plan(options, &settings)?;
    let total = options.seeds.len();
    if wanted.len() < total {
        observe(Event::Kept { objects: total - wanted.len() });
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

/// Seeds without a usable row. Rows with other settings are refused, or removed if they are to be replaced.
fn plan(options: &Options, settings: &Settings) -> Result<Vec<u64>, BenchError> {
    let (mut kept, mut others) = (Vec::new(), Vec::new());
    for (seed, path) in row_files(&options.out.join("rows"))? {
        // A row that cannot be read counts as unfinished.
        match load_json::<RowFile>(&path) {
            Ok(Some(file)) if file.settings == *settings => {
                let again = file.row.status == Status::Failed && options.retry_failed;
                kept.extend((!again).then_some(seed));
            }
            Ok(Some(file)) => others.push((path, file.settings.differences(settings))),
            _ if options.seeds.binary_search(&seed).is_ok() => remove_file(&path)?,
            _ => {}
        }
    }
    if let (Some((path, fields)), false) = (others.first(), options.force) {
        let (folder, fields) = (path.display().to_string(), fields.join(", "));
        return Err(BenchError::OtherSettings { folder, fields, runs: others.len() });
    }
    others.iter().try_for_each(|(path, _)| remove_file(path))?;
    Ok(options.seeds.iter().copied().filter(|seed| kept.binary_search(seed).is_err()).collect())
}

#[cfg(all(test, unix))]
#[path = "run_tests.rs"]
mod tests;
