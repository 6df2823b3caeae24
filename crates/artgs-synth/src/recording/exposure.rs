//! Colour as a camera with automatic exposure and white balance records it.

use crate::degrade::gaussian;
use crate::material::value_noise;
use glam::DVec3;
use rand_pcg::Pcg64Mcg;

/// Mean colour that automatic exposure aims at.
const AIM: f64 = 0.46;
/// How much of the difference from the aim automatic exposure removes, as an exponent.
const CORRECTION: f64 = 0.6;
/// Largest slow changes of exposure and of the balance of red and blue.
const DRIFT: [f64; 2] = [0.15, 0.05];
/// Standard deviation of the noise of a pixel, of 1.
const NOISE: f64 = 0.006;

/// Gains of red, green and blue of one frame. `mean` is the mean of its colours before, in [0, 1]; `time` counts frames.
pub(crate) fn gains(mean: f64, time: f64, seed: u64) -> DVec3 {
    let slow = |channel: u64| 2.0 * value_noise(DVec3::new(time / 14.0, 0.5, 0.5), seed ^ 0xe870 ^ channel << 40) - 1.0;
    let gain = (AIM / mean.max(0.02)).powf(CORRECTION).clamp(0.5, 2.0) * (1.0 + DRIFT[0] * slow(0));
    gain * DVec3::new(1.0 + DRIFT[1] * slow(1), 1.0, 1.0 + DRIFT[1] * slow(2))
}

/// A pixel as it is recorded: with gains, noise and rounding.
pub(crate) fn recorded(color: DVec3, gains: DVec3, rng: &mut Pcg64Mcg) -> [u8; 4] {
    let noise = DVec3::new(gaussian(rng), gaussian(rng), gaussian(rng)) * NOISE;
    let rgb = ((color * gains + noise) * 255.0).round().clamp(DVec3::ZERO, DVec3::splat(255.0));
    [rgb.x as u8, rgb.y as u8, rgb.z as u8, 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dark_frames_become_brighter_and_exposure_changes_slowly() {
        let mean = |v: DVec3| v.element_sum() / 3.0;
        assert!(mean(gains(0.25, 3.0, 1)) > 1.2 && mean(gains(0.8, 3.0, 1)) < 0.85);
        let gains: Vec<DVec3> = (0..90).map(|t| gains(0.5, f64::from(t), 7)).collect();
        let range = gains.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), g| (l.min(g.y), h.max(g.y)));
        assert!(range.1 / range.0 > 1.04, "{range:?}");
        assert!(gains.windows(2).all(|w| (w[0] - w[1]).abs().max_element() < 0.04));
    }
}
