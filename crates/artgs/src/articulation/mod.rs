//! Which Gaussian belongs to which part, and how the parts move.

pub(crate) mod adam;
pub mod assign;
pub mod assignment;
mod block;
mod encoder;
#[cfg(test)]
mod encoder_testing;
pub mod hash_grid;
pub mod joints;
pub mod mlp;
pub mod mlp_assign;
mod quaternion;
pub mod slot_assign;
mod slot_cell;
pub mod warp;

pub use assign::{AssignConfig, AssignKind, AssignState, PartAssignment, SlotConfig};
pub use assignment::Assignment;
pub use hash_grid::{GridTable, HashGrid, HashGridConfig};
pub use joints::{MotionModel, MotionParameters};
pub use mlp_assign::MlpAssignment;
pub use slot_assign::SlotAssignment;
pub use warp::{DualQuaternion, Skin, Warp, WarpGradients, WarpInput};

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// A standard normal variate (Box and Muller).
pub(crate) fn normal(rng: &mut Pcg64Mcg) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}
