//! Procedural articulated objects, photographed in two states with everything known about them: for benchmarks,
//! tests and the demo, and for trying the program without a camera.
//!
//! [`objects`] lists them, [`write_object`] makes a capture folder of one, [`photograph`] keeps it in memory.
//! [`cabinet`] is the small fixture of the tests and of `artgs demo`.

pub mod cabinet;
mod camera;
mod catalog;
mod degrade;
mod light;
mod material;
mod object;
mod photo;
pub mod shape;
#[cfg(test)]
mod tests;
mod trace;
mod write;

pub use catalog::{ObjectInfo, SUITES, object, objects, suite};
pub use degrade::{DEGRADATIONS, Degradation};
pub use material::Material;
pub use object::{Object, Part, Piece};
pub use photo::{PhotoOptions, photograph};
pub use shape::Solid;
pub use write::{Layout, Made, made, write_object};

/// A reason why no capture was made.
#[derive(Debug, thiserror::Error)]
pub enum SynthError {
    /// The options ask for something impossible.
    #[error("capture options: {0}")]
    Options(&'static str),
    /// There is no object of this name.
    #[error("there is no object `{name}`; there are {}", known.join(", "))]
    Unknown {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<&'static str>,
    },
    /// A file could not be written.
    #[error(transparent)]
    File(#[from] artgs_io::FileError),
}
