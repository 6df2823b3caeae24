//! Which predicted part is which true part.

use super::joints::{JointErrors, Motion};
use crate::hungarian::hungarian;

/// Bound and stand-in for an angle error, degrees; the other terms are scaled to compare with it.
const ANGLE_BOUND: f64 = 90.0;
/// Bound of the distance and of the surface term.
const TERM_BOUND: f64 = 100.0;
/// Price of a wrong type.
const TYPE_PRICE: f64 = 50.0;

/// Cost of taking a predicted for a true part, finite and at least 0. `diagonal` is the true object's;
/// lengths count relative to it and `chamfer` (squared scene units, not scaled; none: no mesh) to its square:
///
/// `min(axis angle, 90) + min(10 distance, 100) + motion + 50 [wrong type] + min(1000 chamfer, 100)`
///
/// with a motion in degrees, at most 180, or as `min(100 length, 100)`. A part without a joint pays the bounds.
pub(crate) fn pair_cost(errors: Option<&JointErrors>, chamfer: Option<f64>, diagonal: f64) -> f64 {
    let unit = if diagonal > 0.0 { diagonal } else { 1.0 };
    let bounded = |v: f64, bound: f64| if v <= bound { v.max(0.0) } else { bound };
    let surface = bounded(chamfer.map_or(f64::INFINITY, |c| 1000.0 * c / (unit * unit)), TERM_BOUND);
    let Some(errors) = errors else { return ANGLE_BOUND + 2.0 * TERM_BOUND + TYPE_PRICE + surface };
    let motion = match errors.motion {
        Motion::Degrees(d) => bounded(d, 180.0),
        Motion::Length(l) => bounded(100.0 * l / unit, TERM_BOUND),
    };
    let wrong = if errors.type_ok { 0.0 } else { TYPE_PRICE };
    let position = bounded(errors.axis_position_x10.unwrap_or(0.0) / unit, TERM_BOUND);
    bounded(errors.axis_angle_deg, ANGLE_BOUND) + position + motion + wrong + surface
}

/// For every true part (columns) the predicted part (rows) that takes it, so that the sum of costs is least and as many
/// as possible are taken; none for true parts left over.
pub(crate) fn match_parts(costs: &[Vec<f64>], truths: usize) -> Vec<Option<usize>> {
    let mut out = vec![None; truths];
    for (row, column) in hungarian(costs, truths).into_iter().enumerate() {
        if let Some(column) = column {
            out[column] = Some(row);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::joints::joint_errors;
    use super::*;
    use artgs_core::{Joint, JointKind};
    use glam::DVec3;

    #[test]
    fn not_a_number_never_wins() {
        let costs = vec![vec![f64::NAN, 3.0], vec![1.0, f64::INFINITY]];
        assert_eq!(match_parts(&costs, 2), [Some(1), Some(0)]);
    }

    #[test]
    fn missing_and_extra_parts_stay_alone() {
        assert_eq!(match_parts(&[vec![5.0, 1.0]], 2), [None, Some(0)]);
        assert_eq!(match_parts(&[vec![5.0], vec![1.0], vec![3.0]], 1), [Some(1)]);
        assert_eq!(match_parts(&[], 2), [None, None]);
    }

    #[test]
    fn costs_are_finite_and_price_type_motion_and_surface() {
        let joint = |kind, axis: DVec3, value| Joint {
            kind,
            axis,
            origin: DVec3::ZERO,
            pitch: 0.0,
            state_values: artgs_core::PerState::new(0.0, value),
            limits: [0.0, value],
        };
        let slide = joint(JointKind::Prismatic, DVec3::X, 0.2);
        let turn = joint(JointKind::Revolute, DVec3::X, 0.2);
        let cost = |a: &Joint, b: &Joint, chamfer| pair_cost(Some(&joint_errors(a, b)), chamfer, 2.0);
        assert!(cost(&slide, &slide, Some(0.0)) < 1e-9);
        assert!((cost(&slide, &slide, Some(0.004)) - 1.0).abs() < 1e-9);
        assert!((cost(&turn, &slide, Some(0.0)) - 60.0).abs() < 1e-9, "type 50, motion 100 * 0.2 / 2");
        let broken = joint(JointKind::Revolute, DVec3::NAN, f64::NAN);
        assert!(cost(&broken, &turn, None).is_finite() && pair_cost(None, None, 0.0).is_finite());
    }
}
