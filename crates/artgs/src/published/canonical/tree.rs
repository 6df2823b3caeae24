//! Nearest neighbours among points.

use super::CanonicalError;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;
use std::num::NonZero;

/// A k-d tree over a fixed set of points.
pub(super) struct Tree(ImmutableKdTree<f32, 3>);

impl Tree {
    pub(super) fn new(points: &[[f32; 3]]) -> Result<Self, CanonicalError> {
        if points.is_empty() {
            return Err(CanonicalError::Empty("points to search among"));
        }
        ImmutableKdTree::new_from_slice(points).map(Self).map_err(|e| CanonicalError::Tree(e.to_string()))
    }

    /// Index of the nearest point and the squared distance to it.
    pub(super) fn nearest(&self, query: &[f32; 3]) -> (usize, f32) {
        let hit = self.0.query(query).nearest_one::<SquaredEuclidean<f32>>().execute();
        (hit.item as usize, hit.distance)
    }

    /// [`Tree::nearest`] for every query.
    pub(super) fn nearest_all(&self, queries: &[[f32; 3]]) -> Vec<(usize, f32)> {
        queries.par_iter().with_min_len(256).map(|q| self.nearest(q)).collect()
    }

    /// Indices of the `count` nearest points, nearest first, and the squared distances to them.
    pub(super) fn nearest_n(&self, query: &[f32; 3], count: NonZero<usize>) -> Vec<(usize, f32)> {
        let hits = self.0.query(query).nearest_n::<SquaredEuclidean<f32>>(count).execute();
        hits.into_iter().map(|hit| (hit.item as usize, hit.distance)).collect()
    }

    /// Indices of the points within a distance.
    pub(super) fn within(&self, query: &[f32; 3], radius: f32) -> Vec<usize> {
        let hits = self.0.query(query).within::<SquaredEuclidean<f32>>(radius * radius).execute();
        hits.into_iter().map(|hit| hit.item as usize).collect()
    }
}
