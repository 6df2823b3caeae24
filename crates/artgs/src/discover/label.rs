//! Which part each surface point belongs to: what the other state says under every motion, and where that leaves several
//! answers, what the point hangs together with.

use super::cut::first_steps;
use super::observe::{Cloud, DepthView, SIGHTED_TOGETHER, Sightings};
use super::propose::components;
use super::register::Searchable;
use crate::neighbours::PointTree;
use artgs_core::Rigid;
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Costs of one labelling, each relative to the cost 1 of sitting in empty space.
#[derive(Clone, Copy, Debug)]
pub struct LabelCosts {
    /// A static point that the other state hides.
    pub hidden_static: f32,
    /// A moved point that the other state hides.
    pub hidden_moved: f32,
    /// The same for a point that has moved for sure: another motion may bring it to light.
    pub hidden_gone: f32,
    /// A surface is there but faces elsewhere or is missing from the points.
    pub mismatch: f32,
    /// A surface is there in quite another colour.
    pub color: f32,
    /// A point that does not speak for a movable part, taken for it all the same.
    pub idle: f32,
    /// A point that speaks for no part, taken for another than the one it hangs together with.
    pub astray: f32,
    /// Two close, coplanar, like-coloured neighbours in different parts.
    pub smooth: f32,
}

impl Default for LabelCosts {
    fn default() -> Self {
        Self {
            hidden_static: 0.1,
            hidden_moved: 0.1,
            hidden_gone: 0.25,
            mismatch: 0.2,
            color: 0.3,
            idle: 0.005,
            astray: 0.02,
            smooth: 0.4,
        }
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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Landing {
    /// Where nothing can be, at this cost.
    Empty(f32),
    /// Out of sight.
    #[default]
    Hidden,
    /// At the depth of a surface too little of which is seen to have left points.
    Glimpse,
    /// On a surface: its point there, and the cost of looking different from it.
    Surface(u32, f32),
}

impl Landing {
    fn fits(&self, costs: &LabelCosts) -> bool {
        matches!(self, Self::Surface(_, cost) if *cost < 0.5 * costs.mismatch)
    }
}

impl Pair<'_> {
    /// Where point `i`, of which the other state's views say `seen`, ends up at `q`.
    fn landing(&self, i: usize, q: Vec3, rotation: &Mat3, seen: Sightings, costs: &LabelCosts) -> Landing {
        if seen.through + seen.surface == 0 {
            return Landing::Hidden;
        }
        if !seen.is_surface() {
            let through = seen.through as f32 / (seen.through + seen.surface) as f32;
            // A stray view or two are weak evidence.
            let trust = (seen.through as f32 / 3.0).min(1.0);
            return Landing::Empty(trust * (0.5 + 0.5 * through));
        }
        // Of the nearest points the one whose surface suits best; nearer ones first, lest texture go unnoticed.
        let normal = *rotation * self.own.cloud.normals[i];
        let mut best: Option<(usize, f32)> = None;
        self.other.nearest_n(q, 4, (2.0 * self.spacing).powi(2), |j, _| {
            let shape = self.misplacement(j, q, normal);
            if best.is_none_or(|b| shape < b.1 - 0.1) {
                best = Some((j, shape));
            }
        });
        let Some((j, shape)) = best else { return Landing::Glimpse };
        // The other side of a thin plate may have another colour.
        let same_side = normal.dot(self.other.cloud.normals[j]) > -0.7;
        let tint = (self.own.cloud.colors[i] - self.other.cloud.colors[j]).abs().max_element();
        let tint = if same_side { (tint / 0.5).min(1.0) } else { 0.0 };
        Landing::Surface(j as u32, costs.mismatch * shape + costs.color * tint * tint)
    }

    /// How badly a point at `q` with `normal` suits the surface at point `j` of the other state, 0 to 1. The other side of
    /// a thin plate is nearly as good as the same side.
    fn misplacement(&self, j: usize, q: Vec3, normal: Vec3) -> f32 {
        let other = self.other.cloud;
        let facing = normal.dot(other.normals[j]);
        let turned_away = if facing < 0.0 { 1.0 + 0.7 * facing } else { 1.0 - facing };
        let off_plane = ((q - other.points[j]).dot(other.normals[j]).abs() / self.spacing).min(1.0);
        turned_away.max(0.5 * off_plane * off_plane)
    }

    /// Cost of every motion for every point, `[n * motions]`, each judged by itself. The first motion is rest.
    pub fn plain_costs(&self, to_other: &[Rigid], costs: &LabelCosts) -> Vec<f32> {
        self.fill_rows(to_other, costs, |k, landing| match landing {
            Landing::Empty(cost) | Landing::Surface(_, cost) => cost,
            Landing::Glimpse => costs.mismatch,
            Landing::Hidden if k == 0 => costs.hidden_static,
            Landing::Hidden => costs.hidden_moved,
        })
    }

    /// Where every point lands under every motion, `[n * motions]`.
    pub fn landings(&self, to_other: &[Rigid], costs: &LabelCosts) -> Vec<Landing> {
        self.fill_rows(to_other, costs, |_, landing| landing)
    }

    /// What `say` makes of the landing of every point under every motion, given the motion's number, `[n * motions]`.
    fn fill_rows<T: Copy + Default + Send>(
        &self,
        to_other: &[Rigid],
        costs: &LabelCosts,
        say: impl Fn(usize, Landing) -> T + Sync,
    ) -> Vec<T> {
        let poses: Vec<(Mat3, Vec3)> =
            to_other.iter().map(|m| (m.matrix().as_mat3(), m.translation.as_vec3())).collect();
        let mut out = vec![T::default(); self.own.cloud.len() * poses.len()];
        out.par_chunks_mut(SIGHTED_TOGETHER * poses.len())
            .zip(self.own.cloud.points.par_chunks(SIGHTED_TOGETHER))
            .enumerate()
            .for_each(|(chunk, (out, points))| {
                let (mut moved, mut seen) = (vec![Vec3::ZERO; points.len()], vec![Sightings::default(); points.len()]);
                for (k, (rotation, translation)) in poses.iter().enumerate() {
                    moved.iter_mut().zip(points).for_each(|(q, p)| *q = *rotation * *p + *translation);
                    Sightings::of_each(self.other_views, &moved, self.tolerance, &mut seen);
                    for (n, row) in out.chunks_mut(poses.len()).enumerate() {
                        let i = chunk * SIGHTED_TOGETHER + n;
                        row[k] = say(k, self.landing(i, moved[n], rotation, seen[n], costs));
                    }
                }
            });
        out
    }
}

/// Cost of every part for every point, `[n * parts]`, part 0 resting, from where the points of both states land.
///
/// A surface may slide along itself or come to lie on what has been there all along, and look the same at rest and moved.
/// So a movable part is believed outright only where it explains a surface of the other state that rest leaves
/// unexplained, and rest only where the surface met there could not itself have moved. What is left says no more than a
/// hidden place. `target_at_rest` tells, of the other state's points, what this state says about them.
pub fn part_costs(
    landings: &[Landing],
    target_landings: &[Landing],
    target_at_rest: &[AtRest],
    parts: usize,
    costs: &LabelCosts,
) -> Vec<f32> {
    let mut out = vec![0.0; landings.len()];
    let moved = |landing: &Landing, rest: &Landing| match *landing {
        Landing::Empty(cost) => cost,
        Landing::Hidden | Landing::Glimpse if matches!(rest, Landing::Empty(_)) => costs.hidden_gone,
        Landing::Hidden | Landing::Glimpse => costs.hidden_moved + costs.idle,
        Landing::Surface(j, cost) => match target_at_rest[j as usize] {
            AtRest::Gone => cost,
            AtRest::Unseen => cost + 0.5 * costs.hidden_moved,
            AtRest::Seen => cost.max(costs.hidden_moved) + costs.idle,
        },
    };
    let rest = |row: &[Landing]| match row[0] {
        Landing::Empty(cost) => cost,
        Landing::Hidden => costs.hidden_static,
        Landing::Glimpse => GLIMPSE * costs.hidden_static,
        Landing::Surface(j, cost) => {
            let met = &target_landings[j as usize * parts..(j as usize + 1) * parts];
            let slides = |k: usize| !matches!(row[k], Landing::Empty(_)) && met[k].fits(costs);
            if (1..parts).any(slides) { cost.max(costs.hidden_static) } else { cost }
        }
    };
    out.par_chunks_mut(parts).zip(landings.par_chunks(parts)).with_min_len(512).for_each(|(out, row)| {
        out[0] = rest(row);
        (1..parts).for_each(|k| out[k] = moved(&row[k], &row[0]));
    });
    out
}

/// Cost of a glimpse of a surface at rest, relative to seeing nothing there.
const GLIMPSE: f32 = 0.5;

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
            tree.nearest_n(&coords[i], k + 1, (2.2 * spacing).powi(2), |j, _| {
                if j == i {
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

/// Parts that points speak for by themselves: far cheaper than any other.
fn sure(row: &[f32]) -> Option<usize> {
    const LEAD: f32 = 0.25;
    let best = (0..row.len()).min_by(|&x, &y| row[x].total_cmp(&row[y]))?;
    let clear = row.iter().enumerate().all(|(k, cost)| k == best || *cost > row[best] + LEAD);
    (clear && row[best] < LEAD).then_some(best)
}

/// Adds, for points that speak for no part, what it costs to go astray: nothing for the part whose sure points are
/// nearest along the surface, up to `astray` for others. A step of weight w is 1 / w long, so the way across a smooth face
/// is short and the way across a groove is long.
pub fn add_astray_costs(data: &mut [f32], parts: usize, edges: &[(u32, u32, f32)], astray: f32) {
    let sure: Vec<Option<usize>> = data.chunks_exact(parts).map(sure).collect();
    let roads = Roads::new(sure.len(), edges);
    let ways: Vec<Vec<f32>> = (0..parts).into_par_iter().map(|k| roads.from(|i| sure[i] == Some(k))).collect();
    data.par_chunks_mut(parts).enumerate().with_min_len(512).filter(|(i, _)| sure[*i].is_none()).for_each(
        |(i, row)| {
            let least = ways.iter().map(|w| w[i]).fold(f32::INFINITY, f32::min);
            for (cost, way) in row.iter_mut().zip(&ways) {
                let way = way[i];
                *cost += if way.is_finite() { astray * (way - least) / (way + least).max(1e-6) } else { astray };
            }
        },
    );
}

/// Neighbours of every point, with the lengths of the steps to them.
struct Roads {
    first: Vec<u32>,
    steps: Vec<(u32, f32)>,
}

impl Roads {
    fn new(nodes: usize, edges: &[(u32, u32, f32)]) -> Self {
        let first = first_steps(nodes, edges);
        let mut next = first.clone();
        let mut steps = vec![(0, 0.0); 2 * edges.len()];
        for (i, j, weight) in edges {
            for (from, to) in [(i, j), (j, i)] {
                steps[next[*from as usize] as usize] = (*to, 1.0 / weight.max(1e-3));
                next[*from as usize] += 1;
            }
        }
        Self { first, steps }
    }

    /// Length of the shortest way from any source to every node (Dijkstra 1959); infinite where there is none.
    fn from(&self, is_source: impl Fn(usize) -> bool) -> Vec<f32> {
        let nodes = self.first.len() - 1;
        let mut way = vec![f32::INFINITY; nodes];
        let mut queue = BinaryHeap::new();
        // Lengths are not negative, so their bits are in the same order.
        for i in (0..nodes).filter(|i| is_source(*i)) {
            way[i] = 0.0;
            queue.push(Reverse((0u32, i as u32)));
        }
        while let Some(Reverse((bits, node))) = queue.pop() {
            let (length, i) = (f32::from_bits(bits), node as usize);
            if length > way[i] {
                continue;
            }
            for (to, step) in &self.steps[self.first[i] as usize..self.first[i + 1] as usize] {
                let there = length + step;
                if there < way[*to as usize] {
                    way[*to as usize] = there;
                    queue.push(Reverse((there.to_bits(), *to)));
                }
            }
        }
        way
    }
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

    /// Costs of rest and of one part for a single point that meets point 0 at rest and point 1 moved.
    fn costs_of(own: [Landing; 2], met: [[Landing; 2]; 2], met_at_rest: [AtRest; 2]) -> (f32, f32) {
        let row = part_costs(&own, met.as_flattened(), &met_at_rest, 2, &LabelCosts::default());
        (row[0], row[1])
    }

    const THERE: [Landing; 2] = [Landing::Surface(0, 0.0), Landing::Surface(1, 0.0)];
    const NOWHERE: [Landing; 2] = [Landing::Empty(1.0), Landing::Empty(1.0)];

    #[test]
    fn a_point_that_only_one_part_explains_speaks_for_it() {
        let moved = [Landing::Empty(1.0), Landing::Surface(1, 0.0)];
        let (rest, part) = costs_of(moved, [NOWHERE, NOWHERE], [AtRest::Seen, AtRest::Gone]);
        assert!(rest == 1.0 && part == 0.0);
        let still = [Landing::Surface(0, 0.0), Landing::Empty(1.0)];
        let (rest, part) = costs_of(still, [NOWHERE, NOWHERE], [AtRest::Seen, AtRest::Seen]);
        assert!(rest == 0.0 && part == 1.0);
    }

    #[test]
    fn a_surface_that_slides_along_itself_speaks_for_nobody() {
        let costs = LabelCosts::default();
        let (rest, part) = costs_of(THERE, [THERE, THERE], [AtRest::Seen, AtRest::Seen]);
        assert!((rest - part).abs() <= costs.idle + 1e-6, "{rest} {part}");
        // Unless it cannot have slid: what is met at rest would land in empty space.
        let (rest, part) = costs_of(THERE, [[THERE[0], NOWHERE[1]], THERE], [AtRest::Seen, AtRest::Seen]);
        assert!(rest == 0.0 && part >= costs.hidden_moved, "{rest} {part}");
    }

    #[test]
    fn smooth_faces_hold_together_and_grooves_do_not() {
        let (right, up, down) = (Vec3::X, Vec3::Z, -Vec3::Z);
        let flat = closeness(0.01 * right, [up, up], 0.01);
        let ridge = closeness(0.007 * (right + down), [up, right], 0.01);
        let groove = closeness(0.007 * (right + up), [up, -right], 0.01);
        let step = closeness(0.007 * (right + up), [up, up], 0.01);
        assert!(flat > 0.7 && ridge < 0.5 * flat && groove < 0.3 * ridge && step < 0.5 * flat);
    }

    #[test]
    fn points_without_a_voice_follow_the_nearest_that_speak() {
        // A strip whose ends speak for parts 0 and 1; the steps in the middle are long ones.
        let n = 40;
        let mut data = vec![0.1; 2 * n];
        data[..2].copy_from_slice(&[0.0, 1.0]);
        data[2 * n - 2..].copy_from_slice(&[1.0, 0.0]);
        let edges: Vec<_> = (0..n as u32 - 1).map(|i| (i, i + 1, if i == 30 { 0.05 } else { 1.0 })).collect();
        add_astray_costs(&mut data, 2, &edges, 0.02);
        let labels = cheapest(&data, 2);
        assert!(
            labels.iter().enumerate().all(|(i, l)| *l == u16::from(i > 30) || (20..=30).contains(&i)),
            "{labels:?}"
        );
        assert!(data[2 * 5 + 1] > data[2 * 5] && data[2 * 35] > data[2 * 35 + 1]);
    }

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
