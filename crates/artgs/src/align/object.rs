//! Which surfaces belong to the object: what the cameras look at or what is in a given box, without the planes that bound
//! the scene.

use super::bounds::ObjectBox;
use super::cloud::{FusedCloud, cube};
use super::components::{Components, around, most_attended, moved_shares, with_enclosed, with_held};
use super::frames::DepthFrame;
use super::planes::{NOT_BEHIND, Plane, PlaneConfig, bounding_planes};
use super::upward::upward;
use crate::trimmed::quantile;
use artgs_core::Rigid;
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
    /// Planes that bound the scene, those with the most points first.
    pub(crate) planes: Vec<Plane>,
    /// Those of them that are not part of the object.
    removed: Vec<Plane>,
    /// Cubes with surface of the object, and those next to them.
    cubes: HashSet<IVec3>,
    edge: f64,
    plane_spreads: f64,
    /// What stands on the object.
    load: Option<Load>,
    /// Nothing outside of this box belongs to the object.
    given: Option<ObjectBox>,
    /// Surface of the object in all frames.
    pub(crate) cloud: FusedCloud,
    /// Share of the attention of all frames that the object has, 0 to 1.
    pub(crate) attention: f64,
    /// The same of the next best candidate; 0 if the object is what is in a given box.
    pub(crate) runner_up: f64,
}

/// Surfaces of all frames, and the planes that bound them.
struct Surfaces {
    all: FusedCloud,
    planes: Vec<Plane>,
    edge: f64,
}

impl Surfaces {
    fn new(frames: &[&DepthFrame], unit: f64, config: &ObjectConfig, seed: u64) -> Self {
        let edge = config.cube * unit;
        let all = FusedCloud::new(frames.iter().copied(), edge as f32);
        let mut planes = bounding_planes(&all, unit, &config.planes, seed);
        let raised = raised_planes(frames, &planes, unit, config);
        let mut raised = raised.iter();
        planes.retain(|_| !raised.next().is_some_and(|raised| *raised));
        Self { all, planes, edge }
    }

    /// Points of `all` that are clearly in front of every plane.
    fn off_planes(&self, spreads: f64) -> FusedCloud {
        let far = |p: &Vec3| off_planes(&self.planes, p.as_dvec3(), spreads, self.edge);
        let kept: Vec<usize> = (0..self.all.len()).filter(|&i| far(&self.all.points[i])).collect();
        self.all.select(&kept)
    }
}

/// Which planes are the top of something thin that lies on a larger one, such as the base of a laptop: so close in front of it that the
/// larger one does not count as behind it, and looked at much more.
fn raised_planes(frames: &[&DepthFrame], planes: &[Plane], unit: f64, config: &ObjectConfig) -> Vec<bool> {
    /// Least cosine between parallel normals.
    const PARALLEL: f64 = 0.98;
    /// Ratio of the mean attentions from which the cameras look at it and not at the larger plane.
    const LOOKED_AT: f64 = 2.0;
    let tolerance = config.planes.tolerance * unit;
    let on = |raised: &Plane, base: &Plane| {
        let height = raised.offset - base.offset;
        raised.normal.dot(base.normal) > PARALLEL && (0.0..NOT_BEHIND * tolerance).contains(&height)
    };
    let pairs: Vec<Option<usize>> =
        (0..planes.len()).map(|k| (0..k).find(|base| on(&planes[k], &planes[*base]))).collect();
    if pairs.iter().all(Option::is_none) {
        return vec![false; planes.len()];
    }
    let nearest = |p: DVec3| {
        let distances = planes.iter().map(|plane| plane.distance(p).abs()).enumerate();
        distances.filter(|d| d.1 < tolerance).min_by(|a, b| a.1.total_cmp(&b.1)).map(|d| d.0)
    };
    let looked = attention(frames, planes.len(), &nearest, config.attention);
    let points = attention(frames, planes.len(), &nearest, f64::INFINITY);
    let mean = |k: usize| looked[k] / points[k].max(1.0);
    (0..planes.len()).map(|k| pairs[k].is_some_and(|base| mean(k) > LOOKED_AT * mean(base))).collect()
}

fn off_planes(planes: &[Plane], point: DVec3, spreads: f64, edge: f64) -> bool {
    planes.iter().all(|plane| plane.distance(point) > (spreads * plane.spread).max(0.5 * edge))
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
        let surfaces = Surfaces::new(frames, unit, config, seed);
        let edge = surfaces.edge;
        let cloud = surfaces.off_planes(config.bump_spreads);
        let components = Components::new(&cloud.points, edge as f32, config.gap);
        let attention = attention(frames, components.count, &|p| components.of(p.as_vec3()), config.attention);
        let total: f64 = attention.iter().sum::<f64>().max(1e-12);
        let changed = moved(&cloud);
        let numbers: Vec<Option<usize>> = cloud.points.iter().map(|p| components.of(*p)).collect();
        let best = most_attended(&attention, &moved_shares(&cloud.points, &numbers, &changed, components.count))?;
        let runner_up = attention.iter().enumerate().filter(|a| a.0 != best).map(|a| *a.1).fold(0.0, f64::max);
        let poses: Vec<Rigid> = frames.iter().map(|frame| frame.pose()).collect();
        let found = upward(up, &surfaces.planes, &poses, false);
        let up = Some(found.direction).filter(|_| found.is_certain()).or(surfaces.planes.first().map(|p| p.normal));
        let mut belongs = with_enclosed(&cloud, &components, &numbers, best, up, config);
        let held = with_held(&cloud, &numbers, best, &surfaces.planes, edge);
        belongs.iter_mut().zip(held).for_each(|(own, held)| *own |= held);
        let mut members: Vec<usize> = (0..cloud.len()).filter(|&i| numbers[i].is_some_and(|n| belongs[n])).collect();
        let load = up.and_then(|up| Load::find(&cloud, &members, &changed, up.as_vec3(), edge as f32, config));
        if let Some(load) = &load {
            members.retain(|&i| !load.contains(cloud.points[i]));
        }
        let shares = [attention[best] / total, runner_up / total];
        Some(Self::new(surfaces, cloud.select(&members), load, None, shares, config))
    }

    /// Selects what is in a box and not on a plane that bounds it. None if there is nothing.
    pub(crate) fn inside(
        frames: &[&DepthFrame],
        unit: f64,
        given: &ObjectBox,
        config: &ObjectConfig,
        seed: u64,
    ) -> Option<Self> {
        /// Separate groups with a smaller share of the points are errors of depth.
        const NOISE: f64 = 0.005;
        let scene = Surfaces::new(frames, unit, config, seed);
        let edge = scene.edge;
        let own: Vec<usize> =
            (0..scene.all.len()).filter(|&i| given.contains(scene.all.points[i].as_dvec3())).collect();
        let all = scene.all.select(&own);
        // The plane of a wall is not the boundary of a cabinet that is built into the wall.
        let bounds_content = |plane: &&Plane| {
            let margin = (config.bump_spreads * plane.spread).max(0.5 * edge);
            let behind = all.points.iter().filter(|p| plane.distance(p.as_dvec3()) < -margin).count();
            behind as f64 <= config.planes.behind * all.len() as f64
        };
        let removed: Vec<Plane> = scene.planes.iter().filter(bounds_content).copied().collect();
        let content = Surfaces { all, planes: removed, edge };
        let cloud = content.off_planes(config.bump_spreads);
        let groups = Components::new(&cloud.points, edge as f32, config.gap);
        let mut counts = vec![0; groups.count];
        let numbers: Vec<Option<usize>> = cloud.points.iter().map(|p| groups.of(*p)).collect();
        numbers.iter().flatten().for_each(|&n| counts[n] += 1);
        let large = |n: usize| counts[n] as f64 >= NOISE * cloud.len() as f64;
        let members: Vec<usize> = (0..cloud.len()).filter(|&i| numbers[i].is_some_and(large)).collect();
        if members.is_empty() {
            return None;
        }
        let mut selection = Self::new(content, cloud.select(&members), None, Some(*given), [0.0; 2], config);
        selection.planes = scene.planes;
        let group = |p: DVec3| {
            let free = off_planes(&selection.removed, p, config.bump_spreads, edge);
            free.then(|| usize::from(!selection.contains(p)))
        };
        let attention = attention(frames, 2, &group, config.attention);
        selection.attention = attention[0] / attention.iter().sum::<f64>().max(1e-12);
        Some(selection)
    }

    fn new(
        surfaces: Surfaces,
        cloud: FusedCloud,
        load: Option<Load>,
        given: Option<ObjectBox>,
        [attention, runner_up]: [f64; 2],
        config: &ObjectConfig,
    ) -> Self {
        let Surfaces { planes, edge, .. } = surfaces;
        Self {
            removed: planes.clone(),
            planes,
            cubes: cloud.points.iter().flat_map(|p| around(cube(*p, edge as f32), 1)).collect(),
            edge,
            plane_spreads: config.plane_spreads,
            load,
            given,
            cloud,
            attention,
            runner_up,
        }
    }

    /// Smallest box of all surface points of the object that frames see, world frame. None if they are on a plane.
    pub(crate) fn bounds(&self, frames: &[&DepthFrame]) -> Option<ObjectBox> {
        ObjectBox::around(frames.iter().flat_map(|f| f.world_points()).filter(|p| self.contains(*p)))
    }

    /// True for points that are in a cube next to the object's surface, in the box that was given, or near a plane.
    pub(crate) fn is_near(&self, point: DVec3, spreads: f64) -> bool {
        self.given.is_some_and(|b| b.contains(point))
            || around(cube(point.as_vec3(), self.edge as f32), 1).any(|c| self.cubes.contains(&c))
            || !off_planes(&self.planes, point, spreads, self.edge)
    }

    /// Surface of the object as some frames see it, one point per cube of edge `spacing`.
    pub(crate) fn surface(&self, frames: &[&DepthFrame], spacing: f32) -> FusedCloud {
        let cloud = FusedCloud::new(frames.iter().copied(), spacing);
        let own: Vec<usize> = (0..cloud.len()).filter(|&i| self.contains(cloud.points[i].as_dvec3())).collect();
        cloud.select(&own)
    }

    /// Box of what stands on the object and is left out.
    pub(crate) fn left_out(&self) -> Option<ObjectBox> {
        self.load.as_ref().map(|load| load.bounds)
    }

    /// True for points in the box that was given, and everywhere if none was.
    pub(crate) fn is_within_given(&self, point: DVec3) -> bool {
        self.given.is_none_or(|b| b.contains(point))
    }

    /// True for surface points of the object.
    pub(crate) fn contains(&self, point: DVec3) -> bool {
        self.cubes.contains(&cube(point.as_vec3(), self.edge as f32))
            && self.removed.iter().all(|p| p.distance(point) > self.plane_spreads * p.spread)
            && !self.load.as_ref().is_some_and(|l| l.contains(point.as_vec3()))
            && self.is_within_given(point)
    }
}

/// Things that stand on the object and are not part of it.
#[derive(Clone, Debug)]
struct Load {
    up: Vec3,
    edge: f32,
    /// Height of the face that they stand on, with its noise.
    height: f32,
    /// Columns of cubes that they fill.
    columns: HashSet<Column>,
    /// Box of their points.
    bounds: ObjectBox,
}

/// Share of the columns around the foot of a load in which the face must be seen: a load stands on the face, and a back or a side that
/// rises at its border is part of the object.
const SURROUNDED: f64 = 0.7;

impl Load {
    /// What stands on the largest level face of the object, connected to the rest only through it, and did not move. What begins higher,
    /// such as the back of a chair above its seat, is held by parts of the object that depth cameras do not see.
    fn find(
        cloud: &FusedCloud,
        members: &[usize],
        moved: &[bool],
        up: Vec3,
        edge: f32,
        config: &ObjectConfig,
    ) -> Option<Self> {
        let (height, face) = carrying_face(cloud, members, up, edge, config.carrying_share)?;
        // Depth is blurred where a load meets the face: loads are separated one and a half cubes above it.
        let above: Vec<usize> =
            members.iter().copied().filter(|&i| cloud.points[i].dot(up) > height + 1.5 * edge).collect();
        let points: Vec<Vec3> = above.iter().map(|&i| cloud.points[i]).collect();
        let loads = Components::new(&points, edge, config.gap);
        let mut counts = vec![(0, 0); loads.count];
        let mut lowest = vec![f32::INFINITY; loads.count];
        let mut feet = vec![HashSet::new(); loads.count];
        let reach = height + (config.gap + 2) as f32 * edge;
        for &i in &above {
            if let Some(n) = loads.of(cloud.points[i]) {
                let z = cloud.points[i].dot(up);
                counts[n].1 += 1;
                counts[n].0 += usize::from(moved[i]);
                lowest[n] = lowest[n].min(z);
                if z < reach {
                    feet[n].insert(column(cloud.points[i], up, edge));
                }
            }
        }
        let covered: HashSet<Column> = feet.iter().flatten().copied().collect();
        let is_load = |n: usize| {
            5 * counts[n].0 < counts[n].1 && lowest[n] < reach && surrounded(&feet[n], &face, &covered) >= SURROUNDED
        };
        let mut columns = HashSet::new();
        let mut extent = Vec::new();
        for p in points.iter().filter(|p| loads.of(**p).is_some_and(is_load)) {
            columns.extend(square(column(*p, up, edge), 1));
            extent.extend([-0.5, 0.5].map(|half| (*p + Vec3::splat(half * edge)).as_dvec3()));
        }
        let bounds = ObjectBox::around(extent)?;
        Some(Self { up, edge, height, columns, bounds })
    }

    fn contains(&self, point: Vec3) -> bool {
        point.dot(self.up) > self.height && self.columns.contains(&column(point, self.up, self.edge))
    }
}

/// Column of cubes along `up`.
type Column = (i32, i32);

/// Columns at most `reach` from another.
fn square((x, y): Column, reach: i32) -> impl Iterator<Item = Column> {
    (-reach..=reach).flat_map(move |i| (-reach..=reach).map(move |j| (x + i, y + j)))
}

/// Share of the columns around a foot that show the face; those that are `covered` by other feet say nothing. 0 without any.
fn surrounded(foot: &HashSet<Column>, face: &HashSet<Column>, covered: &HashSet<Column>) -> f64 {
    /// Distances of the columns from the foot, about which depth is blurred.
    const BLURRED: i32 = 2;
    const REACH: i32 = 4;
    let within = |reach: i32| foot.iter().flat_map(move |c| square(*c, reach)).collect::<HashSet<Column>>();
    let near = within(BLURRED);
    let ring: Vec<Column> = within(REACH).into_iter().filter(|c| !near.contains(c) && !covered.contains(c)).collect();
    let shown = ring.iter().filter(|c| face.contains(c)).count();
    shown as f64 / ring.len().max(1) as f64
}

/// Column of cubes along `up` that a point is in.
fn column(point: Vec3, up: Vec3, edge: f32) -> Column {
    let (a, b) = up.any_orthonormal_pair();
    ((point.dot(a) / edge).floor() as i32, (point.dot(b) / edge).floor() as i32)
}

/// Height of the highest level face that has at least `share` of the object's footprint, with a margin for its noise, and the columns of
/// the face.
fn carrying_face(
    cloud: &FusedCloud,
    members: &[usize],
    up: Vec3,
    edge: f32,
    share: f64,
) -> Option<(f32, HashSet<Column>)> {
    let footprint: HashSet<Column> = members.iter().map(|&i| column(cloud.points[i], up, edge)).collect();
    let level: Vec<usize> = members.iter().copied().filter(|&i| cloud.normals[i].dot(up) > 0.9).collect();
    let mut layers: HashMap<i32, HashSet<Column>> = HashMap::new();
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
    let height = quantile(heights.collect(), 0.9)? + 0.25 * edge;
    layers.remove(&layer).map(|face| (height, face))
}

/// How much the frames look at each of `count` groups of points: the sum over cells of a Gaussian weight about the image
/// centre.
fn attention(frames: &[&DepthFrame], count: usize, group_of: &dyn Fn(DVec3) -> Option<usize>, sigma: f64) -> Vec<f64> {
    let mut out = vec![0.0; count];
    for f in frames {
        let (columns, rows) = (f.columns(), f.points.len() / f.columns().max(1));
        let scale = 1.0 / (2.0 * (sigma * (columns as f64).hypot(rows as f64)).powi(2));
        let pose = f.pose();
        for (i, p) in f.points.iter().enumerate().filter(|(_, p)| p.z > 0.0) {
            let (x, y) = ((i % columns) as f64 - 0.5 * columns as f64, (i / columns) as f64 - 0.5 * rows as f64);
            let weight = (-(x * x + y * y) * scale).exp();
            if let Some(group) = group_of(pose.apply(p.as_dvec3())) {
                out[group] += weight;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Camera, Intrinsics, Rigid};

    /// A camera 2 units above a floor at z = 0, which it looks at, and a slab of height 0.03 on the floor about `centre`.
    fn frame_above_slab(centre: DVec3) -> DepthFrame {
        let intrinsics = Intrinsics { fx: 100.0, fy: 100.0, cx: 80.0, cy: 60.0, width: 160, height: 120 };
        let down = Rigid::about(DVec3::X, DVec3::ZERO, std::f64::consts::PI);
        let camera = Camera { intrinsics, world_to_camera: down.inverse() * Rigid::shift(DVec3::Z * -2.0) };
        let cell = |i: usize| {
            let ray = Vec3::new(((i % 160) as f32 - 79.5) / 100.0, ((i / 160) as f32 - 59.5) / 100.0, 1.0);
            let at = DVec3::new(f64::from(ray.x) * 2.0, f64::from(-ray.y) * 2.0, 0.0) - centre;
            ray * if at.x.abs().max(at.y.abs()) < 0.2 { 1.97 } else { 2.0 }
        };
        let points: Vec<Vec3> = (0..160 * 120).map(cell).collect();
        let count = points.len();
        DepthFrame {
            camera,
            points,
            normals: vec![-Vec3::Z; count],
            brightness: vec![0.0; count],
            colors: vec![[128; 3]; count],
            samples: Vec::new(),
        }
    }

    #[test]
    fn a_slab_on_the_floor_that_the_cameras_look_at_bounds_nothing() {
        let level = |offset: f64| Plane { normal: DVec3::Z, offset, spread: 0.002 };
        let wall = Plane { normal: DVec3::X, offset: -3.0, spread: 0.002 };
        let raised = |centre: DVec3, planes: &[Plane]| {
            raised_planes(&[&frame_above_slab(centre)], planes, 2.0, &ObjectConfig::default())
        };
        assert_eq!(raised(DVec3::ZERO, &[level(0.0), wall, level(0.03)]), [false, false, true]);
        // Another level of the floor that they do not look at, and the top of a table.
        assert_eq!(raised(DVec3::new(1.2, 0.8, 0.0), &[level(0.0), level(0.03)]), [false, false]);
        assert_eq!(raised(DVec3::ZERO, &[level(0.0), level(0.4)]), [false, false]);
    }

    #[test]
    fn what_stands_on_a_seat_is_a_load_and_its_back_is_not() {
        let edge = 0.02;
        let mut cloud = FusedCloud { points: Vec::new(), normals: Vec::new(), colors: Vec::new() };
        let mut add = |corner: Vec3, sides: [Vec3; 2], normal: Vec3| {
            for (i, j) in (0..20).flat_map(|i| (0..20).map(move |j| (i, j))) {
                cloud.points.push(corner + (sides[0] * i as f32 + sides[1] * j as f32) / 20.0);
                cloud.normals.push(normal);
                cloud.colors.push(Vec3::ONE);
            }
        };
        let wide = [Vec3::X * 0.4, Vec3::Y * 0.4];
        add(Vec3::new(0.0, 0.0, 0.45), wide, Vec3::Z);
        add(Vec3::new(0.1, 0.1, 0.47), [Vec3::X * 0.1, Vec3::Z * 0.1], Vec3::NEG_Y);
        add(Vec3::new(0.0, 0.3, 0.7), [Vec3::X * 0.4, Vec3::Z * 0.2], Vec3::NEG_Y);
        // An arm that rises from the border of the seat.
        add(Vec3::new(0.39, 0.0, 0.45), [Vec3::Y * 0.4, Vec3::Z * 0.2], Vec3::NEG_X);
        let members: Vec<usize> = (0..cloud.len()).collect();
        let load = Load::find(&cloud, &members, &vec![false; cloud.len()], Vec3::Z, edge, &ObjectConfig::default());
        let load = load.expect("a box stands on the seat");
        assert!(load.contains(Vec3::new(0.15, 0.1, 0.55)), "the box");
        assert!(!load.contains(Vec3::new(0.2, 0.3, 0.8)) && !load.contains(Vec3::new(0.2, 0.2, 0.45)), "back and seat");
        assert!(!load.contains(Vec3::new(0.39, 0.2, 0.55)), "the arm");
        assert!(load.bounds.lower().x > 0.09 && load.bounds.upper().x < 0.21, "{}", load.bounds);
    }
}
