//! Adam for small parameter vectors.

pub(crate) const BETA: [f64; 2] = [0.9, 0.999];
pub(crate) const EPSILON: f64 = 1e-15;

/// Bias corrections `1 - beta^t` after `t` steps.
pub(crate) fn corrections(step: u32) -> [f64; 2] {
    BETA.map(|beta| 1.0 - beta.powf(f64::from(step)))
}

/// First and second moments of a parameter vector, in f64 for parameters of any precision.
#[derive(Clone, Debug)]
pub(crate) struct Adam {
    moments: Vec<[f64; 2]>,
}

impl Adam {
    pub(crate) fn new(len: usize) -> Self {
        Self { moments: vec![[0.0; 2]; len] }
    }

    /// First and second moment of every parameter.
    pub(crate) fn moments(&self) -> &[[f64; 2]] {
        &self.moments
    }

    /// For moments that were made elsewhere.
    pub(crate) fn moments_mut(&mut self) -> &mut [[f64; 2]] {
        &mut self.moments
    }

    /// Folds in the gradient of parameter `i` and returns the step in units of the learning rate, to be subtracted.
    pub(crate) fn update(&mut self, i: usize, gradient: f64, corrections: [f64; 2]) -> f64 {
        let [m, v] = &mut self.moments[i];
        *m += (1.0 - BETA[0]) * (gradient - *m);
        *v += (1.0 - BETA[1]) * (gradient * gradient - *v);
        (*m / corrections[0]) / ((*v / corrections[1]).sqrt() + EPSILON)
    }
}
