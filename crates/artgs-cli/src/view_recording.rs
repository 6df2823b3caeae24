//! The page of a recording of one state: its cameras, its surface points, and the box of the object.

use crate::args::RecordingArgs;
use crate::failure::Failure;
use crate::output::note;
use crate::pages::{camera_views, name_of};
use crate::recordings;
use crate::style::Style;
use anyhow::Context;
use artgs::align::ObjectBox;
use artgs_core::capture::OBJECT_ALPHA;
use artgs_core::{State, View};
use artgs_io::BoxBounds;
use artgs_io::image_io::write_rgb;
use artgs_io::recording::load_recording;
use artgs_io::summary::{cameras_of, visual_center};
use artgs_view::{Cloud, Page, Placement, SceneBox};
use glam::{DQuat, DVec2, DVec3};
use std::collections::HashMap;
use std::path::Path;

/// Pixels of a row whose depth is used.
const COLUMNS: usize = 240;
/// Edge of the cubes whose points become one, relative to the median depth; larger if there are more points than `MOST`.
const CUBE: f64 = 0.008;
const MOST: usize = 300_000;
/// Half the edge of the box to begin with, relative to the distance of the cameras from what they look at.
const REACH: f64 = 0.5;

/// `saved`: the box that was saved for the recording.
pub(crate) fn page(path: &Path, args: &RecordingArgs, saved: Option<BoxBounds>, style: Style) -> Result<Page, Failure> {
    let files = recordings::of_state(path, State::START, args)?;
    let recording = load_recording(&files.path, &files.options).map_err(Failure::bad_input)?;
    recording.warnings.iter().for_each(|warning| note(warning, style));
    let masks = recording.has_masks();
    let views: Vec<View> = recording.frames.into_iter().map(|frame| frame.view).collect();
    let rotation =
        recording.up.map_or(DQuat::IDENTITY, |up| DQuat::from_rotation_arc(up.normalize_or(DVec3::Z), DVec3::Z));
    let placement = Placement { rotation, ..Placement::default() };
    let mut page = Page::empty(&name_of(path, "recording"));
    page.place(placement);
    add_cameras(&mut page, &views, placement)?;
    let cloud = fused(&views);
    if cloud.points.is_empty() {
        note("the recording has no depth: no points are shown", style);
    } else {
        page.add_cloud(&cloud, placement);
    }
    page.scene.object_box = match saved {
        Some(bounds) => Some(scene_box(bounds, true)),
        None => guess(&views, &cloud, masks).map(|bounds| scene_box(bounds, false)),
    };
    Ok(page)
}

/// A box that the page edits.
pub(crate) fn scene_box(BoxBounds { lower, upper }: BoxBounds, saved: bool) -> SceneBox {
    SceneBox { lower, upper, saved, file: None, refused: None }
}

/// Cameras with their images as they were read: without lens distortion, and of formats that have no image files.
fn add_cameras(page: &mut Page, views: &[View], placement: Placement) -> Result<(), Failure> {
    let folder = tempfile::tempdir().context("cannot make a temporary folder")?;
    let mut cameras = camera_views(views, State::START, "");
    for (i, (camera, view)) in cameras.iter_mut().enumerate() {
        let file = folder.path().join(format!("{i}.png"));
        let (width, height) = view.size();
        let pixels: Vec<[u8; 3]> = view.rgba.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
        write_rgb(&file, width as u32, height as u32, &pixels).map_err(Failure::failed)?;
        camera.photo = Some(file);
    }
    let cameras: Vec<_> = cameras.into_iter().map(|(camera, _)| camera).collect();
    page.add_cameras(&cameras, placement).map_err(Failure::bad_input)?;
    page.load_files().map_err(Failure::failed)
}

/// World points and colours of a part of the pixels, row by row.
fn samples(view: &View) -> impl Iterator<Item = (DVec3, [u8; 4])> + '_ {
    let (width, height) = view.size();
    let step = width.div_ceil(COLUMNS).max(1);
    let depth = view.depth.iter();
    depth.flat_map(move |depth| {
        let pixels = (0..height).step_by(step).flat_map(move |v| (0..width).step_by(step).map(move |u| (u, v)));
        pixels.filter_map(move |(u, v)| {
            let (i, z) = (v * width + u, f64::from(depth.at(v * width + u)));
            let pixel = DVec2::new(u as f64 + 0.5, v as f64 + 0.5);
            (z > 0.0).then(|| (view.camera.unproject(pixel, z), view.rgba[i]))
        })
    })
}

/// Surface points of all views: one for each cube that contains some, at their mean and in their mean colour.
fn fused(views: &[View]) -> Cloud {
    let mut cube = CUBE * median_depth(views);
    let mut cells = collected(views, cube);
    while cells.len() > MOST {
        cube *= 1.5;
        cells = collected(views, cube);
    }
    let points = cells.iter().map(|(_, [x, y, z, .., n])| [x / n, y / n, z / n].map(|v| v as f32)).collect();
    let colors = cells.iter().map(|(_, [.., r, g, b, n])| [r / n, g / n, b / n].map(|v| v.round() as u8)).collect();
    Cloud { state: State::START, points, colors, marks: Vec::new() }
}

/// Sums of coordinates and colours and the number of points, by cube, in the order of cubes.
fn collected(views: &[View], cube: f64) -> Vec<([i64; 3], [f64; 7])> {
    let mut cells: HashMap<[i64; 3], [f64; 7]> = HashMap::new();
    for (p, [r, g, b, _]) in views.iter().flat_map(samples) {
        let sums = cells.entry((p / cube).floor().to_array().map(|v| v as i64)).or_default();
        let own = [p.x, p.y, p.z, r.into(), g.into(), b.into(), 1.0];
        sums.iter_mut().zip(own).for_each(|(sum, v)| *sum += v);
    }
    let mut cells: Vec<_> = cells.into_iter().collect();
    // A hash map has no order; the page is the same every time.
    cells.sort_unstable_by_key(|(key, _)| *key);
    cells
}

fn median_depth(views: &[View]) -> f64 {
    let depths = views.iter().filter_map(|v| v.depth.as_ref()).flat_map(|d| d.iter().step_by(97));
    let mut depths: Vec<f32> = depths.filter(|z| *z > 0.0).collect();
    depths.sort_unstable_by(f32::total_cmp);
    depths.get(depths.len() / 2).map_or(1.0, |z| f64::from(*z))
}

/// A box to begin with: of the masks, else of the points near what the cameras look at, else of all points.
fn guess(views: &[View], cloud: &Cloud, masks: bool) -> Option<BoxBounds> {
    if masks {
        let object = views.iter().flat_map(samples).filter(|(_, rgba)| rgba[3] >= OBJECT_ALPHA).map(|(p, _)| p);
        if let Some(bounds) = around(object) {
            return Some(bounds);
        }
    }
    let points = || cloud.points.iter().map(|p| DVec3::from_array(p.map(f64::from)));
    let Some(center) = visual_center(cameras_of(views)) else { return around(points()) };
    let reach = DVec3::splat(REACH * center.mean_distance);
    let near = |p: &DVec3| (*p - center.point).abs().cmple(reach).all();
    around(points().filter(near)).or_else(|| around([center.point - reach, center.point + reach]))
}

fn around(points: impl IntoIterator<Item = DVec3>) -> Option<BoxBounds> {
    let (lower, upper) = points.into_iter().fold((DVec3::MAX, DVec3::MIN), |(l, u), p| (l.min(p), u.max(p)));
    let found = ObjectBox::new(lower, upper).ok()?.rounded();
    Some(BoxBounds { lower: found.lower().to_array(), upper: found.upper().to_array() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Camera, DepthMap, Intrinsics};

    /// Views from a circle of a red point at (1, 2, 3) with alpha, and of a wall far behind it.
    fn views() -> Vec<View> {
        let intrinsics = Intrinsics { fx: 32.0, fy: 32.0, cx: 16.0, cy: 16.0, width: 32, height: 32 };
        let middle = DVec3::new(1.0, 2.0, 3.0);
        let view = |k: usize| {
            let (sin, cos) = (0.7 * k as f64).sin_cos();
            let camera = Camera::look_at(intrinsics, middle + DVec3::new(2.0 * cos, 2.0 * sin, 0.5), middle, DVec3::Z);
            let object = |i: usize| (12..20).contains(&(i % 32)) && (12..20).contains(&(i / 32));
            let depths: Vec<f32> = (0..1024).map(|i| if object(i) { 2.06 } else { 9.0 }).collect();
            let rgba = (0..1024).map(|i| if object(i) { [250, 0, 0, 255] } else { [0, 0, 90, 0] }).collect();
            View { name: format!("{k}.png"), camera, rgba, depth: Some(DepthMap::nearest(&depths)), derived: None }
        };
        (0..9).map(view).collect()
    }

    #[test]
    fn the_box_to_begin_with_is_about_what_the_cameras_look_at() {
        let views = views();
        let cloud = fused(&views);
        assert_eq!(cloud.points.len(), cloud.colors.len());
        assert!(cloud.colors.contains(&[250, 0, 0]) && cloud.colors.contains(&[0, 0, 90]));
        assert_eq!(fused(&views).points, cloud.points);
        for masks in [false, true] {
            let BoxBounds { lower, upper } = guess(&views, &cloud, masks).unwrap();
            for (k, middle) in [1.0, 2.0, 3.0].into_iter().enumerate() {
                let (below, above) = (middle - lower[k], upper[k] - middle);
                assert!((0.05..0.6).contains(&below) && (0.05..0.6).contains(&above), "{masks}: {lower:?} {upper:?}");
            }
        }
    }

    #[test]
    fn without_depth_the_box_is_a_cube_there_and_without_views_there_is_none() {
        let blind: Vec<View> = views().into_iter().map(|v| View { depth: None, ..v }).collect();
        let cloud = fused(&blind);
        assert!(cloud.points.is_empty());
        let BoxBounds { lower, upper } = guess(&blind, &cloud, false).unwrap();
        assert!((upper[0] - lower[0] - 2.06).abs() < 0.05 && lower[0] < 1.0 && upper[0] > 1.0);
        assert_eq!(guess(&[], &fused(&[]), false), None);
    }
}
