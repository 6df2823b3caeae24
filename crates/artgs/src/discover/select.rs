//! Chooses, among candidate motions, the set of a given size that together explains both states best.

use super::Scene;
use super::label::{LabelCosts, Pair};
use super::propose::Proposal;
use super::register::Searchable;
use artgs_core::Rigid;

/// Costs of a sample of points of both states under rest and every candidate.
struct Table {
    columns: usize,
    /// `[n * columns]`, column 0 is rest.
    costs: Vec<f32>,
    weights: Vec<f32>,
}

/// Indices of the best `count` candidates. The energy is the sum over sampled points of the cheapest explanation;
/// candidates are added greedily, then exchanged one for one while that lowers the energy.
pub fn select(
    scene: &Scene,
    search: &[Searchable<'_>; 2],
    moved: &[Vec<usize>; 2],
    pool: &[Proposal],
    count: usize,
) -> Vec<usize> {
    if pool.len() <= count {
        return (0..pool.len()).collect();
    }
    let table = tabulate(scene, search, moved, pool);
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < count {
        let open = (0..pool.len()).filter(|c| !chosen.contains(c));
        let tried = open.map(|c| (energy(&table, &chosen, Some(c)), c));
        let Some((_, c)) = tried.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        chosen.push(c);
    }
    let mut best = energy(&table, &chosen, None);
    loop {
        let mut exchange = None;
        for slot in 0..chosen.len() {
            let rest: Vec<usize> = chosen.iter().enumerate().filter(|(i, _)| *i != slot).map(|(_, c)| *c).collect();
            for c in (0..pool.len()).filter(|c| !chosen.contains(c)) {
                let e = energy(&table, &rest, Some(c));
                if e < best * (1.0 - 1e-6) {
                    best = e;
                    exchange = Some((slot, c));
                }
            }
        }
        let Some((slot, c)) = exchange else { break };
        chosen[slot] = c;
    }
    chosen
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

fn energy(table: &Table, chosen: &[usize], extra: Option<usize>) -> f64 {
    let rows = table.costs.chunks(table.columns).zip(&table.weights);
    rows.map(|(row, weight)| {
        let least = chosen.iter().chain(&extra).map(|c| row[c + 1]).fold(row[0], f32::min);
        f64::from(least * weight)
    })
    .sum()
}
