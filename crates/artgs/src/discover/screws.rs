//! Turns of parts that look alike from many sides. The surface of a cap shows how far it went along its axis, but ribs or
//! a smooth side fit after many turns. The tints of the surface show which turn it was.

use super::cloud::{Cloud, IndexedCloud};
use super::registration::{Matching, Registration, RegistrationOptions, register};
use artgs_core::{PerState, Rigid, State};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Settings of the search for a turn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScrewSettings {
    /// Motions that turn more have a known axis, degrees; that of others is the direction of the shift.
    known_axis_deg: f64,
    /// Smaller turns are not reported, degrees.
    least_turn_deg: f64,
    /// Points that are compared.
    points: usize,
    /// Two points this close match, spacings.
    reach: f64,
    /// Least cosine between their normals.
    facing: f32,
    /// Turns at which a part of this kind must match,
    trials: usize,
    /// with at least this fraction of the pairs that it has without a turn. Here relief, such as ribs, is ignored:
    alike: f64,
    /// points match that are as close as this share of the diagonal of the part's box, if one of so many nearest faces
    /// the same way. Calibrated on a cap with ribs at two resolutions.
    relief: (f32, usize),
    /// Turns that are compared in a whole circle, and then around the best of them.
    steps: [usize; 2],
    /// Distance of tints (shares of red, green and blue) that counts as no match.
    other_tint: f32,
    /// A turn is taken if its mismatch is below this fraction of the mismatch without it,
    better: f64,
    /// and below it by this much.
    clearly: f64,
}

impl Default for ScrewSettings {
    fn default() -> Self {
        Self {
            known_axis_deg: 12.0,
            least_turn_deg: 12.0,
            points: 2000,
            reach: 1.5,
            facing: 0.7,
            trials: 12,
            alike: 0.7,
            relief: (0.05, 16),
            steps: [72, 21],
            other_tint: 0.1,
            better: 0.7,
            clearly: 0.05,
        }
    }
}

/// The turn about the direction of its shift that a part made, registered; none if it made none, or if the part does not
/// look alike from many sides. `motion` fits the surface; `spacing` is the distance between points.
pub(super) fn turned(
    points: &PerState<IndexedCloud<'_>>,
    motion: &Rigid,
    options: &RegistrationOptions,
    spacing: f64,
    settings: &ScrewSettings,
) -> Option<Registration> {
    let start = points[State::START].cloud;
    let middle = start.middle().as_dvec3();
    let known = motion.angle().to_degrees() > settings.known_axis_deg;
    let axis = if known { motion.screw().axis } else { (motion.apply(middle) - middle).try_normalize()? };
    let pivot = axis_of_revolution(start, axis, middle, 2.0 * spacing)?;
    let reach = settings.reach * spacing;
    let compare = Comparison { start, end: &points[State::END], reach: (reach * reach) as f32, near: 1, settings };
    let at = |turn: f64| *motion * Rigid::about(axis, pivot, turn);
    let unturned = compare.with(motion);
    let (relief, near) = settings.relief;
    let relief = f64::from(relief * start.diagonal());
    let coarsely = Comparison { reach: reach.max(relief).powi(2) as f32, near, ..compare };
    let trials = (0..settings.trials).map(|i| (i as f64 + 0.5) / settings.trials as f64 * TAU);
    let matched = trials.map(|turn| coarsely.with(&at(turn)).matched).sum::<f64>() / settings.trials as f64;
    if matched < settings.alike * coarsely.with(motion).matched {
        return None;
    }
    let best_of = |turns: Vec<f64>| {
        let scored: Vec<(f64, f64)> = turns.par_iter().map(|t| (compare.with(&at(*t)).mismatch, *t)).collect();
        scored.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1)
    };
    let [coarse, fine] = settings.steps;
    let step = TAU / coarse as f64;
    let near = best_of((0..coarse).map(|i| i as f64 * step).collect())?;
    let turn = best_of((0..fine).map(|i| near + step * (2.0 * i as f64 / (fine - 1) as f64 - 1.0)).collect())?;
    // Ribs have a neighbour on either side: the turn must not slip to it.
    let options = RegistrationOptions { first_reach: reach, ..*options };
    let found = register(Matching::mutual(&points[State::START], &points[State::END]), at(turn), None, &options);
    let mismatch = compare.with(&found.motion).mismatch;
    let clear = mismatch < settings.better * unturned.mismatch && mismatch + settings.clearly < unturned.mismatch;
    (clear && found.motion.angle().to_degrees() > settings.least_turn_deg).then_some(found)
}

/// How two surfaces compare after a motion.
struct Mismatch {
    /// Share of the points that a point of the other state matches.
    matched: f64,
    /// Mean distance of tints, 1 for points without a match.
    mismatch: f64,
}

#[derive(Clone, Copy)]
struct Comparison<'a> {
    start: &'a Cloud,
    end: &'a IndexedCloud<'a>,
    /// Squared.
    reach: f32,
    /// Nearest points that are looked at.
    near: usize,
    settings: &'a ScrewSettings,
}

impl Comparison<'_> {
    fn with(&self, motion: &Rigid) -> Mismatch {
        let stride = self.start.len().div_ceil(self.settings.points).max(1);
        let (mut all, mut matched, mut mismatch) = (0usize, 0usize, 0.0);
        for i in (0..self.start.len()).step_by(stride) {
            let at = motion.apply(self.start.points[i].as_dvec3()).as_vec3();
            let normal = motion.turn(self.start.normals[i].as_dvec3()).as_vec3();
            let mut other = None;
            self.end.nearest_n(at, self.near, self.reach, |j, _| {
                if other.is_none() && normal.dot(self.end.cloud.normals[j]) > self.settings.facing {
                    other = Some(j);
                }
            });
            all += 1;
            matched += usize::from(other.is_some());
            let apart = |j: usize| tint(self.start.colors[i]).distance(tint(self.end.cloud.colors[j]));
            let apart = other.map_or(1.0, |j| apart(j) / self.settings.other_tint);
            mismatch += f64::from(apart.min(1.0));
        }
        let all = all.max(1) as f64;
        Mismatch { matched: matched as f64 / all, mismatch: mismatch / all }
    }
}

/// Shares of red, green and blue: what light, which does not turn with the part, hardly changes.
fn tint(color: Vec3) -> Vec3 {
    /// Keeps dark colours, whose shares are noise, near grey.
    const DARK: f32 = 0.03;
    (color + DARK) / (color.element_sum() + 3.0 * DARK)
}

/// A point of the line along `axis` that the normals meet, found from `guess`; none if they do not fix it. Normals that
/// miss the line by more than `scale` count less.
fn axis_of_revolution(cloud: &Cloud, axis: DVec3, guess: DVec3, scale: f64) -> Option<DVec3> {
    /// Normals closer to the axis, by their sine, say nothing about its place.
    const LEAST_SINE: f64 = 0.3;
    const ROUNDS: usize = 8;
    let (e1, e2) = axis.any_orthonormal_pair();
    let row = |(p, n): (&Vec3, &Vec3)| {
        let across = n.as_dvec3().cross(axis);
        let p = p.as_dvec3() - guess;
        (across.length() > LEAST_SINE).then(|| (across.dot(e1), across.dot(e2), across.dot(p)))
    };
    let rows: Vec<(f64, f64, f64)> = cloud.points.iter().zip(&cloud.normals).filter_map(row).collect();
    let mut at = None;
    for _ in 0..ROUNDS {
        let (mut uu, mut uv, mut vv, mut ur, mut vr) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for &(u, v, r) in &rows {
            let missed = at.map_or(0.0, |(x, y)| u * x + v * y - r) / scale;
            let w = 1.0 / (1.0 + missed * missed);
            (uu, uv, vv) = (uu + w * u * u, uv + w * u * v, vv + w * v * v);
            (ur, vr) = (ur + w * u * r, vr + w * v * r);
        }
        let determinant = uu * vv - uv * uv;
        // A flat part has normals in one direction only.
        if determinant < 1e-3 * (uu + vv) * (uu + vv) {
            return None;
        }
        at = Some(((vv * ur - uv * vr) / determinant, (uu * vr - uv * ur) / determinant));
    }
    at.map(|(x, y)| guess + e1 * x + e2 * y)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A cap without ribs: a smooth side and a lid, coloured by `color(angle about the axis)`.
    fn cap(motion: &Rigid, color: impl Fn(f64) -> Vec3) -> Cloud {
        let mut cloud = Cloud::default();
        let mut push = |p: DVec3, n: DVec3, angle: f64| {
            cloud.points.push(motion.apply(p).as_vec3());
            cloud.normals.push(motion.turn(n).as_vec3());
            cloud.colors.push(color(angle));
            cloud.roughness.push(0.0);
        };
        for i in 0..120 {
            let angle = f64::from(i) / 120.0 * TAU;
            let out = DVec3::new(angle.cos(), angle.sin(), 0.0);
            (0..20).for_each(|j| push(0.1 * out + DVec3::Z * 0.005 * f64::from(j), out, angle));
            (1..20).for_each(|j| push(0.005 * f64::from(j) * out + DVec3::Z * 0.1, DVec3::Z, angle));
        }
        cloud
    }

    /// The same with 18 ribs along its side, each 0.01 high.
    fn ribbed(motion: &Rigid, color: impl Fn(f64) -> Vec3) -> Cloud {
        let mut cloud = cap(&Rigid::IDENTITY, color);
        for (point, normal) in cloud.points.iter_mut().zip(&cloud.normals) {
            let angle = f64::from(point.y.atan2(point.x)).to_degrees().rem_euclid(20.0);
            if normal.z == 0.0 && angle < 8.0 {
                *point += 0.01 * *normal;
            }
        }
        for (point, normal) in cloud.points.iter_mut().zip(&mut cloud.normals) {
            *point = motion.apply(point.as_dvec3()).as_vec3();
            *normal = motion.turn(normal.as_dvec3()).as_vec3();
        }
        cloud
    }

    fn found(color: fn(f64) -> Vec3, turn: f64) -> Option<Rigid> {
        found_of(cap, color, turn)
    }

    fn found_of<C: Fn(f64) -> Vec3 + Copy>(cap: fn(&Rigid, C) -> Cloud, color: C, turn: f64) -> Option<Rigid> {
        let axis = DVec3::new(0.2, -0.1, 1.0).normalize();
        let place = Rigid::shift(DVec3::new(0.3, 0.4, 0.2))
            * Rigid { rotation: glam::DQuat::from_rotation_arc(DVec3::Z, axis), translation: DVec3::ZERO };
        let shift = Rigid::shift(axis * 0.08);
        let truth = shift * Rigid::about(axis, place.translation, turn);
        let clouds = PerState::new(cap(&place, color), cap(&(truth * place), color));
        let indexed = clouds.as_ref().map(IndexedCloud::new);
        let options = RegistrationOptions {
            first_reach: 0.015,
            last_reach: 0.005,
            iterations: 20,
            max_points: 20_000,
            either_side: false,
        };
        turned(&indexed, &shift, &options, 0.005, &ScrewSettings::default()).map(|r| r.motion)
    }

    #[test]
    fn tints_show_how_far_a_smooth_cap_turned() {
        let sectors = |angle: f64| {
            if ((angle.to_degrees() / 50.0) as u32).is_multiple_of(2) { Vec3::X } else { Vec3::splat(0.9) }
        };
        let motion = found(sectors, 2.0).expect("a turn");
        let screw = motion.screw();
        assert!((screw.angle - 2.0).abs() < 0.03 && (screw.slide - 0.08).abs() < 0.001, "{screw:?}");
        assert!(screw.axis.dot(DVec3::new(0.2, -0.1, 1.0).normalize()) > 0.99999, "{screw:?}");
    }

    #[test]
    fn ribs_higher_than_the_distance_of_points_do_not_hide_a_turn() {
        let sectors = |angle: f64| {
            if ((angle.to_degrees() / 50.0) as u32).is_multiple_of(2) { Vec3::X } else { Vec3::splat(0.9) }
        };
        // Six ribs and a half.
        let truth = 130f64.to_radians();
        let turn = found_of(ribbed, sectors, truth).expect("a turn").screw().angle;
        assert!((turn - truth).abs() < 0.03, "{turn}");
    }

    #[test]
    fn a_piston_that_only_slides_does_not_turn() {
        let sectors = |angle: f64| {
            if ((angle.to_degrees() / 50.0) as u32).is_multiple_of(2) { Vec3::X } else { Vec3::splat(0.9) }
        };
        assert!(found(sectors, 0.0).is_none(), "the right colours at once");
        assert!(found(|_| Vec3::ONE, 1.0).is_none(), "nothing shows the turn");
    }
}
