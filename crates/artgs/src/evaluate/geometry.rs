//! Distances between surfaces, measured on area-weighted random samples.

use artgs_core::Mesh;
use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Chamfer distance of a mesh that is missing or empty.
pub const MISSING: f64 = 1000.0;

/// How surfaces are compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GeometryConfig {
    /// Samples per mesh of the Chamfer distance as published.
    pub samples: usize,
    /// Samples per mesh of the Chamfer distance and F-score whose floor is ten times lower; 0 leaves them out.
    pub dense_samples: usize,
    /// Seeds of the samples; the distances are averaged over them, the dense ones use the first.
    pub seeds: Vec<u64>,
    /// Distance that counts as a hit for the F-score, as a fraction of the true object's diagonal.
    pub f_score_tolerance: f64,
}

impl Default for GeometryConfig {
    fn default() -> Self {
        Self { samples: 10_000, dense_samples: 100_000, seeds: vec![0, 1, 2], f_score_tolerance: 0.01 }
    }
}

/// A mesh against the true one in one state. Chamfer distances are squared scene units x 1000; floors are those of two
/// independent samples of the truth, about `2000 area / (pi n)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GeometryScore {
    /// Chamfer distance; [`MISSING`] if there is no mesh.
    pub chamfer: f64,
    /// Floor of `chamfer`.
    pub floor: f64,
    /// Chamfer distance of the dense samples; 0 if left out.
    pub dense_chamfer: f64,
    /// Floor of `dense_chamfer`.
    pub dense_floor: f64,
    /// Harmonic mean of precision and recall of the dense samples, [0, 1].
    pub f_score: f64,
}

/// A mesh against the true one in both states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeshScore {
    /// At the start state.
    pub start: GeometryScore,
    /// At the end state.
    pub end: GeometryScore,
    /// Mean of both.
    pub mean: GeometryScore,
}

impl GeometryScore {
    /// Mean of every number; zeros without scores.
    pub fn mean_of(scores: &[Self]) -> Self {
        let mean = |f: fn(&Self) -> f64| scores.iter().map(f).sum::<f64>() / scores.len().max(1) as f64;
        Self {
            chamfer: mean(|s| s.chamfer),
            floor: mean(|s| s.floor),
            dense_chamfer: mean(|s| s.dense_chamfer),
            dense_floor: mean(|s| s.dense_floor),
            f_score: mean(|s| s.f_score),
        }
    }
}

impl MeshScore {
    /// From the scores of both states.
    pub fn new([start, end]: [GeometryScore; 2]) -> Self {
        Self { start, end, mean: GeometryScore::mean_of(&[start, end]) }
    }

    /// Mean over meshes, state by state.
    pub fn mean_of(scores: &[Self]) -> Self {
        let state = |f: fn(&Self) -> GeometryScore| GeometryScore::mean_of(&scores.iter().map(f).collect::<Vec<_>>());
        Self { start: state(|s| s.start), end: state(|s| s.end), mean: state(|s| s.mean) }
    }
}

/// `count` points uniform over the area of a mesh; none if it has no area. Triangles with indices or coordinates that
/// are not usable have no area.
pub fn sample_surface(mesh: &Mesh, count: usize, rng: &mut Pcg64Mcg) -> Vec<[f64; 3]> {
    let corner = |i: &u32| mesh.vertices.get(*i as usize).map(|v| DVec3::from_array(v.map(f64::from)));
    let corners = |t: &[u32; 3]| Some([corner(&t[0])?, corner(&t[1])?, corner(&t[2])?]);
    let area = |t: &[u32; 3]| corners(t).map_or(0.0, |[a, b, c]| 0.5 * (b - a).cross(c - a).length());
    let mut total = 0.0;
    let mut cumulative = Vec::with_capacity(mesh.triangles.len());
    for t in &mesh.triangles {
        let a = area(t);
        total += if a.is_finite() { a } else { 0.0 };
        cumulative.push(total);
    }
    if total <= 0.0 {
        return Vec::new();
    }
    (0..count)
        .filter_map(|_| {
            let (pick, u, v): (f64, f64, f64) = (rng.random(), rng.random(), rng.random());
            let t = cumulative.partition_point(|c| *c <= pick * total).min(mesh.triangles.len() - 1);
            let [a, b, c] = corners(&mesh.triangles[t])?;
            // The square root spreads the samples evenly.
            let s = u.sqrt();
            Some((a * (1.0 - s) + b * (s * (1.0 - v)) + c * (s * v)).to_array())
        })
        .collect()
}

/// Points with a tree to find the nearest of them.
struct Cloud {
    points: Vec<[f64; 3]>,
    tree: ImmutableKdTree<f64, 3>,
}

impl Cloud {
    fn new(points: Vec<[f64; 3]>) -> Option<Self> {
        let tree = ImmutableKdTree::new_from_slice(&points).ok()?;
        (!points.is_empty()).then_some(Self { points, tree })
    }

    /// Squared distances of these points to the nearest of the other cloud's.
    fn squared_distances(&self, other: &Self) -> Vec<f64> {
        let nearest = |p: &[f64; 3]| other.tree.query(p).nearest_one::<SquaredEuclidean<f64>>().execute().distance;
        self.points.par_iter().map(nearest).collect()
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Sum of the two directional means of squared distances, squared scene units (not scaled); none if either is empty.
pub fn chamfer(a: &[[f64; 3]], b: &[[f64; 3]]) -> Option<f64> {
    let (a, b) = (Cloud::new(a.to_vec())?, Cloud::new(b.to_vec())?);
    Some(cloud_chamfer(&a, &b).0)
}

/// Chamfer distance and the squared distances from each side.
fn cloud_chamfer(a: &Cloud, b: &Cloud) -> (f64, Vec<f64>, Vec<f64>) {
    let (ab, ba) = (a.squared_distances(b), b.squared_distances(a));
    (mean(&ab) + mean(&ba), ab, ba)
}

/// Generator of one of the independent samples of a seed.
fn generator(seed: u64, stream: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed.wrapping_mul(4).wrapping_add(stream))
}

/// Scores a mesh against the true one; `diagonal` is the true object's. A missing mesh scores [`MISSING`] and an
/// F-score of 0; a true mesh without area scores 0 and an F-score of 1 if the prediction has none either.
pub fn score_mesh(predicted: Option<&Mesh>, truth: &Mesh, diagonal: f64, config: &GeometryConfig) -> GeometryScore {
    let tolerance = config.f_score_tolerance * diagonal;
    let runs: Vec<GeometryScore> = config
        .seeds
        .iter()
        .map(|seed| {
            let run = compare(predicted, truth, config.samples, *seed, tolerance);
            GeometryScore { chamfer: run.0, floor: run.1, ..GeometryScore::default() }
        })
        .collect();
    let score = GeometryScore::mean_of(&runs);
    match config.seeds.first() {
        Some(seed) if config.dense_samples > 0 => {
            let (dense_chamfer, dense_floor, f_score) =
                compare(predicted, truth, config.dense_samples, *seed, tolerance);
            GeometryScore { dense_chamfer, dense_floor, f_score, ..score }
        }
        _ => score,
    }
}

/// Chamfer distance x 1000, its floor and the F-score, of `count` samples.
fn compare(predicted: Option<&Mesh>, truth: &Mesh, count: usize, seed: u64, tolerance: f64) -> (f64, f64, f64) {
    let cloud = |mesh: &Mesh, stream: u64| Cloud::new(sample_surface(mesh, count, &mut generator(seed, stream)));
    let guess = predicted.and_then(|m| cloud(m, 0));
    let (Some(a), Some(b)) = (cloud(truth, 1), cloud(truth, 2)) else {
        return if guess.is_none() { (0.0, 0.0, 1.0) } else { (MISSING, 0.0, 0.0) };
    };
    let floor = 1000.0 * cloud_chamfer(&a, &b).0;
    let Some(guess) = guess else { return (MISSING, floor, 0.0) };
    let (distance, precision, recall) = cloud_chamfer(&guess, &a);
    let hits = |d: &[f64]| d.iter().filter(|d| d.sqrt() <= tolerance).count() as f64 / d.len() as f64;
    let (p, r) = (hits(&precision), hits(&recall));
    let f_score = if p + r > 0.0 { 2.0 * p * r / (p + r) } else { 0.0 };
    (1000.0 * distance, floor, f_score)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Axis-parallel rectangle at height `z`.
    pub(crate) fn plate(corner: [f32; 2], size: [f32; 2], z: f32) -> Mesh {
        let ([x, y], [w, h]) = (corner, size);
        let vertices = vec![[x, y, z], [x + w, y, z], [x + w, y + h, z], [x, y + h, z]];
        Mesh { vertices, colors: vec![], triangles: vec![[0, 1, 2], [0, 2, 3]] }
    }

    fn plain() -> GeometryConfig {
        GeometryConfig { dense_samples: 20_000, seeds: vec![0], ..GeometryConfig::default() }
    }

    #[test]
    fn identical_meshes_score_the_sampling_floor() {
        let truth = plate([0.0, 0.0], [2.0, 2.0], 0.0);
        let s = score_mesh(Some(&truth), &truth, 2.0, &plain());
        let expected = 2000.0 * 4.0 / (std::f64::consts::PI * 1e4);
        assert!((s.chamfer / expected - 1.0).abs() < 0.03, "{} against {expected}", s.chamfer);
        assert!((s.floor / expected - 1.0).abs() < 0.03 && s.f_score > 0.99);
        assert!((s.dense_chamfer / (0.5 * expected) - 1.0).abs() < 0.03, "{}", s.dense_chamfer);
        assert_eq!(s, score_mesh(Some(&truth), &truth, 2.0, &plain()), "seeded");
    }

    #[test]
    fn shifted_planes_score_twice_the_squared_shift_above_the_floor() {
        let (truth, moved) = (plate([0.0, 0.0], [1.0, 1.0], 0.0), plate([0.0, 0.0], [1.0, 1.0], 0.1));
        let s = score_mesh(Some(&moved), &truth, 1.0, &plain());
        assert!((s.chamfer - s.floor - 20.0).abs() < 0.02, "{} {}", s.chamfer, s.floor);
        assert_eq!(s.f_score, 0.0);
        let near = score_mesh(Some(&moved), &truth, 12.0, &plain());
        assert!(near.f_score > 0.999, "0.1 is within a hundredth of 12");
    }

    #[test]
    fn half_a_plate_has_full_precision_and_half_the_recall() {
        let (truth, half) = (plate([0.0, 0.0], [2.0, 1.0], 0.0), plate([0.0, 0.0], [1.0, 1.0], 0.0));
        let s = score_mesh(Some(&half), &truth, 3.0, &plain());
        // Half the truth is at a distance uniform in [0, 1]: 1/2 * 1/3.
        assert!((s.chamfer - 1000.0 / 6.0).abs() < 3.0, "{}", s.chamfer);
        let (p, r) = (1.0, 0.515);
        assert!((s.f_score - 2.0 * p * r / (p + r)).abs() < 0.005, "{}", s.f_score);
    }

    #[test]
    fn samples_follow_the_area() {
        let mut mesh = plate([0.0, 0.0], [1.0, 1.0], 0.0);
        mesh.append(&plate([5.0, 0.0], [3.0, 1.0], 0.0));
        let points = sample_surface(&mesh, 40_000, &mut generator(5, 0));
        let far = points.iter().filter(|p| p[0] > 4.0).count() as f64 / 40_000.0;
        let middle = points.iter().filter(|p| p[0] > 6.5).count() as f64 / 40_000.0;
        assert!((far - 0.75).abs() < 0.01 && (middle - 0.375).abs() < 0.01, "{far} {middle}");
    }

    #[test]
    fn a_missing_or_broken_mesh_scores_a_thousand() {
        let truth = plate([0.0, 0.0], [1.0, 1.0], 0.0);
        let broken = Mesh { vertices: vec![[f32::NAN; 3]; 3], colors: vec![], triangles: vec![[0, 1, 2], [0, 1, 9]] };
        for mesh in [None, Some(&Mesh::default()), Some(&broken)] {
            let s = score_mesh(mesh, &truth, 1.0, &plain());
            assert!(s.chamfer == MISSING && s.dense_chamfer == MISSING && s.f_score == 0.0 && s.floor > 0.0);
        }
        assert_eq!(chamfer(&[], &[[0.0; 3]]), None);
    }
}
