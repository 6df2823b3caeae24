//! A folder with the layout of NVIDIA's SimReady props (profile `Robotics-Prop`), so that simulators of that family find
//! physics, labels, grasps and both appearances where they look for them.
//!
//! `NAME/simready_usd/NAME.usda` is the file to open: metadata, labels, the direction of the front, and variants. All others
//! are in folders beside it. It references `physics/base.usdc` with bodies, joints, hulls, contact materials and grasps, in
//! schemas of USD alone. The variant sets `PhysX`, `Newton` and `MuJoCo`, all disabled, each load a layer of
//! `runnables/physics` with the schemas of that engine. The variant set `Representation` loads `visuals/mesh.usdc` or
//! `splats.usdc`; without Gaussians there is no choice. A thumbnail is in `.thumbs`, if the provenance has a picture.
//!
//! Differences from [`super::export_usd`]: no physics scene, because a scene has its own; a line through each handle along
//! which fingers close; engines are separated. Not written: non-visual materials and materials as labels (a capture does not
//! show what a surface is made of), MDL and OpenPBR materials, collision variants (only the hulls are tested against the
//! motion of the joints).

mod labels;
mod metadata;
#[cfg(test)]
mod tests;

use super::layer::{Layer, Prim, VariantSet, float3, float3s, references, token};
use super::physics::{Engine, joint_name, resistance};
use super::{header, looks, lower, physics, put, textures};
use crate::asset::Provenance;
use crate::asset::meshes::mean_color;
use crate::asset::values::{is_textured, linear};
use crate::image_io::rgb_png;
use crate::{FileError, write_atomic};
use artgs_core::{Asset, AssetLink, Handle, Mesh};
use glam::{DVec3, Vec3};
use openusd::sdf::Value;
use std::path::{Path, PathBuf};

/// Engines that have a layer of their own, in the order of their variant sets.
const ENGINES: [Engine; 3] = [Engine::PhysX, Engine::Newton, Engine::MuJoCo];
/// Variant set of the appearance, and its options.
const REPRESENTATION: &str = "Representation";
const MESH: &str = "Mesh";
const GAUSSIANS: &str = "GaussianSplat";

/// The variant set of an engine, and its layer.
fn engine_set(engine: Engine) -> (&'static str, &'static str) {
    match engine {
        Engine::PhysX => ("PhysX", "runnables/physics/physx.usda"),
        Engine::Newton => ("Newton", "runnables/physics/newton.usda"),
        Engine::MuJoCo => ("MuJoCo", "runnables/physics/mujoco.usda"),
    }
}

/// Writes the folder `NAME` into `dir`. Returns the files, the one to open first.
pub fn export_simready(dir: &Path, asset: &Asset, provenance: &Provenance) -> Result<Vec<PathBuf>, FileError> {
    let folder = dir.join(&asset.name).join("simready_usd");
    let open = folder.join(format!("{}.usda", asset.name));
    let mut files = Vec::new();
    put(&open, lower(&open, interface(asset, provenance))?.usda())?;
    files.push(open.clone());
    let mut crate_file = |name: &str, layer: Result<Layer, String>| -> Result<(), FileError> {
        let path = folder.join(name);
        put(&path, lower(&path, layer)?.usdc())?;
        files.push(path);
        Ok(())
    };
    crate_file("physics/base.usdc", base(asset))?;
    crate_file("visuals/mesh.usdc", visuals(asset, false))?;
    if has_gaussians(asset) {
        crate_file("visuals/splats.usdc", visuals(asset, true))?;
    }
    for engine in ENGINES {
        let path = folder.join(engine_set(engine).1);
        put(&path, lower(&path, Ok(engine_layer(asset, engine)))?.usda())?;
        files.push(path);
    }
    let mut pictures = textures(&folder, asset)?;
    if let Some(picture) = &provenance.picture {
        let name = format!(".thumbs/256x256/{}.usda.png", asset.name);
        pictures.push((name.clone(), rgb_png(&folder.join(&name), picture.width, picture.height, &picture.rgb)?));
    }
    for (name, png) in pictures {
        let path = folder.join(name);
        write_atomic(&path, &png)?;
        files.push(path);
    }
    Ok(files)
}

fn has_gaussians(asset: &Asset) -> bool {
    asset.links.iter().any(|link| link.splats.as_ref().is_some_and(|splats| !splats.is_empty()))
}

/// The layer that is opened.
fn interface(asset: &Asset, provenance: &Provenance) -> Result<Layer, String> {
    let mut layers = vec!["./physics/base.usdc".to_owned()];
    let mut object = labels::object(Prim::new("Xform", asset.name.clone()), provenance);
    if let Some(front) = asset.front {
        object = object.custom_uniform("vector3f", "simready:assetFrame:forwardDirection", float3(front));
    }
    for engine in ENGINES {
        let (name, layer) = engine_set(engine);
        let options = vec![("Disabled", None), ("Enabled", Some(format!("./{layer}")))];
        object = object.variants(VariantSet { name, selected: "Disabled", options });
    }
    let [mesh, splats] = ["mesh", "splats"].map(|name| format!("./visuals/{name}.usdc"));
    if has_gaussians(asset) {
        let options = vec![(MESH, Some(mesh)), (GAUSSIANS, Some(splats))];
        object = object.variants(VariantSet { name: REPRESENTATION, selected: MESH, options });
    } else {
        layers.push(mesh);
    }
    let object = object.field("kind", token("component")).field("references", references(&layers));
    let fields = [header(&asset.name), vec![("customLayerData", metadata::layer_data(asset, provenance))]].concat();
    Ok(Layer { fields, prims: vec![object] })
}

/// Bodies, joints, hulls, contact materials and grasps.
fn base(asset: &Asset) -> Result<Layer, String> {
    let root = format!("/{}", asset.name);
    let mut object = Prim::new("Xform", asset.name.clone()).api("PhysicsArticulationRootAPI");
    let (mut joints, mut contacts) = (Prim::new("Scope", "Joints"), Prim::new("Scope", "Contacts"));
    for (i, link) in asset.links.iter().enumerate() {
        let mut body = labels::link(physics::body(&root, asset, i)?, link);
        body.children.extend(link.handles.iter().map(grasp_line));
        let hulls = looks::hulls(&root, link)?;
        if !hulls.is_empty() {
            contacts = contacts.child(labels::material(looks::contact(link)));
        }
        let flat = |(hull, mesh)| Prim::per_face(hull, "normal3f[]", "normals", float3s(&face_normals(mesh)));
        body.children.extend(hulls.into_iter().zip(looks::solid(link)).map(flat));
        object = object.child(body);
        joints = joints.child(physics::joint(&root, asset, i)?);
    }
    Ok(Layer { fields: header(&asset.name), prims: vec![object.child(joints).child(contacts)] })
}

/// Unit normals of triangles; +Z for those without an area.
fn face_normals(mesh: &Mesh) -> Vec<[f32; 3]> {
    let corner = |i: u32| Vec3::from_array(mesh.vertices[i as usize]);
    let normal = |[a, b, c]: &[u32; 3]| (corner(*b) - corner(*a)).cross(corner(*c) - corner(*a)).normalize_or(Vec3::Z);
    mesh.triangles.iter().map(|triangle| normal(triangle).to_array()).collect()
}

/// A line through a handle along which the fingers of a gripper close, and a little beyond it.
fn grasp_line(handle: &Handle) -> Prim {
    /// The line ends so far from the handle, as a share of its width.
    const BEYOND: f64 = 0.25;
    /// Metres, for drawing.
    const THICKNESS: f32 = 0.002;
    let reach = DVec3::Y * handle.width * (0.5 + BEYOND);
    let ends = [-reach, reach].map(|end| handle.frame.apply(end).as_vec3().to_array());
    let extent = looks::bounds(ends.iter().map(|end| (*end, [0.5 * THICKNESS; 3])));
    Prim::new("BasisCurves", format!("{}_grasp", handle.name))
        .attr("float3[]", "extent", float3s(&extent))
        .attr("point3f[]", "points", float3s(&ends))
        .attr("int[]", "curveVertexCounts", Value::IntVec(vec![2]))
        .constant("float[]", "widths", Value::FloatVec(vec![THICKNESS]))
        .uniform("token", "type", token("linear"))
        .uniform("token", "purpose", token("guide"))
}

/// What is drawn: meshes, or Gaussians where a link has them.
fn visuals(asset: &Asset, gaussians: bool) -> Result<Layer, String> {
    let root = format!("/{}", asset.name);
    let mut object = Prim::new("Xform", asset.name.clone());
    let mut materials = Prim::new("Scope", "Looks");
    for link in &asset.links {
        let splats = link.splats.as_ref().filter(|_| gaussians).map(looks::gaussians).transpose()?.flatten();
        let mesh = if splats.is_none() { looks::visual(&root, link)? } else { None };
        if mesh.is_some() {
            materials = materials.child(labels::material(looks::material(&root, link, "..")?));
        }
        let drawn = splats.or_else(|| mesh.map(|mesh| colored(mesh, link)));
        if let Some(drawn) = drawn {
            object = object.child(Prim::new("Xform", link.name.clone()).child(drawn));
        }
    }
    Ok(Layer { fields: header(&asset.name), prims: vec![object.child(materials)] })
}

/// A textured mesh with its mean colour, for programs that evaluate no materials.
fn colored(mesh: Prim, link: &AssetLink) -> Prim {
    if !is_textured(&link.visual) || link.visual.mesh.colors.is_empty() {
        return mesh;
    }
    let color = mean_color(&link.visual).map(|v| linear((v * 255.0).round() as u8));
    mesh.constant("color3f[]", "primvars:displayColor", float3s(&[color]))
}

/// What an engine alone understands, as opinions about the prims of [`base`].
fn engine_layer(asset: &Asset, engine: Engine) -> Layer {
    let collider = match engine {
        Engine::PhysX => None,
        Engine::Newton => Some("NewtonMeshCollisionAPI"),
        Engine::MuJoCo => Some("MjcCollisionAPI"),
    };
    let (mut object, mut joints) = (Prim::over(asset.name.clone()), Prim::over("Joints"));
    for link in &asset.links {
        if let Some(joint) = &link.joint {
            joints = joints.child(resistance(Prim::over(joint_name(link)), joint, engine));
        }
        let hulls = (0..looks::solid(link).count()).map(looks::hull_name);
        let Some(api) = collider.filter(|_| looks::solid(link).next().is_some()) else { continue };
        let body = hulls.fold(Prim::over(link.name.clone()), |body, hull| body.child(Prim::over(hull).api(api)));
        object = object.child(body);
    }
    Layer { fields: header(&asset.name), prims: vec![object.child(joints)] }
}
