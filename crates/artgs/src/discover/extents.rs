//! Motions of flat parts within their plane, which their surface does not show, from the extents of the part.

use super::cloud::{Cloud, principal_axes};
use artgs_core::Rigid;
use glam::{DVec3, Vec3};

/// `motion` (start to end) with what takes the box around the points `from` of the start state to that around the points
/// `to` of the end state, within the plane of `to`. None if the boxes differ in size, or the points are not flat.
pub(super) fn with_extents(from: &Cloud, to: &Cloud, motion: &Rigid) -> Option<Rigid> {
    /// Fewer points have no extents.
    const LEAST: usize = 60;
    /// Largest ratio of the sides of two boxes of one part, less one.
    const ALIKE: f32 = 0.08;
    /// Largest turn within the plane that is corrected, radians.
    const TURN: f32 = 0.15;
    /// Thickness of a flat part, as a share of the shorter side.
    const FLAT: f32 = 0.15;
    if from.len().min(to.len()) < LEAST {
        return None;
    }
    let moved: Vec<Vec3> = from.points.iter().map(|p| motion.apply(p.as_dvec3()).as_vec3()).collect();
    let all: Vec<usize> = (0..to.len()).collect();
    let [long, short, normal] = principal_axes(to, &all);
    let turn = long_direction(&moved, long, short);
    if turn.abs() > TURN {
        return None;
    }
    let turned = Rigid::about(normal.as_dvec3(), mean(&moved), f64::from(-turn));
    let moved: Vec<Vec3> = moved.iter().map(|p| turned.apply(p.as_dvec3()).as_vec3()).collect();
    let mut shift = Vec3::ZERO;
    let mut shorter = f32::INFINITY;
    for axis in [long, short] {
        let ((a, b), (c, d)) = (side(&moved, axis), side(&to.points, axis));
        let ratio = (b - a) / (d - c).max(1e-9);
        if ratio.max(1.0 / ratio.max(1e-9)) > 1.0 + ALIKE {
            return None;
        }
        shift += axis * (0.5 * (c + d) - 0.5 * (a + b));
        shorter = shorter.min(d - c);
    }
    let (back, front) = side(&to.points, normal);
    (front - back < FLAT * shorter).then(|| Rigid::shift(shift.as_dvec3()) * turned * *motion)
}

fn mean(points: &[Vec3]) -> DVec3 {
    points.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / points.len().max(1) as f64
}

/// Angle of the longest direction of points in the plane of `long` and `short`, from `long` towards `short` as a turn about
/// their normal `long x short`, radians.
fn long_direction(points: &[Vec3], long: Vec3, short: Vec3) -> f32 {
    let centre = mean(points).as_vec3();
    let (mut uu, mut uv, mut vv) = (0.0, 0.0, 0.0);
    for p in points {
        let (u, v) = ((*p - centre).dot(long), (*p - centre).dot(short));
        (uu, uv, vv) = (uu + u * u, uv + u * v, vv + v * v);
    }
    0.5 * (2.0 * uv).atan2(uu - vv)
}

/// Least and largest coordinate along an axis, without strays.
fn side(points: &[Vec3], axis: Vec3) -> (f32, f32) {
    /// Share of the points beside the box on each side.
    const STRAY: f64 = 0.01;
    let mut along: Vec<f32> = points.iter().map(|p| p.dot(axis)).collect();
    along.sort_unstable_by(f32::total_cmp);
    let stray = (STRAY * along.len() as f64) as usize;
    (along[stray], along[along.len() - 1 - stray])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet(width: f64) -> Cloud {
        let mut cloud = Cloud::default();
        for (i, j) in (0..40).flat_map(|i| (0..25).map(move |j| (i, j))) {
            cloud.points.push(DVec3::new(width * f64::from(i) / 39.0, 0.4 * f64::from(j) / 24.0, 0.0).as_vec3());
        }
        cloud
    }

    #[test]
    fn a_sheet_that_slid_and_turned_in_its_plane_is_brought_back() {
        let truth = Rigid::about(DVec3::X, DVec3::new(0.0, -0.1, 0.05), 1.2);
        let start = sheet(0.7);
        let mut end = start.clone();
        end.points.iter_mut().for_each(|p| *p = truth.apply(p.as_dvec3()).as_vec3());
        let normal = truth.turn(DVec3::Z);
        let wrong = Rigid::about(normal, truth.apply(DVec3::new(0.3, 0.2, 0.0)), 0.06)
            * Rigid::shift(truth.turn(DVec3::new(0.03, -0.02, 0.0)))
            * truth;
        let gap = |m: &Rigid| {
            start.points.iter().map(|p| m.apply(p.as_dvec3()).distance(truth.apply(p.as_dvec3()))).fold(0.0, f64::max)
        };
        let found = with_extents(&start, &end, &wrong).expect("boxes of one size");
        assert!(gap(&wrong) > 0.03 && gap(&found) < 1e-3, "{} {}", gap(&wrong), gap(&found));
        // A sheet of which one state shows less has other extents.
        assert!(with_extents(&sheet(0.55), &end, &wrong).is_none());
    }
}
