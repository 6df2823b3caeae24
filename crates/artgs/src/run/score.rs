//! Scores of a replica on disk.

use super::Error;
use crate::evaluate::{EvaluateConfig, Scores, Truth};
use crate::surface::PartMeshes;
use artgs_core::{Mesh, PerState, State};
use artgs_io::FileError;
use artgs_io::run_folder::RunFolder;
use std::path::Path;

/// Scores the replica in a run's folder against the ground truth in the folder `ground_truth`.
pub fn evaluate(folder: &RunFolder, ground_truth: &Path) -> Result<Scores, Error> {
    let replica = artgs_io::read_replica(folder.root())?;
    let load = |paths: &PerState<String>| -> Result<[Mesh; 2], FileError> {
        let [start, end] = State::ALL.map(|state| folder.load_mesh(&paths[state]));
        Ok([start?, end?])
    };
    let parts = replica.parts.iter().map(|part| load(&part.meshes)).collect::<Result<_, _>>()?;
    let meshes = PartMeshes { parts, whole: load(&replica.whole)? };
    let artgs_io::GroundTruth { joints, parents, whole, fixed, movable } = artgs_io::load_ground_truth(ground_truth)?;
    let movable = movable.into_iter().map(Into::into).collect();
    let truth = Truth { joints, parents, whole: whole.into(), fixed: fixed.into(), movable };
    Ok(crate::evaluate::evaluate(&replica, &meshes, &truth, &EvaluateConfig::default()))
}
