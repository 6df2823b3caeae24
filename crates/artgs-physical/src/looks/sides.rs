//! Sides of the object that were not recorded: their surface is missing, or what closes it is invented.

use crate::geometry::topology::{bounds, corners, cross, points};
use crate::settings::SideSettings;
use artgs_core::{Asset, AssetLink, FaceEvidence};
use glam::DVec3;

/// Names of the sides of the static part that hardly a camera looks at, or of which most is invented, of `back`, `left`, `right` (as seen from
/// the front) and `top`; none where the front or the evidence is unknown. What is below stands on the floor. `cameras` are the positions of the cameras of
/// both states, frame of the asset; without any, invented surface alone decides.
pub(crate) fn unrecorded_sides(asset: &Asset, cameras: &[DVec3], settings: &SideSettings) -> Vec<&'static str> {
    let (Some(front), Some(base)) = (asset.front, asset.links.first()) else { return Vec::new() };
    let right = (-front).cross(DVec3::Z);
    let sides = [("back", -front), ("left", -right), ("right", right), ("top", DVec3::Z)];
    if base.visual.evidence.is_empty() {
        return Vec::new();
    }
    let is_unseen = |towards| !cameras.is_empty() && looking(base, towards, cameras, settings) < settings.cameras;
    let lacks = |(_, towards): &(&str, DVec3)| is_unseen(*towards) || is_invented(base, *towards, settings);
    sides.into_iter().filter(lacks).map(|(name, _)| name).collect()
}

/// Number of cameras that look at a side from far enough in front of it.
fn looking(link: &AssetLink, towards: DVec3, cameras: &[DVec3], settings: &SideSettings) -> usize {
    let mesh = &link.visual.mesh;
    let Some([lower, upper]) = bounds(mesh) else { return 0 };
    let middle = 0.5 * (lower + upper);
    let side = middle + towards * (points(mesh).map(|p| (p - middle).dot(towards)).fold(0.0, f64::max));
    let looks = |camera: &&DVec3| (**camera - side).normalize_or_zero().dot(towards) > settings.grazing;
    cameras.iter().filter(looks).count()
}

/// True if most of the surface that faces outwards there is invented.
fn is_invented(link: &AssetLink, towards: DVec3, settings: &SideSettings) -> bool {
    let mesh = &link.visual.mesh;
    let along = || points(mesh).map(|p| p.dot(towards));
    let [low, high] = [along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max)];
    let (mut all, mut invented) = (0.0, 0.0);
    for (triangle, evidence) in mesh.triangles.iter().zip(&link.visual.evidence) {
        let normal = cross(mesh, *triangle);
        let middle = corners(mesh, *triangle).into_iter().sum::<DVec3>() / 3.0;
        let facing = normal.dot(towards);
        if facing > settings.facing * normal.length() && middle.dot(towards) > high - settings.depth * (high - low) {
            all += facing;
            invented += if *evidence == FaceEvidence::Invented { facing } else { 0.0 };
        }
    }
    invented > settings.invented * all
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Mesh, TexturedMesh};

    fn sides(asset: &Asset) -> Vec<&'static str> {
        unrecorded_sides(asset, &[], &SideSettings::DEFAULT)
    }

    /// A box whose faces that point along `unseen` are invented.
    fn recorded_without(unseen: &[DVec3]) -> Asset {
        let mesh = Mesh::cuboid([-0.5, -0.3, 0.0], [0.5, 0.3, 1.0]);
        let of = |t: &[u32; 3]| {
            let normal = cross(&mesh, *t).normalize();
            let hidden = unseen.iter().any(|d| d.dot(normal) > 0.9);
            if hidden { FaceEvidence::Invented } else { FaceEvidence::Seen }
        };
        let evidence = mesh.triangles.iter().map(of).collect::<Vec<_>>();
        let visual = TexturedMesh { mesh, evidence, ..TexturedMesh::default() };
        let links = vec![AssetLink { visual, ..AssetLink::default() }];
        Asset { links, front: Some(DVec3::NEG_Y), ..Asset::default() }
    }

    #[test]
    fn invented_sides_are_named_as_seen_from_the_front() {
        assert!(sides(&recorded_without(&[])).is_empty());
        // The front is towards -Y: who stands there has +X on the right.
        assert_eq!(sides(&recorded_without(&[DVec3::Y, DVec3::NEG_X])), ["back", "left"]);
        assert_eq!(sides(&recorded_without(&[DVec3::X, DVec3::Z, DVec3::NEG_Z])), ["right", "top"]);
    }

    #[test]
    fn sides_that_no_camera_looks_at_are_named_also_if_nothing_closes_them() {
        // The mesh has no back.
        let mut open = recorded_without(&[]);
        let visual = &mut open.links[0].visual;
        let faces_back: Vec<bool> =
            visual.mesh.triangles.iter().map(|t| cross(&visual.mesh, *t).normalize().dot(DVec3::Y) > 0.9).collect();
        let mut kept = faces_back.iter().map(|back| !back);
        visual.mesh.triangles.retain(|_| kept.next().unwrap());
        visual.evidence.truncate(visual.mesh.triangles.len());
        assert!(sides(&open).is_empty(), "without cameras it is unknown");
        // From the front, up to 60 degrees to both sides, from above.
        let from = |degrees: f64| DVec3::new(3.0 * degrees.to_radians().sin(), -3.0 * degrees.to_radians().cos(), 1.6);
        let arc = |most: i32| (-6..=6).map(|i| from(f64::from(i * most) / 6.0)).collect::<Vec<DVec3>>();
        let named = |cameras: &[DVec3]| unrecorded_sides(&open, cameras, &SideSettings::DEFAULT);
        assert_eq!(named(&arc(60)), ["back"]);
        assert_eq!(named(&arc(8)), ["back", "left", "right"]);
        assert!(named(&arc(170)).is_empty());
    }

    #[test]
    fn without_front_or_evidence_nothing_is_named() {
        let asset = recorded_without(&[DVec3::Y]);
        assert!(sides(&Asset { front: None, ..asset.clone() }).is_empty());
        let mut unknown = asset;
        unknown.links[0].visual.evidence.clear();
        assert!(sides(&unknown).is_empty());
        assert!(sides(&Asset::default()).is_empty());
    }
}
