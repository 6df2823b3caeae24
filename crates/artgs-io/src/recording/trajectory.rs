//! Poses over time from a file `timestamp tx ty tz qx qy qz qw`, as TUM RGB-D and SLAM systems write it.

use super::RecordingError;
use super::files::rows;
use super::pose::Axes;
use super::tum::NEAR;
use artgs_core::Rigid;
use glam::DVec3;
use std::path::Path;

/// Pose of the camera at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pose {
    /// Seconds.
    pub(super) time: f64,
    pub(super) world_to_camera: Rigid,
}

/// Poses in the order of the file, and by time.
pub(super) struct Trajectory {
    /// As in the file.
    pub(super) poses: Vec<Pose>,
    by_time: Vec<Pose>,
}

/// Longest gap between two poses that is interpolated, seconds.
const GAP: f64 = 0.1;

impl Trajectory {
    pub(super) fn read(path: &Path) -> Result<Self, RecordingError> {
        let parse = |row: super::files::Row| {
            let [time, x, y, z, qx, qy, qz, qw] = row.numbers()?;
            let pose = Axes::OpenCv.world_to_camera_of_quaternion([qx, qy, qz, qw], DVec3::new(x, y, z));
            Ok(Pose { time, world_to_camera: pose.map_err(|e| format!("line {}: {e}", row.line))? })
        };
        let poses: Result<Vec<Pose>, String> = rows(path)?.into_iter().map(parse).collect();
        let poses = poses.map_err(|e| RecordingError::malformed(path, e))?;
        if poses.is_empty() {
            return Err(RecordingError::malformed(
                path,
                "contains no pose; write `timestamp tx ty tz qx qy qz qw` per frame",
            ));
        }
        let mut by_time = poses.clone();
        by_time.sort_by(|a, b| a.time.total_cmp(&b.time));
        Ok(Self { poses, by_time })
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
            ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0\n", "line 2: 7 values"),
            ("0 0 0 0 0 0 0 2\n", "line 1: the quaternion has length 2"),
            ("0 0 nan 0 0 0 0 1\n", "line 1: `nan`"),
            ("\n", "contains no pose"),
        ] {
            std::fs::write(&path, text).unwrap();
            let message = Trajectory::read(&path).err().unwrap().to_string();
            assert!(message.contains("poses.txt") && message.contains(part), "{message}");
        }
    }
}
