//! The seam between the training loop and the device it runs on: state goes up, steps run, state comes down.

use super::FitError;
use super::adam::{AdamConfig, SplatAdam, SplatRates};
use super::deform::Articulated;
use super::densify::DensifyStats;
use super::loss::{LossConfig, LossTerms};
use super::schedule::LogLinear;
use artgs_core::Splats;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

/// What lies between the stored Gaussians and those that are drawn.
#[derive(Clone, Debug, Default)]
pub enum Deformation {
    /// Nothing: the stored Gaussians are drawn.
    #[default]
    None,
    /// The stored Gaussians are canonical; they are drawn at the state of each photograph.
    Articulated(Box<Articulated>),
}

impl Deformation {
    /// Follows a change of the set of Gaussians: the new one `i` descends from the old one `parents[i]`.
    pub fn follow(&mut self, parents: &[usize]) {
        if let Self::Articulated(articulated) = self {
            articulated.follow(parents);
        }
    }
}

/// All that training changes. A device that holds it can resume where another stopped.
#[derive(Clone, Debug, Default)]
pub struct TrainState {
    /// Steps done.
    pub step: usize,
    /// Gaussians in raw parameters.
    pub splats: Splats,
    /// Their optimiser.
    pub adam: SplatAdam,
    /// What was seen of them since the last densification.
    pub stats: DensifyStats,
    /// How they are moved before they are drawn.
    pub deformation: Deformation,
    /// Step after which rates began to fall; see [`PlateauConfig`].
    pub settling: Option<usize>,
}

impl TrainState {
    /// Step 0.
    pub fn new(splats: Splats) -> Self {
        let (adam, stats) = (SplatAdam::new(&splats), DensifyStats::zeros(splats.len()));
        Self { step: 0, splats, adam, stats, deformation: Deformation::None, settling: None }
    }
}

/// Learning rates as published, with a schedule for short runs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RateConfig {
    /// Rate of centres at the first step, per spatial scale; see [`RateConfig::extent_factor`].
    pub position_from: f64,
    /// Rate of centres at the horizon, per spatial scale.
    pub position_to: f64,
    /// Steps over which the rate of centres falls; 0: the length of the run.
    pub position_horizon: usize,
    /// Spatial scale relative to the extent of the cameras (largest distance from their mean). The published scale is
    /// 5; benchmark cameras on a half sphere of radius 3.2 have an extent of 3.53, so 1.414 reproduces it.
    pub extent_factor: f64,
    /// Rate of raw quaternions.
    pub rotation: f64,
    /// Rate of log scales.
    pub log_scale: f64,
    /// Rate of logit opacities.
    pub opacity: f64,
    /// Rate of the constant harmonic.
    pub sh_dc: f64,
    /// Rate of the other harmonics.
    pub sh_rest: f64,
    /// All rates but that of centres fall log-linearly to this fraction at the end of the run; 1: constant.
    pub final_fraction: f64,
}

impl RateConfig {
    /// As published.
    pub fn paper() -> Self {
        Self {
            position_from: 1.6e-4,
            position_to: 1.6e-6,
            position_horizon: 30_000,
            extent_factor: 1.414,
            rotation: 1e-3,
            log_scale: 5e-3,
            opacity: 0.05,
            sh_dc: 2.5e-3,
            sh_rest: 1.25e-4,
            final_fraction: 1.0,
        }
    }

    /// Rates at a step of a run of `total` steps, for cameras of the given extent (scene units).
    pub fn at(&self, step: usize, total: usize, extent: f64) -> SplatRates {
        let horizon = if self.position_horizon == 0 { total } else { self.position_horizon };
        let scale = extent * self.extent_factor;
        let position =
            LogLinear { from: self.position_from * scale, to: self.position_to * scale, steps: horizon }.at(step);
        let fall = LogLinear { from: 1.0, to: self.final_fraction, steps: total }.at(step);
        SplatRates {
            means: position as f32,
            rotations: (self.rotation * fall) as f32,
            log_scales: (self.log_scale * fall) as f32,
            logit_opacities: (self.opacity * fall) as f32,
            sh_dc: (self.sh_dc * fall) as f32,
            sh_rest: (self.sh_rest * fall) as f32,
        }
    }
}

impl Default for RateConfig {
    /// For short runs that start on the surface: larger harmonics and scales, all rates falling.
    fn default() -> Self {
        Self {
            position_to: 1.6e-6,
            position_horizon: 0,
            log_scale: 1e-2,
            sh_dc: 1e-2,
            sh_rest: 1e-3,
            rotation: 5e-3,
            final_fraction: 0.05,
            ..Self::paper()
        }
    }
}

/// When a run has converged. At first learning rates are constant and a few views are held back. When the held-back views no
/// longer improve, the run settles: it trains on all views for a fixed number of steps with falling rates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlateauConfig {
    /// Steps after the run settles; 0: the run has its full length, and rates fall from its beginning.
    pub settle: usize,
    /// Views of each state that are held back, but at most one in eight. With none the run has its full length.
    pub hold_back: usize,
    /// Steps between two scores of the held-back views.
    pub every: usize,
    /// Until the run settles, larger images are reduced by an integer factor to about this number of pixels.
    pub coarse_pixels: usize,
    /// The run settles when the mean PSNR of the held-back views is less than this above the best so far, decibels.
    pub least_gain: f64,
}

impl PlateauConfig {
    /// As published: no early end.
    pub fn never() -> Self {
        Self { settle: 0, hold_back: 0, ..Self::default() }
    }

    /// Last step of the run, if it settled after `settling` and has `steps` steps at most.
    pub fn end(&self, settling: Option<usize>, steps: usize) -> usize {
        settling.map_or(steps, |from| steps.min(from + self.settle))
    }

    /// Step after which a run of `steps` steps settles at the latest.
    pub fn latest(&self, steps: usize) -> usize {
        steps.saturating_sub(self.settle)
    }

    /// Which of `count` views of one state to hold back, evenly spread.
    pub fn held(&self, count: usize) -> impl Iterator<Item = usize> {
        let held = if self.settle == 0 { 0 } else { self.hold_back.min(count / 8) };
        (0..held).map(move |i| (2 * i + 1) * count / (2 * held))
    }
}

impl Default for PlateauConfig {
    fn default() -> Self {
        Self { settle: 200, hold_back: 3, every: 100, coarse_pixels: 250_000, least_gain: 0.2 }
    }
}

/// What a device needs to know to make a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainConfig {
    /// Length of the whole run, for schedules.
    pub total: usize,
    /// Weights of the losses.
    pub loss: LossConfig,
    /// Learning rates.
    pub rates: RateConfig,
    /// Optimiser constants.
    pub adam: AdamConfig,
    /// The active degree of harmonics rises by one every so many steps; 0: all at once.
    pub sh_every: usize,
    /// A new background colour each step; otherwise black.
    pub random_background: bool,
    /// Draw each view independently, with both states equally likely; otherwise all views in shuffled rounds.
    pub with_replacement: bool,
    /// Extent of the cameras, scene units: scales the rate of centres.
    pub extent: f64,
    /// Depth differences are divided by this inside the logarithm, scene units.
    pub depth_unit: f32,
    /// Gaussians nearer than this are not drawn, scene units.
    pub near: f32,
    /// When the run has converged.
    pub plateau: PlateauConfig,
}

impl TrainConfig {
    /// Rates at a step, counted from 1, of a run that settles after `settling`.
    pub fn rates_at(&self, step: usize, settling: Option<usize>) -> SplatRates {
        match self.plateau.settle.min(self.total) {
            0 => self.rates.at(step, self.total, self.extent),
            settle => self.rates.at(settling.map_or(0, |from| step - from), settle, self.extent),
        }
    }

    /// Active degree of harmonics at a step, counted from 1.
    pub fn sh_degree(&self, step: usize, stored: usize) -> usize {
        step.checked_div(self.sh_every).map_or(stored, |degree| degree.min(stored))
    }
}

/// What one step was like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepStats {
    /// Number of the step, from 1.
    pub step: usize,
    /// Length of the run.
    pub total: usize,
    /// Loss of the view of this step, before the update.
    pub loss: f64,
    /// Peak signal to noise ratio of that view over its background, decibel.
    pub psnr: f64,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Terms of the loss.
    pub terms: LossTerms,
}

/// A device that trains. Pixels never leave it.
pub trait Backend {
    /// Takes the state over. A device that cannot train it says why ([`FitError::Device`]).
    fn upload(&mut self, state: TrainState) -> Result<(), FitError>;

    /// Makes `steps` steps and reports each, in order; fewer if `on_step` breaks off, after the step that was reported.
    /// A device that makes several steps at once breaks off after the last of them and reports them all. Without
    /// `update_last` the last of all `steps` leaves the Gaussians as they are and only gathers statistics; what moves them
    /// is updated all the same.
    fn run(
        &mut self,
        steps: usize,
        update_last: bool,
        on_step: &mut dyn FnMut(StepStats) -> ControlFlow<()>,
    ) -> Result<(), FitError>;

    /// Mean peak signal to noise ratio of the views that are held back, decibel; none if there are none.
    fn held_back(&mut self) -> Result<Option<f64>, FitError>;

    /// Gives the state back; nothing can be run before the next upload.
    fn download(&mut self) -> Result<TrainState, FitError>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_rates_come_out_for_the_benchmarks_cameras() {
        let rates = RateConfig::paper().at(10_000, 10_000, 3.5355);
        assert!((rates.means / 1.72e-4 - 1.0).abs() < 5e-3, "{}", rates.means);
        assert_eq!((rates.logit_opacities, rates.sh_dc, rates.log_scales), (0.05, 2.5e-3, 5e-3));
    }
}
