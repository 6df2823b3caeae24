//! 3D Scanner App, "All Data": `frame_N.json` with pose and intrinsics, `frame_N.jpg` for some of them, `depth_N.png` (mm) and
//! `conf_N.png` (0 to 2). Camera-to-world, row by row, OpenGL axes, metres; +Y is up.

use super::RecordingError;
use super::depth::Measured;
use super::files::{between, names};
use super::index::{Entry, Gaps, Index, LOST, Load};
use super::lens::{Distortion, Lens};
use super::pixels::read_color;
use super::pose::{Axes, upright};
use super::values::{is_lost_pose, numbers};
use super::write::{SensorDepth, write_jpeg, write_json};
use crate::capture::json::{Object, key_error, number, read_object};
use artgs_core::{RecordedFrame, Recording};
use glam::{DQuat, DVec2, DVec3};
use serde_json::{Value, json};
use std::path::Path;

pub(super) fn matches(dir: &Path) -> bool {
    let first = names(dir).into_iter().find(|n| between(n, "frame_", ".json").is_some());
    let pose = |name: String| {
        let path = dir.join(name);
        read_object(&path, &path).ok().map(|o| o.contains_key("cameraPoseARFrame"))
    };
    first.and_then(pose).unwrap_or(false)
}

pub(super) fn index(dir: &Path) -> Result<Index, RecordingError> {
    let files = names(dir);
    let has = |name: &String| files.binary_search(name).is_ok();
    let numbers: Vec<&str> = files.iter().filter_map(|n| between(n, "frame_", ".json")).collect();
    let mut index = Index { up: Some(DVec3::Y), metric: true, ..Index::default() };
    let (mut pictured, mut lost, mut without) = (Vec::new(), Vec::new(), Gaps::default());
    for (place, number) in numbers.iter().enumerate() {
        let [image, depth, confidence] =
            [format!("frame_{number}.jpg"), format!("depth_{number}.png"), format!("conf_{number}.png")];
        if !has(&image) {
            continue;
        }
        pictured.push(place);
        let file = dir.join(format!("frame_{number}.json"));
        let root = read_object(&file, &file)?;
        if root.get("cameraPoseARFrame").is_some_and(is_lost_pose) {
            lost.push(image);
            continue;
        }
        let mut entry = entry(dir, &file, &root, image)?;
        if has(&depth) {
            entry.depth = Some(depth_of(dir, &depth, has(&confidence).then_some(confidence)));
        } else {
            without.unnamed.push(entry.name.clone());
        }
        index.entries.push(entry);
    }
    let no_image = gaps(&pictured).into_iter().map(|i| format!("frame_{}.jpg", numbers[i])).collect::<Vec<_>>();
    index.skip(dir, "images do not exist", &no_image);
    index.skip(dir, LOST, &lost);
    index.warn_gaps(dir, &without);
    Ok(index)
}

/// The app stores the image of every n-th frame only. Returns the frames between the first and last image that should have one.
fn gaps(pictured: &[usize]) -> Vec<usize> {
    let Some(step) = pictured.windows(2).map(|w| w[1] - w[0]).min() else { return Vec::new() };
    let between = pictured.windows(2).flat_map(|w| (w[0] + step..w[1]).step_by(step));
    between.collect()
}

fn entry(dir: &Path, file: &Path, root: &Object, image: String) -> Result<Entry, RecordingError> {
    let place = file.display().to_string();
    let pose = numbers::<16>(root, &place, "cameraPoseARFrame")?;
    let world_to_camera =
        Axes::OpenGl.world_to_camera_of_rows(&pose).map_err(|e| key_error(&place, "cameraPoseARFrame", e))?;
    let path = dir.join(&image);
    Ok(Entry {
        name: image,
        time: number(root, &place, "time")?,
        world_to_camera,
        lens: lens(root, &place)?,
        color: Box::new(move || read_color(&path)),
        depth: None,
        mask: None,
    })
}

/// Intrinsics; the projection matrix states the size of the images that they belong to.
fn lens(root: &Object, place: &str) -> Result<Lens, RecordingError> {
    let k = numbers::<9>(root, place, "intrinsics")?;
    let focal = DVec2::new(k[0], k[4]);
    if focal.min_element() <= 0.0 {
        return Err(key_error(place, "intrinsics", "focal lengths must be above 0; remove the frame").into());
    }
    let mut center = DVec2::new(k[2], k[5]);
    let mut size = None;
    if root.contains_key("projectionMatrix") {
        let p = numbers::<16>(root, place, "projectionMatrix")?;
        let (w, h) = ((2.0 * focal.x / p[0]).round(), (2.0 * focal.y / p[5]).round());
        if (1.0..=1e5).contains(&w) && (1.0..=1e5).contains(&h) {
            size = Some((w as u32, h as u32));
            // Devices count pixels from the centre of the first; their projection matrix shows it.
            if (p[2] - (1.0 - (2.0 * center.x + 1.0) / w)).abs() < 0.1 / w {
                center += 0.5;
            }
        }
    }
    Ok(Lens { focal, center: Some(center), size, distortion: Distortion::None })
}

fn depth_of(dir: &Path, depth: &str, confidence: Option<String>) -> Load<Measured> {
    let (depth, confidence) = (dir.join(depth), confidence.map(|c| dir.join(c)));
    Box::new(move || Measured::read_phone(&depth, confidence.as_deref()))
}

pub(super) fn write(dir: &Path, recording: &Recording) -> Result<(), RecordingError> {
    let turn = upright(recording.up);
    for (i, frame) in recording.frames.iter().enumerate() {
        write_json(&dir.join(format!("frame_{i:05}.json")), &frame_json(frame, i, turn))?;
        write_jpeg(&dir.join(format!("frame_{i:05}.jpg")), &frame.view)?;
        let Some(depth) = SensorDepth::new(frame) else { continue };
        depth.write_png(&dir.join(format!("depth_{i:05}.png")))?;
        depth.write_confidence(&dir.join(format!("conf_{i:05}.png")), 2)?;
    }
    write_json(&dir.join("info.json"), &json!({ "numImages": recording.frames.len(), "title": "recording" }))
}

fn frame_json(frame: &RecordedFrame, i: usize, turn: DQuat) -> Value {
    let k = &frame.view.camera.intrinsics;
    let (w, h) = (f64::from(k.width), f64::from(k.height));
    let pose = Axes::OpenGl.rows(&frame.view.camera, turn).concat();
    let projection = [
        [2.0 * k.fx / w, 0.0, 1.0 - 2.0 * k.cx / w, 0.0],
        [0.0, 2.0 * k.fy / h, 2.0 * k.cy / h - 1.0, 0.0],
        [0.0, 0.0, -1.0, -0.001],
        [0.0, 0.0, -1.0, 0.0],
    ];
    json!({
        "frame_index": i,
        "time": frame.time.unwrap_or(i as f64),
        "cameraPoseARFrame": pose,
        "intrinsics": [k.fx, 0.0, k.cx - 0.5, 0.0, k.fy, k.cy - 0.5, 0.0, 0.0, 1.0],
        "projectionMatrix": projection.concat(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stride_of_images_is_no_gap() {
        assert_eq!(gaps(&[0, 3, 6, 12, 15]), [9]);
        assert!(gaps(&[0, 3, 6, 9]).is_empty() && gaps(&[5]).is_empty());
    }

    /// Values of a device: the projection matrix states 1920x1440 and pixels counted from the centre of the first.
    #[test]
    fn the_projection_matrix_states_the_image_size() {
        let mut root = Object::new();
        root.insert("intrinsics".into(), json!([1590.2057, 0, 947.3061, 0, 1590.2057, 727.5516, 0, 0, 1]));
        root.insert(
            "projectionMatrix".into(),
            json!([1.6564642, 0, 0.012701988, 0, 0, 2.2086191, 0.0111827, 0, 0, 0, -1, -0.001, 0, 0, -1, 0]),
        );
        let lens = lens(&root, "frame").unwrap();
        assert_eq!(lens.size, Some((1920, 1440)));
        assert!(lens.center.unwrap().distance(DVec2::new(947.8061, 728.0516)) < 1e-9);
    }
}
