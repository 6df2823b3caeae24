//! When two motions of a part may be those of one joint: two joints that are both correct differ by up to twice the errors that a
//! correct joint may have.

use artgs_core::{Joint, JointKind, Rigid};
use glam::DVec3;

/// Largest angle between the axes of one joint, degrees.
const AXIS_DEG: f64 = 10.0;
/// Largest distance of the axes as a share of the part's size, and largest difference of the motions as a share of either the
/// motion or the part's size.
const SHARE: f64 = 0.1;

/// A part for which motions are compared.
pub(super) struct ComparedPart {
    /// Middle of the part at the start, world frame.
    pub(super) middle: DVec3,
    /// Diagonal of the part's box, scene units.
    pub(super) size: f64,
    /// Motions that turn less are slides, degrees.
    pub(super) turn_deg: f64,
}

impl ComparedPart {
    /// Type of the joint of a motion.
    pub(super) fn kind(&self, motion: &Rigid) -> JointKind {
        if motion.angle().to_degrees() > self.turn_deg { JointKind::Revolute } else { JointKind::Prismatic }
    }

    /// True if the motions (start to end) may be those of one joint: the type, the axis to 10 degrees, its place to 10 % of the part's
    /// size, the motion to 10 % of itself or of the part's size.
    pub(super) fn is_same_joint(&self, a: &Rigid, b: &Rigid) -> bool {
        let kind = self.kind(a);
        if kind != self.kind(b) {
            return false;
        }
        let [a, b] = [a, b].map(|motion| Joint::from_motion(kind, motion).with_origin_near(self.middle));
        let [amount, other] = [&a, &b].map(|joint| {
            let motion = joint.start_to_end();
            if kind == JointKind::Revolute { motion.angle() } else { motion.translation.length() }
        });
        // A turn moves points at the far end by its angle times their distance from the axis.
        let reach = if kind == JointKind::Revolute { 1.0 } else { self.size };
        let as_far = (amount - other).abs() <= SHARE * amount.max(reach);
        let aligned = directed(&a).dot(directed(&b)) >= AXIS_DEG.to_radians().cos();
        let apart = if kind == JointKind::Revolute { between(&a, &b) } else { 0.0 };
        aligned && as_far && apart <= SHARE * self.size
    }
}

/// Axis in the direction of the motion from start to end.
fn directed(joint: &Joint) -> DVec3 {
    let [start, end] = [artgs_core::State::START, artgs_core::State::END].map(|state| joint.state_values[state]);
    if end < start { -joint.axis } else { joint.axis }
}

/// Distance of the axes beside the part: of the points of both that are nearest to its middle.
fn between(a: &Joint, b: &Joint) -> f64 {
    let across = |from: &Joint, to: &Joint| (from.origin - to.origin).reject_from_normalized(to.axis).length();
    across(a, b).max(across(b, a))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_within_the_errors_of_a_correct_one_are_the_same() {
        let part = ComparedPart { middle: DVec3::new(0.3, 0.0, 0.5), size: 1.0, turn_deg: 3.0 };
        let door = |tilt_deg: f64, at: f64, angle_deg: f64| {
            let axis = Rigid::about(DVec3::X, DVec3::ZERO, tilt_deg.to_radians()).turn(DVec3::Z);
            Rigid::about(axis, DVec3::new(at, 0.0, 0.5), angle_deg.to_radians())
        };
        let found = door(0.0, 0.0, 60.0);
        for same in [door(1.6, 0.0, 60.0), door(0.0, 0.04, 60.0), door(5.7, 0.0, 58.0)] {
            assert!(part.is_same_joint(&found, &same) && part.is_same_joint(&same, &found));
        }
        let slide = |y: f64| Rigid::shift(DVec3::new(0.0, y, 0.0));
        for other in
            [door(12.0, 0.0, 60.0), door(0.0, 0.15, 60.0), door(0.0, 0.0, 50.0), door(0.0, 0.0, -60.0), slide(0.5)]
        {
            assert!(!part.is_same_joint(&found, &other), "{other:?}");
        }
        assert!(part.is_same_joint(&slide(0.3), &slide(0.34)));
        assert!(!part.is_same_joint(&slide(0.3), &slide(0.45)) && !part.is_same_joint(&slide(0.3), &slide(-0.3)));
    }
}
