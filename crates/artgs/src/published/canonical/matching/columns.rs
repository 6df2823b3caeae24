//! The second point set as vectors, with prices.

use fearless_simd::{Simd, f32x16, mask32x16, prelude::*};

/// Columns looked at together.
pub(super) const WIDTH: usize = 16;

/// Columns: the second set, padded to whole vectors with points at infinity.
pub(super) struct Columns {
    pub(super) coordinates: [Vec<f32>; 3],
    /// Dual prices.
    pub(super) price: Vec<f32>,
}

/// Order in which points near each other in space mostly are so in the list: halves by the widest side, in turn.
pub(super) fn nearby_order(points: &[[f32; 3]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    split(points, &mut order);
    order
}

fn split(points: &[[f32; 3]], order: &mut [usize]) {
    if order.len() <= WIDTH {
        return;
    }
    let side = |axis: usize| {
        let range = |(low, high): (f32, f32), &i: &usize| (low.min(points[i][axis]), high.max(points[i][axis]));
        let (low, high) = order.iter().fold((f32::INFINITY, f32::NEG_INFINITY), range);
        high - low
    };
    let axis = (0..3).max_by(|&a, &b| side(a).total_cmp(&side(b))).unwrap_or(0);
    // Whole vectors on the left.
    let middle = (order.len() / 2).next_multiple_of(WIDTH);
    order.select_nth_unstable_by(middle, |&i, &j| points[i][axis].total_cmp(&points[j][axis]).then(i.cmp(&j)));
    let (left, right) = order.split_at_mut(middle);
    split(points, left);
    split(points, right);
}

impl Columns {
    pub(super) fn new(points: impl ExactSizeIterator<Item = [f32; 3]> + Clone) -> Self {
        let padded = points.len().next_multiple_of(WIDTH);
        let coordinate = |axis: usize| {
            let tail = std::iter::repeat_n(f32::INFINITY, padded - points.len());
            points.clone().map(|p| p[axis]).chain(tail).collect::<Vec<f32>>()
        };
        Self { coordinates: [0, 1, 2].map(coordinate), price: vec![0.0; padded] }
    }

    pub(super) fn point(&self, j: usize) -> [f32; 3] {
        [0, 1, 2].map(|axis| self.coordinates[axis][j])
    }

    /// Squared distances from a point to columns `at..at + WIDTH`.
    #[inline(always)]
    pub(super) fn squares<S: Simd>(&self, s: S, p: [f32; 3], at: usize) -> f32x16<S> {
        let x = f32x16::from_slice(s, &self.coordinates[0][at..at + WIDTH]) - f32x16::splat(s, p[0]);
        let y = f32x16::from_slice(s, &self.coordinates[1][at..at + WIDTH]) - f32x16::splat(s, p[1]);
        let z = f32x16::from_slice(s, &self.coordinates[2][at..at + WIDTH]) - f32x16::splat(s, p[2]);
        z.mul_add(z, y.mul_add(y, x * x))
    }

    #[inline(always)]
    pub(super) fn prices<S: Simd>(&self, s: S, at: usize) -> f32x16<S> {
        f32x16::from_slice(s, &self.price[at..at + WIDTH])
    }
}

/// Where the root of `square` may be less than `limit`.
#[inline(always)]
pub(super) fn below<S: Simd>(s: S, square: f32x16<S>, limit: f32x16<S>) -> mask32x16<S> {
    let limit = limit.max(f32x16::splat(s, 0.0));
    square.simd_le(limit * limit)
}

#[inline(always)]
pub(super) fn store<S: Simd>(v: f32x16<S>) -> [f32; WIDTH] {
    let mut out = [0.0; WIDTH];
    v.store_slice(&mut out);
    out
}
