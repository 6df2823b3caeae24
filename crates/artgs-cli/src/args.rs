//! The command line as people type it.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::num::NonZeroUsize;
use std::path::PathBuf;

const EXIT_CODES: &str = "Exit codes: 0 done, 1 failed, 2 wrong usage or bad input, 130 interrupted.";

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
                Command::Synth(a) => a.json,
            }
    }
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Say what a capture contains, and what is missing or odd
    Inspect(Inspect),
    /// Make a replica from a capture
    Reconstruct(Reconstruct),
    /// Score a replica against the truth
    Evaluate(Evaluate),
    /// Photograph a procedural cabinet, reconstruct it and score the result
    Demo(Demo),
    /// Photograph procedural objects with everything known about them
    Synth(Synth),
}

#[derive(Debug, Args)]
pub(crate) struct Inspect {
    /// Folder with the images and cameras of both states
    pub(crate) capture: PathBuf,
    /// Write JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Reconstruct {
    /// Folder with the images and cameras of both states
    pub(crate) capture: PathBuf,
    /// Folder for the replica; made if missing
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Number of rigid parts, the static part included
    #[arg(long, value_name = "K", value_parser = parts)]
    pub(crate) parts: Option<usize>,
    #[command(flatten)]
    pub(crate) method: Method,
    #[command(flatten)]
    pub(crate) earlier: Earlier,
    /// Write events as JSON, one per line
    #[arg(long)]
    json: bool,
}

/// How to reconstruct.
#[derive(Debug, Args)]
pub(crate) struct Method {
    /// Settings to start from
    #[arg(long, value_enum, default_value_t = Preset::Default)]
    pub(crate) preset: Preset,
    /// TOML file with settings that replace those of the preset
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Number of threads; all cores if absent
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<NonZeroUsize>,
}

/// What to do about an earlier run in the same folder.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Earlier {
    /// Go on where an earlier run in the folder stopped
    #[arg(long)]
    pub(crate) resume: bool,
    /// Discard an earlier run in the folder
    #[arg(long, conflicts_with = "resume")]
    pub(crate) force: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Preset {
    /// What works best
    Default,
    /// The published method, as closely as possible
    Paper,
}

#[derive(Debug, Args)]
pub(crate) struct Evaluate {
    /// Folder that `reconstruct` made
    pub(crate) out: PathBuf,
    /// Folder with the true joints and meshes
    #[arg(long, value_name = "DIR")]
    pub(crate) gt: PathBuf,
    /// Write the scores as JSON to FILE; `-` or nothing: to standard output instead of the table
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "-")]
    pub(crate) json: Option<PathBuf>,
    /// Number of threads; all cores if absent
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<NonZeroUsize>,
}

#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Folder for the capture and the replica; made if missing
    #[arg(short, long, value_name = "DIR", default_value = "artgs-demo")]
    pub(crate) out: PathBuf,
    /// Training views per state
    #[arg(long, value_name = "N", default_value_t = 40)]
    pub(crate) views: usize,
    /// Width and height of the images, pixels
    #[arg(long, value_name = "N", default_value_t = 200)]
    pub(crate) size: u32,
    #[command(flatten)]
    pub(crate) method: Method,
    #[command(flatten)]
    pub(crate) earlier: Earlier,
    /// Write events as JSON, one per line
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Synth {
    /// Name of an object or a suite; --list shows them
    #[arg(value_name = "OBJECT|SUITE", required_unless_present = "list")]
    pub(crate) what: Option<String>,
    /// Folder for the capture of an object, or for a folder per object of a suite
    #[arg(short, long, value_name = "DIR", required_unless_present = "list")]
    pub(crate) out: Option<PathBuf>,
    /// List objects and suites
    #[arg(long)]
    pub(crate) list: bool,
    /// Training views per state
    #[arg(long, value_name = "N", default_value_t = 64)]
    pub(crate) views: usize,
    /// Held-out views per state
    #[arg(long, value_name = "N", default_value_t = 16)]
    pub(crate) test_views: usize,
    /// Width and height of the images, pixels
    #[arg(long, value_name = "PX", default_value_t = 400)]
    pub(crate) size: u32,
    /// What shall be wrong with the capture; may be repeated. One of depth=SIGMA (noise at distance 1, grows with its
    /// square), edges=on|DEG (no depth where surfaces are grazed), gloss=FRACTION (no depth on glossy patches),
    /// pose=DEG,LENGTH (jitter of the stated cameras), misalign=DEG,LENGTH (of the end state against the start),
    /// front=on (cameras only there), light=camera, no-depth
    #[arg(long, value_name = "NAME=VALUE")]
    pub(crate) noise: Vec<String>,
    /// Seed of placement, textures and degradations
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// How the files are laid out
    #[arg(long, value_enum, default_value_t = SynthLayout::Artgs)]
    pub(crate) layout: SynthLayout,
    /// Write into a folder that holds other files, too
    #[arg(long)]
    pub(crate) force: bool,
    /// Number of threads; all cores if absent
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Write JSON, one line per object
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SynthLayout {
    /// transforms_{train,test}_{start,end}.json
    Artgs,
    /// {start,end}/camera_{train,test}.json
    Paris,
}

fn parts(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0 | 1) => {
            Err("K counts the static part, so it is 2 or more: 1 static part and at least 1 that moves".into())
        }
        Ok(count) => Ok(count),
        Err(_) => Err("K is the number of rigid parts, the static part included: 2, 3, ...".into()),
    }
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
