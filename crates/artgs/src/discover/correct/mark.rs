//! The motion of a joint that a user gives.

use crate::discover::Discovery;
use artgs_core::{Joint, JointKind, PerState, Rigid, State};
use artgs_io::MarkedJoint;
use glam::DVec3;

/// Motion from start to end on a given joint. Where its value is not given, the part goes as far as `before`, its motion so
/// far, takes the middle of its points.
pub(super) fn motion(kind: JointKind, mark: &MarkedJoint, found: &Discovery, part: usize, before: &Rigid) -> Rigid {
    let axis = DVec3::from_array(mark.axis).normalize_or(DVec3::Z);
    let (state_values, pitch) = (PerState::new(0.0, 0.0), if kind == JointKind::Screw { mark.pitch } else { 0.0 });
    let joint = Joint { kind, axis, origin: DVec3::from_array(mark.origin), pitch, state_values, limits: [0.0; 2] };
    joint.motion(mark.value.unwrap_or_else(|| value_of(&joint, before, middle(found, part))))
}

/// Value of a joint after a motion, by a point that it moves: an angle about the axis or a distance along it.
fn value_of(joint: &Joint, motion: &Rigid, point: DVec3) -> f64 {
    let (from, to) = (point - joint.origin, motion.apply(point) - joint.origin);
    if joint.kind == JointKind::Prismatic {
        return joint.axis.dot(to - from);
    }
    joint.axis.dot(from.cross(to)).atan2(from.reject_from(joint.axis).dot(to.reject_from(joint.axis)))
}

/// Mean of a part's points at the start; the origin where it has none.
fn middle(found: &Discovery, part: usize) -> DVec3 {
    let points = found.clouds[State::START].points.iter().zip(&found.labels[State::START]);
    let own = points.filter(|(_, label)| usize::from(**label) == part).map(|(p, _)| p.as_dvec3());
    let (sum, n) = own.fold((DVec3::ZERO, 0), |(sum, n), p| (sum + p, n + 1));
    sum / f64::from(n.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_without_a_value_goes_as_far_as_the_part_did() {
        let found = Discovery {
            clouds: PerState::from_fn(|_| crate::discover::Cloud {
                points: vec![glam::Vec3::new(0.4, 0.0, 0.1), glam::Vec3::new(0.6, 0.0, 0.3)],
                ..Default::default()
            }),
            labels: PerState::from_fn(|_| vec![1, 1]),
            ..Discovery::default()
        };
        let turned = Rigid::about(DVec3::Z, DVec3::ZERO, 0.7);
        let mark = MarkedJoint { axis: [0.0, 0.0, -2.0], origin: [0.0, 0.0, 9.0], value: None, pitch: 0.0 };
        let x = DVec3::new(0.3, 0.2, 0.1);
        let hinge = motion(JointKind::Revolute, &mark, &found, 1, &turned);
        assert!((hinge.apply(x) - turned.apply(x)).length() < 1e-9);
        let slide = Rigid::shift(DVec3::new(0.0, -0.3, 0.0));
        let mark = MarkedJoint { axis: [0.0, 1.0, 0.0], ..mark };
        let moved = motion(JointKind::Prismatic, &mark, &found, 1, &slide);
        assert!((moved.apply(x) - slide.apply(x)).length() < 1e-9);
        let given = MarkedJoint { value: Some(0.1), ..mark };
        let moved = motion(JointKind::Prismatic, &given, &found, 1, &slide);
        assert!((moved.apply(x) - x - DVec3::new(0.0, 0.1, 0.0)).length() < 1e-9);
    }
}
