//! Pixels and gradients: renders Gaussians into colour, depth and alpha, and carries image gradients back.

mod rasterizer;
pub mod reference;
pub mod types;

pub use rasterizer::Rasterizer;
pub use types::{Colors, Frame, FrameGrad, RenderOptions, ShFrames, SplatGrads, SplatView};
