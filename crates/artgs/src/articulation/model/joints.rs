//! Parameters of a movable part: a flat vector for the optimiser, a half motion for the warp.

use super::quaternion::{Quat, Vec3, conjugate, cross, dot, multiply, normalise, normalise_vjp, vector};
use super::warp::DualQuaternion;
use crate::random::normal;
use artgs_core::{Joint, JointKind, PerState, Rigid};
use glam::DVec3;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Which motions a part may make. All motions below are half motions, from the canonical state to the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MotionModel {
    /// Any rigid motion: quaternion (w, x, y, z) normalised on use, translation. Seven numbers.
    Free,
    /// Translation. Three numbers.
    Prismatic,
    /// Turn about a line: axis normalised on use, pivot, angle in radians. Seven numbers.
    /// Moving the pivot along the axis changes nothing.
    Hinge,
    /// Turn about a line and slide along it: axis, pivot, angle, slide in scene units. Eight numbers.
    Screw,
}

/// One movable part's parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MotionParameters {
    model: MotionModel,
    values: Vec<f64>,
}

impl MotionModel {
    /// Length of the parameter vector.
    pub fn parameters(self) -> usize {
        match self {
            Self::Prismatic => 3,
            Self::Free | Self::Hinge => 7,
            Self::Screw => 8,
        }
    }

    /// True if parameter `i` is a length (scene units): part of a translation, a pivot or a slide.
    pub fn is_length(self, i: usize) -> bool {
        match self {
            Self::Free => i >= 4,
            Self::Prismatic => true,
            Self::Hinge | Self::Screw => (3..6).contains(&i) || i == 7,
        }
    }
}

fn array<const N: usize>(values: &[f64]) -> [f64; N] {
    std::array::from_fn(|i| values[i])
}

impl MotionParameters {
    /// A part that hardly moves: identity plus noise of 1e-5, a hinge or screw with a random axis through `pivot`.
    pub fn still(model: MotionModel, pivot: DVec3, rng: &mut Pcg64Mcg) -> Self {
        let mut draw = |scale: f64| scale * normal(rng);
        let values = match model {
            MotionModel::Free => std::iter::once(1.0).chain((0..6).map(|_| draw(1e-5))).collect(),
            MotionModel::Prismatic => (0..3).map(|_| draw(1e-5)).collect(),
            MotionModel::Hinge | MotionModel::Screw => {
                let axis = normalise([draw(1.0), draw(1.0), draw(1.0)]).0;
                let rest = (0..model.parameters() - 6).map(|_| draw(1e-5));
                axis.into_iter().chain(pivot.to_array()).chain(rest).collect()
            }
        };
        Self { model, values }
    }

    /// Best parameters for a whole motion from start to end. A prismatic part keeps the translation of the world
    /// origin, so pass a motion without rotation; a hinge drops the slide. Turns of at most half a circle.
    pub fn from_motion(model: MotionModel, start_to_end: &Rigid) -> Self {
        let screw = start_to_end.screw();
        let line = || screw.axis.to_array().into_iter().chain(screw.origin.to_array()).chain([screw.angle / 2.0]);
        let values = match model {
            MotionModel::Free => {
                let half = start_to_end.power(0.5);
                let q = half.rotation;
                [q.w, q.x, q.y, q.z].into_iter().chain(half.translation.to_array()).collect()
            }
            MotionModel::Prismatic => (start_to_end.translation / 2.0).to_array().to_vec(),
            MotionModel::Hinge => line().collect(),
            MotionModel::Screw => line().chain([screw.slide / 2.0]).collect(),
        };
        Self { model, values }
    }

    /// Which motions are possible.
    pub fn model(&self) -> MotionModel {
        self.model
    }

    /// The parameters, in the order given at [`MotionModel`].
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// For the optimiser.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    fn line(&self) -> Line {
        let (axis, length) = normalise(array::<3>(&self.values));
        let slide = if self.model == MotionModel::Screw { self.values[7] } else { 0.0 };
        Line { axis, length, pivot: array(&self.values[3..]), angle: self.values[6], slide }
    }

    /// The half motion as the warp wants it; the unit constraints hold by construction.
    pub fn dual_quaternion(&self) -> DualQuaternion {
        match self.model {
            MotionModel::Free => {
                let (real, _) = normalise(array::<4>(&self.values));
                DualQuaternion { real, dual: multiply(half_pure(&self.values[4..]), real) }
            }
            MotionModel::Prismatic => DualQuaternion { dual: half_pure(&self.values), ..DualQuaternion::IDENTITY },
            MotionModel::Hinge | MotionModel::Screw => self.line().dual_quaternion(),
        }
    }

    /// Gradient by the parameters from that by [`MotionParameters::dual_quaternion`]; overwrites `out`,
    /// which is as long as the parameters.
    pub fn vjp(&self, d: &DualQuaternion, out: &mut [f64]) {
        match self.model {
            MotionModel::Free => {
                let (real, length) = normalise(array::<4>(&self.values));
                let through = multiply(conjugate(half_pure(&self.values[4..])), d.dual);
                let d_real = std::array::from_fn(|i| d.real[i] + through[i]);
                out[..4].copy_from_slice(&normalise_vjp(real, length, d_real));
                let d_t = vector(multiply(d.dual, conjugate(real)));
                out[4..].copy_from_slice(&d_t.map(|c| c / 2.0));
            }
            MotionModel::Prismatic => out.copy_from_slice(&vector(d.dual).map(|c| c / 2.0)),
            MotionModel::Hinge | MotionModel::Screw => {
                let gradient = self.line().vjp(d);
                out.copy_from_slice(&gradient[..self.values.len()]);
            }
        }
    }

    /// The half motion from the canonical state to the end; its inverse leads to the start.
    pub fn half_motion(&self) -> Rigid {
        let DualQuaternion { real, dual } = self.dual_quaternion();
        Rigid::from_dual_quaternion(real, dual)
    }

    /// The motion from the start to the end.
    pub fn full_motion(&self) -> Rigid {
        let half = self.half_motion();
        half * half
    }

    /// Kind of joint: fixed by the model, or for a free motion revolute where the half motion turns by more than
    /// `half_angle` radians (10 degrees as published).
    pub fn joint_kind(&self, half_angle: f64) -> JointKind {
        match self.model {
            MotionModel::Prismatic => JointKind::Prismatic,
            MotionModel::Hinge => JointKind::Revolute,
            MotionModel::Screw => JointKind::Screw,
            MotionModel::Free if self.half_motion().angle() > half_angle => JointKind::Revolute,
            MotionModel::Free => JointKind::Prismatic,
        }
    }

    /// Reads out the joint, by closed form. Hinges and screws keep turns beyond half a circle.
    pub fn joint(&self, kind: JointKind) -> Joint {
        let same = matches!(
            (self.model, kind),
            (MotionModel::Hinge, JointKind::Revolute) | (MotionModel::Screw, JointKind::Screw)
        );
        if !same {
            return Joint::from_motion(kind, &self.full_motion());
        }
        let line = self.line();
        let sign = if line.angle < 0.0 { -1.0 } else { 1.0 };
        let axis = DVec3::from_array(line.axis) * sign;
        let pivot = DVec3::from_array(line.pivot);
        let value = 2.0 * line.angle.abs();
        let turned = line.angle.abs().max(1e-12) * line.angle.signum();
        let pitch = if kind == JointKind::Screw { line.slide / turned } else { 0.0 };
        let origin = pivot - axis * axis.dot(pivot);
        Joint { kind, axis, origin, pitch, state_values: PerState::new(0.0, value), limits: [0.0, value] }
    }

    /// The same motion after the world has been shifted by `by`.
    pub fn shifted(mut self, by: DVec3) -> Self {
        match self.model {
            MotionModel::Prismatic => {}
            MotionModel::Free => {
                let moved = by - self.half_motion().turn(by);
                self.values[4..].iter_mut().zip(moved.to_array()).for_each(|(t, d)| *t += d);
            }
            MotionModel::Hinge | MotionModel::Screw => {
                self.values[3..6].iter_mut().zip(by.to_array()).for_each(|(p, d)| *p += d);
            }
        }
        self
    }

    /// Takes out what has no effect: unit quaternion or axis, pivot at the point of the axis nearest to `near`.
    /// Keeps the motion; do it where the optimiser's moments are reset.
    pub fn fix_gauge(&mut self, near: DVec3) {
        match self.model {
            MotionModel::Prismatic => {}
            MotionModel::Free => {
                let unit = normalise(array::<4>(&self.values)).0;
                self.values[..4].copy_from_slice(&unit);
            }
            MotionModel::Hinge | MotionModel::Screw => {
                let line = self.line();
                let (axis, pivot) = (DVec3::from_array(line.axis), DVec3::from_array(line.pivot));
                self.values[..3].copy_from_slice(&line.axis);
                self.values[3..6].copy_from_slice(&(pivot + axis * axis.dot(near - pivot)).to_array());
            }
        }
    }
}

/// The quaternion `(0, t) / 2`.
fn half_pure(t: &[f64]) -> Quat {
    [0.0, t[0] / 2.0, t[1] / 2.0, t[2] / 2.0]
}

/// A turn by `angle` and shift by `slide` along the line through `pivot`; `length` is that of the raw axis.
/// With `h = angle / 2`: `real = (cos h, a sin h)`,
/// `dual = (-slide/2 sin h, a slide/2 cos h + (pivot x a) sin h)`.
struct Line {
    axis: Vec3,
    length: f64,
    pivot: Vec3,
    angle: f64,
    slide: f64,
}

impl Line {
    fn dual_quaternion(&self) -> DualQuaternion {
        let (sin, cos) = (self.angle / 2.0).sin_cos();
        let (a, moment, s) = (self.axis, cross(self.pivot, self.axis), self.slide / 2.0);
        let dual = |i: usize| a[i] * s * cos + moment[i] * sin;
        DualQuaternion { real: [cos, a[0] * sin, a[1] * sin, a[2] * sin], dual: [-s * sin, dual(0), dual(1), dual(2)] }
    }

    /// Gradient by raw axis, pivot, angle and slide.
    fn vjp(&self, d: &DualQuaternion) -> [f64; 8] {
        let (sin, cos) = (self.angle / 2.0).sin_cos();
        let (a, moment, s) = (self.axis, cross(self.pivot, self.axis), self.slide / 2.0);
        let (g_r, g_d) = (vector(d.real), vector(d.dual));
        let d_half =
            -sin * d.real[0] + cos * dot(a, g_r) - s * cos * d.dual[0] - s * sin * dot(a, g_d) + cos * dot(moment, g_d);
        let d_slide = (-sin * d.dual[0] + cos * dot(a, g_d)) / 2.0;
        let through_moment = cross(g_d, self.pivot);
        let d_axis = std::array::from_fn(|i| sin * g_r[i] + s * cos * g_d[i] + sin * through_moment[i]);
        let d_axis = normalise_vjp(a, self.length, d_axis);
        let d_pivot = cross(a, g_d).map(|c| c * sin);
        [d_axis[0], d_axis[1], d_axis[2], d_pivot[0], d_pivot[1], d_pivot[2], d_half / 2.0, d_slide]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::State;

    const MODELS: [MotionModel; 4] =
        [MotionModel::Free, MotionModel::Prismatic, MotionModel::Hinge, MotionModel::Screw];

    fn sample(model: MotionModel) -> MotionParameters {
        let all = [0.9, -0.4, 0.6, 0.3, 0.2, -0.5, 0.8, 0.15];
        MotionParameters { model, values: all[..model.parameters()].to_vec() }
    }

    fn gap(a: &Rigid, b: &Rigid) -> f64 {
        [DVec3::X, DVec3::Y, DVec3::Z, DVec3::ZERO].iter().map(|&x| (a.apply(x) - b.apply(x)).length()).sum()
    }

    #[test]
    fn gradients_match_finite_differences() {
        let d = DualQuaternion { real: [0.3, -0.8, 0.5, 1.1], dual: [-0.6, 0.9, 0.2, -0.7] };
        for model in MODELS {
            let mut p = sample(model);
            let mut gradient = vec![f64::NAN; model.parameters()];
            p.vjp(&d, &mut gradient);
            for (i, g) in gradient.into_iter().enumerate() {
                let mut value = |h: f64| {
                    p.values[i] += h;
                    let q = p.dual_quaternion();
                    dot(q.real, d.real) + dot(q.dual, d.dual)
                };
                let numeric = (value(1e-6) - value(-2e-6)) / 2e-6;
                p.values[i] += 1e-6;
                assert!((g - numeric).abs() < 1e-8, "{model:?} {i}: {g} against {numeric}");
            }
        }
    }

    #[test]
    fn lines_move_as_rigid_motions_about_lines() {
        let p = sample(MotionModel::Screw);
        let (axis, pivot) = (DVec3::new(0.9, -0.4, 0.6).normalize(), DVec3::new(0.3, 0.2, -0.5));
        let mut expected = Rigid::about(axis, pivot, 0.8);
        expected.translation += axis * 0.15;
        assert!(gap(&p.half_motion(), &expected) < 1e-12);
        let hinge = sample(MotionModel::Hinge);
        assert!((hinge.half_motion().apply(pivot) - pivot).length() < 1e-12);
        let before = p.half_motion();
        let mut q = p;
        q.fix_gauge(DVec3::new(3.0, -1.0, 2.0));
        assert!(gap(&q.half_motion(), &before) < 1e-12);
    }

    #[test]
    fn a_shifted_world_sees_the_same_motions() {
        let by = DVec3::new(0.7, -1.3, 0.4);
        for model in MODELS {
            let p = sample(model);
            let expected = Rigid::shift(by) * p.half_motion() * Rigid::shift(-by);
            let dual = p.dual_quaternion().shifted(by.to_array());
            assert!(gap(&Rigid::from_dual_quaternion(dual.real, dual.dual), &expected) < 1e-12, "{model:?}");
            assert!(gap(&p.shifted(by).half_motion(), &expected) < 1e-12, "{model:?}");
        }
    }

    #[test]
    fn every_model_reads_back_the_motions_it_can_make() {
        for model in MODELS {
            let whole = sample(model).full_motion();
            let again = MotionParameters::from_motion(model, &whole);
            assert!(gap(&again.full_motion(), &whole) < 1e-12, "{model:?}");
            let kind = again.joint_kind(10f64.to_radians());
            if model != MotionModel::Free {
                assert!(gap(&again.joint(kind).start_to_end(), &whole) < 1e-12, "{model:?}");
            }
        }
    }

    #[test]
    fn a_hinge_beyond_half_a_circle_keeps_its_turn_and_a_negative_one_flips_its_axis() {
        for angle in [2.0, -2.0] {
            let mut p = sample(MotionModel::Hinge);
            p.values[6] = angle;
            let joint = p.joint(JointKind::Revolute);
            assert!((joint.state_values[State::END] - 4.0).abs() < 1e-12);
            assert!(gap(&joint.start_to_end(), &p.full_motion()) < 1e-12);
            let mut s = sample(MotionModel::Screw);
            s.values[6] = angle;
            assert!(gap(&s.joint(JointKind::Screw).start_to_end(), &s.full_motion()) < 1e-12);
        }
    }

    #[test]
    fn type_of_a_free_motion_depends_on_its_half_angle() {
        for (degrees, kind) in [(18.0, JointKind::Prismatic), (22.0, JointKind::Revolute)] {
            let whole = Rigid::about(DVec3::Y, DVec3::ONE, f64::to_radians(degrees));
            let p = MotionParameters::from_motion(MotionModel::Free, &whole);
            assert_eq!(p.joint_kind(10f64.to_radians()), kind);
        }
    }
}
