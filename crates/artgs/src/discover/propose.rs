//! Candidate motions: clusters of moved points and a wide search of hinges and slides for each.

use super::field::{Field, NOWHERE};
use super::observe::{Cloud, fit_plane};
use super::register::{Match, RegisterOptions, Searchable, register, register_along};
use artgs_core::Rigid;
use glam::{Mat3, Quat, Vec3};
use rayon::prelude::*;

/// One state as the search sees it.
pub struct Side<'a> {
    /// Points with their search tree.
    pub points: &'a Searchable<'a>,
    /// Lookup of surfaces and empty space.
    pub field: &'a Field,
    /// Points that are not there in the other state.
    pub moved: &'a [usize],
    /// Points that the other state neither shows nor looks through: they may have moved.
    pub unsure: &'a [usize],
}

/// Worth of landing on a point that is there in both states, against 1 for one that moved and is not explained yet.
const STALE: f32 = 0.35;
/// Worth of landing on a point the other state cannot see.
const UNSURE: f32 = 0.8;

/// Flags of the points `members`.
fn flags(len: usize, members: &[usize]) -> Vec<bool> {
    let mut out = vec![false; len];
    members.iter().for_each(|&i| out[i] = true);
    out
}

/// Worth of landing on each point of a side while `open` of its moved points are unexplained.
fn landing_worth(side: &Side<'_>, open: &[usize]) -> Vec<f32> {
    let mut out = vec![STALE; side.points.cloud.len()];
    side.unsure.iter().for_each(|&i| out[i] = UNSURE);
    open.iter().for_each(|&i| out[i] = 1.0);
    out
}

/// A motion with the cluster it was found from.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// Motion from start to end.
    pub motion: Rigid,
    /// Moved points of each state it explains.
    pub explained: [Vec<usize>; 2],
    /// Worth of the explained points, in points.
    pub gain: f64,
    /// Strain on credulity, 0 (rests) to 0.6; see `effort`.
    pub effort: f32,
}

/// Lengths that steer the search, scene units.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    /// Distance between neighbouring points.
    pub spacing: f32,
    /// Diagonal of the object.
    pub diagonal: f32,
}

#[derive(Clone, Copy)]
struct Pose {
    rotation: Mat3,
    translation: Vec3,
}

impl Pose {
    fn rigid(&self) -> Rigid {
        Rigid::from_matrix(self.rotation.as_dmat3(), self.translation.as_dvec3())
    }
}

/// Worth of one point under a motion: near 1 on a surface that faces the same way, -1 in empty space, slightly negative where nothing was seen.
/// `landing` weighs the other state's points: moved points land on moved points.
fn worth(pose: &Pose, p: Vec3, n: Vec3, field: &Field, cloud: &Cloud, landing: &[f32], radius: f32) -> f32 {
    let q = pose.rotation * p + pose.translation;
    let (nearest, empty) = field.lookup(q);
    if nearest != NOWHERE {
        let d = cloud.points[nearest as usize].distance(q) / radius;
        if d < 1.0 {
            let facing = (pose.rotation * n).dot(cloud.normals[nearest as usize]).max(0.0);
            return (1.0 - d * d) * facing * landing[nearest as usize];
        }
    }
    if empty { -1.0 } else { -0.1 }
}

fn mean_worth(pose: &Pose, sample: &[(Vec3, Vec3)], field: &Field, cloud: &Cloud, landing: &[f32], radius: f32) -> f32 {
    // A hopeless first third decides: the wide search spends most of its time on such poses.
    let third = sample.len() / 3;
    let mut sum = 0.0;
    for (i, (p, n)) in sample.iter().enumerate() {
        sum += worth(pose, *p, *n, field, cloud, landing, radius);
        if i == third && sum < 0.0 {
            return -1.0;
        }
    }
    sum / sample.len() as f32
}

/// Groups of moved points connected by steps of at most `reach`; largest first, groups under `least` points dropped.
pub fn components(cloud: &Cloud, members: &[usize], reach: f32, least: usize) -> Vec<Vec<usize>> {
    let cell = |p: Vec3| (p / reach).floor().as_ivec3().to_array();
    let mut grid: std::collections::BTreeMap<[i32; 3], Vec<usize>> = std::collections::BTreeMap::new();
    for &i in members {
        grid.entry(cell(cloud.points[i])).or_default().push(i);
    }
    let mut seen = std::collections::BTreeSet::new();
    let mut groups = Vec::new();
    for &seed in members {
        if !seen.insert(seed) {
            continue;
        }
        let (mut group, mut next) = (vec![seed], 0);
        while next < group.len() {
            let p = cloud.points[group[next]];
            next += 1;
            let c = cell(p);
            for d in 0..27 {
                let key = [c[0] + d % 3 - 1, c[1] + d / 3 % 3 - 1, c[2] + d / 9 - 1];
                for &j in grid.get(&key).map_or(&[][..], |v| v) {
                    if cloud.points[j].distance(p) <= reach && seen.insert(j) {
                        group.push(j);
                    }
                }
            }
        }
        if group.len() >= least {
            groups.push(group);
        }
    }
    groups.sort_by_key(|g| std::cmp::Reverse(g.len()));
    groups
}

/// Splits a group in two along its longest direction, at the widest sparse place near the middle.
fn halves(cloud: &Cloud, group: &[usize]) -> [Vec<usize>; 2] {
    let axes = principal_axes(cloud, group);
    let mut sorted: Vec<(f32, usize)> = group.iter().map(|&i| (axes[0].dot(cloud.points[i]), i)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (lo, hi) = (sorted[0].0, sorted[sorted.len() - 1].0);
    let bins = 40;
    let mut counts = vec![0usize; bins];
    for (x, _) in &sorted {
        counts[(((x - lo) / (hi - lo).max(1e-12) * bins as f32) as usize).min(bins - 1)] += 1;
    }
    let cut = (bins / 4..3 * bins / 4).min_by_key(|&b| (counts[b], b.abs_diff(bins / 2))).unwrap_or(bins / 2);
    let at = lo + (hi - lo) * (cut as f32 + 0.5) / bins as f32;
    let split = sorted.partition_point(|(x, _)| *x < at);
    [sorted[..split].iter().map(|s| s.1).collect(), sorted[split..].iter().map(|s| s.1).collect()]
}

/// Principal directions of a group, longest first.
fn principal_axes(cloud: &Cloud, group: &[usize]) -> [Vec3; 3] {
    let points: Vec<Vec3> = group.iter().map(|&i| cloud.points[i]).collect();
    let (short, _) = fit_plane(&points);
    let mean = points.iter().sum::<Vec3>() / points.len() as f32;
    let (u, v) = short.any_orthonormal_pair();
    let (mut uu, mut uv, mut vv) = (0.0f32, 0.0, 0.0);
    for p in &points {
        let (a, b) = ((*p - mean).dot(u), (*p - mean).dot(v));
        uu += a * a;
        uv += a * b;
        vv += b * b;
    }
    let angle = 0.5 * (2.0 * uv).atan2(uu - vv);
    let long = u * angle.cos() + v * angle.sin();
    [long, short.cross(long), short]
}

/// Directions along which the object's faces look, most common first: peaks of the histogram of normals.
fn face_directions(cloud: &Cloud, at_most: usize) -> Vec<Vec3> {
    let mut peaks: Vec<(Vec3, f32)> = Vec::new();
    let stride = (cloud.len() / 4000).max(1);
    for n in cloud.normals.iter().step_by(stride) {
        match peaks.iter_mut().find(|(d, _)| d.dot(*n).abs() > 0.985) {
            Some((d, c)) => {
                let s = if d.dot(*n) < 0.0 { -*n } else { *n };
                *d = (*d * *c + s).normalize();
                *c += 1.0;
            }
            None => peaks.push((*n, 1.0)),
        }
    }
    peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
    peaks.into_iter().take(at_most).map(|p| p.0).collect()
}

fn distinct(directions: impl IntoIterator<Item = Vec3>) -> Vec<Vec3> {
    let mut out: Vec<Vec3> = Vec::new();
    for d in directions {
        if d.is_finite() && d.length() > 0.5 && out.iter().all(|o| o.dot(d).abs() < 0.995) {
            out.push(d);
        }
    }
    out
}

/// Evenly spread directions on the half sphere.
fn half_sphere(count: usize) -> Vec<Vec3> {
    (0..count)
        .map(|i| {
            let z = (i as f32 + 0.5) / count as f32;
            let (s, c) = (2.399_963_2 * i as f32).sin_cos();
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * c, r * s, z)
        })
        .collect()
}

/// Candidate motions of a cluster in its own state's frame: slides in all directions, hinges along likely directions
/// through a grid of pivots across the cluster's box.
fn candidate_poses(cloud: &Cloud, group: &[usize], faces: &[Vec3], diagonal: f32) -> Vec<Pose> {
    let axes = principal_axes(cloud, group);
    let mut poses = Vec::new();
    let shifts = distinct(axes.into_iter().chain(faces.iter().copied()).chain(half_sphere(120)));
    for d in &shifts {
        for step in 1..=32 {
            let t = *d * (diagonal * 0.6 * (step as f32 / 32.0).powf(1.3));
            poses.push(Pose { rotation: Mat3::IDENTITY, translation: t });
            poses.push(Pose { rotation: Mat3::IDENTITY, translation: -t });
        }
    }
    for a in distinct(axes.into_iter().chain(faces.iter().copied())) {
        let (u, v) = a.any_orthonormal_pair();
        // Cells follow the box of the cluster seen along the axis, so turn the grid with the cluster.
        let flat = |p: Vec3| (p.dot(u), p.dot(v));
        let (mut sxx, mut sxy, mut syy, mut mx, mut my) = (0.0f32, 0.0f32, 0.0f32, 0.0f32, 0.0f32);
        for &i in group {
            let (x, y) = flat(cloud.points[i]);
            mx += x / group.len() as f32;
            my += y / group.len() as f32;
        }
        for &i in group {
            let (x, y) = flat(cloud.points[i]);
            sxx += (x - mx) * (x - mx);
            sxy += (x - mx) * (y - my);
            syy += (y - my) * (y - my);
        }
        let turn = 0.5 * (2.0 * sxy).atan2(sxx - syy);
        let (gu, gv) = (u * turn.cos() + v * turn.sin(), v * turn.cos() - u * turn.sin());
        let range = |d: Vec3| {
            let mut xs: Vec<f32> = group.iter().map(|&i| cloud.points[i].dot(d)).collect();
            xs.sort_unstable_by(f32::total_cmp);
            let (lo, hi) = (xs[xs.len() / 100], xs[xs.len() - 1 - xs.len() / 100]);
            let pad = 0.05 * (hi - lo) + 0.01 * diagonal;
            (lo - pad, hi + pad)
        };
        let (ru, rv) = (range(gu), range(gv));
        let cells = |r: (f32, f32)| (((r.1 - r.0) / (0.035 * diagonal)).ceil() as usize).clamp(3, 11);
        let (nu, nv) = (cells(ru), cells(rv));
        for i in 0..nu {
            for j in 0..nv {
                let x = ru.0 + (ru.1 - ru.0) * i as f32 / (nu - 1) as f32;
                let y = rv.0 + (rv.1 - rv.0) * j as f32 / (nv - 1) as f32;
                let pivot = gu * x + gv * y;
                for step in 1..=30 {
                    for sign in [1.0, -1.0] {
                        let rotation =
                            Mat3::from_quat(Quat::from_axis_angle(a, sign * step as f32 * 6f32.to_radians()));
                        poses.push(Pose { rotation, translation: pivot - rotation * pivot });
                    }
                }
            }
        }
    }
    poses
}

fn sample_of(cloud: &Cloud, group: &[usize], count: usize) -> Vec<(Vec3, Vec3)> {
    // Bit-reversed strides spread even the first third over the whole group.
    let n = group.len();
    (0..count.min(n))
        .map(|i| {
            let f = (i as f64 * 0.618_033_988_75).fract();
            let k = group[((f * n as f64) as usize).min(n - 1)];
            (cloud.points[k], cloud.normals[k])
        })
        .collect()
}

/// Best motions (own state to other state) of a cluster, refined by registration, with their mean worth; best first.
fn search(
    cloud: &Cloud,
    group: &[usize],
    other: &Side<'_>,
    landing: &[f32],
    faces: &[Vec3],
    scales: &Scales,
) -> Vec<(f32, Rigid)> {
    let poses = candidate_poses(cloud, group, faces, scales.diagonal);
    let sample = sample_of(cloud, group, 120);
    let radius = 0.035 * scales.diagonal;
    let target = other.points.cloud;
    let centre = sample.iter().map(|s| s.0).sum::<Vec3>() / sample.len() as f32;
    let mut scored: Vec<(f32, usize)> = poses
        .par_iter()
        .enumerate()
        .with_min_len(256)
        .map(|(i, pose)| (mean_worth(pose, &sample, other.field, target, landing, radius), i))
        .filter(|s| s.0 > 0.0)
        .collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let reach = |i: usize| poses[i].translation + poses[i].rotation * centre - centre;
    let mut modest: Vec<(f32, usize)> =
        scored.iter().map(|(v, i)| (v * modesty(0.4 * reach(*i).length() / scales.diagonal), *i)).collect();
    modest.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut kept: Vec<Rigid> = Vec::new();
    for (ranking, most) in [(&scored, 30), (&modest, 50)] {
        for (_, i) in ranking {
            if kept.len() >= most {
                break;
            }
            let pose = poses[*i];
            let differs = |k: &Rigid| {
                let shift = (pose.rotation * centre + pose.translation).distance(k.apply(centre.as_dvec3()).as_vec3());
                let angle = (k.inverse() * pose.rigid()).angle();
                shift > 0.7 * radius || angle > 0.2
            };
            if kept.iter().all(differs) {
                kept.push(pose.rigid());
            }
        }
    }
    let own = cloud.select(group);
    let source = Searchable::new(&own);
    let fine = sample_of(cloud, group, 600);
    let register_all = |guesses: &[Rigid], iterations: usize, max_points: usize| -> Vec<(f32, f32, Rigid)> {
        let options = RegisterOptions {
            first_reach: f64::from(0.05 * scales.diagonal),
            last_reach: f64::from(1.5 * scales.spacing),
            iterations,
            max_points,
        };
        let judged = guesses.par_iter().map(|guess| {
            let motion = register(Match::one_sided(&source, other.points), *guess, None, &options).motion;
            let pose = Pose { rotation: motion.matrix().as_mat3(), translation: motion.translation.as_vec3() };
            let value = mean_worth(&pose, &fine, other.field, target, landing, FINE_REACH * scales.spacing);
            let effort = effort(&motion, &fine, scales);
            (value * (1.0 - effort), value * modesty(effort), motion)
        });
        judged.filter(|r| r.0 > 0.03).collect()
    };
    // Most guesses show after a rough registration that they lead nowhere.
    let rough = best_by_both(register_all(&kept, 14, 250), 14, 28, &fine, scales);
    let refined = register_all(&rough.iter().map(|r| r.1).collect::<Vec<_>>(), 20, 400);
    best_by_both(refined, 5, 9, &fine, scales)
}

/// The first `by_worth` distinct motions ranked by the first number, then by the second until there are `in_all`.
fn best_by_both(
    judged: Vec<(f32, f32, Rigid)>,
    by_worth: usize,
    in_all: usize,
    fine: &[(Vec3, Vec3)],
    scales: &Scales,
) -> Vec<(f32, Rigid)> {
    let mut distinct: Vec<(f32, Rigid)> = Vec::new();
    let reach = f64::from(1.5 * scales.spacing);
    for (rank, most) in [(0, by_worth), (1, in_all)] {
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

/// Factor that ranks modest motions first; the second ranking keeps them from being crowded out by far-fetched ones
/// that happen to land on a twin of the part.
fn modesty(effort: f32) -> f32 {
    (-15.0 * effort).exp()
}

/// A point explains another if they are this many spacings apart or less.
const FINE_REACH: f32 = 1.6;

/// Between motions that explain the same, the one that moves and turns less and whose hinge lies on the part is meant.
/// Two like doors can be mistaken for each other by everything but this. About 0.1 for an ordinary door, at most 0.6.
fn effort(motion: &Rigid, sample: &[(Vec3, Vec3)], scales: &Scales) -> f32 {
    let count = sample.len().max(1) as f32;
    let moved = |p: Vec3| motion.apply(p.as_dvec3()).as_vec3();
    let shift = sample.iter().map(|(p, _)| moved(*p).distance(*p)).sum::<f32>() / count / scales.diagonal;
    let angle = motion.angle() as f32;
    let mut far = 0.0;
    if angle > 0.1 {
        let screw = motion.screw();
        let (axis, origin) = (screw.axis.as_vec3(), screw.origin.as_vec3());
        let gap = sample.iter().map(|(p, _)| (*p - origin).cross(axis).length()).fold(f32::INFINITY, f32::min);
        far = (gap / scales.diagonal).min(0.2) + (screw.slide.abs() as f32 / scales.diagonal).min(0.2);
    }
    (0.1 * angle / std::f32::consts::PI + 0.4 * shift + 0.8 * far).min(0.6)
}

/// Collects candidate motions, at most `pool` of them, all distinct and registered, those that explain most first.
/// Groups of moved points are searched, the motion that explains most takes its points away, and the rest is searched
/// again, `rounds` times or until nothing worth `least_gain` points remains.
pub fn propose(sides: [&Side<'_>; 2], scales: &Scales, rounds: usize, pool: usize, least_gain: f64) -> Vec<Proposal> {
    let mut open: [Vec<usize>; 2] = [sides[0].moved.to_vec(), sides[1].moved.to_vec()];
    let all_open = open.clone();
    let all_landing = [0, 1].map(|s| landing_worth(sides[s], &open[s]));
    let faces = face_directions(sides[1].points.cloud, 6);
    let mut cache = Vec::new();
    let (mut motions, mut others): (Vec<Rigid>, Vec<Rigid>) = Default::default();
    for _ in 0..rounds {
        let landing = [0, 1].map(|s| landing_worth(sides[s], &open[s]));
        let found = hypotheses(&sides, &open, &landing, &faces, scales, least_gain, &mut cache);
        let weighed = found.iter().map(|m| weigh(&sides, &open, &landing, *m, scales));
        let best = weighed.reduce(|a, b| if b.gain > a.gain { b } else { a });
        motions.extend(best.iter().map(|b| b.motion));
        others.extend(found);
        let Some(best) = best.filter(|b| b.gain > least_gain) else { break };
        for s in 0..2 {
            let claimed = claim(&sides, &open[s], &best, s, scales);
            open[s].retain(|&i| !claimed[i]);
        }
    }
    // Winners of each round first: variants of a large part's motion must not crowd out a small part's.
    let judge = |m: Rigid| weigh(&sides, &all_open, &all_landing, m, scales);
    let rest: Vec<Proposal> = others.into_iter().map(judge).filter(|p| p.gain > 0.3 * least_gain).collect();
    let (by_gain, by_modesty) = rayon::join(
        || diverse_order(&rest, sides, 2 * pool, |p| f64::from(1.0 - p.effort)),
        || diverse_order(&rest, sides, 2 * pool, |p| f64::from((1.0 - p.effort) * modesty(p.effort))),
    );
    let winners: Vec<Proposal> = motions.into_iter().map(judge).collect();
    let mut taken = vec![false; rest.len()];
    let alternating = by_gain.iter().zip(&by_modesty).flat_map(|(a, b)| [*a, *b]);
    let alternating = alternating.filter(|&i| !std::mem::replace(&mut taken[i], true)).map(|i| rest[i].clone());
    let proposals = winners.into_iter().chain(alternating);
    let mut raw: Vec<Rigid> = Vec::new();
    let mut kept: Vec<Proposal> = Vec::new();
    for p in proposals {
        if kept.len() >= pool {
            break;
        }
        if raw.iter().any(|m| alike(m, &p, sides, scales)) {
            continue;
        }
        raw.push(p.motion);
        for motion in variants(sides, &p, &faces, scales) {
            let candidate = Proposal { motion, ..p.clone() };
            if kept.iter().all(|k| !alike(&k.motion, &candidate, sides, scales)) {
                kept.push(candidate);
            }
        }
    }
    kept
}

/// Order in which proposals are worth keeping, at most `count` of them: each time the one that explains most, times its
/// `factor`, where a point counts half as much each time that one taken before explains it. Without that, a hundred
/// variants of one good motion would crowd out the only one of another part.
fn diverse_order(
    proposals: &[Proposal],
    sides: [&Side<'_>; 2],
    count: usize,
    factor: impl Fn(&Proposal) -> f64,
) -> Vec<usize> {
    let mut weights = sides.map(|side| vec![1.0f64; side.points.cloud.len()]);
    let value = |p: &Proposal, weights: &[Vec<f64>; 2]| {
        let explained = p.explained.iter().zip(weights);
        factor(p) * explained.map(|(points, w)| points.iter().map(|&i| w[i]).sum::<f64>()).sum::<f64>()
    };
    // Values only fall, so one that still leads after a fresh look leads for good.
    let mut waiting: Vec<(f64, usize)> = proposals.iter().map(|p| value(p, &weights)).zip(0..).collect();
    let ascending = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1));
    waiting.sort_by(ascending);
    let mut order = Vec::new();
    while order.len() < count
        && let Some((_, best)) = waiting.pop()
    {
        let fresh = (value(&proposals[best], &weights), best);
        if waiting.last().is_some_and(|next| ascending(&fresh, next).is_lt()) {
            let place = waiting.partition_point(|w| ascending(w, &fresh).is_lt());
            waiting.insert(place, fresh);
            continue;
        }
        order.push(best);
        for (points, w) in proposals[best].explained.iter().zip(&mut weights) {
            points.iter().for_each(|&i| w[i] *= 0.5);
        }
    }
    order
}

/// True if a motion takes the points explained by a proposal to the same places as the proposal does.
fn alike(motion: &Rigid, proposal: &Proposal, sides: [&Side<'_>; 2], scales: &Scales) -> bool {
    let [start, end] = &proposal.explained;
    let (s, members) = if start.len() > end.len() { (0, start) } else { (1, end) };
    let pick = |m: &Rigid| if s == 0 { *m } else { m.inverse() };
    let (a, b) = (pick(motion), pick(&proposal.motion));
    let sample = sample_of(sides[s].points.cloud, members, 50);
    let gap = |p: Vec3| a.apply(p.as_dvec3()).distance(b.apply(p.as_dvec3()));
    sample.iter().map(|(p, _)| gap(*p)).fold(0.0, f64::max) < f64::from(0.5 * scales.spacing)
}

/// Motions (own state to other state) searched for a group of a state.
type Searched = (usize, Vec<usize>, Vec<(f32, Rigid)>);

/// Motions from start to end for the groups of open points of both states. Groups that no single motion explains are
/// cut in halves and quarters.
fn hypotheses(
    sides: &[&Side<'_>; 2],
    open: &[Vec<usize>; 2],
    landing: &[Vec<f32>; 2],
    faces: &[Vec3],
    scales: &Scales,
    least_gain: f64,
    cache: &mut Vec<Searched>,
) -> Vec<Rigid> {
    let least = 12usize.max((0.3 * least_gain) as usize);
    let mut motions = Vec::new();
    for s in 0..2 {
        let cloud = sides[s].points.cloud;
        let groups = components(cloud, &open[s], 2.6 * scales.spacing, least);
        let mut queue: Vec<(Vec<usize>, usize)> = groups.into_iter().take(20).map(|g| (g, 0)).collect();
        let mut next = 0;
        while next < queue.len() {
            let (group, depth) = queue[next].clone();
            next += 1;
            let hit = cache.iter().position(|c| c.0 == s && c.1 == group).unwrap_or_else(|| {
                let found = search(cloud, &group, sides[1 - s], &landing[1 - s], faces, scales);
                cache.push((s, group.clone(), found));
                cache.len() - 1
            });
            let found = &cache[hit].2;
            motions.extend(found.iter().map(|(_, m)| if s == 0 { *m } else { m.inverse() }));
            let explained = found.first().map_or(0.0, |f| f.0);
            if explained < 0.6 && depth < 2 && group.len() >= 4 * least {
                queue.extend(halves(cloud, &group).into_iter().filter(|h| h.len() >= least).map(|h| (h, depth + 1)));
            }
        }
    }
    motions
}

/// Worth of the open points of state `s` under a motion from start to end.
fn worths(
    sides: &[&Side<'_>; 2],
    open: &[usize],
    landing: &[f32],
    motion: &Rigid,
    s: usize,
    scales: &Scales,
) -> Vec<f32> {
    let m = if s == 0 { *motion } else { motion.inverse() };
    let pose = Pose { rotation: m.matrix().as_mat3(), translation: m.translation.as_vec3() };
    let (own, other) = (sides[s].points.cloud, sides[1 - s]);
    let reach = FINE_REACH * scales.spacing;
    open.par_iter()
        .with_min_len(512)
        .map(|&i| worth(&pose, own.points[i], own.normals[i], other.field, other.points.cloud, landing, reach))
        .collect()
}

/// What a motion explains of the open points of both states.
fn weigh(
    sides: &[&Side<'_>; 2],
    open: &[Vec<usize>; 2],
    landing: &[Vec<f32>; 2],
    motion: Rigid,
    scales: &Scales,
) -> Proposal {
    let mut explained = [Vec::new(), Vec::new()];
    let mut gain = 0.0f64;
    for s in 0..2 {
        let values = worths(sides, &open[s], &landing[1 - s], &motion, s, scales);
        explained[s] = open[s].iter().zip(&values).filter(|(_, v)| **v > 0.3 * STALE).map(|(i, _)| *i).collect();
        gain += values.iter().filter(|v| **v > 0.0).map(|v| f64::from(*v)).sum::<f64>();
    }
    let s = usize::from(explained[1].len() > explained[0].len());
    let sample = sample_of(sides[s].points.cloud, &explained[s], 300);
    let effort = effort(&if s == 0 { motion } else { motion.inverse() }, &sample, scales);
    Proposal { motion, explained, gain: gain * f64::from(1.0 - effort), effort }
}

/// Open points that a chosen motion takes: the explained ones, and those it moves to where nothing was seen
/// if they hang together with explained ones (the inside of a drawer that was shut).
fn claim(sides: &[&Side<'_>; 2], open: &[usize], proposal: &Proposal, s: usize, scales: &Scales) -> Vec<bool> {
    let cloud = sides[s].points.cloud;
    let any = vec![1.0; sides[1 - s].points.cloud.len()];
    let values = worths(sides, open, &any, &proposal.motion, s, scales);
    let possible: Vec<usize> = open.iter().zip(&values).filter(|(_, v)| **v > -0.5).map(|(i, _)| *i).collect();
    let mut claimed = flags(cloud.len(), &proposal.explained[s]);
    for group in components(cloud, &possible, 2.6 * scales.spacing, 1) {
        let sure = group.iter().filter(|&&i| claimed[i]).count();
        if 4 * sure >= group.len() {
            group.iter().for_each(|&i| claimed[i] = true);
        }
    }
    claimed
}

/// Variants of a proposal registered from its explained points of both states: free; where it hardly turns, the slide
/// that shifts the points alike; and where that slide nearly follows a direction in which the object's faces look, the
/// slide along it (a flat front says little about motion along itself).
fn variants(sides: [&Side<'_>; 2], proposal: &Proposal, faces: &[Vec3], scales: &Scales) -> Vec<Rigid> {
    let clouds = [0, 1].map(|s| sides[s].points.cloud.select(&proposal.explained[s]));
    let sources = [Searchable::new(&clouds[0]), Searchable::new(&clouds[1])];
    let looking = |s: usize| (clouds[s].len() >= 12).then_some(&sources[s]);
    let points =
        Match { start: looking(0), end: looking(1), start_target: sides[0].points, end_target: sides[1].points };
    let options = RegisterOptions {
        first_reach: f64::from(3.0 * scales.spacing),
        last_reach: f64::from(scales.spacing),
        iterations: 15,
        max_points: 2500,
    };
    let free = register(points, proposal.motion, None, &options).motion;
    let mut out = vec![free];
    if free.angle() > 0.1 {
        return out;
    }
    let s = usize::from(clouds[1].len() > clouds[0].len());
    let centre = (clouds[s].points.iter().sum::<Vec3>() / clouds[s].len().max(1) as f32).as_dvec3();
    let centre = if s == 0 { centre } else { free.inverse().apply(centre) };
    let shift = free.apply(centre) - centre;
    if shift.length() < f64::from(scales.spacing) {
        return out;
    }
    out.push(Rigid::shift(shift));
    for face in faces {
        let axis = face.as_dvec3().normalize();
        let along = shift.dot(axis);
        if along.abs() > 0.85 * shift.length() {
            let amount = register_along(points, axis, along, &options);
            out.push(Rigid::shift(axis * amount));
        }
    }
    out
}
