//! Adds what simulators need to a replica: closed meshes, textures, convex hulls, masses, joint limits.

pub mod assemble;
pub mod bake;
pub mod build;
pub mod clearance;
mod coacd;
pub mod config;
pub mod decompose;
pub mod export;
pub mod hull;
pub mod looks;
pub mod mass;
pub mod repair;
pub mod shade;
pub mod simplify;
pub mod stance;
mod topology;
pub mod unwrap;

pub use assemble::{Decisions, assemble};
pub use build::{BuiltAsset, Parts, build};
pub use config::{Collision, PhysicalConfig, Up};
pub use looks::PartSurface;
