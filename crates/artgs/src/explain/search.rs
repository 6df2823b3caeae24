//! The search for the explanation with the lowest energy: motions are proposed, and only the energy decides.

use super::cost::Context;
use super::energy::{Explanation, Problem};
use artgs_core::{JointKind, PerState, Rigid, State};
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
    /// Another part is fitted if the total is at most so many nats higher before. Raising it tries more.
    pub rough: f64,
    /// Nats of a surfel of another moving part that a new part takes although it explains it worse by as many. Raising it replaces parts more
    /// readily.
    pub yielded: f32,
    /// Nats by which an explanation must be better than one with as many parts. Raising it keeps what was found first.
    pub better: f64,
    /// Motions that take all surfels of a part to places this close are the same, fractions of the diagonal.
    pub same: f64,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self {
            rounds: 12,
            tried: 5,
            part: 12.0,
            unhappy: 1.5,
            least_group: 12,
            groups: 8,
            rough: 60.0,
            yielded: 1.0,
            better: 3.0,
            same: 0.002,
        }
    }
}

/// True if a motion hardly turns.
pub(super) fn is_slide(motion: &Rigid) -> bool {
    motion.angle() < 0.01
}

/// Numbers that a motion needs.
fn numbers(motion: &Rigid) -> u8 {
    let kind = if is_slide(motion) { JointKind::Prismatic } else { JointKind::Revolute };
    kind.numbers()
}

/// At most `count` things with the largest gains above `least`, none of which is the `same` as a better one.
fn most_promising<T>(mut gains: Vec<(f64, T)>, least: f64, count: usize, same: impl Fn(&T, &T) -> bool) -> Vec<T> {
    gains.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut out: Vec<T> = Vec::new();
    for (_, next) in gains.into_iter().take_while(|g| g.0 > least) {
        if out.len() == count {
            break;
        }
        if !out.iter().any(|other| same(other, &next)) {
            out.push(next);
        }
    }
    out
}

impl Explanation {
    /// With one more part that moves so and has no surfels.
    pub(super) fn with(&self, motion: Rigid) -> Self {
        let mut out = self.clone();
        out.motions.push(motion);
        out.numbers.push(numbers(&motion));
        out
    }
}

impl Problem<'_> {
    /// From `start`, adds parts with the motions that unexplained surfels propose or that `pool` has, and removes parts, as long as that lowers
    /// the total. Parts have distinct motions: bodies that move alike are one part.
    pub fn searched(&mut self, start: &Explanation, pool: &[Rigid], settings: &SearchSettings) -> Explanation {
        let mut best = self.settled(start, settings);
        for _ in 0..settings.rounds {
            best = self.refitted(&best, settings);
            let costs = self.costs(&best);
            let contexts = self.contexts(&best);
            let additions = self.additions(&best, &costs, &contexts, pool, settings);
            let next = self.accepted(&best, &additions, settings).or_else(|| self.divided(&best, settings));
            if let Some(next) = next {
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

    /// Parts that move by `motions`, which one after the other take what they explain better; those that move alike joined.
    pub fn started(&mut self, motions: &[Rigid], settings: &SearchSettings) -> Explanation {
        let mut out = Explanation::without_parts(self.surfels());
        for motion in motions {
            out = self.roughly_with(&out, *motion, 0.0);
        }
        self.settled(&out, settings)
    }

    /// With the motion of each part fitted again where that lowers the total.
    fn refitted(&mut self, explanation: &Explanation, settings: &SearchSettings) -> Explanation {
        let mut best = explanation.clone();
        for part in 1..=best.motions.len() {
            let fitted = self.fitted(&best, part);
            best = self.lowest(&best, vec![fitted], settings).unwrap_or(best);
        }
        best
    }

    /// Of `others` the explanation with the lowest total; none if it is not lower than that of `now`.
    fn lowest(
        &mut self,
        now: &Explanation,
        others: Vec<Explanation>,
        settings: &SearchSettings,
    ) -> Option<Explanation> {
        let mut least = self.total(now, settings);
        let mut next = None;
        for other in others {
            let total = self.total(&other, settings);
            if total < least {
                (next, least) = (Some(other), total);
            }
        }
        next
    }

    /// With one more part that moves by one of `motions`, perhaps in place of others, and lowers the total, the most promising one first; none if
    /// none does.
    fn accepted(&mut self, now: &Explanation, motions: &[Rigid], settings: &SearchSettings) -> Option<Explanation> {
        let least = self.total(now, settings);
        // Before the motion is fitted and all labels are cut.
        let mut roughly: Vec<(f64, Explanation)> = Vec::new();
        for motion in motions {
            // A right motion may have to replace a wrong one that explains the same surfels nearly as well.
            for yielded in [0.0, settings.yielded] {
                let with = self.roughly_with(now, *motion, yielded);
                roughly.push((self.total(&with, settings), with));
            }
        }
        roughly.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, with) in roughly.into_iter().take_while(|r| r.0 < least + settings.rough) {
            let fitted = self.fitted(&with, with.motions.len());
            let total = self.total(&fitted, settings);
            if total < least {
                return Some(fitted);
            }
            if total < least + settings.rough {
                let fewer = self.without_surplus_parts(&fitted, settings);
                if self.total(&fewer, settings) < least - settings.better {
                    return Some(fewer);
                }
            }
        }
        None
    }

    /// With one more part that moves so and its first labels, for which it takes surfels of other moving parts also if it explains them worse by
    /// `yielded` nats each.
    pub(super) fn roughly_with(&mut self, now: &Explanation, motion: Rigid, yielded: f32) -> Explanation {
        let part = now.motions.len() as u16 + 1;
        let fresh = Some((part, yielded));
        let with = self.grown(&now.with(motion), &[part], fresh);
        let possible = self.possible_motion(&with, usize::from(part));
        if possible == motion { with } else { self.grown(&now.with(possible), &[part], fresh) }
    }

    /// The motion of part `part` (from 1) if it can move so, else the slide of its middle.
    pub(super) fn possible_motion(&self, explanation: &Explanation, part: usize) -> Rigid {
        let motion = explanation.motions[part - 1];
        if self.can_move(&motion, explanation, part) {
            return motion;
        }
        let middle = self.middles(explanation)[part];
        Rigid::shift(motion.apply(middle) - middle)
    }

    /// True if part `part` (from 1) can turn so about an axis on the object, where it is or where another part that carries it takes it.
    pub(super) fn can_move(&self, motion: &Rigid, explanation: &Explanation, part: usize) -> bool {
        let turns_on = |carrier: &Rigid| self.scene.hinges().can_move(&(carrier.inverse() * *motion));
        let mut others = explanation.motions.iter().enumerate().filter(|(k, _)| k + 1 != part);
        turns_on(&Rigid::IDENTITY) || others.any(|(_, carrier)| turns_on(carrier))
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

    /// The most promising motions of another part.
    fn additions(
        &self,
        now: &Explanation,
        costs: &PerState<Vec<f32>>,
        contexts: &PerState<Context>,
        pool: &[Rigid],
        settings: &SearchSettings,
    ) -> Vec<Rigid> {
        let unhappy = costs.as_ref().map(|costs| (0..costs.len()).filter(|&i| costs[i] > settings.unhappy).collect());
        let mut proposals = self.proposed(costs, &unhappy, settings);
        proposals.extend(self.slides(now, contexts, costs, &unhappy, settings));
        proposals.extend(pool);
        let gains = proposals.par_iter().map(|m| self.gain(costs, &unhappy, contexts, m));
        let gains: Vec<(f64, Rigid)> = gains.zip(proposals.par_iter().copied()).collect();
        let same = |a: &Rigid, b: &Rigid| self.same_everywhere(a, b, settings.same);
        most_promising(gains, settings.part, settings.tried, same)
    }

    /// With one more part that moves so, and the labels that it takes.
    pub(super) fn with_part(&mut self, now: &Explanation, motion: Rigid) -> Explanation {
        let with = self.roughly_with(now, motion, 0.0);
        self.relabelled(&with)
    }

    /// Without parts that do not save their price, the one that saves least first.
    pub(super) fn without_surplus_parts(
        &mut self,
        explanation: &Explanation,
        settings: &SearchSettings,
    ) -> Explanation {
        let mut best = explanation.clone();
        loop {
            let parts: Vec<u16> = (0..best.motions.len() as u16).collect();
            let fewer = (1..=best.motions.len()).map(|k| self.grown(&best.without(k), &parts, None)).collect();
            let fewer = self.lowest(&best, fewer, settings).or_else(|| self.without_drift(&best, settings));
            let Some(fewer) = fewer else { return best };
            best = self.relabelled(&fewer);
        }
    }

    /// Without the part that is most likely no part, but a region that errors of poses took so far; none if there is none.
    pub(super) fn without_drift(&self, explanation: &Explanation, settings: &SearchSettings) -> Option<Explanation> {
        let excess =
            |k: usize| settings.part + self.nats_of_numbers(explanation.numbers[k - 1]) - self.drift(explanation, k);
        let all = (1..=explanation.motions.len()).map(|k| (excess(k), k));
        let (excess, k) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (excess > 0.0).then(|| explanation.without(k))
    }

    /// Parts that move nearly alike joined, where that lowers the total.
    fn distinct(&mut self, explanation: &Explanation, settings: &SearchSettings) -> Explanation {
        let same = settings.same * f64::from(self.diagonal());
        let mut out = explanation.clone();
        for k in (2..=out.motions.len()).rev() {
            let own = self.members(&out, k as u16);
            let cloud = self.clouds[State::START].cloud;
            let points: Vec<_> = own[State::START].iter().step_by(4).map(|&i| cloud.points[i].as_dvec3()).collect();
            let near = |j: usize, p: &glam::DVec3| out.motions[k - 1].apply(*p).distance(out.motions[j - 1].apply(*p));
            let alike: Vec<usize> = (1..k).filter(|&j| points.iter().all(|p| near(j, p) < same)).collect();
            let joined = alike.into_iter().map(|j| out.joined(j, k)).collect();
            out = self.lowest(&out, joined, settings).unwrap_or(out);
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
