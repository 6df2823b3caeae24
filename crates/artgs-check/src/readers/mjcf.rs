//! MJCF. `mjcf-rs` resolves defaults; fields that it lacks are read from the XML.

use super::{folder, numbers};
use crate::meshes;
use crate::model::{Link, Model, Motion, moments};
use crate::report::FormatFinding;
use artgs_core::{Inertial, JointKind, PerState, Rigid, State};
use glam::{DMat3, DQuat, DVec3};
use mjcf_rs::body::{Body, InertiaSpec, Joint, JointType};
use mjcf_rs::equality::Equality;
use std::path::Path;

/// Reads an MJCF with its meshes and textures.
pub(super) fn read(path: &Path, finding: &mut FormatFinding) -> Result<Option<Model>, String> {
    let text = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
    let tree = roxmltree::Document::parse(&text).map_err(|e| e.to_string())?;
    let scene = mjcf_rs::Model::from_file(path).map_err(|e| e.to_string())?;
    let mut model = Model { links: Vec::new(), has_hulls: true };
    let mut keys = Keys::of(&scene)?;
    for (id, entry) in scene.bodies_iter() {
        let body = &entry.body;
        // The world is body 0; bodies come with parents first.
        let parent = entry.parent.filter(|p| *p > 0).map(|p| p - 1);
        if id != model.links.len() + 1 || parent.is_some_and(|p| p >= model.links.len()) {
            return Err("bodies are not listed with parents first".into());
        }
        let above = parent.map_or(Rigid::IDENTITY, |p| model.links[p].pose);
        let mut link = Link::new(body.name.as_deref().unwrap_or("unnamed"), parent, above * rigid(&body.pose));
        link.inertial = body.inertial.as_ref().map(inertial);
        if link.inertial.is_none() {
            finding.problems.push(format!("body `{}` has no inertial", link.name));
        }
        link.motion = motion(&scene, body, &tree, &mut keys)?;
        add_shapes(path, &scene, body, &mut link, finding);
        model.links.push(link);
    }
    keys.finish()?;
    for texture in &scene.assets.textures {
        let Some(file) = scene.resolve_texture_file(texture, folder(path)) else { continue };
        if let Err(reason) = meshes::image_file(&file, finding) {
            finding.problems.push(format!("texture {}: {reason}", texture.file.as_deref().unwrap_or_default()));
        }
    }
    Ok(Some(model))
}

/// The keyframes `start` and `end`, consumed value by value in the order of the joints.
struct Keys {
    values: Option<PerState<Vec<f64>>>,
    at: usize,
}

impl Keys {
    fn of(scene: &mjcf_rs::Model) -> Result<Self, String> {
        let key = |name: &str| scene.keyframes.iter().find(|k| k.name.as_deref() == Some(name)).map(|k| k.qpos.clone());
        let joints =
            scene.bodies_iter().flat_map(|(_, e)| &e.body.joints).filter(|j| j.type_ != JointType::Free).count();
        let values = PerState::try_from_fn(|state| key(state.name()));
        if values.is_none() && joints > 0 {
            return Err("the keyframes `start` and `end` are incomplete".into());
        }
        Ok(Self { values, at: 0 })
    }

    fn next(&mut self) -> Result<Option<PerState<f64>>, String> {
        let Some(values) = &self.values else { return Ok(None) };
        let next = PerState::try_from_fn(|state| values[state].get(self.at).copied());
        self.at += 1;
        next.map(Some).ok_or_else(|| "a keyframe has fewer values than there are joints".into())
    }

    fn finish(&self) -> Result<(), String> {
        match &self.values {
            Some(values) if values.iter().any(|v| v.len() != self.at) => {
                Err("a keyframe has more values than there are joints".into())
            }
            _ => Ok(()),
        }
    }
}

fn rigid(pose: &mjcf_rs::Pose) -> Rigid {
    let (q, t) = (pose.rotation, pose.translation);
    Rigid { rotation: DQuat::from_xyzw(q.x, q.y, q.z, q.w), translation: DVec3::new(t.x, t.y, t.z) }
}

fn inertial(given: &mjcf_rs::body::Inertial) -> Inertial {
    let at = rigid(&given.pose);
    let own = match given.inertia {
        InertiaSpec::Diagonal(d) => DMat3::from_diagonal(DVec3::from_array(d)),
        InertiaSpec::Full(full) => crate::model::tensor(full),
    };
    let turn = at.matrix();
    Inertial { mass: given.mass, center: at.translation, inertia: moments(turn * own * turn.transpose()) }
}

fn motion(
    scene: &mjcf_rs::Model,
    body: &Body,
    tree: &roxmltree::Document,
    keys: &mut Keys,
) -> Result<Option<Motion>, String> {
    let (thread, joint) = match body.joints.as_slice() {
        [] => return Ok(None),
        [free] if free.type_ == JointType::Free => {
            // Position and orientation of a base that is not fixed.
            (0..7).try_for_each(|_| keys.next().map(drop))?;
            return Ok(None);
        }
        [joint] => (None, joint),
        [thread, joint] => (Some(thread), joint),
        more => return Err(format!("body {:?} has {} joints", body.name, more.len())),
    };
    let name = joint.name.as_deref().unwrap_or("unnamed");
    let slid = thread.map(|_| keys.next()).transpose()?.flatten();
    let kind = match (joint.type_, thread) {
        (JointType::Hinge, None) => JointKind::Revolute,
        (JointType::Slide, None) => JointKind::Prismatic,
        (JointType::Hinge, Some(_)) => JointKind::Screw,
        (other, _) => return Err(format!("joint `{name}` is of type {other:?}, which artgs does not write")),
    };
    let observed = keys.next()?;
    let pitch = thread.map(|t| pitch(scene, t, joint)).transpose()?;
    if let (Some(pitch), Some(slid), Some(turned)) = (pitch, slid, observed)
        && State::ALL.iter().any(|s| (slid[*s] - pitch * turned[*s]).abs() > 1e-6)
    {
        return Err(format!("joint `{name}`: a keyframe violates the coupling of the screw"));
    }
    let element = tree.descendants().find(|n| n.has_tag_name("joint") && n.attribute("name") == Some(name));
    let force = element.and_then(|n| n.attribute("actuatorfrcrange")).map(numbers::<2>).transpose()?;
    let limited = joint.limited.resolve(scene.compiler.autolimits, joint.range.is_some());
    let Some(limits) = joint.range.filter(|_| limited) else {
        return Err(format!("joint `{name}` has no limits"));
    };
    Ok(Some(Motion {
        limits,
        pitch,
        observed,
        effort: force.map(|f| f[1]),
        damping: Some(joint.damping),
        friction: Some(joint.frictionloss),
        ..Motion::new(name, kind, DVec3::from_array(joint.axis).normalize_or_zero())
    }))
}

/// Metres per radian of a screw.
fn pitch(scene: &mjcf_rs::Model, thread: &Joint, joint: &Joint) -> Result<f64, String> {
    let coupling = scene.equality.iter().find_map(|e| match e {
        Equality::Joint(e) if Some(&e.joint1) == thread.name.as_ref() && e.joint2 == joint.name => Some(e.polycoef[1]),
        _ => None,
    });
    coupling.ok_or_else(|| format!("joint {:?} has no coupling", thread.name))
}

fn add_shapes(path: &Path, scene: &mjcf_rs::Model, body: &Body, link: &mut Link, finding: &mut FormatFinding) {
    for geom in &body.geoms {
        let mesh = geom.mesh.as_deref().and_then(|name| scene.assets.mesh(name));
        let Some(file) = mesh.and_then(|m| scene.resolve_mesh_file(m, folder(path))) else {
            finding.problems.push(format!("geom {:?} has no existing mesh", geom.name));
            continue;
        };
        let scale = mesh.map_or(DVec3::ONE, |m| DVec3::from_array(m.scale));
        let name = file.strip_prefix(folder(path)).unwrap_or(&file).display().to_string();
        // MJCF refers to textures in its assets, so those of the MTL are not counted.
        let textures = finding.textures;
        let shape = meshes::obj(&file, &name, &rigid(&geom.pose), scale, finding);
        finding.textures = textures;
        let collides = geom.contype != 0 || geom.conaffinity != 0;
        if collides { &mut link.hulls } else { &mut link.visuals }.push(shape);
    }
}
