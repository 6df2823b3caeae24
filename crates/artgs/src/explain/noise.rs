//! The noise of a capture, measured where nothing moved: surfels of a state in the views of the same state.

use super::evidence::{Surfel, residual};
use super::settings::ExplainSettings;
use crate::discover::Cloud;
use crate::discover::scene::Scene;
use crate::neighbours::PointTree;
use artgs_core::State;
use rayon::prelude::*;

/// Borders between ranges of the cosine of incidence.
const EDGES: [f32; 3] = [0.35, 0.6, 0.85];

/// What was measured in one state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise {
    /// Standard deviation of depth by cosine of incidence, scene units, most oblique first.
    pub(super) deviation: [f32; 4],
    /// Shares of the predictions for front-facing surfels that were hit, hidden and seen through.
    pub(super) rates: [f32; 3],
    /// Number of neighbouring surfels whose errors count as one.
    pub(super) shared: f32,
}

impl Noise {
    /// Standard deviation of depth at a cosine of incidence, scene units.
    pub(super) fn deviation_at(&self, cosine: f32) -> f32 {
        self.deviation[EDGES.iter().take_while(|edge| cosine >= **edge).count()]
    }

    /// Adds an independent error, scene units.
    pub(super) fn add(&mut self, deviation: f32) {
        self.deviation.iter_mut().for_each(|own| *own = own.hypot(deviation));
    }

    /// Measures a state.
    pub(super) fn measured(scene: &Scene, cloud: &Cloud, state: State, settings: &ExplainSettings) -> Self {
        /// Every so many surfels are measured.
        const STRIDE: usize = 2;
        let views = &scene.states[state].views;
        let gate = settings.gate * scene.lengths.diagonal;
        let surfels: Vec<Surfel> = (0..cloud.len()).step_by(STRIDE).map(|i| Surfel::of(cloud, i)).collect();
        // (residual, cosine) of every other view: the surfels were made from all of them.
        let seen: Vec<Vec<(f32, f32)>> = surfels
            .par_iter()
            .map(|s| views.iter().skip(1).step_by(2).filter_map(|v| residual(v, s, settings.facing)).collect())
            .collect();
        let front = || seen.iter().flatten().filter(|(_, cosine)| *cosine >= settings.facing);
        let floor = settings.motion_error * scene.lengths.diagonal;
        let deviation = std::array::from_fn(|bin| {
            let own = |c: f32| EDGES.iter().take_while(|edge| c >= **edge).count() == bin;
            let sizes: Vec<f32> = front().filter(|(r, c)| own(*c) && r.abs() < gate).map(|(r, _)| r.abs()).collect();
            let median = crate::trimmed::quantile(sizes, 0.5).unwrap_or(gate / 4.0);
            (1.4826 * median).hypot(floor)
        });
        let mut noise = Self { deviation, rates: [1.0, 0.0, 0.0], shared: 1.0 };
        let limit = settings.hit;
        let kind = |(r, c): &(f32, f32)| {
            let t = r / noise.deviation_at(*c);
            if t.abs() <= limit { 0 } else { 1 + usize::from(t > 0.0) }
        };
        let mut counts = [0f32; 3];
        front().for_each(|seen| counts[kind(seen)] += 1.0);
        let total = counts.iter().sum::<f32>().max(1.0);
        let through: Vec<f32> = seen
            .iter()
            .map(|of| {
                let kinds = || of.iter().filter(|(_, c)| *c >= settings.facing).map(kind);
                let (hit, through) = (kinds().filter(|k| *k == 0).count(), kinds().filter(|k| *k == 2).count());
                through as f32 / (hit + through).max(1) as f32
            })
            .collect();
        noise.rates = counts.map(|c| c / total);
        noise.shared = shared(&surfels, &through, settings.spacing * scene.lengths.spacing);
        noise
    }
}

/// Nats of a residual of `t` standard deviations against one that is as large as they usually are, of Student's distribution with three
/// degrees of freedom: errors at edges and of curved surfaces are larger than normal ones. Usual residuals cost nothing: else surfels that
/// are seen with a usual error would gain by being hidden.
pub(super) fn misfit(t: f32) -> f32 {
    /// Standard deviations that are usual.
    const USUAL: f32 = 2.0;
    2.0 * ((1.0 + t * t / 3.0) / (1.0 + USUAL * USUAL / 3.0)).ln().max(0.0)
}

/// One, and for every ring of neighbours their number times the correlation of the share of views that look through.
fn shared(surfels: &[Surfel], through: &[f32], spacing: f32) -> f32 {
    /// Neighbours that are compared.
    const NEIGHBOURS: usize = 40;
    /// Farthest neighbour, spacings.
    const REACH: f32 = 5.0;
    /// Every so many surfels are compared.
    const STRIDE: usize = 5;
    let coords: Vec<[f32; 3]> = surfels.iter().map(|s| s.point.to_array()).collect();
    let tree = PointTree::new(&coords);
    let mean = through.iter().sum::<f32>() / through.len().max(1) as f32;
    let variance = through.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / through.len().max(1) as f32;
    if variance < 1e-9 {
        return 1.0;
    }
    let sampled: Vec<usize> = (0..surfels.len()).step_by(STRIDE).collect();
    let sum: f32 = sampled
        .par_iter()
        .map(|&i| {
            let mut sum = 0.0;
            tree.nearest_n(&coords[i], NEIGHBOURS, (REACH * spacing).powi(2), |j, _| {
                sum += if j == i { 0.0 } else { (through[i] - mean) * (through[j] - mean) };
            });
            sum
        })
        .collect::<Vec<f32>>()
        .iter()
        .sum();
    // Half of the surfels were measured: each of them stands for two.
    (1.0 + 2.0 * sum / sampled.len() as f32 / variance).clamp(1.0, 2.0 * NEIGHBOURS as f32)
}
