//! Chooses, among candidate motions, the set of a given size that together explains both states best.

use super::candidates::Candidate;
use super::cloud::IndexedCloud;
use super::landing::StatePair;
use super::scene::Scene;
use super::segmentation::LabelCosts;
use artgs_core::{PerState, Rigid, State};
use rayon::prelude::*;

/// Settings of the selection; costs are relative to the cost 1 of a point in empty space. Calibrated on the stand-ins of
/// the paper's objects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SelectionSettings {
    /// First candidates from which sets are grown, beside the best one.
    pub(crate) firsts: usize,
    /// Numbers of candidates by which sets are grown beyond the size asked for, then reduced again.
    pub(crate) extras: [usize; 3],
    /// Points of each state that are compared, moved ones and others each.
    pub(crate) sample: usize,
    /// Weight of points that show no sign of motion: a chance match of a wall must not justify a part.
    pub(crate) static_weight: f32,
    /// Cost of explaining such a point by a motion.
    pub(crate) static_cost: f32,
    /// Costs of landings. What is hidden in one state is weak evidence against a motion: one to a part that looks the same
    /// would show all of it.
    pub(crate) costs: LabelCosts,
}

impl Default for SelectionSettings {
    fn default() -> Self {
        Self {
            firsts: 6,
            extras: [0, 2, 4],
            sample: 2500,
            static_weight: 0.5,
            static_cost: 0.05,
            costs: LabelCosts { hidden_static: 0.25, hidden_moved: 0.1, mismatch: 0.5, ..LabelCosts::default() },
        }
    }
}

/// Costs of a sample of points of both states under rest and every candidate.
struct Table {
    columns: usize,
    /// `[n * columns]`, column 0 is rest.
    costs: Vec<f32>,
    weights: Vec<f32>,
}

/// Indices of the best `count` candidates. The energy is the sum over sampled points of the cheapest explanation. Sets
/// are grown greedily, some beyond `count` and from several first candidates, reduced, and improved by exchanges of one
/// for one; the best of them is taken. A single greedy set with exchanges stays at two wrong motions that share what two
/// right ones explain.
pub(super) fn select(
    scene: &Scene,
    clouds: &PerState<IndexedCloud<'_>>,
    moved: &PerState<Vec<usize>>,
    pool: &[Candidate],
    count: usize,
    settings: &SelectionSettings,
) -> Vec<usize> {
    if pool.len() <= count {
        return (0..pool.len()).collect();
    }
    let table = tabulate(scene, clouds, moved, pool, settings);
    let firsts = std::iter::once(None).chain((0..settings.firsts.min(pool.len())).map(Some));
    let starts: Vec<(Option<usize>, usize)> =
        firsts.flat_map(|first| settings.extras.map(|extra| (first, extra))).collect();
    let ends = starts.par_iter().map(|(first, extra)| {
        let mut chosen: Vec<usize> = first.iter().copied().collect();
        table.grow(&mut chosen, count + extra);
        if *extra > 0 {
            table.exchange(&mut chosen);
            table.shrink(&mut chosen, count);
        }
        table.exchange(&mut chosen);
        (table.energy(&chosen), chosen)
    });
    let ends: Vec<(f64, Vec<usize>)> = ends.collect();
    ends.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Vec::new, |best| best.1)
}

impl Table {
    /// Cheapest explanation of every row by rest or a chosen candidate.
    fn cheapest(&self, chosen: impl Iterator<Item = usize> + Clone) -> Vec<f32> {
        let rows = self.costs.chunks(self.columns);
        rows.map(|row| chosen.clone().map(|c| row[c + 1]).fold(row[0], f32::min)).collect()
    }

    /// Energy with `cheapest` and one more candidate.
    fn energy_with(&self, cheapest: &[f32], candidate: usize) -> f64 {
        let rows = self.costs.chunks(self.columns).zip(&self.weights).zip(cheapest);
        rows.map(|((row, weight), least)| f64::from(row[candidate + 1].min(*least) * weight)).sum()
    }

    fn energy(&self, chosen: &[usize]) -> f64 {
        let cheapest = self.cheapest(chosen.iter().copied());
        cheapest.iter().zip(&self.weights).map(|(least, weight)| f64::from(least * weight)).sum()
    }

    /// The candidate that lowers the energy most, with the energy then.
    fn best_addition(&self, cheapest: &[f32], chosen: &[usize]) -> Option<(f64, usize)> {
        let open = (0..self.columns - 1).filter(|c| !chosen.contains(c));
        open.map(|c| (self.energy_with(cheapest, c), c)).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Adds the best candidates one by one.
    fn grow(&self, chosen: &mut Vec<usize>, count: usize) {
        while chosen.len() < count {
            let Some((_, c)) = self.best_addition(&self.cheapest(chosen.iter().copied()), chosen) else { break };
            chosen.push(c);
        }
    }

    /// Removes those that raise the energy least, one by one.
    fn shrink(&self, chosen: &mut Vec<usize>, count: usize) {
        while chosen.len() > count {
            let without = |slot: usize| {
                let rest: Vec<usize> = others(chosen, slot).collect();
                (self.energy(&rest), slot)
            };
            let Some((_, slot)) = (0..chosen.len()).map(without).min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            chosen.remove(slot);
        }
    }

    /// Exchanges one for one while that lowers the energy, the best exchange first.
    fn exchange(&self, chosen: &mut [usize]) {
        let mut best = self.energy(chosen);
        loop {
            let exchanges = (0..chosen.len()).filter_map(|slot| {
                let (e, c) = self.best_addition(&self.cheapest(others(chosen, slot)), chosen)?;
                (e < best * (1.0 - 1e-6)).then_some((e, slot, c))
            });
            let Some((e, slot, c)) = exchanges.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            chosen[slot] = c;
            best = e;
        }
    }
}

/// All but the one at `slot`.
fn others(chosen: &[usize], slot: usize) -> impl Iterator<Item = usize> + Clone {
    chosen.iter().copied().enumerate().filter(move |(i, _)| *i != slot).map(|(_, c)| c)
}

fn tabulate(
    scene: &Scene,
    clouds: &PerState<IndexedCloud<'_>>,
    moved: &PerState<Vec<usize>>,
    pool: &[Candidate],
    settings: &SelectionSettings,
) -> Table {
    let mut table = Table { columns: pool.len() + 1, costs: Vec::new(), weights: Vec::new() };
    for s in State::ALL {
        let cloud = clouds[s].cloud;
        let mut is_moved = vec![false; cloud.len()];
        moved[s].iter().for_each(|&i| is_moved[i] = true);
        let unmoved: Vec<usize> = (0..cloud.len()).filter(|&i| !is_moved[i]).collect();
        let moving = pool.iter().map(|c| c.motion.away_from(s));
        let to_other: Vec<Rigid> = std::iter::once(Rigid::IDENTITY).chain(moving).collect();
        let kinds = [(&moved[s], 1.0, 0.0), (&unmoved, settings.static_weight, settings.static_cost)];
        for (members, weight, extra) in kinds {
            let stride = members.len().div_ceil(settings.sample).max(1);
            let picked: Vec<usize> = members.iter().copied().step_by(stride).collect();
            let own = cloud.select(&picked);
            let own = IndexedCloud::new(&own);
            let pair = StatePair { own: &own, ..scene.pair(clouds, s) };
            let mut rows = pair.plain_costs(&to_other, &settings.costs);
            for row in rows.chunks_mut(table.columns) {
                for (cost, candidate) in row[1..].iter_mut().zip(pool) {
                    *cost += extra + candidate.implausibility;
                }
            }
            table.costs.extend(rows);
            table.weights.extend(vec![weight * stride as f32; picked.len()]);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_right_motions_beat_wrong_ones_that_explain_more_at_first() {
        // Candidates 1 and 2 explain four points each; candidate 0 explains six, but leaves two to nothing cheap.
        let explains = [[0, 1, 2, 4, 5, 6].as_slice(), &[0, 1, 2, 3], &[4, 5, 6, 7]];
        let row = |i: usize| std::iter::once(1.0).chain(explains.map(|e| if e.contains(&i) { 0.0 } else { 1.0 }));
        let table = Table { columns: 4, costs: (0..8).flat_map(row).collect(), weights: vec![1.0; 8] };
        let mut chosen = Vec::new();
        table.grow(&mut chosen, 2);
        assert!(chosen[0] == 0 && table.energy(&chosen) == 1.0);
        table.grow(&mut chosen, 3);
        table.shrink(&mut chosen, 2);
        chosen.sort_unstable();
        assert_eq!((table.energy(&chosen), &chosen[..]), (0.0, &[1, 2][..]));
    }
}
