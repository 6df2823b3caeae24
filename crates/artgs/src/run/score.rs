//! Scores of a replica on disk, or of parts that were found before training.

use super::saved::replica_and_meshes;
use super::{Error, found_parts};
use crate::discover::Discovery;
use crate::evaluate::{Closing, EvaluateConfig, Scores, Truth};
use crate::surface::PartMeshes;
use artgs_core::{Joint, JointEstimate, Mesh, PerState, Replica, State};
use artgs_io::FileError;
use artgs_io::export_report::ExportReport;
use artgs_io::run_folder::RunFolder;
use artgs_io::summary::Bounds;
use glam::{DVec3, Vec3};
use std::path::Path;

/// Scores the replica in a run's folder against the ground truth in the folder `ground_truth`.
pub fn evaluate(folder: &RunFolder, ground_truth: &Path) -> Result<Scores, Error> {
    let (replica, meshes) = replica_and_meshes(folder)?;
    let truth = load_truth(ground_truth)?;
    require_same_place(&meshes.whole[State::START], &truth.whole[State::START])?;
    let mut scores = crate::evaluate::evaluate(&replica, &meshes, &truth, &EvaluateConfig::default());
    let digest = folder.replica_digest()?;
    // Limits of an earlier replica say nothing of this one.
    if let Some(export) = ExportReport::load(folder)?.filter(|export| export.replica == digest) {
        let zeros = artgs_io::read_true_zeros(ground_truth)?;
        let of = |part: usize| {
            export.links.iter().find(|link| export.part_of(&link.name) == Some(&replica.parts[part].name))
        };
        for score in &mut scores.parts {
            let pair = score.part.and_then(of).zip(zeros[score.truth]);
            let truth = &truth.joints[score.truth];
            score.closing = pair.and_then(|(link, zero)| Closing::of(&export, link, truth, zero));
        }
    }
    Ok(scores)
}

/// Refuses surfaces whose boxes do not intersect or whose sizes differ by more than a factor: the comparison would take
/// minutes and say nothing.
fn require_same_place(replica: &Mesh, truth: &Mesh) -> Result<(), Error> {
    /// Largest ratio of the diagonals.
    const RATIO: f64 = 20.0;
    let bounds = |mesh: &Mesh| Bounds::of(mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))));
    let (Some(own), Some(other)) = (bounds(replica), bounds(truth)) else { return Ok(()) };
    let diagonal = |b: &Bounds| b.min.distance(b.max);
    let ratio = diagonal(&own) / diagonal(&other).max(f64::MIN_POSITIVE);
    if own.intersects(&other) && (1.0 / RATIO..RATIO).contains(&ratio) {
        return Ok(());
    }
    let text = |b: &Bounds| format!("{:.3} to {:.3}", b.min, b.max);
    Err(Error::Elsewhere { replica: text(&own), truth: text(&other) })
}

/// Scores the parts that a run found before training. Surfaces are small triangles at the labelled points. None if the
/// folder does not hold them.
pub fn evaluate_found(folder: &RunFolder, ground_truth: &Path) -> Result<Option<Scores>, Error> {
    let Some(found) = found_parts(folder) else { return Ok(None) };
    let parts: Vec<PerState<Mesh>> =
        (0..=found.parts.len()).map(|part| surfels(&found, |label| usize::from(label) == part)).collect();
    let joint = |part: &JointEstimate| part.joint_near(&found.parts, DVec3::ZERO);
    let joints: Vec<Joint> = found.parts.iter().map(joint).collect();
    let meshes = PartMeshes { parts, whole: surfels(&found, |_| true) };
    let truth = load_truth(ground_truth)?;
    let mut replica = Replica::new(&joints);
    replica.parts[1..].iter_mut().zip(&found.parts).for_each(|(part, found)| part.parent = Some(found.parent));
    Ok(Some(crate::evaluate::evaluate(&replica, &meshes, &truth, &EvaluateConfig::default())))
}

fn load_truth(folder: &Path) -> Result<Truth, FileError> {
    let artgs_io::GroundTruth { joints, parents, whole, fixed, movable } = artgs_io::load_ground_truth(folder)?;
    Ok(Truth { joints, parents, whole, fixed, movable })
}

/// A triangle at every point with such a label, in its tangent plane; about as large as the surface between points.
fn surfels(found: &Discovery, wanted: impl Fn(u16) -> bool) -> PerState<Mesh> {
    let radius = 0.6 * found.spacing as f32;
    PerState::from_fn(|s: State| {
        let mut mesh = Mesh::default();
        let cloud = &found.clouds[s];
        for (i, _) in found.labels[s].iter().enumerate().filter(|(_, label)| wanted(**label)) {
            let (at, normal) = (cloud.points[i], cloud.normals[i].normalize_or(Vec3::Z));
            let (along, across) = normal.any_orthonormal_pair();
            let first = mesh.vertices.len() as u32;
            for [x, y] in [[1.0_f32, 0.0], [-0.5, 0.866], [-0.5, -0.866]] {
                mesh.vertices.push((at + radius * (x * along + y * across)).to_array());
                mesh.colors.push(cloud.colors[i].to_array().map(|c| (255.0 * c).round().clamp(0.0, 255.0) as u8));
            }
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        mesh
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(side: f32, at: f32) -> Mesh {
        let vertices = vec![[at; 3], [at + side, at, at], [at + side; 3]];
        Mesh { vertices, triangles: vec![[0, 1, 2]], ..Mesh::default() }
    }

    #[test]
    fn other_units_and_places_are_refused_and_missing_surfaces_are_not() {
        let refused = |a: &Mesh, b: &Mesh| matches!(require_same_place(a, b), Err(Error::Elsewhere { .. }));
        assert!(!refused(&cube(1.0, 0.0), &cube(0.6, 0.3)));
        assert!(refused(&cube(1000.0, 0.0), &cube(1.0, 0.0)));
        assert!(refused(&cube(1.0, 0.0), &cube(1.0, 2.0)));
        assert!(!refused(&Mesh::default(), &cube(1.0, 2.0)));
    }
}
