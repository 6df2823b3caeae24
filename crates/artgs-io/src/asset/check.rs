//! Checks of an asset that every writer runs, so that exports contain no values that simulators reject.

use artgs_core::{Asset, AssetJoint, AssetLink, ContactMaterial, Inertial, JointKind, Mesh, TexturedMesh};
use glam::DVec3;
use std::collections::BTreeSet;

/// Names that formats reserve for the ground and for the joint between ground and base.
const TAKEN: [&str; 2] = ["world", "world_joint"];
/// How far a unit vector may be off 1, and an observed value off its limits (radians or metres).
const TOLERANCE: f64 = 1e-6;

/// Refuses an asset that formats cannot express or simulators reject; the message names the link and the field. Checked are:
/// names (form and uniqueness), finite numbers, unit axes, lower < upper, observed values within the limits, positive
/// masses and moments, the triangle inequality of moments, consistent meshes, hulls with volume, and that there is a mesh.
pub fn check_asset(asset: &Asset) -> Result<(), String> {
    check_name(&asset.name).map_err(|e| format!("asset: name {e}"))?;
    if asset.links.iter().all(|l| l.visual.mesh.is_empty() && l.collision.is_empty()) {
        return Err("asset: links: none has a mesh; export a replica with parts".into());
    }
    let mut names: BTreeSet<String> = TAKEN.map(String::from).into();
    for (i, link) in asset.links.iter().enumerate() {
        check_name(&link.name).map_err(|e| format!("link {i}: name {e}"))?;
        // Links and joints share a scope in SDF.
        for name in [link.name.clone(), format!("{}_joint", link.name)] {
            if !names.insert(name.clone()) {
                return Err(format!("link {i} `{}`: name `{name}` is taken; give it another", link.name));
            }
        }
        for handle in &link.handles {
            let name = &handle.name;
            check_name(name).map_err(|e| format!("link {i}: handle name {e}"))?;
            // In URDF a handle is a link on a fixed joint.
            for name in [name.clone(), format!("{name}_joint")] {
                if !names.insert(name.clone()) {
                    return Err(format!("link {i} `{}`: name `{name}` of a handle is taken", link.name));
                }
            }
            finite("handle", &handle.frame.translation.to_array())?;
            finite("handle", &handle.frame.rotation.to_array())?;
        }
        check_link(asset, i, link).map_err(|e| format!("link {i} `{}`: {e}", link.name))?;
    }
    Ok(())
}

fn check_name(name: &str) -> Result<(), String> {
    let valid = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if valid && name.starts_with(|c: char| c.is_ascii_lowercase()) {
        return Ok(());
    }
    Err(format!("{name:?}: must be lower case letters, digits and `_`, a letter first"))
}

fn check_link(asset: &Asset, index: usize, link: &AssetLink) -> Result<(), String> {
    match (link.parent, &link.joint) {
        (None, None) if index == 0 => {}
        (Some(parent), Some(joint)) if parent < index => check_joint(joint)?,
        (parent, joint) => {
            let (n, has) = (asset.links.len(), if joint.is_some() { "a" } else { "no" });
            let rule = "the first link has no parent and no joint, the others have a joint and a parent before them";
            return Err(format!("parent {parent:?} of {n} links and {has} joint: {rule}"));
        }
    }
    finite("origin", &link.origin.to_array())?;
    check_inertial(&link.inertial)?;
    let ContactMaterial { friction, restitution } = link.contact;
    if !(friction >= 0.0 && friction.is_finite() && (0.0..=1.0).contains(&restitution)) {
        return Err(format!("contact: friction {friction} must be at least 0, restitution {restitution} from 0 to 1"));
    }
    check_visual(&link.visual)?;
    for (k, hull) in link.collision.iter().enumerate() {
        check_mesh(hull).and_then(|()| check_volume(hull)).map_err(|e| format!("collision {k}: {e}"))?;
    }
    let Some(splats) = &link.splats else { return Ok(()) };
    let numbers = [&splats.logit_opacities, &splats.sh].into_iter().flatten();
    let triples = splats.means.iter().chain(&splats.log_scales).flatten();
    let rotations = splats.rotations.iter().flatten();
    if numbers.chain(triples).chain(rotations).any(|v| !v.is_finite()) {
        return Err("splats: not all numbers are finite".into());
    }
    Ok(())
}

fn finite(field: &str, values: &[f64]) -> Result<(), String> {
    match values.iter().find(|v| !v.is_finite()) {
        Some(v) => Err(format!("{field}: {v} is not finite")),
        None => Ok(()),
    }
}

fn check_joint(joint: &AssetJoint) -> Result<(), String> {
    let AssetJoint { kind, axis, pitch, limits, observed, effort, velocity, damping, friction } = *joint;
    finite("joint.axis", &axis.to_array())?;
    if (axis.length() - 1.0).abs() > TOLERANCE {
        return Err(format!("joint.axis: has length {}, must be 1", axis.length()));
    }
    finite("joint.pitch", &[pitch])?;
    if pitch != 0.0 && kind != JointKind::Screw {
        return Err(format!("joint.pitch: {pitch} on a joint that is no screw"));
    }
    finite("joint.limits", &limits)?;
    let [lower, upper] = limits;
    if lower >= upper {
        return Err(format!("joint.limits: lower {lower} must be below upper {upper}"));
    }
    finite("joint.observed", observed.as_slice())?;
    let values = observed.iter().map(|v| ("joint.observed", *v));
    for (field, value) in values.chain([("joint.limits", 0.0)]) {
        if value < lower - TOLERANCE || value > upper + TOLERANCE {
            return Err(format!("{field}: {value} is not within the limits {lower} to {upper}"));
        }
    }
    for (field, value, least) in [("effort", effort, "above"), ("velocity", velocity, "above")]
        .into_iter()
        .chain([("damping", damping, "at least"), ("friction", friction, "at least")])
    {
        if !value.is_finite() || value < 0.0 || (least == "above" && value == 0.0) {
            return Err(format!("joint.{field}: {value}, must be finite and {least} 0"));
        }
    }
    Ok(())
}

fn check_inertial(inertial: &Inertial) -> Result<(), String> {
    let Inertial { mass, center, inertia } = *inertial;
    finite("inertial.mass", &[mass])?;
    finite("inertial.center", &center.to_array())?;
    finite("inertial.inertia", &inertia)?;
    if mass <= 0.0 {
        return Err(format!("inertial.mass: {mass}, must be above 0"));
    }
    let [a, b, c] = principal_moments(inertia);
    if a <= 1e-12 * c || c <= 0.0 {
        return Err(format!("inertial.inertia: principal moments {a}, {b}, {c} must be above 0"));
    }
    // The moments of a plate are equal to the bound; rounding may exceed it slightly.
    if a + b < c * (1.0 - 1e-9) {
        return Err(format!("inertial.inertia: principal moment {c} exceeds the sum of {a} and {b}; no body has that"));
    }
    Ok(())
}

/// The inertia with moments raised by up to a millionth if a plate would violate the triangle inequality by rounding,
/// which MuJoCo refuses.
pub(super) fn sound_inertia(inertia: [f64; 6]) -> [f64; 6] {
    let [a, b, c] = principal_moments(inertia);
    let lack = (c * (1.0 + 1e-6) - (a + b)).clamp(0.0, 2e-6 * c);
    let [xx, yy, zz, xy, xz, yz] = inertia;
    [xx + lack, yy + lack, zz + lack, xy, xz, yz]
}

/// Eigenvalues, ascending, of the symmetric matrix `ixx iyy izz ixy ixz iyz`, by the cosines of its characteristic cubic.
fn principal_moments([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> [f64; 3] {
    let mean = (xx + yy + zz) / 3.0;
    let (dx, dy, dz) = (xx - mean, yy - mean, zz - mean);
    let spread = ((dx * dx + dy * dy + dz * dz + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0).sqrt();
    if spread == 0.0 {
        return [mean; 3];
    }
    let det = dx * (dy * dz - yz * yz) - xy * (xy * dz - yz * xz) + xz * (xy * yz - dy * xz);
    let angle = (det / (2.0 * spread.powi(3))).clamp(-1.0, 1.0).acos() / 3.0;
    let at = |turn: f64| mean + 2.0 * spread * (angle + turn * std::f64::consts::TAU / 3.0).cos();
    [at(1.0), at(2.0), at(0.0)]
}

fn check_mesh(mesh: &Mesh) -> Result<(), String> {
    if mesh.vertices.as_flattened().iter().any(|v| !v.is_finite()) {
        return Err("not all vertices are finite".into());
    }
    let n = mesh.vertices.len();
    if let Some(t) = mesh.triangles.iter().find(|t| t.iter().any(|i| *i as usize >= n)) {
        return Err(format!("triangle {t:?} has an index beyond the {n} vertices"));
    }
    Ok(())
}

fn check_visual(visual: &TexturedMesh) -> Result<(), String> {
    let TexturedMesh { mesh, normals, uvs, texture, evidence } = visual;
    check_mesh(mesh).map_err(|e| format!("visual: {e}"))?;
    let n = mesh.vertices.len();
    for (field, len) in [("normals", normals.len()), ("colors", mesh.colors.len()), ("uvs", uvs.len())] {
        let needed = field == "uvs" && texture.is_some();
        if len != n && (needed || len != 0) {
            return Err(format!("visual.{field}: {len} for {n} vertices"));
        }
    }
    if !evidence.is_empty() && evidence.len() != mesh.triangles.len() {
        return Err(format!("visual.evidence: {} for {} triangles", evidence.len(), mesh.triangles.len()));
    }
    if normals.as_flattened().iter().chain(uvs.as_flattened()).any(|v| !v.is_finite()) {
        return Err("visual: not all normals and texture coordinates are finite".into());
    }
    let Some(t) = texture else { return Ok(()) };
    if t.rgb.is_empty() || t.rgb.len() as u64 != u64::from(t.width) * u64::from(t.height) {
        return Err(format!("visual.texture: {} pixels do not match {} x {}", t.rgb.len(), t.width, t.height));
    }
    Ok(())
}

fn check_volume(hull: &Mesh) -> Result<(), String> {
    let at = |i: u32| DVec3::from_array(hull.vertices[i as usize].map(f64::from));
    // Relative to one of its corners, so that a small hull far from the origin loses no digits.
    let from = hull.vertices.first().map_or(DVec3::ZERO, |v| DVec3::from_array(v.map(f64::from)));
    let corners = hull.triangles.iter().map(|t| t.map(|i| at(i) - from));
    let volume: f64 = corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    if volume > 0.0 { Ok(()) } else { Err(format!("volume {volume} m^3, must be above 0; it is flat or inside out")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::testing::cabinet;
    use artgs_core::State;

    #[test]
    fn a_good_asset_passes() {
        assert_eq!(check_asset(&cabinet()), Ok(()));
    }

    #[test]
    fn every_fault_is_named() {
        let refused = |edit: fn(&mut Asset), expected: &str| {
            let mut asset = cabinet();
            edit(&mut asset);
            let message = check_asset(&asset).unwrap_err();
            assert!(message.contains(expected), "{message:?} lacks {expected:?}");
        };
        fn joint(asset: &mut Asset) -> &mut AssetJoint {
            asset.links[2].joint.as_mut().unwrap()
        }
        refused(|a| a.name = "Two Words".into(), "asset: name \"Two Words\"");
        refused(|a| a.links.clear(), "asset: links");
        refused(|a| a.links[2].name = "part_1".into(), "link 2 `part_1`: name `part_1` is taken");
        refused(|a| a.links[2].name = "part_1_joint".into(), "name `part_1_joint` is taken");
        refused(|a| a.links[0].name = "world".into(), "`world` is taken");
        refused(|a| a.links[1].handles[0].name = "part_2".into(), "`part_2` is taken");
        refused(|a| a.links[1].handles[0].frame.translation.x = f64::NAN, "handle: NaN");
        refused(|a| a.links[1].parent = Some(2), "link 1 `part_1`: parent Some(2)");
        refused(|a| a.links[1].joint = None, "and no joint");
        refused(|a| a.links[1].origin.x = f64::INFINITY, "origin: inf");
        refused(|a| joint(a).axis = DVec3::ZERO, "link 2 `part_2`: joint.axis: has length 0");
        refused(|a| joint(a).pitch = 0.1, "joint.pitch");
        refused(|a| joint(a).limits[1] = f64::NAN, "joint.limits: NaN");
        refused(|a| joint(a).limits = [0.5, 0.5], "joint.limits: lower 0.5");
        refused(|a| joint(a).observed[State::START] = -0.1, "joint.observed: -0.1");
        refused(|a| joint(a).limits[0] = 0.1, "joint.observed: 0 is not within");
        refused(|a| joint(a).effort = 0.0, "joint.effort: 0");
        refused(|a| joint(a).friction = -1.0, "joint.friction: -1");
        refused(|a| a.links[1].inertial.mass = 0.0, "inertial.mass: 0");
        refused(|a| a.links[1].inertial.inertia = [1.0, 1.0, 2.1, 0.0, 0.0, 0.0], "exceeds the sum");
        refused(|a| a.links[1].inertial.inertia = [1.0, 1.0, 1.0, 1.1, 0.0, 0.0], "must be above 0");
        refused(|a| a.links[1].visual.mesh.vertices[0][1] = f32::NAN, "visual: not all vertices");
        refused(|a| a.links[1].visual.mesh.triangles[0][1] = 999, "999");
        refused(|a| a.links[1].visual.evidence.push(artgs_core::FaceEvidence::Seen), "visual.evidence: 1 for");
        refused(|a| a.links[1].visual.uvs.truncate(1), "visual.uvs: 1 for 24");
        refused(|a| a.links[1].visual.texture.as_mut().unwrap().width = 3, "visual.texture: 8 pixels");
        refused(|a| a.links[0].collision[2].vertices.iter_mut().for_each(|v| v[2] = 0.0), "collision 2: volume");
        refused(|a| a.links[0].collision[2].triangles.iter_mut().for_each(|t| t.reverse()), "inside out");
        refused(|a| a.links[0].splats.as_mut().unwrap().sh[3] = f32::NAN, "splats");
    }

    #[test]
    fn moments_of_known_bodies() {
        let near = |a: [f64; 3], b: [f64; 3]| (0..3).all(|i| (a[i] - b[i]).abs() < 1e-12);
        assert!(near(principal_moments([3.0, 1.0, 2.0, 0.0, 0.0, 0.0]), [1.0, 2.0, 3.0]));
        assert!(near(principal_moments([2.0, 2.0, 5.0, 1.0, 0.0, 0.0]), [1.0, 3.0, 5.0]));
        assert!(near(principal_moments([4.0, 4.0, 4.0, 0.0, 0.0, 0.0]), [4.0; 3]));
        let plate = Inertial { mass: 1.0, center: DVec3::ZERO, inertia: [0.1, 0.2, 0.1 + 0.2, 0.0, 0.0, 0.0] };
        assert_eq!(check_inertial(&plate), Ok(()));
        let [a, b, c] = principal_moments(sound_inertia(plate.inertia));
        assert!(a + b > c * (1.0 + 5e-7) && (c - 0.3).abs() < 1e-6);
        assert_eq!(sound_inertia([3.0, 3.0, 4.0, 0.1, 0.0, 0.0]), [3.0, 3.0, 4.0, 0.1, 0.0, 0.0]);
    }
}
