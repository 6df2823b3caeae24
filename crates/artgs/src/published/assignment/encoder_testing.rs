//! Plain f64 versions of what the encoder does, for the tests of the segmentations that use it.

use super::encoder::Encoder;
use super::hash_grid::HashGridConfig;
use super::mlp::LANES;
use super::{AssignConfig, block::gumbel};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

pub(super) fn config() -> AssignConfig {
    let grid =
        HashGridConfig { levels: 4, log2_entries: 8, base_resolution: 4.0, initial_range: 0.3, ..Default::default() };
    AssignConfig { grid, initial_levels: 4, hidden: 16, ..Default::default() }
}

pub(super) fn points(n: usize) -> Vec<[f32; 3]> {
    let mut rng = Pcg64Mcg::new(11);
    (0..n).map(|_| std::array::from_fn(|_| 2.0 * rng.random::<f32>() - 1.0)).collect()
}

/// The seed that a forward pass with the generator `Pcg64Mcg::new(4)` draws.
pub(super) fn seed() -> u64 {
    Pcg64Mcg::new(4).random()
}

/// Inputs of the perceptron.
pub(super) fn hash_input(encoder: &Encoder, x: &[[f32; 3]]) -> Vec<Vec<f64>> {
    let input = |x: &[f32; 3]| {
        let at = encoder.coordinate(*x);
        let features = (0..encoder.grid.levels()).flat_map(|l| encoder.grid.features(l, at));
        features.chain(at).map(f64::from).collect()
    };
    x.iter().map(input).collect()
}

/// `W2 relu(W1 x + b1) + b2`.
pub(super) fn perceptron(p: &[f64], x: &[f64], hidden: usize, outputs: usize) -> Vec<f64> {
    let layer = |w: &[f64], b: &[f64], x: &[f64]| -> Vec<f64> {
        (0..b.len()).map(|o| b[o] + (0..x.len()).map(|i| w[o * x.len() + i] * x[i]).sum::<f64>()).collect()
    };
    let (w1, rest) = p.split_at(hidden * x.len());
    let (b1, rest) = rest.split_at(hidden);
    let (w2, b2) = rest.split_at(hidden * outputs);
    assert_eq!(b2.len(), outputs);
    let h: Vec<f64> = layer(w1, b1, x).iter().map(|v| v.max(0.0)).collect();
    layer(w2, b2, &h)
}

/// Softmax of every row times `factor`, with the noise of a seed if there is one.
pub(super) fn softmax_rows(logits: &[Vec<f64>], seed: Option<u64>, factor: f64) -> Vec<f64> {
    let mut out = Vec::new();
    for (block, rows) in logits.chunks(LANES).enumerate() {
        let mut noise = seed.map(|s| gumbel(s, block));
        for row in rows {
            let mut draw = || noise.as_mut().map_or(0.0, |n| f64::from(n()));
            let scores: Vec<f64> = row.iter().map(|l| ((l + draw()) * factor).exp()).collect();
            let sum: f64 = scores.iter().sum();
            out.extend(scores.iter().map(|s| s / sum));
        }
    }
    out
}
