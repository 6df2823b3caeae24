//! Observers of a training run.

use super::backend::{StepStats, TrainState};

/// Follows training, on the thread that runs it and between steps, so it must return quickly. What it does never changes
/// the result. Closures that take [`StepStats`] follow the numbers alone.
pub trait Follow {
    /// A step is done.
    fn step(&mut self, stats: StepStats);

    /// Steps from here on belong to the stage of this name.
    fn stage(&mut self, _: &'static str) {}

    /// Something worth knowing was decided; one sentence.
    fn note(&mut self, _message: String) {}

    /// True if [`Follow::snapshot`] is to be called before the next step; asked after every step. The device has to give
    /// its state back for that, so ask seldom.
    fn wants_snapshot(&mut self) -> bool {
        false
    }

    /// Takes a look at the state; `total` is the length of the run in steps as far as it is known.
    fn snapshot(&mut self, _state: &TrainState, _total: usize) {}
}

impl<F: FnMut(StepStats)> Follow for F {
    fn step(&mut self, stats: StepStats) {
        self(stats);
    }
}
