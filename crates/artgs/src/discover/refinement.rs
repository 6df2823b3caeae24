//! From motions to parts: points are labelled and parts registered in turn, parts that explain next to nothing are
//! removed, and bodies that move alike are told apart.

use super::cloud::{Cloud, IndexedCloud};
use super::config::StepSettings;
use super::joints::JointFit;
use super::parents::{Carriers, Numbering, parents_first};
use super::scene::Scene;
use super::segmentation::Labelling;
use super::support::Support;
use super::{DiscoverConfig, Evidence};
use artgs_core::{JointEstimate, JointKind, PerState, Rigid, State};
use std::ops::RangeInclusive;

/// Parts with their labelled points.
pub(super) struct Parts {
    pub(super) parts: Vec<JointEstimate>,
    pub(super) labels: PerState<Vec<u16>>,
}

/// What parts are refined with.
pub(super) struct Refinement<'a> {
    pub(super) scene: &'a Scene,
    pub(super) clouds: &'a PerState<IndexedCloud<'a>>,
    pub(super) evidence: &'a Evidence,
    pub(super) config: &'a DiscoverConfig,
    pub(super) settings: &'a StepSettings,
}

impl Refinement<'_> {
    /// Parts that move by `motions` (start to end), as many as `movable` allows.
    pub(super) fn parts(&self, motions: &[Rigid], movable: &RangeInclusive<usize>) -> Parts {
        let mut found = self.refined(motions);
        while found.parts.len() > *movable.start() {
            let Some(weakest) = self.unsupported(&found) else { break };
            let kept = (0..found.parts.len()).filter(|k| *k != weakest);
            let motions: Vec<Rigid> = kept.map(|k| found.parts[k].motion).collect();
            found = self.refined(&motions);
        }
        self.split(&mut found, *movable.end());
        found
    }

    fn refined(&self, motions: &[Rigid]) -> Parts {
        let kinds = vec![None; motions.len()];
        let Self { scene, clouds, evidence, config, settings } = *self;
        let order = Numbering::ParentsFirst;
        let (parts, labels) = refine_parts(scene, clouds, evidence, motions, &kinds, order, config, settings);
        Parts { parts, labels }
    }

    /// The part with the least support, if that is too little: few points moved for certain, or other motions explain all
    /// of them.
    fn unsupported(&self, found: &Parts) -> Option<usize> {
        let Self { scene, clouds, evidence, settings, config } = *self;
        let supports = settings.support.of_parts(scene, clouds, &evidence.occupancy, &found.labels, &found.parts);
        let least_moved = (config.least_share * evidence.total() as f64).max(super::LEAST_MOVED as f64);
        let lacks = |s: &Support| s.moved < least_moved || s.exclusive * s.moved < settings.support.least_exclusive;
        let lacking = supports.iter().enumerate().filter(|(_, s)| lacks(s));
        let weakest = lacking.min_by(|a, b| (a.1.exclusive * a.1.moved).total_cmp(&(b.1.exclusive * b.1.moved)));
        weakest.map(|(k, _)| k)
    }

    /// Tells apart bodies that move alike, up to `most` parts, and registers each by itself.
    fn split(&self, found: &mut Parts, most: usize) {
        let motions: Vec<Rigid> = found.parts.iter().map(|p| p.motion).collect();
        let front = self.evidence.front(self.scene, self.clouds, self.settings);
        let poses = &self.settings.candidates.poses;
        let directions = poses.face_directions(self.clouds[State::END].cloud);
        let mut labels = found.labels.clone();
        let sources = self.settings.instances.split(self.scene, &mut labels, &motions, front, &directions);
        if sources.is_empty() || found.parts.len() + sources.len() > most {
            return;
        }
        let mut changed = sources.clone();
        changed.extend(found.parts.len()..found.parts.len() + sources.len());
        found.parts.extend(sources.iter().map(|k| found.parts[*k]).collect::<Vec<_>>());
        found.labels = labels;
        changed.sort_unstable();
        changed.dedup();
        let Self { scene, config, settings, .. } = *self;
        let (lengths, tolerance) = (&scene.lengths, scene.tolerance.into());
        let fit = JointFit { lengths, tolerance, settings: &settings.joints, config, last: true };
        for k in changed {
            // The joint of a carried part is relative to its carrier.
            if found.parts[k].parent > 0 {
                continue;
            }
            let points = points_of_part(self.clouds, &found.labels, k as u16 + 1);
            let kind = found.parts[k].kind;
            found.parts[k] = fit.decide(&found.parts[k], &points, Some(kind)).joint;
        }
    }
}

/// Labels points and registers parts in turn, from motions start to end; the last round decides each joint, unless its
/// kind is known, and what carries it.
#[expect(clippy::too_many_arguments, reason = "what was measured, what is known, how to number, and settings")]
pub(super) fn refine_parts(
    scene: &Scene,
    clouds: &PerState<IndexedCloud<'_>>,
    evidence: &Evidence,
    motions: &[Rigid],
    kinds: &[Option<JointKind>],
    numbering: Numbering,
    config: &DiscoverConfig,
    settings: &StepSettings,
) -> (Vec<JointEstimate>, PerState<Vec<u16>>) {
    let mut parts: Vec<JointEstimate> = motions.iter().map(|m| JointEstimate::new(JointKind::Screw, *m)).collect();
    let graphs = clouds.as_ref().map(|c| settings.graph.graph(c.cloud, scene.lengths.spacing));
    let labelling = Labelling {
        scene,
        clouds,
        graphs: &graphs,
        occupancy: &evidence.occupancy,
        costs: settings.label_costs,
        settings: settings.segmentation,
    };
    let mut labels = PerState::default();
    let rounds = config.rounds.max(1);
    for round in 0..rounds {
        let motions: Vec<Rigid> = parts.iter().map(|p| p.motion).collect();
        labels = labelling.labels(&motions);
        let (lengths, tolerance, last) = (&scene.lengths, scene.tolerance.into(), round + 1 == rounds);
        let fit = JointFit { lengths, tolerance, settings: &settings.joints, config, last };
        let own = |part: usize| points_of_part(clouds, &labels, part as u16);
        if last && config.decide_joints {
            let clouds = (0..=parts.len()).map(own).collect();
            let carriers = Carriers { fit: &fit, settings: &settings.parents, clouds, numbering };
            parts = carriers.joints(&parts, kinds);
        } else {
            parts.iter_mut().enumerate().for_each(|(k, part)| *part = fit.refine(part, &own(k + 1)));
        }
    }
    if numbering == Numbering::ParentsFirst {
        parents_first(&mut parts, &mut labels);
    }
    (parts, labels)
}

/// Points of one part in every state.
pub(super) fn points_of_part(clouds: &PerState<IndexedCloud<'_>>, labels: &PerState<Vec<u16>>, part: u16) -> PerState<Cloud> {
    PerState::from_fn(|s: State| {
        let members: Vec<usize> = (0..labels[s].len()).filter(|&i| labels[s][i] == part).collect();
        clouds[s].cloud.select(&members)
    })
}

