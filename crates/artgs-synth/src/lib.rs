//! Procedural articulated objects, rendered in two states with ground truth: for benchmarks, tests and the demo, and to try
//! the program without a camera.
//!
//! [`objects`] lists them, [`write_object`] writes a capture folder of one, [`render_capture`] keeps it in memory.
//! [`population`] draws random objects by seed.
//! [`recording`] simulates what people record: the object in a room, with the errors of a device.
//! [`cabinet`] is the small fixture of the tests and of `artgs demo`.

pub mod cabinet;
mod camera;
mod catalog;
mod degrade;
mod light;
mod material;
mod object;
pub mod population;
pub mod recording;
mod render;
mod replace;
mod shape;
pub mod target;
#[cfg(test)]
mod tests;
mod trace;
mod visible;
mod write;

pub use catalog::{ObjectInfo, SUITES, object, objects, suite};
pub use degrade::Degradation;
pub use object::Object;
pub use recording::{RecordingCaptureOptions, RecordingTruth, render_recording};
pub use render::{Arc, CaptureOptions, render_capture};
pub use write::{CaptureInfo, Layout, capture_info, write_object};

use material::Material;
use object::Part;
use shape::Solid;

/// Why a capture was not rendered or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SynthError {
    /// The options are invalid.
    #[error("capture options: {0}")]
    Options(&'static str),
    /// There is no object of this name.
    #[error("there is no object `{name}`; there are {}", known.join(", "))]
    Unknown {
        /// The requested name.
        name: String,
        /// Names of all objects.
        known: Vec<&'static str>,
    },
    /// A file in the folder of a capture is not one of the capture that was written there before.
    #[error("{}: not written by artgs synth; move it away, or give another folder to -o", _0.display())]
    InTheWay(std::path::PathBuf),
    /// A file could not be written.
    #[error(transparent)]
    File(#[from] artgs_io::FileError),
    /// A recording could not be written.
    #[error(transparent)]
    Recording(#[from] artgs_io::recording::RecordingError),
}
