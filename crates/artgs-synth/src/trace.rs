//! Ray casting against the surface of an object in one state, with a bounding volume hierarchy.

use crate::object::Object;
use artgs_core::State;
use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::ray::Ray;
#[cfg(test)]
use obvhs::ray::RayHit;
use obvhs::triangle::Triangle;
use std::time::Duration;

/// All triangles of an object in one state, world frame.
pub(crate) struct Surface {
    triangles: Vec<[DVec3; 3]>,
    /// Part and piece of each triangle.
    owners: Vec<(u32, u32)>,
    /// Which triangle each leaf of the tree holds.
    order: Vec<u32>,
    tree: CwBvh,
}

/// Intersection of a ray with the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Intersection {
    /// Distance in multiples of the direction of the ray.
    pub(crate) t: f64,
    pub(crate) triangle: usize,
    /// Weights of the triangle's second and third corner.
    pub(crate) weights: [f64; 2],
}

impl Surface {
    pub(crate) fn new(object: &Object, state: State) -> Self {
        let (mut triangles, mut owners) = (Vec::new(), Vec::new());
        for (p, part) in object.parts.iter().enumerate() {
            let pose = object.pose(p, state);
            for (q, piece) in part.pieces.iter().enumerate() {
                triangles.extend(piece.solid.0.iter().map(|t| t.map(|v| pose.apply(v))));
                owners.resize(triangles.len(), (p as u32, q as u32));
            }
        }
        let single = |t: &[DVec3; 3]| {
            let [v0, v1, v2] = t.map(|v| v.as_vec3a());
            Triangle { v0, v1, v2 }
        };
        let flat: Vec<Triangle> = triangles.iter().map(single).collect();
        let tree = build_cwbvh_from_tris(&flat, BvhBuildParams::medium_build(), &mut Duration::default());
        let order = tree.primitive_indices.clone();
        Self { triangles, owners, order, tree }
    }

    pub(crate) fn len(&self) -> usize {
        self.triangles.len()
    }

    pub(crate) fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle]
    }

    /// Outward unit normal of a triangle.
    pub(crate) fn normal(&self, triangle: usize) -> DVec3 {
        let [a, b, c] = self.triangles[triangle];
        (b - a).cross(c - a).normalize_or(DVec3::Z)
    }

    /// Part and piece of a triangle.
    pub(crate) fn owner(&self, triangle: usize) -> (usize, usize) {
        let (part, piece) = self.owners[triangle];
        (part as usize, piece as usize)
    }

    /// The nearest intersection of a ray with the front of a triangle: what [`crate::visible`] computes for all pixels at once. The tree
    /// works in single precision, the intersection of triangles in double.
    #[cfg(test)]
    pub(crate) fn cast(&self, from: DVec3, direction: DVec3) -> Option<Intersection> {
        let mut best: Option<Intersection> = None;
        let intersect = |_: &Ray, id: usize| {
            let triangle = self.order[id] as usize;
            let Some((t, weights)) = self.intersect(triangle, from, direction, true) else { return f32::INFINITY };
            if best.is_none_or(|b| t < b.t) {
                best = Some(Intersection { t, triangle, weights });
            }
            t as f32
        };
        self.tree.ray_traverse(Ray::new_inf(single(from), single(direction)), &mut RayHit::none(), intersect);
        best
    }

    /// Intersection of a ray with a triangle: multiple of its direction, weights of the second and third corner.
    /// Edges belong to both neighbours, so that no ray passes between them.
    fn intersect(&self, triangle: usize, from: DVec3, direction: DVec3, front_only: bool) -> Option<(f64, [f64; 2])> {
        const EDGE: f64 = -1e-9;
        let [a, b, c] = self.triangles[triangle];
        let (e1, e2, out) = (b - a, c - a, from - a);
        let slope = -direction.dot(e1.cross(e2));
        if slope == 0.0 || (front_only && slope < 0.0) {
            return None;
        }
        let (across, scale) = (out.cross(direction), 1.0 / slope);
        let (u, v) = (e2.dot(across) * scale, -e1.dot(across) * scale);
        let t = out.dot(e1.cross(e2)) * scale;
        (t > 0.0 && u >= EDGE && v >= EDGE && u + v <= 1.0 - EDGE).then_some((t, [u, v]))
    }

    /// True if a surface is between a point and the sky in a direction.
    pub(crate) fn is_hidden(&self, from: DVec3, direction: DVec3) -> bool {
        let ray = Ray::new_inf(single(from), single(direction));
        let intersect = |_: &Ray, id: usize| {
            let found = self.intersect(self.order[id] as usize, from, direction, false);
            found.map_or(f32::INFINITY, |(t, _)| t as f32)
        };
        !self.tree.ray_traverse_miss(ray, intersect)
    }

    /// Number of faces that a ray leaves through minus those it enters through: 0 outside all closed surfaces.
    #[cfg(test)]
    pub(crate) fn depth_inside(&self, from: DVec3, direction: DVec3, part: usize) -> i32 {
        let ray = Ray::new_inf(single(from), single(direction));
        let mut depth = 0;
        self.tree.ray_traverse_anyhit(ray, |_, id| {
            let triangle = self.order[id] as usize;
            if self.owners[triangle].0 as usize == part && self.intersect(triangle, from, direction, false).is_some() {
                depth += if self.normal(triangle).dot(direction) > 0.0 { 1 } else { -1 };
            }
        });
        depth
    }
}

fn single(v: DVec3) -> Vec3A {
    v.as_vec3a()
}
