//! A capture of the selected object: refined poses, masks from depth, images cut to the object.

use super::cloud::FusedCloud;
use super::complete::{CellPlane, window};
use super::consistent::factor_at;
use super::exposure::applied;
use super::frames::DepthFrame;
use super::object::Selection;
use super::outline::{Sides, changed};
use artgs_core::capture::{HIDDEN_ALPHA, OBJECT_ALPHA};
use artgs_core::{Camera, DepthMap, Intrinsics, PerState, RecordedFrame, Rigid, State, View};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What makes a view of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ExtractConfig {
    /// Pixels without depth take the label of a pixel at most this far away, in measured depth pixels.
    pub fill: f64,
    /// Cost of the outline of the object between two pixels of one colour, where no depth was measured, in pixels that change sides. Raising it
    /// makes outlines shorter and follow edges of the photo; 0 leaves pixels what they are taken for.
    pub outline: f32,
    /// Pixels around the object that are kept.
    pub margin: usize,
    /// Share of the object's surface that other things may hide before a frame is left out, 0 to 1.
    pub hidden: f64,
    /// Least share of an image that the object fills, 0 to 1.
    pub least_share: f64,
}

impl Default for ExtractConfig {
    fn default() -> Self {
        Self { fill: 3.0, outline: 15.0, margin: 8, hidden: 0.08, least_share: 0.01 }
    }
}

/// A frame whose pixels are labelled, and the box of the object in it: first and past-the-last column and row.
struct Labelled<'a> {
    recorded: &'a RecordedFrame,
    camera: Camera,
    colors: Vec3,
    depth: DepthMap,
    /// Depth of pixels where none was measured, 0 elsewhere.
    derived: DepthMap,
    labels: Vec<Label>,
    columns: [usize; 2],
    rows: [usize; 2],
}

/// Recorded and prepared frames of a state, with their factors of depth.
pub(crate) struct StateFrames<'a> {
    pub(crate) recorded: &'a [RecordedFrame],
    pub(crate) frames: &'a [DepthFrame],
    pub(crate) factors: &'a [Vec<f32>],
    /// What the cells of each frame show, also where no depth was measured.
    pub(crate) planes: &'a [Vec<CellPlane>],
    /// Factors of red, green and blue that equalise the exposure of each frame.
    pub(crate) colors: &'a [Vec3],
    /// Surface of the object in both states, one point per cube of edge `spacing`. A pixel without depth that may show what
    /// the other state shows must not count as empty.
    pub(crate) surface: &'a FusedCloud,
    pub(crate) spacing: f32,
}

/// Views of the object in all states, cut to one size. Frames in which other things hide it, or that hardly show it, are
/// left out.
pub(crate) fn views(
    states: &PerState<StateFrames<'_>>,
    selection: &Selection,
    config: &ExtractConfig,
) -> PerState<Vec<View>> {
    let labelled = states.as_ref().map(|s| {
        let visible = |i: &usize| hidden_share(&s.frames[*i], selection) <= config.hidden;
        let label = |i: usize| Labelled::new(s, i, selection, config);
        (0..s.recorded.len()).into_par_iter().filter(visible).filter_map(label).collect::<Vec<_>>()
    });
    let all = || labelled.iter().flatten();
    let most = |extent: fn(&Labelled<'_>) -> usize| all().map(extent).max().unwrap_or(0) + 2 * config.margin;
    let smallest = |size: fn(&Labelled<'_>) -> usize| all().map(size).min().unwrap_or(0);
    let width = most(|l| l.columns[1] - l.columns[0]).min(smallest(|l| l.recorded.view.size().0));
    let height = most(|l| l.rows[1] - l.rows[0]).min(smallest(|l| l.recorded.view.size().1));
    PerState::from_fn(|state| labelled[state].par_iter().map(|l| l.cut(state, width, height)).collect())
}

/// A surface this much nearer than a point, relative to its depth, is in front of it.
const FRONT: f64 = 0.05;

/// Share of the object's points in the image that something else is in front of.
fn hidden_share(frame: &DepthFrame, selection: &Selection) -> f64 {
    /// Every so many points are tested.
    const STRIDE: usize = 5;
    let (mut hidden, mut total) = (0, 0);
    let pose = frame.pose();
    for p in selection.cloud.points.iter().step_by(STRIDE) {
        let q = frame.camera.world_to_camera.apply(p.as_dvec3());
        let Some(cell) = frame.cell_of(q) else { continue };
        total += 1;
        let surface = frame.points[cell].as_dvec3();
        let front = surface.z > 0.0 && surface.z < q.z * (1.0 - FRONT);
        hidden += usize::from(front && !selection.contains(pose.apply(surface)));
    }
    if total == 0 { 1.0 } else { f64::from(hidden as u32) / f64::from(total as u32) }
}

/// Label of a pixel.
#[derive(Clone, Copy, PartialEq)]
enum Label {
    Unknown,
    Object,
    Other,
    /// Something else in front of the object, or nothing that is known.
    Hidden,
}

impl<'a> Labelled<'a> {
    /// None if the object fills less than the least share of the image.
    fn new(state: &StateFrames<'a>, index: usize, selection: &Selection, config: &ExtractConfig) -> Option<Self> {
        let (recorded, frame, factors) = (&state.recorded[index], &state.frames[index], &state.factors[index]);
        let width = recorded.view.size().0;
        let depth = corrected(recorded.view.depth.as_ref()?, width, frame, factors);
        let camera = Camera { world_to_camera: frame.camera.world_to_camera, ..recorded.view.camera };
        let mut labels = labels(&camera, &depth, &recorded.view.rgba, selection);
        let derived = derive(&mut labels, recorded, &camera, frame, &state.planes[index], (selection, config));
        let reach = (config.fill * recorded.depth_step).ceil() as usize;
        let farthest = farthest(&camera, state.surface, state.spacing);
        doubt(&mut labels, &derived, &enclosed(&farthest, width));
        hide(&mut labels, &depth, &farthest, width, reach);
        cover(&mut labels, &farthest);
        let derived = fill(&mut labels, &depth, derived, width, reach);
        let (mut count, mut columns, mut rows) = (0, [width, 0], [usize::MAX, 0]);
        for i in (0..labels.len()).filter(|&i| labels[i] == Label::Object) {
            let (x, y) = (i % width, i / width);
            count += 1;
            columns = [columns[0].min(x), columns[1].max(x + 1)];
            rows = [rows[0].min(y), rows[1].max(y + 1)];
        }
        let large = count as f64 >= config.least_share * labels.len().max(1) as f64;
        (large && count > 0).then_some(Self {
            recorded,
            camera,
            colors: state.colors[index],
            depth,
            derived,
            labels,
            columns,
            rows,
        })
    }

    /// The window of this size around the object; it stays in the image.
    fn cut(&self, state: State, width: usize, height: usize) -> View {
        let (source, size) = (&self.recorded.view, self.recorded.view.size());
        let start = |[from, to]: [usize; 2], window: usize, image: usize| {
            ((from + to) / 2).saturating_sub(window / 2).min(image - window)
        };
        let (x0, y0) = (start(self.columns, width, size.0), start(self.rows, height, size.1));
        let pixels = || (y0..y0 + height).flat_map(move |y| (x0..x0 + width).map(move |x| y * size.0 + x));
        let object = |i: usize| self.labels[i] == Label::Object;
        let color = |i: usize| {
            let [r, g, b, _] = applied(source.rgba[i], self.colors);
            let alpha = match self.labels[i] {
                Label::Object => 255,
                Label::Hidden => HIDDEN_ALPHA,
                _ => 0,
            };
            [r, g, b, alpha]
        };
        let measured = pixels().map(|i| if object(i) { self.depth.counts()[i] } else { 0 }).collect();
        let k = self.camera.intrinsics;
        let intrinsics =
            Intrinsics { cx: k.cx - x0 as f64, cy: k.cy - y0 as f64, width: width as u32, height: height as u32, ..k };
        View {
            name: format!("{}/{}", state.name(), source.name),
            camera: Camera { intrinsics, ..self.camera },
            rgba: pixels().map(color).collect(),
            depth: Some(DepthMap::new(measured, self.depth.per_unit())),
            derived: Some(self.derived.select(pixels())),
        }
    }
}

/// Depth with the factors of its cells, in finer counts.
fn corrected(depth: &DepthMap, width: usize, frame: &DepthFrame, factors: &[f32]) -> DepthMap {
    let step = width as f64 / frame.columns().max(1) as f64;
    let step = step.floor().max(1.0);
    let depths: Vec<f32> = depth
        .iter()
        .enumerate()
        .map(|(i, z)| {
            let (u, v) = (((i % width) as f64 + 0.5) / step, ((i / width) as f64 + 0.5) / step);
            if z > 0.0 { z * factor_at(factors, frame.columns(), u, v) } else { 0.0 }
        })
        .collect();
    DepthMap::nearest(&depths)
}

/// Labels of pixels with depth, and of those outside of a recorded mask.
fn labels(camera: &Camera, depth: &DepthMap, rgba: &[[u8; 4]], selection: &Selection) -> Vec<Label> {
    let pose = camera.world_to_camera.inverse();
    let k = &camera.intrinsics;
    let width = k.width as usize;
    let label = |(i, z): (usize, f32)| {
        if rgba[i][3] < OBJECT_ALPHA {
            return Label::Other;
        }
        if z == 0.0 {
            return Label::Unknown;
        }
        let z = f64::from(z);
        let (u, v) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        let p = pose.apply(glam::DVec3::new((u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z));
        if selection.contains(p) { Label::Object } else { Label::Other }
    };
    depth.iter().enumerate().map(label).collect()
}

/// Depth of pixels without measured depth: that of the plane of one of the cells around them whose colour is most like theirs. Their
/// labels are those of the planes, then the outline of the object moves to edges of the photo.
fn derive(
    labels: &mut [Label],
    recorded: &RecordedFrame,
    camera: &Camera,
    frame: &DepthFrame,
    planes: &[CellPlane],
    (selection, config): (&Selection, &ExtractConfig),
) -> DepthMap {
    /// Farthest cell whose plane a pixel takes that changes sides, columns and rows.
    const NEARBY: usize = 6;
    let width = recorded.view.size().0;
    let rgba = &recorded.view.rgba;
    let mut depths = vec![0.0; labels.len()];
    let free: Vec<bool> = labels.iter().map(|label| *label == Label::Unknown && !planes.is_empty()).collect();
    let shown = Shown::new(rgba, camera, frame, planes, selection);
    for i in (0..labels.len()).filter(|&i| free[i]) {
        if let Some((depth, is_object)) = shown.at(i, 1, |_| true) {
            depths[i] = depth;
            labels[i] = if is_object { Label::Object } else { Label::Other };
        }
    }
    let of_label = |label: &Label| match label {
        Label::Object => Some(true),
        Label::Other => Some(false),
        _ => None,
    };
    let shows_object: Vec<Option<bool>> = labels.iter().map(of_label).collect();
    for i in changed(&Sides { shows_object: &shows_object, free: &free, rgba, width }, config.outline) {
        let is_object = labels[i] != Label::Object;
        labels[i] = if is_object { Label::Object } else { Label::Other };
        // A background without a plane keeps its depth: one that was not measured hardly carves.
        match (1..=NEARBY).find_map(|radius| shown.at(i, radius, |object| object == is_object)) {
            Some((depth, _)) => depths[i] = depth,
            None if is_object => depths[i] = 0.0,
            None => {}
        }
    }
    DepthMap::nearest(&depths)
}

/// What pixels of an image show by the planes of the cells around them.
struct Shown<'a> {
    rgba: &'a [[u8; 4]],
    camera: &'a Camera,
    pose: Rigid,
    frame: &'a DepthFrame,
    planes: &'a [CellPlane],
    /// True for cells whose plane is of the object.
    belongs: Vec<bool>,
    /// Pixels per cell along a row or a column.
    step: usize,
    selection: &'a Selection,
}

impl<'a> Shown<'a> {
    fn new(
        rgba: &'a [[u8; 4]],
        camera: &'a Camera,
        frame: &'a DepthFrame,
        planes: &'a [CellPlane],
        selection: &'a Selection,
    ) -> Self {
        let pose = camera.world_to_camera.inverse();
        let step = (camera.intrinsics.fx / frame.camera.intrinsics.fx).round().max(1.0) as usize;
        let belongs =
            planes.iter().map(|p| p.is_some() && selection.contains(pose.apply(p.source.as_dvec3()))).collect();
        Self { rgba, camera, pose, frame, planes, belongs, step, selection }
    }

    /// Depth of a pixel and whether it shows the object, by the plane of the cell at most `radius` columns and rows away whose colour is most
    /// like its own, of those that may be, by whether they are of the object.
    fn at(&self, pixel: usize, radius: usize, may_be: impl Fn(bool) -> bool) -> Option<(f32, bool)> {
        let (k, columns) = (&self.camera.intrinsics, self.frame.columns());
        let (x, y) = (pixel % k.width as usize, pixel / k.width as usize);
        // Pixels beyond the last whole cell belong to it.
        let rows = self.planes.len() / columns.max(1);
        let cell = (y / self.step).min(rows - 1) * columns + (x / self.step).min(columns - 1);
        let color = |rgb: &[u8]| Vec3::from(std::array::from_fn(|c| f32::from(rgb[c])));
        let own = color(&self.rgba[pixel]);
        let difference = |cell: &usize| color(&self.frame.colors[*cell]).distance_squared(own);
        let shown = window(cell, radius, columns, self.planes.len());
        let shown = shown.filter(|cell| self.planes[*cell].is_some() && may_be(self.belongs[*cell]));
        let cell = shown.min_by(|a, b| difference(a).total_cmp(&difference(b)))?;
        let ray = Vec3::new(((x as f64 + 0.5 - k.cx) / k.fx) as f32, ((y as f64 + 0.5 - k.cy) / k.fy) as f32, 1.0);
        let depth = self.planes[cell].depth(ray)?;
        let is_within = self.selection.is_within_given(self.pose.apply((ray * depth).as_dvec3()));
        Some((depth, self.belongs[cell] && is_within))
    }
}

/// Depth of the farthest surface of the object at each pixel, as other frames see it; 0 where there is none.
fn farthest(camera: &Camera, surface: &FusedCloud, spacing: f32) -> Vec<f32> {
    /// Radius of a point's disc, cubes: discs of neighbouring cubes overlap, and outlines grow little.
    const RADIUS: f64 = 0.6;
    let k = &camera.intrinsics;
    let mut out = vec![0.0f32; k.width as usize * k.height as usize];
    for point in &surface.points {
        let (center, z) = camera.project(point.as_dvec3());
        if z <= 0.0 {
            continue;
        }
        let radius = RADIUS * f64::from(spacing) * k.fx / z;
        let range = |c: f64, size: u32| {
            let (from, to) = ((c - radius).ceil().max(0.0), (c + radius).floor().min(f64::from(size) - 1.0));
            if from <= to { from as usize..to as usize + 1 } else { 0..0 }
        };
        for y in range(center.y - 0.5, k.height) {
            for x in range(center.x - 0.5, k.width) {
                let farthest = &mut out[y * k.width as usize + x];
                *farthest = farthest.max(z as f32);
            }
        }
    }
    out
}

/// A background that was not measured and that the object surrounds is unknown: a wrong one would take the object there for empty, and
/// discovery turned the door of an oven over.
fn doubt(labels: &mut [Label], derived: &DepthMap, enclosed: &[f32]) {
    for ((label, derived), far) in labels.iter_mut().zip(derived.counts()).zip(enclosed) {
        if *label == Label::Other && *derived > 0 && *far > 0.0 {
            *label = Label::Hidden;
        }
    }
}

/// Pixels that show something else in front of the surface of the object, and those without depth beside them where that surface
/// is, hide the object.
fn hide(labels: &mut [Label], depth: &DepthMap, farthest: &[f32], width: usize, reach: usize) {
    for ((label, z), far) in labels.iter_mut().zip(depth.iter()).zip(enclosed(farthest, width)) {
        if *label == Label::Other && z > 0.0 && f64::from(z) < f64::from(far) * (1.0 - FRONT) {
            *label = Label::Hidden;
        }
    }
    let front = (0..labels.len()).filter(|&i| labels[i] == Label::Hidden).collect();
    spread(labels, front, width, reach, |i| farthest[i] > 0.0);
}

/// Depths with those of pixels that have others to the left, to the right, above and below them: the least of the largest depths on
/// these sides. No frame may see what is behind a thing that stands before the object.
fn enclosed(depths: &[f32], width: usize) -> Vec<f32> {
    let mut out = vec![f32::INFINITY; depths.len()];
    let mut largest_so_far = |line: &mut dyn Iterator<Item = usize>| {
        let mut largest = 0.0f32;
        for i in line {
            largest = largest.max(depths[i]);
            out[i] = out[i].min(largest);
        }
    };
    for row in (0..depths.len()).step_by(width.max(1)) {
        largest_so_far(&mut (row..row + width));
        largest_so_far(&mut (row..row + width).rev());
    }
    for column in 0..width {
        largest_so_far(&mut (column..depths.len()).step_by(width));
        largest_so_far(&mut (column..depths.len()).step_by(width).rev());
    }
    out.iter_mut().zip(depths).for_each(|(out, depth)| *out = out.max(*depth));
    out
}

/// Unknown pixels at which the surface of the object lies show the object.
fn cover(labels: &mut [Label], farthest: &[f32]) {
    for (label, _) in labels.iter_mut().zip(farthest).filter(|(l, z)| **l == Label::Unknown && **z > 0.0) {
        *label = Label::Object;
    }
}

/// Gives unknown pixels the label of the nearest known pixel within `reach` steps along rows and columns. Nothing is known of others:
/// the object may be there. Returns the derived depth with that of backgrounds which got their label so: they were not measured.
fn fill(labels: &mut [Label], depth: &DepthMap, derived: DepthMap, width: usize, reach: usize) -> DepthMap {
    let front = (0..labels.len()).filter(|&i| labels[i] != Label::Unknown).collect();
    let given = spread(labels, front, width, reach, |_| true);
    labels.iter_mut().filter(|l| **l == Label::Unknown).for_each(|l| *l = Label::Hidden);
    let mut out: Vec<f32> = derived.iter().collect();
    for [from, to] in given {
        if labels[to] == Label::Other {
            out[to] = if depth.at(from) > 0.0 { depth.at(from) } else { out[from] };
        }
    }
    DepthMap::nearest(&out)
}

/// Carries the labels of the pixels `front` to unknown pixels that may have them, `reach` steps along rows and columns. Returns each such
/// pixel after the one beside it that gave it the label.
fn spread(
    labels: &mut [Label],
    mut front: Vec<usize>,
    width: usize,
    reach: usize,
    may: impl Fn(usize) -> bool,
) -> Vec<[usize; 2]> {
    let mut given = Vec::new();
    for _ in 0..reach {
        let mut next = Vec::new();
        let mut set = Vec::new();
        for &i in &front {
            let x = i % width;
            let around = [
                (x > 0).then(|| i - 1),
                (x + 1 < width).then_some(i + 1),
                i.checked_sub(width),
                Some(i + width).filter(|j| *j < labels.len()),
            ];
            for j in around.into_iter().flatten() {
                if labels[j] == Label::Unknown && may(j) {
                    set.push([i, j]);
                }
            }
        }
        for [i, j] in set {
            if labels[j] == Label::Unknown {
                labels[j] = labels[i];
                given.push([i, j]);
                next.push(j);
            }
        }
        front = next;
    }
    given
}

#[cfg(test)]
mod tests {
    use super::*;
    use Label::{Hidden, Object, Other, Unknown};

    #[test]
    fn pixels_in_front_of_the_object_hide_it() {
        // A row through the object at depth 2: background, object, a thing at depth 1 with an edge without depth on either side,
        // and a place behind it that no frame sees; above and below, the object fills the rows.
        let width = 8;
        let middle = [Other, Object, Unknown, Other, Other, Unknown, Object, Other];
        let depths = [4.0, 2.0, 0.0, 1.0, 1.0, 0.0, 2.0, 1.0];
        let full = [Other, Object, Object, Object, Object, Object, Object, Other];
        let full_depths = [4.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 4.0];
        let mut labels = [full, middle, full].concat();
        let depth = DepthMap::nearest(&[full_depths, depths, full_depths].concat());
        let known = [0.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 0.0];
        let farthest = [known, [0.0, 2.0, 2.0, 0.0, 2.0, 2.0, 2.0, 0.0], known].concat();
        hide(&mut labels, &depth, &farthest, width, 1);
        assert!(labels[width..2 * width] == [Other, Object, Hidden, Hidden, Hidden, Hidden, Object, Other]);
        // A background without depth of its own is in front of nothing.
        let mut seen_through = vec![Object, Other, Object];
        hide(&mut seen_through, &DepthMap::nearest(&[2.0, 0.0, 2.0]), &[2.0; 3], 3, 1);
        assert!(seen_through == [Object, Other, Object]);
        doubt(&mut seen_through, &DepthMap::nearest(&[0.0, 3.0, 0.0]), &[2.0; 3]);
        assert!(seen_through == [Object, Hidden, Object], "but the object may be there");
        let mut outside = vec![Other, Other];
        doubt(&mut outside, &DepthMap::nearest(&[3.0, 0.0]), &[0.0, 2.0]);
        assert!(outside == [Other, Other], "outside of the outline, and where nothing was derived");
        assert!(labels[..width] == full && labels[2 * width..] == full);
    }

    #[test]
    fn pixels_without_depth_show_the_object_where_other_frames_see_it() {
        let mut labels = vec![Other, Unknown, Unknown, Unknown, Object];
        cover(&mut labels, &[0.0, 0.0, 0.0, 2.0, 2.0]);
        let none = || DepthMap::nearest(&[0.0; 5]);
        let derived = fill(&mut labels, &DepthMap::nearest(&[4.0, 0.0, 0.0, 0.0, 2.0]), none(), 5, 1);
        assert!(labels == [Other, Other, Object, Object, Object]);
        assert_eq!(derived.iter().collect::<Vec<_>>(), [0.0, 4.0, 0.0, 0.0, 0.0], "a background that was not measured");
        let mut far = vec![Object, Unknown, Unknown, Unknown, Other];
        fill(&mut far, &none(), none(), 5, 1);
        assert!(far == [Object, Object, Hidden, Other, Other], "nothing is known beyond the reach");
    }
}
