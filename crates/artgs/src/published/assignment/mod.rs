//! A learnt assignment of Gaussians to parts: by distances from centres ([`centres`]), by a perceptron of the position
//! ([`perceptron`]) or by slot attention ([`slots`]). Settings are in [`config`].

mod block;
pub(crate) mod centres;
pub(crate) mod config;
mod encoder;
#[cfg(test)]
mod encoder_testing;
pub(crate) mod hash_grid;
pub(crate) mod mlp;
pub(crate) mod perceptron;
mod slot_cell;
pub(crate) mod slots;

pub use centres::{AssignState, PartAssignment};
pub use config::{AssignConfig, AssignKind, SlotConfig};
pub use hash_grid::{GridTable, HashGrid, HashGridConfig};
pub use perceptron::MlpAssignment;
pub use slots::SlotAssignment;

use artgs_core::Splats;
use rand_pcg::Pcg64Mcg;

/// One of the three modules; see there. Every step: [`forward`](Self::forward), optionally
/// [`centre_regulariser`](Self::centre_regulariser), [`backward`](Self::backward), [`step`](Self::step).
#[derive(Clone, Debug)]
pub enum Assignment {
    /// By centres.
    Centres(PartAssignment),
    /// By a perceptron.
    Mlp(MlpAssignment),
    /// By slot attention.
    Slots(Box<SlotAssignment>),
}

impl Assignment {
    /// The module that `config` asks for. `centres` and `radii` are `[K]`, the static part first; only their number
    /// matters without centres. `bounds` are the least and the greatest coordinates of the object.
    pub fn new(
        config: AssignConfig,
        centres: &[[f32; 3]],
        radii: &[f32],
        bounds: [[f32; 3]; 2],
        rng: &mut Pcg64Mcg,
    ) -> Self {
        match config.kind {
            AssignKind::Centres => Self::Centres(PartAssignment::new(config, centres, radii, bounds, rng)),
            AssignKind::Mlp => Self::Mlp(MlpAssignment::new(config, centres.len(), bounds, rng)),
            AssignKind::Slots => Self::Slots(Box::new(SlotAssignment::new(config, centres.len(), bounds, rng))),
        }
    }

    /// Number of parts, the static one included.
    pub fn parts(&self) -> usize {
        match self {
            Self::Centres(m) => m.parts(),
            Self::Mlp(m) => m.parts(),
            Self::Slots(m) => m.parts(),
        }
    }

    /// Training weights `[n][K]` at an optimisation step; noise comes from `rng`. Remembers what `backward` needs.
    pub fn forward(&mut self, means: &[[f32; 3]], step: usize, rng: &mut Pcg64Mcg, weights: &mut [f32]) {
        match self {
            Self::Centres(m) => m.forward(means, step, rng, weights),
            Self::Mlp(m) => m.forward(means, step, rng, weights),
            Self::Slots(m) => m.forward(means, step, rng, weights),
        }
    }

    /// The pull of centres to their parts, weighted; nothing where there are no centres. Call it before `backward`.
    pub fn centre_regulariser(&mut self, splats: &Splats, weights: &[f32], d_weights: &mut [f32]) -> f64 {
        match self {
            Self::Centres(m) if m.config().centre_weight > 0.0 => m.centre_regulariser(splats, weights, d_weights),
            _ => 0.0,
        }
    }

    /// Adds the gradients of the last `forward` from those by its weights, `[n][K]`.
    pub fn backward(&mut self, d_weights: &[f32]) {
        match self {
            Self::Centres(m) => m.backward(d_weights),
            Self::Mlp(m) => m.backward(d_weights),
            Self::Slots(m) => m.backward(d_weights),
        }
    }

    /// One Adam step on everything with the gradients added up since the last, which are then zero.
    pub fn step(&mut self, learning_rate: f64) {
        match self {
            Self::Centres(m) => m.step(learning_rate),
            Self::Mlp(m) => m.step(learning_rate),
            Self::Slots(m) => m.step(learning_rate),
        }
    }

    /// Most probable part of every position, without noise.
    pub fn labels(&self, means: &[[f32; 3]]) -> Vec<u16> {
        match self {
            Self::Centres(m) => m.labels(means),
            Self::Mlp(m) => m.labels(means),
            Self::Slots(m) => m.labels(means),
        }
    }
}
