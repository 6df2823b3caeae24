//! What a run computes, and how it is written to a folder.

use super::preview::Preview;
use super::saved::posed;
use super::{Error, Summary};
use crate::articulation::Trained;
use crate::config::Config;
use crate::discover::Discovery;
use crate::surface::PartMeshes;
use artgs_core::{JointEstimate, Mesh, Replica, Rigid, Splats};
use artgs_io::run_folder::{RunFolder, save_json};

/// A replica in memory with everything that it was made from.
#[derive(Clone, Debug)]
pub struct Reconstructed {
    /// Parts and joints. Its mesh paths are those that [`Reconstructed::save`] writes.
    pub replica: Replica,
    /// Meshes of every part and of the whole, world frame of each state.
    pub meshes: PartMeshes,
    /// Labelled surface points; none for the published method.
    pub points: Option<Discovery>,
    /// Gaussians midway between the states with their parts and motions; none for the baseline.
    pub trained: Option<Trained>,
    /// Renderings beside photos; none for the baseline.
    pub preview: Option<Preview>,
    /// Scores, times and warnings.
    pub summary: Summary,
    /// The settings it was made with.
    pub config: Config,
}

impl Reconstructed {
    /// Writes the folder as a run does, without its `stages`: settings, replica, meshes, Gaussians, preview and scores.
    pub fn save(&self, folder: &RunFolder) -> Result<(), Error> {
        folder.save_config(&self.config.to_toml()?)?;
        self.save_results(folder)?;
        Ok(save_json(&folder.metrics(), &self.summary)?)
    }

    /// Everything but settings and scores.
    pub(super) fn save_results(&self, folder: &RunFolder) -> Result<(), Error> {
        folder.save_replica(&self.replica, &self.meshes.parts, &self.meshes.whole)?;
        if let Some(trained) = &self.trained {
            folder.save_splats(&trained.splats, &trained.labels, trained.joints.len() + 1)?;
        } else {
            folder.remove_splats()?;
        }
        if let Some(preview) = &self.preview {
            preview.save(&folder.preview())?;
        }
        Ok(())
    }

    /// Motion of a part from where it is at the start to where it is when every joint has its value of `values`
    /// (radians or scene units; `values[k]` is of part `k`, the value of part 0 is ignored), world frame. Missing values
    /// are those of the start.
    pub fn pose(&self, part: usize, values: &[f64]) -> Rigid {
        self.replica.pose(part, values)
    }

    /// Mesh of every part when the joints have these values, world frame; see [`Reconstructed::pose`].
    pub fn posed_meshes(&self, values: &[f64]) -> Vec<Mesh> {
        posed(&self.replica, &self.meshes, values)
    }

    /// Gaussians of one part, world frame midway between the states; none if there are no Gaussians.
    pub fn part_splats(&self, part: usize) -> Option<Splats> {
        self.trained.as_ref().map(|trained| trained.splats.select(trained.members(part)))
    }
}

/// Parts as training, or the baseline, leaves them: what meshes are fused with.
#[derive(Clone, Debug)]
pub struct FittedParts {
    /// Canonical Gaussians, labels and motions; none from the baseline.
    pub trained: Option<Trained>,
    /// Movable parts: kinds and motions from start to end.
    pub parts: Vec<JointEstimate>,
}

impl FittedParts {
    /// Motions of all parts from the canonical state to the end, the identity for part 0.
    pub(crate) fn half_motions(&self) -> Vec<Rigid> {
        std::iter::once(Rigid::IDENTITY).chain(self.parts.iter().map(|p| p.motion.power(0.5))).collect()
    }
}
