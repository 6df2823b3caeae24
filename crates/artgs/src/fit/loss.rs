//! What training minimises: colour, depth and mask of a rendering against a photograph, and undecided opacities.

use super::images::{Rect, TrainImage};
use super::ssim::Ssim;
use artgs_core::DepthMap;
use artgs_core::capture::OBJECT_ALPHA;
use artgs_raster::simd::level;
use artgs_raster::{Frame, FrameGrad};
use fearless_simd::dispatch;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Which rendered depth is compared with the measured one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthMode {
    /// Depth accumulated over the ray, not divided by alpha, also against 0 in the background; as published.
    Accumulated,
    /// Depth divided by alpha, where alpha is above one half and a depth was measured.
    #[default]
    Normalized,
}

/// Weights of the terms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LossConfig {
    /// Share of `1 - SSIM` in the colour loss; the rest is L1.
    pub ssim: f32,
    /// Evaluate SSIM only around the object; elsewhere both images are background.
    pub crop_ssim: bool,
    /// Blend the photograph over the background with alpha squared, as the published code does.
    pub double_alpha: bool,
    /// Weight of the depth loss; 0 or images without depth: none.
    pub depth: f32,
    /// Form of the depth loss.
    pub depth_mode: DepthMode,
    /// Weight of the mean absolute difference between rendered and measured alpha.
    pub mask: f32,
    /// Weight of the entropy of opacities.
    pub opacity_entropy: f32,
}

impl Default for LossConfig {
    fn default() -> Self {
        Self {
            ssim: 0.2,
            crop_ssim: true,
            double_alpha: false,
            depth: 0.5,
            depth_mode: DepthMode::Normalized,
            mask: 0.1,
            opacity_entropy: 0.0,
        }
    }
}

/// Values of the terms of one image, unweighted but for `total`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LossTerms {
    /// Mean absolute colour difference.
    pub l1: f64,
    /// Mean structural similarity.
    pub ssim: f64,
    /// Depth loss.
    pub depth: f64,
    /// Mean absolute difference of alpha.
    pub mask: f64,
    /// Weighted sum.
    pub total: f64,
    /// Mean squared colour difference.
    pub mse: f64,
}

impl LossTerms {
    /// Sets the weighted sum of the others.
    pub fn weigh(&mut self, config: &LossConfig) {
        let [ssim, depth, mask] = [config.ssim, config.depth, config.mask].map(f64::from);
        self.total = (1.0 - ssim) * self.l1 + depth * self.depth + mask * self.mask;
        if config.ssim > 0.0 {
            self.total += ssim * (1.0 - self.ssim);
        }
    }
}

/// Fewer valid depths than this and the published depth loss is skipped.
pub const MIN_VALID_DEPTHS: usize = 100;
/// Depth is divided by alpha only above this alpha.
pub(crate) const MIN_ALPHA: f32 = 0.5;

/// Workspace that turns a rendering and a photograph into a loss and the gradient of the loss.
#[derive(Clone, Debug, Default)]
pub struct ImageLoss {
    /// Gradient of `total` of the last evaluation.
    pub grad: FrameGrad,
    target: Vec<f32>,
    rows: Vec<[f64; 2]>,
    ssim: Ssim,
}

impl ImageLoss {
    /// An empty workspace; grows at the first use.
    pub fn new() -> Self {
        Self::default()
    }

    /// Compares a rendering over `background` with a photograph blended over the same background. Depths are divided
    /// by `depth_unit` (scene units) inside the logarithm. Leaves the gradient in `grad`.
    pub fn evaluate(
        &mut self,
        frame: &Frame,
        image: &TrainImage,
        background: [f32; 3],
        config: &LossConfig,
        depth_unit: f32,
    ) -> LossTerms {
        let n = image.area();
        assert!(frame.width == image.width && frame.height == image.height, "rendering and photograph differ in size");
        self.target.resize(3 * n, 0.0);
        self.grad.rgb.resize(3 * n, 0.0);
        self.grad.depth.resize(n, 0.0);
        self.grad.alpha.resize(n, 0.0);
        let mut terms = LossTerms::default();
        (terms.l1, terms.mse) = self.colors(frame, image, background, config);
        if config.ssim > 0.0 {
            let (w, h) = (image.width, image.height);
            let rect = if config.crop_ssim { image.object.grown(16, w, h) } else { Rect::full(w, h) };
            terms.ssim = self.ssim.evaluate(&frame.rgb, &self.target, (w, h), rect, -config.ssim, &mut self.grad.rgb);
        }
        (terms.depth, terms.mask) = self.geometry(frame, image, config, depth_unit);
        terms.weigh(config);
        terms
    }

    /// Composes the target; L1 with its gradient (overwrites), and the mean squared error.
    fn colors(&mut self, frame: &Frame, image: &TrainImage, background: [f32; 3], config: &LossConfig) -> (f64, f64) {
        let (width, n, level) = (image.width, image.area(), level());
        let step = (1.0 - config.ssim) / (3 * n) as f32;
        self.rows.resize(image.height, [0.0; 2]);
        par_planes(&mut self.target, width, n)
            .zip(par_planes(&mut self.grad.rgb, width, n))
            .zip(self.rows.par_iter_mut())
            .enumerate()
            .with_min_len(16)
            .for_each(|(row, ((target, grad), sums))| {
                let from = row * width;
                let photo = &image.rgba[from..from + width];
                let render: [&[f32]; 3] = std::array::from_fn(|c| &frame.rgb[c * n + from..c * n + from + width]);
                dispatch!(level, _simd => {
                    *sums = [0.0; 2];
                    for ((c, target), grad) in target.into_iter().enumerate().zip(grad) {
                        compose(photo, 8 * c as u32, background[c], config.double_alpha, target);
                        let [l1, squared] = absolute(render[c], target, step, grad);
                        *sums = [sums[0] + l1, sums[1] + squared];
                    }
                });
            });
        let sum = |i: usize| self.rows.iter().map(|r| r[i]).sum::<f64>() / (3 * n) as f64;
        (sum(0), sum(1))
    }

    /// Depth and mask terms with their gradients (overwrite).
    fn geometry(&mut self, frame: &Frame, image: &TrainImage, config: &LossConfig, unit: f32) -> (f64, f64) {
        let (width, n) = (image.width, image.area());
        let valid = n - image.without_depth;
        let measured = image.depth.as_deref().filter(|_| config.depth > 0.0);
        let count = if config.depth_mode == DepthMode::Accumulated { valid } else { n };
        let measured = measured.filter(|_| count > MIN_VALID_DEPTHS || config.depth_mode == DepthMode::Normalized);
        let depth_step = config.depth / count as f32;
        let mask_step = config.mask / n as f32;
        self.rows.resize(image.height, [0.0; 2]);
        self.grad
            .depth
            .par_chunks_exact_mut(width)
            .zip(self.grad.alpha.par_chunks_exact_mut(width))
            .zip(self.rows.par_iter_mut())
            .enumerate()
            .with_min_len(16)
            .for_each(|(row, ((by_depth, by_alpha), sums))| {
                let span = row * width..(row + 1) * width;
                let photo = &image.rgba[span.clone()];
                let (depth, alpha) = (&frame.depth[span.clone()], &frame.alpha[span.clone()]);
                sums[1] = masks(alpha, photo, mask_step, by_alpha);
                by_depth.fill(0.0);
                sums[0] = match (measured, config.depth_mode) {
                    (None, _) => 0.0,
                    (Some(d), DepthMode::Accumulated) => {
                        accumulated(depth, measured_row(d, span), photo, unit, depth_step, by_depth)
                    }
                    (Some(d), DepthMode::Normalized) => {
                        normalized((depth, alpha), measured_row(d, span), photo, unit, depth_step, (by_depth, by_alpha))
                    }
                };
            });
        let sum = |i: usize| self.rows.iter().map(|r| r[i]).sum::<f64>();
        (sum(0) / count as f64, sum(1) / n as f64)
    }
}

/// Rows of three planes at once.
fn par_planes(planes: &mut [f32], width: usize, n: usize) -> impl IndexedParallelIterator<Item = [&mut [f32]; 3]> {
    let (r, rest) = planes.split_at_mut(n);
    let (g, b) = rest.split_at_mut(n);
    let rows = r.par_chunks_exact_mut(width).zip(g.par_chunks_exact_mut(width)).zip(b.par_chunks_exact_mut(width));
    rows.map(|((r, g), b)| [r, g, b])
}

/// One channel of a photograph, `shift` bits up in its pixels, over a background;
/// `alpha color + (1 - alpha) background`.
#[inline(always)]
fn compose(photo: &[[u8; 4]], shift: u32, background: f32, double_alpha: bool, out: &mut [f32]) {
    for (out, &pixel) in out.iter_mut().zip(photo) {
        let pixel = u32::from_le_bytes(pixel);
        let a = (pixel >> 24) as f32 * (1.0 / 255.0);
        let weight = if double_alpha { a * a } else { a };
        *out = weight * ((pixel >> shift & 255) as f32 * (1.0 / 255.0)) + (1.0 - a) * background;
    }
}

/// Sums of absolute and squared differences of a row; `grad = step sign(x - y)`.
#[inline(always)]
fn absolute(x: &[f32], y: &[f32], step: f32, grad: &mut [f32]) -> [f64; 2] {
    const LANES: usize = 16;
    let mut sums = [[0.0_f32; LANES]; 2];
    let mut add = |lane: usize, x: f32, y: f32, g: &mut f32| {
        let d = x - y;
        sums[0][lane] += d.abs();
        sums[1][lane] += d * d;
        *g = if d > 0.0 { step } else { 0.0 } - if d < 0.0 { step } else { 0.0 };
    };
    let whole = x.len() / LANES * LANES;
    for ((x, y), g) in x.chunks_exact(LANES).zip(y.chunks_exact(LANES)).zip(grad[..whole].chunks_exact_mut(LANES)) {
        for lane in 0..LANES {
            add(lane, x[lane], y[lane], &mut g[lane]);
        }
    }
    for i in whole..x.len() {
        add(i - whole, x[i], y[i], &mut grad[i]);
    }
    sums.map(|s| s.iter().map(|&v| f64::from(v)).sum())
}

/// Counts of some pixels and how many make a scene unit.
fn measured_row(depth: &DepthMap, span: Range<usize>) -> (&[u16], f32) {
    (&depth.counts()[span], depth.per_unit())
}

/// `log(1 + |accumulated - measured| / unit)`; pixels inside the mask without depth do not count.
fn accumulated(
    depth: &[f32],
    (measured, per_unit): (&[u16], f32),
    photo: &[[u8; 4]],
    unit: f32,
    step: f32,
    by_depth: &mut [f32],
) -> f64 {
    let mut sum = 0.0;
    for i in 0..depth.len() {
        let covered = photo[i][3] >= OBJECT_ALPHA;
        if measured[i] == 0 && covered {
            continue;
        }
        let r = (depth[i] - if covered { f32::from(measured[i]) / per_unit } else { 0.0 }) / unit;
        sum += f64::from(r.abs().ln_1p());
        by_depth[i] = step * sign(r) / (unit * (1.0 + r.abs()));
    }
    sum
}

/// `log(1 + |accumulated / alpha - measured| / unit)` where a depth was measured and alpha is above one half.
fn normalized(
    (depth, alpha): (&[f32], &[f32]),
    (measured, per_unit): (&[u16], f32),
    photo: &[[u8; 4]],
    unit: f32,
    step: f32,
    (by_depth, by_alpha): (&mut [f32], &mut [f32]),
) -> f64 {
    let mut sum = 0.0;
    for i in 0..depth.len() {
        if measured[i] == 0 || photo[i][3] < OBJECT_ALPHA || alpha[i] <= MIN_ALPHA {
            continue;
        }
        let z = depth[i] / alpha[i];
        let r = (z - f32::from(measured[i]) / per_unit) / unit;
        sum += f64::from(r.abs().ln_1p());
        let slope = step * sign(r) / (unit * (1.0 + r.abs()) * alpha[i]);
        by_depth[i] = slope;
        by_alpha[i] -= slope * z;
    }
    sum
}

/// Sum of `|alpha - mask|`; overwrites the gradient.
fn masks(alpha: &[f32], photo: &[[u8; 4]], step: f32, by_alpha: &mut [f32]) -> f64 {
    let mut sum = 0.0_f32;
    for ((g, &a), &m) in by_alpha.iter_mut().zip(alpha).zip(photo) {
        let d = a - f32::from(m[3]) * (1.0 / 255.0);
        sum += d.abs();
        *g = step * sign(d);
    }
    f64::from(sum)
}

/// -1, 0 or 1.
fn sign(v: f32) -> f32 {
    f32::from(v > 0.0) - f32::from(v < 0.0)
}

/// Mean binary cross-entropy between opacities and themselves rounded, `mean(log(1 + exp(-|l|)))` over raw logits `l`;
/// adds `weight` times its gradient to `grads`. Drives opacities to 0 or 1.
pub fn opacity_entropy(logits: &[f32], weight: f32, grads: &mut [f32]) -> f64 {
    let n = logits.len().max(1);
    let step = weight / n as f32;
    let mut sum = 0.0;
    for (g, &l) in grads.iter_mut().zip(logits) {
        let e = (-l.abs()).exp();
        sum += f64::from(e.ln_1p());
        *g -= step * if l > 0.0 { 1.0 } else { -1.0 } * e / (1.0 + e);
    }
    sum / n as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::images::DepthPick;
    use artgs_core::{Camera, Intrinsics, Rigid, State, View};

    const W: usize = 19;
    const H: usize = 23;

    fn view() -> View {
        let intrinsics = Intrinsics { fx: 20.0, fy: 20.0, cx: 9.5, cy: 11.5, width: W as u32, height: H as u32 };
        let alpha = |i: usize| if (4..13).contains(&(i % W)) && i / W > 3 { 255 - (i % 3) as u8 * 60 } else { 0 };
        let rgba = (0..W * H).map(|i| [(i * 7 % 256) as u8, (i * 13 % 256) as u8, 90, alpha(i)]).collect();
        let depth = (0..W * H).map(|i| if i % 11 == 0 { 0 } else { 20 + (i % 5) as u16 }).collect();
        let camera = Camera { intrinsics, world_to_camera: Rigid::IDENTITY };
        View { name: String::new(), camera, rgba, depth: Some(DepthMap::new(depth, 10.0)), derived: None }
    }

    fn image(view: &View) -> TrainImage<'_> {
        TrainImage::new(view, State::START, 1, DepthPick::Median)
    }

    fn frame() -> Frame {
        let wave = |i: usize, a: f32| 0.5 + 0.45 * (i as f32 * a).sin();
        let alpha: Vec<f32> = (0..W * H).map(|i| wave(i, 0.77)).collect();
        Frame {
            width: W,
            height: H,
            rgb: (0..3 * W * H).map(|i| wave(i, 0.13)).collect(),
            depth: alpha.iter().enumerate().map(|(i, a)| a * (2.0 + 0.3 * wave(i, 0.3))).collect(),
            alpha,
        }
    }

    fn check(config: &LossConfig) {
        let view = view();
        let (image, frame, mut loss) = (image(&view), frame(), ImageLoss::new());
        let mut value = |f: &Frame| loss.evaluate(f, &image, [0.3, 0.6, 0.1], config, 0.7).total;
        let shift = 1e-3;
        let mut differences = Vec::new();
        let fields: [fn(&mut Frame) -> &mut Vec<f32>; 3] = [|f| &mut f.rgb, |f| &mut f.depth, |f| &mut f.alpha];
        for (which, field) in fields.iter().enumerate() {
            for i in (3..field(&mut frame.clone()).len()).step_by(29) {
                let mut moved = |d: f32| {
                    let mut f = frame.clone();
                    field(&mut f)[i] += d;
                    value(&f)
                };
                let (up, mid, down) = (moved(shift), moved(0.0), moved(-shift));
                let kink = (up - mid) * (mid - down) < 0.0;
                differences.push((which, i, (up - down) / (2.0 * f64::from(shift)), kink));
            }
        }
        loss.evaluate(&frame, &image, [0.3, 0.6, 0.1], config, 0.7);
        let g = &loss.grad;
        let largest = g.rgb.iter().chain(&g.depth).chain(&g.alpha).fold(0.0_f32, |m, v| m.max(v.abs()));
        let mut seen = 0;
        for (which, i, want, _) in differences.iter().filter(|d| !d.3) {
            let got = f64::from([&g.rgb, &g.depth, &g.alpha][*which][*i]);
            assert!((got - want).abs() < 6e-3 * f64::from(largest), "{config:?} {which} {i}: {got} {want}");
            seen += usize::from(got != 0.0);
        }
        assert!(seen > 20);
    }

    #[test]
    fn gradients_match_finite_differences() {
        let none = LossConfig { ssim: 0.0, depth: 0.0, mask: 0.0, ..LossConfig::default() };
        check(&none);
        check(&LossConfig { ssim: 0.2, ..none });
        check(&LossConfig { ssim: 1.0, crop_ssim: false, mask: 0.5, ..none });
        check(&LossConfig { depth: 3.0, ..none });
        check(&LossConfig { depth: 3.0, depth_mode: DepthMode::Accumulated, double_alpha: true, ..none });
    }

    #[test]
    fn the_photograph_itself_costs_nothing() {
        let view = view();
        let (image, mut frame, back) = (image(&view), frame(), [0.3, 0.6, 0.1]);
        for c in 0..3 {
            compose(&image.rgba, 8 * c as u32, back[c], false, &mut frame.rgb[c * W * H..(c + 1) * W * H]);
        }
        frame.alpha = image.rgba.iter().map(|p| f32::from(p[3]) / 255.0).collect();
        frame.depth = frame.alpha.iter().enumerate().map(|(i, a)| a * image.depth_at(i)).collect();
        let terms = ImageLoss::new().evaluate(&frame, &image, back, &LossConfig::default(), 1.0);
        assert!(terms.total.abs() < 1e-6 && terms.mse < 1e-12, "{terms:?}");
    }

    #[test]
    fn opacity_entropy_matches_cross_entropy_and_finite_differences() {
        let logits = [-3.0_f32, -0.4, 0.2, 1.5, 6.0];
        let slow = |logits: &[f32]| {
            let term = |&l: &f32| {
                let p = 1.0 / (1.0 + (-f64::from(l)).exp());
                if p > 0.5 { -p.ln() } else { -(1.0 - p).ln() }
            };
            logits.iter().map(term).sum::<f64>() / logits.len() as f64
        };
        let mut grads = [0.0; 5];
        assert!((opacity_entropy(&logits, 0.1, &mut grads) - slow(&logits)).abs() < 1e-6);
        for i in 0..5 {
            let at = |d: f32| {
                let mut l = logits;
                l[i] += d;
                slow(&l)
            };
            let want = 0.1 * (at(1e-2) - at(-1e-2)) / 2e-2;
            assert!((f64::from(grads[i]) - want).abs() < 1e-5, "{i}: {} {want}", grads[i]);
        }
    }
}
