//! Hulls of links and their penetration at given poses.

use crate::CheckOptions;
use crate::model::{Link, Model, bounds};
use crate::report::StateFinding;
use artgs_core::{Rigid, State};
use glam::DVec3;
use rapier3d::parry::bounding_volume::BoundingVolume as _;
use rapier3d::parry::query;
use rapier3d::parry::shape::{ConvexPolyhedron, Shape};
use rapier3d::parry::transformation::try_convex_hull;
use rapier3d::prelude::{Pose, Real, Rotation, SharedShape, Vector};

/// Convex shapes per link, link frame.
pub(crate) struct Scene {
    pub(crate) hulls: Vec<Vec<SharedShape>>,
}

/// A vector of the engine.
pub(crate) fn vector(v: DVec3) -> Vector {
    Vector::from_array(v.as_vec3().to_array())
}

/// A pose of the engine.
pub(crate) fn pose(motion: &Rigid) -> Pose {
    let q = motion.rotation.as_quat();
    Pose::from_parts(vector(motion.translation), Rotation::from_xyzw(q.x, q.y, q.z, q.w))
}

/// Distance of a point of the link's frame from a hull, negative inside; from outside at least the distance from the plane of one of its
/// faces. The planes decide on the side: the engine's search takes some points 5 mm beside thin hulls for points inside.
pub(crate) fn signed(hull: &SharedShape, p: DVec3) -> f64 {
    let found = f64::from(hull.distance_to_local_point(vector(p), false));
    let Some(hull) = hull.as_convex_polyhedron() else { return found };
    let before = planes(hull).map(|(normal, corner)| f64::from(normal.dot(vector(p) - corner)));
    let beyond = before.fold(f64::NEG_INFINITY, f64::max);
    if beyond > 0.0 { found.max(beyond) } else { beyond }
}

impl Scene {
    /// The hull of every collision mesh, and problems of meshes without a hull, with their links.
    pub(crate) fn of(model: &Model) -> (Self, Vec<(usize, String)>) {
        let mut flat = Vec::new();
        let mut hulls = Vec::new();
        for (i, link) in model.links.iter().enumerate() {
            let mut shapes = Vec::new();
            // Unreadable meshes are reported by their reader.
            for (k, shape) in link.hulls.iter().enumerate().filter(|(_, s)| !s.points.is_empty()) {
                let points: Vec<Vector> = shape.points.iter().map(|p| vector(*p)).collect();
                match hull(&points) {
                    Some(hull) => shapes.push(SharedShape::new(hull)),
                    None => flat.push((i, format!("hull {k} is flat or invalid: it has no volume"))),
                }
            }
            hulls.push(shapes);
        }
        (Self { hulls }, flat)
    }

    /// True if a hull reaches within `near` of a point of the object's frame; with a negative value, at least so deep.
    pub(crate) fn holds(&self, poses: &[Rigid], p: DVec3, near: f64) -> bool {
        let inside = |(hulls, at): (&Vec<SharedShape>, &Rigid)| {
            let own = at.inverse().apply(p);
            hulls.iter().any(|hull| signed(hull, own) <= near)
        };
        self.hulls.iter().zip(poses).any(inside)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.hulls.iter().all(Vec::is_empty)
    }

    /// Deepest penetration of two different links, with the links; only pairs for which `tested` is true.
    pub(crate) fn deepest(&self, poses: &[Rigid], tested: impl Fn(usize, usize) -> bool) -> (f64, Option<[usize; 2]>) {
        let poses: Vec<Pose> = poses.iter().map(pose).collect();
        let boxes: Vec<Vec<_>> = self
            .hulls
            .iter()
            .zip(&poses)
            .map(|(hulls, at)| hulls.iter().map(|h| h.compute_aabb(at)).collect())
            .collect();
        let mut worst = (0.0, None);
        for a in 0..poses.len() {
            for b in (a + 1..poses.len()).filter(|b| tested(a, *b)) {
                for (i, first) in self.hulls[a].iter().enumerate() {
                    for (j, second) in self.hulls[b].iter().enumerate() {
                        if !boxes[a][i].intersects(&boxes[b][j]) {
                            continue;
                        }
                        let apart = distance([&poses[a], &poses[b]], [first.0.as_ref(), second.0.as_ref()]);
                        let depth = apart.map_or(0.0, |d| f64::from(-d));
                        if depth > worst.0 {
                            worst = (depth, Some([a, b]));
                        }
                    }
                }
            }
        }
        worst
    }
}

/// Distance of two convex shapes, negative where they penetrate. Penetration is asked for only where the distance is zero, and it
/// is at most as deep as the planes of the faces allow: for thin hulls that are apart the queries of the engine can find one
/// (examples: 2.3 mm for hulls 10 mm apart, 3.7 mm for hulls that a face separates).
pub(crate) fn distance(poses: [&Pose; 2], shapes: [&dyn Shape; 2]) -> Option<Real> {
    let apart = query::distance(poses[0], shapes[0], poses[1], shapes[1]).ok()?.distance;
    if apart > 0.0 {
        return Some(apart);
    }
    let met = query::contact(poses[0], shapes[0], poses[1], shapes[1], 0.0).ok()?;
    let found = met.map_or(0.0, |contact| contact.dist);
    let least = match shapes.map(|shape| shape.as_convex_polyhedron()) {
        [Some(a), Some(b)] => beyond_faces(a, poses[0], b, poses[1]).max(beyond_faces(b, poses[1], a, poses[0])),
        _ => found,
    };
    Some(found.max(least))
}

/// Largest distance of a hull from the plane of a face of another one, negative if it is behind all of them.
fn beyond_faces(of: &ConvexPolyhedron, at: &Pose, other: &ConvexPolyhedron, other_at: &Pose) -> Real {
    let relative = at.inv_mul(other_at);
    let points: Vec<Vector> = other.points().iter().map(|p| relative * *p).collect();
    let before = |(normal, corner): (Vector, Vector)| {
        points.iter().map(|p| normal.dot(*p - corner)).fold(Real::INFINITY, Real::min)
    };
    planes(of).map(before).fold(Real::NEG_INFINITY, Real::max)
}

/// Outward normal and a corner of every face.
fn planes(hull: &ConvexPolyhedron) -> impl Iterator<Item = (Vector, Vector)> + '_ {
    let corners = hull.vertices_adj_to_face();
    hull.faces().iter().map(|face| (face.normal, hull.points()[corners[face.first_vertex_or_edge as usize] as usize]))
}

/// The convex hull of points; none if it has no volume.
fn hull(points: &[Vector]) -> Option<ConvexPolyhedron> {
    /// Least volume of a hull relative to the cube of its size: a needle with a ratio of a thousand has more.
    const THINNEST: f64 = 1e-7;
    if points.iter().any(|p| !p.is_finite()) {
        return None;
    }
    let (points, faces) = try_convex_hull(points).ok()?;
    let at = |i: u32| DVec3::from_array((points[i as usize] - points[0]).to_array().map(f64::from));
    let volume: f64 = faces.iter().map(|f| at(f[0]).dot(at(f[1]).cross(at(f[2]))) / 6.0).sum();
    let [low, high] = bounds((0..points.len() as u32).map(at))?;
    let solid = volume > THINNEST * (high - low).length().powi(3);
    if solid { ConvexPolyhedron::from_convex_mesh(points, &faces) } else { None }
}

/// The names of two links.
pub(crate) fn names(model: &Model, links: Option<[usize; 2]>) -> Option<[String; 2]> {
    links.map(|pair| pair.map(|i| model.links[i].name.clone()))
}

/// Penetration in an observed state, all joints together.
pub(crate) fn state(model: &Model, scene: &Scene, state: State, options: &CheckOptions) -> StateFinding {
    let value = |link: &Link| link.motion.as_ref().and_then(|m| m.observed).map_or(0.0, |o| o[state]);
    let values: Vec<f64> = model.links.iter().map(value).collect();
    let (penetration, pair) = scene.deepest(&model.poses(&values), |_, _| true);
    let between = names(model, pair);
    let mut problems = Vec::new();
    if let Some([a, b]) = between.as_ref().filter(|_| penetration > options.penetration) {
        problems.push(format!("`{a}` and `{b}` penetrate each other by {:.1} mm", 1e3 * penetration));
    }
    StateFinding { state: state.name().into(), penetration, between, problems }
}

#[cfg(test)]
#[path = "poses_tests.rs"]
mod tests;
