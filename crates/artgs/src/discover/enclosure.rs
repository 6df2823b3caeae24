//! Which part encloses a place, as the front and the sides of a drawer enclose its floor.

use glam::{DVec3, Vec3};
use std::cmp::Ordering;

/// Share of the points beside the box on each side of an axis: strays do not enlarge it.
const STRAY: f64 = 0.02;

/// A box around points, with one axis given and the others along and across the points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Enclosure {
    axes: [Vec3; 3],
    lower: Vec3,
    upper: Vec3,
}

impl Enclosure {
    /// Box of `points` with `axis` (unit), grown by `margin` (scene units); none for fewer than `least` points.
    pub(super) fn around(points: &[Vec3], axis: Vec3, margin: f32, least: usize) -> Option<Self> {
        if points.len() < least.max(1) || axis == Vec3::ZERO {
            return None;
        }
        let axes = axes(points, axis);
        let side = |k: usize| {
            let mut along: Vec<f32> = points.iter().map(|p| p.dot(axes[k])).collect();
            let stray = (STRAY * points.len() as f64) as usize;
            let last = along.len() - 1 - stray;
            let order = |a: &f32, b: &f32| a.partial_cmp(b).unwrap_or(Ordering::Equal);
            let lower = *along.select_nth_unstable_by(stray, order).1;
            let upper = *along.select_nth_unstable_by(last, order).1;
            (lower - margin, upper + margin)
        };
        let sides = [side(0), side(1), side(2)];
        Some(Self { axes, lower: Vec3::from(sides.map(|s| s.0)), upper: Vec3::from(sides.map(|s| s.1)) })
    }

    /// True for points in the box.
    pub(super) fn contains(&self, point: Vec3) -> bool {
        let at = Vec3::from(self.axes.map(|axis| point.dot(axis)));
        at.cmpge(self.lower).all() && at.cmple(self.upper).all()
    }
}

/// The axis and two directions normal to it, the first of which is that in which the points extend farthest.
fn axes(points: &[Vec3], axis: Vec3) -> [Vec3; 3] {
    let (u, v) = axis.any_orthonormal_pair();
    let mean = points.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / points.len() as f64;
    let (mut uu, mut uv, mut vv) = (0.0, 0.0, 0.0);
    for p in points {
        let d = p.as_dvec3() - mean;
        let (x, y) = (d.dot(u.as_dvec3()), d.dot(v.as_dvec3()));
        (uu, uv, vv) = (uu + x * x, uv + x * y, vv + y * y);
    }
    // Angle of the major axis of a symmetric 2 x 2 matrix.
    let (sine, cosine) = (0.5 * f64::atan2(2.0 * uv, uu - vv)).sin_cos();
    let along = (u * cosine as f32 + v * sine as f32).normalize();
    [axis, along, axis.cross(along)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_drawer_encloses_its_floor_and_a_door_does_not() {
        let turn = glam::Quat::from_rotation_z(0.4);
        // Front and two sides of a drawer that slides along y; the floor is at the bottom.
        let mut drawer = Vec::new();
        let mut door = Vec::new();
        for (i, j) in (0..30).flat_map(|i| (0..30).map(move |j| (i as f32 / 29.0, j as f32 / 29.0))) {
            drawer.push(turn * Vec3::new(i, 0.0, 0.3 * j));
            drawer.push(turn * Vec3::new(0.0, i, 0.3 * j));
            drawer.push(turn * Vec3::new(1.0, i, 0.3 * j));
            door.push(turn * Vec3::new(i, 0.0, 1.0 + j));
        }
        let floor = turn * Vec3::new(0.5, 0.5, 0.0);
        let around = |points: &[Vec3], axis: Vec3| Enclosure::around(points, axis, 0.02, 10).expect("a box");
        let drawer = around(&drawer, turn * Vec3::Y);
        let door = around(&door, turn * Vec3::Z);
        assert!(drawer.contains(floor) && !door.contains(floor));
        assert!(!drawer.contains(floor - 0.1 * Vec3::Z) && door.contains(turn * Vec3::new(0.5, 0.0, 1.5)));
        assert!(Enclosure::around(&[Vec3::ZERO; 5], Vec3::Z, 0.1, 10).is_none());
    }
}
