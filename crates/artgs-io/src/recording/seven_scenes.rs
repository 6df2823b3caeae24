//! 7-Scenes: `frame-N.color.png`, `frame-N.depth.png` (mm; 0 or 65535 is a hole), `frame-N.pose.txt` (4x4, camera-to-world, OpenCV
//! axes, metres).

use super::depth_file::{self, Scale};
use super::files::{between, names};
use super::index::{Entry, Gaps, Index, Load, Poseless};
use super::intrinsics::{self, Cameras};
use super::lens::Lens;
use super::matrices::matrix_file;
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
    let cameras = cameras(dir, options, &mut index.warnings)?;
    let scale = Scale::same(cameras.per_metre.unwrap_or(1000.0));
    let (mut no_image, mut gaps, mut poseless, mut count) = (Vec::new(), Gaps::default(), Poseless::default(), 0);
    for name in names(dir) {
        let Some(number) = between(&name, "frame-", ".pose.txt") else { continue };
        let path = |suffix: &str| dir.join(format!("frame-{number}.{suffix}"));
        let Some(image) = ["color.png", "color.jpg"].map(path).into_iter().find(|p| p.is_file()) else {
            no_image.push(number.to_string());
            continue;
        };
        count += 1;
        let file = dir.join(&name);
        let pose = matrix_file(&file, Axes::OpenCv);
        let Some(world_to_camera) = poseless.keep(&name, pose, |reason| RecordingError::malformed(&file, reason))
        else {
            continue;
        };
        let depth = depth_file::find(dir, &[&format!("frame-{number}.depth")]);
        if depth.is_none() {
            gaps.unnamed.push(number.to_string());
        }
        index.entries.push(Entry {
            name: format!("frame-{number}"),
            time: None,
            world_to_camera,
            lens: cameras.lens,
            color: Box::new(move || read_color(&image)),
            depth: depth
                .map(|d| -> Load<_> { Box::new(move || Ok(cameras.place(depth_file::read(&d, scale, true)?))) }),
            mask: None,
        });
    }
    index.skip(dir, "images do not exist", &no_image);
    poseless.report(&mut index, dir, count)?;
    index.warn_gaps(dir, &gaps);
    Ok(index)
}

/// Intrinsics from the options, a file, or those of the data set's depth camera.
fn cameras(dir: &Path, options: &RecordingOptions, warnings: &mut Vec<String>) -> Result<Cameras, RecordingError> {
    if let Some(cameras) = intrinsics::find(dir, options, warnings)? {
        return Ok(cameras);
    }
    warnings.push(format!(
        "{}: no intrinsics are stated; 585,585,320,240 are used, those of the depth camera of 7-Scenes, whose colour images \
         are not registered to depth",
        dir.display()
    ));
    let k = Intrinsics { fx: 585.0, fy: 585.0, cx: 320.5, cy: 240.5, width: 640, height: 480 };
    Ok(Cameras::of_lens(Lens::pinhole(&k)))
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
