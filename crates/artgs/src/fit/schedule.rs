//! Learning rates over time.

use serde::{Deserialize, Serialize};

/// A rate that falls from `from` to `to` linearly in its logarithm over `steps` steps and then stays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogLinear {
    /// Rate at step 0.
    pub from: f64,
    /// Rate from step `steps` on.
    pub to: f64,
    /// Length of the fall in steps; 0 means `to` throughout.
    pub steps: usize,
}

impl LogLinear {
    /// Rate at a step: `from^(1 - s) to^s`, `s = min(step / steps, 1)`.
    pub fn at(&self, step: usize) -> f64 {
        if step >= self.steps {
            return self.to;
        }
        let s = step as f64 / self.steps as f64;
        (self.from.ln() * (1.0 - s) + self.to.ln() * s).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_position_rates_are_met() {
        let rate = LogLinear { from: 8e-4, to: 8e-6, steps: 30_000 };
        for (step, want) in [(0, 8.0e-4), (3_000, 5.05e-4), (10_000, 1.72e-4), (20_000, 3.71e-5), (40_000, 8e-6)] {
            assert!((rate.at(step) / want - 1.0).abs() < 5e-3, "{step}: {}", rate.at(step));
        }
    }
}
