//! Parts that depth noise lets be turned over: the other side of a thin door fits as well, and its motion is less plausible.

use super::Discovery;
use super::candidates::sample_of;
use super::cloud::{IndexedCloud, principal_axes};
use super::landing::StatePair;
use super::ranking::better_seen;
use super::refinement::{Parts, Refinement, members_of_part};
use super::twins::twins;
use artgs_core::{JointKind, PerState, Rigid, State};

/// Points that judge a motion.
const SAMPLES: usize = 300;

/// What was found, hinges exchanged for more plausible ones that take the part to the same place turned over and that explain the
/// points as well.
pub(super) fn not_turned_over(
    mut found: Discovery,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Discovery {
    /// Motions that are tried at most: each needs a refinement.
    const TRIALS: usize = 6;
    let mut tried = 0;
    'exchanged: loop {
        for k in 0..found.parts.len() {
            for twin in plausible_twins(&found, k, work) {
                if tried == TRIALS {
                    return found;
                }
                tried += 1;
                let mut motions: Vec<Rigid> = found.parts.iter().map(|p| p.motion).collect();
                motions[k] = twin;
                let other = result(work.parts(&motions, &(motions.len()..=motions.len())));
                if is_better(&other, &found, work) {
                    found = other;
                    continue 'exchanged;
                }
            }
        }
        return found;
    }
}

/// True if the parts of `other`, as many as were found, explain nearly as much with less cost and implausibility.
fn is_better(other: &Discovery, found: &Discovery, work: &Refinement<'_>) -> bool {
    /// Share of the explained points that the other parts must explain.
    const KEPT: f64 = 0.97;
    let energy = |found: &Discovery| -> f64 {
        let own =
            |k: usize| implausibility(&members_of_part(&found.labels, k as u16 + 1), &found.parts[k].motion, work);
        found.support.iter().enumerate().map(|(k, s)| s.moved * (s.cost + own(k))).sum()
    };
    other.parts.len() == found.parts.len()
        && other.explained() >= KEPT * found.explained()
        && energy(other) < energy(found)
}

/// Motions, start to end, that take a hinged part to the same place turned over and that are more plausible than its own, the most
/// plausible one first.
fn plausible_twins(found: &Discovery, k: usize, work: &Refinement<'_>) -> Vec<Rigid> {
    let part = &found.parts[k];
    if part.kind != JointKind::Revolute || part.parent > 0 {
        return Vec::new();
    }
    let members = members_of_part(&found.labels, k as u16 + 1);
    let state = better_seen(&members);
    let all = twins(work.clouds[state].cloud, &members[state], &part.motion.away_from(state));
    let own = implausibility(&members, &part.motion, work);
    let judged = all.iter().map(|twin| twin.away_from(state)).map(|twin| (implausibility(&members, &twin, work), twin));
    let mut plausible: Vec<(f64, Rigid)> = judged.filter(|twin| twin.0 < own).collect();
    plausible.sort_by(|a, b| a.0.total_cmp(&b.0));
    plausible.iter().map(|(_, twin)| placed(twin, &members, work)).collect()
}

/// `motion` with the shift with which the part's points cost least: what is seen of a part, and so the middle about which it was
/// turned over, differs between the states.
fn placed(motion: &Rigid, members: &PerState<Vec<usize>>, work: &Refinement<'_>) -> Rigid {
    /// Tried shifts along each axis of the box and per sign: along its normal by the thickness of the part at most.
    const STEPS: [i32; 3] = [4, 4, 4];
    /// Distances between them, spacings.
    const STEP: [f64; 3] = [2.0, 2.0, 1.0];
    let spacing = f64::from(work.scene.lengths.spacing);
    let axes = principal_axes(work.clouds[State::END].cloud, &members[State::END]).map(|a| a.as_dvec3());
    let along = |k: usize| (-STEPS[k]..=STEPS[k]).map(move |i| axes[k] * (f64::from(i) * STEP[k] * spacing));
    let shifts = along(0).flat_map(|a| along(1).flat_map(move |b| along(2).map(move |c| a + b + c)));
    let motions: Vec<Rigid> = shifts.map(|shift| Rigid::shift(shift) * *motion).collect();
    let costs = &work.settings.support.costs;
    let mut total = vec![0.0f64; motions.len()];
    for s in State::ALL {
        let stride = members[s].len().div_ceil(SAMPLES).max(1);
        let picked: Vec<usize> = members[s].iter().copied().step_by(stride).collect();
        let own = work.clouds[s].cloud.select(&picked);
        let own = IndexedCloud::new(&own);
        let to_other: Vec<Rigid> = motions.iter().map(|m| m.away_from(s)).collect();
        let pair = StatePair { own: &own, ..work.scene.pair(work.clouds, s) }.with_few_views();
        for row in pair.landings(&to_other, costs).chunks_exact(motions.len()) {
            total.iter_mut().zip(row).for_each(|(sum, landing)| *sum += f64::from(landing.cost(costs)));
        }
    }
    let best = total.iter().zip(&motions).min_by(|a, b| a.0.total_cmp(b.0));
    best.map_or(*motion, |(_, motion)| *motion)
}

/// Implausibility of a motion (start to end) of points.
fn implausibility(members: &PerState<Vec<usize>>, motion: &Rigid, work: &Refinement<'_>) -> f64 {
    let state = better_seen(members);
    let sample = sample_of(work.clouds[state].cloud, &members[state], SAMPLES);
    let lengths = &work.scene.lengths;
    work.settings.ranking.implausibility(&motion.away_from(state), &sample, lengths, work.front).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::test_scene::{cabinet_scene, with_refinement};
    use crate::discover::{DiscoverConfig, discover};

    #[test]
    fn a_door_that_was_turned_over_gets_its_hinge_back() {
        let config = DiscoverConfig::default();
        let scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &config).unwrap();
        with_refinement(&scene, |work| {
            let result =
                |parts: Parts| work.evidence.result(work.scene, work.clouds, parts, Vec::new(), &[], work.settings);
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
                let right = not_turned_over(turned, work, &result);
                let hinge = right.parts.iter().find(|p| p.kind == JointKind::Revolute).unwrap().motion;
                assert!(aside(&hinge) < 1.0, "{}", aside(&hinge));
                assert!(hinge.apply(middle).distance(truth.apply(middle)) < 0.01 * found.diagonal);
            }
            // The right hinge stays.
            let kept = not_turned_over(found.clone(), work, &result);
            assert_eq!(kept.parts, found.parts);
        });
    }
}
