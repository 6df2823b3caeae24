//! Adam over flat parameter arrays, and the moments of a whole set of Gaussians.

use artgs_core::Splats;
use artgs_raster::SplatGrads;
use artgs_raster::simd::level;
use fearless_simd::dispatch;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Constants of Adam that do not change during training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AdamConfig {
    /// Decay of the first moment.
    pub beta1: f32,
    /// Decay of the second moment.
    pub beta2: f32,
    /// Added to the root of the second moment.
    pub eps: f32,
}

impl AdamConfig {
    /// Factors of the first moment and of the root of the second that correct their bias at update `count`, from 1.
    pub fn corrections(&self, count: usize) -> [f32; 2] {
        let power = |beta: f32| 1.0 - f64::from(beta).powf(count as f64);
        [(1.0 / power(self.beta1)) as f32, (1.0 / power(self.beta2).sqrt()) as f32]
    }
}

impl Default for AdamConfig {
    fn default() -> Self {
        Self { beta1: 0.9, beta2: 0.999, eps: 1e-15 }
    }
}

/// First and second moment of one parameter array, rows of a fixed width.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moments {
    /// Running mean of gradients.
    pub first: Vec<f32>,
    /// Running mean of squared gradients.
    pub second: Vec<f32>,
}

impl Moments {
    /// Moments of `n` floats nothing is known about.
    pub fn zeros(n: usize) -> Self {
        Self { first: vec![0.0; n], second: vec![0.0; n] }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.first.fill(0.0);
        self.second.fill(0.0);
    }

    /// The rows of width `stride` named by `rows` (`None`: a row of zeros), in that order.
    pub fn select(&self, stride: usize, rows: &[Option<usize>]) -> Self {
        let pick = |from: &[f32]| {
            let mut to = vec![0.0; rows.len() * stride];
            for (out, row) in to.chunks_exact_mut(stride).zip(rows) {
                if let Some(i) = row {
                    out.copy_from_slice(&from[i * stride..(i + 1) * stride]);
                }
            }
            to
        };
        Self { first: pick(&self.first), second: pick(&self.second) }
    }
}

/// Numbers of one update: `p -= rate m / (sqrt(v) / root + eps)`, with the bias corrections folded in.
#[derive(Clone, Copy)]
struct Update {
    beta1: f32,
    beta2: f32,
    eps: f32,
    mean_correction: f32,
    root_correction: f32,
}

impl Update {
    fn new(config: &AdamConfig, count: usize) -> Self {
        let [mean_correction, root_correction] = config.corrections(count);
        Self { beta1: config.beta1, beta2: config.beta2, eps: config.eps, mean_correction, root_correction }
    }

    #[inline(always)]
    fn apply(&self, params: &mut [f32], grads: &[f32], first: &mut [f32], second: &mut [f32], rate: f32) {
        let rate = rate * self.mean_correction;
        for (((p, &g), m), v) in params.iter_mut().zip(grads).zip(first).zip(second) {
            *m = self.beta1 * *m + (1.0 - self.beta1) * g;
            *v = self.beta2 * *v + (1.0 - self.beta2) * g * g;
            *p -= rate * *m / (v.sqrt() * self.root_correction + self.eps);
        }
    }
}

/// Floats updated by one task, about; results do not depend on it.
const TASK: usize = 16 * 1024;

/// One Adam update of `params` at one rate. `count` is the number of this update, from 1.
/// All slices have the same length.
pub fn adam(params: &mut [f32], grads: &[f32], moments: &mut Moments, rate: f32, count: usize, config: &AdamConfig) {
    adam_columns(params, grads, moments, 1, &[(1, rate)], count, config);
}

/// One Adam update of rows of width `stride`. `columns` lists how many columns have which rate, from the left;
/// columns it does not reach are left alone.
pub(crate) fn adam_columns(
    params: &mut [f32],
    grads: &[f32],
    moments: &mut Moments,
    stride: usize,
    columns: &[(usize, f32)],
    count: usize,
    config: &AdamConfig,
) {
    assert!(params.len() == grads.len() && params.len() == moments.first.len() && params.len().is_multiple_of(stride));
    let update = Update::new(config, count);
    let level = level();
    let task = TASK.div_ceil(stride) * stride;
    params
        .par_chunks_mut(task)
        .zip(grads.par_chunks(task))
        .zip(moments.first.par_chunks_mut(task).zip(moments.second.par_chunks_mut(task)))
        .for_each(|((p, g), (m, v))| match columns {
            [(width, rate)] if *width == stride => dispatch!(level, _simd => update.apply(p, g, m, v, *rate)),
            _ => dispatch!(level, _simd => rows(&update, p, g, m, v, stride, columns)),
        });
}

#[inline(always)]
fn rows(
    update: &Update,
    params: &mut [f32],
    grads: &[f32],
    first: &mut [f32],
    second: &mut [f32],
    stride: usize,
    columns: &[(usize, f32)],
) {
    let chunks = params
        .chunks_exact_mut(stride)
        .zip(grads.chunks_exact(stride))
        .zip(first.chunks_exact_mut(stride).zip(second.chunks_exact_mut(stride)));
    for ((p, g), (m, v)) in chunks {
        let mut from = 0;
        for &(width, rate) in columns {
            let to = from + width;
            update.apply(&mut p[from..to], &g[from..to], &mut m[from..to], &mut v[from..to], rate);
            from = to;
        }
    }
}

/// Learning rates of one step, one per kind of parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatRates {
    /// Centres, scene units.
    pub means: f32,
    /// Raw quaternions.
    pub rotations: f32,
    /// Log scales.
    pub log_scales: f32,
    /// Logit opacities.
    pub logit_opacities: f32,
    /// Constant harmonic.
    pub sh_dc: f32,
    /// All other harmonics.
    pub sh_rest: f32,
}

/// Adam state of a set of Gaussians; rows follow the Gaussians through densification.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SplatAdam {
    /// Number of updates so far.
    pub count: usize,
    /// Centres, `[n][3]`.
    pub means: Moments,
    /// Quaternions, `[n][4]`.
    pub rotations: Moments,
    /// Log scales, `[n][3]`.
    pub log_scales: Moments,
    /// Logit opacities, `[n]`.
    pub logit_opacities: Moments,
    /// Harmonics, `[n][(degree + 1)^2][3]`.
    pub sh: Moments,
}

impl SplatAdam {
    /// Fresh state for a set of Gaussians.
    pub fn new(splats: &Splats) -> Self {
        let n = splats.len();
        Self {
            count: 0,
            means: Moments::zeros(3 * n),
            rotations: Moments::zeros(4 * n),
            log_scales: Moments::zeros(3 * n),
            logit_opacities: Moments::zeros(n),
            sh: Moments::zeros(splats.sh.len()),
        }
    }

    /// One update of every parameter; harmonics beyond `active_degree` are left alone.
    pub fn step(
        &mut self,
        splats: &mut Splats,
        grads: &SplatGrads,
        rates: &SplatRates,
        active_degree: usize,
        config: &AdamConfig,
    ) {
        self.count += 1;
        let (t, stride) = (self.count, splats.sh_stride());
        let group = |p: &mut [f32], g: &[f32], m: &mut Moments, rate| adam(p, g, m, rate, t, config);
        group(splats.means.as_flattened_mut(), grads.means.as_flattened(), &mut self.means, rates.means);
        group(
            splats.rotations.as_flattened_mut(),
            grads.rotations.as_flattened(),
            &mut self.rotations,
            rates.rotations,
        );
        group(
            splats.log_scales.as_flattened_mut(),
            grads.log_scales.as_flattened(),
            &mut self.log_scales,
            rates.log_scales,
        );
        group(&mut splats.logit_opacities, &grads.logit_opacities, &mut self.logit_opacities, rates.logit_opacities);
        let rest = 3 * (active_degree.min(splats.sh_degree) + 1).pow(2) - 3;
        let columns = [(3, rates.sh_dc), (rest, rates.sh_rest)];
        adam_columns(&mut splats.sh, &grads.sh, &mut self.sh, stride, &columns, t, config);
    }

    /// The state of the Gaussians `rows` (`None`: a new Gaussian), in that order.
    pub fn select(&self, rows: &[Option<usize>]) -> Self {
        let stride = self.sh.first.len() / self.logit_opacities.first.len().max(1);
        Self {
            count: self.count,
            means: self.means.select(3, rows),
            rotations: self.rotations.select(4, rows),
            log_scales: self.log_scales.select(3, rows),
            logit_opacities: self.logit_opacities.select(1, rows),
            sh: self.sh.select(stride.max(1), rows),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Textbook Adam in f64.
    fn reference(p: &mut f64, m: &mut f64, v: &mut f64, g: f64, rate: f64, t: i32) {
        let (b1, b2) = (0.9, 0.999);
        *m = b1 * *m + (1.0 - b1) * g;
        *v = b2 * *v + (1.0 - b2) * g * g;
        *p -= rate * (*m / (1.0 - b1.powi(t))) / ((*v / (1.0 - b2.powi(t))).sqrt() + 1e-15);
    }

    #[test]
    fn updates_match_the_textbook_column_by_column() {
        let (rows, stride) = (7_001, 6);
        let n = rows * stride;
        let columns = [(1, 0.01_f32), (3, 0.002)];
        let gradient = |i: usize, t: usize| ((i * 37 + t * 11) % 101) as f32 / 50.0 - 1.0;
        let mut params: Vec<f32> = (0..n).map(|i| i as f32 * 1e-4).collect();
        let mut moments = Moments::zeros(n);
        let mut twin: Vec<(f64, f64, f64)> = params.iter().map(|&p| (f64::from(p), 0.0, 0.0)).collect();
        for t in 1..=5 {
            let grads: Vec<f32> = (0..n).map(|i| gradient(i, t)).collect();
            adam_columns(&mut params, &grads, &mut moments, stride, &columns, t, &AdamConfig::default());
            for (i, (p, m, v)) in twin.iter_mut().enumerate() {
                let rate = [0.01, 0.002, 0.002, 0.002, 0.0, 0.0][i % stride];
                reference(p, m, v, f64::from(gradient(i, t)), rate, t as i32);
            }
        }
        for (i, (p, ..)) in twin.iter().enumerate() {
            assert!((f64::from(params[i]) - p).abs() < 2e-6, "{i}: {} {p}", params[i]);
        }
    }

    #[test]
    fn rows_follow_selection_and_new_ones_start_from_nothing() {
        let m = Moments { first: (0..6).map(|v| v as f32).collect(), second: (0..6).map(|v| v as f32 * 2.0).collect() };
        let s = m.select(2, &[Some(2), None, Some(0)]);
        assert_eq!(s.first, [4.0, 5.0, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(s.second, [8.0, 10.0, 0.0, 0.0, 0.0, 2.0]);
    }
}
