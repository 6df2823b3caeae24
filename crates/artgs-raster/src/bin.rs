//! Lists of the Gaussians that touch each tile, front to back, and the inverse: the list entries of each Gaussian.

use crate::limits::{LOG2_CUT, SLACK, SLACK_PIXELS, TILE};
use crate::project::Flat;
use crate::sort::sort_pairs;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Side of a block in pixels; a tile is 2 x 2 blocks.
pub(crate) const BLOCK: usize = 8;
/// Low bits of an entry of a list: the Gaussian. The four high bits are the blocks of the tile it touches.
pub(crate) const INDEX: u32 = (1 << 28) - 1;
/// Key of a Gaussian that is not drawn.
pub(crate) const NOT_DRAWN: u32 = u32::MAX;
/// Gaussians are distributed in at most this many independent runs.
const RUNS: usize = 16;
const RUN_MIN: usize = 1024;
/// Gaussians fetched together: in order of depth they are scattered in memory, and loads in one batch overlap.
const BATCH: usize = 32;

/// One Gaussian in the list of a tile; atomic so that runs can be written in parallel without locks.
#[derive(Debug, Default)]
pub(crate) struct Entry(AtomicU32);

/// The bit of an entry that says whether it touches a block.
#[inline(always)]
pub(crate) const fn block_bit(block: usize) -> u32 {
    1 << (28 + block)
}

/// The image and its tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Grid {
    pub(crate) tiles: [usize; 2],
    size: [usize; 2],
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

/// Lists of all tiles, and the list entries of each Gaussian.
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
    pub(crate) fn new(size: [usize; 2]) -> Self {
        Self { tiles: size.map(|n| n.div_ceil(TILE)), size }
    }

    /// Top left pixel of a tile.
    pub(crate) fn origin(&self, tile: usize) -> [usize; 2] {
        [tile % self.tiles[0] * TILE, tile / self.tiles[0] * TILE]
    }

    /// First and last block along an axis with a pixel centre in `low..=high`.
    #[inline(always)]
    fn block_range(&self, axis: usize, low: f32, high: f32) -> Option<[usize; 2]> {
        let size = self.size[axis] as f32;
        let low = (low - 0.5).max(0.0).min(size);
        let below = low as usize;
        let first = below + usize::from(low > below as f32);
        // One past the last pixel: truncation is the floor of what is not negative.
        let end = (high + 0.5).max(0.0).min(size) as usize;
        (first < end).then(|| [first / BLOCK, (end - 1) / BLOCK])
    }

    /// Calls `hit(tile, blocks)` for every tile the Gaussian touches, in order of tiles.
    #[inline(always)]
    fn for_each_tile(&self, g: &Flat, mut hit: impl FnMut(usize, u32)) {
        let Some([top, bottom]) = self.block_range(1, g.y - g.half[1], g.y + g.half[1]) else { return };
        let Some([left, right]) = self.block_range(0, g.x - g.half[0], g.x + g.half[0]) else { return };
        let ellipse = Ellipse::new(g);
        let row_range = |row: usize| {
            if row < top || row > bottom {
                None
            } else if top == bottom || left == right {
                // One row or column of blocks: the bounding box gives the range.
                Some([left, right])
            } else {
                let [from, to] = ellipse.span((row * BLOCK) as f32 + 0.5)?;
                self.block_range(0, from, to)
            }
        };
        for tile_row in top / 2..=bottom / 2 {
            let rows = [row_range(2 * tile_row), row_range(2 * tile_row + 1)];
            let ([a, b], [c, d]) = match rows {
                [Some(upper), Some(lower)] => (upper, lower),
                [Some(upper), None] => (upper, [usize::MAX, 0]),
                [None, Some(lower)] => ([usize::MAX, 0], lower),
                [None, None] => continue,
            };
            for tile_column in a.min(c) / 2..=b.max(d) / 2 {
                let column = 2 * tile_column;
                let bit = |from: usize, to: usize, k: usize, block: usize| {
                    u32::from((from <= column + k) & (column + k <= to)) * block_bit(block)
                };
                let blocks = bit(a, b, 0, 0) | bit(a, b, 1, 1) | bit(c, d, 0, 2) | bit(c, d, 1, 3);
                if blocks != 0 {
                    hit(tile_row * self.tiles[0] + tile_column, blocks);
                }
            }
        }
    }
}

/// Region where a Gaussian's alpha reaches 1/255.
struct Ellipse {
    x: f32,
    y: f32,
    half: [f32; 2],
    /// Height of the rightmost point over the centre; the leftmost one is its mirror image.
    peak: f32,
    /// The borders at height `dy` are `slope dy +- sqrt(reach - curvature dy^2)`.
    slope: f32,
    reach: f32,
    curvature: f32,
}

impl Ellipse {
    #[inline(always)]
    fn new(g: &Flat) -> Self {
        let inverse = -0.5 / g.xx;
        Self {
            x: g.x,
            y: g.y,
            half: g.half,
            peak: -0.5 * g.xy / g.yy * g.half[0],
            slope: g.xy * inverse,
            reach: 2.0 * inverse * (g.log2_opacity - LOG2_CUT + SLACK),
            curvature: g.discriminant * inverse * inverse,
        }
    }

    /// Horizontal extent within the row of blocks whose first pixel centres are at height `top`.
    #[inline(always)]
    fn span(&self, top: f32) -> Option<[f32; 2]> {
        let low = (top - self.y).max(-self.half[1]);
        let high = (top + (BLOCK - 1) as f32 - self.y).min(self.half[1]);
        if low > high {
            return None;
        }
        // The right border is concave in dy: over an interval it is farthest at the point nearest to its peak.
        let root = |dy: f32| (self.reach - self.curvature * dy * dy).max(0.0).sqrt();
        let (l, r) = ((-self.peak).max(low).min(high), self.peak.max(low).min(high));
        let left = (self.slope * l - root(l)).max(-self.half[0]);
        let right = (self.slope * r + root(r)).min(self.half[0]);
        Some([self.x + left - SLACK_PIXELS, self.x + right + SLACK_PIXELS])
    }
}

impl Bins {
    /// Rebuilds the lists. `keys` orders the Gaussians by depth; equal depths are ordered by index.
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

    /// The intersections of a Gaussian in order of tiles, the first number of each being its place in the lists of all
    /// tiles; empty where not drawn.
    #[inline(always)]
    pub(crate) fn hits(&self, gaussian: usize) -> &[[u32; 2]] {
        let rank = self.ranks[gaussian];
        if rank == NOT_DRAWN {
            return &[];
        }
        let run = &self.runs[rank as usize / self.run_len];
        let k = rank as usize % self.run_len;
        &run.hits[run.starts[k] as usize..run.starts[k + 1] as usize]
    }
}

impl Run {
    fn hit(&mut self, grid: &Grid, flats: &[Flat], order: &[[u32; 2]], tiles: usize) {
        let Self { hits, starts, cursors } = self;
        hits.clear();
        starts.clear();
        cursors.clear();
        cursors.resize(tiles, 0);
        let mut batch = [Flat::default(); BATCH];
        for order in order.chunks(BATCH) {
            for (flat, &[_, i]) in batch.iter_mut().zip(order) {
                *flat = flats[i as usize];
            }
            for (flat, &[_, i]) in batch.iter().zip(order) {
                starts.push(hits.len() as u32);
                grid.for_each_tile(flat, |tile, blocks| {
                    cursors[tile] += 1;
                    hits.push([tile as u32, i | blocks]);
                });
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::project::View;
    use crate::{Colors, RenderOptions, SplatView};
    use artgs_core::{Camera, Intrinsics};
    use rand::{RngExt, SeedableRng};

    /// Blocks of the image where some pixel passes the cut, by looking at every pixel.
    fn blocks_by_pixels(g: &Flat, size: [usize; 2]) -> Vec<bool> {
        let columns = size[0].div_ceil(BLOCK);
        let mut blocks = vec![false; columns * size[1].div_ceil(BLOCK)];
        for y in 0..size[1] {
            for x in 0..size[0] {
                let (dx, dy) = (x as f64 + 0.5 - f64::from(g.x), y as f64 + 0.5 - f64::from(g.y));
                let quadratic = f64::from(g.xx) * dx * dx + f64::from(g.xy) * dx * dy + f64::from(g.yy) * dy * dy;
                let drawn = quadratic + f64::from(g.log2_opacity) >= f64::from(LOG2_CUT);
                blocks[y / BLOCK * columns + x / BLOCK] |= drawn;
            }
        }
        blocks
    }

    #[test]
    fn footprints_lose_no_pixel_and_waste_few_blocks() {
        let size = [150, 93];
        let k = Intrinsics { fx: 140.0, fy: 150.0, cx: 75.0, cy: 46.0, width: 150, height: 93 };
        let camera = Camera::look_at(k, glam::DVec3::new(0.0, -2.0, 0.0), glam::DVec3::ZERO, glam::DVec3::Z);
        let view = View::new(&camera, &RenderOptions::default());
        let grid = Grid::new(size);
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let (mut needed, mut listed, mut drawn) = (0, 0, 0);
        for _ in 0..600 {
            let splats = SplatView {
                means: &[[0; 3].map(|_| rng.random_range(-1.1..1.1))],
                rotations: &[[0; 4].map(|_| rng.random_range(-1.0..1.0))],
                log_scales: &[[0; 3].map(|_| rng.random_range(-6.0..-0.5))],
                logit_opacities: &[rng.random_range(-5.0..4.0)],
                colors: Colors::Fixed(&[[0.0; 3]]),
            };
            let Some(g) = view.project(&splats, 0) else { continue };
            drawn += 1;
            let want = blocks_by_pixels(&g, size);
            let columns = size[0].div_ceil(BLOCK);
            let mut got = vec![false; want.len()];
            grid.for_each_tile(&g, |tile, blocks| {
                let [x, y] = grid.origin(tile).map(|p| p / BLOCK);
                for b in (0..4).filter(|&b| blocks & block_bit(b) != 0) {
                    got[(y + b / 2) * columns + x + b % 2] = true;
                }
            });
            assert!(want.iter().zip(&got).all(|(w, g)| !w || *g), "a block is missing of {g:?}");
            needed += want.iter().filter(|w| **w).count();
            listed += got.iter().filter(|g| **g).count();
        }
        assert!(drawn > 400 && listed < needed + needed / 8, "{drawn} Gaussians, {listed} blocks for {needed}");
    }
}
