//! The command line as people type it.

use crate::device::DeviceChoice;
#[cfg(feature = "bench")]
use crate::seeds::Seeds;
use artgs::{PartCount, PartCountError};
use artgs_io::asset::{Actuators, Format, Frames, Provenance, SpzVersion};
use artgs_physical::Up;
use artgs_physical::export::{ExportOptions, FrontAxis};
use artgs_synth::recording::Drift;
use bytesize::ByteSize;
use clap::builder::PossibleValue;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::num::NonZeroUsize;
use std::path::PathBuf;
#[cfg(feature = "bench")]
use std::time::Duration;

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
    /// Write JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Reconstruct {
    /// Folder with the images and cameras of both states; or two recordings, the object closed in one and open in the
    /// other, as a phone or depth camera wrote them, or one folder that contains them as `start` and `end`
    #[arg(num_args = 1..=2, required = true, value_name = "CAPTURE")]
    pub(crate) capture: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) recording: RecordingArgs,
    /// Two recordings: the object is what is in this box, in the world and unit of the first recording, instead of what
    /// the cameras look at; floor and walls in it are left out. A run prints the box of its object in this form; the
    /// page of `artgs view RECORDING` shows a box, and saves it in a FILE
    #[arg(
        long = "box",
        value_name = "X0,Y0,Z0,X1,Y1,Z1|FILE",
        allow_hyphen_values = true,
        help_heading = "Recordings"
    )]
    pub(crate) object_box: Option<String>,
    /// Folder for the replica; made if missing
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) method: Method,
    #[command(flatten)]
    pub(crate) earlier: Earlier,
    /// Use a capture whose views or states do not agree with each other; `artgs inspect` shows what is wrong with it
    #[arg(long)]
    pub(crate) force_input: bool,
    /// Memory that the run may take, such as 4GiB: larger images are reduced to fit; what is free on the machine if absent
    #[arg(long, value_name = "SIZE")]
    pub(crate) memory: Option<ByteSize>,
    /// Show training in the browser while it runs
    #[arg(long)]
    pub(crate) view: bool,
    /// Stop when parts and joints are found, before training, so that they can be corrected: in the page, which with
    /// --view is open at once and else by `artgs view DIR`, or by hand; --resume continues
    #[arg(long, value_name = "STAGE", value_enum)]
    pub(crate) stop_after: Option<Stop>,
    /// Write events as JSON, one per line
    #[arg(long)]
    json: bool,
}

/// How recordings are read.
#[derive(Debug, Args)]
#[command(next_help_heading = "Recordings")]
pub(crate) struct RecordingArgs {
    /// Format of the recordings; recognised by content if absent; an unknown name lists them
    #[arg(long, value_name = "NAME")]
    pub(crate) format: Option<String>,
    /// Largest number of frames of a recording that are used
    #[arg(long, value_name = "N")]
    pub(crate) frames: Option<usize>,
    /// Intrinsics, for formats without intrinsics: FX,FY,CX,CY in pixels of the recorded images
    #[arg(long, value_name = "FX,FY,CX,CY")]
    pub(crate) intrinsics: Option<String>,
    /// Camera poses for formats without, as TUM files; one for both recordings, or one for each
    #[arg(long, value_name = "FILE", num_args = 1..=2)]
    pub(crate) poses: Vec<PathBuf>,
    /// Length of one stored number of the depth images, such as mm, 0.2mm or m; that of the files or of the format if absent
    #[arg(long, value_name = "LENGTH")]
    pub(crate) depth_unit: Option<String>,
    /// Axes of the camera frame that poses belong to: opencv, opengl, robot (x forward, z up), or where x, y and z point,
    /// such as RDF for right, down, forward; those of the format if absent
    #[arg(long, value_name = "AXES")]
    pub(crate) camera_axes: Option<String>,
    /// Poses lead from the world to the camera, where those of the format lead back
    #[arg(long)]
    pub(crate) invert_poses: bool,
    /// Use every N-th frame only
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) every: usize,
    /// Number of the first frame that --every uses, of each recording: one recording can serve as two states
    #[arg(long, value_name = "START,END", value_delimiter = ',')]
    pub(crate) offset: Vec<usize>,
}

/// Where to stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Stop {
    /// Finding parts and joints
    Discover,
}

/// How to reconstruct.
#[derive(Debug, Args)]
pub(crate) struct Method {
    /// Number of rigid parts, the static part included: K, MIN..MAX (both included), or auto to find it, which is the
    /// default
    #[arg(long, value_name = "K|MIN..MAX|auto", value_parser = parts)]
    pub(crate) parts: Option<PartCount>,
    /// The method, with its settings to start from
    #[arg(long, visible_alias = "method", value_enum, default_value_t = Preset::Default)]
    pub(crate) preset: Preset,
    /// Only this share of the published steps, 0 to 1, with larger rates; with `--preset paper`
    #[arg(long, value_name = "SHARE")]
    pub(crate) schedule: Option<f64>,
    /// Disable one component of the method, as the ablations of the paper do; an unknown name lists them
    #[arg(long, value_name = "NAME")]
    pub(crate) variant: Option<String>,
    /// TOML file with settings that replace those of the preset
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Number of threads; all cores if absent
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<NonZeroUsize>,
    /// What training runs on: auto (a graphics processor if there is one), cpu, gpu or gpu:N; `artgs devices` lists them
    #[arg(long, value_name = "DEVICE", default_value_t = DeviceChoice::Auto)]
    pub(crate) device: DeviceChoice,
}

/// What to do about an earlier run in the same folder.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct Earlier {
    /// Continue an earlier run in the folder where it stopped
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
    /// A baseline without Gaussians: clusters of what moved, registered; needs depth
    Registration,
}

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// Folder that `reconstruct` made; files go to its folder `exports`
    pub(crate) out: PathBuf,
    /// Formats, separated by commas; all of them if absent
    #[arg(long, value_name = "LIST", value_enum, value_delimiter = ',')]
    pub(crate) to: Vec<FormatArg>,
    /// Folder with the photos, for textures; where the run found them if absent
    #[arg(long, value_name = "DIR")]
    pub(crate) capture: Option<PathBuf>,
    /// Name of the object in the files
    #[arg(long, default_value = ExportOptions::NAME, value_parser = object_name)]
    pub(crate) name: String,
    /// Metres per unit of the capture
    #[arg(long, value_name = "M", default_value_t = 1.0, value_parser = metres_per_unit)]
    pub(crate) scale: f64,
    /// Which way is up in the capture: x, -x, y, -y, z, -z, or a direction such as 0.1,0,0.99; if absent, as the recordings state or
    /// their floor and walls say; z for captures
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub(crate) up: Option<Up>,
    /// Front of the object in the capture's frame, which is along -Y in exports: `auto` (where drawers come out and doors open
    /// to), x, -x, y, -y, z, -z, or `capture` to keep the frame of the capture
    #[arg(long, value_name = "AXIS", default_value = "auto", allow_hyphen_values = true)]
    pub(crate) front: FrontAxis,
    /// Links keep the names `part_1`, `part_2`, ... instead of names by their classes such as `door_left`
    #[arg(long)]
    pub(crate) part_names: bool,
    /// MJCF: an actuator per joint, whose control is a force or the value of the joint
    #[arg(long, value_name = "motor|position", value_parser = actuators)]
    pub(crate) actuators: Option<Actuators>,
    /// MJCF: the base moves freely instead of being fixed to the world
    #[arg(long)]
    pub(crate) free_base: bool,
    /// URDF: mesh paths begin with package://NAME/, the folder `urdf` being the package
    #[arg(long, value_name = "NAME", value_parser = package)]
    pub(crate) package: Option<String>,
    /// Frames without a body: `all`, or `none` to leave out grasp frames and the root link of the URDF, at which some importers stop
    #[arg(long, value_name = "all|none", value_parser = frames, default_value = "all")]
    pub(crate) frames: Frames,
    /// Version of the SPZ files: 2 and 3 are gzip streams, 4 has zstd streams
    #[arg(long, value_name = "2|3|4", default_value_t)]
    pub(crate) spz: SpzVersion,
    /// SimReady: who made the object
    #[arg(long, value_name = "NAME", value_parser = stated)]
    pub(crate) author: Option<String>,
    /// SimReady: the terms under which the files may be used
    #[arg(long, value_name = "TEXT", value_parser = stated)]
    pub(crate) license: Option<String>,
    /// SimReady: Wikidata item of the kind of object, such as Q42177; that of a physical object if absent
    #[arg(long, value_name = "ITEM", value_parser = wikidata)]
    pub(crate) wikidata: Option<String>,
    /// Kilograms per cubic metre, of all parts or of one; may be repeated; 650 if absent
    #[arg(long, value_name = "KG|PART=KG", value_parser = density)]
    pub(crate) density: Vec<(Option<String>, f64)>,
    /// Kilograms of all parts together
    #[arg(long, value_name = "KG", value_parser = mass)]
    pub(crate) mass: Option<f64>,
    /// What parts collide with
    #[arg(long, value_enum, default_value_t = CollisionKind::Hulls)]
    pub(crate) collision: CollisionKind,
    /// Convex pieces per link at most; 400 if absent
    #[arg(long, value_name = "N", value_parser = hulls)]
    pub(crate) hulls: Option<u32>,
    /// Joints go from one observed state to the other and no further
    #[arg(long)]
    pub(crate) observed_limits: bool,
    /// Triangles per link for drawing, at most about this many; 20000 if absent
    #[arg(long, value_name = "N", value_parser = triangles)]
    pub(crate) triangles: Option<usize>,
    /// Millimetres per texel of the textures; as in the photos if absent
    #[arg(long, value_name = "MM", value_parser = texel)]
    pub(crate) texel: Option<f64>,
    /// Number of threads; all cores if absent
    #[arg(long, value_name = "N")]
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

/// A format as the value of a flag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FormatArg(pub(crate) Format);

impl ValueEnum for FormatArg {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [FormatArg; Format::ALL.len()] = {
            let mut all = [FormatArg(Format::Urdf); Format::ALL.len()];
            let mut i = 0;
            while i < all.len() {
                all[i] = FormatArg(Format::ALL[i]);
                i += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let hidden = !self.0.is_available();
        Some(PossibleValue::new(self.0.name()).help(self.0.description()).hide(hidden))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CollisionKind {
    /// Convex pieces, cut so that hulls of different parts do not collide
    Hulls,
    /// Convex pieces by CoACD, cut likewise; needs the Python package `coacd` and takes minutes
    Coacd,
    /// Nothing collides
    None,
}

#[derive(Debug, Args)]
pub(crate) struct Evaluate {
    /// Folder that `reconstruct` made
    pub(crate) out: PathBuf,
    /// Folder with the ground truth: joints and meshes
    #[arg(long, value_name = "DIR", required_unless_present = "capture")]
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
pub(crate) struct Batch {
    /// CSV with a header, or JSON with one object per line (.jsonl): `id`, `start` (a capture, or the first recording), `end`
    /// (the second recording), and options of reconstruct. Relative paths start at its folder
    pub(crate) manifest: PathBuf,
    /// Folder for replicas, logs, and a row per capture; if absent, the number of captures is printed
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Number of the capture, from 0; all of them one after another if absent, and then the table results.jsonl
    #[arg(long, value_name = "N", requires = "out")]
    pub(crate) index: Option<usize>,
    /// Export the replicas: formats, separated by commas
    #[arg(long, value_name = "LIST", value_enum, value_delimiter = ',')]
    pub(crate) to: Vec<FormatArg>,
    /// Run captures again that failed for a reason that remains
    #[arg(long)]
    pub(crate) retry_failed: bool,
    /// Write rows as JSON, one per line
    #[arg(long)]
    json: bool,
}

#[cfg(feature = "bench")]
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
    json: bool,
}

#[cfg(feature = "bench")]
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
    /// Population: keep captures and runs in OUT/objects
    #[arg(long)]
    pub(crate) keep: bool,
    /// Seconds after which a run counts as failed
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(crate) timeout: Option<Duration>,
    /// Runs at a time; times and memory are comparable only with one
    #[arg(long, value_name = "N", default_value = "1")]
    pub(crate) jobs: NonZeroUsize,
    /// Number of threads of a run; all cores if absent
    #[arg(long, value_name = "N")]
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
    json: bool,
}

/// How the runs of a bench know the number of parts.
#[cfg(feature = "bench")]
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Parts {
    /// The true number is given
    Given,
    /// They find it
    Auto,
}

#[cfg(feature = "bench")]
fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.is_empty() && !value.is_empty() => Ok((name.into(), value.into())),
        _ => Err("two words with `=` between them".into()),
    }
}

#[cfg(feature = "bench")]
fn share(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|s| (f64::MIN_POSITIVE..=1.0).contains(s)).ok_or_else(|| "above 0 and at most 1".into())
}

#[cfg(feature = "bench")]
fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|s: &f64| *s > 0.0);
    let duration = seconds.and_then(|s| Duration::try_from_secs_f64(s).ok());
    duration.ok_or_else(|| "a number of seconds above 0".into())
}

/// Scales between micrometres and kilometres.
fn metres_per_unit(text: &str) -> Result<f64, String> {
    number_in(text, 1e-6, 1e3)
}

/// Densities from foam to the heaviest metal.
fn density(text: &str) -> Result<(Option<String>, f64), String> {
    let (part, number) = text.split_once('=').map_or((None, text), |(part, number)| (Some(part.to_string()), number));
    Ok((part, number_in(number, 1.0, 25_000.0)?))
}

/// Masses from a gram to a ship.
fn mass(text: &str) -> Result<f64, String> {
    number_in(text, 1e-3, 1e6)
}

#[cfg(feature = "bench")]
fn price(text: &str) -> Result<f64, String> {
    number_in(text, 0.0, 1e6)
}

fn actuators(text: &str) -> Result<Actuators, String> {
    Actuators::ALL.into_iter().find(|kind| kind.name() == text).ok_or_else(|| "motor or position".into())
}

fn frames(text: &str) -> Result<Frames, String> {
    Frames::ALL.into_iter().find(|kind| kind.name() == text).ok_or_else(|| "all or none".into())
}

/// Names of ROS packages.
fn package(text: &str) -> Result<String, String> {
    let usable = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-';
    let valid = text.starts_with(|c: char| c.is_ascii_lowercase()) && text.chars().all(usable) && text.len() <= 100;
    if valid { Ok(text.into()) } else { Err("lower case letters, digits, `_` and `-`, a letter first".into()) }
}

/// Names that a file can have.
fn object_name(text: &str) -> Result<String, String> {
    let usable =
        text.chars().count() <= 100 && text.chars().any(char::is_alphanumeric) && !text.chars().any(char::is_control);
    if usable { Ok(text.into()) } else { Err("1 to 100 characters, one of them a letter or digit".into()) }
}

/// Numbers of convex pieces with which engines are still fast.
fn hulls(text: &str) -> Result<u32, String> {
    let number = text.parse().ok().filter(|n| (1..=1000).contains(n));
    number.ok_or_else(|| "a whole number from 1 to 1000".into())
}

/// A text that says something.
fn stated(text: &str) -> Result<String, String> {
    if text.trim().is_empty() { Err("a text that is not empty".into()) } else { Ok(text.trim().into()) }
}

fn wikidata(text: &str) -> Result<String, String> {
    if Provenance::is_item(text) { Ok(text.into()) } else { Err("the letter Q and a number, such as Q42177".into()) }
}

fn texel(text: &str) -> Result<f64, String> {
    number_in(text, 1e-2, 1e3)
}

/// Numbers of triangles that can show something.
fn triangles(text: &str) -> Result<usize, String> {
    let number = text.parse().ok().filter(|n| (4..=100_000_000).contains(n));
    number.ok_or_else(|| "a whole number from 4 to 100000000".into())
}

fn number_in(text: &str, low: f64, high: f64) -> Result<f64, String> {
    let number = text.parse().ok().filter(|x| (low..=high).contains(x));
    number.ok_or_else(|| format!("a number from {low} to {high}"))
}

#[derive(Debug, Args)]
pub(crate) struct Synth {
    /// Name of an object or a suite; --list shows them
    #[arg(value_name = "OBJECT|SUITE", required_unless_present_any = ["list", "random"])]
    pub(crate) what: Option<String>,
    /// Folder for the capture of an object, or for a folder per object of a suite
    #[arg(short, long, value_name = "DIR", required_unless_present = "list")]
    pub(crate) out: Option<PathBuf>,
    /// Draw an object, its states and its recording from the population by this seed; views, noise and drift are drawn, too
    #[arg(long, value_name = "SEED", conflicts_with_all = ["what", "views", "noise", "path", "drift", "own_frames", "bystander", "seed", "layout"])]
    pub(crate) random: Option<u64>,
    /// Number of states of a random object, 2 if absent; those after the end are called state_2, state_3, ...
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..=100))]
    pub(crate) states: Option<u64>,
    /// List objects and suites
    #[arg(long)]
    pub(crate) list: bool,
    /// What is around the object: studio (nothing; cameras on a sphere, masks) or room (floor, walls and clutter; a
    /// recording by a simulated device, no masks, metres). If absent, studio, or what a random object draws
    #[arg(long, value_enum)]
    pub(crate) scene: Option<SynthScene>,
    /// Training views per state; 64, in a room 90 frames
    #[arg(long, value_name = "N")]
    pub(crate) views: Option<usize>,
    /// Held-out views per state; 16, in a room none
    #[arg(long, value_name = "N")]
    pub(crate) test_views: Option<usize>,
    /// Width of the images, pixels; 400, in a room 640 or, with lidar, 720. The height is the same, in a room three quarters
    /// of it
    #[arg(long, value_name = "PX")]
    pub(crate) size: Option<u32>,
    /// How the capture is degraded; may be repeated. One of depth=SIGMA (noise at distance 1, grows with its
    /// square), edges=on|DEG (no depth where surfaces are grazed), gloss=FRACTION (no depth on glossy patches),
    /// pose=DEG,LENGTH (jitter of the stated cameras), misalign=DEG,LENGTH (of the end state against the start),
    /// front=on (cameras only in front), light=camera, no-depth
    #[arg(long, value_name = "NAME=VALUE")]
    pub(crate) noise: Vec<String>,
    /// The device in a room; its noise was measured on recordings; lidar if absent. For a random object also exact (masks and
    /// exact depth) or room (a room with a device that is drawn); drawn if absent
    #[arg(long, value_enum)]
    pub(crate) sensor: Option<SynthSensor>,
    /// How the device moves in a room; handheld (around the front at two heights) if absent
    #[arg(long, value_enum)]
    pub(crate) path: Option<SynthPath>,
    /// Drift of the poses that the device states in a room, such as 0.01,0.4
    #[arg(long, value_name = "METRES,DEGREES", value_parser = Drift::parse)]
    pub(crate) drift: Option<Drift>,
    /// In a room, the end state has a world frame of its own
    #[arg(long)]
    pub(crate) own_frames: bool,
    /// In a room, a box beside the object moves between the states
    #[arg(long)]
    pub(crate) bystander: bool,
    /// Seed of placement, textures and degradations
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// How the files are laid out: artgs or paris; in a room a format of recordings. If absent, artgs or, in a room,
    /// scanner-app
    #[arg(long, value_enum)]
    pub(crate) layout: Option<SynthLayout>,
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
pub(crate) enum SynthScene {
    /// Nothing around the object
    Studio,
    /// A furnished room
    Room,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SynthSensor {
    /// Structured light, first Kinect
    Kinect,
    /// Structured light, Asus Xtion
    Xtion,
    /// Active stereo, RealSense D435
    D435,
    /// LiDAR of a phone
    Lidar,
    /// Random objects: no device, but masks and exact depth
    Exact,
    /// Random objects: a room with a device that is drawn
    Room,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SynthPath {
    /// A walk around the front at two heights
    Handheld,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SynthLayout {
    /// transforms_{train,test}_{start,end}.json
    Artgs,
    /// {start,end}/camera_{train,test}.json
    Paris,
    /// Room: 3D Scanner App, "All Data"
    ScannerApp,
    /// Room: Record3D
    Record3d,
    /// Room: Polycam raw data
    Polycam,
    /// Room: nerfstudio
    Nerfstudio,
    /// Room: TUM RGB-D
    Tum,
    /// Room: COLMAP
    Colmap,
}

fn parts(text: &str) -> Result<PartCount, String> {
    let count: PartCount = text.parse().map_err(|e: PartCountError| e.to_string())?;
    count.check().map(|()| count).map_err(String::from)
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
