//! Robust least squares for what views add to values that they share.

use crate::settings::GainSettings;

/// What a view shows of a point: the value of the point, unknown, plus `basis` times the coefficients of the view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row<const K: usize> {
    pub(super) view: usize,
    pub(super) basis: [f64; K],
    pub(super) value: f64,
}

/// Coefficients of `views` views from the rows of every point. Rows that contradict the others of their point count less;
/// `prior` has the weights that keep coefficients small, relative to the mean weight of a view.
pub(super) fn solved<const K: usize>(
    points: &[Vec<Row<K>>],
    views: usize,
    prior: [f64; K],
    settings: &GainSettings,
) -> Vec<[f64; K]> {
    let scale = settings.scale;
    let mut weights: Vec<Vec<f64>> = points.iter().map(|rows| initial(rows, scale)).collect();
    let mut out = vec![[0.0; K]; views];
    for _ in 0..settings.rounds {
        out = step(points, &weights, prior, out);
        for (rows, weights) in points.iter().zip(&mut weights) {
            let left: Vec<f64> = rows.iter().map(|row| row.value - dot(&out[row.view], &row.basis)).collect();
            let mean = mean(&left, weights);
            weights.iter_mut().zip(left).for_each(|(w, left)| *w = robust(left - mean, scale));
        }
    }
    out
}

/// Least squares with the values of the points eliminated, from a first guess.
fn step<const K: usize>(
    points: &[Vec<Row<K>>],
    weights: &[Vec<f64>],
    prior: [f64; K],
    guess: Vec<[f64; K]>,
) -> Vec<[f64; K]> {
    let views = guess.len();
    let mut diagonal = vec![[0.0; K]; views];
    for (row, w) in points.iter().flatten().zip(weights.iter().flatten()) {
        diagonal[row.view].iter_mut().zip(row.basis).for_each(|(d, b)| *d += w * b * b);
    }
    let mean_weight = diagonal.iter().flatten().sum::<f64>() / (K * views).max(1) as f64;
    let prior = prior.map(|share| (share * mean_weight).max(f64::MIN_POSITIVE));
    diagonal.iter_mut().for_each(|view| view.iter_mut().zip(prior).for_each(|(d, p)| *d += p));
    let normal = |of: &dyn Fn(&Row<K>) -> f64, sum: &mut Vec<[f64; K]>| {
        for (rows, weights) in points.iter().zip(weights) {
            let values: Vec<f64> = rows.iter().map(of).collect();
            let mean = mean(&values, weights);
            for ((row, w), value) in rows.iter().zip(weights).zip(values) {
                sum[row.view].iter_mut().zip(row.basis).for_each(|(s, b)| *s += w * b * (value - mean));
            }
        }
    };
    let mut right = vec![[0.0; K]; views];
    normal(&|row| row.value, &mut right);
    let apply = |x: &[[f64; K]]| {
        let mut sum: Vec<[f64; K]> = x.iter().map(|x| std::array::from_fn(|k| prior[k] * x[k])).collect();
        normal(&|row| dot(&x[row.view], &row.basis), &mut sum);
        sum
    };
    conjugate_gradients(&apply, &right, &diagonal, guess)
}

/// Solves `apply(x) = right`, symmetric and positive definite, from a guess; `diagonal` is that of the matrix.
pub(super) fn conjugate_gradients<const K: usize>(
    apply: &impl Fn(&[[f64; K]]) -> Vec<[f64; K]>,
    right: &[[f64; K]],
    diagonal: &[[f64; K]],
    mut x: Vec<[f64; K]>,
) -> Vec<[f64; K]> {
    /// Most iterations; views that share many points need about 20.
    const MOST: usize = 60;
    /// Residual, as a share of the right side, that is small enough.
    const SMALL: f64 = 1e-6;
    let inner = |a: &[[f64; K]], b: &[[f64; K]]| a.iter().zip(b).map(|(a, b)| dot(a, b)).sum::<f64>();
    let add = |a: &mut [[f64; K]], b: &[[f64; K]], factor: f64| {
        a.as_flattened_mut().iter_mut().zip(b.as_flattened()).for_each(|(a, b)| *a += factor * b);
    };
    let divided = |a: &[[f64; K]]| -> Vec<[f64; K]> {
        a.iter().zip(diagonal).map(|(a, d)| std::array::from_fn(|k| a[k] / d[k])).collect()
    };
    let mut left = right.to_vec();
    add(&mut left, &apply(&x), -1.0);
    let mut direction = divided(&left);
    let mut size = inner(&left, &direction);
    let enough = SMALL * SMALL * inner(right, &divided(right));
    for _ in 0..MOST {
        if size.is_nan() || size <= enough {
            break;
        }
        let image = apply(&direction);
        let length = size / inner(&direction, &image);
        add(&mut x, &direction, length);
        add(&mut left, &image, -length);
        let scaled = divided(&left);
        let next = inner(&left, &scaled);
        let ratio = next / size;
        let before = std::mem::replace(&mut direction, scaled);
        add(&mut direction, &before, ratio);
        size = next;
    }
    x
}

fn mean(values: &[f64], weights: &[f64]) -> f64 {
    values.iter().zip(weights).map(|(v, w)| v * w).sum::<f64>() / weights.iter().sum::<f64>()
}

pub(super) fn dot<const K: usize>(a: &[f64; K], b: &[f64; K]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Weight of a row by its residual, half at `scale`.
fn robust(residual: f64, scale: f64) -> f64 {
    1.0 / (1.0 + (residual / scale).powi(2))
}

/// Weights by the distance to the median of the rows.
fn initial<const K: usize>(rows: &[Row<K>], scale: f64) -> Vec<f64> {
    let mut values: Vec<f64> = rows.iter().map(|row| row.value).collect();
    values.sort_unstable_by(f64::total_cmp);
    let median = values.get(values.len() / 2).copied().unwrap_or(0.0);
    rows.iter().map(|row| robust(row.value - median, scale)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 200 points, of which each of 8 views sees half; a tenth of the rows is far off.
    fn points(offset: impl Fn(usize, f64) -> f64) -> Vec<Vec<Row<2>>> {
        let row = |point: usize, view: usize| {
            let slope = ((point * 7 + view) % 11) as f64 / 5.0 - 1.0;
            let wrong = if (point * 8 + view) % 10 == 3 { 1.5 } else { 0.0 };
            Row { view, basis: [1.0, slope], value: point as f64 * 0.01 + offset(view, slope) + wrong }
        };
        (0..200)
            .map(|p: usize| {
                (0..8_usize).filter(|v| (p + v).is_multiple_of(2) || p.is_multiple_of(5)).map(|v| row(p, v)).collect()
            })
            .collect()
    }

    #[test]
    fn differences_of_views_are_found_despite_wrong_rows() {
        let truth = |view: usize| [0.05 * (view as f64 - 3.5), 0.02 * ((view % 3) as f64 - 1.0)];
        let found =
            solved(&points(|view, slope| dot(&truth(view), &[1.0, slope])), 8, [3e-3; 2], &GainSettings::DEFAULT);
        for (view, [offset, slope]) in found.iter().enumerate() {
            let (wanted, first) = (truth(view), truth(0));
            assert!((offset - found[0][0] - wanted[0] + first[0]).abs() < 0.01, "{found:?}");
            assert!((slope - found[0][1] - wanted[1] + first[1]).abs() < 0.01, "{found:?}");
        }
    }

    #[test]
    fn views_that_agree_or_see_nothing_stay_as_they_are() {
        let found = solved(&points(|_, _| 0.0), 9, [3e-3; 2], &GainSettings::DEFAULT);
        assert!(found.iter().flatten().all(|c| c.abs() < 5e-3), "{found:?}");
        assert_eq!(found[8], [0.0; 2]);
        assert_eq!(solved(&[], 2, [3e-3], &GainSettings::DEFAULT), [[0.0], [0.0]]);
    }
}
