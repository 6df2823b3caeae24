//! Registration of many depth frames with each other: all poses together, by points against planes and by brightness.

use super::frames::DepthFrame;
use crate::trimmed::quantile;
use artgs_core::{PerState, Rigid, State};
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Gauss-Newton over all poses. Lengths are in units of the median depth of the frames.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BundleConfig {
    /// Share of a frame's points that another frame must see for the two to be compared, 0 to 1.
    pub overlap: f64,
    /// Distance between corresponding points in the first step; falls to a multiple of the noise.
    pub gate: f64,
    /// Largest number of Gauss-Newton steps.
    pub steps: usize,
    /// Weight of brightness against depth, 0 for none.
    pub brightness: f64,
    /// Standard deviation of a stated pose: angle in degrees.
    pub stated_deg: f64,
    /// Standard deviation of a stated pose: position.
    pub stated_shift: f64,
    /// Standard deviation of the stated motion between consecutive frames: angle in degrees.
    pub step_deg: f64,
    /// Standard deviation of the stated motion between consecutive frames: position.
    pub step_shift: f64,
}

impl Default for BundleConfig {
    fn default() -> Self {
        Self {
            overlap: 0.5,
            gate: 0.08,
            steps: 14,
            brightness: 2.0,
            stated_deg: 2.0,
            stated_shift: 0.03,
            step_deg: 0.5,
            step_shift: 0.01,
        }
    }
}

/// What a registration of frames did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct BundleReport {
    /// Pairs of frames that overlap.
    pub(crate) pairs: usize,
    /// Median distance of points to the surfaces of other frames before, scene units.
    pub(crate) before: f64,
    /// The same afterwards.
    pub(crate) after: f64,
}

/// Terms of one pair: `matrix` and `vector` of the normal equations for the motion of the first frame against the second.
#[derive(Default)]
struct PairTerms {
    matrix: [[f64; 6]; 6],
    vector: [f64; 6],
    /// Residuals of depth, scene units.
    plain: Vec<f32>,
    /// Residuals of depth, relative to the expected noise.
    depth: Vec<f32>,
    /// Residuals of brightness.
    brightness: Vec<f32>,
    depth_blocks: Blocks,
    brightness_blocks: Blocks,
}

/// Residuals of the blocks of an image, 3 x 3. Errors that the residuals of a block share are not averaged out by more
/// samples: depth of phones has smooth errors of millimetres.
#[derive(Clone, Copy, Default)]
struct Blocks {
    sums: [f64; 9],
    squares: [f64; 9],
    counts: [u32; 9],
}

impl Blocks {
    fn add(&mut self, block: usize, residual: f64) {
        self.sums[block] += residual;
        self.squares[block] += residual * residual;
        self.counts[block] += 1;
    }
}

/// Standard deviation of a kind of residual, and the share of its variance that neighbouring samples have in common.
#[derive(Clone, Copy)]
struct Spread {
    sigma: f64,
    common: f64,
}

impl Spread {
    const UNKNOWN: Self = Self { sigma: f64::INFINITY, common: 0.0 };

    /// From residuals and their blocks, all pairs together.
    fn measure<'a>(residuals: Vec<f32>, blocks: impl Iterator<Item = &'a Blocks>) -> Self {
        /// From the median of absolute values to a standard deviation.
        const SIGMA: f64 = 1.4826;
        let sigma = SIGMA * median(residuals).max(1e-9);
        // Within a block: variance s2 about its mean. Of block means: t2 + s2 / count. Blocks with few samples say little.
        let (mut within, mut freedom, mut between, mut share, mut number) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for b in blocks {
            for k in 0..9 {
                let n = f64::from(b.counts[k]);
                if n >= 4.0 {
                    let mean = b.sums[k] / n;
                    // Blocks on another surface are outliers.
                    if mean.abs() < 3.0 * sigma {
                        within += b.squares[k] - n * mean * mean;
                        freedom += n - 1.0;
                        between += mean * mean;
                        share += 1.0 / n;
                        number += 1.0;
                    }
                }
            }
        }
        if number < 10.0 {
            return Self { sigma, common: 0.0 };
        }
        let within: f64 = (within / freedom).max(1e-18);
        let common = (between - within * share) / number;
        Self { sigma, common: (common / within).max(0.0) }
    }

    /// Weight of one of `n` residuals of a block that `repeated` other pairs see with the same error.
    fn weight(&self, n: f64, repeated: f64) -> f64 {
        1.0 / (self.sigma.powi(2) * (1.0 + self.common * n * repeated))
    }
}

/// Median of absolute values; 0 without values.
fn median(mut values: Vec<f32>) -> f64 {
    values.iter_mut().for_each(|v| *v = v.abs());
    quantile(values, 0.5).map_or(0.0, f64::from)
}

/// Lengths and robust scales that all pairs share.
#[derive(Clone, Copy)]
struct Scales {
    median_depth: f64,
    center: DVec3,
    gate: f64,
    depth: Spread,
    brightness: Spread,
    brightness_weight: f64,
    /// Pairs that a frame is in, on average.
    pairs_per_frame: f64,
    /// Standard deviations of the stated motion between consecutive frames: radians, scene units.
    step: (f64, f64),
}

/// Moves the frames so that their depth agrees, by `pairs` of frames that overlap ([`overlapping_pairs`]). `order` gives the
/// recording and position of every frame: frames of one recording with consecutive positions moved as stated, up to the
/// deviations of the configuration. The first frame of recording 0 does not move: it defines the world, as on the device, whose
/// drift grows from there.
pub(super) fn register_frames(
    frames: &mut [DepthFrame],
    pairs: &[(usize, usize)],
    order: &[(usize, usize)],
    config: &BundleConfig,
) -> BundleReport {
    /// Motion of a step, relative to the median depth, below which poses have settled: far below the depth noise.
    const SETTLED: f64 = 1e-4;
    let stated: Vec<Rigid> = frames.iter().map(DepthFrame::pose).collect();
    let median_depth = median_depth(frames.iter());
    let mut scales = Scales {
        median_depth,
        center: center(frames),
        gate: config.gate * median_depth,
        depth: Spread::UNKNOWN,
        brightness: Spread::UNKNOWN,
        brightness_weight: config.brightness,
        pairs_per_frame: pairs.len() as f64 / frames.len().max(1) as f64,
        step: (config.step_deg.to_radians(), config.step_shift * median_depth),
    };
    /// Steps in which samples count as independent.
    const FREE_STEPS: usize = 5;
    let mut common = (0.0, 0.0);
    let mut report = BundleReport { pairs: pairs.len(), ..BundleReport::default() };
    for step in 0..config.steps {
        let terms: Vec<PairTerms> =
            pairs.par_iter().map(|&(i, j)| pair_terms(&frames[i], &frames[i].pose(), &frames[j], &scales)).collect();
        let plain = median(terms.iter().flat_map(|t| t.plain.iter().copied()).collect());
        if step == 0 {
            report.before = plain;
        }
        report.after = plain;
        let depth = Spread::measure(
            terms.iter().flat_map(|t| t.depth.iter().copied()).collect(),
            terms.iter().map(|t| &t.depth_blocks),
        );
        let brightness = Spread::measure(
            terms.iter().flat_map(|t| t.brightness.iter().copied()).collect(),
            terms.iter().map(|t| &t.brightness_blocks),
        );
        // Wrong poses give common errors, too: what remains when poses follow the residuals freely is that of the sensor.
        if step <= FREE_STEPS {
            common = (depth.common, brightness.common);
        }
        let used = if step < FREE_STEPS { (0.0, 0.0) } else { common };
        scales.depth = Spread { common: used.0, ..depth };
        scales.brightness = Spread { common: used.1, ..brightness };
        scales.gate = (0.6 * scales.gate).max(12.0 * plain);
        if step == 0 {
            continue;
        }
        let moved = solve_step(frames, pairs, &terms, &stated, order, config, &scales);
        if step >= FREE_STEPS {
            scales.step = step_spread(frames, &stated, order, &scales);
        }
        if step > FREE_STEPS && moved < SETTLED * median_depth {
            break;
        }
    }
    report
}

/// Motion that brings frames of the end state onto the surfaces of frames of the start state: `pairs` of an end frame and a
/// start frame that are compared. The standard deviation of residuals falls from `width` to `noise`, scene units, so that
/// surfaces that moved between the states have no weight in the end.
pub(super) fn register_states(
    frames: &PerState<Vec<DepthFrame>>,
    pairs: &[(usize, usize)],
    width: f64,
    noise: f64,
) -> Rigid {
    const STEPS: i32 = 24;
    /// Factor of the standard deviation from step to step.
    const SHRINK: f64 = 0.8;
    let (start, end) = (&frames[State::START], &frames[State::END]);
    let median_depth = median_depth(frames.iter().flatten());
    let mut scales = Scales {
        median_depth,
        center: center(start),
        gate: 0.0,
        depth: Spread::UNKNOWN,
        brightness: Spread::UNKNOWN,
        brightness_weight: 0.0,
        pairs_per_frame: 1.0,
        step: (0.0, 0.0),
    };
    let mut motion = Rigid::IDENTITY;
    for step in 0..STEPS {
        let sigma = (width * SHRINK.powi(step)).max(noise);
        scales.gate = 5.0 * sigma;
        // Residuals are divided by the noise of two depths, which is about the root of two.
        scales.depth = Spread { sigma: sigma * std::f64::consts::FRAC_1_SQRT_2, common: 0.0 };
        let terms: Vec<PairTerms> = pairs
            .par_iter()
            .map(|&(i, j)| pair_terms(&end[i], &(motion * end[i].pose()), &start[j], &scales))
            .collect();
        let (mut matrix, mut vector) = (Matrix6::<f64>::zeros(), Vector6::<f64>::zeros());
        for t in &terms {
            for r in 0..6 {
                vector[r] += t.vector[r];
                for c in 0..6 {
                    matrix[(r, c)] += t.matrix[r.min(c)][r.max(c)];
                }
            }
        }
        for k in 0..6 {
            matrix[(k, k)] += 1e-9 * (1.0 + matrix[(k, k)]);
        }
        let Some(factor) = matrix.cholesky() else { break };
        let x = -factor.solve(&vector);
        motion = small_motion(DVec3::new(x[0], x[1], x[2]), DVec3::new(x[3], x[4], x[5]), scales.center) * motion;
    }
    motion
}

/// Rotation vector about `center`, then a translation.
fn small_motion(turn: DVec3, shift: DVec3, center: DVec3) -> Rigid {
    let rotation = DQuat::from_scaled_axis(turn);
    Rigid { rotation, translation: center + shift - rotation * center }
}

/// Pairs of frames, ordered both ways, in which the first shows points that the second sees.
pub(super) fn overlapping_pairs(frames: &[DepthFrame], least: f64) -> Vec<(usize, usize)> {
    /// Every so many samples are tested.
    const STRIDE: usize = 7;
    /// Depth difference below which a point counts as seen, relative to its depth: far above drift, below furniture.
    const NEAR: f64 = 0.1;
    let overlap = |i: usize, j: usize| {
        let (a, b) = (&frames[i], &frames[j]);
        let relative = b.camera.world_to_camera * a.pose();
        let tested: Vec<u32> = a.samples.iter().copied().step_by(STRIDE).collect();
        let seen = tested.iter().filter(|&&s| {
            let p = relative.apply(a.points[s as usize].as_dvec3());
            let normal = relative.turn(a.normals[s as usize].as_dvec3());
            b.cell_of(p).is_some_and(|cell| {
                let z = f64::from(b.points[cell].z);
                z > 0.0 && (z - p.z).abs() < NEAR * z && normal.dot(b.normals[cell].as_dvec3()) > 0.5
            })
        });
        seen.count() as f64 >= least * tested.len().max(1) as f64
    };
    let n = frames.len();
    (0..n)
        .into_par_iter()
        .flat_map_iter(|i| (0..n).filter(move |&j| j != i).map(move |j| (i, j)))
        .filter(|&(i, j)| overlap(i, j))
        .collect()
}

/// Median depth of the samples of some frames, scene units; 1 without samples.
pub(crate) fn median_depth<'a>(frames: impl Iterator<Item = &'a DepthFrame>) -> f64 {
    let depths = frames.flat_map(|f| f.samples.iter().map(|&s| f.points[s as usize].z)).collect();
    quantile(depths, 0.5).map_or(1.0, f64::from)
}

/// Mean of all samples, world frame.
fn center(frames: &[DepthFrame]) -> DVec3 {
    let (sum, count) = frames.iter().fold((DVec3::ZERO, 0), |(sum, count), f| {
        let pose = f.pose();
        let own: DVec3 = f.samples.iter().map(|&s| pose.apply(f.points[s as usize].as_dvec3())).sum();
        (sum + own, count + f.samples.len())
    });
    sum / count.max(1) as f64
}

/// Depth noise relative to the median depth `m`: it grows with the square of the depth, and never vanishes.
fn relative_noise(z: f64, m: f64) -> f64 {
    0.5 * (m + z * z / m)
}

/// Tukey's weight of a residual in standard deviations.
fn tukey(residual: f64) -> f64 {
    const END: f64 = 4.7;
    let t = residual / END;
    if t.abs() < 1.0 { (1.0 - t * t).powi(2) } else { 0.0 }
}

/// A sample that another frame sees: its block, the direction and size of its residuals.
struct Match {
    block: usize,
    row: [f64; 6],
    residual: f64,
    noise: f64,
}

/// Terms of frame `a` at `pose_a` (camera to world) against frame `b`.
fn pair_terms(a: &DepthFrame, pose_a: &Rigid, b: &DepthFrame, scales: &Scales) -> PairTerms {
    let pose_b = b.pose();
    let relative = b.camera.world_to_camera * *pose_a;
    let mut terms = PairTerms::default();
    let (mut depths, mut colors) = (Vec::new(), Vec::new());
    for &s in &a.samples {
        let p = relative.apply(a.points[s as usize].as_dvec3());
        let Some(cell) = b.cell_of(p) else { continue };
        let (q, n) = (b.points[cell].as_dvec3(), b.normals[cell].as_dvec3());
        if n == DVec3::ZERO || relative.turn(a.normals[s as usize].as_dvec3()).dot(n) < 0.8 {
            continue;
        }
        let residual = n.dot(p - q);
        if residual.abs() > scales.gate {
            continue;
        }
        let world = pose_b.apply(p) - scales.center;
        let row = |direction: DVec3| {
            let turn = world.cross(direction);
            [turn.x, turn.y, turn.z, direction.x, direction.y, direction.z]
        };
        let m = scales.median_depth;
        let noise = relative_noise(p.z, m).hypot(relative_noise(f64::from(a.points[s as usize].z), m));
        let block = b.block_of(cell);
        terms.plain.push(residual as f32);
        depths.push(Match { block, row: row(pose_b.turn(n)), residual, noise });
        if let Some((slope, residual)) = brightness_term(a, b, s as usize, cell, p) {
            colors.push(Match { block, row: row(pose_b.turn(slope)), residual, noise: 1.0 });
        }
    }
    add_matches(&mut terms, &depths, &scales.depth, 1.0, scales.pairs_per_frame, Kind::Depth);
    remove_exposure(&mut colors);
    if scales.brightness_weight > 0.0 {
        let weight = scales.brightness_weight;
        add_matches(&mut terms, &colors, &scales.brightness, weight, scales.pairs_per_frame, Kind::Brightness);
    }
    terms
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Depth,
    Brightness,
}

/// Subtracts the median difference of brightness: it is a difference of exposure, or the samples are too few to know.
fn remove_exposure(colors: &mut Vec<Match>) {
    const LEAST: usize = 20;
    if colors.len() < LEAST {
        return colors.clear();
    }
    let middle = colors.len() / 2;
    let mut values: Vec<f64> = colors.iter().map(|m| m.residual).collect();
    let exposure = *values.select_nth_unstable_by(middle, f64::total_cmp).1;
    colors.iter_mut().for_each(|m| m.residual -= exposure);
}

/// Adds residuals of one kind to the statistics and, once their spread is known, to the normal equations.
fn add_matches(terms: &mut PairTerms, matches: &[Match], spread: &Spread, factor: f64, repeated: f64, kind: Kind) {
    let mut blocks = Blocks::default();
    for m in matches {
        let normalised = m.residual / m.noise;
        match kind {
            Kind::Depth => terms.depth.push(normalised as f32),
            Kind::Brightness => terms.brightness.push(normalised as f32),
        }
        if normalised.abs() < 4.0 * spread.sigma {
            blocks.add(m.block, normalised);
        }
    }
    if spread.sigma.is_finite() {
        for m in matches {
            let weight = spread.weight(blocks.counts[m.block].into(), repeated);
            let robust = tukey(m.residual / m.noise / spread.sigma);
            add(terms, &m.row, m.residual, factor * robust * weight / m.noise.powi(2));
        }
    }
    match kind {
        Kind::Depth => terms.depth_blocks = blocks,
        Kind::Brightness => terms.brightness_blocks = blocks,
    }
}

/// Difference of brightness between a sample of `a` at `p` in the frame of `b` and the image of `b`, and its gradient
/// along `p`.
fn brightness_term(a: &DepthFrame, b: &DepthFrame, sample: usize, cell: usize, p: DVec3) -> Option<(DVec3, f64)> {
    let (gx, gy) = b.brightness_gradient(cell)?;
    let k = &b.camera.intrinsics;
    let (u, v) = (k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy);
    let (x, y) = ((cell % b.columns()) as f64 + 0.5, (cell / b.columns()) as f64 + 0.5);
    let (gx, gy) = (f64::from(gx), f64::from(gy));
    let there = f64::from(b.brightness[cell]) + gx * (u - x) + gy * (v - y);
    let slope = DVec3::new(gx * k.fx / p.z, gy * k.fy / p.z, -(gx * k.fx * p.x + gy * k.fy * p.y) / (p.z * p.z));
    Some((slope, there - f64::from(a.brightness[sample])))
}

fn add(terms: &mut PairTerms, row: &[f64; 6], residual: f64, weight: f64) {
    for i in 0..6 {
        for j in i..6 {
            terms.matrix[i][j] += weight * row[i] * row[j];
        }
        terms.vector[i] += weight * row[i] * residual;
    }
}

/// One Gauss-Newton step; returns the largest motion of a frame's surroundings.
fn solve_step(
    frames: &mut [DepthFrame],
    pairs: &[(usize, usize)],
    terms: &[PairTerms],
    stated: &[Rigid],
    order: &[(usize, usize)],
    config: &BundleConfig,
    scales: &Scales,
) -> f64 {
    /// Weight of the pose of the frame that defines the world, against that of the others.
    const FIXED: f64 = 1e8;
    let n = frames.len();
    let mut matrix = DMatrix::<f64>::zeros(6 * n, 6 * n);
    let mut vector = DVector::<f64>::zeros(6 * n);
    for (&(i, j), t) in pairs.iter().zip(terms) {
        for r in 0..6 {
            vector[6 * i + r] += t.vector[r];
            vector[6 * j + r] -= t.vector[r];
            for c in 0..6 {
                let v = t.matrix[r.min(c)][r.max(c)];
                matrix[(6 * i + r, 6 * i + c)] += v;
                matrix[(6 * j + r, 6 * j + c)] += v;
                matrix[(6 * i + r, 6 * j + c)] -= v;
                matrix[(6 * j + r, 6 * i + c)] -= v;
            }
        }
    }
    let deviations: Vec<[f64; 6]> =
        frames.iter().zip(stated).map(|(f, s)| twist(&(f.pose() * s.inverse()), scales.center)).collect();
    let m = scales.median_depth;
    let stated_weight = weights(config.stated_deg, config.stated_shift * m);
    let step_weight = weights(scales.step.0.to_degrees(), scales.step.1);
    for i in 0..n {
        let fixed = if order[i] == (0, 0) { FIXED } else { 1.0 };
        for r in 0..6 {
            matrix[(6 * i + r, 6 * i + r)] += fixed * stated_weight[r];
            vector[6 * i + r] += fixed * stated_weight[r] * deviations[i][r];
        }
        if let Some(j) = following(order, i) {
            for r in 0..6 {
                let w = step_weight[r];
                matrix[(6 * i + r, 6 * i + r)] += w;
                matrix[(6 * j + r, 6 * j + r)] += w;
                matrix[(6 * i + r, 6 * j + r)] -= w;
                matrix[(6 * j + r, 6 * i + r)] -= w;
                let difference = w * (deviations[i][r] - deviations[j][r]);
                vector[6 * i + r] += difference;
                vector[6 * j + r] -= difference;
            }
        }
    }
    let Some(factor) = matrix.cholesky() else { return 0.0 };
    let solution = factor.solve(&vector);
    let mut largest = 0.0_f64;
    for (i, frame) in frames.iter_mut().enumerate() {
        let x: Vec<f64> = (0..6).map(|r| -solution[6 * i + r]).collect();
        let (turn, shift) = (DVec3::new(x[0], x[1], x[2]), DVec3::new(x[3], x[4], x[5]));
        largest = largest.max(turn.length() * m + shift.length());
        frame.set_pose(small_motion(turn, shift, scales.center) * frame.pose());
    }
    largest
}

/// Spread of the deviations from the stated motion between consecutive frames.
fn step_spread(frames: &[DepthFrame], stated: &[Rigid], order: &[(usize, usize)], scales: &Scales) -> (f64, f64) {
    let deviation = |i: usize| twist(&(frames[i].pose() * stated[i].inverse()), scales.center);
    let (mut turns, mut shifts) = (Vec::new(), Vec::new());
    for i in 0..frames.len() {
        if let Some(j) = following(order, i) {
            let (a, b) = (deviation(i), deviation(j));
            (0..3).for_each(|r| turns.push((b[r] - a[r]) as f32));
            (3..6).for_each(|r| shifts.push((b[r] - a[r]) as f32));
        }
    }
    let floor = (1e-4, 1e-4 * scales.median_depth);
    let sigma = |values: Vec<f32>| 1.4826 * median(values);
    (sigma(turns).max(floor.0), sigma(shifts).max(floor.1))
}

/// Frame taken next after frame `i` in the same recording. `order` is sorted.
fn following(order: &[(usize, usize)], i: usize) -> Option<usize> {
    (order.get(i + 1)? == &(order[i].0, order[i].1 + 1)).then_some(i + 1)
}

/// Inverse variances of a twist with these standard deviations.
fn weights(deg: f64, shift: f64) -> [f64; 6] {
    let (turn, shift) = (deg.to_radians().powi(-2), shift.powi(-2));
    [turn, turn, turn, shift, shift, shift]
}

/// Rotation vector of a small motion, and where it moves `center`.
fn twist(motion: &Rigid, center: DVec3) -> [f64; 6] {
    let turn = motion.rotation.to_scaled_axis();
    let shift = motion.apply(center) - center;
    [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z]
}
