//! Multi-resolution hash encoding of positions (Müller et al. 2022), with an Adam that visits only what was ever used.

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
const UNTOUCHED: u32 = u32::MAX;
/// Moments below this are set to zero: they would decay into slow denormal numbers.
pub(crate) const FLUSH: f32 = 1e-30;
/// Gradients below this are taken for zero: Adam adds 1e-15 to their size before it divides by it.
pub(crate) const NEGLIGIBLE: f32 = 1e-18;
/// Steps after which an entry without gradients has come to rest: 0.9 to this power is 5e-8.
const REST: usize = 160;
/// Points that are looked up together: a table is larger than the caches, and reading many entries before using any
/// lets the waits overlap.
const BATCH: usize = 64;

/// Entries and weights of the eight corners around some points.
struct Batch {
    entries: [[u32; 8]; BATCH],
    weights: [[f32; 8]; BATCH],
}

/// One entry of a table. Adam keeps moving an entry after its last gradient; that drift is added where it is read.
#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Features after the update of step `last`.
    value: [f32; FEATURES],
    /// `m / (sqrt(v) + eps)` after that update.
    slope: [f32; FEATURES],
    last: u32,
    /// Place among the optimised entries.
    slot: u32,
}

/// What the optimiser keeps of an entry that ever received a gradient; moments are those of step `last`.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    gradient: [f32; FEATURES],
    mean: [f32; FEATURES],
    square: [f32; FEATURES],
    /// Whether there is a gradient since the last step.
    fresh: bool,
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

/// One resolution. Moments exist only for entries that ever received a gradient, in order of first use; the others
/// would stay where they are under Adam. A step visits only the entries with a gradient since the last.
#[derive(Clone, Debug)]
struct Level {
    scale: f32,
    stride: [u32; 2],
    hashed: bool,
    table: Vec<Entry>,
    moments: Vec<Moments>,
    /// Entries with a gradient since the last step.
    fresh: Vec<u32>,
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
        let mut entry = || Entry {
            value: std::array::from_fn(|_| range * (2.0 * rng.random::<f32>() - 1.0)),
            slope: [0.0; FEATURES],
            last: 0,
            slot: UNTOUCHED,
        };
        Self {
            scale: scale as f32,
            stride: [resolution as u32, (resolution as u32).wrapping_mul(resolution as u32)],
            hashed,
            table: (0..entries).map(|_| entry()).collect(),
            moments: Vec::new(),
            fresh: Vec::new(),
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

    /// Looks up at most [`BATCH`] points and brings their entries into the caches.
    fn look_up(&self, points: impl Iterator<Item = [f32; 3]>, batch: &mut Batch) {
        let mut seen = 0;
        for ((point, entries), weights) in points.zip(&mut batch.entries).zip(&mut batch.weights) {
            (*entries, *weights) = self.corners(point);
            for &entry in &*entries {
                seen ^= self.table[entry as usize].last;
            }
        }
        std::hint::black_box(seen);
    }

    fn features(&self, entries: &[u32; 8], weights: &[f32; 8], drift: &Drift) -> [f32; FEATURES] {
        let mut out = [0.0; FEATURES];
        for (&entry, weight) in entries.iter().zip(weights) {
            let value = drift.value(&self.table[entry as usize]);
            (0..FEATURES).for_each(|f| out[f] += weight * value[f]);
        }
        out
    }

    /// Gives optimiser memory to the entries of a point, and brings it into the caches.
    fn prepare(&mut self, entries: &[u32; 8]) {
        let mut seen = false;
        for &index in entries {
            let entry = &mut self.table[index as usize];
            if entry.slot == UNTOUCHED {
                entry.slot = self.moments.len() as u32;
                self.moments.push(Moments::default());
            }
            seen ^= self.moments[entry.slot as usize].fresh;
        }
        std::hint::black_box(seen);
    }

    fn accumulate(&mut self, entries: &[u32; 8], weights: &[f32; 8], gradient: [f32; FEATURES]) {
        for (&index, weight) in entries.iter().zip(weights) {
            let slot = self.table[index as usize].slot;
            let sum = &mut self.moments[slot as usize];
            if !sum.fresh {
                sum.fresh = true;
                self.fresh.push(index);
            }
            (0..FEATURES).for_each(|f| sum.gradient[f] += weight * gradient[f]);
        }
    }

    fn table(&self, step: u32, drift: &Drift) -> GridTable {
        let moments = |entry: &Entry, beta: f64, pick: fn(&Moments) -> [f32; FEATURES]| {
            let decay = beta.powf(f64::from(step - entry.last)) as f32;
            self.moments.get(entry.slot as usize).map_or([0.0; FEATURES], |m| pick(m).map(|v| v * decay))
        };
        GridTable {
            scale: self.scale,
            stride: self.stride,
            hashed: self.hashed,
            values: self.table.iter().map(|entry| drift.value(entry)).collect(),
            means: self.table.iter().map(|entry| moments(entry, BETA[0], |m| m.mean)).collect(),
            squares: self.table.iter().map(|entry| moments(entry, BETA[1], |m| m.square)).collect(),
        }
    }

    /// Puts every entry where a table has it after step `step`.
    fn take_over(&mut self, table: &GridTable, step: u32) {
        self.moments.clear();
        self.fresh.clear();
        let read = table.values.iter().zip(&table.means).zip(&table.squares);
        for (entry, ((&value, &mean), &square)) in self.table.iter_mut().zip(read) {
            let slope = std::array::from_fn(|f| mean[f] / (square[f].sqrt() + EPSILON as f32));
            *entry = Entry { value, slope, last: step, slot: UNTOUCHED };
            if mean != [0.0; FEATURES] || square != [0.0; FEATURES] {
                entry.slot = self.moments.len() as u32;
                self.moments.push(Moments { mean, square, ..Moments::default() });
            }
        }
    }

    fn adam(&mut self, learning_rate: f32, step: u32, correction: [f32; 2], drift: &Drift) {
        for indices in self.fresh.chunks(BATCH) {
            let mut seen = false;
            for &index in indices {
                seen ^= self.moments[self.table[index as usize].slot as usize].fresh;
            }
            std::hint::black_box(seen);
            for &index in indices {
                let entry = &mut self.table[index as usize];
                let moments = &mut self.moments[entry.slot as usize];
                entry.value = drift.value(entry);
                moments.update(entry, learning_rate, step, correction);
            }
        }
        self.fresh.clear();
    }
}

impl Moments {
    /// Folds the gradient in and moves the entry, whose value is that of the step before.
    #[inline]
    fn update(&mut self, entry: &mut Entry, learning_rate: f32, step: u32, correction: [f32; 2]) {
        let decay = BETA.map(|b| (b as f32).powi((step - entry.last) as i32));
        let gain = BETA.map(|b| 1.0 - b as f32);
        for f in 0..FEATURES {
            let g = self.gradient[f];
            let mean = decay[0] * self.mean[f] + gain[0] * g;
            let square = decay[1] * self.square[f] + gain[1] * g * g;
            let m = if mean.abs() < FLUSH { 0.0 } else { mean };
            let v = if square < FLUSH { 0.0 } else { square };
            let (root, eps) = (v.sqrt(), EPSILON as f32);
            entry.value[f] -= learning_rate * (m * correction[0]) / (root * correction[1].sqrt() + eps);
            entry.slope[f] = m / (root + eps);
            (self.mean[f], self.square[f], self.gradient[f]) = (m, v, 0.0);
        }
        entry.last = step;
        self.fresh = false;
    }
}

impl Batch {
    fn new() -> Self {
        Self { entries: [[0; 8]; BATCH], weights: [[0.0; 8]; BATCH] }
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
        let level = &self.levels[level];
        let (entries, weights) = level.corners(point);
        level.features(&entries, &weights, &self.drift)
    }

    /// Features of a level at some points, one row of `out` per feature, rows `stride` apart.
    pub fn encode(&self, level: usize, points: &[[f32; 3]], out: &mut [f32], stride: usize) {
        let level = &self.levels[level];
        let mut batch = Batch::new();
        for (c, points) in points.chunks(BATCH).enumerate() {
            level.look_up(points.iter().copied(), &mut batch);
            for i in 0..points.len() {
                let features = level.features(&batch.entries[i], &batch.weights[i], &self.drift);
                (0..FEATURES).for_each(|f| out[f * stride + c * BATCH + i] = features[f]);
            }
        }
    }

    /// Entries that ever received a gradient, over all levels.
    pub fn touched(&self) -> usize {
        self.levels.iter().map(|l| l.moments.len()).sum()
    }

    /// Adds up gradients of the first `active` levels: `gradient(level, i)` is that by the features of `points[i]`.
    /// Every level is one task that takes the points in order.
    pub fn backward(
        &mut self,
        points: &[[f32; 3]],
        active: usize,
        gradient: impl Fn(usize, usize) -> [f32; FEATURES] + Sync,
    ) {
        self.levels.par_iter_mut().take(active).enumerate().for_each(|(l, level)| {
            let mut batch = Batch::new();
            let mut chosen = [(0, [0.0; FEATURES]); BATCH];
            let mut count = 0;
            for i in 0..points.len() {
                let g = gradient(l, i);
                if g.iter().any(|v| v.abs() > NEGLIGIBLE) {
                    chosen[count] = (i, g);
                    count += 1;
                }
                if count == BATCH || i + 1 == points.len() {
                    level.look_up(chosen[..count].iter().map(|c| points[c.0]), &mut batch);
                    batch.entries[..count].iter().for_each(|entries| level.prepare(entries));
                    for (k, (_, g)) in chosen[..count].iter().enumerate() {
                        level.accumulate(&batch.entries[k], &batch.weights[k], *g);
                    }
                    count = 0;
                }
            }
        });
    }

    /// One Adam step with the gradients added up since the last, which are then zero.
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
            for &index in &level.fresh {
                let slot = level.table[index as usize].slot;
                visit(l, index as usize, level.moments[slot as usize].gradient);
            }
        }
    }
}

#[cfg(test)]
#[path = "hash_grid_tests.rs"]
mod tests;
