//! A baseline without Gaussians: what moved, seen in depth, is split into clusters, the clusters of the two states are
//! matched one to one and registered, and the motions are read as joints. What registration baselines of the published
//! comparisons stand for; nothing here looks back at a decision once it is made.

mod align;

use crate::canonical::CanonicalError;
use crate::canonical::cluster::{ClusterConfig, spectral_clusters};
use crate::discover::label::AtRest;
use crate::discover::observe::Cloud;
use crate::discover::{DiscoverError, Discovery, Scene, borne_out};
use crate::evaluate::matching::hungarian;
use align::Fit;
use artgs_core::{Joint, JointEstimate, JointKind, Rigid};
use glam::Vec3;
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
    /// A part whose motion turns by more than this (degrees) is taken for revolute; the published rule for half motions
    /// is 10.
    pub revolute_deg: f64,
    /// Farthest that points look for partners at first, relative to the object's diagonal.
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

/// Why the baseline gives nothing.
#[derive(Debug, thiserror::Error)]
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

/// Finds `movable` parts. Points that moved carry the part of their cluster, all others the static part. The same seed
/// gives the same bytes.
pub fn register_parts(
    scene: &Scene,
    movable: usize,
    config: &RegistrationConfig,
    seed: u64,
) -> Result<Discovery, RegistrationError> {
    let clouds = [&scene.states[0].cloud, &scene.states[1].cloud];
    let mut members: [Vec<Vec<usize>>; 2] = Default::default();
    for state in 0..2 {
        let at_rest = scene.at_rest(state);
        let moved: Vec<usize> = (0..clouds[state].len()).filter(|&i| at_rest[i] == AtRest::Gone).collect();
        if moved.len() < LEAST {
            return Err(DiscoverError::NothingMoved.into());
        }
        let points: Vec<[f32; 3]> = moved.iter().map(|&i| clouds[state].points[i].to_array()).collect();
        let mut rng = Pcg64Mcg::seed_from_u64(seed.wrapping_add(state as u64));
        let clusters = spectral_clusters(&points, movable, &config.cluster, &mut rng)?;
        members[state] = vec![Vec::new(); movable];
        moved.iter().zip(&clusters).for_each(|(&i, &k)| members[state][usize::from(k)].push(i));
    }
    let groups = [0, 1].map(|s| members[s].iter().map(|m| clouds[s].select(m)).collect::<Vec<Cloud>>());
    let pairs = matched(&groups, scene, config);

    let mut labels = [vec![0u16; clouds[0].len()], vec![0u16; clouds[1].len()]];
    let (mut parts, mut warnings) = (Vec::new(), Vec::new());
    for (k, (a, b, fit)) in pairs.iter().enumerate() {
        members[0][*a].iter().for_each(|&i| labels[0][i] = k as u16 + 1);
        members[1][*b].iter().for_each(|&i| labels[1][i] = k as u16 + 1);
        let (start, end) = (&groups[0][*a], &groups[1][*b]);
        if fit.is_none() {
            warnings.push(format!("part {} has too few points to be registered", k + 1));
        }
        parts.push(part(start, end, *fit, scene, config));
    }
    for (k, part) in parts.iter_mut().enumerate() {
        part.confidence = borne_out(scene, &labels, k as u16 + 1, &part.motion);
    }
    Ok(Discovery {
        clouds: [clouds[0].clone(), clouds[1].clone()],
        labels,
        parts,
        diagonal: scene.scales.diagonal.into(),
        spacing: scene.scales.spacing.into(),
        tolerance: scene.tolerance.into(),
        warnings,
    })
}

/// Clusters of start and end that fit each other best, one to one, with the motions between them; largest first.
fn matched(groups: &[Vec<Cloud>; 2], scene: &Scene, config: &RegistrationConfig) -> Vec<(usize, usize, Option<Fit>)> {
    let fit = |a: &Cloud, b: &Cloud| (a.len().min(b.len()) >= LEAST).then(|| align::align(a, b, &scene.scales, config));
    let fits: Vec<Vec<Option<Fit>>> = groups[0].iter().map(|a| groups[1].iter().map(|b| fit(a, b)).collect()).collect();
    let cost = |fit: &Option<Fit>| fit.map_or(f64::from(scene.scales.diagonal), |f| f.cost);
    let costs: Vec<Vec<f64>> = fits.iter().map(|row| row.iter().map(cost).collect()).collect();
    let taken = hungarian(&costs, groups[1].len());
    let mut pairs: Vec<_> = taken.iter().enumerate().filter_map(|(a, b)| b.map(|b| (a, b, fits[a][b]))).collect();
    pairs.sort_by_key(|&(a, b, _)| std::cmp::Reverse(groups[0][a].len() + groups[1][b].len()));
    pairs
}

/// Type by the turn, then the motion on that joint. Without a fit: the shift between the middles.
fn part(start: &Cloud, end: &Cloud, fit: Option<Fit>, scene: &Scene, config: &RegistrationConfig) -> JointEstimate {
    let middle = |c: &Cloud| (c.points.iter().sum::<Vec3>() / c.len().max(1) as f32).as_dvec3();
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
    let bound = align::on_joint(start, end, guess, kind, &scene.scales);
    JointEstimate { kind, motion: bound.motion, rms: bound.rms, confidence: None }
}
