//! The search for the explanation with the lowest energy: motions are proposed, and only the energy decides.

use super::energy::{Explanation, Problem};
use artgs_core::{JointKind, Rigid, State};
use rayon::prelude::*;

/// Settings of the search.
#[derive(Clone, Copy, Debug)]
pub struct SearchSettings {
    /// Rounds, in each of which one part is added or some are removed.
    pub rounds: usize,
    /// Motions of each round whose labels are cut.
    pub tried: usize,
    /// Nats that a part must save beyond the numbers of its motion. Raising it loses small parts.
    pub part: f64,
    /// Surfels that cost more nats look for another motion.
    pub unhappy: f32,
    /// Fewer surfels propose nothing.
    pub least_group: usize,
    /// Groups of each state that propose motions.
    pub groups: usize,
    /// Motions that take all surfels of a part to places this close are the same, fractions of the diagonal.
    pub same: f64,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self { rounds: 12, tried: 5, part: 30.0, unhappy: 1.5, least_group: 12, groups: 8, same: 0.002 }
    }
}

impl Problem<'_> {
    /// From `start`, adds parts with the motions that unexplained surfels propose, and removes parts, as long as that lowers the total. Parts have distinct motions: bodies that move alike are one part.
    pub fn searched(&mut self, start: &Explanation, settings: &SearchSettings) -> Explanation {
        let mut best = self.settled(start, settings);
        for _ in 0..settings.rounds {
            let least = self.total(&best, settings);
            if let Some(next) = self.with_another(&best, least, settings) {
                best = next;
            } else {
                // Parts are removed last: an addition may be what a wrong part stands for.
                let fewer = self.without_surplus_parts(&best, settings);
                if fewer.motions.len() == best.motions.len() {
                    break;
                }
                best = fewer;
            }
            self.forget_all_but(&best);
        }
        best
    }

    /// The energy and the price of the parts, nats.
    pub fn total(&mut self, explanation: &Explanation, settings: &SearchSettings) -> f64 {
        self.terms(explanation).total() + settings.part * explanation.motions.len() as f64
    }

    /// Parts that move alike joined and labels cut.
    pub fn settled(&mut self, explanation: &Explanation, settings: &SearchSettings) -> Explanation {
        let distinct = self.distinct(explanation, settings);
        self.relabelled(&distinct)
    }

    /// The explanation with one more part, that of the tried motions with the lowest energy; none if it does not pay.
    fn with_another(&mut self, now: &Explanation, least: f64, settings: &SearchSettings) -> Option<Explanation> {
        let costs = self.costs(now);
        let unhappy = costs.as_ref().map(|costs| (0..costs.len()).filter(|&i| costs[i] > settings.unhappy).collect());
        let mut proposals = self.proposed(&costs, &unhappy, settings);
        let contexts = self.contexts(now);
        proposals.extend(self.slides(now, &contexts, &costs, &unhappy, settings));
        let gains: Vec<f64> = proposals.par_iter().map(|m| self.gain(&costs, &unhappy, &contexts, m)).collect();
        let mut order: Vec<usize> = (0..proposals.len()).collect();
        order.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]));
        let mut tried: Vec<Rigid> = Vec::new();
        let mut next: Option<(Explanation, f64)> = None;
        for m in order {
            if tried.len() == settings.tried || gains[m] < settings.part {
                break;
            }
            if tried.iter().any(|t| self.same_everywhere(t, &proposals[m], settings.same)) {
                continue;
            }
            tried.push(proposals[m]);
            let with = self.with_part(now, proposals[m]);
            let with = self.fitted(&with, with.motions.len());
            let energy = self.total(&with, settings);
            if next.as_ref().is_none_or(|n| energy < n.1) {
                next = Some((with, energy));
            }
        }
        next.filter(|n| n.1 < least).map(|n| n.0)
    }

    /// With one more part that moves so, and the labels that it takes.
    pub(super) fn with_part(&mut self, now: &Explanation, motion: Rigid) -> Explanation {
        let mut with = now.clone();
        with.motions.push(motion);
        // What hardly turns is a slide.
        let kind = if motion.angle() < 0.01 { JointKind::Prismatic } else { JointKind::Revolute };
        with.numbers.push(kind.numbers());
        let fresh = with.motions.len() as u16;
        self.relabelled_with(&with, Some(fresh))
    }

    /// Without parts that do not save their price, the one that saves least first.
    pub(super) fn without_surplus_parts(
        &mut self,
        explanation: &Explanation,
        settings: &SearchSettings,
    ) -> Explanation {
        let mut best = explanation.clone();
        loop {
            let least = self.total(&best, settings);
            let mut next: Option<(Explanation, f64)> = None;
            for k in 1..=best.motions.len() {
                let fewer = self.relabelled(&best.without(k));
                let total = self.total(&fewer, settings);
                if total < next.as_ref().map_or(least, |n| n.1) {
                    next = Some((fewer, total));
                }
            }
            let Some((fewer, _)) = next else { return best };
            best = fewer;
        }
    }

    /// Parts that move alike joined.
    fn distinct(&self, explanation: &Explanation, settings: &SearchSettings) -> Explanation {
        let mut out = explanation.clone();
        let mut k = out.motions.len();
        while k > 1 {
            let own = self.members(&out, k as u16);
            let points = own[State::START].iter().map(|&i| self.clouds[State::START].cloud.points[i].as_dvec3());
            let points: Vec<_> = points.step_by(4).collect();
            let same = settings.same * f64::from(self.diagonal());
            let alike = |m: &Rigid| points.iter().all(|p| m.apply(*p).distance(out.motions[k - 1].apply(*p)) < same);
            if let Some(j) = (0..k - 1).find(|j| !points.is_empty() && alike(&out.motions[*j])) {
                out.labels.iter_mut().flatten().filter(|l| usize::from(**l) == k).for_each(|l| *l = j as u16 + 1);
                out = out.without(k);
            }
            k -= 1;
        }
        out
    }

    /// True if two motions take the corners of the object to the same places.
    fn same_everywhere(&self, a: &Rigid, b: &Rigid, same: f64) -> bool {
        let (lower, upper) = self.scene.bounds();
        let corner = |c: usize| {
            let pick = |bit: usize, axis: usize| if c >> bit & 1 == 1 { upper[axis] } else { lower[axis] };
            glam::DVec3::new(pick(0, 0).into(), pick(1, 1).into(), pick(2, 2).into())
        };
        (0..8).all(|c| a.apply(corner(c)).distance(b.apply(corner(c))) < 4.0 * same * f64::from(self.diagonal()))
    }
}
