//! One-sided Chamfer distance from moved Gaussians to the centres of a separately fitted state.

use crate::neighbours::PointTree;
use artgs_core::{PerState, State};
use rayon::prelude::*;

/// Points per task. Fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 512;

/// Targets of both states, ready for search.
#[derive(Debug)]
pub struct ChamferTargets {
    points: PerState<Vec<[f32; 3]>>,
    trees: PerState<PointTree>,
}

impl ChamferTargets {
    /// Centres of each state, finite, scene units.
    pub fn new(points: &PerState<Vec<[f32; 3]>>) -> Self {
        Self { points: points.clone(), trees: points.as_ref().map(|points| PointTree::new(points)) }
    }

    /// Centres of a state.
    pub fn points(&self, state: State) -> &[[f32; 3]] {
        &self.points[state]
    }

    /// `weight mean_i min_j |x_i - y_j|^2` over all `means`; writes its gradient by them to `d_means`, `[n]`.
    /// `sums` is scratch memory. Without targets, and for centres that are not finite, nothing.
    pub fn evaluate(
        &self,
        state: State,
        means: &[[f32; 3]],
        weight: f64,
        d_means: &mut [[f32; 3]],
        sums: &mut Vec<f64>,
    ) -> f64 {
        let (tree, points) = (&self.trees[state], &self.points[state]);
        let share = weight / means.len().max(1) as f64;
        sums.resize(means.len().div_ceil(CHUNK), 0.0);
        let tasks = means.par_chunks(CHUNK).zip(d_means.par_chunks_mut(CHUNK)).zip(sums.par_iter_mut());
        tasks.for_each(|((means, d_means), sum)| {
            *sum = 0.0;
            for (x, d) in means.iter().zip(d_means) {
                *d = [0.0; 3];
                let finite = x.iter().all(|c| c.is_finite());
                let Some((nearest, square)) = finite.then(|| tree.nearest(x)).flatten() else { continue };
                let y = points[nearest];
                *d = std::array::from_fn(|a| (2.0 * share) as f32 * (x[a] - y[a]));
                *sum += f64::from(square);
            }
        });
        share * sums.iter().sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_and_gradient_of_two_points() {
        let targets = ChamferTargets::new(&PerState::new(vec![[0.0; 3], [10.0, 0.0, 0.0]], vec![]));
        let means = [[1.0, 2.0, 0.0], [10.0, 0.0, 3.0]];
        let (mut d, mut sums) = ([[9.0; 3]; 2], Vec::new());
        let loss = targets.evaluate(State::START, &means, 100.0, &mut d, &mut sums);
        assert!((loss - 100.0 * (5.0 + 9.0) / 2.0).abs() < 1e-4, "{loss}");
        assert_eq!(d, [[100.0, 200.0, 0.0], [0.0, 0.0, 300.0]]);
        assert_eq!(targets.evaluate(State::END, &means, 100.0, &mut d, &mut sums), 0.0);
        assert_eq!(d, [[0.0; 3]; 2]);
    }
}
