//! Training on the processor.

use super::FitError;
use super::backend::{Backend, Deformation, StepStats, TrainConfig, TrainState};
use super::images::TrainImage;
use super::loss::{ImageLoss, opacity_entropy};
use artgs_raster::{Rasterizer, RenderOptions, SplatGrads, SplatView};
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_pcg::Pcg64Mcg;

/// Draws views and backgrounds; the same sequence for the same seed.
#[derive(Clone, Debug)]
pub struct ViewSampler {
    rng: Pcg64Mcg,
    order: Vec<usize>,
    next: usize,
    with_replacement: bool,
}

impl ViewSampler {
    /// A sampler of `count` views (at least one).
    pub fn new(count: usize, with_replacement: bool, seed: u64) -> Self {
        Self { rng: Pcg64Mcg::seed_from_u64(seed), order: (0..count).collect(), next: count, with_replacement }
    }

    /// Index of the next view: all of them in a random order before any comes again, unless with replacement.
    pub fn view(&mut self) -> usize {
        if self.with_replacement {
            return self.rng.random_range(0..self.order.len());
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
}

impl CpuBackend {
    /// Holds the images; `seed` decides the order of views and the backgrounds.
    pub fn new(images: Vec<TrainImage>, config: TrainConfig, seed: u64) -> Result<Self, FitError> {
        if images.is_empty() {
            return Err(FitError::NoViews);
        }
        let sampler = ViewSampler::new(images.len(), config.with_replacement, seed);
        Ok(Self {
            images,
            config,
            state: TrainState::default(),
            sampler,
            rasterizer: Rasterizer::new(),
            loss: ImageLoss::new(),
            grads: SplatGrads::default(),
        })
    }

    /// One view: draw, compare, carry back, gather statistics, update.
    fn step(&mut self, update: bool) -> StepStats {
        let Self { images, config, state, sampler, rasterizer, loss, grads } = self;
        let step = state.step + 1;
        let image = &images[sampler.view()];
        let background = if config.random_background { sampler.color() } else { [0.0; 3] };
        let sh_degree = config.sh_degree(step, state.splats.sh_degree);
        let options = RenderOptions { sh_degree, background, near: config.near, ..RenderOptions::default() };
        let view = match state.deformation {
            Deformation::None => SplatView::from(&state.splats),
        };
        let frame = rasterizer.forward(view, &image.camera, &options);
        let terms = loss.evaluate(frame, image, background, &config.loss, config.depth_unit);
        rasterizer.backward(view, &image.camera, &options, &loss.grad, grads);
        state.stats.add(grads);
        let mut total = terms.total;
        if config.loss.opacity_entropy > 0.0 {
            let weight = config.loss.opacity_entropy;
            let entropy = opacity_entropy(&state.splats.logit_opacities, weight, &mut grads.logit_opacities);
            total += f64::from(weight) * entropy;
        }
        if update {
            let rates = config.rates.at(step, config.total, config.extent);
            state.adam.step(&mut state.splats, grads, &rates, sh_degree, &config.adam);
        }
        state.step = step;
        let psnr = -10.0 * terms.mse.max(1e-12).log10();
        StepStats { step, total: config.total, loss: total, psnr, gaussians: state.splats.len(), terms }
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
mod tests {
    use super::*;

    #[test]
    fn rounds_show_every_view_once() {
        let mut sampler = ViewSampler::new(7, false, 5);
        for _ in 0..3 {
            let mut round: Vec<usize> = (0..7).map(|_| sampler.view()).collect();
            round.sort_unstable();
            assert_eq!(round, [0, 1, 2, 3, 4, 5, 6]);
        }
        let mut sampler = ViewSampler::new(7, true, 5);
        let draws: Vec<usize> = (0..700).map(|_| sampler.view()).collect();
        assert!((0..7).all(|v| draws.iter().filter(|&&d| d == v).count() > 60));
    }
}
