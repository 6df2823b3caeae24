//! The motion of a part from its surfels and the depth that the other state shows, with the information that they hold about it.

use super::evidence::{Surfel, residual};
use super::noise::Noise;
use super::settings::ExplainSettings;
use crate::discover::cloud::IndexedCloud;
use crate::discover::scene::Scene;
use artgs_core::{PerState, Rigid, State};
use glam::{DVec3, Vec3};
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

/// A motion and the inverse of its covariance.
#[derive(Clone, Copy, Debug)]
pub struct Registered {
    /// Motion from start to end, world frame.
    pub motion: Rigid,
    /// Information about a twist in the frame of the end about the origin: turn, then shift; radians and scene units.
    pub information: Matrix6<f64>,
}

/// What one surfel says about a twist: `slope * twist` is a distance of which `information` is the inverse variance, and
/// `pull / information` the measured value.
pub(super) struct Equation {
    pub(super) slope: Vector6<f64>,
    pub(super) information: f64,
    pub(super) pull: f64,
}

/// How far a twist about the origin (turn, then shift) moves a place along a direction.
pub(super) fn slope_of(place: DVec3, direction: DVec3) -> Vector6<f64> {
    let turn = place.cross(direction);
    Vector6::new(turn.x, turn.y, turn.z, direction.x, direction.y, direction.z)
}

/// Depth residuals of the surfels of each state that are `members`, of a part.
pub(super) struct Residuals<'a> {
    pub(super) scene: &'a Scene,
    pub(super) clouds: &'a PerState<IndexedCloud<'a>>,
    pub(super) noise: &'a PerState<Noise>,
    /// Neighbouring surfels that count as one.
    pub(super) shared: f32,
    pub(super) members: &'a PerState<Vec<usize>>,
    pub(super) settings: &'a ExplainSettings,
}

impl Residuals<'_> {
    /// Normal equations of a twist after `motion`, as [`Registered::information`]: information, and what it is multiplied with. Hits within
    /// `gate`, or within the hit deviations if these are more, take part.
    pub(super) fn equations(&self, motion: &Rigid, gate: f32) -> (Matrix6<f64>, Vector6<f64>) {
        /// Surfels of a state that take part; the others count by their number.
        const MOST: usize = 2500;
        let (mut a, mut b) = (Matrix6::<f64>::zeros(), Vector6::<f64>::zeros());
        for state in State::ALL {
            let motion = motion.away_from(state);
            let members = &self.members[state];
            let step = members.len().div_ceil(MOST).max(1);
            let own: Vec<usize> = members.iter().copied().step_by(step).collect();
            let rows: Vec<Equation> =
                own.par_iter().with_min_len(64).map(|&i| self.equation(state, i, &motion, gate)).collect();
            for row in rows {
                a += row.slope * row.slope.transpose() * (row.information * step as f64);
                b += row.slope * (row.pull * step as f64);
            }
        }
        (a / f64::from(self.shared), b / f64::from(self.shared))
    }

    /// What surfel `i` of a state says, which `motion` takes to the other one.
    pub(super) fn equation(&self, state: State, i: usize, motion: &Rigid, gate: f32) -> Equation {
        /// Every so many views take part.
        const VIEWS: usize = 3;
        let (to, settings) = (state.other(), self.settings);
        let surfel = Surfel::of(self.clouds[state].cloud, i);
        let image = surfel.moved(motion);
        // The twist acts on the place in the end state.
        let (at, sign) = if state == State::START { (image, 1.0) } else { (surfel, -1.0) };
        let (p, n) = (at.point.as_dvec3(), at.normal.as_dvec3());
        let j = slope_of(p, n) * sign;
        let (mut a, mut b, mut count) = (0.0, 0.0, 0.0);
        for view in self.scene.states[to].views.iter().step_by(VIEWS) {
            let Some((r, cosine)) = residual(view, &image, settings.facing) else { continue };
            let deviation = self.noise[to].deviation_at(cosine);
            if cosine < settings.facing || r.abs() > gate.max(settings.hit * deviation) {
                continue;
            }
            // Depth changes by this much for a shift along the normal.
            let slope = f64::from(-1.0 / (cosine * stretch(view, image.point)));
            let weight = f64::from(deviation).powi(-2);
            a += weight * slope * slope;
            b += weight * slope * f64::from(r);
            count += 1.0;
        }
        // Views of one surfel are averaged.
        let each = 1.0 / f64::max(count, 1.0);
        Equation { slope: j, information: a * each, pull: b * each }
    }
}

/// Gauss-Newton steps on the residuals of a part from `motion` on. The gate of hits shrinks from step to step.
pub(super) fn registered(residuals: &Residuals<'_>, motion: Rigid) -> Registered {
    const STEPS: usize = 8;
    /// The gate shrinks by this factor from step to step.
    const SHRINK: f32 = 0.6;
    /// First gate, a share of the diagonal.
    const GATE: f32 = 0.003;
    /// Standard deviation of the given motion, a share of the diagonal: where the surfels say nothing, it stays.
    const GIVEN: f64 = 0.002;
    let diagonal = residuals.scene.lengths.diagonal;
    let given = (GIVEN * f64::from(diagonal)).powi(-2);
    let middle = middle_of(residuals.clouds, residuals.members, &motion);
    let mut out = Registered { motion, information: Matrix6::zeros() };
    let mut gate = GATE * diagonal;
    for _ in 0..STEPS {
        let (a, b) = residuals.equations(&out.motion, gate);
        out.information = a;
        let (a, b) = with_prior(a, b, &motion, &out.motion, middle, given, diagonal.into());
        let Some(x) = a.cholesky().map(|c| c.solve(&b)) else { return out };
        let (omega, v) = (DVec3::new(x[0], x[1], x[2]), DVec3::new(x[3], x[4], x[5]));
        out.motion =
            Rigid::shift(v) * Rigid::about(omega.normalize_or(DVec3::Z), DVec3::ZERO, omega.length()) * out.motion;
        gate *= SHRINK;
    }
    out
}

/// Mean place in the end state.
fn middle_of(clouds: &PerState<IndexedCloud<'_>>, members: &PerState<Vec<usize>>, motion: &Rigid) -> DVec3 {
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for s in State::ALL {
        for &i in &members[s] {
            let p = clouds[s].cloud.points[i].as_dvec3();
            sum += if s == State::START { motion.apply(p) } else { p };
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

/// The normal equations with the information `given` about the places of the middle and of three points around it at a tenth of the
/// diagonal: the given motion takes them there.
pub(super) fn with_prior(
    mut a: Matrix6<f64>,
    mut b: Vector6<f64>,
    before: &Rigid,
    now: &Rigid,
    middle: DVec3,
    given: f64,
    diagonal: f64,
) -> (Matrix6<f64>, Vector6<f64>) {
    /// Distance of the points from the middle, a share of the diagonal.
    const ARM: f64 = 0.1;
    let change = *before * now.inverse();
    for offset in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
        let p = middle + offset * ARM * diagonal;
        let wanted = change.apply(p) - p;
        for (axis, w) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().zip(wanted.to_array()) {
            let j = slope_of(p, axis);
            a += j * j.transpose() * given / 4.0;
            b += j * (w * given / 4.0);
        }
    }
    (a, b)
}

/// Length of the line of sight to a point for each unit of depth.
pub(super) fn stretch(view: &crate::discover::visibility::DepthLookup, point: Vec3) -> f32 {
    let eye = view.camera.position().as_vec3();
    let (rotation, translation) = view.pose();
    point.distance(eye) / (rotation * point + translation).z.max(1e-6)
}
