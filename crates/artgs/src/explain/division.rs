//! Parts that are two: bodies that move nearly alike, on both sides of a plane.

use super::energy::{Explanation, Problem};
use super::motion::{Equation, registered, with_prior};
use super::search::SearchSettings;
use crate::discover::cloud::{Cloud, principal_axes};
use artgs_core::{PerState, Rigid, State};
use glam::{DVec3, Vec3};
use nalgebra::{Matrix6, Vector6};
use rayon::prelude::*;

/// Surfels of a part on either side of a plane.
struct Division {
    /// Nats by which two motions fit their depth better than one.
    gain: f64,
    /// Part, from 1.
    part: usize,
    sides: [PerState<Vec<usize>>; 2],
}

/// A surfel of a part, and what it says about a twist.
struct Member {
    /// Place in the end state.
    place: Vec3,
    equation: Equation,
}

impl Problem<'_> {
    /// With a part divided in two that move nearly alike, such as two drawers that open nearly as far; none if that does not lower the total. While they
    /// are one, neither true motion explains more than the mean of both: adding one alone lowers nothing.
    pub(super) fn divided(&mut self, now: &Explanation, settings: &SearchSettings) -> Option<Explanation> {
        let mut divisions: Vec<Division> =
            (1..=now.motions.len()).filter_map(|part| self.division(now, part, settings)).collect();
        divisions.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let least = self.total(now, settings);
        for division in divisions.into_iter().take(settings.tried) {
            let with = self.with_division(now, &division);
            let mut fitted = self.fitted(&with, division.part);
            fitted = self.fitted(&fitted, with.motions.len());
            if self.total(&fitted, settings) < least - settings.better {
                return Some(fitted);
            }
        }
        None
    }

    /// The two sides of a part, each with its registered motion.
    fn with_division(&self, now: &Explanation, division: &Division) -> Explanation {
        let motion = now.motions[division.part - 1];
        let registered = |side: &PerState<Vec<usize>>| registered(&self.residuals(side), motion).motion;
        let [first, second] = &division.sides;
        let mut out = now.with(registered(second));
        out.motions[division.part - 1] = registered(first);
        let last = out.motions.len();
        for s in State::ALL {
            second[s].iter().for_each(|i| out.labels[s][*i] = last as u16);
        }
        for part in [division.part, last] {
            out.motions[part - 1] = self.possible_motion(&out, part);
        }
        out
    }

    /// The plane across a main direction of part `part` (from 1) on both sides of which two motions fit best; none if they gain less than a part costs at
    /// least.
    fn division(&self, now: &Explanation, part: usize, settings: &SearchSettings) -> Option<Division> {
        let motion = now.motions[part - 1];
        let own = self.members(now, part as u16);
        let members = self.asked(&own, &motion);
        if members.len() < 2 * settings.least_group {
            return None;
        }
        let cloud = Cloud { points: members.iter().map(|m| m.place).collect(), ..Cloud::default() };
        let axes = principal_axes(&cloud, &(0..members.len()).collect::<Vec<_>>());
        let best = axes.map(|axis| self.best_plane(&members, axis, settings));
        let (axis, (gain, offset)) = (0..3).map(|k| (axes[k], best[k])).max_by(|a, b| a.1.0.total_cmp(&b.1.0))?;
        if gain < settings.part + self.nats_of_numbers(1) {
            return None;
        }
        let is_first = |s: State, i: usize| self.place_at_end(&motion, s, i).dot(axis) < offset;
        let sides = [true, false].map(|first| {
            PerState::from_fn(|s: State| own[s].iter().copied().filter(|i| is_first(s, *i) == first).collect())
        });
        Some(Division { gain, part, sides })
    }

    /// Where a surfel is in the end state if it moves so.
    fn place_at_end(&self, motion: &Rigid, state: State, surfel: usize) -> Vec3 {
        let p = self.clouds[state].cloud.points[surfel];
        if state == State::START { motion.apply(p.as_dvec3()).as_vec3() } else { p }
    }

    /// Some surfels of a part.
    fn asked(&self, own: &PerState<Vec<usize>>, motion: &Rigid) -> Vec<Member> {
        /// Surfels of a state that are asked.
        const ASKED: usize = 1500;
        /// Residuals of less take part, shares of the diagonal.
        const GATE: f32 = 0.01;
        let residuals = self.residuals(own);
        let mut out = Vec::new();
        for state in State::ALL {
            let step = own[state].len().div_ceil(ASKED).max(1);
            let moved = motion.away_from(state);
            let of = |surfel: usize| {
                let mut equation = residuals.equation(state, surfel, &moved, GATE * self.diagonal());
                let weight = step as f64 * f64::from(self.weights[state][surfel] / self.shared);
                equation.information *= weight;
                equation.pull *= weight;
                Member { place: self.place_at_end(motion, state, surfel), equation }
            };
            let asked: Vec<usize> = own[state].iter().copied().step_by(step).collect();
            out.par_extend(asked.into_par_iter().map(of));
        }
        out
    }

    /// Gain of two motions on both sides of the best plane across `axis`, nats, and the offset of the plane.
    fn best_plane(&self, members: &[Member], axis: Vec3, settings: &SearchSettings) -> (f64, f32) {
        /// Planes that are tried.
        const PLANES: usize = 40;
        let mut order: Vec<&Member> = members.iter().collect();
        order.sort_by(|a, b| a.place.dot(axis).total_cmp(&b.place.dot(axis)));
        let all = Information::of(&order);
        let whole = all.explained(self.diagonal());
        let (mut first, mut done) = (Information::default(), 0);
        let mut best = (0.0, 0.0);
        for plane in 1..PLANES {
            let end = plane * order.len() / PLANES;
            first.add(&order[done..end]);
            done = end;
            if end.min(order.len() - end) < settings.least_group {
                continue;
            }
            let second = all.without(&first);
            let gain = first.explained(self.diagonal()) + second.explained(self.diagonal()) - whole;
            if gain > best.0 {
                best = (gain, 0.5 * (order[end - 1].place + order[end].place).dot(axis));
            }
        }
        best
    }
}

/// Normal equations of a twist.
#[derive(Clone, Copy, Default)]
struct Information {
    a: Matrix6<f64>,
    b: Vector6<f64>,
    /// Sum and number of places.
    places: (DVec3, f64),
}

impl Information {
    fn of(members: &[&Member]) -> Self {
        let mut out = Self::default();
        out.add(members);
        out
    }

    fn add(&mut self, members: &[&Member]) {
        for member in members {
            let Equation { slope, information, pull } = &member.equation;
            self.a += slope * slope.transpose() * *information;
            self.b += slope * *pull;
            self.places.0 += member.place.as_dvec3();
            self.places.1 += 1.0;
        }
    }

    fn without(&self, other: &Self) -> Self {
        let places = (self.places.0 - other.places.0, self.places.1 - other.places.1);
        Self { a: self.a - other.a, b: self.b - other.b, places }
    }

    /// Nats by which the best twist fits better than none, with a prior that keeps it small.
    fn explained(&self, diagonal: f32) -> f64 {
        /// Standard deviation of the twist, a share of the diagonal.
        const GIVEN: f64 = 0.005;
        let diagonal = f64::from(diagonal);
        let given = (GIVEN * diagonal).powi(-2);
        let middle = self.places.0 / self.places.1.max(1.0);
        let (a, b) = with_prior(self.a, self.b, &Rigid::IDENTITY, &Rigid::IDENTITY, middle, given, diagonal);
        a.cholesky().map_or(0.0, |c| 0.5 * b.dot(&c.solve(&b)))
    }
}
