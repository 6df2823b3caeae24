//! Registration of two clusters from nothing: many turns about the principal axes, the best of them refined.

use super::RegistrationConfig;
use crate::discover::Cloud;
use crate::discover::cloud::IndexedCloud;
use crate::discover::registration::{Matching, Registration, RegistrationOptions, register};
use crate::discover::scene::Lengths;
use artgs_core::{JointKind, PerState, Rigid, State};
use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, SymmetricEigen};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Rough registrations that are refined.
const REFINED: usize = 6;
/// Of equal fits the smaller turn is taken: a turn by half a circle costs as much as a mean distance of this fraction of the
/// distance between points.
const TURN_COST: f64 = 0.5;
/// Distances count up to this, relative to the object's diagonal.
const CAP: f64 = 0.03;

/// A motion between two clusters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    /// Start to end.
    pub(super) motion: Rigid,
    /// Mean distance, both ways and capped, with the cost of the turn, scene units.
    pub(super) cost: f64,
}

/// Best motion from one cluster to the other.
pub(super) fn align(start: &Cloud, end: &Cloud, lengths: &Lengths, config: &RegistrationConfig) -> Fit {
    let points = PerState::new(IndexedCloud::new(start), IndexedCloud::new(end));
    let (diagonal, spacing) = (f64::from(lengths.diagonal), f64::from(lengths.spacing));
    let rough = RegistrationOptions {
        first_reach: config.reach * diagonal,
        last_reach: 0.3 * config.reach * diagonal,
        iterations: 12,
        max_points: config.rough_points,
        either_side: false,
    };
    let fine = RegistrationOptions {
        first_reach: (0.3 * config.reach * diagonal).max(4.0 * spacing),
        last_reach: 2.0 * spacing,
        iterations: 25,
        max_points: 3000,
        either_side: false,
    };
    let refine = |guess: &Rigid, options: &RegistrationOptions| {
        let motion =
            register(Matching::mutual(&points[State::START], &points[State::END]), *guess, None, options).motion;
        Fit { motion, cost: cost(&points, &motion, options.max_points, lengths) }
    };
    let ranked = |guesses: &[Rigid], options: &RegistrationOptions| {
        let mut fits: Vec<Fit> = guesses.par_iter().map(|g| refine(g, options)).collect();
        fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        fits
    };
    let mut best: Vec<Rigid> = Vec::new();
    for fit in ranked(&guesses(start, end, config.turns), &rough) {
        let differs = |m: &Rigid| {
            (m.inverse() * fit.motion).angle() > 0.1 || gap_at_middle(m, &fit.motion, start) > 2.0 * spacing
        };
        if best.len() < REFINED && best.iter().all(differs) {
            best.push(fit.motion);
        }
    }
    ranked(&best, &fine)[0]
}

/// The same motion kept on a joint and refined once more.
pub(super) fn on_joint(start: &Cloud, end: &Cloud, guess: Rigid, kind: JointKind, lengths: &Lengths) -> Registration {
    let points = PerState::new(IndexedCloud::new(start), IndexedCloud::new(end));
    let spacing = f64::from(lengths.spacing);
    let options = RegistrationOptions {
        first_reach: 4.0 * spacing,
        last_reach: spacing,
        iterations: 20,
        max_points: 10_000,
        either_side: false,
    };
    register(Matching::mutual(&points[State::START], &points[State::END]), guess, Some(kind), &options)
}

pub(super) fn middle(cloud: &Cloud) -> DVec3 {
    cloud.middle().as_dvec3()
}

/// Distance between the places to which two motions take the middle of a cloud.
fn gap_at_middle(a: &Rigid, b: &Rigid, cloud: &Cloud) -> f64 {
    let at = middle(cloud);
    a.apply(at).distance(b.apply(at))
}

/// Middle onto middle, with `turns` turns about each principal axis of the start cluster.
fn guesses(start: &Cloud, end: &Cloud, turns: usize) -> Vec<Rigid> {
    let (from, to) = (middle(start), middle(end));
    let about =
        |q: DQuat| Rigid::shift(to) * Rigid::from_matrix(DMat3::from_quat(q), DVec3::ZERO) * Rigid::shift(-from);
    let mut out = vec![about(DQuat::IDENTITY)];
    for axis in principal_axes(start) {
        let turn = |i: usize| about(DQuat::from_axis_angle(axis, TAU * i as f64 / turns.max(1) as f64));
        out.extend((1..turns).map(turn));
    }
    out
}

fn principal_axes(cloud: &Cloud) -> [DVec3; 3] {
    let at = middle(cloud);
    let mut covariance = Matrix3::<f64>::zeros();
    for p in &cloud.points {
        let d = p.as_dvec3() - at;
        let v = nalgebra::Vector3::new(d.x, d.y, d.z);
        covariance += v * v.transpose();
    }
    let vectors = SymmetricEigen::new(covariance).eigenvectors;
    [0, 1, 2].map(|i| DVec3::new(vectors[(0, i)], vectors[(1, i)], vectors[(2, i)]).normalize_or(DVec3::X))
}

/// See [`Fit::cost`]. A partner must face the same way.
fn cost(points: &PerState<IndexedCloud<'_>>, motion: &Rigid, samples: usize, lengths: &Lengths) -> f64 {
    let cap = CAP * f64::from(lengths.diagonal);
    let one_way = |from: &IndexedCloud<'_>, to: &IndexedCloud<'_>, m: &Rigid| -> f64 {
        let stride = from.cloud.len().div_ceil(samples).max(1);
        let distance = |i: usize| {
            let p = m.apply(from.cloud.points[i].as_dvec3()).as_vec3();
            let n = m.turn(from.cloud.normals[i].as_dvec3()).as_vec3();
            match to.nearest_within(p, (cap * cap) as f32) {
                Some((j, square)) if to.cloud.normals[j].dot(n) > 0.5 => f64::from(square).sqrt(),
                _ => cap,
            }
        };
        let all: Vec<f64> = (0..from.cloud.len()).step_by(stride).map(distance).collect();
        all.iter().sum::<f64>() / all.len().max(1) as f64
    };
    let distances = State::ALL.map(|s| one_way(&points[s], &points[s.other()], &motion.away_from(s)));
    0.5 * distances.iter().sum::<f64>() + TURN_COST * f64::from(lengths.spacing) * motion.angle() / PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A box with sides 0.5, 0.3 and 0.1, one of whose faces is missing, moved.
    fn open_box(motion: &Rigid) -> Cloud {
        let mut cloud = Cloud::default();
        let mut face = |origin: Vec3, u: Vec3, v: Vec3| {
            let normal = u.cross(v).normalize();
            for i in 0..400 {
                let p = origin + u * ((i % 20) as f32 + 0.5) / 20.0 + v * ((i / 20) as f32 + 0.5) / 20.0;
                cloud.points.push(motion.apply(p.as_dvec3()).as_vec3());
                cloud.normals.push(motion.turn(normal.as_dvec3()).as_vec3());
                cloud.colors.push(Vec3::ONE);
                cloud.roughness.push(0.0);
            }
        };
        let (x, y, z) = (Vec3::X * 0.5, Vec3::Y * 0.3, Vec3::Z * 0.1);
        face(Vec3::ZERO, y, x);
        face(z, x, y);
        face(Vec3::ZERO, x, z);
        face(Vec3::ZERO, z, y);
        face(x, y, z);
        cloud
    }

    #[test]
    fn large_turns_and_slides_are_found_without_a_guess() {
        let lengths = Lengths { spacing: 0.015, diagonal: 1.2 };
        let start = open_box(&Rigid::IDENTITY);
        let hinge = Rigid::about(DVec3::new(0.1, 0.2, 1.0).normalize(), DVec3::new(0.5, 0.0, 0.0), 1.6);
        for truth in [hinge, Rigid::shift(DVec3::new(0.05, -0.4, 0.1))] {
            let fit = align(&start, &open_box(&truth), &lengths, &RegistrationConfig::default());
            let error = (fit.motion.inverse() * truth).angle().to_degrees();
            assert!(error < 0.5 && gap_at_middle(&fit.motion, &truth, &start) < 0.005, "wrong by {error} degrees");
        }
    }
}
