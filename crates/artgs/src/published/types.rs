//! Kinds of joints from a short optimisation of free motions.

use super::AssignConfig;
use crate::articulation::{ArticulateConfig, MotionModel, MotionParameters, SkinStart, Start, Trained, articulate};
use crate::fit::{Devices, FitError, Follow, LossConfig};
use crate::published::canonical::Canonical;
use artgs_core::{PerState, View};
use glam::DVec3;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Settings of the prediction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TypeConfig {
    /// Leave this stage out, the paper's ablation "w/o Joint Pred.": all parts keep general rigid motions, and those
    /// whose learnt half motion exceeds `half_angle_deg` in the end are reported as revolute.
    pub skip: bool,
    /// The optimisation; its number of steps is for a single movable part.
    pub train: ArticulateConfig,
    /// Number of steps for several movable parts.
    pub steps_for_many: usize,
    /// A part whose half motion turns by more than this (degrees) is taken for revolute.
    pub half_angle_deg: f64,
}

impl TypeConfig {
    /// The second stage as published: colour loss only, images of 100 pixels, an eighth of those of the paper.
    pub fn paper() -> Self {
        let third = ArticulateConfig::paper();
        Self {
            skip: false,
            train: ArticulateConfig {
                steps: 3000,
                image_side: 100,
                loss: LossConfig { depth: 0.0, ..third.loss },
                assign: AssignConfig { centre_weight: 0.0, ..third.assign },
                chamfer: 0.0,
                ..third
            },
            steps_for_many: 5000,
            half_angle_deg: 10.0,
        }
    }
}

impl TypeConfig {
    /// Number of steps for `parts` parts, the static one included.
    pub(super) fn steps(&self, parts: usize) -> usize {
        if parts > 2 { self.steps_for_many } else { self.train.steps }
    }
}

impl Default for TypeConfig {
    fn default() -> Self {
        Self::paper()
    }
}

/// The training that decides the kinds: all parts have general rigid motions.
pub(super) fn free_motions(
    views: PerState<&[View]>,
    canonical: &Canonical,
    config: &TypeConfig,
    seed: u64,
    devices: &dyn Devices,
    follow: &mut dyn Follow,
) -> Result<Trained, FitError> {
    let parts = canonical.centres.len();
    let train = ArticulateConfig { steps: config.steps(parts), ..config.train.clone() };
    let start = still_start(canonical, &vec![MotionModel::Free; parts.saturating_sub(1)], seed);
    articulate(views, start, None, &train, seed, devices, follow)
}

/// Models of the movable parts, `[K - 1]`, by how far each turns: `Prismatic`, or `Free` for those that turn (published code does not
/// hold them to a hinge).
pub(super) fn models_of(trained: &Trained, config: &TypeConfig) -> Vec<MotionModel> {
    let limit = config.half_angle_deg.to_radians();
    let kind = |joint: &MotionParameters| {
        if joint.half_motion().angle() > limit { MotionModel::Free } else { MotionModel::Prismatic }
    };
    trained.joints.iter().map(kind).collect()
}

/// Parts that hardly move yet, assigned by their centres.
pub(crate) fn still_start(canonical: &Canonical, models: &[MotionModel], seed: u64) -> Start {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let pivot = |k: usize| DVec3::from_array(canonical.centres[k].map(f64::from));
    let joints = models.iter().enumerate().map(|(i, &m)| MotionParameters::still(m, pivot(i + 1), &mut rng)).collect();
    let skin = SkinStart::Centres { centres: canonical.centres.clone(), radii: canonical.radii.clone() };
    Start { splats: canonical.splats.clone(), skin, joints }
}
