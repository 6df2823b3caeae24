//! What the writers of recordings share.

use super::RecordingError;
use super::pixels::jpeg;
use crate::image_io::{write_depth, write_rgb};
use crate::write_atomic;
use artgs_core::{DepthMap, View};
use serde_json::Value;
use std::path::Path;

/// Width and height of the images of a view.
pub(super) fn size(view: &View) -> (u32, u32) {
    (view.camera.intrinsics.width, view.camera.intrinsics.height)
}

/// Writes the colours of a view as a JPEG.
pub(super) fn write_jpeg(path: &Path, view: &View) -> Result<(), RecordingError> {
    let (width, height) = size(view);
    Ok(write_atomic(path, &jpeg(path, width, height, &view.rgba)?)?)
}

/// Writes the colours of a view as a PNG without alpha.
pub(super) fn write_png(path: &Path, view: &View) -> Result<(), RecordingError> {
    let (width, height) = size(view);
    let rgb: Vec<[u8; 3]> = view.rgba.iter().map(|p| [p[0], p[1], p[2]]).collect();
    Ok(write_rgb(path, width, height, &rgb)?)
}

/// Writes the depth of a view as a 16-bit PNG with `per_unit` counts per scene unit. Depth beyond its range becomes a hole.
pub(super) fn write_depth_png(path: &Path, view: &View, depth: &DepthMap, per_unit: f32) -> Result<(), RecordingError> {
    let (width, height) = size(view);
    let count = |d: f32| if d * per_unit < f32::from(u16::MAX) { (d * per_unit).round() as u16 } else { 0 };
    let counts = depth.iter().map(count).collect();
    Ok(write_depth(path, width, height, &DepthMap::new(counts, per_unit))?)
}

/// Writes a JSON file.
pub(super) fn write_json(path: &Path, value: &Value) -> Result<(), RecordingError> {
    Ok(write_atomic(path, format!("{value:#}\n").as_bytes())?)
}
