//! What a capture does not tell and simulators need: closed meshes, textures, convex hulls, masses, joint limits.


pub mod repair;

pub mod simplify;
mod topology;

