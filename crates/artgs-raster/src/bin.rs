//! Which Gaussians touch which tiles, front to back, and back from a Gaussian to its places in the tiles' lists.

use crate::project::Flat;
use crate::sort::sort_pairs;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Side of a tile in pixels.
pub(crate) const TILE: usize = 16;
/// Side of a block in pixels; a tile is 2 x 2 blocks.
pub(crate) const BLOCK: usize = 8;
/// Low bits of an entry of a list: the Gaussian. The four high bits are the blocks of the tile it touches.
pub(crate) const INDEX: u32 = (1 << 28) - 1;
/// Key of a Gaussian that is not drawn.
pub(crate) const NOT_DRAWN: u32 = u32::MAX;
/// Gaussians are distributed in at most this many independent runs.
const RUNS: usize = 16;
const RUN_MIN: usize = 1024;

/// One Gaussian in the list of a tile; atomic only so that runs can be written side by side without locks.
#[derive(Debug, Default)]
pub(crate) struct Entry(AtomicU32);

/// The bit of an entry that says whether it touches a block.
#[inline(always)]
pub(crate) const fn block_bit(block: usize) -> u32 {
    1 << (28 + block)
}

/// Tiles and blocks of an image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Grid {
    pub(crate) tiles: [usize; 2],
    blocks: [usize; 2],
}

/// A consecutive run of the Gaussians in order of depth.
#[derive(Debug, Default)]
struct Run {
    /// Tile and entry of every intersection; afterwards place in `entries` and entry.
    hits: Vec<[u32; 2]>,
    /// Start in `hits` of each Gaussian of the run, and the end.
    starts: Vec<u32>,
    /// Intersections of this run with each tile; afterwards the next free place.
    cursors: Vec<u32>,
}

/// Lists of all tiles, and their transposition.
#[derive(Debug, Default)]
pub(crate) struct Bins {
    /// (key of depth, Gaussian) of the drawn ones, sorted; and scratch for sorting.
    order: Vec<[u32; 2]>,
    scratch: Vec<[u32; 2]>,
    /// Place of each Gaussian in `order`.
    ranks: Vec<u32>,
    runs: Vec<Run>,
    run_len: usize,
    /// Start of each tile's list in `entries`, and the end.
    offsets: Vec<u32>,
    entries: Vec<Entry>,
    /// Tiles with a list, ascending.
    pub(crate) active: Vec<u32>,
}

impl Entry {
    /// Gaussian and blocks.
    #[inline(always)]
    pub(crate) fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

impl Grid {
    pub(crate) fn new([width, height]: [usize; 2]) -> Self {
        Self {
            tiles: [width.div_ceil(TILE), height.div_ceil(TILE)],
            blocks: [width.div_ceil(BLOCK), height.div_ceil(BLOCK)],
        }
    }

    /// Top left pixel of a tile.
    pub(crate) fn origin(&self, tile: usize) -> [usize; 2] {
        [tile % self.tiles[0] * TILE, tile / self.tiles[0] * TILE]
    }

    /// First and last block along an axis with a pixel centre in `center +- half`.
    fn block_range(&self, axis: usize, low: f32, high: f32) -> Option<[usize; 2]> {
        let last = self.blocks[axis] as f32 - 1.0;
        let (a, b) = (((low - 0.5).ceil() / BLOCK as f32).floor(), ((high - 0.5).floor() / BLOCK as f32).floor());
        (a <= last && b >= 0.0 && a <= b).then(|| [a.max(0.0) as usize, b.min(last) as usize])
    }

    /// First and last block of row `row` that the ellipse of the Gaussian reaches.
    fn blocks_in_row(&self, g: &Flat, row: usize) -> Option<[usize; 2]> {
        let top = (row * BLOCK) as f32 + 0.5 - g.y;
        let bottom = top + (BLOCK - 1) as f32;
        let (low, high) = (top.max(-g.half[1]), bottom.min(g.half[1]));
        if low > high {
            return None;
        }
        // The right border is concave in dy and peaks where the gradient has no y; the left one is its mirror image.
        let peak = -g.xy / (2.0 * g.yy) * g.half[0];
        let reach = 4.0 * -g.xx * (g.log2_opacity - crate::project::LOG2_CUT + 1e-3);
        let border = |dy: f32, side: f32| {
            let root = (reach - g.discriminant * dy * dy).max(0.0).sqrt();
            (g.xy * dy + side * root) / (-2.0 * g.xx)
        };
        let right = border(peak.max(low).min(high), 1.0).min(g.half[0]) + 0.01;
        let left = border((-peak).max(low).min(high), -1.0).max(-g.half[0]) - 0.01;
        self.block_range(0, g.x + left, g.x + right)
    }

    /// Calls `hit(tile, blocks)` for every tile the Gaussian touches, in order of tiles.
    fn for_each_tile(&self, g: &Flat, mut hit: impl FnMut(usize, u32)) {
        let Some([first, last]) = self.block_range(1, g.y - g.half[1], g.y + g.half[1]) else { return };
        for tile_row in first / 2..=last / 2 {
            let rows = [0, 1].map(|half| {
                let row = 2 * tile_row + half;
                if (first..=last).contains(&row) { self.blocks_in_row(g, row) } else { None }
            });
            let Some(left) = rows.iter().flatten().map(|r| r[0]).min() else { continue };
            let right = rows.iter().flatten().map(|r| r[1]).max().unwrap_or(left);
            for tile_column in left / 2..=right / 2 {
                let mut blocks = 0;
                for (half, range) in rows.iter().enumerate() {
                    let Some([from, to]) = range else { continue };
                    for k in 0..2 {
                        let column = 2 * tile_column + k;
                        blocks |= u32::from(*from <= column && column <= *to) * block_bit(2 * half + k);
                    }
                }
                if blocks != 0 {
                    hit(tile_row * self.tiles[0] + tile_column, blocks);
                }
            }
        }
    }
}

impl Bins {
    /// Rebuilds the lists. `keys` orders the Gaussians by depth; ties go by index.
    pub(crate) fn fill(&mut self, grid: &Grid, flats: &[Flat], keys: &[u32]) {
        assert!(flats.len() <= INDEX as usize, "at most 2^28 Gaussians");
        self.sort(keys);
        let tiles = grid.tiles[0] * grid.tiles[1];
        self.run_len = RUN_MIN.max(self.order.len().div_ceil(RUNS));
        let count = self.order.len().div_ceil(self.run_len);
        if self.runs.len() < count {
            self.runs.resize_with(count, Run::default);
        }
        let runs = &mut self.runs[..count];
        runs.par_iter_mut()
            .zip(self.order.par_chunks(self.run_len))
            .for_each(|(run, order)| run.hit(grid, flats, order, tiles));
        lay_out(runs, tiles, &mut self.offsets, &mut self.active);
        let total = self.offsets[tiles] as usize;
        if self.entries.len() < total {
            self.entries.resize_with(total, Entry::default);
        }
        let entries = &self.entries[..total];
        runs.par_iter_mut().for_each(|run| run.place(entries));
    }

    fn sort(&mut self, keys: &[u32]) {
        self.order.clear();
        self.order.extend(keys.iter().zip(0..).filter(|(key, _)| **key != NOT_DRAWN).map(|(&key, i)| [key, i]));
        sort_pairs(&mut self.order, &mut self.scratch);
        self.ranks.clear();
        self.ranks.resize(keys.len(), NOT_DRAWN);
        for (rank, &[_, i]) in self.order.iter().enumerate() {
            self.ranks[i as usize] = rank as u32;
        }
    }

    /// Intersections of all tiles together.
    pub(crate) fn total(&self) -> usize {
        self.offsets.last().map_or(0, |&n| n as usize)
    }

    /// Where the list of a tile starts.
    pub(crate) fn start(&self, tile: u32) -> usize {
        self.offsets[tile as usize] as usize
    }

    /// The list of a tile, front to back.
    pub(crate) fn list(&self, tile: u32) -> &[Entry] {
        &self.entries[self.start(tile)..self.start(tile + 1)]
    }

    /// Places of a Gaussian in the lists of all tiles, in order of tiles; empty where not drawn.
    pub(crate) fn places(&self, gaussian: usize) -> impl Iterator<Item = usize> + '_ {
        let rank = self.ranks[gaussian];
        let hits = if rank == NOT_DRAWN {
            &[]
        } else {
            let run = &self.runs[rank as usize / self.run_len];
            let k = rank as usize % self.run_len;
            &run.hits[run.starts[k] as usize..run.starts[k + 1] as usize]
        };
        hits.iter().map(|hit| hit[0] as usize)
    }
}

impl Run {
    fn hit(&mut self, grid: &Grid, flats: &[Flat], order: &[[u32; 2]], tiles: usize) {
        let Self { hits, starts, cursors } = self;
        hits.clear();
        starts.clear();
        cursors.clear();
        cursors.resize(tiles, 0);
        for &[_, i] in order {
            starts.push(hits.len() as u32);
            grid.for_each_tile(&flats[i as usize], |tile, blocks| {
                cursors[tile] += 1;
                hits.push([tile as u32, i | blocks]);
            });
        }
        starts.push(hits.len() as u32);
    }

    /// Writes every entry to its place; the places of different runs are disjoint.
    fn place(&mut self, entries: &[Entry]) {
        for hit in &mut self.hits {
            let cursor = &mut self.cursors[hit[0] as usize];
            entries[*cursor as usize].0.store(hit[1], Ordering::Relaxed);
            hit[0] = *cursor;
            *cursor += 1;
        }
    }
}

/// Turns the counts of the runs into their first places, tile after tile, run after run.
fn lay_out(runs: &mut [Run], tiles: usize, offsets: &mut Vec<u32>, active: &mut Vec<u32>) {
    offsets.clear();
    active.clear();
    let mut next = 0;
    for tile in 0..tiles {
        offsets.push(next);
        for run in runs.iter_mut() {
            let count = run.cursors[tile];
            run.cursors[tile] = next;
            next += count;
        }
        if next > offsets[tile] {
            active.push(tile as u32);
        }
    }
    offsets.push(next);
}
