//! One cloud from all frames of a recording: mean points, normals and colours of cubes.

use super::frames::DepthFrame;
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// Oriented, coloured surface points, world frame.
#[derive(Clone, Debug, Default)]
pub(crate) struct FusedCloud {
    /// Mean positions.
    pub(crate) points: Vec<Vec3>,
    /// Unit normals towards the cameras.
    pub(crate) normals: Vec<Vec3>,
    /// sRGB, 0 to 1.
    pub(crate) colors: Vec<Vec3>,
}

/// Cube, main direction of the normal, point, normal and colour of a cell, world frame.
type WorldCell = ([i32; 3], u8, Vec3, Vec3, [u8; 3]);

/// Cubes with fewer cells are noise.
const LEAST_CELLS: usize = 3;

impl FusedCloud {
    /// Averages the cells of all frames over cubes of edge `voxel` and the six main directions of normals, so that both
    /// sides of a thin plate stay apart. Sorted by cube.
    pub(crate) fn new<'a>(frames: impl Iterator<Item = &'a DepthFrame>, voxel: f32) -> Self {
        let mut cells: Vec<WorldCell> =
            frames.collect::<Vec<_>>().into_par_iter().flat_map_iter(|f| world_cells(f, voxel)).collect();
        cells.par_sort_by_key(|c| (c.0, c.1));
        let mut cloud = Self::default();
        for run in cells.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            if run.len() < LEAST_CELLS {
                continue;
            }
            let mean = |f: &dyn Fn(&WorldCell) -> Vec3| run.iter().map(f).sum::<Vec3>() / run.len() as f32;
            cloud.points.push(mean(&|c| c.2));
            cloud.normals.push(mean(&|c| c.3).normalize_or(run[0].3));
            cloud.colors.push(mean(&|c| Vec3::from(c.4.map(f32::from)) / 255.0));
        }
        cloud
    }

    /// Number of points.
    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    /// The points at `indices`, in that order.
    pub(crate) fn select(&self, indices: &[usize]) -> Self {
        Self {
            points: indices.iter().map(|&i| self.points[i]).collect(),
            normals: indices.iter().map(|&i| self.normals[i]).collect(),
            colors: indices.iter().map(|&i| self.colors[i]).collect(),
        }
    }
}

/// Cube of edge `voxel` that a point is in.
pub(crate) fn cube(point: Vec3, voxel: f32) -> IVec3 {
    (point / voxel).floor().as_ivec3()
}

fn world_cells(f: &DepthFrame, voxel: f32) -> impl Iterator<Item = WorldCell> + '_ {
    let pose = f.pose();
    let valid = (0..f.points.len()).filter(|&i| f.normals[i] != Vec3::ZERO);
    valid.map(move |i| {
        let p = pose.apply(f.points[i].as_dvec3()).as_vec3();
        let n = pose.turn(f.normals[i].as_dvec3()).as_vec3();
        let axis = n.abs().max_position();
        (cube(p, voxel).to_array(), 2 * axis as u8 + u8::from(n[axis] < 0.0), p, n, f.colors[i])
    })
}
