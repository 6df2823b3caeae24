//! Scores of a replica on disk.

use super::Error;
use crate::evaluate::{EvaluateConfig, Scores, Truth};
use crate::surface::PartMeshes;
use artgs_core::{Mesh, PerState};
use artgs_io::FileError;
use artgs_io::run_folder::RunFolder;
use std::path::Path;

/// Scores the replica in a run's folder against the ground truth in the folder `ground_truth`.
pub fn evaluate(folder: &RunFolder, ground_truth: &Path) -> Result<Scores, Error> {
    let replica = artgs_io::read_replica(folder.root())?;
    let load = |paths: &PerState<String>| -> Result<PerState<Mesh>, FileError> {
        PerState::from_fn(|state| folder.load_mesh(&paths[state])).transpose()
    };
    let parts = replica.parts.iter().map(|part| load(&part.meshes)).collect::<Result<_, _>>()?;
    let meshes = PartMeshes { parts, whole: load(&replica.whole)? };
    let artgs_io::GroundTruth { joints, parents, whole, fixed, movable } = artgs_io::load_ground_truth(ground_truth)?;
    let truth = Truth { joints, parents, whole, fixed, movable };
    Ok(crate::evaluate::evaluate(&replica, &meshes, &truth, &EvaluateConfig::default()))
}
