//! 7-Scenes: `frame-N.color.png`, `frame-N.depth.png` (mm; 0 or 65535 is a hole), `frame-N.pose.txt` (4x4, camera-to-world, OpenCV
//! axes, metres).

use super::depth::Measured;
use super::files::{between, first_file, names, rows, text};
use super::index::{Entry, Index, Load};
use super::lens::Lens;
use super::options::parse_intrinsics;
use super::pixels::read_color;
use super::pose::Axes;
use super::write::{write_depth_png, write_png};
use super::{RecordingError, RecordingOptions};
use crate::write_atomic;
use artgs_core::{Intrinsics, Recording};
use glam::DQuat;
use std::path::Path;

pub(super) fn matches(dir: &Path) -> bool {
    super::format::has_name(dir, "frame-", ".pose.txt")
}

pub(super) fn index(dir: &Path, options: &RecordingOptions) -> Result<Index, RecordingError> {
    let mut index = Index { metric: true, ..Index::default() };
    let lens = lens(dir, options, &mut index.warnings)?;
    let (mut no_image, mut no_depth) = (Vec::new(), Vec::new());
    for name in names(dir) {
        let Some(number) = between(&name, "frame-", ".pose.txt") else { continue };
        let path = |suffix: &str| dir.join(format!("frame-{number}.{suffix}"));
        let Some(image) = ["color.png", "color.jpg"].map(path).into_iter().find(|p| p.is_file()) else {
            no_image.push(number.to_string());
            continue;
        };
        let depth = Some(path("depth.png")).filter(|p| p.is_file());
        if depth.is_none() {
            no_depth.push(number.to_string());
        }
        index.entries.push(Entry {
            name: format!("frame-{number}"),
            time: None,
            world_to_camera: pose(&dir.join(&name))?,
            lens,
            color: Box::new(move || read_color(&image)),
            depth: depth.map(|d| -> Load<Measured> { Box::new(move || Measured::read_png(&d, 1000.0, true)) }),
            mask: None,
        });
    }
    index.warn(dir, "images are missing, their frames are ignored", &no_image);
    if no_depth.len() < index.entries.len() {
        index.warn(dir, "frames have no depth image", &no_depth);
    }
    Ok(index)
}

fn pose(path: &Path) -> Result<artgs_core::Rigid, RecordingError> {
    let fail = |reason: String| RecordingError::malformed(path, reason);
    let rows = rows(path)?;
    if rows.len() < 3 {
        return Err(fail(format!("{} rows, expected 4 rows of 4 numbers; remove the frame", rows.len())));
    }
    let mut m = [0.0; 12];
    for (row, values) in rows.iter().zip(m.as_chunks_mut::<4>().0) {
        *values = row.numbers().map_err(fail)?;
    }
    Axes::OpenCv.world_to_camera_of_rows(&m).map_err(fail)
}

/// Intrinsics from the options, a file with `fx fy cx cy` or a 3x3 matrix, or those of the data set's depth camera.
fn lens(dir: &Path, options: &RecordingOptions, warnings: &mut Vec<String>) -> Result<Lens, RecordingError> {
    if let Some(k) = &options.intrinsics {
        return Ok(Lens::pinhole(k));
    }
    let file = first_file(dir, &["intrinsics.txt", "calibration.txt", "camera-intrinsics.txt"]);
    if let Some(path) = file {
        let text = text(&path)?;
        let words: Vec<&str> = text.split_whitespace().collect();
        let line = if words.len() == 9 { [words[0], words[4], words[2], words[5]].join(" ") } else { text };
        let k = parse_intrinsics(&line).map_err(|e| RecordingError::malformed(&path, e))?;
        return Ok(Lens::pinhole(&k));
    }
    warnings.push(format!(
        "{}: no intrinsics are stated; 585,585,320,240 are used, those of the depth camera of 7-Scenes, whose colour images \
         are not registered to depth",
        dir.display()
    ));
    Ok(Lens::pinhole(&Intrinsics { fx: 585.0, fy: 585.0, cx: 320.5, cy: 240.5, width: 640, height: 480 }))
}

pub(super) fn write(dir: &Path, recording: &Recording) -> Result<(), RecordingError> {
    let Some(first) = recording.frames.first() else {
        return Err(RecordingError::incomplete(dir, "a recording without frames cannot be written"));
    };
    let k = first.view.camera.intrinsics;
    if recording.frames.iter().any(|f| f.view.camera.intrinsics != k) {
        let reason = "7-Scenes recordings have one camera, the frames have several; use another format";
        return Err(RecordingError::incomplete(dir, reason));
    }
    for (i, frame) in recording.frames.iter().enumerate() {
        let path = |suffix: &str| dir.join(format!("frame-{i:06}.{suffix}"));
        write_png(&path("color.png"), &frame.view)?;
        if let Some(depth) = &frame.view.depth {
            write_depth_png(&path("depth.png"), &frame.view, depth, 1000.0)?;
        }
        let rows = Axes::OpenCv.rows(&frame.view.camera, DQuat::IDENTITY);
        let text: String = rows.iter().map(|r| format!("{} {} {} {}\n", r[0], r[1], r[2], r[3])).collect();
        write_atomic(&path("pose.txt"), text.as_bytes())?;
    }
    let intrinsics = format!("{} {} {} {} {} {}\n", k.fx, k.fy, k.cx - 0.5, k.cy - 0.5, k.width, k.height);
    Ok(write_atomic(&dir.join("intrinsics.txt"), intrinsics.as_bytes())?)
}
