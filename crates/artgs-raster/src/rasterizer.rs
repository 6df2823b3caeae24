//! The rasteriser: its workspaces and the order of its passes.

use crate::{Frame, FrameGrad, RenderOptions, SplatGrads, SplatView, reference};
use artgs_core::Camera;

/// Renders Gaussians and carries gradients back, reusing its workspaces from call to call.
#[derive(Debug, Default)]
pub struct Rasterizer {
    frame: Frame,
}

impl Rasterizer {
    /// A rasteriser with empty workspaces.
    pub fn new() -> Self {
        Self::default()
    }

    /// Renders the Gaussians as the camera sees them.
    pub fn forward(&mut self, splats: SplatView<'_>, camera: &Camera, options: &RenderOptions) -> &Frame {
        self.frame = reference::render(splats, camera, options);
        &self.frame
    }

    /// The last rendering.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// Carries the gradient of a loss with respect to the last rendering to every parameter, overwriting `grads`.
    /// Must follow a [`forward`](Self::forward) with the same arguments.
    pub fn backward(
        &mut self,
        splats: SplatView<'_>,
        camera: &Camera,
        options: &RenderOptions,
        d_frame: &FrameGrad,
        grads: &mut SplatGrads,
    ) {
        *grads = reference::gradients(splats, camera, options, d_frame);
    }
}
