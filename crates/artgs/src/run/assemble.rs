//! The files a user opens: replica, meshes, splats, scores of pictures.

use super::{Built, Error, ViewMeans};
use crate::articulation::{Trained, score_state};
use crate::fit::score::mean_score;
use crate::surface::PartMeshes;
use artgs_core::{Capture, Joint, JointEstimate, Mesh, Replica, Rigid, View};
use artgs_io::{write_mesh_ply, write_replica, write_splat_ply};
use glam::DVec3;
use std::path::Path;

impl Built {
    /// Motions from the canonical state to state 1, the identity for part 0.
    pub(crate) fn half_motions(&self) -> Vec<Rigid> {
        std::iter::once(Rigid::IDENTITY).chain(self.parts.iter().map(|p| p.motion.power(0.5))).collect()
    }
}

/// Joints of the movable parts, their origins near the parts at the start state.
fn joints(built: &Built, meshes: &PartMeshes) -> Vec<Joint> {
    let joint = |(k, part): (usize, &JointEstimate)| part.joint_near(centre(&meshes.parts[k + 1][0]));
    built.parts.iter().enumerate().map(joint).collect()
}

fn centre(mesh: &Mesh) -> DVec3 {
    let sum: DVec3 = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).sum();
    sum / mesh.vertices.len().max(1) as f64
}

/// Meshes and `replica.json`.
pub(super) fn write_replica_files(root: &Path, built: &Built, meshes: &PartMeshes) -> Result<(), Error> {
    let mut replica = Replica::new(&joints(built, meshes));
    for (part, found) in replica.parts[1..].iter_mut().zip(&built.parts) {
        part.confidence = found.confidence;
    }
    for (part, pair) in replica.parts.iter().zip(&meshes.parts) {
        for state in 0..2 {
            write_mesh_ply(&root.join(part.meshes.get(state)), &pair[state])?;
        }
    }
    for state in 0..2 {
        write_mesh_ply(&root.join(replica.whole.get(state)), &meshes.whole[state])?;
    }
    write_replica(root, &replica)?;
    Ok(())
}

/// `splats/canonical.ply` and one file per part.
pub(super) fn write_splats(root: &Path, trained: &Trained) -> Result<(), Error> {
    let folder = root.join("splats");
    let frame = super::folder::CANONICAL;
    write_splat_ply(&folder.join("canonical.ply"), &trained.splats, Some(&trained.labels), frame)?;
    for part in 0..=trained.joints.len() {
        let members = (0..trained.labels.len()).filter(|&i| usize::from(trained.labels[i]) == part);
        let splats = trained.splats.select(members);
        let labels = vec![part as u16; splats.len()];
        write_splat_ply(&folder.join(format!("part_{part}.ply")), &splats, Some(&labels), frame)?;
    }
    Ok(())
}

/// Mean scores per state.
type Means = [Option<ViewMeans>; 2];

/// Scores of held-out and of training pictures.
pub(super) fn score_pictures(capture: &Capture, trained: &Trained, rotate_sh: bool) -> (Means, Means) {
    let means = |views: &[View], step: usize, state: usize| {
        let scores = score_state(trained, views.iter().step_by(step), state, rotate_sh);
        let mean = mean_score(&scores);
        (!scores.is_empty()).then_some(ViewMeans { psnr: mean.psnr, ssim: mean.ssim, views: scores.len() })
    };
    // A few training views are enough to tell overfitting.
    let train = |s: usize| means(&capture.states[s].train, capture.states[s].train.len().div_ceil(8).max(1), s);
    ([0, 1].map(|s| means(&capture.states[s].test, 1, s)), [0, 1].map(train))
}

/// Largest resident memory so far, MiB; only Linux tells without further crates.
pub(super) fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<f64>().ok()? / 1024.0)
}
