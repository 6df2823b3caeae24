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

/// Gauss-Newton steps on the depth residuals of the surfels of each state that are `members`, from `motion` on. Hits within a gate
/// that shrinks from the measuring gate take part. `shared` neighbouring surfels count as one.
pub(super) fn registered(
    scene: &Scene,
    clouds: &PerState<IndexedCloud<'_>>,
    noise: &PerState<Noise>,
    shared: f32,
    members: &PerState<Vec<usize>>,
    motion: Rigid,
    settings: &ExplainSettings,
) -> Registered {
    const STEPS: usize = 8;
    /// Surfels of a state that take part.
    const MOST: usize = 2500;
    /// Every so many views take part.
    const VIEWS: usize = 3;
    /// The gate shrinks by this factor from step to step.
    const SHRINK: f32 = 0.6;
    /// First gate, a share of the diagonal.
    const GATE: f32 = 0.003;
    /// Standard deviation of the given motion, a share of the diagonal: where the surfels say nothing, it stays.
    const GIVEN: f64 = 0.002;
    let given = (GIVEN * f64::from(scene.lengths.diagonal)).powi(-2);
    let middle = middle_of(clouds, members, &motion);
    let mut out = Registered { motion, information: Matrix6::zeros() };
    let mut gate = GATE * scene.lengths.diagonal;
    for _ in 0..STEPS {
        let (mut a, mut b) = (Matrix6::<f64>::zeros(), Vector6::<f64>::zeros());
        for state in State::ALL {
            let to = state.other();
            let motion = out.motion.away_from(state);
            let own: Vec<usize> =
                members[state].iter().copied().step_by(members[state].len().div_ceil(MOST).max(1)).collect();
            let views = &scene.states[to].views;
            let rows: Vec<(Matrix6<f64>, Vector6<f64>)> = own
                .par_iter()
                .with_min_len(64)
                .map(|&i| {
                    let surfel = Surfel::of(clouds[state].cloud, i);
                    let image = surfel.moved(&motion);
                    // The twist acts on the place in the end state.
                    let (at, sign) = if state == State::START { (image, 1.0) } else { (surfel, -1.0) };
                    let (p, n) = (at.point.as_dvec3(), at.normal.as_dvec3());
                    let m = p.cross(n);
                    let j = Vector6::new(m.x, m.y, m.z, n.x, n.y, n.z) * sign;
                    let (mut a, mut b, mut count) = (0.0, 0.0, 0.0);
                    for view in views.iter().step_by(VIEWS) {
                        let Some((r, cosine)) = residual(view, &image, settings.facing) else { continue };
                        let deviation = noise[to].deviation_at(cosine);
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
                    (j * j.transpose() * (a * each), j * (b * each))
                })
                .collect();
            rows.iter().for_each(|(x, y)| {
                a += x;
                b += y;
            });
        }
        out.information = a / f64::from(shared);
        let (a, b) = with_prior(
            a / f64::from(shared),
            b / f64::from(shared),
            &motion,
            &out.motion,
            middle,
            given,
            scene.lengths.diagonal.into(),
        );
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
fn with_prior(
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
            let m = p.cross(axis);
            let j = Vector6::new(m.x, m.y, m.z, axis.x, axis.y, axis.z);
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
