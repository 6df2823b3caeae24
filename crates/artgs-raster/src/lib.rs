//! Pixels and gradients: renders Gaussians into colour, depth and alpha, and carries image gradients back.

pub mod types;

pub use types::{Colors, Frame, FrameGrad, RenderOptions, ShFrames, SplatGrads, SplatView};
