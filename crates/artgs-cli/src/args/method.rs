//! Arguments of reconstructions: input, method, devices, limits.

use artgs::fit::DeviceChoice;
use artgs::{PartCount, PartCountError};
use bytesize::ByteSize;
use clap::{Args, ValueEnum};
use std::num::NonZeroUsize;
use std::path::PathBuf;

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
    #[arg(long, value_name = "SIZE", value_parser = crate::args::size)]
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
    pub(super) json: bool,
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
    /// Number of the first frame that --every uses, of each recording; with two numbers one recording is both states
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
    #[arg(long, value_name = "N", value_parser = crate::args::count)]
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

impl From<Earlier> for artgs::run::Earlier {
    fn from(Earlier { resume, force }: Earlier) -> Self {
        match (resume, force) {
            (true, _) => Self::Resume,
            (_, true) => Self::Discard,
            _ => Self::Refuse,
        }
    }
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
    pub(super) json: bool,
}

fn parts(text: &str) -> Result<PartCount, String> {
    let count: PartCount = text.parse().map_err(|e: PartCountError| e.to_string())?;
    count.check().map(|()| count).map_err(String::from)
}
