//! The two inner loops: blending the Gaussians of a tile front to back, and its adjoint.
//!
//! A tile is four blocks of 8 x 8 pixels; a block is four vectors of 8 x 2 pixels. The state of a block stays in registers
//! while the kernel reads the list of the tile.

use crate::bin::{BLOCK, Entry, INDEX, block_bit};
use crate::limits::{ALPHA_MAX, LOG2_CUT, TILE, TRANSMITTANCE_MIN};
use crate::project::Flat;
use crate::simd::{
    Lanes, Mask, Select, Simd, SimdBase, SimdFloat, SimdMask, WIDTH, dispatch, exp2, level, sum_lane, sums,
};
use crate::{Frame, FrameGrad, project::Sums};
use glam::{Vec2, Vec3};

/// Vectors of a block.
const VECTORS: usize = BLOCK * BLOCK / WIDTH;
/// Pixels of a block.
pub(crate) const BLOCK_PIXELS: usize = BLOCK * BLOCK;
/// Pixels of a tile.
pub(crate) const TILE_PIXELS: usize = TILE * TILE;
/// Entries of a list processed between two tests whether the block is finished.
const BATCH: usize = 16;

/// The pixels of a tile, block after block, rows of a block one after the other: red, green, blue, depth, alpha.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct TilePixels(pub(crate) [[f32; TILE_PIXELS]; 5]);

impl Default for TilePixels {
    fn default() -> Self {
        Self([[0.0; TILE_PIXELS]; 5])
    }
}

/// Sums of one Gaussian over the pixels of one tile, in the lanes of [`sum_lane`]: g, g dx, g dy, g dx^2, g dx dy,
/// g dy^2, red, green, blue, depth.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub(crate) struct Cell([f32; WIDTH]);

impl Cell {
    pub(crate) fn add(&mut self, other: &Self) {
        for k in 0..WIDTH {
            self.0[k] += other.0[k];
        }
    }

    pub(crate) fn sums(&self) -> Sums {
        let v = |k: usize| self.0[sum_lane(k)];
        Sums {
            g: v(0),
            first: Vec2::new(v(1), v(2)),
            second: [v(3), v(4), v(5)],
            rgb: Vec3::new(v(6), v(7), v(8)),
            depth: v(9),
        }
    }
}

/// Renders one tile. `list` is front to back, `origin` its top left pixel. Returns how often a Gaussian was evaluated in
/// a pixel.
pub(crate) fn forward(
    flats: &[Flat],
    list: &[Entry],
    origin: [usize; 2],
    background: [f32; 3],
    out: &mut TilePixels,
) -> usize {
    dispatch!(level(), s => {
        let mut evaluated = 0;
        for block in 0..4 {
            evaluated += forward_block(s, flats, list, origin, block, background, out);
        }
        evaluated * BLOCK_PIXELS
    })
}

/// Adjoint of [`forward`]: overwrites the cell of every entry of `list`.
pub(crate) fn backward(
    flats: &[Flat],
    list: &[Entry],
    origin: [usize; 2],
    frame: &Frame,
    d_frame: &FrameGrad,
    cells: &mut [Cell],
) {
    cells.fill(Cell::default());
    dispatch!(level(), s => {
        let gradients = TilePixels::gradients(origin, frame, d_frame);
        for block in 0..4 {
            backward_block(s, flats, list, origin, block, &gradients, cells);
        }
    });
}

/// Pixel centres of the first vector of a block.
#[inline(always)]
fn centers<S: Simd>(s: S, origin: [usize; 2], block: usize) -> (Lanes<S>, Lanes<S>) {
    let (mut x, mut y) = ([0.0; WIDTH], [0.0; WIDTH]);
    for i in 0..WIDTH {
        x[i] = (origin[0] + BLOCK * (block % 2) + i % BLOCK) as f32 + 0.5;
        y[i] = (origin[1] + BLOCK * (block / 2) + i / BLOCK) as f32 + 0.5;
    }
    (Lanes::from_slice(s, &x), Lanes::from_slice(s, &y))
}

/// The Gaussians of a batch that touch the block, and their positions in the batch.
struct Selection {
    flats: [Flat; BATCH],
    positions: [u32; BATCH],
    len: usize,
}

impl Selection {
    #[inline(always)]
    fn new() -> Self {
        Self { flats: [Flat::default(); BATCH], positions: [0; BATCH], len: 0 }
    }

    #[inline(always)]
    fn fill(&mut self, flats: &[Flat], batch: &[Entry], block: usize) {
        self.len = 0;
        for (position, entry) in batch.iter().enumerate() {
            let entry = entry.get();
            self.flats[self.len] = flats[(entry & INDEX) as usize];
            self.positions[self.len] = position as u32;
            self.len += usize::from(entry & block_bit(block) != 0);
        }
    }
}

/// `log2(alpha)` of one Gaussian along a block: what does not change from vector to vector.
struct Exponent<S: Simd> {
    dx: Lanes<S>,
    dy: Lanes<S>,
    constant: Lanes<S>,
    linear: Lanes<S>,
    square: Lanes<S>,
}

impl<S: Simd> Exponent<S> {
    #[inline(always)]
    fn new(s: S, g: &Flat, x: Lanes<S>, y: Lanes<S>) -> Self {
        let dx = x - Lanes::splat(s, g.x);
        Self {
            dx,
            dy: y - Lanes::splat(s, g.y),
            constant: (dx * dx).mul_add(Lanes::splat(s, g.xx), Lanes::splat(s, g.log2_opacity)),
            linear: dx * Lanes::splat(s, g.xy),
            square: Lanes::splat(s, g.yy),
        }
    }

    #[inline(always)]
    fn at(&self, dy: Lanes<S>) -> Lanes<S> {
        dy.mul_add(self.square.mul_add(dy, self.linear), self.constant)
    }
}

#[inline(always)]
fn unfinished<S: Simd>(s: S, transmittance: &[Lanes<S>; VECTORS]) -> bool {
    let min = Lanes::splat(s, TRANSMITTANCE_MIN);
    let mut any = Mask::splat(s, false);
    for t in transmittance {
        any |= t.simd_ge(min);
    }
    any.any_true()
}

#[inline(always)]
fn forward_block<S: Simd>(
    s: S,
    flats: &[Flat],
    list: &[Entry],
    origin: [usize; 2],
    block: usize,
    background: [f32; 3],
    out: &mut TilePixels,
) -> usize {
    let (x, y) = centers(s, origin, block);
    let (zero, one) = (Lanes::splat(s, 0.0), Lanes::splat(s, 1.0));
    let (cut, alpha_max) = (Lanes::splat(s, LOG2_CUT), Lanes::splat(s, ALPHA_MAX));
    let (t_min, step) = (Lanes::splat(s, TRANSMITTANCE_MIN), Lanes::splat(s, (WIDTH / BLOCK) as f32));
    let mut t = [one; VECTORS];
    let (mut red, mut green, mut blue, mut depth) =
        ([zero; VECTORS], [zero; VECTORS], [zero; VECTORS], [zero; VECTORS]);
    let mut chosen = Selection::new();
    let mut evaluated = 0;
    for batch in list.chunks(BATCH) {
        chosen.fill(flats, batch, block);
        evaluated += chosen.len;
        for g in &chosen.flats[..chosen.len] {
            let exponent = Exponent::new(s, g, x, y);
            let (r, gr, b, z) = (
                Lanes::splat(s, g.rgb[0]),
                Lanes::splat(s, g.rgb[1]),
                Lanes::splat(s, g.rgb[2]),
                Lanes::splat(s, g.depth),
            );
            let mut dy = exponent.dy;
            for k in 0..VECTORS {
                let e = exponent.at(dy);
                dy += step;
                let inside = e.simd_ge(cut);
                if !inside.any_true() {
                    continue;
                }
                let alpha = exp2(s, e).min(alpha_max);
                let weight = (inside & t[k].simd_ge(t_min)).select(alpha * t[k], zero);
                t[k] -= weight;
                red[k] = weight.mul_add(r, red[k]);
                green[k] = weight.mul_add(gr, green[k]);
                blue[k] = weight.mul_add(b, blue[k]);
                depth[k] = weight.mul_add(z, depth[k]);
            }
        }
        if !unfinished(s, &t) {
            break;
        }
    }
    let [br, bg, bb] = background;
    for k in 0..VECTORS {
        let at = (block * VECTORS + k) * WIDTH;
        t[k].mul_add(Lanes::splat(s, br), red[k]).store_slice(&mut out.0[0][at..at + WIDTH]);
        t[k].mul_add(Lanes::splat(s, bg), green[k]).store_slice(&mut out.0[1][at..at + WIDTH]);
        t[k].mul_add(Lanes::splat(s, bb), blue[k]).store_slice(&mut out.0[2][at..at + WIDTH]);
        depth[k].store_slice(&mut out.0[3][at..at + WIDTH]);
        (one - t[k]).store_slice(&mut out.0[4][at..at + WIDTH]);
    }
    evaluated
}

/// With `v_i` the gradient of the pixel dotted with the colour and depth of Gaussian `i`, `w_i` its weight, `T` the
/// final transmittance and `v_T` its gradient, `dL/dalpha_i = T_i v_i - (sum_{j > i} w_j v_j + v_T T) / (1 - alpha_i)`.
/// The bracket starts as the whole sum, which follows from the rendering. `w_i v_i` is subtracted at each Gaussian.
#[inline(always)]
fn backward_block<S: Simd>(
    s: S,
    flats: &[Flat],
    list: &[Entry],
    origin: [usize; 2],
    block: usize,
    gradients: &TilePixels,
    cells: &mut [Cell],
) {
    let (x, y) = centers(s, origin, block);
    let (zero, one) = (Lanes::splat(s, 0.0), Lanes::splat(s, 1.0));
    let (cut, alpha_max) = (Lanes::splat(s, LOG2_CUT), Lanes::splat(s, ALPHA_MAX));
    let (t_min, step) = (Lanes::splat(s, TRANSMITTANCE_MIN), Lanes::splat(s, (WIDTH / BLOCK) as f32));
    let mut t = [one; VECTORS];
    let mut rest = [zero; VECTORS];
    let mut v = [[zero; 4]; VECTORS];
    for k in 0..VECTORS {
        let at = (block * VECTORS + k) * WIDTH;
        for c in 0..4 {
            v[k][c] = Lanes::from_slice(s, &gradients.0[c][at..at + WIDTH]);
        }
        rest[k] = Lanes::from_slice(s, &gradients.0[4][at..at + WIDTH]);
    }
    let mut chosen = Selection::new();
    for (batch, cells) in list.chunks(BATCH).zip(cells.chunks_mut(BATCH)) {
        chosen.fill(flats, batch, block);
        for n in 0..chosen.len {
            let g = &chosen.flats[n];
            let exponent = Exponent::new(s, g, x, y);
            let (r, gr, b, z) = (
                Lanes::splat(s, g.rgb[0]),
                Lanes::splat(s, g.rgb[1]),
                Lanes::splat(s, g.rgb[2]),
                Lanes::splat(s, g.depth),
            );
            let mut dy = exponent.dy;
            let (mut sum, mut sum_y, mut sum_yy) = (zero, zero, zero);
            let (mut red, mut green, mut blue, mut depth) = (zero, zero, zero, zero);
            let mut touched = false;
            for k in 0..VECTORS {
                let e = exponent.at(dy);
                let y = dy;
                dy += step;
                let drawn = e.simd_ge(cut) & t[k].simd_ge(t_min);
                if !drawn.any_true() {
                    continue;
                }
                touched = true;
                let raw = exp2(s, e);
                let alpha = raw.min(alpha_max);
                let weight = drawn.select(alpha * t[k], zero);
                let value = v[k][0].mul_add(r, v[k][1].mul_add(gr, v[k][2].mul_add(b, v[k][3] * z)));
                rest[k] -= weight * value;
                let d_alpha = t[k] * value - rest[k] / (one - alpha);
                let d_power = (drawn & raw.simd_le(alpha_max)).select(alpha * d_alpha, zero);
                t[k] -= weight;
                red = weight.mul_add(v[k][0], red);
                green = weight.mul_add(v[k][1], green);
                blue = weight.mul_add(v[k][2], blue);
                depth = weight.mul_add(v[k][3], depth);
                let d_power_y = d_power * y;
                sum += d_power;
                sum_y += d_power_y;
                sum_yy = d_power_y.mul_add(y, sum_yy);
            }
            if touched {
                let sum_x = sum * exponent.dx;
                let moments =
                    [sum, sum_x, sum_y, sum_x * exponent.dx, sum_y * exponent.dx, sum_yy, red, green, blue, depth];
                let cell = &mut cells[chosen.positions[n] as usize].0;
                (Lanes::from_slice(s, cell) + sums(&moments)).store_slice(cell);
            }
        }
        if !unfinished(s, &t) {
            break;
        }
    }
}

impl TilePixels {
    /// Gradients of colour and depth, and the sum of all `w_i v_i` plus `v_T T`, of the pixels of a tile; zero outside
    /// the image. The background is not needed: the rendered colour already contains its share of `v_T T`.
    #[inline(always)]
    fn gradients(origin: [usize; 2], frame: &Frame, d: &FrameGrad) -> Self {
        let mut out = Self::default();
        let size = frame.width * frame.height;
        for row in 0..TILE.min(frame.height - origin[1]) {
            for half in 0..2 {
                let left = origin[0] + BLOCK * half;
                let count = BLOCK.min(frame.width.saturating_sub(left));
                let from = (origin[1] + row) * frame.width + left;
                let to = tile_offset(row, half);
                for i in 0..count {
                    let (p, q) = (from + i, to + i);
                    let mut rest = d.depth[p] * frame.depth[p] - d.alpha[p] * (1.0 - frame.alpha[p]);
                    for c in 0..3 {
                        let v = d.rgb[c * size + p];
                        out.0[c][q] = v;
                        rest += v * frame.rgb[c * size + p];
                    }
                    out.0[3][q] = d.depth[p];
                    out.0[4][q] = rest;
                }
            }
        }
        out
    }

    /// Copies the `row`-th row of plane `plane` to `target`, the part of an image row this tile covers.
    pub(crate) fn copy_row(&self, plane: usize, row: usize, target: &mut [f32]) {
        for (half, target) in target.chunks_mut(BLOCK).enumerate() {
            let from = tile_offset(row, half);
            target.copy_from_slice(&self.0[plane][from..from + target.len()]);
        }
    }
}

/// Where the eight pixels of the left or right half of a row of a tile start.
#[inline(always)]
fn tile_offset(row: usize, half: usize) -> usize {
    (row / BLOCK * 2 + half) * BLOCK * BLOCK + row % BLOCK * BLOCK
}
