//! Statistics of shares and of values, as pure functions.

use serde::Serialize;

/// The 97.5 % quantile of the normal distribution: intervals contain the true share in 95 % of samples.
const Z: f64 = 1.959_963_984_540_054;

/// How many of some things have a property.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// Things with the property.
    pub count: usize,
    /// All things.
    pub of: usize,
    /// The share, 0 to 1; none of nothing.
    pub share: Option<f64>,
    /// 95 % interval of the share (Wilson); none of nothing.
    pub interval: Option<[f64; 2]>,
}

impl Share {
    /// `count` of `of` things; `count` is at most `of`.
    pub fn new(count: usize, of: usize) -> Self {
        let share = (of > 0).then(|| count as f64 / of as f64);
        Self { count, of, share, interval: wilson(count, of) }
    }

    /// The share of the items that have a property.
    pub fn among<T>(items: impl IntoIterator<Item = T>, has: impl Fn(&T) -> bool) -> Self {
        let (mut count, mut of) = (0, 0);
        for item in items {
            count += usize::from(has(&item));
            of += 1;
        }
        Self::new(count, of)
    }

    /// The things without the property.
    pub fn rest(&self) -> usize {
        self.of - self.count
    }
}

/// The Wilson interval of a share, at 95 %; none if there is nothing.
fn wilson(count: usize, of: usize) -> Option<[f64; 2]> {
    if of == 0 {
        return None;
    }
    let (n, share) = (of as f64, count as f64 / of as f64);
    let middle = share + Z * Z / (2.0 * n);
    let half = Z * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + Z * Z / n;
    // Rounding leaves [0, 1] by 1e-17 where the share is 0 or 1.
    Some([((middle - half) / scale).max(0.0), ((middle + half) / scale).min(1.0)])
}

/// The p-value of the exact test of McNemar, two-sided: how likely changes this unequal or more are, if `lost` and `won` have the same
/// chance. It is 1 without changes.
pub fn mcnemar(lost: usize, won: usize) -> f64 {
    let (less, all) = (lost.min(won), lost + won);
    // Logarithms, because the terms of a thousand changes are less than the smallest number.
    let mut term = -(all as f64) * std::f64::consts::LN_2;
    let mut sum = 0.0;
    for k in 0..=less {
        sum += term.exp();
        term += ((all - k) as f64).ln() - ((k + 1) as f64).ln();
    }
    (2.0 * sum).min(1.0)
}

/// A percentile: `share` of the values are below. It is linear between the sorted values, the least of which is that of 0 and the largest
/// that of 1. Values that are not finite are ignored; none without values.
pub fn percentile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let place = share.clamp(0.0, 1.0) * sorted.len().checked_sub(1)? as f64;
    let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
    Some(below + (above - below) * place.fract())
}

/// The middle and the upper end of values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Middle {
    /// Number of values.
    pub count: usize,
    /// Median.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
}

impl Middle {
    /// Of the finite values; none without any.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.iter().filter(|v| v.is_finite()).count();
        Some(Self { count, median: percentile(values, 0.5)?, p95: percentile(values, 0.95)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_intervals_of_known_shares() {
        let near = |found: [f64; 2], known: [f64; 2]| (0..2).all(|i| (found[i] - known[i]).abs() < 5e-4);
        for (count, of, known) in
            [(8, 10, [0.490, 0.943]), (0, 10, [0.0, 0.278]), (10, 10, [0.722, 1.0]), (1, 1, [0.207, 1.0])]
        {
            let share = Share::new(count, of);
            assert!(near(share.interval.unwrap(), known), "{share:?}");
            assert!(share.interval.unwrap()[0] >= 0.0 && share.interval.unwrap()[1] <= 1.0);
        }
        assert_eq!((Share::new(0, 0).share, Share::new(0, 0).interval), (None, None));
        assert_eq!(Share::among([1, 2, 3], |n| *n > 1), Share::new(2, 3));
    }

    #[test]
    fn mcnemar_of_known_changes() {
        for (lost, won, known) in
            [(1, 9, 22.0 / 1024.0), (9, 1, 22.0 / 1024.0), (0, 5, 0.0625), (3, 3, 1.0), (0, 0, 1.0), (0, 1, 1.0)]
        {
            assert!((mcnemar(lost, won) - known).abs() < 1e-12, "{lost} {won}: {}", mcnemar(lost, won));
        }
        assert!((mcnemar(1, 9) - 0.0215).abs() < 5e-5);
        // The normal approximation with continuity correction: z = (|lost - won| - 1) / sqrt(lost + won) = 2.193.
        assert!((mcnemar(950, 1050) - 0.0268).abs() < 5e-4, "{}", mcnemar(950, 1050));
        assert_eq!(mcnemar(20_000, 0).min(1.0), mcnemar(0, 20_000));
    }

    #[test]
    fn percentiles_of_known_values() {
        let values: Vec<f64> = (0..=100).rev().map(f64::from).collect();
        assert_eq!(
            Middle::of(&values),
            Some(Middle { count: 101, median: 50.0, p95: 95.0 }),
            "sorted before they are read"
        );
        assert_eq!(percentile(&[1.0, 2.0], 0.5), Some(1.5));
        assert_eq!(percentile(&[7.0], 0.95), Some(7.0));
        assert_eq!((percentile(&[], 0.5), percentile(&[f64::NAN], 0.5), Middle::of(&[])), (None, None, None));
        assert_eq!(percentile(&[f64::NAN, 3.0], 0.5), Some(3.0));
    }
}
