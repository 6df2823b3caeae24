//! Vertex normals with creases.

use crate::geometry::topology::{NONE, Sets, corner_angle, corners, cross, ends, next, twins};
use artgs_core::{Mesh, TexturedMesh};
use glam::DVec3;

/// The mesh with a normal per vertex; vertices are split along edges whose triangles differ by more than `crease` radians.
/// Triangles are weighted by area and angle, so that large flat ones stay flat beside bevels. Positions, triangles and their
/// order stay; texture coordinates are empty.
pub(crate) fn with_normals(mesh: &Mesh, crease: f64) -> TexturedMesh {
    let twins = twins(mesh);
    let points: Vec<[DVec3; 3]> = mesh.triangles.iter().map(|t| corners(mesh, *t)).collect();
    let areas: Vec<f64> = mesh.triangles.iter().map(|t| cross(mesh, *t).length()).collect();
    let flat: Vec<DVec3> = points.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a).normalize_or_zero()).collect();
    let mut fans = Sets::new(twins.len());
    for (h, twin) in twins.iter().enumerate().filter(|(_, t)| **t != NONE) {
        let (n, m) = (flat[h / 3], flat[*twin as usize / 3]);
        // Degenerate triangles follow their neighbours.
        if n.dot(m) >= crease.cos() || n == DVec3::ZERO || m == DVec3::ZERO {
            fans.join(h as u32, next(*twin));
            fans.join(next(h as u32), *twin);
        }
    }
    let colored = mesh.colors.len() == mesh.vertices.len();
    let mut index = vec![NONE; twins.len()];
    let mut out = Mesh::default();
    let mut normals: Vec<DVec3> = Vec::new();
    for h in 0..twins.len() {
        let root = fans.find(h as u32) as usize;
        if index[root] == NONE {
            let vertex = ends(&mesh.triangles, h as u32)[0] as usize;
            index[root] = out.vertices.len() as u32;
            out.vertices.push(mesh.vertices[vertex]);
            normals.push(DVec3::ZERO);
            if colored {
                out.colors.push(mesh.colors[vertex]);
            }
        }
        index[h] = index[root];
        normals[index[h] as usize] += flat[h / 3] * (areas[h / 3] * corner_angle(points[h / 3], h % 3));
    }
    out.triangles = index.as_chunks::<3>().0.to_vec();
    let normals = normals.iter().map(|n| n.normalize_or(DVec3::Z).as_vec3().to_array()).collect();
    TexturedMesh { mesh: out, normals, ..TexturedMesh::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::topology::testing::{open_box, sphere};
    use crate::geometry::weld::welded;
    use crate::settings::LookSettings;
    use glam::Vec3;

    #[test]
    fn a_box_has_flat_sides_and_a_sphere_is_round() {
        let block = with_normals(&welded(&open_box(DVec3::ONE, 3, [true; 6]), 1e-6), LookSettings::DEFAULT.crease);
        assert_eq!(block.mesh.vertices.len(), 6 * 16);
        assert!(block.normals.iter().all(|n| n.map(f32::abs).iter().sum::<f32>() < 1.0 + 1e-6));
        let ball = with_normals(&welded(&sphere(2.0, 20), 1e-6), LookSettings::DEFAULT.crease);
        assert_eq!(ball.mesh.vertices.len(), 6 * 20 * 20 + 2);
        let along = |(v, n): (&[f32; 3], &[f32; 3])| Vec3::from_array(*v).normalize().dot(Vec3::from_array(*n));
        assert!(ball.mesh.vertices.iter().zip(&ball.normals).map(along).all(|c| c > 0.998));
        assert_eq!(ball.mesh.colors.len(), ball.mesh.vertices.len());
    }
}
