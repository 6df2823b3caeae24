//! A differentiable Gaussian rasteriser on the CPU: renders colour, depth and alpha, and computes the gradients of the
//! Gaussians from those of the image.

mod bin;
mod blend;
mod gather;
mod limits;
mod moved;
mod project;
mod rasterizer;
#[cfg(feature = "scalar")]
pub mod reference;
mod sh;
pub mod simd;
mod sort;
mod types;

/// Numbers that other implementations of the same rendering need; they may change with every version.
pub mod low_level {
    pub use crate::limits::{
        ALPHA_MAX, BLUR, LOG2_CUT, NEAR, QUATERNION_MIN, RADIUS_DEVIATIONS, RADIUS_SPREAD_MIN, SLACK, SLACK_PIXELS,
        TILE, TRAINING_NEAR, TRANSMITTANCE_MIN, jacobian_limits,
    };
    pub use crate::sh::{C0 as SH_C0, C1 as SH_C1, C2 as SH_C2, C3 as SH_C3};
}

pub use moved::moved;
pub use rasterizer::{PassSeconds, Rasterizer};
pub use types::{Colors, Frame, FrameGrad, RenderOptions, ShFrames, SplatGrads, SplatView};
