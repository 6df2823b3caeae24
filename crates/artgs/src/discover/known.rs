//! What refinements have found out and later ones use again. Most refinements differ from an earlier one by one part of
//! many: what the others do with every point, and the joints that fit their points, are known.

use super::cloud::{Cloud, IndexedCloud};
use super::graph_cut::columns as transposed;
use super::joints::Decided;
use super::landing::{Landing, StatePair};
use super::segmentation::LabelCosts;
use artgs_core::{JointEstimate, JointKind, PerState, Rigid, State};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Bits of a motion: only the very same motion has known results.
type Key = [u64; 7];

fn key(motion: &Rigid) -> Key {
    let (r, t) = (motion.rotation, motion.translation);
    [r.x, r.y, r.z, r.w, t.x, t.y, t.z].map(f64::to_bits)
}

/// A value behind a lock. What a panic of another thread left is whole: entries are only added and removed.
fn locked<T>(value: &Mutex<T>) -> MutexGuard<'_, T> {
    value.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Where every point of a state lands under one motion.
struct Column {
    landings: Vec<Landing>,
    /// Number of the last labelling that used it.
    used: u64,
}

/// Landings of all points under the motions of recent labellings.
#[derive(Default)]
pub(super) struct KnownLandings {
    columns: Mutex<PerState<BTreeMap<Key, Column>>>,
}

impl KnownLandings {
    /// Where every point of a state lands at rest and under motions from start to end, `[n * (motions + 1)]`.
    pub(super) fn rows(
        &self,
        pair: &StatePair<'_>,
        state: State,
        motions: &[Rigid],
        costs: &LabelCosts,
    ) -> Vec<Landing> {
        /// Labellings after which unused landings are dropped.
        const KEPT: u64 = 4;
        let all: Vec<(Key, Rigid)> = std::iter::once((key(&Rigid::IDENTITY), Rigid::IDENTITY))
            .chain(motions.iter().map(|m| (key(m), m.away_from(state))))
            .collect();
        let mut columns = locked(&self.columns);
        let columns = &mut columns[state];
        let now = columns.values().map(|c| c.used).max().unwrap_or(0) + 1;
        let mut missing: Vec<(Key, Rigid)> =
            all.iter().filter(|(key, _)| !columns.contains_key(key)).copied().collect();
        missing.sort_by_key(|m| m.0);
        missing.dedup_by_key(|m| m.0);
        let to_other: Vec<Rigid> = missing.iter().map(|m| m.1).collect();
        let found = if to_other.is_empty() { Vec::new() } else { pair.landings(&to_other, costs) };
        for ((key, _), landings) in missing.iter().zip(transposed(&found, missing.len(), |landing| *landing)) {
            columns.insert(*key, Column { landings, used: now });
        }
        all.iter().filter_map(|(key, _)| columns.get_mut(key).map(|c| c.used = now)).for_each(drop);
        columns.retain(|_, column| column.used + KEPT > now);
        let used: Vec<&[Landing]> = all.iter().map(|(key, _)| columns[key].landings.as_slice()).collect();
        let mut rows = vec![Landing::default(); used.len() * pair.own.cloud.len()];
        rows.par_chunks_mut(used.len()).enumerate().with_min_len(512).for_each(|(i, row)| {
            row.iter_mut().zip(&used).for_each(|(landing, column)| *landing = column[i]);
        });
        rows
    }
}

/// Landings of points that were asked for, each once, as long as their motion is in use.
#[derive(Default)]
pub(super) struct KnownSamples {
    columns: Mutex<PerState<BTreeMap<Key, Sample>>>,
}

/// What is known of the landings of a state's points under one motion.
struct Sample {
    landings: Vec<Option<Landing>>,
    /// False if no measurement since the last one has used it.
    in_use: [bool; 3],
}

impl KnownSamples {
    /// Begins a measurement of all parts: forgets motions that the last ones did not use.
    pub(super) fn begin(&self) {
        for columns in locked(&self.columns).iter_mut() {
            columns.retain(|_, sample| sample.in_use.contains(&true));
            columns.values_mut().for_each(|sample| {
                sample.in_use.rotate_right(1);
                sample.in_use[0] = false;
            });
        }
    }

    /// Where the points `picked` of a state land under motions from start to end, `[n * motions]`. `pair` has all points of
    /// the state; it and the costs are always the same.
    pub(super) fn rows(
        &self,
        pair: &StatePair<'_>,
        state: State,
        picked: &[usize],
        motions: &[Rigid],
        costs: &LabelCosts,
    ) -> Vec<Landing> {
        let mut columns = locked(&self.columns);
        let mut rows = vec![Landing::default(); picked.len() * motions.len()];
        for (k, motion) in motions.iter().enumerate() {
            let nothing = || Sample { landings: vec![None; pair.own.cloud.len()], in_use: [false; 3] };
            let sample = columns[state].entry(key(motion)).or_insert_with(nothing);
            sample.in_use[0] = true;
            let missing: Vec<usize> = picked.iter().copied().filter(|i| sample.landings[*i].is_none()).collect();
            if !missing.is_empty() {
                let own = pair.own.cloud.select(&missing);
                let own = IndexedCloud::new(&own);
                let found = StatePair { own: &own, ..*pair }.landings(&[motion.away_from(state)], costs);
                missing.iter().zip(found).for_each(|(i, landing)| sample.landings[*i] = Some(landing));
            }
            for (row, i) in rows.chunks_exact_mut(motions.len()).zip(picked) {
                row[k] = sample.landings[*i].unwrap_or_default();
            }
        }
        rows
    }
}

/// Indices of the points of a part.
pub(super) type Members = PerState<Vec<u32>>;

/// Points of every part, the static part first.
pub(super) fn members_of_parts(labels: &PerState<Vec<u16>>, parts: usize) -> Vec<Members> {
    let mut out = vec![Members::default(); parts + 1];
    for (state, labels) in State::ALL.into_iter().zip(labels.iter()) {
        for (i, label) in labels.iter().enumerate() {
            out[usize::from(*label)][state].push(i as u32);
        }
    }
    out
}

/// The points `members` of the clouds of both states.
pub(super) fn selected(clouds: PerState<&Cloud>, members: &Members) -> PerState<Cloud> {
    PerState::from_fn(|s| clouds[s].select(&members[s].iter().map(|i| *i as usize).collect::<Vec<_>>()))
}

/// A registration of some points, beginning with some motion.
struct Fit<T> {
    members: Members,
    kind: Option<JointKind>,
    found: T,
}

/// Registrations by the motion that they begin with, or that they led to.
type Fits<T> = Mutex<BTreeMap<Key, Vec<Fit<T>>>>;

/// Joints of parts that were registered.
#[derive(Default)]
pub(super) struct KnownFits {
    refined: Fits<JointEstimate>,
    decided: Fits<Decided>,
    /// By the motion of the part in the end.
    settled: Fits<Decided>,
}

/// Share of a part's points that may be others than those that its joint was decided with.
const SAME_POINTS: f64 = 0.01;

impl KnownFits {
    /// The motion of a part in a round before the last: as it is if its joint was decided with nearly the same points, else
    /// registered by `fit`.
    pub(super) fn refined(
        &self,
        part: &JointEstimate,
        members: &Members,
        fit: impl FnOnce() -> JointEstimate,
    ) -> JointEstimate {
        if find(&self.settled, &part.motion, |f| are_nearly_same(&f.members, members)).is_some() {
            return *part;
        }
        find(&self.refined, &part.motion, |f| f.members == *members).unwrap_or_else(|| {
            let found = fit();
            add(&self.refined, &part.motion, Fit { members: members.clone(), kind: None, found });
            found
        })
    }

    /// The joint of a part in the last round: the one that was decided with nearly the same points if that led to the part's
    /// motion, else decided by `fit`. `kind` is the type if the user gave it.
    pub(super) fn decided(
        &self,
        part: &JointEstimate,
        members: &Members,
        kind: Option<JointKind>,
        fit: impl FnOnce() -> Decided,
    ) -> Decided {
        let settled = find(&self.settled, &part.motion, |f| f.kind == kind && are_nearly_same(&f.members, members));
        let known = || find(&self.decided, &part.motion, |f| f.kind == kind && f.members == *members);
        settled.or_else(known).unwrap_or_else(|| {
            let found = fit();
            add(&self.decided, &part.motion, Fit { members: members.clone(), kind, found });
            found
        })
    }

    /// Notes that a part moves by `motion` in the end, decided with these points.
    pub(super) fn settle(&self, motion: &Rigid, members: &Members, kind: Option<JointKind>, decided: &Decided) {
        // Points that are nearly the same do not replace those that the joint was decided with: they must not drift.
        if find(&self.settled, motion, |f| f.kind == kind && are_nearly_same(&f.members, members)).is_none() {
            add(&self.settled, motion, Fit { members: members.clone(), kind, found: *decided });
        }
    }
}

fn find<T: Copy>(fits: &Fits<T>, motion: &Rigid, which: impl Fn(&Fit<T>) -> bool) -> Option<T> {
    locked(fits).get(&key(motion))?.iter().find(|f| which(f)).map(|f| f.found)
}

fn add<T>(fits: &Fits<T>, motion: &Rigid, fit: Fit<T>) {
    locked(fits).entry(key(motion)).or_default().push(fit);
}

/// True if few points are in one of two sets only. The indices are in ascending order.
fn are_nearly_same(a: &Members, b: &Members) -> bool {
    let points: usize = a.iter().map(Vec::len).sum();
    let different: usize = State::ALL.iter().map(|s| difference(&a[*s], &b[*s])).sum();
    different as f64 <= SAME_POINTS * points as f64
}

/// Number of indices in one of two ascending lists only.
fn difference(a: &[u32], b: &[u32]) -> usize {
    let (mut i, mut j, mut shared) = (0, 0, 0);
    while i < a.len() && j < b.len() {
        let (x, y) = (a[i], b[j]);
        (i, j) = (i + usize::from(x <= y), j + usize::from(y <= x));
        shared += usize::from(x == y);
    }
    a.len() + b.len() - 2 * shared
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::StepSettings;
    use crate::discover::test_scene::cabinet_scene;
    use glam::DVec3;

    fn shift(x: f64) -> Rigid {
        Rigid::shift(DVec3::X * x)
    }

    #[test]
    fn known_landings_are_those_that_are_computed() {
        let scene = cabinet_scene(8, 64);
        let (clouds, costs) = (scene.indexed_clouds(), StepSettings::default().label_costs);
        let (landings, samples) = (KnownLandings::default(), KnownSamples::default());
        // The same motions, others, some again after they were dropped, and twice the same one.
        let sets: [&[f64]; 8] =
            [&[0.1, 0.2], &[0.1, 0.2], &[0.2, 0.3], &[0.3], &[0.3], &[0.3], &[0.3, 0.2], &[0.1, 0.1]];
        for (turn, set) in sets.into_iter().enumerate() {
            let motions: Vec<Rigid> = set.iter().map(|x| shift(*x)).collect();
            samples.begin();
            for s in State::ALL {
                let pair = scene.pair(&clouds, s);
                let to_other: Vec<Rigid> = motions.iter().map(|m| m.away_from(s)).collect();
                let expected = pair.landings(&to_other, &costs);
                let rows = landings.rows(&pair, s, &motions, &costs);
                let moved = rows.chunks_exact(motions.len() + 1).flat_map(|row| &row[1..]);
                assert!(moved.eq(&expected), "turn {turn}");
                let picked: Vec<usize> = (0..clouds[s].cloud.len()).step_by(3 + turn % 2).collect();
                let sampled = samples.rows(&pair, s, &picked, &motions, &costs);
                let expected = picked.iter().flat_map(|i| &expected[i * motions.len()..(i + 1) * motions.len()]);
                assert!(sampled.iter().eq(expected), "turn {turn}");
            }
        }
        let kept = |known: usize| (2..=3).contains(&known);
        assert!(locked(&landings.columns).iter().all(|c| kept(c.len() - 1)), "motions of the last turns are kept");
        assert!(locked(&samples.columns).iter().all(|c| kept(c.len())));
    }

    #[test]
    fn joints_are_decided_again_only_if_other_points_belong_to_the_part() {
        let points = |first: u32| PerState::new((first..first + 500).collect(), (0..500).collect());
        let part = JointEstimate::new(JointKind::Screw, shift(0.1));
        let joint = |x: f64| JointEstimate::new(JointKind::Prismatic, shift(x));
        let decided = |x: f64| Decided { joint: joint(x), general: None, misfit: 0.0 };
        let known = KnownFits::default();
        let decide = |members: &Members, x: f64| known.decided(&part, members, None, || decided(x)).joint;
        assert_eq!(decide(&points(0), 0.2), joint(0.2));
        assert_eq!(decide(&points(0), 0.3), joint(0.2), "the same points from the same motion");
        assert_eq!(decide(&points(1), 0.3), joint(0.3), "one other point");
        let typed = known.decided(&part, &points(0), Some(JointKind::Prismatic), || decided(0.4));
        assert_eq!(typed.joint, joint(0.4), "the type is known");
        // The part is settled: a few other points do not change it, also not one after the other.
        known.settle(&part.motion, &points(0), None, &decided(0.2));
        assert_eq!(decide(&points(4), 0.5), joint(0.2));
        known.settle(&part.motion, &points(4), None, &decided(0.5));
        assert_eq!(decide(&points(8), 0.6), joint(0.6));
        let refine = |members: &Members| known.refined(&part, members, || joint(0.7));
        assert_eq!((refine(&points(3)), refine(&points(9))), (part, joint(0.7)));
    }
}
