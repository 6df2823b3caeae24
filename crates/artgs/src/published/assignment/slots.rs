//! Part assignment by slot attention (Locatello et al. 2020) over all Gaussians, without centres.
//!
//! Every Gaussian has features `n = LN(MLP(hash(x), x))`. Slots, one per part, begin at learnt queries, since part `k`
//! must stay part `k` from step to step (Jia et al. 2023), and attend to the Gaussians a few times: shares
//! `a_ik = softmax_k(n_i . u_k)`, means `m_k = sum_i a_ik n_i / (sum_i a_ik + 1e-8)`, an update of the slot by its mean
//! (see `slot_cell`). The last attention gives `weights = softmax((n_i . u_k + gumbel) / T)`. Positions get no gradient.

use super::AssignConfig;
use super::encoder::{Encoder, Features, Sampler, best, softmax, softmax_backward};
use super::mlp::LANES;
use super::slot_cell::{Layout, Query, Update};
use crate::articulation::adam::{Adam, corrections};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

const LAYER_FLOOR: f32 = 1e-5;
const MASS_FLOOR: f64 = 1e-8;
/// Blocks per task. Fixed, so that sums do not depend on the number of threads.
const BLOCKS: usize = 8;

/// One attention of all slots and what followed; `masses` are sums of shares.
#[derive(Clone, Debug)]
struct Round {
    queries: Vec<Query>,
    masses: Vec<f64>,
    means: Vec<Vec<f64>>,
    updates: Vec<Update>,
}

/// The module with its optimiser and scratch memory; used like [`PartAssignment`](super::PartAssignment).
#[derive(Clone, Debug)]
pub struct SlotAssignment {
    config: AssignConfig,
    layout: Layout,
    /// Of the slots.
    params: Vec<f64>,
    encoder: Encoder,
    adam: Adam,
    steps: u32,
    /// Of the perceptron, then of the slots.
    gradient: Vec<f64>,
    inverse_temperature: f32,
    active_levels: usize,
    /// One over the standard deviation of the features before they were normalised, per block.
    inverse: Vec<[f32; LANES]>,
    rounds: Vec<Round>,
    last: Vec<Query>,
}

impl SlotAssignment {
    /// For `parts` parts, the static one included; `bounds` are the least and the greatest coordinates of the object.
    pub fn new(config: AssignConfig, parts: usize, bounds: [[f32; 3]; 2], rng: &mut Pcg64Mcg) -> Self {
        let encoder = Encoder::new(&config, config.slots.width, parts, bounds, rng);
        let layout = Layout::new(parts, config.slots.width);
        let params = layout.initial(rng);
        let len = encoder.mlp.params().len() + params.len();
        Self {
            config,
            layout,
            params,
            encoder,
            adam: Adam::new(len),
            steps: 0,
            gradient: vec![0.0; len],
            inverse_temperature: 1.0,
            active_levels: 0,
            inverse: Vec::new(),
            rounds: Vec::new(),
            last: Vec::new(),
        }
    }

    /// Number of parts, the static one included.
    pub fn parts(&self) -> usize {
        self.layout.parts
    }

    /// Settings.
    pub fn config(&self) -> &AssignConfig {
        &self.config
    }

    fn queries(&self, slots: &[Vec<f64>]) -> Vec<Query> {
        slots.iter().map(|slot| self.layout.query(&self.params, slot)).collect()
    }

    /// Lets the slots attend to normalised features; gives every round and the queries of the last attention.
    fn attend(&self, blocks: &[Features]) -> (Vec<Round>, Vec<Query>) {
        let Layout { width, ref first, .. } = self.layout;
        let mut slots: Vec<Vec<f64>> = self.params[first.clone()].chunks_exact(width).map(<[f64]>::to_vec).collect();
        let mut rounds = Vec::new();
        for _ in 0..self.config.slots.iterations {
            let queries = self.queries(&slots);
            let (masses, sums) = gathered(blocks, &directions(&queries), width);
            let mean = |(sum, mass): (&[f64], &f64)| sum.iter().map(|s| s / (mass + MASS_FLOOR)).collect();
            let means: Vec<Vec<f64>> = sums.chunks_exact(width).zip(&masses).map(mean).collect();
            let pairs = slots.iter().zip(&means);
            let updates: Vec<Update> = pairs.map(|(s, m)| self.layout.update(&self.params, s, m)).collect();
            slots = updates.iter().map(|u| u.slot.clone()).collect();
            rounds.push(Round { queries, masses, means, updates });
        }
        (rounds, self.queries(&slots))
    }

    /// Training weights `[n][K]` at an optimisation step; noise comes from `rng`. Remembers what `backward` needs.
    pub fn forward(&mut self, means: &[[f32; 3]], step: usize, rng: &mut Pcg64Mcg, weights: &mut [f32]) {
        let parts = self.parts();
        assert_eq!(weights.len(), means.len() * parts, "one weight per Gaussian and part");
        self.active_levels = self.config.active_levels(step);
        let sampler = Sampler::new(&self.config, parts, step, rng);
        self.inverse_temperature = sampler.inverse_temperature;
        self.encoder.forward(means);
        self.inverse.resize(self.encoder.blocks.len(), [0.0; LANES]);
        let blocks = self.encoder.blocks.par_iter_mut().zip(&mut self.inverse);
        blocks.for_each(|(block, inverse)| normalise(&mut block.out, inverse));
        (self.rounds, self.last) = self.attend(&self.encoder.blocks);
        let u = directions(&self.last);
        let tasks = self.encoder.blocks.par_iter_mut().zip(weights.par_chunks_mut(LANES * parts));
        tasks.enumerate().for_each(|(index, (block, weights))| {
            logits(&block.out, &u, &mut block.soft);
            sampler.draw(index, block.lanes, &mut block.soft, weights);
        });
    }

    /// Adds the gradients of the last `forward` from those by its weights, `[n][K]`.
    pub fn backward(&mut self, d_weights: &[f32]) {
        let (parts, width) = (self.parts(), self.layout.width);
        let split = self.encoder.mlp.params().len();
        let factor = self.inverse_temperature;
        let (layout, params) = (&self.layout, &self.params);
        let (d_mlp, d_params) = self.gradient.split_at_mut(split);

        let u = directions(&self.last);
        let tasks = self.encoder.blocks.par_chunks_mut(BLOCKS).zip(d_weights.par_chunks(BLOCKS * LANES * parts));
        let d_u = summed(tasks.map(|(blocks, d_weights)| {
            let (mut d_u, mut d_logits) = (vec![0.0; parts * width], vec![0.0; parts * LANES]);
            for (block, d) in blocks.iter_mut().zip(d_weights.chunks(LANES * parts)) {
                softmax_backward(&block.soft, d, factor, &mut d_logits);
                block.d_out.fill(0.0);
                logits_backward(block, &u, &d_logits, &mut d_u);
            }
            d_u
        }));
        let vjp = |(query, d_u): (&Query, &[f64])| layout.query_vjp(params, query, d_u, d_params);
        let mut d_slots: Vec<Vec<f64>> = self.last.iter().zip(d_u.chunks_exact(width)).map(vjp).collect();

        for round in self.rounds.iter().rev() {
            let vjp = |(update, d): (&Update, &Vec<f64>)| layout.update_vjp(params, update, d, d_params);
            let (d_old, d_means): (Vec<_>, Vec<_>) =
                round.updates.iter().zip(&d_slots).map(vjp).map(|[old, mean]| (old, mean)).unzip();
            let u = directions(&round.queries);
            let d_u = summed(self.encoder.blocks.par_chunks_mut(BLOCKS).map(|blocks| {
                let mut d_u = vec![0.0; parts * width];
                blocks.iter_mut().for_each(|block| gathered_backward(block, &u, round, &d_means, &mut d_u));
                d_u
            }));
            d_slots = d_old;
            for ((query, d_u), d_slot) in round.queries.iter().zip(d_u.chunks_exact(width)).zip(&mut d_slots) {
                let through = layout.query_vjp(params, query, d_u, d_params);
                d_slot.iter_mut().zip(through).for_each(|(d, t)| *d += t);
            }
        }
        let d_first = d_params[layout.first.clone()].iter_mut();
        d_first.zip(d_slots.iter().flatten()).for_each(|(total, d)| *total += d);

        let blocks = self.encoder.blocks.par_iter_mut().zip(&self.inverse);
        blocks.for_each(|(block, inverse)| normalise_backward(block, inverse));
        self.encoder.backward(self.active_levels, d_mlp);
    }

    /// One Adam step on everything with the gradients added up since the last, which are then zero.
    pub fn step(&mut self, learning_rate: f64) {
        self.steps += 1;
        let correction = corrections(self.steps);
        let split = self.encoder.mlp.params().len();
        let mut by = |i: usize| learning_rate * self.adam.update(i, self.gradient[i], correction);
        self.encoder.mlp.params_mut().iter_mut().enumerate().for_each(|(i, value)| *value -= by(i) as f32);
        self.params.iter_mut().enumerate().for_each(|(i, value)| *value -= by(split + i));
        self.gradient.fill(0.0);
        self.encoder.grid.adam_step(learning_rate as f32);
    }

    /// Most probable part of every position, without noise; the slots attend to these positions.
    pub fn labels(&self, means: &[[f32; 3]]) -> Vec<u16> {
        let mut blocks = self.encoder.features(means);
        blocks.par_iter_mut().for_each(|block| normalise(&mut block.out, &mut [0.0; LANES]));
        let u = directions(&self.attend(&blocks).1);
        let of_block = |block: &mut Features| {
            logits(&block.out, &u, &mut block.soft);
            (0..block.lanes).map(|lane| best(&block.soft, lane) as u16).collect::<Vec<_>>()
        };
        blocks.iter_mut().flat_map(of_block).collect()
    }
}

/// Queries as the Gaussians see them, `[K][D]`.
fn directions(queries: &[Query]) -> Vec<f32> {
    queries.iter().flat_map(|q| q.u.iter().map(|&v| v as f32)).collect()
}

/// Sum of vectors in their order.
fn summed(parts: impl IndexedParallelIterator<Item = Vec<f64>>) -> Vec<f64> {
    let parts: Vec<Vec<f64>> = parts.collect();
    let mut total = vec![0.0; parts.first().map_or(0, Vec::len)];
    parts.iter().flat_map(|p| p.iter().enumerate()).for_each(|(i, v)| total[i] += v);
    total
}

/// Rows of one point each to mean 0 and variance 1 over the rows.
fn normalise(rows: &mut [f32], inverse: &mut [f32; LANES]) {
    let width = (rows.len() / LANES) as f32;
    let (mut mean, mut square) = ([0.0f32; LANES], [0.0f32; LANES]);
    for row in rows.chunks_exact(LANES) {
        (0..LANES).for_each(|l| mean[l] += row[l] / width);
    }
    for row in rows.chunks_exact(LANES) {
        (0..LANES).for_each(|l| square[l] += (row[l] - mean[l]).powi(2) / width);
    }
    (0..LANES).for_each(|l| inverse[l] = 1.0 / (square[l] + LAYER_FLOOR).sqrt());
    for row in rows.chunks_exact_mut(LANES) {
        (0..LANES).for_each(|l| row[l] = (row[l] - mean[l]) * inverse[l]);
    }
}

/// Turns the gradient by normalised features into that by the perceptron's output.
fn normalise_backward(block: &mut Features, inverse: &[f32; LANES]) {
    let width = (block.out.len() / LANES) as f32;
    let (mut mean, mut along) = ([0.0f32; LANES], [0.0f32; LANES]);
    for (d, y) in block.d_out.chunks_exact(LANES).zip(block.out.chunks_exact(LANES)) {
        for l in 0..LANES {
            mean[l] += d[l] / width;
            along[l] += d[l] * y[l] / width;
        }
    }
    for (d, y) in block.d_out.chunks_exact_mut(LANES).zip(block.out.chunks_exact(LANES)) {
        (0..LANES).for_each(|l| d[l] = inverse[l] * (d[l] - mean[l] - y[l] * along[l]));
    }
}

/// `out[k] = sum_d u[k][d] n[d]` for every lane.
fn logits(n: &[f32], u: &[f32], out: &mut [f32]) {
    let width = n.len() / LANES;
    for (row, u) in out.chunks_exact_mut(LANES).zip(u.chunks_exact(width)) {
        row.fill(0.0);
        for (n, u) in n.chunks_exact(LANES).zip(u) {
            row.iter_mut().zip(n).for_each(|(l, n)| *l += u * n);
        }
    }
}

/// Adds to the block's gradient by features and to `d_u`.
fn logits_backward(block: &mut Features, u: &[f32], d_logits: &[f32], d_u: &mut [f64]) {
    let width = block.out.len() / LANES;
    for (k, d_row) in d_logits.chunks_exact(LANES).enumerate() {
        for i in 0..width {
            let (n, d_n) = (&block.out[i * LANES..(i + 1) * LANES], &mut block.d_out[i * LANES..(i + 1) * LANES]);
            let u = u[k * width + i];
            d_n.iter_mut().zip(d_row).for_each(|(d_n, d)| *d_n += u * d);
            d_u[k * width + i] += f64::from(lane_dot(n, d_row));
        }
    }
}

/// Sum of products over the lanes, eight sums side by side.
fn lane_dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        (0..8).for_each(|j| sums[j] += a[j] * b[j]);
    }
    sums.iter().sum()
}

/// Masses `[K]` and sums of features `[K][D]` under the shares of one attention.
fn gathered(blocks: &[Features], u: &[f32], width: usize) -> (Vec<f64>, Vec<f64>) {
    let parts = u.len() / width;
    let mut totals = summed(blocks.par_chunks(BLOCKS).map(|blocks| {
        let (mut sums, mut shares) = (vec![0.0; parts * (width + 1)], vec![0.0; parts * LANES]);
        for block in blocks {
            logits(&block.out, u, &mut shares);
            softmax(&mut shares, block.lanes, 1.0);
            for (k, share) in shares.chunks_exact(LANES).enumerate() {
                sums[k] += f64::from(share.iter().sum::<f32>());
                for (i, n) in block.out.chunks_exact(LANES).enumerate() {
                    sums[parts + k * width + i] += f64::from(lane_dot(share, n));
                }
            }
        }
        sums
    }));
    totals.resize(parts * (width + 1), 0.0);
    let sums = totals.split_off(parts);
    (totals, sums)
}

/// Adjoint of [`gathered`] and the division by the masses: adds to the block's gradient by features and to `d_u`.
fn gathered_backward(block: &mut Features, u: &[f32], round: &Round, d_means: &[Vec<f64>], d_u: &mut [f64]) {
    let parts = d_means.len();
    let mut shares = vec![0.0; parts * LANES];
    logits(&block.out, u, &mut shares);
    softmax(&mut shares, block.lanes, 1.0);
    let mut d_logits = vec![0.0; parts * LANES];
    let mut mean = [0.0f32; LANES];
    for k in 0..parts {
        let scale = 1.0 / (round.masses[k] + MASS_FLOOR);
        let (share, d_share) = (&shares[k * LANES..][..LANES], &mut d_logits[k * LANES..][..LANES]);
        let offset = d_means[k].iter().zip(&round.means[k]).map(|(d, m)| d * m).sum::<f64>() * scale;
        d_share.fill(-offset as f32);
        for (i, d_mean) in d_means[k].iter().enumerate() {
            let d = (d_mean * scale) as f32;
            let (n, d_n) = (&block.out[i * LANES..][..LANES], &mut block.d_out[i * LANES..][..LANES]);
            for l in 0..LANES {
                d_share[l] += d * n[l];
                d_n[l] += d * share[l];
            }
        }
        (0..LANES).for_each(|l| mean[l] += share[l] * d_share[l]);
    }
    for (share, d) in shares.chunks_exact(LANES).zip(d_logits.chunks_exact_mut(LANES)) {
        (0..LANES).for_each(|l| d[l] = share[l] * (d[l] - mean[l]));
    }
    logits_backward(block, u, &d_logits, d_u);
}

#[cfg(test)]
#[path = "slots_tests.rs"]
mod tests;
