//! Centre-based part assignment: a learnable soft, later hard, part for every Gaussian.
//!
//! `X_k = R(q_k) (x - p_k) / (exp(s_k) scale_factor)`, `(a, b) = MLP(X, |X|, hash(x), x)`,
//! `logit_k = -|X_k|^2 exp(w a_k) + w b_k`, `weights = softmax((logits + gumbel) / T)`. Positions get no gradient.

use super::AssignConfig;
use super::block::{Block, Frame, Model, PART_SUMS, Partial, gumbel};
use super::hash_grid::{FEATURES, GridTable, HashGrid};
use super::mlp::{LANES, Mlp};
use crate::articulation::adam::{Adam, corrections};
use crate::articulation::model::quaternion::{matrix, matrix_vjp, normalise, normalise_vjp};
use crate::random::normal;
use artgs_core::Splats;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Blocks per task. Fixed, so that sums do not depend on the number of threads.
const BLOCKS: usize = 8;
const CHUNK: usize = BLOCKS * LANES;
/// Numbers per part: centre, log-scales, quaternion (w, x, y, z).
pub(crate) const FRAME: usize = 10;
pub(crate) const OPACITY_FLOOR: f64 = 1e-5;

/// What training changes of the module, for devices that train it elsewhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AssignState {
    /// Ten numbers per part, `[K]`: centre, log-scales, quaternion (w, x, y, z); then the perceptron's W1
    /// `[hidden][inputs]`, b1, W2 `[2 K][hidden]`, b2.
    pub values: Vec<f32>,
    /// First and second moments of `values`.
    pub moments: Vec<[f64; 2]>,
    /// Levels of the hash grid.
    pub grid: Vec<GridTable>,
}

/// The module with its optimiser and scratch memory.
/// Every step: [`forward`](Self::forward), optionally [`centre_regulariser`](Self::centre_regulariser),
/// [`backward`](Self::backward), [`step`](Self::step).
#[derive(Clone, Debug)]
pub struct PartAssignment {
    config: AssignConfig,
    frames: Vec<f32>,
    mlp: Mlp,
    grid: HashGrid,
    /// Lower corner and inverse longest side of the object; zero and one for world coordinates.
    normalisation: ([f32; 3], f32),
    adam: Adam,
    steps: u32,
    gradient: Vec<f64>,
    points: Vec<[f32; 3]>,
    coordinates: Vec<[f32; 3]>,
    blocks: Vec<Block>,
    partials: Vec<Partial>,
    inverse_temperature: f32,
    active_levels: usize,
}

impl PartAssignment {
    /// `centres` and `radii` are `[K]`, the static part first, radii positive; `bounds` are the least and the greatest
    /// coordinates of the object.
    pub fn new(
        config: AssignConfig,
        centres: &[[f32; 3]],
        radii: &[f32],
        bounds: [[f32; 3]; 2],
        rng: &mut Pcg64Mcg,
    ) -> Self {
        let parts = centres.len();
        assert!(parts > 0 && parts == radii.len(), "every part has a centre and a radius");
        let frames = centres
            .iter()
            .zip(radii)
            .flat_map(|(c, r)| [c[0], c[1], c[2], r.ln(), r.ln(), r.ln(), 1.0, 0.0, 0.0, 0.0])
            .collect();
        let mlp = Mlp::new(4 * parts + FEATURES * config.grid.levels + 3, config.hidden, 2 * parts, rng);
        let grid = HashGrid::new(&config.grid, rng);
        let normalisation = config.normalisation(bounds);
        let len = parts * FRAME + mlp.params().len();
        Self {
            frames,
            mlp,
            grid,
            normalisation,
            adam: Adam::new(len),
            steps: 0,
            gradient: vec![0.0; len],
            points: Vec::new(),
            coordinates: Vec::new(),
            blocks: Vec::new(),
            partials: Vec::new(),
            inverse_temperature: 1.0,
            active_levels: 0,
            config,
        }
    }

    /// Without initial centres: centres and log-scales are normal with standard deviation 0.01.
    pub fn uninformed(config: AssignConfig, parts: usize, bounds: [[f32; 3]; 2], rng: &mut Pcg64Mcg) -> Self {
        let mut draw = || (0.01 * normal(rng)) as f32;
        let frames: Vec<[f32; 6]> = (0..parts).map(|_| std::array::from_fn(|_| draw())).collect();
        let mut module = Self::new(config, &vec![[0.0; 3]; parts], &vec![1.0; parts], bounds, rng);
        for (frame, six) in module.frames.chunks_exact_mut(FRAME).zip(&frames) {
            frame[..6].copy_from_slice(six);
        }
        module
    }

    /// Number of parts, the static one included.
    pub fn parts(&self) -> usize {
        self.frames.len() / FRAME
    }

    /// Settings.
    pub fn config(&self) -> &AssignConfig {
        &self.config
    }

    /// Centres as learnt so far, `[K]`.
    pub fn centres(&self) -> Vec<[f32; 3]> {
        self.frames.chunks_exact(FRAME).map(|f| [f[0], f[1], f[2]]).collect()
    }

    /// Lower corner and inverse longest side of the object; zero and one for world coordinates.
    pub fn normalisation(&self) -> ([f32; 3], f32) {
        self.normalisation
    }

    /// Number of entries of each level of the hash grid.
    pub fn entries(&self) -> Vec<usize> {
        (0..self.grid.levels()).map(|level| self.grid.entries(level)).collect()
    }

    /// Parameters and their optimisers.
    pub fn state(&self) -> AssignState {
        let values = self.frames.iter().chain(self.mlp.params()).copied().collect();
        AssignState { values, moments: self.adam.moments().to_vec(), grid: self.grid.tables() }
    }

    /// Takes over what [`state`](Self::state) has given out, as it is after all steps counted so far; levels that have not
    /// learnt yet may be left out.
    pub fn set_state(&mut self, state: &AssignState) {
        let params = self.frames.iter_mut().chain(self.mlp.params_mut());
        params.zip(&state.values).for_each(|(to, v)| *to = *v);
        self.adam.moments_mut().iter_mut().zip(&state.moments).for_each(|(to, m)| *to = *m);
        self.grid.take_over(&state.grid, self.steps);
    }

    /// Counts a step that was made elsewhere; [`set_state`](Self::set_state) must follow before the next one made here.
    pub fn count_step(&mut self) {
        self.steps += 1;
    }

    /// Bias corrections `1 - beta^t` of the `ahead`-th step from here on.
    pub fn corrections(&self, ahead: u32) -> [f64; 2] {
        corrections(self.steps + ahead)
    }

    fn local_frames(&self) -> Vec<Frame> {
        self.frames
            .chunks_exact(FRAME)
            .map(|f| Frame {
                centre: [f[0], f[1], f[2]],
                rows: matrix(unit_quaternion(f).0).map(|row| row.map(|c| c as f32)),
                inverse_scale: std::array::from_fn(|a| (-f[3 + a]).exp() / self.config.scale_factor),
            })
            .collect()
    }

    fn coordinate(&self, x: [f32; 3]) -> [f32; 3] {
        let (origin, scale) = self.normalisation;
        std::array::from_fn(|a| (x[a] - origin[a]) * scale)
    }

    /// Training weights `[n][K]` at an optimisation step; noise comes from `rng`. Remembers what `backward` needs.
    pub fn forward(&mut self, means: &[[f32; 3]], step: usize, rng: &mut Pcg64Mcg, weights: &mut [f32]) {
        let parts = self.parts();
        assert_eq!(weights.len(), means.len() * parts, "one weight per Gaussian and part");
        self.inverse_temperature = self.config.inverse_temperature(step, parts);
        self.active_levels = self.config.active_levels(step);
        self.points.clear();
        self.points.extend_from_slice(means);
        let mut coordinates = std::mem::take(&mut self.coordinates);
        coordinates.clear();
        coordinates.extend(means.iter().map(|&x| self.coordinate(x)));
        self.coordinates = coordinates;
        self.grid.forward(&self.coordinates);
        let (levels, hidden) = (self.grid.levels(), self.config.hidden);
        self.blocks.resize_with(means.len().div_ceil(LANES), || Block::new(parts, levels, hidden));

        let seed = self.config.gumbel.then(|| rng.random::<u64>());
        let hard = self.config.is_hard(step);
        let mut blocks = std::mem::take(&mut self.blocks);
        let frames = self.local_frames();
        let model = self.model(&frames, self.inverse_temperature);
        let inputs = self.points.par_chunks(LANES).zip(self.coordinates.par_chunks(LANES));
        let tasks = blocks.par_iter_mut().zip(inputs).zip(weights.par_chunks_mut(LANES * parts));
        tasks.with_min_len(BLOCKS).enumerate().for_each(|(index, ((block, (points, coordinates)), weights))| {
            let mut noise = seed.map(|seed| gumbel(seed, index));
            let noise = noise.as_mut().map(|draw| draw as &mut dyn FnMut() -> f32);
            model.forward(points, coordinates, Some(index * LANES), noise, block);
            for (lane, row) in weights.chunks_exact_mut(parts).enumerate() {
                if hard {
                    row.fill(0.0);
                    row[block.best(lane)] = 1.0;
                } else {
                    row.iter_mut().enumerate().for_each(|(k, w)| *w = block.soft[k * LANES + lane]);
                }
            }
        });
        self.blocks = blocks;
    }

    /// Adds the gradients of the last `forward` from those by its weights, `[n][K]`.
    pub fn backward(&mut self, d_weights: &[f32]) {
        let parts = self.parts();
        assert_eq!(d_weights.len(), self.points.len() * parts, "one gradient per weight of the last forward");
        let (mut blocks, mut partials) = (std::mem::take(&mut self.blocks), std::mem::take(&mut self.partials));
        partials.resize_with(blocks.len().div_ceil(BLOCKS), || Partial::new(parts, self.grid.levels(), &self.mlp));
        let frames = self.local_frames();
        let model = self.model(&frames, self.inverse_temperature);
        let transposed = self.mlp.transposed();
        let inputs = self.points.par_chunks(CHUNK).zip(d_weights.par_chunks(CHUNK * parts));
        let tasks = blocks.par_chunks_mut(BLOCKS).zip(inputs).zip(&mut partials);
        tasks.for_each(|((blocks, (points, d_weights)), partial)| {
            partial.clear();
            let inputs = points.chunks(LANES).zip(d_weights.chunks(LANES * parts));
            for (block, (points, d_weights)) in blocks.iter_mut().zip(inputs) {
                model.backward(&transposed, points, d_weights, block, partial);
            }
        });
        self.collect(&partials, &frames);
        let feature = |level: usize, i: usize| -> [f32; FEATURES] {
            let row = 4 * parts + FEATURES * level;
            std::array::from_fn(|f| blocks[i / LANES].input[(row + f) * LANES + i % LANES])
        };
        self.grid.backward(self.active_levels, feature);
        (self.blocks, self.partials) = (blocks, partials);
    }

    fn model<'a>(&'a self, frames: &'a [Frame], inverse_temperature: f32) -> Model<'a> {
        let shift_weight = self.config.shift_weight;
        Model { frames, grid: &self.grid, mlp: &self.mlp, shift_weight, inverse_temperature }
    }

    /// Sums the tasks' gradients in their order and takes them from local frames to parameters.
    fn collect(&mut self, partials: &[Partial], frames: &[Frame]) {
        let split = frames.len() * FRAME;
        let (d_frames, d_mlp) = self.gradient.split_at_mut(split);
        for partial in partials {
            d_mlp.iter_mut().zip(&partial.mlp).for_each(|(total, &g)| *total += f64::from(g));
        }
        for (k, frame) in frames.iter().enumerate() {
            let mut sums = [0.0; PART_SUMS];
            for partial in partials {
                sums.iter_mut().zip(&partial.parts[k]).for_each(|(total, g)| *total += g);
            }
            let out = &mut d_frames[k * FRAME..(k + 1) * FRAME];
            for a in 0..3 {
                out[a] -= (0..3).map(|b| f64::from(frame.rows[b][a]) * sums[b]).sum::<f64>();
                out[3 + a] += sums[3 + a];
            }
            let (unit, length) = unit_quaternion(&self.frames[k * FRAME..]);
            let outer = std::array::from_fn(|a| std::array::from_fn(|b| sums[6 + 3 * a + b]));
            let d_quaternion = normalise_vjp(unit, length, matrix_vjp(unit, outer));
            (0..4).for_each(|c| out[6 + c] += d_quaternion[c]);
        }
    }

    /// `centre_weight * mean over 3K of (p_k - c_k)^2` with `c_k = sum m o x / (sum m o + 1e-5)`, `o` being opacities.
    /// Adds gradients by centres to the module and those by weights to `d_weights`, so call it before `backward`.
    pub fn centre_regulariser(&mut self, splats: &Splats, weights: &[f32], d_weights: &mut [f32]) -> f64 {
        let parts = self.parts();
        let opacity = |i: usize| 1.0 / (1.0 + (-f64::from(splats.logit_opacities[i])).exp());
        let mass_of = |c: usize| {
            let mut sums = vec![[0.0f64; 4]; parts];
            for i in c * CHUNK..((c + 1) * CHUNK).min(splats.len()) {
                let o = opacity(i);
                for (sum, &w) in sums.iter_mut().zip(&weights[i * parts..]) {
                    let mass = o * f64::from(w);
                    (0..3).for_each(|a| sum[a] += mass * f64::from(splats.means[i][a]));
                    sum[3] += mass;
                }
            }
            sums
        };
        let chunks: Vec<_> = (0..splats.len().div_ceil(CHUNK)).into_par_iter().map(mass_of).collect();
        let mut loss = 0.0;
        let mut through = Vec::with_capacity(parts);
        for k in 0..parts {
            let total: [f64; 4] = std::array::from_fn(|a| chunks.iter().map(|c| c[k][a]).sum());
            let mass = total[3] + OPACITY_FLOOR;
            let mean: [f64; 3] = std::array::from_fn(|a| total[a] / mass);
            let scale = self.config.centre_weight / (3 * parts) as f64;
            let mut d_mean = [0.0; 3];
            for a in 0..3 {
                let gap = f64::from(self.frames[k * FRAME + a]) - mean[a];
                loss += scale * gap * gap;
                self.gradient[k * FRAME + a] += 2.0 * scale * gap;
                d_mean[a] = -2.0 * scale * gap / mass;
            }
            through.push((mean, d_mean));
        }
        d_weights.par_chunks_mut(parts).enumerate().with_min_len(CHUNK).for_each(|(i, row)| {
            for (d, (mean, d_mean)) in row.iter_mut().zip(&through) {
                let along: f64 = (0..3).map(|a| d_mean[a] * (f64::from(splats.means[i][a]) - mean[a])).sum();
                *d += (opacity(i) * along) as f32;
            }
        });
        loss
    }

    /// One Adam step on everything with the gradients added up since the last, which are then zero.
    pub fn step(&mut self, learning_rate: f64) {
        self.steps += 1;
        let correction = corrections(self.steps);
        let params = self.frames.iter_mut().chain(self.mlp.params_mut());
        for (i, (value, gradient)) in params.zip(&mut self.gradient).enumerate() {
            *value -= (learning_rate * self.adam.update(i, *gradient, correction)) as f32;
            *gradient = 0.0;
        }
        self.grid.adam_step(learning_rate as f32);
    }

    /// Most probable part of every position, without noise.
    pub fn labels(&self, means: &[[f32; 3]]) -> Vec<u16> {
        let frames = self.local_frames();
        let model = self.model(&frames, 1.0);
        let of_task = |points: &[[f32; 3]]| -> Vec<u16> {
            let mut block = Block::new(self.parts(), self.grid.levels(), self.config.hidden);
            let mut labels = Vec::with_capacity(points.len());
            for points in points.chunks(LANES) {
                let coordinates: Vec<_> = points.iter().map(|&x| self.coordinate(x)).collect();
                model.forward(points, &coordinates, None, None, &mut block);
                labels.extend((0..points.len()).map(|lane| block.best(lane) as u16));
            }
            labels
        };
        means.par_chunks(CHUNK).flat_map_iter(of_task).collect()
    }
}

/// Of a part's parameters: unit quaternion and the raw one's length.
fn unit_quaternion(frame: &[f32]) -> ([f64; 4], f64) {
    normalise(std::array::from_fn(|c| f64::from(frame[6 + c])))
}

#[cfg(test)]
#[path = "centres_tests.rs"]
mod tests;
