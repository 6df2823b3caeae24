//! Nearest neighbours in 3D.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::num::NonZero;

/// A search tree over fixed points. Searching an empty tree finds nothing.
#[derive(Debug)]
pub(crate) struct PointTree(Option<ImmutableKdTree<f32, 3>>);

impl PointTree {
    /// Builds the tree over `points`, `[n][3]`, which must be finite.
    pub(crate) fn new(points: &[[f32; 3]]) -> Self {
        Self(ImmutableKdTree::new_from_slice(points).ok().filter(|_| !points.is_empty()))
    }

    /// Index of the nearest point and its squared distance.
    pub(crate) fn nearest(&self, query: &[f32; 3]) -> Option<(usize, f32)> {
        let found = self.0.as_ref()?.query(query).nearest_one::<SquaredEuclidean<f32>>().execute();
        Some((found.item as usize, found.distance))
    }

    /// The same within a squared distance; much faster than [`nearest`](Self::nearest) where there is nothing near.
    pub(crate) fn nearest_within(&self, query: &[f32; 3], limit: f32) -> Option<(usize, f32)> {
        let search = self.0.as_ref()?.query(query).nearest_n::<SquaredEuclidean<f32>>(NonZero::<usize>::MIN);
        let found = search.within::<SquaredEuclidean<f32>>(limit).execute();
        found.first().map(|hit| (hit.item as usize, hit.distance))
    }

    /// Calls `visit(index, squared distance)` for the `n` nearest points within a squared distance, nearest first.
    pub(crate) fn nearest_n(&self, query: &[f32; 3], n: usize, limit: f32, mut visit: impl FnMut(usize, f32)) {
        let (Some(tree), Some(n)) = (&self.0, NonZero::new(n)) else { return };
        let search = tree.query(query).nearest_n::<SquaredEuclidean<f32>>(n);
        for hit in search.within::<SquaredEuclidean<f32>>(limit).execute() {
            visit(hit.item as usize, hit.distance);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_nearest_and_survives_emptiness() {
        let points: Vec<[f32; 3]> =
            (0..100).map(|i| [(i as f32).sin(), (i as f32 * 0.7).cos(), i as f32 * 0.01]).collect();
        let tree = PointTree::new(&points);
        assert_eq!(tree.nearest(&points[42]), Some((42, 0.0)));
        let mut seen = Vec::new();
        tree.nearest_n(&points[7], 5, 100.0, |i, d| seen.push((i, d)));
        assert!(seen.len() == 5 && seen[0].0 == 7 && seen.windows(2).all(|w| w[0].1 <= w[1].1));
        for query in [[0.3, 0.2, 0.5], [9.0, 0.0, 0.0]] {
            let near = tree.nearest(&query).filter(|n| n.1 <= 0.5);
            assert_eq!(tree.nearest_within(&query, 0.5), near);
        }
        assert_eq!(PointTree::new(&[]).nearest(&[0.0; 3]), None);
        assert_eq!(PointTree::new(&[]).nearest_within(&[0.0; 3], 1.0), None);
    }
}
