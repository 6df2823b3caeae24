//! nerfstudio and instant-ngp: `transforms.json` with `frames`, each with `file_path` and `transform_matrix` (camera-to-world,
//! OpenGL axes); intrinsics and distortion for the file or per frame; optional depth and masks.

use super::RecordingError;
use super::depth::Measured;
use super::depth_file::{self, Scale};
use super::files::natural;
use super::index::{Entry, Gaps, Index, LOST, Load};
use super::lens::{Distortion, Lens};
use super::pixels::{dimensions, read_color};
use super::pose::Axes;
use super::values::{is_lost_pose, size};
use super::write::{self, write_depth_png, write_json, write_png};
use crate::capture::json::{Object, key_error, number, positive, read_object, text};
use crate::capture::pose::world_to_camera;
use crate::image_io::write_gray;
use artgs_core::{Intrinsics, RecordedFrame, Recording};
use glam::{DQuat, DVec2};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const FILES: [&str; 2] = ["transforms.json", "transforms_train.json"];

pub(super) fn matches(path: &Path) -> bool {
    let file = camera_file(path);
    file.is_some_and(|f| read_object(&f, &f).is_ok_and(|o| o.get("frames").is_some_and(Value::is_array)))
}

/// The camera file of a folder, or the given JSON file.
fn camera_file(path: &Path) -> Option<PathBuf> {
    if path.is_file() {
        return path.extension().is_some_and(|e| e == "json").then(|| path.into());
    }
    super::files::first_file(path, &FILES)
}

pub(super) fn index(path: &Path) -> Result<Index, RecordingError> {
    let Some(file) = camera_file(path) else {
        return Err(RecordingError::incomplete(path, "contains no transforms.json; give the folder that contains it"));
    };
    let dir = file.parent().unwrap_or(Path::new(".")).to_path_buf();
    let root = read_object(&file, &file)?;
    let shown = file.display().to_string();
    let Some(Value::Array(frames)) = root.get("frames") else {
        return Err(key_error(&shown, "frames", "expected a list of frames; add it").into());
    };
    let mut index = Index::default();
    let (mut no_image, mut lost, mut gaps) = (Vec::new(), Vec::new(), Gaps::default());
    for (i, frame) in frames.iter().enumerate() {
        let place = format!("{shown}, frame {i}");
        let Value::Object(frame) = frame else {
            return Err(key_error(&place, "frames", "a frame must be an object").into());
        };
        let missing = |key: &str| key_error(&place, key, "is missing; add it or remove the frame");
        let listed = text(frame, &place, "file_path")?.ok_or_else(|| missing("file_path"))?;
        let pose = frame.get("transform_matrix").ok_or_else(|| missing("transform_matrix"))?;
        if is_lost_pose(pose) {
            lost.push(listed.to_string());
            continue;
        }
        let world_to_camera = world_to_camera(pose, &place, "transform_matrix")?;
        let Some(image) = image_file(&dir, listed) else {
            no_image.push(listed.to_string());
            continue;
        };
        let depth = match depth(&dir, &root, frame, &place)? {
            Depth::File(load) => Some(load),
            Depth::Unnamed => {
                gaps.unnamed.push(listed.to_string());
                None
            }
            Depth::Missing(named) => {
                gaps.missing.push(named);
                None
            }
        };
        let mask = text(frame, &place, "mask_path")?.map(|m| dir.join(m));
        index.entries.push(Entry {
            name: listed.trim_start_matches("./").into(),
            time: None,
            world_to_camera,
            lens: lens(&root, frame, &place, &image)?,
            color: Box::new(move || read_color(&image)),
            depth,
            mask: mask.map(|m| -> Load<_> { Box::new(move || read_color(&m)) }),
        });
    }
    index.entries.sort_by_cached_key(|e| natural(&e.name));
    index.metric = index.entries.iter().any(|entry| entry.depth.is_some());
    index.skip(&file, "images do not exist", &no_image);
    index.skip(&file, LOST, &lost);
    index.warn_gaps(&file, &gaps);
    Ok(index)
}

/// The image, also without its suffix in the file.
fn image_file(dir: &Path, listed: &str) -> Option<PathBuf> {
    ["", ".png", ".jpg", ".jpeg", ".JPG"].into_iter().map(|s| dir.join(format!("{listed}{s}"))).find(|p| p.is_file())
}

/// A key of the frame, or of the file.
fn either(root: &Object, frame: &Object, place: &str, key: &str) -> Result<Option<f64>, RecordingError> {
    Ok(if frame.contains_key(key) { number(frame, place, key)? } else { number(root, place, key)? })
}

fn lens(root: &Object, frame: &Object, place: &str, image: &Path) -> Result<Lens, RecordingError> {
    let get = |key: &str| either(root, frame, place, key);
    let stated = match size(frame, place, ["w", "h"])? {
        Some(size) => Some(size),
        None => size(root, place, ["w", "h"])?,
    };
    let focal = |pixels: &str, angle: &str, side: fn((u32, u32)) -> u32| -> Result<Option<f64>, RecordingError> {
        if let Some(f) = get(pixels)? {
            return Ok(Some(f));
        }
        let Some(angle) = get(angle)? else { return Ok(None) };
        let size = stated.map_or_else(|| dimensions(image), Ok)?;
        Ok(Some(0.5 * f64::from(side(size)) / (0.5 * angle).tan()))
    };
    let fx = focal("fl_x", "camera_angle_x", |s| s.0)?;
    let fy = focal("fl_y", "camera_angle_y", |s| s.1)?;
    let Some(fx) = fx.filter(|f| *f > 0.0) else {
        let reason = "no focal length above 0; add `fl_x` and `fl_y` in pixels, or `camera_angle_x` in radians";
        return Err(key_error(place, "fl_x", reason).into());
    };
    let center = match (get("cx")?, get("cy")?) {
        (Some(x), Some(y)) => Some(DVec2::new(x, y)),
        _ => None,
    };
    Ok(Lens {
        focal: DVec2::new(fx, fy.unwrap_or(fx)),
        center,
        size: stated,
        distortion: distortion(root, frame, place)?,
    })
}

fn distortion(root: &Object, frame: &Object, place: &str) -> Result<Distortion, RecordingError> {
    let model = text(frame, place, "camera_model")?.or(text(root, place, "camera_model")?).unwrap_or("OPENCV");
    let mut k = [0.0; 6];
    for (i, value) in k.iter_mut().enumerate() {
        *value = either(root, frame, place, &format!("k{}", i + 1))?.unwrap_or(0.0);
    }
    let p = [either(root, frame, place, "p1")?.unwrap_or(0.0), either(root, frame, place, "p2")?.unwrap_or(0.0)];
    // instant-ngp states a fisheye without a model.
    let fisheye = root.get("is_fisheye").and_then(Value::as_bool).unwrap_or(false);
    match model {
        "OPENCV_FISHEYE" => Ok(Distortion::Fisheye([k[0], k[1], k[2], k[3]])),
        "OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "FULL_OPENCV" if fisheye => {
            Ok(Distortion::Fisheye([k[0], k[1], k[2], k[3]]))
        }
        "PINHOLE" | "SIMPLE_PINHOLE" => Ok(Distortion::None),
        "OPENCV" | "SIMPLE_RADIAL" | "RADIAL" | "FULL_OPENCV" => Ok(Distortion::radial(k, p)),
        other => {
            let reason = format!("`{other}` is not supported; undistort the images to a pinhole camera");
            Err(key_error(place, "camera_model", reason).into())
        }
    }
}

/// The depth image of a frame.
enum Depth {
    File(Load<Measured>),
    /// The frame names none.
    Unnamed,
    /// It does not exist.
    Missing(String),
}

/// Counts per scene unit: `depth_scale`, or the inverse of instant-ngp's `integer_depth_scale`, or 1000 (millimetres).
fn depth(dir: &Path, root: &Object, frame: &Object, place: &str) -> Result<Depth, RecordingError> {
    let mut listed = None;
    for key in ["depth_file_path", "depth_path"] {
        listed = listed.or(text(frame, place, key)?);
    }
    let Some(listed) = listed else { return Ok(Depth::Unnamed) };
    let path = Some(dir.join(listed)).filter(|p| p.is_file()).or_else(|| depth_file::find(dir, &[listed]));
    let Some(path) = path else { return Ok(Depth::Missing(listed.into())) };
    let stated = match positive(root, place, "integer_depth_scale")? {
        Some(scale) => Some(1.0 / scale),
        None => positive(root, place, "depth_scale")?,
    };
    let scale = stated.map_or(Scale { integer: 1000.0, float: 1.0 }, |per_unit| Scale::same(per_unit as f32));
    Ok(Depth::File(Box::new(move || depth_file::read(&path, scale, false))))
}

pub(super) fn write(dir: &Path, recording: &Recording) -> Result<(), RecordingError> {
    let masks = recording.has_masks();
    let mut frames = Vec::with_capacity(recording.frames.len());
    for (i, frame) in recording.frames.iter().enumerate() {
        let name = format!("{:06}.png", i + 1);
        write_png(&dir.join("images").join(&name), &frame.view)?;
        let mut object = frame_json(frame);
        object["file_path"] = json!(format!("images/{name}"));
        if let Some(depth) = &frame.view.depth {
            write_depth_png(&dir.join("depth").join(&name), &frame.view, depth, 1000.0)?;
            object["depth_file_path"] = json!(format!("depth/{name}"));
        }
        if masks {
            let alpha: Vec<u8> = frame.view.rgba.iter().map(|p| p[3]).collect();
            let (width, height) = write::size(&frame.view);
            write_gray(&dir.join("masks").join(&name), width, height, &alpha)?;
            object["mask_path"] = json!(format!("masks/{name}"));
        }
        frames.push(object);
    }
    write_json(&dir.join(FILES[0]), &json!({ "camera_model": "OPENCV", "frames": frames }))
}

fn frame_json(frame: &RecordedFrame) -> Value {
    let Intrinsics { fx, fy, cx, cy, width, height } = frame.view.camera.intrinsics;
    json!({
        "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": width, "h": height,
        "transform_matrix": Axes::OpenGl.rows(&frame.view.camera, DQuat::IDENTITY),
    })
}
