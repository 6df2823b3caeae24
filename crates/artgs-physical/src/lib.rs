//! What a capture does not tell and simulators need: closed meshes, textures, convex hulls, masses, joint limits.

pub mod bake;
pub mod repair;
pub mod shade;
pub mod simplify;
mod topology;
pub mod unwrap;
