//! Inputs and outputs of the rasteriser.

use crate::limits::{BLUR, NEAR};
use artgs_core::Splats;

/// Rotates viewing directions before the harmonics are evaluated, so that the colours of a part turn with the part.
#[derive(Clone, Copy, Debug)]
pub struct ShFrames<'a> {
    /// Frame of each Gaussian, `[n]`, index into `world_to_frame`.
    pub index: &'a [u16],
    /// Rotation matrices, row-major, taking world directions into each frame. No gradient flows to them.
    pub world_to_frame: &'a [[[f32; 3]; 3]],
}

/// Colours of Gaussians.
#[derive(Clone, Copy, Debug)]
pub enum Colors<'a> {
    /// Spherical harmonics.
    Sh {
        /// Coefficients, `[n][(degree + 1)^2][3]`.
        sh: &'a [f32],
        /// Stored degree.
        degree: usize,
        /// Optional rotation of the viewing direction.
        frames: Option<ShFrames<'a>>,
    },
    /// One fixed colour per Gaussian, `[n][3]`, any range (labels, features). Has no gradient.
    Fixed(&'a [[f32; 3]]),
}

/// Borrowed Gaussians in raw parameters, world frame; see [`Splats`] for the meaning of each field.
#[derive(Clone, Copy, Debug)]
pub struct SplatView<'a> {
    /// Centres, `[n][3]`.
    pub means: &'a [[f32; 3]],
    /// Quaternions (w, x, y, z), normalised by the rasteriser.
    pub rotations: &'a [[f32; 4]],
    /// Log standard deviations.
    pub log_scales: &'a [[f32; 3]],
    /// Logit opacities.
    pub logit_opacities: &'a [f32],
    /// Colours.
    pub colors: Colors<'a>,
}

impl<'a> From<&'a Splats> for SplatView<'a> {
    fn from(s: &'a Splats) -> Self {
        Self {
            means: &s.means,
            rotations: &s.rotations,
            log_scales: &s.log_scales,
            logit_opacities: &s.logit_opacities,
            colors: Colors::Sh { sh: &s.sh, degree: s.sh_degree, frames: None },
        }
    }
}

/// Settings of one rendering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// Degree of harmonics evaluated, at most the stored one.
    pub sh_degree: usize,
    /// Colour behind the Gaussians.
    pub background: [f32; 3],
    /// Gaussians nearer than this view depth (scene units) are dropped.
    pub near: f32,
    /// Added to the diagonal of the projected covariance, square pixels (3DGS: 0.3).
    pub blur: f32,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self { sh_degree: 3, background: [0.0; 3], near: NEAR, blur: BLUR }
    }
}

/// A rendering: planar, row-major.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Colour over the background, planes r, g, b: `[3][height * width]`.
    pub rgb: Vec<f32>,
    /// Accumulated depth, sum of weight times view depth of the centre, not divided by alpha: `[height * width]`.
    pub depth: Vec<f32>,
    /// Sum of weights: `[height * width]`.
    pub alpha: Vec<f32>,
}

/// Gradient of a loss with respect to a [`Frame`], same layout.
#[derive(Clone, Debug, Default)]
pub struct FrameGrad {
    /// With respect to colour, `[3][height * width]`.
    pub rgb: Vec<f32>,
    /// With respect to accumulated depth.
    pub depth: Vec<f32>,
    /// With respect to alpha.
    pub alpha: Vec<f32>,
}

/// Gradients with respect to the raw parameters of every Gaussian; overwritten by each backward pass.
#[derive(Clone, Debug, Default)]
pub struct SplatGrads {
    /// World-space centres.
    pub means: Vec<[f32; 3]>,
    /// Raw quaternions (through their normalisation).
    pub rotations: Vec<[f32; 4]>,
    /// Log scales.
    pub log_scales: Vec<[f32; 3]>,
    /// Logit opacities.
    pub logit_opacities: Vec<f32>,
    /// Harmonics, `[n][(stored degree + 1)^2][3]`; zero beyond the active degree; empty for fixed colours.
    pub sh: Vec<f32>,
    /// Length of the gradient with respect to the projected centre in normalised device units
    /// (pixel gradient times half the image size), the densification statistic of 3DGS; 0 where not drawn.
    pub mean2d: Vec<f32>,
    /// Radius of the drawn footprint in pixels (3 standard deviations, rounded up); 0 where not drawn.
    pub radii: Vec<f32>,
}
