//! Statistics of a capture: as text (`Display`) and as JSON (`Serialize`).

use artgs_core::{Camera, Capture, DepthMap, PerState, State, View};
use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;
use serde::Serialize;
use std::fmt;

/// Stride in x and y, pixels, at which depth is sampled for bounding boxes.
const STRIDE: usize = 2;

/// An axis-aligned box in the world frame, scene units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: DVec3,
    /// Largest coordinates.
    pub max: DVec3,
}

impl Bounds {
    /// Smallest box around points; none without points.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Option<Self> {
        points
            .into_iter()
            .fold(None, |b, p| Some(b.map_or(Self { min: p, max: p }, |b| b.union(&Self { min: p, max: p }))))
    }

    /// Smallest box around both.
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Intersection over union of the volumes, [0, 1]; 0 for boxes without volume.
    pub fn shared_volume(&self, other: &Self) -> f64 {
        let volume = |size: DVec3| size.max(DVec3::ZERO).element_product();
        let common = volume(self.max.min(other.max) - self.min.max(other.min));
        let both = volume(self.max - self.min) + volume(other.max - other.min) - common;
        if both > 0.0 { common / both } else { 0.0 }
    }

    /// True if the boxes intersect.
    pub fn intersects(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }
}

/// Statistics of a capture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CaptureSummary {
    /// Start and end.
    #[serde(with = "artgs_core::state::array")]
    pub states: PerState<StateSummary>,
    /// Intersection over union of the object boxes of both states, [0, 1]; none without depth.
    pub shared_volume: Option<f64>,
    /// Distance between the visual centres of the training cameras of both states, scene units.
    pub gaze_distance: Option<f64>,
    /// Largest distance of a training camera from their mean, scene units.
    pub camera_extent: f64,
    /// Warnings.
    pub warnings: Vec<String>,
}

/// One state.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StateSummary {
    /// `start` or `end`.
    pub name: String,
    /// Training views.
    pub train: SplitSummary,
    /// Held-out views.
    pub test: SplitSummary,
    /// Box of the back-projected training depth; none without depth.
    pub object_box: Option<Bounds>,
    /// Nearest and farthest training camera from the object: the centre of its box, else the visual centre.
    pub camera_distance: Option<[f64; 2]>,
}

/// Views of one state and split.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SplitSummary {
    /// Number of views.
    pub views: usize,
    /// Distinct image sizes, width and height in pixels.
    pub image_sizes: Vec<[usize; 2]>,
    /// Horizontal and vertical field of view of the first view, degrees.
    pub field_of_view_deg: Option<[f64; 2]>,
    /// Mean fraction of pixels with alpha of at least one half.
    pub mask_coverage: f64,
    /// Depth, if any view has it.
    pub depth: Option<DepthSummary>,
}

/// Depth of one state and split.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DepthSummary {
    /// Views with depth.
    pub views: usize,
    /// Nearest and farthest, scene units.
    pub range: [f64; 2],
    /// Fraction of the object's pixels (in views with depth) that have depth.
    pub valid_fraction: f64,
}

/// Computes the statistics of a capture.
pub fn summarize(capture: &Capture) -> CaptureSummary {
    let summary = |state: State| {
        let views = &capture.states[state];
        let object_box = depth_bounds(&views.train);
        let center =
            object_box.map(|b| (b.min + b.max) * 0.5).or(visual_center(cameras_of(&views.train)).map(|c| c.point));
        StateSummary {
            name: state.name().into(),
            train: summarize_split(&views.train),
            test: summarize_split(&views.test),
            object_box,
            camera_distance: center.and_then(|c| range(views.train.iter().map(|v| (v.camera.position() - c).length()))),
        }
    };
    let states = PerState::from_fn(summary);
    let boxes = PerState::try_from_fn(|state| states[state].object_box);
    let gaze = PerState::try_from_fn(|state| visual_center(cameras_of(&capture.states[state].train)));
    CaptureSummary {
        states,
        shared_volume: boxes.map(|b| b[State::START].shared_volume(&b[State::END])),
        gaze_distance: gaze.map(|c| (c[State::START].point - c[State::END].point).length()),
        camera_extent: capture.camera_extent(),
        warnings: capture.warnings.clone(),
    }
}

fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    values.fold(None, |r, v| Some(r.map_or([v, v], |[a, b]: [f64; 2]| [a.min(v), b.max(v)])))
}

fn summarize_split(views: &[View]) -> SplitSummary {
    let mut image_sizes: Vec<[usize; 2]> = views.iter().map(|v| v.size().into()).collect();
    image_sizes.sort_unstable();
    image_sizes.dedup();
    let field_of_view_deg = views.first().map(|v| {
        let k = &v.camera.intrinsics;
        [(k.width, k.fx), (k.height, k.fy)].map(|(n, f)| 2.0 * (f64::from(n) / (2.0 * f)).atan().to_degrees())
    });
    let coverage: f64 = views.iter().map(|v| object_pixels(v) as f64 / v.rgba.len().max(1) as f64).sum();
    SplitSummary {
        views: views.len(),
        image_sizes,
        field_of_view_deg,
        mask_coverage: coverage / views.len().max(1) as f64,
        depth: summarize_depth(views),
    }
}

fn object_pixels(view: &View) -> usize {
    view.rgba.iter().filter(|p| p[3] >= artgs_core::capture::OBJECT_ALPHA).count()
}

fn summarize_depth(views: &[View]) -> Option<DepthSummary> {
    let with: Vec<(&View, &DepthMap)> = views.iter().filter_map(|v| Some((v, v.depth.as_ref()?))).collect();
    let values = || with.iter().flat_map(|(_, d)| d.iter()).filter(|d| *d > 0.0).map(f64::from);
    let object: usize = with.iter().map(|(v, _)| object_pixels(v)).sum();
    Some(DepthSummary {
        views: with.len(),
        range: range(values())?,
        valid_fraction: values().count() as f64 / object.max(1) as f64,
    })
}

/// Box of the back-projected depth of every other pixel; none without depth.
pub fn depth_bounds(views: &[View]) -> Option<Bounds> {
    let of_view = |view: &View| {
        let (depth, (w, _)) = (view.depth.as_ref()?, view.size());
        let camera_to_world = view.camera.world_to_camera.inverse();
        let (turn, eye, k) = (camera_to_world.matrix(), camera_to_world.translation, view.camera.intrinsics);
        let seen = depth.iter().enumerate().filter(|(i, d)| *d > 0.0 && i % w % STRIDE == 0 && i / w % STRIDE == 0);
        Bounds::of(seen.map(|(i, d)| {
            let pixel = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
            let ray = DVec3::new((pixel.x - k.cx) / k.fx, (pixel.y - k.cy) / k.fy, 1.0);
            turn * (ray * f64::from(d)) + eye
        }))
    };
    let boxes: Vec<Option<Bounds>> = views.par_iter().map(of_view).collect();
    boxes.into_iter().flatten().reduce(|a, b| a.union(&b))
}

/// The cameras of views.
pub fn cameras_of(views: &[View]) -> impl Iterator<Item = &Camera> + Clone {
    views.iter().map(|view| &view.camera)
}

/// The common point at which cameras look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisualCenter {
    /// The point nearest to all optical axes in the least-squares sense, world frame.
    pub point: DVec3,
    /// Mean distance of the cameras to it, scene units.
    pub mean_distance: f64,
}

/// Solves `sum (I - d d^T) (x - eye) = 0`; none if the optical axes are parallel.
pub fn visual_center<'a>(cameras: impl Iterator<Item = &'a Camera> + Clone) -> Option<VisualCenter> {
    let (mut a, mut b) = (DMat3::ZERO, DVec3::ZERO);
    for camera in cameras.clone() {
        let to_world = camera.world_to_camera.inverse();
        let d = to_world.turn(DVec3::Z);
        let across = DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        a += across;
        b += across * to_world.translation;
    }
    let n = cameras.clone().count() as f64;
    if a.determinant() < 1e-9 * n.powi(3) || n == 0.0 {
        return None;
    }
    let point = a.inverse() * b;
    let mean_distance = cameras.map(|camera| (camera.position() - point).length()).sum::<f64>() / n;
    Some(VisualCenter { point, mean_distance })
}

impl fmt::Display for CaptureSummary {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for state in &self.states {
            writeln!(f, "state {}", state.name)?;
            write_split(f, "train", &state.train)?;
            write_split(f, "test", &state.test)?;
            if let Some(b) = &state.object_box {
                writeln!(f, "  object box       {:.3} to {:.3}, size {:.3}", b.min, b.max, b.max - b.min)?;
            }
            if let Some([near, far]) = state.camera_distance {
                writeln!(f, "  camera distance  {near:.3} to {far:.3}")?;
            }
        }
        writeln!(f, "camera extent      {:.3}", self.camera_extent)?;
        if let Some(share) = self.shared_volume {
            writeln!(f, "overlap of states  their object boxes share {:.1} % of their volume", 100.0 * share)?;
        } else if let Some(distance) = self.gaze_distance {
            writeln!(f, "overlap of states  their cameras look at points {distance:.3} apart")?;
        }
        self.warnings.iter().try_for_each(|w| writeln!(f, "warning: {w}"))
    }
}

fn write_split(f: &mut fmt::Formatter, name: &str, split: &SplitSummary) -> fmt::Result {
    if split.views == 0 {
        return writeln!(f, "  {name:<5} no views");
    }
    let sizes: Vec<String> = split.image_sizes.iter().map(|[w, h]| format!("{w}x{h}")).collect();
    write!(f, "  {name:<5} {} views, {}", split.views, sizes.join(" and "))?;
    if let Some([x, y]) = split.field_of_view_deg {
        write!(f, ", field of view {x:.1} x {y:.1} deg")?;
    }
    writeln!(f, ", object on {:.1} % of the pixels", 100.0 * split.mask_coverage)?;
    match &split.depth {
        None if name == "train" => writeln!(f, "        no depth"),
        None => Ok(()),
        Some(d) => {
            let [near, far] = d.range;
            let valid = 100.0 * d.valid_fraction;
            writeln!(f, "        depth in {} views, {near:.3} to {far:.3}, on {valid:.1} % of the object", d.views)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_volume_is_intersection_over_union() {
        let cube = |at: f64, size: f64| Bounds { min: DVec3::splat(at), max: DVec3::splat(at + size) };
        assert_eq!(cube(0.0, 2.0).shared_volume(&cube(0.0, 2.0)), 1.0);
        assert!((cube(0.0, 2.0).shared_volume(&cube(1.0, 2.0)) - 1.0 / 15.0).abs() < 1e-12);
        assert_eq!(cube(0.0, 1.0).shared_volume(&cube(3.0, 1.0)), 0.0);
        assert_eq!(cube(0.0, 0.0).shared_volume(&cube(0.0, 0.0)), 0.0);
    }
}
