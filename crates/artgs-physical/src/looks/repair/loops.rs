//! Rims of holes.

use super::RepairOptions;
use crate::geometry::topology::{NONE, ends, point, twins};
use crate::settings::RepairSettings;
use artgs_core::Mesh;
use glam::{DMat3, DVec2, DVec3};

/// Vertices around every hole, in the order in which a cap runs along them, of a mesh whose vertices have one fan each.
pub(super) fn holes(mesh: &Mesh) -> Vec<Vec<u32>> {
    let twins = twins(mesh);
    // The border of a triangle from a to b is the cap's from b to a.
    let mut before = vec![NONE; mesh.vertices.len()];
    for h in (0..twins.len() as u32).filter(|h| twins[*h as usize] == NONE) {
        let [a, b] = ends(&mesh.triangles, h);
        before[b as usize] = a;
    }
    let mut holes = Vec::new();
    for start in 0..before.len() as u32 {
        let mut hole = Vec::new();
        let mut v = start;
        while before[v as usize] != NONE {
            hole.push(v);
            v = std::mem::replace(&mut before[v as usize], NONE);
        }
        if hole.len() >= 3 {
            holes.push(hole);
        }
    }
    holes
}

/// Smooths a rim of many corners a little. Sharp turns between long edges stay.
pub(super) fn smooth(mesh: &mut Mesh, hole: &[u32], options: &RepairOptions) {
    let (reach, RepairSettings { rim_rounds, rim_corners, .. }) = (options.rim_smoothing, options.settings);
    let was: Vec<DVec3> = hole.iter().map(|v| point(mesh, *v)).collect();
    let mut now = was.clone();
    let n = now.len();
    for _ in 0..if n > rim_corners { rim_rounds } else { 0 } {
        let old = now.clone();
        for i in 0..n {
            let wanted = 0.5 * old[i] + 0.25 * (old[(i + 1) % n] + old[(i + n - 1) % n]);
            now[i] = was[i] + (wanted - was[i]).clamp_length_max(reach);
        }
    }
    for (v, p) in hole.iter().zip(&now) {
        mesh.vertices[*v as usize] = p.as_vec3().to_array();
    }
}

/// A rim in its plane.
pub(super) struct Flat {
    /// Corners in the plane, counter-clockwise on the whole.
    pub(super) points: Vec<DVec2>,
    /// Diagonal of the rim's box, scene units.
    pub(super) width: f64,
    /// Root mean square distance from the plane, scene units.
    pub(super) deviation: f64,
    /// Largest distance from the plane, scene units.
    pub(super) farthest: f64,
}

/// Projects a rim along its area vector, about which it winds counter-clockwise.
pub(super) fn flatten(mesh: &Mesh, hole: &[u32]) -> Flat {
    let points: Vec<DVec3> = hole.iter().map(|v| point(mesh, *v)).collect();
    let n = points.len();
    let mean = points.iter().sum::<DVec3>() / n as f64;
    let area: DVec3 = (0..n).map(|i| (points[i] - mean).cross(points[(i + 1) % n] - mean)).sum();
    let normal = area.normalize_or(DVec3::Z);
    let x = normal.any_orthonormal_vector();
    let to_plane = DMat3::from_cols(x, normal.cross(x), normal).transpose();
    let local: Vec<DVec3> = points.iter().map(|p| to_plane * (*p - mean)).collect();
    let (low, high) = points.iter().fold((points[0], points[0]), |(l, h), p| (l.min(*p), h.max(*p)));
    Flat {
        points: local.iter().map(|p| p.truncate()).collect(),
        width: low.distance(high),
        deviation: (local.iter().map(|p| p.z * p.z).sum::<f64>() / n as f64).sqrt(),
        farthest: local.iter().map(|p| p.z.abs()).fold(0.0, f64::max),
    }
}
