//! Finds the pieces near a point.

use super::Pieces;
use glam::DVec3;

/// Pieces, sorted into slabs across the longest side of the box around them.
pub(super) struct Slabs<'a> {
    pieces: &'a Pieces,
    /// Distance within which a piece is near.
    near: f64,
    axis: usize,
    low: f64,
    width: f64,
    slabs: Vec<Vec<usize>>,
}

impl<'a> Slabs<'a> {
    pub(super) fn new(pieces: &'a Pieces, near: f64) -> Self {
        /// Number of slabs.
        const COUNT: usize = 128;
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = pieces.boxes.iter().fold(start, |(l, h), [low, high]| (l.min(*low), h.max(*high)));
        let axis = if pieces.boxes.is_empty() { 0 } else { (high - low).max_position() };
        let (low, high) = (low[axis] - near, high[axis] + near);
        let mut out =
            Self { pieces, near, axis, low, width: (high - low) / COUNT as f64, slabs: vec![Vec::new(); COUNT] };
        for (piece, [low, high]) in pieces.boxes.iter().enumerate() {
            let ends = [low[axis] - near, high[axis] + near].map(|at| out.slab(at));
            out.slabs[ends[0]..=ends[1]].iter_mut().for_each(|slab| slab.push(piece));
        }
        out
    }

    fn slab(&self, at: f64) -> usize {
        (((at - self.low) / self.width).max(0.0) as usize).min(self.slabs.len() - 1)
    }

    /// All pieces near a point, in order.
    pub(super) fn covering(&self, p: DVec3) -> impl Iterator<Item = usize> {
        self.slabs[self.slab(p[self.axis])]
            .iter()
            .copied()
            .filter(move |piece| self.pieces.is_near(*piece, p, self.near))
    }

    /// True if a piece is near a point, by its planes.
    pub(super) fn cover(&self, p: DVec3) -> bool {
        self.covering(p).next().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::hull::Hull;

    #[test]
    fn pieces_near_a_point_are_those_of_a_search_through_all() {
        let mut pieces = Pieces::default();
        assert!(!Slabs::new(&pieces, 0.1).cover(DVec3::ZERO));
        for i in 0..40 {
            let at = DVec3::new((i * 7 % 40) as f64 * 0.1, (i % 3) as f64 * 0.2, 0.0);
            let corner = |k: usize| at + DVec3::new((k & 1) as f64 * 0.3, (k >> 1 & 1) as f64, (k >> 2) as f64) * 0.5;
            pieces.push(Hull::of(&(0..8).map(corner).collect::<Vec<_>>(), 1e-3).unwrap());
        }
        let near = 0.07;
        let slabs = Slabs::new(&pieces, near);
        for i in 0..3000 {
            let [a, b] = [0.7549, 0.5698].map(|step| (f64::from(i) * step).fract());
            let p = DVec3::new(5.0 * a - 0.4, 1.6 * b - 0.3, 0.2);
            let all: Vec<usize> = (0..40).filter(|piece| pieces.is_near(*piece, p, near)).collect();
            assert_eq!(slabs.covering(p).collect::<Vec<_>>(), all, "{p}");
        }
    }
}
