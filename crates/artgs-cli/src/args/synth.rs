//! Arguments of `artgs synth`.

use artgs_synth::recording::Drift;
use clap::{Args, ValueEnum};
use std::num::NonZeroUsize;
use std::path::PathBuf;

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
    /// Nothing of a random object moves: all states are as the start
    #[arg(long)]
    pub(crate) still: bool,
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
    #[arg(long, value_name = "N", value_parser = crate::args::count)]
    pub(crate) threads: Option<NonZeroUsize>,
    /// Write JSON, one line per object
    #[arg(long)]
    pub(super) json: bool,
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
