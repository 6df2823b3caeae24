//! Oriented surface points and searches among them.

use super::morton::morton;
use super::near_grid::NearGrid;
use super::plane_fit::fit_plane;
use super::visibility::{DepthLookup, STEEPEST};
use crate::neighbours::PointTree;
use glam::{DVec3, IVec3, Vec3};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Oriented, coloured surface points.
#[derive(Clone, Debug, Default)]
pub struct Cloud {
    /// Positions, world frame of the state.
    pub points: Vec<Vec3>,
    /// Unit normals towards the cameras.
    pub normals: Vec<Vec3>,
    /// sRGB in [0, 1].
    pub colors: Vec<Vec3>,
    /// Root mean square distance of the neighbourhood from its plane, scene units.
    pub roughness: Vec<f32>,
}

impl Cloud {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    fn push(&mut self, point: Vec3, normal: Vec3, color: Vec3, roughness: f32) {
        self.points.push(point);
        self.normals.push(normal);
        self.colors.push(color);
        self.roughness.push(roughness);
    }

    /// Concatenates another cloud.
    pub fn append(&mut self, other: &Self) {
        self.points.extend(&other.points);
        self.normals.extend(&other.normals);
        self.colors.extend(&other.colors);
        self.roughness.extend(&other.roughness);
    }

    /// The points `indices`, in that order.
    pub fn select(&self, indices: &[usize]) -> Self {
        let mut out = Self::default();
        for &i in indices {
            out.push(self.points[i], self.normals[i], self.colors[i], self.roughness[i]);
        }
        out
    }

    /// Mean of the points; the origin if there are none.
    pub(crate) fn middle(&self) -> Vec3 {
        self.points.iter().sum::<Vec3>() / self.len().max(1) as f32
    }

    /// Diagonal of the box of the points; 0 if there are none.
    pub(crate) fn diagonal(&self) -> f32 {
        let (lower, upper) = (self.points.iter().copied(), self.points.iter().copied());
        let (lower, upper) = (lower.fold(Vec3::INFINITY, Vec3::min), upper.fold(Vec3::NEG_INFINITY, Vec3::max));
        (upper - lower).max(Vec3::ZERO).length()
    }

    /// Keeps, of every occupied cube of edge `voxel` and main direction, the point with the smoothest neighbourhood.
    /// Two sides of a thin plate are kept apart by the main axis of their normals. Sorted by cube, along a Morton curve.
    pub(crate) fn thinned(&self, voxel: f32) -> Self {
        let cube = |i: usize| (self.points[i] / voxel).floor().as_ivec3();
        let least = (0..self.len()).map(cube).fold(IVec3::MAX, IVec3::min);
        let key = |i: usize| {
            let n = self.normals[i];
            let axis = n.abs().max_position();
            (morton(cube(i) - least), 2 * axis as u8 + u8::from(n[axis] < 0.0))
        };
        let mut order: Vec<_> = (0..self.len()).map(|i| (key(i), i)).collect();
        order.par_sort_unstable();
        let mut keep = Vec::new();
        for run in order.chunk_by(|a, b| a.0 == b.0) {
            let best = run.iter().min_by(|a, b| self.roughness[a.1].total_cmp(&self.roughness[b.1]));
            keep.extend(best.map(|b| b.1));
        }
        self.select(&keep)
    }
}

/// A cloud with a search tree.
pub(crate) struct IndexedCloud<'a> {
    /// The points.
    pub(crate) cloud: &'a Cloud,
    /// Built for the first search that needs it.
    tree: OnceLock<PointTree>,
    /// For short searches, if there are many.
    grid: Option<NearGrid>,
}

impl<'a> IndexedCloud<'a> {
    /// For any search.
    pub(crate) fn new(cloud: &'a Cloud) -> Self {
        Self { cloud, tree: OnceLock::new(), grid: None }
    }

    fn tree(&self) -> &PointTree {
        self.tree.get_or_init(|| {
            let points: Vec<[f32; 3]> = self.cloud.points.iter().map(|p| p.to_array()).collect();
            PointTree::new(&points)
        })
    }

    /// The same for many searches within a few times `spacing`, the distance between neighbouring points in scene units.
    pub(crate) fn gridded(cloud: &'a Cloud, spacing: f32) -> Self {
        /// Edge of a cell, spacings.
        const EDGE: f32 = 1.5;
        Self { grid: NearGrid::new(&cloud.points, EDGE * spacing), ..Self::new(cloud) }
    }

    /// Index of the nearest point within a squared distance, and its squared distance.
    pub(crate) fn nearest_within(&self, point: Vec3, limit: f32) -> Option<(usize, f32)> {
        match &self.grid {
            Some(grid) if grid.suits(1, limit) => {
                let mut found = None;
                grid.nearest_n(point, 1, limit, |i, d| found = Some((i, d)));
                found
            }
            _ => self.tree().nearest_within(&point.to_array(), limit),
        }
    }

    /// Calls `visit(index, squared distance)` for the `n` nearest points within a squared distance, nearest first.
    pub(crate) fn nearest_n(&self, point: Vec3, n: usize, limit: f32, visit: impl FnMut(usize, f32)) {
        match &self.grid {
            Some(grid) if grid.suits(n, limit) => {
                grid.nearest_n(point, n, limit, visit);
            }
            _ => self.tree().nearest_n(&point.to_array(), n, limit, visit),
        }
    }
}

/// Half the edge of the square of pixels that gives a point its normal, pixels.
const PATCH: usize = 2;
/// Least pixels of that square on the same surface; fewer means an edge, where the normal would be wrong.
const LEAST_OF_PATCH: usize = 12;

/// Surface points of one view by back-projection, with normals from a plane through the 5x5 neighbourhood.
/// `stride` skips pixels. Pixels at the edge of a surface (fewer than 12 of 25 neighbours on it) are left out.
pub(super) fn surface_points(view: &DepthLookup, rgba: &[[u8; 4]], stride: usize) -> Cloud {
    let k = view.camera.intrinsics;
    let (w, h) = (k.width as usize, k.height as usize);
    let to_world = view.camera.world_to_camera.inverse();
    let rotation = to_world.matrix();
    let eye = view.camera.position().as_vec3();
    // Points in the frame of the camera: one transformation for the point and one for its normal are enough.
    let point = |(i, d): (usize, f32)| {
        let (x, y) = ((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
        DVec3::new((x - k.cx) / k.fx, (y - k.cy) / k.fy, 1.0) * f64::from(d)
    };
    let points: Vec<DVec3> = view.depth.iter().enumerate().map(point).collect();
    let mut cloud = Cloud::default();
    let mut patch = Vec::with_capacity(25);
    for y in (PATCH..h.saturating_sub(PATCH)).step_by(stride) {
        for x in (PATCH..w.saturating_sub(PATCH)).step_by(stride) {
            let centre = points[y * w + x];
            if centre.z <= 0.0 {
                continue;
            }
            let reach = 2.0 * f64::from(STEEPEST) * centre.z / k.fx;
            patch.clear();
            for row in y - PATCH..=y + PATCH {
                let neighbours = &points[row * w + x - PATCH..=row * w + x + PATCH];
                let near = neighbours.iter().filter(|p| p.z > 0.0 && (p.z - centre.z).abs() < reach);
                patch.extend(near.map(|p| (*p - centre).as_vec3()));
            }
            if patch.len() < LEAST_OF_PATCH {
                continue;
            }
            let (normal, roughness) = fit_plane(&patch);
            let p = to_world.apply(centre).as_vec3();
            let normal = (rotation * normal.as_dvec3()).as_vec3();
            let normal = if normal.dot(eye - p) < 0.0 { -normal } else { normal };
            let c = rgba[y * w + x];
            let color = Vec3::new(c[0].into(), c[1].into(), c[2].into()) / 255.0;
            cloud.push(p, normal, color, roughness);
        }
    }
    cloud
}

/// Principal directions of a group of points, longest first.
pub(crate) fn principal_axes(cloud: &Cloud, group: &[usize]) -> [Vec3; 3] {
    let points: Vec<Vec3> = group.iter().map(|&i| cloud.points[i]).collect();
    let (short, _) = fit_plane(&points);
    let mean = points.iter().sum::<Vec3>() / points.len() as f32;
    let (u, v) = short.any_orthonormal_pair();
    let (mut uu, mut uv, mut vv) = (0.0f32, 0.0, 0.0);
    for p in &points {
        let (a, b) = ((*p - mean).dot(u), (*p - mean).dot(v));
        uu += a * a;
        uv += a * b;
        vv += b * b;
    }
    let angle = 0.5 * (2.0 * uv).atan2(uu - vv);
    let long = u * angle.cos() + v * angle.sin();
    [long, short.cross(long), short]
}

/// Groups of points connected by steps of at most `reach` (scene units); largest first, groups under `least` points
/// left out.
pub(crate) fn components(cloud: &Cloud, members: &[usize], reach: f32, least: usize) -> Vec<Vec<usize>> {
    let cells = Cells::new(cloud, members, reach);
    let mut visited = vec![false; members.len()];
    let mut groups = Vec::new();
    for seed in 0..members.len() {
        if std::mem::replace(&mut visited[seed], true) {
            continue;
        }
        let (mut group, mut next) = (vec![seed], 0);
        while next < group.len() {
            let p = cloud.points[members[group[next]]];
            for n in cells.around(group[next]) {
                if cloud.points[members[n]].distance(p) <= reach && !std::mem::replace(&mut visited[n], true) {
                    group.push(n);
                }
            }
            next += 1;
        }
        let group: Vec<usize> = group.into_iter().map(|n| members[n]).collect();
        if group.len() >= least {
            groups.push(group);
        }
    }
    groups.sort_by_key(|g| std::cmp::Reverse(g.len()));
    groups
}

/// Members of a cloud by cubic cells.
struct Cells {
    /// Cell of each member.
    of: Vec<u32>,
    /// Where the members of each cell start in `sorted`, and the end.
    first: Vec<u32>,
    sorted: Vec<u32>,
    /// Up to 27 cells around each one, itself included, x fastest.
    around: Vec<Vec<u32>>,
}

impl Cells {
    fn new(cloud: &Cloud, members: &[usize], edge: f32) -> Self {
        // x last, so that cells next to each other in x are so in the list.
        let key = |i: &usize| (cloud.points[*i] / edge).floor().as_ivec3().to_array();
        let keys: Vec<[i32; 3]> = members.iter().map(key).map(|[x, y, z]| [z, y, x]).collect();
        let mut sorted: Vec<u32> = (0..members.len() as u32).collect();
        sorted.sort_by_key(|n| keys[*n as usize]);
        let runs: Vec<&[u32]> = sorted.chunk_by(|a, b| keys[*a as usize] == keys[*b as usize]).collect();
        let cells: Vec<[i32; 3]> = runs.iter().map(|run| keys[run[0] as usize]).collect();
        let (mut of, mut first) = (vec![0; members.len()], vec![0]);
        for (cell, run) in runs.iter().enumerate() {
            run.iter().for_each(|n| of[*n as usize] = cell as u32);
            first.push(first[cell] + run.len() as u32);
        }
        let around = |[z, y, x]: &[i32; 3]| {
            let mut out = Vec::with_capacity(27);
            for d in 0..9 {
                let (y, z) = (y.saturating_add(d % 3 - 1), z.saturating_add(d / 3 - 1));
                let begin = cells.partition_point(|c| *c < [z, y, x.saturating_sub(1)]);
                let end = [z, y, x.saturating_add(1)];
                out.extend((begin..cells.len()).take_while(|c| cells[*c] <= end).map(|c| c as u32));
            }
            out
        };
        let around = cells.iter().map(around).collect();
        Self { of, first, sorted, around }
    }

    /// Members in the cells around that of a member.
    fn around(&self, member: usize) -> impl Iterator<Item = usize> {
        let cells = self.around[self.of[member] as usize].iter().map(|c| *c as usize);
        cells.flat_map(|c| &self.sorted[self.first[c] as usize..self.first[c + 1] as usize]).map(|n| *n as usize)
    }
}
