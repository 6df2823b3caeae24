//! Shorter schedules: every count of steps times one factor.
//!
//! Adam moves a parameter by about its rate in a step, so a run that is shorter by `f` with the same rates would not get
//! as far. Rates therefore grow by `1 / sqrt(f)`, midway between the same rates and the same reach, as one scales them
//! with the batch (Malladi et al. 2022): the published joint optimisation can turn a part by 5 radians, a tenth of it by
//! 1.6.

use crate::articulation::ArticulateConfig;
use crate::config::Config;
use crate::fit::{DensifyConfig, LogLinear, RateConfig};
use crate::settings::{ConfigError, bad};

impl Config {
    /// The published method with every count of steps (lengths of runs, densification, resets, temperature, levels,
    /// learning rate schedules, Chamfer range) multiplied by `factor` in (0, 1], and learning rates by
    /// `1 / sqrt(factor)`: for tables of many runs, where a full one takes too long. Not the published numbers.
    pub fn paper_scaled(factor: f64) -> Result<Self, ConfigError> {
        if factor > 0.0 && factor <= 1.0 {
            return Ok(shortened(Self::paper(), factor));
        }
        let rule = "must be the share of the published steps, more than 0 and at most 1";
        Err(bad("", "schedule", factor, rule))
    }
}

/// A factor on counts of steps.
#[derive(Clone, Copy)]
struct Factor(f64);

impl Factor {
    /// Rounded; 0, which means never, stays, anything else is at least 1.
    fn steps(self, count: usize) -> usize {
        if count == 0 { 0 } else { ((count as f64 * self.0).round() as usize).max(1) }
    }

    fn rate(self, rate: f64) -> f64 {
        rate / self.0.sqrt()
    }

    fn fall(self, fall: LogLinear) -> LogLinear {
        LogLinear { from: self.rate(fall.from), to: self.rate(fall.to), steps: self.steps(fall.steps) }
    }

    fn rates(self, rates: RateConfig) -> RateConfig {
        RateConfig {
            position_from: self.rate(rates.position_from),
            position_to: self.rate(rates.position_to),
            position_horizon: self.steps(rates.position_horizon),
            rotation: self.rate(rates.rotation),
            log_scale: self.rate(rates.log_scale),
            opacity: self.rate(rates.opacity),
            sh_dc: self.rate(rates.sh_dc),
            sh_rest: self.rate(rates.sh_rest),
            ..rates
        }
    }

    fn densify(self, densify: DensifyConfig) -> DensifyConfig {
        DensifyConfig {
            after: self.steps(densify.after),
            before: self.steps(densify.before),
            every: self.steps(densify.every),
            late_after: self.steps(densify.late_after),
            reset_every: self.steps(densify.reset_every),
            ..densify
        }
    }

    fn articulate(self, config: ArticulateConfig) -> ArticulateConfig {
        let mut assign = config.assign;
        assign.temperature_steps = self.steps(assign.temperature_steps);
        assign.steps_per_level = self.steps(assign.steps_per_level);
        ArticulateConfig {
            steps: self.steps(config.steps),
            sh_every: self.steps(config.sh_every),
            rates: self.rates(config.rates),
            densify: self.densify(config.densify),
            joint_rate: self.fall(config.joint_rate),
            assign_rate: self.fall(config.assign_rate),
            assign,
            centre_after: self.steps(config.centre_after),
            chamfer_after: self.steps(config.chamfer_after),
            chamfer_before: self.steps(config.chamfer_before),
            ..config
        }
    }
}

/// The published settings with every count of steps multiplied by `factor`.
pub(crate) fn shortened(mut config: Config, factor: f64) -> Config {
    let f = Factor(factor);
    config.single.steps = f.steps(config.single.steps);
    config.single.sh_every = f.steps(config.single.sh_every);
    config.single.rates = f.rates(config.single.rates);
    config.single.densify = f.densify(config.single.densify);
    config.types.steps_for_many = f.steps(config.types.steps_for_many);
    config.types.train = f.articulate(config.types.train);
    config.articulate = f.articulate(config.articulate);
    config
}
