//! Errors of one joint. Both joints are read as motions from start to end, so an axis turned round with its values
//! negated is the same joint, and a turn by more than half a circle equals its complement the other way.

use artgs_core::{Joint, JointKind, Rigid};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Below this sine two axes count as parallel.
const PARALLEL: f64 = 1e-6;

/// Error of the motion from start to end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// Angle between the two rotations, degrees in [0, 180]; of joints that truly turn.
    Degrees(f64),
    /// Distance between the two displacements, scene units; of joints that truly slide.
    Length(f64),
}

impl Motion {
    /// The number in its own unit.
    pub fn value(self) -> f64 {
        match self {
            Self::Degrees(v) | Self::Length(v) => v,
        }
    }
}

/// Errors of one joint against the true one. Which are defined depends on the true kind only.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointErrors {
    /// Angle between the axes as lines, degrees in [0, 90].
    pub axis_angle_deg: f64,
    /// Distance between the axes as lines, tenths of a scene unit (scene units x 10); none if truly prismatic.
    pub axis_position_x10: Option<f64>,
    /// Error of the motion from start to end.
    pub motion: Motion,
    /// Error of the displacement along the true axis from start to end, scene units; only of joints that truly are
    /// screws, whose turn is in `motion`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slide: Option<f64>,
    /// Predicted and true kind agree.
    pub type_ok: bool,
}

/// All errors of a joint.
pub fn joint_errors(predicted: &Joint, truth: &Joint) -> JointErrors {
    JointErrors {
        axis_angle_deg: axis_angle_deg(predicted.axis, truth.axis),
        axis_position_x10: axis_position(predicted, truth).map(|d| 10.0 * d),
        motion: part_motion(predicted, truth),
        slide: screw_slide(predicted, truth),
        type_ok: predicted.kind == truth.kind,
    }
}

/// Angle between two directions as lines, degrees in [0, 90]; 90 if either is not a direction.
pub fn axis_angle_deg(a: DVec3, b: DVec3) -> f64 {
    // The arccosine of |a.b| / (|a| |b|), computed so that small angles keep their digits.
    let (sine, cosine) = (a.cross(b).length(), a.dot(b).abs());
    if sine + cosine > 0.0 { sine.atan2(cosine).to_degrees() } else { 90.0 }
}

/// Shortest distance between the two axes as endless lines, as published, scene units; none if the true joint is
/// prismatic. Lines that cross far from the object thus score 0: the angle separates those. A predicted prismatic
/// joint is measured by the line through its origin. Infinite if the prediction is not finite.
pub fn axis_position(predicted: &Joint, truth: &Joint) -> Option<f64> {
    if truth.kind == JointKind::Prismatic {
        return None;
    }
    let (a, b) = (predicted.axis.normalize_or_zero(), truth.axis.normalize_or_zero());
    let (gap, across) = (predicted.origin - truth.origin, a.cross(b));
    let sine = across.length();
    let distance = if sine < PARALLEL { gap.reject_from(b).length() } else { gap.dot(across).abs() / sine };
    Some(if distance.is_nan() { f64::INFINITY } else { distance })
}

/// Error of the motion from start to end: the angle between the rotations if the true joint turns, else the distance
/// between the displacements of the true joint's origin, which for two prismatic joints is `|t - t'|`.
pub fn part_motion(predicted: &Joint, truth: &Joint) -> Motion {
    let (p, t) = (predicted.start_to_end(), truth.start_to_end());
    let worst = |v: f64, bound: f64| if v.is_nan() { bound } else { v };
    match truth.kind {
        JointKind::Prismatic => {
            Motion::Length(worst((p.apply(truth.origin) - t.apply(truth.origin)).length(), f64::INFINITY))
        }
        JointKind::Revolute | JointKind::Screw => Motion::Degrees(worst((p.inverse() * t).angle().to_degrees(), 180.0)),
    }
}

/// Difference of the displacements along the true axis of a true screw, scene units; none for other joints. Infinite
/// if the prediction is not finite.
pub(crate) fn screw_slide(predicted: &Joint, truth: &Joint) -> Option<f64> {
    let along = |j: &Joint| (j.start_to_end().apply(truth.origin) - truth.origin).dot(truth.axis.normalize_or_zero());
    let error = (along(predicted) - along(truth)).abs();
    (truth.kind == JointKind::Screw).then_some(if error.is_nan() { f64::INFINITY } else { error })
}

/// What a motion from start to end does, read as a joint of the given kind near `origin`; parts of the motion that the
/// kind does not have are dropped.
pub(crate) fn read_as(kind: JointKind, motion: &Rigid, origin: DVec3) -> Joint {
    match kind {
        JointKind::Prismatic => Joint::from_motion(kind, &Rigid::shift(motion.apply(origin) - origin)),
        _ => Joint::from_motion(kind, motion),
    }
    .with_origin_near(origin)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn revolute(axis: DVec3, origin: DVec3, angle_deg: f64) -> Joint {
        let v = angle_deg.to_radians();
        Joint {
            kind: JointKind::Revolute,
            axis,
            origin,
            pitch: 0.0,
            state_values: artgs_core::PerState::new(0.0, v),
            limits: [0.0, v],
        }
    }

    fn prismatic(axis: DVec3, length: f64) -> Joint {
        let (kind, values) = (JointKind::Prismatic, [0.0, length]);
        Joint {
            kind,
            axis,
            origin: DVec3::new(0.3, 0.1, 0.9),
            pitch: 0.0,
            state_values: artgs_core::PerState::new(0.0, length),
            limits: values,
        }
    }

    #[test]
    fn angles_fold_at_ninety_degrees() {
        let at = |deg: f64| DVec3::new(deg.to_radians().cos(), deg.to_radians().sin(), 0.0);
        for (deg, expected) in [(0.0, 0.0), (30.0, 30.0), (90.0, 90.0), (150.0, 30.0), (180.0, 0.0), (1e-7, 1e-7)] {
            let angle = axis_angle_deg(at(0.0), at(deg) * 3.0);
            assert!((angle - expected).abs() < 1e-12 + 1e-6 * expected, "{deg}: {angle}");
        }
        // The naive arccosine is NaN for many unit axes with themselves.
        for i in 0..100 {
            let a = DVec3::new(f64::from(i), 1.7, -0.3).normalize();
            assert!(axis_angle_deg(a, a) == 0.0);
        }
        assert_eq!(axis_angle_deg(DVec3::ZERO, DVec3::X), 90.0);
        assert_eq!(axis_angle_deg(DVec3::NAN, DVec3::X), 90.0);
    }

    #[test]
    fn positions_of_parallel_and_skew_lines() {
        let truth = revolute(DVec3::Z, DVec3::ZERO, 40.0);
        let position = |axis, origin| joint_errors(&revolute(axis, origin, 40.0), &truth).axis_position_x10.unwrap();
        assert!((position(DVec3::Z, DVec3::new(0.3, 0.4, 7.0)) - 5.0).abs() < 1e-12);
        assert!((position(-DVec3::Z, DVec3::new(0.3, 0.4, 7.0)) - 5.0).abs() < 1e-12);
        assert!((position(DVec3::X, DVec3::new(5.0, 0.2, 1.0)) - 2.0).abs() < 1e-12, "skew lines");
        assert!(position(DVec3::X, DVec3::new(5.0, 0.0, 1.0)) < 1e-12, "crossing lines");
        assert_eq!(position(DVec3::X, DVec3::NAN), f64::INFINITY);
    }

    #[test]
    fn an_opposite_axis_with_a_negative_motion_is_the_same_joint() {
        let origin = DVec3::new(0.1, 0.2, 0.3);
        let truth = revolute(DVec3::Y, origin, 70.0);
        let e = joint_errors(&revolute(-DVec3::Y, origin + DVec3::Y, -70.0), &truth);
        assert!(e.axis_angle_deg < 1e-9 && e.axis_position_x10.unwrap() < 1e-9 && e.motion.value() < 1e-9);
        let slide = prismatic(DVec3::X, 0.2);
        let e = joint_errors(&prismatic(-DVec3::X, -0.2), &slide);
        assert!(e.axis_angle_deg < 1e-9 && e.motion.value() < 1e-12 && e.axis_position_x10.is_none());
    }

    #[test]
    fn nearly_parallel_axes_are_measured_as_parallel_ones() {
        let truth = revolute(DVec3::Z, DVec3::ZERO, 40.0);
        for sign in [1.0, -1.0] {
            let axis = sign * DVec3::new(1e-9, 0.0, 1.0).normalize();
            let e = joint_errors(&revolute(axis, DVec3::new(0.3, 0.4, 7.0), sign * 40.0), &truth);
            assert!((e.axis_angle_deg / 1e-9_f64.to_degrees() - 1.0).abs() < 1e-6, "{}", e.axis_angle_deg);
            assert!((e.axis_position_x10.unwrap() - 5.0).abs() < 1e-7 && e.motion.value() < 1e-6);
        }
    }

    #[test]
    fn turns_of_half_a_circle_and_more() {
        let turn = |deg: f64| revolute(DVec3::Y, DVec3::X, deg);
        for (predicted, truth, expected) in [
            (120.0, 120.0, 0.0),
            (120.0, 95.0, 25.0),
            (180.0, 180.0, 0.0),
            // Half a circle ends at the same place either way round.
            (-180.0, 180.0, 0.0),
            (179.0, -179.0, 2.0),
            (0.0, 180.0, 180.0),
            (200.0, 200.0, 0.0),
            (200.0, -160.0, 0.0),
            (-100.0, 100.0, 160.0),
        ] {
            let Motion::Degrees(found) = part_motion(&turn(predicted), &turn(truth)) else { panic!("in degrees") };
            assert!((found - expected).abs() < 1e-6, "{predicted} for {truth}: {found}");
        }
    }

    #[test]
    fn screws_are_measured_by_turn_and_slide() {
        let screw = |pitch: f64, deg: f64| {
            let hinge = revolute(DVec3::Z, DVec3::new(0.2, 0.1, 0.0), deg);
            Joint { kind: JointKind::Screw, pitch, ..hinge }
        };
        let truth = screw(0.02, 90.0);
        let e = joint_errors(&screw(0.03, 100.0), &truth);
        assert!(e.type_ok && e.axis_angle_deg < 1e-9 && e.axis_position_x10.unwrap() < 1e-9);
        let slide = 0.03 * 100_f64.to_radians() - 0.02 * 90_f64.to_radians();
        assert!((e.motion.value() - 10.0).abs() < 1e-9 && (e.slide.unwrap() - slide).abs() < 1e-12);
        // Turned round and unscrewed is the same screw.
        let round = Joint { axis: -DVec3::Z, ..screw(0.02, -90.0) };
        assert!(joint_errors(&round, &truth).slide.unwrap() < 1e-12);
        let hinge = joint_errors(&revolute(DVec3::Z, truth.origin, 90.0), &truth);
        assert!(!hinge.type_ok && (hinge.slide.unwrap() - 0.02 * std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert!(matches!(hinge.motion, Motion::Degrees(d) if d < 1e-9));
        let cap = joint_errors(&prismatic(DVec3::Z, 0.5), &truth);
        assert!(!cap.type_ok && matches!(cap.motion, Motion::Degrees(d) if (d - 90.0).abs() < 1e-9));
        assert_eq!(joint_errors(&truth, &revolute(DVec3::Z, truth.origin, 90.0)).slide, None);
        assert_eq!(screw_slide(&screw(f64::NAN, 90.0), &truth), Some(f64::INFINITY));
    }

    #[test]
    fn a_motion_is_read_as_the_joint_it_is() {
        let origin = DVec3::new(0.4, -0.2, 0.3);
        let hinge = revolute(DVec3::Z, origin, 50.0);
        assert!(
            joint_errors(&read_as(JointKind::Revolute, &hinge.start_to_end(), origin), &hinge).motion.value() < 1e-9
        );
        let slide = Joint { origin, ..prismatic(DVec3::Y, 0.3) };
        // A slide with a little turn about the part itself is still that slide.
        let wobble = Rigid::about(DVec3::X, origin, 1e-3) * slide.start_to_end();
        let read = joint_errors(&read_as(JointKind::Prismatic, &wobble, origin), &slide);
        assert!(read.axis_angle_deg < 0.1 && read.motion.value() < 4e-4, "{read:?}");
    }

    #[test]
    fn a_motion_the_wrong_way_is_an_error() {
        let truth = revolute(DVec3::Y, DVec3::ZERO, 70.0);
        let wrong = part_motion(&revolute(-DVec3::Y, DVec3::ZERO, 70.0), &truth);
        assert!(matches!(wrong, Motion::Degrees(d) if (d - 140.0).abs() < 1e-9));
        let wrong = part_motion(&prismatic(-DVec3::X, 0.2), &prismatic(DVec3::X, 0.2));
        assert!(matches!(wrong, Motion::Length(d) if (d - 0.4).abs() < 1e-12));
    }

    #[test]
    fn a_wrong_type_is_still_measured_against_the_true_one() {
        let e = joint_errors(&prismatic(DVec3::Z, 0.2), &revolute(DVec3::Z, DVec3::new(0.3, 0.1, 0.0), 25.0));
        assert!(!e.type_ok && e.axis_angle_deg == 0.0 && e.axis_position_x10.unwrap() < 1e-12);
        assert!(matches!(e.motion, Motion::Degrees(d) if (d - 25.0).abs() < 1e-9));
        let turn = revolute(DVec3::Z, DVec3::ZERO, 0.0);
        let e = joint_errors(&turn, &prismatic(DVec3::Z, 0.2));
        assert!(!e.type_ok && e.axis_position_x10.is_none());
        assert!(matches!(e.motion, Motion::Length(d) if (d - 0.2).abs() < 1e-12));
    }
}
