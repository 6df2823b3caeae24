//! Random choices of the population.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// A source of random choices. The same seed gives the same choices.
pub(super) struct Dice(Pcg64Mcg);

impl Dice {
    pub(super) fn new(seed: u64) -> Self {
        Self(Pcg64Mcg::seed_from_u64(seed))
    }

    /// A source of its own, so that what it draws does not shift later choices.
    pub(super) fn branch(&mut self) -> Self {
        Self::new(self.0.random())
    }

    /// A number between two.
    pub(super) fn within(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// A number between two, rounded to a multiple of `step`.
    pub(super) fn stepped(&mut self, range: [f64; 2], step: f64) -> f64 {
        (self.within(range) / step).round() * step
    }

    /// True with this probability.
    pub(super) fn chance(&mut self, probability: f64) -> bool {
        self.0.random::<f64>() < probability
    }

    /// A whole number between two, both included.
    pub(super) fn count(&mut self, low: usize, high: usize) -> usize {
        low + (self.0.random::<f64>() * (high - low + 1) as f64) as usize
    }

    /// One of some things, each with its weight.
    pub(super) fn weighted<T: Copy>(&mut self, choices: &[(T, f64)]) -> T {
        let total: f64 = choices.iter().map(|(_, weight)| weight).sum();
        let mut left = self.0.random::<f64>() * total;
        for (choice, weight) in choices {
            left -= weight;
            if left < 0.0 {
                return *choice;
            }
        }
        choices[choices.len() - 1].0
    }

    /// One of some things with equal chances.
    pub(super) fn pick<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.count(0, choices.len() - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_probabilities() {
        let mut dice = Dice::new(3);
        let mut counts = [0; 3];
        for _ in 0..4000 {
            counts[dice.weighted(&[(0, 1.0), (1, 2.0), (2, 5.0)])] += 1;
        }
        for (count, expected) in counts.into_iter().zip([500.0, 1000.0, 2500.0]) {
            assert!((f64::from(count) - expected).abs() < 120.0, "{counts:?}");
        }
        let counted: Vec<usize> = (0..400).map(|_| dice.count(2, 4)).collect();
        assert!([2, 3, 4].iter().all(|n| counted.contains(n)) && counted.iter().all(|n| (2..=4).contains(n)));
    }
}
