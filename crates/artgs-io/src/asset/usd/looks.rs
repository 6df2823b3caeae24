//! Meshes, materials and Gaussians of a link as prims.

use super::layer::{Prim, float3s, token};
use crate::asset::values::{Activated, is_textured, linear, unit_normals};
use artgs_core::{AssetLink, ContactMaterial, Mesh, Splats};
use openusd::sdf::{AssetPath, Value};

/// Path of the texture of a link, from the folder of the asset.
pub(super) fn texture_file(link: &AssetLink) -> String {
    format!("textures/{}.png", link.name)
}

/// A mesh prim with points, triangles and bounds; no subdivision.
pub(super) fn mesh_prim(name: String, mesh: &Mesh) -> Prim {
    let corners = mesh.triangles.as_flattened().iter().map(|i| *i as i32).collect::<Vec<_>>();
    Prim::new("Mesh", name)
        .attr("float3[]", "extent", float3s(&bounds(mesh.vertices.iter().map(|v| (*v, [0.0; 3])))))
        .attr("point3f[]", "points", float3s(&mesh.vertices))
        .attr("int[]", "faceVertexCounts", Value::IntVec(vec![3; mesh.triangles.len()]))
        .attr("int[]", "faceVertexIndices", Value::IntVec(corners))
        .uniform("token", "subdivisionScheme", token("none"))
}

/// Bounding box of boxes, given by their centres and half of their sides.
pub(super) fn bounds(boxes: impl Iterator<Item = ([f32; 3], [f32; 3])>) -> [[f32; 3]; 2] {
    let start = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    boxes.fold(start, |[low, high], (v, r)| {
        [[0, 1, 2].map(|a| low[a].min(v[a] - r[a])), [0, 1, 2].map(|a| high[a].max(v[a] + r[a]))]
    })
}

/// Half of the sides of the box in which a Gaussian covers more than a step of 8 bits, at most three deviations.
fn reach(scale: &[f32; 3], [w, x, y, z]: &[f32; 4], opacity: f32) -> [f32; 3] {
    let deviations = (2.0 * (255.0 * opacity).max(1.0).ln()).sqrt().min(3.0);
    let turn = glam::Mat3::from_quat(glam::Quat::from_xyzw(*x, *y, *z, *w));
    let columns = [0, 1, 2].map(|axis| turn.col(axis) * scale[axis]);
    let squares = columns.iter().fold(glam::Vec3::ZERO, |sum, c| sum + *c * *c);
    (deviations * glam::Vec3::from(squares.to_array().map(f32::sqrt))).to_array()
}

/// Visual mesh of a link, bound to its material; none if it is empty.
pub(super) fn visual(root: &str, link: &AssetLink) -> Result<Option<Prim>, String> {
    let (visual, mesh) = (&link.visual, &link.visual.mesh);
    if mesh.is_empty() || mesh.vertices.is_empty() {
        return Ok(None);
    }
    // Double-sided, because an open door may show the inside of a shell that was observed only from outside.
    let mut prim = mesh_prim("visual".into(), mesh)
        .api("MaterialBindingAPI")
        .uniform("bool", "doubleSided", Value::Bool(true))
        .rel("material:binding", &format!("{root}/Looks/{}", link.name))?;
    let normals = unit_normals(visual);
    if !normals.is_empty() {
        prim = prim.per_vertex("normal3f[]", "normals", float3s(&normals));
    }
    if is_textured(visual) {
        // USD's texture coordinates start at the bottom left.
        let st = visual.uvs.iter().map(|[u, v]| [*u, 1.0 - v].into()).collect();
        prim = prim.per_vertex("texCoord2f[]", "primvars:st", Value::Vec2fVec(st));
    } else if mesh.colors.len() == mesh.vertices.len() {
        let colors: Vec<[f32; 3]> = mesh.colors.iter().map(|c| c.map(linear)).collect();
        prim = prim.per_vertex("color3f[]", "primvars:displayColor", float3s(&colors));
    }
    Ok(Some(prim))
}

/// The material of a link: its texture, or the colours of its vertices. `folder` is where the folder of textures is, from the
/// folder of the layer.
pub(super) fn material(root: &str, link: &AssetLink, folder: &str) -> Result<Prim, String> {
    let here = format!("{root}/Looks/{}", link.name);
    let shader = |name: &str, id: &str| Prim::new("Shader", name).uniform("token", "info:id", token(id));
    let surface = shader("surface", "UsdPreviewSurface").attr("float", "inputs:metallic", Value::Float(0.0)).attr(
        "float",
        "inputs:roughness",
        Value::Float(0.8),
    );
    let color = "inputs:diffuseColor";
    let (surface, feeders) = if is_textured(&link.visual) {
        let file = Value::AssetPath(AssetPath::new(format!("{folder}/{}", texture_file(link))));
        let reader = shader("coordinates", "UsdPrimvarReader_float2")
            .attr("string", "inputs:varname", Value::String("st".into()))
            .output("float2", "outputs:result");
        let texture = shader("texture", "UsdUVTexture")
            .attr("asset", "inputs:file", file)
            .attr("token", "inputs:sourceColorSpace", token("sRGB"))
            .connect("float2", "inputs:st", &format!("{here}/coordinates.outputs:result"))?
            .attr("token", "inputs:wrapS", token("clamp"))
            .attr("token", "inputs:wrapT", token("clamp"))
            .output("float3", "outputs:rgb");
        (surface.connect("color3f", color, &format!("{here}/texture.outputs:rgb"))?, vec![reader, texture])
    } else if link.visual.mesh.colors.len() == link.visual.mesh.vertices.len() {
        let reader = shader("colors", "UsdPrimvarReader_float3")
            .attr("string", "inputs:varname", Value::String("displayColor".into()))
            .output("float3", "outputs:result");
        (surface.connect("color3f", color, &format!("{here}/colors.outputs:result"))?, vec![reader])
    } else {
        (surface.attr("color3f", color, Value::Vec3f([0.5; 3].into())), Vec::new())
    };
    let mut material = Prim::new("Material", link.name.clone())
        .connect("token", "outputs:surface", &format!("{here}/surface.outputs:surface"))?
        .child(surface.output("token", "outputs:surface"));
    material.children.extend(feeders);
    Ok(material)
}

/// The physics material of a link, as all its hulls bind it.
pub(super) fn contact(link: &AssetLink) -> Prim {
    let ContactMaterial { friction, restitution } = link.contact;
    Prim::new("Material", link.name.clone())
        .api("PhysicsMaterialAPI")
        .attr("float", "physics:staticFriction", Value::Float(friction as f32))
        .attr("float", "physics:dynamicFriction", Value::Float(friction as f32))
        .attr("float", "physics:restitution", Value::Float(restitution as f32))
}

/// The hulls of a link that are written, in their order.
pub(super) fn solid(link: &AssetLink) -> impl Iterator<Item = &Mesh> {
    link.collision.iter().filter(|hull| !hull.is_empty() && !hull.vertices.is_empty())
}

/// Name of the prim of a hull, by its place among those of its link.
pub(super) fn hull_name(place: usize) -> String {
    format!("collision_{place}")
}

/// The hulls that a link collides with, for physics only.
pub(super) fn hulls(root: &str, link: &AssetLink) -> Result<Vec<Prim>, String> {
    let prim = |(i, hull): (usize, &Mesh)| {
        let prim = mesh_prim(hull_name(i), hull)
            .api("PhysicsCollisionAPI")
            .api("PhysicsMeshCollisionAPI")
            .api("MaterialBindingAPI")
            .rel("material:binding:physics", &format!("{root}/Contacts/{}", link.name))?
            .uniform("token", "purpose", token("guide"))
            .attr("bool", "physics:collisionEnabled", Value::Bool(true))
            .uniform("token", "physics:approximation", token("convexHull"));
        Ok(prim)
    };
    solid(link).enumerate().map(prim).collect()
}

/// The Gaussians of a link; none if there are none.
pub(super) fn gaussians(splats: &Splats) -> Result<Option<Prim>, String> {
    if splats.is_empty() {
        return Ok(None);
    }
    let activated = Activated::of(splats)?;
    let shapes = activated.scales.iter().zip(&activated.rotations).zip(&activated.opacities);
    let reach = shapes.map(|((scale, turn), opacity)| reach(scale, turn, *opacity));
    let sh = splats.sh.as_chunks::<3>().0;
    let rotations = activated.rotations.iter().map(|q| (*q).into()).collect();
    Ok(Some(
        Prim::new("ParticleField3DGaussianSplat", "splats")
            .attr("float3[]", "extent", float3s(&bounds(splats.means.iter().copied().zip(reach))))
            .attr("point3f[]", "positions", float3s(&splats.means))
            .attr("quatf[]", "orientations", Value::QuatfVec(rotations))
            .attr("float3[]", "scales", float3s(&activated.scales))
            .attr("float[]", "opacities", Value::FloatVec(activated.opacities))
            .uniform("int", "radiance:sphericalHarmonicsDegree", Value::Int(splats.sh_degree as i32))
            .attr("float3[]", "radiance:sphericalHarmonicsCoefficients", float3s(sh)),
    ))
}

#[cfg(test)]
mod tests {
    use super::reach;

    #[test]
    fn a_gaussian_reaches_three_deviations_along_its_own_axes() {
        let quarter_about_z = [0.5f32.sqrt(), 0.0, 0.0, 0.5f32.sqrt()];
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(near(reach(&[0.1, 0.2, 0.3], &quarter_about_z, 1.0), [0.6, 0.3, 0.9]));
        // What no pixel shows has no extent.
        assert!(near(reach(&[0.1, 0.2, 0.3], &quarter_about_z, 0.003), [0.0; 3]));
    }
}
