//! Stray Scanner: `odometry.csv` (pose and intrinsics per frame; camera-to-world, OpenCV axes, metres; +Y is up), `rgb.mp4`,
//! `depth/N.png` (mm) or `.npy`, `confidence/N.png` (0 to 2). Without the video, frames may be images `rgb/N.jpg`.

use super::depth::Measured;
use super::depth_file;
use super::files::{Odd, Table, first_file, rows, sift, text};
use super::index::{Entry, Gaps, Index, Load};
use super::lens::{Distortion, Lens};
use super::pixels::{Color, read_color};
use super::pose::{Axes, is_lost, upright};
use super::video::VideoFrames;
use super::write::{SensorDepth, write_jpeg};
use super::{RecordingError, RecordingOptions};
use crate::write_atomic;
use artgs_core::Recording;
use glam::{DQuat, DVec2, DVec3};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

/// The app computes intrinsics for these images.
const SIZE: (u32, u32) = (1920, 1440);

pub(super) fn matches(dir: &Path) -> bool {
    dir.join("odometry.csv").is_file()
}

/// A row of `odometry.csv`.
struct Odometry {
    time: f64,
    /// Number as in file names.
    frame: String,
    world_to_camera: artgs_core::Rigid,
    /// fx, fy, cx, cy.
    camera: Option<[f64; 4]>,
}

pub(super) fn index(dir: &Path, options: &RecordingOptions) -> Result<Index, RecordingError> {
    let path = dir.join("odometry.csv");
    let Table { rows: odometry, notes } = odometry(&path)?;
    let matrix = camera_matrix(dir)?;
    let video = first_file(dir, &["rgb.mp4"]).filter(|_| !dir.join("rgb").is_dir());
    let video = video.map(|v| VideoFrames::decode(&v, options.longest_side)).transpose()?;
    let mut index = Index { up: Some(DVec3::Y), metric: true, ..Index::default() };
    index.note(&path, notes);
    let (mut no_image, mut gaps) = (Vec::new(), Gaps::default());
    for Odometry { time, frame, world_to_camera, camera } in odometry {
        let Some([fx, fy, cx, cy]) = camera.or(matrix) else {
            return Err(RecordingError::incomplete(
                dir,
                "no intrinsics in odometry.csv and no camera_matrix.csv; add it",
            ));
        };
        let Some(color) = color(dir, &frame, video.as_ref()) else {
            no_image.push(frame);
            continue;
        };
        let depth = depth_file::find(&dir.join("depth"), &[&frame]);
        let confidence = first_file(&dir.join("confidence"), &[&format!("{frame}.png")]);
        if depth.is_none() {
            gaps.unnamed.push(frame.clone());
        }
        // Intrinsics of files that other programs wrote belong to their images.
        let size = (cx > 0.4 * f64::from(SIZE.0)).then_some(SIZE);
        index.entries.push(Entry {
            name: format!("frame {frame}"),
            time: Some(time),
            world_to_camera,
            lens: Lens {
                focal: DVec2::new(fx, fy),
                center: Some(DVec2::new(cx, cy)),
                size,
                distortion: Distortion::None,
            },
            color,
            depth: depth
                .map(|d| -> Load<Measured> { Box::new(move || Measured::read_phone(&d, confidence.as_deref())) }),
            mask: None,
        });
    }
    index.skip(dir, "images do not exist", &no_image);
    index.warn_gaps(dir, &gaps);
    Ok(index)
}

fn color(dir: &Path, frame: &str, video: Option<&Arc<VideoFrames>>) -> Option<Load<Color>> {
    if let Some(video) = video {
        let number = frame.parse::<usize>().ok().filter(|n| *n < video.count)?;
        let video = Arc::clone(video);
        return Some(Box::new(move || read_color(&video.path(number))));
    }
    let image = first_file(&dir.join("rgb"), &[&format!("{frame}.jpg"), &format!("{frame}.png")])?;
    Some(Box::new(move || read_color(&image)))
}

fn odometry(path: &Path) -> Result<Table<Odometry>, RecordingError> {
    let fail = |reason: String| RecordingError::malformed(path, reason);
    let rows = rows(path)?;
    let Some((head, rows)) = rows.split_first() else {
        return Err(fail("is empty; copy or export the recording again".into()));
    };
    let columns: Vec<&str> = head.text.split(',').map(str::trim).collect();
    let column = |name: &str| columns.iter().position(|c| *c == name);
    let needed = ["timestamp", "frame", "x", "y", "z", "qx", "qy", "qz", "qw"];
    if let Some(missing) = needed.iter().find(|n| column(n).is_none()) {
        return Err(fail(format!("no column `{missing}`; record with a newer version of the app")));
    }
    let parse = |row: &super::files::Row| -> Result<Odometry, Odd> {
        let words: Vec<&str> = row.text.split(',').map(str::trim).collect();
        let value = |name: &str| {
            let word = column(name).and_then(|c| words.get(c)).copied().unwrap_or("");
            word.parse::<f64>().map_err(|_| {
                let line = row.line;
                Odd::Wrong(format!("line {line}: column `{name}` is `{word}`, must be a number; remove the line"))
            })
        };
        let position = DVec3::new(value("x")?, value("y")?, value("z")?);
        let q = [value("qx")?, value("qy")?, value("qz")?, value("qw")?];
        if is_lost(&position.to_array(), &q) {
            return Err(Odd::Lost);
        }
        let pose = Axes::OpenCv.world_to_camera_of_quaternion(q, position);
        let camera = ["fx", "fy", "cx", "cy"].map(value);
        let camera = if let [Ok(fx), Ok(fy), Ok(cx), Ok(cy)] = camera { Some([fx, fy, cx, cy]) } else { None };
        let frame = column("frame").and_then(|c| words.get(c)).copied().unwrap_or("");
        if frame.is_empty() || !frame.bytes().all(|b| b.is_ascii_digit()) {
            let reason = format!("line {}: column `frame` is `{frame}`, must be a number; remove the line", row.line);
            return Err(Odd::Wrong(reason));
        }
        Ok(Odometry {
            time: value("timestamp")?,
            frame: frame.into(),
            world_to_camera: pose.map_err(|e| Odd::Wrong(format!("line {}: {e}", row.line)))?,
            camera: camera.filter(|k| k.iter().all(|v| v.is_finite())),
        })
    };
    sift(path, rows, parse)
}

/// fx, fy, cx, cy of `camera_matrix.csv`.
fn camera_matrix(dir: &Path) -> Result<Option<[f64; 4]>, RecordingError> {
    let Some(path) = first_file(dir, &["camera_matrix.csv"]) else { return Ok(None) };
    let text = text(&path)?;
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty());
    let numbers: Result<Vec<f64>, _> = words.map(str::parse::<f64>).collect();
    match numbers.as_deref() {
        Ok([fx, _, cx, _, fy, cy, _, _, _]) => Ok(Some([*fx, *fy, *cx, *cy])),
        _ => Err(RecordingError::malformed(
            &path,
            "expected a 3x3 matrix of numbers; copy or export the recording again",
        )),
    }
}

/// Without an encoder of videos, frames are images `rgb/N.jpg`. Intrinsics belong to these images.
pub(super) fn write(dir: &Path, recording: &Recording) -> Result<(), RecordingError> {
    let turn = upright(recording.up);
    let mut table = String::from("timestamp, frame, x, y, z, qx, qy, qz, qw, fx, fy, cx, cy\n");
    for (i, frame) in recording.frames.iter().enumerate() {
        let (time, k) = (frame.time.unwrap_or(i as f64 / 60.0), &frame.view.camera.intrinsics);
        let (r, t) = Axes::OpenCv.camera_to_world(&frame.view.camera, turn);
        let q = DQuat::from_mat3(&r);
        let _ = writeln!(
            table,
            "{time:.6}, {i:06}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}",
            t.x, t.y, t.z, q.x, q.y, q.z, q.w, k.fx, k.fy, k.cx, k.cy
        );
        write_jpeg(&dir.join(format!("rgb/{i:06}.jpg")), &frame.view)?;
        let Some(depth) = SensorDepth::new(frame) else { continue };
        depth.write_png(&dir.join(format!("depth/{i:06}.png")))?;
        depth.write_confidence(&dir.join(format!("confidence/{i:06}.png")), 2)?;
    }
    if let Some(k) = recording.frames.first().map(|f| f.view.camera.intrinsics) {
        let matrix = format!("{}, 0.0, {}\n0.0, {}, {}\n0.0, 0.0, 1.0\n", k.fx, k.cx, k.fy, k.cy);
        write_atomic(&dir.join("camera_matrix.csv"), matrix.as_bytes())?;
    }
    Ok(write_atomic(&dir.join("odometry.csv"), table.as_bytes())?)
}
