//! Building blocks of the method for sister crates, benchmarks, tests and experiments. They change without notice; the
//! stable calls are [`crate::Reconstruction`] and the other modules.

pub use crate::articulation::*;
pub use crate::fit::adam::adam;
pub use crate::fit::deform::DeformWorkspace;
pub use crate::fit::loss::{MIN_VALID_DEPTHS, opacity_entropy};
pub use crate::fit::ssim::Ssim;
pub use crate::published::assignment::hash_grid::FEATURES;
pub use crate::published::assignment::mlp::{LANES, Mlp};
pub use crate::published::canonical::cluster::{ClusterConfig, radius_components, spectral_clusters};
pub use crate::published::canonical::fps::farthest_points;
pub use crate::published::canonical::matching::match_points;
pub use crate::published::canonical::motion::analyse;
pub use crate::published::*;

/// Numbers that the CPU code and the GPU kernels share.
pub mod kernel_constants {
    pub use crate::kernel_constants::*;
}
