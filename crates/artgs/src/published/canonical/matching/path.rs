//! Shortest augmenting paths: Dijkstra's algorithm over reduced costs, with blocks of columns as lazy as can be.
//!
//! A block is a vector of neighbouring columns. What rows already on paths say about its columns is at first only bounded,
//! by the ball around the block and its highest price, and worked out when that bound is the least of all. Most blocks are
//! never looked into.

use super::columns::{Columns, WIDTH, store};
use super::{NONE, distance};
use artgs_raster::simd::Level;
use fearless_simd::{Simd, dispatch, f32x16, prelude::*};

/// Relative widening of the balls, so that rounding never makes a bound too high.
const SLACK: f32 = 1e-5;

/// Balls around the blocks, padded to whole vectors with balls at infinity.
struct Blocks {
    center: [Vec<f32>; 3],
    radius: Vec<f32>,
    /// Highest price of a column.
    price: Vec<f32>,
}

impl Blocks {
    fn new(columns: &Columns) -> Self {
        let count = columns.price.len() / WIDTH;
        let padded = count.next_multiple_of(WIDTH);
        let infinite = || vec![f32::INFINITY; padded];
        let mut blocks =
            Self { center: [infinite(), infinite(), infinite()], radius: vec![0.0; padded], price: vec![0.0; padded] };
        for block in 0..count {
            let own = block * WIDTH..(block + 1) * WIDTH;
            let points = || own.clone().map(|j| columns.point(j)).filter(|p| p[0].is_finite());
            let n = points().count().max(1) as f32;
            let center = [0, 1, 2].map(|axis| points().map(|p| p[axis]).sum::<f32>() / n);
            (0..3).for_each(|axis| blocks.center[axis][block] = center[axis]);
            let reach = points().map(|p| distance(p, center)).fold(0.0, f32::max);
            let far = center.iter().fold(reach, |far, c| far.max(c.abs()));
            blocks.radius[block] = reach + SLACK * far;
            blocks.update_price(columns, block);
        }
        blocks
    }

    fn update_price(&mut self, columns: &Columns, block: usize) {
        let prices = &columns.price[block * WIDTH..(block + 1) * WIDTH];
        self.price[block] = prices.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    }
}

/// A row on a path: where it is and how long the path to it is.
#[derive(Clone, Copy)]
struct Scanned {
    row: usize,
    point: [f32; 3],
    base: f32,
}

/// Workspace of the search for augmenting paths.
pub(super) struct Search {
    blocks: Blocks,
    /// Length of the shortest path found to every open column; minus infinity once a column is closed.
    open: Vec<f32>,
    /// Row before the column on its path, as a float.
    from: Vec<f32>,
    /// That length at the moment of closing.
    closed: Vec<(usize, f32)>,
    scanned: Vec<Scanned>,
    /// How many of the scanned rows the columns of a block know.
    known: Vec<usize>,
    /// Least length to an open column of a block by the rows it knows.
    least: Vec<f32>,
    /// Lower bound of the lengths by the rows it does not know.
    bound: Vec<f32>,
}

impl Search {
    pub(super) fn new(columns: &Columns) -> Self {
        let blocks = Blocks::new(columns);
        let (n, count) = (columns.price.len(), blocks.price.len());
        Self {
            blocks,
            open: vec![0.0; n],
            from: vec![0.0; n],
            closed: Vec::new(),
            scanned: Vec::new(),
            known: vec![0; count],
            least: vec![0.0; count],
            bound: vec![0.0; count],
        }
    }

    /// Pairs a free row by the shortest augmenting path.
    pub(super) fn augment(
        &mut self,
        level: Level,
        a: &[[f32; 3]],
        start: usize,
        columns: &mut Columns,
        row_of: &mut [u32],
        column_of: &mut [u32],
    ) {
        self.open.fill(f32::INFINITY);
        self.least.fill(f32::INFINITY);
        self.bound.fill(f32::INFINITY);
        self.known.fill(0);
        self.closed.clear();
        self.scanned.clear();
        let mut scanned = Scanned { row: start, point: a[start], base: 0.0 };
        let (sink, total) = loop {
            let (j, length) = dispatch!(level, s => s.vectorize(
                #[inline(always)]
                || self.nearest_open(s, columns, scanned),
            ));
            if row_of[j] == NONE {
                break (j, length);
            }
            self.close(j, length);
            let row = row_of[j] as usize;
            let base = length - (distance(a[row], columns.point(j)) - columns.price[j]);
            scanned = Scanned { row, point: a[row], base };
        };
        for &(j, length) in &self.closed {
            columns.price[j] += length - total;
            self.blocks.update_price(columns, j / WIDTH);
        }
        self.turn_over(start, sink, row_of, column_of);
    }

    fn close(&mut self, j: usize, length: f32) {
        let block = j / WIDTH;
        self.open[j] = f32::NEG_INFINITY;
        self.closed.push((j, length));
        let still = self.open[block * WIDTH..(block + 1) * WIDTH].iter().copied();
        self.least[block] = still.filter(|l| *l > f32::NEG_INFINITY).fold(f32::INFINITY, f32::min);
    }

    /// Takes one more row into account and returns the open column with the shortest path, and its length.
    #[inline(always)]
    fn nearest_open<S: Simd>(&mut self, s: S, columns: &Columns, scanned: Scanned) -> (usize, f32) {
        self.scanned.push(scanned);
        let mut block = self.bound_all(s, scanned);
        while self.bound[block] < self.least[block] {
            self.look_into(s, columns, block);
            block = self.most_promising(s);
        }
        let own = block * WIDTH..(block + 1) * WIDTH;
        let j = own.into_iter().find(|&j| self.open[j] == self.least[block]).unwrap_or(block * WIDTH);
        (j, self.least[block])
    }

    /// Bounds the lengths by way of a row in every block; the block with the least length or bound.
    #[inline(always)]
    fn bound_all<S: Simd>(&mut self, s: S, scanned: Scanned) -> usize {
        let blocks = &self.blocks;
        let p = scanned.point.map(|c| f32x16::splat(s, c));
        let base = f32x16::splat(s, scanned.base);
        let (mut first, mut at) = (f32x16::splat(s, f32::INFINITY), f32x16::splat(s, 0.0));
        for i in (0..self.bound.len()).step_by(WIDTH) {
            let axis = |axis: usize| f32x16::from_slice(s, &blocks.center[axis][i..i + WIDTH]) - p[axis];
            let (x, y, z) = (axis(0), axis(1), axis(2));
            let away = z.mul_add(z, y.mul_add(y, x * x)).sqrt();
            let apart = away * f32x16::splat(s, 1.0 - SLACK) - f32x16::from_slice(s, &blocks.radius[i..i + WIDTH]);
            let cost = apart.max(f32x16::splat(s, 0.0)) - f32x16::from_slice(s, &blocks.price[i..i + WIDTH]);
            let bound = f32x16::from_slice(s, &self.bound[i..i + WIDTH]).min(cost + base);
            bound.store_slice(&mut self.bound[i..i + WIDTH]);
            let key = bound.min(f32x16::from_slice(s, &self.least[i..i + WIDTH]));
            let better = key.simd_lt(first);
            first = better.select(key, first);
            at = better.select(f32x16::splat(s, i as f32), at);
        }
        first_lane(store(first), store(at))
    }

    /// The block with the least length or bound.
    #[inline(always)]
    fn most_promising<S: Simd>(&self, s: S) -> usize {
        let (mut first, mut at) = (f32x16::splat(s, f32::INFINITY), f32x16::splat(s, 0.0));
        for i in (0..self.bound.len()).step_by(WIDTH) {
            let bound = f32x16::from_slice(s, &self.bound[i..i + WIDTH]);
            let key = bound.min(f32x16::from_slice(s, &self.least[i..i + WIDTH]));
            let better = key.simd_lt(first);
            first = better.select(key, first);
            at = better.select(f32x16::splat(s, i as f32), at);
        }
        first_lane(store(first), store(at))
    }

    /// Adds to the columns of a block the rows that they do not know yet.
    #[inline(always)]
    fn look_into<S: Simd>(&mut self, s: S, columns: &Columns, block: usize) {
        let at = block * WIDTH;
        let closed = f32x16::splat(s, f32::NEG_INFINITY);
        let price = columns.prices(s, at);
        let mut open = f32x16::from_slice(s, &self.open[at..at + WIDTH]);
        let mut from = f32x16::from_slice(s, &self.from[at..at + WIDTH]);
        for scanned in &self.scanned[self.known[block]..] {
            let base = f32x16::splat(s, scanned.base);
            let length = columns.squares(s, scanned.point, at).sqrt() - price + base;
            let shorter = length.simd_lt(open);
            open = shorter.select(length, open);
            from = shorter.select(f32x16::splat(s, scanned.row as f32), from);
        }
        open.store_slice(&mut self.open[at..at + WIDTH]);
        from.store_slice(&mut self.from[at..at + WIDTH]);
        let lengths = store(open.simd_gt(closed).select(open, f32x16::splat(s, f32::INFINITY)));
        self.least[block] = lengths.into_iter().fold(f32::INFINITY, f32::min);
        self.known[block] = self.scanned.len();
        self.bound[block] = f32::INFINITY;
    }

    /// Pairs along the path that ends in the column `sink`.
    fn turn_over(&self, start: usize, sink: usize, row_of: &mut [u32], column_of: &mut [u32]) {
        let mut j = sink;
        loop {
            let row = self.from[j] as usize;
            row_of[j] = row as u32;
            let before = column_of[row];
            column_of[row] = j as u32;
            if row == start {
                return;
            }
            j = before as usize;
        }
    }
}

/// Index of the least value, given the index of the first lane of each.
#[inline(always)]
fn first_lane(values: [f32; WIDTH], at: [f32; WIDTH]) -> usize {
    let lane = (1..WIDTH).fold(0, |best, l| if values[l] < values[best] { l } else { best });
    at[lane] as usize + lane
}
