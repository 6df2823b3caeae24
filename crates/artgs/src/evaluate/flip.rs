//! LDR-FLIP (Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", 2020): how different two pictures
//! look when one flips between them, per pixel in [0, 1].
//!
//! A colour part (contrast sensitivity filters in YCxCz, HyAB distance in Hunt-adjusted L*a*b*, redistributed to [0, 1])
//! raised to one minus a feature part (edges and points of the luminance). Pixels beyond the border repeat the border.

use rayon::prelude::*;

/// Pixels per degree of the published default: a 0.7 m wide display of 3840 pixels seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f64 = 67.0;

/// Exponent of the colour difference.
const QC: f64 = 0.7;
/// Share of the largest colour difference that is mapped to [0, `PT`].
const PC: f64 = 0.4;
const PT: f64 = 0.95;
/// Exponent of the feature difference.
const QF: f64 = 0.5;
/// Width of the feature detectors, degrees.
const FEATURE_WIDTH: f64 = 0.082;
/// Contrast sensitivity of the channels Y, Cx, Cz in space: sums of `a sqrt(pi / b) exp(-pi^2 x^2 / b)`, as `(a, b)`.
const SENSITIVITY: [&[(f64, f64)]; 3] = [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];

/// Linear sRGB to XYZ, white of D65.
const TO_XYZ: [[f64; 3]; 3] = [
    [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
    [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
    [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
];

type Matrix = [[f64; 3]; 3];

fn times(m: &Matrix, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Inverse by cofactors.
fn inverse(m: &Matrix) -> Matrix {
    let minor = |r: usize, c: usize| {
        let ([r1, r2], [c1, c2]) = ([(r + 1) % 3, (r + 2) % 3], [(c + 1) % 3, (c + 2) % 3]);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    std::array::from_fn(|r| std::array::from_fn(|c| minor(c, r) / determinant))
}

/// Conversions between colour spaces relative to the white that all of them share.
struct Spaces {
    white: [f64; 3],
    from_xyz: Matrix,
}

impl Spaces {
    fn new() -> Self {
        Self { white: times(&TO_XYZ, [1.0; 3]), from_xyz: inverse(&TO_XYZ) }
    }

    fn relative(&self, linear: [f64; 3]) -> [f64; 3] {
        let xyz = times(&TO_XYZ, linear);
        std::array::from_fn(|i| xyz[i] / self.white[i])
    }

    /// A linearised L*a*b*.
    fn ycxcz(&self, linear: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.relative(linear);
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    fn linear_of_ycxcz(&self, [l, cx, cz]: [f64; 3]) -> [f64; 3] {
        let y = (l + 16.0) / 116.0;
        let relative = [y + cx / 500.0, y, y - cz / 200.0];
        times(&self.from_xyz, std::array::from_fn(|i| relative[i] * self.white[i]))
    }

    /// L*a*b* with chroma scaled by lightness (Hunt effect).
    fn hunt_lab(&self, linear: [f64; 3]) -> [f64; 3] {
        const DELTA: f64 = 6.0 / 29.0;
        let f = |t: f64| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
        let [x, y, z] = self.relative(linear).map(f);
        let l = 116.0 * y - 16.0;
        [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
    }
}

fn linear_of_srgb(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// `|L - L'|` plus the Euclidean distance of the chromas.
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// One channel of a picture.
#[derive(Clone)]
struct Plane {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Plane {
    /// Correlation with `kx` along rows and `ky` along columns, of odd lengths.
    fn filtered(&self, kx: &[f64], ky: &[f64]) -> Self {
        let (w, h) = (self.width, self.height);
        let clamped = |i: usize, tap: usize, half: usize, n: usize| (i + tap).saturating_sub(half).min(n - 1);
        let mut across = vec![0.0_f32; w * h];
        across.par_chunks_mut(w).zip(self.values.par_chunks(w)).for_each(|(out, row)| {
            for (x, out) in out.iter_mut().enumerate() {
                let at = |t: usize| f64::from(row[clamped(x, t, kx.len() / 2, w)]);
                *out = kx.iter().enumerate().map(|(t, k)| k * at(t)).sum::<f64>() as f32;
            }
        });
        let mut values = vec![0.0_f32; w * h];
        values.par_chunks_mut(w).enumerate().for_each(|(y, out)| {
            let mut sums = vec![0.0_f64; w];
            for (t, k) in ky.iter().enumerate() {
                let row = &across[clamped(y, t, ky.len() / 2, h) * w..][..w];
                sums.iter_mut().zip(row).for_each(|(s, v)| *s += k * f64::from(*v));
            }
            out.iter_mut().zip(&sums).for_each(|(o, s)| *o = *s as f32);
        });
        Self { values, ..*self }
    }
}

/// `f` at whole steps from `-radius` to `radius`.
fn taps(radius: usize, f: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=2 * radius).map(|i| f(i as f64 - radius as f64)).collect()
}

fn scaled_to_one(mut kernel: Vec<f64>) -> Vec<f64> {
    let sum: f64 = kernel.iter().sum();
    kernel.iter_mut().for_each(|k| *k /= sum);
    kernel
}

/// Weights and one-dimensional kernels, of sum 1 each, whose weighted squares add up to a channel's filter.
fn sensitivity_kernels(terms: &[(f64, f64)], radius: usize, ppd: f64) -> Vec<(f64, Vec<f64>)> {
    use std::f64::consts::PI;
    let raw = terms.iter().map(|(a, b)| {
        let kernel = taps(radius, |x| (-PI * PI * (x / ppd).powi(2) / b).exp());
        let sum: f64 = kernel.iter().sum();
        (a * (PI / b).sqrt() * sum * sum, kernel)
    });
    let raw: Vec<(f64, Vec<f64>)> = raw.collect();
    let total: f64 = raw.iter().map(|r| r.0).sum();
    raw.into_iter().map(|(weight, kernel)| (weight / total, scaled_to_one(kernel))).collect()
}

/// A picture as the colour and the feature part see it.
struct Seen {
    /// Hunt-adjusted L*a*b* of the filtered picture.
    lab: Vec<[f64; 3]>,
    /// Edge and point strength of the luminance.
    features: Vec<[f64; 2]>,
}

fn see(rgb: &[f32], width: usize, height: usize, ppd: f64, spaces: &Spaces) -> Seen {
    let n = width * height;
    let opponent: Vec<[f64; 3]> = (0..n)
        .into_par_iter()
        .map(|i| spaces.ycxcz([0, 1, 2].map(|c| linear_of_srgb(f64::from(rgb[c * n + i]).clamp(0.0, 1.0)))))
        .collect();
    let plane = |pick: &dyn Fn(&[f64; 3]) -> f64| Plane {
        width,
        height,
        values: opponent.iter().map(|v| pick(v) as f32).collect(),
    };
    let widest = SENSITIVITY.iter().flat_map(|t| t.iter()).map(|t| t.1).fold(0.0, f64::max);
    let radius = (3.0 * (widest / (2.0 * std::f64::consts::PI.powi(2))).sqrt() * ppd).ceil() as usize;
    let filtered = [0, 1, 2].map(|c| {
        let channel = plane(&|v| v[c]);
        let mut sum = vec![0.0; n];
        for (weight, kernel) in sensitivity_kernels(SENSITIVITY[c], radius, ppd) {
            let part = channel.filtered(&kernel, &kernel);
            sum.iter_mut().zip(&part.values).for_each(|(s, v)| *s += weight * f64::from(*v));
        }
        sum
    });
    let color = |i: usize| {
        let linear = spaces.linear_of_ycxcz([filtered[0][i], filtered[1][i], filtered[2][i]]);
        spaces.hunt_lab(linear.map(|v| v.clamp(0.0, 1.0)))
    };
    let lab = (0..n).into_par_iter().map(color).collect();
    Seen { lab, features: features(&plane(&|v| (v[0] + 16.0) / 116.0), ppd) }
}

/// Scales the positive values of a kernel to the sum 1 and the negative ones to -1.
fn balanced(mut kernel: Vec<f64>) -> Vec<f64> {
    let up: f64 = kernel.iter().filter(|k| **k > 0.0).sum();
    let down: f64 = kernel.iter().filter(|k| **k < 0.0).sum();
    kernel.iter_mut().for_each(|k| *k /= if *k > 0.0 { up } else { -down });
    kernel
}

/// Gradient lengths by first and second derivatives of a Gaussian.
fn features(luminance: &Plane, ppd: f64) -> Vec<[f64; 2]> {
    let deviation = 0.5 * FEATURE_WIDTH * ppd;
    let radius = (3.0 * deviation).ceil() as usize;
    let gauss = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let smooth = scaled_to_one(taps(radius, gauss));
    let length = |kernel: Vec<f64>| {
        let (x, y) = (luminance.filtered(&kernel, &smooth), luminance.filtered(&smooth, &kernel));
        x.values.iter().zip(&y.values).map(|(x, y)| f64::from(*x).hypot(f64::from(*y))).collect::<Vec<_>>()
    };
    let edges = length(balanced(taps(radius, |x| -x * gauss(x))));
    let points = length(balanced(taps(radius, |x| (x * x / (deviation * deviation) - 1.0) * gauss(x))));
    edges.into_iter().zip(points).map(|(e, p)| [e, p]).collect()
}

/// Difference of every pixel, `[height * width]` in [0, 1], of planar sRGB pictures `[3][height * width]` in [0, 1].
/// `pixels_per_degree` is how large the pictures are seen, above 0.
pub fn flip_map(reference: &[f32], test: &[f32], width: usize, height: usize, pixels_per_degree: f64) -> Vec<f32> {
    assert!(reference.len() == 3 * width * height && test.len() == reference.len() && pixels_per_degree > 0.0);
    if reference.is_empty() {
        return Vec::new();
    }
    let spaces = Spaces::new();
    let [a, b] = [reference, test].map(|rgb| see(rgb, width, height, pixels_per_degree, &spaces));
    let largest = hyab(spaces.hunt_lab([0.0, 1.0, 0.0]), spaces.hunt_lab([0.0, 0.0, 1.0])).powf(QC);
    let knee = PC * largest;
    let color = |i: usize| {
        let d = hyab(a.lab[i], b.lab[i]).powf(QC);
        if d < knee { d * PT / knee } else { PT + (d - knee) / (largest - knee) * (1.0 - PT) }
    };
    let feature = |i: usize| {
        let apart = |k: usize| (a.features[i][k] - b.features[i][k]).abs();
        (apart(0).max(apart(1)) * std::f64::consts::FRAC_1_SQRT_2).powf(QF)
    };
    (0..width * height).into_par_iter().map(|i| color(i).powf(1.0 - feature(i)) as f32).collect()
}

/// Mean of [`flip_map`], the number that tables give; 0 for pictures without pixels.
pub fn flip(reference: &[f32], test: &[f32], width: usize, height: usize, pixels_per_degree: f64) -> f64 {
    let map = flip_map(reference, test, width, height, pixels_per_degree);
    map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const W: usize = 64;
    const H: usize = 48;

    fn picture(f: impl Fn(f64, f64) -> [f64; 3]) -> Vec<f32> {
        let at = |i: usize, c: usize| f((i % W) as f64, (i / W) as f64)[c].clamp(0.0, 1.0) as f32;
        (0..3).flat_map(|c| (0..W * H).map(move |i| (i, c))).map(|(i, c)| at(i, c)).collect()
    }

    fn checks(shift: f64) -> Vec<f32> {
        picture(|x, y| {
            let v = (((x + shift) / 8.0).floor() + (y / 8.0).floor()) % 2.0;
            [0.2 + 0.6 * v, 0.7 - 0.4 * v, 0.3 + 0.1 * v]
        })
    }

    fn dots() -> Vec<f32> {
        let inside = |x: f64, y: f64, cx: f64, cy: f64, square: f64| (x - cx).powi(2) + (y - cy).powi(2) < square;
        picture(|x, y| {
            let v = f64::from(inside(x, y, 20.0, 24.0, 9.0) || inside(x, y, 45.0, 12.0, 2.5));
            [v, 0.8 * v, 0.1 * v]
        })
    }

    /// Means and four pixels from the authors' own program (flip-evaluator 1.7) on the same pictures.
    #[test]
    fn agrees_with_the_published_program() {
        let hash = |x: f64, y: f64, k: f64| ((x * 12.9898 + y * 78.233 + k * 37.719) * 0.6180339887).rem_euclid(1.0);
        let gradients = |fade: f64, blue: f64| picture(move |x, y| [x / 63.0, fade * y / 47.0, blue]);
        let gradients = [gradients(1.0, 0.5), gradients(0.9, 0.6)];
        let noise = [picture(|x, y| [0.0, 1.0, 2.0].map(|k| hash(x, y, k))), picture(|_, _| [0.5; 3])];
        let checks = [checks(0.0), checks(2.0)];
        let dots = [picture(|_, _| [0.0; 3]), dots()];
        let plain = [picture(|_, _| [0.0, 1.0, 0.0]), picture(|_, _| [0.0, 0.0, 1.0])];
        for (pair, ppd, mean, pixels) in [
            (&gradients, 67.0, 0.436545551, [0.279401, 0.431963, 0.265955, 0.677991]),
            (&gradients, 20.0, 0.419570221, [0.277532, 0.409858, 0.253893, 0.673552]),
            (&checks, 67.0, 0.398646930, [0.06407, 0.140931, 0.638417, 0.969449]),
            (&checks, 20.0, 0.332896050, [0.0, 0.038701, 0.363032, 0.966233]),
            (&noise, 67.0, 0.437981507, [0.608979, 0.499015, 0.360142, 0.598973]),
            (&noise, 20.0, 0.777623286, [0.816416, 0.916539, 0.972339, 0.638508]),
            (&dots, 67.0, 0.055460074, [0.0, 0.988523, 0.978954, 0.0]),
            (&dots, 20.0, 0.021973690, [0.0, 0.987034, 0.991518, 0.0]),
            (&plain, 67.0, 1.0, [1.0; 4]),
        ] {
            let map = flip_map(&pair[0], &pair[1], W, H, ppd);
            let found = flip(&pair[0], &pair[1], W, H, ppd);
            assert!((found - mean).abs() < 2e-5, "mean at {ppd}: {found} against {mean}");
            for ((x, y), expected) in [(0, 0), (20, 24), (45, 12), (63, 47)].into_iter().zip(pixels) {
                let found = f64::from(map[y * W + x]);
                assert!((found - expected).abs() < 2e-4, "({x}, {y}) at {ppd}: {found} against {expected}");
            }
        }
    }

    #[test]
    fn equal_pictures_do_not_differ_and_order_does_not_matter() {
        let (a, b) = (checks(0.0), checks(3.0));
        assert_eq!(flip(&a, &a, W, H, PIXELS_PER_DEGREE), 0.0);
        assert_eq!(flip(&a, &b, W, H, PIXELS_PER_DEGREE), flip(&b, &a, W, H, PIXELS_PER_DEGREE));
        assert_eq!(flip(&[], &[], 0, 0, PIXELS_PER_DEGREE), 0.0);
    }

    #[test]
    fn black_and_white_differ_by_almost_everything() {
        let found = flip(&picture(|_, _| [0.0; 3]), &picture(|_, _| [1.0; 3]), W, H, PIXELS_PER_DEGREE);
        // HyAB is 100 of the 308 between green and blue, beyond the knee.
        assert!(found > 0.95 && found < 0.98, "{found}");
    }
}
