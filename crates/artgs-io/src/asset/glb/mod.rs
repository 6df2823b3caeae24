//! glTF 2.0 in binary form: `NAME.glb` with meshes, `NAME_splats.glb` with Gaussians.
//!
//! Limitations: glTF has no joints, masses or collision shapes. Joints and masses are in `extras`, motions are clips, one per
//! joint; collision meshes are not written. Meshes are double-sided. Gaussians have their own file, because strict readers
//! (the `gltf` crate, also in Bevy) and Khronos' validator refuse a file with attributes of an unknown extension, and because
//! renderers that know the extension would draw surfaces twice.
//!
//! What faces rest on, if it is known: the mesh of a link has a primitive, with a material of its own, for faces that were seen, derived
//! and invented; `extras.evidence` of the primitive and the material `LINK`, `LINK_derived` or `LINK_invented` say which. Attributes of
//! one's own, which also could, are refused by strict readers.
//!
//! Frames: the root node, named like the asset, turns +Z up to glTF's +Y; under it all nodes have the link frames, so
//! all of `extras` is in the node's axes, metres and radians. There is a node per link, children under parents, with rest
//! pose at joint value 0. The clip `LINK_joint` moves the joint from its lower to its upper limit in two seconds, with keys at
//! most 60 degrees apart. Harmonics of Gaussians are in the link frame: renderers must transform the view direction into the
//! node's frame.
//!
//! `extras` of a link's node:
//! ```json
//! {"joint": {"name": "door_joint", "type": "revolute", "axis": [0, 0, 1], "pitch": 0, "limits": [0, 1.6],
//!            "observed": [0, 1.5], "effort": 50, "velocity": 3, "damping": 0.2, "friction": 0.1},
//!  "inertial": {"mass": 2, "center": [0, 0, 0], "inertia": [0.1, 0.1, 0.1, 0, 0, 0]},
//!  "class": "door",
//!  "handles": [{"name": "door_handle", "position": [0, 0, 0], "orientation": [0, 0, 0, 1], "width": 0.02, "length": 0.2,
//!               "depth": 0.03}]}
//! ```
//! `type` is `revolute`, `prismatic` or `screw`, `observed` the values in the two observed states, `inertia`
//! `ixx iyy izz ixy ixz iyz` about the centre of mass, handles as in [`artgs_core::Handle`], orientations x y z w. The base
//! has no `joint`.

mod buffer;
mod clips;
mod looks;
#[cfg(test)]
mod tests;

use crate::{FileError, write_atomic};
use artgs_core::{Asset, AssetLink, Handle};
use buffer::Buffer;
use glam::DVec3;
use serde_json::{Map, Value, json};
use std::f64::consts::FRAC_1_SQRT_2;
use std::path::{Path, PathBuf};

/// Visual content of the nodes.
#[derive(Clone, Copy, PartialEq)]
enum Content {
    Meshes,
    Splats,
}

/// A glTF document being written.
#[derive(Default)]
struct Scene {
    buffer: Buffer,
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    textures: Vec<Value>,
    images: Vec<Value>,
    animations: Vec<Value>,
}

/// Writes `NAME.glb` into `dir`, and `NAME_splats.glb` if a link has Gaussians. Returns the files, the meshes first.
pub fn export_glb(dir: &Path, asset: &Asset) -> Result<Vec<PathBuf>, FileError> {
    let mut files = vec![dir.join(format!("{}.glb", asset.name))];
    write(&files[0], asset, Content::Meshes)?;
    if asset.links.iter().any(|l| l.splats.as_ref().is_some_and(|s| !s.is_empty())) {
        files.push(dir.join(format!("{}_splats.glb", asset.name)));
        write(&files[1], asset, Content::Splats)?;
    }
    Ok(files)
}

fn write(path: &Path, asset: &Asset, content: Content) -> Result<(), FileError> {
    let malformed = |reason: String| FileError::malformed(path, reason);
    let mut scene = Scene::default();
    // Turns z up to y up.
    let up = [-FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2];
    scene.nodes.push(json!({"name": asset.name, "rotation": up, "children": []}));
    for (i, link) in asset.links.iter().enumerate() {
        let mesh = match (content, &link.splats) {
            (Content::Meshes, _) => scene.add_mesh(path, link)?,
            (Content::Splats, Some(splats)) => scene.add_splats(&link.name, splats).map_err(malformed)?,
            (Content::Splats, None) => None,
        };
        if link.parent.is_some_and(|p| p >= i) {
            return Err(malformed(format!("link `{}` stands before its parent; put parents first", link.name)));
        }
        scene.add_node(asset, i, mesh);
    }
    scene.nodes.iter_mut().for_each(drop_empty_children);
    let glb = scene.finish(&asset.name, content).map_err(malformed)?;
    write_atomic(path, &glb)
}

/// Name of the joint of a link.
fn joint_name(link: &AssetLink) -> String {
    format!("{}_joint", link.name)
}

fn drop_empty_children(node: &mut Value) {
    if let Some(fields) = node.as_object_mut() {
        fields.retain(|name, value| name != "children" || value.as_array().is_none_or(|c| !c.is_empty()));
    }
}

impl Scene {
    /// Node `i + 1` for link `i`, and its clip. Node 0 is the root.
    fn add_node(&mut self, asset: &Asset, i: usize, mesh: Option<usize>) {
        let link = &asset.links[i];
        let rest = link.origin - link.parent.map_or(DVec3::ZERO, |p| asset.links[p].origin);
        let mut node = json!({
            "name": link.name, "translation": rest.to_array(), "children": [], "extras": extras(link),
        });
        if let Some(mesh) = mesh {
            node["mesh"] = json!(mesh);
        }
        if let Some(children) = self.nodes[link.parent.map_or(0, |p| p + 1)]["children"].as_array_mut() {
            children.push(json!(i + 1));
        }
        self.nodes.push(node);
        if let Some(joint) = &link.joint {
            self.animations.push(clips::clip(&mut self.buffer, link, joint, i + 1, rest));
        }
    }

    fn finish(self, name: &str, content: Content) -> Result<Vec<u8>, String> {
        let generator = format!("artgs {}", env!("CARGO_PKG_VERSION"));
        let mut all = Map::new();
        let mut put = |key: &str, value: Value| all.insert(key.into(), value);
        put("asset", json!({"version": "2.0", "generator": generator}));
        if content == Content::Splats {
            put("extensionsUsed", json!(["KHR_gaussian_splatting"]));
        }
        put("scene", json!(0));
        put("scenes", json!([{"name": name, "nodes": [0]}]));
        if !self.textures.is_empty() {
            // Trilinear filtering, clamped at the edges of the atlas.
            put("samplers", json!([{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}]));
        }
        put("nodes", self.nodes.into());
        put("meshes", self.meshes.into());
        put("materials", self.materials.into());
        put("textures", self.textures.into());
        put("images", self.images.into());
        put("animations", self.animations.into());
        self.buffer.into_glb(all)
    }
}

fn extras(link: &AssetLink) -> Value {
    let m = &link.inertial;
    let mut out = json!({"inertial": {"mass": m.mass, "center": m.center.to_array(), "inertia": m.inertia}});
    if let Some(j) = &link.joint {
        out["joint"] = json!({
            "name": joint_name(link), "type": j.kind.name(), "axis": j.axis.to_array(), "pitch": j.pitch, "limits": j.limits,
            "observed": j.observed.as_slice(), "effort": j.effort, "velocity": j.velocity, "damping": j.damping,
            "friction": j.friction,
        });
    }
    if let Some(semantics) = &link.semantics {
        out["class"] = json!(semantics.class.name());
    }
    let handle = |h: &Handle| {
        json!({
            "name": h.name, "position": h.frame.translation.to_array(), "orientation": h.frame.rotation.to_array(),
            "width": h.width, "length": h.length, "depth": h.depth,
        })
    };
    if !link.handles.is_empty() {
        out["handles"] = link.handles.iter().map(handle).collect();
    }
    out
}
