//! Adds what simulators need to a replica: closed meshes, textures, convex hulls, masses, joint limits.

mod assemble;
mod build;
pub mod collision;
mod describe;
mod dynamics;
pub mod export;
pub mod geometry;
mod limits;
pub mod looks;
mod mass;
pub mod settings;
mod step;

pub use settings::{Collision, Front, GivenClass, PhysicalConfig, Up};
