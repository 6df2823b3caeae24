//! What stages save, and load again when a run resumes.

use super::Error;
use super::points::{points_as_splats, splats_as_points};
use crate::articulation::MotionParameters;
use crate::articulation::Trained;
use crate::discover::{Discovery, Support};
use artgs_core::{JointAlternative, JointEstimate, PerState, Splats, State};
use artgs_io::run_folder::{CANONICAL_FRAME, RunFolder, load_json, remove_file, save_json};
use artgs_io::{FileError, read_splat_ply, write_splat_ply};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Serialize, Deserialize)]
struct FoundFile {
    parts: Vec<JointEstimate>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    alternatives: Vec<Vec<JointAlternative>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    support: Vec<Support>,
    diagonal: f64,
    spacing: f64,
    tolerance: f64,
    #[serde(default)]
    noisy: bool,
    warnings: Vec<String>,
}

#[derive(Serialize, Deserialize)]
struct TrainedFile {
    parts: Vec<JointEstimate>,
    /// Half motions as trained: a general one is more than the joint it is taken for.
    joints: Vec<MotionParameters>,
}

/// A file that cannot be read is computed again, as a missing one is.
fn readable<T: DeserializeOwned>(path: &Path) -> Option<T> {
    load_json(path).ok().flatten()
}

pub(super) fn save_single(folder: &RunFolder, single: &PerState<Splats>) -> Result<(), Error> {
    for (state, splats) in single.enumerate() {
        write_splat_ply(&folder.single_splats(state), splats, None, state.name())?;
    }
    Ok(())
}

pub(super) fn load_single(folder: &RunFolder) -> Option<PerState<Splats>> {
    PerState::try_from_fn(|state| Some(read_splat_ply(&folder.single_splats(state)).ok()?.0))
}

pub(super) fn save_discovery(folder: &RunFolder, found: &Discovery) -> Result<(), Error> {
    for state in State::ALL {
        let splats = points_as_splats(&found.clouds[state], found.spacing);
        write_splat_ply(&folder.found_points(state), &splats, Some(&found.labels[state]), state.name())?;
    }
    let Discovery { parts, alternatives, support, diagonal, spacing, tolerance, noisy, warnings, .. } = found.clone();
    let file = FoundFile { parts, alternatives, support, diagonal, spacing, tolerance, noisy, warnings };
    Ok(save_json(&folder.found_parts(), &file)?)
}

pub(super) fn load_discovery(folder: &RunFolder) -> Option<Discovery> {
    let FoundFile { parts, alternatives, support, diagonal, spacing, tolerance, noisy, warnings } =
        readable(&folder.found_parts())?;
    let load = |state: State| {
        let (splats, labels) = read_splat_ply(&folder.found_points(state)).ok()?;
        Some((splats_as_points(&splats), labels?))
    };
    let ((start, start_labels), (end, end_labels)) = (load(State::START)?, load(State::END)?);
    let (clouds, labels) = (PerState::new(start, end), PerState::new(start_labels, end_labels));
    Some(Discovery { clouds, labels, parts, alternatives, support, diagonal, spacing, tolerance, noisy, warnings })
}

/// What [`load_discovery`] loads after [`save_discovery`]: files hold less than memory, and a run must continue from
/// the same whether it is resumed or not.
pub(super) fn as_saved(found: Discovery) -> Discovery {
    let clouds = found.clouds.as_ref().map(|cloud| splats_as_points(&points_as_splats(cloud, found.spacing)));
    Discovery { clouds, ..found }
}

pub(super) fn save_trained(folder: &RunFolder, trained: &Trained, parts: &[JointEstimate]) -> Result<(), Error> {
    write_splat_ply(&folder.trained_splats(), &trained.splats, Some(&trained.labels), CANONICAL_FRAME)?;
    let file = TrainedFile { parts: parts.to_vec(), joints: trained.joints.clone() };
    Ok(save_json(&folder.trained_joints(), &file)?)
}

pub(super) fn load_trained(folder: &RunFolder) -> Option<(Trained, Vec<JointEstimate>)> {
    let TrainedFile { parts, joints } = readable(&folder.trained_joints())?;
    let (splats, labels) = read_splat_ply(&folder.trained_splats()).ok()?;
    Some((Trained { splats, labels: labels?, joints }, parts))
}

/// Removes what [`load_trained`] loads.
pub(super) fn forget_trained(folder: &RunFolder) -> Result<(), FileError> {
    remove_file(&folder.trained_joints())
}

/// Seconds of each stage in the run that computed it.
pub(super) type StageTimes = BTreeMap<String, f64>;

pub(super) fn load_times(folder: &RunFolder) -> StageTimes {
    readable(&folder.stage_times()).unwrap_or_default()
}

pub(super) fn save_times(folder: &RunFolder, times: &StageTimes) -> Result<(), FileError> {
    save_json(&folder.stage_times(), times)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::Cloud;
    use artgs_core::{JointKind, Rigid};
    use glam::Vec3;

    fn numbers() -> impl Iterator<Item = f64> {
        let mut state = 1_u64;
        std::iter::repeat_with(move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        })
    }

    #[test]
    fn parts_that_could_not_be_registered_come_back() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(root.path());
        let part = |parent, rms, confidence| JointEstimate {
            parent,
            rms,
            confidence,
            ..JointEstimate::new(JointKind::Prismatic, Rigid::IDENTITY)
        };
        let parts = vec![part(0, None, None), part(1, Some(0.5), Some(0.25))];
        let other = JointAlternative {
            kind: JointKind::Revolute,
            motion: Rigid::IDENTITY,
            cost: 0.25,
            what: "turns".into(),
            advice: "open it further".into(),
        };
        let found = Discovery { parts, alternatives: vec![vec![], vec![other]], ..Discovery::default() };
        save_discovery(&folder, &found).unwrap();
        let loaded = load_discovery(&folder).unwrap();
        assert_eq!((loaded.parts, loaded.alternatives), (found.parts, found.alternatives));
    }

    #[test]
    fn a_discovery_in_memory_is_the_one_that_is_loaded() {
        let root = tempfile::tempdir().unwrap();
        let folder = RunFolder::new(root.path());
        let mut numbers = numbers();
        let mut vectors = move || {
            let mut next = || numbers.next().unwrap() as f32;
            Vec3::new(next(), next(), next())
        };
        let mut cloud = || {
            let mut cloud = Cloud::default();
            for _ in 0..500 {
                cloud.points.push(vectors());
                cloud.normals.push(vectors().normalize());
                cloud.colors.push(vectors() + 0.5);
                cloud.roughness.push(0.25);
            }
            cloud
        };
        let clouds = PerState::from_fn(|_| cloud());
        let labels = PerState::from_fn(|_| (0..500).map(|i| i % 3).collect());
        let found = Discovery { clouds, labels, spacing: 0.01, diagonal: 1.0 / 3.0, ..Discovery::default() };
        save_discovery(&folder, &found).unwrap();
        let (loaded, kept) = (load_discovery(&folder).unwrap(), as_saved(found));
        assert_eq!((loaded.labels, loaded.diagonal), (kept.labels, kept.diagonal));
        for (a, b) in loaded.clouds.iter().zip(&kept.clouds) {
            assert_eq!((&a.points, &a.normals), (&b.points, &b.normals));
            assert_eq!((&a.colors, &a.roughness), (&b.colors, &b.roughness));
        }
    }

    #[test]
    fn numbers_come_back_to_the_last_bit() {
        let root = tempfile::tempdir().unwrap();
        let path = RunFolder::new(root.path()).stage("numbers.json");
        let numbers: Vec<f64> = numbers().take(10_000).collect();
        save_json(&path, &numbers).unwrap();
        let read: Vec<f64> = readable(&path).unwrap();
        assert!(numbers.iter().zip(&read).all(|(a, b)| a.to_bits() == b.to_bits()) && read.len() == numbers.len());
    }
}
