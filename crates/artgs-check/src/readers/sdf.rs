//! SDFormat. This module resolves the frames: every pose is relative to a link, a joint or the model.

use super::urdf::rigid;
use super::{folder, numbers};
use crate::meshes;
use crate::model::{Link, Model, Motion, Shape};
use crate::report::FormatFinding;
use artgs_core::{Inertial, JointKind, Rigid};
use glam::DVec3;
use roxmltree::Node;
use std::path::Path;

/// Reads `model.sdf` with its meshes, and `model.config` beside it.
pub(super) fn read(path: &Path, finding: &mut FormatFinding) -> Result<Option<Model>, String> {
    let text = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
    let tree = roxmltree::Document::parse(&text).map_err(|e| e.to_string())?;
    let object = child(tree.root_element(), "model")?;
    config(path, finding);
    let links: Vec<Node> = object.children().filter(|n| n.has_tag_name("link")).collect();
    let joints: Vec<Node> = object.children().filter(|n| n.has_tag_name("joint")).collect();
    let mut model = Model { links: Vec::new(), has_hulls: true };
    for link in &links {
        let name = named(*link)?;
        let joint = joints.iter().find(|j| text_of(**j, "child") == Ok(name));
        let Some(joint) = joint else { return Err(format!("link `{name}` has no joint")) };
        let parent_name = text_of(*joint, "parent")?;
        let parent = model.links.iter().position(|l| l.name == parent_name);
        if parent.is_none() && parent_name != "world" {
            return Err(format!("link `{name}` precedes its parent `{parent_name}`"));
        }
        let mut out = Link::new(name, parent, frame(object, name, 0)?);
        out.inertial = Some(inertial(*link)?);
        out.motion = motion(*joint)?;
        for (tag, shapes) in [("visual", &mut out.visuals), ("collision", &mut out.hulls)] {
            for shape in link.children().filter(|n| n.has_tag_name(tag)) {
                shapes.push(mesh(path, shape, finding)?);
            }
        }
        model.links.push(out);
    }
    Ok(Some(model))
}

fn config(path: &Path, finding: &mut FormatFinding) {
    let text = std::fs::read_to_string(folder(path).join("model.config")).map_err(|e| e.to_string());
    let parsed = text.and_then(|t| roxmltree::Document::parse(&t).map(|_| ()).map_err(|e| e.to_string()));
    if let Err(reason) = parsed {
        finding.problems.push(format!("model.config: {reason}"));
    }
}

fn child<'a>(node: Node<'a, 'a>, tag: &str) -> Result<Node<'a, 'a>, String> {
    node.children().find(|n| n.has_tag_name(tag)).ok_or_else(|| format!("<{}> has no <{tag}>", node.tag_name().name()))
}

fn text_of<'a>(node: Node<'a, 'a>, tag: &str) -> Result<&'a str, String> {
    Ok(child(node, tag)?.text().unwrap_or_default().trim())
}

fn number(node: Node, tag: &str) -> Result<f64, String> {
    Ok(numbers::<1>(text_of(node, tag)?)?[0])
}

fn named<'a>(node: Node<'a, 'a>) -> Result<&'a str, String> {
    node.attribute("name").ok_or_else(|| format!("a <{}> has no name", node.tag_name().name()))
}

/// Pose of a node and what it is relative to.
fn pose<'a>(node: Node<'a, 'a>) -> Result<(Rigid, Option<&'a str>), String> {
    let Some(pose) = node.children().find(|n| n.has_tag_name("pose")) else { return Ok((Rigid::IDENTITY, None)) };
    let [x, y, z, roll, pitch, yaw] = numbers(pose.text().unwrap_or_default())?;
    Ok((rigid([x, y, z], [roll, pitch, yaw]), pose.attribute("relative_to")))
}

/// Frame of a link or joint in the model's frame.
fn frame(object: Node, name: &str, depth: usize) -> Result<Rigid, String> {
    if depth > 1000 {
        return Err(format!("the pose of `{name}` is relative to itself"));
    }
    let node = object.children().find(|n| n.attribute("name") == Some(name));
    let node = node.ok_or_else(|| format!("a pose is relative to `{name}`, which is missing"))?;
    let (own, relative) = pose(node)?;
    let above = match relative {
        Some(other) => frame(object, other, depth + 1)?,
        // By default the pose of a joint is relative to its child.
        None if node.has_tag_name("joint") => frame(object, text_of(node, "child")?, depth + 1)?,
        None => Rigid::IDENTITY,
    };
    Ok(above * own)
}

fn inertial(link: Node) -> Result<Inertial, String> {
    let given = child(link, "inertial")?;
    let (at, _) = pose(given)?;
    let table = child(given, "inertia")?;
    let mut own = [0.0; 6];
    for (value, tag) in own.iter_mut().zip(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"]) {
        *value = number(table, tag)?;
    }
    let turn = at.matrix();
    let inertia = crate::model::moments(turn * crate::model::tensor(own) * turn.transpose());
    Ok(Inertial { mass: number(given, "mass")?, center: at.translation, inertia })
}

fn motion(joint: Node) -> Result<Option<Motion>, String> {
    let name = named(joint)?;
    let kind = match joint.attribute("type") {
        Some("fixed") => return Ok(None),
        Some("revolute") => JointKind::Revolute,
        Some("prismatic") => JointKind::Prismatic,
        Some("screw") => JointKind::Screw,
        other => return Err(format!("joint `{name}` is of type {other:?}, which artgs does not write")),
    };
    let pitch = match kind {
        JointKind::Screw => Some(number(joint, "screw_thread_pitch")? / std::f64::consts::TAU),
        _ => None,
    };
    let axis = child(joint, "axis")?;
    let (limit, dynamics) = (child(axis, "limit")?, child(axis, "dynamics")?);
    Ok(Some(Motion {
        limits: [number(limit, "lower")?, number(limit, "upper")?],
        pitch,
        effort: Some(number(limit, "effort")?),
        velocity: Some(number(limit, "velocity")?),
        damping: Some(number(dynamics, "damping")?),
        friction: Some(number(dynamics, "friction")?),
        ..Motion::new(name, kind, DVec3::from_array(numbers(text_of(axis, "xyz")?)?))
    }))
}

fn mesh(path: &Path, node: Node, finding: &mut FormatFinding) -> Result<Shape, String> {
    let mesh = child(child(node, "geometry")?, "mesh")?;
    let uri = text_of(mesh, "uri")?;
    let scale = match text_of(mesh, "scale") {
        Ok(text) => DVec3::from_array(numbers(text)?),
        Err(_) => DVec3::ONE,
    };
    Ok(meshes::obj(&folder(path).join(uri), uri, &pose(node)?.0, scale, finding))
}
