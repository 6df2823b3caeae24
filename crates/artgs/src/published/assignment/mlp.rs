//! A perceptron with one hidden layer, on blocks of [`LANES`] points stored channel by channel.

use artgs_raster::simd::{Level, level};
use fearless_simd::{Simd, dispatch, f32x8, prelude::*};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// Points per block.
pub const LANES: usize = 128;
const WIDTH: usize = 8;

/// `out = W2 relu(W1 x + b1) + b2`.
#[derive(Clone, Debug)]
pub struct Mlp {
    inputs: usize,
    hidden: usize,
    outputs: usize,
    /// W1 `[hidden][inputs]`, b1, W2 `[outputs][hidden]`, b2.
    params: Vec<f32>,
    level: Level,
}

/// The weights once more, transposed, for the backward pass. Make a fresh one after every step.
#[derive(Clone, Debug)]
pub struct Transposed {
    first: Vec<f32>,
    second: Vec<f32>,
}

impl Mlp {
    /// Weights and biases uniform within one over the root of the layer's inputs.
    pub fn new(inputs: usize, hidden: usize, outputs: usize, rng: &mut Pcg64Mcg) -> Self {
        let mut params = Vec::with_capacity(hidden * (inputs + 1) + outputs * (hidden + 1));
        for (count, fan_in) in [(hidden * (inputs + 1), inputs), (outputs * (hidden + 1), hidden)] {
            let bound = 1.0 / (fan_in as f32).sqrt();
            params.extend((0..count).map(|_| bound * (2.0 * rng.random::<f32>() - 1.0)));
        }
        Self { inputs, hidden, outputs, params, level: level() }
    }

    /// Parameters, in the order W1 `[hidden][inputs]`, b1, W2 `[outputs][hidden]`, b2.
    pub fn params(&self) -> &[f32] {
        &self.params
    }

    /// For the optimiser.
    pub fn params_mut(&mut self) -> &mut [f32] {
        &mut self.params
    }

    /// Width of the hidden layer.
    pub fn hidden(&self) -> usize {
        self.hidden
    }

    /// Where b1, W2 and b2 start.
    fn offsets(&self) -> [usize; 3] {
        let b1 = self.hidden * self.inputs;
        [b1, b1 + self.hidden, b1 + self.hidden + self.outputs * self.hidden]
    }

    /// See [`Transposed`].
    pub fn transposed(&self) -> Transposed {
        let turn = |w: &[f32], rows: usize, columns: usize| -> Vec<f32> {
            (0..rows * columns).map(|i| w[(i % rows) * columns + i / rows]).collect()
        };
        let w2 = self.offsets()[1];
        Transposed {
            first: turn(&self.params, self.hidden, self.inputs),
            second: turn(&self.params[w2..], self.outputs, self.hidden),
        }
    }

    /// One block: `x` is `[inputs][LANES]`; writes the hidden layer after ReLU, `[hidden][LANES]`,
    /// and the output, `[outputs][LANES]`.
    pub fn forward(&self, x: &[f32], hidden: &mut [f32], out: &mut [f32]) {
        let [b1, w2, b2] = self.offsets();
        let p = &self.params;
        dispatch!(self.level, s => s.vectorize(#[inline(always)] || {
            linear(s, x, self.inputs, p, Some(&p[b1..w2]), hidden);
            relu(s, hidden);
            linear(s, hidden, self.hidden, &p[w2..b2], Some(&p[b2..]), out);
        }));
    }

    /// One block backward: adds to `gradient` (as long as the parameters), overwrites `d_hidden` and the first rows of
    /// the input's gradient `d_x`, as many as it has room for. `x` and `hidden` are those of the forward pass.
    pub fn backward(
        &self,
        transposed: &Transposed,
        (x, hidden): (&[f32], &[f32]),
        d_out: &[f32],
        d_hidden: &mut [f32],
        d_x: &mut [f32],
        gradient: &mut [f32],
    ) {
        let [b1, w2, b2] = self.offsets();
        dispatch!(self.level, s => s.vectorize(#[inline(always)] || {
            products(s, d_out, hidden, self.hidden, &mut gradient[w2..b2]);
            sums(s, d_out, &mut gradient[b2..]);
            linear(s, d_out, self.outputs, &transposed.second, None, d_hidden);
            mask(s, d_hidden, hidden);
            products(s, d_hidden, x, self.inputs, &mut gradient[..b1]);
            sums(s, d_hidden, &mut gradient[b1..w2]);
            linear(s, d_hidden, self.hidden, &transposed.first, None, d_x);
        }));
    }
}

// No closures in the functions below: the compiler would call them outside the vectorised context.

type V<S> = f32x8<S>;

#[inline(always)]
fn load<S: Simd>(s: S, row: &[f32], at: usize) -> V<S> {
    f32x8::from_slice(s, &row[at..at + WIDTH])
}

/// `out[j] = bias[j] + sum_i w[j][i] x[i]` for as many rows as `out` has.
#[inline(always)]
fn linear<S: Simd>(s: S, x: &[f32], inputs: usize, w: &[f32], bias: Option<&[f32]>, out: &mut [f32]) {
    let rows = out.len() / LANES;
    let fours = rows / 4 * 4;
    for j in (0..fours).step_by(4) {
        linear_rows::<S, 4>(s, x, inputs, &w[j * inputs..], bias.map(|b| &b[j..]), &mut out[j * LANES..]);
    }
    for j in fours..rows {
        linear_rows::<S, 1>(s, x, inputs, &w[j * inputs..], bias.map(|b| &b[j..]), &mut out[j * LANES..]);
    }
}

#[inline(always)]
fn linear_rows<S: Simd, const J: usize>(
    s: S,
    x: &[f32],
    inputs: usize,
    w: &[f32],
    bias: Option<&[f32]>,
    out: &mut [f32],
) {
    let w: [&[f32]; J] = std::array::from_fn(|q| &w[q * inputs..(q + 1) * inputs]);
    for lane in (0..LANES).step_by(2 * WIDTH) {
        let mut sum = [[f32x8::splat(s, 0.0); 2]; J];
        if let Some(bias) = bias {
            for q in 0..J {
                sum[q] = [f32x8::splat(s, bias[q]); 2];
            }
        }
        for i in 0..inputs {
            let (a, b) = (load(s, x, i * LANES + lane), load(s, x, i * LANES + lane + WIDTH));
            for q in 0..J {
                let weight = f32x8::splat(s, w[q][i]);
                sum[q] = [a.mul_add(weight, sum[q][0]), b.mul_add(weight, sum[q][1])];
            }
        }
        for q in 0..J {
            for half in 0..2 {
                let at = q * LANES + lane + half * WIDTH;
                sum[q][half].store_slice(&mut out[at..at + WIDTH]);
            }
        }
    }
}

#[inline(always)]
fn relu<S: Simd>(s: S, values: &mut [f32]) {
    for chunk in values.chunks_exact_mut(WIDTH) {
        load(s, chunk, 0).max(f32x8::splat(s, 0.0)).store_slice(chunk);
    }
}

/// Zeroes `values` where `gate` is not positive.
#[inline(always)]
fn mask<S: Simd>(s: S, values: &mut [f32], gate: &[f32]) {
    let zero = f32x8::splat(s, 0.0);
    for (chunk, gate) in values.chunks_exact_mut(WIDTH).zip(gate.chunks_exact(WIDTH)) {
        load(s, gate, 0).simd_gt(zero).select(load(s, chunk, 0), zero).store_slice(chunk);
    }
}

/// `out[j][i] += sum over lanes of d[j] x[i]`.
#[inline(always)]
fn products<S: Simd>(s: S, d: &[f32], x: &[f32], inputs: usize, out: &mut [f32]) {
    let rows = d.len() / LANES;
    for j in (0..rows).step_by(2) {
        for i in (0..inputs).step_by(4) {
            match (rows - j >= 2, inputs - i >= 4) {
                (true, true) => product_tile::<S, 2, 4>(s, d, x, inputs, j, i, out),
                (true, false) => {
                    for i in i..inputs {
                        product_tile::<S, 2, 1>(s, d, x, inputs, j, i, out);
                    }
                }
                (false, true) => product_tile::<S, 1, 4>(s, d, x, inputs, j, i, out),
                (false, false) => {
                    for i in i..inputs {
                        product_tile::<S, 1, 1>(s, d, x, inputs, j, i, out);
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn product_tile<S: Simd, const J: usize, const I: usize>(
    s: S,
    d: &[f32],
    x: &[f32],
    inputs: usize,
    j: usize,
    i: usize,
    out: &mut [f32],
) {
    let mut sum = [[f32x8::splat(s, 0.0); I]; J];
    for lane in (0..LANES).step_by(WIDTH) {
        let mut right = [f32x8::splat(s, 0.0); I];
        for p in 0..I {
            right[p] = load(s, x, (i + p) * LANES + lane);
        }
        for q in 0..J {
            let left = load(s, d, (j + q) * LANES + lane);
            for p in 0..I {
                sum[q][p] = left.mul_add(right[p], sum[q][p]);
            }
        }
    }
    for q in 0..J {
        for p in 0..I {
            out[(j + q) * inputs + i + p] += sum[q][p].reduce_sum();
        }
    }
}

#[inline(always)]
fn sums<S: Simd>(s: S, d: &[f32], out: &mut [f32]) {
    for (row, out) in d.chunks_exact(LANES).zip(out) {
        let mut sum = f32x8::splat(s, 0.0);
        for lane in (0..LANES).step_by(WIDTH) {
            sum += load(s, row, lane);
        }
        *out += sum.reduce_sum();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The loss `sum g out` in f64, by the definition.
    fn twin(mlp: &Mlp, params: &[f64], x: &[f64], g: &[f32]) -> f64 {
        let [b1, w2, b2] = mlp.offsets();
        let mut loss = 0.0;
        for lane in 0..LANES {
            let hidden: Vec<f64> = (0..mlp.hidden)
                .map(|h| {
                    let row = (0..mlp.inputs).map(|i| params[h * mlp.inputs + i] * x[i * LANES + lane]);
                    (params[b1 + h] + row.sum::<f64>()).max(0.0)
                })
                .collect();
            for o in 0..mlp.outputs {
                let row = (0..mlp.hidden).map(|h| params[w2 + o * mlp.hidden + h] * hidden[h]);
                loss += f64::from(g[o * LANES + lane]) * (params[b2 + o] + row.sum::<f64>());
            }
        }
        loss
    }

    #[test]
    fn value_and_gradients_match_a_scalar_twin() {
        for (inputs, outputs) in [(35, 4), (39, 6), (55, 14), (6, 3)] {
            let mut rng = Pcg64Mcg::new(5);
            let mlp = Mlp::new(inputs, 32, outputs, &mut rng);
            let mut draw = |n: usize| -> Vec<f32> { (0..n).map(|_| rng.random::<f32>() - 0.5).collect() };
            let (x, g) = (draw(inputs * LANES), draw(outputs * LANES));
            let (mut hidden, mut out) = (vec![0.0; 32 * LANES], vec![0.0; outputs * LANES]);
            mlp.forward(&x, &mut hidden, &mut out);
            let mut p: Vec<f64> = mlp.params.iter().map(|&v| v.into()).collect();
            let mut x64: Vec<f64> = x.iter().map(|&v| v.into()).collect();
            let loss: f64 = out.iter().zip(&g).map(|(&a, &b)| f64::from(a) * f64::from(b)).sum();
            assert!((loss - twin(&mlp, &p, &x64, &g)).abs() < 1e-4);

            let kept = inputs - 3;
            let (mut d_hidden, mut d_x) = (vec![9.0; 32 * LANES], vec![9.0; kept * LANES]);
            let mut gradient = vec![0.0; p.len()];
            mlp.backward(&mlp.transposed(), (&x, &hidden), &g, &mut d_hidden, &mut d_x, &mut gradient);
            let check = |a: f32, up: f64, down: f64| {
                let numeric = (up - down) / 2e-6;
                assert!((f64::from(a) - numeric).abs() < 1e-3 * (1.0 + numeric.abs()), "{a} against {numeric}");
            };
            for i in (0..p.len()).step_by(29).chain(p.len() - outputs - 3..p.len()) {
                let at = p[i];
                let mut value = |v: f64| {
                    p[i] = v;
                    twin(&mlp, &p, &x64, &g)
                };
                check(gradient[i], value(at + 1e-6), value(at - 1e-6));
                p[i] = at;
            }
            for i in (0..kept * LANES).step_by(301) {
                let at = x64[i];
                let mut value = |v: f64| {
                    x64[i] = v;
                    twin(&mlp, &p, &x64, &g)
                };
                check(d_x[i], value(at + 1e-6), value(at - 1e-6));
                x64[i] = at;
            }
        }
    }
}
