//! Optimal one-to-one matching of two point sets.
//!
//! Jonker and Volgenant (1987): column reduction, augmenting row reduction, then shortest augmenting paths.
//! Costs are computed where they are needed: a row costs less to compute than to fetch from a large matrix. Roots are the
//! most expensive part; they are taken only where the squares say that they may matter. Paths are searched block by block of
//! neighbouring columns, of which most are too far away to be looked into.

mod columns;
mod path;

use artgs_raster::simd::{Level, level};
use columns::{Columns, WIDTH, below, nearby_order, store};
use fearless_simd::{Simd, dispatch, f32x16, prelude::*};
use path::Search;

const NONE: u32 = u32::MAX;

/// `partner[i]` is the point of `b` that goes with `a[i]`, so that the sum of Euclidean distances is least, up to the
/// rounding of f32. Both sets have the same size, below 2^24.
pub fn match_points(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<usize> {
    assert!(a.len() == b.len() && a.len() < 1 << 24, "a matching pairs two sets of equal size");
    let level = level();
    let order = nearby_order(b);
    let mut columns = Columns::new(order.iter().map(|&j| b[j]));
    let mut row_of = vec![NONE; b.len()];
    let mut column_of = vec![NONE; a.len()];
    reduce_columns(level, a, &mut columns, &mut row_of, &mut column_of);
    auction(level, a, &mut columns, &mut row_of, &mut column_of);
    let free = reduce_rows(level, a, &mut columns, &mut row_of, &mut column_of);
    let mut search = Search::new(&columns);
    for row in free {
        search.augment(level, a, row, &mut columns, &mut row_of, &mut column_of);
    }
    column_of.into_iter().map(|j| order[j as usize]).collect()
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (x, y, z) = (a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    (x * x + y * y + z * z).sqrt()
}

/// Prices every column at its cheapest row and pairs the two where the row is still free.
fn reduce_columns(level: Level, a: &[[f32; 3]], columns: &mut Columns, row_of: &mut [u32], column_of: &mut [u32]) {
    let rows = Columns::new(a.iter().copied());
    for j in 0..row_of.len() {
        let p = columns.point(j);
        let least = dispatch!(level, s => s.vectorize(#[inline(always)] || two_least(s, &rows, p)));
        columns.price[j] = least.first;
        if column_of[least.at] == NONE {
            (column_of[least.at], row_of[j]) = (j as u32, least.at as u32);
        }
    }
}

/// Brings the prices near their final values: in rounds of ever smaller steps, all rows bid for their best column at the
/// price of their second best and a step more (Bertsekas 1988). Only pairs that are best at the last prices stay.
/// With such prices augmenting paths are short: 5,000 pairs took 1.0 s without.
fn auction(level: Level, a: &[[f32; 3]], columns: &mut Columns, row_of: &mut [u32], column_of: &mut [u32]) {
    const SMALLER: f32 = 5.0;
    const ROUNDS: i32 = 5;
    let best = |columns: &Columns, row: usize| dispatch!(level, s => s.vectorize(#[inline(always)] || two_least(s, columns, a[row])));
    // A column costs its nearest row now: their mean is the length that matters.
    let scale = columns.price.iter().take(row_of.len()).sum::<f32>() / row_of.len().max(1) as f32;
    for round in (0..ROUNDS).filter(|_| scale > 0.0) {
        let step = scale * SMALLER.powi(1 - round);
        row_of.fill(NONE);
        column_of.fill(NONE);
        let mut queue: Vec<u32> = (0..a.len() as u32).rev().collect();
        // Bids that differ by a rounding error may never end.
        let mut bids = 50 * a.len();
        while let Some(row) = queue.pop().filter(|_| bids > 0) {
            bids -= 1;
            let least = best(columns, row as usize);
            let raise = if least.second.is_finite() { least.second - least.first } else { 0.0 };
            columns.price[least.at] -= raise + step;
            let owner = std::mem::replace(&mut row_of[least.at], row);
            column_of[row as usize] = least.at as u32;
            if owner != NONE {
                column_of[owner as usize] = NONE;
                queue.push(owner);
            }
        }
    }
    for row in 0..a.len() {
        let column = column_of[row];
        if column != NONE && best(columns, row).at != column as usize {
            (row_of[column as usize], column_of[row]) = (NONE, NONE);
        }
    }
}

struct TwoLeast {
    first: f32,
    second: f32,
    at: usize,
}

/// Least and second least of `distance - price` over all columns.
#[inline(always)]
fn two_least<S: Simd>(s: S, columns: &Columns, p: [f32; 3]) -> TwoLeast {
    let infinity = f32x16::splat(s, f32::INFINITY);
    let (mut first, mut second, mut at) = (infinity, infinity, f32x16::splat(s, 0.0));
    for j in (0..columns.price.len()).step_by(WIDTH) {
        let (square, price) = (columns.squares(s, p, j), columns.prices(s, j));
        if !below(s, square, second + price).any_true() {
            continue;
        }
        let cost = square.sqrt() - price;
        let better = cost.simd_lt(first);
        second = better.select(first, second.min(cost));
        first = better.select(cost, first);
        at = better.select(f32x16::splat(s, j as f32), at);
    }
    let (first, second, at) = (store(first), store(second), store(at));
    let lane = (1..WIDTH).fold(0, |best, l| if first[l] < first[best] { l } else { best });
    let others = (0..WIDTH).filter(|&l| l != lane).map(|l| first[l]);
    let second = others.fold(second[lane], f32::min);
    TwoLeast { first: first[lane], second, at: at[lane] as usize + lane }
}

/// Lets free rows bid for their best column at the price of their second best; returns rows that end up free.
fn reduce_rows(
    level: Level,
    a: &[[f32; 3]],
    columns: &mut Columns,
    row_of: &mut [u32],
    column_of: &mut [u32],
) -> Vec<usize> {
    let mut free: Vec<usize> = (0..a.len()).filter(|&i| column_of[i] == NONE).collect();
    // Bids that differ by a rounding error may never end.
    let mut bids = 8 * a.len();
    for _ in 0..2 {
        let mut left = Vec::new();
        let mut queue = std::mem::take(&mut free);
        queue.reverse();
        while let Some(row) = queue.pop() {
            if bids == 0 {
                left.push(row);
                continue;
            }
            bids -= 1;
            let least = dispatch!(level, s => s.vectorize(#[inline(always)] || two_least(s, columns, a[row])));
            let owner = row_of[least.at];
            let raise = least.second - least.first;
            let raised = columns.price[least.at] - raise;
            let strict = raised < columns.price[least.at] && raise.is_finite();
            if owner != NONE && !strict {
                left.push(row);
                continue;
            }
            if strict {
                columns.price[least.at] = raised;
            }
            (row_of[least.at], column_of[row]) = (row as u32, least.at as u32);
            if owner != NONE {
                column_of[owner as usize] = NONE;
                queue.push(owner as usize);
            }
        }
        free = left;
    }
    free
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;
    use rand_pcg::Pcg64Mcg;

    fn cloud(n: usize, rng: &mut Pcg64Mcg) -> Vec<[f32; 3]> {
        (0..n).map(|_| std::array::from_fn(|_| rng.random::<f32>())).collect()
    }

    fn cost(a: &[[f32; 3]], b: &[[f32; 3]], partner: &[usize]) -> f64 {
        let mut seen = partner.to_vec();
        seen.sort_unstable();
        assert!(seen.iter().enumerate().all(|(i, &j)| i == j), "not one to one");
        a.iter().zip(partner).map(|(&p, &j)| f64::from(distance(p, b[j]))).sum()
    }

    fn brute(a: &[[f32; 3]], b: &[[f32; 3]], taken: &mut Vec<usize>) -> f64 {
        let i = taken.len();
        if i == a.len() {
            return 0.0;
        }
        let mut best = f64::INFINITY;
        for j in 0..b.len() {
            if !taken.contains(&j) {
                taken.push(j);
                best = best.min(f64::from(distance(a[i], b[j])) + brute(a, b, taken));
                taken.pop();
            }
        }
        best
    }

    #[test]
    fn as_cheap_as_the_best_of_all_permutations() {
        let mut rng = Pcg64Mcg::new(3);
        for n in [1, 2, 3, 5, 7] {
            for _ in 0..20 {
                let (a, b) = (cloud(n, &mut rng), cloud(n, &mut rng));
                let found = cost(&a, &b, &match_points(&a, &b));
                assert!((found - brute(&a, &b, &mut Vec::new())).abs() < 1e-5);
            }
        }
        assert!(match_points(&[], &[]).is_empty());
    }

    /// O(n^3) Hungarian algorithm in f64, dense.
    fn hungarian(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
        let n = a.len();
        let (mut u, mut v, mut row) = (vec![0.0; n + 1], vec![0.0; n + 1], vec![0; n + 1]);
        for i in 1..=n {
            let (mut least, mut used, mut way) = (vec![f64::INFINITY; n + 1], vec![false; n + 1], vec![0; n + 1]);
            row[0] = i;
            let mut j0 = 0;
            while row[j0] != 0 {
                used[j0] = true;
                let (i0, mut delta, mut j1) = (row[j0], f64::INFINITY, 0);
                for j in (1..=n).filter(|&j| !used[j]) {
                    let c = f64::from(distance(a[i0 - 1], b[j - 1])) - u[i0] - v[j];
                    if c < least[j] {
                        (least[j], way[j]) = (c, j0);
                    }
                    if least[j] < delta {
                        (delta, j1) = (least[j], j);
                    }
                }
                for j in 0..=n {
                    if used[j] {
                        u[row[j]] += delta;
                        v[j] -= delta;
                    } else {
                        least[j] -= delta;
                    }
                }
                j0 = j1;
            }
            while j0 != 0 {
                row[j0] = row[way[j0]];
                j0 = way[j0];
            }
        }
        -v[0]
    }

    #[test]
    fn as_cheap_as_a_dense_hungarian_algorithm() {
        let mut rng = Pcg64Mcg::new(4);
        for n in [50, 203] {
            let (a, b) = (cloud(n, &mut rng), cloud(n, &mut rng));
            let (found, best) = (cost(&a, &b, &match_points(&a, &b)), hungarian(&a, &b));
            assert!((found - best).abs() < 1e-4, "{found} {best}");
        }
    }

    #[test]
    fn shuffled_noisy_copies_find_each_other_and_duplicates_do_no_harm() {
        let mut rng = Pcg64Mcg::new(5);
        let a = cloud(500, &mut rng);
        let b: Vec<[f32; 3]> = a.iter().rev().map(|p| p.map(|c| c + 1e-4 * rng.random::<f32>())).collect();
        assert!(match_points(&a, &b).iter().enumerate().all(|(i, &j)| j == 499 - i));
        let same = vec![[0.5; 3]; 40];
        assert_eq!(cost(&same, &same, &match_points(&same, &same)), 0.0);
        let grid: Vec<[f32; 3]> = (0..216).map(|i| [(i % 6) as f32, (i / 6 % 6) as f32, (i / 36) as f32]).collect();
        let moved: Vec<[f32; 3]> = grid.iter().map(|p| [p[0] + 1.0, p[1], p[2]]).collect();
        // 36 points go six steps, or all go one: either way 216.
        assert!((cost(&grid, &moved, &match_points(&grid, &moved)) - 216.0).abs() < 1e-3);
    }
}
