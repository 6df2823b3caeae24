//! Variants of the method that lack one idea each, as settings: the ablations of the paper, for both presets.
//!
//! The paper learns which Gaussian belongs to which part; the default method does not, it has labels from depth. Variants
//! that change how this is learnt therefore make the default learn it first (`learnt-parts`, which is what to compare them
//! with): no discovery, the surface points of each state matched and clustered as the paper does with its Gaussians,
//! general rigid motions that begin at rest and are trained with all else, joint types decided in the end by the turn.

use crate::config::{Config, Method};
use crate::fit::{LogLinear, PlateauConfig};
use crate::published::AssignKind;
use crate::published::canonical::{CanonicalStart, CentreSource};
use crate::start::{PartSource, StartSource};

const VARIANTS: [(&str, &str); 8] = [
    ("full", "the complete method"),
    ("random-gaussians", "canonical Gaussians begin at random in the object's box (w/o Cano. Init.)"),
    ("random-centres", "part centres are learnt from random ones (w/o Center Init.)"),
    ("cluster-all", "part centres are learnt from clusters of everything, not of what moved (w/o Motion Prior)"),
    ("no-types", "joints stay general rigid motions; types are decided by the final rotation (w/o Joint Pred.)"),
    ("mlp", "a perceptron of the position assigns parts (w/ MLP Seg)"),
    ("slots", "slot attention assigns parts (w/ SA Seg)"),
    ("learnt-parts", "default only: parts and motions learnt as the paper learns them, instead of found in depth"),
];

/// Why there is no such variant.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AblationError {
    /// Not a name of [`variants`].
    #[error("there is no variant `{name}`; there are: {known}")]
    Unknown {
        /// What was asked for.
        name: String,
        /// All names.
        known: String,
    },
    /// The method does not have what the variant takes away.
    #[error("variant `{name}` has no meaning for this method: {reason}")]
    Meaningless {
        /// The variant.
        name: &'static str,
        /// What is missing.
        reason: &'static str,
    },
}

/// Names and one-line descriptions.
pub fn variants() -> &'static [(&'static str, &'static str)] {
    &VARIANTS
}

/// The settings without what a variant takes away; nothing else changes but what the module's head says.
pub fn apply(name: &str, config: Config) -> Result<Config, AblationError> {
    let Some((name, _)) = VARIANTS.iter().find(|v| v.0 == name) else {
        let known = VARIANTS.map(|v| v.0).join(", ");
        return Err(AblationError::Unknown { name: name.into(), known });
    };
    let meaningless = |reason| Err(AblationError::Meaningless { name, reason });
    match (config.method, *name) {
        (_, "full") => Ok(config),
        (Method::Registration, _) => meaningless("the registration baseline trains nothing"),
        (Method::Paper, "learnt-parts") => meaningless("the published method always learns its parts"),
        (Method::Paper, name) => Ok(published(name, config)),
        (Method::Discover, name) => Ok(default(name, config)),
    }
}

fn published(name: &str, mut config: Config) -> Config {
    match name {
        "random-gaussians" => config.canonical.start = CanonicalStart::Random,
        "no-types" => config.types.skip = true,
        name => learning(name, &mut config),
    }
    config
}

fn default(name: &str, mut config: Config) -> Config {
    match name {
        "random-gaussians" => config.start.from = StartSource::Random,
        "no-types" => config.discover.decide_joints = false,
        name => {
            learn_parts(&mut config);
            learning(name, &mut config);
        }
    }
    config
}

/// What differs in learning an assignment.
fn learning(name: &str, config: &mut Config) {
    match name {
        "random-centres" => config.canonical.centres = CentreSource::Random,
        "cluster-all" => config.canonical.centres = CentreSource::All,
        "mlp" => {
            config.articulate.assign.kind = AssignKind::Mlp;
            config.types.train.assign.kind = AssignKind::Mlp;
        }
        "slots" => {
            config.articulate.assign.kind = AssignKind::Slots;
            config.types.train.assign.kind = AssignKind::Slots;
        }
        _ => {}
    }
}

/// Makes the default learn parts and motions, with what the published optimisation has and the default does without: the
/// Chamfer term, the pull of centres, rates that let parts move far, and no stop before the end.
fn learn_parts(config: &mut Config) {
    config.start.parts = PartSource::Learnt;
    let train = &mut config.articulate;
    train.learn_joints = true;
    train.joint_rate = LogLinear { from: 4e-3, to: 1e-4, steps: train.steps };
    train.chamfer = 100.0;
    train.chamfer_after = 0;
    train.chamfer_before = train.steps / 2;
    train.assign.centre_weight = 0.1;
    train.plateau = PlateauConfig::never();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_variant_differs_survives_a_file_and_changes_only_its_own_settings() {
        for preset in [Config::default(), Config::paper()] {
            let mut seen = vec![preset.clone()];
            for (name, _) in &variants()[1..] {
                let Ok(changed) = apply(name, preset.clone()) else {
                    assert_eq!((*name, preset.method), ("learnt-parts", Method::Paper));
                    continue;
                };
                assert!(!seen.contains(&changed), "{name} is like another variant");
                assert_eq!(Config::default().overridden_by(&changed.to_toml().unwrap()).unwrap(), changed, "{name}");
                let back = Config {
                    start: preset.start,
                    canonical: preset.canonical.clone(),
                    types: preset.types.clone(),
                    discover: preset.discover.clone(),
                    articulate: preset.articulate.clone(),
                    ..changed.clone()
                };
                assert_eq!(back, preset, "{name} touches other sections");
                seen.push(changed);
            }
        }
    }

    #[test]
    fn published_variants_are_single_settings() {
        let paper = Config::paper();
        let only = |name: &str, undo: fn(&mut Config)| {
            let mut config = apply(name, paper.clone()).unwrap();
            assert!(config != paper);
            undo(&mut config);
            assert_eq!(config, paper, "{name}");
        };
        only("random-gaussians", |c| c.canonical.start = CanonicalStart::Matched);
        only("random-centres", |c| c.canonical.centres = CentreSource::Moved);
        only("cluster-all", |c| c.canonical.centres = CentreSource::Moved);
        only("no-types", |c| c.types.skip = false);
        for name in ["mlp", "slots"] {
            only(name, |c| {
                c.articulate.assign.kind = AssignKind::Centres;
                c.types.train.assign.kind = AssignKind::Centres;
            });
        }
        assert_eq!(apply("full", paper.clone()).unwrap(), paper);
    }

    #[test]
    fn what_has_no_meaning_is_refused_with_a_reason() {
        let message = |name: &str, config: Config| apply(name, config).unwrap_err().to_string();
        assert!(message("magic", Config::default()).contains("random-centres"));
        assert!(message("learnt-parts", Config::paper()).contains("always learns"));
        assert!(message("mlp", Config::registration()).contains("trains nothing"));
    }
}
