//! TUM RGB-D: `rgb.txt` and `depth.txt` (`timestamp file`), `groundtruth.txt` (`timestamp tx ty tz qx qy qz qw`, camera-to-world,
//! OpenCV axes, metres), depth in counts of 0.2 mm. Images may have indices as time stamps; then the poses, for example in
//! `truth_cam_poses.txt`, belong to them by row.

use super::depth_file::{self, Scale};
use super::files::{Odd, Row, Table, first_file, names, table, text};
use super::index::{Entry, Gaps, Index};
use super::intrinsics::{self, Cameras};
use super::lens::{Distortion, Lens};
use super::pixels::read_color;
use super::pose::Axes;
use super::trajectory::{Pose, Trajectory};
use super::write::{write_depth_png, write_png};
use super::{RecordingError, RecordingOptions};
use crate::write_atomic;
use artgs_core::{Intrinsics, Recording};
use glam::DQuat;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Largest difference of time stamps that belong together, seconds.
pub(super) const NEAR: f64 = 0.02;

/// Counts per metre.
const PER_METRE: f32 = 5000.0;

const KNOWN: &str = ". Known cameras of TUM RGB-D: fr1 517.3,516.5,318.6,255.3; fr2 520.9,521.0,325.1,249.7; \
                     fr3 535.4,539.2,320.1,247.6";

/// Focal lengths, principal point and k1 k2 p1 p2 k3 of the cameras of the data set; images of fr3 are undistorted.
const CAMERAS: [(&str, [f64; 4], [f64; 5]); 3] = [
    ("freiburg1", [517.3, 516.5, 318.6, 255.3], [0.2624, -0.9531, -0.0054, 0.0026, 1.1633]),
    ("freiburg2", [520.9, 521.0, 325.1, 249.7], [0.2312, -0.7849, -0.0033, -0.0001, 0.9172]),
    ("freiburg3", [535.4, 539.2, 320.1, 247.6], [0.0; 5]),
];

pub(super) fn matches(dir: &Path) -> bool {
    dir.join("rgb.txt").is_file() && pose_file(dir).is_some()
}

fn pose_file(dir: &Path) -> Option<PathBuf> {
    let other =
        || names(dir).into_iter().find(|n| n.ends_with(".txt") && (n.contains("poses") || n.contains("trajectory")));
    first_file(dir, &["groundtruth.txt", "truth_cam_poses.txt"]).or_else(|| Some(dir.join(other()?)))
}

/// An image of `rgb.txt` or `depth.txt`.
struct Listed {
    time: f64,
    file: String,
}

fn listed(path: &Path) -> Result<Table<Listed>, RecordingError> {
    let parse = |row: &Row| {
        let wrong = |reason: String| Odd::Wrong(format!("line {}: {reason}", row.line));
        let (time, file) = row.text.split_once([' ', '\t', ',']).unwrap_or((&row.text, ""));
        let time =
            time.parse::<f64>().ok().filter(|t| t.is_finite()).ok_or_else(|| {
                wrong(format!("the time `{time}` is not a finite number; correct or remove the line"))
            })?;
        let file = file.trim().to_string();
        if file.is_empty() {
            Err(wrong("no file name; write `timestamp file`".into()))
        } else {
            Ok(Listed { time, file })
        }
    };
    table(path, parse)
}

pub(super) fn index(dir: &Path, options: &RecordingOptions) -> Result<Index, RecordingError> {
    let (rgb, list) = (dir.join("rgb.txt"), dir.join("depth.txt"));
    let Table { rows: images, notes } = listed(&rgb)?;
    let depths = if list.is_file() { listed(&list)? } else { Table { rows: Vec::new(), notes: Vec::new() } };
    let Some(poses) = options.poses.clone().or_else(|| pose_file(dir)) else {
        return Err(RecordingError::incomplete(dir, "no groundtruth.txt; add the poses of the camera"));
    };
    let trajectory = Trajectory::read(&poses)?;
    let by_row = are_indices(&images) && images.iter().all(|image| trajectory.nearest(image.time, NEAR).is_none());
    let pose_rows = by_row.then(|| rows_of(&images, trajectory.by_row.len())).transpose();
    let pose_rows = pose_rows.map_err(|e| RecordingError::malformed(&poses, e))?;
    let mut index = Index { metric: true, ..Index::default() };
    index.note(&rgb, notes);
    index.note(&list, depths.notes);
    index.note(&poses, trajectory.notes.clone());
    let cameras = cameras(dir, options, &mut index.warnings)?;
    let scale = Scale::same(cameras.per_metre.unwrap_or(PER_METRE));
    let (mut no_pose, mut no_image, mut gaps) = (Vec::new(), Vec::new(), Gaps::default());
    for (i, Listed { time, file }) in images.iter().enumerate() {
        let pose = pose_rows.as_ref().map_or_else(|| trajectory.at(*time), |rows| trajectory.by_row[rows[i]]);
        let path = dir.join(file);
        let Some(Pose { time: pose_time, world_to_camera }) = pose else {
            no_pose.push(file.clone());
            continue;
        };
        if !path.is_file() {
            no_image.push(file.clone());
            continue;
        }
        let mut entry = Entry {
            name: file.clone(),
            time: Some(if by_row { pose_time } else { *time }),
            world_to_camera,
            lens: cameras.lens,
            color: Box::new(move || read_color(&path)),
            depth: None,
            mask: None,
        };
        match nearest(&depths.rows, *time) {
            None => gaps.unnamed.push(file.clone()),
            Some(listed) if !dir.join(&listed.file).is_file() => gaps.missing.push(listed.file.clone()),
            Some(listed) => {
                let path = dir.join(&listed.file);
                entry.depth = Some(Box::new(move || Ok(cameras.place(depth_file::read(&path, scale, false)?))));
            }
        }
        index.entries.push(entry);
    }
    index.skip(dir, "images have no pose within 20 ms", &no_pose);
    index.skip(dir, "images of rgb.txt do not exist", &no_image);
    index.warn(dir, "frames name a depth image that does not exist", &gaps.missing);
    index.warn_no_depth(dir, depths.rows.len(), &gaps.unnamed);
    Ok(index)
}

/// True if time stamps are ascending indices.
fn are_indices(images: &[Listed]) -> bool {
    let is_index = |image: &Listed| image.time >= 0.0 && image.time.fract() == 0.0;
    !images.is_empty() && images.iter().all(is_index) && images.windows(2).all(|w| w[0].time < w[1].time)
}

/// Row of the pose of every image: its index if there are so many poses, else, with one pose per image, in order.
fn rows_of(images: &[Listed], poses: usize) -> Result<Vec<usize>, String> {
    let last = images.last().map_or(0.0, |image| image.time);
    if last < poses as f64 {
        Ok(images.iter().map(|image| image.time as usize).collect())
    } else if poses == images.len() {
        Ok((0..poses).collect())
    } else {
        let images = images.len();
        Err(format!("{poses} poses for {images} images of rgb.txt with indices up to {last}; each image needs a row"))
    }
}

fn nearest(depths: &[Listed], time: f64) -> Option<&Listed> {
    let apart = |d: &&Listed| (d.time - time).abs();
    depths.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).filter(|d| apart(d) <= NEAR)
}

/// Intrinsics from the options, a file, or the name of the sequence in the head of `rgb.txt`.
fn cameras(dir: &Path, options: &RecordingOptions, warnings: &mut Vec<String>) -> Result<Cameras, RecordingError> {
    if let Some(cameras) = intrinsics::find(dir, options, warnings)? {
        return Ok(cameras);
    }
    let head = text(&dir.join("rgb.txt"))?;
    let head: String = head.lines().take_while(|l| l.starts_with('#')).collect();
    let Some((name, [fx, fy, cx, cy], [k1, k2, p1, p2, k3])) = CAMERAS.into_iter().find(|c| head.contains(c.0)) else {
        return Err(RecordingError::Intrinsics { path: dir.into(), hint: KNOWN });
    };
    warnings.push(format!(
        "{}: no intrinsics are stated; those of {name} are used, because rgb.txt names this camera",
        dir.display()
    ));
    let k = Intrinsics { fx, fy, cx: cx + 0.5, cy: cy + 0.5, width: 640, height: 480 };
    let distortion = Distortion::radial([k1, k2, k3, 0.0, 0.0, 0.0], [p1, p2]);
    Ok(Cameras::of_lens(Lens { distortion, ..Lens::pinhole(&k) }))
}

pub(super) fn write(dir: &Path, recording: &Recording) -> Result<(), RecordingError> {
    let Some(first) = recording.frames.first() else {
        return Err(RecordingError::incomplete(dir, "a recording without frames cannot be written"));
    };
    let k = first.view.camera.intrinsics;
    if recording.frames.iter().any(|f| f.view.camera.intrinsics != k) {
        let reason = "TUM recordings have one camera, the frames have several; use another format";
        return Err(RecordingError::incomplete(dir, reason));
    }
    let (mut images, mut depths) = (String::from("# timestamp filename\n"), String::from("# timestamp filename\n"));
    let mut poses = String::from("# timestamp tx ty tz qx qy qz qw\n");
    for (i, frame) in recording.frames.iter().enumerate() {
        let time = frame.time.unwrap_or(i as f64 / 30.0);
        write_png(&dir.join(format!("rgb/{i:06}.png")), &frame.view)?;
        let _ = writeln!(images, "{time:.6} rgb/{i:06}.png");
        if let Some(depth) = &frame.view.depth {
            write_depth_png(&dir.join(format!("depth/{i:06}.png")), &frame.view, depth, PER_METRE)?;
            let _ = writeln!(depths, "{time:.6} depth/{i:06}.png");
        }
        let (r, t) = Axes::OpenCv.camera_to_world(&frame.view.camera, DQuat::IDENTITY);
        let q = DQuat::from_mat3(&r);
        let _ = writeln!(poses, "{time:.6} {} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w);
    }
    let intrinsics = format!("{} {} {} {} {} {}\n", k.fx, k.fy, k.cx - 0.5, k.cy - 0.5, k.width, k.height);
    for (name, text) in
        [("rgb.txt", images), ("depth.txt", depths), ("groundtruth.txt", poses), ("intrinsics.txt", intrinsics)]
    {
        write_atomic(&dir.join(name), text.as_bytes())?;
    }
    Ok(())
}
