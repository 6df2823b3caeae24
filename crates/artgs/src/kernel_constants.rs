//! Numbers of training that the kernels of other devices need; they may change with every version.

use crate::articulation::adam;
use crate::articulation::model::warp;
use crate::fit::{loss, ssim};
use crate::published::assignment::{centres, hash_grid};

/// Decay of the first and second moment of motions and membership.
pub const ADAM_BETA: [f64; 2] = adam::BETA;
/// Added to the root of the second moment of motions and membership.
pub const ADAM_EPSILON: f64 = adam::EPSILON;
/// Numbers per part of a learned assignment: centre, log scales, quaternion.
pub const ASSIGN_FRAME: usize = centres::FRAME;
/// Added to the total opacity of a part before it is divided by.
pub const OPACITY_FLOOR: f64 = centres::OPACITY_FLOOR;
/// Features per level of the hash grid.
pub const HASH_FEATURES: usize = hash_grid::FEATURES;
/// Factors of the second and third coordinate in the hash of a grid point.
pub const HASH_PRIMES: [u32; 2] = hash_grid::PRIMES;
/// Moments of the hash grid below this are set to 0.
pub const HASH_FLUSH: f32 = hash_grid::FLUSH;
/// Gradients of the hash grid below this count as 0.
pub const HASH_NEGLIGIBLE: f32 = hash_grid::NEGLIGIBLE;
/// Least length of a sum of weighted motions that is divided by it.
pub const MOTION_LENGTH_MIN: f64 = warp::LENGTH_MIN;
/// Least alpha of an image, of 255, where its depth is that of the object.
pub const COVERED: u8 = artgs_core::capture::OBJECT_ALPHA;
/// Least alpha of a rendering by which its depth is divided.
pub const MIN_ALPHA: f32 = loss::MIN_ALPHA;
/// Constants of structural similarity.
pub const SSIM_C1: f32 = ssim::C1;
/// See [`SSIM_C1`].
pub const SSIM_C2: f32 = ssim::C2;
/// Weights of the window of structural similarity along one axis.
pub const SSIM_TAPS: usize = ssim::TAPS;

/// The window of structural similarity along one axis, sum 1.
pub fn ssim_window() -> [f32; SSIM_TAPS] {
    ssim::window()
}
