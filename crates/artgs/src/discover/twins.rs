//! Motions that a symmetric part may be confused with.

use super::cloud::{Cloud, principal_axes};
use artgs_core::Rigid;
use glam::Vec3;
use std::f64::consts::PI;

/// Motions that take a box around the points `group` to the same place as `motion` does, turned by half a circle about each of
/// its axes before. A thin lid of which the other state shows the other side fits best when it is turned over.
pub(super) fn twins(cloud: &Cloud, group: &[usize], motion: &Rigid) -> Vec<Rigid> {
    /// Fewer points have no axes.
    const LEAST: usize = 12;
    /// Share of the points beside the box on each side.
    const STRAY: f64 = 0.02;
    if group.len() < LEAST {
        return Vec::new();
    }
    let axes = principal_axes(cloud, group);
    let middle = |axis: Vec3| {
        let mut along: Vec<f32> = group.iter().map(|&i| cloud.points[i].dot(axis)).collect();
        along.sort_unstable_by(f32::total_cmp);
        let stray = (STRAY * along.len() as f64) as usize;
        0.5 * (along[stray] + along[along.len() - 1 - stray])
    };
    let centre: Vec3 = axes.iter().map(|axis| *axis * middle(*axis)).sum();
    let turned = |axis: &Vec3| *motion * Rigid::about(axis.as_dvec3(), centre.as_dvec3(), PI);
    axes.iter().map(turned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_lid_that_is_turned_over_has_the_hinge_as_a_twin() {
        // A lid of 0.6 x 0.4 with its hinge along x, open by 30 degrees; it is opened by 76 more.
        let hinge = |degrees: f64| Rigid::about(DVec3::X, DVec3::ZERO, degrees.to_radians());
        let mut cloud = Cloud::default();
        for (i, j) in (0..30).flat_map(|i| (0..20).map(move |j| (i, j))) {
            let flat = DVec3::new(0.6 * f64::from(i) / 29.0, 0.4 * f64::from(j) / 19.0, 0.0);
            cloud.points.push(hinge(30.0).apply(flat).as_vec3());
        }
        let truth = hinge(76.0);
        let over = Rigid::about(hinge(30.0).turn(DVec3::X), hinge(30.0).apply(DVec3::new(0.3, 0.2, 0.0)), PI);
        let group: Vec<usize> = (0..cloud.len()).collect();
        let found = twins(&cloud, &group, &(truth * over));
        let gap = |m: &Rigid, p: DVec3| m.apply(p).distance(truth.apply(p));
        let worst = |m: &Rigid| cloud.points.iter().map(|p| gap(m, p.as_dvec3())).fold(0.0, f64::max);
        let worst: Vec<f64> = found.iter().map(worst).collect();
        assert!(worst.len() == 3 && worst.iter().any(|w| *w < 1e-3), "{worst:?}");
        assert!(twins(&cloud, &group[..5], &truth).is_empty());
    }
}
