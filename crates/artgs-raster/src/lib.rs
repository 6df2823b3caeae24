//! Pixels and gradients: renders Gaussians into colour, depth and alpha, and carries image gradients back.

mod bin;
mod blend;
mod gather;
mod moved;
mod project;
mod rasterizer;
pub mod reference;
mod sh;
pub mod simd;
mod sort;
pub mod types;

pub use moved::moved;
pub use rasterizer::{PassSeconds, Rasterizer};
pub use types::{Colors, Frame, FrameGrad, RenderOptions, ShFrames, SplatGrads, SplatView};
