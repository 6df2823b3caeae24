//! Writes a capture in the ArtGS layout, with intrinsics per frame.

use super::RecordedNames;
use super::pose::opengl_pose;
use crate::image_io::{write_depth, write_rgba};
use crate::{FileError, write_atomic};
use artgs_core::{Capture, DepthMap, FrameError, PerState, Rigid, State, Upward, View};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::Path;

/// File with the motions from the worlds of recordings into that of the capture.
const FRAMES_FILE: &str = "frames.json";

/// Key of the pose of a frame to the last bit: the matrix is that of other programs and rounds it.
pub(super) const EXACT_POSE: &str = "world_to_camera";

/// Content of [`FRAMES_FILE`].
#[derive(Serialize, Deserialize)]
struct Frames {
    /// Motion from the world of each state's recording into the world of the capture.
    frames: PerState<Rigid>,
    /// What these motions leave.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    frame_errors: Option<PerState<FrameError>>,
    /// Which way is up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    up: Option<Upward>,
}

/// Writes the training and held-out views of a capture into `dir`, with the names of the views, which are those in `recorded` where it
/// has them. [`load_capture`](super::load_capture) reads what
/// [`as_stored`](super::as_stored) returns.
pub fn write_capture(dir: &Path, capture: &Capture, recorded: &RecordedNames) -> Result<(), FileError> {
    let scale = depth_scale(capture);
    for (state, views) in capture.states.enumerate() {
        for (split, views) in [("train", &views.train), ("test", &views.test)] {
            if views.is_empty() {
                continue;
            }
            let folder = folder_of(state, split);
            let numbered: Vec<(usize, &View)> = views.iter().enumerate().collect();
            numbered.par_iter().try_for_each(|(i, view)| write_view(dir, &folder, *i, view, scale))?;
            let frames: Vec<Value> =
                numbered.iter().map(|(i, view)| frame(&folder, *i, view, state, recorded)).collect();
            let lens = lens(&views[0]);
            let mut root = json!({ "depth_scale": scale, "frames": frames });
            if let (Some(root), Value::Object(lens)) = (root.as_object_mut(), lens) {
                root.extend(lens);
            }
            write_json(&dir.join(format!("transforms_{split}_{}.json", state.name())), &root)?;
        }
    }
    match capture.frames {
        Some(frames) => {
            let Capture { frame_errors, up, .. } = *capture;
            write_json(&dir.join(FRAMES_FILE), &json!(Frames { frames, frame_errors, up }))
        }
        None => Ok(()),
    }
}

/// Reads the motions from the worlds of recordings into the world of the capture, and what is known of that, into a capture;
/// nothing if the folder does not state them.
pub(super) fn read_frames(dir: &Path, capture: &mut Capture) -> Result<(), FileError> {
    let path = dir.join(FRAMES_FILE);
    if !path.is_file() {
        return Ok(());
    }
    let bytes = std::fs::read(&path).map_err(|source| FileError::Read { path: path.clone(), source })?;
    let read = serde_json::from_slice::<Frames>(&bytes);
    let Frames { frames, frame_errors, up } = read.map_err(|e| FileError::malformed(&path, e.to_string()))?;
    (capture.frames, capture.frame_errors, capture.up) = (Some(frames), frame_errors, up);
    Ok(())
}

fn write_json(path: &Path, value: &Value) -> Result<(), FileError> {
    write_atomic(path, format!("{value:#}\n").as_bytes())
}

fn write_view(dir: &Path, folder: &str, index: usize, view: &View, scale: f64) -> Result<(), FileError> {
    let (width, height) = (view.camera.intrinsics.width, view.camera.intrinsics.height);
    write_rgba(&dir.join(image_path(folder, index)), width, height, &view.rgba)?;
    for (kind, depth) in depths(view) {
        write_depth(&dir.join(depth_path(folder, kind, index)), width, height, &counted(depth, scale))?;
    }
    Ok(())
}

/// Folder of the images of a state and split, relative to the capture.
pub(super) fn folder_of(state: State, split: &str) -> String {
    format!("{}/{split}", state.name())
}

/// Path of an image, relative to the capture.
pub(super) fn image_path(folder: &str, index: usize) -> String {
    format!("{folder}/rgba/{index:04}.png")
}

/// Counts of depth per scene unit in the files of a capture: those of its depth maps if all have the same, else such that the largest
/// depth has 65534.
pub(super) fn depth_scale(capture: &Capture) -> f64 {
    let views = || capture.states.iter().flat_map(|s| s.train.iter().chain(&s.test));
    let mut units = views().flat_map(depths).map(|(_, depth)| depth.per_unit());
    if let Some(first) = units.next()
        && units.all(|unit| unit == first)
    {
        return f64::from(first);
    }
    // Of a background that was not measured only matters that it is there: its depth is cut off at the largest other one.
    let largest_of = |view: &View| view.any_depth().map_or(0.0, |depth| depth.iter().fold(0.0_f32, f32::max));
    let largest = views().map(largest_of).fold(0.0_f32, f32::max);
    let scale = if largest > 0.0 { f64::from(u16::MAX - 1) / f64::from(largest) } else { 1.0 };
    // A round number keeps files readable.
    if scale > 10.0 { scale.floor() } else { f64::from(scale as f32) }
}

/// Depth in counts of another size.
pub(super) fn counted(depth: &DepthMap, scale: f64) -> DepthMap {
    if depth.per_unit() == scale as f32 {
        return depth.clone();
    }
    let count =
        |z: f32| if z > 0.0 { (f64::from(z) * scale).round().clamp(1.0, f64::from(u16::MAX)) as u16 } else { 0 };
    DepthMap::new(depth.iter().map(count).collect(), scale as f32)
}

/// Depth maps of a view, with the names of their folders.
fn depths(view: &View) -> impl Iterator<Item = (&'static str, &DepthMap)> {
    [("depth", &view.depth), ("derived_depth", &view.derived)]
        .into_iter()
        .filter_map(|(kind, d)| Some((kind, d.as_ref()?)))
}

fn depth_path(folder: &str, kind: &str, index: usize) -> String {
    format!("{folder}/{kind}/{index:04}.png")
}

fn lens(view: &View) -> Value {
    let k = &view.camera.intrinsics;
    json!({ "fl_x": k.fx, "fl_y": k.fy, "cx": k.cx, "cy": k.cy, "w": k.width, "h": k.height })
}

fn frame(folder: &str, index: usize, view: &View, state: State, recorded: &RecordedNames) -> Value {
    let mut frame = lens(view);
    frame["file_path"] = image_path(folder, index).into();
    for (kind, _) in depths(view) {
        frame[format!("{kind}_path")] = depth_path(folder, kind, index).into();
    }
    frame["time"] = json!(state.index() as f64);
    frame["transform_matrix"] = json!(opengl_pose(&view.camera));
    frame[EXACT_POSE] = json!(view.camera.world_to_camera);
    frame["recorded_as"] = recorded.get(&view.name).unwrap_or(&view.name).as_str().into();
    frame
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_capture;
    use artgs_core::{Camera, Intrinsics, StateViews};
    use glam::DVec3;

    fn view(i: usize) -> View {
        let intrinsics = Intrinsics { fx: 20.0 + i as f64, fy: 21.0, cx: 4.0 - i as f64, cy: 3.5, width: 8, height: 6 };
        let eye = DVec3::new(1.0 + i as f64, 0.5, 2.0);
        let depth: Vec<f32> = (0..48).map(|p| if p == 5 || p == 7 { 0.0 } else { 1.0 + 0.01 * p as f32 }).collect();
        View {
            name: format!("walk/{i}.jpg"),
            camera: Camera::look_at(intrinsics, eye, DVec3::ZERO, DVec3::Y),
            rgba: (0..48).map(|p| [p, 2 * p, i as u8, if p == 7 { 0 } else { 255 }]).collect(),
            depth: Some(DepthMap::nearest(&depth)),
            derived: (i > 0).then(|| DepthMap::new((0..48).map(|p| u16::from(p == 5 || p == 7)).collect(), 1.0)),
        }
    }

    #[test]
    fn a_written_capture_is_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let views = || StateViews { train: (0..3).map(view).collect(), test: Vec::new() };
        let turn = Rigid::about(DVec3::Y, DVec3::X, 0.4);
        let frames = Some(PerState::new(Rigid::IDENTITY, turn));
        let error = |shift| FrameError { shift, turn: 0.002 };
        let up = Upward { direction: DVec3::X, source: artgs_core::UpSource::Floor, confidence: 0.9 };
        let capture = Capture {
            states: PerState::new(views(), views()),
            frames,
            frame_errors: Some(PerState::new(error(0.01), error(0.02))),
            up: Some(up),
            warnings: Vec::new(),
        };
        write_capture(dir.path(), &capture, &RecordedNames::new()).unwrap();
        let read = load_capture(dir.path()).unwrap();
        assert_eq!((read.frames, read.frame_errors, read.up), (capture.frames, capture.frame_errors, capture.up));
        for (a, b) in capture.states.iter().zip(read.states.iter()) {
            assert_eq!(b.train.len(), 3);
            for (a, b) in a.train.iter().zip(&b.train) {
                assert_eq!((a.camera.intrinsics, &a.rgba), (b.camera.intrinsics, &b.rgba));
                let p = DVec3::new(0.1, 0.2, -0.3);
                assert!(a.camera.project(p).0.distance(b.camera.project(p).0) < 1e-9);
                let (da, db) = (a.depth.as_ref().unwrap(), b.depth.as_ref().unwrap());
                assert!(da.iter().zip(db.iter()).all(|(a, b)| (a - b).abs() < 1e-4 && (a > 0.0) == (b > 0.0)));
                let derived = |view: &View| view.derived.as_ref().map(|d| d.iter().collect::<Vec<_>>());
                assert_eq!(derived(a), derived(b));
            }
        }
    }
}
