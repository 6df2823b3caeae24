//! Convolutions and pooling of small networks, forward only.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use rayon::prelude::*;

/// Floats of the unrolled input of one task; bounds memory for any size of image.
const UNROLLED: usize = 1 << 21;

/// Planar activations `[channels][height * width]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Features {
    pub(super) channels: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) values: Vec<f32>,
}

/// Number of windows along an axis; none if not one fits.
fn windows(extent: usize, size: usize, stride: usize, padding: usize) -> Option<usize> {
    Some((extent + 2 * padding).checked_sub(size)? / stride + 1)
}

/// A convolution with a square kernel and zero padding.
#[derive(Clone, Debug)]
pub(super) struct Convolution {
    pub(super) inputs: usize,
    pub(super) kernel: usize,
    pub(super) stride: usize,
    pub(super) padding: usize,
    /// `[outputs][inputs][kernel][kernel]`.
    pub(super) weights: Vec<f32>,
    /// `[outputs]`.
    pub(super) bias: Vec<f32>,
}

impl Convolution {
    /// `max(0, W * x + b)`; none if the input is smaller than the kernel. Rows of windows are unrolled into columns of
    /// a matrix, band by band, and multiplied with the weights.
    pub(super) fn rectified(&self, input: &Features) -> Option<Features> {
        let width = windows(input.width, self.kernel, self.stride, self.padding)?;
        let height = windows(input.height, self.kernel, self.stride, self.padding)?;
        let (outputs, taps) = (self.bias.len(), self.inputs * self.kernel * self.kernel);
        let rows = (UNROLLED / (taps * width)).clamp(1, height);
        let bands: Vec<(usize, Vec<f32>)> = (0..height.div_ceil(rows))
            .into_par_iter()
            .map(|band| {
                let first = band * rows;
                let count = rows.min(height - first);
                (first, self.band(input, first, count, width, taps))
            })
            .collect();
        let mut values = vec![0.0_f32; outputs * height * width];
        values.par_chunks_mut(height * width).enumerate().for_each(|(o, out)| {
            for (first, band) in &bands {
                let n = band.len() / outputs;
                let target = &mut out[first * width..][..n];
                target.iter_mut().zip(&band[o * n..][..n]).for_each(|(t, v)| *t = (v + self.bias[o]).max(0.0));
            }
        });
        Some(Features { channels: outputs, width, height, values })
    }

    /// `W * x` of `count` rows of windows, `[outputs][count * width]`.
    fn band(&self, input: &Features, first: usize, count: usize, width: usize, taps: usize) -> Vec<f32> {
        let (n, outputs) = (count * width, self.bias.len());
        let mut columns = vec![0.0_f32; taps * n];
        for (tap, row) in columns.chunks_mut(n).enumerate() {
            let (channel, within) = (tap / (self.kernel * self.kernel), tap % (self.kernel * self.kernel));
            let plane = &input.values[channel * input.width * input.height..][..input.width * input.height];
            let (dy, dx) = (within / self.kernel, within % self.kernel);
            for (y, line) in row.chunks_mut(width).enumerate() {
                let Some(sy) = ((first + y) * self.stride + dy).checked_sub(self.padding) else { continue };
                if sy >= input.height {
                    continue;
                }
                let source = &plane[sy * input.width..][..input.width];
                for (x, value) in line.iter_mut().enumerate() {
                    if let Some(v) = (x * self.stride + dx).checked_sub(self.padding).and_then(|sx| source.get(sx)) {
                        *value = *v;
                    }
                }
            }
        }
        let mut out = vec![0.0_f32; outputs * n];
        let weights = MatRef::from_row_major_slice(&self.weights, outputs, taps);
        let columns = MatRef::from_row_major_slice(&columns, taps, n);
        let product = MatMut::from_row_major_slice_mut(&mut out, outputs, n);
        matmul(product, Accum::Replace, weights, columns, 1.0, Par::Seq);
        out
    }
}

/// Largest value of every window of `size` by `size`; none if not one fits.
pub(super) fn max_pool(input: &Features, size: usize, stride: usize) -> Option<Features> {
    let (width, height) = (windows(input.width, size, stride, 0)?, windows(input.height, size, stride, 0)?);
    let mut values = vec![f32::NEG_INFINITY; input.channels * width * height];
    let planes = input.values.par_chunks(input.width * input.height);
    values.par_chunks_mut(width * height).zip(planes).for_each(|(out, plane)| {
        for (i, best) in out.iter_mut().enumerate() {
            for dy in 0..size {
                let start = (i / width * stride + dy) * input.width + i % width * stride;
                *best = plane[start..start + size].iter().fold(*best, |b, v| b.max(*v));
            }
        }
    });
    Some(Features { width, height, values, ..*input })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    fn random(count: usize, rng: &mut Pcg64Mcg) -> Vec<f32> {
        (0..count).map(|_| rng.random_range(-1.0..1.0)).collect()
    }

    /// The definition, one output at a time.
    fn naive(c: &Convolution, input: &Features, o: usize, y: usize, x: usize) -> f32 {
        let mut sum = f64::from(c.bias[o]);
        for i in 0..c.inputs {
            for (dy, dx) in (0..c.kernel).flat_map(|dy| (0..c.kernel).map(move |dx| (dy, dx))) {
                let (sy, sx) = ((y * c.stride + dy) as i64, (x * c.stride + dx) as i64);
                let (sy, sx) = (sy - c.padding as i64, sx - c.padding as i64);
                if (0..input.height as i64).contains(&sy) && (0..input.width as i64).contains(&sx) {
                    let weight = c.weights[((o * c.inputs + i) * c.kernel + dy) * c.kernel + dx];
                    let at = (i * input.height + sy as usize) * input.width + sx as usize;
                    sum += f64::from(weight) * f64::from(input.values[at]);
                }
            }
        }
        sum.max(0.0) as f32
    }

    #[test]
    fn convolutions_equal_their_definition() {
        let mut rng = Pcg64Mcg::seed_from_u64(4);
        for (inputs, outputs, kernel, stride, padding, (width, height)) in [
            (3, 8, 11, 4, 2, (37, 31)),
            (5, 7, 5, 1, 2, (9, 14)),
            (4, 6, 3, 1, 1, (1, 3)),
            (2, 3, 3, 2, 0, (8, 7)),
            // Several bands.
            (64, 2, 5, 1, 2, (120, 40)),
        ] {
            let weights = random(outputs * inputs * kernel * kernel, &mut rng);
            let bias = random(outputs, &mut rng);
            let input = Features { channels: inputs, width, height, values: random(inputs * width * height, &mut rng) };
            let c = Convolution { inputs, kernel, stride, padding, weights, bias };
            let out = c.rectified(&input).unwrap();
            for (i, found) in out.values.iter().enumerate() {
                let (x, y, o) = (i % out.width, i / out.width % out.height, i / (out.width * out.height));
                let expected = naive(&c, &input, o, y, x);
                assert!((found - expected).abs() < 2e-4, "{kernel} {stride} {padding}: {found} against {expected}");
            }
        }
    }

    #[test]
    fn pooling_takes_the_largest_and_drops_what_is_left_over() {
        let input = Features { channels: 1, width: 5, height: 4, values: (0..20).map(|v| -(v as f32)).collect() };
        let two = max_pool(&input, 2, 2).unwrap();
        assert_eq!((two.width, two.height, two.values), (2, 2, vec![0.0, -2.0, -10.0, -12.0]));
        let three = max_pool(&input, 3, 2).unwrap();
        assert_eq!((three.width, three.height, three.values), (2, 1, vec![0.0, -2.0]));
        assert_eq!(max_pool(&Features { width: 2, height: 10, ..input }, 3, 2), None);
    }
}
