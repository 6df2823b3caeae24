//! Multi-resolution hash encoding of positions (Müller et al. 2022), with an Adam that visits only what was ever used.

use super::adam::{BETA, EPSILON, corrections};
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

const UNTOUCHED: u32 = u32::MAX;
/// Moments below this are set to zero: they would decay into slow denormal numbers.
const FLUSH: f32 = 1e-30;

/// One resolution. Gradients and moments exist only for entries that ever received a gradient, in order of first use;
/// the others would stay zero under Adam, so skipping them changes nothing.
#[derive(Clone, Debug)]
struct Level {
    scale: f32,
    stride: [u32; 2],
    hashed: bool,
    table: Vec<[f32; FEATURES]>,
    slot: Vec<u32>,
    touched: Vec<u32>,
    gradient: Vec<[f32; FEATURES]>,
    moments: Vec<[[f32; FEATURES]; 2]>,
}

/// The encoding: `levels` times [`FEATURES`] numbers for every point of space, wrapping around where the table ends.
#[derive(Clone, Debug)]
pub struct HashGrid {
    levels: Vec<Level>,
    step: u32,
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
        let table = (0..entries).map(|_| std::array::from_fn(|_| range * (2.0 * rng.random::<f32>() - 1.0))).collect();
        Self {
            scale: scale as f32,
            stride: [resolution as u32, (resolution as u32).wrapping_mul(resolution as u32)],
            hashed,
            table,
            slot: vec![UNTOUCHED; entries],
            touched: Vec::new(),
            gradient: Vec::new(),
            moments: Vec::new(),
        }
    }

    /// Entries and weights of the eight corners around a point.
    #[inline]
    fn corners(&self, point: [f32; 3]) -> [(usize, f32); 8] {
        let position = point.map(|c| c * self.scale + 0.5);
        // Rounds down without a call to the mathematics library.
        let low = position.map(|c| {
            let toward_zero = c as i32;
            toward_zero - i32::from(c < toward_zero as f32)
        });
        let fraction: [f32; 3] = std::array::from_fn(|a| position[a] - low[a] as f32);
        let low = low.map(|c| c as u32);
        let size = self.table.len() as u32;
        std::array::from_fn(|corner| {
            let bit = |a: usize| (corner >> a & 1) as u32;
            let [x, y, z] = std::array::from_fn(|a| low[a].wrapping_add(bit(a)));
            let key = if self.hashed {
                x ^ y.wrapping_mul(2_654_435_761) ^ z.wrapping_mul(805_459_861)
            } else {
                x.wrapping_add(y.wrapping_mul(self.stride[0])).wrapping_add(z.wrapping_mul(self.stride[1]))
            };
            let along = |a: usize| if bit(a) == 1 { fraction[a] } else { 1.0 - fraction[a] };
            let entry = if size.is_power_of_two() { key & (size - 1) } else { key % size };
            (entry as usize, along(0) * along(1) * along(2))
        })
    }

    fn features(&self, point: [f32; 3]) -> [f32; FEATURES] {
        let mut out = [0.0; FEATURES];
        for (entry, weight) in self.corners(point) {
            let value = self.table[entry];
            (0..FEATURES).for_each(|f| out[f] += weight * value[f]);
        }
        out
    }

    fn accumulate(&mut self, point: [f32; 3], gradient: [f32; FEATURES]) {
        for (entry, weight) in self.corners(point) {
            let mut slot = self.slot[entry];
            if slot == UNTOUCHED {
                slot = self.touched.len() as u32;
                self.slot[entry] = slot;
                self.touched.push(entry as u32);
                self.gradient.push([0.0; FEATURES]);
                self.moments.push([[0.0; FEATURES]; 2]);
            }
            let sum = &mut self.gradient[slot as usize];
            (0..FEATURES).for_each(|f| sum[f] += weight * gradient[f]);
        }
    }

    fn adam(&mut self, learning_rate: f32, correction: [f32; 2]) {
        let beta = BETA.map(|b| b as f32);
        for ((&entry, gradient), [m, v]) in self.touched.iter().zip(&mut self.gradient).zip(&mut self.moments) {
            let value = &mut self.table[entry as usize];
            for f in 0..FEATURES {
                let g = gradient[f];
                let first = beta[0] * m[f] + (1.0 - beta[0]) * g;
                m[f] = if first.abs() < FLUSH { 0.0 } else { first };
                let second = beta[1] * v[f] + (1.0 - beta[1]) * g * g;
                v[f] = if second < FLUSH { 0.0 } else { second };
                value[f] -= learning_rate * (m[f] * correction[0]) / ((v[f] * correction[1]).sqrt() + EPSILON as f32);
            }
            *gradient = [0.0; FEATURES];
        }
    }
}

impl HashGrid {
    /// A grid with random features.
    pub fn new(config: &HashGridConfig, rng: &mut Pcg64Mcg) -> Self {
        Self { levels: (0..config.levels).map(|l| Level::new(config, l, rng)).collect(), step: 0 }
    }

    /// Number of resolutions.
    pub fn levels(&self) -> usize {
        self.levels.len()
    }

    /// Features of a level at a point, by trilinear interpolation.
    pub fn features(&self, level: usize, point: [f32; 3]) -> [f32; FEATURES] {
        self.levels[level].features(point)
    }

    /// Entries that ever received a gradient, over all levels.
    pub fn touched(&self) -> usize {
        self.levels.iter().map(|l| l.touched.len()).sum()
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
            for (i, &point) in points.iter().enumerate() {
                let g = gradient(l, i);
                if g != [0.0; FEATURES] {
                    level.accumulate(point, g);
                }
            }
        });
    }

    /// One Adam step with the gradients added up since the last, which are then zero.
    pub fn adam_step(&mut self, learning_rate: f32) {
        self.step += 1;
        let correction = corrections(self.step).map(|c| (1.0 / c) as f32);
        self.levels.par_iter_mut().for_each(|level| level.adam(learning_rate, correction));
    }

    /// Features of a level, `[entries]`.
    pub fn table(&self, level: usize) -> &[[f32; FEATURES]] {
        &self.levels[level].table
    }

    /// For setting features.
    pub fn table_mut(&mut self, level: usize) -> &mut [[f32; FEATURES]] {
        &mut self.levels[level].table
    }

    /// Calls `visit(level, entry, gradient)` for every entry that ever received a gradient.
    pub fn for_each_touched(&self, mut visit: impl FnMut(usize, usize, [f32; FEATURES])) {
        for (l, level) in self.levels.iter().enumerate() {
            level.touched.iter().zip(&level.gradient).for_each(|(&entry, &g)| visit(l, entry as usize, g));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<[f32; 3]> {
        let mut rng = Pcg64Mcg::new(3);
        (0..200).map(|_| std::array::from_fn(|_| 3.0 * rng.random::<f32>() - 1.5)).collect()
    }

    fn small() -> HashGrid {
        let config = HashGridConfig { levels: 4, log2_entries: 10, base_resolution: 4.0, ..Default::default() };
        HashGrid::new(&config, &mut Pcg64Mcg::new(1))
    }

    #[test]
    fn paper_preset_has_three_dense_levels_of_twelve() {
        let grid = HashGrid::new(&HashGridConfig::default(), &mut Pcg64Mcg::new(1));
        let sizes: Vec<usize> = grid.levels.iter().map(|l| l.table.len()).collect();
        assert_eq!(sizes[..4], [4096, 32768, 262_144, 524_288]);
        assert!(grid.levels.iter().enumerate().all(|(l, level)| level.hashed == (l >= 3)));
        assert!(grid.table(5).iter().flatten().all(|v| v.abs() <= 1e-4));
        assert_eq!(grid.levels[11].scale, 32767.0);
    }

    #[test]
    fn dense_levels_interpolate_linearly() {
        let mut grid = small();
        let level = &mut grid.levels[0];
        for z in 0..4 {
            for y in 0..4 {
                for x in 0..4 {
                    level.table[x + 4 * y + 16 * z] = [x as f32 + 10.0 * y as f32, z as f32];
                }
            }
        }
        let p = [0.3f32, 0.55, 0.7];
        let at = p.map(|c| 3.0 * c + 0.5);
        let f = grid.features(0, p);
        assert!((f[0] - at[0] - 10.0 * at[1]).abs() < 1e-5 && (f[1] - at[2]).abs() < 1e-5);
    }

    #[test]
    fn features_are_continuous_also_at_negative_coordinates() {
        let grid = small();
        for level in 0..4 {
            for &p in &points() {
                let q = p.map(|c| c + 1e-5);
                let (a, b) = (grid.features(level, p), grid.features(level, q));
                assert!((a[0] - b[0]).abs() < 1e-6, "{level} {p:?}");
            }
        }
    }

    #[test]
    fn table_gradient_matches_finite_differences_and_inactive_levels_get_none() {
        let mut grid = small();
        let points = points();
        let weight = |l: usize, i: usize| [(i % 7) as f32 - 3.0, (l + i % 3) as f32];
        grid.backward(&points, 3, weight);
        let loss = |grid: &HashGrid| -> f64 {
            let at = |l: usize, i: usize| {
                let (f, w) = (grid.features(l, points[i]), weight(l, i));
                f64::from(f[0]) * f64::from(w[0]) + f64::from(f[1]) * f64::from(w[1])
            };
            (0..4).map(|l| (0..points.len()).map(|i| at(l, i)).sum::<f64>()).sum()
        };
        let mut entries = Vec::new();
        grid.for_each_touched(|l, e, g| entries.push((l, e, g)));
        assert!(entries.len() > 300 && entries.iter().all(|e| e.0 < 3));
        for (l, e, g) in entries.into_iter().step_by(17) {
            for f in 0..FEATURES {
                let base = loss(&grid);
                grid.table_mut(l)[e][f] += 0.5;
                let numeric = (loss(&grid) - base) / 0.5;
                grid.table_mut(l)[e][f] -= 0.5;
                assert!((numeric - f64::from(g[f])).abs() < 1e-4 * (1.0 + numeric.abs()), "{numeric} {}", g[f]);
            }
        }
    }

    #[test]
    fn lazy_adam_equals_a_dense_one() {
        let mut grid = small();
        let points = points();
        let mut dense: Vec<[f64; 3]> = grid.table(2).iter().map(|v| [v[0].into(), 0.0, 0.0]).collect();
        for step in 1..=5u32 {
            let some = &points[step as usize * 20..][..60];
            grid.backward(some, 4, |l, i| [(i + l) as f32 - 20.0, 1.0]);
            let mut gradient = vec![0.0f64; dense.len()];
            grid.for_each_touched(|l, e, g| {
                if l == 2 {
                    gradient[e] = g[0].into()
                }
            });
            grid.adam_step(1e-2);
            for ([p, m, v], g) in dense.iter_mut().zip(gradient) {
                *m = 0.9 * *m + 0.1 * g;
                *v = 0.999 * *v + 0.001 * g * g;
                let (mh, vh) = (*m / (1.0 - 0.9f64.powf(step.into())), *v / (1.0 - 0.999f64.powf(step.into())));
                *p -= 1e-2 * mh / (vh.sqrt() + 1e-15);
            }
        }
        for (a, b) in grid.table(2).iter().zip(&dense) {
            assert!((f64::from(a[0]) - b[0]).abs() < 1e-6);
        }
    }
}
