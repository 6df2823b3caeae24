//! Order statistics: ranges of numbers without their outermost values, quantiles, medians.

use std::cmp::Ordering;

/// Least and greatest of the numbers after one in `one_in` has been left out on each side, so that strays do not count;
/// none without numbers. Sorts the numbers by `compare`, the `total_cmp` of their type.
pub(crate) fn trimmed_range<T: Copy>(
    values: &mut [T],
    one_in: usize,
    compare: impl FnMut(&T, &T) -> Ordering,
) -> Option<[T; 2]> {
    values.sort_unstable_by(compare);
    let cut = values.len() / one_in;
    Some([*values.get(cut)?, *values.get(values.len() - 1 - cut)?])
}

/// Value below which the share `at`, 0 to 1, of some numbers lies; none without numbers.
pub(crate) fn quantile(mut values: Vec<f32>, at: f32) -> Option<f32> {
    let index = (at * values.len().checked_sub(1)? as f32) as usize;
    Some(*values.select_nth_unstable_by(index, f32::total_cmp).1)
}

/// Median of some numbers, the upper one of two; none without numbers. Reorders them.
pub(crate) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strays_on_both_sides_are_left_out() {
        let mut values: Vec<f32> = (0..100).rev().map(|i| i as f32).collect();
        assert_eq!(trimmed_range(&mut values, 100, f32::total_cmp), Some([1.0, 98.0]));
        assert_eq!(trimmed_range(&mut values, 1000, f32::total_cmp), Some([0.0, 99.0]));
        assert_eq!(trimmed_range(&mut [], 100, f32::total_cmp), None);
    }

    #[test]
    fn quantiles_are_values_of_the_list() {
        assert_eq!(quantile(vec![5.0, 1.0, 3.0], 0.5), Some(3.0));
        assert_eq!(quantile(vec![5.0, 1.0, 3.0], 1.0), Some(5.0));
        assert_eq!(quantile(Vec::new(), 0.5), None);
        assert_eq!(median(&mut [5.0, 1.0, 3.0, 9.0]), Some(5.0));
        assert_eq!(median(&mut []), None);
    }
}
