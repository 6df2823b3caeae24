//! Which part each surface point belongs to: what the other state says under every motion, and where that leaves several
//! answers, what the point hangs together with.

use super::observe::{Cloud, DepthView, Sightings};
use super::propose::components;
use super::register::Searchable;
use crate::neighbours::PointTree;
use artgs_core::Rigid;
use glam::{Mat3, Vec3};
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
    /// A point that does not speak for a movable part, taken for it all the same.
    pub idle: f32,
    /// Two close, coplanar, like-coloured neighbours in different parts.
    pub smooth: f32,
}

impl Default for LabelCosts {
    fn default() -> Self {
        Self { hidden_static: 0.1, hidden_moved: 0.1, mismatch: 0.2, color: 0.3, idle: 0.01, smooth: 0.4 }
    }
}

/// What the other state says about a point at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AtRest {
    /// It looks through the point: the point has moved.
    Gone,
    /// It does not show the place.
    Unseen,
    /// It shows a surface there.
    Seen,
}

/// Both clouds and what is needed to look from one state into the other.
pub struct Pair<'a> {
    /// Points of the state that is labelled.
    pub own: &'a Searchable<'a>,
    /// Points of the other state.
    pub other: &'a Searchable<'a>,
    /// Depth maps of the other state.
    pub other_views: &'a [DepthView],
    /// Depth tolerance, scene units.
    pub tolerance: f32,
    /// Distance between neighbouring points, scene units.
    pub spacing: f32,
}

/// Where a point of one state ends up in the other.
enum Landing {
    /// Where nothing can be, at this cost.
    Empty(f32),
    /// Out of sight.
    Hidden,
    /// On a surface; the nearest point of it, if one is near, and the cost of looking different.
    Surface(Option<usize>, f32),
}

impl Pair<'_> {
    fn landing(&self, i: usize, rotation: &Mat3, translation: Vec3, costs: &LabelCosts) -> Landing {
        let q = *rotation * self.own.cloud.points[i] + translation;
        let seen = Sightings::of(self.other_views, q, self.tolerance);
        if seen.through + seen.surface == 0 {
            return Landing::Hidden;
        }
        if !seen.is_surface() {
            let through = seen.through as f32 / (seen.through + seen.surface) as f32;
            // A stray view or two are weak evidence.
            let trust = (seen.through as f32 / 3.0).min(1.0);
            return Landing::Empty(trust * (0.5 + 0.5 * through));
        }
        let mut best = Landing::Surface(None, costs.mismatch);
        self.other.nearest_n(q, 4, |j, d2| {
            let cost = self.unlikeness(i, j, q, *rotation * self.own.cloud.normals[i], costs);
            if d2 < (2.0 * self.spacing).powi(2) && matches!(best, Landing::Surface(_, least) if cost < least) {
                best = Landing::Surface(Some(j), cost);
            }
        });
        best
    }

    /// How different a point, moved to `q` with `normal`, and point `j` of the other state look. The other side of a thin
    /// plate is nearly as good as the same side, whatever its colour.
    fn unlikeness(&self, i: usize, j: usize, q: Vec3, normal: Vec3, costs: &LabelCosts) -> f32 {
        let other = self.other.cloud;
        let facing = normal.dot(other.normals[j]);
        let turned_away = if facing < 0.0 { 1.0 + 0.7 * facing } else { 1.0 - facing };
        let off_plane = ((q - other.points[j]).dot(other.normals[j]).abs() / self.spacing).min(1.0);
        let tint = if facing < -0.7 { 0.0 } else { (self.own.cloud.colors[i] - other.colors[j]).abs().max_element() };
        costs.mismatch * turned_away.max(0.5 * off_plane * off_plane) + costs.color * (tint / 0.5).min(1.0).powi(2)
    }

    /// Cost of every motion for every point, `[n * motions]`, each judged by itself. The first motion is rest.
    pub fn plain_costs(&self, to_other: &[Rigid], costs: &LabelCosts) -> Vec<f32> {
        let poses = matrices(to_other);
        self.fill_rows(poses.len(), |i, row| {
            for (k, (cost, (r, t))) in row.iter_mut().zip(&poses).enumerate() {
                *cost = match self.landing(i, r, *t, costs) {
                    Landing::Empty(cost) | Landing::Surface(_, cost) => cost,
                    Landing::Hidden if k == 0 => costs.hidden_static,
                    Landing::Hidden => costs.hidden_moved,
                };
            }
        })
    }

    /// Cost of every part for every point, `[n * parts]`, part 0 resting. A movable part is believed outright only where
    /// it explains a surface of the other state that rest leaves unexplained: one that slides along itself, or comes to
    /// lie on what has been there all along, says no more than a hidden one. `target_at_rest` tells, of the other
    /// state's points, what this state says about them.
    pub fn part_costs(&self, to_other: &[Rigid], target_at_rest: &[AtRest], costs: &LabelCosts) -> Vec<f32> {
        let poses = matrices(to_other);
        self.fill_rows(poses.len(), |i, row| {
            let land = |k: usize| self.landing(i, &poses[k].0, poses[k].1, costs);
            let (rest, rest_fits) = match land(0) {
                // Too small a glimpse to have left points, yet at the right depth.
                Landing::Surface(None, _) => (0.0, true),
                Landing::Empty(cost) => (cost, false),
                Landing::Hidden => (costs.hidden_static, false),
                Landing::Surface(_, cost) => (cost, cost < 0.5 * costs.mismatch),
            };
            row[0] = rest;
            for k in 1..row.len() {
                row[k] = match land(k) {
                    Landing::Empty(cost) => cost,
                    Landing::Hidden | Landing::Surface(None, _) => costs.hidden_moved + costs.idle,
                    Landing::Surface(Some(j), cost) => match target_at_rest[j] {
                        AtRest::Gone => cost,
                        AtRest::Unseen => cost + 0.5 * costs.hidden_moved,
                        AtRest::Seen if rest_fits => cost + costs.idle,
                        AtRest::Seen => cost.max(costs.hidden_moved) + costs.idle,
                    },
                };
            }
        })
    }

    fn fill_rows(&self, columns: usize, fill: impl Fn(usize, &mut [f32]) + Sync) -> Vec<f32> {
        let mut out = vec![0.0; self.own.cloud.len() * columns];
        out.par_chunks_mut(columns).enumerate().with_min_len(64).for_each(|(i, row)| fill(i, row));
        out
    }
}

fn matrices(motions: &[Rigid]) -> Vec<(Mat3, Vec3)> {
    motions.iter().map(|m| (m.matrix().as_mat3(), m.translation.as_vec3())).collect()
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
                let weight = closeness(points[j] - points[i], [normals[i], normals[j]], spacing)
                    * (-4.0 * (colors[i] - colors[j]).abs().max_element()).exp().max(0.3);
                near.push((i.min(j) as u32, i.max(j) as u32, weight));
            });
            near
        })
        .collect();
    edges.par_sort_unstable_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
    edges.dedup_by_key(|e| (e.0, e.1));
    edges
}

/// How firmly two points hang together, in (0, 1]: firmly on a smooth surface, less across an edge that bulges, least
/// across a groove or a step, where one part ends and the next begins.
fn closeness(apart: Vec3, normals: [Vec3; 2], spacing: f32) -> f32 {
    let bend = 1.0 - normals[0].dot(normals[1]).max(-1.0);
    let bulges = (normals[1] - normals[0]).dot(apart) > 0.0;
    let step = (apart.dot(normals[0] + normals[1]) / (2.0 * apart.length().max(1e-12))).abs();
    let near = (-0.25 * apart.length_squared() / (spacing * spacing)).exp().max(0.05);
    near * (if bulges { -1.0 } else { -3.0 } * bend - 2.0 * step * step).exp().max(0.02)
}

/// The cheapest part of every point by itself.
pub fn cheapest(data: &[f32], parts: usize) -> Vec<u16> {
    let best = |row: &[f32]| (0..parts).min_by(|&x, &y| row[x].total_cmp(&row[y])).unwrap_or(0) as u16;
    data.chunks_exact(parts).map(best).collect()
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
}
