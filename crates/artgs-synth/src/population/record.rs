//! How an object of the population is recorded.

use super::dice::Dice;
use crate::recording::{Drift, RecordingCaptureOptions, Sensor, WorldAxes};
use crate::{Arc, CaptureOptions};
use artgs_io::recording::RecordingFormat;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Views per state and their weights.
const VIEWS: [(usize, f64); 7] = [(16, 0.08), (24, 0.12), (32, 0.15), (48, 0.25), (64, 0.2), (90, 0.12), (120, 0.08)];
/// Recordings in rooms, as videos, have at least this many frames.
const FRAMES: usize = 32;
/// Probability that a capture is exact where the device is drawn.
const EXACT: f64 = 0.5;
/// Width of images, pixels. Those of exact captures are square, those of rooms 320 x 240, where LiDAR has its own 256 x 192 pixels.
const SIZE: u32 = 320;

/// What records an object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Device {
    /// Drawn by the seed: one half exact captures, one half recordings of rooms.
    #[default]
    Any,
    /// Exact depth and masks.
    Exact,
    /// A room, recorded with a device that the seed draws.
    Room,
    /// A room, recorded with this device.
    Sensor(Sensor),
}

/// What is asked for; everything else is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RandomOptions {
    /// What records the object.
    pub device: Device,
    /// Width of the images, pixels; 320 if absent.
    pub size: Option<u32>,
    /// Held-out views per state of exact captures.
    pub test_views: usize,
    /// Number of states; 2 if absent.
    pub states: Option<usize>,
    /// Nothing moves.
    pub still: bool,
}

/// How an object is recorded.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RandomCapture {
    /// Exact depth and masks.
    Exact(CaptureOptions),
    /// Recordings in a room.
    Room {
        /// How they are simulated.
        options: RecordingCaptureOptions,
        /// Name of the format of their files.
        format: RoomFormat,
    },
}

/// Formats of recordings in rooms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RoomFormat {
    /// 3D Scanner App.
    ScannerApp,
    /// Record3D.
    Record3d,
    /// Polycam raw data.
    Polycam,
    /// TUM RGB-D.
    Tum,
    /// nerfstudio.
    Nerfstudio,
    /// COLMAP.
    Colmap,
}

impl RoomFormat {
    pub(super) fn format(self) -> RecordingFormat {
        match self {
            Self::ScannerApp => RecordingFormat::ScannerApp,
            Self::Record3d => RecordingFormat::Record3d,
            Self::Polycam => RecordingFormat::Polycam,
            Self::Tum => RecordingFormat::Tum,
            Self::Nerfstudio => RecordingFormat::Nerfstudio,
            Self::Colmap => RecordingFormat::Colmap,
        }
    }
}

impl RandomCapture {
    /// `exact`, or the device of the room.
    pub fn sensor(&self) -> &'static str {
        match self {
            Self::Exact(_) => "exact",
            Self::Room { options, .. } => options.sensor.name(),
        }
    }
}

/// Draws how the object of a seed is recorded, and the features of that. What is drawn does not depend on the object.
pub fn random_capture(seed: u64, options: &RandomOptions) -> (RandomCapture, BTreeSet<&'static str>) {
    let mut dice = Dice::new(seed.wrapping_mul(0xd134_2543_de82_ef95) ^ 0x7265_636f_7264);
    let exact = dice.chance(EXACT);
    let drawn = dice.pick(&[Sensor::Lidar, Sensor::Kinect, Sensor::Xtion, Sensor::D435]);
    let sensor = match options.device {
        Device::Any if exact => None,
        Device::Exact => None,
        Device::Any | Device::Room => Some(drawn),
        Device::Sensor(sensor) => Some(sensor),
    };
    let views = dice.weighted(&VIEWS);
    let arc = dice.weighted(&[(Arc::Full, 0.45), (Arc::Half, 0.35), (Arc::Above, 0.2)]);
    let mut features = BTreeSet::new();
    let capture = match sensor {
        None => {
            features.insert(match arc {
                Arc::Full => "full-circle",
                Arc::Half => "half-circle",
                Arc::Above => "from-above",
            });
            let mut capture = CaptureOptions {
                views,
                test_views: options.test_views,
                size: options.size.unwrap_or(SIZE),
                seed,
                arc,
                ..CaptureOptions::default()
            };
            capture.degradation.camera_light = dice.chance(0.3);
            RandomCapture::Exact(capture)
        }
        Some(sensor) => room(seed, sensor, views.max(FRAMES), options.size, &mut dice, &mut features),
    };
    let views = match &capture {
        RandomCapture::Exact(options) => options.views,
        RandomCapture::Room { options, .. } => options.views,
    };
    match views {
        0..=32 => features.insert("views-few"),
        33..=64 => false,
        _ => features.insert("views-many"),
    };
    (capture, features)
}

fn room(
    seed: u64,
    sensor: Sensor,
    views: usize,
    size: Option<u32>,
    dice: &mut Dice,
    features: &mut BTreeSet<&'static str>,
) -> RandomCapture {
    let format = match sensor {
        Sensor::Lidar => {
            dice.weighted(&[(RoomFormat::ScannerApp, 0.4), (RoomFormat::Record3d, 0.3), (RoomFormat::Polycam, 0.3)])
        }
        _ => dice.weighted(&[(RoomFormat::Tum, 0.5), (RoomFormat::Nerfstudio, 0.3), (RoomFormat::Colmap, 0.2)]),
    };
    let drift = match dice.chance(0.75) {
        true => Drift { metres: dice.within([0.003, 0.02]), degrees: dice.within([0.1, 0.8]) },
        false => Drift::default(),
    };
    let (own_frames, bystander) = (dice.chance(0.7), dice.chance(0.1));
    for (is, feature) in [(drift != Drift::default(), "drift"), (own_frames, "own-frames"), (bystander, "bystander")] {
        if is {
            features.insert(feature);
        }
    }
    let options = RecordingCaptureOptions {
        views,
        width: size.unwrap_or(SIZE),
        sensor,
        drift,
        own_frames,
        world: WorldAxes::of(format.format()),
        fixed_focus: format == RoomFormat::Tum,
        bystander,
        seed,
    };
    RandomCapture::Room { options, format }
}
