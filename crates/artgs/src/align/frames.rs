//! Depth frames prepared for registration: points, normals and brightness on a coarse grid of pixels.

use artgs_core::capture::OBJECT_ALPHA;
use artgs_core::{Camera, RecordedFrame, Rigid, View};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Grid of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GridConfig {
    /// Largest number of grid columns, cells. Depth noise is averaged within a cell; more columns cost time.
    pub columns: usize,
    /// Depth step between neighbouring cells that is an edge, as a fraction of the depth.
    pub edge: f32,
    /// Points of a frame that are compared with other frames.
    pub samples: usize,
}

impl Default for GridConfig {
    fn default() -> Self {
        Self { columns: 200, edge: 0.04, samples: 300 }
    }
}

/// One frame on a grid of cells, row-major. All vectors are in the camera's frame (OpenCV axes).
#[derive(Clone)]
pub(crate) struct DepthFrame {
    /// Camera whose pixels are the cells, with the pose known so far.
    pub(crate) camera: Camera,
    /// Mean point of each cell; zero where depth is missing or has an edge.
    pub(crate) points: Vec<Vec3>,
    /// Unit normal towards the camera; zero where it is unknown.
    pub(crate) normals: Vec<Vec3>,
    /// Logarithm of brightness.
    pub(crate) brightness: Vec<f32>,
    /// Mean colour, 0 to 255.
    pub(crate) colors: Vec<[u8; 3]>,
    /// Cells that are compared with other frames, spread over directions of normals.
    pub(crate) samples: Vec<u32>,
}

impl DepthFrame {
    /// Averages a frame with depth over cells; pixels outside its mask are ignored. Without depth the grid is empty.
    ///
    /// `depth_step` is the width in image pixels of one measured depth pixel.
    pub(crate) fn new(view: &View, depth_step: f64, config: &GridConfig) -> Self {
        let (width, height) = view.size();
        let step = (depth_step.round() as usize).max(width.div_ceil(config.columns.max(1))).max(1);
        let (columns, rows) = (width / step, height / step);
        let k = view.camera.intrinsics;
        let s = step as f64;
        let intrinsics = artgs_core::Intrinsics {
            fx: k.fx / s,
            fy: k.fy / s,
            cx: k.cx / s,
            cy: k.cy / s,
            width: columns as u32,
            height: rows as u32,
        };
        let camera = Camera { intrinsics, ..view.camera };
        let cells: Vec<(f32, [u8; 3])> =
            (0..columns * rows).map(|i| cell(view, step, i % columns, i / columns, config.edge)).collect();
        let points: Vec<Vec3> = cells.iter().enumerate().map(|(i, (z, _))| ray(&camera, i) * *z).collect();
        let normals = normals(&points, columns, config.edge);
        let colors: Vec<[u8; 3]> = cells.into_iter().map(|(_, color)| color).collect();
        let brightness = colors.iter().map(|c| brightness(c.map(f32::from))).collect();
        let samples = spread_samples(&points, &normals, config.samples);
        Self { camera, points, normals, brightness, colors, samples }
    }

    /// Prepares all frames.
    pub(crate) fn all(frames: &[RecordedFrame], config: &GridConfig) -> Vec<Self> {
        frames.par_iter().map(|f| Self::new(&f.view, f.depth_step, config)).collect()
    }

    /// Prepares views whose depth has the size of their images.
    pub(crate) fn of_views(views: &[View], config: &GridConfig) -> Vec<Self> {
        views.par_iter().map(|v| Self::new(v, 1.0, config)).collect()
    }

    /// Grid columns.
    pub(crate) fn columns(&self) -> usize {
        self.camera.intrinsics.width as usize
    }

    /// Cell that a point in the camera's frame falls into.
    pub(crate) fn cell_of(&self, p: DVec3) -> Option<usize> {
        let k = &self.camera.intrinsics;
        if p.z <= 0.0 {
            return None;
        }
        let (u, v) = (k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy);
        let inside = u >= 0.0 && v >= 0.0 && u < f64::from(k.width) && v < f64::from(k.height);
        inside.then(|| v as usize * k.width as usize + u as usize)
    }

    /// Multiplies the depth of every cell.
    pub(crate) fn scale_depth(&mut self, factors: &[f32]) {
        self.points.iter_mut().zip(factors).for_each(|(p, f)| *p *= *f);
    }

    /// Block of the image, of 3 x 3, that a cell is in.
    pub(crate) fn block_of(&self, cell: usize) -> usize {
        let (columns, rows) = (self.columns(), self.points.len() / self.columns());
        (cell / columns * 3 / rows) * 3 + cell % columns * 3 / columns
    }

    /// Points of all cells with depth, world frame.
    pub(crate) fn world_points(&self) -> impl Iterator<Item = DVec3> + '_ {
        let pose = self.pose();
        self.points.iter().filter(|p| p.z > 0.0).map(move |p| pose.apply(p.as_dvec3()))
    }

    /// Camera to world.
    pub(crate) fn pose(&self) -> Rigid {
        self.camera.world_to_camera.inverse()
    }

    /// Replaces the pose; `pose` is camera to world.
    pub(crate) fn set_pose(&mut self, pose: Rigid) {
        self.camera.world_to_camera = pose.inverse();
    }

    /// Gradient of brightness along columns and rows, per cell; none at the border or beside missing depth.
    pub(crate) fn brightness_gradient(&self, cell: usize) -> Option<(f32, f32)> {
        let (columns, x) = (self.columns(), cell % self.columns());
        if x == 0 || x + 1 == columns || cell < columns || cell + columns >= self.points.len() {
            return None;
        }
        let around = [cell - 1, cell + 1, cell - columns, cell + columns];
        around.iter().all(|&c| self.points[c].z > 0.0).then(|| {
            let b = |c: usize| self.brightness[around[c]];
            (0.5 * (b(1) - b(0)), 0.5 * (b(3) - b(2)))
        })
    }
}

/// Direction of a cell's centre with depth 1.
pub(super) fn ray(camera: &Camera, index: usize) -> Vec3 {
    let k = &camera.intrinsics;
    let (x, y) = (index % k.width as usize, index / k.width as usize);
    Vec3::new(((x as f64 + 0.5 - k.cx) / k.fx) as f32, ((y as f64 + 0.5 - k.cy) / k.fy) as f32, 1.0)
}

/// Mean depth of the pixels of a cell that belong to one surface, 0 if there is none, and their mean colour.
fn cell(view: &View, step: usize, column: usize, row: usize, edge: f32) -> (f32, [u8; 3]) {
    let width = view.size().0;
    let pixels = (0..step * step).map(|i| (row * step + i / step) * width + column * step + i % step);
    let (mut sum, mut count, mut low, mut high) = (0.0, 0, f32::MAX, 0.0_f32);
    let (mut color, mut colored) = ([0_u32; 3], 0);
    for pixel in pixels {
        let c = view.rgba[pixel];
        color.iter_mut().zip(c).for_each(|(sum, c)| *sum += u32::from(c));
        colored += 1;
        let z = view.depth.as_ref().map_or(0.0, |d| d.at(pixel));
        if z > 0.0 && c[3] >= OBJECT_ALPHA {
            (sum, count, low, high) = (sum + z, count + 1, low.min(z), high.max(z));
        }
    }
    let color = color.map(|c| (c / colored.max(1)) as u8);
    let whole = 2 * count >= step * step && high - low < edge * low;
    (if whole { sum / count as f32 } else { 0.0 }, color)
}

/// Logarithm of the brightness of a colour, 0 to 255.
pub(super) fn brightness([r, g, b]: [f32; 3]) -> f32 {
    // Dark pixels are noisy: 8 grey levels are added before the logarithm.
    (0.299 * r + 0.587 * g + 0.114 * b + 8.0).ln()
}

/// Normals from differences over two cells in each direction.
fn normals(points: &[Vec3], columns: usize, edge: f32) -> Vec<Vec3> {
    const REACH: usize = 2;
    let rows = points.len() / columns.max(1);
    let normal = |i: usize| {
        let (x, y) = (i % columns, i / columns);
        if x < REACH || y < REACH || x + REACH >= columns || y + REACH >= rows || points[i].z == 0.0 {
            return Vec3::ZERO;
        }
        let ends = [i - REACH, i + REACH, i - REACH * columns, i + REACH * columns].map(|j| points[j]);
        let p = points[i];
        // The bound is wide enough for oblique surfaces.
        if ends.iter().any(|e| e.z == 0.0 || (e.z - p.z).abs() > REACH as f32 * edge * p.z) {
            return Vec3::ZERO;
        }
        let normal = (ends[3] - ends[2]).cross(ends[1] - ends[0]).normalize_or_zero();
        if normal.dot(p) > 0.0 { -normal } else { normal }
    };
    (0..points.len()).map(normal).collect()
}

/// Up to `count` cells with normals, the same number from each of 26 directions where possible: a floor that fills the
/// image must not outweigh the surfaces that hold the other directions.
fn spread_samples(points: &[Vec3], normals: &[Vec3], count: usize) -> Vec<u32> {
    let mut bins: Vec<Vec<u32>> = vec![Vec::new(); 27];
    for (i, n) in normals.iter().enumerate() {
        if *n != Vec3::ZERO && points[i].z > 0.0 {
            let third = |v: f32| {
                if v < -0.4 {
                    0
                } else if v > 0.4 {
                    2
                } else {
                    1
                }
            };
            bins[third(n.x) * 9 + third(n.y) * 3 + third(n.z)].push(i as u32);
        }
    }
    bins.retain(|b| !b.is_empty());
    bins.sort_by_key(Vec::len);
    let mut chosen = Vec::with_capacity(count);
    let total = bins.len();
    for (i, bin) in bins.iter().enumerate() {
        let share = (count - chosen.len()) / (total - i);
        let stride = bin.len().div_ceil(share.max(1)).max(1);
        chosen.extend(bin.iter().step_by(stride));
    }
    chosen
}
