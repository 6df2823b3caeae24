//! Training images on the device: four bytes of colour and alpha, two of depth per pixel.

use crate::kernels::Kernels;
use crate::scene::{Gaussians, ImageBuffers, Program, Size, StepBuffers};
use crate::step::Step;
use crate::{Gpu, GpuError};
use artgs::fit::{LossConfig, Rect, TrainConfig, TrainImage};
use artgs_core::{Camera, State};
use wgpu::Buffer;

/// A training image.
#[derive(Debug)]
pub(crate) struct DeviceImage {
    pub(crate) state: State,
    pub(crate) size: [usize; 2],
    camera: Camera,
    object: Rect,
    without_depth: usize,
    depth_per_unit: Option<f32>,
    image: Buffer,
    measured: Buffer,
}

impl DeviceImage {
    pub(crate) fn new(gpu: &Gpu, image: &TrainImage<'_>) -> Result<Self, GpuError> {
        let measured = image.depth.as_deref().map_or(&[][..], artgs_core::DepthMap::counts);
        Ok(Self {
            state: image.state,
            size: [image.width, image.height],
            camera: image.camera,
            object: image.object,
            without_depth: image.without_depth,
            depth_per_unit: image.depth.as_deref().map(artgs_core::DepthMap::per_unit),
            image: gpu.array_of("image", &image.rgba)?,
            measured: gpu.array_of("depth of an image", measured)?,
        })
    }

    /// A step on this image, with the fields that depend on the image.
    pub(crate) fn step(&self, config: &TrainConfig, loss: &LossConfig, background: [f32; 3]) -> Step {
        let blur = artgs_raster::RenderOptions::default().blur;
        let mut step = Step::view(&self.camera, config.near, blur);
        let rect = self.rect(loss);
        step.background = background;
        step.rect = if rect.is_empty() { [0; 4] } else { [rect.x0, rect.y0, rect.x1, rect.y1].map(|v| v as u32) };
        step.pose = self.state.index() as u32;
        step.losses(loss, config.depth_unit, self.depth_per_unit, self.without_depth);
        step
    }

    /// The pixels on which windows of structural similarity are centred.
    fn rect(&self, loss: &LossConfig) -> Rect {
        let [w, h] = self.size;
        if loss.crop_ssim { self.object.grown(16, w, h) } else { Rect::full(w, h) }
    }

    /// Number of windows of structural similarity in a channel.
    pub(crate) fn windows(&self, loss: &LossConfig) -> usize {
        let rect = self.rect(loss);
        if rect.is_empty() { 0 } else { rect.area() }
    }

    /// Number of pixels the depth term is averaged over.
    pub(crate) fn depth_pixels(&self, loss: &LossConfig) -> usize {
        let [w, h] = self.size;
        match loss.depth_mode {
            artgs::fit::DepthMode::Accumulated => (w * h - self.without_depth).max(1),
            artgs::fit::DepthMode::Normalized => w * h,
        }
    }

    /// Computes the loss of the frame and its gradient.
    pub(crate) fn compare(
        &self,
        gpu: &Gpu,
        k: &Kernels,
        g: &Gaussians,
        image_buffers: &ImageBuffers,
        step_buffers: &StepBuffers,
    ) -> Program {
        let slope =
            [&step_buffers.steps, &self.image, &image_buffers.frame, &image_buffers.slopes, &image_buffers.window_sums];
        let compare = [
            &step_buffers.steps,
            &self.image,
            &self.measured,
            &image_buffers.frame,
            &image_buffers.frame_depth,
            &image_buffers.slopes,
            &image_buffers.d_frame,
            &image_buffers.remainders,
            &image_buffers.pixel_sums,
        ];
        let collect = [
            &step_buffers.steps,
            &g.params,
            &image_buffers.pixel_sums,
            &image_buffers.window_sums,
            &step_buffers.control,
            &step_buffers.results,
        ];
        vec![
            (k.slope.on(gpu, &slope), Size::Windows),
            (k.compare.on(gpu, &compare), Size::Tiles),
            (k.collect.on(gpu, &collect), Size::Count(1)),
        ]
    }
}
