//! Spectral clustering of points, and connected components.

use super::CanonicalError;
use super::fps::farthest_points;
use super::spectral::{Rows, dense_embedding, graph_embedding, neighbours};
use super::tree::Tree;
use crate::connected::connected_components;
use nalgebra::DMatrix;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Which points belong together, and how much.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Affinity {
    /// Symmetric graph of nearest neighbours with locally scaled weights; independent of the unit.
    Neighbours(usize),
    /// Dense `exp(-gamma d^2)`, as published with gamma 1; depends on the unit.
    Rbf(f64),
}

/// How the spectral embedding becomes labels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LabelRule {
    /// k-means++ and Lloyd's iterations on unit rows, best of several starts.
    KMeans,
    /// Nearest partition matrix up to rotation (Yu and Shi 2003), as published.
    Discretize,
}

/// Settings of spectral clustering.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClusterConfig {
    /// Affinity of points.
    pub affinity: Affinity,
    /// Labels from the embedding.
    pub labels: LabelRule,
    /// More points than this are thinned by farthest point sampling; the others get the label of their nearest sample.
    /// The dense affinity takes `8 max_points^2` bytes.
    pub max_points: usize,
    /// With `Affinity::Neighbours`: components of the graph with a smaller share of the points than this are left out
    /// and labelled by their nearest neighbour.
    pub min_component: f64,
}

impl Default for ClusterConfig {
    fn default() -> Self {
        let affinity = Affinity::Neighbours(7);
        Self { affinity, labels: LabelRule::KMeans, max_points: 5000, min_component: 0.01 }
    }
}

impl ClusterConfig {
    /// As published, but thinned to 2500 points.
    pub fn paper() -> Self {
        Self { affinity: Affinity::Rbf(1.0), labels: LabelRule::Discretize, max_points: 2500, min_component: 0.0 }
    }
}

/// A label in `0..clusters` for every point; their order has no meaning.
pub fn spectral_clusters(
    points: &[[f32; 3]],
    clusters: usize,
    config: &ClusterConfig,
    rng: &mut Pcg64Mcg,
) -> Result<Vec<u16>, CanonicalError> {
    let too_few = |points: usize| CanonicalError::TooFewPoints { points, clusters };
    if points.len() < clusters.max(1) {
        return Err(too_few(points.len()));
    }
    if clusters <= 1 {
        return Ok(vec![0; points.len()]);
    }
    let samples: Vec<[f32; 3]> = if points.len() > config.max_points {
        farthest_points(points, config.max_points.max(clusters)).into_iter().map(|i| points[i]).collect()
    } else {
        points.to_vec()
    };
    let (samples, mut embedding) = match config.affinity {
        Affinity::Rbf(gamma) => {
            let embedding = dense_embedding(&samples, gamma, clusters, rng);
            (samples, embedding)
        }
        Affinity::Neighbours(count) => {
            let samples = large_components(samples, count, clusters, config.min_component)?;
            let near = neighbours(&samples, count)?;
            let component = graph_components(&near);
            let mut embedding = graph_embedding(&samples, &near, &component, clusters, rng)?;
            embedding.normalise();
            (samples, embedding)
        }
    };
    let labels = match config.labels {
        LabelRule::KMeans => kmeans(&embedding, clusters, rng),
        LabelRule::Discretize => discretize(&mut embedding, rng),
    };
    if samples.len() == points.len() {
        return Ok(labels);
    }
    Ok(Tree::new(&samples)?.nearest_all(points).into_iter().map(|hit| labels[hit.0]).collect())
}

/// Drops the points of small components, unless too few would be left.
fn large_components(
    points: Vec<[f32; 3]>,
    count: usize,
    clusters: usize,
    share: f64,
) -> Result<Vec<[f32; 3]>, CanonicalError> {
    let component = graph_components(&neighbours(&points, count)?);
    let mut size = vec![0usize; points.len()];
    component.iter().for_each(|&c| size[c as usize] += 1);
    let least = share * points.len() as f64;
    let kept: Vec<_> =
        points.iter().zip(&component).filter(|(_, c)| size[**c as usize] as f64 >= least).map(|(p, _)| *p).collect();
    Ok(if kept.len() < clusters.max(points.len() / 2) { points } else { kept })
}

fn graph_components(near: &[Vec<(usize, f32)>]) -> Vec<u32> {
    connected_components(near.len(), near.iter().enumerate().flat_map(|(i, hits)| hits.iter().map(move |h| (i, h.0))))
}

/// Component of each point when points within `radius` of one another are connected.
pub fn radius_components(points: &[[f32; 3]], radius: f32) -> Result<Vec<u32>, CanonicalError> {
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let tree = Tree::new(points)?;
    let edges = points.iter().enumerate().flat_map(|(i, p)| tree.within(p, radius).into_iter().map(move |j| (i, j)));
    Ok(connected_components(points.len(), edges))
}

const STARTS: usize = 10;
const LLOYD: usize = 100;

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum()
}

/// Index of the nearest centre, the first of equals, and the squared distance.
fn nearest_centre(row: &[f64], centres: &[Vec<f64>]) -> (usize, f64) {
    centres
        .iter()
        .enumerate()
        .map(|(c, centre)| (c, squared_distance(row, centre)))
        .fold((0, f64::INFINITY), |a, b| if b.1 < a.1 { b } else { a })
}

/// k-means++ starts (Arthur and Vassilvitskii 2007), Lloyd's iterations, the labels of least inertia.
fn kmeans(rows: &Rows, clusters: usize, rng: &mut Pcg64Mcg) -> Vec<u16> {
    let n = rows.len();
    let mut best = (f64::INFINITY, vec![0; n]);
    for _ in 0..STARTS {
        let mut centres = vec![rows.row(rng.random_range(0..n)).to_vec()];
        let mut nearest = vec![f64::INFINITY; n];
        while centres.len() < clusters {
            let newest = &centres[centres.len() - 1];
            nearest.iter_mut().enumerate().for_each(|(i, d)| *d = d.min(squared_distance(rows.row(i), newest)));
            let mut left = rng.random::<f64>() * nearest.iter().sum::<f64>();
            let drawn = nearest.iter().position(|d| {
                left -= d;
                left < 0.0
            });
            centres.push(rows.row(drawn.unwrap_or(n - 1)).to_vec());
        }
        let mut labels = vec![u16::MAX; n];
        let mut inertia = 0.0;
        for _ in 0..LLOYD {
            let mut changed = false;
            inertia = 0.0;
            let mut sums = vec![(vec![0.0; rows.columns], 0.0); clusters];
            for (i, label) in labels.iter_mut().enumerate() {
                let (c, d) = nearest_centre(rows.row(i), &centres);
                changed |= *label != c as u16;
                *label = c as u16;
                inertia += d;
                sums[c].0.iter_mut().zip(rows.row(i)).for_each(|(s, v)| *s += v);
                sums[c].1 += 1.0;
            }
            if !changed {
                break;
            }
            for (centre, (sum, count)) in centres.iter_mut().zip(sums) {
                if count > 0.0 {
                    *centre = sum.into_iter().map(|s| s / count).collect();
                }
            }
        }
        if inertia < best.0 {
            best = (inertia, labels);
        }
    }
    best.1
}

/// Alternates between the best partition for a rotation of the embedding and the best rotation for a partition.
fn discretize(rows: &mut Rows, rng: &mut Pcg64Mcg) -> Vec<u16> {
    let (n, k) = (rows.len(), rows.columns);
    for c in 0..k {
        let column = || (0..n).map(|i| rows.row(i)[c]);
        let scale = (n as f64).sqrt() / column().map(|v| v * v).sum::<f64>().sqrt().max(1e-300);
        let sign = if rows.row(0)[c] > 0.0 { -scale } else { scale };
        (0..n).for_each(|i| rows.values[i * k + c] *= sign);
    }
    rows.normalise();
    let mut rotation = DMatrix::zeros(k, k);
    let mut overlap = vec![0.0; n];
    let mut pick = rng.random_range(0..n);
    for c in 0..k {
        (0..k).for_each(|r| rotation[(r, c)] = rows.row(pick)[r]);
        let picked = rows.row(pick).to_vec();
        for (i, o) in overlap.iter_mut().enumerate() {
            *o += rows.row(i).iter().zip(&picked).map(|(a, b)| a * b).sum::<f64>().abs();
        }
        pick = (1..n).fold(0, |a, b| if overlap[b] < overlap[a] { b } else { a });
    }
    let mut labels = vec![0u16; n];
    let mut objective = 0.0f64;
    for _ in 0..30 {
        let mut matched = DMatrix::<f64>::zeros(k, k);
        for (i, label) in labels.iter_mut().enumerate() {
            let row = rows.row(i);
            let score = |c: usize| (0..k).map(|r| row[r] * rotation[(r, c)]).sum::<f64>();
            let scores: Vec<f64> = (0..k).map(score).collect();
            let best = (1..k).fold(0, |a, b| if scores[b] > scores[a] { b } else { a });
            *label = best as u16;
            (0..k).for_each(|r| matched[(best, r)] += row[r]);
        }
        let svd = matched.svd(true, true);
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else { break };
        let now: f64 = 2.0 * (n as f64 - svd.singular_values.sum());
        if (now - objective).abs() < f64::EPSILON * n as f64 {
            break;
        }
        objective = now;
        rotation = v_t.transpose() * u.transpose();
    }
    labels
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_pcg::Pcg64Mcg;

    /// Surface of a box.
    fn shell(low: [f32; 3], size: [f32; 3], n: usize, rng: &mut Pcg64Mcg) -> Vec<[f32; 3]> {
        (0..n)
            .map(|_| {
                let face = rng.random_range(0..6usize);
                let mut u: [f32; 3] = std::array::from_fn(|_| rng.random());
                u[face / 2] = (face % 2) as f32;
                std::array::from_fn(|a| low[a] + size[a] * u[a])
            })
            .collect()
    }

    /// Stacked drawers and the drawer of each point.
    fn drawers(n: usize, gap: f32, rng: &mut Pcg64Mcg) -> (Vec<[f32; 3]>, Vec<usize>) {
        let mut all: Vec<([f32; 3], usize)> = Vec::new();
        for d in 0..3 {
            let low = [-0.4, -0.3, d as f32 * (0.2 + gap) - 0.4];
            all.extend(shell(low, [0.8, 0.6, 0.2], n / 3, rng).into_iter().map(|p| (p, d)));
        }
        all.into_iter().unzip()
    }

    fn purity(labels: &[u16], truth: &[usize], clusters: usize) -> f64 {
        let mut table = vec![vec![0; 16]; clusters];
        labels.iter().zip(truth).for_each(|(&l, &t)| table[l as usize][t] += 1);
        table.iter().map(|row| row.iter().max().copied().unwrap_or(0)).sum::<usize>() as f64 / labels.len() as f64
    }

    #[test]
    fn stacked_drawers_come_apart_in_any_unit() {
        for (n, scale, gap) in [(3000, 1.0, 0.1), (3000, 1000.0, 0.1), (3000, 0.01, 0.1), (15_000, 1.0, 0.06)] {
            let mut rng = Pcg64Mcg::new(6);
            let (points, truth) = drawers(n, gap, &mut rng);
            let points: Vec<_> = points.into_iter().map(|p| p.map(|c| c * scale)).collect();
            let labels = spectral_clusters(&points, 3, &ClusterConfig::default(), &mut rng).unwrap();
            assert!(purity(&labels, &truth, 3) > 0.999, "{scale} {gap} {}", purity(&labels, &truth, 3));
        }
    }

    #[test]
    fn touching_boxes_are_cut_at_the_neck_and_speckles_follow_their_neighbours() {
        let mut rng = Pcg64Mcg::new(8);
        let mut points = shell([0.0; 3], [1.0, 1.0, 1.0], 1500, &mut rng);
        points.extend(shell([1.0, 0.4, 0.4], [0.3, 0.1, 0.1], 60, &mut rng));
        points.extend(shell([1.3, 0.0, 0.0], [1.0, 1.0, 1.0], 1500, &mut rng));
        let truth: Vec<usize> = points.iter().map(|p| usize::from(p[0] > 1.15)).collect();
        points.extend(vec![[3.5, 0.5, 0.5]; 12]);
        let labels = spectral_clusters(&points, 2, &ClusterConfig::default(), &mut rng).unwrap();
        assert!(purity(&labels[..truth.len()], &truth, 2) > 0.98);
        let far = points.iter().position(|p| p[0] > 2.25).unwrap();
        assert!(labels[truth.len()..].iter().all(|&l| l == labels[far]));
    }

    #[test]
    fn published_affinity_separates_what_its_unit_allows() {
        for rule in [LabelRule::Discretize, LabelRule::KMeans] {
            let mut rng = Pcg64Mcg::new(7);
            let mut points = Vec::new();
            let mut truth = Vec::new();
            for c in 0..3 {
                points.extend(shell([4.0 * c as f32, 0.0, 0.0], [1.0; 3], 300, &mut rng));
                truth.extend([c; 300]);
            }
            let config = ClusterConfig { labels: rule, max_points: 500, ..ClusterConfig::paper() };
            let labels = spectral_clusters(&points, 3, &config, &mut rng).unwrap();
            assert_eq!(purity(&labels, &truth, 3), 1.0, "{rule:?}");
        }
    }

    #[test]
    fn degenerate_requests_do_not_panic() {
        let mut rng = Pcg64Mcg::new(1);
        let config = ClusterConfig::default();
        let few = [[0.0; 3], [1.0; 3]];
        assert!(matches!(
            spectral_clusters(&few, 3, &config, &mut rng),
            Err(CanonicalError::TooFewPoints { points: 2, clusters: 3 })
        ));
        assert_eq!(spectral_clusters(&few, 1, &config, &mut rng), Ok(vec![0, 0]));
        for points in [vec![[0.5; 3]; 50], vec![[0.0; 3], [1.0; 3], [2.0; 3]]] {
            for config in [ClusterConfig::default(), ClusterConfig::paper()] {
                let labels = spectral_clusters(&points, 2, &config, &mut rng).unwrap();
                assert!(labels.len() == points.len() && labels.iter().all(|&l| l < 2));
            }
        }
    }

    #[test]
    fn components_are_named_by_first_member() {
        let points = [[0.0; 3], [5.0; 3], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]];
        assert_eq!(radius_components(&points, 0.6), Ok(vec![0, 1, 0, 0]));
        assert_eq!(radius_components(&[], 1.0), Ok(vec![]));
    }
}
