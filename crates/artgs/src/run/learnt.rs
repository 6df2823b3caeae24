//! Parts and motions that training learnt, in the form of found ones; and the start of such a training from depth.

use super::points::discs;
use crate::articulation::{MotionModel, MotionParameters};
use crate::articulation::{Start, Trained};
use crate::config::Config;
use crate::discover::Discovery;
use crate::neighbours::PointTree;
use crate::published::canonical::{Canonical, CanonicalError, canonical_init};
use crate::published::types::still_start;
use artgs_core::{JointEstimate, JointKind, PerState, Rigid};
use glam::DVec3;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// The start of training where only surface points are known: as Gaussians of each state they are input of the published
/// canonical start, and parts begin without motion.
pub(super) fn uninformed_start(
    found: &Discovery,
    parts: usize,
    config: &Config,
) -> Result<(Start, Canonical), CanonicalError> {
    let single = PerState::from_fn(|state| discs(&found.clouds[state], found.spacing, &config.start));
    let mut rng = Pcg64Mcg::seed_from_u64(config.seed);
    let canonical = canonical_init(&single, parts, &config.canonical, &mut rng)?;
    let start = still_start(&canonical, &vec![MotionModel::Free; parts - 1], config.seed);
    Ok((start, canonical))
}

/// Kinds and motions of trained parts. A motion of any kind is revolute where its half turns by more than `half_angle`
/// radians, else the shift of the part's middle.
pub(super) fn joints_of(trained: &Trained, half_angle: f64) -> Vec<JointEstimate> {
    let joint = |(k, learnt): (usize, &MotionParameters)| {
        let motion = learnt.full_motion();
        let general = matches!(learnt.model(), MotionModel::Free | MotionModel::Screw);
        let turns = learnt.half_motion().angle() > half_angle;
        let kind = match general {
            true if turns => JointKind::Revolute,
            true => JointKind::Prismatic,
            false => learnt.joint_kind(half_angle),
        };
        let shift = general && kind == JointKind::Prismatic;
        let motion = if shift { Rigid::shift(shift_of_middle(trained, k + 1, &motion)) } else { motion };
        JointEstimate { rms: Some(0.0), ..JointEstimate::new(kind, motion) }
    };
    trained.joints.iter().enumerate().map(joint).collect()
}

/// How far a motion from start to end takes the middle of a part; where it has no Gaussians, the world's origin.
fn shift_of_middle(trained: &Trained, part: usize, motion: &Rigid) -> DVec3 {
    let points: Vec<DVec3> =
        trained.members(part).map(|i| DVec3::from_array(trained.splats.means[i].map(f64::from))).collect();
    let middle = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    // From the canonical state, where the Gaussians are, to both ends.
    let half = motion.power(0.5);
    half.apply(middle) - half.inverse().apply(middle)
}

/// The same points, each with the part of the nearest trained Gaussian of its state that is more than half opaque.
pub(super) fn relabelled(found: &Discovery, trained: &Trained) -> Discovery {
    let labels = PerState::from_fn(|state| {
        let posed = trained.at_state(state);
        let opaque: Vec<usize> = (0..posed.len()).filter(|&i| posed.logit_opacities[i] > 0.0).collect();
        let tree = PointTree::new(&opaque.iter().map(|&i| posed.means[i]).collect::<Vec<_>>());
        let label = |p: &glam::Vec3| tree.nearest(&p.to_array()).map_or(0, |(j, _)| trained.labels[opaque[j]]);
        found.clouds[state].points.par_iter().with_min_len(256).map(label).collect()
    });
    Discovery { labels, ..found.clone() }
}
