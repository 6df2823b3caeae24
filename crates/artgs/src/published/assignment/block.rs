//! The arithmetic of part assignment on one block of points, forward and backward.

use super::hash_grid::{FEATURES, HashGrid};
use super::mlp::{LANES, Mlp, Transposed};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A part's local frame: `X = R (x - centre) * inverse_scale`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) centre: [f32; 3],
    pub(super) rows: [[f32; 3]; 3],
    pub(super) inverse_scale: [f32; 3],
}

/// Everything a block needs from the module.
pub(super) struct Model<'a> {
    pub(super) frames: &'a [Frame],
    pub(super) grid: &'a HashGrid,
    pub(super) mlp: &'a Mlp,
    pub(super) shift_weight: f32,
    pub(super) inverse_temperature: f32,
}

/// What the forward pass keeps of a block; rows of [`LANES`].
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Input of the perceptron: X and |X| of every part, hash features, position. The backward pass puts the
    /// gradients of the hash features over them.
    pub(super) input: Vec<f32>,
    hidden: Vec<f32>,
    /// Rows `(a_k, b_k)` interleaved.
    out: Vec<f32>,
    /// Softmax of the noisy logits, a row per part.
    pub(super) soft: Vec<f32>,
}

/// Sums per part that the backward pass leaves: by the vector before scaling (3), by log-scale (3),
/// and the outer product of the former with `x - centre` (9).
pub(super) const PART_SUMS: usize = 15;

/// Gradients and scratch memory of one task.
#[derive(Clone, Debug)]
pub(super) struct Partial {
    pub(super) mlp: Vec<f32>,
    pub(super) parts: Vec<[f64; PART_SUMS]>,
    d_out: Vec<f32>,
    d_hidden: Vec<f32>,
    d_input: Vec<f32>,
    d_distance: Vec<f32>,
}

impl Block {
    pub(super) fn new(parts: usize, levels: usize, hidden: usize) -> Self {
        let rows = |n: usize| vec![0.0; n * LANES];
        Self {
            input: rows(4 * parts + FEATURES * levels + 3),
            hidden: rows(hidden),
            out: rows(2 * parts),
            soft: rows(parts),
        }
    }

    /// Most probable part of a lane, the first of equals.
    pub(super) fn best(&self, lane: usize) -> usize {
        let parts = self.soft.len() / LANES;
        let score = |k: usize| self.soft[k * LANES + lane];
        (1..parts).fold(0, |best, k| if score(k) > score(best) { k } else { best })
    }
}

impl Partial {
    pub(super) fn new(parts: usize, levels: usize, mlp: &Mlp) -> Self {
        let rows = |n: usize| vec![0.0; n * LANES];
        Self {
            mlp: vec![0.0; mlp.params().len()],
            parts: vec![[0.0; PART_SUMS]; parts],
            d_out: rows(2 * parts),
            d_hidden: rows(mlp.hidden()),
            d_input: rows(4 * parts + FEATURES * levels),
            d_distance: rows(parts),
        }
    }

    pub(super) fn clear(&mut self) {
        self.mlp.fill(0.0);
        self.parts.fill([0.0; PART_SUMS]);
    }
}

/// Gumbel(0, 1) noise of a block, part by part within each lane.
pub(super) fn gumbel(seed: u64, block: usize) -> impl FnMut() -> f32 {
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ (block as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    move || gumbel_of(rng.random())
}

/// Gumbel noise of random bits. 23 of them: with one more, the middle of the last interval would round to 1 and the
/// noise would be infinite.
fn gumbel_of(bits: u32) -> f32 {
    let uniform = ((bits >> 9) as f32 + 0.5) * (1.0 / (1u32 << 23) as f32);
    -(-uniform.ln()).ln()
}

impl Model<'_> {
    fn parts(&self) -> usize {
        self.frames.len()
    }

    /// Rows where hash features start and end.
    fn feature_rows(&self) -> [usize; 2] {
        let start = 4 * self.parts();
        [start, start + FEATURES * self.grid.levels()]
    }

    /// Fills a block from at most [`LANES`] points; `coordinates` are the points as the hash grid sees them. Where the grid has
    /// looked them up for training, `looked_up` is the place of the first among those.
    pub(super) fn forward(
        &self,
        points: &[[f32; 3]],
        coordinates: &[[f32; 3]],
        looked_up: Option<usize>,
        noise: Option<&mut dyn FnMut() -> f32>,
        block: &mut Block,
    ) {
        let [start, end] = self.feature_rows();
        for (k, frame) in self.frames.iter().enumerate() {
            let rows = &mut block.input[4 * k * LANES..4 * (k + 1) * LANES];
            for (lane, x) in points.iter().enumerate() {
                let y: [f32; 3] = std::array::from_fn(|a| x[a] - frame.centre[a]);
                let mut square = 0.0;
                for (a, row) in frame.rows.iter().enumerate() {
                    let local = (row[0] * y[0] + row[1] * y[1] + row[2] * y[2]) * frame.inverse_scale[a];
                    rows[a * LANES + lane] = local;
                    square += local * local;
                }
                rows[3 * LANES + lane] = square.sqrt();
            }
        }
        for level in 0..self.grid.levels() {
            let rows = &mut block.input[(start + FEATURES * level) * LANES..];
            self.grid.encode(level, coordinates, looked_up, rows, LANES);
        }
        for (lane, x) in coordinates.iter().enumerate() {
            (0..3).for_each(|a| block.input[(end + a) * LANES + lane] = x[a]);
        }
        self.mlp.forward(&block.input, &mut block.hidden, &mut block.out);
        self.softmax(points.len(), noise, block);
    }

    fn softmax(&self, lanes: usize, mut noise: Option<&mut dyn FnMut() -> f32>, block: &mut Block) {
        let parts = self.parts();
        for lane in 0..lanes {
            let mut highest = f32::NEG_INFINITY;
            for k in 0..parts {
                let norm = block.input[(4 * k + 3) * LANES + lane];
                let (a, b) = (block.out[2 * k * LANES + lane], block.out[(2 * k + 1) * LANES + lane]);
                let logit = -norm * norm * (self.shift_weight * a).exp() + self.shift_weight * b;
                let noisy = logit + noise.as_mut().map_or(0.0, |draw| draw());
                let scaled = noisy * self.inverse_temperature;
                highest = highest.max(scaled);
                block.soft[k * LANES + lane] = scaled;
            }
            let mut sum = 0.0;
            for k in 0..parts {
                let value = (block.soft[k * LANES + lane] - highest).exp();
                sum += value;
                block.soft[k * LANES + lane] = value;
            }
            (0..parts).for_each(|k| block.soft[k * LANES + lane] /= sum);
        }
    }

    /// Adds a block's gradients to `partial`; `d_weights` is `[points][parts]`. The softmax is differentiated also
    /// where the forward pass handed out its hard maximum.
    pub(super) fn backward(
        &self,
        transposed: &Transposed,
        points: &[[f32; 3]],
        d_weights: &[f32],
        block: &mut Block,
        partial: &mut Partial,
    ) {
        self.softmax_backward(points.len(), d_weights, block, partial);
        let [start, end] = self.feature_rows();
        let Partial { mlp, d_out, d_hidden, d_input, .. } = partial;
        self.mlp.backward(transposed, (&block.input, &block.hidden), d_out, d_hidden, d_input, mlp);
        block.input[start * LANES..end * LANES].copy_from_slice(&d_input[start * LANES..]);
        for k in 0..self.parts() {
            self.frame_backward(k, points, block, partial);
        }
    }

    fn softmax_backward(&self, lanes: usize, d_weights: &[f32], block: &Block, partial: &mut Partial) {
        let (parts, shift) = (self.parts(), self.shift_weight);
        if lanes < LANES {
            partial.d_out.fill(0.0);
            partial.d_distance.fill(0.0);
        }
        for (lane, d) in d_weights.chunks_exact(parts).enumerate() {
            let mean: f32 = (0..parts).map(|k| block.soft[k * LANES + lane] * d[k]).sum();
            for k in 0..parts {
                let d_logit = block.soft[k * LANES + lane] * (d[k] - mean) * self.inverse_temperature;
                let norm = block.input[(4 * k + 3) * LANES + lane];
                let stretch = (shift * block.out[2 * k * LANES + lane]).exp();
                partial.d_distance[k * LANES + lane] = -stretch * d_logit;
                partial.d_out[2 * k * LANES + lane] = -shift * norm * norm * stretch * d_logit;
                partial.d_out[(2 * k + 1) * LANES + lane] = shift * d_logit;
            }
        }
    }

    fn frame_backward(&self, k: usize, points: &[[f32; 3]], block: &Block, partial: &mut Partial) {
        let frame = &self.frames[k];
        let at = |rows: &[f32], row: usize, lane: usize| rows[(4 * k + row) * LANES + lane];
        let mut sums = [0.0f32; PART_SUMS];
        for (lane, x) in points.iter().enumerate() {
            let norm = at(&block.input, 3, lane);
            let through_norm = if norm > 0.0 { at(&partial.d_input, 3, lane) / norm } else { 0.0 };
            let radial = 2.0 * partial.d_distance[k * LANES + lane] + through_norm;
            let y: [f32; 3] = std::array::from_fn(|a| x[a] - frame.centre[a]);
            for a in 0..3 {
                let local = at(&block.input, a, lane);
                let d_local = at(&partial.d_input, a, lane) + local * radial;
                let d_turned = d_local * frame.inverse_scale[a];
                sums[a] += d_turned;
                sums[3 + a] -= local * d_local;
                (0..3).for_each(|b| sums[6 + 3 * a + b] += d_turned * y[b]);
            }
        }
        partial.parts[k].iter_mut().zip(sums).for_each(|(total, sum)| *total += f64::from(sum));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_finite_at_both_ends() {
        let (low, high) = (gumbel_of(0), gumbel_of(u32::MAX));
        assert!((-3.0..-2.7).contains(&low) && (16.0..18.0).contains(&high), "{low} {high}");
    }
}
