//! Chooses, among candidate motions, the set of a given size that together explains both states best.

use super::Scene;
use super::label::{LabelCosts, Pair};
use super::propose::Proposal;
use super::register::Searchable;
use artgs_core::Rigid;
use rayon::prelude::*;

/// Costs of a sample of points of both states under rest and every candidate.
struct Table {
    columns: usize,
    /// `[n * columns]`, column 0 is rest.
    costs: Vec<f32>,
    weights: Vec<f32>,
}

/// Indices of the best `count` candidates. The energy is the sum over sampled points of the cheapest explanation. Sets
/// are grown greedily, some beyond `count` and from several first candidates, cut back, and improved by exchanges of one
/// for one; the best of them is taken. A single greedy set with exchanges gets stuck where two wrong motions share what
/// two right ones explain.
pub fn select(
    scene: &Scene,
    search: &[Searchable<'_>; 2],
    moved: &[Vec<usize>; 2],
    pool: &[Proposal],
    count: usize,
) -> Vec<usize> {
    const FIRSTS: usize = 6;
    if pool.len() <= count {
        return (0..pool.len()).collect();
    }
    let table = tabulate(scene, search, moved, pool);
    let firsts = std::iter::once(None).chain((0..FIRSTS.min(pool.len())).map(Some));
    let starts: Vec<(Option<usize>, usize)> = firsts.flat_map(|first| [0, 2, 4].map(|extra| (first, extra))).collect();
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

    /// Energy where `cheapest` is joined by one more candidate.
    fn with(&self, cheapest: &[f32], candidate: usize) -> f64 {
        let rows = self.costs.chunks(self.columns).zip(&self.weights).zip(cheapest);
        rows.map(|((row, weight), least)| f64::from(row[candidate + 1].min(*least) * weight)).sum()
    }

    fn energy(&self, chosen: &[usize]) -> f64 {
        let cheapest = self.cheapest(chosen.iter().copied());
        cheapest.iter().zip(&self.weights).map(|(least, weight)| f64::from(least * weight)).sum()
    }

    /// The candidate that joins best, with the energy then.
    fn best_addition(&self, cheapest: &[f32], chosen: &[usize]) -> Option<(f64, usize)> {
        let open = (0..self.columns - 1).filter(|c| !chosen.contains(c));
        open.map(|c| (self.with(cheapest, c), c)).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Adds the best candidates one by one.
    fn grow(&self, chosen: &mut Vec<usize>, count: usize) {
        while chosen.len() < count {
            let Some((_, c)) = self.best_addition(&self.cheapest(chosen.iter().copied()), chosen) else { break };
            chosen.push(c);
        }
    }

    /// Drops those that are missed least, one by one.
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

fn tabulate(scene: &Scene, search: &[Searchable<'_>; 2], moved: &[Vec<usize>; 2], pool: &[Proposal]) -> Table {
    // Points that show no sign of motion matter less: a chance match of a wall must not buy a part.
    const IDLE_WEIGHT: f32 = 0.5;
    const IDLE_COST: f32 = 0.05;
    const SAMPLE: usize = 5000;
    // What is hidden inside in one state says little against a motion: a twin of the part would show it everything.
    let costs = LabelCosts { hidden_static: 0.25, hidden_moved: 0.1, mismatch: 0.5, ..LabelCosts::default() };
    let mut table = Table { columns: pool.len() + 1, costs: Vec::new(), weights: Vec::new() };
    for s in 0..2 {
        let cloud = search[s].cloud;
        let mut is_moved = vec![false; cloud.len()];
        moved[s].iter().for_each(|&i| is_moved[i] = true);
        let idle: Vec<usize> = (0..cloud.len()).filter(|&i| !is_moved[i]).collect();
        let to_other: Vec<Rigid> = std::iter::once(Rigid::IDENTITY)
            .chain(pool.iter().map(|p| if s == 0 { p.motion } else { p.motion.inverse() }))
            .collect();
        for (members, weight, extra) in [(&moved[s], 1.0, 0.0), (&idle, IDLE_WEIGHT, IDLE_COST)] {
            let stride = members.len().div_ceil(SAMPLE).max(1);
            let picked: Vec<usize> = members.iter().copied().step_by(stride).collect();
            let own = cloud.select(&picked);
            let own = Searchable::new(&own);
            let pair = Pair { own: &own, ..scene.pair(search, s) };
            let mut rows = pair.plain_costs(&to_other, &costs);
            for row in rows.chunks_mut(table.columns) {
                for (cost, proposal) in row[1..].iter_mut().zip(pool) {
                    *cost += extra + proposal.effort;
                }
            }
            table.costs.extend(rows);
            table.weights.extend(vec![weight * stride as f32; picked.len()]);
        }
    }
    table
}
