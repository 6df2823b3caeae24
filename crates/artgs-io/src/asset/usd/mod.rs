//! OpenUSD with UsdPhysics: `NAME.usda` and `NAME.usdc` with the same content, `NAME.usdz` as a single file.
//!
//! Limitations: a screw becomes a revolute joint; its slide is only in the attribute `artgs:pitch`. USD has no dry friction
//! and no largest speed of joints; they are written in the schemas of PhysX (`PhysxJointAxisAPI`) and Newton
//! (`NewtonJointAPI`), which other engines ignore. The base is fixed to the world at the object's origin; a scene that
//! references the asset elsewhere must also move the joint `fixed_base`. `NAME.usdz` has no
//! Gaussians and no animation.
//!
//! Layout: `/NAME` (default prim, one articulation root) holds the links as siblings, so that no rigid body is nested;
//! under each `visual` (UsdPreviewSurface, texture or vertex colours) and `collision_0` .. (convex hulls, purpose guide).
//! Handles are Xforms under their link, as in [`artgs_core::Handle`], with their sizes in `artgs:width`, `artgs:length` and
//! `artgs:depth`; `artgs:class` of a link is its class.
//! `/NAME/Joints` contains `LINK_joint` and `fixed_base`, `/NAME/Looks` the materials that are
//! drawn, `/NAME/Contacts` those of contacts (PhysicsMaterialAPI). `/PhysicsScene` is outside the default
//! prim, so that a scene with its own physics scene can reference the asset.
//! Joints turn about or slide along the X axis of their frame; limits are in degrees or metres, and so are the custom
//! attributes `artgs:observed` (values in the two observed states) and `artgs:pitch` (metres per degree). Their
//! drives have no stiffness, only damping and the largest force, so doors move freely. Bodies connected by a joint
//! do not collide.
//!
//! `NAME_splats.usdc`, if there are Gaussians, is the same stage with Gaussians (OpenUSD 26.03 or later) instead of
//! the meshes, which are hidden. `scene.usda` references the asset, with a floor, light and the camera `front`.

mod layer;
mod looks;
mod physics;
mod repair;
mod scene;
pub mod simready;
#[cfg(test)]
mod tests;

use super::scene::SCENE;
use crate::image_io::rgb_png;
use crate::{FileError, write_atomic};
use artgs_core::Asset;
use layer::{Layer, Lowered, Prim, references, token};
use openusd::sdf::Value;
use openusd::usdz::ArchiveWriter;
use physics::Engine;
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Writes `NAME.usda`, `NAME.usdc`, `textures/LINK.png`, `scene.usda` and, if a link has Gaussians, `NAME_splats.usdc` into `dir`.
/// Returns the files, `NAME.usda` first.
pub fn export_usd(dir: &Path, asset: &Asset) -> Result<Vec<PathBuf>, FileError> {
    let file = |suffix: &str| dir.join(format!("{}{suffix}", asset.name));
    let (text, binary, splats) = (file(".usda"), file(".usdc"), file("_splats.usdc"));
    let layer = lower(&text, stage(asset))?;
    let mut files = vec![text, binary];
    put(&files[0], layer.usda())?;
    put(&files[1], layer.usdc())?;
    if let Some(layer) = splats_layer(asset).map_err(|e| FileError::malformed(&splats, e))? {
        put(&splats, lower(&splats, Ok(layer))?.usdc())?;
        files.push(splats);
    }
    for (name, png) in textures(dir, asset)? {
        let path = dir.join(name);
        write_atomic(&path, &png)?;
        files.push(path);
    }
    if asset.name != SCENE {
        let path = dir.join(format!("{SCENE}.usda"));
        put(&path, lower(&path, Ok(scene::scene(asset)))?.usda())?;
        files.push(path);
    }
    Ok(files)
}

/// Writes `NAME.usdz` into `dir`: the crate layer and the textures, uncompressed and aligned to 64 bytes. Returns it.
pub fn export_usdz(dir: &Path, asset: &Asset) -> Result<Vec<PathBuf>, FileError> {
    let path = dir.join(format!("{}.usdz", asset.name));
    let malformed = |e: String| FileError::malformed(&path, e);
    let layer = lower(&path, stage(asset))?.usdc().map_err(malformed)?;
    let mut archive = ArchiveWriter::new(Cursor::new(Vec::new()));
    // The first file of a package is the one that is opened.
    for (name, bytes) in [(format!("{}.usdc", asset.name), layer)].into_iter().chain(textures(dir, asset)?) {
        archive.add_layer(&name, &bytes).map_err(|e| malformed(e.to_string()))?;
    }
    let bytes = archive.finish().map_err(|e| malformed(e.to_string()))?.into_inner();
    write_atomic(&path, &bytes)?;
    Ok(vec![path])
}

fn lower(path: &Path, layer: Result<Layer, String>) -> Result<Lowered, FileError> {
    layer.and_then(Layer::lower).map_err(|e| FileError::malformed(path, e))
}

fn put(path: &Path, bytes: Result<Vec<u8>, String>) -> Result<(), FileError> {
    write_atomic(path, &bytes.map_err(|e| FileError::malformed(path, e))?)
}

/// Names, from the layer's folder, and bytes of the textures.
fn textures(dir: &Path, asset: &Asset) -> Result<Vec<(String, Vec<u8>)>, FileError> {
    let textured = asset.links.iter().filter(|l| crate::asset::values::is_textured(&l.visual));
    let pictures = textured.filter_map(|l| Some((looks::texture_file(l), l.visual.texture.as_ref()?)));
    pictures.map(|(name, t)| Ok((name.clone(), rgb_png(&dir.join(&name), t.width, t.height, &t.rgb)?))).collect()
}

/// Units and axes of every layer that is opened.
fn header(default_prim: &str) -> Vec<(&'static str, Value)> {
    vec![
        ("defaultPrim", token(default_prim)),
        ("documentation", Value::String(format!("artgs {}", env!("CARGO_PKG_VERSION")))),
        ("kilogramsPerUnit", Value::Double(1.0)),
        ("metersPerUnit", Value::Double(1.0)),
        ("upAxis", token("Z")),
    ]
}

fn stage(asset: &Asset) -> Result<Layer, String> {
    let root = format!("/{}", asset.name);
    let mut object =
        Prim::new("Xform", asset.name.clone()).api("PhysicsArticulationRootAPI").field("kind", token("component"));
    let (mut joints, mut materials) = (Prim::new("Scope", "Joints"), Prim::new("Scope", "Looks"));
    let mut contacts = Prim::new("Scope", "Contacts");
    for (i, link) in asset.links.iter().enumerate() {
        let mut body = physics::body(&root, asset, i)?;
        if let Some(visual) = looks::visual(&root, link)? {
            body = body.child(visual);
            materials = materials.child(looks::material(&root, link, ".")?);
        }
        let hulls = looks::hulls(&root, link)?;
        if !hulls.is_empty() {
            contacts = contacts.child(looks::contact(link));
        }
        body.children.extend(hulls);
        object = object.child(body);
        let joint = physics::joint(&root, asset, i)?;
        let engines = [Engine::PhysX, Engine::Newton];
        joints = joints.child(match &link.joint {
            Some(moves) => engines.into_iter().fold(joint, |prim, engine| physics::resistance(prim, moves, engine)),
            None => joint,
        });
    }
    Ok(Layer {
        fields: header(&asset.name),
        prims: vec![object.child(joints).child(materials).child(contacts), physics::scene()],
    })
}

/// References the stage and overrides it to show Gaussians instead of meshes; none without Gaussians.
fn splats_layer(asset: &Asset) -> Result<Option<Layer>, String> {
    let mut object = Prim::new("Xform", asset.name.clone());
    for link in &asset.links {
        let Some(splats) = link.splats.as_ref().map(looks::gaussians).transpose()?.flatten() else { continue };
        let hidden = Prim::over("visual").attr("token", "visibility", token("invisible"));
        let body = Prim::over(link.name.clone());
        let body = if link.visual.mesh.is_empty() { body } else { body.child(hidden) };
        object = object.child(body.child(splats));
    }
    if object.children.is_empty() {
        return Ok(None);
    }
    let object = object.field("references", references(&[format!("./{}.usdc", asset.name)]));
    Ok(Some(Layer { fields: header(&asset.name), prims: vec![object, physics::scene()] }))
}
