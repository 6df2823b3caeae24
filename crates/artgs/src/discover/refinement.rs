//! From motions to parts: points are labelled and parts registered in turn, parts that explain next to nothing are
//! removed, and bodies that move alike are separated.

use super::cloud::{Cloud, IndexedCloud};
use super::config::StepSettings;
use super::front::Front;
use super::joints::{Decided, JointFit};
use super::known::{members_of_parts, selected};
use super::parents::{Carriers, Numbering, parents_first};
use super::scene::Scene;
use super::segmentation::Labelling;
use super::support::Support;
use super::{DiscoverConfig, Evidence};
use artgs_core::{JointEstimate, JointKind, PerState, Rigid, State};
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Parts with their labelled points.
#[derive(Clone)]
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
    /// The side on which the object opens, if it has one.
    pub(super) front: Option<Front>,
    /// Called before each round of refinement.
    pub(super) begun: &'a dyn Fn(),
}

impl Refinement<'_> {
    /// Parts that move by `motions` (start to end), as many as `movable` allows. Bodies with slightly different motions may
    /// share one at first: once they are separated, each is registered by itself, and all points are labelled again with
    /// the motions found then.
    pub(super) fn parts(&self, motions: &[Rigid], movable: &RangeInclusive<usize>) -> Parts {
        self.aligned(self.separated(self.refined(motions), movable))
    }

    /// With slides along the direction that they and the front agree on, where depth noise spreads points.
    pub(super) fn aligned(&self, mut found: Parts) -> Parts {
        if self.scene.spreading && self.config.decide_joints {
            self.settings.rails.align(self.scene, self.clouds, &found.labels, &mut found.parts, self.front);
        }
        found
    }

    /// Parts with support, those that move alike separated. A part without support, or a piece that turns out to have none, does not
    /// take the number of one that moves like another: it is only kept if there are too few parts without it.
    fn separated(&self, refined: Parts, movable: &RangeInclusive<usize>) -> Parts {
        /// Pieces beyond the largest number of parts that are looked at.
        const EXTRA: usize = 3;
        let (least, most) = (*movable.start(), *movable.end());
        let found = self.separated_from(self.supported(refined.clone(), least.min(1)), least.min(1), most + EXTRA);
        if movable.contains(&found.parts.len()) {
            return found;
        }
        self.separated_from(self.supported(refined, least), least, most)
    }

    /// Separates parts that move alike, at most `most`. Those without support are removed, but `least` stay.
    fn separated_from(&self, mut found: Parts, least: usize, most: usize) -> Parts {
        /// Rounds of separating bodies.
        const ROUNDS: usize = 3;
        for round in 1..=ROUNDS {
            let before = found.parts.len();
            let mut split = found.clone();
            self.split(&mut split, most);
            let distinct = self.distinct_motions(&split);
            if distinct.len() <= before || round == ROUNDS {
                return split;
            }
            found = self.supported(self.refined(&distinct), least);
        }
        found
    }

    /// Without parts that lack support, but at least `least`.
    fn supported(&self, mut found: Parts, least: usize) -> Parts {
        while found.parts.len() > least {
            let Some(weakest) = self.unsupported(&found) else { break };
            let kept = (0..found.parts.len()).filter(|k| *k != weakest);
            let motions: Vec<Rigid> = kept.map(|k| found.parts[k].motion).collect();
            found = self.refined(&motions);
        }
        found
    }

    /// Motions of parts, those that take a part's points to the same places as an earlier one left out. Places within the depth
    /// tolerance are the same: labels could not separate such parts again.
    fn distinct_motions(&self, found: &Parts) -> Vec<Rigid> {
        /// Places this close are the same, too, spacings.
        const SAME: f32 = 0.4;
        let same = f64::from((SAME * self.scene.lengths.spacing).max(self.scene.tolerance));
        let mut out: Vec<Rigid> = Vec::new();
        for (k, part) in found.parts.iter().enumerate() {
            let own = points_of_part(self.clouds, &found.labels, k as u16 + 1);
            let points = &own[State::START].points;
            let gap = |m: &Rigid, p: glam::DVec3| m.apply(p).distance(part.motion.apply(p));
            let alike = |m: &Rigid| points.iter().step_by(16).all(|p| gap(m, p.as_dvec3()) < same);
            if !points.is_empty() && !out.iter().any(alike) {
                out.push(part.motion);
            }
        }
        out
    }

    /// Parts that move by `motions`, refined once.
    pub(super) fn refined(&self, motions: &[Rigid]) -> Parts {
        self.refined_but(0, motions)
    }

    /// The same, but the first `slides` motions are slides that stay as they are.
    pub(super) fn refined_but(&self, slides: usize, motions: &[Rigid]) -> Parts {
        (self.begun)();
        let kinds = vec![None; motions.len()];
        self.refined_as(motions, slides, &kinds, Numbering::ParentsFirst)
    }

    /// Labels points and registers parts in turn, from motions start to end; the last round decides each joint, unless its
    /// kind is known, and what carries it. The first `fixed` motions are slides that stay as they are.
    pub(super) fn refined_as(
        &self,
        motions: &[Rigid],
        fixed: usize,
        kinds: &[Option<JointKind>],
        numbering: Numbering,
    ) -> Parts {
        let Self { scene, clouds, evidence, config, settings, front, .. } = *self;
        let mut parts: Vec<JointEstimate> = motions.iter().map(|m| JointEstimate::new(JointKind::Screw, *m)).collect();
        let labelling = Labelling {
            scene,
            clouds,
            graphs: &evidence.graphs,
            known: &evidence.landings,
            occupancy: &evidence.occupancy,
            costs: settings.label_costs,
            settings: settings.segmentation,
        };
        let slides = motions[..fixed].iter().map(|m| JointEstimate::new(JointKind::Prismatic, *m));
        let slides: Vec<JointEstimate> = slides.collect();
        parts[..fixed].copy_from_slice(&slides);
        let (mut labels, mut labelled_by) = (PerState::default(), None);
        let rounds = config.rounds.max(1);
        for round in 0..rounds {
            let motions: Vec<Rigid> = parts.iter().map(|p| p.motion).collect();
            // The same motions lead to the same labels.
            if labelled_by.as_ref() != Some(&motions) {
                labels = labelling.labels(&motions);
                labelled_by = Some(motions);
            }
            let last = round + 1 == rounds;
            let fit = JointFit::new(scene, front, &settings.joints, config, last);
            let members = members_of_parts(&labels, parts.len());
            let own = |part: usize| selected(clouds.as_ref().map(|c| c.cloud), &members[part]);
            let numbered = parts.par_iter().enumerate();
            if last && config.decide_joints {
                let decide = |(k, part): (usize, &JointEstimate)| {
                    if k < fixed {
                        return Decided { joint: *part, general: None, misfit: 0.0 };
                    }
                    evidence.fits.decided(part, &members[k + 1], kinds[k], || fit.decide(part, &own(k + 1), kinds[k]))
                };
                let decided: Vec<Decided> = numbered.map(decide).collect();
                let clouds = (0..=parts.len()).map(own).collect();
                let carriers = Carriers { fit: &fit, settings: &settings.parents, clouds, numbering };
                parts = carriers.joints(&decided, kinds);
                // Slides that stay are carried by nothing.
                parts[..fixed].copy_from_slice(&slides);
                for (k, part) in parts.iter().enumerate().skip(fixed) {
                    evidence.fits.settle(&part.motion, &members[k + 1], kinds[k], &decided[k]);
                }
            } else {
                let refine = |(k, part): (usize, &JointEstimate)| match k < fixed {
                    true => *part,
                    false => evidence.fits.refined(part, &members[k + 1], || fit.refine(part, &own(k + 1))),
                };
                parts = numbered.map(refine).collect();
            }
        }
        if numbering == Numbering::ParentsFirst {
            parents_first(&mut parts, &mut labels);
        }
        Parts { parts, labels }
    }

    /// Parts with these motions and labels, bodies that move alike separated, with their joints and what carries them.
    pub(super) fn of_labels(&self, motions: &[Rigid], mut labels: PerState<Vec<u16>>, most: usize) -> Parts {
        let Self { scene, clouds, config, settings, front, .. } = *self;
        let sources = settings.instances.split(scene, &mut labels, motions, front, most);
        let all = motions.iter().chain(sources.iter().map(|k| &motions[*k]));
        let parts: Vec<JointEstimate> = all.map(|m| JointEstimate::new(JointKind::Screw, *m)).collect();
        let fit = JointFit::new(scene, front, &settings.joints, config, true);
        let kinds = vec![None; parts.len()];
        let own: Vec<PerState<Cloud>> =
            (0..=parts.len()).map(|part| points_of_part(clouds, &labels, part as u16)).collect();
        let decide = |(k, part): (usize, &JointEstimate)| fit.decide(part, &own[k + 1], None);
        let decided: Vec<Decided> = parts.par_iter().enumerate().map(decide).collect();
        let carriers =
            Carriers { fit: &fit, settings: &settings.parents, clouds: own, numbering: Numbering::ParentsFirst };
        let mut parts = carriers.joints(&decided, &kinds);
        parents_first(&mut parts, &mut labels);
        self.aligned(Parts { parts, labels })
    }

    /// The part with the least support, if that is too little: few points moved for certain, or other motions explain all
    /// of them.
    fn unsupported(&self, found: &Parts) -> Option<usize> {
        let Self { scene, clouds, evidence, settings, .. } = *self;
        let supports = settings.support.of_parts(scene, clouds, evidence, found);
        let least_moved = self.least_moved();
        let lacks = |s: &Support| {
            s.moved < least_moved
                || s.exclusive * s.moved < settings.support.least_exclusive
                || s.explained < settings.support.least_explained
                || s.stiffness < settings.support.least_stiffness
        };
        let lacking = supports.iter().enumerate().filter(|(_, s)| lacks(s));
        let weakest = lacking.min_by(|a, b| (a.1.exclusive * a.1.moved).total_cmp(&(b.1.exclusive * b.1.moved)));
        weakest.map(|(k, _)| k)
    }

    /// Points of a part that must have moved for certain.
    fn least_moved(&self) -> f64 {
        (self.config.least_share * self.evidence.total() as f64).max(super::LEAST_MOVED as f64)
    }

    /// Separates bodies that move alike, up to `most` parts, and registers each by itself.
    fn split(&self, found: &mut Parts, most: usize) {
        let motions: Vec<Rigid> = found.parts.iter().map(|p| p.motion).collect();
        let mut labels = found.labels.clone();
        let sources = self.settings.instances.split(self.scene, &mut labels, &motions, self.front, most);
        let least = self.least_moved();
        let bodies = motions.len() + sources.len();
        let moved = |part: usize| -> f64 {
            let of_state =
                |s: State| self.evidence.moved[s].iter().filter(|&&i| usize::from(labels[s][i]) == part).count();
            State::ALL.into_iter().map(of_state).sum::<usize>() as f64
        };
        // A body of which hardly a point moved for certain is a piece of another one.
        if sources.is_empty() || (1..=bodies).any(|part| moved(part) < least) {
            return;
        }
        let mut changed = sources.clone();
        changed.extend(found.parts.len()..found.parts.len() + sources.len());
        found.parts.extend(sources.iter().map(|k| found.parts[*k]).collect::<Vec<_>>());
        found.labels = labels;
        changed.sort_unstable();
        changed.dedup();
        let Self { scene, config, settings, front, .. } = *self;
        let fit = JointFit::new(scene, front, &settings.joints, config, true);
        for k in changed {
            // The joint of a carried part is relative to its carrier.
            if found.parts[k].parent > 0 {
                continue;
            }
            let points = points_of_part(self.clouds, &found.labels, k as u16 + 1);
            found.parts[k] = fit.decide(&found.parts[k], &points, None).joint;
        }
    }
}

/// Indices of the points of one part in every state.
pub(super) fn members_of_part(labels: &PerState<Vec<u16>>, part: u16) -> PerState<Vec<usize>> {
    labels.as_ref().map(|labels| (0..labels.len()).filter(|&i| labels[i] == part).collect())
}

/// Points of one part in every state.
pub(super) fn points_of_part(
    clouds: &PerState<IndexedCloud<'_>>,
    labels: &PerState<Vec<u16>>,
    part: u16,
) -> PerState<Cloud> {
    let members = members_of_part(labels, part);
    PerState::from_fn(|s: State| clouds[s].cloud.select(&members[s]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::discover;
    use crate::discover::test_scene::{cabinet_scene, object_scene, with_refinement};
    use glam::DVec3;

    #[test]
    fn parts_whose_points_stay_keep_their_joints_in_another_refinement() {
        let config = DiscoverConfig::default();
        let scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &config).unwrap();
        with_refinement(&scene, |work| {
            let motions: Vec<Rigid> = found.parts.iter().map(|p| p.motion).collect();
            let first = work.refined(&motions);
            let motions: Vec<Rigid> = first.parts.iter().map(|p| p.motion).collect();
            let again = work.refined(&motions);
            assert_eq!(again.parts, first.parts);
            let different =
                again.labels.iter().flatten().zip(first.labels.iter().flatten()).filter(|(a, b)| a != b).count();
            assert!(different * 500 < first.labels.iter().flatten().count(), "{different}");
        });
    }

    #[test]
    fn a_part_without_support_does_not_take_the_number_of_one_that_moves_like_another() {
        let config = DiscoverConfig::default();
        let scene = object_scene("twin_drawers", 32, 128);
        let found = discover(&scene, 2..=2, &config).unwrap();
        with_refinement(&scene, |work| {
            let shift = found.parts[0].motion;
            let of_nothing = Rigid::about(DVec3::X, DVec3::new(0.0, 0.0, 3.0), 0.5);
            let parts = work.parts(&[shift, of_nothing], &(2..=2)).parts;
            assert_eq!(parts.len(), 2);
            for part in &parts {
                assert_eq!(part.kind, JointKind::Prismatic);
                assert!(part.motion.translation.distance(shift.translation) < 0.01, "{:?}", part.motion);
            }
        });
    }
}
