//! Automatic exposure and white balance: one gain per colour channel and frame, from surfaces that several frames show.
//!
//! The gains are estimated before the Gaussians are fitted, so that candidates of parts, the Gaussians and the textures all
//! see equal colours, with every backend.

use super::frames::DepthFrame;
use crate::trimmed::median;
use glam::{DVec3, Vec3};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Equalisation of exposure and white balance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExposureConfig {
    /// False: colours are used as they were recorded.
    pub enabled: bool,
    /// Common points that two frames need to be compared.
    pub least_points: usize,
    /// Colours are left as they are if the gains spread by less than this (standard deviation of their logarithms).
    pub least_spread: f64,
    /// Colours of recordings are left as they are unless their disagreement falls to this share, 0 to 1. Of a Kinect's
    /// recording 0.46 remains, of simulated phones' 0.1.
    pub explained: f64,
    /// The same of captures whose states share a frame: rendered light that moves with the camera leaves 0.3 or more, and
    /// held-out images keep it.
    pub explained_in_captures: f64,
}

impl Default for ExposureConfig {
    fn default() -> Self {
        Self { enabled: true, least_points: 12, least_spread: 0.01, explained: 0.7, explained_in_captures: 0.2 }
    }
}

/// What was equalised.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Exposure {
    /// Smallest and largest gain of a frame and channel that was removed; 1 is the mean of all frames.
    pub gains: [f64; 2],
    /// Median difference of the colours of the same surfaces in two frames before and after, as a share of the colour.
    pub disagreement: [f64; 2],
}

impl Exposure {
    /// What was done.
    pub fn sentence(&self) -> String {
        let ([low, high], [before, after]) = (self.gains, self.disagreement);
        format!(
            "exposure and white balance of the images were equalised: gains from {low:.2} to {high:.2}; colours of the same \
             surfaces differed by {:.1} %, now by {:.1} %",
            100.0 * before,
            100.0 * after
        )
    }
}

/// Factors of red, green and blue that equalise each frame, and what they change; none if the colours agree as they are, or
/// unless their disagreement falls to the share `explained`.
pub(super) fn equalising(
    frames: &[&DepthFrame],
    explained: f64,
    config: &ExposureConfig,
) -> Option<(Vec<Vec3>, Exposure)> {
    if !config.enabled {
        return None;
    }
    let pairs = compared(frames, config);
    let logs: Vec<Vec<f64>> = (0..3).map(|c| log_gains(frames.len(), &pairs, c)).collect();
    let gains: Vec<DVec3> = (0..frames.len()).map(|i| DVec3::new(logs[0][i], logs[1][i], logs[2][i])).collect();
    let disagreement = |gains: &dyn Fn(usize) -> DVec3| {
        let channels = |p: &Pair| (p.ratio - gains(p.frames[0]) + gains(p.frames[1])).abs().to_array();
        let mut all: Vec<f64> = pairs.iter().flat_map(channels).collect();
        median(&mut all).map_or(0.0, f64::exp_m1)
    };
    let (before, after) = (disagreement(&|_| DVec3::ZERO), disagreement(&|i| gains[i]));
    let spread = (gains.iter().map(|g| g.length_squared()).sum::<f64>() / (3 * gains.len()).max(1) as f64).sqrt();
    if spread < config.least_spread || after > explained * before {
        return None;
    }
    let range = gains.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], g| {
        [low.min(g.min_element()), high.max(g.max_element())]
    });
    let factors = gains.iter().map(|g| (-*g).exp().as_vec3()).collect();
    Some((factors, Exposure { gains: range.map(f64::exp), disagreement: [before, after] }))
}

/// The colours of an image with the factors of its frame.
pub(super) fn applied(rgba: [u8; 4], factors: Vec3) -> [u8; 4] {
    let [r, g, b, a] = rgba;
    let scaled = |c: u8, factor: f32| (f32::from(c) * factor).round().min(255.0) as u8;
    [scaled(r, factors.x), scaled(g, factors.y), scaled(b, factors.z), a]
}

/// Two frames that show the same surfaces.
struct Pair {
    frames: [usize; 2],
    /// Median over the surfaces of the logarithm of the colour in the first less that in the second, per channel.
    ratio: DVec3,
    /// Number of compared points.
    weight: f64,
}

/// Compares every frame with every other.
fn compared(frames: &[&DepthFrame], config: &ExposureConfig) -> Vec<Pair> {
    /// Most projections of points, which bounds the time: 0.05 microseconds each.
    const MOST: usize = 6_000_000;
    let samples: usize = frames.iter().map(|f| f.samples.len()).sum();
    let stride = (samples * frames.len()).div_ceil(MOST).max(1);
    let of_frame = |i: usize| {
        let others = (0..frames.len()).filter(move |j| *j != i);
        others.filter_map(move |j| Pair::new(frames, [i, j], stride, config.least_points)).collect::<Vec<_>>()
    };
    (0..frames.len()).into_par_iter().flat_map_iter(of_frame).collect()
}

impl Pair {
    /// None if fewer than `least` of the points of the first frame are shown by the second.
    fn new(frames: &[&DepthFrame], [i, j]: [usize; 2], stride: usize, least: usize) -> Option<Self> {
        /// Depth difference within which a frame shows a point, relative to its depth.
        const SAME: f64 = 0.01;
        /// Least cosine between the normals, which excludes other surfaces beside an edge.
        const FACING: f32 = 0.8;
        let (first, second) = (frames[i], frames[j]);
        let relative = second.camera.world_to_camera * first.pose();
        let mut ratios: [Vec<f64>; 3] = Default::default();
        for &sample in first.samples.iter().step_by(stride) {
            let sample = sample as usize;
            let p = relative.apply(first.points[sample].as_dvec3());
            let Some(cell) = second.cell_of(p) else { continue };
            let normal = relative.turn(first.normals[sample].as_dvec3()).as_vec3();
            let shown = (f64::from(second.points[cell].z) - p.z).abs() < SAME * p.z;
            if !shown || normal.dot(second.normals[cell]) < FACING {
                continue;
            }
            if let Some(ratio) = log_ratio(first.colors[sample], second.colors[cell]) {
                ratios.iter_mut().zip(ratio).for_each(|(all, one)| all.push(one));
            }
        }
        let weight = ratios[0].len();
        let enough = weight >= least.max(1);
        let [r, g, b] = ratios.map(|mut all| median(&mut all).unwrap_or(0.0));
        enough.then_some(Self { frames: [i, j], ratio: DVec3::new(r, g, b), weight: weight as f64 })
    }
}

/// Logarithms of the ratios of two colours; none where a channel is dark, so that noise and offsets count, or saturated.
fn log_ratio(a: [u8; 3], b: [u8; 3]) -> Option<[f64; 3]> {
    const DARK: u8 = 16;
    const BRIGHT: u8 = 245;
    let usable = a.iter().chain(&b).all(|c| (DARK..=BRIGHT).contains(c));
    usable.then(|| [0, 1, 2].map(|c| (f64::from(a[c]) / f64::from(b[c])).ln()))
}

/// Logarithm of the gain of each frame in one channel, with mean 0, from the ratios of pairs: least squares with weights that
/// fall with the residual, so that pairs whose surfaces shine do not count.
fn log_gains(count: usize, pairs: &[Pair], channel: usize) -> Vec<f64> {
    /// Rounds of reweighting.
    const ROUNDS: usize = 8;
    /// Residual at which the weight of a pair has halved.
    const SCALE: f64 = 0.02;
    /// Weight of a gain of 1, relative to the mean weight of a frame: frames without pairs keep their colours, and each
    /// group of connected frames keeps its mean.
    const PRIOR: f64 = 1e-3;
    let mut gains = DVector::<f64>::zeros(count);
    for _ in 0..ROUNDS {
        let mut matrix = DMatrix::<f64>::zeros(count, count);
        let mut right = DVector::<f64>::zeros(count);
        for pair in pairs {
            let ([i, j], ratio) = (pair.frames, pair.ratio[channel]);
            let residual = ratio - gains[i] + gains[j];
            let weight = pair.weight / (1.0 + (residual / SCALE).powi(2));
            matrix[(i, i)] += weight;
            matrix[(j, j)] += weight;
            matrix[(i, j)] -= weight;
            matrix[(j, i)] -= weight;
            right[i] += weight * ratio;
            right[j] -= weight * ratio;
        }
        let prior = (PRIOR * matrix.trace() / count.max(1) as f64).max(f64::MIN_POSITIVE);
        (0..count).for_each(|i| matrix[(i, i)] += prior);
        let Some(solved) = Cholesky::new(matrix).map(|c| c.solve(&right)) else { break };
        gains = solved;
    }
    let mean = gains.sum() / count.max(1) as f64;
    gains.iter().map(|g| g - mean).collect()
}
