//! What stages save between them.

use super::Error;
use super::points::{points_as_splats, splats_as_points};
use crate::articulation::Trained;
use crate::articulation::{MotionModel, MotionParameters};
use crate::discover::Discovery;
use artgs_core::{JointEstimate, JointKind, STATE_NAMES, Splats};
use artgs_io::{FileError, read_splat_ply, write_atomic, write_splat_ply};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Frame named in the PLY files.
pub(super) const CANONICAL: &str = "canonical: world frame of the capture, parts midway between start and end";

/// Files of a run.
#[derive(Clone, Debug)]
pub(super) struct Folder {
    pub(super) root: PathBuf,
}

#[derive(Serialize, Deserialize)]
struct FoundFile {
    parts: Vec<JointEstimate>,
    diagonal: f64,
    spacing: f64,
    tolerance: f64,
    warnings: Vec<String>,
}

#[derive(Serialize, Deserialize)]
struct TrainedFile {
    parts: Vec<JointEstimate>,
    /// Half motions as trained: a general one is more than the joint it is taken for.
    joints: Vec<MotionParameters>,
}

impl Folder {
    pub(super) fn new(root: &Path) -> Self {
        Self { root: root.to_path_buf() }
    }

    fn stage(&self, name: &str) -> PathBuf {
        self.root.join("stages").join(name)
    }

    pub(super) fn write_json(&self, path: &Path, value: &impl Serialize) -> Result<(), Error> {
        let text = serde_json::to_string_pretty(value).unwrap_or_default();
        write_atomic(path, format!("{text}\n").as_bytes())?;
        Ok(())
    }

    fn read_json<T: for<'a> Deserialize<'a>>(&self, name: &str) -> Option<T> {
        serde_json::from_slice(&std::fs::read(self.stage(name)).ok()?).ok()
    }

    pub(super) fn save_single(&self, single: &[Splats; 2]) -> Result<(), FileError> {
        for (splats, state) in single.iter().zip(STATE_NAMES) {
            write_splat_ply(&self.stage(&format!("single_{state}.ply")), splats, None, state)?;
        }
        Ok(())
    }

    pub(super) fn load_single(&self) -> Option<[Splats; 2]> {
        let load = |state: &str| Some(read_splat_ply(&self.stage(&format!("single_{state}.ply"))).ok()?.0);
        Some([load(STATE_NAMES[0])?, load(STATE_NAMES[1])?])
    }

    pub(super) fn save_discovery(&self, found: &Discovery) -> Result<(), Error> {
        for (s, state) in STATE_NAMES.iter().enumerate() {
            let splats = points_as_splats(&found.clouds[s], found.spacing);
            write_splat_ply(&self.stage(&format!("points_{state}.ply")), &splats, Some(&found.labels[s]), state)?;
        }
        let Discovery { parts, diagonal, spacing, tolerance, warnings, .. } = found.clone();
        self.write_json(&self.stage("parts.json"), &FoundFile { parts, diagonal, spacing, tolerance, warnings })
    }

    pub(super) fn load_discovery(&self) -> Option<Discovery> {
        let FoundFile { parts, diagonal, spacing, tolerance, warnings } = self.read_json("parts.json")?;
        let load = |state: &str| {
            let (splats, labels) = read_splat_ply(&self.stage(&format!("points_{state}.ply"))).ok()?;
            Some((splats_as_points(&splats), labels?))
        };
        let ((start, start_labels), (end, end_labels)) = (load(STATE_NAMES[0])?, load(STATE_NAMES[1])?);
        let (clouds, labels) = ([start, end], [start_labels, end_labels]);
        Some(Discovery { clouds, labels, parts, diagonal, spacing, tolerance, warnings })
    }

    pub(super) fn save_trained(&self, trained: &Trained, parts: &[JointEstimate]) -> Result<(), Error> {
        write_splat_ply(&self.stage("articulated.ply"), &trained.splats, Some(&trained.labels), CANONICAL)?;
        let file = TrainedFile { parts: parts.to_vec(), joints: trained.joints.clone() };
        self.write_json(&self.stage("joints.json"), &file)
    }

    /// Removes what [`Self::load_trained`] loads.
    pub(super) fn forget_trained(&self) -> Result<(), FileError> {
        let path = self.stage("joints.json");
        match std::fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => Err(FileError::Write { path, source }),
            _ => Ok(()),
        }
    }

    pub(super) fn load_trained(&self) -> Option<(Trained, Vec<JointEstimate>)> {
        let TrainedFile { parts, joints } = self.read_json("joints.json")?;
        let (splats, labels) = read_splat_ply(&self.stage("articulated.ply")).ok()?;
        Some((Trained { splats, labels: labels?, joints }, parts))
    }
}

/// Optimiser's form of found motions.
pub(super) fn motion_parameters(parts: &[JointEstimate]) -> Vec<MotionParameters> {
    let model = |kind| match kind {
        JointKind::Prismatic => MotionModel::Prismatic,
        JointKind::Revolute => MotionModel::Hinge,
        JointKind::Screw => MotionModel::Screw,
    };
    parts.iter().map(|p| MotionParameters::from_motion(model(p.kind), &p.motion)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_that_could_not_be_registered_come_back() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::new(root.path());
        let part = |rms, confidence| JointEstimate {
            kind: JointKind::Prismatic,
            motion: artgs_core::Rigid::IDENTITY,
            rms,
            confidence,
        };
        let parts = vec![part(None, None), part(Some(0.5), Some(0.25))];
        folder.save_discovery(&Discovery { parts: parts.clone(), ..Discovery::default() }).unwrap();
        let read = folder.load_discovery().unwrap().parts;
        assert_eq!(read, parts);
    }

    #[test]
    fn numbers_come_back_to_the_last_bit() {
        let root = tempfile::tempdir().unwrap();
        let folder = Folder::new(root.path());
        let mut state = 1_u64;
        let numbers: Vec<f64> = std::iter::repeat_with(|| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        })
        .take(10_000)
        .collect();
        folder.write_json(&folder.stage("numbers.json"), &numbers).unwrap();
        let read: Vec<f64> = folder.read_json("numbers.json").unwrap();
        assert!(numbers.iter().zip(&read).all(|(a, b)| a.to_bits() == b.to_bits()) && read.len() == numbers.len());
    }
}
