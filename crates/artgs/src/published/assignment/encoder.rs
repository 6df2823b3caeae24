//! Hash features and position of points through a perceptron: the input of an assignment that has no part centres.

use super::hash_grid::{FEATURES, HashGrid};
use super::mlp::{LANES, Mlp};
use super::{AssignConfig, block::gumbel};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Blocks per task. Fixed, so that sums do not depend on the number of threads.
const BLOCKS: usize = 8;

/// One block of points; rows of [`LANES`].
#[derive(Clone, Debug)]
pub(super) struct Features {
    /// Hash features, then the position. The backward pass puts the gradients of the former over them.
    input: Vec<f32>,
    hidden: Vec<f32>,
    /// Output of the perceptron.
    pub(super) out: Vec<f32>,
    /// Gradient by the output, to be filled in before the backward pass; zero in lanes without a point.
    pub(super) d_out: Vec<f32>,
    /// Training weights before they are made hard, a row per part.
    pub(super) soft: Vec<f32>,
    /// Number of points in the block.
    pub(super) lanes: usize,
}

#[derive(Clone, Debug)]
struct Partial {
    mlp: Vec<f32>,
    d_hidden: Vec<f32>,
    d_input: Vec<f32>,
}

/// Hash grid, perceptron and the blocks of the last forward pass.
#[derive(Clone, Debug)]
pub(super) struct Encoder {
    pub(super) grid: HashGrid,
    pub(super) mlp: Mlp,
    pub(super) blocks: Vec<Features>,
    outputs: usize,
    parts: usize,
    /// Lower corner and inverse longest side of the object; zero and one for world coordinates.
    normalisation: ([f32; 3], f32),
    coordinates: Vec<[f32; 3]>,
    partials: Vec<Partial>,
}

impl Encoder {
    pub(super) fn new(
        config: &AssignConfig,
        outputs: usize,
        parts: usize,
        bounds: [[f32; 3]; 2],
        rng: &mut Pcg64Mcg,
    ) -> Self {
        let mlp = Mlp::new(FEATURES * config.grid.levels + 3, config.hidden, outputs, rng);
        let grid = HashGrid::new(&config.grid, rng);
        let normalisation = config.normalisation(bounds);
        Self {
            grid,
            mlp,
            blocks: Vec::new(),
            outputs,
            parts,
            normalisation,
            coordinates: Vec::new(),
            partials: Vec::new(),
        }
    }

    /// Where the grid and the perceptron see a position.
    pub(super) fn coordinate(&self, x: [f32; 3]) -> [f32; 3] {
        let (origin, scale) = self.normalisation;
        std::array::from_fn(|a| (x[a] - origin[a]) * scale)
    }

    fn block(&self) -> Features {
        let rows = |n: usize| vec![0.0; n * LANES];
        Features {
            input: rows(FEATURES * self.grid.levels() + 3),
            hidden: rows(self.mlp.hidden()),
            out: rows(self.outputs),
            d_out: rows(self.outputs),
            soft: rows(self.parts),
            lanes: 0,
        }
    }

    /// `looked_up` as in [`HashGrid::encode`].
    fn fill(&self, coordinates: &[[f32; 3]], looked_up: Option<usize>, block: &mut Features) {
        block.lanes = coordinates.len();
        let end = FEATURES * self.grid.levels();
        for level in 0..self.grid.levels() {
            self.grid.encode(level, coordinates, looked_up, &mut block.input[FEATURES * level * LANES..], LANES);
        }
        for (lane, x) in coordinates.iter().enumerate() {
            (0..3).for_each(|a| block.input[(end + a) * LANES + lane] = x[a]);
        }
        self.mlp.forward(&block.input, &mut block.hidden, &mut block.out);
    }

    /// Outputs of the perceptron for training; kept in `blocks`.
    pub(super) fn forward(&mut self, means: &[[f32; 3]]) {
        let mut coordinates = std::mem::take(&mut self.coordinates);
        coordinates.clear();
        coordinates.extend(means.iter().map(|&x| self.coordinate(x)));
        self.grid.forward(&coordinates);
        let mut blocks = std::mem::take(&mut self.blocks);
        blocks.resize_with(means.len().div_ceil(LANES), || self.block());
        let tasks = blocks.par_iter_mut().zip(coordinates.par_chunks(LANES)).with_min_len(BLOCKS);
        tasks.enumerate().for_each(|(index, (block, points))| self.fill(points, Some(index * LANES), block));
        (self.blocks, self.coordinates) = (blocks, coordinates);
    }

    /// The same for a look that leaves no trace.
    pub(super) fn features(&self, means: &[[f32; 3]]) -> Vec<Features> {
        let of_block = |points: &[[f32; 3]]| {
            let coordinates: Vec<_> = points.iter().map(|&x| self.coordinate(x)).collect();
            let mut block = self.block();
            self.fill(&coordinates, None, &mut block);
            block
        };
        means.par_chunks(LANES).with_min_len(BLOCKS).map(of_block).collect()
    }

    /// Takes `d_out` of every block to the grid's first `active` levels and adds to the gradient of the perceptron.
    pub(super) fn backward(&mut self, active: usize, gradient: &mut [f64]) {
        let features = FEATURES * self.grid.levels() * LANES;
        let (count, hidden) = (self.mlp.params().len(), self.mlp.hidden() * LANES);
        let partial = || Partial { mlp: vec![0.0; count], d_hidden: vec![0.0; hidden], d_input: vec![0.0; features] };
        let tasks = self.blocks.len().div_ceil(BLOCKS);
        self.partials.resize_with(tasks, partial);
        let (mlp, transposed) = (&self.mlp, self.mlp.transposed());
        self.blocks.par_chunks_mut(BLOCKS).zip(&mut self.partials).for_each(|(blocks, partial)| {
            let Partial { mlp: out, d_hidden, d_input } = partial;
            out.fill(0.0);
            for block in blocks {
                mlp.backward(&transposed, (&block.input, &block.hidden), &block.d_out, d_hidden, d_input, out);
                block.input[..features].copy_from_slice(d_input);
            }
        });
        for partial in &self.partials {
            gradient.iter_mut().zip(&partial.mlp).for_each(|(total, &g)| *total += f64::from(g));
        }
        let blocks = &self.blocks;
        let feature = |level: usize, i: usize| -> [f32; FEATURES] {
            std::array::from_fn(|f| blocks[i / LANES].input[(FEATURES * level + f) * LANES + i % LANES])
        };
        self.grid.backward(active, feature);
    }
}

/// How logits become training weights at a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampler {
    pub(super) inverse_temperature: f32,
    hard: bool,
    seed: Option<u64>,
}

impl Sampler {
    pub(super) fn new(config: &AssignConfig, parts: usize, step: usize, rng: &mut Pcg64Mcg) -> Self {
        Self {
            inverse_temperature: config.inverse_temperature(step, parts),
            hard: config.is_hard(step),
            seed: config.gumbel.then(|| rng.random()),
        }
    }

    /// Softmax of the noisy logits of block `index`, rows per part, in place; and the weights, `[lanes][parts]`.
    pub(super) fn draw(&self, index: usize, lanes: usize, soft: &mut [f32], weights: &mut [f32]) {
        let parts = soft.len() / LANES;
        if let Some(mut noise) = self.seed.map(|seed| gumbel(seed, index)) {
            (0..lanes).for_each(|lane| (0..parts).for_each(|k| soft[k * LANES + lane] += noise()));
        }
        softmax(soft, lanes, self.inverse_temperature);
        for (lane, row) in weights.chunks_exact_mut(parts).enumerate() {
            if self.hard {
                row.fill(0.0);
                row[best(soft, lane)] = 1.0;
            } else {
                row.iter_mut().enumerate().for_each(|(k, w)| *w = soft[k * LANES + lane]);
            }
        }
    }
}

/// Softmax over the rows of every lane of `factor * logits`, in place; zero in lanes without a point.
pub(super) fn softmax(rows: &mut [f32], lanes: usize, factor: f32) {
    let parts = rows.len() / LANES;
    let (mut highest, mut sum) = ([f32::NEG_INFINITY; LANES], [0.0f32; LANES]);
    for row in rows.chunks_exact(LANES) {
        highest.iter_mut().zip(row).for_each(|(h, l)| *h = h.max(*l));
    }
    for row in rows.chunks_exact_mut(LANES) {
        for lane in 0..LANES {
            row[lane] = ((row[lane] - highest[lane]) * factor).exp();
            sum[lane] += row[lane];
        }
    }
    for k in 0..parts {
        let row = &mut rows[k * LANES..(k + 1) * LANES];
        row.iter_mut().zip(&sum).for_each(|(v, s)| *v /= s);
        row[lanes..].fill(0.0);
    }
}

/// Gradient by the logits of [`softmax`] from that by the weights, `[lanes][parts]`; rows of lanes without a point are
/// zero.
pub(super) fn softmax_backward(soft: &[f32], d_weights: &[f32], factor: f32, d_logits: &mut [f32]) {
    let parts = soft.len() / LANES;
    d_logits.fill(0.0);
    for (lane, d) in d_weights.chunks_exact(parts).enumerate() {
        let mean: f32 = (0..parts).map(|k| soft[k * LANES + lane] * d[k]).sum();
        for k in 0..parts {
            d_logits[k * LANES + lane] = soft[k * LANES + lane] * (d[k] - mean) * factor;
        }
    }
}

/// The row that is largest in a lane, the first of equals.
pub(super) fn best(rows: &[f32], lane: usize) -> usize {
    let score = |k: usize| rows[k * LANES + lane];
    (1..rows.len() / LANES).fold(0, |best, k| if score(k) > score(best) { k } else { best })
}
