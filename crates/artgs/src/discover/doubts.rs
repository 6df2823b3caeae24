//! Parts of which the joint is doubtful are removed, or get another motion, while the others then explain more for certain.

use super::Discovery;
use super::bodies::{Body, BodySettings};
use super::candidates::Candidate;
use super::refinement::{Parts, Refinement};
use artgs_core::Rigid;
use std::ops::{Range, RangeInclusive};

/// The better of the parts that were found first, without doubtful ones, and of `bodies`, which are tried where the first parts are
/// doubtful. Where depth noise does not spread points and bodies are sure, no part is exchanged for another before.
pub(super) fn settled<'b>(
    found: Discovery,
    work: &Refinement<'_>,
    movable: &RangeInclusive<usize>,
    pool: &[Candidate],
    result: &dyn Fn(Parts) -> Discovery,
    bodies: &dyn Fn() -> Option<&'b Discovery>,
) -> Discovery {
    let (total, settings) = (work.evidence.total(), &work.settings.bodies);
    let may_be_bodies = may_be_bodies(work);
    let spreading = work.scene.spreading;
    let first = found.quality(total);
    if let Some(sure) = better_if_sure(&found, settings.doubtful, work, movable, bodies) {
        return sure;
    }
    // With a body that its motion only hides, the parts explain less than it seems once that body is part of another one again.
    let hiding = (spreading && found.hides_a_part()).then_some(first);
    let found = without_doubtful(found, work, *movable.start(), pool, result);
    let quality = hiding.unwrap_or_else(|| found.quality(total));
    if !may_be_bodies || quality > settings.doubtful {
        return found;
    }
    let others = bodies().filter(|others| is_better(others, quality, work, movable));
    others.cloned().unwrap_or(found)
}

/// What was found, or, if that explains too little for certain of `moved` points, the parts of one of these `numbers` of motions, if they
/// explain more. `with` finds the parts of a number of motions.
pub(super) fn or_fewer(
    mut found: Discovery,
    numbers: Range<usize>,
    moved: usize,
    settings: &BodySettings,
    with: &dyn Fn(usize) -> Discovery,
) -> Discovery {
    /// Numbers that are tried: each needs a refinement.
    const MOST: usize = 3;
    if found.quality(moved) > settings.insufficient {
        return found;
    }
    for number in numbers.take(MOST) {
        let other = with(number);
        if other.quality(moved) > found.quality(moved) + settings.better {
            found = other;
        }
    }
    found
}

/// Bodies, if parts of motions that were refined once explain far too little and bodies are sure: the parts are then not refined any
/// further.
pub(super) fn sure_bodies<'b>(
    refined: &Parts,
    work: &Refinement<'_>,
    movable: &RangeInclusive<usize>,
    result: &dyn Fn(Parts) -> Discovery,
    bodies: &dyn Fn() -> Option<&'b Discovery>,
) -> Option<Discovery> {
    /// The refinement of fewer parts that this saves is short.
    const LEAST: usize = 4;
    if refined.parts.len() < LEAST || !may_be_sure(work) {
        return None;
    }
    better_if_sure(&result(refined.clone()), work.settings.bodies.insufficient, work, movable, bodies)
}

/// Bodies if they are sure and better than what was found, of which the quality is `most` at most.
fn better_if_sure<'b>(
    found: &Discovery,
    most: f64,
    work: &Refinement<'_>,
    movable: &RangeInclusive<usize>,
    bodies: &dyn Fn() -> Option<&'b Discovery>,
) -> Option<Discovery> {
    let quality = found.quality(work.evidence.total());
    if !may_be_sure(work) || quality > most {
        return None;
    }
    let sure = |others: &&Discovery| is_better(others, quality, work, movable) && doubtful(others, DOUBTFUL).is_empty();
    bodies().filter(sure).cloned()
}

/// True if bodies can be sure: where depth noise spreads points, none are.
fn may_be_sure(work: &Refinement<'_>) -> bool {
    may_be_bodies(work) && !work.scene.spreading
}

/// True if bodies are worth a trial.
fn may_be_bodies(work: &Refinement<'_>) -> bool {
    work.config.decide_joints && !work.evidence.is_scarce()
}

/// True if there are as many bodies as may be and they explain more than `quality`.
fn is_better(bodies: &Discovery, quality: f64, work: &Refinement<'_>, movable: &RangeInclusive<usize>) -> bool {
    let better = bodies.quality(work.evidence.total()) > quality + work.settings.bodies.better;
    better && movable.contains(&bodies.parts.len())
}

/// Without doubtful parts, but at least `least` parts, or with their motion replaced by the best different one, while the parts
/// then explain more for certain: where depth is noisy or parts look alike, a wrong motion takes points from the part that they
/// belong to.
fn without_doubtful(
    mut found: Discovery,
    work: &Refinement<'_>,
    least: usize,
    pool: &[Candidate],
    result: &dyn Fn(Parts) -> Discovery,
) -> Discovery {
    let total = work.evidence.total();
    let mut tried = 0;
    'improved: loop {
        let count = found.parts.len();
        for k in doubtful(&found, DOUBTFUL) {
            let others: Vec<Rigid> = (0..count).filter(|&other| other != k).map(|k| found.parts[k].motion).collect();
            let support = &found.support[k];
            let fair = support.fair_rival.filter(|_| support.contested > CONTESTED);
            let with_rival = fair.or(support.rival).map(|rival| {
                let motions = others.iter().copied().chain([pool[rival].motion]).collect::<Vec<_>>();
                (motions, count)
            });
            // Where noise spreads points, the others may be several parts that move alike once they hold its points.
            let most = if work.scene.spreading { count } else { count - 1 };
            let without = (count > least.max(1)).then_some((others, most));
            for (motions, most) in [without, with_rival].into_iter().flatten() {
                if tried == TRIALS {
                    return found;
                }
                tried += 1;
                let other = result(work.parts(&motions, &(least.max(1)..=most)));
                let allowed = !other.parts.is_empty() && other.parts.len() <= most;
                if allowed && keeps_explaining(&found, k, &other) && other.quality(total) > found.quality(total) {
                    found = other;
                    continue 'improved;
                }
            }
        }
        return found;
    }
}

/// Parts of bodies. Where depth noise spreads points, without uncertain bodies, but at least `least`, while the others then explain
/// more for certain: the floor of an open drawer fits that of the drawer above it.
pub(super) fn certain_bodies(
    bodies: Vec<Body>,
    work: &Refinement<'_>,
    least: usize,
    result: &dyn Fn(Parts) -> Discovery,
) -> Discovery {
    let refined = |bodies: Vec<Body>| {
        let (parts, bodies) = work.of_bodies(bodies);
        (result(parts), bodies)
    };
    let (found, bodies) = refined(bodies);
    let moved = work.evidence.total();
    if work.scene.spreading { without_uncertain(found, bodies, least.max(1), moved, &refined) } else { found }
}

/// Without bodies of which the others, at least `least`, explain more for certain. Body `k` is that of part `k`; `refined` finds the parts of bodies
/// and which of these remain; `moved` points moved for certain.
fn without_uncertain(
    mut found: Discovery,
    mut bodies: Vec<Body>,
    least: usize,
    moved: usize,
    refined: &dyn Fn(Vec<Body>) -> (Discovery, Vec<Body>),
) -> Discovery {
    /// Confidence below which a body is tried without: what a region of space holds is not explained by a body elsewhere.
    const UNCERTAIN: f64 = 0.7;
    /// A doubtful body must raise the quality by this: what it does not explain lowers the confidence of all others.
    const WORTH: f64 = 0.03;
    let mut tried = 0;
    'improved: loop {
        for k in doubtful(&found, UNCERTAIN) {
            if tried == TRIALS || bodies.len() <= least {
                return found;
            }
            tried += 1;
            let mut others = bodies.clone();
            others.remove(k);
            let (other, others) = refined(others);
            let worth = if found.parts[k].confidence.unwrap_or(0.0) < DOUBTFUL { WORTH } else { 0.0 };
            let better = other.quality(moved) > found.quality(moved) - worth;
            if better && !other.parts.is_empty() && keeps_explaining(&found, k, &other) {
                (found, bodies) = (other, others);
                continue 'improved;
            }
        }
        return found;
    }
}

/// Confidence below which a part is doubtful: among joints of captures with ground truth, one in ten was correct.
pub(super) const DOUBTFUL: f64 = 0.3;
/// A part with a larger [`super::Support::contested`] is doubtful too: of 327 joints of captures with ground truth, all but one of the
/// wrong ones had more, and all but one of the correct ones less.
const CONTESTED: f64 = 0.2;
/// Sets of parts that are tried without a doubtful one at most: each needs a refinement.
const TRIALS: usize = 6;

/// Parts of a lower confidence than `least` or contested ones, the most doubtful one first.
pub(super) fn doubtful(found: &Discovery, least: f64) -> Vec<usize> {
    let confidence = |k: usize| found.parts[k].confidence.unwrap_or(0.0);
    let is_doubtful = |k: &usize| confidence(*k) < least || found.support[*k].contested > CONTESTED;
    let mut doubtful: Vec<usize> = (0..found.parts.len()).filter(is_doubtful).collect();
    doubtful.sort_by(|a, b| confidence(*a).total_cmp(&confidence(*b)));
    doubtful
}

/// True if `other` parts explain nearly all points that were explained, unless the confidence of part `k` was low and it was not
/// contested: what only that part explains did move, though otherwise.
fn keeps_explaining(found: &Discovery, k: usize, other: &Discovery) -> bool {
    /// Least share of these points.
    const KEPT: f64 = 0.95;
    let wrong = found.parts[k].confidence.unwrap_or(0.0) < DOUBTFUL && found.support[k].contested <= CONTESTED;
    wrong || other.explained() >= KEPT * found.explained()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::scene::Scene;
    use crate::discover::test_scene::cabinet_scene;
    use crate::discover::{DiscoverConfig, Evidence, StepSettings, Support};
    use artgs_core::{JointEstimate, JointKind, PerState, State};
    use glam::DVec3;

    /// Parts of these confidences that each explain 1000 points, of which no other one explains any.
    fn with_confidences(confidences: &[f64]) -> Discovery {
        let part = |c: &f64| JointEstimate {
            confidence: Some(*c),
            ..JointEstimate::new(JointKind::Prismatic, Rigid::shift(DVec3::X * *c))
        };
        let support = Support { moved: 1000.0, explained: 1.0, ..Support::default() };
        let parts: Vec<JointEstimate> = confidences.iter().map(part).collect();
        Discovery { support: vec![support; parts.len()], parts, ..Discovery::default() }
    }

    #[test]
    fn fewer_motions_are_tried_where_several_explain_too_little_for_certain() {
        let settings = BodySettings::default();
        let confidences: [&[f64]; 4] = [&[], &[0.9], &[0.2, 0.3], &[0.1, 0.1, 0.1]];
        let found = |number: usize| with_confidences(confidences[number]);
        let best = |first: usize, moved: usize| {
            or_fewer(found(first), 1..first, moved, &settings, &found)
                .parts
                .iter()
                .map(|p| p.confidence)
                .collect::<Vec<_>>()
        };
        assert_eq!(best(3, 1200), [Some(0.9)]);
        assert_eq!(or_fewer(found(2), 1..1, 1200, &settings, &found).parts.len(), 2);
        // Two parts that explain enough stay.
        assert_eq!(or_fewer(with_confidences(&[0.8, 0.8]), 1..2, 2000, &settings, &|_| unreachable!()).parts.len(), 2);
    }

    #[test]
    fn bodies_are_removed_while_the_others_explain_more() {
        let body = |x: f64| Body { motion: Rigid::shift(DVec3::X * x), regions: Vec::new() };
        let bodies = [body(1.0), body(2.0), body(3.0), body(4.0), body(5.0)];
        let refined = |kept: Vec<f64>| {
            let bodies: Vec<Body> = bodies.iter().filter(|b| kept.contains(&b.motion.translation.x)).cloned().collect();
            let confidences = bodies.iter().map(|b| match (b.motion.translation.x as i32, kept.contains(&3.0)) {
                (3, _) => 0.6,
                (4, _) => 0.65,
                (5, _) => 0.1,
                (_, true) => 0.5,
                (_, false) => 0.95,
            });
            let mut found = with_confidences(&confidences.collect::<Vec<f64>>());
            // What body 3 explained wrongly belongs to the first one.
            if !kept.contains(&3.0) && !found.support.is_empty() {
                found.support[0].moved += 950.0;
            }
            (found, bodies)
        };
        let again = |bodies: Vec<Body>| refined(bodies.iter().map(|b| b.motion.translation.x).collect());
        let without = |least: usize| {
            let (all, kept) = refined(vec![1.0, 2.0, 3.0, 4.0, 5.0]);
            let found = without_uncertain(all, kept, least, 4000, &again);
            found.parts.iter().map(|p| p.confidence.unwrap()).collect::<Vec<_>>()
        };
        // Without the fourth, less would be explained, and without the fifth as well, but hardly any.
        assert_eq!(without(1), [0.95, 0.95, 0.65]);
        assert_eq!(without(5).len(), 5);
    }

    #[test]
    fn sure_bodies_replace_motions_that_explain_far_too_little() {
        let mut scene = cabinet_scene(12, 96);
        let (config, settings) = (DiscoverConfig::default(), StepSettings::default());
        let taken = |scene: &Scene, found: f64, confidences: &[f64], movable: RangeInclusive<usize>| {
            let (clouds, evidence) = (scene.indexed_clouds(), Evidence::new(scene, &settings).unwrap());
            let (clouds, evidence, begun) = (&clouds, &evidence, &|| ());
            let work = Refinement { scene, clouds, evidence, config: &config, settings: &settings, front: None, begun };
            // Each explains an equal share of what moved, so that the quality is the mean confidence.
            let sharing = |confidences: &[f64]| {
                let mut found = with_confidences(confidences);
                let share = evidence.total() as f64 / confidences.len() as f64;
                found.support.iter_mut().for_each(|s| s.moved = share);
                found
            };
            let (found, bodies) = (sharing(&[found]), sharing(confidences));
            let refined = |count: usize| Parts { parts: vec![found.parts[0]; count], labels: PerState::default() };
            let sure = |count: usize| {
                sure_bodies(&refined(count), &work, &movable, &|_| found.clone(), &|| Some(&bodies)).is_some()
            };
            assert!(!sure(3), "few parts are refined in short time");
            sure(4)
        };
        assert!(taken(&scene, 0.5, &[0.9, 0.8], 0..=8));
        assert!(!taken(&scene, 0.7, &[0.9, 0.8], 0..=8), "the motions explain enough to be refined");
        assert!(!taken(&scene, 0.5, &[0.9, 0.2], 0..=8), "a body is doubtful");
        assert!(!taken(&scene, 0.5, &[0.51, 0.52], 0..=8), "they are hardly better");
        assert!(!taken(&scene, 0.5, &[0.9, 0.8], 3..=3), "another number of parts is given");
        scene.spreading = true;
        assert!(!taken(&scene, 0.5, &[0.9, 0.8], 0..=8), "depth is noisy");
    }

    #[test]
    fn a_part_that_one_state_does_not_show_is_hidden() {
        let labels = [[1u16; 40], [2; 40]].concat();
        let mut found = with_confidences(&[0.9, 0.9]);
        found.labels = PerState::new(labels.clone(), labels);
        assert!(!found.hides_a_part());
        found.labels[State::END].truncate(50);
        assert!(found.hides_a_part());
    }

    #[test]
    fn contested_and_uncertain_parts_are_doubtful() {
        let mut found = with_confidences(&[0.8, 0.25, 0.6, 0.1]);
        found.support[0].contested = 0.3;
        assert_eq!(doubtful(&found, DOUBTFUL), [3, 1, 0]);
        assert_eq!(doubtful(&found, 0.7), [3, 1, 2, 0]);
        let fewer = with_confidences(&[0.9, 0.9]);
        assert!(keeps_explaining(&found, 3, &fewer), "hardly a part");
        assert!(!keeps_explaining(&found, 2, &fewer) && !keeps_explaining(&found, 0, &fewer));
    }
}
