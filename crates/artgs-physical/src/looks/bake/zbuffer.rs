//! Z-buffer of meshes: the visible surface of every pixel.

use artgs_core::{Camera, DepthMap, Mesh};
use glam::{DVec2, DVec3};

/// The visible surface of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Position in the list of meshes.
    pub mesh: usize,
    /// Index of the triangle.
    pub triangle: usize,
    /// Weights of its corners.
    pub weights: [f32; 3],
    /// Planar depth, scene units.
    pub depth: f32,
}

/// The visible surface of every pixel centre, `[height * width]`; triangles are visible from both sides. Meshes are in the
/// camera's world frame; triangles that reach behind the camera are ignored.
pub fn visible(camera: &Camera, meshes: &[&Mesh]) -> Vec<Option<Hit>> {
    let k = &camera.intrinsics;
    let (width, height) = (k.width as usize, k.height as usize);
    let mut hits: Vec<Option<Hit>> = vec![None; width * height];
    for (index, mesh) in meshes.iter().enumerate() {
        let seen: Vec<(DVec2, f64)> =
            mesh.vertices.iter().map(|v| camera.project(DVec3::from_array(v.map(f64::from)))).collect();
        for (triangle, t) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = t.map(|v| seen[v as usize]);
            if a.1.min(b.1).min(c.1) <= 0.0 {
                continue;
            }
            each_pixel([a.0, b.0, c.0], [width, height], |x, y, w| {
                // In the image 1 / depth is linear, and so is any attribute divided by depth.
                let inverse = w[0] / a.1 + w[1] / b.1 + w[2] / c.1;
                let depth = (1.0 / inverse) as f32;
                let hit = &mut hits[y * width + x];
                if hit.is_none_or(|h| depth < h.depth) {
                    let weights = [w[0] / a.1, w[1] / b.1, w[2] / c.1].map(|w| (w / inverse) as f32);
                    *hit = Some(Hit { mesh: index, triangle, weights, depth });
                }
            });
        }
    }
    hits
}

/// Renders the depth of the meshes, for views without measured depth.
pub(crate) fn depth_of(camera: &Camera, meshes: &[&Mesh]) -> DepthMap {
    let depths: Vec<f32> = visible(camera, meshes).iter().map(|h| h.map_or(0.0, |h| h.depth)).collect();
    DepthMap::nearest(&depths)
}

/// Calls `visit(x, y, weights)` for every pixel of an image whose centre is inside a triangle of either winding.
pub(super) fn each_pixel(triangle: [DVec2; 3], size: [usize; 2], mut visit: impl FnMut(usize, usize, [f64; 3])) {
    let [a, b, c] = triangle;
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let area = (b - a).perp_dot(c - a);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let range = |low: f64, high: f64, size: usize| {
        let first = (low - 0.5).ceil().max(0.0) as usize;
        first..((high - 0.5).floor() + 1.0).clamp(0.0, size as f64) as usize
    };
    for y in range(low.y, high.y, size[1]) {
        for x in range(low.x, high.x, size[0]) {
            let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            let u = (c - b).perp_dot(p - b) / area;
            let v = (a - c).perp_dot(p - c) / area;
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                visit(x, y, [u, v, 1.0 - u - v]);
            }
        }
    }
}
