//! Training on the processor.

use super::FitError;
use super::backend::{Backend, Deformation, StepStats, TrainConfig, TrainState};
use super::deform::DeformWorkspace;
use super::images::TrainImage;
use super::loss::{ImageLoss, LossConfig, LossTerms, opacity_entropy};
use super::score::psnr_of_mse;
use super::views::ViewPlan;
use crate::articulation::Warp;
use artgs_core::State;
use artgs_raster::{Rasterizer, RenderOptions, SplatGrads, SplatView};
use std::ops::ControlFlow;

/// A [`Backend`] on the processor: images, rasteriser and workspaces, reused from step to step.
#[derive(Debug)]
pub struct CpuBackend<'a> {
    images: Vec<TrainImage<'a>>,
    config: TrainConfig,
    state: TrainState,
    views: ViewPlan<'a>,
    rasterizer: Rasterizer,
    loss: ImageLoss,
    grads: SplatGrads,
    warp: Warp,
    work: DeformWorkspace,
}

impl<'a> CpuBackend<'a> {
    /// Holds the images; `seed` decides the order of views and the backgrounds. Images of more than
    /// `config.plateau.coarse_pixels` pixels are made smaller until the run settles.
    pub fn new(images: Vec<TrainImage<'a>>, config: TrainConfig, seed: u64) -> Result<Self, FitError> {
        let (views, images) = ViewPlan::new(images, &config, seed)?;
        Ok(Self {
            images,
            config,
            state: TrainState::default(),
            views,
            rasterizer: Rasterizer::new(),
            loss: ImageLoss::new(),
            grads: SplatGrads::default(),
            warp: Warp::new(true),
            work: DeformWorkspace::default(),
        })
    }

    /// One view: draw, compare, carry back, gather statistics, update.
    fn step(&mut self, update: bool) -> StepStats {
        let view = self.views.sampler.view();
        let background = if self.config.random_background { self.views.sampler.color() } else { [0.0; 3] };
        let (terms, total) = self.differentiate(view, background);
        let Self { config, state, grads, work, .. } = self;
        state.stats.add(grads);
        state.step += 1;
        let step = state.step;
        if update {
            let rates = config.rates_at(step, state.settling);
            let sh_degree = config.sh_degree(step, state.splats.sh_degree);
            state.adam.step(&mut state.splats, grads, &rates, sh_degree, &config.adam);
        }
        if let Deformation::Articulated(articulated) = &mut state.deformation {
            articulated.update(step, work);
        }
        let psnr = psnr_of_mse(terms.mse);
        StepStats { step, total: config.total, loss: total, psnr, gaussians: state.splats.len(), terms }
    }

    /// Loss of one view at the next step: terms of the image and the sum of all. Leaves the gradient by the stored
    /// Gaussians in `grads` and that by the motions in `work`.
    fn differentiate(&mut self, view: usize, background: [f32; 3]) -> (LossTerms, f64) {
        let Self { images, config, state, rasterizer, loss, grads, warp, work, .. } = self;
        let (image, step) = (&images[view], state.step + 1);
        let (drawn, options) = prepare(config, state, image.state, background, work);
        let frame = rasterizer.forward(drawn, &image.camera, &options);
        let terms = loss.evaluate(frame, image, background, &config.loss, config.depth_unit);
        rasterizer.backward(drawn, &image.camera, &options, &loss.grad, grads);
        let mut total = terms.total;
        if let Deformation::Articulated(articulated) = &mut state.deformation {
            total += articulated.backward(&state.splats, image.state, step, warp, grads, work);
        }
        if config.loss.opacity_entropy > 0.0 {
            let weight = config.loss.opacity_entropy;
            let entropy = opacity_entropy(&state.splats.logit_opacities, weight, &mut grads.logit_opacities);
            total += f64::from(weight) * entropy;
        }
        (terms, total)
    }
}

/// Gaussians at one state as the next step draws them, and how.
fn prepare<'a>(
    config: &TrainConfig,
    state: &'a mut TrainState,
    pose: State,
    background: [f32; 3],
    work: &'a mut DeformWorkspace,
) -> (SplatView<'a>, RenderOptions) {
    let TrainState { splats, deformation, step, .. } = state;
    let sh_degree = config.sh_degree(*step + 1, splats.sh_degree);
    let options = RenderOptions { sh_degree, background, near: config.near, ..RenderOptions::default() };
    let drawn = match deformation {
        Deformation::None => SplatView::from(&*splats),
        Deformation::Articulated(articulated) => {
            articulated.forward(splats, pose, *step + 1, work);
            articulated.view(splats, work)
        }
    };
    (drawn, options)
}

impl Backend for CpuBackend<'_> {
    fn upload(&mut self, state: TrainState) -> Result<(), FitError> {
        if state.splats.is_empty() {
            return Err(FitError::Empty);
        }
        self.state = state;
        if self.state.settling.is_some()
            && let Some(fine) = self.views.settle()
        {
            self.images = fine;
        }
        Ok(())
    }

    fn run(
        &mut self,
        steps: usize,
        update_last: bool,
        on_step: &mut dyn FnMut(StepStats) -> ControlFlow<()>,
    ) -> Result<(), FitError> {
        if self.state.splats.is_empty() {
            return Err(FitError::Empty);
        }
        for i in 0..steps {
            let stats = self.step(update_last || i + 1 < steps);
            if on_step(stats).is_break() {
                break;
            }
        }
        Ok(())
    }

    fn held_back(&mut self) -> Result<Option<f64>, FitError> {
        if self.state.splats.is_empty() {
            return Err(FitError::Empty);
        }
        let Self { images, config, state, rasterizer, loss, work, views, .. } = self;
        let colors = LossConfig { ssim: 0.0, depth: 0.0, mask: 0.0, ..config.loss };
        let mut sum = 0.0;
        for &view in &views.held {
            let image = &images[view];
            let (drawn, options) = prepare(config, state, image.state, [0.0; 3], work);
            let frame = rasterizer.forward(drawn, &image.camera, &options);
            let terms = loss.evaluate(frame, image, [0.0; 3], &colors, config.depth_unit);
            sum += psnr_of_mse(terms.mse);
        }
        Ok((!views.held.is_empty()).then(|| sum / views.held.len() as f64))
    }

    fn download(&mut self) -> Result<TrainState, FitError> {
        Ok(std::mem::take(&mut self.state))
    }
}

#[cfg(test)]
#[path = "cpu_tests.rs"]
mod tests;
