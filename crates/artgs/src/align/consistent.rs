//! Depth corrected by what other frames see. Depth sensors have smooth errors of millimetres that differ from frame to
//! frame; the mean of many frames is better than each.

use super::frames::DepthFrame;
use artgs_core::Rigid;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Correction of depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConsistentConfig {
    /// Frames that correct a frame, those that see most of it.
    pub frames: usize,
    /// Largest correction, as a fraction of the depth: a larger difference is another surface.
    pub largest: f64,
    /// Frames that must see a surface to correct it.
    pub least: usize,
}

impl Default for ConsistentConfig {
    fn default() -> Self {
        Self { frames: 24, largest: 0.03, least: 3 }
    }
}

/// Factors of depth for every cell of every frame, near 1. `frames` are those of one state, with refined poses.
pub(crate) fn depth_factors(frames: &[DepthFrame], config: &ConsistentConfig) -> Vec<Vec<f32>> {
    (0..frames.len()).into_par_iter().map(|i| frame_factors(frames, i, config)).collect()
}

fn frame_factors(frames: &[DepthFrame], i: usize, config: &ConsistentConfig) -> Vec<f32> {
    let frame = &frames[i];
    let others = most_overlapping(frames, i, config.frames);
    let relative: Vec<(usize, Rigid)> =
        others.iter().map(|&j| (j, frames[j].camera.world_to_camera * frame.pose())).collect();
    let mut values = Vec::with_capacity(relative.len() + 1);
    let mut factors: Vec<Option<f32>> = (0..frame.points.len())
        .map(|cell| {
            let (p, n) = (frame.points[cell], frame.normals[cell]);
            if n == Vec3::ZERO {
                return None;
            }
            values.clear();
            // Its own depth is one of the votes.
            values.push(0.0);
            for (j, motion) in &relative {
                values.extend(difference(&frames[*j], motion, p.as_dvec3(), n.as_dvec3(), config.largest));
            }
            (values.len() > config.least).then(|| 1.0 + median(&mut values))
        })
        .collect();
    spread(&mut factors, frame.columns());
    factors.into_iter().map(|f| f.unwrap_or(1.0)).collect()
}

/// Relative depth change that brings a point onto the plane that another frame sees there.
fn difference(other: &DepthFrame, motion: &Rigid, p: DVec3, n: DVec3, largest: f64) -> Option<f32> {
    let q = motion.apply(p);
    let cell = other.cell_of(q)?;
    let (there, normal) = (other.points[cell].as_dvec3(), other.normals[cell].as_dvec3());
    if normal == DVec3::ZERO || motion.turn(n).dot(normal) < 0.8 {
        return None;
    }
    // The ray through `p`, in the frame of the other camera.
    let ray = motion.turn(p);
    let slope = normal.dot(ray);
    let change = normal.dot(there - q) / slope;
    (slope.abs() > 0.2 * ray.length() && change.abs() < largest).then_some(change as f32)
}

/// Frames that see most points of frame `i`, itself left out.
pub(super) fn most_overlapping(frames: &[DepthFrame], i: usize, count: usize) -> Vec<usize> {
    const STRIDE: usize = 5;
    let frame = &frames[i];
    let seen = |j: usize| {
        let motion = frames[j].camera.world_to_camera * frame.pose();
        let visible = |s: &&u32| {
            let q = motion.apply(frame.points[**s as usize].as_dvec3());
            let depth = frames[j].cell_of(q).map_or(0.0, |c| f64::from(frames[j].points[c].z));
            depth > 0.0 && (depth - q.z).abs() < 0.05 * depth
        };
        frame.samples.iter().step_by(STRIDE).filter(visible).count()
    };
    let mut order: Vec<(usize, usize)> = (0..frames.len()).filter(|&j| j != i).map(|j| (seen(j), j)).collect();
    order.sort_by_key(|o| (std::cmp::Reverse(o.0), o.1));
    order.into_iter().take(count).filter(|o| o.0 > 0).map(|o| o.1).collect()
}

fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Carries factors to neighbouring cells without one, such as those along edges, where normals are unknown.
fn spread(factors: &mut [Option<f32>], columns: usize) {
    /// Cells that normals are unknown within, along an edge, and one more.
    const ROUNDS: usize = 3;
    for _ in 0..ROUNDS {
        let before = factors.to_vec();
        for i in (0..before.len()).filter(|&i| before[i].is_none()) {
            let x = i % columns;
            let around = [
                (x > 0).then(|| before[i - 1]).flatten(),
                (x + 1 < columns).then(|| before.get(i + 1).copied().flatten()).flatten(),
                i.checked_sub(columns).and_then(|j| before[j]),
                before.get(i + columns).copied().flatten(),
            ];
            let (sum, count) = around.iter().flatten().fold((0.0, 0), |(s, c), f| (s + f, c + 1));
            factors[i] = (count > 0).then(|| sum / count as f32);
        }
    }
}

/// Factor at image coordinates `u`, `v` in cells, interpolated between cell centres.
pub(crate) fn factor_at(factors: &[f32], columns: usize, u: f64, v: f64) -> f32 {
    let rows = factors.len() / columns.max(1);
    if columns == 0 || rows == 0 {
        return 1.0;
    }
    let (u, v) = ((u - 0.5).clamp(0.0, (columns - 1) as f64), (v - 0.5).clamp(0.0, (rows - 1) as f64));
    let (x, y) = (u as usize, v as usize);
    let (fx, fy) = ((u - x as f64) as f32, (v - y as f64) as f32);
    let at = |x: usize, y: usize| factors[y.min(rows - 1) * columns + x.min(columns - 1)];
    let (top, bottom) = (at(x, y) * (1.0 - fx) + at(x + 1, y) * fx, at(x, y + 1) * (1.0 - fx) + at(x + 1, y + 1) * fx);
    top * (1.0 - fy) + bottom * fy
}
