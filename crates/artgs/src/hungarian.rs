//! The assignment of least cost.

/// Least-cost assignment of rows to distinct columns of a dense matrix with `columns` columns, by shortest augmenting
/// paths in O(n^3). With more rows than columns the most expensive rows get none. Costs that are not finite count as 1e12.
pub fn hungarian(costs: &[Vec<f64>], columns: usize) -> Vec<Option<usize>> {
    let rows = costs.len();
    let cost = |r: usize, c: usize| if costs[r][c].is_finite() { costs[r][c] } else { 1e12 };
    if rows <= columns {
        return assign(rows, columns, cost).into_iter().map(Some).collect();
    }
    let mut out = vec![None; rows];
    for (column, row) in assign(columns, rows, |c, r| cost(r, c)).into_iter().enumerate() {
        out[row] = Some(column);
    }
    out
}

/// Column of every row, for at most as many rows as columns. `u`, `v` are the dual prices; index 0 is a sentinel.
fn assign(rows: usize, columns: usize, cost: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    let (mut u, mut v) = (vec![0.0; rows + 1], vec![0.0; columns + 1]);
    let (mut row_of, mut previous) = (vec![0usize; columns + 1], vec![0usize; columns + 1]);
    for row in 1..=rows {
        row_of[0] = row;
        let mut column = 0;
        let (mut slack, mut done) = (vec![f64::INFINITY; columns + 1], vec![false; columns + 1]);
        while row_of[column] != 0 {
            done[column] = true;
            let r = row_of[column];
            let (mut delta, mut next) = (f64::INFINITY, 0);
            for c in (1..=columns).filter(|c| !done[*c]) {
                let reduced = cost(r - 1, c - 1) - u[r] - v[c];
                if reduced < slack[c] {
                    (slack[c], previous[c]) = (reduced, column);
                }
                if slack[c] < delta {
                    (delta, next) = (slack[c], c);
                }
            }
            for c in 0..=columns {
                if done[c] {
                    u[row_of[c]] += delta;
                    v[c] -= delta;
                } else {
                    slack[c] -= delta;
                }
            }
            column = next;
        }
        while column != 0 {
            row_of[column] = row_of[previous[column]];
            column = previous[column];
        }
    }
    let mut out = vec![0; rows];
    for c in 1..=columns {
        if row_of[c] != 0 {
            out[row_of[c] - 1] = c - 1;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Least cost over all ways to give each row its own column.
    fn brute(costs: &[Vec<f64>], taken: &mut Vec<usize>) -> f64 {
        let Some(row) = costs.get(taken.len()) else { return 0.0 };
        let mut best = f64::INFINITY;
        for c in 0..row.len() {
            if !taken.contains(&c) {
                taken.push(c);
                best = best.min(row[c] + brute(costs, taken));
                taken.pop();
            }
        }
        best
    }

    #[test]
    fn as_cheap_as_trying_everything() {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        for (rows, columns) in [(1, 1), (3, 3), (5, 5), (3, 6), (0, 2)] {
            for _ in 0..20 {
                let costs: Vec<Vec<f64>> =
                    (0..rows).map(|_| (0..columns).map(|_| rng.random_range(-5.0..9.0)).collect()).collect();
                let out = hungarian(&costs, columns);
                let total: f64 = out.iter().enumerate().map(|(r, c)| costs[r][c.unwrap()]).sum();
                assert!((total - brute(&costs, &mut vec![])).abs() < 1e-9);
                let flipped: Vec<Vec<f64>> = (0..columns).map(|c| costs.iter().map(|r| r[c]).collect()).collect();
                let back = hungarian(&flipped, rows);
                let again: f64 = back.iter().enumerate().filter_map(|(c, r)| r.map(|r| costs[r][c])).sum();
                assert!((total - again).abs() < 1e-9 && back.iter().flatten().count() == rows);
            }
        }
    }
}
