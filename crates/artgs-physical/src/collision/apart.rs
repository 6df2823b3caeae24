//! Links that cannot touch: engines need not test them against each other.

use crate::settings::PoseSettings;
use artgs_core::{Asset, AssetJoint, AssetLink, JointKind, Mesh};
use glam::DVec3;
use parry3d_f64::bounding_volume::{Aabb, BoundingVolume as _};
use parry3d_f64::math::{Pose3, Vec3};
use parry3d_f64::query::details::closest_points_support_map_support_map_with_params as closest_points;
use parry3d_f64::query::gjk::{GJKResult, VoronoiSimplex};
use parry3d_f64::shape::SupportMap;
use rayon::prelude::*;

/// Pairs of links with the same parent whose convex pieces cannot touch at any values of their joints within the limits: planes in the
/// frame of the parent separate all places of the pieces of one from those of the other. First link before second.
pub(crate) fn links_apart(asset: &Asset, settings: &PoseSettings) -> Vec<[usize; 2]> {
    let swept: Vec<Vec<Swept>> = asset.links.par_iter().map(|link| Swept::of_pieces(link, settings)).collect();
    let pairs = (0..asset.links.len()).flat_map(|a| (a + 1..asset.links.len()).map(move |b| [a, b]));
    let are_apart = |[a, b]: &[usize; 2]| {
        let same_parent = asset.links[*a].parent == asset.links[*b].parent;
        let (first, second) = (&swept[*a], &swept[*b]);
        let known = !first.is_empty() && !second.is_empty();
        same_parent && known && first.par_iter().all(|one| second.iter().all(|other| one.is_apart_from(other)))
    };
    pairs.filter(are_apart).collect()
}

/// Corners of a convex piece in poses over a part of the range of its joint, in the frame of the parent but for the place of that. All
/// places of the piece are in the convex hull of balls around them.
struct Swept {
    points: Vec<Vec3>,
    /// Radius of the balls, metres.
    radius: f64,
    /// Box around the balls.
    bounds: Aabb,
}

impl Swept {
    /// All pieces of a link; none without a joint.
    fn of_pieces(link: &AssetLink, settings: &PoseSettings) -> Vec<Self> {
        let Some(joint) = link.joint else { return Vec::new() };
        let of_piece = |piece: &Mesh| {
            let corners: Vec<DVec3> = piece.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
            let at = move |values: Vec<f64>| Self::of(&corners, (&values, settings.sagitta), &joint, link.origin);
            groups(&joint, settings).into_iter().map(at)
        };
        link.collision.iter().flat_map(of_piece).collect()
    }

    /// Corners at these values of a joint, the motions in between included.
    fn of(corners: &[DVec3], (values, sagitta): (&[f64], f64), joint: &AssetJoint, origin: DVec3) -> Self {
        let arm = corners.iter().map(|p| p.reject_from_normalized(joint.axis).length()).fold(0.0, f64::max);
        let radius = if joint.kind == JointKind::Prismatic { 0.0 } else { sagitta * arm };
        let at = |value: &f64| {
            let motion = joint.motion(*value);
            corners.iter().map(move |p| Vec3::from_array((origin + motion.apply(*p)).to_array()))
        };
        let points: Vec<Vec3> = values.iter().flat_map(at).collect();
        let bounds = Aabb::from_points(points.iter().copied()).loosened(radius);
        Self { points, radius, bounds }
    }

    /// True if a plane lies between the two.
    fn is_apart_from(&self, other: &Self) -> bool {
        if !self.bounds.intersects(&other.bounds) {
            return true;
        }
        let found = closest_points(&Pose3::IDENTITY, self, other, f64::MAX, &mut VoronoiSimplex::new(), None);
        let GJKResult::ClosestPoints(_, _, normal) = found else { return false };
        // The direction decides by itself, however exact the search was.
        let reach = self.local_support_point(normal).dot(normal);
        let from = other.local_support_point(-normal).dot(normal);
        from - reach > (self.radius + other.radius) * normal.length()
    }
}

/// Values of a joint in groups over its range, the last of one the first of the next: the limits of a slide; of a hinge, values so close
/// that chords follow the arc, in groups so short that convex hulls do.
fn groups(joint: &AssetJoint, settings: &PoseSettings) -> Vec<Vec<f64>> {
    let steps = settings.arc;
    let [lower, upper] = joint.limits;
    if joint.kind == JointKind::Prismatic {
        return vec![joint.limits.to_vec()];
    }
    let step = 2.0 * (1.0 - settings.sagitta).acos();
    let count = ((upper - lower) / step).ceil().max(1.0) as usize;
    let value = |i: usize| lower + (upper - lower) * i as f64 / count as f64;
    (0..count).step_by(steps).map(|from| (from..=(from + steps).min(count)).map(value).collect()).collect()
}

impl SupportMap for Swept {
    fn local_support_point(&self, direction: Vec3) -> Vec3 {
        let along = |p: &&Vec3| p.dot(direction);
        let farthest = self.points.iter().max_by(|p, q| along(p).total_cmp(&along(q)));
        farthest.copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::PerState;
    use std::f64::consts::FRAC_PI_2;

    fn link(kind: JointKind, axis: DVec3, limits: [f64; 2], origin: DVec3, size: [f32; 3]) -> AssetLink {
        let observed = PerState::new(0.0, limits[1]);
        let joint = AssetJoint {
            kind,
            axis,
            pitch: 0.0,
            limits,
            observed,
            effort: 1.0,
            velocity: 1.0,
            damping: 0.0,
            friction: 0.0,
        };
        let collision = vec![Mesh::cuboid([0.0; 3], size)];
        AssetLink { parent: Some(0), joint: Some(joint), origin, collision, ..AssetLink::default() }
    }

    fn pairs(links: Vec<AssetLink>) -> Vec<[usize; 2]> {
        let base = AssetLink { collision: vec![Mesh::cuboid([0.0; 3], [1.0; 3])], ..AssetLink::default() };
        links_apart(
            &Asset { links: std::iter::once(base).chain(links).collect(), ..Asset::default() },
            &PoseSettings::DEFAULT,
        )
    }

    /// A drawer of 1 x 0.5 x 0.2 m that opens towards -Y.
    fn drawer(height: f64) -> AssetLink {
        link(JointKind::Prismatic, DVec3::NEG_Y, [0.0, 0.4], DVec3::Z * height, [1.0, 0.5, 0.2])
    }

    #[test]
    fn drawers_above_each_other_are_apart_if_a_gap_is_between_them() {
        assert_eq!(pairs(vec![drawer(0.0), drawer(0.203), drawer(0.403)]), [[1, 2], [1, 3]]);
        // A rail that reaches below a part of the drawer beneath: pieces are separated one by one.
        let mut with_rail = drawer(0.203);
        with_rail.collision.push(Mesh::cuboid([1.01, 0.1, -0.1], [1.03, 0.4, 0.1]));
        assert_eq!(pairs(vec![drawer(0.0), with_rail]), [[1, 2]]);
        // A drawer in a drawer has another parent.
        let inner = AssetLink { parent: Some(1), ..drawer(0.5) };
        assert!(pairs(vec![drawer(0.0), inner]).is_empty());
        assert!(pairs(vec![drawer(0.0), AssetLink { collision: Vec::new(), ..drawer(0.5) }]).is_empty());
    }

    #[test]
    fn a_door_touches_only_what_it_can_reach() {
        // Hinges at the outer edges: the doors meet in the middle, with 4 mm between them.
        let left =
            |angle: f64| link(JointKind::Revolute, DVec3::NEG_Z, [0.0, angle], DVec3::NEG_Y * 0.1, [0.498, 0.02, 0.8]);
        let mut right = left(FRAC_PI_2);
        right.origin.x = 1.0;
        right.collision = vec![Mesh::cuboid([-0.494, 0.0, 0.0], [0.0, 0.02, 0.8])];
        if let Some(joint) = &mut right.joint {
            joint.axis = DVec3::Z;
        }
        assert_eq!(pairs(vec![left(FRAC_PI_2), right.clone()]), [[1, 2]]);
        // With both hinges at the left edges, the second door sweeps through the place of the first one.
        let mut second = left(3.0);
        second.origin.x = 0.5;
        assert!(pairs(vec![left(FRAC_PI_2), second]).is_empty());
        // A drawer behind the door can be closed while the door turns, but is in its way when it is open.
        let behind = link(JointKind::Prismatic, DVec3::NEG_Y, [0.0, 0.3], DVec3::new(0.1, 0.0, 0.1), [0.3, 0.4, 0.2]);
        assert!(pairs(vec![left(FRAC_PI_2), behind]).is_empty());
    }

    #[test]
    fn arcs_between_poses_count() {
        // A bar of 0.5 m turns by a quarter; its corner reaches x = 0.5 only in between.
        let bar = link(JointKind::Revolute, DVec3::Z, [-0.785, 0.785], DVec3::ZERO, [0.5, 0.001, 0.1]);
        let beside = |gap: f64| {
            link(JointKind::Prismatic, DVec3::Z, [0.0, 0.1], DVec3::new(0.5 + gap, -0.1, 0.0), [0.1, 0.2, 0.1])
        };
        assert!(pairs(vec![bar.clone(), beside(0.0)]).is_empty());
        assert_eq!(pairs(vec![bar, beside(0.001)]), [[1, 2]]);
    }
}
