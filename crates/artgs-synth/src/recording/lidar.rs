//! The depth of a phone with LiDAR: interpolated from few points by the colour image, so its error is smooth, and edges are
//! blurred over some pixels. White noise alone would be the wrong model.

use super::sensor::{SeenImage, Sensor};
use crate::degrade::gaussian;
use crate::material::value_noise;
use glam::DVec3;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// Standard deviation of the smooth error, as a share of depth: 1.4 to 4.8 mm between views at 0.2 to 0.6 m were measured.
const SMOOTH: f64 = 0.0045;
/// Standard deviation of `value_noise`, by which the smooth error is normalised.
const NOISE_SPREAD: f64 = 0.22;
/// Features of the smooth error: as a share of the width of the image, and in frames.
const FEATURES: [f64; 2] = [0.16, 7.0];
/// Standard deviation of the blur, pixels.
const BLUR: f64 = 0.9;
/// Depth has low confidence where it changes by more than this share within two pixels, ...
const STEP: f64 = 0.08;
/// ... in this share of these pixels; the others float between foreground and background.
const UNSURE: f64 = 0.6;
/// No depth of sufficient confidence beyond this distance, metres, and below this cosine of the angle to the normal.
const FARTHEST: f64 = 5.0;
const GRAZING: f64 = 0.12;

/// Depth in metres, 0 where its confidence is low.
pub(crate) fn measure(image: &SeenImage, rng: &mut Pcg64Mcg) -> Vec<f64> {
    let (width, points) = (image.width, image.points);
    let height = points.len() / width;
    // Planes are planes in inverse depth, so that blur does not change them.
    let inverse: Vec<f64> = points.iter().map(|p| if p.depth > 0.0 { 1.0 / p.depth } else { 0.0 }).collect();
    let across = blurred(&inverse, width, height, 1, width);
    let smooth = blurred(&across, height, width, width, 1);
    let one = |pixel: usize, rng: &mut Pcg64Mcg| {
        let point = &points[pixel];
        let (x, y) = (pixel % width, pixel / width);
        // One random number each, so that a hole does not change the noise elsewhere.
        let (noise, luck) = (gaussian(rng), rng.random::<f64>());
        if point.depth == 0.0 || smooth[pixel] <= 0.0 || point.depth > FARTHEST || point.facing < GRAZING {
            return 0.0;
        }
        let around = |dx: i32, dy: i32| {
            let (x, y) = (x as i32 + dx, y as i32 + dy);
            let (x, y) = (x.clamp(0, width as i32 - 1) as usize, y.clamp(0, height as i32 - 1) as usize);
            inverse[y * width + x]
        };
        let ring = [(-1, 0), (1, 0), (0, -1), (0, 1), (-2, 0), (2, 0), (0, -2), (0, 2)];
        // Curvature of inverse depth: 0 on planes, however inclined.
        let bend = ring.chunks(2).map(|p| around(p[0].0, p[0].1) + around(p[1].0, p[1].1) - 2.0 * inverse[pixel]);
        if bend.fold(0.0, |m: f64, b| m.max(b.abs())) > STEP * inverse[pixel] && luck < UNSURE {
            return 0.0;
        }
        let depth = 1.0 / smooth[pixel];
        let at = DVec3::new(x as f64, y as f64, 0.0) / (FEATURES[0] * width as f64);
        let field = value_noise(at.with_z(image.time / FEATURES[1]), image.seed ^ 0x11da);
        depth * (1.0 + SMOOTH * (field - 0.5) / NOISE_SPREAD) + Sensor::Lidar.noise(depth) * noise
    };
    (0..points.len()).map(|pixel| one(pixel, rng)).collect()
}

/// Values blurred along lines of `length` values that are `step` apart; there are `lines` lines, `stride` apart.
fn blurred(values: &[f64], length: usize, lines: usize, step: usize, stride: usize) -> Vec<f64> {
    let weights: Vec<f64> = (-3..=3).map(|k: i32| (-0.5 * (f64::from(k) / BLUR).powi(2)).exp()).collect();
    let mut out = vec![0.0; values.len()];
    for line in 0..lines {
        for i in 0..length {
            let (mut sum, mut weight) = (0.0, 0.0);
            for (k, w) in weights.iter().enumerate() {
                let Some(j) = (i + k).checked_sub(3).filter(|j| *j < length) else { continue };
                let value = values[line * stride + j * step];
                if value > 0.0 {
                    sum += w * value;
                    weight += w;
                }
            }
            out[line * stride + i * step] = if weight > 0.0 { sum / weight } else { 0.0 };
        }
    }
    out
}
