//! Settings of the joint optimisation.

use crate::fit::{
    AdamConfig, DensifyConfig, DepthMode, DepthPick, LogLinear, LossConfig, PlateauConfig, RateConfig, SingleConfig,
    TrainConfig,
};
use crate::published::assignment::AssignConfig;
use artgs_raster::low_level::TRAINING_NEAR;
use serde::{Deserialize, Serialize};

/// Settings of the joint optimisation. The default is a short run from a good start: fixed labels and joints. In depth and Chamfer
/// losses and in the learning rates of motions, half the longest side of the object counts as 1, and motions are optimised as seen
/// from the middle of their part: the published constants are for objects of that size about the world's origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArticulateConfig {
    /// Largest number of steps, one view each.
    pub steps: usize,
    /// Images are made smaller by the integer factor that brings their longer side nearest to this, pixels; 0: as they are.
    pub image_side: usize,
    /// How depth is resampled.
    pub depth_pick: DepthPick,
    /// The active degree of harmonics rises from 0 by one every so many steps; 0: all at once.
    pub sh_every: usize,
    /// A new background colour each step; otherwise black.
    pub random_background: bool,
    /// Draw a state by a fair coin, then any of its views; otherwise all views of both states in shuffled rounds.
    pub with_replacement: bool,
    /// Update Gaussians also at steps that change their set and at the last step (published: not).
    pub update_always: bool,
    /// Weights of the losses on images.
    pub loss: LossConfig,
    /// Learning rates of Gaussians.
    pub rates: RateConfig,
    /// Optimiser constants.
    pub adam: AdamConfig,
    /// Adaptive density control.
    pub densify: DensifyConfig,
    /// When the run has converged.
    pub plateau: PlateauConfig,
    /// True derivatives of the warp. Published: canonical centres get the gradient of the moved ones without turning
    /// it back, and the turn of Gaussians passes no gradient to motions and parts.
    pub exact: bool,
    /// Turn colours with the parts rather than leave them fixed to the world.
    pub rotate_sh: bool,
    /// Improve the motions; otherwise they stay as given.
    pub learn_joints: bool,
    /// Improve the motions of found parts whose points are noisy, also without `learn_joints`: photos determine motions along
    /// surfaces better than noisy depth.
    pub learn_noisy_joints: bool,
    /// Learning rate of the joint motions; used if `learn_joints`.
    pub joint_rate: LogLinear,
    /// Learning rate of a learnt assignment to parts.
    pub assign_rate: LogLinear,
    /// A learnt assignment to parts: used where the start gives centres instead of labels.
    pub assign: AssignConfig,
    /// The pull of part centres towards their parts (weight in `assign`) acts after this step.
    pub centre_after: usize,
    /// Weight of the mean squared distance from moved Gaussians to the targets of their state; trains motions and
    /// parts only. 0: none.
    pub chamfer: f64,
    /// That term acts after this step ...
    pub chamfer_after: usize,
    /// ... and before this one, ...
    pub chamfer_before: usize,
    /// ... unless, if this is set, any part is prismatic.
    pub chamfer_not_if_prismatic: bool,
}

impl ArticulateConfig {
    /// The third stage as published.
    pub fn paper() -> Self {
        let rate = LogLinear { from: 8e-4, to: 1.6e-6, steps: 40_000 };
        Self {
            steps: 20_000,
            image_side: 0,
            depth_pick: DepthPick::Nearest,
            sh_every: 0,
            random_background: true,
            with_replacement: true,
            update_always: false,
            loss: LossConfig {
                depth: 1.0,
                depth_mode: DepthMode::Accumulated,
                opacity_entropy: 0.0,
                ..SingleConfig::paper().loss
            },
            rates: RateConfig::paper(),
            adam: AdamConfig::default(),
            densify: DensifyConfig { grad_threshold: 1e-3, late_prune_opacity: 0.01, ..DensifyConfig::paper() },
            plateau: PlateauConfig::never(),
            exact: false,
            rotate_sh: false,
            learn_joints: true,
            learn_noisy_joints: false,
            joint_rate: rate,
            assign_rate: rate,
            assign: AssignConfig::default(),
            centre_after: 3000,
            chamfer: 100.0,
            chamfer_after: 1000,
            chamfer_before: 5000,
            chamfer_not_if_prismatic: true,
        }
    }

    /// What a training device needs, for cameras of the given extent and an object of the given half side.
    pub(super) fn train(&self, extent: f64, half_side: f64) -> TrainConfig {
        TrainConfig {
            total: self.steps,
            loss: self.loss,
            rates: self.rates,
            adam: self.adam,
            sh_every: self.sh_every,
            random_background: self.random_background,
            with_replacement: self.with_replacement,
            extent,
            depth_unit: half_side as f32,
            near: (TRAINING_NEAR * half_side) as f32,
            plateau: self.plateau,
        }
    }
}

impl Default for ArticulateConfig {
    fn default() -> Self {
        Self {
            steps: 1200,
            depth_pick: DepthPick::Median,
            with_replacement: false,
            update_always: true,
            loss: LossConfig::default(),
            rates: RateConfig::default(),
            densify: DensifyConfig::default(),
            plateau: PlateauConfig::default(),
            exact: true,
            rotate_sh: true,
            learn_joints: false,
            learn_noisy_joints: true,
            joint_rate: LogLinear { from: 1e-3, to: 1e-5, steps: 900 },
            assign_rate: LogLinear { from: 5e-3, to: 5e-4, steps: 900 },
            assign: AssignConfig {
                temperature_steps: 600,
                steps_per_level: 100,
                centre_weight: 0.0,
                ..AssignConfig::light()
            },
            centre_after: 300,
            chamfer: 0.0,
            chamfer_not_if_prismatic: false,
            ..Self::paper()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_survive_a_file_and_unknown_ones_are_refused() {
        for config in [ArticulateConfig::default(), ArticulateConfig::paper()] {
            let text = serde_json::to_string(&config).unwrap();
            assert_eq!(serde_json::from_str::<ArticulateConfig>(&text).unwrap(), config);
        }
        let some: ArticulateConfig = serde_json::from_str(r#"{"steps": 7}"#).unwrap();
        assert_eq!(some, ArticulateConfig { steps: 7, ..ArticulateConfig::default() });
        assert!(serde_json::from_str::<ArticulateConfig>(r#"{"stepz": 7}"#).is_err());
    }
}
