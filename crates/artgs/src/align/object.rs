//! Which surfaces belong to the object: what the cameras look at, without the planes that bound the scene.

use super::cloud::{FusedCloud, cube};
use super::frames::DepthFrame;
use super::planes::{Plane, PlaneConfig, bounding_planes};
use crate::trimmed::quantile;
use glam::{DVec3, IVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};

/// Selection of the object. Lengths are in units of the median depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ObjectConfig {
    /// Edge of the cubes that the scene is divided into.
    pub cube: f64,
    /// Standard deviation of attention about the image centre, as a fraction of the image diagonal.
    pub attention: f64,
    /// Points within this many standard deviations of a bounding plane belong to the plane.
    pub plane_spreads: f64,
    /// Points within this many standard deviations of a bounding plane do not connect surfaces: depth errors make bumps on
    /// a floor.
    pub bump_spreads: f64,
    /// Surfaces with at most this many empty cubes between them are connected: depth is missing along edges.
    pub gap: i32,
    /// A level face of the object with at least this share of its footprint can carry things that are not part of it, 0 to
    /// 1. Above 1, everything on the object belongs to it.
    pub carrying_share: f64,
    /// Bounding planes.
    pub planes: PlaneConfig,
}

impl Default for ObjectConfig {
    fn default() -> Self {
        Self {
            cube: 0.012,
            attention: 0.15,
            plane_spreads: 2.0,
            bump_spreads: 4.0,
            gap: 2,
            carrying_share: 0.25,
            planes: PlaneConfig::default(),
        }
    }
}

/// The selected object.
#[derive(Clone, Debug)]
pub(crate) struct Selection {
    /// Planes that bound the scene; not part of the object.
    pub(crate) planes: Vec<Plane>,
    /// Cubes with surface of the object, and those next to them.
    cubes: HashSet<IVec3>,
    edge: f64,
    plane_spreads: f64,
    /// What stands on the object.
    load: Option<Load>,
    /// Surface of the object in all frames.
    pub(crate) cloud: FusedCloud,
    /// Box of the object, world frame.
    pub(crate) lower: DVec3,
    /// Box of the object, world frame.
    pub(crate) upper: DVec3,
    /// Share of the attention of all frames that the object has, 0 to 1.
    pub(crate) attention: f64,
    /// The same of the next best candidate.
    pub(crate) runner_up: f64,
}

impl Selection {
    /// Selects the connected surfaces that the frames look at most. `unit` is the median depth, `up` the direction opposite
    /// to gravity. Things that stand on the object are left out unless they are in `moved`, points that the two states do
    /// not share. None if the frames look at nothing but bounding planes.
    pub(crate) fn find(
        frames: &[&DepthFrame],
        unit: f64,
        up: Option<DVec3>,
        moved: &dyn Fn(&FusedCloud) -> Vec<bool>,
        config: &ObjectConfig,
        seed: u64,
    ) -> Option<Self> {
        let edge = config.cube * unit;
        let all = FusedCloud::new(frames.iter().copied(), edge as f32);
        let planes = bounding_planes(&all, unit, &config.planes, seed);
        let off_planes = |p: Vec3| {
            let far =
                |plane: &Plane| plane.distance(p.as_dvec3()) > (config.bump_spreads * plane.spread).max(0.5 * edge);
            planes.iter().all(far)
        };
        let kept: Vec<usize> = (0..all.len()).filter(|&i| off_planes(all.points[i])).collect();
        let cloud = all.select(&kept);
        let components = Components::new(&cloud.points, edge as f32, config.gap);
        let attention = attention(frames, &components, config.attention);
        let total: f64 = attention.iter().sum::<f64>().max(1e-12);
        let best = (0..attention.len()).max_by(|a, b| attention[*a].total_cmp(&attention[*b]).then(b.cmp(a)))?;
        let runner_up = attention.iter().enumerate().filter(|a| a.0 != best).map(|a| *a.1).fold(0.0, f64::max);
        let up = up.or(planes.first().map(|p| p.normal));
        let mut members = with_enclosed(&cloud, &components, best, up, config);
        let load = up.and_then(|up| Load::find(&cloud, &members, &moved(&cloud), up.as_vec3(), edge as f32, config));
        if let Some(load) = &load {
            members.retain(|&i| !load.contains(cloud.points[i]));
        }
        let object = cloud.select(&members);
        let (lower, upper) = object.points.iter().fold((Vec3::MAX, Vec3::MIN), |(l, u), p| (l.min(*p), u.max(*p)));
        Some(Self {
            planes,
            cubes: object.points.iter().flat_map(|p| around(cube(*p, edge as f32), 1)).collect(),
            edge,
            plane_spreads: config.plane_spreads,
            load,
            cloud: object,
            lower: lower.as_dvec3(),
            upper: upper.as_dvec3(),
            attention: attention[best] / total,
            runner_up: runner_up / total,
        })
    }

    /// Surface of the object as some frames see it, one point per cube of edge `spacing`.
    pub(crate) fn surface(&self, frames: &[&DepthFrame], spacing: f32) -> FusedCloud {
        let cloud = FusedCloud::new(frames.iter().copied(), spacing);
        let own: Vec<usize> = (0..cloud.len()).filter(|&i| self.contains(cloud.points[i].as_dvec3())).collect();
        cloud.select(&own)
    }

    /// True for surface points of the object.
    pub(crate) fn contains(&self, point: DVec3) -> bool {
        self.cubes.contains(&cube(point.as_vec3(), self.edge as f32))
            && self.planes.iter().all(|p| p.distance(point) > self.plane_spreads * p.spread)
            && !self.load.as_ref().is_some_and(|l| l.contains(point.as_vec3()))
    }
}

/// A cube and those within `reach` cubes of it along every axis.
fn around(c: IVec3, reach: i32) -> impl Iterator<Item = IVec3> {
    let side = 2 * reach + 1;
    (0..side.pow(3)).map(move |i| c + IVec3::new(i % side, i / side % side, i / (side * side)) - reach)
}

/// Connected groups of cubes that hold points.
struct Components {
    numbers: HashMap<IVec3, usize>,
    edge: f32,
    count: usize,
}

impl Components {
    /// Connects cubes with at most `gap` empty cubes between them. Numbered in the order of their first cube.
    fn new(points: &[Vec3], edge: f32, gap: i32) -> Self {
        let mut cubes: Vec<IVec3> = points.iter().map(|p| cube(*p, edge)).collect();
        cubes.sort_by_key(|c| c.to_array());
        cubes.dedup();
        let filled: HashSet<IVec3> = cubes.iter().copied().collect();
        let mut numbers: HashMap<IVec3, usize> = HashMap::new();
        let mut count = 0;
        for &c in &cubes {
            if numbers.contains_key(&c) {
                continue;
            }
            let mut stack = vec![c];
            numbers.insert(c, count);
            while let Some(c) = stack.pop() {
                for n in around(c, gap + 1) {
                    if filled.contains(&n) && !numbers.contains_key(&n) {
                        numbers.insert(n, count);
                        stack.push(n);
                    }
                }
            }
            count += 1;
        }
        Self { numbers, edge, count }
    }

    fn of(&self, point: Vec3) -> Option<usize> {
        self.numbers.get(&cube(point, self.edge)).copied()
    }
}

/// Points of a component, and of those that are mostly above its footprint and near it: what an open door shows inside, a
/// top whose edges have no depth.
fn with_enclosed(
    cloud: &FusedCloud,
    components: &Components,
    best: usize,
    up: Option<DVec3>,
    config: &ObjectConfig,
) -> Vec<usize> {
    /// Share of a component's points.
    const MOSTLY: f64 = 0.9;
    let up = up.map_or(Vec3::Z, |u| u.as_vec3());
    let (a, b) = up.any_orthonormal_pair();
    let flat = |p: Vec3| (p.dot(a), p.dot(b));
    let numbers: Vec<Option<usize>> = cloud.points.iter().map(|p| components.of(*p)).collect();
    let own: Vec<Vec3> =
        cloud.points.iter().zip(&numbers).filter(|(_, n)| **n == Some(best)).map(|(p, _)| *p).collect();
    let hull = convex_hull(own.iter().map(|p| flat(*p)).collect());
    let heights = own.iter().map(|p| p.dot(up));
    let (low, high) = heights.fold((f32::MAX, f32::MIN), |(l, h), z| (l.min(z), h.max(z)));
    let reach = (config.gap + 2) as f32 * components.edge;
    let mut counts = vec![(0, 0, f32::MAX); components.count];
    for (p, n) in cloud.points.iter().zip(&numbers) {
        if let Some(n) = n {
            let (count, z) = (&mut counts[*n], p.dot(up));
            count.1 += 1;
            count.0 += usize::from(z > low && in_hull(&hull, flat(*p)));
            count.2 = count.2.min(z);
        }
    }
    let belongs = |n: usize| {
        let (inside, all, lowest) = counts[n];
        n == best || (inside as f64 >= MOSTLY * all as f64 && lowest < high + reach)
    };
    (0..cloud.len()).filter(|&i| numbers[i].is_some_and(belongs)).collect()
}

/// Corners of the convex hull of points in the plane, counter-clockwise (Andrew's monotone chain).
fn convex_hull(mut points: Vec<(f32, f32)>) -> Vec<(f32, f32)> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let half = |points: &mut dyn Iterator<Item = (f32, f32)>| {
        let mut chain: Vec<(f32, f32)> = Vec::new();
        for p in points {
            while chain.len() >= 2 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    hull
}

/// Positive if `c` is on the left of the line from `a` to `b`.
fn turn(a: (f32, f32), b: (f32, f32), c: (f32, f32)) -> f32 {
    (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0)
}

fn in_hull(hull: &[(f32, f32)], p: (f32, f32)) -> bool {
    hull.len() >= 3 && (0..hull.len()).all(|i| turn(hull[i], hull[(i + 1) % hull.len()], p) >= 0.0)
}

/// Things that stand on the object and are not part of it.
#[derive(Clone, Debug)]
struct Load {
    up: Vec3,
    edge: f32,
    /// Height of the face that they stand on, with its noise.
    height: f32,
    /// Columns of cubes that they fill.
    columns: HashSet<(i32, i32)>,
}

impl Load {
    /// What is above the largest level face of the object, connected to the rest only through it, and did not move.
    fn find(
        cloud: &FusedCloud,
        members: &[usize],
        moved: &[bool],
        up: Vec3,
        edge: f32,
        config: &ObjectConfig,
    ) -> Option<Self> {
        let height = carrying_height(cloud, members, up, edge, config.carrying_share)?;
        // Depth is blurred where a load meets the face: loads are separated one and a half cubes above it.
        let above: Vec<usize> =
            members.iter().copied().filter(|&i| cloud.points[i].dot(up) > height + 1.5 * edge).collect();
        let points: Vec<Vec3> = above.iter().map(|&i| cloud.points[i]).collect();
        let loads = Components::new(&points, edge, config.gap);
        let mut counts = vec![(0, 0); loads.count];
        for &i in &above {
            if let Some(n) = loads.of(cloud.points[i]) {
                counts[n].1 += 1;
                counts[n].0 += usize::from(moved[i]);
            }
        }
        let still = |n: usize| 5 * counts[n].0 < counts[n].1;
        let mut columns = HashSet::new();
        for p in points.iter().filter(|p| loads.of(**p).is_some_and(still)) {
            let (x, y) = column(*p, up, edge);
            columns.extend((0..9).map(|i| (x + i % 3 - 1, y + i / 3 - 1)));
        }
        (!columns.is_empty()).then_some(Self { up, edge, height, columns })
    }

    fn contains(&self, point: Vec3) -> bool {
        point.dot(self.up) > self.height && self.columns.contains(&column(point, self.up, self.edge))
    }
}

/// Column of cubes along `up` that a point is in.
fn column(point: Vec3, up: Vec3, edge: f32) -> (i32, i32) {
    let (a, b) = up.any_orthonormal_pair();
    ((point.dot(a) / edge).floor() as i32, (point.dot(b) / edge).floor() as i32)
}

/// Height of the highest level face that has at least `share` of the object's footprint, with a margin for its noise.
fn carrying_height(cloud: &FusedCloud, members: &[usize], up: Vec3, edge: f32, share: f64) -> Option<f32> {
    let footprint: HashSet<(i32, i32)> = members.iter().map(|&i| column(cloud.points[i], up, edge)).collect();
    let level: Vec<usize> = members.iter().copied().filter(|&i| cloud.normals[i].dot(up) > 0.9).collect();
    let mut layers: HashMap<i32, HashSet<(i32, i32)>> = HashMap::new();
    for &i in &level {
        let layer = (cloud.points[i].dot(up) / edge).floor() as i32;
        // A face may lie on the border of two layers.
        for l in [layer - 1, layer] {
            layers.entry(l).or_default().insert(column(cloud.points[i], up, edge));
        }
    }
    let wide = layers.iter().filter(|(_, columns)| columns.len() as f64 >= share * footprint.len() as f64);
    let layer = wide.map(|(layer, _)| *layer).max()?;
    let inside = |h: f32| (layer as f32 * edge..(layer + 2) as f32 * edge).contains(&h);
    let heights = level.iter().map(|&i| cloud.points[i].dot(up)).filter(|h| inside(*h));
    // The face itself stays, with a quarter of a cube of noise above it.
    Some(quantile(heights.collect(), 0.9)? + 0.25 * edge)
}

/// How much the frames look at each component: the sum over cells of a Gaussian weight about the image centre.
fn attention(frames: &[&DepthFrame], components: &Components, sigma: f64) -> Vec<f64> {
    let mut out = vec![0.0; components.count];
    for f in frames {
        let (columns, rows) = (f.columns(), f.points.len() / f.columns().max(1));
        let scale = 1.0 / (2.0 * (sigma * (columns as f64).hypot(rows as f64)).powi(2));
        let pose = f.pose();
        for (i, p) in f.points.iter().enumerate().filter(|(_, p)| p.z > 0.0) {
            let (x, y) = ((i % columns) as f64 - 0.5 * columns as f64, (i / columns) as f64 - 0.5 * rows as f64);
            let weight = (-(x * x + y * y) * scale).exp();
            let world = pose.apply(p.as_dvec3()).as_vec3();
            if let Some(c) = components.of(world) {
                out[c] += weight;
            }
        }
    }
    out
}
