//! A baseline without Gaussians: what moved, seen in depth, is split into clusters, the clusters of the two states are
//! matched one to one and registered, and the motions are read as joints. It stands for the registration baselines of the
//! published comparisons; no decision is revised by a later step.

mod align;

use crate::discover::diagnosis::DiagnosisSettings;
use crate::discover::visibility::Occupancy;
use crate::discover::{Cloud, DiscoverError, Discovery, Scene, without_parts};
use crate::hungarian::hungarian;
use crate::published::canonical::CanonicalError;
use crate::published::canonical::cluster::{ClusterConfig, spectral_clusters};
use align::{Fit, middle};
use artgs_core::{Joint, JointEstimate, JointKind, PerState, Rigid, State};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Least points of a cluster that is registered.
const LEAST: usize = 24;

/// Settings of the baseline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegistrationConfig {
    /// How the moved points of each state are split.
    pub cluster: ClusterConfig,
    /// A part whose motion turns by more than this (degrees) is revolute; the published rule for half motions is 10.
    pub revolute_deg: f64,
    /// Largest distance of matched points at first, relative to the object's diagonal.
    pub reach: f64,
    /// Turns tried about each principal axis of a cluster.
    pub turns: usize,
    /// Points of each cluster that take part in the first, rough registrations.
    pub rough_points: usize,
}

impl Default for RegistrationConfig {
    fn default() -> Self {
        Self { cluster: ClusterConfig::default(), revolute_deg: 5.0, reach: 0.12, turns: 12, rough_points: 400 }
    }
}

/// Why the baseline finds nothing.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RegistrationError {
    /// A view has no depth.
    #[error("the registration baseline needs depth in every training view; state {0} lacks it: use the default method")]
    NoDepth(&'static str),
    /// Nothing to split.
    #[error(transparent)]
    Discover(#[from] DiscoverError),
    /// The moved points cannot be split.
    #[error("clusters of moved points: {0}")]
    Cluster(#[from] CanonicalError),
}

/// Finds `movable` parts. Points that moved have the part of their cluster, all others the static part. The same seed
/// gives the same bytes.
pub(crate) fn register_parts(
    scene: &Scene,
    movable: usize,
    config: &RegistrationConfig,
    seed: u64,
) -> Result<Discovery, RegistrationError> {
    let members = State::ALL.map(|s| clusters(scene, s, movable, config, seed));
    let [start, end] = members;
    let members = PerState::new(start?, end?);
    let groups =
        PerState::from_fn(|s| members[s].iter().map(|m| scene.states[s].cloud.select(m)).collect::<Vec<Cloud>>());
    let pairs = matched(&groups, scene, config);

    let mut found = without_parts(scene);
    for (k, (pair, fit)) in pairs.iter().enumerate() {
        for s in State::ALL {
            members[s][pair[s]].iter().for_each(|&i| found.labels[s][i] = k as u16 + 1);
        }
        if fit.is_none() {
            found.warnings.push(format!("part {} has too few points to be registered", k + 1));
        }
        let cloud = |s: State| &groups[s][pair[s]];
        found.parts.push(part(cloud(State::START), cloud(State::END), *fit, scene, config));
    }
    let diagnosis = DiagnosisSettings::default();
    for (k, part) in found.parts.iter_mut().enumerate() {
        part.confidence = diagnosis.fit(scene, &found.labels, k as u16 + 1, &part.motion);
    }
    Ok(found)
}

/// Points of each cluster of what moved, in one state.
fn clusters(
    scene: &Scene,
    state: State,
    movable: usize,
    config: &RegistrationConfig,
    seed: u64,
) -> Result<Vec<Vec<usize>>, RegistrationError> {
    let cloud = &scene.states[state].cloud;
    let occupancy = scene.occupancy_elsewhere(state);
    let moved: Vec<usize> = (0..cloud.len()).filter(|&i| occupancy[i] == Occupancy::Empty).collect();
    if moved.len() < LEAST {
        return Err(DiscoverError::NothingMoved.into());
    }
    let points: Vec<[f32; 3]> = moved.iter().map(|&i| cloud.points[i].to_array()).collect();
    let mut rng = Pcg64Mcg::seed_from_u64(seed.wrapping_add(state.index() as u64));
    let cluster_of = spectral_clusters(&points, movable, &config.cluster, &mut rng)?;
    let mut members = vec![Vec::new(); movable];
    moved.iter().zip(&cluster_of).for_each(|(&i, &k)| members[usize::from(k)].push(i));
    Ok(members)
}

/// A cluster of each state and the motion between them.
type MatchedClusters = (PerState<usize>, Option<Fit>);

/// Clusters of start and end that fit each other best, one to one, with the motions between them; largest first.
fn matched(groups: &PerState<Vec<Cloud>>, scene: &Scene, config: &RegistrationConfig) -> Vec<MatchedClusters> {
    let fit =
        |a: &Cloud, b: &Cloud| (a.len().min(b.len()) >= LEAST).then(|| align::align(a, b, &scene.lengths, config));
    let (starts, ends) = (&groups[State::START], &groups[State::END]);
    let fits: Vec<Vec<Option<Fit>>> = starts.iter().map(|a| ends.iter().map(|b| fit(a, b)).collect()).collect();
    let cost = |fit: &Option<Fit>| fit.map_or(f64::from(scene.lengths.diagonal), |f| f.cost);
    let costs: Vec<Vec<f64>> = fits.iter().map(|row| row.iter().map(cost).collect()).collect();
    let taken = hungarian(&costs, ends.len());
    let pairs = taken.iter().enumerate().filter_map(|(a, b)| b.map(|b| (PerState::new(a, b), fits[a][b])));
    let mut pairs: Vec<MatchedClusters> = pairs.collect();
    pairs.sort_by_key(|(pair, _)| {
        std::cmp::Reverse(State::ALL.into_iter().map(|s| groups[s][pair[s]].len()).sum::<usize>())
    });
    pairs
}

/// Type by the turn, then the motion on that joint. Without a fit: the shift between the middles.
fn part(start: &Cloud, end: &Cloud, fit: Option<Fit>, scene: &Scene, config: &RegistrationConfig) -> JointEstimate {
    let Some(fit) = fit else {
        let motion = if start.is_empty() || end.is_empty() {
            Rigid::IDENTITY
        } else {
            Rigid::shift(middle(end) - middle(start))
        };
        return JointEstimate::new(JointKind::Prismatic, motion);
    };
    let turns = fit.motion.angle().to_degrees() > config.revolute_deg;
    let (kind, guess) = if turns {
        (JointKind::Revolute, Joint::from_motion(JointKind::Revolute, &fit.motion).start_to_end())
    } else {
        (JointKind::Prismatic, Rigid::shift(fit.motion.apply(middle(start)) - middle(start)))
    };
    let on_joint = align::on_joint(start, end, guess, kind, &scene.lengths);
    JointEstimate { rms: on_joint.rms, ..JointEstimate::new(kind, on_joint.motion) }
}
