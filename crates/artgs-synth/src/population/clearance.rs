//! No two bodies intersect, in any state or on the way from one to the next.

use super::model::Body;
use artgs_core::Rigid;
use glam::DVec3;
use parry3d_f64::math::{Pose3, Rot3, Vec3};
use parry3d_f64::query::{distance, intersection_test};
use parry3d_f64::shape::{Shape as _, TriMesh};

/// Largest steps on the way: radians and metres.
const STEP: [f64; 2] = [0.06, 0.02];

/// The surfaces of all bodies, object frame with all joints at 0.
pub(super) struct Clearance<'a> {
    bodies: &'a [Body],
    meshes: Vec<TriMesh>,
    /// A corner of every piece.
    corners: Vec<Vec<DVec3>>,
}

impl<'a> Clearance<'a> {
    pub(super) fn new(bodies: &'a [Body]) -> Option<Self> {
        let meshes = bodies.iter().map(|body| mesh(body.points())).collect::<Option<Vec<_>>>()?;
        let corner = |body: &Body| body.pieces.iter().filter_map(|p| p.solid.0.first().map(|t| t[0])).collect();
        Some(Self { bodies, meshes, corners: bodies.iter().map(corner).collect() })
    }

    /// Two bodies that intersect in a state, if there are any. One may be inside the other.
    pub(super) fn conflict(&self, values: &[f64]) -> Option<[usize; 2]> {
        let poses = poses(self.bodies, values);
        let n = self.bodies.len();
        let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j]));
        pairs
            .into_iter()
            .find(|[i, j]| self.meet(&poses, *i, *j) || self.holds(&poses, *i, *j) || self.holds(&poses, *j, *i))
    }

    /// Two bodies that intersect on every way from one state to the next that was tried: all at once, and one after the other in
    /// an order that is searched for.
    pub(super) fn conflict_between(&self, from: &[f64], to: &[f64]) -> Option<[usize; 2]> {
        let all: Vec<usize> = (1..self.bodies.len()).filter(|&b| from[b] != to[b]).collect();
        self.conflict_of(from, to, &all)?;
        let (mut at, mut left) = (from.to_vec(), all);
        while !left.is_empty() {
            let mut found = None;
            let free = left.iter().position(|&body| {
                let mut next = at.clone();
                next[body] = to[body];
                let conflict = self.conflict_of(&at, &next, &[body]);
                found = found.or(conflict);
                conflict.is_none()
            });
            let Some(free) = free else { return found };
            let body = left.remove(free);
            at[body] = to[body];
        }
        None
    }

    /// Two bodies that intersect while some bodies move at once.
    fn conflict_of(&self, from: &[f64], to: &[f64], moving: &[usize]) -> Option<[usize; 2]> {
        let steps = moving.iter().map(|&b| {
            let size = (to[b] - from[b]).abs();
            let slides = self.bodies[b].mechanism.as_ref().is_some_and(|m| m.kind == artgs_core::JointKind::Prismatic);
            (size / STEP[usize::from(slides)]).ceil() as usize
        });
        let steps = steps.max().unwrap_or(0).max(2);
        let carried: Vec<bool> = (0..self.bodies.len()).map(|b| self.is_carried(b, moving)).collect();
        let n = self.bodies.len();
        // A pair of which both or none are carried by the only body that moves keeps its distance.
        let pairs: Vec<[usize; 2]> = (0..n)
            .flat_map(|i| (i + 1..n).map(move |j| [i, j]))
            .filter(|[i, j]| if moving.len() == 1 { carried[*i] != carried[*j] } else { carried[*i] || carried[*j] })
            .collect();
        for step in 1..steps {
            let share = step as f64 / steps as f64;
            let values: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + (b - a) * share).collect();
            let poses = poses(self.bodies, &values);
            if let Some(pair) = pairs.iter().find(|[i, j]| self.meet(&poses, *i, *j)) {
                return Some(*pair);
            }
        }
        None
    }

    /// True if a body or one that carries it is among some.
    fn is_carried(&self, mut body: usize, by: &[usize]) -> bool {
        while body > 0 {
            if by.contains(&body) {
                return true;
            }
            body = self.bodies[body].parent;
        }
        false
    }

    fn meet(&self, poses: &[Rigid], i: usize, j: usize) -> bool {
        let [a, b] = [pose(&poses[i]), pose(&poses[j])];
        let (box_a, box_b) = (self.meshes[i].compute_aabb(&a), self.meshes[j].compute_aabb(&b));
        let apart = box_a.maxs.cmplt(box_b.mins).any() || box_b.maxs.cmplt(box_a.mins).any();
        // The cost is that of the triangles of the first one near the second one.
        let (a, i, b, j) =
            if self.meshes[i].num_triangles() < self.meshes[j].num_triangles() { (a, i, b, j) } else { (b, j, a, i) };
        !apart && intersection_test(&a, &self.meshes[i], &b, &self.meshes[j]).is_ok_and(|found| found.intersecting)
    }

    /// True if a piece of body `j` has a corner inside a piece of body `i`.
    fn holds(&self, poses: &[Rigid], i: usize, j: usize) -> bool {
        let relative = poses[i].inverse() * poses[j];
        let toward = DVec3::new(0.312_7, 0.520_3, 0.793_1);
        self.corners[j].iter().any(|corner| {
            let from = relative.apply(*corner);
            self.bodies[i].pieces.iter().any(|piece| winding(&piece.solid.0, from, toward) > 0)
        })
    }
}

/// Object frame with all joints at 0 to that with these values, for every body.
pub(super) fn poses(bodies: &[Body], values: &[f64]) -> Vec<Rigid> {
    let mut poses = Vec::with_capacity(bodies.len());
    for (body, value) in bodies.iter().zip(values) {
        let own = body.mechanism.as_ref().map_or(Rigid::IDENTITY, |m| m.joint([0.0; 2]).motion(*value));
        let parent = if body.mechanism.is_some() { poses[body.parent] } else { Rigid::IDENTITY };
        poses.push(parent * own);
    }
    poses
}

/// Least distance between the surfaces of two sets of triangles, metres; none if one is empty.
pub(super) fn gap(a: impl Iterator<Item = DVec3>, b: impl Iterator<Item = DVec3>) -> Option<f64> {
    let (a, b) = (mesh(a)?, mesh(b)?);
    distance(&Pose3::IDENTITY, &a, &Pose3::IDENTITY, &b).ok().map(|found| found.distance)
}

fn mesh(points: impl Iterator<Item = DVec3>) -> Option<TriMesh> {
    let vertices: Vec<Vec3> = points.map(|p| Vec3::new(p.x, p.y, p.z)).collect();
    let triangles = (0..vertices.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    TriMesh::new(vertices, triangles).ok()
}

fn pose(motion: &Rigid) -> Pose3 {
    let (q, t) = (motion.rotation, motion.translation);
    Pose3::from_parts(Vec3::new(t.x, t.y, t.z), Rot3::from_xyzw(q.x, q.y, q.z, q.w))
}

/// Faces of a closed surface that a ray leaves through minus those it enters through: 0 outside.
fn winding(triangles: &[[DVec3; 3]], from: DVec3, toward: DVec3) -> i32 {
    let crossing = |[a, b, c]: &[DVec3; 3]| {
        let (e1, e2, out) = (*b - *a, *c - *a, from - *a);
        let slope = -toward.dot(e1.cross(e2));
        if slope == 0.0 {
            return 0;
        }
        let across = out.cross(toward);
        let (u, v, t) = (e2.dot(across) / slope, -e1.dot(across) / slope, out.dot(e1.cross(e2)) / slope);
        let hit = t > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        if hit { if slope < 0.0 { 1 } else { -1 } } else { 0 }
    };
    triangles.iter().map(crossing).sum()
}

#[cfg(test)]
mod tests {
    use super::super::model::Mechanism;
    use super::*;
    use crate::Material;
    use crate::shape::cuboid;

    const GREY: Material = Material::Plain { color: [0.5; 3] };

    /// A block with a wall before it, and a door in the wall that turns away.
    fn blocked() -> Vec<Body> {
        let door = Mechanism::hinge(DVec3::NEG_Z, DVec3::new(-0.1, -0.02, 0.0), [0.0, 100.0], 10.0);
        let slide = Mechanism::slide(DVec3::NEG_Y, [0.0, 0.3], 0.05);
        vec![
            Body::fixed("floor").with(GREY, cuboid([-1.0, -1.0, -0.1], [1.0, 1.0, -0.01])),
            Body::new("door", 0, door).with(GREY, cuboid([-0.1, -0.02, 0.0], [0.1, -0.01, 0.2])),
            Body::new("block", 0, slide).with(GREY, cuboid([-0.05, 0.0, 0.0], [0.05, 0.2, 0.1])),
        ]
    }

    #[test]
    fn a_door_must_open_before_what_is_behind_it_slides_out() {
        let bodies = blocked();
        let clearance = Clearance::new(&bodies).unwrap();
        assert_eq!(clearance.conflict(&[0.0, 0.0, 0.0]), None);
        assert_eq!(clearance.conflict(&[0.0, 0.0, 0.2]), Some([1, 2]));
        assert_eq!(clearance.conflict(&[0.0, 1.7, 0.2]), None);
        // Both at once meet; the door first does not.
        assert_eq!(clearance.conflict_of(&[0.0; 3], &[0.0, 1.7, 0.2], &[1, 2]), Some([1, 2]));
        assert_eq!(clearance.conflict_between(&[0.0; 3], &[0.0, 1.7, 0.2]), None);
        assert_eq!(clearance.conflict_between(&[0.0, 1.7, 0.2], &[0.0; 3]), None);
        assert_eq!(clearance.conflict_between(&[0.0, 0.0, -0.3], &[0.0, 0.0, 0.5]), Some([1, 2]));
    }

    #[test]
    fn a_body_inside_another_one_is_a_conflict() {
        let slide = Mechanism::slide(DVec3::Z, [0.0, 3.0], 0.1);
        let bodies = vec![
            Body::fixed("big").with(GREY, cuboid([-1.0; 3], [1.0; 3])),
            Body::new("small", 0, slide).with(GREY, cuboid([-0.1; 3], [0.1; 3])),
        ];
        let clearance = Clearance::new(&bodies).unwrap();
        assert_eq!(clearance.conflict(&[0.0, 0.0]), Some([0, 1]));
        assert_eq!(clearance.conflict(&[0.0, 1.2]), None);
        let found = gap(bodies[0].points(), bodies[1].points().map(|p| p + DVec3::Z * 1.5)).unwrap();
        assert!((found - 0.4).abs() < 1e-9, "{found}");
    }
}
