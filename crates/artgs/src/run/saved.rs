//! A replica that was saved, read back into memory.

use super::Error;
use crate::surface::PartMeshes;
use artgs_core::{Mesh, PerState, Replica, Rigid, Splats, State};
use artgs_io::{FileError, RunFolder};
use std::path::Path;

/// A replica with its meshes and Gaussians.
#[derive(Clone, Debug)]
pub struct SavedReplica {
    /// Parts and joints.
    pub replica: Replica,
    /// Meshes of every part and of the whole, world frame of each state.
    pub meshes: PartMeshes,
    /// Gaussians midway between the states, and the part of each; none for the baseline.
    pub splats: Option<(Splats, Vec<u16>)>,
}

/// Reads the folder that a run or `Reconstructed::save` wrote.
pub fn load(folder: impl AsRef<Path>) -> Result<SavedReplica, Error> {
    let folder = RunFolder::new(folder.as_ref());
    let (replica, meshes) = replica_and_meshes(&folder)?;
    let splats = folder.has_splats().then(|| folder.load_splats()).transpose()?;
    Ok(SavedReplica { replica, meshes, splats })
}

/// The replica in a folder and its meshes in both states.
pub(super) fn replica_and_meshes(folder: &RunFolder) -> Result<(Replica, PartMeshes), Error> {
    let replica = artgs_io::read_replica(folder.root())?;
    let both = |paths: &PerState<String>| -> Result<PerState<Mesh>, FileError> {
        PerState::from_fn(|state| folder.load_mesh(&paths[state])).transpose()
    };
    let parts = replica.parts.iter().map(|part| both(&part.meshes)).collect::<Result<_, _>>()?;
    let meshes = PartMeshes { parts, whole: both(&replica.whole)? };
    Ok((replica, meshes))
}

impl SavedReplica {
    /// Motion of a part from where it is at the start to where it is at these joint values; see [`Replica::pose`].
    pub fn pose(&self, part: usize, values: &[f64]) -> Rigid {
        self.replica.pose(part, values)
    }

    /// Mesh of every part at these joint values, world frame: `values[k]` is of part `k`, that of part 0 is ignored.
    pub fn posed_meshes(&self, values: &[f64]) -> Vec<Mesh> {
        posed(&self.replica, &self.meshes, values)
    }

    /// Gaussians of one part, world frame midway between the states; none if there are no Gaussians.
    pub fn part_splats(&self, part: usize) -> Option<Splats> {
        let (splats, labels) = self.splats.as_ref()?;
        let own = labels.iter().enumerate().filter(|(_, label)| usize::from(**label) == part).map(|(i, _)| i);
        Some(splats.select(own))
    }
}

/// Meshes of all parts at some joint values, world frame.
pub(super) fn posed(replica: &Replica, meshes: &PartMeshes, values: &[f64]) -> Vec<Mesh> {
    let parts = meshes.parts.iter().enumerate();
    parts.map(|(part, meshes)| meshes[State::START].moved(&replica.pose(part, values))).collect()
}
