//! Which part each surface point belongs to: evidence from the other state under every motion, smoothed by belief propagation.

use super::observe::{Cloud, DepthView, Sightings};
use super::propose::components;
use super::register::Searchable;
use crate::neighbours::PointTree;
use artgs_core::Rigid;
use glam::Vec3;
use rayon::prelude::*;

/// Costs of one labelling, each relative to the cost 1 of sitting in empty space.
#[derive(Clone, Copy, Debug)]
pub struct LabelCosts {
    /// A static point that the other state hides.
    pub hidden_static: f32,
    /// A moved point that the other state hides.
    pub hidden_moved: f32,
    /// A surface is there but faces elsewhere or is missing from the points.
    pub mismatch: f32,
    /// A surface is there in quite another colour.
    pub color: f32,
    /// A point without sign of having moved, taken for movable right beside points that have.
    pub idle: f32,
    /// The same far away from all of them.
    pub idle_far: f32,
    /// The same, far away, for a point that the other state does not show at rest: what it hangs together with decides.
    pub idle_unsure: f32,
    /// Two neighbours in different parts.
    pub smooth: f32,
}

impl Default for LabelCosts {
    fn default() -> Self {
        Self {
            hidden_static: 0.3,
            hidden_moved: 0.3,
            mismatch: 0.5,
            color: 0.3,
            idle: 0.01,
            idle_far: 0.3,
            idle_unsure: 0.02,
            smooth: 0.4,
        }
    }
}

/// Cost of every part for every point of a state, `[n * k]`. `to_other[k]` moves part k from this state to the other.
pub fn data_costs(
    own: &Searchable<'_>,
    other: &Searchable<'_>,
    other_views: &[DepthView],
    to_other: &[Rigid],
    tolerance: f32,
    spacing: f32,
    costs: &LabelCosts,
) -> Vec<f32> {
    let parts = to_other.len();
    let poses: Vec<_> = to_other.iter().map(|m| (m.matrix().as_mat3(), m.translation.as_vec3())).collect();
    (0..own.cloud.len())
        .into_par_iter()
        .with_min_len(64)
        .flat_map_iter(|i| {
            let (p, n, c) = (own.cloud.points[i], own.cloud.normals[i], own.cloud.colors[i]);
            let poses = &poses;
            (0..parts).map(move |k| {
                let (r, t) = poses[k];
                let q = r * p + t;
                let seen = Sightings::of(other_views, q, tolerance);
                if seen.through + seen.surface == 0 {
                    return if k == 0 { costs.hidden_static } else { costs.hidden_moved };
                }
                if !seen.is_surface() {
                    let through = seen.through as f32 / (seen.through + seen.surface) as f32;
                    // One stray view is weak evidence.
                    let trust = if seen.through == 1 { 0.6 } else { 1.0 };
                    return trust * (0.5 + 0.5 * through);
                }
                let (j, d2) = other.nearest(q);
                if d2 > (2.0 * spacing).powi(2) {
                    return costs.mismatch;
                }
                let facing = (r * n).dot(other.cloud.normals[j]).max(0.0);
                let off_plane = ((q - other.cloud.points[j]).dot(other.cloud.normals[j]).abs() / spacing).min(1.0);
                let tint = ((c - other.cloud.colors[j]).abs().max_element() / 0.5).min(1.0);
                costs.mismatch * (1.0 - facing).max(0.5 * off_plane * off_plane) + costs.color * tint * tint
            })
        })
        .collect()
}

/// Symmetric nearest-neighbour graph: `(i, j, closeness in (0, 1])` with i < j, sorted.
pub fn neighbour_graph(
    points: &[Vec3],
    normals: &[Vec3],
    colors: &[Vec3],
    k: usize,
    spacing: f32,
) -> Vec<(u32, u32, f32)> {
    let coords: Vec<[f32; 3]> = points.iter().map(|p| p.to_array()).collect();
    let tree = PointTree::new(&coords);
    let mut edges: Vec<(u32, u32, f32)> = (0..points.len())
        .into_par_iter()
        .with_min_len(256)
        .flat_map_iter(|i| {
            let mut near = Vec::with_capacity(k);
            tree.nearest_n(&coords[i], k + 1, |j, d2| {
                let d = d2.sqrt() / spacing;
                if j == i || d > 2.2 {
                    return;
                }
                let bend = 1.0 - normals[i].dot(normals[j]).max(0.0);
                let tint = (colors[i] - colors[j]).abs().max_element();
                let closeness: f32 = (-0.25 * d * d).exp();
                let alike: f32 = (-4.0 * tint).exp();
                let weight = closeness.max(0.05) * (1.0 - 0.6 * bend) * alike.max(0.3);
                near.push((i.min(j) as u32, i.max(j) as u32, weight));
            });
            near
        })
        .collect();
    edges.par_sort_unstable_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
    edges.dedup_by_key(|e| (e.0, e.1));
    edges
}

/// Adds what it costs to take points that show no sign of having moved for movable: little beside the `evidence` of a
/// part (indices of moved points it explains), more with the square of the distance, full at `ranges[k]` scene units.
/// A plane that slides along itself is otherwise as good an explanation of a wall as standing still.
/// `unsure` flags points that the other state does not show at rest.
pub fn add_idle_costs(
    data: &mut [f32],
    cloud: &Cloud,
    evidence: &[Vec<usize>],
    unsure: &[bool],
    ranges: &[f32],
    costs: &LabelCosts,
) {
    let parts = evidence.len() + 1;
    for (k, members) in evidence.iter().enumerate() {
        let points: Vec<[f32; 3]> = members.iter().map(|&i| cloud.points[i].to_array()).collect();
        let tree = PointTree::new(&points);
        let range = ranges[k];
        data.par_chunks_mut(parts).enumerate().with_min_len(512).for_each(|(i, row)| {
            let far = tree.nearest(&cloud.points[i].to_array()).map_or(1.0, |(_, d2)| (d2 / (range * range)).min(1.0));
            if far > 0.0 {
                let (near, away) = if unsure[i] { (0.0, costs.idle_unsure) } else { (costs.idle, costs.idle_far) };
                row[k + 1] += near + (away - near) * far;
            }
        });
    }
}

/// Minimises data cost plus a Potts penalty over the graph by damped min-sum belief propagation.
/// `data` is `[n * parts]`; the result is the part of every point.
pub fn propagate(data: &[f32], parts: usize, edges: &[(u32, u32, f32)], smooth: f32, rounds: usize) -> Vec<u16> {
    let n = data.len() / parts.max(1);
    // Message e goes i -> j, message e + m goes j -> i.
    let m = edges.len();
    let mut incoming: Vec<Vec<u32>> = vec![Vec::new(); n];
    for (e, (i, j, _)) in edges.iter().enumerate() {
        incoming[*j as usize].push(e as u32);
        incoming[*i as usize].push((e + m) as u32);
    }
    let mut messages = vec![0.0f32; 2 * m * parts];
    let mut next = messages.clone();
    let mut belief = data.to_vec();
    for _ in 0..rounds {
        belief.par_chunks_mut(parts).enumerate().with_min_len(512).for_each(|(i, b)| {
            b.copy_from_slice(&data[i * parts..(i + 1) * parts]);
            for &e in &incoming[i] {
                let from = &messages[e as usize * parts..(e as usize + 1) * parts];
                b.iter_mut().zip(from).for_each(|(x, y)| *x += y);
            }
        });
        next.par_chunks_mut(parts).enumerate().with_min_len(512).for_each(|(e, out)| {
            let (edge, back) = if e < m { (edges[e], e + m) } else { (edges[e - m], e - m) };
            let source = if e < m { edge.0 } else { edge.1 } as usize;
            let mut least = f32::INFINITY;
            for k in 0..parts {
                out[k] = belief[source * parts + k] - messages[back * parts + k];
                least = least.min(out[k]);
            }
            let cap = smooth * edge.2;
            for k in 0..parts {
                let fresh = (out[k] - least).min(cap);
                out[k] = 0.5 * (fresh + messages[e * parts + k]);
            }
        });
        std::mem::swap(&mut messages, &mut next);
    }
    (0..n)
        .map(|i| {
            let b = &belief[i * parts..(i + 1) * parts];
            let best = (0..parts).min_by(|&x, &y| b[x].total_cmp(&b[y]));
            best.unwrap_or(0) as u16
        })
        .collect()
}

/// Gives islands of a movable part back to the static one: groups of its points, connected by steps of at most `reach`
/// (scene units), for which the other state speaks no better under the part's motion than at rest.
pub fn drop_islands(labels: &mut [u16], data: &[f32], parts: usize, cloud: &Cloud, reach: f32) {
    for part in 1..parts {
        let members: Vec<usize> = (0..labels.len()).filter(|&i| usize::from(labels[i]) == part).collect();
        for group in components(cloud, &members, reach, 1) {
            let margin = |i: &usize| (data[i * parts] - data[i * parts + part]).clamp(-0.5, 0.5);
            let support: f32 = group.iter().map(margin).sum();
            if support < 2.0 || support < 0.04 * group.len() as f32 {
                group.iter().for_each(|&i| labels[i] = 0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_island_without_support_goes_back_to_the_static_part() {
        let mut cloud = Cloud::default();
        cloud.points.extend((0..60).map(|i| Vec3::new(i as f32 + if i < 30 { 0.0 } else { 50.0 }, 0.0, 0.0)));
        // The first thirty are better explained by moving, the others equally well by both.
        let data: Vec<f32> = (0..60).flat_map(|i| [if i < 30 { 1.0 } else { 0.0 }, 0.0]).collect();
        let mut labels = vec![1; 60];
        drop_islands(&mut labels, &data, 2, &cloud, 1.5);
        assert!(labels[..30].iter().all(|l| *l == 1) && labels[30..].iter().all(|l| *l == 0));
    }

    #[test]
    fn propagation_fills_gaps_and_removes_specks() {
        // A line of 60 points: the left half says 0, the right half 1, a third say nothing, three lie.
        let n = 60;
        let mut data = vec![0.0f32; 2 * n];
        for i in 0..n {
            let label = usize::from(i >= 30);
            data[2 * i + (1 - label)] = if i % 3 == 0 { 0.0 } else { 1.0 };
        }
        for liar in [10, 20, 50] {
            data.swap(2 * liar, 2 * liar + 1);
        }
        let edges: Vec<_> =
            (0..n - 2).flat_map(|i| [(i as u32, i as u32 + 1, 1.0), (i as u32, i as u32 + 2, 1.0)]).collect();
        let labels = propagate(&data, 2, &edges, 0.4, 40);
        let wrong = (0..n).filter(|&i| labels[i] != u16::from(i >= 30)).count();
        assert!(wrong <= 1, "{labels:?}");
    }
}
