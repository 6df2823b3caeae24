//! Means and spreads over seeds.

use serde::Serialize;

/// A number over several runs. Runs without it are counted, not averaged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Aggregate {
    /// Mean of the runs that have the number.
    pub mean: f64,
    /// Sample standard deviation (divisor n - 1); none for a single run.
    pub std: Option<f64>,
    /// Runs that have the number.
    pub runs: usize,
}

/// Mean and sample standard deviation; none without values.
pub(crate) fn aggregate(values: &[f64]) -> Option<Aggregate> {
    let runs = values.len();
    if runs == 0 {
        return None;
    }
    let mean = values.iter().sum::<f64>() / runs as f64;
    let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
    let std = (runs > 1).then(|| (squares / (runs - 1) as f64).sqrt());
    Some(Aggregate { mean, std, runs })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_answers() {
        assert_eq!(aggregate(&[]), None);
        assert_eq!(aggregate(&[3.0]), Some(Aggregate { mean: 3.0, std: None, runs: 1 }));
        let a = aggregate(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]).unwrap();
        assert_eq!((a.mean, a.runs), (5.0, 8));
        assert!((a.std.unwrap() - (32.0_f64 / 7.0).sqrt()).abs() < 1e-12);
    }
}
