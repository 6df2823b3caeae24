//! Decodes a chosen frame: pinhole image, mask and registered depth.

use super::RecordingError;
use super::depth::Registered;
use super::index::Entry;
use super::lens::{Distortion, Lens, Undistortion, same_shape};
use super::pixels::Color;
use crate::reduce::reduced_size;
use artgs_core::capture::OBJECT_ALPHA;
use artgs_core::{Camera, DepthMap, RecordedFrame, View};
use std::path::Path;

/// Decodes a frame with images of at most `longest_side` pixels.
pub(super) fn frame(entry: &Entry, longest_side: u32) -> Result<RecordedFrame, RecordingError> {
    let fail = |reason: String| RecordingError::malformed(Path::new(&entry.name), reason);
    let color = upright(&entry.lens, (entry.color)()?);
    let measured = entry.depth.as_ref().map(|load| load().map_err(|e| mixed_up(e, entry, &color))).transpose()?;
    let recorded = entry.lens.intrinsics(color.width, color.height).map_err(fail)?;
    let (width, height) = reduced_size(color.width, color.height, longest_side);
    let mut k = recorded.resized(width, height);
    let mut image = color.reduced(width, height);
    drop(color);
    if let Some(mask) = &entry.mask {
        apply_mask(&mut image, upright(&entry.lens, mask()?), &entry.name)?;
    }
    let mut depth = measured.map(|measured| measured.onto(&k)).transpose()?;
    if entry.lens.distortion != Distortion::None {
        let undistortion = Undistortion::new(&k, &entry.lens.distortion).map_err(fail)?;
        image = undistortion.color(&image);
        if let Some(depth) = &mut depth {
            depth.map = depth.map.select(undistortion.nearest());
        }
        k = undistortion.intrinsics;
    }
    let depth_step = depth.as_ref().map_or(1.0, |d| d.step);
    let depth = depth.map(|Registered { map, .. }| within_mask(map, &image.rgba));
    let camera = Camera { intrinsics: k, world_to_camera: entry.world_to_camera };
    let view = View { name: entry.name.clone(), camera, rgba: image.rgba, depth, derived: None };
    Ok(RecordedFrame { view, time: entry.time, depth_step })
}

/// The error of a depth image that cannot be read; if the colour image is grey, the two may have changed places.
fn mixed_up(error: RecordingError, entry: &Entry, color: &Color) -> RecordingError {
    match error {
        RecordingError::File(crate::FileError::Malformed { path, reason })
            if color.rgba.iter().all(|p| p[0] == p[1] && p[1] == p[2]) =>
        {
            let question = "is grey as depth is: are colour and depth mixed up? Exchange their files";
            RecordingError::malformed(&path, format!("{reason}; its colour image {} {question}", entry.name))
        }
        other => other,
    }
}

/// The pixels that the intrinsics belong to: turned as EXIF states only if the stated size has the turned shape.
fn upright(lens: &Lens, color: Color) -> Color {
    let stored = (color.width, color.height);
    match lens.size {
        Some(size) if !same_shape(size, stored) && same_shape(size, (stored.1, stored.0)) => color.oriented(),
        _ => color,
    }
}

/// Replaces alpha by the brightness of the mask.
fn apply_mask(image: &mut Color, mask: Color, name: &str) -> Result<(), RecordingError> {
    if !same_shape((mask.width, mask.height), (image.width, image.height)) || mask.width < image.width {
        let reason = format!(
            "its mask is {}x{}, the image {}x{}; write the mask in the size of the image",
            mask.width, mask.height, image.width, image.height
        );
        return Err(RecordingError::malformed(Path::new(name), reason));
    }
    let mask = mask.reduced(image.width, image.height);
    for (pixel, mask) in image.rgba.iter_mut().zip(&mask.rgba) {
        pixel[3] = mask[0].max(mask[1]).max(mask[2]);
    }
    Ok(())
}

/// Depth outside a mask is removed.
fn within_mask(depth: DepthMap, rgba: &[[u8; 4]]) -> DepthMap {
    if rgba.iter().all(|p| p[3] >= OBJECT_ALPHA) {
        return depth;
    }
    let counts = depth.counts().iter().zip(rgba).map(|(count, p)| if p[3] >= OBJECT_ALPHA { *count } else { 0 });
    DepthMap::new(counts.collect(), depth.per_unit())
}
