//! Training on the processor.

use super::FitError;
use super::backend::{Backend, Deformation, PlateauConfig, StepStats, TrainConfig, TrainState};
use super::deform::DeformWorkspace;
use super::images::TrainImage;
use super::loss::{ImageLoss, LossConfig, LossTerms, opacity_entropy};
use crate::articulation::Warp;
use artgs_raster::{Rasterizer, RenderOptions, SplatGrads, SplatView};
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Draws views and backgrounds; the same sequence for the same seed.
#[derive(Clone, Debug)]
pub struct ViewSampler {
    rng: Pcg64Mcg,
    order: Vec<usize>,
    next: usize,
    with_replacement: bool,
    /// Views of each state there is, for drawing with replacement; empty: without.
    states: Vec<Vec<usize>>,
}

impl ViewSampler {
    /// A sampler of views (at least one), given the state of each.
    pub fn new(states: &[usize], with_replacement: bool, seed: u64) -> Self {
        let mut sampler = Self {
            rng: Pcg64Mcg::seed_from_u64(seed),
            order: Vec::new(),
            next: 0,
            with_replacement,
            states: Vec::new(),
        };
        sampler.restrict(states, |_| true);
        sampler
    }

    /// From now on draws only those of the views that `keep` says.
    pub fn restrict(&mut self, states: &[usize], keep: impl Fn(usize) -> bool) {
        let kept = |&v: &usize| keep(v);
        self.order = (0..states.len()).filter(kept).collect();
        self.next = self.order.len();
        if self.with_replacement {
            let of_state = |s: usize| self.order.iter().copied().filter(|&v| states[v] == s).collect::<Vec<usize>>();
            self.states = [of_state(0), of_state(1)].into_iter().filter(|g| !g.is_empty()).collect();
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
pub struct CpuBackend<'a> {
    images: Vec<TrainImage<'a>>,
    /// The same views at full size, for when the run settles; empty if they are so already.
    fine: Vec<TrainImage<'a>>,
    config: TrainConfig,
    state: TrainState,
    sampler: ViewSampler,
    /// State of every view.
    states: Vec<usize>,
    /// Views that are not trained on yet.
    held: Vec<usize>,
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
        if images.is_empty() {
            return Err(FitError::NoViews);
        }
        let states: Vec<usize> = images.iter().map(|image| image.state).collect();
        let held = held(&states, &config.plateau);
        let mut sampler = ViewSampler::new(&states, config.with_replacement, seed);
        sampler.restrict(&states, |v| !held.contains(&v));
        let (images, fine) = coarse_first(images, &config.plateau);
        Ok(Self {
            images,
            fine,
            config,
            state: TrainState::default(),
            sampler,
            states,
            held,
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
            let rates = config.rates_at(step, state.settling);
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
    pose: usize,
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

/// The images to begin with and, if those are smaller, the ones to end with.
pub fn coarse_first<'a>(
    images: Vec<TrainImage<'a>>,
    plateau: &PlateauConfig,
) -> (Vec<TrainImage<'a>>, Vec<TrainImage<'a>>) {
    let largest = images.iter().map(TrainImage::area).max().unwrap_or(0);
    if plateau.settle == 0 || largest <= plateau.coarse_pixels {
        return (images, Vec::new());
    }
    let divisor = (largest as f64 / plateau.coarse_pixels.max(1) as f64).sqrt().ceil() as usize;
    (images.par_iter().map(|image| image.smaller(divisor)).collect(), images)
}

/// Views to hold back, ascending, given the state of each.
pub fn held(states: &[usize], plateau: &PlateauConfig) -> Vec<usize> {
    let of_state = |s: usize| (0..states.len()).filter(|&v| states[v] == s).collect::<Vec<usize>>();
    let mut held: Vec<usize> =
        [0, 1].map(of_state).iter().flat_map(|views| plateau.held(views.len()).map(|i| views[i])).collect();
    held.sort_unstable();
    held
}

impl Backend for CpuBackend<'_> {
    fn upload(&mut self, state: TrainState) -> Result<(), FitError> {
        if state.splats.is_empty() {
            return Err(FitError::Empty);
        }
        self.state = state;
        if self.state.settling.is_some() {
            if !self.held.is_empty() {
                self.held.clear();
                self.sampler.restrict(&self.states, |_| true);
            }
            if !self.fine.is_empty() {
                self.images = std::mem::take(&mut self.fine);
            }
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
        let Self { images, config, state, rasterizer, loss, work, held, .. } = self;
        let colors = LossConfig { ssim: 0.0, depth: 0.0, mask: 0.0, ..config.loss };
        let mut sum = 0.0;
        for &view in &*held {
            let image = &images[view];
            let (drawn, options) = prepare(config, state, image.state, [0.0; 3], work);
            let frame = rasterizer.forward(drawn, &image.camera, &options);
            let terms = loss.evaluate(frame, image, [0.0; 3], &colors, config.depth_unit);
            sum -= 10.0 * terms.mse.max(1e-12).log10();
        }
        Ok((!held.is_empty()).then(|| sum / held.len() as f64))
    }

    fn download(&mut self) -> Result<TrainState, FitError> {
        Ok(std::mem::take(&mut self.state))
    }
}

#[cfg(test)]
#[path = "cpu_tests.rs"]
mod tests;
