//! Motions that a symmetric part may be confused with.

use super::cloud::{Cloud, principal_axes};
use artgs_core::Rigid;
use glam::{Vec2, Vec3};
use std::f32::consts::FRAC_PI_2;
use std::f64::consts::PI;

/// Motions that take a box around the points `group` to the same place as `motion` does, turned by half a circle about each of
/// its axes before. A thin lid of which the other state shows the other side fits best when it is turned over. Squares have no principal
/// axes in their plane, so the axes of the smallest box are used too, where they differ.
pub(super) fn twins(cloud: &Cloud, group: &[usize], motion: &Rigid) -> Vec<Rigid> {
    /// Fewer points have no axes.
    const LEAST: usize = 12;
    /// Least difference, degrees: smaller ones disappear in a registration.
    const DIFFERENT: f64 = 15.0;
    if group.len() < LEAST {
        return Vec::new();
    }
    let turned_about = |axes: [Vec3; 3]| {
        let middle = |axis: Vec3| {
            let [lower, upper] = extent(group.iter().map(|&i| cloud.points[i].dot(axis)));
            0.5 * (lower + upper)
        };
        let centre: Vec3 = axes.iter().map(|axis| *axis * middle(*axis)).sum();
        axes.map(|axis| *motion * Rigid::about(axis.as_dvec3(), centre.as_dvec3(), PI))
    };
    let principal = principal_axes(cloud, group);
    let of_box = box_axes(principal, cloud, group);
    let mut out = turned_about(principal).to_vec();
    if f64::from(of_box[0].angle_between(principal[0])).to_degrees() > DIFFERENT {
        // Both have the same normal.
        out.extend(&turned_about(of_box)[..2]);
    }
    out
}

/// Axes of the box around points that has the same normal and, within its plane, the smallest rectangle.
fn box_axes([long, wide, short]: [Vec3; 3], cloud: &Cloud, group: &[usize]) -> [Vec3; 3] {
    /// Points that are compared at most.
    const SAMPLES: usize = 500;
    /// Angles within a quarter of a turn.
    const ANGLES: i32 = 90;
    let flat: Vec<Vec2> = (group.iter().step_by(group.len().div_ceil(SAMPLES)))
        .map(|&i| Vec2::new(cloud.points[i].dot(long), cloud.points[i].dot(wide)))
        .collect();
    let direction = |k: i32| Vec2::from_angle(k as f32 * FRAC_PI_2 / ANGLES as f32);
    let area = |k: i32| {
        let length = |axis: Vec2| {
            let [lower, upper] = extent(flat.iter().map(|p| p.dot(axis)));
            upper - lower
        };
        length(direction(k)) * length(direction(k).perp())
    };
    // Of equal areas that of the principal axes.
    let angles = (-ANGLES / 2..ANGLES / 2).map(|k| (area(k), k));
    let best = angles.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.abs().cmp(&b.1.abs()))).map_or(0, |(_, k)| k);
    let axis = direction(best);
    let first = long * axis.x + wide * axis.y;
    [first, short.cross(first), short]
}

/// Least and largest of the values but for a few stray ones on each side.
fn extent(values: impl Iterator<Item = f32>) -> [f32; 2] {
    /// Share of the values on each side.
    const STRAY: f64 = 0.02;
    let mut values: Vec<f32> = values.collect();
    values.sort_unstable_by(f32::total_cmp);
    let stray = (STRAY * values.len() as f64) as usize;
    [values[stray], values[values.len() - 1 - stray]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_lid_that_is_turned_over_has_the_hinge_as_a_twin() {
        found_of_lid(DVec3::new(0.6, 0.4, 0.0), |_| true);
        // A square without most of one corner: its principal axes are the diagonals.
        found_of_lid(DVec3::new(0.4, 0.4, 0.0), |p| p.x + p.y < 0.6);
    }

    /// Turns over a lid of this size with its hinge along x, open by 30 degrees, that is opened by 76 more.
    fn found_of_lid(size: DVec3, seen: fn(DVec3) -> bool) {
        let hinge = |degrees: f64| Rigid::about(DVec3::X, DVec3::ZERO, degrees.to_radians());
        let mut cloud = Cloud::default();
        for (i, j) in (0..30).flat_map(|i| (0..20).map(move |j| (i, j))) {
            let flat = size * DVec3::new(f64::from(i) / 29.0, f64::from(j) / 19.0, 0.0);
            if seen(flat) {
                cloud.points.push(hinge(30.0).apply(flat).as_vec3());
            }
        }
        let truth = hinge(76.0);
        let over = Rigid::about(hinge(30.0).turn(DVec3::X), hinge(30.0).apply(0.5 * size), PI);
        let group: Vec<usize> = (0..cloud.len()).collect();
        let found = twins(&cloud, &group, &(truth * over));
        let gap = |m: &Rigid, p: DVec3| m.apply(p).distance(truth.apply(p));
        let worst = |m: &Rigid| cloud.points.iter().map(|p| gap(m, p.as_dvec3())).fold(0.0, f64::max);
        let worst: Vec<f64> = found.iter().map(worst).collect();
        assert!(worst.iter().any(|w| *w < 1e-3), "{worst:?}");
        assert!(twins(&cloud, &group[..5], &truth).is_empty());
    }
}
