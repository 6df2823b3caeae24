//! Motions that take a part to the same place turned over: the other side of a thin door fits nearly as well.

use super::Discovery;
use super::cloud::principal_axes;
use super::exchanges::{costs_of, implausibility};
use super::ranking::better_seen;
use super::refinement::{Refinement, members_of_part};
use super::twins::twins;
use artgs_core::{PerState, Rigid, State};

/// Motions, start to end, that take a part to the same place turned over and that are more plausible than its own, the most
/// plausible one first.
pub(super) fn plausible_twins(found: &Discovery, k: usize, work: &Refinement<'_>) -> Vec<Rigid> {
    let part = &found.parts[k];
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
pub(super) fn placed(motion: &Rigid, members: &PerState<Vec<usize>>, work: &Refinement<'_>) -> Rigid {
    /// Tried shifts along each axis of the box and per sign: along its normal by the thickness of the part at most.
    const STEPS: [i32; 3] = [4, 4, 4];
    /// Distances between them, spacings.
    const STEP: [f64; 3] = [2.0, 2.0, 1.0];
    let spacing = f64::from(work.scene.lengths.spacing);
    let axes = principal_axes(work.clouds[State::END].cloud, &members[State::END]).map(|a| a.as_dvec3());
    let along = |k: usize| (-STEPS[k]..=STEPS[k]).map(move |i| axes[k] * (f64::from(i) * STEP[k] * spacing));
    let shifts = along(0).flat_map(|a| along(1).flat_map(move |b| along(2).map(move |c| a + b + c)));
    let motions: Vec<Rigid> = shifts.map(|shift| Rigid::shift(shift) * *motion).collect();
    let costs = costs_of(&motions, members, work);
    let best = costs.iter().zip(&motions).min_by(|a, b| a.0.total_cmp(b.0));
    best.map_or(*motion, |(_, motion)| *motion)
}
