//! Poses over time from a file `timestamp tx ty tz qx qy qz qw`, as TUM RGB-D and SLAM systems write it.

use super::RecordingError;
use super::files::{Odd, Row, Table, loose_numbers, rows, table, text};
use super::pose::{Axes, is_lost};
use super::tum::NEAR;
use artgs_core::Rigid;
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::Path;

/// Pose of the camera at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pose {
    /// Seconds.
    pub(super) time: f64,
    pub(super) world_to_camera: Rigid,
}

/// Poses by time, and in the order of the file.
pub(super) struct Trajectory {
    by_time: Vec<Pose>,
    /// The pose of every row, none for those that are left out.
    pub(super) by_row: Vec<Option<Pose>>,
    /// What was left out of the file.
    pub(super) notes: Vec<String>,
}

/// Longest gap between two poses that is interpolated, seconds.
const GAP: f64 = 0.1;

impl Trajectory {
    /// Reads a file; further columns, which programs add for numbers of frames or velocities, are not used.
    pub(super) fn read(path: &Path) -> Result<Self, RecordingError> {
        let scalar_first = text(path)?.lines().next().is_some_and(states_scalar_first);
        let Table { rows: placed, notes } = table(path, |row| Ok((row.line, pose(row, scalar_first)?)))?;
        let of_line: BTreeMap<usize, Pose> = placed.iter().copied().collect();
        if placed.is_empty() {
            let reason = match notes.first() {
                Some(note) => format!("contains no pose that can be used: {note}"),
                None => "contains no pose; write `timestamp tx ty tz qx qy qz qw` per frame".into(),
            };
            return Err(RecordingError::malformed(path, reason));
        }
        let lines = rows(path)?.into_iter().filter(|row| !row.is_header()).map(|row| row.line);
        let by_row = lines.map(|line| of_line.get(&line).copied()).collect();
        let mut by_time: Vec<Pose> = placed.into_iter().map(|(_, pose)| pose).collect();
        by_time.sort_by(|a, b| a.time.total_cmp(&b.time));
        Ok(Self { by_time, by_row, notes })
    }

    /// The pose nearest in time, at most `limit` seconds away.
    pub(super) fn nearest(&self, time: f64, limit: f64) -> Option<Pose> {
        let i = self.by_time.partition_point(|p| p.time < time);
        let near = self.by_time[i.saturating_sub(1)..(i + 1).min(self.by_time.len())].iter();
        let apart = |p: &&Pose| (p.time - time).abs();
        near.min_by(|a, b| apart(a).total_cmp(&apart(b))).filter(|p| apart(p) <= limit).copied()
    }

    /// The pose at a time: interpolated between neighbours if one is near enough, else none.
    pub(super) fn at(&self, time: f64) -> Option<Pose> {
        let nearest = self.nearest(time, NEAR)?;
        let i = self.by_time.partition_point(|p| p.time < time);
        let (Some(before), Some(after)) = (self.by_time.get(i.wrapping_sub(1)), self.by_time.get(i)) else {
            return Some(nearest);
        };
        let gap = after.time - before.time;
        if gap > GAP || gap <= 0.0 {
            return Some(nearest);
        }
        let share = (time - before.time) / gap;
        let (a, b) = (before.world_to_camera.inverse(), after.world_to_camera.inverse());
        let between = Rigid {
            rotation: a.rotation.slerp(b.rotation, share),
            translation: a.translation.lerp(b.translation, share),
        };
        Some(Pose { time, world_to_camera: between.inverse() })
    }
}

/// True for names of columns in which the quaternion begins with w, as those of EuRoC.
fn states_scalar_first(head: &str) -> bool {
    let head = head.to_ascii_lowercase();
    let at = |names: [&str; 3]| names.iter().filter_map(|name| head.find(name)).min();
    matches!((at(["qw", "q_w", "q_rs_w"]), at(["qx", "q_x", "q_rs_x"])), (Some(w), Some(x)) if w < x)
}

/// The pose of a row.
fn pose(row: &Row, scalar_first: bool) -> Result<Pose, Odd> {
    let wrong = |reason: String| Odd::Wrong(format!("line {}: {reason}", row.line));
    let Some(numbers) = loose_numbers(&row.text) else {
        let is_number = |word: &str| word.trim_matches([',', ';']).parse::<f64>().is_ok();
        let word = row.words().find(|word| !is_number(word)).unwrap_or("");
        return Err(wrong(format!("`{word}` is not a number; correct or remove the line")));
    };
    let &[time, x, y, z, a, b, c, d, ..] = numbers.as_slice() else {
        let count = numbers.len();
        return Err(wrong(format!(
            "{count} values, expected 8: timestamp tx ty tz qx qy qz qw; complete or remove the line"
        )));
    };
    let q = if scalar_first { [b, c, d, a] } else { [a, b, c, d] };
    if !time.is_finite() {
        return Err(wrong(format!("the time is `{time}`; correct or remove the line")));
    }
    if is_lost(&[x, y, z], &q) {
        return Err(Odd::Lost);
    }
    // Nanoseconds since 1970 are seen by their size.
    let time = if time > 1e14 { 1e-9 * time } else { time };
    let pose = Axes::OpenCv.world_to_camera_of_quaternion(q, DVec3::new(x, y, z));
    Ok(Pose { time, world_to_camera: pose.map_err(wrong)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_interpolated_and_far_times_have_none() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("poses.txt");
        std::fs::write(&path, "# t\n10.01 1 0 0 0 0 0 1\n10.00 0 0 0 0 0 0 1\n11 5 0 0 0 0 0 -1\n").unwrap();
        let poses = Trajectory::read(&path).unwrap();
        let at = |t| poses.at(t).map(|p| p.world_to_camera.inverse().translation.x);
        assert!((at(10.0025).unwrap() - 0.25).abs() < 1e-6);
        assert_eq!((at(11.01), at(10.5)), (Some(5.0), None));
    }

    #[test]
    fn wrong_lines_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("poses.txt");
        for (text, part) in [
            ("1 0 0 0 0 0 0\n", "line 1: 7 values"),
            ("0 0 0 0 0 0 0 2\n", "line 1: the quaternion has length 2"),
            ("0 0 0 0 0 0 x 1\n", "line 1: `x`"),
            ("0 0 nan 0 0 0 0 1\n1 0 0 0 0 0 0 0\n", "2 of 2 poses are lost"),
            ("\n", "contains no pose"),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = Trajectory::read(&path).err().unwrap().to_string();
            assert!(message.contains("poses.txt") && message.contains(part), "{message}");
        }
    }

    #[test]
    fn odd_rows_are_left_out_and_counted() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("poses.txt");
        let text = "timestamp tx ty tz qx qy qz qw id\n0 1 0 0 0 0 0 1 7\n1 -inf 0 0 0 0 0 1 8\n2 0 0 0 0 0 0 0 9\n3 4 0 0 0 0 0 1 9\n4 0 0\n";
        std::fs::write(&path, text).unwrap();
        let read = Trajectory::read(&path).unwrap();
        assert_eq!(read.by_time.iter().map(|p| p.time).collect::<Vec<_>>(), [0.0, 3.0]);
        assert_eq!(read.notes.len(), 2);
        assert!(read.notes[0].contains("1 of 5 lines cannot be read") && read.notes[0].contains("line 6: 3 values"));
        assert!(
            read.notes[1].contains("2 of 5 poses are lost") && read.notes[1].contains("line 3"),
            "{:?}",
            read.notes
        );
    }

    #[test]
    fn columns_of_euroc_are_read_by_their_names() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("poses.csv");
        let text = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v\n\
                    1403636580838555648,1,2,3,1,0,0,0,0.5\n";
        std::fs::write(&path, text).unwrap();
        let read = Trajectory::read(&path).unwrap();
        assert!((read.by_time[0].time - 1403636580.838).abs() < 0.01 && read.notes.is_empty());
        assert!(read.by_time[0].world_to_camera.angle() < 1e-9);
    }
}
