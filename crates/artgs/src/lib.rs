//! Two captures of an articulated object, one per state, to a replica: rigid parts, joints, Gaussians and meshes.
//!
//! A [`Request`] names the input: a folder of images, the recordings of two states, or images in memory. [`Request::prepare`] reads, checks
//! and aligns it, and a [`Reconstruction`] runs the stages on what is [`Prepared`], in a folder that can be resumed
//! ([`Reconstruction::run`]) or in memory ([`Reconstruction::compute`]):
//!
//! ```
//! use artgs::prelude::*;
//! use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};
//!
//! // Here a rendered cabinet with a door and a drawer; `Input::new(&["closed", "open"])` are files.
//! let options = CabinetOptions { views: 20, test_views: 0, size: 96, ..CabinetOptions::default() };
//! let (capture, _ground_truth) = cabinet_capture(&options)?;
//!
//! // Fewer steps and larger voxels than the default, so that this takes seconds.
//! let mut config = Config { parts: 3.into(), ..Config::default() };
//! config.articulate.steps = 20;
//! config.surface.resolution = 60.0;
//! let request = Request { config, ..Request::new(Input::Images(capture)) };
//! let prepared = request.prepare(&mut NullObserver)?;
//! let made = Reconstruction::new(&prepared).compute(&mut NullObserver)?;
//!
//! let kind = |part| made.replica.joint(part).map(|joint| joint.kind);
//! assert!([kind(1), kind(2)].contains(&Some(JointKind::Revolute)));
//! // The mesh of every part with both joints half way, world frame.
//! let half = |part| made.replica.joint(part).map_or(0.0, |joint| 0.5 * joint.limits[1]);
//! let posed = made.posed_meshes(&[0.0, half(1), half(2)]);
//! // Saved and read back, it is the same.
//! let folder = tempfile::tempdir()?;
//! made.save(&artgs_io::RunFolder::new(folder.path()))?;
//! let saved = artgs::load(folder.path())?;
//! assert_eq!(saved.posed_meshes(&[0.0, half(1), half(2)])[1].vertices, posed[1].vertices);
//! assert_eq!(saved.part_splats(1).map(|s| s.len()), made.part_splats(1).map(|s| s.len()));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # The parts of the method alone
//!
//! | step | call | result |
//! |---|---|---|
//! | discovery | [`Reconstruction::find_parts`] | parts, joints and labelled surface points |
//! | training | [`Reconstruction::train`] | Gaussians on found parts |
//! | fusion | [`Reconstruction::fuse`] | meshes of found parts |
//! | scores | [`run::evaluate`], [`evaluate`] | errors against a ground truth |
//!
//! All settings are in [`Config`]; [`observer`] reports progress. Errors are [`Error`], which says whether the user has to
//! change something. The examples of this crate show own images as a capture, an own observer, joints only, meshes at any
//! joint value, and the Gaussians of one part.

pub mod ablation;
pub mod align;
mod articulation;
pub mod config;
mod connected;
pub mod consistency;
pub mod discover;
pub mod evaluate;
pub mod explain;
pub mod fit;
mod hungarian;
mod kernel_constants;
#[doc(hidden)]
pub mod low_level;
mod neighbours;
pub mod observer;
mod part_count;
pub mod prepare;
mod published;
mod random;
mod registration;
pub mod run;
pub mod settings;
mod shorten;
mod start;
pub mod surface;
mod trimmed;

pub use config::Config;
pub use part_count::{PartCount, PartCountError};
pub use prepare::{Input, Prepared, Request};
pub use run::{Error, Reconstructed, Reconstruction, SavedReplica, Summary, load};

/// What most programs need: `use artgs::prelude::*;`.
pub mod prelude {
    pub use crate::fit::DeviceChoice;
    pub use crate::observer::{Event, NullObserver, Observer};
    pub use crate::run::{Earlier, RunOptions};
    pub use crate::{Config, Error, Input, PartCount, Prepared, Reconstructed, Reconstruction, Request, SavedReplica};
    pub use artgs_core::{
        Camera, Capture, DepthMap, Intrinsics, Joint, JointKind, Mesh, PerState, Replica, Rigid, State, View,
    };
}
