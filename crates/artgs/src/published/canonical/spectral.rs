//! Leading eigenvectors of the two affinities, by block subspace iteration.
//!
//! A block finds eigenvectors of equal eigenvalues, which well separated clusters have and a Krylov method with one
//! start vector misses.

use super::CanonicalError;
use super::tree::Tree;
use faer::linalg::solvers::Solve;
use faer::sparse::{SparseColMat, Triplet};
use faer::{MatMut, Side};
use nalgebra::{DMatrix, SymmetricEigen};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::num::NonZero;

/// Vectors beyond those wanted, for convergence.
const EXTRA: usize = 4;
const MAX_ITERATIONS: usize = 60;
const TOLERANCE: f64 = 1e-7;
/// Added to the normalised Laplacian, which is singular.
const SHIFT: f64 = 1e-6;
/// Weight of a link between components whose gap equals their local spacing.
const LINK: f64 = 1e-3;

/// `[n][columns]`, row-major.
pub(super) struct Rows {
    pub(super) values: Vec<f64>,
    pub(super) columns: usize,
}

impl Rows {
    pub(super) fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.columns..(i + 1) * self.columns]
    }

    pub(super) fn len(&self) -> usize {
        self.values.len() / self.columns.max(1)
    }

    /// Divides rows by their lengths.
    pub(super) fn normalise(&mut self) {
        for row in self.values.chunks_exact_mut(self.columns) {
            let length = row.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-300);
            row.iter_mut().for_each(|v| *v /= length);
        }
    }
}

/// Undirected weighted edges, each once.
type Edges = Vec<Edge>;
type Edge = (usize, usize, f64);

/// Nearest neighbours of every point, itself left out.
pub(super) fn neighbours(points: &[[f32; 3]], count: usize) -> Result<Vec<Vec<(usize, f32)>>, CanonicalError> {
    let tree = Tree::new(points)?;
    let wanted = NonZero::new(count + 1).unwrap_or(NonZero::<usize>::MIN);
    let of = |(i, p): (usize, &[f32; 3])| {
        let mut found = tree.nearest_n(p, wanted);
        found.retain(|hit| hit.0 != i);
        found.truncate(count);
        found
    };
    Ok(points.par_iter().enumerate().map(of).collect())
}

/// First `wanted` eigenvectors of the normalised Laplacian of the neighbourhood graph. Weights are
/// `exp(-d^2 / (s_i s_j))`, `s` being the distance to a neighbour a third down the list (after
/// Zelnik-Manor and Perona 2004; nearer than theirs, to weaken edges across narrow gaps), so nothing
/// depends on the unit. Components of the graph are joined by a spanning tree of weak links.
pub(super) fn graph_embedding(
    points: &[[f32; 3]],
    near: &[Vec<(usize, f32)>],
    component: &[u32],
    wanted: usize,
    rng: &mut Pcg64Mcg,
) -> Result<Rows, CanonicalError> {
    let n = points.len();
    let local = |hits: &Vec<(usize, f32)>| hits.get(hits.len() / 3).map_or(0.0, |hit| f64::from(hit.1).sqrt());
    let spacing: Vec<f64> = near.iter().map(local).collect();
    let typical = spacing.iter().sum::<f64>() / n as f64;
    let spacing: Vec<f64> = spacing.into_iter().map(|s| s.max(1e-6 * typical).max(1e-30)).collect();
    let mut edges = Edges::new();
    for (i, hits) in near.iter().enumerate() {
        for &(j, square) in hits {
            let mutual = near[j].iter().any(|hit| hit.0 == i);
            if i < j || !mutual {
                edges.push((i, j, (-f64::from(square) / (spacing[i] * spacing[j])).exp()));
            }
        }
    }
    for (i, j, square) in spanning_links(points, component)? {
        edges.push((i, j, LINK * (spacing[i] * spacing[j] / square.max(1e-300)).min(1.0)));
    }
    let mut degree = vec![0.0; n];
    for &(i, j, w) in &edges {
        degree[i] += w;
        degree[j] += w;
    }
    let scaled = |i: usize, j: usize, w: f64| -w / (degree[i] * degree[j]).sqrt();
    let both = edges.iter().flat_map(|&(i, j, w)| [(i, j, w), (j, i, w)]);
    let triplets: Vec<Triplet<usize, usize, f64>> = (0..n)
        .map(|i| Triplet::new(i, i, 1.0 + SHIFT))
        .chain(both.map(|(i, j, w)| Triplet::new(i, j, scaled(i, j, w))))
        .collect();
    let fail = |e: &dyn std::fmt::Debug| CanonicalError::Factorisation(format!("{e:?}"));
    let laplacian = SparseColMat::<usize, f64>::try_new_from_triplets(n, n, &triplets).map_err(|e| fail(&e))?;
    let factor = laplacian.sp_cholesky(Side::Lower).map_err(|e| fail(&e))?;
    let solve = |rows: &Rows| {
        let mut values = rows.values.clone();
        factor.solve_in_place(MatMut::from_row_major_slice_mut(&mut values, n, rows.columns));
        Rows { values, columns: rows.columns }
    };
    Ok(dominant_subspace(n, wanted, solve, rng))
}

/// Edges that join the components into one: a minimum spanning tree over the components' nearest pairs of points, with
/// squared lengths.
fn spanning_links(points: &[[f32; 3]], component: &[u32]) -> Result<Edges, CanonicalError> {
    let count = component.iter().max().map_or(0, |&c| c as usize + 1);
    let mut members = vec![Vec::new(); count];
    component.iter().enumerate().for_each(|(i, &c)| members[c as usize].push(i));
    let mut links = Edges::new();
    // Prim: shortest known link from the growing tree to every component outside.
    let mut outside: Vec<(usize, Option<Edge>)> = (1..count).map(|c| (c, None)).collect();
    let mut newest = 0;
    while !outside.is_empty() {
        let of_newest: Vec<[f32; 3]> = members[newest].iter().map(|&i| points[i]).collect();
        let tree = Tree::new(&of_newest)?;
        for (c, best) in &mut outside {
            for &i in &members[*c] {
                let (j, square) = tree.nearest(&points[i]);
                if best.is_none_or(|b| f64::from(square) < b.2) {
                    *best = Some((i, members[newest][j], f64::from(square)));
                }
            }
        }
        let length = |o: &(usize, Option<Edge>)| o.1.map_or(f64::INFINITY, |link| link.2);
        let next = (1..outside.len()).fold(0, |a, b| if length(&outside[b]) < length(&outside[a]) { b } else { a });
        let (c, link) = outside.swap_remove(next);
        links.extend(link);
        newest = c;
    }
    Ok(links)
}

/// First `wanted` eigenvectors of the dense radial basis affinity `exp(-gamma d^2)`, normalised without its diagonal,
/// and divided by the roots of the degrees.
pub(super) fn dense_embedding(points: &[[f32; 3]], gamma: f64, wanted: usize, rng: &mut Pcg64Mcg) -> Rows {
    let n = points.len();
    let mut affinity = vec![0.0f64; n * n];
    affinity.par_chunks_mut(n.max(1)).enumerate().for_each(|(i, row)| {
        for (j, w) in row.iter_mut().enumerate() {
            let side = |a: usize| f64::from(points[i][a]) - f64::from(points[j][a]);
            let square = side(0).powi(2) + side(1).powi(2) + side(2).powi(2);
            *w = if i == j { 0.0 } else { (-gamma * square).exp() };
        }
    });
    let root: Vec<f64> = affinity.par_chunks(n.max(1)).map(|row| row.iter().sum::<f64>().max(1e-300).sqrt()).collect();
    affinity.par_chunks_mut(n.max(1)).enumerate().for_each(|(i, row)| {
        row.iter_mut().zip(&root).for_each(|(w, r)| *w /= root[i] * r);
    });
    let apply = |rows: &Rows| {
        let columns = rows.columns;
        let mut values = vec![0.0; n * columns];
        values.par_chunks_mut(columns).zip(affinity.par_chunks(n)).for_each(|(out, weights)| {
            for (w, row) in weights.iter().zip(rows.values.chunks_exact(columns)) {
                out.iter_mut().zip(row).for_each(|(o, v)| *o += w * v);
            }
        });
        Rows { values, columns }
    };
    let mut vectors = dominant_subspace(n, wanted, apply, rng);
    let columns = vectors.columns;
    vectors.values.chunks_exact_mut(columns).zip(&root).for_each(|(row, r)| row.iter_mut().for_each(|v| *v /= r));
    vectors
}

/// Eigenvectors of the largest eigenvalues of a symmetric operator, largest first.
fn dominant_subspace(n: usize, wanted: usize, apply: impl Fn(&Rows) -> Rows, rng: &mut Pcg64Mcg) -> Rows {
    let wanted = wanted.min(n);
    let columns = (wanted + EXTRA).min(n);
    let mut basis = Rows { values: (0..n * columns).map(|_| rng.random::<f64>() - 0.5).collect(), columns };
    orthonormalise(&mut basis);
    let mut before = vec![0.0; wanted];
    for iteration in 1..=MAX_ITERATIONS {
        let image = apply(&basis);
        let small = inner(&basis, &image);
        let eigen = SymmetricEigen::new((&small + small.transpose()) * 0.5);
        let mut order: Vec<usize> = (0..columns).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let now: Vec<f64> = order[..wanted].iter().map(|&c| eigen.eigenvalues[c]).collect();
        let settled = now.iter().zip(&before).all(|(a, b)| (a - b).abs() <= TOLERANCE * a.abs());
        before = now;
        if settled || iteration == MAX_ITERATIONS {
            let turn = DMatrix::from_fn(columns, wanted, |r, c| eigen.eigenvectors[(r, order[c])]);
            return times(&basis, &turn);
        }
        let turn = DMatrix::from_fn(columns, columns, |r, c| eigen.eigenvectors[(r, order[c])]);
        basis = times(&image, &turn);
        orthonormalise(&mut basis);
    }
    basis
}

fn inner(a: &Rows, b: &Rows) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(a.columns, b.columns);
    for i in 0..a.len() {
        let (x, y) = (a.row(i), b.row(i));
        for (c, yc) in y.iter().enumerate() {
            x.iter().enumerate().for_each(|(r, xr)| out[(r, c)] += xr * yc);
        }
    }
    out
}

fn times(a: &Rows, m: &DMatrix<f64>) -> Rows {
    let columns = m.ncols();
    let mut values = Vec::with_capacity(a.len() * columns);
    for i in 0..a.len() {
        let row = a.row(i);
        values.extend((0..columns).map(|c| (0..a.columns).map(|r| row[r] * m[(r, c)]).sum::<f64>()));
    }
    Rows { values, columns }
}

/// Gram and Schmidt, twice for accuracy.
fn orthonormalise(rows: &mut Rows) {
    let columns = rows.columns;
    for c in 0..columns {
        for _ in 0..2 {
            let mut along = vec![0.0; c + 1];
            for row in rows.values.chunks_exact(columns) {
                (0..=c).for_each(|b| along[b] += row[b] * row[c]);
            }
            for row in rows.values.chunks_exact_mut(columns) {
                row[c] -= (0..c).map(|b| along[b] * row[b]).sum::<f64>();
            }
            let square: f64 = rows.values.chunks_exact(columns).map(|row| row[c] * row[c]).sum();
            let scale = 1.0 / square.sqrt().max(1e-300);
            rows.values.chunks_exact_mut(columns).for_each(|row| row[c] *= scale);
        }
    }
}
