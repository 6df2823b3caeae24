//! The first stage: Gaussians for one state of the object.

use super::FitError;
use super::adam::AdamConfig;
use super::backend::{Backend, PlateauConfig, RateConfig, TrainConfig, TrainState};
use super::densify::DensifyConfig;
use super::devices::Devices;
use super::follow::Follow;
use super::images::{DepthPick, TrainImage, prepare};
use super::init::{DepthInit, RandomInit, from_depth, random_cube};
use super::loss::{DepthMode, LossConfig};
use super::region::Region;
use super::train::{RunPlan, train};
use artgs_core::{Splats, State, View};
use artgs_raster::low_level::TRAINING_NEAR;
use glam::DVec3;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Where Gaussians start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InitKind {
    /// On depth where any view has it, else at random.
    #[default]
    Auto,
    /// On depth; an error where there is none.
    Depth,
    /// At random in a cube around the object.
    Random,
}

/// Settings of the first stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SingleConfig {
    /// Largest number of steps, one view each.
    pub steps: usize,
    /// Images are made smaller by this integer factor.
    pub image_divisor: usize,
    /// How depth is resampled.
    pub depth_pick: DepthPick,
    /// Degree of the harmonics, 0 to 3.
    pub sh_degree: usize,
    /// The active degree rises from 0 by one every so many steps; 0: all at once.
    pub sh_every: usize,
    /// A new background colour each step; otherwise black.
    pub random_background: bool,
    /// Draw each view independently; otherwise all views in shuffled rounds.
    pub with_replacement: bool,
    /// Update parameters also at steps that change the set of Gaussians and at the last step (published: not).
    pub update_always: bool,
    /// Where Gaussians start.
    pub init: InitKind,
    /// Random start.
    pub random: RandomInit,
    /// Start on depth.
    pub depth: DepthInit,
    /// Weights of the losses.
    pub loss: LossConfig,
    /// Learning rates.
    pub rates: RateConfig,
    /// Optimiser constants.
    pub adam: AdamConfig,
    /// Adaptive density control.
    pub densify: DensifyConfig,
    /// When the run has converged.
    pub plateau: PlateauConfig,
}

impl SingleConfig {
    /// As published: 10,000 steps at half size from 100,000 random Gaussians, colour and opacity losses only.
    pub fn paper() -> Self {
        Self {
            steps: 10_000,
            image_divisor: 2,
            depth_pick: DepthPick::Nearest,
            sh_degree: 3,
            sh_every: 1000,
            random_background: true,
            with_replacement: true,
            update_always: false,
            init: InitKind::Random,
            random: RandomInit::default(),
            depth: DepthInit { opacity: 0.1, flatten: 1.0, spread: 1.0, min_pixels: 1, ..DepthInit::default() },
            loss: LossConfig {
                ssim: 0.2,
                crop_ssim: false,
                double_alpha: true,
                depth: 0.0,
                depth_mode: DepthMode::Accumulated,
                mask: 0.0,
                opacity_entropy: 0.1,
            },
            rates: RateConfig::paper(),
            adam: AdamConfig::default(),
            densify: DensifyConfig::paper(),
            plateau: PlateauConfig::never(),
        }
    }
}

impl Default for SingleConfig {
    /// Starts on depth and needs a tenth of the steps.
    fn default() -> Self {
        Self {
            steps: 1200,
            image_divisor: 1,
            depth_pick: DepthPick::Median,
            sh_every: 150,
            with_replacement: false,
            update_always: true,
            init: InitKind::Auto,
            depth: DepthInit::default(),
            loss: LossConfig::default(),
            rates: RateConfig::default(),
            densify: DensifyConfig::default(),
            ..Self::paper()
        }
    }
}

/// Largest distance of a camera from the mean of all, scene units.
pub(crate) fn camera_extent(images: &[TrainImage]) -> f64 {
    let eyes: Vec<DVec3> = images.iter().map(|i| i.camera.position()).collect();
    let mean = eyes.iter().sum::<DVec3>() / eyes.len().max(1) as f64;
    eyes.iter().map(|e| (*e - mean).length()).fold(0.0, f64::max)
}

/// Gaussians to start with.
pub(crate) fn initialize(
    images: &[TrainImage],
    region: &Region,
    config: &SingleConfig,
    rng: &mut Pcg64Mcg,
) -> Result<Splats, FitError> {
    let start = match config.init {
        InitKind::Random => None,
        InitKind::Depth => Some(from_depth(images, &config.depth, config.sh_degree)?),
        InitKind::Auto => match from_depth(images, &config.depth, config.sh_degree) {
            Err(FitError::NoDepth | FitError::Empty) => None,
            other => Some(other?),
        },
    };
    start.map_or_else(|| random_cube(region, &config.random, config.sh_degree, rng), Ok)
}

/// Fits Gaussians to the views of one state. The same seed gives the same bytes on the processor.
pub fn fit_single(
    views: &[View],
    config: &SingleConfig,
    seed: u64,
    devices: &dyn Devices,
    follow: &mut dyn Follow,
) -> Result<Splats, FitError> {
    if views.is_empty() {
        return Err(FitError::NoViews);
    }
    let images = prepare(views, State::START, config.image_divisor, config.depth_pick);
    let region = Region::of(&images);
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let splats = initialize(&images, &region, config, &mut rng)?;
    let extent = camera_extent(&images).max(region.half_side());
    let train = TrainConfig {
        total: config.steps,
        loss: config.loss,
        rates: config.rates,
        adam: config.adam,
        sh_every: config.sh_every,
        random_background: config.random_background,
        with_replacement: config.with_replacement,
        extent,
        depth_unit: region.half_side() as f32,
        near: (TRAINING_NEAR * region.half_side()) as f32,
        plateau: config.plateau,
    };
    let mut backend = devices.backend(images, train, seed.wrapping_add(1))?;
    train_single(backend.as_mut(), TrainState::new(splats), config, extent as f32, &mut rng, follow)
}

/// Runs a backend through the first stage.
pub(crate) fn train_single(
    backend: &mut dyn Backend,
    state: TrainState,
    config: &SingleConfig,
    extent: f32,
    rng: &mut Pcg64Mcg,
    follow: &mut dyn Follow,
) -> Result<Splats, FitError> {
    let SingleConfig { steps, plateau, update_always, densify, .. } = *config;
    let plan = RunPlan { steps, plateau, update_always, densify, extent };
    Ok(train(backend, state, &plan, rng, follow)?.splats)
}
