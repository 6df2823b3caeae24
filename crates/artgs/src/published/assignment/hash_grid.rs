//! Multi-resolution hash encoding of positions (Müller et al. 2022), with an Adam that visits only what was used.
//!
//! The tables of the paper are larger than the caches, and neighbouring points have entries far apart. So every level sorts its
//! lookups by entry once per step: the pass that reads features and the one that updates entries then go through the table in order.

use crate::articulation::adam::{BETA, EPSILON, corrections};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Features per level.
pub const FEATURES: usize = 2;

/// Shape of the encoding. The default is the paper's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HashGridConfig {
    /// Number of resolutions.
    pub levels: usize,
    /// Binary logarithm of the most entries a level may have; coarser levels that need fewer are dense.
    pub log2_entries: u32,
    /// Grid points per unit length at the coarsest level.
    pub base_resolution: f64,
    /// Ratio of neighbouring resolutions.
    pub growth: f64,
    /// Initial features are uniform in plus or minus this.
    pub initial_range: f32,
}

impl Default for HashGridConfig {
    fn default() -> Self {
        Self { levels: 12, log2_entries: 19, base_resolution: 16.0, growth: 2.0, initial_range: 1e-4 }
    }
}

/// Factors of the second and third coordinate in the hash of a grid point.
pub(crate) const PRIMES: [u32; 2] = [2_654_435_761, 805_459_861];
/// Moments below this are set to zero: they would decay into slow denormal numbers.
pub(crate) const FLUSH: f32 = 1e-30;
/// Gradients below this are taken for zero: Adam adds 1e-15 to their size before it divides by it.
pub(crate) const NEGLIGIBLE: f32 = 1e-18;
/// Steps after which an entry without gradients has come to rest: 0.9 to this power is 5e-8.
const REST: usize = 160;
/// Most bits of an entry's index that one pass of sorting looks at: more places to write to than that leave the nearest cache.
const DIGIT: u32 = 10;

/// One entry of a table. Adam keeps moving an entry after its last gradient; that drift is added where it is read.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    /// Features after the update of step `last`.
    value: [f32; FEATURES],
    /// `m / (sqrt(v) + eps)` after that update.
    slope: [f32; FEATURES],
    last: u32,
}

/// First and second moments of an entry's gradients after the update of its step `last`.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    mean: [f32; FEATURES],
    square: [f32; FEATURES],
}

/// How far Adam carries a parameter after its last gradient, at step `t`: by `-slope total[t]`, with
/// `total[t] = sum over steps s > t of rate_s (beta1 / sqrt(beta2))^(s - t) sqrt(1 - beta2^s) / (1 - beta1^s)`.
#[derive(Clone, Debug)]
struct Drift {
    total: Vec<f32>,
    powers: [f32; REST],
}

impl Drift {
    fn new() -> Self {
        let ratio = BETA[0] / BETA[1].sqrt();
        Self { total: vec![0.0], powers: std::array::from_fn(|j| ratio.powi(j as i32 + 1) as f32) }
    }

    /// One more step; `factor` is the rate with both bias corrections.
    fn advance(&mut self, factor: f32) {
        for (total, power) in self.total.iter_mut().rev().zip(&self.powers) {
            *total += factor * power;
        }
        self.total.push(0.0);
    }

    #[inline]
    fn value(&self, entry: &Entry) -> [f32; FEATURES] {
        let total = self.total[entry.last as usize];
        std::array::from_fn(|f| entry.value[f] - entry.slope[f] * total)
    }
}

/// One resolution, with the lookups of the last forward pass.
#[derive(Clone, Debug)]
struct Level {
    scale: f32,
    stride: [u32; 2],
    hashed: bool,
    table: Vec<Entry>,
    /// Of every entry.
    moments: Vec<Moments>,
    /// `entry << 32 | point << 3 | corner`, ascending.
    lookups: Vec<u64>,
    /// Shares of the eight corners of every point.
    weights: Vec<[f32; 8]>,
    /// Features of every point; the backward pass puts their gradients over them.
    features: Vec<[f32; FEATURES]>,
    /// Entries with a gradient since the last step, ascending.
    gradients: Vec<(u32, [f32; FEATURES])>,
    scratch: Vec<u64>,
}

/// The encoding: `levels` times [`FEATURES`] numbers for every point of space, wrapping around where the table ends.
#[derive(Clone, Debug)]
pub struct HashGrid {
    levels: Vec<Level>,
    drift: Drift,
    step: u32,
}

/// One resolution as other devices train it: every entry as a dense Adam would have it after the last step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GridTable {
    /// Grid points per unit length.
    pub scale: f32,
    /// Entries between neighbours along y and along z, where the table is dense.
    pub stride: [u32; 2],
    /// Whether places are hashed.
    pub hashed: bool,
    /// Features of every entry.
    pub values: Vec<[f32; FEATURES]>,
    /// First moments of their gradients.
    pub means: Vec<[f32; FEATURES]>,
    /// Second moments.
    pub squares: Vec<[f32; FEATURES]>,
}

impl Level {
    fn new(config: &HashGridConfig, index: usize, rng: &mut Pcg64Mcg) -> Self {
        let scale = config.base_resolution * config.growth.powi(index as i32) - 1.0;
        let resolution = scale.ceil() as u64 + 1;
        let dense = resolution.saturating_mul(resolution).saturating_mul(resolution).next_multiple_of(8);
        let most = 1u64 << config.log2_entries.min(28);
        let hashed = dense > most;
        let entries = dense.min(most) as usize;
        let range = config.initial_range;
        let mut entry =
            || Entry { value: std::array::from_fn(|_| range * (2.0 * rng.random::<f32>() - 1.0)), ..Entry::default() };
        Self {
            scale: scale as f32,
            stride: [resolution as u32, (resolution as u32).wrapping_mul(resolution as u32)],
            hashed,
            table: (0..entries).map(|_| entry()).collect(),
            moments: vec![Moments::default(); entries],
            lookups: Vec::new(),
            weights: Vec::new(),
            features: Vec::new(),
            gradients: Vec::new(),
            scratch: Vec::new(),
        }
    }

    /// Entries and weights of the eight corners around a point.
    #[inline]
    fn corners(&self, point: [f32; 3]) -> ([u32; 8], [f32; 8]) {
        let position = point.map(|c| c * self.scale + 0.5);
        // Rounds down without a call to the mathematics library.
        let low = position.map(|c| {
            let toward_zero = c as i32;
            toward_zero - i32::from(c < toward_zero as f32)
        });
        let fraction: [f32; 3] = std::array::from_fn(|a| position[a] - low[a] as f32);
        let low = low.map(|c| c as u32);
        let size = self.table.len() as u32;
        let bit = |corner: usize, a: usize| (corner >> a & 1) as u32;
        let entries = std::array::from_fn(|corner| {
            let [x, y, z] = std::array::from_fn(|a| low[a].wrapping_add(bit(corner, a)));
            let key = if self.hashed {
                x ^ y.wrapping_mul(PRIMES[0]) ^ z.wrapping_mul(PRIMES[1])
            } else {
                x.wrapping_add(y.wrapping_mul(self.stride[0])).wrapping_add(z.wrapping_mul(self.stride[1]))
            };
            if size.is_power_of_two() { key & (size - 1) } else { key % size }
        });
        let weights = std::array::from_fn(|corner| {
            let along = |a: usize| if bit(corner, a) == 1 { fraction[a] } else { 1.0 - fraction[a] };
            along(0) * along(1) * along(2)
        });
        (entries, weights)
    }

    fn features(&self, point: [f32; 3], drift: &Drift) -> [f32; FEATURES] {
        let (entries, weights) = self.corners(point);
        let mut out = [0.0; FEATURES];
        for (&entry, weight) in entries.iter().zip(weights) {
            let value = drift.value(&self.table[entry as usize]);
            (0..FEATURES).for_each(|f| out[f] += weight * value[f]);
        }
        out
    }

    fn forward(&mut self, points: &[[f32; 3]], drift: &Drift) {
        self.lookups.clear();
        self.weights.clear();
        for (i, &point) in points.iter().enumerate() {
            let (entries, weights) = self.corners(point);
            self.weights.push(weights);
            let key = |corner: usize| u64::from(entries[corner]) << 32 | (i << 3 | corner) as u64;
            self.lookups.extend((0..8).map(key));
        }
        sort_by_entry(&mut self.lookups, &mut self.scratch, self.table.len());
        self.features.clear();
        self.features.resize(points.len(), [0.0; FEATURES]);
        for &lookup in &self.lookups {
            let (entry, point, corner) = parts_of(lookup);
            let (weight, value) = (self.weights[point][corner], drift.value(&self.table[entry]));
            let out = &mut self.features[point];
            (0..FEATURES).for_each(|f| out[f] += weight * value[f]);
        }
    }

    fn backward(&mut self, gradient: impl Fn(usize) -> [f32; FEATURES]) {
        let kept = |v: f32| if v.abs() > NEGLIGIBLE { v } else { 0.0 };
        self.features.iter_mut().enumerate().for_each(|(i, g)| *g = gradient(i).map(kept));
        self.gradients.clear();
        for run in self.lookups.chunk_by(|a, b| a >> 32 == b >> 32) {
            let mut sum = [0.0; FEATURES];
            for &lookup in run {
                let (_, point, corner) = parts_of(lookup);
                let (weight, g) = (self.weights[point][corner], self.features[point]);
                (0..FEATURES).for_each(|f| sum[f] += weight * g[f]);
            }
            if sum != [0.0; FEATURES] {
                self.gradients.push(((run[0] >> 32) as u32, sum));
            }
        }
    }

    fn table(&self, step: u32, drift: &Drift) -> GridTable {
        let decayed = |beta: f64, pick: fn(&Moments) -> [f32; FEATURES]| {
            let of = |(entry, moments): (&Entry, &Moments)| {
                let decay = beta.powf(f64::from(step - entry.last)) as f32;
                pick(moments).map(|v| v * decay)
            };
            self.table.iter().zip(&self.moments).map(of).collect()
        };
        GridTable {
            scale: self.scale,
            stride: self.stride,
            hashed: self.hashed,
            values: self.table.iter().map(|entry| drift.value(entry)).collect(),
            means: decayed(BETA[0], |m| m.mean),
            squares: decayed(BETA[1], |m| m.square),
        }
    }

    /// Puts every entry where a table has it after step `step`.
    fn take_over(&mut self, table: &GridTable, step: u32) {
        self.gradients.clear();
        let read = table.values.iter().zip(&table.means).zip(&table.squares);
        for ((entry, moments), ((&value, &mean), &square)) in self.table.iter_mut().zip(&mut self.moments).zip(read) {
            let slope = std::array::from_fn(|f| mean[f] / (square[f].sqrt() + EPSILON as f32));
            *entry = Entry { value, slope, last: step };
            *moments = Moments { mean, square };
        }
    }

    fn adam(&mut self, learning_rate: f32, step: u32, correction: [f32; 2], drift: &Drift) {
        for &(index, gradient) in &self.gradients {
            let entry = &mut self.table[index as usize];
            entry.value = drift.value(entry);
            self.moments[index as usize].update(entry, gradient, learning_rate, step, correction);
        }
        self.gradients.clear();
    }
}

/// Entry, point and corner of a lookup.
#[inline]
fn parts_of(lookup: u64) -> (usize, usize, usize) {
    ((lookup >> 32) as usize, (lookup as u32 >> 3) as usize, lookup as usize & 7)
}

/// Stable radix sort by the upper half, which is below `entries`.
fn sort_by_entry(lookups: &mut Vec<u64>, scratch: &mut Vec<u64>, entries: usize) {
    let bits = usize::BITS - entries.saturating_sub(1).leading_zeros();
    // Passes alike in width.
    let width = bits.div_ceil(bits.div_ceil(DIGIT).max(1)).max(1);
    scratch.resize(lookups.len(), 0);
    for shift in (32..32 + bits).step_by(width as usize) {
        let digit = |lookup: u64| (lookup >> shift) as usize & ((1 << width) - 1);
        let mut places = [0u32; 1 << DIGIT];
        lookups.iter().for_each(|&lookup| places[digit(lookup)] += 1);
        let mut before = 0;
        for place in &mut places {
            before += std::mem::replace(place, before);
        }
        for &lookup in &*lookups {
            let place = &mut places[digit(lookup)];
            scratch[*place as usize] = lookup;
            *place += 1;
        }
        std::mem::swap(lookups, scratch);
    }
}

impl Moments {
    /// Folds the gradient in and moves the entry, whose value is that of the step before.
    #[inline]
    fn update(
        &mut self,
        entry: &mut Entry,
        gradient: [f32; FEATURES],
        learning_rate: f32,
        step: u32,
        correction: [f32; 2],
    ) {
        let decay = BETA.map(|b| (b as f32).powi((step - entry.last) as i32));
        let gain = BETA.map(|b| 1.0 - b as f32);
        for f in 0..FEATURES {
            let g = gradient[f];
            let mean = decay[0] * self.mean[f] + gain[0] * g;
            let square = decay[1] * self.square[f] + gain[1] * g * g;
            let m = if mean.abs() < FLUSH { 0.0 } else { mean };
            let v = if square < FLUSH { 0.0 } else { square };
            let (root, eps) = (v.sqrt(), EPSILON as f32);
            entry.value[f] -= learning_rate * (m * correction[0]) / (root * correction[1].sqrt() + eps);
            entry.slope[f] = m / (root + eps);
            (self.mean[f], self.square[f]) = (m, v);
        }
        entry.last = step;
    }
}

impl HashGrid {
    /// A grid with random features.
    pub fn new(config: &HashGridConfig, rng: &mut Pcg64Mcg) -> Self {
        Self { levels: (0..config.levels).map(|l| Level::new(config, l, rng)).collect(), drift: Drift::new(), step: 0 }
    }

    /// Number of resolutions.
    pub fn levels(&self) -> usize {
        self.levels.len()
    }

    /// Features of a level at a point, by trilinear interpolation.
    pub fn features(&self, level: usize, point: [f32; 3]) -> [f32; FEATURES] {
        self.levels[level].features(point, &self.drift)
    }

    /// Looks up points for training. Every level is one task, so sums do not depend on the number of threads.
    pub fn forward(&mut self, points: &[[f32; 3]]) {
        let drift = &self.drift;
        self.levels.par_iter_mut().for_each(|level| level.forward(points, drift));
    }

    /// Features of a level at some points, one row of `out` per feature, rows `stride` apart. Points of the last
    /// [`forward`](Self::forward), of which `looked_up` is the place of the first, are not looked up again.
    pub fn encode(&self, level: usize, points: &[[f32; 3]], looked_up: Option<usize>, out: &mut [f32], stride: usize) {
        let level = &self.levels[level];
        for (i, &point) in points.iter().enumerate() {
            let features =
                looked_up.map_or_else(|| level.features(point, &self.drift), |first| level.features[first + i]);
            (0..FEATURES).for_each(|f| out[f * stride + i] = features[f]);
        }
    }

    /// Gradients of the first `active` levels: `gradient(level, i)` is that by the features of the `i`-th point of the last
    /// [`forward`](Self::forward).
    pub fn backward(&mut self, active: usize, gradient: impl Fn(usize, usize) -> [f32; FEATURES] + Sync) {
        let levels = self.levels.par_iter_mut().take(active).enumerate();
        levels.for_each(|(l, level)| level.backward(|i| gradient(l, i)));
    }

    /// One Adam step with the gradients of the last backward pass, which are then gone.
    pub fn adam_step(&mut self, learning_rate: f32) {
        self.step += 1;
        let correction = corrections(self.step).map(|c| (1.0 / c) as f32);
        let (step, drift) = (self.step, &self.drift);
        self.levels.par_iter_mut().for_each(|level| level.adam(learning_rate, step, correction, drift));
        self.drift.advance(learning_rate * correction[0] / correction[1].sqrt());
    }

    /// All levels, for devices that train them elsewhere.
    pub fn tables(&self) -> Vec<GridTable> {
        self.levels.par_iter().map(|level| level.table(self.step, &self.drift)).collect()
    }

    /// Takes over tables of the shapes that [`tables`](Self::tables) has given out, as they are after `step` updates. Fewer
    /// than those are the coarser ones; the others must not have learnt yet.
    pub fn take_over(&mut self, tables: &[GridTable], step: u32) {
        self.levels.par_iter_mut().zip(tables).for_each(|(level, table)| level.take_over(table, step));
        self.step = step;
        self.drift.total.clear();
        self.drift.total.resize(step as usize + 1, 0.0);
    }

    /// Number of entries of a level.
    pub fn entries(&self, level: usize) -> usize {
        self.levels[level].table.len()
    }

    /// Features of an entry.
    pub fn entry(&self, level: usize, entry: usize) -> [f32; FEATURES] {
        self.drift.value(&self.levels[level].table[entry])
    }

    /// Sets the features of an entry; it comes to rest there.
    pub fn set_entry(&mut self, level: usize, entry: usize, value: [f32; FEATURES]) {
        let entry = &mut self.levels[level].table[entry];
        (entry.value, entry.slope) = (value, [0.0; FEATURES]);
    }

    /// Calls `visit(level, entry, gradient)` for every entry with a gradient since the last step.
    pub fn for_each_gradient(&self, mut visit: impl FnMut(usize, usize, [f32; FEATURES])) {
        for (l, level) in self.levels.iter().enumerate() {
            level.gradients.iter().for_each(|&(entry, gradient)| visit(l, entry as usize, gradient));
        }
    }
}

#[cfg(test)]
#[path = "hash_grid_tests.rs"]
mod tests;
