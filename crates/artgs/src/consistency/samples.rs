//! Coarse depth of some views, prepared so that cameras can be changed without reading the images again.

use artgs_core::capture::may_hold_object;
use artgs_core::{Camera, Rigid, View};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;
use serde::Serialize;

/// Views of a state that are compared at most.
const VIEWS: usize = 24;
/// Columns of the coarse depth.
const COLUMNS: usize = 160;
/// Points of a view that are carried into the others, about.
const POINTS: usize = 120;
/// Depth step between neighbouring cells that is an edge, as a share of the depth.
const EDGE: f64 = 0.04;

/// What a cell of a view shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Seen {
    /// Nothing is known: the object without depth, or an unmeasured place.
    Unknown,
    /// No object, by the mask.
    Background,
    /// A surface at this depth.
    Surface(f64),
}

/// One view.
pub(super) struct CoarseView {
    /// Camera whose pixels are the cells.
    pub(super) camera: Camera,
    /// Cells, row-major.
    pub(super) cells: Vec<Seen>,
    /// Cell centres with depth and the slopes of the depth from cell to cell, along columns and rows.
    pub(super) points: Vec<Point>,
    /// Number of cells with depth that have depth on four sides.
    pub(super) inner: usize,
    /// Number of them that are far from the straight line between their neighbours along a column or a row.
    pub(super) rough: usize,
}

/// A surface point of a view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    /// Cell coordinates of its centre.
    pub(super) at: DVec2,
    /// Depth.
    pub(super) depth: f64,
    /// Change of depth per cell along columns and rows.
    pub(super) slope: DVec2,
}

/// Some of the views with depth, spread over all of them.
pub(super) fn coarse_views<'v>(views: impl Iterator<Item = &'v View>) -> Vec<CoarseView> {
    let with_depth: Vec<&View> = views.filter(|v| v.depth.is_some()).collect();
    let count = with_depth.len().min(VIEWS);
    let chosen: Vec<&View> = (0..count).map(|i| with_depth[i * with_depth.len() / count]).collect();
    chosen.into_par_iter().map(CoarseView::new).collect()
}

impl CoarseView {
    pub(super) fn new(view: &View) -> Self {
        let width = view.size().0;
        let step = width.div_ceil(COLUMNS).max(1);
        let camera = view.camera.thinned(step);
        let (columns, rows) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
        let seen = |cell: usize| {
            let pixel = (cell / columns * step) * width + cell % columns * step;
            let depth = view.depth.as_ref().map_or(0.0, |d| d.at(pixel));
            match (may_hold_object(&view.rgba[pixel]), depth > 0.0) {
                (false, _) => Seen::Background,
                (true, true) => Seen::Surface(depth.into()),
                (true, false) => Seen::Unknown,
            }
        };
        let cells: Vec<Seen> = (0..columns * rows).map(seen).collect();
        let (points, inner, rough) = points(&cells, columns, rows);
        let stride = points.len().div_ceil(POINTS).max(1);
        // An odd stride does not stay in one column.
        let points = points.into_iter().step_by(stride | 1).collect();
        Self { camera, cells, points, inner, rough }
    }
}

/// Cells away from edges, the number of all cells with depth on four sides, and the number of rough ones.
fn points(cells: &[Seen], columns: usize, rows: usize) -> (Vec<Point>, usize, usize) {
    let (mut inner, mut rough) = (0, 0);
    let depth = |x: usize, y: usize| match cells[y * columns + x] {
        Seen::Surface(z) => Some(z),
        _ => None,
    };
    let mut point = |cell: usize| {
        let (x, y) = (cell % columns, cell / columns);
        if x == 0 || y == 0 || x + 1 >= columns || y + 1 >= rows {
            return None;
        }
        let z = depth(x, y)?;
        let [left, right, up, down] = [depth(x - 1, y)?, depth(x + 1, y)?, depth(x, y - 1)?, depth(x, y + 1)?];
        inner += 1;
        // A plane that is seen at a grazing angle has steps, but is straight.
        let bend = (left + right - 2.0 * z).abs().max((up + down - 2.0 * z).abs());
        rough += usize::from(bend > EDGE * z);
        let smooth = [left, right, up, down].into_iter().all(|d| (d - z).abs() < EDGE * z);
        let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
        smooth.then(|| Point { at, depth: z, slope: 0.5 * DVec2::new(right - left, down - up) })
    };
    let smooth = (0..cells.len()).filter_map(&mut point).collect();
    (smooth, inner, rough)
}

/// How a stated camera or depth may be read differently.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading {
    /// Changed poses.
    pub(super) pose: PoseReading,
    /// Factor of all depths.
    pub(super) depth: f64,
    /// Factor of all depths and camera positions.
    pub(super) scale: f64,
    /// Factor of the focal lengths.
    pub(super) focal: f64,
    /// Focal lengths and principal points of columns and rows change places.
    pub(super) swapped: bool,
    /// Depth is the distance along the ray, not along the optical axis.
    pub(super) along_ray: bool,
}

/// Readings of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PoseReading {
    /// As stated.
    Stated,
    /// The matrices have OpenCV axes (y down, looks along +z), not OpenGL axes.
    OpenCv,
    /// The matrices lead from the world to the camera, with OpenGL axes.
    WorldToCamera,
    /// The matrices lead from the world to the camera, with OpenCV axes.
    WorldToCameraOpenCv,
    /// The poses lead from the world to the camera where those of the format lead back, with the axes of the format.
    Inverted,
    /// The camera frame as it was read is this turn of the right one.
    Turned(AxisTurn),
}

/// A turn that takes axes to axes: for each axis of the result the axis that becomes it, and its sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct AxisTurn([(u8, bool); 3]);

impl AxisTurn {
    /// The turn that takes the camera frame of a robot (x forward, y left, z up) to that of OpenCV.
    pub(super) const ROBOT: Self = Self([(1, true), (2, true), (0, false)]);

    /// All 24 turns.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        const ORDERS: [[u8; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let turns = ORDERS
            .into_iter()
            .flat_map(|order| (0..8_u8).map(move |signs| Self([0, 1, 2].map(|i| (order[i], signs >> i & 1 == 1)))));
        turns.filter(|turn| turn.matrix().determinant() > 0.0)
    }

    pub(super) fn matrix(self) -> DMat3 {
        let axis = |(axis, negative): (u8, bool)| {
            let unit = [DVec3::X, DVec3::Y, DVec3::Z][usize::from(axis)];
            if negative { -unit } else { unit }
        };
        DMat3::from_cols(axis(self.0[0]), axis(self.0[1]), axis(self.0[2])).transpose()
    }

    /// The motion that applies it.
    fn motion(self) -> Rigid {
        Rigid::from_matrix(self.matrix(), DVec3::ZERO)
    }
}

impl Reading {
    /// What the capture states.
    pub(super) const STATED: Self =
        Self { pose: PoseReading::Stated, depth: 1.0, scale: 1.0, focal: 1.0, swapped: false, along_ray: false };

    /// World to camera, OpenCV axes. The reader took the stated matrix for camera-to-world with OpenGL axes.
    pub(super) fn pose_of(&self, camera: &Camera) -> Rigid {
        let stated = camera.world_to_camera;
        // Half a turn about x exchanges OpenGL and OpenCV axes.
        let flip = Rigid::about(DVec3::X, DVec3::ZERO, std::f64::consts::PI);
        let pose = match self.pose {
            PoseReading::Stated => stated,
            PoseReading::OpenCv => flip * stated,
            PoseReading::WorldToCamera => flip * stated.inverse() * flip,
            PoseReading::WorldToCameraOpenCv => stated.inverse() * flip,
            PoseReading::Inverted => stated.inverse(),
            PoseReading::Turned(turn) => turn.motion() * stated,
        };
        Rigid { translation: pose.translation * self.scale, ..pose }
    }

    /// Focal lengths and principal point, in cells.
    fn lens(&self, camera: &Camera) -> (DVec2, DVec2) {
        let k = &camera.intrinsics;
        let (f, c) = (DVec2::new(k.fx, k.fy) * self.focal, DVec2::new(k.cx, k.cy));
        if self.swapped { (DVec2::new(f.y, f.x), DVec2::new(c.y, c.x)) } else { (f, c) }
    }
}

/// A view under a reading.
pub(super) struct Posed<'a> {
    view: &'a CoarseView,
    /// World to camera.
    pub(super) to_camera: Rigid,
    focal: DVec2,
    center: DVec2,
    reading: Reading,
}

impl<'a> Posed<'a> {
    pub(super) fn new(view: &'a CoarseView, reading: Reading) -> Self {
        let (focal, center) = reading.lens(&view.camera);
        Self { view, to_camera: reading.pose_of(&view.camera), focal, center, reading }
    }

    /// Planar depth at a cell from the stored value.
    fn planar(&self, at: DVec2, stored: f64) -> f64 {
        let ray = (at - self.center) / self.focal;
        let length = if self.reading.along_ray { (1.0 + ray.length_squared()).sqrt() } else { 1.0 };
        self.reading.depth * self.reading.scale * stored / length
    }

    /// Its points and their normals towards the camera, in the camera's frame.
    pub(super) fn points(&self) -> impl Iterator<Item = (DVec3, DVec3)> + '_ {
        self.view.points.iter().map(|point| {
            let lift = |at: DVec2, stored: f64| {
                let ray = (at - self.center) / self.focal;
                ray.extend(1.0) * self.planar(at, stored)
            };
            let p = lift(point.at, point.depth);
            let across = lift(point.at + DVec2::X, point.depth + point.slope.x) - p;
            let down = lift(point.at + DVec2::Y, point.depth + point.slope.y) - p;
            let normal = across.cross(down).normalize_or_zero();
            (p, if normal.dot(p) > 0.0 { -normal } else { normal })
        })
    }

    /// What the view shows where a point in its frame is seen; none outside of the image and behind the camera.
    pub(super) fn looks_at(&self, p: DVec3) -> Option<Seen> {
        if p.z <= 0.0 {
            return None;
        }
        let at = self.focal * p.truncate() / p.z + self.center;
        let k = &self.view.camera.intrinsics;
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < f64::from(k.width) && at.y < f64::from(k.height);
        inside.then(|| match self.view.cells[at.y as usize * k.width as usize + at.x as usize] {
            Seen::Surface(z) => Seen::Surface(self.planar(at, z)),
            other => other,
        })
    }
}
