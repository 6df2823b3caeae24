//! Motions of parts: their parameters ([`joints`]), and Gaussians moved by them ([`warp`]), with gradients.

pub(crate) mod joints;
pub(crate) mod quaternion;
pub(crate) mod warp;

pub use joints::{MotionModel, MotionParameters};
pub use warp::{DualQuaternion, Skin, Warp, WarpGradients, WarpInput};
