//! Training on the processor.

use super::FitError;
use super::backend::{Backend, Deformation, StepStats, TrainConfig, TrainState};
use super::deform::DeformWorkspace;
use super::images::TrainImage;
use super::loss::{ImageLoss, LossTerms, opacity_entropy};
use crate::articulation::Warp;
use artgs_raster::{Rasterizer, RenderOptions, SplatGrads, SplatView};
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_pcg::Pcg64Mcg;

/// Draws views and backgrounds; the same sequence for the same seed.
#[derive(Clone, Debug)]
pub struct ViewSampler {
    rng: Pcg64Mcg,
    order: Vec<usize>,
    next: usize,
    /// Views of each state there is, for drawing with replacement; empty: without.
    states: Vec<Vec<usize>>,
}

impl ViewSampler {
    /// A sampler of views (at least one), given the state of each.
    pub fn new(states: &[usize], with_replacement: bool, seed: u64) -> Self {
        let of_state = |s: usize| -> Vec<usize> { (0..states.len()).filter(|&v| states[v] == s).collect() };
        let groups = if with_replacement { vec![of_state(0), of_state(1)] } else { Vec::new() };
        Self {
            rng: Pcg64Mcg::seed_from_u64(seed),
            order: (0..states.len()).collect(),
            next: states.len(),
            states: groups.into_iter().filter(|g| !g.is_empty()).collect(),
        }
    }

    /// Index of the next view: all of them in a random order before any comes again, or with replacement, states
    /// being equally likely.
    pub fn view(&mut self) -> usize {
        if let Some(first) = self.states.first() {
            let group =
                if self.states.len() > 1 { &self.states[self.rng.random_range(0..self.states.len())] } else { first };
            return group[self.rng.random_range(0..group.len())];
        }
        if self.next >= self.order.len() {
            self.order.shuffle(&mut self.rng);
            self.next = 0;
        }
        self.next += 1;
        self.order[self.next - 1]
    }

    /// A uniform colour.
    pub fn color(&mut self) -> [f32; 3] {
        std::array::from_fn(|_| self.rng.random::<f32>())
    }
}

/// A [`Backend`] on the processor: images, rasteriser and workspaces, reused from step to step.
#[derive(Debug)]
pub struct CpuBackend {
    images: Vec<TrainImage>,
    config: TrainConfig,
    state: TrainState,
    sampler: ViewSampler,
    rasterizer: Rasterizer,
    loss: ImageLoss,
    grads: SplatGrads,
    warp: Warp,
    work: DeformWorkspace,
}

impl CpuBackend {
    /// Holds the images; `seed` decides the order of views and the backgrounds.
    pub fn new(images: Vec<TrainImage>, config: TrainConfig, seed: u64) -> Result<Self, FitError> {
        if images.is_empty() {
            return Err(FitError::NoViews);
        }
        let states: Vec<usize> = images.iter().map(|image| image.state).collect();
        let sampler = ViewSampler::new(&states, config.with_replacement, seed);
        Ok(Self {
            images,
            config,
            state: TrainState::default(),
            sampler,
            rasterizer: Rasterizer::new(),
            loss: ImageLoss::new(),
            grads: SplatGrads::default(),
            warp: Warp::new(true),
            work: DeformWorkspace::default(),
        })
    }

    /// One view: draw, compare, carry back, gather statistics, update.
    fn step(&mut self, update: bool) -> StepStats {
        let view = self.sampler.view();
        let background = if self.config.random_background { self.sampler.color() } else { [0.0; 3] };
        let (terms, total) = self.differentiate(view, background);
        let Self { config, state, grads, work, .. } = self;
        state.stats.add(grads);
        state.step += 1;
        let step = state.step;
        if update {
            let rates = config.rates.at(step, config.total, config.extent);
            let sh_degree = config.sh_degree(step, state.splats.sh_degree);
            state.adam.step(&mut state.splats, grads, &rates, sh_degree, &config.adam);
        }
        if let Deformation::Articulated(articulated) = &mut state.deformation {
            articulated.update(step, work);
        }
        let psnr = -10.0 * terms.mse.max(1e-12).log10();
        StepStats { step, total: config.total, loss: total, psnr, gaussians: state.splats.len(), terms }
    }

    /// Loss of one view at the next step: terms of the image and the sum of all. Leaves the gradient by the stored
    /// Gaussians in `grads` and that by the motions in `work`.
    fn differentiate(&mut self, view: usize, background: [f32; 3]) -> (LossTerms, f64) {
        let Self { images, config, state, rasterizer, loss, grads, warp, work, .. } = self;
        let (image, splats, step) = (&images[view], &state.splats, state.step + 1);
        let sh_degree = config.sh_degree(step, splats.sh_degree);
        let options = RenderOptions { sh_degree, background, near: config.near, ..RenderOptions::default() };
        let drawn = match &mut state.deformation {
            Deformation::None => SplatView::from(splats),
            Deformation::Articulated(articulated) => {
                articulated.forward(splats, image.state, step, work);
                articulated.view(splats, work)
            }
        };
        let frame = rasterizer.forward(drawn, &image.camera, &options);
        let terms = loss.evaluate(frame, image, background, &config.loss, config.depth_unit);
        rasterizer.backward(drawn, &image.camera, &options, &loss.grad, grads);
        let mut total = terms.total;
        if let Deformation::Articulated(articulated) = &mut state.deformation {
            total += articulated.backward(splats, image.state, step, warp, grads, work);
        }
        if config.loss.opacity_entropy > 0.0 {
            let weight = config.loss.opacity_entropy;
            let entropy = opacity_entropy(&splats.logit_opacities, weight, &mut grads.logit_opacities);
            total += f64::from(weight) * entropy;
        }
        (terms, total)
    }
}

impl Backend for CpuBackend {
    fn upload(&mut self, state: TrainState) -> Result<(), FitError> {
        if state.splats.is_empty() {
            return Err(FitError::Empty);
        }
        self.state = state;
        Ok(())
    }

    fn run(&mut self, steps: usize, update_last: bool, on_step: &mut dyn FnMut(StepStats)) -> Result<(), FitError> {
        if self.state.splats.is_empty() {
            return Err(FitError::Empty);
        }
        for i in 0..steps {
            let stats = self.step(update_last || i + 1 < steps);
            on_step(stats);
        }
        Ok(())
    }

    fn download(&mut self) -> Result<TrainState, FitError> {
        Ok(std::mem::take(&mut self.state))
    }
}

#[cfg(test)]
#[path = "cpu_tests.rs"]
mod tests;
