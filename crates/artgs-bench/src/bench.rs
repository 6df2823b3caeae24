//! Runs of a benchmark: plans missing runs, executes them and scores the results.

use crate::batch::TableError;
use crate::counted::counted;
use crate::item::{Item, ItemError, Source, check_names};
use crate::launch::{Ended, Tools};
use crate::marker::{Kind, claim};
use crate::population::{RESERVED, WriteError};
use crate::record::{Facts, Outcome, Record, RunSettings};
use crate::variant::{Variant, VariantError, check_variants};
use artgs_io::folder_lock::LockError;
use artgs_io::{FileError, write_atomic};
use serde_json::json;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

const RECORD: &str = "run.json";

/// Options of a benchmark.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder for everything.
    pub out: PathBuf,
    /// Runs of each variant and object, with seeds 0, 1, ...
    pub seeds: u64,
    /// Time after which a run counts as failed.
    pub timeout: Option<Duration>,
    /// Runs at a time. Times and memory are comparable only with one.
    pub jobs: usize,
    /// Threads of a run; all cores if absent.
    pub threads: Option<usize>,
    /// Give the method the true number of parts; otherwise it has to find the number, if it can.
    pub parts_given: bool,
    /// Stop runs when parts and joints are found, and score these.
    pub stop_after_discover: bool,
    /// Device for training, as in `artgs reconstruct --device`; the best available one if absent.
    pub device: Option<String>,
    /// Repeat runs with other settings instead of refusing them.
    pub force: bool,
    /// Repeat failed runs.
    pub retry_failed: bool,
}

/// Why a benchmark did not start or could not continue. A failing run is no such reason.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// Objects that cannot be used.
    #[error(transparent)]
    Item(#[from] ItemError),
    /// Variants that cannot be used.
    #[error(transparent)]
    Variant(#[from] VariantError),
    /// The output folder contains other files.
    #[error("{0} contains files that no benchmark wrote; give an empty folder to -o")]
    ForeignFolder(String),
    /// The output folder is a file.
    #[error("{0} is a file; give a folder to -o")]
    IsFile(String),
    /// The output folder is that of a benchmark of other things.
    #[error("{folder} holds {holds}; give another folder to -o")]
    OtherKind {
        /// The folder.
        folder: String,
        /// What it holds.
        holds: &'static str,
    },
    /// Another process writes into the output folder.
    #[error(transparent)]
    Lock(#[from] LockError),
    /// Earlier runs have other settings.
    #[error(
        "{folder} was made with another {fields} ({runs}); give the same settings, another folder to -o, \
         or --force to repeat these runs"
    )]
    OtherSettings {
        /// Folder of the first such run.
        folder: String,
        /// What differs.
        fields: String,
        /// How many there are, such as `2 such runs`.
        runs: String,
    },
    /// Rows of a population that were not asked for have other settings.
    #[error(
        "{rows} outside of --seeds with another {fields}, such as {row}, would be mixed with new rows; give the same settings, \
         another folder to -o, or --force with --seeds that include all rows of the folder"
    )]
    OtherSeeds {
        /// File of the first such row.
        row: String,
        /// What differs.
        fields: String,
        /// How many there are, such as `2 rows`.
        rows: String,
    },
    /// Seeds that nobody may use before a program is judged.
    #[error(
        "seeds from {RESERVED} on are kept for judging a finished program; give seeds below it, such as --seeds 0..200"
    )]
    ReservedSeeds,
    /// Rows of earlier runs that cannot be listed or read.
    #[error(transparent)]
    Rows(#[from] TableError),
    /// The tables of a population could not be written.
    #[error(transparent)]
    Tables(#[from] WriteError),
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A folder could not be created or removed.
    #[error("{path}: {source}")]
    Folder {
        /// The folder.
        path: String,
        /// Why.
        source: std::io::Error,
    },
}

impl BenchError {
    /// True if the user has to change the command.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::File(_) | Self::Tables(_) | Self::Folder { .. } | Self::Lock(LockError::File(_)))
    }
}

/// Progress of a benchmark.
#[derive(Debug)]
pub enum Event<'a> {
    /// Runs of an earlier benchmark are reused.
    Kept {
        /// Number of runs.
        runs: usize,
    },
    /// The views of a procedural object are rendered.
    Rendering {
        /// Name of the object.
        object: &'a str,
    },
    /// A run starts.
    Started {
        /// Which.
        run: RunName<'a>,
        /// Position among the runs to execute, from 1.
        number: usize,
        /// Number of runs to execute.
        of: usize,
    },
    /// A run has ended.
    Finished {
        /// Which.
        run: RunName<'a>,
        /// How.
        outcome: &'a Outcome,
        /// Wall-clock seconds, scoring included.
        seconds: f64,
    },
}

/// Variant, object and seed.
#[derive(Clone, Copy, Debug)]
pub struct RunName<'a> {
    /// Name of the variant.
    pub variant: &'a str,
    /// Name of the object.
    pub object: &'a str,
    /// Seed.
    pub seed: u64,
}

impl std::fmt::Display for RunName<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {} seed {}", self.variant, self.object, self.seed)
    }
}

/// Records of a benchmark, those of earlier runs included.
#[derive(Debug)]
pub struct Finished {
    /// By variant, object, seed.
    pub records: Vec<Record>,
    /// Runs that are missing because the benchmark was stopped.
    pub missing: usize,
}

/// A capture ready for its runs.
#[derive(Clone, Debug, Default)]
struct Prepared {
    capture: PathBuf,
    facts: Facts,
    /// Why there is none.
    error: Option<String>,
}

/// One run, executed or not.
struct Job<'a> {
    item: usize,
    variant: &'a Variant,
    object: &'a Item,
    settings: RunSettings,
    folder: PathBuf,
    kept: Option<Record>,
}

impl Job<'_> {
    fn name(&self) -> RunName<'_> {
        RunName { variant: &self.variant.name, object: &self.object.name, seed: self.settings.seed }
    }
}

/// Executes and scores the missing runs. Failed runs have records, too. `stop` ends the run in progress and the benchmark;
/// a later call resumes it.
pub fn run(
    items: &[Item],
    variants: &[Variant],
    options: &Options,
    tools: &Tools,
    stop: &AtomicBool,
    observe: &(dyn Fn(Event<'_>) + Sync),
) -> Result<Finished, BenchError> {
    check_names(items)?;
    check_variants(variants)?;
    let _lock = claim(&options.out, Kind::Suites)?;
    let jobs = plan(items, variants, options)?;
    let mut kept = 0;
    let mut wanted: Vec<&Job<'_>> = Vec::new();
    for job in &jobs {
        if job.kept.is_some() { kept += 1 } else { wanted.push(job) }
    }
    // All objects with the first seed, then all with the second.
    wanted.sort_by_key(|j| j.settings.seed);
    if kept > 0 {
        observe(Event::Kept { runs: kept });
    }
    for variant in variants.iter().filter(|v| !v.overlay.is_empty()) {
        write_atomic(&overlay_path(&options.out, variant), variant.overlay.as_bytes())?;
    }
    let prepared = prepare(items, &wanted, options, stop, observe)?;
    let (next, finished) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    let worker = || -> Result<(), BenchError> {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = wanted.get(index).filter(|_| !stop.load(Ordering::Relaxed)) else { return Ok(()) };
            observe(Event::Started { run: job.name(), number: index + 1, of: wanted.len() });
            let start = Instant::now();
            let Some(record) = execute(job, &prepared[job.item], options, tools, stop)? else { return Ok(()) };
            let seconds = start.elapsed().as_secs_f64();
            observe(Event::Finished { run: job.name(), outcome: &record.outcome, seconds });
            if let Ok(mut finished) = finished.lock() {
                finished.push(record);
            }
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..options.jobs.max(1)).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().try_for_each(|w| w.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })?;
    let mut finished = finished.into_inner().unwrap_or_default();
    let of = |job: &Job<'_>| {
        let same =
            |r: &Record| (&r.variant, &r.object, r.seed) == (&job.variant.name, &job.object.name, job.settings.seed);
        job.kept.clone().or_else(|| finished.iter().position(same).map(|i| finished.swap_remove(i)))
    };
    let total = jobs.len();
    let records: Vec<Record> = jobs.iter().filter_map(of).collect();
    Ok(Finished { missing: total - records.len(), records })
}

fn overlay_path(out: &Path, variant: &Variant) -> PathBuf {
    out.join("variants").join(format!("{}.toml", variant.name))
}

/// All runs with their existing records, by variant, object, seed.
fn plan<'a>(items: &'a [Item], variants: &'a [Variant], options: &Options) -> Result<Vec<Job<'a>>, BenchError> {
    let (mut jobs, mut others) = (Vec::new(), Vec::new());
    for variant in variants {
        for (index, item) in items.iter().enumerate() {
            for seed in 0..options.seeds {
                let settings = settings(item, variant, options, seed);
                let folder = Path::new("runs").join(&variant.name).join(&item.name).join(format!("seed_{seed}"));
                let mut kept = read_record(&options.out.join(&folder));
                if let Some(record) = &kept {
                    let differences = record.settings.differences(&settings);
                    if !differences.is_empty() {
                        others.push((folder.clone(), differences));
                        kept = None;
                    }
                }
                let kept = kept.filter(|r| r.measured().is_some() || !options.retry_failed);
                jobs.push(Job { item: index, variant, object: item, settings, folder, kept });
            }
        }
    }
    match others.first() {
        Some((folder, fields)) if !options.force => Err(BenchError::OtherSettings {
            folder: options.out.join(folder).display().to_string(),
            fields: fields.join(", "),
            runs: counted(others.len(), "such run"),
        }),
        _ => Ok(jobs),
    }
}

fn settings(item: &Item, variant: &Variant, options: &Options, seed: u64) -> RunSettings {
    RunSettings {
        version: env!("CARGO_PKG_VERSION").into(),
        preset: variant.preset.clone(),
        overlay: variant.overlay.clone(),
        arguments: arguments_of(variant, options),
        source: match &item.source {
            Source::Folder(path) => path.display().to_string(),
            Source::Procedural { settings, .. } => settings.clone(),
        },
        parts: item.parts.filter(|_| options.parts_given || variant.needs_parts),
        seed,
        threads: options.threads,
        device: options.device.clone(),
    }
}

/// Arguments of the variant, and those that the whole benchmark has.
fn arguments_of(variant: &Variant, options: &Options) -> Vec<String> {
    let stop = ["--stop-after", "discover"].iter().filter(|_| options.stop_after_discover);
    variant.arguments.iter().cloned().chain(stop.map(|word| (*word).to_string())).collect()
}

/// The record of a finished run; an unreadable one counts as unfinished.
fn read_record(folder: &Path) -> Option<Record> {
    serde_json::from_slice(&std::fs::read(folder.join(RECORD)).ok()?).ok()
}

/// Renders missing captures of procedural objects and reads facts of the needed captures.
fn prepare(
    items: &[Item],
    wanted: &[&Job<'_>],
    options: &Options,
    stop: &AtomicBool,
    observe: &(dyn Fn(Event<'_>) + Sync),
) -> Result<Vec<Prepared>, BenchError> {
    let mut all = Vec::new();
    for (index, item) in items.iter().enumerate() {
        if stop.load(Ordering::Relaxed) || !wanted.iter().any(|j| j.item == index) {
            all.push(Prepared::default());
            continue;
        }
        let (capture, error) = match &item.source {
            Source::Folder(path) => (path.clone(), None),
            Source::Procedural { settings, write } => {
                let capture = options.out.join("captures").join(&item.name);
                let error = render(&capture, settings, write, || {
                    observe(Event::Rendering { object: &item.name });
                })?;
                (capture, error)
            }
        };
        // The run itself reports a capture that cannot be read.
        let loaded = if error.is_none() { artgs_io::load_capture(&capture).ok() } else { None };
        let facts = loaded.map(|c| Facts::of(&c, item.noise.clone())).unwrap_or_default();
        all.push(Prepared { capture, facts, error });
    }
    Ok(all)
}

/// Renders into a folder unless that was done with the same settings. Returns why the object cannot be rendered, if so.
fn render(
    capture: &Path,
    settings: &str,
    write: &crate::item::Renderer,
    report: impl Fn(),
) -> Result<Option<String>, BenchError> {
    let done = capture.with_file_name(format!("{}.settings", file_name(capture)));
    if std::fs::read_to_string(&done).is_ok_and(|text| text == settings) && capture.is_dir() {
        return Ok(None);
    }
    report();
    remove(&done, |path| std::fs::remove_file(path))?;
    remove(capture, |path| std::fs::remove_dir_all(path))?;
    let written = catch_unwind(AssertUnwindSafe(|| write(capture)));
    match written.unwrap_or_else(|_| Err("the program crashed".into())) {
        Ok(()) => Ok(write_atomic(&done, settings.as_bytes()).map(|()| None)?),
        Err(reason) => Ok(Some(format!("could not be rendered: {reason}"))),
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn remove(path: &Path, how: impl Fn(&Path) -> std::io::Result<()>) -> Result<(), BenchError> {
    match how(path) {
        Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
            Err(BenchError::Folder { path: path.display().to_string(), source })
        }
        _ => Ok(()),
    }
}

/// Executes and scores a run and writes its record; none if the benchmark was stopped.
fn execute(
    job: &Job<'_>,
    prepared: &Prepared,
    options: &Options,
    tools: &Tools,
    stop: &AtomicBool,
) -> Result<Option<Record>, BenchError> {
    let folder = options.out.join(&job.folder);
    // Files of an unfinished run would be reused and make the times of this one too short.
    remove(&folder, |path| std::fs::remove_dir_all(path))?;
    let log = folder.with_file_name(format!("{}.log", file_name(&folder)));
    let ended = match &prepared.error {
        Some(reason) => Ended::Failed(reason.clone()),
        None => tools.run(&arguments(job, prepared, options, &folder), &log, options.timeout, stop),
    };
    let outcome = match ended {
        Ended::Stopped => return Ok(None),
        Ended::Failed(reason) => Outcome::Failed(reason),
        Ended::Success => {
            let measured = catch_unwind(AssertUnwindSafe(|| (tools.measure)(&folder, &prepared.capture)));
            match measured.unwrap_or_else(|_| Err("scoring crashed".into())) {
                Ok(measured) => Outcome::Done(measured),
                Err(reason) => Outcome::Failed(reason),
            }
        }
    };
    let record = Record {
        variant: job.variant.name.clone(),
        object: job.object.name.clone(),
        seed: job.settings.seed,
        settings: job.settings.clone(),
        facts: prepared.facts.clone(),
        outcome,
        folder: job.folder.clone(),
    };
    write_atomic(&folder.join(RECORD), format!("{:#}\n", json!(record)).as_bytes())?;
    Ok(Some(record))
}

/// The command line of a run.
fn arguments(job: &Job<'_>, prepared: &Prepared, options: &Options, folder: &Path) -> Vec<OsString> {
    let mut args: Vec<OsString> = vec!["reconstruct".into(), prepared.capture.clone().into()];
    args.extend(["-o".into(), folder.into(), "--preset".into(), job.variant.preset.clone().into()]);
    if !job.variant.overlay.is_empty() {
        args.extend(["--config".into(), overlay_path(&options.out, job.variant).into()]);
    }
    if let Some(parts) = job.settings.parts {
        args.extend(["--parts".into(), parts.to_string().into()]);
    }
    args.extend(["--seed".into(), job.settings.seed.to_string().into()]);
    if let Some(threads) = options.threads {
        args.extend(["--threads".into(), threads.to_string().into()]);
    }
    if let Some(device) = &options.device {
        args.extend(["--device".into(), device.into()]);
    }
    args.push("--json".into());
    args.extend(job.settings.arguments.iter().map(OsString::from));
    args
}

#[cfg(test)]
#[path = "bench_tests.rs"]
mod tests;
