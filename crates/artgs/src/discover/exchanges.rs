//! Where depth noise spreads points, the motions that were found are compared with others that explain the same points: those that
//! are more plausible, and fewer of them.

use super::Discovery;
use super::candidates::sample_of;
use super::cloud::IndexedCloud;
use super::front_slides::front_slides;
use super::landing::{Landing, StatePair};
use super::ranking::better_seen;
use super::refinement::{Parts, Refinement, members_of_part};
use super::turned_over::{placed, plausible_twins};
use artgs_core::{Joint, JointKind, PerState, Rigid, State};

/// Points that judge a motion.
const SAMPLES: usize = 300;

/// What was found, hinges and screws exchanged for more plausible motions that explain the points as well: those that take the part to
/// the same place turned over, and slides along the front.
pub(super) fn exchanged(mut found: Discovery, work: &Refinement<'_>, result: &dyn Fn(Parts) -> Discovery) -> Discovery {
    /// Motions that are tried at most: each needs a refinement.
    const TRIALS: usize = 8;
    let mut tried = 0;
    'exchanged: loop {
        for k in 0..found.parts.len() {
            if !may_be_exchanged(&found, k, work) {
                continue;
            }
            let others = plausible_twins(&found, k, work).into_iter().chain(front_slides(&found, k, work));
            for other in others {
                if tried == TRIALS {
                    return found;
                }
                tried += 1;
                let mut motions: Vec<Rigid> = found.parts.iter().map(|p| p.motion).collect();
                motions[k] = other;
                let refined = result(work.parts(&motions, &(motions.len()..=motions.len())));
                let beside = beside_other_side(&refined, k, work, result);
                if let Some(other) = beside.into_iter().chain([refined]).find(|other| is_better(other, &found, work)) {
                    found = other;
                    continue 'exchanged;
                }
            }
        }
        return found;
    }
}

/// With the hinge of part `k` (from 0) where its points cost least. Where the states show different sides of a thin part, a registration
/// puts one side onto the other, and so moves the part by its thickness. None if there is no such part, or it stays.
fn beside_other_side(
    refined: &Discovery,
    k: usize,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Option<Discovery> {
    let part = refined.parts.get(k).filter(|part| part.kind == JointKind::Revolute && part.parent == 0)?;
    let members = members_of_part(&refined.labels, k as u16 + 1);
    let placed = Joint::from_motion(part.kind, &placed(&part.motion, &members, work)).start_to_end();
    let costs = costs_of(&[part.motion, placed], &members, work);
    if costs[1] >= costs[0] {
        return None;
    }
    let mut parts = Parts { parts: refined.parts.clone(), labels: refined.labels.clone() };
    parts.parts[k].motion = placed;
    Some(result(parts))
}

/// Without parts, but at least `least`, that the others make superfluous: motions of noise, motions that share the points of one part,
/// and the other side of a part that was turned over.
pub(super) fn without_surplus(
    mut found: Discovery,
    least: usize,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Discovery {
    /// Parts that alone explain a smaller share of the moved points are tried without,
    const ALONE: f64 = 0.03;
    /// and so are parts of a lower confidence.
    const DOUBTFUL: f64 = 0.1;
    /// What a part must raise the quality by, times its doubt: what it does not explain lowers the confidence of all others.
    const WORTH: f64 = 0.01;
    let (total, least) = (work.evidence.total(), least.max(1));
    'removed: while found.parts.len() > least {
        let count = found.parts.len();
        let alone = |k: usize| found.support[k].exclusive * found.support[k].moved / total.max(1) as f64;
        let is_doubtful = |k: &usize| found.parts[*k].confidence.is_some_and(|c| c < DOUBTFUL);
        let mut small: Vec<usize> = (0..count).filter(|k| alone(*k) < ALONE || is_doubtful(k)).collect();
        small.sort_by(|a, b| alone(*a).total_cmp(&alone(*b)));
        for k in small {
            let Some(other) = without(&found, k, least, work, result) else { continue };
            let worth = WORTH * (1.0 - found.parts[k].confidence.unwrap_or(0.0));
            if other.quality(total) > found.quality(total) - worth {
                found = other;
                continue 'removed;
            }
        }
        break;
    }
    found
}

/// The parts that the other motions explain without that of part `k` (from 0), at least `least`; none if they are not fewer.
fn without(
    found: &Discovery,
    k: usize,
    least: usize,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Option<Discovery> {
    let count = found.parts.len();
    let others: Vec<Rigid> = (0..count).filter(|other| *other != k).map(|k| found.parts[k].motion).collect();
    let other = result(work.parts(&others, &(least..=count - 1)));
    (!other.parts.is_empty() && other.parts.len() < count).then_some(other)
}

/// Without parts, but at least `least`, that are not sure and moved no farther than errors of depth and of the alignment shift surfaces.
pub(super) fn without_errors(
    mut found: Discovery,
    least: usize,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Discovery {
    /// Mean distance that the points of such a part moved, spacings.
    const NEAR: f64 = 3.0;
    /// Confidence from which a part is sure. Calibrated on a cabinet in simulated recordings of a phone: 0.26 and 0.73 for motions of 1.4
    /// and 2.2 spacings that were none.
    const SURE: f64 = 0.8;
    while found.parts.len() > least.max(1) {
        let is_error =
            |k: &usize| found.support[*k].shift < NEAR && found.parts[*k].confidence.is_none_or(|c| c < SURE);
        let Some(k) = (0..found.parts.len()).find(is_error) else { break };
        let Some(mut other) = without(&found, k, least.max(1), work, result) else { break };
        let share = 100.0 * found.support[k].shift * found.spacing / found.diagonal;
        other.warnings.append(&mut found.warnings);
        other.warnings.push(format!(
            "a part that moved by only {share:.1} % of the object's diagonal is ignored, because errors of depth look like that: open it wider, or \
             state the number of parts"
        ));
        found = other;
    }
    found
}

/// True for hinges and screws of parts on the static part, but not for screws of parts that look alike after a quarter of a turn, such
/// as caps: those are known by their colours.
pub(super) fn may_be_exchanged(found: &Discovery, k: usize, work: &Refinement<'_>) -> bool {
    /// A part that costs this much more after a quarter of a turn does not look alike.
    const UNLIKE: f64 = 0.05;
    let part = &found.parts[k];
    let is_round = || {
        let members = members_of_part(&found.labels, k as u16 + 1);
        let screw = part.motion.screw();
        let quarter = Rigid::about(screw.axis, screw.origin, std::f64::consts::FRAC_PI_2) * part.motion;
        let costs = costs_of(&[part.motion, quarter], &members, work);
        costs[1] < costs[0] + UNLIKE
    };
    part.parent == 0
        && match part.kind {
            JointKind::Revolute => true,
            JointKind::Screw => !is_round(),
            JointKind::Prismatic => false,
        }
}

/// Mean cost of each motion, start to end, for a sample of a part's points.
pub(super) fn costs_of(motions: &[Rigid], members: &PerState<Vec<usize>>, work: &Refinement<'_>) -> Vec<f64> {
    let costs = &work.settings.support.costs;
    let (mut total, mut count) = (vec![0.0f64; motions.len()], 0);
    for s in State::ALL {
        let stride = members[s].len().div_ceil(SAMPLES).max(1);
        let picked: Vec<usize> = members[s].iter().copied().step_by(stride).collect();
        for row in landings(&picked, s, motions, work).chunks_exact(motions.len()) {
            total.iter_mut().zip(row).for_each(|(sum, landing)| *sum += f64::from(landing.cost(costs)));
        }
        count += picked.len();
    }
    total.iter().map(|sum| sum / count.max(1) as f64).collect()
}

/// Where points of a state land under motions from start to end, `[n * motions]`.
pub(super) fn landings(points: &[usize], s: State, motions: &[Rigid], work: &Refinement<'_>) -> Vec<Landing> {
    let own = work.clouds[s].cloud.select(points);
    let own = IndexedCloud::new(&own);
    let to_other: Vec<Rigid> = motions.iter().map(|m| m.away_from(s)).collect();
    let pair = StatePair { own: &own, ..work.scene.pair(work.clouds, s) }.with_few_views();
    pair.landings(&to_other, &work.settings.support.costs)
}

/// True if the parts of `other`, as many as were found, explain nearly as much with less cost and implausibility. A moved point that has
/// no part costs as much as one in empty space.
fn is_better(other: &Discovery, found: &Discovery, work: &Refinement<'_>) -> bool {
    /// Share of the explained points that the other parts must explain: of a thin lid that is not turned over, the sides that the two
    /// states show are different ones, and fit less well.
    const KEPT: f64 = 0.9;
    let total = work.evidence.total() as f64;
    let energy = |found: &Discovery| -> f64 {
        let own =
            |k: usize| implausibility(&members_of_part(&found.labels, k as u16 + 1), &found.parts[k].motion, work);
        let of_parts = found.support.iter().enumerate().map(|(k, s)| s.moved * (s.cost + own(k))).sum::<f64>();
        of_parts + (total - found.support.iter().map(|s| s.moved).sum::<f64>()).max(0.0)
    };
    other.parts.len() == found.parts.len()
        && other.explained() >= KEPT * found.explained()
        && energy(other) < energy(found)
}

/// Implausibility of a motion (start to end) of points.
pub(super) fn implausibility(members: &PerState<Vec<usize>>, motion: &Rigid, work: &Refinement<'_>) -> f64 {
    let state = better_seen(members);
    let sample = sample_of(work.clouds[state].cloud, &members[state], SAMPLES);
    let lengths = &work.scene.lengths;
    work.settings.ranking.implausibility(&motion.away_from(state), &sample, lengths, work.front).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::cloud::principal_axes;
    use crate::discover::test_scene::{cabinet_scene, with_refinement};
    use crate::discover::twins::twins;
    use crate::discover::{DiscoverConfig, discover};
    use glam::DVec3;

    fn refined(parts: Parts, work: &Refinement<'_>) -> Discovery {
        work.evidence.result(work.scene, work.clouds, parts, Vec::new(), &[], work.settings)
    }

    #[test]
    fn a_door_that_was_turned_over_gets_its_hinge_back() {
        let config = DiscoverConfig::default();
        let scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &config).unwrap();
        with_refinement(&scene, |work| {
            let result = |parts: Parts| refined(parts, work);
            let door = found.parts.iter().position(|p| p.kind == JointKind::Revolute).unwrap();
            let truth = found.parts[door].motion;
            let members = members_of_part(&found.labels, door as u16 + 1);
            let state = better_seen(&members);
            let twins = twins(work.clouds[state].cloud, &members[state], &truth.away_from(state));
            let middle = found.middle(door + 1, State::START);
            let aside = |m: &Rigid| (truth.inverse() * *m).angle().to_degrees();
            // All but the turn within the plane of the door: about its long side and its short side.
            for twin in twins.iter().take(2).map(|twin| twin.away_from(state)) {
                let mut turned = found.clone();
                turned.parts[door].motion = twin;
                turned.support[door].cost += 0.02;
                assert!(aside(&twin) > 170.0);
                let right = exchanged(turned, work, &result);
                let hinge = right.parts.iter().find(|p| p.kind == JointKind::Revolute).unwrap().motion;
                assert!(aside(&hinge) < 1.0, "{}", aside(&hinge));
                assert!(hinge.apply(middle).distance(truth.apply(middle)) < 0.01 * found.diagonal);
            }
            // The right hinge stays.
            let kept = exchanged(found.clone(), work, &result);
            assert_eq!(kept.parts, found.parts);
        });
    }

    #[test]
    fn a_door_that_was_put_onto_its_other_side_is_put_beside_it() {
        let scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &DiscoverConfig::default()).unwrap();
        with_refinement(&scene, |work| {
            let door = found.parts.iter().position(|p| p.kind == JointKind::Revolute).unwrap();
            let truth = found.parts[door].motion;
            let members = members_of_part(&found.labels, door as u16 + 1);
            let normal = principal_axes(work.clouds[State::END].cloud, &members[State::END])[2].as_dvec3();
            let mut aside = found.clone();
            aside.parts[door].motion = Rigid::shift(normal * (3.0 * found.spacing)) * truth;
            let back = beside_other_side(&aside, door, work, &|parts| refined(parts, work)).unwrap();
            let middle = found.middle(door + 1, State::START);
            let apart = back.parts[door].motion.apply(middle).distance(truth.apply(middle));
            assert!(apart < 1.5 * found.spacing, "{}", apart / found.spacing);
            assert_eq!(back.labels, found.labels);
        });
    }

    #[test]
    fn a_drawer_that_was_taken_for_a_hinge_slides_again() {
        let scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &DiscoverConfig::default()).unwrap();
        with_refinement(&scene, |work| {
            let drawer = found.parts.iter().position(|p| p.kind == JointKind::Prismatic).unwrap();
            let truth = found.parts[drawer].motion;
            let mut turned = found.clone();
            turned.parts[drawer].kind = JointKind::Revolute;
            turned.parts[drawer].motion = Rigid::about(DVec3::Z, found.middle(drawer + 1, State::END), 1.5);
            turned.support[drawer].cost += 0.1;
            let right = exchanged(turned, work, &|parts| refined(parts, work));
            let slide = right.parts.iter().find(|p| p.kind == JointKind::Prismatic).unwrap().motion;
            assert!(slide.translation.distance(truth.translation) < 0.01 * found.diagonal);
        });
    }

    #[test]
    fn a_part_of_which_others_explain_all_is_removed_unless_so_many_are_asked_for() {
        let scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &DiscoverConfig::default()).unwrap();
        with_refinement(&scene, |work| {
            let shifted = Rigid::shift(DVec3::Z * (0.3 * found.spacing));
            let mut parts = Parts { parts: found.parts.clone(), labels: found.labels.clone() };
            parts.parts.push(found.parts[0]);
            parts.parts[2].motion = shifted * found.parts[0].motion;
            for labels in parts.labels.iter_mut() {
                labels.iter_mut().filter(|l| **l == 1).step_by(8).for_each(|l| *l = 3);
            }
            let surplus = refined(parts, work);
            let left = |least: usize| without_surplus(surplus.clone(), least, work, &|parts| refined(parts, work));
            assert_eq!((left(1).parts.len(), left(3).parts.len()), (2, 3));
            // One that alone explains its points is removed if it is doubtful.
            let left = |confidence: f64| {
                let mut doubtful = surplus.clone();
                doubtful.parts[2].confidence = Some(confidence);
                doubtful.support.iter_mut().for_each(|support| support.exclusive = 1.0);
                without_surplus(doubtful, 1, work, &|parts| refined(parts, work)).parts.len()
            };
            assert_eq!((left(0.05), left(0.5)), (2, 3));
            // Parts that alone explain their points stay.
            assert_eq!(without_surplus(found.clone(), 1, work, &|parts| refined(parts, work)).parts, found.parts);
        });
    }

    #[test]
    fn a_part_that_hardly_moved_is_removed_unless_it_is_sure() {
        let scene = cabinet_scene(16, 96);
        let mut found = discover(&scene, 2..=2, &DiscoverConfig::default()).unwrap();
        with_refinement(&scene, |work| {
            let left = |found: &Discovery, least: usize| {
                without_errors(found.clone(), least, work, &|parts| refined(parts, work)).parts.len()
            };
            found.parts.iter_mut().for_each(|part| part.confidence = Some(0.9));
            found.support[0].shift = 2.2;
            assert_eq!(left(&found, 1), 2, "both are sure");
            found.parts[0].confidence = Some(0.7);
            assert_eq!((left(&found, 1), left(&found, 2)), (1, 2));
            let warnings = without_errors(found.clone(), 1, work, &|parts| refined(parts, work)).warnings;
            assert!(warnings.iter().any(|warning| warning.contains("open it wider")), "{warnings:?}");
            found.support[0].shift = 3.5;
            assert_eq!(left(&found, 1), 2, "it moved far");
        });
    }
}
