//! The published method from two separately fitted states on.

use super::decisions;
use super::trace::{PublishedTrace, Sampling};
use super::types::{TypeConfig, free_motions, models_of, still_start};
use crate::articulation::{ArticulateConfig, MotionModel, Trained, articulate};
use crate::fit::{Devices, FitError, Follow};
use crate::published::canonical::{CanonicalConfig, canonical_init};
use artgs_core::{PerState, Splats, View};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Settings of the stages.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PaperConfig {
    /// Canonical Gaussians and part centres.
    pub canonical: CanonicalConfig,
    /// Kinds of joints.
    pub types: TypeConfig,
    /// Joint optimisation.
    pub articulate: ArticulateConfig,
}

impl Default for PaperConfig {
    /// As published.
    fn default() -> Self {
        Self { canonical: CanonicalConfig::paper(), types: TypeConfig::paper(), articulate: ArticulateConfig::paper() }
    }
}

/// What the published method gives.
#[derive(Clone, Debug, PartialEq)]
pub struct PaperResult {
    /// The object; labels are the most probable parts.
    pub trained: Trained,
    /// Predicted models of the movable parts, `[K - 1]`.
    pub models: Vec<MotionModel>,
    /// What each stage decided.
    pub trace: PublishedTrace,
}

/// Canonical start, kinds of joints and joint optimisation for `parts` parts, the static one included. `single` are the
/// Gaussians of each state alone. Stages are reported as `types` and `articulate`. The same seed gives the same bytes on the
/// processor.
pub fn paper_pipeline(
    views: PerState<&[View]>,
    single: &PerState<Splats>,
    parts: usize,
    config: &PaperConfig,
    seed: u64,
    devices: &dyn Devices,
    follow: &mut dyn Follow,
) -> Result<PaperResult, FitError> {
    let canonical = canonical_init(single, parts, &config.canonical, &mut Pcg64Mcg::seed_from_u64(seed))?;
    let mut trace = PublishedTrace::of_start(&canonical);
    follow.note(decisions::start(&trace, single));
    follow.stage("types");
    let models = match config.types.skip {
        true => vec![MotionModel::Free; parts - 1],
        false => {
            let mut sampling = Sampling::new(&mut *follow);
            let trained = free_motions(views, &canonical, &config.types, seed, devices, &mut sampling)?;
            trace.types = sampling.ended(config.types.steps(parts), &trained);
            models_of(&trained, &config.types)
        }
    };
    trace.turns = models.iter().map(|m| *m != MotionModel::Prismatic).collect();
    if let Some(message) = decisions::types(&trace, &config.types) {
        follow.note(message);
    }
    let start = still_start(&canonical, &models, seed);
    let targets = Some(&canonical.cd_targets);
    follow.stage("articulate");
    let mut sampling = Sampling::new(&mut *follow);
    let trained = articulate(views, start, targets, &config.articulate, seed, devices, &mut sampling)?;
    trace.articulate = sampling.ended(config.articulate.steps, &trained);
    follow.note(decisions::end(&trained));
    Ok(PaperResult { trained, models, trace })
}
