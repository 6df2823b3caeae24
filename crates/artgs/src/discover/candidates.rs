//! Candidate motions: a wide search of hinges and slides for each cluster of moved points, refined by registration.

use super::cloud::{Cloud, IndexedCloud, components, principal_axes};
use super::extents::with_extents;
use super::front::Front;
use super::poses::{Pose, PoseSettings};
use super::ranking::{RankingSettings, alike, better_seen};
use super::registration::{Matching, RegistrationOptions, register, register_along};
use super::scene::Lengths;
use super::space_grid::{NO_POINT, SpaceGrid};
use super::twins::twins;
use crate::observer::Share;
use artgs_core::{PerState, Rigid, State};
use glam::{Mat3, Vec3};
use rayon::prelude::*;

/// Settings of the search. Distances are in spacings (between neighbouring points) or fractions of the object's diagonal.
/// Calibrated on the stand-ins of the paper's objects: as few poses are kept as lose none of their true motions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CandidateSettings {
    /// Poses of the wide search.
    pub(crate) poses: PoseSettings,
    /// Value of landing on a point that is in both states, where 1 is a point that moved and is not explained yet.
    pub(crate) on_static: f32,
    /// Value of landing on a point that the other state cannot see.
    pub(crate) on_unseen: f32,
    /// Value of landing in empty space.
    pub(crate) in_empty: f32,
    /// Value of landing where nothing was seen.
    pub(crate) in_unseen: f32,
    /// Points this close to a surface count in the wide search, fraction of the diagonal.
    pub(crate) reach: f32,
    /// Points this close to a surface count after registration, spacings.
    pub(crate) fine_reach: f32,
    /// Points that score a pose of the wide search.
    pub(crate) coarse_points: usize,
    /// Points that score a registered motion.
    pub(crate) fine_points: usize,
    /// Lengths of slides out of the front that are tried, per sign, up to the longest slide.
    pub(crate) front_steps: usize,
    /// Moved points of each state that weigh a motion.
    pub(crate) weighed_points: usize,
    /// Slides out of the front that are registered.
    pub(crate) front_slides: usize,
    /// Poses that are registered: the best, and in all with the best small ones.
    pub(crate) registered: [usize; 2],
    /// Motions that are kept after a rough registration: the same two counts.
    pub(crate) rough: [usize; 2],
    /// Motions that are kept after the final registration: the same two counts.
    pub(crate) kept: [usize; 2],
    /// Registered motions of a lower mean value are dropped.
    pub(crate) least_value: f32,
    /// Iterations and points of the registration of each kept candidate; parts are registered again with all points.
    pub(crate) variant_effort: (usize, usize),
    /// Two points this close belong to one cluster, spacings.
    pub(crate) cluster_reach: f32,
    /// Clusters of a state that are searched, largest first.
    pub(crate) clusters: usize,
    /// Least points of a cluster.
    pub(crate) least_cluster: usize,
    /// A cluster whose best motion has a lower mean value is cut in two.
    pub(crate) explained: f32,
    /// A cluster is cut this often at most.
    pub(crate) cuts: usize,
}

impl Default for CandidateSettings {
    fn default() -> Self {
        Self {
            poses: PoseSettings::default(),
            on_static: 0.35,
            on_unseen: 0.8,
            in_empty: -1.0,
            in_unseen: -0.1,
            reach: 0.035,
            fine_reach: 1.6,
            coarse_points: 120,
            fine_points: 600,
            front_steps: 48,
            weighed_points: 3000,
            front_slides: 4,
            registered: [30, 50],
            rough: [14, 28],
            kept: [5, 9],
            least_value: 0.03,
            variant_effort: (10, 500),
            cluster_reach: 2.6,
            clusters: 20,
            least_cluster: 12,
            explained: 0.6,
            cuts: 2,
        }
    }
}

/// What the search reads of one state.
pub(super) struct SearchState<'a> {
    /// Points with their search tree.
    pub(super) points: &'a IndexedCloud<'a>,
    /// Lookup of surfaces and empty space.
    pub(super) grid: &'a SpaceGrid,
    /// Points at whose place the other state shows empty space.
    pub(super) moved: &'a [usize],
    /// Points whose place the other state does not show: they may have moved.
    pub(super) unseen: &'a [usize],
}

/// A motion with what it explains.
#[derive(Clone, Debug)]
pub(super) struct Candidate {
    /// Motion from start to end.
    pub(super) motion: Rigid,
    /// Moved points of each state it explains.
    pub(super) explained: PerState<Vec<usize>>,
    /// Value of the explained points, in points.
    pub(super) gain: f64,
    /// See [`RankingSettings::implausibility`].
    pub(super) implausibility: f32,
    /// True if what it explains may show its other side in the other state.
    pub(super) turned_over: bool,
}

/// Flags of the points `members`.
fn flags(len: usize, members: &[usize]) -> Vec<bool> {
    let mut out = vec![false; len];
    members.iter().for_each(|&i| out[i] = true);
    out
}

/// `count` points of a group with their normals. A golden-ratio sequence spreads even the first third over the group.
pub(super) fn sample_of(cloud: &Cloud, group: &[usize], count: usize) -> Vec<(Vec3, Vec3)> {
    let n = group.len();
    (0..count.min(n))
        .map(|i| {
            let f = (i as f64 * 0.618_033_988_75).fract();
            let k = group[((f * n as f64) as usize).min(n - 1)];
            (cloud.points[k], cloud.normals[k])
        })
        .collect()
}

/// Splits a group in two along its longest direction, at the widest sparse place near the middle.
fn halves(cloud: &Cloud, group: &[usize]) -> [Vec<usize>; 2] {
    const BINS: usize = 40;
    let axes = principal_axes(cloud, group);
    let mut sorted: Vec<(f32, usize)> = group.iter().map(|&i| (axes[0].dot(cloud.points[i]), i)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (lo, hi) = (sorted[0].0, sorted[sorted.len() - 1].0);
    let mut counts = vec![0usize; BINS];
    for (x, _) in &sorted {
        counts[(((x - lo) / (hi - lo).max(1e-12) * BINS as f32) as usize).min(BINS - 1)] += 1;
    }
    let cut = (BINS / 4..3 * BINS / 4).min_by_key(|&b| (counts[b], b.abs_diff(BINS / 2))).unwrap_or(BINS / 2);
    let at = lo + (hi - lo) * (cut as f32 + 0.5) / BINS as f32;
    let split = sorted.partition_point(|(x, _)| *x < at);
    [sorted[..split].iter().map(|s| s.1).collect(), sorted[split..].iter().map(|s| s.1).collect()]
}

/// Motions (own state to other state) that were found for a group of points.
type Searched = (Vec<usize>, Vec<(f32, Rigid)>);

/// Collects candidate motions from both states.
pub(super) struct Search<'a> {
    pub(super) states: PerState<SearchState<'a>>,
    pub(super) lengths: Lengths,
    /// Side on which the object opens.
    pub(super) front: Option<Front>,
    pub(super) settings: CandidateSettings,
    pub(super) ranking: RankingSettings,
    /// Least value of what a motion explains, in points.
    pub(super) least_gain: f64,
    /// The same for another round of the search. What noise leaves would be searched for minutes.
    pub(super) least_round: f64,
}

impl Search<'_> {
    /// At most `pool` distinct and registered motions, those that explain most first. Groups of moved points are
    /// searched, the points that the best motion explains are removed, and the rest is searched again, `rounds` times or
    /// until nothing worth `least_gain` points remains. `done` takes the share of the moved points that are explained.
    pub(super) fn candidates(&self, rounds: usize, pool: usize, done: Share<'_>) -> Vec<Candidate> {
        let mut open = self.states.as_ref().map(|s| s.moved.to_vec());
        let all_open = open.clone();
        let all_values = self.landing_values(&open);
        let faces = self.settings.poses.face_directions(self.states[State::END].points.cloud);
        let mut cache = PerState::default();
        let (mut winners, mut others): (Vec<Rigid>, Vec<Rigid>) = Default::default();
        let moved = open.iter().map(Vec::len).sum::<usize>().max(1) as f64;
        for _ in 0..rounds {
            done(1.0 - open.iter().map(Vec::len).sum::<usize>() as f64 / moved);
            let values = self.landing_values(&open);
            let found = self.hypotheses(&open, &values, &faces, &mut cache);
            let weighed: Vec<Candidate> = found.par_iter().map(|m| self.weigh(&open, &values, *m)).collect();
            let best = weighed.into_iter().reduce(|a, b| if b.gain > a.gain { b } else { a });
            winners.extend(best.iter().map(|b| b.motion));
            others.extend(found);
            let Some(best) = best.filter(|b| b.gain > self.least_round) else { break };
            for s in State::ALL {
                let claimed = self.claim(s, &open[s], &values[s.other()], &best.motion);
                open[s].retain(|&i| !claimed[i]);
            }
        }
        // Winners of each round first: variants of a large part's motion must not displace a small part's.
        let judge = |m: Rigid| self.weigh(&all_open, &all_values, m);
        let rest = others.into_par_iter().map(judge).filter(|c| c.gain > 0.3 * self.least_gain);
        let rest: Vec<Candidate> = rest.collect();
        let winners: Vec<Candidate> = winners.into_iter().map(judge).collect();
        let twins: Vec<Candidate> = winners.iter().flat_map(|winner| self.twins(winner)).collect();
        let order = self.order(&rest, 2 * pool);
        let ranked = winners.into_iter().chain(twins).chain(order.into_iter().map(|i| rest[i].clone()));
        self.registered(ranked, pool, &faces)
    }

    /// Motions that a symmetric part may be confused with, for the points that a candidate explains.
    fn twins(&self, candidate: &Candidate) -> Vec<Candidate> {
        /// Points that judge the plausibility.
        const SAMPLES: usize = 300;
        let state = better_seen(&candidate.explained);
        let (cloud, group) = (self.states[state].points.cloud, &candidate.explained[state]);
        let sample = sample_of(cloud, group, SAMPLES);
        let clouds = PerState::from_fn(|s| self.states[s].points.cloud.select(&candidate.explained[s]));
        let twin = |motion: Rigid| {
            let implausibility = self.ranking.implausibility(&motion, &sample, &self.lengths, self.front);
            let motion = motion.away_from(state);
            let placed = with_extents(&clouds[State::START], &clouds[State::END], &motion);
            Candidate { motion: placed.unwrap_or(motion), implausibility, turned_over: true, ..candidate.clone() }
        };
        twins(cloud, group, &candidate.motion.away_from(state)).into_iter().map(twin).collect()
    }

    pub(super) fn clouds(&self) -> PerState<&IndexedCloud<'_>> {
        self.states.as_ref().map(|s| s.points)
    }

    /// Alternates between those that explain most and those that explain most by small motions.
    pub(super) fn order(&self, rest: &[Candidate], count: usize) -> Vec<usize> {
        let (by_gain, by_small_motion) = rayon::join(
            || self.ranking.diverse_order(rest, self.clouds(), count, |c| f64::from(1.0 - c.implausibility)),
            || {
                let factor = |c: &Candidate| (1.0 - c.implausibility) * self.ranking.small_motion(c.implausibility);
                self.ranking.diverse_order(rest, self.clouds(), count, |c| f64::from(factor(c)))
            },
        );
        let mut taken = vec![false; rest.len()];
        let alternating = by_gain.iter().zip(&by_small_motion).flat_map(|(a, b)| [*a, *b]);
        alternating.filter(|&i| !std::mem::replace(&mut taken[i], true)).collect()
    }

    /// Registers candidates in their order until `pool` distinct motions are found.
    fn registered(&self, ranked: impl Iterator<Item = Candidate>, pool: usize, faces: &[Vec3]) -> Vec<Candidate> {
        /// Candidates that are registered at once.
        const BATCH: usize = 16;
        let same = |m: &Rigid, c: &Candidate| alike(m, c, self.clouds(), &self.lengths);
        let mut unregistered: Vec<Rigid> = Vec::new();
        let mut distinct = ranked.filter(|c| {
            let is_new = !unregistered.iter().any(|m| same(m, c));
            unregistered.extend(is_new.then_some(c.motion));
            is_new
        });
        let mut kept: Vec<Candidate> = Vec::new();
        loop {
            let batch: Vec<Candidate> = distinct.by_ref().take(BATCH).collect();
            let variants: Vec<Vec<Rigid>> = batch.par_iter().map(|c| self.variants(c, faces)).collect();
            for (c, motions) in batch.iter().zip(variants) {
                if kept.len() >= pool {
                    break;
                }
                for motion in motions {
                    let candidate = Candidate { motion, ..c.clone() };
                    if kept.iter().all(|k| !same(&k.motion, &candidate)) {
                        kept.push(candidate);
                    }
                }
            }
            if batch.len() < BATCH || kept.len() >= pool {
                return kept;
            }
        }
    }

    /// Value of landing on each point of each state while `open` of its moved points are unexplained.
    pub(super) fn landing_values(&self, open: &PerState<Vec<usize>>) -> PerState<Vec<f32>> {
        PerState::from_fn(|s| {
            let state = &self.states[s];
            let mut out = vec![self.settings.on_static; state.points.cloud.len()];
            state.unseen.iter().for_each(|&i| out[i] = self.settings.on_unseen);
            open[s].iter().for_each(|&i| out[i] = 1.0);
            out
        })
    }

    /// Value of one point of another state at pose `pose` in `target`: near 1 on a surface that faces the same way,
    /// negative in empty space and slightly negative where nothing was seen. `landing` are values of the target's points.
    pub(super) fn value(
        &self,
        pose: &Pose,
        p: Vec3,
        n: Vec3,
        target: &SearchState<'_>,
        landing: &[f32],
        radius: f32,
    ) -> f32 {
        let q = pose.apply(p);
        let (nearest, empty) = target.grid.lookup(q, radius);
        if nearest != NO_POINT {
            let cloud = target.points.cloud;
            let d = cloud.points[nearest as usize].distance(q) / radius;
            if d < 1.0 {
                let facing = (pose.rotation * n).dot(cloud.normals[nearest as usize]).max(0.0);
                return (1.0 - d * d) * facing * landing[nearest as usize];
            }
        }
        if empty { self.settings.in_empty } else { self.settings.in_unseen }
    }

    /// The same where landing on every point counts alike.
    pub(super) fn value_anywhere(&self, pose: &Pose, p: Vec3, n: Vec3, target: &SearchState<'_>, radius: f32) -> f32 {
        let q = pose.apply(p);
        let (nearest, _) = target.grid.lookup(q, radius);
        if nearest == NO_POINT {
            return 0.0;
        }
        let cloud = target.points.cloud;
        let d = cloud.points[nearest as usize].distance(q) / radius;
        (1.0 - d * d).max(0.0) * (pose.rotation * n).dot(cloud.normals[nearest as usize]).max(0.0)
    }

    pub(super) fn mean_value(
        &self,
        pose: &Pose,
        sample: &[(Vec3, Vec3)],
        target: &SearchState<'_>,
        landing: &[f32],
        radius: f32,
    ) -> f32 {
        /// More than the largest value of a point.
        const MOST: f32 = 1.001;
        // A third of the points is enough to reject most poses of the wide search, as soon as the points up to there cannot
        // make up for the ones before.
        let (tenth, third) = (sample.len() / 10, sample.len() / 3);
        let mut sum = 0.0;
        for (i, (p, n)) in sample.iter().enumerate() {
            sum += self.value(pose, *p, *n, target, landing, radius);
            let falls_short = |at: usize, least: f32| i <= at && sum + (at - i) as f32 * MOST < least;
            if falls_short(third, 0.0) || falls_short(tenth, -0.3 * tenth as f32) {
                return -1.0;
            }
        }
        sum / sample.len() as f32
    }

    /// Motions from start to end for the groups of open points of both states. Groups that no single motion explains are
    /// cut in halves and quarters.
    fn hypotheses(
        &self,
        open: &PerState<Vec<usize>>,
        landing: &PerState<Vec<f32>>,
        faces: &[Vec3],
        cache: &mut PerState<Vec<Searched>>,
    ) -> Vec<Rigid> {
        let of_states: Vec<(State, &mut Vec<Searched>)> = State::ALL.into_iter().zip(cache.iter_mut()).collect();
        let of_state = |(s, cache): (State, &mut Vec<Searched>)| self.hypotheses_of(s, open, landing, faces, cache);
        of_states.into_par_iter().map(of_state).collect::<Vec<Vec<Rigid>>>().concat()
    }

    /// The same for the groups of one state.
    fn hypotheses_of(
        &self,
        s: State,
        open: &PerState<Vec<usize>>,
        landing: &PerState<Vec<f32>>,
        faces: &[Vec3],
        cache: &mut Vec<Searched>,
    ) -> Vec<Rigid> {
        let settings = &self.settings;
        let least = settings.least_cluster.max((0.3 * self.least_gain) as usize);
        let cloud = self.states[s].points.cloud;
        let groups = components(cloud, &open[s], settings.cluster_reach * self.lengths.spacing, least);
        let mut queue: Vec<(Vec<usize>, usize)> = groups.into_iter().take(settings.clusters).map(|g| (g, 0)).collect();
        let (mut motions, mut next) = (Vec::new(), 0);
        while next < queue.len() {
            let (group, depth) = queue[next].clone();
            next += 1;
            let hit = cache.iter().position(|c| c.0 == group).unwrap_or_else(|| {
                let found = self.search(s, &group, &landing[s.other()], faces);
                cache.push((group.clone(), found));
                cache.len() - 1
            });
            let found = &cache[hit].1;
            motions.extend(found.iter().map(|(_, m)| m.away_from(s)));
            let explained = found.first().map_or(0.0, |f| f.0);
            if explained < settings.explained && depth < settings.cuts && group.len() >= 4 * least {
                let parts = halves(cloud, &group).into_iter().filter(|h| h.len() >= least);
                queue.extend(parts.map(|h| (h, depth + 1)));
            }
        }
        motions
    }

    /// Best motions (own state to other state) of a group of a state, refined by registration, with their mean value;
    /// best first.
    fn search(&self, state: State, group: &[usize], landing: &[f32], faces: &[Vec3]) -> Vec<(f32, Rigid)> {
        let settings = &self.settings;
        let (cloud, target) = (self.states[state].points.cloud, &self.states[state.other()]);
        let guesses = self.best_poses(state, group, landing, faces);
        let own = cloud.select(group);
        let source = IndexedCloud::new(&own);
        let fine = sample_of(cloud, group, settings.fine_points);
        let register_all = |guesses: &[Rigid], iterations: usize, max_points: usize| -> Vec<(f32, f32, Rigid)> {
            let options = RegistrationOptions {
                first_reach: f64::from(0.05 * self.lengths.diagonal),
                last_reach: f64::from(1.5 * self.lengths.spacing),
                iterations,
                max_points,
                either_side: false,
            };
            let judged = guesses.par_iter().filter_map(|guess| {
                let motion =
                    register(Matching::one_sided(&source, target.points, target.grid), *guess, None, &options).motion;
                let radius = settings.fine_reach * self.lengths.spacing;
                let value = self.mean_value(&Pose::of(&motion), &fine, target, landing, radius);
                if value <= settings.least_value {
                    return None;
                }
                let implausibility = self.ranking.implausibility(&motion, &fine, &self.lengths, self.front);
                Some((value * (1.0 - implausibility), value * self.ranking.small_motion(implausibility), motion))
            });
            judged.filter(|r| r.0 > settings.least_value).collect()
        };
        // A rough registration shows of most guesses that they are wrong.
        let rough = self.best_by_both(register_all(&guesses, 14, 250), settings.rough, &fine);
        let refined = register_all(&rough.iter().map(|r| r.1).collect::<Vec<_>>(), 20, 400);
        self.best_by_both(refined, settings.kept, &fine)
    }

    /// Poses of the wide search that are worth a registration.
    fn best_poses(&self, state: State, group: &[usize], landing: &[f32], faces: &[Vec3]) -> Vec<Rigid> {
        let settings = &self.settings;
        let (cloud, target) = (self.states[state].points.cloud, &self.states[state.other()]);
        let poses = settings.poses.poses(cloud, group, faces, self.lengths.diagonal);
        let sample = sample_of(cloud, group, settings.coarse_points);
        let radius = settings.reach * self.lengths.diagonal;
        let centre = sample.iter().map(|s| s.0).sum::<Vec3>() / sample.len() as f32;
        let mut by_value: Vec<(f32, usize)> = poses
            .par_iter()
            .enumerate()
            .with_min_len(256)
            .map(|(i, pose)| (self.mean_value(pose, &sample, target, landing, radius), i))
            .filter(|s| s.0 > 0.0)
            .collect();
        by_value.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let shift = |i: usize| poses[i].translation + poses[i].rotation * centre - centre;
        let small =
            |i: usize| self.ranking.small_motion(self.ranking.shift * shift(i).length() / self.lengths.diagonal);
        let mut by_small_motion: Vec<(f32, usize)> = by_value.iter().map(|(v, i)| (v * small(*i), *i)).collect();
        by_small_motion.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut kept: Vec<Rigid> = Vec::new();
        for (ranking, most) in [&by_value, &by_small_motion].into_iter().zip(settings.registered) {
            for (_, i) in ranking {
                if kept.len() >= most {
                    break;
                }
                let (pose, rigid) = (poses[*i], poses[*i].rigid());
                let differs = |k: &Rigid| {
                    let shift = pose.apply(centre).distance(k.apply(centre.as_dvec3()).as_vec3());
                    shift > 0.7 * radius || (k.inverse() * rigid).angle() > 0.2
                };
                if kept.iter().all(differs) {
                    kept.push(rigid);
                }
            }
        }
        kept.extend(self.front_slides(&sample, target, landing, radius));
        kept
    }

    /// The best slides out of the front and into it. A drawer that closes hides most of what was seen of it, so that the
    /// wide search may prefer every other drawer that looks the same.
    fn front_slides(
        &self,
        sample: &[(Vec3, Vec3)],
        target: &SearchState<'_>,
        landing: &[f32],
        radius: f32,
    ) -> Vec<Rigid> {
        let Some(Front { direction, .. }) = self.front else { return Vec::new() };
        let (steps, longest) = (self.settings.front_steps, self.settings.poses.longest_slide * self.lengths.diagonal);
        let mut best = Vec::new();
        for sign in [1.0, -1.0] {
            let shift = |step: usize| direction * (sign * longest * step as f32 / steps as f32);
            let value = |step: usize| {
                let pose = Pose { rotation: Mat3::IDENTITY, translation: shift(step) };
                let values = sample.iter().map(|(p, n)| self.value(&pose, *p, *n, target, landing, radius));
                values.sum::<f32>()
            };
            let values: Vec<f32> = (0..=steps + 1).map(value).collect();
            let peaks = (1..=steps).filter(|&i| values[i] >= values[i - 1] && values[i] > values[i + 1]);
            best.extend(peaks.map(|i| (values[i], Rigid::shift(shift(i).as_dvec3()))));
        }
        best.sort_by(|a, b| b.0.total_cmp(&a.0));
        best.into_iter().take(self.settings.front_slides).map(|b| b.1).collect()
    }

    /// The first distinct motions ranked by the first number, then by the second until there are `in_all`.
    pub(super) fn best_by_both(
        &self,
        judged: Vec<(f32, f32, Rigid)>,
        [by_value, in_all]: [usize; 2],
        fine: &[(Vec3, Vec3)],
    ) -> Vec<(f32, Rigid)> {
        let mut distinct: Vec<(f32, Rigid)> = Vec::new();
        let reach = f64::from(1.5 * self.lengths.spacing);
        for (rank, most) in [(0, by_value), (1, in_all)] {
            let mut ranking = judged.clone();
            ranking.sort_by(|a, b| if rank == 0 { b.0.total_cmp(&a.0) } else { b.1.total_cmp(&a.1) });
            for r in ranking {
                let gap = |m: &Rigid, p: Vec3| m.apply(p.as_dvec3()).distance(r.2.apply(p.as_dvec3()));
                if distinct.len() < most && distinct.iter().all(|d| fine.iter().any(|(p, _)| gap(&d.1, *p) > reach)) {
                    distinct.push((r.0, r.2));
                }
            }
        }
        distinct
    }

    /// Values of some points of a state under a motion from start to end.
    fn values(&self, state: State, members: &[usize], landing: &[f32], motion: &Rigid) -> Vec<f32> {
        let pose = Pose::of(&motion.away_from(state));
        let (own, target) = (self.states[state].points.cloud, &self.states[state.other()]);
        let reach = self.settings.fine_reach * self.lengths.spacing;
        members
            .par_iter()
            .with_min_len(512)
            .map(|&i| self.value(&pose, own.points[i], own.normals[i], target, landing, reach))
            .collect()
    }

    /// What a motion explains of the open points of both states.
    pub(super) fn weigh(&self, open: &PerState<Vec<usize>>, landing: &PerState<Vec<f32>>, motion: Rigid) -> Candidate {
        /// Points that judge the plausibility.
        const SAMPLES: usize = 300;
        let mut gain = 0.0f64;
        let explained = PerState::from_fn(|s| {
            let stride = open[s].len().div_ceil(self.settings.weighed_points).max(1);
            let sample: Vec<usize> = open[s].iter().copied().step_by(stride).collect();
            let values = self.values(s, &sample, &landing[s.other()], &motion);
            gain += values.iter().filter(|v| **v > 0.0).map(|v| f64::from(*v)).sum::<f64>() * stride as f64;
            self.explained(&sample, &values)
        });
        let s = better_seen(&explained);
        let sample = sample_of(self.states[s].points.cloud, &explained[s], SAMPLES);
        let implausibility = self.ranking.implausibility(&motion.away_from(s), &sample, &self.lengths, self.front);
        Candidate {
            motion,
            explained,
            gain: gain * f64::from(1.0 - implausibility),
            implausibility,
            turned_over: false,
        }
    }

    /// Those of some points that a motion explains, by their values.
    fn explained(&self, points: &[usize], values: &[f32]) -> Vec<usize> {
        let least = 0.3 * self.settings.on_static;
        points.iter().zip(values).filter(|(_, v)| **v > least).map(|(i, _)| *i).collect()
    }

    /// Open points that belong to a chosen motion: the explained ones, and those it moves to where nothing was seen if
    /// they are connected with explained ones (the inside of a drawer that was closed).
    fn claim(&self, state: State, open: &[usize], landing: &[f32], motion: &Rigid) -> Vec<bool> {
        /// Groups of which this fraction is explained belong to the motion as a whole.
        const SURE: usize = 4;
        let cloud = self.states[state].points.cloud;
        let mut claimed = flags(cloud.len(), &self.explained(open, &self.values(state, open, landing, motion)));
        let any = vec![1.0; self.states[state.other()].points.cloud.len()];
        let values = self.values(state, open, &any, motion);
        let possible: Vec<usize> = open.iter().zip(&values).filter(|(_, v)| **v > -0.5).map(|(i, _)| *i).collect();
        for group in components(cloud, &possible, self.settings.cluster_reach * self.lengths.spacing, 1) {
            let sure = group.iter().filter(|&&i| claimed[i]).count();
            if SURE * sure >= group.len() {
                group.iter().for_each(|&i| claimed[i] = true);
            }
        }
        claimed
    }

    /// Points of each state against all of the other one, those of a state only if they are at least so many.
    pub(super) fn matching<'b>(&'b self, own: &'b PerState<IndexedCloud<'b>>, least: usize) -> Matching<'b> {
        let source = |s: State| (own[s].cloud.len() >= least).then_some(&own[s]);
        Matching {
            start: source(State::START),
            end: source(State::END),
            start_target: self.states[State::START].points,
            end_target: self.states[State::END].points,
            end_grid: None,
        }
    }

    /// Variants of a candidate registered from its explained points of both states: free; where it hardly turns, the
    /// slide that shifts the points by the same; and where that slide nearly follows a direction in which the object's
    /// faces look, the slide along it (a flat front says little about motion along itself).
    fn variants(&self, candidate: &Candidate, faces: &[Vec3]) -> Vec<Rigid> {
        /// Candidates that turn more are no slides, radians.
        const SLIDE: f64 = 0.1;
        /// Least cosine between a slide and the face direction that it is taken to follow.
        const ALONG: f64 = 0.85;
        let clouds = PerState::from_fn(|s| self.states[s].points.cloud.select(&candidate.explained[s]));
        let sources = clouds.as_ref().map(IndexedCloud::new);
        let points = self.matching(&sources, 12);
        let spacing = f64::from(self.lengths.spacing);
        let options = RegistrationOptions {
            first_reach: f64::from(3.0 * self.lengths.spacing),
            last_reach: spacing,
            iterations: self.settings.variant_effort.0,
            max_points: self.settings.variant_effort.1,
            either_side: candidate.turned_over,
        };
        let free = register(points, candidate.motion, None, &options).motion;
        let mut out = vec![free];
        if free.angle() > SLIDE {
            return out;
        }
        let s = better_seen(&candidate.explained);
        let centre = clouds[s].middle().as_dvec3();
        let centre = if s == State::START { centre } else { free.inverse().apply(centre) };
        let shift = free.apply(centre) - centre;
        if shift.length() < spacing {
            return out;
        }
        out.push(Rigid::shift(shift));
        for face in faces {
            let axis = face.as_dvec3().normalize();
            let along = shift.dot(axis);
            if along.abs() > ALONG * shift.length() {
                let amount = register_along(points, axis, along, &options);
                out.push(Rigid::shift(axis * amount));
            }
        }
        out
    }
}
