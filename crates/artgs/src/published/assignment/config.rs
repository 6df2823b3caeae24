//! Settings of the assignment to parts.

use super::HashGridConfig;
use serde::{Deserialize, Serialize};

/// What decides which part a Gaussian belongs to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AssignKind {
    /// Distances from centres, corrected by a perceptron: the paper's.
    #[default]
    Centres,
    /// A perceptron of the position alone: the paper's ablation "MLP Seg".
    Mlp,
    /// Slot attention over all Gaussians: the paper's ablation "SA Seg".
    Slots,
}

/// Settings of the slot attention.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SlotConfig {
    /// Numbers per slot and per Gaussian.
    pub width: usize,
    /// Times that the slots attend to the Gaussians before their last attention assigns these.
    pub iterations: usize,
}

impl Default for SlotConfig {
    fn default() -> Self {
        Self { width: 32, iterations: 3 }
    }
}

/// Settings of the module. The default is the paper's; [`AssignConfig::light`] is faster.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AssignConfig {
    /// What decides.
    pub kind: AssignKind,
    /// The slots of `kind = "slots"`.
    pub slots: SlotConfig,
    /// Hash encoding of positions.
    pub grid: HashGridConfig,
    /// Whether hash grid and perceptron see positions relative to the object's bounding box, its longest side being 1,
    /// rather than world coordinates.
    pub normalise_coordinates: bool,
    /// Width of the hidden layer.
    pub hidden: usize,
    /// Weight `w` of the perceptron's two outputs in the logits.
    pub shift_weight: f32,
    /// Factor on the parts' scales.
    pub scale_factor: f32,
    /// Temperature at step 0, falling along a cosine ...
    pub start_temperature: f64,
    /// ... to this ...
    pub end_temperature: f64,
    /// ... at this step.
    pub temperature_steps: usize,
    /// Whether the softmax divides by `temperature / (K - 1)` rather than by the temperature.
    pub divide_temperature_by_movable: bool,
    /// Weights are one-hot, with the gradient of the soft ones, once the temperature is this close to its end.
    pub hard_margin: f64,
    /// Whether training adds Gumbel noise to the logits.
    pub gumbel: bool,
    /// Levels of the hash grid that learn from the start; the others only pass their features on.
    pub initial_levels: usize,
    /// Steps after which one more level learns.
    pub steps_per_level: usize,
    /// Weight of the pull of centres to the opacity-weighted means of their parts.
    pub centre_weight: f64,
}

impl Default for AssignConfig {
    fn default() -> Self {
        Self {
            kind: AssignKind::Centres,
            slots: SlotConfig::default(),
            grid: HashGridConfig::default(),
            normalise_coordinates: false,
            hidden: 32,
            shift_weight: 0.5,
            scale_factor: 1.0,
            start_temperature: 1.0,
            end_temperature: 0.1,
            temperature_steps: 10_000,
            divide_temperature_by_movable: true,
            hard_margin: 1e-3,
            gumbel: true,
            initial_levels: 6,
            steps_per_level: 500,
            centre_weight: 0.1,
        }
    }
}

impl AssignConfig {
    /// A grid of 8 levels, 16 to 430 points along the object, at most 2^15 entries each.
    pub fn light() -> Self {
        let grid = HashGridConfig { levels: 8, log2_entries: 15, growth: 1.6, ..HashGridConfig::default() };
        Self { grid, normalise_coordinates: true, ..Self::default() }
    }

    /// Temperature before any division by the number of movable parts.
    pub fn temperature(&self, step: usize) -> f64 {
        let done = (step as f64 / self.temperature_steps.max(1) as f64).min(1.0);
        let (start, end) = (self.start_temperature, self.end_temperature);
        end + (start - end) * 0.5 * (1.0 + (std::f64::consts::PI * done).cos())
    }

    /// What logits are multiplied by before the softmax, for `parts` parts.
    pub fn inverse_temperature(&self, step: usize, parts: usize) -> f32 {
        let movable = (parts.max(2) - 1) as f64;
        let divisor = if self.divide_temperature_by_movable { movable } else { 1.0 };
        (divisor / self.temperature(step)) as f32
    }

    /// Levels of the hash grid that learn at a step.
    pub fn active_levels(&self, step: usize) -> usize {
        (self.initial_levels + step / self.steps_per_level.max(1)).min(self.grid.levels)
    }

    /// Origin and scale of the coordinates that hash grid and perceptron see.
    pub(super) fn normalisation(&self, bounds: [[f32; 3]; 2]) -> ([f32; 3], f32) {
        let longest = (0..3).map(|a| bounds[1][a] - bounds[0][a]).fold(1e-12, f32::max);
        if self.normalise_coordinates { (bounds[0], 1.0 / longest) } else { ([0.0; 3], 1.0) }
    }

    /// Whether weights are one-hot at a step.
    pub fn is_hard(&self, step: usize) -> bool {
        self.temperature(step) - self.end_temperature < self.hard_margin
    }
}
