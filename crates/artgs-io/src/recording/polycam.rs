//! Polycam raw data: `keyframes/{images,cameras,depth,confidence}/T.*`, and `corrected_images`, `corrected_cameras` after a loop
//! was closed. Camera-to-world, rows `t_00` to `t_23`, OpenGL axes, metres; +Y is up.

use super::RecordingError;
use super::depth::Measured;
use super::files::{between, names, natural};
use super::index::{Entry, Index};
use super::lens::{Distortion, Lens};
use super::pixels::read_color;
use super::pose::{Axes, upright};
use super::values::{needed, size};
use super::write::{SensorDepth, write_jpeg, write_json};
use crate::capture::json::{key_error, read_object};
use artgs_core::Recording;
use glam::{DVec2, DVec3};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Folders of cameras and images, the better pair first.
const FOLDERS: [(&str, &str); 2] = [("corrected_cameras", "corrected_images"), ("cameras", "images")];

pub(super) fn matches(path: &Path) -> bool {
    keyframes(path).is_some()
}

/// The folder `keyframes`, given itself or by the folder that contains it, with its folders of cameras and images.
fn keyframes(path: &Path) -> Option<(PathBuf, &'static str, &'static str)> {
    for dir in [path.join("keyframes"), path.to_path_buf()] {
        for (cameras, images) in FOLDERS {
            let first = names(&dir.join(cameras)).into_iter().find(|n| n.ends_with(".json"));
            let posed = first.map(|n| dir.join(cameras).join(n)).and_then(|f| read_object(&f, &f).ok());
            if dir.join(images).is_dir() && posed.is_some_and(|o| o.contains_key("t_00")) {
                return Some((dir, cameras, images));
            }
        }
    }
    None
}

pub(super) fn index(path: &Path) -> Result<Index, RecordingError> {
    let Some((dir, cameras, images)) = keyframes(path) else {
        let reason = "contains no keyframes with cameras and images; export raw data in Polycam";
        return Err(RecordingError::incomplete(path, reason));
    };
    let mut stems = names(&dir.join(cameras));
    stems.retain(|n| n.ends_with(".json"));
    stems.sort_by_cached_key(|n| natural(n));
    let mut index = Index { up: Some(DVec3::Y), metric: true, ..Index::default() };
    let (mut no_image, mut no_depth) = (Vec::new(), Vec::new());
    for name in &stems {
        let stem = between(name, "", ".json").unwrap_or(name);
        let image = ["jpg", "jpeg", "png"].map(|s| dir.join(images).join(format!("{stem}.{s}")));
        let Some(image) = image.into_iter().find(|p| p.is_file()) else {
            no_image.push(stem.to_string());
            continue;
        };
        let mut entry = entry(&dir.join(cameras).join(name), image, format!("{images}/{stem}"))?;
        let depth = dir.join("depth").join(format!("{stem}.png"));
        if depth.is_file() {
            let confidence = Some(dir.join("confidence").join(format!("{stem}.png"))).filter(|p| p.is_file());
            entry.depth = Some(Box::new(move || Measured::read_phone(&depth, confidence.as_deref())));
        } else {
            no_depth.push(stem.to_string());
        }
        index.entries.push(entry);
    }
    index.warn(path, "images are missing, their frames are ignored", &no_image);
    if no_depth.len() < index.entries.len() {
        index.warn(path, "frames have no depth image", &no_depth);
    }
    Ok(index)
}

fn entry(file: &Path, image: PathBuf, name: String) -> Result<Entry, RecordingError> {
    let place = file.display().to_string();
    let root = read_object(file, file)?;
    let mut pose = [0.0; 12];
    for (i, value) in pose.iter_mut().enumerate() {
        *value = needed(&root, &place, &format!("t_{}{}", i / 4, i % 4))?;
    }
    let world_to_camera = Axes::OpenGl.world_to_camera_of_rows(&pose).map_err(|e| key_error(&place, "t_00", e))?;
    let value = |key| needed(&root, &place, key);
    let lens = Lens {
        focal: DVec2::new(value("fx")?, value("fy")?),
        center: Some(DVec2::new(value("cx")?, value("cy")?)),
        size: size(&root, &place, ["width", "height"])?,
        distortion: Distortion::None,
    };
    Ok(Entry {
        name,
        time: None,
        world_to_camera,
        lens,
        color: Box::new(move || read_color(&image)),
        depth: None,
        mask: None,
    })
}

pub(super) fn write(dir: &Path, recording: &Recording) -> Result<(), RecordingError> {
    let turn = upright(recording.up);
    let dir = dir.join("keyframes");
    for (i, frame) in recording.frames.iter().enumerate() {
        let stem = format!("{}", 1_000_000 + i);
        let k = &frame.view.camera.intrinsics;
        let mut object =
            json!({ "fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "width": k.width, "height": k.height });
        for (row, values) in Axes::OpenGl.rows(&frame.view.camera, turn).iter().take(3).enumerate() {
            for (column, value) in values.iter().enumerate() {
                object[format!("t_{row}{column}")] = json!(value);
            }
        }
        write_json(&dir.join(format!("cameras/{stem}.json")), &object)?;
        write_jpeg(&dir.join(format!("images/{stem}.jpg")), &frame.view)?;
        let Some(depth) = SensorDepth::new(frame) else { continue };
        depth.write_png(&dir.join(format!("depth/{stem}.png")))?;
        depth.write_confidence(&dir.join(format!("confidence/{stem}.png")), 255)?;
    }
    Ok(())
}
