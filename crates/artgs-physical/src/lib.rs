//! Adds what simulators need to a replica: closed meshes, textures, convex hulls, masses, joint limits.

mod apart;
mod assemble;
pub mod bake;
mod build;
mod clearance;
mod coacd;
mod config;
mod convert;
pub mod decompose;
mod describe;
pub mod export;
mod flush;
mod fused;
mod hull;
mod islands;
pub mod looks;
mod mass;
mod motions;
mod passage;
mod portrait;
mod redundant;
mod repair;
mod semantics;
mod shade;
mod simplify;
mod spread;
mod stance;
mod sweep;
mod topology;
mod unwrap;

pub use config::{Collision, Front, GivenClass, PhysicalConfig, Up};
