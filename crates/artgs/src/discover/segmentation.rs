//! Which part each surface point belongs to: what the other state shows under every motion and, where that leaves several
//! answers, which part the point is connected with.

use super::cloud::{Cloud, IndexedCloud, components};
use super::graph_cut;
use super::known::KnownLandings;
use super::landing::Landing;
use super::scene::Scene;
use super::surface_paths::SurfaceGraph;
use super::visibility::Occupancy;
use crate::neighbours::PointTree;
use artgs_core::{PerState, Rigid, State};
use glam::Vec3;
use rayon::prelude::*;

/// Costs of one labelling, each relative to the cost 1 of a point in empty space. Calibrated on the stand-ins of the
/// paper's objects and the demo cabinet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LabelCosts {
    /// A static point that the other state hides.
    pub(crate) hidden_static: f32,
    /// A moved point that the other state hides.
    pub(crate) hidden_moved: f32,
    /// The same for a point that has moved for certain: another motion may take it to where it is seen.
    pub(crate) hidden_certain: f32,
    /// A surface is at the place but faces elsewhere or is missing from the points.
    pub(crate) mismatch: f32,
    /// A surface is at the place in quite another colour.
    pub(crate) color: f32,
    /// A point without evidence for a movable part that is given to it.
    pub(crate) unsupported: f32,
    /// A point without evidence for any part that is given to another one than the nearest along the surface.
    pub(crate) not_nearest: f32,
    /// Two close, coplanar neighbours of the same colour in different parts.
    pub(crate) smooth: f32,
}

impl Default for LabelCosts {
    fn default() -> Self {
        Self {
            hidden_static: 0.1,
            hidden_moved: 0.1,
            hidden_certain: 0.25,
            mismatch: 0.2,
            color: 0.3,
            unsupported: 0.005,
            not_nearest: 0.02,
            smooth: 0.4,
        }
    }
}

/// Settings of the labelling beside its costs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SegmentationSettings {
    /// Rounds of expansion of the graph cut.
    pub(crate) sweeps: usize,
    /// A point has evidence for the part that is cheaper than every other by this much and costs less than this.
    pub(crate) lead: f32,
    /// Points of a part this close are one island, spacings.
    pub(crate) island_reach: f32,
    /// Islands whose points are cheaper in their part than static by less than this in sum become static.
    pub(crate) island_support: f32,
    /// The same on average.
    pub(crate) island_mean_support: f32,
    /// Most that one point counts for or against its island.
    pub(crate) island_point: f32,
}

impl Default for SegmentationSettings {
    fn default() -> Self {
        Self {
            sweeps: 2,
            lead: 0.25,
            island_reach: 1.8,
            island_support: 2.0,
            island_mean_support: 0.04,
            island_point: 0.5,
        }
    }
}

/// Settings of the neighbour graph. Edges are weighed so that a cut runs along grooves and steps, where parts end.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GraphSettings {
    /// Neighbours per point.
    pub(crate) neighbours: usize,
    /// Farthest neighbour, spacings.
    pub(crate) reach: f32,
    /// Rate at which weights fall with the largest difference of a colour channel, and their least factor.
    pub(crate) color: [f32; 2],
    /// Rate at which weights fall with squared distance in spacings, and their least factor.
    pub(crate) distance: [f32; 2],
    /// Rates at which weights fall with the bend (1 - cosine between normals) of an edge that bulges, and of a groove.
    pub(crate) bend: [f32; 2],
    /// Rate at which weights fall with the square of the sine of a step.
    pub(crate) step: f32,
    /// Least factor of bend and step together.
    pub(crate) least_shape: f32,
}

impl Default for GraphSettings {
    fn default() -> Self {
        Self {
            neighbours: 10,
            reach: 2.2,
            color: [4.0, 0.3],
            distance: [0.25, 0.05],
            bend: [1.0, 3.0],
            step: 2.0,
            least_shape: 0.02,
        }
    }
}

/// How the points of a cloud are connected.
#[derive(Default)]
pub(crate) struct Graph {
    /// Edges `(i, j, weight in (0, 1])` with i < j, sorted.
    edges: Vec<(u32, u32, f32)>,
    /// Ways along them.
    surface: SurfaceGraph,
}

impl Graph {
    /// Its edges `(i, j, weight in (0, 1])` with i < j, sorted.
    pub(crate) fn into_edges(self) -> Vec<(u32, u32, f32)> {
        self.edges
    }
}

impl GraphSettings {
    /// Symmetric nearest-neighbour graph of a cloud.
    pub(crate) fn graph(&self, cloud: &Cloud, spacing: f32) -> Graph {
        let Cloud { points, normals, colors, .. } = cloud;
        let coords: Vec<[f32; 3]> = points.iter().map(|p| p.to_array()).collect();
        let tree = PointTree::new(&coords);
        let [color_rate, least_color] = self.color;
        let mut edges: Vec<(u32, u32, f32)> = (0..points.len())
            .into_par_iter()
            .with_min_len(256)
            .flat_map_iter(|i| {
                let mut near = Vec::with_capacity(self.neighbours);
                tree.nearest_n(&coords[i], self.neighbours + 1, (self.reach * spacing).powi(2), |j, _| {
                    if j == i {
                        return;
                    }
                    let weight = self.closeness(points[j] - points[i], [normals[i], normals[j]], spacing)
                        * (-color_rate * (colors[i] - colors[j]).abs().max_element()).exp().max(least_color);
                    near.push((i.min(j) as u32, i.max(j) as u32, weight));
                });
                near
            })
            .collect();
        edges.par_sort_unstable_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
        edges.dedup_by_key(|e| (e.0, e.1));
        Graph { surface: SurfaceGraph::new(points.len(), &edges), edges }
    }

    /// How strongly two points are connected, in (0, 1]: strongly on a smooth surface, less across an edge that bulges,
    /// least across a groove or a step, where one part ends and the next begins.
    fn closeness(&self, apart: Vec3, normals: [Vec3; 2], spacing: f32) -> f32 {
        let bend = 1.0 - normals[0].dot(normals[1]).max(-1.0);
        let bulges = (normals[1] - normals[0]).dot(apart) > 0.0;
        let step = (apart.dot(normals[0] + normals[1]) / (2.0 * apart.length().max(1e-12))).abs();
        let near = (-self.distance[0] * apart.length_squared() / (spacing * spacing)).exp().max(self.distance[1]);
        let [convex, concave] = self.bend;
        near * (if bulges { -convex } else { -concave } * bend - self.step * step * step).exp().max(self.least_shape)
    }
}

/// Labels the points of all states.
pub(super) struct Labelling<'a> {
    pub(super) scene: &'a Scene,
    pub(super) clouds: &'a PerState<IndexedCloud<'a>>,
    pub(super) graphs: &'a PerState<Graph>,
    pub(super) known: &'a KnownLandings,
    /// What the other state shows at each point.
    pub(super) occupancy: &'a PerState<Vec<Occupancy>>,
    pub(super) costs: LabelCosts,
    pub(super) settings: SegmentationSettings,
}

impl Labelling<'_> {
    /// Part of every point of every state under motions from start to end.
    pub(super) fn labels(&self, motions: &[Rigid]) -> PerState<Vec<u16>> {
        let parts = motions.len() + 1;
        let landings =
            PerState::from_fn(|s| self.known.rows(&self.scene.pair(self.clouds, s), s, motions, &self.costs));
        let label = |s: State| {
            let own = part_costs(&landings[s], &landings[s.other()], &self.occupancy[s.other()], parts, &self.costs);
            let mut data = own.clone();
            let Graph { edges, surface } = &self.graphs[s];
            add_distance_costs(&mut data, parts, surface, self.costs.not_nearest, self.settings.lead);
            let mut labels = cheapest(&data, parts);
            graph_cut::expand(&data, parts, edges, self.costs.smooth, &mut labels, self.settings.sweeps);
            let reach = self.settings.island_reach * self.scene.lengths.spacing;
            drop_islands(&mut labels, &own, parts, self.clouds[s].cloud, reach, &self.settings);
            labels
        };
        let all: Vec<Vec<u16>> = State::ALL.into_par_iter().map(label).collect();
        let mut all = all.into_iter();
        PerState::from_fn(|_| all.next().unwrap_or_default())
    }
}

/// Cost of an unsampled surface at rest, relative to seeing nothing at the place.
const UNSAMPLED: f32 = 0.5;

/// Cost of every part for every point, `[n * parts]`, part 0 resting, from where the points of both states are.
///
/// A surface may slide along itself or come to lie on one that is in both states, and look the same at rest and moved. So
/// there is evidence for a movable part only where it explains a surface of the other state that rest leaves unexplained,
/// and for rest only where the surface at the place could not itself have moved. All else counts as much as a hidden
/// place. `target_occupancy` is what this state shows at the other state's points.
fn part_costs(
    landings: &[Landing],
    target_landings: &[Landing],
    target_occupancy: &[Occupancy],
    parts: usize,
    costs: &LabelCosts,
) -> Vec<f32> {
    let mut out = vec![0.0; landings.len()];
    let moved = |landing: &Landing, rest: &Landing| match *landing {
        Landing::Empty(cost) => cost,
        Landing::Hidden | Landing::Unsampled if matches!(rest, Landing::Empty(_)) => costs.hidden_certain,
        Landing::Hidden | Landing::Unsampled => costs.hidden_moved + costs.unsupported,
        Landing::Surface(j, cost) => match target_occupancy[j as usize] {
            Occupancy::Empty => cost,
            Occupancy::Unseen => cost + 0.5 * costs.hidden_moved,
            Occupancy::Surface => cost.max(costs.hidden_moved) + costs.unsupported,
        },
    };
    let rest = |row: &[Landing]| match row[0] {
        Landing::Empty(cost) => cost,
        Landing::Hidden => costs.hidden_static,
        Landing::Unsampled => UNSAMPLED * costs.hidden_static,
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

/// The part that a point has evidence for, if any: cheaper by `lead` than every other.
fn evident(row: &[f32], lead: f32) -> Option<usize> {
    let best = (0..row.len()).min_by(|&x, &y| row[x].total_cmp(&row[y]))?;
    let clear = row.iter().enumerate().all(|(k, cost)| k == best || *cost > row[best] + lead);
    (clear && row[best] < lead).then_some(best)
}

/// Adds, for points without evidence, nothing for the part whose points with evidence are nearest along the surface, up
/// to `not_nearest` for others. A step of weight w has length 1 / w, so a path across a smooth face is short and one across
/// a groove is long.
fn add_distance_costs(data: &mut [f32], parts: usize, surface: &SurfaceGraph, not_nearest: f32, lead: f32) {
    let evidence: Vec<Option<usize>> = data.chunks_exact(parts).map(|row| evident(row, lead)).collect();
    let sources = |k: usize| evidence.iter().enumerate().filter(move |(_, e)| **e == Some(k)).map(|(i, _)| i);
    let distances: Vec<Vec<f32>> = (0..parts).into_par_iter().map(|k| surface.distances(sources(k))).collect();
    data.par_chunks_mut(parts).enumerate().with_min_len(512).filter(|(i, _)| evidence[*i].is_none()).for_each(
        |(i, row)| {
            let least = distances.iter().map(|w| w[i]).fold(f32::INFINITY, f32::min);
            for (cost, distance) in row.iter_mut().zip(&distances) {
                let distance = distance[i];
                *cost += if distance.is_finite() {
                    not_nearest * (distance - least) / (distance + least).max(1e-6)
                } else {
                    not_nearest
                };
            }
        },
    );
}

/// The cheapest part of every point by itself.
fn cheapest(data: &[f32], parts: usize) -> Vec<u16> {
    let best = |row: &[f32]| (0..parts).min_by(|&x, &y| row[x].total_cmp(&row[y])).unwrap_or(0) as u16;
    data.chunks_exact(parts).map(best).collect()
}

/// Makes islands of a movable part static: groups of its points, connected by steps of at most `reach` (scene units), that
/// the other state explains no better under the part's motion than at rest.
fn drop_islands(
    labels: &mut [u16],
    data: &[f32],
    parts: usize,
    cloud: &Cloud,
    reach: f32,
    settings: &SegmentationSettings,
) {
    let most = settings.island_point;
    for part in 1..parts {
        let members: Vec<usize> = (0..labels.len()).filter(|&i| usize::from(labels[i]) == part).collect();
        for group in components(cloud, &members, reach, 1) {
            let margin = |i: &usize| (data[i * parts] - data[i * parts + part]).clamp(-most, most);
            let support: f32 = group.iter().map(margin).sum();
            if support < settings.island_support || support < settings.island_mean_support * group.len() as f32 {
                group.iter().for_each(|&i| labels[i] = 0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Costs of rest and of one part for a single point that meets point 0 at rest and point 1 moved.
    fn costs_of(own: [Landing; 2], met: [[Landing; 2]; 2], met_occupancy: [Occupancy; 2]) -> (f32, f32) {
        let row = part_costs(&own, met.as_flattened(), &met_occupancy, 2, &LabelCosts::default());
        (row[0], row[1])
    }

    const ON_SURFACE: [Landing; 2] = [Landing::Surface(0, 0.0), Landing::Surface(1, 0.0)];
    const NOT_HERE: [Landing; 2] = [Landing::Empty(1.0), Landing::Empty(1.0)];

    #[test]
    fn a_point_that_only_one_part_explains_belongs_to_it() {
        let moved = [Landing::Empty(1.0), Landing::Surface(1, 0.0)];
        let (rest, part) = costs_of(moved, [NOT_HERE, NOT_HERE], [Occupancy::Surface, Occupancy::Empty]);
        assert!(rest == 1.0 && part == 0.0);
        let still = [Landing::Surface(0, 0.0), Landing::Empty(1.0)];
        let (rest, part) = costs_of(still, [NOT_HERE, NOT_HERE], [Occupancy::Surface, Occupancy::Surface]);
        assert!(rest == 0.0 && part == 1.0);
    }

    #[test]
    fn a_surface_that_slides_along_itself_is_evidence_for_no_part() {
        let costs = LabelCosts::default();
        let (rest, part) = costs_of(ON_SURFACE, [ON_SURFACE, ON_SURFACE], [Occupancy::Surface, Occupancy::Surface]);
        assert!((rest - part).abs() <= costs.unsupported + 1e-6, "{rest} {part}");
        // Unless it cannot have slid: what is met at rest would land in empty space.
        let (rest, part) =
            costs_of(ON_SURFACE, [[ON_SURFACE[0], NOT_HERE[1]], ON_SURFACE], [Occupancy::Surface, Occupancy::Surface]);
        assert!(rest == 0.0 && part >= costs.hidden_moved, "{rest} {part}");
    }

    #[test]
    fn smooth_faces_are_connected_and_grooves_are_not() {
        let (right, up, down) = (Vec3::X, Vec3::Z, -Vec3::Z);
        let settings = GraphSettings::default();
        let closeness = |apart, normals, spacing| settings.closeness(apart, normals, spacing);
        let flat = closeness(0.01 * right, [up, up], 0.01);
        let ridge = closeness(0.007 * (right + down), [up, right], 0.01);
        let groove = closeness(0.007 * (right + up), [up, -right], 0.01);
        let step = closeness(0.007 * (right + up), [up, up], 0.01);
        assert!(flat > 0.7 && ridge < 0.5 * flat && groove < 0.3 * ridge && step < 0.5 * flat);
    }

    #[test]
    fn points_without_evidence_follow_the_nearest_with_evidence() {
        // A strip whose ends belong to parts 0 and 1; the steps in the middle are long ones.
        let n = 40;
        let mut data = vec![0.1; 2 * n];
        data[..2].copy_from_slice(&[0.0, 1.0]);
        data[2 * n - 2..].copy_from_slice(&[1.0, 0.0]);
        let edges: Vec<_> = (0..n as u32 - 1).map(|i| (i, i + 1, if i == 30 { 0.05 } else { 1.0 })).collect();
        add_distance_costs(&mut data, 2, &SurfaceGraph::new(n, &edges), 0.02, 0.25);
        let labels = cheapest(&data, 2);
        assert!(
            labels.iter().enumerate().all(|(i, l)| *l == u16::from(i > 30) || (20..=30).contains(&i)),
            "{labels:?}"
        );
        assert!(data[2 * 5 + 1] > data[2 * 5] && data[2 * 35] > data[2 * 35 + 1]);
    }

    #[test]
    fn an_island_without_support_becomes_static() {
        let mut cloud = Cloud::default();
        cloud.points.extend((0..60).map(|i| Vec3::new(i as f32 + if i < 30 { 0.0 } else { 50.0 }, 0.0, 0.0)));
        // The first thirty are better explained by moving, the others equally well by both.
        let data: Vec<f32> = (0..60).flat_map(|i| [if i < 30 { 1.0 } else { 0.0 }, 0.0]).collect();
        let mut labels = vec![1; 60];
        drop_islands(&mut labels, &data, 2, &cloud, 1.5, &SegmentationSettings::default());
        assert!(labels[..30].iter().all(|l| *l == 1) && labels[30..].iter().all(|l| *l == 0));
    }
}
