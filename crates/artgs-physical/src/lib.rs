//! What a capture does not tell and simulators need: closed meshes, textures, convex hulls, masses, joint limits.

pub mod assemble;
pub mod bake;
pub mod clearance;
pub mod config;
pub mod decompose;
pub mod hull;
pub mod mass;
pub mod repair;
pub mod shade;
pub mod simplify;
pub mod stance;
mod topology;
pub mod unwrap;

pub use assemble::{Decisions, PartSurface, assemble};
pub use config::{Collision, PhysicalConfig, Up};
