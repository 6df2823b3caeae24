//! Motion of one part between the two states: symmetric point-to-plane registration, free or bound to a joint.

use super::cloud::IndexedCloud;
use super::space_grid::{NO_POINT, SpaceGrid};
use artgs_core::{JointKind, Rigid};
use glam::{DMat3, DVec3, Vec3};
use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use rayon::prelude::*;

/// Settings of a registration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RegistrationOptions {
    /// Pairs farther apart than this are ignored in the first iteration, scene units.
    pub(crate) first_reach: f64,
    /// The same in the last iteration; shrinks geometrically in between.
    pub(crate) last_reach: f64,
    /// Gauss-Newton steps.
    pub(crate) iterations: usize,
    /// At most so many points of each side take part.
    pub(crate) max_points: usize,
    /// Points also match the other side of a surface: of a thin part, each state may show another side.
    pub(crate) either_side: bool,
}

/// Outcome of a registration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Registration {
    /// Motion from start to end.
    pub(crate) motion: Rigid,
    /// Root mean square distance to the planes over the pairs, scene units; none without enough pairs.
    pub(crate) rms: Option<f64>,
    /// Pairs in the last iteration.
    pub(crate) pairs: usize,
}

/// How pairs are chosen and weighed in every registration. The values are those of robust regression; results hardly
/// depend on them.
struct RobustSettings {
    /// With fewer pairs the motion stays as it is.
    least_pairs: usize,
    /// Least cosine between the normals of a pair.
    least_facing: f64,
    /// Points whose neighbourhood is this rough, in units of the reach, weigh half.
    roughness: f64,
    /// Residuals above this many robust standard deviations have no weight (Tukey's biweight).
    tukey: f64,
    /// Residuals below this fraction of the reach always have some weight, except in the last iterations.
    least_cut: f64,
    /// Number of those last iterations.
    exact_iterations: usize,
}

impl Default for RobustSettings {
    fn default() -> Self {
        Self { least_pairs: 12, least_facing: 0.7, roughness: 0.25, tukey: 4.7, least_cut: 0.3, exact_iterations: 4 }
    }
}

#[derive(Clone, Copy)]
struct Correspondence {
    /// Point of the start state moved to the end state.
    moved: DVec3,
    normal: DVec3,
    residual: f64,
    weight: f64,
}

/// Which points are matched, and with which.
#[derive(Clone, Copy)]
pub(crate) struct Matching<'a> {
    /// Points of the start state that are matched with those of `end_target`.
    pub(crate) start: Option<&'a IndexedCloud<'a>>,
    /// Points of the end state that are matched with those of `start_target`.
    pub(crate) end: Option<&'a IndexedCloud<'a>>,
    /// Points of the start state; may show more than the part.
    pub(crate) start_target: &'a IndexedCloud<'a>,
    /// Points of the end state; may show more than the part.
    pub(crate) end_target: &'a IndexedCloud<'a>,
    /// Finds the nearest of `end_target` to within a cell, about ten times as fast as its tree.
    pub(super) end_grid: Option<&'a SpaceGrid>,
}

impl<'a> Matching<'a> {
    /// Both states show the part and nothing else.
    pub(crate) fn mutual(start: &'a IndexedCloud<'a>, end: &'a IndexedCloud<'a>) -> Self {
        Self { start: Some(start), end: Some(end), start_target: start, end_target: end, end_grid: None }
    }

    /// Only the points of `start` are matched, with a state that may show more than the part and has a grid.
    pub(super) fn one_sided(
        start: &'a IndexedCloud<'a>,
        end_target: &'a IndexedCloud<'a>,
        end_grid: &'a SpaceGrid,
    ) -> Self {
        Self { start: Some(start), end: None, start_target: start, end_target, end_grid: Some(end_grid) }
    }

    /// Index of the point of a target nearest to a place, within a squared distance.
    fn nearest(target: &IndexedCloud<'_>, grid: Option<&SpaceGrid>, place: Vec3, limit: f32) -> Option<usize> {
        let Some(grid) = grid else { return target.nearest_within(place, limit).map(|found| found.0) };
        let (index, _) = grid.lookup(place, limit.sqrt());
        let index = (index != NO_POINT).then_some(index as usize)?;
        (target.cloud.points[index].distance_squared(place) <= limit).then_some(index)
    }
}

/// Registers a part beginning at `guess` (start to end). With `kind` the motion stays on the joint: three numbers for
/// prismatic, five for revolute, six otherwise.
pub(crate) fn register(
    points: Matching<'_>,
    guess: Rigid,
    kind: Option<JointKind>,
    options: &RegistrationOptions,
) -> Registration {
    let mut motion = guess;
    let settings = RobustSettings::default();
    let mut outcome = Registration { motion, rms: None, pairs: 0 };
    let shrink = (options.last_reach / options.first_reach).powf(1.0 / (options.iterations.max(2) - 1) as f64);
    let mut reach = options.first_reach;
    for iteration in 0..options.iterations {
        let pairs = collect_pairs(points, &motion, reach, options, &settings);
        if pairs.len() < settings.least_pairs {
            return outcome;
        }
        // Large flat faces fit at once and would make everything that fixes the motion along them look like an outlier.
        let last_ones = iteration + settings.exact_iterations >= options.iterations;
        let pairs = reweighted(pairs, if last_ones { 0.0 } else { settings.least_cut * reach }, &settings);
        let total: f64 = pairs.iter().map(|p| p.weight).sum();
        let square: f64 = pairs.iter().map(|p| p.weight * p.residual * p.residual).sum();
        outcome = Registration { motion, rms: Some((square / total.max(1e-300)).sqrt()), pairs: pairs.len() };
        let centre = pairs.iter().map(|p| p.moved).sum::<DVec3>() / pairs.len() as f64;
        motion = advance(&motion, kind, &pairs, centre);
        outcome.motion = motion;
        reach *= shrink;
    }
    outcome
}

fn collect_pairs(
    points: Matching<'_>,
    motion: &Rigid,
    reach: f64,
    options: &RegistrationOptions,
    settings: &RobustSettings,
) -> Vec<Correspondence> {
    let limit = (reach * reach) as f32;
    let inverse = motion.inverse();
    let one_way = |from: &IndexedCloud<'_>, to: &IndexedCloud<'_>, m: &Rigid, forward: bool| -> Vec<Correspondence> {
        let grid = points.end_grid.filter(|_| forward);
        let stride = from.cloud.len().div_ceil(options.max_points).max(1);
        let count = from.cloud.len().div_ceil(stride);
        (0..count)
            .into_par_iter()
            .with_min_len(256)
            .filter_map(|c| {
                let i = c * stride;
                let (p, n) = (from.cloud.points[i].as_dvec3(), from.cloud.normals[i].as_dvec3());
                let image = m.apply(p);
                let j = Matching::nearest(to, grid, image.as_vec3(), limit)?;
                let (q, nq) = (to.cloud.points[j].as_dvec3(), to.cloud.normals[j].as_dvec3());
                let facing = m.turn(n).dot(nq);
                if facing.abs() < settings.least_facing || (facing < 0.0 && !options.either_side) {
                    return None;
                }
                let weight = 1.0 / (1.0 + (f64::from(to.cloud.roughness[j]) / (settings.roughness * reach)).powi(2));
                let (moved, normal, other) =
                    if forward { (image, nq, q) } else { (motion.apply(q), motion.turn(nq), p) };
                Some(Correspondence { moved, normal, residual: normal.dot(moved - other), weight })
            })
            .collect()
    };
    let mut pairs = points.start.map_or(Vec::new(), |from| one_way(from, points.end_target, motion, true));
    if let Some(from) = points.end {
        pairs.extend(one_way(from, points.start_target, &inverse, false));
    }
    pairs
}

/// Registers a slide along the fixed unit direction `axis`; only its amount is free.
pub(crate) fn register_along(points: Matching<'_>, axis: DVec3, amount: f64, options: &RegistrationOptions) -> f64 {
    let settings = RobustSettings::default();
    let mut amount = amount;
    let mut reach = options.first_reach;
    let shrink = (options.last_reach / options.first_reach).powf(1.0 / (options.iterations.max(2) - 1) as f64);
    for _ in 0..options.iterations {
        let pairs = collect_pairs(points, &Rigid::shift(axis * amount), reach, options, &settings);
        if pairs.len() < settings.least_pairs {
            break;
        }
        let (mut curvature, mut gradient) = (1e-12, 0.0);
        for p in reweighted(pairs, settings.least_cut * reach, &settings) {
            let slope = p.normal.dot(axis);
            curvature += p.weight * slope * slope;
            gradient += p.weight * slope * p.residual;
        }
        amount -= gradient / curvature;
        reach *= shrink;
    }
    amount
}

/// True if, under a motion, the states show different sides of a thin part: few points match the same side.
pub(super) fn shows_other_side(points: Matching<'_>, motion: &Rigid, reach: f64) -> bool {
    /// Share of the matches.
    const FEW: f64 = 0.35;
    /// Points compared.
    const SAMPLES: usize = 1000;
    let settings = RobustSettings::default();
    let count = |either_side: bool| matched(points, motion, reach, SAMPLES, either_side);
    let either = count(true);
    either >= settings.least_pairs && (count(false) as f64) < FEW * either as f64
}

/// Number of matches within `reach` under a motion, of at most `max_points` of each state.
pub(super) fn matched(points: Matching<'_>, motion: &Rigid, reach: f64, max_points: usize, either_side: bool) -> usize {
    let options = RegistrationOptions { first_reach: reach, last_reach: reach, iterations: 1, max_points, either_side };
    collect_pairs(points, motion, reach, &options, &RobustSettings::default()).len()
}

/// Root mean square distance between the matched surfaces per unit of displacement in the direction, among shifts and
/// turns, that they hold least; turns count by the displacement of the pairs' mean radius. Between 0 and 1; 0 without
/// enough pairs.
pub(super) fn stiffness(points: Matching<'_>, motion: &Rigid, reach: f64, max_points: usize) -> f64 {
    let settings = RobustSettings::default();
    let either_side = shows_other_side(points, motion, reach);
    let options = RegistrationOptions { first_reach: reach, last_reach: reach, iterations: 1, max_points, either_side };
    let pairs = collect_pairs(points, motion, reach, &options, &settings);
    if pairs.len() < settings.least_pairs {
        return 0.0;
    }
    let count = pairs.len() as f64;
    let centre = pairs.iter().map(|p| p.moved).sum::<DVec3>() / count;
    let radius = (pairs.iter().map(|p| p.moved.distance_squared(centre)).sum::<f64>() / count).sqrt().max(1e-12);
    let mut a = Matrix6::<f64>::zeros();
    for p in &pairs {
        let m = (p.moved - centre).cross(p.normal) / radius;
        let j = Vector6::new(m.x, m.y, m.z, p.normal.x, p.normal.y, p.normal.z);
        a += j * j.transpose() / count;
    }
    a.symmetric_eigenvalues().min().max(0.0).sqrt()
}

/// Tukey's biweight, cut at a multiple of the robust standard deviation but not below `least_cut`.
fn reweighted(mut pairs: Vec<Correspondence>, least_cut: f64, settings: &RobustSettings) -> Vec<Correspondence> {
    let mut sizes: Vec<f64> = pairs.iter().map(|p| p.residual.abs()).collect();
    let middle = sizes.len() / 2;
    let scale = 1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
    let cut = (settings.tukey * scale).max(least_cut).max(1e-12);
    for p in &mut pairs {
        let u = p.residual / cut;
        p.weight *= if u.abs() < 1.0 { (1.0 - u * u).powi(2) } else { 0.0 };
    }
    pairs
}

/// One Gauss-Newton step. Twists are about `centre`: column of `omega`, then of `v`.
fn advance(motion: &Rigid, kind: Option<JointKind>, pairs: &[Correspondence], centre: DVec3) -> Rigid {
    let (mut a, mut b) = (Matrix6::<f64>::zeros(), Vector6::<f64>::zeros());
    for p in pairs {
        let m = (p.moved - centre).cross(p.normal);
        let j = Vector6::new(m.x, m.y, m.z, p.normal.x, p.normal.y, p.normal.z);
        a += p.weight * j * j.transpose();
        b -= p.weight * p.residual * j;
    }
    match kind {
        Some(JointKind::Prismatic) => {
            let v = solve(&a.fixed_view::<3, 3>(3, 3).clone_owned().resize(3, 3, 0.0), b.fixed_rows::<3>(3).as_slice());
            Rigid::shift(motion.translation + DVec3::new(v[0], v[1], v[2]))
        }
        Some(JointKind::Revolute) => advance_hinge(motion, &a, &b, centre),
        _ => {
            let x = solve(&a.resize(6, 6, 0.0), b.as_slice());
            let (omega, v) = (DVec3::new(x[0], x[1], x[2]), DVec3::new(x[3], x[4], x[5]));
            let turn = Rigid::about(omega.normalize_or(DVec3::Z), centre, omega.length());
            Rigid::shift(v) * turn * *motion
        }
    }
}

/// Step on the five numbers of a hinge: two tilts of the axis, two shifts of the pivot, the angle.
fn advance_hinge(motion: &Rigid, a: &Matrix6<f64>, b: &Vector6<f64>, centre: DVec3) -> Rigid {
    let screw = motion.screw();
    let (axis, angle) = (screw.axis, screw.angle);
    let pivot = screw.origin + axis * axis.dot(centre - screw.origin);
    let (e1, e2) = axis.any_orthonormal_pair();
    let i_minus_r = DMat3::IDENTITY - motion.matrix();
    let about_pivot = |omega: DVec3| (omega, (pivot - centre).cross(omega));
    let twists = [
        about_pivot(i_minus_r * e1),
        about_pivot(i_minus_r * e2),
        (DVec3::ZERO, i_minus_r * e1),
        (DVec3::ZERO, i_minus_r * e2),
        about_pivot(axis),
    ];
    let columns = DMatrix::from_fn(6, 5, |r, c| {
        let (omega, v) = twists[c];
        if r < 3 { omega[r] } else { v[r - 3] }
    });
    let reduced = columns.transpose() * a * &columns;
    let right = columns.transpose() * b;
    let x = solve(&reduced, right.as_slice());
    let tilt = e1 * x[0] + e2 * x[1];
    let turned = Rigid::about(tilt.normalize_or(DVec3::Z), DVec3::ZERO, tilt.length()).turn(axis);
    Rigid::about(turned.normalize(), pivot + e1 * x[2] + e2 * x[3], angle + x[4])
}

/// Solves with a slight damping, so that directions the planes do not fix stay where they are.
fn solve(a: &DMatrix<f64>, b: &[f64]) -> Vec<f64> {
    let n = b.len();
    let mut damped = a.clone();
    for i in 0..n {
        damped[(i, i)] += 1e-6 * a[(i, i)] + 1e-12 * a.trace() / n as f64 + 1e-300;
    }
    damped.cholesky().map_or(vec![0.0; n], |c| c.solve(&DVector::from_column_slice(b)).as_slice().to_vec())
}

#[cfg(test)]
mod tests {
    use super::super::cloud::Cloud;
    use super::*;

    /// Points on three faces of a box.
    fn corner() -> Cloud {
        let mut c = Cloud::default();
        for i in 0..30 {
            for j in 0..30 {
                let (u, v) = (i as f32 / 30.0, j as f32 / 30.0);
                for (p, n) in [
                    (Vec3::new(u, v, 0.0), Vec3::NEG_Z),
                    (Vec3::new(u, 0.0, 0.5 * v), Vec3::NEG_Y),
                    (Vec3::new(0.0, u, 0.5 * v), Vec3::NEG_X),
                ] {
                    c.points.push(p);
                    c.normals.push(n);
                    c.colors.push(Vec3::ONE);
                    c.roughness.push(0.0);
                }
            }
        }
        c
    }

    fn moved(cloud: &Cloud, m: &Rigid) -> Cloud {
        let mut out = cloud.clone();
        for i in 0..cloud.len() {
            out.points[i] = m.apply(cloud.points[i].as_dvec3()).as_vec3();
            out.normals[i] = m.turn(cloud.normals[i].as_dvec3()).as_vec3();
        }
        out
    }

    #[test]
    fn recovers_free_hinged_and_sliding_motions() {
        let start = corner();
        let axis = DVec3::new(0.1, 0.0, 1.0).normalize();
        let hinge = Rigid::about(axis, DVec3::new(0.0, 1.0, 0.2), 0.8);
        let slide = Rigid::shift(DVec3::new(0.03, -0.3, 0.1));
        let free = Rigid { translation: hinge.translation + axis * 0.1, ..hinge };
        let options = RegistrationOptions {
            first_reach: 0.1,
            last_reach: 0.02,
            iterations: 30,
            max_points: 4000,
            either_side: false,
        };
        for (truth, kind) in [(hinge, Some(JointKind::Revolute)), (slide, Some(JointKind::Prismatic)), (free, None)] {
            let end = moved(&start, &truth);
            let disturbed = Rigid::about(DVec3::new(0.0, 0.6, 0.8), DVec3::ZERO, 0.03) * truth;
            let guess = if kind == Some(JointKind::Prismatic) {
                Rigid::shift(truth.translation + DVec3::splat(0.02))
            } else {
                disturbed
            };
            let found =
                register(Matching::mutual(&IndexedCloud::new(&start), &IndexedCloud::new(&end)), guess, kind, &options);
            let x = DVec3::new(0.7, 0.4, 0.3);
            assert!((found.motion.apply(x) - truth.apply(x)).length() < 1e-5, "{kind:?}: {found:?}");
        }
    }
}
