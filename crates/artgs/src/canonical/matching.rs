//! Optimal one-to-one matching of two point sets.
//!
//! Jonker and Volgenant (1987): column reduction, augmenting row reduction, then shortest augmenting paths.
//! Costs are computed where they are needed: a row costs less to compute than to fetch from a large matrix. Roots are the
//! dearest part; they are taken only where the squares say that they may matter.

use artgs_raster::simd::{Level, level};
use fearless_simd::{Simd, dispatch, f32x16, mask32x16, prelude::*};

const WIDTH: usize = 16;
const NONE: u32 = u32::MAX;

/// Columns: the second set, padded to whole vectors with points at infinity.
struct Columns {
    coordinates: [Vec<f32>; 3],
    /// Dual prices.
    price: Vec<f32>,
}

/// State of one search for an augmenting path.
struct Search {
    /// Length of the shortest path to every open column; minus infinity once a column is closed.
    open: Vec<f32>,
    /// That length at the moment of closing.
    closed: Vec<(usize, f32)>,
    /// Row before the column on its path, as a float.
    from: Vec<f32>,
}

/// `partner[i]` is the point of `b` that goes with `a[i]`, so that the sum of Euclidean distances is least, up to the
/// rounding of f32. Both sets have the same size, below 2^24.
pub fn match_points(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<usize> {
    assert!(a.len() == b.len() && a.len() < 1 << 24, "a matching pairs two sets of equal size");
    let level = level();
    let padded = b.len().next_multiple_of(WIDTH);
    let coordinate = |axis: usize| {
        let tail = std::iter::repeat_n(f32::INFINITY, padded - b.len());
        b.iter().map(|p| p[axis]).chain(tail).collect::<Vec<f32>>()
    };
    let mut columns = Columns { coordinates: [0, 1, 2].map(coordinate), price: vec![0.0; padded] };
    let mut row_of = vec![NONE; b.len()];
    let mut column_of = vec![NONE; a.len()];
    reduce_columns(level, a, b, &mut columns, &mut row_of, &mut column_of);
    let free = reduce_rows(level, a, &mut columns, &mut row_of, &mut column_of);
    let mut search = Search { open: vec![0.0; padded], closed: Vec::new(), from: vec![0.0; padded] };
    for row in free {
        augment(level, a, row, &mut columns, &mut search, &mut row_of, &mut column_of);
    }
    column_of.into_iter().map(|j| j as usize).collect()
}

fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (x, y, z) = (a[0] - b[0], a[1] - b[1], a[2] - b[2]);
    (x * x + y * y + z * z).sqrt()
}

impl Columns {
    fn point(&self, j: usize) -> [f32; 3] {
        [0, 1, 2].map(|axis| self.coordinates[axis][j])
    }

    /// Squared distances from a point to columns `at..at + WIDTH`.
    #[inline(always)]
    fn squares<S: Simd>(&self, s: S, p: [f32; 3], at: usize) -> f32x16<S> {
        let x = f32x16::from_slice(s, &self.coordinates[0][at..at + WIDTH]) - f32x16::splat(s, p[0]);
        let y = f32x16::from_slice(s, &self.coordinates[1][at..at + WIDTH]) - f32x16::splat(s, p[1]);
        let z = f32x16::from_slice(s, &self.coordinates[2][at..at + WIDTH]) - f32x16::splat(s, p[2]);
        z.mul_add(z, y.mul_add(y, x * x))
    }

    #[inline(always)]
    fn prices<S: Simd>(&self, s: S, at: usize) -> f32x16<S> {
        f32x16::from_slice(s, &self.price[at..at + WIDTH])
    }
}

/// Where the root of `square` may be less than `limit`.
#[inline(always)]
fn below<S: Simd>(s: S, square: f32x16<S>, limit: f32x16<S>) -> mask32x16<S> {
    let limit = limit.max(f32x16::splat(s, 0.0));
    square.simd_le(limit * limit)
}

#[inline(always)]
fn store<S: Simd>(v: f32x16<S>) -> [f32; WIDTH] {
    let mut out = [0.0; WIDTH];
    v.store_slice(&mut out);
    out
}

/// Prices every column at its cheapest row and pairs the two where the row is still free.
fn reduce_columns(
    level: Level,
    a: &[[f32; 3]],
    b: &[[f32; 3]],
    columns: &mut Columns,
    row_of: &mut [u32],
    column_of: &mut [u32],
) {
    let padded = a.len().next_multiple_of(WIDTH);
    let coordinate = |axis: usize| {
        let tail = std::iter::repeat_n(f32::INFINITY, padded - a.len());
        a.iter().map(|p| p[axis]).chain(tail).collect::<Vec<f32>>()
    };
    let rows = Columns { coordinates: [0, 1, 2].map(coordinate), price: vec![0.0; padded] };
    for (j, &p) in b.iter().enumerate() {
        let least = dispatch!(level, s => s.vectorize(#[inline(always)] || two_least(s, &rows, p)));
        columns.price[j] = least.first;
        if column_of[least.at] == NONE {
            (column_of[least.at], row_of[j]) = (j as u32, least.at as u32);
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
    // Bids of a rounding error can go on for ever.
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

/// Extends the paths by the edges out of `row` and returns the nearest open column with the length to it.
#[inline(always)]
fn relax<S: Simd>(s: S, columns: &Columns, search: &mut Search, p: [f32; 3], row: usize, base: f32) -> (usize, f32) {
    let infinity = f32x16::splat(s, f32::INFINITY);
    let (mut least, mut at) = (infinity, f32x16::splat(s, 0.0));
    let (base, row) = (f32x16::splat(s, base), f32x16::splat(s, row as f32));
    for j in (0..columns.price.len()).step_by(WIDTH) {
        let (square, price) = (columns.squares(s, p, j), columns.prices(s, j));
        let mut open = f32x16::from_slice(s, &search.open[j..j + WIDTH]);
        if below(s, square, open - base + price).any_true() {
            let length = square.sqrt() - price + base;
            let from = f32x16::from_slice(s, &search.from[j..j + WIDTH]);
            let shorter = length.simd_lt(open);
            open = shorter.select(length, open);
            open.store_slice(&mut search.open[j..j + WIDTH]);
            shorter.select(row, from).store_slice(&mut search.from[j..j + WIDTH]);
        }
        let is_open = open.simd_gt(f32x16::splat(s, f32::NEG_INFINITY));
        let key = is_open.select(open, infinity);
        let better = key.simd_lt(least);
        least = better.select(key, least);
        at = better.select(f32x16::splat(s, j as f32), at);
    }
    let (least, at) = (store(least), store(at));
    let lane = (1..WIDTH).fold(0, |best, l| if least[l] < least[best] { l } else { best });
    (at[lane] as usize + lane, least[lane])
}

/// Pairs a free row by the shortest augmenting path (Dijkstra over reduced costs).
fn augment(
    level: Level,
    a: &[[f32; 3]],
    start: usize,
    columns: &mut Columns,
    search: &mut Search,
    row_of: &mut [u32],
    column_of: &mut [u32],
) {
    search.open.fill(f32::INFINITY);
    search.closed.clear();
    let (mut row, mut base) = (start, 0.0);
    let (sink, total) = loop {
        let (j, length) =
            dispatch!(level, s => s.vectorize(#[inline(always)] || relax(s, columns, search, a[row], row, base)));
        if row_of[j] == NONE {
            break (j, length);
        }
        search.open[j] = f32::NEG_INFINITY;
        search.closed.push((j, length));
        row = row_of[j] as usize;
        base = length - (distance(a[row], columns.point(j)) - columns.price[j]);
    };
    for &(j, length) in &search.closed {
        columns.price[j] += length - total;
    }
    let mut j = sink;
    loop {
        let row = search.from[j] as usize;
        row_of[j] = row as u32;
        let before = column_of[row];
        column_of[row] = j as u32;
        if row == start {
            return;
        }
        j = before as usize;
    }
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
