//! Assets as files of simulators, browsers and renderers: [`Format`] lists them, one module writes each.

pub mod check;
mod format;
pub mod glb;
mod meshes;
pub mod mjcf;
pub mod obj;
pub mod partnet;
mod provenance;
mod scene;
pub mod sdf;
pub mod splats;
pub mod spz;
pub mod urdf;
#[cfg(feature = "usd")]
pub mod usd;
mod values;
mod xml;

#[cfg(test)]
pub(crate) mod testing;

pub use check::check_asset;
pub use format::{Actuators, Format, Frames, UnknownFormat, WriteOptions};
pub use mjcf::export_mjcf;
pub use partnet::export_partnet;
pub use provenance::Provenance;
pub use scene::{SCENE, is_scene};
pub use sdf::export_sdf;
pub use spz::SpzVersion;
pub use urdf::export_urdf;
