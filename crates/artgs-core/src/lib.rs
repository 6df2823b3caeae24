//! Data types and basic geometry shared by all other crates. No files, threads or random numbers.
//!
//! Frames, units and orders are fixed in `CONVENTIONS.md` at the root of the repository.

mod asset;
mod camera;
pub mod capture;
mod depth;
mod inside;
mod joint;
mod mesh;
pub mod random;
pub mod recording;
pub mod replica;
mod rigid;
mod semantics;
mod splats;
pub mod state;
mod world;

pub use asset::{
    Asset, AssetJoint, AssetLink, ContactMaterial, FaceEvidence, Inertial, Texture, TexturedMesh, odd_size,
};
pub use camera::{Camera, Intrinsics};
pub use capture::{Capture, StateViews, View};
pub use depth::DepthMap;
pub use inside::Inside;
pub use joint::{Joint, JointAlternative, JointEstimate, JointInterval, JointKind};
pub use mesh::Mesh;
pub use recording::{RecordedFrame, Recording};
pub use replica::{Alternative, Replica, ReplicaError};
pub use rigid::Rigid;
pub use semantics::{Handle, HingeSide, PartClass, PartSemantics};
pub use splats::Splats;
pub use state::{PerState, State};
pub use world::{FrameError, UpSource, Upward};
