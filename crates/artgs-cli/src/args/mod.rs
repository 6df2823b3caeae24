//! The command line as people type it.

mod batch;
#[cfg(feature = "bench")]
mod bench;
mod export;
mod method;
mod synth;

pub(crate) use batch::Batch;
#[cfg(feature = "bench")]
pub(crate) use bench::{Bench, Parts, Report};
pub(crate) use export::{CollisionKind, Export, FormatArg};
pub(crate) use method::{Demo, Earlier, Method, Preset, Reconstruct, RecordingArgs};
pub(crate) use synth::{Synth, SynthLayout, SynthScene, SynthSensor};

use bytesize::ByteSize;
use clap::{Args, Parser, Subcommand};
use std::num::NonZeroUsize;
use std::path::PathBuf;

const EXIT_CODES: &str = "Exit codes: 0 done, 1 failed, 2 wrong usage or bad input, 3 a check failed, 70 an error in the program, 75 a later retry makes sense (batch), 130 interrupted.";

/// Photos of an articulated object in two states to an interactable replica: part meshes, joints, splats, URDF.
#[derive(Debug, Parser)]
#[command(name = "artgs", version, after_help = EXIT_CODES, arg_required_else_help = true)]
pub(crate) struct Cli {
    /// JSON instead of text on standard output
    #[arg(long)]
    json: bool,
    /// Only warnings, errors and what was asked for
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    #[command(subcommand)]
    pub(crate) command: Command,
}

impl Cli {
    /// True if standard output must hold JSON and nothing else.
    pub(crate) fn wants_json(&self) -> bool {
        self.json
            || match &self.command {
                Command::Inspect(a) => a.json,
                Command::Reconstruct(a) => a.json,
                Command::Evaluate(a) => a.json.as_ref().is_some_and(|file| file.as_os_str() == "-"),
                Command::Demo(a) => a.json,
                Command::Batch(a) => a.json,
                #[cfg(feature = "bench")]
                Command::Bench(a) => a.json,
                #[cfg(feature = "bench")]
                Command::Report(a) => a.json,
                Command::Synth(a) => a.json,
                Command::Export(a) => a.json,
                #[cfg(feature = "check")]
                Command::Check(a) => a.json,
                Command::View(a) => a.json,
                Command::Devices(a) => a.json,
                Command::Settings(a) => a.json,
            }
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Describe a capture, and what is missing or unexpected in it
    Inspect(Inspect),
    /// Make a replica from a capture
    Reconstruct(Reconstruct),
    /// Complete a replica for simulators, and write it in their formats
    Export(Export),
    /// Open every export of a replica with another reader, and drive its joints in a physics engine
    #[cfg(feature = "check")]
    Check(Check),
    /// Show a replica, or a capture or recording before any reconstruction, in the browser
    View(View),
    /// Score a replica against the ground truth, against held-out photos, or both
    Evaluate(Evaluate),
    /// Render a capture of a procedural cabinet, reconstruct it and score the result
    Demo(Demo),
    /// Reconstruct the captures of a manifest, or one of them as a job of a cluster
    Batch(Batch),
    /// Describe the results of a batch or of `bench population` on a page: failures or errors, distributions, the worst, changes
    #[cfg(feature = "bench")]
    Report(Report),
    /// Reconstruct and score many captures, and tabulate the results beside those of the paper
    #[cfg(feature = "bench")]
    Bench(Bench),
    /// Render captures of procedural objects with their ground truth
    Synth(Synth),
    /// List what training can run on
    Devices(DeviceList),
    /// List the settings that a configuration file can hold, with their values and ranges
    Settings(SettingList),
}

#[derive(Debug, Args)]
pub(crate) struct DeviceList {
    /// Write JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct SettingList {
    /// The method whose values are shown
    #[arg(long, visible_alias = "method", value_enum, default_value_t = Preset::Default)]
    pub(crate) preset: Preset,
    /// Write JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Inspect {
    /// Folder with the images and cameras of both states, or one or two recordings, or a folder of two
    #[arg(num_args = 1..=2, required = true, value_name = "CAPTURE")]
    pub(crate) capture: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) recording: RecordingArgs,
    /// Number of threads; all cores if absent
    #[arg(long, value_name = "N", value_parser = crate::args::count)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Write JSON
    #[arg(long)]
    json: bool,
}

#[cfg(feature = "check")]
#[derive(Debug, Args)]
pub(crate) struct Check {
    /// Folder that `reconstruct` made and `export` filled
    pub(crate) out: PathBuf,
    /// Write a report with a line per rule: to FILE, as JSON if it ends in .json or as a page if it ends in .html, or both as
    /// check.json and check.html into a folder
    #[arg(long, value_name = "PATH")]
    pub(crate) report: Option<PathBuf>,
    /// Write JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct View {
    /// Folder that `reconstruct` made, also one that stopped before training; a capture; or a recording of one state
    pub(crate) what: PathBuf,
    /// Port on this machine; 8765 or any free one if absent
    #[arg(long, value_name = "N")]
    pub(crate) port: Option<u16>,
    /// Do not start a browser
    #[arg(long)]
    pub(crate) no_open: bool,
    /// Write one self-contained page to FILE instead of serving it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["port", "no_open"])]
    pub(crate) export: Option<PathBuf>,
    /// Title of the page; the name of the object if absent
    #[arg(long, value_name = "TEXT", requires = "export")]
    pub(crate) title: Option<String>,
    /// The page in FILE also has photos of the capture. Without, it can be shared without showing the room
    #[arg(long, requires = "export")]
    pub(crate) photos: bool,
    /// Folder with the photos of a replica; where the run found them if absent
    #[arg(long, value_name = "DIR")]
    pub(crate) capture: Option<PathBuf>,
    /// Write JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    pub(crate) recording: RecordingArgs,
    /// File in which the page of a recording saves the box of the object; object_box.json in its folder if absent
    #[arg(long, value_name = "FILE", conflicts_with = "export", help_heading = "Recordings")]
    pub(crate) save_box: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct Evaluate {
    /// Folder that `reconstruct` made
    pub(crate) out: PathBuf,
    /// Folder with the ground truth: joints and meshes
    #[arg(long, value_name = "DIR")]
    pub(crate) gt: Option<PathBuf>,
    /// Folder with the capture: its held-out views are compared with what the replica shows there
    #[arg(long, value_name = "DIR")]
    pub(crate) capture: Option<PathBuf>,
    /// Weights of AlexNet or VGG16 for LPIPS, as safetensors; docs/lpips.md says how to make the file
    #[arg(long, value_name = "FILE", requires = "capture")]
    pub(crate) lpips: Option<PathBuf>,
    /// Write the scores as JSON to FILE; `-` or nothing: to standard output instead of the table
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-")]
    pub(crate) json: Option<PathBuf>,
    /// Number of threads; all cores if absent
    #[arg(long, value_name = "N", value_parser = crate::args::count)]
    pub(crate) threads: Option<NonZeroUsize>,
}

/// A number of at least 1.
fn count(text: &str) -> Result<NonZeroUsize, String> {
    text.parse().map_err(|_| "give a whole number of at least 1".into())
}

/// Bytes with or without a unit.
fn size(text: &str) -> Result<ByteSize, String> {
    text.parse().map_err(|_| "give a number with a unit, such as 4GiB or 800MB".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn json_is_understood_before_and_after_the_command() {
        let wants = |line: &str| Cli::try_parse_from(line.split(' ')).unwrap().wants_json();
        assert!(wants("artgs --json inspect x") && wants("artgs inspect x --json"));
        assert!(wants("artgs --json demo") && wants("artgs evaluate x --gt y --json"));
        assert!(!wants("artgs evaluate x --gt y --json scores.json") && !wants("artgs demo"));
    }
}
