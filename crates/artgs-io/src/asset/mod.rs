//! Exports of assets for simulators, browsers and renderers; one module per format.

pub mod check;
pub mod glb;
mod meshes;
pub mod mjcf;
pub mod obj;
pub mod partnet;
pub mod sdf;
pub mod splats;
pub mod spz;
pub mod urdf;
pub mod usd;
mod values;
mod xml;

#[cfg(test)]
pub(crate) mod testing;

pub use check::check_asset;
pub use mjcf::export_mjcf;
pub use partnet::export_partnet;
pub use sdf::export_sdf;
pub use urdf::export_urdf;
