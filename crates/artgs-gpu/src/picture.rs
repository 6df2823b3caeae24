//! Photographs on the device: four bytes of colour and alpha, two of depth per pixel.

use crate::kernels::Kernels;
use crate::scene::{Canvas, Desk, Gaussians, Program, Size};
use crate::step::Step;
use crate::{Gpu, GpuError};
use artgs::fit::{LossConfig, Rect, TrainConfig, TrainImage};
use artgs_core::Camera;
use wgpu::Buffer;

/// A photograph to train on.
#[derive(Debug)]
pub(crate) struct Picture {
    pub(crate) state: usize,
    pub(crate) size: [usize; 2],
    camera: Camera,
    object: Rect,
    without_depth: usize,
    depth_per_unit: Option<f32>,
    photo: Buffer,
    measured: Buffer,
}

impl Picture {
    pub(crate) fn new(gpu: &Gpu, image: &TrainImage<'_>) -> Result<Self, GpuError> {
        let measured = image.depth.as_deref().map_or(&[][..], artgs_core::DepthMap::counts);
        Ok(Self {
            state: image.state,
            size: [image.width, image.height],
            camera: image.camera,
            object: image.object,
            without_depth: image.without_depth,
            depth_per_unit: image.depth.as_deref().map(artgs_core::DepthMap::per_unit),
            photo: gpu.array_of("photograph", &image.rgba)?,
            measured: gpu.array_of("depth of a photograph", measured)?,
        })
    }

    /// The numbers of a step on this photograph as far as the photograph decides them.
    pub(crate) fn step(&self, config: &TrainConfig, loss: &LossConfig, background: [f32; 3]) -> Step {
        let blur = artgs_raster::RenderOptions::default().blur;
        let mut step = Step::view(&self.camera, config.near, blur);
        let rect = self.rect(loss);
        step.background = background;
        step.rect = if rect.is_empty() { [0; 4] } else { [rect.x0, rect.y0, rect.x1, rect.y1].map(|v| v as u32) };
        step.pose = self.state as u32;
        step.losses(loss, config.depth_unit, self.depth_per_unit, self.without_depth);
        step
    }

    /// Where windows of similarity are centred.
    fn rect(&self, loss: &LossConfig) -> Rect {
        let [w, h] = self.size;
        if loss.crop_ssim { self.object.grown(16, w, h) } else { Rect::full(w, h) }
    }

    /// Number of windows of similarity in a channel.
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

    /// From the frame to its loss and gradient.
    pub(crate) fn compare(&self, gpu: &Gpu, k: &Kernels, g: &Gaussians, canvas: &Canvas, desk: &Desk) -> Program {
        let slope = [&desk.steps, &self.photo, &canvas.frame, &canvas.slopes, &canvas.window_sums];
        let compare = [
            &desk.steps,
            &self.photo,
            &self.measured,
            &canvas.frame,
            &canvas.frame_depth,
            &canvas.slopes,
            &canvas.pulls,
            &canvas.rests,
            &canvas.pixel_sums,
        ];
        let collect = [&desk.steps, &g.params, &canvas.pixel_sums, &canvas.window_sums, &desk.control, &desk.results];
        vec![
            (k.slope.on(gpu, &slope), Size::Windows),
            (k.compare.on(gpu, &compare), Size::Tiles),
            (k.collect.on(gpu, &collect), Size::Count(1)),
        ]
    }
}
