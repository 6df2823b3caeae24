//! Binary glTF. The `gltf` crate refuses the extension for Gaussians: of those files it reads only the container, and this
//! module checks the accessors.

use crate::meshes;
use crate::model::{Link, Model, Motion, Shape};
use crate::report::FormatFinding;
use artgs_core::{Inertial, JointKind, PerState, Rigid};
use glam::{DMat4, DQuat, DVec3};
use gltf::animation::util::ReadOutputs;
use serde_json::Value;
use std::path::Path;

/// Reads a GLB with its textures, clips and notes.
pub(super) fn read(path: &Path, finding: &mut FormatFinding) -> Result<Option<Model>, String> {
    let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
    let glb = gltf::Glb::from_slice(&bytes).map_err(|e| e.to_string())?;
    let json: Value = serde_json::from_slice(&glb.json).map_err(|e| e.to_string())?;
    let binary = glb.bin.as_deref().unwrap_or_default();
    bounds(&json, binary)?;
    let used = json["extensionsUsed"].as_array();
    if used.is_some_and(|all| all.iter().any(|e| e == "KHR_gaussian_splatting")) {
        splats(&json, binary, finding)?;
        return Ok(None);
    }
    let gltf = gltf::Gltf::from_slice(&bytes).map_err(|e| e.to_string())?;
    let (document, blob) = (gltf.document, gltf.blob);
    let buffers = gltf::import_buffers(&document, None, blob).map_err(|e| e.to_string())?;
    let images = gltf::import_images(&document, None, &buffers).map_err(|e| e.to_string())?;
    finding.textures = images.iter().filter(|i| i.width > 0 && i.height > 0).count();
    if finding.textures < images.len() {
        finding.problems.push("a texture is empty".into());
    }
    let scene = document.default_scene().ok_or("there is no default scene")?;
    let mut roots = scene.nodes();
    let (Some(root), None) = (roots.next(), roots.next()) else { return Err("the scene has not one root".into()) };
    let up = local(&root).turn(DVec3::Z);
    if (up - DVec3::Y).length() > 1e-4 {
        finding.problems.push(format!("the root turns +Z to {up}, not to glTF's +Y"));
    }
    let mut model = Model::default();
    for node in root.children() {
        add(&node, None, &buffers, &mut model, finding)?;
    }
    clips(&document, &buffers, &model, finding);
    Ok(Some(model))
}

fn local(node: &gltf::Node) -> Rigid {
    let ([x, y, z], [i, j, k, w], _) = node.transform().decomposed();
    let rotation = DQuat::from_xyzw(i.into(), j.into(), k.into(), w.into()).normalize();
    Rigid { rotation, translation: DVec3::new(x.into(), y.into(), z.into()) }
}

fn add(
    node: &gltf::Node,
    parent: Option<usize>,
    buffers: &[gltf::buffer::Data],
    model: &mut Model,
    finding: &mut FormatFinding,
) -> Result<(), String> {
    let name = node.name().unwrap_or("unnamed");
    let above = parent.map_or(Rigid::IDENTITY, |p| model.links[p].pose);
    let mut link = Link::new(name, parent, above * local(node));
    let notes = node.extras().as_ref().ok_or_else(|| format!("node `{name}` has no extras"))?;
    let notes: Value = serde_json::from_str(notes.get()).map_err(|e| format!("node `{name}`: extras: {e}"))?;
    link.inertial = Some(inertial(&notes["inertial"]).ok_or_else(|| format!("node `{name}`: no inertial in extras"))?);
    if let Some(joint) = notes.get("joint") {
        link.motion = Some(motion(joint).ok_or_else(|| format!("node `{name}`: no joint can be read from extras"))?);
    }
    for primitive in node.mesh().iter().flat_map(|m| m.primitives()) {
        link.visuals.push(shape(&primitive, buffers).unwrap_or_else(|reason| {
            finding.problems.push(format!("mesh of node `{name}`: {reason}"));
            Shape::default()
        }));
    }
    model.links.push(link);
    let at = model.links.len() - 1;
    node.children().try_for_each(|child| add(&child, Some(at), buffers, model, finding))
}

fn shape(primitive: &gltf::Primitive, buffers: &[gltf::buffer::Data]) -> Result<Shape, String> {
    let reader = primitive.reader(|b| buffers.get(b.index()).map(|d| &d.0[..]));
    let positions = reader.read_positions().ok_or("no positions")?;
    let points: Vec<DVec3> = positions.map(|p| DVec3::from_array(p.map(f64::from))).collect();
    let indices: Vec<u32> = reader.read_indices().ok_or("no indices")?.into_u32().collect();
    meshes::triangles(&points, &indices)?;
    if reader.read_normals().is_some_and(|mut all| all.any(|n| n.iter().any(|v| !v.is_finite()))) {
        return Err("a normal is not finite".into());
    }
    if let Some(uvs) = reader.read_tex_coords(0)
        && uvs.into_f32().any(|uv| uv.iter().any(|v| !v.is_finite()))
    {
        return Err("a texture coordinate is not finite".into());
    }
    Ok(Shape { points, triangles: indices.as_chunks::<3>().0.to_vec() })
}

fn row<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let values: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    values?.try_into().ok()
}

fn inertial(notes: &Value) -> Option<Inertial> {
    let center = DVec3::from_array(row(&notes["center"])?);
    Some(Inertial { mass: notes["mass"].as_f64()?, center, inertia: row(&notes["inertia"])? })
}

fn motion(notes: &Value) -> Option<Motion> {
    let kind: JointKind = serde_json::from_value(notes["type"].clone()).ok()?;
    let number = |name: &str| notes[name].as_f64();
    Some(Motion {
        limits: row(&notes["limits"])?,
        pitch: number("pitch").filter(|_| kind == JointKind::Screw),
        observed: row(&notes["observed"]).map(|[start, end]| Some(PerState::new(start, end)))?,
        effort: Some(number("effort")?),
        velocity: Some(number("velocity")?),
        damping: Some(number("damping")?),
        friction: Some(number("friction")?),
        ..Motion::new(notes["name"].as_str()?, kind, DVec3::from_array(row(&notes["axis"])?))
    })
}

/// Checks that every joint has a clip from its lower to its upper limit.
fn clips(document: &gltf::Document, buffers: &[gltf::buffer::Data], model: &Model, finding: &mut FormatFinding) {
    for link in &model.links {
        let Some(motion) = &link.motion else { continue };
        let Some(clip) = document.animations().find(|a| a.name() == Some(&motion.name)) else {
            finding.problems.push(format!("joint `{}` has no clip", motion.name));
            continue;
        };
        let above = link.parent.map_or(Rigid::IDENTITY, |p| model.links[p].pose);
        let rest = above.inverse() * link.pose;
        for (end, limit) in motion.limits.into_iter().enumerate() {
            let want = rest * motion.motion(limit);
            let Some(got) = keyed(&clip, buffers, &rest, end == 1) else {
                finding.problems.push(format!("the clip `{}` cannot be read", motion.name));
                break;
            };
            let off = (DMat4::from_rotation_translation(got.rotation, got.translation)
                - DMat4::from_rotation_translation(want.rotation, want.translation))
            .to_cols_array()
            .iter()
            .fold(0.0, |m: f64, v| m.max(v.abs()));
            if off > 1e-4 || off.is_nan() {
                finding.problems.push(format!("the clip `{}` does not go to the limit {limit}", motion.name));
            }
        }
    }
}

/// Transform of the driven node at the first or last key.
fn keyed(clip: &gltf::Animation, buffers: &[gltf::buffer::Data], rest: &Rigid, last: bool) -> Option<Rigid> {
    let mut out = *rest;
    for channel in clip.channels() {
        let pick = |n: usize| if last { n.checked_sub(1) } else { Some(0) };
        match channel.reader(|b| buffers.get(b.index()).map(|d| &d.0[..])).read_outputs()? {
            ReadOutputs::Rotations(all) => {
                let all: Vec<[f32; 4]> = all.into_f32().collect();
                let q = all.get(pick(all.len())?)?.map(f64::from);
                out.rotation = DQuat::from_array(q).normalize();
            }
            ReadOutputs::Translations(all) => {
                let all: Vec<[f32; 3]> = all.collect();
                out.translation = DVec3::from_array(all.get(pick(all.len())?)?.map(f64::from));
            }
            _ => return None,
        }
    }
    Some(out)
}

fn whole(value: &Value, otherwise: usize) -> Option<usize> {
    if value.is_null() { Some(otherwise) } else { usize::try_from(value.as_u64()?).ok() }
}

/// Bytes of one element of an accessor.
fn stride(accessor: &Value) -> Option<usize> {
    let size = match accessor["componentType"].as_u64()? {
        5120 | 5121 => 1,
        5122 | 5123 => 2,
        5125 | 5126 => 4,
        _ => return None,
    };
    let count = match accessor["type"].as_str()? {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        _ => return None,
    };
    Some(size * count)
}

/// Start and end in the binary chunk of a view and of what an accessor spans in it; none if out of bounds.
fn span(json: &Value, binary: &[u8], accessor: &Value) -> Option<(usize, usize)> {
    let view = json["bufferViews"].get(whole(&accessor["bufferView"], usize::MAX)?)?;
    let start = view_span(view, binary)?.0;
    let (count, size) = (whole(&accessor["count"], usize::MAX)?, stride(accessor)?);
    let step = whole(&view["byteStride"], size)?;
    let from = start.checked_add(whole(&accessor["byteOffset"], 0)?)?;
    let length = count.checked_sub(1)?.checked_mul(step)?.checked_add(size)?;
    let to = from.checked_add(length)?;
    (to <= view_span(view, binary)?.1).then_some((from, to))
}

fn view_span(view: &Value, binary: &[u8]) -> Option<(usize, usize)> {
    let from = whole(&view["byteOffset"], 0)?;
    let to = from.checked_add(whole(&view["byteLength"], usize::MAX)?)?;
    (to <= binary.len()).then_some((from, to))
}

/// Refuses views and accessors out of range, on which image readers panic.
fn bounds(json: &Value, binary: &[u8]) -> Result<(), String> {
    let all = |name: &str| json[name].as_array().cloned().unwrap_or_default();
    for (i, view) in all("bufferViews").iter().enumerate() {
        view_span(view, binary).ok_or_else(|| format!("buffer view {i} reaches beyond the {} bytes", binary.len()))?;
    }
    for (i, accessor) in all("accessors").iter().enumerate() {
        span(json, binary, accessor).ok_or_else(|| format!("accessor {i} reaches beyond its buffer view"))?;
    }
    Ok(())
}

/// Counts Gaussians and reports numbers that are not finite.
fn splats(json: &Value, binary: &[u8], finding: &mut FormatFinding) -> Result<(), String> {
    finding.reader = "gltf (container)".into();
    let meshes = json["meshes"].as_array().ok_or("there are no meshes")?;
    for primitive in meshes.iter().flat_map(|m| m["primitives"].as_array().into_iter().flatten()) {
        let attributes = primitive["attributes"].as_object().ok_or("a primitive has no attributes")?;
        let mut counts = Vec::new();
        for (name, index) in attributes {
            let accessor = index.as_u64().and_then(|i| json["accessors"].get(usize::try_from(i).ok()?));
            let accessor = accessor.ok_or_else(|| format!("{name} names no accessor"))?;
            let (from, to) = span(json, binary, accessor).ok_or_else(|| format!("{name} is out of bounds"))?;
            counts.push(accessor["count"].as_u64().unwrap_or_default());
            let floats = binary[from..to].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b));
            if accessor["componentType"] == 5126 && floats.into_iter().any(|v| !v.is_finite()) {
                finding.problems.push(format!("{name} has a number that is not finite"));
            }
        }
        if counts.iter().any(|c| *c != counts[0]) {
            finding.problems.push("attributes of Gaussians are of different lengths".into());
        }
        finding.splats += counts.first().map_or(0, |c| *c as usize);
    }
    Ok(())
}
