//! Vertex colours from the images.

use super::view::{FusionView, PixelUse, Selection};
use artgs_core::Mesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Colours every vertex with the mean of the views that see it: selected pixels whose depth agrees within
/// `tolerance` (scene units), weighted by the squared cosine between ray and normal. Vertices that nobody sees get the
/// mean colour of the others; without colours in any view the mesh stays uncoloured. Views in the frame of the mesh.
pub fn paint(mesh: &mut Mesh, views: &[FusionView], selection: Selection, tolerance: f64) {
    if views.iter().all(|v| v.rgba.is_none()) {
        return;
    }
    let normals = vertex_normals(mesh);
    let eyes: Vec<DVec3> = views.iter().map(|v| v.camera.position()).collect();
    let seen: Vec<Option<Vec3>> = mesh
        .vertices
        .par_iter()
        .zip(&normals)
        .map(|(v, n)| {
            let p = DVec3::from_array(v.map(f64::from));
            let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
            for (view, eye) in views.iter().zip(&eyes) {
                let cosine = n.dot((eye - p).normalize_or_zero());
                if cosine < 0.1 {
                    continue;
                }
                if let Some(color) = seen_color(view, selection, p, tolerance) {
                    let w = (cosine * cosine) as f32;
                    sum += color * w;
                    weight += w;
                }
            }
            (weight > 0.0).then(|| sum / weight)
        })
        .collect();
    let known: Vec<Vec3> = seen.iter().flatten().copied().collect();
    let mean = known.iter().sum::<Vec3>() / known.len().max(1) as f32;
    mesh.colors = seen.iter().map(|c| c.unwrap_or(mean).round().to_array().map(|x| x as u8)).collect();
}

/// Colour of the pixel a point falls into, [0, 255], if the pixel sees that point.
fn seen_color(view: &FusionView, selection: Selection, point: DVec3, tolerance: f64) -> Option<Vec3> {
    let rgba = view.rgba.as_deref()?;
    let (uv, z) = view.camera.project(point);
    let k = &view.camera.intrinsics;
    if !(z > 0.0 && uv.x >= 0.0 && uv.y >= 0.0 && uv.x < f64::from(k.width) && uv.y < f64::from(k.height)) {
        return None;
    }
    let index = uv.y as usize * k.width as usize + uv.x as usize;
    let (PixelUse::Surface, depth) = view.pixel(index, selection) else { return None };
    let [r, g, b, _] = rgba[index];
    ((f64::from(depth) - z).abs() <= tolerance).then(|| Vec3::new(r.into(), g.into(), b.into()))
}

/// Unit normals, triangles weighted by area.
fn vertex_normals(mesh: &Mesh) -> Vec<DVec3> {
    let point = |i: u32| DVec3::from_array(mesh.vertices[i as usize].map(f64::from));
    let mut normals = vec![DVec3::ZERO; mesh.vertices.len()];
    for t in &mesh.triangles {
        let [a, b, c] = t.map(point);
        let n = (b - a).cross(c - a);
        t.iter().for_each(|i| normals[*i as usize] += n);
    }
    normals.iter().map(|n| n.normalize_or_zero()).collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing::orbit;
    use super::*;

    #[test]
    fn a_vertex_takes_the_colour_of_the_views_that_see_it() {
        let cameras = orbit(2, 32, 2.0);
        let (near, behind) = (vec![2.0; 32 * 32], vec![1.0; 32 * 32]);
        let (red, green) = (vec![[200, 10, 0, 255]; 32 * 32], vec![[0, 250, 0, 255]; 32 * 32]);
        let views = [
            FusionView { rgba: Some(red.into()), ..FusionView::new(cameras[0], near) },
            FusionView { rgba: Some(green.into()), ..FusionView::new(cameras[1], behind) },
        ];
        // A triangle through the origin that faces the first camera, and a far vertex no depth agrees with.
        let forward = cameras[0].position().normalize();
        let side = forward.any_orthonormal_vector() * 0.01;
        let up = forward.cross(side);
        let far = forward * -1.0;
        let vertices = [side, up, -side - up, far].map(|p| p.as_vec3().to_array()).to_vec();
        let mut mesh = Mesh { vertices, colors: vec![], triangles: vec![[0, 1, 2]] };
        paint(&mut mesh, &views, Selection::ALL, 0.05);
        assert_eq!(mesh.colors, [[200, 10, 0]; 4]);
    }
}
