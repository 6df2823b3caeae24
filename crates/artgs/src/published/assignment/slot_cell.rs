//! One slot of slot attention: the query it asks with and its update, with adjoints. Numbers are f64, slots are few.
//!
//! With `LN` a layer normalisation without gain and bias (the linear maps that follow have their own):
//! `q = Wq LN(s) + bq`, `u = Wk^T q / sqrt(D)`, so that the logit of a Gaussian with normalised features `n` is `n . u`;
//! `v = Wv m + bv` of the mean `m` of the features attended to; `h = GRU(v, s)`; `s' = h + M2 relu(M1 LN(h) + c1) + c2`.

use crate::random::normal;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use std::ops::Range;

const LAYER_FLOOR: f64 = 1e-5;

/// Where the parameters lie in one flat vector; `width` is D.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) parts: usize,
    pub(super) width: usize,
    /// First slots, `[K][D]`.
    pub(super) first: Range<usize>,
    query: Range<usize>,
    query_bias: Range<usize>,
    key: Range<usize>,
    value: Range<usize>,
    value_bias: Range<usize>,
    /// Rows of the reset, the update and the candidate gate.
    input: Range<usize>,
    input_bias: Range<usize>,
    state: Range<usize>,
    state_bias: Range<usize>,
    rise: Range<usize>,
    rise_bias: Range<usize>,
    fall: Range<usize>,
    fall_bias: Range<usize>,
    pub(super) len: usize,
}

impl Layout {
    pub(super) fn new(parts: usize, width: usize) -> Self {
        let (d, mut len) = (width, 0);
        let mut take = |n: usize| {
            len += n;
            len - n..len
        };
        let mut layout = Self {
            parts,
            width,
            first: take(parts * d),
            query: take(d * d),
            query_bias: take(d),
            key: take(d * d),
            value: take(d * d),
            value_bias: take(d),
            input: take(3 * d * d),
            input_bias: take(3 * d),
            state: take(3 * d * d),
            state_bias: take(3 * d),
            rise: take(2 * d * d),
            rise_bias: take(2 * d),
            fall: take(2 * d * d),
            fall_bias: take(d),
            len: 0,
        };
        layout.len = len;
        layout
    }

    /// First slots normal with deviation 1; weights and biases uniform within one over the root of the layer's inputs.
    pub(super) fn initial(&self, rng: &mut Pcg64Mcg) -> Vec<f64> {
        let mut params: Vec<f64> = self.first.clone().map(|_| normal(rng)).collect();
        let bound = 1.0 / (self.width as f64).sqrt();
        params.extend((self.first.end..self.fall.start).map(|_| bound * (2.0 * rng.random::<f64>() - 1.0)));
        let bound = bound / 2f64.sqrt();
        params.extend((self.fall.start..self.len).map(|_| bound * (2.0 * rng.random::<f64>() - 1.0)));
        params
    }
}

/// What the adjoint of a query needs.
#[derive(Clone, Debug)]
pub(super) struct Query {
    normed: Vec<f64>,
    inverse: f64,
    q: Vec<f64>,
    /// Direction in the space of features, `[D]`.
    pub(super) u: Vec<f64>,
}

/// What the adjoint of an update needs.
#[derive(Clone, Debug)]
pub(super) struct Update {
    mean: Vec<f64>,
    old: Vec<f64>,
    value: Vec<f64>,
    reset: Vec<f64>,
    keep: Vec<f64>,
    candidate: Vec<f64>,
    /// State's share of the candidate before the reset.
    memory: Vec<f64>,
    normed: Vec<f64>,
    inverse: f64,
    hidden: Vec<f64>,
    pub(super) slot: Vec<f64>,
}

/// `W x + b`, row-major.
fn affine(w: &[f64], b: &[f64], x: &[f64]) -> Vec<f64> {
    let row = |(w, b): (&[f64], &f64)| b + w.iter().zip(x).map(|(w, x)| w * x).sum::<f64>();
    w.chunks_exact(x.len()).zip(b).map(row).collect()
}

/// Adds `d x^T` to `d_w` and `W^T d` to `d_x`.
fn linear_vjp(w: &[f64], x: &[f64], d: &[f64], d_w: &mut [f64], d_x: &mut [f64]) {
    for ((w, d_w), d) in w.chunks_exact(x.len()).zip(d_w.chunks_exact_mut(x.len())).zip(d) {
        for i in 0..x.len() {
            d_w[i] += d * x[i];
            d_x[i] += d * w[i];
        }
    }
}

fn add(total: &mut [f64], d: &[f64]) {
    total.iter_mut().zip(d).for_each(|(t, d)| *t += d);
}

/// `(x - mean) / sqrt(variance + 1e-5)` and the inverse root.
fn layer_norm(x: &[f64]) -> (Vec<f64>, f64) {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let variance = x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    let inverse = 1.0 / (variance + LAYER_FLOOR).sqrt();
    (x.iter().map(|v| (v - mean) * inverse).collect(), inverse)
}

fn layer_norm_vjp(normed: &[f64], inverse: f64, d: &[f64]) -> Vec<f64> {
    let n = d.len() as f64;
    let mean = d.iter().sum::<f64>() / n;
    let along = d.iter().zip(normed).map(|(d, y)| d * y).sum::<f64>() / n;
    d.iter().zip(normed).map(|(d, y)| inverse * (d - mean - y * along)).collect()
}

fn sigmoid(v: f64) -> f64 {
    1.0 / (1.0 + (-v).exp())
}

impl Layout {
    pub(super) fn query(&self, p: &[f64], slot: &[f64]) -> Query {
        let (normed, inverse) = layer_norm(slot);
        let q = affine(&p[self.query.clone()], &p[self.query_bias.clone()], &normed);
        let scale = 1.0 / (self.width as f64).sqrt();
        let mut u = vec![0.0; self.width];
        for (row, q) in p[self.key.clone()].chunks_exact(self.width).zip(&q) {
            u.iter_mut().zip(row).for_each(|(u, w)| *u += scale * q * w);
        }
        Query { normed, inverse, q, u }
    }

    /// Adds to `gradient`; returns that by the slot.
    pub(super) fn query_vjp(&self, p: &[f64], query: &Query, d_u: &[f64], gradient: &mut [f64]) -> Vec<f64> {
        let scale = 1.0 / (self.width as f64).sqrt();
        let mut d_q = vec![0.0; self.width];
        let key = self.key.clone();
        for (i, d_q) in d_q.iter_mut().enumerate() {
            let row = key.start + i * self.width;
            for j in 0..self.width {
                gradient[row + j] += scale * query.q[i] * d_u[j];
                *d_q += scale * p[row + j] * d_u[j];
            }
        }
        let mut d_normed = vec![0.0; self.width];
        linear_vjp(&p[self.query.clone()], &query.normed, &d_q, &mut gradient[self.query.clone()], &mut d_normed);
        add(&mut gradient[self.query_bias.clone()], &d_q);
        layer_norm_vjp(&query.normed, query.inverse, &d_normed)
    }

    pub(super) fn update(&self, p: &[f64], old: &[f64], mean: &[f64]) -> Update {
        let d = self.width;
        let value = affine(&p[self.value.clone()], &p[self.value_bias.clone()], mean);
        let input = affine(&p[self.input.clone()], &p[self.input_bias.clone()], &value);
        let state = affine(&p[self.state.clone()], &p[self.state_bias.clone()], old);
        let reset: Vec<f64> = (0..d).map(|i| sigmoid(input[i] + state[i])).collect();
        let keep: Vec<f64> = (0..d).map(|i| sigmoid(input[d + i] + state[d + i])).collect();
        let memory = state[2 * d..].to_vec();
        let candidate: Vec<f64> = (0..d).map(|i| (input[2 * d + i] + reset[i] * memory[i]).tanh()).collect();
        let after: Vec<f64> = (0..d).map(|i| (1.0 - keep[i]) * candidate[i] + keep[i] * old[i]).collect();
        let (normed, inverse) = layer_norm(&after);
        let mut hidden = affine(&p[self.rise.clone()], &p[self.rise_bias.clone()], &normed);
        hidden.iter_mut().for_each(|v| *v = v.max(0.0));
        let mut slot = affine(&p[self.fall.clone()], &p[self.fall_bias.clone()], &hidden);
        add(&mut slot, &after);
        let (mean, old) = (mean.to_vec(), old.to_vec());
        Update { mean, old, value, reset, keep, candidate, memory, normed, inverse, hidden, slot }
    }

    /// Adds to `gradient`; returns those by the old slot and by the mean attended to.
    pub(super) fn update_vjp(&self, p: &[f64], at: &Update, d_slot: &[f64], gradient: &mut [f64]) -> [Vec<f64>; 2] {
        let d = self.width;
        let zeros = |n: usize| vec![0.0; n];
        let mut d_hidden = zeros(2 * d);
        linear_vjp(&p[self.fall.clone()], &at.hidden, d_slot, &mut gradient[self.fall.clone()], &mut d_hidden);
        add(&mut gradient[self.fall_bias.clone()], d_slot);
        d_hidden.iter_mut().zip(&at.hidden).filter(|(_, h)| **h <= 0.0).for_each(|(g, _)| *g = 0.0);
        let mut d_normed = zeros(d);
        linear_vjp(&p[self.rise.clone()], &at.normed, &d_hidden, &mut gradient[self.rise.clone()], &mut d_normed);
        add(&mut gradient[self.rise_bias.clone()], &d_hidden);
        let mut d_after = layer_norm_vjp(&at.normed, at.inverse, &d_normed);
        add(&mut d_after, d_slot);

        // Before the gates' functions; the candidate's memory is behind the reset.
        let (mut d_input, mut d_state) = (zeros(3 * d), zeros(3 * d));
        let mut d_old: Vec<f64> = (0..d).map(|i| d_after[i] * at.keep[i]).collect();
        for i in 0..d {
            let d_candidate = d_after[i] * (1.0 - at.keep[i]) * (1.0 - at.candidate[i].powi(2));
            let d_keep = d_after[i] * (at.old[i] - at.candidate[i]) * at.keep[i] * (1.0 - at.keep[i]);
            let d_reset = d_candidate * at.memory[i] * at.reset[i] * (1.0 - at.reset[i]);
            for (gate, g) in [d_reset, d_keep, d_candidate].into_iter().enumerate() {
                d_input[gate * d + i] = g;
                d_state[gate * d + i] = if gate == 2 { g * at.reset[i] } else { g };
            }
        }
        linear_vjp(&p[self.state.clone()], &at.old, &d_state, &mut gradient[self.state.clone()], &mut d_old);
        add(&mut gradient[self.state_bias.clone()], &d_state);
        let mut d_value = zeros(d);
        linear_vjp(&p[self.input.clone()], &at.value, &d_input, &mut gradient[self.input.clone()], &mut d_value);
        add(&mut gradient[self.input_bias.clone()], &d_input);
        let mut d_mean = zeros(d);
        linear_vjp(&p[self.value.clone()], &at.mean, &d_value, &mut gradient[self.value.clone()], &mut d_mean);
        add(&mut gradient[self.value_bias.clone()], &d_value);
        [d_old, d_mean]
    }
}
