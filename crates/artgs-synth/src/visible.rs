//! What a camera sees of a surface: triangles are drawn into a depth buffer, which is faster than a ray for every pixel.

use crate::trace::{Intersection, Surface};
use artgs_core::{Intrinsics, Rigid};
use glam::{DVec2, DVec3};

/// Nearer points are not projected, multiples of the optical axis.
const NEAR: f64 = 1e-6;
/// Edges belong to both neighbours, so that nothing is seen between them.
const EDGE: f64 = -1e-9;

/// A number that changes linearly over the image: at the first pixel, and its steps to the right and down.
#[derive(Clone, Copy)]
struct Linear([f64; 3]);

impl Linear {
    /// `w` times the direction of a pixel's ray, camera frame, 1 along the optical axis.
    fn along(w: DVec3, k: &Intrinsics, first: DVec2) -> Self {
        let steps = [w.x / k.fx, w.y / k.fy];
        Self([w.z + steps[0] * (first.x - k.cx) + steps[1] * (first.y - k.cy), steps[0], steps[1]])
    }

    fn at(&self, x: f64, y: f64) -> f64 {
        self.0[0] + self.0[1] * x + self.0[2] * y
    }
}

/// For every pixel the nearest front of a triangle, row-major. Rays go through the centres of the pixels, shifted by `offset`
/// (pixels); they are 1 along the optical axis.
pub(crate) fn visible(
    surface: &Surface,
    world_to_camera: &Rigid,
    k: &Intrinsics,
    offset: [f64; 2],
) -> Vec<Option<Intersection>> {
    let (width, height) = (k.width as usize, k.height as usize);
    let mut seen: Vec<Option<Intersection>> = vec![None; width * height];
    let first = DVec2::new(0.5 + offset[0], 0.5 + offset[1]);
    let turn = world_to_camera.matrix();
    for triangle in 0..surface.len() {
        let corners = surface.corners(triangle).map(|p| turn * p + world_to_camera.translation);
        let [a, b, c] = corners;
        let (e1, e2) = (b - a, c - a);
        let normal = e1.cross(e2);
        let height_above = -a.dot(normal);
        let Some([left, right, top, bottom]) = pixels_around(&corners, k, first).filter(|_| height_above > 0.0) else {
            continue;
        };
        let linear = |w: DVec3| Linear::along(w, k, first);
        let (slopes, us, vs) = (linear(-normal), linear(a.cross(e2)), linear(e1.cross(a)));
        for y in top..bottom {
            for x in left..right {
                let (fx, fy) = (x as f64, y as f64);
                let (slope, u, v) = (slopes.at(fx, fy), us.at(fx, fy), vs.at(fx, fy));
                let edge = EDGE * slope;
                if slope <= 0.0 || u < edge || v < edge || u + v > slope - edge {
                    continue;
                }
                let t = height_above / slope;
                let nearest = &mut seen[y * width + x];
                if nearest.is_none_or(|n| t < n.t) {
                    *nearest = Some(Intersection { t, triangle, weights: [u / slope, v / slope] });
                }
            }
        }
    }
    seen
}

/// Columns and rows, `[first, last + 1, first, last + 1]`, that a triangle in front of the camera may cover; none behind it.
fn pixels_around(corners: &[DVec3; 3], k: &Intrinsics, first: DVec2) -> Option<[usize; 4]> {
    let project = |p: DVec3| DVec2::new(p.x / p.z * k.fx + k.cx, p.y / p.z * k.fy + k.cy) - first;
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for i in 0..3 {
        let (p, q) = (corners[i], corners[(i + 1) % 3]);
        let crosses = (p.z > NEAR) != (q.z > NEAR);
        let between = crosses.then(|| p.lerp(q, (NEAR - p.z) / (q.z - p.z)).with_z(NEAR));
        for point in [(p.z > NEAR).then_some(p), between].into_iter().flatten().map(project) {
            (low, high) = (low.min(point), high.max(point));
        }
    }
    let clamp = |v: f64, most: u32| v.clamp(0.0, f64::from(most)) as usize;
    let (low, high) = (low.floor(), high.floor() + 2.0);
    let range = [clamp(low.x, k.width), clamp(high.x, k.width), clamp(low.y, k.height), clamp(high.y, k.height)];
    (range[0] < range[1] && range[2] < range[3]).then_some(range)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::object_in_metres;
    use crate::recording::room_surface;
    use artgs_core::State;

    #[test]
    fn a_depth_buffer_sees_what_rays_hit() {
        let object = object_in_metres("storage2", 3).unwrap();
        let surface = room_surface(object, State::END);
        let k = Intrinsics { width: 64, height: 48, fx: 50.0, fy: 51.0, cx: 31.0, cy: 25.0 };
        let mut different = 0;
        for (turn, x) in [(0.3, -0.4), (1.9, 0.7), (4.0, 1.2)] {
            // A camera of a person, who may stand in clutter: some triangles are behind it.
            let pose = Rigid::about(DVec3::Z, DVec3::ZERO, turn);
            let pose = Rigid::shift(DVec3::new(x, -1.2, 0.9)) * pose * Rigid::about(DVec3::X, DVec3::ZERO, -1.8);
            let seen = visible(&surface, &pose.inverse(), &k, [0.2, -0.4]);
            for (pixel, seen) in seen.iter().enumerate() {
                let at = DVec2::new((pixel % 64) as f64 + 0.7, (pixel / 64) as f64 + 0.1);
                let ray = pose.turn(DVec3::new((at.x - k.cx) / k.fx, (at.y - k.cy) / k.fy, 1.0));
                let cast = surface.cast(pose.translation, ray);
                let same = match (cast, seen) {
                    (Some(a), Some(b)) => (a.t - b.t).abs() < 1e-9 * a.t,
                    (a, b) => a.is_none() && b.is_none(),
                };
                different += usize::from(!same);
            }
            assert!(seen.iter().flatten().count() > 64 * 48 / 2);
        }
        assert_eq!(different, 0);
    }
}
