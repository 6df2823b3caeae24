//! Poses that the wide search tries for a cluster of moved points: slides in many directions, hinges along likely axes.

use super::cloud::{Cloud, principal_axes};
use artgs_core::Rigid;
use glam::{Mat3, Quat, Vec3};

/// Settings of the wide search. Steps are finer than the distance up to which a point is scored as close to a surface
/// (`CandidateSettings::reach`), so that no motion falls between two poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PoseSettings {
    /// Directions of slides spread over the half sphere, beside those of faces and principal axes.
    pub(crate) directions: usize,
    /// Lengths of slides per direction and sign.
    pub(crate) slides: usize,
    /// Longest slide, fraction of the diagonal.
    pub(crate) longest_slide: f32,
    /// Exponent that puts more of the lengths near zero.
    pub(crate) slide_exponent: f32,
    /// Angles per axis and sign.
    pub(crate) turns: usize,
    /// Step between them, degrees.
    pub(crate) turn_step: f32,
    /// Distance between pivots, fraction of the diagonal.
    pub(crate) pivot_step: f32,
    /// Least and most pivots per direction across the cluster.
    pub(crate) pivots: [usize; 2],
    /// Pivots reach past the cluster by this fraction of its size, and of the diagonal.
    pub(crate) pivot_margin: [f32; 2],
    /// Directions of faces that are tried.
    pub(crate) faces: usize,
}

impl Default for PoseSettings {
    fn default() -> Self {
        Self {
            directions: 120,
            slides: 32,
            longest_slide: 0.6,
            slide_exponent: 1.3,
            turns: 30,
            turn_step: 6.0,
            pivot_step: 0.035,
            pivots: [3, 11],
            pivot_margin: [0.05, 0.01],
            faces: 6,
        }
    }
}

/// A rigid motion in the form that moves many points fast.
#[derive(Clone, Copy)]
pub(super) struct Pose {
    pub(super) rotation: Mat3,
    pub(super) translation: Vec3,
}

impl Pose {
    pub(super) fn of(motion: &Rigid) -> Self {
        Self { rotation: motion.matrix().as_mat3(), translation: motion.translation.as_vec3() }
    }

    pub(super) fn rigid(&self) -> Rigid {
        Rigid::from_matrix(self.rotation.as_dmat3(), self.translation.as_dvec3())
    }

    pub(super) fn apply(&self, point: Vec3) -> Vec3 {
        self.rotation * point + self.translation
    }
}

impl PoseSettings {
    /// Directions along which the object's faces look, most common first: peaks of the histogram of normals.
    pub(super) fn face_directions(&self, cloud: &Cloud) -> Vec<Vec3> {
        /// Normals looked at.
        const SAMPLES: usize = 4000;
        /// Cosine between normals of the same face.
        const SAME: f32 = 0.985;
        let mut peaks: Vec<(Vec3, f32)> = Vec::new();
        let stride = (cloud.len() / SAMPLES).max(1);
        for n in cloud.normals.iter().step_by(stride) {
            match peaks.iter_mut().find(|(d, _)| d.dot(*n).abs() > SAME) {
                Some((d, c)) => {
                    let s = if d.dot(*n) < 0.0 { -*n } else { *n };
                    *d = (*d * *c + s).normalize();
                    *c += 1.0;
                }
                None => peaks.push((*n, 1.0)),
            }
        }
        peaks.sort_by(|a, b| b.1.total_cmp(&a.1));
        peaks.into_iter().take(self.faces).map(|p| p.0).collect()
    }

    /// Poses of a cluster in its own state's frame: slides in all directions, hinges along likely directions through a
    /// grid of pivots across the cluster's box.
    pub(super) fn poses(&self, cloud: &Cloud, group: &[usize], faces: &[Vec3], diagonal: f32) -> Vec<Pose> {
        let axes = principal_axes(cloud, group);
        let mut poses = Vec::new();
        let likely = || axes.into_iter().chain(faces.iter().copied());
        for d in &distinct(likely().chain(half_sphere(self.directions))) {
            for step in 1..=self.slides {
                let fraction = (step as f32 / self.slides as f32).powf(self.slide_exponent);
                let t = *d * (diagonal * self.longest_slide * fraction);
                poses.push(Pose { rotation: Mat3::IDENTITY, translation: t });
                poses.push(Pose { rotation: Mat3::IDENTITY, translation: -t });
            }
        }
        for axis in distinct(likely()) {
            let angles = (1..=self.turns).flat_map(|step| [1.0, -1.0].map(|sign| sign * step as f32));
            let turn = |steps: f32| Quat::from_axis_angle(axis, steps * self.turn_step.to_radians());
            let rotations: Vec<Mat3> = angles.map(|steps| Mat3::from_quat(turn(steps))).collect();
            for pivot in self.pivots(cloud, group, axis, diagonal) {
                let about = |rotation: &Mat3| Pose { rotation: *rotation, translation: pivot - *rotation * pivot };
                poses.extend(rotations.iter().map(about));
            }
        }
        poses
    }

    /// A grid of pivots across the box of the cluster seen along the axis; the grid turns with the cluster.
    fn pivots(&self, cloud: &Cloud, group: &[usize], axis: Vec3, diagonal: f32) -> Vec<Vec3> {
        let (u, v) = axis.any_orthonormal_pair();
        let flat = |p: Vec3| (p.dot(u), p.dot(v));
        let (mut sxx, mut sxy, mut syy, mut mx, mut my) = (0.0f32, 0.0f32, 0.0f32, 0.0f32, 0.0f32);
        for &i in group {
            let (x, y) = flat(cloud.points[i]);
            mx += x / group.len() as f32;
            my += y / group.len() as f32;
        }
        for &i in group {
            let (x, y) = flat(cloud.points[i]);
            sxx += (x - mx) * (x - mx);
            sxy += (x - mx) * (y - my);
            syy += (y - my) * (y - my);
        }
        let turn = 0.5 * (2.0 * sxy).atan2(sxx - syy);
        let (gu, gv) = (u * turn.cos() + v * turn.sin(), v * turn.cos() - u * turn.sin());
        let [of_size, of_diagonal] = self.pivot_margin;
        let range = |d: Vec3| {
            let mut xs: Vec<f32> = group.iter().map(|&i| cloud.points[i].dot(d)).collect();
            xs.sort_unstable_by(f32::total_cmp);
            let (lo, hi) = (xs[xs.len() / 100], xs[xs.len() - 1 - xs.len() / 100]);
            let pad = of_size * (hi - lo) + of_diagonal * diagonal;
            (lo - pad, hi + pad)
        };
        let (ru, rv) = (range(gu), range(gv));
        let [least, most] = self.pivots;
        let cells = |r: (f32, f32)| (((r.1 - r.0) / (self.pivot_step * diagonal)).ceil() as usize).clamp(least, most);
        let (nu, nv) = (cells(ru), cells(rv));
        let mut pivots = Vec::with_capacity(nu * nv);
        for i in 0..nu {
            for j in 0..nv {
                let x = ru.0 + (ru.1 - ru.0) * i as f32 / (nu - 1) as f32;
                let y = rv.0 + (rv.1 - rv.0) * j as f32 / (nv - 1) as f32;
                pivots.push(gu * x + gv * y);
            }
        }
        pivots
    }
}

/// Directions of which no two are within 6 degrees of each other or of each other's opposite; earlier ones stay.
fn distinct(directions: impl IntoIterator<Item = Vec3>) -> Vec<Vec3> {
    let mut out: Vec<Vec3> = Vec::new();
    for d in directions {
        if d.is_finite() && d.length() > 0.5 && out.iter().all(|o| o.dot(d).abs() < 0.995) {
            out.push(d);
        }
    }
    out
}

/// Evenly spread directions on the half sphere (Fibonacci lattice).
fn half_sphere(count: usize) -> Vec<Vec3> {
    /// Radians between successive directions about z.
    const GOLDEN_ANGLE: f32 = 2.399_963_2;
    (0..count)
        .map(|i| {
            let z = (i as f32 + 0.5) / count as f32;
            let (s, c) = (GOLDEN_ANGLE * i as f32).sin_cos();
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * c, r * s, z)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_direction_is_near_one_that_is_tried() {
        let tried = half_sphere(120);
        for x in half_sphere(37) {
            let nearest = tried.iter().map(|d| d.dot(x).abs()).fold(0.0, f32::max);
            assert!(nearest > 12f32.to_radians().cos(), "{x} {nearest}");
        }
        let faces = [Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::new(0.999, 0.04, 0.0).normalize(), Vec3::NAN];
        assert_eq!(distinct(faces), [Vec3::X, Vec3::Y]);
    }
}
