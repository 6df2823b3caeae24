//! Meshes and textures referenced by other files.

use crate::model::Shape;
use crate::report::FormatFinding;
use artgs_core::Rigid;
use glam::DVec3;
use std::path::Path;

/// Reads an OBJ with the textures of its materials into the link frame. Problems are added to the finding under the file name
/// `name`.
pub(crate) fn obj(path: &Path, name: &str, place: &Rigid, scale: DVec3, finding: &mut FormatFinding) -> Shape {
    match read(path, finding) {
        Ok(mut shape) => {
            shape.points.iter_mut().for_each(|p| *p = place.apply(*p * scale));
            shape
        }
        Err(reason) => {
            finding.problems.push(format!("{name}: {reason}"));
            Shape::default()
        }
    }
}

fn read(path: &Path, finding: &mut FormatFinding) -> Result<Shape, String> {
    if !path.is_file() {
        return Err("the file does not exist; export again".into());
    }
    let options = tobj::LoadOptions { triangulate: true, ..tobj::LoadOptions::default() };
    let (models, materials) = tobj::load_obj(path, &options).map_err(|e| e.to_string())?;
    let mut out = Shape::default();
    for model in &models {
        let mesh = &model.mesh;
        let own: Vec<DVec3> =
            mesh.positions.as_chunks::<3>().0.iter().map(|p| DVec3::from_array(p.map(f64::from))).collect();
        triangles(&own, &mesh.indices)?;
        if mesh.normals.iter().chain(&mesh.texcoords).any(|v| !v.is_finite()) {
            return Err("a normal or a texture coordinate is not finite".into());
        }
        let first = out.points.len() as u32;
        out.triangles.extend(mesh.indices.as_chunks::<3>().0.iter().map(|t| t.map(|i| first + i)));
        out.points.extend(own);
    }
    if out.points.is_empty() {
        return Err("the mesh is empty".into());
    }
    let folder = path.parent().unwrap_or(Path::new("."));
    // Hulls have no materials, which is no error.
    for material in materials.map_err(|e| format!("its materials: {e}"))? {
        let Some(texture) = material.diffuse_texture else { continue };
        image_file(&folder.join(&texture), finding).map_err(|e| format!("texture {texture}: {e}"))?;
    }
    Ok(out)
}

/// Refuses points that are not finite and indices out of range.
pub(crate) fn triangles(points: &[DVec3], indices: &[u32]) -> Result<(), String> {
    if points.is_empty() || indices.is_empty() {
        return Err("the mesh is empty".into());
    }
    if let Some(i) = points.iter().position(|p| !p.is_finite()) {
        return Err(format!("vertex {i} is not finite"));
    }
    match indices.iter().find(|i| **i as usize >= points.len()) {
        Some(i) => Err(format!("a triangle has index {i} of {} vertices", points.len())),
        None => Ok(()),
    }
}

/// Decodes an image file.
pub(crate) fn image_file(path: &Path, finding: &mut FormatFinding) -> Result<(), String> {
    let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
    decode(&bytes, finding)
}

/// Decodes an image.
pub(crate) fn decode(bytes: &[u8], finding: &mut FormatFinding) -> Result<(), String> {
    let picture = image::load_from_memory(bytes).map_err(|e| format!("cannot be decoded: {e}"))?;
    if picture.width() == 0 || picture.height() == 0 {
        return Err("the image is empty".into());
    }
    finding.textures += 1;
    Ok(())
}
