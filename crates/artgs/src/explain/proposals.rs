//! Motions that the search tries. They can do no harm: only the energy accepts one.

use super::cost::Context;
use super::energy::{Explanation, Problem};
use super::search::{SearchSettings, is_slide};
use crate::discover::cloud::{IndexedCloud, components, principal_axes};
use crate::discover::registration::{Matching, RegistrationOptions, register};
use artgs_core::{PerState, Rigid, State};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

impl Problem<'_> {
    /// Slides in the directions of the parts, and along the axes of parts that turn, which take them along, of the lengths that explain most of the
    /// unhappy surfels.
    pub(super) fn slides(
        &self,
        now: &Explanation,
        contexts: &PerState<Context>,
        costs: &PerState<Vec<f32>>,
        unhappy: &PerState<Vec<usize>>,
        settings: &SearchSettings,
    ) -> Vec<Rigid> {
        /// Step and longest slide, fractions of the diagonal; best slides are searched between the steps with steps so many times finer.
        const STEP: f64 = 0.004;
        const LONGEST: f64 = 0.4;
        const FINER: f64 = 8.0;
        /// Surfels of a state that are asked.
        const ASKED: usize = 400;
        let asked = unhappy.as_ref().map(|u| u.iter().copied().step_by(u.len().div_ceil(ASKED).max(1)).collect());
        let step = STEP * f64::from(self.diagonal());
        let scan = |turn: &Rigid, direction: DVec3, middle: f64, step: f64, steps: i32| {
            let lengths: Vec<f64> = (-steps..=steps).map(|i| middle + f64::from(i) * step).collect();
            let gain = |length: &f64| self.gain(costs, &asked, contexts, &(Rigid::shift(direction * *length) * *turn));
            let gains: Vec<f64> = lengths.par_iter().map(gain).collect();
            (lengths, gains)
        };
        let mut out = Vec::new();
        let alone = self.directions(now, 0).into_iter().map(|direction| (Rigid::IDENTITY, direction));
        let turns = now.motions.iter().filter(|m| !is_slide(m)).map(|m| (*m, m.screw().axis));
        for (turn, direction) in alone.chain(turns) {
            let (lengths, gains) = scan(&turn, direction, 0.0, step, (LONGEST / STEP) as i32);
            for p in peaks(&gains).into_iter().take(settings.tried) {
                let (lengths, gains) = scan(&turn, direction, lengths[p], step / FINER, FINER as i32);
                let best = (0..lengths.len()).max_by(|a, b| gains[*a].total_cmp(&gains[*b]));
                out.extend(best.map(|b| Rigid::shift(direction * lengths[b]) * turn));
            }
        }
        out
    }

    /// Motions of connected groups of unhappy surfels of the start onto those of the end.
    pub(super) fn proposed(
        &self,
        costs: &PerState<Vec<f32>>,
        unhappy: &PerState<Vec<usize>>,
        settings: &SearchSettings,
    ) -> Vec<Rigid> {
        /// Groups are connected over this many distances of surfels.
        const REACH: f32 = 2.2;
        /// Ratio of the sizes of groups that may be one body.
        const RATIO: usize = 4;
        let spacing = self.spacing();
        let groups = PerState::from_fn(|s| {
            let mut groups = components(self.clouds[s].cloud, &unhappy[s], REACH * spacing, settings.least_group);
            let weight = |g: &Vec<usize>| g.iter().map(|i| costs[s][*i]).sum::<f32>();
            groups.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
            groups.truncate(settings.groups);
            groups
        });
        let mut pairs = Vec::new();
        for a in &groups[State::START] {
            for b in &groups[State::END] {
                if a.len() <= RATIO * b.len() && b.len() <= RATIO * a.len() {
                    pairs.push([a, b]);
                }
            }
        }
        pairs.par_iter().flat_map_iter(|pair| self.onto(*pair)).collect()
    }

    /// Motions of a group of the start onto one of the end: by the shift of its middle, and by its principal directions.
    fn onto(&self, [a, b]: [&Vec<usize>; 2]) -> Vec<Rigid> {
        const ITERATIONS: usize = 15;
        const MOST: usize = 600;
        /// First reach, fractions of the diagonal.
        const REACH: f64 = 0.05;
        /// Share of the surfels of the smaller group that must match.
        const MATCHED: f64 = 0.4;
        let (start, end) = (self.clouds[State::START].cloud, self.clouds[State::END].cloud);
        let frames = [principal_axes(start, a), principal_axes(end, b)];
        let (from, to) = (start.select(a), end.select(b));
        let middles = [from.middle().as_dvec3(), to.middle().as_dvec3()];
        let mut turns = vec![DMat3::IDENTITY];
        for signs in [DVec3::ONE, DVec3::new(1.0, -1.0, -1.0), DVec3::new(-1.0, 1.0, -1.0), DVec3::new(-1.0, -1.0, 1.0)]
        {
            let turn = basis(frames[1], signs) * basis(frames[0], DVec3::ONE).transpose();
            // Principal directions may form a left-handed frame.
            turns.push(if turn.determinant() < 0.0 { -turn } else { turn });
        }
        let (from, to) = (IndexedCloud::gridded(&from, self.spacing()), IndexedCloud::gridded(&to, self.spacing()));
        let options = RegistrationOptions {
            first_reach: REACH * f64::from(self.diagonal()),
            last_reach: self.spacing().into(),
            iterations: ITERATIONS,
            max_points: MOST,
            either_side: false,
        };
        let fit = |turn: DMat3| {
            let guess = Rigid::from_matrix(turn, middles[1] - turn * middles[0]);
            let found = register(Matching::mutual(&from, &to), guess, None, &options);
            (found.pairs as f64 > MATCHED * a.len().min(b.len()) as f64).then_some(found.motion)
        };
        turns.into_iter().filter_map(fit).collect()
    }
}

/// Principal directions as columns, with signs.
fn basis(axes: [Vec3; 3], signs: DVec3) -> DMat3 {
    let [x, y, z] = axes.map(|a| a.as_dvec3());
    DMat3::from_cols(x * signs.x, y * signs.y, z * signs.z)
}

/// Places of positive local maxima, highest first.
fn peaks(values: &[f64]) -> Vec<usize> {
    let at = |i: Option<usize>| i.and_then(|i| values.get(i)).copied().unwrap_or(f64::NEG_INFINITY);
    let is_peak = |i: &usize| values[*i] > 0.0 && values[*i] >= at(i.checked_sub(1)) && values[*i] > at(Some(i + 1));
    let mut peaks: Vec<usize> = (0..values.len()).filter(is_peak).collect();
    peaks.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    peaks
}

#[cfg(test)]
mod tests {
    use super::peaks;

    #[test]
    fn peaks_are_positive_and_ordered() {
        assert_eq!(peaks(&[1.0, 3.0, 3.0, 0.0, -1.0, -0.5, -2.0, 5.0]), [7, 2]);
        assert!(peaks(&[]).is_empty());
    }
}
