//! Depth where a sensor left it out, from surfaces that continue there and from what the other frames of the recording show.
//!
//! Depth cameras measure nothing at edges, at grazing angles and on dark or shiny surfaces; the photos show these places. Every
//! cell without depth is compared with the planes of measured cells around it, in its own frame and in the others. Other
//! frames see through a wrong plane, or have other colours where it would be.

use super::consistent::most_overlapping;
use super::frames::{DepthFrame, ray};
use crate::discover::plane_fit::fit_plane;
use glam::{Mat3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Completion of depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CompleteConfig {
    /// False: pixels without measured depth stay without.
    pub enabled: bool,
    /// Frames that a plane is compared with, those that see most of what the frame sees. More cost time.
    pub frames: usize,
    /// Farthest measured cell of the same frame whose plane may continue in a cell, cells.
    pub reach: usize,
    /// Mean difference of colours, 0 to 1, that speaks neither for nor against the same surface.
    pub color: f32,
    /// Least mean vote for a plane, -1 to 1. Raising it leaves more cells without depth.
    pub least_vote: f32,
}

impl Default for CompleteConfig {
    fn default() -> Self {
        Self { enabled: true, frames: 16, reach: 24, color: 0.08, least_vote: 0.2 }
    }
}

/// A plane that a cell shows, in the frame of its camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct CellPlane {
    /// A point in the middle of the measured ones of the plane: what a cell shows belongs to what this point belongs to.
    pub(crate) source: Vec3,
    /// Unit normal towards the camera; zero for none.
    pub(crate) normal: Vec3,
}

impl CellPlane {
    /// True if there is a plane.
    pub(crate) fn is_some(&self) -> bool {
        self.normal != Vec3::ZERO
    }

    /// Depth along a ray of depth 1; none where the ray misses the plane or grazes it.
    pub(crate) fn depth(&self, ray: Vec3) -> Option<f32> {
        /// Least cosine between ray and normal: a grazed plane says nothing about depth.
        const GRAZED: f32 = 0.05;
        let slope = self.normal.dot(ray);
        let depth = self.normal.dot(self.source) / slope;
        (slope < -GRAZED * ray.length() && depth > 0.0).then_some(depth)
    }
}

/// Planes of the cells of every frame of one recording: those that were measured, and those that complete them. `colors` are factors
/// that equalise the frames, `tolerance` the distance between surfaces of different frames that are the same, scene units.
pub(crate) fn cell_planes(
    frames: &[DepthFrame],
    colors: &[Vec3],
    tolerance: f32,
    config: &CompleteConfig,
) -> Vec<Vec<CellPlane>> {
    let measured: Vec<Vec<CellPlane>> = frames.par_iter().map(|frame| measured_planes(frame, tolerance)).collect();
    if !config.enabled {
        return measured.into_iter().map(|planes| vec![CellPlane::default(); planes.len()]).collect();
    }
    let images: Vec<Vec<Vec3>> = frames.iter().zip(colors).map(|(frame, gain)| equalised(frame, *gain)).collect();
    let complete = |i: usize| {
        let others = compared(frames, i, config.frames);
        let others: Vec<Other> = others.into_iter().map(|j| Other::new(frames, &measured, &images, i, j)).collect();
        let own = Own { frame: &frames[i], planes: &measured[i], image: &images[i], others, tolerance, config };
        own.completed()
    };
    (0..frames.len()).into_par_iter().map(complete).collect()
}

/// Colours of the cells, 0 to 1.
fn equalised(frame: &DepthFrame, gain: Vec3) -> Vec<Vec3> {
    frame.colors.iter().map(|c| Vec3::from(c.map(f32::from)) / 255.0 * gain).collect()
}

/// Plane of every cell with depth: a least-squares plane of the cells around it that agree with its normal. Cells beside an edge, which
/// have no normal, take the plane of a neighbour that they are on.
fn measured_planes(frame: &DepthFrame, tolerance: f32) -> Vec<CellPlane> {
    /// Radius of the window, cells.
    const RADIUS: usize = 4;
    /// Least cosine between normals of one plane.
    const ALIKE: f32 = 0.95;
    let columns = frame.columns();
    let window = |i: usize, radius: usize| window(i, radius, columns, frame.points.len());
    let fitted = |i: usize| {
        let (p, n) = (frame.points[i], frame.normals[i]);
        if n == Vec3::ZERO {
            return CellPlane::default();
        }
        let alike = |j: &usize| {
            let (q, m) = (frame.points[*j], frame.normals[*j]);
            q.z > 0.0 && m.dot(n) > ALIKE && n.dot(q - p).abs() < 2.0 * tolerance
        };
        let near: Vec<Vec3> = window(i, RADIUS).filter(alike).map(|j| frame.points[j]).collect();
        plane(&near, n).unwrap_or(CellPlane { source: p, normal: n })
    };
    let mut out: Vec<CellPlane> = (0..frame.points.len()).map(fitted).collect();
    let before = out.clone();
    for i in (0..out.len()).filter(|&i| frame.points[i].z > 0.0 && !before[i].is_some()) {
        let p = frame.points[i];
        let distance = |j: &usize| before[*j].normal.dot(p - before[*j].source).abs();
        let near = window(i, 2).filter(|j| before[*j].is_some());
        if let Some(j) = near.min_by(|a, b| distance(a).total_cmp(&distance(b))).filter(|j| distance(j) < tolerance) {
            out[i] = CellPlane { source: p, normal: before[j].normal };
        }
    }
    out
}

/// Cells at most `radius` columns and rows from one, of `cells` in rows of `columns`.
pub(super) fn window(cell: usize, radius: usize, columns: usize, cells: usize) -> impl Iterator<Item = usize> + Clone {
    let span = move |c: usize, size: usize| c.saturating_sub(radius)..(c + radius + 1).min(size);
    let (x, y) = (cell % columns, cell / columns);
    span(y, cells / columns).flat_map(move |y| span(x, columns).map(move |x| y * columns + x))
}

/// Least-squares plane of at least 12 points, facing as `towards` does.
fn plane(points: &[Vec3], towards: Vec3) -> Option<CellPlane> {
    if points.len() < 12 {
        return None;
    }
    let mean = points.iter().sum::<Vec3>() / points.len() as f32;
    let (normal, _) = fit_plane(&points.iter().map(|p| *p - mean).collect::<Vec<_>>());
    Some(CellPlane { source: mean, normal: if normal.dot(towards) < 0.0 { -normal } else { normal } })
}

/// Up to `count` frames that see much of what frame `i` sees. The frames that see most of it are next to it and show it from the same
/// place: every other one of twice as many.
fn compared(frames: &[DepthFrame], i: usize, count: usize) -> Vec<usize> {
    let most = most_overlapping(frames, i, 2 * count);
    let step = if most.len() == 2 * count { 2 } else { 1 };
    most.into_iter().step_by(step).take(count).collect()
}

/// Another frame, as seen from the frame that is completed.
struct Other<'a> {
    frame: &'a DepthFrame,
    planes: &'a [CellPlane],
    image: &'a [Vec3],
    /// From the camera of the frame that is completed to that of this one.
    turn: Mat3,
    shift: Vec3,
}

impl<'a> Other<'a> {
    fn new(
        frames: &'a [DepthFrame],
        planes: &'a [Vec<CellPlane>],
        images: &'a [Vec<Vec3>],
        own: usize,
        index: usize,
    ) -> Self {
        let motion = frames[index].camera.world_to_camera * frames[own].pose();
        Self {
            frame: &frames[index],
            planes: &planes[index],
            image: &images[index],
            turn: motion.matrix().as_mat3(),
            shift: motion.translation.as_vec3(),
        }
    }

    fn apply(&self, p: Vec3) -> Vec3 {
        self.turn * p + self.shift
    }

    /// Planes of this frame in the frame that is completed.
    fn planes_there(&self) -> impl Iterator<Item = CellPlane> + '_ {
        let back = self.turn.transpose();
        let there = move |p: &CellPlane| CellPlane { source: back * (p.source - self.shift), normal: back * p.normal };
        self.planes.iter().filter(|p| p.is_some()).map(there)
    }

    /// Colour at a point in the frame of this camera, interpolated between cells.
    fn color(&self, p: Vec3) -> Option<Vec3> {
        if p.z <= 0.0 {
            return None;
        }
        let k = &self.frame.camera.intrinsics;
        let (u, v) = (k.fx as f32 * p.x / p.z + k.cx as f32 - 0.5, k.fy as f32 * p.y / p.z + k.cy as f32 - 0.5);
        let (columns, rows) = (k.width as usize, k.height as usize);
        if u < 0.0 || v < 0.0 || u as usize + 1 >= columns || v as usize + 1 >= rows {
            return None;
        }
        let (x, y) = (u as usize, v as usize);
        let (fx, fy) = (u - x as f32, v - y as f32);
        let at = |x: usize, y: usize| self.image[y * columns + x];
        Some(at(x, y).lerp(at(x + 1, y), fx).lerp(at(x, y + 1).lerp(at(x + 1, y + 1), fx), fy))
    }
}

/// The frame that is completed.
struct Own<'a> {
    frame: &'a DepthFrame,
    planes: &'a [CellPlane],
    image: &'a [Vec3],
    others: Vec<Other<'a>>,
    tolerance: f32,
    config: &'a CompleteConfig,
}

/// A plane that may continue in a cell, and the weight of that, 0 to 1.
#[derive(Clone, Copy)]
struct Candidate {
    plane: CellPlane,
    depth: f32,
    prior: f32,
}

impl Own<'_> {
    fn completed(&self) -> Vec<CellPlane> {
        let seen = self.seen_by_others();
        let cell = |(i, measured): (usize, &CellPlane)| match measured.is_some() {
            true => *measured,
            false => self.best(i, &seen[i]).unwrap_or_default(),
        };
        self.planes.iter().enumerate().map(cell).collect()
    }

    /// Planes that other frames measured at each cell without depth.
    fn seen_by_others(&self) -> Vec<Vec<CellPlane>> {
        /// Planes of a cell that are kept.
        const MOST: usize = 48;
        let mut out = vec![Vec::new(); self.planes.len()];
        for other in &self.others {
            for plane in other.planes_there() {
                if let Some(cell) = self.frame.cell_of(plane.source.as_dvec3())
                    && !self.planes[cell].is_some()
                    && out[cell].len() < MOST
                {
                    out[cell].push(plane);
                }
            }
        }
        out
    }

    /// The nearest plane that is about as good as the best.
    fn best(&self, cell: usize, seen: &[CellPlane]) -> Option<CellPlane> {
        /// Share of the best vote that is enough for a plane in front of it, which hides it.
        const ALMOST: f32 = 0.8;
        let votes: Vec<(f32, Candidate)> =
            self.candidates(cell, seen).into_iter().map(|c| (self.vote(cell, &c), c)).collect();
        let best = votes.iter().map(|v| v.0).fold(f32::MIN, f32::max);
        let enough = (best - (1.0 - ALMOST) * best.abs()).max(self.config.least_vote);
        let good = votes.into_iter().filter(|v| v.0 >= enough);
        good.min_by(|a, b| a.1.depth.total_cmp(&b.1.depth)).map(|v| v.1.plane)
    }

    /// Planes that differ by more than the tolerance at the cell.
    fn candidates(&self, cell: usize, seen: &[CellPlane]) -> Vec<Candidate> {
        let ray = ray(&self.frame.camera, cell);
        let continued = self.around(cell).into_iter();
        let all = continued.chain(seen.iter().map(|plane| (*plane, 0.0)));
        let mut found: Vec<Candidate> =
            all.filter_map(|(plane, prior)| Some(Candidate { plane, prior, depth: plane.depth(ray)? })).collect();
        found.sort_by(|a, b| a.depth.total_cmp(&b.depth));
        let mut distinct: Vec<Candidate> = Vec::new();
        for next in found {
            match distinct.last_mut().filter(|last| next.depth - last.depth < 0.5 * self.tolerance) {
                Some(last) if next.prior > last.prior => *last = Candidate { depth: last.depth, ..next },
                Some(_) => {}
                None => distinct.push(next),
            }
        }
        distinct
    }

    /// Planes of the nearest measured cells in eight directions, with a prior that falls with the distance and the difference of colour.
    fn around(&self, cell: usize) -> Vec<(CellPlane, f32)> {
        const DIRECTIONS: [(isize, isize); 8] = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];
        let columns = self.frame.columns() as isize;
        let rows = self.planes.len() as isize / columns.max(1);
        let (x, y) = (cell as isize % columns, cell as isize / columns);
        let nearest = |(dx, dy): (isize, isize)| {
            (1..=self.config.reach as isize).find_map(|step| {
                let (x, y) = (x + dx * step, y + dy * step);
                let inside = x >= 0 && y >= 0 && x < columns && y < rows;
                let at = (y * columns + x) as usize;
                if !inside || !self.planes[at].is_some() {
                    return None;
                }
                let near = 1.0 - step as f32 / (self.config.reach + 1) as f32;
                let difference = (self.image[at] - self.image[cell]).abs().element_sum() / 3.0;
                Some((self.planes[at], near * (1.0 - difference / self.config.color).clamp(-1.0, 1.0)))
            })
        };
        DIRECTIONS.into_iter().filter_map(nearest).collect()
    }

    /// Mean vote of the other frames and of the prior for a plane in a cell, -1 to 1.
    fn vote(&self, cell: usize, candidate: &Candidate) -> f32 {
        /// Weight of a frame that sees through the plane.
        const THROUGH: f32 = 1.5;
        /// Weight of the colours of a frame that has no depth there.
        const UNMEASURED: f32 = 0.5;
        let point = ray(&self.frame.camera, cell) * candidate.depth;
        let (mut sum, mut weight) = (candidate.prior, 1.0);
        for other in &self.others {
            let q = other.apply(point);
            let Some(there) = other.frame.cell_of(q.as_dvec3()) else { continue };
            let measured = other.frame.points[there];
            let plane = other.planes[there];
            let share = if measured.z <= 0.0 {
                UNMEASURED
            } else {
                let along = measured.z - q.z;
                let off = if plane.is_some() { plane.normal.dot(q - plane.source) } else { along };
                if along > 3.0 * self.tolerance && off.abs() > 2.0 * self.tolerance {
                    sum -= THROUGH;
                    weight += THROUGH;
                    continue;
                }
                if along < 0.0 && off.abs() > 2.0 * self.tolerance {
                    continue;
                }
                1.0
            };
            if let Some(likeness) = self.likeness(cell, candidate, other) {
                sum += share * likeness;
                weight += share;
            }
        }
        sum / weight
    }

    /// How alike the colours of a plane are in both frames, -1 to 1.
    fn likeness(&self, cell: usize, candidate: &Candidate, other: &Other) -> Option<f32> {
        let (mut sum, mut count) = (0.0, 0);
        for at in window(cell, 1, self.frame.columns(), self.planes.len()) {
            let ray = ray(&self.frame.camera, at);
            let Some(depth) = candidate.plane.depth(ray) else { continue };
            let Some(color) = other.color(other.apply(ray * depth)) else { continue };
            sum += (self.image[at] - color).abs().element_sum() / 3.0;
            count += 1;
        }
        (count > 0).then(|| (1.0 - sum / count as f32 / self.config.color).clamp(-1.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::frames::GridConfig;
    use super::*;
    use artgs_core::{Camera, DepthMap, Intrinsics, View};
    use glam::{DVec2, DVec3};

    const SIZE: u32 = 96;

    /// A checked panel at z = 2, |x|, |y| < 0.4, before a wall at z = 3 with bars; `without` removes depth of pixels.
    fn frame(eye: DVec3, without: impl Fn(usize, usize) -> bool) -> DepthFrame {
        let s = f64::from(SIZE);
        let k = Intrinsics { fx: s, fy: s, cx: 0.5 * s, cy: 0.5 * s, width: SIZE, height: SIZE };
        let camera = Camera::look_at(k, eye, DVec3::new(0.0, 0.0, 2.5), -DVec3::Y);
        let mut depths = Vec::new();
        let mut rgba = Vec::new();
        for i in 0..(SIZE * SIZE) as usize {
            let (x, y) = (i % SIZE as usize, i / SIZE as usize);
            let direction = camera.unproject(DVec2::new(x as f64 + 0.5, y as f64 + 0.5), 1.0) - eye;
            let at = |z: f64| eye + direction * ((z - eye.z) / direction.z);
            let panel = at(2.0);
            let on_panel = panel.x.abs() < 0.4 && panel.y.abs() < 0.4;
            let p = if on_panel { panel } else { at(3.0) };
            let check = |v: f64| (v / 0.1).floor() as i64 & 1;
            let bright = if on_panel { check(p.x) ^ check(p.y) } else { check(p.x) };
            rgba.push(if on_panel {
                [180 + 50 * bright as u8, 60, 40, 255]
            } else {
                [40, 80 + 50 * bright as u8, 160, 255]
            });
            depths.push(if without(x, y) { 0.0 } else { camera.project(p).1 as f32 });
        }
        let view = View { name: String::new(), camera, rgba, depth: Some(DepthMap::nearest(&depths)), derived: None };
        DepthFrame::new(&view, 1.0, &GridConfig::default())
    }

    fn depth_at(frame: &DepthFrame, planes: &[CellPlane], x: usize, y: usize) -> Option<f32> {
        let cell = y * SIZE as usize + x;
        planes[cell].is_some().then(|| planes[cell].depth(ray(&frame.camera, cell))).flatten()
    }

    /// A band across both borders of the panel has no depth in the first frame. The panel reaches from column 29 to 66.
    #[test]
    fn surfaces_continue_to_where_photos_and_other_frames_end_them() {
        let band = |_: usize, y: usize| (40..56).contains(&y);
        let whole = |_: usize, _: usize| false;
        let eyes = [0.0, -0.5, 0.5, -0.3, 0.3, -0.15, 0.15].map(|x| DVec3::new(x, 0.1 * x, 0.0));
        let frames: Vec<DepthFrame> = eyes
            .iter()
            .enumerate()
            .map(|(i, eye)| if i == 0 { frame(*eye, band) } else { frame(*eye, whole) })
            .collect();
        let colors = vec![Vec3::ONE; frames.len()];
        let planes = cell_planes(&frames, &colors, 0.02, &CompleteConfig::default());
        let off = cell_planes(&frames, &colors, 0.02, &CompleteConfig { enabled: false, ..CompleteConfig::default() });
        let (mut panel, mut wall, mut wrong) = (0, 0, 0);
        for y in 42..54 {
            for x in (8..88).filter(|x| !(26..32).contains(x) && !(64..70).contains(x)) {
                assert_eq!(depth_at(&frames[0], &off[0], x, y), None);
                let expected = if (32..64).contains(&x) { 2.0 } else { 3.0 };
                match depth_at(&frames[0], &planes[0], x, y) {
                    Some(z) if (z - expected).abs() < 0.02 => {
                        *(if expected < 2.5 { &mut panel } else { &mut wall }) += 1
                    }
                    Some(_) => wrong += 1,
                    None => {}
                }
            }
        }
        assert!(panel > 370 && wall > 420 && wrong < 10, "{panel} of 384, {wall} of 432, {wrong} wrong");
    }

    #[test]
    fn a_surface_that_no_other_frame_confirms_ends_where_colours_change() {
        // The border of the panel is at column 67.
        let right = |x: usize, _: usize| x >= 58;
        let frames = [frame(DVec3::ZERO, right)];
        let planes = cell_planes(&frames, &[Vec3::ONE], 0.02, &CompleteConfig::default());
        assert!(
            depth_at(&frames[0], &planes[0], 63, 48).is_some_and(|z| (z - 2.0).abs() < 0.02),
            "the panel continues"
        );
        assert_eq!(depth_at(&frames[0], &planes[0], 70, 48), None, "beyond its border nothing is known");
    }
}
