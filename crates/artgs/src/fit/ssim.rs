//! Structural similarity and its gradient, with an 11 by 11 Gaussian window of deviation 1.5 and zero padding.
//!
//! Per window, with weighted means `mx`, `my`, `s = E[x^2 + y^2]` and `q = E[xy]`:
//! `ssim = (2 mx my + C1)(2 (q - mx my) + C2) / ((mx^2 + my^2 + C1)(s - mx^2 - my^2 + C2))`.
//! Only three maps are blurred back for the gradient: the derivatives by `mx`, `s` and `q`.

use super::images::Rect;
use artgs_raster::simd::level;
use fearless_simd::{dispatch, prelude::*};
use rayon::prelude::*;

pub(crate) const TAPS: usize = 11;
const HALF: usize = TAPS / 2;
pub(crate) const C1: f32 = 0.01 * 0.01;
pub(crate) const C2: f32 = 0.03 * 0.03;
/// Rows of gradient per task; fixed, so that results do not depend on the number of threads.
const BAND: usize = 128;
/// Row buffers are padded to a multiple of this many floats, two of the widest vectors.
const PAD: usize = 32;

/// Weights of the window along one axis, sum 1.
pub(crate) fn window() -> [f32; TAPS] {
    let w: [f64; TAPS] = std::array::from_fn(|i| (-((i as f64 - HALF as f64) / 1.5).powi(2) / 2.0).exp());
    let sum: f64 = w.iter().sum();
    w.map(|v| (v / sum) as f32)
}

/// Workspace of one task: padded rows and rings of the last eleven horizontally blurred rows.
#[derive(Clone, Debug, Default)]
struct Buffers {
    stride: usize,
    /// x, y, x^2 + y^2, xy of one row with margins of half a window.
    padded: [Vec<f32>; 4],
    /// Their horizontal blurs, `[11][stride]` each.
    blurred: [Vec<f32>; 4],
    /// Derivatives by mx, s, q of one row, with margins.
    slopes: [Vec<f32>; 3],
    /// Their horizontal blurs, `[11][stride]` each.
    blurred_slopes: [Vec<f32>; 3],
    /// x and y of one row, without margins.
    pixels: [Vec<f32>; 2],
    /// Similarity of one row of windows, then gradients of one row.
    row: Vec<f32>,
    zeros: Vec<f32>,
}

impl Buffers {
    fn resize(&mut self, width: usize) {
        let stride = width.next_multiple_of(PAD);
        if self.stride == stride {
            for row in self.padded.iter_mut().chain(&mut self.slopes) {
                row.fill(0.0);
            }
            return;
        }
        let margin = stride + PAD;
        *self = Self {
            stride,
            padded: std::array::from_fn(|_| vec![0.0; margin]),
            blurred: std::array::from_fn(|_| vec![0.0; TAPS * stride]),
            slopes: std::array::from_fn(|_| vec![0.0; margin]),
            blurred_slopes: std::array::from_fn(|_| vec![0.0; TAPS * stride]),
            pixels: std::array::from_fn(|_| vec![0.0; stride]),
            row: vec![0.0; stride],
            zeros: vec![0.0; stride],
        };
    }
}

/// The image pair of one channel and the part of it that is looked at.
#[derive(Clone, Copy)]
struct Plane<'a> {
    x: &'a [f32],
    y: &'a [f32],
    width: usize,
    /// Windows centred here are evaluated.
    rect: Rect,
    /// `rect` grown by half a window within the image: pixels that are read and get a gradient.
    reach: Rect,
    taps: [f32; TAPS],
}

/// Reusable workspace for structural similarity.
#[derive(Clone, Debug, Default)]
pub struct Ssim {
    buffers: Vec<Buffers>,
    sums: Vec<f64>,
}

impl Ssim {
    /// An empty workspace; grows at the first use.
    pub fn new() -> Self {
        Self::default()
    }

    /// Mean similarity over all pixels and channels of two planar images `[channels][height * width]`; adds `weight`
    /// times its gradient by `x` to `grad`. Only windows centred in `rect` are evaluated; the images are taken to be
    /// equal in all others, whose similarity is 1.
    pub fn evaluate(
        &mut self,
        x: &[f32],
        y: &[f32],
        (width, height): (usize, usize),
        rect: Rect,
        weight: f32,
        grad: &mut [f32],
    ) -> f64 {
        assert!(x.len() == y.len() && x.len() == grad.len() && rect.x1 <= width && rect.y1 <= height);
        let area = width * height;
        if x.is_empty() || rect.is_empty() {
            return 1.0;
        }
        let channels = x.len() / area;
        let reach = rect.grown(HALF, width, height);
        let bands = (reach.y1 - reach.y0).div_ceil(BAND);
        self.buffers.resize(channels * bands, Buffers::default());
        self.sums.clear();
        self.sums.resize(channels * bands, 0.0);
        let (taps, level, factor) = (window(), level(), weight / x.len() as f32);
        grad.par_chunks_exact_mut(area)
            .zip(self.buffers.par_chunks_exact_mut(bands).zip(self.sums.par_chunks_exact_mut(bands)))
            .enumerate()
            .for_each(|(channel, (grad, (buffers, sums)))| {
                let pixels = channel * area..(channel + 1) * area;
                let plane = Plane { x: &x[pixels.clone()], y: &y[pixels], width, rect, reach, taps };
                grad[reach.y0 * width..reach.y1 * width]
                    .par_chunks_mut(BAND * width)
                    .zip(buffers.par_iter_mut().zip(sums.par_iter_mut()))
                    .enumerate()
                    .for_each(|(band, (grad, (buffers, sum)))| {
                        buffers.resize(reach.x1 - reach.x0);
                        let first = reach.y0 + band * BAND;
                        *sum = dispatch!(level, simd => sweep(simd, &plane, buffers, first, grad, factor));
                    });
            });
        let outside = (x.len() - channels * rect.area()) as f64;
        (self.sums.iter().sum::<f64>() + outside) / x.len() as f64
    }
}

/// Streams down one band: adds the gradient of the rows of `grad`, the first of which is image row `first`, and
/// returns the sum of the similarities of the windows centred in them.
#[inline(always)]
fn sweep<S: Simd>(simd: S, plane: &Plane, b: &mut Buffers, first: usize, grad: &mut [f32], factor: f32) -> f64 {
    let (rect, reach) = (plane.rect, plane.reach);
    let last = first + grad.len() / plane.width;
    let mut next_slope = first.saturating_sub(HALF).max(rect.y0);
    let mut next_pixel = next_slope.saturating_sub(HALF).max(reach.y0);
    let mut sum = 0.0;
    for (line, g) in grad.chunks_exact_mut(plane.width).enumerate() {
        let row = first + line;
        while next_slope < (row + HALF + 1).min(rect.y1) {
            while next_pixel < (next_slope + HALF + 1).min(reach.y1) {
                blur_pixels(simd, plane, b, next_pixel);
                next_pixel += 1;
            }
            let own = (first..last).contains(&next_slope);
            sum += slopes(simd, plane, b, next_slope, own);
            next_slope += 1;
        }
        gradient(simd, plane, b, row, &mut g[reach.x0..reach.x1], factor);
    }
    sum
}

/// The weights times `factor`, one vector each. Vector code here keeps out of closures: they are compiled apart, without
/// the instructions that [`dispatch`] turned on.
#[inline(always)]
fn splat_taps<S: Simd>(simd: S, taps: &[f32; TAPS], factor: f32) -> [S::f32s; TAPS] {
    let mut out = [S::f32s::splat(simd, 0.0); TAPS];
    for k in 0..TAPS {
        out[k] = S::f32s::splat(simd, taps[k] * factor);
    }
    out
}

/// Horizontal blur of a padded row into `out`.
#[inline(always)]
fn blur_row<S: Simd>(simd: S, taps: &[f32; TAPS], padded: &[f32], out: &mut [f32]) {
    let lanes = S::f32s::LEN;
    let weights = splat_taps(simd, taps, 1.0);
    for (i, out) in out.chunks_exact_mut(lanes).enumerate() {
        let at = &padded[i * lanes..i * lanes + lanes + TAPS - 1];
        let mut sum = S::f32s::from_slice(simd, &at[..lanes]) * weights[0];
        for k in 1..TAPS {
            sum = S::f32s::from_slice(simd, &at[k..k + lanes]).mul_add(weights[k], sum);
        }
        sum.store_slice(out);
    }
}

/// Rows `row - 5 ..= row + 5` of a ring that holds rows `bounds`, zeros elsewhere.
#[inline(always)]
fn column<'a>(
    ring: &'a [f32],
    zeros: &'a [f32],
    stride: usize,
    row: usize,
    bounds: (usize, usize),
) -> [&'a [f32]; TAPS] {
    std::array::from_fn(|k| {
        let r = row + k;
        if r < HALF + bounds.0 || r >= HALF + bounds.1 {
            return zeros;
        }
        let slot = (r - HALF) % TAPS;
        &ring[slot * stride..(slot + 1) * stride]
    })
}

/// Vertical blur at two vectors of columns from `i`.
#[inline(always)]
fn blur_column<S: Simd>(simd: S, weights: &[S::f32s; TAPS], rows: &[&[f32]; TAPS], i: usize) -> [S::f32s; 2] {
    let lanes = S::f32s::LEN;
    let mut sums = [S::f32s::splat(simd, 0.0); 2];
    for k in 0..TAPS {
        let at = &rows[k][i..i + 2 * lanes];
        sums[0] = S::f32s::from_slice(simd, &at[..lanes]).mul_add(weights[k], sums[0]);
        sums[1] = S::f32s::from_slice(simd, &at[lanes..]).mul_add(weights[k], sums[1]);
    }
    sums
}

/// Puts the horizontal blurs of image row `row` into the rings.
#[inline(always)]
fn blur_pixels<S: Simd>(simd: S, plane: &Plane, b: &mut Buffers, row: usize) {
    let (reach, stride) = (plane.reach, b.stride);
    let at = row * plane.width;
    let (x, y) = (&plane.x[at + reach.x0..at + reach.x1], &plane.y[at + reach.x0..at + reach.x1]);
    let inner = HALF..HALF + x.len();
    let [px, py, ps, pq] = &mut b.padded;
    px[inner.clone()].copy_from_slice(x);
    py[inner.clone()].copy_from_slice(y);
    for ((s, &x), &y) in ps[inner.clone()].iter_mut().zip(x).zip(y) {
        *s = x * x + y * y;
    }
    for ((q, &x), &y) in pq[inner].iter_mut().zip(x).zip(y) {
        *q = x * y;
    }
    let slot = row % TAPS * stride;
    for (padded, ring) in b.padded.iter().zip(&mut b.blurred) {
        blur_row(simd, &plane.taps, padded, &mut ring[slot..slot + stride]);
    }
}

/// Similarity of the windows centred in image row `row` and its slopes, blurred horizontally into their rings.
/// Returns the sum of the similarities if `own`.
#[inline(always)]
fn slopes<S: Simd>(simd: S, plane: &Plane, b: &mut Buffers, row: usize, own: bool) -> f64 {
    let (stride, lanes) = (b.stride, S::f32s::LEN);
    let bounds = (plane.reach.y0, plane.reach.y1);
    let rows: [[&[f32]; TAPS]; 4] = std::array::from_fn(|m| column(&b.blurred[m], &b.zeros, stride, row, bounds));
    let weights = splat_taps(simd, &plane.taps, 1.0);
    let [by_mean, by_square, by_product] = &mut b.slopes;
    for i in (0..stride).step_by(2 * lanes) {
        let mx = blur_column(simd, &weights, &rows[0], i);
        let my = blur_column(simd, &weights, &rows[1], i);
        let s = blur_column(simd, &weights, &rows[2], i);
        let q = blur_column(simd, &weights, &rows[3], i);
        for h in 0..2 {
            let at = i + h * lanes;
            let (v, dm, ds, dq) = similarity(simd, mx[h], my[h], s[h], q[h]);
            v.store_slice(&mut b.row[at..at + lanes]);
            dm.store_slice(&mut by_mean[HALF + at..HALF + at + lanes]);
            ds.store_slice(&mut by_square[HALF + at..HALF + at + lanes]);
            dq.store_slice(&mut by_product[HALF + at..HALF + at + lanes]);
        }
    }
    let (from, to) = (plane.rect.x0 - plane.reach.x0, plane.rect.x1 - plane.reach.x0);
    let slot = row % TAPS * stride;
    for (slope, ring) in b.slopes.iter_mut().zip(&mut b.blurred_slopes) {
        slope[..HALF + from].fill(0.0);
        slope[HALF + to..].fill(0.0);
        blur_row(simd, &plane.taps, slope, &mut ring[slot..slot + stride]);
    }
    if own { row_sum(&b.row[from..to]) } else { 0.0 }
}

/// Similarity and its derivatives by `mx`, `s` and `q`.
#[inline(always)]
fn similarity<S: Simd>(
    simd: S,
    mx: S::f32s,
    my: S::f32s,
    s: S::f32s,
    q: S::f32s,
) -> (S::f32s, S::f32s, S::f32s, S::f32s) {
    let (c1, c2, one) = (S::f32s::splat(simd, C1), S::f32s::splat(simd, C2), S::f32s::splat(simd, 1.0));
    let product = mx * my;
    let squares = mx * mx + my * my;
    let a1 = product + product + c1;
    let covariance = q - product;
    let a2 = covariance + covariance + c2;
    let (r1, r2) = (one / (squares + c1), one / (s - squares + c2));
    let v = a1 * a2 * r1 * r2;
    let by_mean = my * (a2 - a1) * r1 * r2 + mx * v * (r2 - r1);
    let by_product = a1 * r1 * r2;
    (v, by_mean + by_mean, -(v * r2), by_product + by_product)
}

/// Adds the gradient of one image row: `factor (blur(dm) + 2 x blur(ds) + y blur(dq))`.
#[inline(always)]
fn gradient<S: Simd>(simd: S, plane: &Plane, b: &mut Buffers, row: usize, grad: &mut [f32], factor: f32) {
    let (stride, lanes) = (b.stride, S::f32s::LEN);
    let bounds = (plane.rect.y0, plane.rect.y1);
    let rows: [[&[f32]; TAPS]; 3] =
        std::array::from_fn(|m| column(&b.blurred_slopes[m], &b.zeros, stride, row, bounds));
    let weights = splat_taps(simd, &plane.taps, factor);
    let at = row * plane.width;
    let (x, y) = (&plane.x[at + plane.reach.x0..at + plane.reach.x1], &plane.y[at + plane.reach.x0..]);
    let n = x.len();
    let [px, py] = &mut b.pixels;
    px[..n].copy_from_slice(x);
    py[..n].copy_from_slice(&y[..n]);
    for i in (0..stride).step_by(2 * lanes) {
        let dm = blur_column(simd, &weights, &rows[0], i);
        let ds = blur_column(simd, &weights, &rows[1], i);
        let dq = blur_column(simd, &weights, &rows[2], i);
        for h in 0..2 {
            let j = i + h * lanes;
            let x = S::f32s::from_slice(simd, &px[j..j + lanes]);
            let y = S::f32s::from_slice(simd, &py[j..j + lanes]);
            ((x + x).mul_add(ds[h], y.mul_add(dq[h], dm[h]))).store_slice(&mut b.row[j..j + lanes]);
        }
    }
    for (g, d) in grad.iter_mut().zip(&b.row) {
        *g += d;
    }
}

/// Sum of a row in 16 lanes, the same on every machine.
#[inline(always)]
fn row_sum(row: &[f32]) -> f64 {
    let mut lanes = [0.0_f32; 16];
    let chunks = row.chunks_exact(16);
    let rest: f64 = chunks.remainder().iter().map(|&v| f64::from(v)).sum();
    for c in chunks {
        for (l, v) in lanes.iter_mut().zip(c) {
            *l += v;
        }
    }
    lanes.iter().map(|&v| f64::from(v)).sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (37, 29);

    fn images() -> (Vec<f32>, Vec<f32>) {
        let n = 3 * SIZE.0 * SIZE.1;
        let wave = |i: usize, a: f32| 0.5 + 0.4 * ((i as f32) * a).sin() * ((i / SIZE.0) as f32 * 0.31).cos();
        ((0..n).map(|i| wave(i, 0.37)).collect(), (0..n).map(|i| wave(i, 0.41)).collect())
    }

    /// Direct two-dimensional windows in f64.
    fn slow(x: &[f32], y: &[f32], rect: Rect) -> f64 {
        let (w, h) = SIZE;
        let taps = window().map(f64::from);
        let mut sum = 0.0;
        for channel in 0..3 {
            for (cy, cx) in (0..h).flat_map(|cy| (0..w).map(move |cx| (cy, cx))) {
                if !(rect.x0..rect.x1).contains(&cx) || !(rect.y0..rect.y1).contains(&cy) {
                    sum += 1.0;
                    continue;
                }
                let mut m = [0.0; 5];
                for (ky, kx) in (0..TAPS).flat_map(|ky| (0..TAPS).map(move |kx| (ky, kx))) {
                    let (py, px) = (cy + ky, cx + kx);
                    if py < HALF || px < HALF || py >= h + HALF || px >= w + HALF {
                        continue;
                    }
                    let i = channel * w * h + (py - HALF) * w + px - HALF;
                    let (a, b, k) = (f64::from(x[i]), f64::from(y[i]), taps[ky] * taps[kx]);
                    for (m, v) in m.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                        *m += k * v;
                    }
                }
                let [mx, my, xx, yy, xy] = m;
                let (c1, c2) = (f64::from(C1), f64::from(C2));
                sum += (2.0 * mx * my + c1) * (2.0 * (xy - mx * my) + c2)
                    / ((mx * mx + my * my + c1) * (xx - mx * mx + yy - my * my + c2));
            }
        }
        sum / (3 * w * h) as f64
    }

    #[test]
    fn value_matches_direct_windows_and_identical_images_score_one() {
        let (x, y) = images();
        let mut grad = vec![0.0; x.len()];
        let mut ssim = Ssim::new();
        for rect in [Rect::full(SIZE.0, SIZE.1), Rect { x0: 4, y0: 9, x1: 21, y1: 26 }] {
            let got = ssim.evaluate(&x, &y, SIZE, rect, 1.0, &mut grad);
            assert!((got - slow(&x, &y, rect)).abs() < 1e-5, "{got} {}", slow(&x, &y, rect));
        }
        let same = ssim.evaluate(&x, &x, SIZE, Rect::full(SIZE.0, SIZE.1), 1.0, &mut grad);
        assert!((same - 1.0).abs() < 1e-6);
    }

    #[test]
    fn gradient_matches_finite_differences() {
        let (x, y) = images();
        for rect in [Rect::full(SIZE.0, SIZE.1), Rect { x0: 8, y0: 2, x1: 30, y1: 20 }] {
            let mut grad = vec![0.0; x.len()];
            Ssim::new().evaluate(&x, &y, SIZE, rect, 2.0, &mut grad);
            let scale = grad.iter().fold(0.0_f32, |a, g| a.max(g.abs()));
            for i in (0..x.len()).step_by(613).chain([0, 36, 28 * 37, 5 * 37 + 4]) {
                let shifted = |d: f32| {
                    let mut x = x.clone();
                    x[i] += d;
                    slow(&x, &y, rect)
                };
                let want = 2.0 * (shifted(1e-3) - shifted(-1e-3)) / 2e-3;
                assert!((f64::from(grad[i]) - want).abs() < 2e-3 * f64::from(scale), "{i}: {} {want}", grad[i]);
            }
        }
    }

    #[test]
    fn bands_do_not_show() {
        let (w, h) = (40, 2 * BAND + 17);
        let x: Vec<f32> = (0..w * h).map(|i| (i as f32 * 0.7).sin()).collect();
        let y: Vec<f32> = (0..w * h).map(|i| (i as f32 * 0.7 + (i / w % 7) as f32 * 0.2).sin()).collect();
        let rotate = |v: &[f32]| -> Vec<f32> { (0..w * h).map(|i| v[(i % h) * w + i / h]).collect() };
        let (mut a, mut b) = (vec![0.0; w * h], vec![0.0; w * h]);
        let va = Ssim::new().evaluate(&x, &y, (w, h), Rect::full(w, h), 1.0, &mut a);
        let vb = Ssim::new().evaluate(&rotate(&x), &rotate(&y), (h, w), Rect::full(h, w), 1.0, &mut b);
        assert!((va - vb).abs() < 1e-6);
        let scale = a.iter().fold(0.0_f32, |m, g| m.max(g.abs()));
        for (a, b) in rotate(&a).iter().zip(&b) {
            assert!((a - b).abs() < 1e-4 * scale);
        }
    }
}
