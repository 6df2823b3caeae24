//! Part assignment by a perceptron alone, without centres: `weights = softmax((MLP(hash(x), x) + gumbel) / T)`.
//! Positions get no gradient. Which output means which part is settled by the motions trained with it.

use super::AssignConfig;
use super::encoder::{Encoder, Sampler, best, softmax_backward};
use super::mlp::LANES;
use crate::articulation::adam::{Adam, corrections};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// The module with its optimiser and scratch memory; used like [`PartAssignment`](super::PartAssignment).
#[derive(Clone, Debug)]
pub struct MlpAssignment {
    config: AssignConfig,
    parts: usize,
    encoder: Encoder,
    adam: Adam,
    steps: u32,
    gradient: Vec<f64>,
    inverse_temperature: f32,
    active_levels: usize,
}

impl MlpAssignment {
    /// For `parts` parts, the static one included; `bounds` are the least and the greatest coordinates of the object.
    pub fn new(config: AssignConfig, parts: usize, bounds: [[f32; 3]; 2], rng: &mut Pcg64Mcg) -> Self {
        let encoder = Encoder::new(&config, parts, parts, bounds, rng);
        let len = encoder.mlp.params().len();
        let (adam, gradient) = (Adam::new(len), vec![0.0; len]);
        Self { config, parts, encoder, adam, steps: 0, gradient, inverse_temperature: 1.0, active_levels: 0 }
    }

    /// Number of parts, the static one included.
    pub fn parts(&self) -> usize {
        self.parts
    }

    /// Settings.
    pub fn config(&self) -> &AssignConfig {
        &self.config
    }

    /// Training weights `[n][K]` at an optimisation step; noise comes from `rng`. Remembers what `backward` needs.
    pub fn forward(&mut self, means: &[[f32; 3]], step: usize, rng: &mut Pcg64Mcg, weights: &mut [f32]) {
        assert_eq!(weights.len(), means.len() * self.parts, "one weight per Gaussian and part");
        self.active_levels = self.config.active_levels(step);
        let sampler = Sampler::new(&self.config, self.parts, step, rng);
        self.inverse_temperature = sampler.inverse_temperature;
        self.encoder.forward(means);
        let tasks = self.encoder.blocks.par_iter_mut().zip(weights.par_chunks_mut(LANES * self.parts));
        tasks.enumerate().for_each(|(index, (block, weights))| {
            block.soft.copy_from_slice(&block.out);
            sampler.draw(index, block.lanes, &mut block.soft, weights);
        });
    }

    /// Adds the gradients of the last `forward` from those by its weights, `[n][K]`.
    pub fn backward(&mut self, d_weights: &[f32]) {
        let factor = self.inverse_temperature;
        let tasks = self.encoder.blocks.par_iter_mut().zip(d_weights.par_chunks(LANES * self.parts));
        tasks.for_each(|(block, d)| softmax_backward(&block.soft, d, factor, &mut block.d_out));
        self.encoder.backward(self.active_levels, &mut self.gradient);
    }

    /// One Adam step on everything with the gradients added up since the last, which are then zero.
    pub fn step(&mut self, learning_rate: f64) {
        self.steps += 1;
        let correction = corrections(self.steps);
        let params = self.encoder.mlp.params_mut().iter_mut();
        for (i, (value, gradient)) in params.zip(&mut self.gradient).enumerate() {
            *value -= (learning_rate * self.adam.update(i, *gradient, correction)) as f32;
            *gradient = 0.0;
        }
        self.encoder.grid.adam_step(learning_rate as f32);
    }

    /// Most probable part of every position, without noise.
    pub fn labels(&self, means: &[[f32; 3]]) -> Vec<u16> {
        let blocks = self.encoder.features(means);
        blocks.iter().flat_map(|b| (0..b.lanes).map(|lane| best(&b.out, lane) as u16)).collect()
    }
}

#[cfg(test)]
#[path = "perceptron_tests.rs"]
mod tests;
