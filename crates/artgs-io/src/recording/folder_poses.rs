//! Poses of folders of images: where they are, and what their rows mean.

use super::RecordingError;
use super::files::{Odd, Row, loose_numbers, names, rows};
use super::index::Index;
use super::matrices::{matrix, matrix_file};
use super::pose::{Axes, is_lost};
use super::trajectory::{Pose, Trajectory};
use super::tum::NEAR;
use artgs_core::Rigid;
use glam::{DQuat, DVec3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Where the poses are.
#[derive(Debug)]
pub(super) enum Poses {
    /// A folder with one matrix per frame.
    Folder(PathBuf),
    File(PathBuf),
}

/// Files with poses, the better ones first: those of the camera before those of the robot that carries it.
const FILES: [&str; 10] = [
    "pose.txt",
    "poses.txt",
    "traj.txt",
    "scene/trajectory.log",
    "trajectory.log",
    "lowres_wide.traj",
    "traj_w_c.txt",
    "groundtruth.txt",
    "trajectory.txt",
    "camera_poses.txt",
];
const ENDS: [&str; 5] = ["_camera_poses.txt", "_poses.txt", ".log", ".traj", ".freiburg"];

impl Poses {
    pub(super) fn find(dir: &Path) -> Option<Self> {
        let folder =
            ["pose", "poses"].map(|n| dir.join(n)).into_iter().find(|p| names(p).iter().any(|n| n.ends_with(".txt")));
        let all = names(dir);
        let named = || FILES.iter().map(|n| dir.join(n)).find(|p| p.is_file());
        let ending = || ENDS.iter().find_map(|end| all.iter().find(|n| n.ends_with(end)).map(|n| dir.join(n)));
        folder.map(Self::Folder).or_else(|| named().or_else(ending).map(Self::File))
    }
}

/// Poses by the order or the numbers of images.
pub(super) struct Read {
    file: PathBuf,
    by_key: BTreeMap<String, PathBuf>,
    by_row: Vec<Result<Rigid, String>>,
    /// Poses by key, of files that state the numbers or times of images.
    known: BTreeMap<String, Rigid>,
    trajectory: Option<Trajectory>,
    /// True if the format's worlds have z up.
    pub(super) gravity: bool,
}

impl Read {
    pub(super) fn file(&self) -> &Path {
        &self.file
    }

    /// The pose of the image with this place in the list and this number.
    pub(super) fn of(&self, place: usize, key: &str) -> Option<Result<Rigid, Odd>> {
        if let Some(path) = self.by_key.get(key) {
            return Some(matrix_file(path, Axes::OpenCv));
        }
        if let Some(pose) = self.known.get(key) {
            return Some(Ok(*pose));
        }
        if let Some(trajectory) = &self.trajectory {
            let time = key.parse::<f64>().ok()?;
            return Some(Ok(trajectory.nearest(time, NEAR)?.world_to_camera));
        }
        let pose = self.by_row.get(place)?;
        Some(pose.clone().map_err(|reason| if reason.is_empty() { Odd::Lost } else { Odd::Wrong(reason) }))
    }
}

/// Reads the poses of images, which have numbers and paths. Notes about odd rows go to the index.
pub(super) fn read(poses: &Poses, images: &[(String, PathBuf)], index: &mut Index) -> Result<Read, RecordingError> {
    let mut read = Read {
        file: PathBuf::new(),
        by_key: BTreeMap::new(),
        by_row: Vec::new(),
        known: BTreeMap::new(),
        trajectory: None,
        gravity: false,
    };
    match poses {
        Poses::Folder(dir) => {
            read.file = dir.clone();
            let files = super::folders::numbered(dir, |name| name.ends_with(".txt"));
            read.by_key = files.into_iter().map(|(number, path)| (super::folders::key(&number), path)).collect();
        }
        Poses::File(path) => {
            read.file = path.clone();
            of_file(path, images, index, &mut read)?;
        }
    }
    Ok(read)
}

fn of_file(
    path: &Path,
    images: &[(String, PathBuf)],
    index: &mut Index,
    read: &mut Read,
) -> Result<(), RecordingError> {
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("");
    let rows: Vec<Row> = rows(path)?.into_iter().filter(|row| !row.is_header()).collect();
    let widths = rows.iter().filter_map(|row| loose_numbers(&row.text)).map(|n| n.len());
    let width = widths.fold(BTreeMap::new(), |mut counts, n| {
        *counts.entry(n).or_insert(0) += 1;
        counts
    });
    let width = width.into_iter().max_by_key(|(_, count)| *count).map_or(0, |(n, _)| n);
    match width {
        4 => of_log(path, &rows, read)?,
        12 | 16 => {
            read.by_row =
                rows.iter().map(|row| numbers(row).and_then(|n| matrix(&n, Axes::OpenCv)).map_err(text)).collect()
        }
        7 if name.ends_with(".traj") => {
            read.gravity = true;
            of_axis_angles(path, &rows, images, read)?;
        }
        7 => read.by_row = rows.iter().map(|row| numbers(row).and_then(|n| quaternion(&n)).map_err(text)).collect(),
        _ => {
            let trajectory = Trajectory::read(path)?;
            index.note(path, trajectory.notes.clone());
            of_trajectory(path, &rows, trajectory, images, read)?;
        }
    }
    if !read.by_row.is_empty() && read.by_row.len() != images.len() {
        index.warnings.push(format!(
            "{}: {} poses for {} images; they belong to the images in their order",
            path.display(),
            read.by_row.len(),
            images.len()
        ));
    }
    Ok(())
}

fn numbers(row: &Row) -> Result<Vec<f64>, Odd> {
    loose_numbers(&row.text).ok_or_else(|| Odd::Wrong(format!("line {}: a value is not a number", row.line)))
}

/// The empty text stands for a lost pose.
fn text(odd: Odd) -> String {
    if let Odd::Wrong(reason) = odd { reason } else { String::new() }
}

/// tx ty tz qx qy qz qw.
fn quaternion(n: &[f64]) -> Result<Rigid, Odd> {
    let &[x, y, z, qx, qy, qz, qw] = n else { return Err(Odd::Wrong(format!("{} values, expected 7", n.len()))) };
    if is_lost(&[x, y, z], &[qx, qy, qz, qw]) {
        return Err(Odd::Lost);
    }
    Axes::OpenCv.world_to_camera_of_quaternion([qx, qy, qz, qw], DVec3::new(x, y, z)).map_err(Odd::Wrong)
}

/// Open3D: three numbers of a frame, then a matrix of four rows. Frames without a pose are not listed: the first number counts images.
fn of_log(path: &Path, rows: &[Row], read: &mut Read) -> Result<(), RecordingError> {
    let cut = || RecordingError::malformed(path, "ends inside a matrix; export the trajectory again");
    let mut at = 0;
    while at < rows.len() {
        let block = rows.get(at..at + 5).ok_or_else(cut)?;
        let cells: Vec<f64> = block[1..].iter().filter_map(|row| loose_numbers(&row.text)).flatten().collect();
        read.by_row.push(matrix(&cells, Axes::OpenCv).map_err(text));
        at += 5;
    }
    Ok(())
}

/// ARKitScenes: time, axis times angle, translation, from the world to the camera; times are in the names of images.
fn of_axis_angles(
    path: &Path,
    rows: &[Row],
    images: &[(String, PathBuf)],
    read: &mut Read,
) -> Result<(), RecordingError> {
    let mut poses: Vec<(f64, Rigid)> = Vec::new();
    for row in rows {
        let [time, ax, ay, az, x, y, z] = row.numbers().map_err(|e| RecordingError::malformed(path, e))?;
        let rotation = DQuat::from_scaled_axis(DVec3::new(ax, ay, az));
        poses.push((time, Rigid { rotation, translation: DVec3::new(x, y, z) }));
    }
    for (number, _) in images {
        let Ok(time) = number.parse::<f64>() else { continue };
        let apart = |p: &&(f64, Rigid)| (p.0 - time).abs();
        // Poses come ten times a second, images more often.
        if let Some((_, pose)) = poses.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).filter(|p| apart(p) < NEAR) {
            read.known.insert(super::folders::key(number), *pose);
        }
    }
    Ok(())
}

/// Rows of time, position and quaternion: by the number in a ninth column, by time, or by their order.
fn of_trajectory(
    path: &Path,
    rows: &[Row],
    trajectory: Trajectory,
    images: &[(String, PathBuf)],
    read: &mut Read,
) -> Result<(), RecordingError> {
    let keys: Vec<String> = images.iter().map(|(number, _)| super::folders::key(number)).collect();
    for row in rows {
        let Some(n) = loose_numbers(&row.text).filter(|n| n.len() >= 9) else { continue };
        if let (Ok(pose), true) = (quaternion(&n[1..8]), n[8].fract() == 0.0) {
            read.known.insert(format!("{}", n[8]), pose);
        }
    }
    if keys.iter().any(|key| read.known.contains_key(key)) {
        return Ok(());
    }
    read.known.clear();
    let timed = keys.iter().filter(|k| k.parse().is_ok_and(|t| trajectory.nearest(t, NEAR).is_some())).count();
    if 2 * timed >= keys.len() {
        read.trajectory = Some(trajectory);
        return Ok(());
    }
    if trajectory.by_row.len() != images.len() {
        let (poses, images) = (trajectory.by_row.len(), images.len());
        let reason = format!(
            "{poses} poses for {images} images, and neither times nor numbers say which belong together; name images by the times of their poses"
        );
        return Err(RecordingError::malformed(path, reason));
    }
    let pose = |pose: &Option<Pose>| pose.map(|p| p.world_to_camera).ok_or_else(String::new);
    read.by_row = trajectory.by_row.iter().map(pose).collect();
    Ok(())
}
