//! What the writers of recordings share.

use super::RecordingError;
use super::pixels::jpeg;
use crate::image_io::{write_depth, write_gray, write_rgb};
use crate::write_atomic;
use artgs_core::{DepthMap, RecordedFrame, View};
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
    write_counts(path, width, height, depth, per_unit)
}

fn write_counts(path: &Path, width: u32, height: u32, depth: &DepthMap, per_unit: f32) -> Result<(), RecordingError> {
    let count = |d: f32| if d * per_unit < f32::from(u16::MAX) { (d * per_unit).round() as u16 } else { 0 };
    let counts = depth.iter().map(count).collect();
    Ok(write_depth(path, width, height, &DepthMap::new(counts, per_unit))?)
}

/// Depth of a frame as the sensor measured it: at the size of the image divided by `depth_step`.
pub(super) struct SensorDepth {
    pub(super) width: u32,
    pub(super) height: u32,
    map: DepthMap,
}

impl SensorDepth {
    /// The depth at the centre of every measured pixel; none without depth.
    pub(super) fn new(frame: &RecordedFrame) -> Option<Self> {
        let full = frame.view.depth.as_ref()?;
        let (columns, rows) = size(&frame.view);
        let measured = |pixels: u32| ((f64::from(pixels) / frame.depth_step).round() as u32).max(1);
        let (width, height) = (measured(columns), measured(rows));
        let at = |i: u32, from: u32, to: u32| ((f64::from(i) + 0.5) * f64::from(to) / f64::from(from)) as u32;
        let index = |x, y| (at(y, height, rows) * columns + at(x, width, columns)) as usize;
        let counts = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let counts = counts.map(|(x, y)| full.counts()[index(x, y)]).collect();
        Some(Self { width, height, map: DepthMap::new(counts, full.per_unit()) })
    }

    /// Depths, scene units, row-major; 0 is a hole.
    pub(super) fn depths(&self) -> Vec<f32> {
        self.map.iter().collect()
    }

    /// Writes a 16-bit PNG in thousandths of a scene unit.
    pub(super) fn write_png(&self, path: &Path) -> Result<(), RecordingError> {
        write_counts(path, self.width, self.height, &self.map, 1000.0)
    }

    /// Writes a confidence image with the value `high` where depth was measured and 0 in holes.
    pub(super) fn write_confidence(&self, path: &Path, high: u8) -> Result<(), RecordingError> {
        let levels: Vec<u8> = self.map.counts().iter().map(|c| if *c > 0 { high } else { 0 }).collect();
        Ok(write_gray(path, self.width, self.height, &levels)?)
    }
}

/// Writes a JSON file.
pub(super) fn write_json(path: &Path, value: &Value) -> Result<(), RecordingError> {
    Ok(write_atomic(path, format!("{value:#}\n").as_bytes())?)
}
