//! Arguments of benchmarks and of reports.

use super::SynthSensor;
use super::method::Stop;
use crate::seeds::Seeds;
use artgs::fit::DeviceChoice;
use clap::Args;
use clap::ValueEnum;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

#[derive(Debug, Args)]
pub(crate) struct Report {
    /// Folder of a batch, its results.jsonl or rows, or the results.parquet of artgs.ray; or the same of artgs bench population
    pub(crate) table: PathBuf,
    /// The page (.html), or a folder for report.html; beside the table if absent. For a population also its tables as Markdown, beside
    /// the page with the same name (page.html: page.md)
    #[arg(short, long, value_name = "FILE|DIR")]
    pub(crate) out: Option<PathBuf>,
    /// An earlier table of the same captures: the page lists what has changed
    #[arg(long, value_name = "TABLE")]
    pub(crate) before: Option<PathBuf>,
    /// Price of an hour of one processor, in any currency: the page has the cost
    #[arg(long, value_name = "PRICE", value_parser = price)]
    pub(crate) cpu_price: Option<f64>,
    /// Write the numbers as JSON
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Bench {
    /// Suites of procedural objects, captures with their ground truth under `gt`, or folders of such captures; or
    /// `population` for the random objects of --seeds A..B, one by one
    #[arg(required = true, value_name = "SUITE|DIR|population")]
    pub(crate) what: Vec<PathBuf>,
    /// Folder for runs and results; made if missing; an interrupted bench continues where it stopped
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Runs of every object and variant, with seeds 0, 1, ...; 1 if absent. Of a population: the seeds of its objects, B
    /// excluded, or included in A..=B, or a list of seeds and ranges such as 3,5,8..=10
    #[arg(long, value_name = "N|A..B")]
    pub(crate) seeds: Option<Seeds>,
    /// Ways to run the method, separated by commas; `full` if neither this nor --variant-config is given
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    pub(crate) variants: Vec<String>,
    /// A further way: settings in a TOML file that replace those of the default preset
    #[arg(long, value_name = "NAME=FILE", value_parser = pair)]
    pub(crate) variant_config: Vec<(String, String)>,
    /// Whether runs are given the true number of parts or have to find it; variants that cannot find it are always given
    /// it; given if absent, except that a population never is
    #[arg(long, value_enum)]
    pub(crate) parts: Option<Parts>,
    /// Stop runs when parts and joints are found, and score these: seconds per run
    #[arg(long, value_name = "STAGE", value_enum)]
    pub(crate) stop_after: Option<Stop>,
    /// Training views per state of the objects of suites; several, separated by commas: each of them
    #[arg(long, value_name = "N", value_delimiter = ',')]
    pub(crate) views: Vec<usize>,
    /// Width and height of the pictures of the objects of suites, pixels; several: each of them
    #[arg(long, value_name = "PX", value_delimiter = ',')]
    pub(crate) size: Vec<u32>,
    /// How the captures of suites are degraded, as `artgs synth --noise` reads it, several joined by `+`; `none` for
    /// nothing; may be repeated: each of them
    #[arg(long, value_name = "NAME=VALUE")]
    pub(crate) noise: Vec<String>,
    /// Seed of placement, textures and degradations of the objects of suites; 0 if absent
    #[arg(long, value_name = "N")]
    pub(crate) photo_seed: Option<u64>,
    /// Share of the published steps that variants of the paper make, above 0 and at most 1
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub(crate) schedule: Option<f64>,
    /// Measure every stage of runs with --preset paper against the ground truth: `stages.md` and `stages.html` in DIR
    #[arg(long)]
    pub(crate) stages: bool,
    /// Weights of LPIPS, to score pictures with it
    #[arg(long, value_name = "FILE")]
    pub(crate) lpips: Option<PathBuf>,
    /// A capture that is an object of the paper, such as `mine=paris/fridge`
    #[arg(long, value_name = "NAME=OBJECT", value_parser = pair)]
    pub(crate) same_object: Vec<(String, String)>,
    /// A capture that stands for an object of the paper
    #[arg(long, value_name = "NAME=OBJECT", value_parser = pair)]
    pub(crate) stand_in: Vec<(String, String)>,
    /// Population: exact for captures with masks and exact depth, else the device that records the object in a room, or room for one
    /// that is drawn; if absent, half of the objects are exact
    #[arg(long, value_enum)]
    pub(crate) sensor: Option<SynthSensor>,
    /// Population: nothing moves; a result is right if it has no joint
    #[arg(long)]
    pub(crate) still: bool,
    /// Population: keep captures and runs in OUT/objects
    #[arg(long)]
    pub(crate) keep: bool,
    /// Seconds after which a run counts as failed
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(crate) timeout: Option<Duration>,
    /// Runs at a time; times and memory are comparable only with one
    #[arg(long, value_name = "N", default_value = "1", value_parser = crate::args::count)]
    pub(crate) jobs: NonZeroUsize,
    /// Number of threads of a run; all cores if absent
    #[arg(long, value_name = "N", value_parser = crate::args::count)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// What training runs on, as `artgs reconstruct` reads it
    #[arg(long, value_name = "DEVICE", default_value_t = DeviceChoice::Auto)]
    pub(crate) device: DeviceChoice,
    /// Make runs again that were made with other settings; of a population those of --seeds, and rows of other seeds with
    /// other settings remain an error
    #[arg(long)]
    pub(crate) force: bool,
    /// Make failed runs again
    #[arg(long)]
    pub(crate) retry_failed: bool,
    /// Write events as JSON, one per line
    #[arg(long)]
    pub(super) json: bool,
}

impl Bench {
    /// The device as `artgs reconstruct` reads it; none if it is to choose.
    pub(crate) fn named_device(&self) -> Option<String> {
        Some(self.device).filter(|d| *d != DeviceChoice::Auto).map(|d| d.to_string())
    }
}

/// How the runs of a bench know the number of parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Parts {
    /// The true number is given
    Given,
    /// They find it
    Auto,
}

fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() && !value.is_empty() => Ok((name.into(), value.into())),
        _ => Err("two words with `=` between them".into()),
    }
}

fn share(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|s| (f64::MIN_POSITIVE..=1.0).contains(s)).ok_or_else(|| "above 0 and at most 1".into())
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|s: &f64| *s > 0.0);
    let duration = seconds.and_then(|s| Duration::try_from_secs_f64(s).ok());
    duration.ok_or_else(|| "a number of seconds above 0".into())
}

fn price(text: &str) -> Result<f64, String> {
    number_in(text, 0.0, 1e6)
}

fn number_in(text: &str, low: f64, high: f64) -> Result<f64, String> {
    let number = text.parse().ok().filter(|x| (low..=high).contains(x));
    number.ok_or_else(|| format!("a number from {low} to {high}"))
}
