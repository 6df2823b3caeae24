//! Local shape descriptors: fast point feature histograms (Rusu, Blodow and Beetz, 2009) with mean colour.

use super::cloud::FusedCloud;
use crate::neighbours::PointTree;
use glam::Vec3;
use rayon::prelude::*;

/// Bins of each of the three angles.
const BINS: usize = 11;
/// Length of a descriptor: three histograms and a mean chroma of two values.
const LENGTH: usize = 3 * BINS + 2;
/// Largest number of neighbours of a point.
const NEIGHBOURS: usize = 80;
/// Weight of chroma, 0 to 1, against histograms that sum to 1 each.
const CHROMA: f32 = 1.0;

/// Descriptor of a point.
pub(crate) type Descriptor = [f32; LENGTH];

/// Descriptors of the points with the most curved surroundings.
pub(crate) struct Features {
    /// Indices of the points in their cloud.
    pub(crate) points: Vec<usize>,
    descriptors: Vec<Descriptor>,
}

impl Features {
    /// Describes up to `count` points of a cloud by neighbours within `radius`. Points on flat surroundings look alike
    /// and are left out.
    pub(crate) fn new(cloud: &FusedCloud, radius: f32, count: usize) -> Self {
        let coordinates: Vec<[f32; 3]> = cloud.points.iter().map(Vec3::to_array).collect();
        let tree = PointTree::new(&coordinates);
        let neighbours: Vec<Vec<(usize, f32)>> = coordinates
            .par_iter()
            .map(|p| {
                let mut found = Vec::new();
                tree.nearest_n(p, NEIGHBOURS, radius * radius, |i, d| found.push((i, d)));
                found
            })
            .collect();
        let simple: Vec<Descriptor> =
            (0..cloud.len()).into_par_iter().map(|i| simple_histogram(cloud, i, &neighbours[i])).collect();
        let curvature = |i: usize| -> f32 {
            let others = &neighbours[i];
            let bent = |&(j, _): &(usize, f32)| 1.0 - cloud.normals[i].dot(cloud.normals[j]).abs();
            others.iter().map(bent).sum::<f32>() / others.len().max(1) as f32
        };
        let mut order: Vec<(f32, usize)> =
            (0..cloud.len()).into_par_iter().map(|i| (curvature(i), i)).filter(|c| c.0 > 0.02).collect();
        order.par_sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        // Spread over the more curved part of the cloud instead of the sharpest corner only.
        let usable = order.len().min(4 * count);
        let stride = usable.div_ceil(count.max(1)).max(1);
        let points: Vec<usize> = order[..usable].iter().step_by(stride).map(|c| c.1).collect();
        let descriptors = points.par_iter().map(|&i| weighted(&simple, &neighbours[i], i)).collect();
        Self { points, descriptors }
    }

    /// Points of `self` and `other` that are each other's nearest, or one of the `ranks` nearest, in descriptor space.
    pub(crate) fn matches(&self, other: &Self, ranks: usize) -> Vec<(usize, usize)> {
        let nearest: Vec<Vec<usize>> =
            self.descriptors.par_iter().map(|d| nearest(d, &other.descriptors, ranks)).collect();
        let back: Vec<Vec<usize>> =
            other.descriptors.par_iter().map(|d| self::nearest(d, &self.descriptors, ranks)).collect();
        let pairs = nearest.iter().enumerate().flat_map(|(i, found)| found.iter().map(move |&j| (i, j)));
        pairs.filter(|&(i, j)| back[j].contains(&i)).map(|(i, j)| (self.points[i], other.points[j])).collect()
    }
}

fn nearest(query: &Descriptor, all: &[Descriptor], ranks: usize) -> Vec<usize> {
    let distance = |d: &Descriptor| d.iter().zip(query).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
    let mut order: Vec<(f32, usize)> = all.iter().enumerate().map(|(i, d)| (distance(d), i)).collect();
    let ranks = ranks.min(order.len());
    if ranks == 0 {
        return Vec::new();
    }
    order.select_nth_unstable_by(ranks - 1, |a, b| a.0.total_cmp(&b.0));
    order[..ranks].iter().map(|o| o.1).collect()
}

/// Histograms of the three Darboux angles between a point and its neighbours, and its chroma.
fn simple_histogram(cloud: &FusedCloud, i: usize, neighbours: &[(usize, f32)]) -> Descriptor {
    let mut out = [0.0; LENGTH];
    let (p, n) = (cloud.points[i], cloud.normals[i]);
    let share = 1.0 / (neighbours.len().max(2) - 1) as f32;
    for &(j, _) in neighbours.iter().filter(|&&(j, _)| j != i) {
        let direction = (cloud.points[j] - p).normalize_or_zero();
        let v = n.cross(direction).normalize_or_zero();
        let w = n.cross(v);
        let m = cloud.normals[j];
        let angles = [
            0.5 + 0.5 * v.dot(m),
            0.5 + 0.5 * n.dot(direction),
            0.5 + w.dot(m).atan2(n.dot(m)) / std::f32::consts::TAU,
        ];
        for (k, a) in angles.into_iter().enumerate() {
            out[k * BINS + ((a * BINS as f32) as usize).min(BINS - 1)] += share;
        }
    }
    let color = cloud.colors[i];
    let sum = (color.x + color.y + color.z).max(0.1);
    (out[3 * BINS], out[3 * BINS + 1]) = (CHROMA * color.x / sum, CHROMA * color.z / sum);
    out
}

/// The descriptor: half the simple histogram of the point, half the mean of its neighbours'.
fn weighted(simple: &[Descriptor], neighbours: &[(usize, f32)], i: usize) -> Descriptor {
    let mut out = simple[i];
    let mut total = 0.0;
    let mut mean = [0.0; LENGTH];
    for &(j, d) in neighbours.iter().filter(|n| n.0 != i) {
        let weight = 1.0 / d.sqrt().max(1e-6);
        total += weight;
        mean.iter_mut().zip(&simple[j]).for_each(|(m, s)| *m += weight * s);
    }
    if total > 0.0 {
        out.iter_mut().zip(mean).for_each(|(o, m)| *o = 0.5 * (*o + m / total));
    }
    out
}
