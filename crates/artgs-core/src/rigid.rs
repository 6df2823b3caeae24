//! Rigid motions, their dual quaternions and their screws.

use crate::State;
use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::ops::Mul;

/// A rigid motion `x -> R x + t`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rigid {
    /// Unit quaternion of the rotation `R`.
    pub rotation: DQuat,
    /// Translation `t`, scene units.
    pub translation: DVec3,
}

/// Chasles' form of a rigid motion: a turn by `angle` about a line and a shift by `slide` along it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Screw {
    /// Unit direction of the line; for a pure translation its direction.
    pub axis: DVec3,
    /// Point of the line closest to the world origin; the origin itself for a pure translation.
    pub origin: DVec3,
    /// Turn about `axis`, radians in [0, pi].
    pub angle: f64,
    /// Shift along `axis`, scene units, signed.
    pub slide: f64,
}

impl Rigid {
    /// The identity.
    pub const IDENTITY: Self = Self { rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// From a rotation matrix and a translation.
    pub fn from_matrix(rotation: DMat3, translation: DVec3) -> Self {
        Self { rotation: DQuat::from_mat3(&rotation).normalize(), translation }
    }

    /// Turn by `angle` radians about the line through `origin` along the unit vector `axis`.
    pub fn about(axis: DVec3, origin: DVec3, angle: f64) -> Self {
        let rotation = DQuat::from_axis_angle(axis, angle);
        Self { rotation, translation: origin - rotation * origin }
    }

    /// Pure translation.
    pub fn shift(translation: DVec3) -> Self {
        Self { rotation: DQuat::IDENTITY, translation }
    }

    /// Image of a point.
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.rotation * point + self.translation
    }

    /// Image of a direction.
    pub fn turn(&self, direction: DVec3) -> DVec3 {
        self.rotation * direction
    }

    /// The inverse motion.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.conjugate();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// Of a motion from start to end (or from the canonical state to the end): the direction that leads to `state`.
    pub fn towards(&self, state: State) -> Self {
        if state == State::END { *self } else { self.inverse() }
    }

    /// Of a motion from start to end (or from the start to the canonical state): the direction that leaves `state`.
    pub fn away_from(&self, state: State) -> Self {
        self.towards(state.other())
    }

    /// Rotation as a matrix.
    pub fn matrix(&self) -> DMat3 {
        DMat3::from_quat(self.rotation)
    }

    /// Angle of the rotation, radians in [0, pi].
    pub fn angle(&self) -> f64 {
        2.0 * self.rotation.xyz().length().atan2(self.rotation.w.abs())
    }

    /// Chasles' decomposition. Below 1e-9 rad the motion counts as a translation.
    /// The pivot is the closed form `(t' + cot(angle/2) a x t') / 2`, `t'` being the part of `t` across the axis `a`;
    /// inverting `I - R` instead is singular along the axis.
    pub fn screw(&self) -> Screw {
        let q = if self.rotation.w < 0.0 { -self.rotation } else { self.rotation };
        let (v, t) = (q.xyz(), self.translation);
        let sin_half = v.length();
        if sin_half < 5e-10 {
            return Screw { axis: t.normalize_or(DVec3::Z), origin: DVec3::ZERO, angle: 0.0, slide: t.length() };
        }
        let axis = v / sin_half;
        let slide = axis.dot(t);
        let across = t - axis * slide;
        let origin = 0.5 * (across + axis.cross(across) * (q.w / sin_half));
        Screw { axis, origin: origin - axis * axis.dot(origin), angle: 2.0 * sin_half.atan2(q.w), slide }
    }

    /// The motion that is `fraction` of this one along its screw; `power(0.5)` applied twice is this motion.
    pub fn power(&self, fraction: f64) -> Self {
        let s = self.screw();
        if s.angle == 0.0 {
            return Self::shift(self.translation * fraction);
        }
        let turned = Self::about(s.axis, s.origin, s.angle * fraction);
        Self { translation: turned.translation + s.axis * (s.slide * fraction), ..turned }
    }

    /// Real and dual quaternion, each (w, x, y, z): `dual = (0, t) * real / 2`.
    pub fn dual_quaternion(&self) -> ([f64; 4], [f64; 4]) {
        let (q, t) = (self.rotation, self.translation);
        let d = DQuat::from_xyzw(t.x, t.y, t.z, 0.0) * q * 0.5;
        ([q.w, q.x, q.y, q.z], [d.w, d.x, d.y, d.z])
    }

    /// Inverse of [`Rigid::dual_quaternion`]; normalises by the length of the real part.
    pub fn from_dual_quaternion(real: [f64; 4], dual: [f64; 4]) -> Self {
        let q = DQuat::from_xyzw(real[1], real[2], real[3], real[0]);
        let n = q.length();
        let (q, d) = (q * (1.0 / n), DQuat::from_xyzw(dual[1], dual[2], dual[3], dual[0]) * (1.0 / n));
        Self { rotation: q, translation: (d * q.conjugate()).xyz() * 2.0 }
    }
}

impl Mul for Rigid {
    type Output = Self;
    /// `(a * b)(x) = a(b(x))`.
    fn mul(self, other: Self) -> Self {
        Self {
            rotation: (self.rotation * other.rotation).normalize(),
            translation: self.rotation * other.translation + self.translation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Rigid {
        let a = DVec3::new(0.3, -0.5, 0.8).normalize();
        let m = Rigid::about(a, DVec3::new(0.4, 0.1, -0.2), 1.1);
        Rigid { translation: m.translation + a * 0.07, ..m }
    }

    #[test]
    fn screw_reads_back_axis_pivot_angle_and_slide() {
        let s = sample().screw();
        let a = DVec3::new(0.3, -0.5, 0.8).normalize();
        let p = DVec3::new(0.4, 0.1, -0.2);
        assert!((s.axis - a).length() < 1e-12 && (s.angle - 1.1).abs() < 1e-12 && (s.slide - 0.07).abs() < 1e-12);
        assert!((s.origin - (p - a * a.dot(p))).length() < 1e-12);
    }

    #[test]
    fn screw_folds_the_negative_quaternion() {
        let m = sample();
        let n = Rigid { rotation: -m.rotation, ..m };
        assert!((m.screw().origin - n.screw().origin).length() < 1e-12);
    }

    #[test]
    fn half_twice_is_the_whole() {
        for m in [sample(), Rigid::shift(DVec3::new(0.1, 0.2, -0.3)), Rigid::IDENTITY] {
            let h = m.power(0.5);
            let x = DVec3::new(0.7, -0.3, 0.2);
            assert!(((h * h).apply(x) - m.apply(x)).length() < 1e-12);
        }
    }

    #[test]
    fn dual_quaternion_round_trip() {
        let m = sample();
        let (r, d) = m.dual_quaternion();
        let n = Rigid::from_dual_quaternion(r.map(|v| 2.0 * v), d.map(|v| 2.0 * v));
        let x = DVec3::new(0.7, -0.3, 0.2);
        assert!((m.apply(x) - n.apply(x)).length() < 1e-12);
        assert!((m.inverse() * m).translation.length() < 1e-12);
    }
}
