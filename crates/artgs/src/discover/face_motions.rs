//! Hypotheses of bodies from flat faces (`facets`): every face of moved points is brought onto the faces of the other
//! state, and the motion is registered from what is in front of the face and behind it only. A hypothesis explains nothing
//! elsewhere, so drawers that open by nearly the same amount, and adjacent doors, do not share a motion.

use super::candidates::{Candidate, Search, sample_of};
use super::cloud::{Cloud, IndexedCloud, principal_axes};
use super::facets::{Facet, FacetSettings};
use super::poses::Pose;
use super::registration::{RegistrationOptions, register, register_along};
use artgs_core::{JointKind, PerState, Rigid, State};
use glam::Vec3;
use rayon::prelude::*;

/// The box of space in front of a face and behind it, in the frame of one state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Region {
    state: State,
    centre: Vec3,
    axes: [Vec3; 3],
    half: [f32; 3],
}

impl Region {
    /// True if a point of a state is in the box, which moves from start to end by `motion`.
    pub(super) fn contains(&self, state: State, point: Vec3, motion: &Rigid) -> bool {
        let own = if state == self.state { point } else { motion.away_from(state).apply(point.as_dvec3()).as_vec3() };
        let d = own - self.centre;
        self.axes.iter().zip(self.half).all(|(axis, half)| d.dot(*axis).abs() < half)
    }

    /// The box of a face of a state.
    pub(super) fn around(cloud: &Cloud, facet: &Facet, state: State, spacing: f32, diagonal: f32) -> Self {
        /// The box reaches past the face by this, spacings,
        const MARGIN: f32 = 1.0;
        /// and extends in front of it and behind it by this fraction of the diagonal.
        const DEPTH: f32 = 0.35;
        /// One of so many points on each side may lie outside.
        const OUTLIERS: usize = 100;
        if facet.members.is_empty() {
            return Self { state, centre: facet.centre, axes: [Vec3::X, Vec3::Y, Vec3::Z], half: [0.0; 3] };
        }
        let [long, _, _] = principal_axes(cloud, &facet.members);
        let normal = facet.normal;
        let u = (long - normal * long.dot(normal)).normalize_or(normal.any_orthonormal_vector());
        let axes = [u, normal.cross(u), normal];
        let ranges = axes.map(|axis| {
            let mut along: Vec<f32> = facet.members.iter().map(|&i| cloud.points[i].dot(axis)).collect();
            along.sort_unstable_by(f32::total_cmp);
            let outer = along.len() / OUTLIERS;
            along.get(outer).zip(along.iter().nth_back(outer)).map_or((0.0, 0.0), |(lo, hi)| (*lo, *hi))
        });
        let centre = axes.iter().zip(ranges).map(|(axis, (lo, hi))| *axis * (0.5 * (lo + hi))).sum();
        let [a, b, _] = ranges.map(|(lo, hi)| 0.5 * (hi - lo) + MARGIN * spacing);
        Self { state, centre, axes, half: [a, b, DEPTH * diagonal] }
    }

    /// The same region, wider by this much on each side across the normal of its face, scene units.
    pub(super) fn widened(self, by: f32) -> Self {
        let [a, b, depth] = self.half;
        Self { half: [a + by, b + by, depth], ..self }
    }
}

/// A motion and the space that it is assumed for.
#[derive(Clone, Debug)]
pub(super) struct Hypothesis {
    /// The motion, and the points that it explains in the region.
    pub(super) candidate: Candidate,
    pub(super) region: Region,
}

impl Search<'_> {
    /// At most `most` hypotheses, in the order in which they are worth keeping.
    pub(super) fn hypotheses_of_faces(&self, settings: &FacetSettings, most: usize) -> Vec<Hypothesis> {
        let spacing = self.lengths.spacing;
        let landing = self.landing_values(&self.states.as_ref().map(|s| s.moved.to_vec()));
        let facets = PerState::from_fn(|s| {
            let state = &self.states[s];
            let members: Vec<usize> = state.moved.iter().chain(state.unseen).copied().collect();
            settings.find(state.points.cloud, &members, spacing)
        });
        let mut found: Vec<Hypothesis> = Vec::new();
        for s in State::ALL {
            let mut is_moved = vec![false; self.states[s].points.cloud.len()];
            self.states[s].moved.iter().for_each(|&i| is_moved[i] = true);
            let moved = |f: &&Facet| 2 * f.members.iter().filter(|&&i| is_moved[i]).count() > f.members.len();
            let own: Vec<&Facet> = facets[s].iter().filter(moved).collect();
            let of_facet = |facet: &&Facet| self.hypotheses_of_face(s, facet, &facets[s.other()], &landing, settings);
            found.extend(own.par_iter().flat_map_iter(of_facet).collect::<Vec<Hypothesis>>());
        }
        let candidates: Vec<Candidate> = found.iter().map(|h| h.candidate.clone()).collect();
        self.order(&candidates, most).into_iter().take(most).map(|i| found[i].clone()).collect()
    }

    /// The best hypotheses for one face of `state`.
    fn hypotheses_of_face(
        &self,
        state: State,
        facet: &Facet,
        others: &[Facet],
        landing: &PerState<Vec<f32>>,
        settings: &FacetSettings,
    ) -> Vec<Hypothesis> {
        /// Points of the face that are compared.
        const SAMPLES: usize = 120;
        /// Motions that are registered: the best, and in all with the best small ones.
        const REGISTERED: [usize; 2] = [4, 8];
        /// Hypotheses that are kept: the same two counts.
        const KEPT: [usize; 2] = [2, 4];
        /// Distance up to which points are near a surface, spacings.
        const REACH: f32 = 2.0;
        let (cloud, target) = (self.states[state].points.cloud, &self.states[state.other()]);
        let sample = sample_of(cloud, &facet.members, SAMPLES);
        let region = Region::around(cloud, facet, state, self.lengths.spacing, self.lengths.diagonal);
        let judge = |motion: &Rigid, reach: f32| {
            let radius = reach * self.lengths.spacing;
            let value = self.mean_value(&Pose::of(motion), &sample, target, &landing[state.other()], radius);
            if value <= self.settings.least_value {
                return None;
            }
            let implausibility = self.ranking.implausibility(motion, &sample, &self.lengths, self.front);
            let by_small = value * self.ranking.small_motion(implausibility);
            (value * (1.0 - implausibility) > self.settings.least_value).then_some((
                value * (1.0 - implausibility),
                by_small,
                *motion,
            ))
        };
        let poses = others.iter().flat_map(|to| settings.poses(cloud, facet, to, self.lengths.diagonal));
        let judged = poses.filter_map(|pose| judge(&pose.rigid(), REACH)).collect();
        let guesses = self.best_by_both(judged, REGISTERED, &sample);
        let registered = guesses.iter().flat_map(|(_, motion)| self.registered_in(&region, facet, motion));
        let fine = self.settings.fine_reach;
        let judged = registered.filter_map(|m| judge(&m.away_from(state), fine)).collect();
        let best = self.best_by_both(judged, KEPT, &sample);
        // Once more, from what the registered motion explains.
        let exact = |m: Rigid| self.registered_in(&region, facet, &m).first().map_or(m.away_from(state), |m| *m);
        let motions = best.into_iter().map(|(_, m)| exact(m));
        let narrow = |motion: &Rigid| {
            let facet = Facet { members: self.not_in_empty_space(state, &facet.members, motion), ..facet.clone() };
            Region::around(cloud, &facet, state, self.lengths.spacing, self.lengths.diagonal)
        };
        let with_region = motions.map(|motion| (motion, narrow(&motion)));
        with_region.map(|(m, region)| Hypothesis { candidate: self.weigh_in(&region, landing, m), region }).collect()
    }

    /// Those of some points of a state that a motion from start to end does not take into empty space. Two closed doors
    /// side by side are one face; only one of them moves so.
    fn not_in_empty_space(&self, state: State, members: &[usize], motion: &Rigid) -> Vec<usize> {
        let (cloud, target) = (self.states[state].points.cloud, &self.states[state.other()]);
        let pose = Pose::of(&motion.away_from(state));
        let radius = self.settings.fine_reach * self.lengths.spacing;
        let any = vec![1.0; target.points.cloud.len()];
        let least = 0.5 * self.settings.in_empty;
        let value = |i: usize| self.value(&pose, cloud.points[i], cloud.normals[i], target, &any, radius);
        members.iter().copied().filter(|&i| value(i) > least).collect()
    }

    /// What a motion from start to end explains of the moved points in a region.
    fn weigh_in(&self, region: &Region, landing: &PerState<Vec<f32>>, motion: Rigid) -> Candidate {
        let inside = PerState::from_fn(|s| {
            let points = &self.states[s].points.cloud.points;
            let moved = self.states[s].moved.iter().copied();
            moved.filter(|&i| region.contains(s, points[i], &motion)).collect::<Vec<usize>>()
        });
        self.weigh(&inside, landing, motion)
    }

    /// Motions from start to end, registered from the points in the region that `motion` (own state to other state)
    /// explains: on a hinge if it turns, else free, and, if it does not turn at all, as a slide along the normal of the face.
    fn registered_in(&self, region: &Region, facet: &Facet, motion: &Rigid) -> Vec<Rigid> {
        /// Points this close to a surface are explained, spacings.
        const REACH: f32 = 2.0;
        /// Their least value.
        const LEAST_VALUE: f32 = 0.1;
        /// Motions that turn more are hinges: a thin leaf says little about motion along its axis, radians.
        const HINGE: f64 = 0.1;
        /// Fewer points are no body.
        const LEAST: usize = 24;
        let guess = motion.away_from(region.state);
        let clouds = PerState::from_fn(|s| {
            let (own, target) = (self.states[s].points.cloud, &self.states[s.other()]);
            let pose = Pose::of(&guess.away_from(s));
            let radius = REACH * self.lengths.spacing;
            let explained = |i: &usize| {
                let (p, n) = (own.points[*i], own.normals[*i]);
                region.contains(s, p, &guess) && self.value_anywhere(&pose, p, n, target, radius) > LEAST_VALUE
            };
            let members = self.states[s].moved.iter().chain(self.states[s].unseen).copied().filter(explained);
            own.select(&members.collect::<Vec<usize>>())
        });
        if clouds[region.state].len() < LEAST {
            return Vec::new();
        }
        let sources = clouds.as_ref().map(IndexedCloud::new);
        let points = self.matching(&sources, LEAST);
        let spacing = f64::from(self.lengths.spacing);
        let (iterations, max_points) = self.settings.variant_effort;
        let options = RegistrationOptions {
            first_reach: f64::from(REACH) * spacing,
            last_reach: spacing,
            iterations,
            max_points,
            either_side: false,
        };
        let kind = (motion.angle() > HINGE).then_some(JointKind::Revolute);
        let mut out = vec![register(points, guess, kind, &options).motion];
        if motion.angle() < 1e-6 {
            let axis = facet.normal.as_dvec3().normalize();
            out.push(Rigid::shift(axis * register_along(points, axis, guess.translation.dot(axis), &options)));
        }
        out
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use glam::DVec3;

    /// A face of 30 by 20 points at distance 1 that looks towards -y, its corner at `x`.
    pub(in super::super) fn face(x: f32) -> (Cloud, Facet) {
        let mut cloud = Cloud::default();
        for i in 0..600 {
            cloud.points.push(Vec3::new(x + (i % 30) as f32, 0.0, (i / 30) as f32));
            cloud.normals.push(Vec3::NEG_Y);
            cloud.colors.push(Vec3::ONE);
            cloud.roughness.push(0.0);
        }
        let facet = Facet { members: (0..600).collect(), centre: cloud.middle(), normal: Vec3::NEG_Y };
        (cloud, facet)
    }

    #[test]
    fn a_region_moves_with_its_motion_and_ends_beside_its_face() {
        let (cloud, facet) = face(0.0);
        let region = Region::around(&cloud, &facet, State::START, 1.0, 40.0);
        let motion = Rigid::about(DVec3::Z, DVec3::ZERO, -1.0);
        let behind = Vec3::new(12.0, 9.0, 6.0);
        let beside = Vec3::new(33.0, 0.0, 6.0);
        for (place, expected) in [(behind, true), (beside, false), (Vec3::new(12.0, 16.0, 6.0), false)] {
            assert_eq!(region.contains(State::START, place, &motion), expected, "{place}");
            let at_end = motion.apply(place.as_dvec3()).as_vec3();
            assert_eq!(region.contains(State::END, at_end, &motion), expected, "{place}");
        }
        let just_below = Vec3::new(12.0, 4.0, -2.0);
        assert!(!region.contains(State::START, just_below, &motion));
        assert!(region.widened(1.5).contains(State::START, just_below, &motion));
    }
}
