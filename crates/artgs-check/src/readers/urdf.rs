//! URDF and the URDF of the PartNet-Mobility folder.

use super::folder;
use crate::meshes;
use crate::model::{Link, Model, Motion, Shape};
use crate::report::FormatFinding;
use artgs_core::{Inertial, JointKind, Rigid};
use glam::{DMat3, DVec3};
use std::path::Path;

/// Reads a URDF and its meshes.
pub(super) fn read(path: &Path, finding: &mut FormatFinding) -> Result<Option<Model>, String> {
    let robot = urdf_rs::read_file(path).map_err(|e| e.to_string())?;
    let mut model = Model { links: Vec::new(), has_hulls: true };
    for index in order(&robot)? {
        let link = &robot.links[index];
        let joint = robot.joints.iter().find(|j| j.child.link == link.name);
        let parent = joint.and_then(|j| model.links.iter().position(|l| l.name == j.parent.link));
        let above = parent.map_or(Rigid::IDENTITY, |p| model.links[p].pose);
        let own = joint.map_or(Rigid::IDENTITY, |j| placed(&j.origin));
        let mut out = Link::new(&link.name, parent, above * own);
        out.motion = joint.map(motion).transpose()?.flatten();
        let place = |s: &urdf_rs::Geometry, at: &urdf_rs::Pose, f: &mut FormatFinding| shape(path, s, at, f);
        out.visuals = link.visual.iter().map(|v| place(&v.geometry, &v.origin, finding)).collect();
        out.hulls = link.collision.iter().map(|c| place(&c.geometry, &c.origin, finding)).collect();
        // The reader sets a missing mass to 0.
        if link.inertial.mass.value != 0.0 || !out.visuals.is_empty() || !out.hulls.is_empty() {
            out.inertial = Some(inertial(&link.inertial));
        }
        model.links.push(out);
    }
    Ok(Some(model))
}

/// Reads `mobility.urdf`; names of links are those in `mobility_v2.json`.
pub(super) fn read_partnet(path: &Path, finding: &mut FormatFinding) -> Result<Option<Model>, String> {
    let Some(mut model) = read(path, finding)? else { return Ok(None) };
    let semantics =
        std::fs::read_to_string(folder(path).join("semantics.txt")).map_err(|e| format!("semantics.txt: {e}"))?;
    let tree = std::fs::read(folder(path).join("mobility_v2.json")).map_err(|e| format!("mobility_v2.json: {e}"))?;
    let tree: serde_json::Value = serde_json::from_slice(&tree).map_err(|e| format!("mobility_v2.json: {e}"))?;
    for (i, line) in semantics.lines().filter(|l| !l.trim().is_empty()).enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [id, _, _] = words[..] else {
            return Err(format!("semantics.txt: {line:?} is not a link, a joint and a class"));
        };
        let name = tree[i]["artgs_name"].as_str().filter(|_| id == format!("link_{i}"));
        match (model.links.iter_mut().find(|l| l.name == id), name) {
            (Some(link), Some(name)) => link.name = name.into(),
            (Some(_), None) => finding.problems.push(format!("mobility_v2.json: no name of `{id}`")),
            (None, _) => finding.problems.push(format!("semantics.txt: no link `{id}` in mobility.urdf")),
        }
    }
    for name in ["mobility_v2.json", "result.json", "meta.json", "bounding_box.json"] {
        let text = std::fs::read(folder(path).join(name)).map_err(|e| e.to_string());
        let json = text.and_then(|t| serde_json::from_slice::<serde_json::Value>(&t).map_err(|e| e.to_string()));
        if let Err(reason) = json {
            finding.problems.push(format!("{name}: {reason}"));
        }
    }
    Ok(Some(model))
}

/// Indices of links, parents first.
fn order(robot: &urdf_rs::Robot) -> Result<Vec<usize>, String> {
    let find = |name: &str| {
        robot
            .links
            .iter()
            .position(|l| l.name == name)
            .ok_or_else(|| format!("a joint names link `{name}`, which is missing"))
    };
    let edges: Vec<(usize, usize)> = robot
        .joints
        .iter()
        .map(|j| Ok((find(&j.parent.link)?, find(&j.child.link)?)))
        .collect::<Result<_, String>>()?;
    let mut out: Vec<usize> = (0..robot.links.len()).filter(|i| edges.iter().all(|e| e.1 != *i)).collect();
    if out.len() != 1 {
        return Err(format!("{} links have no parent; there must be one root", out.len()));
    }
    let mut at = 0;
    while at < out.len() && out.len() <= robot.links.len() {
        let parent = out[at];
        out.extend(edges.iter().filter(|e| e.0 == parent).map(|e| e.1));
        at += 1;
    }
    if out.len() != robot.links.len() {
        return Err("the links do not make a tree".into());
    }
    Ok(out)
}

fn placed(pose: &urdf_rs::Pose) -> Rigid {
    let [roll, pitch, yaw] = pose.rpy.0;
    rigid(pose.xyz.0, [roll, pitch, yaw])
}

/// A translation after turns about the fixed axes X, Y and Z.
pub(super) fn rigid(xyz: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Rigid {
    let turn = DMat3::from_rotation_z(yaw) * DMat3::from_rotation_y(pitch) * DMat3::from_rotation_x(roll);
    Rigid::from_matrix(turn, DVec3::from_array(xyz))
}

fn motion(joint: &urdf_rs::Joint) -> Result<Option<Motion>, String> {
    let kind = match joint.joint_type {
        urdf_rs::JointType::Fixed => return Ok(None),
        urdf_rs::JointType::Revolute => JointKind::Revolute,
        urdf_rs::JointType::Prismatic => JointKind::Prismatic,
        ref other => return Err(format!("joint `{}` is of type {other:?}, which artgs does not write", joint.name)),
    };
    let limit = &joint.limit;
    Ok(Some(Motion {
        limits: [limit.lower, limit.upper],
        effort: Some(limit.effort),
        velocity: Some(limit.velocity),
        damping: Some(joint.dynamics.as_ref().map_or(0.0, |d| d.damping)),
        friction: Some(joint.dynamics.as_ref().map_or(0.0, |d| d.friction)),
        ..Motion::new(&joint.name, kind, DVec3::from_array(joint.axis.xyz.0))
    }))
}

fn inertial(given: &urdf_rs::Inertial) -> Inertial {
    let at = placed(&given.origin);
    let t = &given.inertia;
    let own = crate::model::tensor([t.ixx, t.iyy, t.izz, t.ixy, t.ixz, t.iyz]);
    let turn = at.matrix();
    let inertia = crate::model::moments(turn * own * turn.transpose());
    Inertial { mass: given.mass.value, center: at.translation, inertia }
}

fn shape(path: &Path, geometry: &urdf_rs::Geometry, at: &urdf_rs::Pose, finding: &mut FormatFinding) -> Shape {
    let urdf_rs::Geometry::Mesh { filename, scale } = geometry else {
        finding.problems.push("a shape is no mesh; artgs writes only meshes".into());
        return Shape::default();
    };
    // The folder of the URDF is that of the package.
    let packaged = filename.strip_prefix("package://").and_then(|rest| rest.split_once('/'));
    let filename = packaged.map_or(filename.as_str(), |(_, inside)| inside);
    if Path::new(filename).is_absolute() || filename.contains("://") {
        finding.problems.push(format!("{filename}: is not a relative path, so the folder cannot be moved"));
    }
    let scale = scale.as_ref().map_or(DVec3::ONE, |s| DVec3::from_array(s.0));
    meshes::obj(&folder(path).join(filename), filename, &placed(at), scale, finding)
}
