//! Depth noise of single pixels, averaged within surfaces.

use artgs_core::DepthMap;

/// Depth of a view in which the noise of single pixels is averaged by planes through their neighbourhoods; unchanged if the
/// noise is small against the size of a pixel. Noise that neighbouring pixels share remains. `focal` is in pixels.
///
/// Planes are fitted to inverse depth, which is linear on them; its noise does not depend on the distance where that of the
/// depth grows with its square, as for structured light and stereo.
pub(super) fn smoothed(depth: &DepthMap, width: usize, focal: f32) -> Option<DepthMap> {
    /// Noise in sizes of a pixel below which normals of 5 x 5 pixels are good enough.
    const SMALL: f32 = 1.0;
    /// Standard deviation of the slope of a fitted plane, radians.
    const SLOPE: f32 = 0.1;
    /// Radii of a neighbourhood, pixels.
    const RADII: (f32, f32) = (2.0, 8.0);
    let inverse = inverted(depth);
    let (noise, ratio) = inverse_noise(&inverse, width, focal)?;
    if ratio < SMALL {
        return None;
    }
    let side = (12.0_f32.sqrt() / SLOPE * ratio).sqrt();
    let radius = (0.5 * (side - 1.0)).ceil().clamp(RADII.0, RADII.1) as usize;
    let window = Window { inverse: &inverse, width, noise, radius, oblique: 1.0 / focal };
    let values: Vec<f32> =
        (0..inverse.len()).map(|i| if inverse[i] > 0.0 { 1.0 / window.fitted(i) } else { 0.0 }).collect();
    Some(DepthMap::nearest(&values))
}

/// Standard deviation of the noise of single pixels, sizes of a pixel at the median depth; none with too few pixels.
pub(super) fn pixel_noise(depth: &DepthMap, width: usize, focal: f32) -> Option<f32> {
    inverse_noise(&inverted(depth), width, focal).map(|(_, ratio)| ratio)
}

/// Inverse depth, 0 where there is none.
fn inverted(depth: &DepthMap) -> Vec<f32> {
    depth.iter().map(|z| if z > 0.0 { 1.0 / z } else { 0.0 }).collect()
}

/// Standard deviation of the noise of inverse depth, from differences between each pixel and the mean of its two neighbours,
/// and that of the depth it stands for in sizes of a pixel, both at the median depth; none with too few pixels.
fn inverse_noise(inverse: &[f32], width: usize, focal: f32) -> Option<(f32, f32)> {
    /// Every so many pixels are measured; odd, so that they are not in one column.
    const STRIDE: usize = 7;
    const LEAST: usize = 50;
    /// Median of absolute values of a normal distribution, and the length of (1, -2, 1).
    const SCALE: f32 = 1.0 / (0.6745 * 2.449_49);
    let inner = (1..inverse.len().saturating_sub(1)).step_by(STRIDE).filter(|i| (1..width - 1).contains(&(i % width)));
    let triples = inner.map(|i| [inverse[i - 1], inverse[i], inverse[i + 1]]).filter(|t| t.iter().all(|w| *w > 0.0));
    let (bends, mut middles): (Vec<f32>, Vec<f32>) = triples.map(|t| ((t[0] - 2.0 * t[1] + t[2]).abs(), t[1])).unzip();
    if bends.len() < LEAST {
        return None;
    }
    let half = middles.len() / 2;
    let middle = *middles.select_nth_unstable_by(half, f32::total_cmp).1;
    let noise = SCALE * crate::trimmed::quantile(bends, 0.5)?;
    // Depth noise at the middle depth z is noise * z^2; a pixel is z / focal wide.
    Some((noise, noise * focal / middle))
}

/// Neighbourhoods that planes are fitted to.
struct Window<'a> {
    inverse: &'a [f32],
    width: usize,
    /// Standard deviation of inverse depth.
    noise: f32,
    /// Pixels to each side.
    radius: usize,
    /// Change of inverse depth from pixel to pixel on a surface seen at 45 degrees, relative to the inverse depth. On steeper
    /// ones the first plane is fitted to the nearest pixels only; more would join surfaces across steps.
    oblique: f32,
}

impl Window<'_> {
    /// Inverse depth of pixel `i` on the plane through its neighbours on the same surface.
    fn fitted(&self, i: usize) -> f32 {
        /// Pixels farther from the plane are on another surface, standard deviations.
        const GATES: [f32; 2] = [4.0, 3.0];
        /// Fewer pixels do not give a plane.
        const LEAST: f32 = 9.0;
        let mut plane = [self.inverse[i], 0.0, 0.0];
        for (round, gate) in GATES.into_iter().enumerate() {
            let slack = if round == 0 { self.oblique * plane[0] } else { 0.0 };
            match self.fit(i, plane, gate * self.noise, slack) {
                Some((count, found)) if count >= LEAST => plane = found,
                _ => break,
            }
        }
        // A plane that leaves the measurement was extrapolated.
        let (measured, limit) = (self.inverse[i], GATES[0] * self.noise);
        let found = plane[0].clamp(measured - limit, measured + limit);
        // Near 0 the depth would be immense, and with it the unit of the whole depth map.
        if found > 0.5 * measured { found } else { measured }
    }

    /// Least-squares plane (value at the pixel, slopes along columns and rows) through the pixels within `gate` of the plane
    /// `near`, and their number.
    fn fit(&self, i: usize, near: [f32; 3], gate: f32, slack: f32) -> Option<(f32, [f32; 3])> {
        let (x, y) = ((i % self.width) as i32, (i / self.width) as i32);
        let rows = (self.inverse.len() / self.width) as i32;
        let r = self.radius as i32;
        let (mut n, mut sx, mut sy, mut sxx, mut sxy, mut syy) = (0.0_f32, 0.0, 0.0, 0.0, 0.0, 0.0);
        let (mut sw, mut swx, mut swy) = (0.0_f32, 0.0, 0.0);
        for yy in (y - r).max(0)..=(y + r).min(rows - 1) {
            let dy = (yy - y) as f32;
            let row = (yy * self.width as i32) as usize;
            for xx in (x - r).max(0)..=(x + r).min(self.width as i32 - 1) {
                let w = self.inverse[row + xx as usize];
                let dx = (xx - x) as f32;
                let off = w - (near[0] + near[1] * dx + near[2] * dy);
                let keep = w > 0.0 && off.abs() < gate + slack * dx.abs().max(dy.abs());
                let k = f32::from(u8::from(keep));
                let value = k * (w - near[0]);
                n += k;
                sx += k * dx;
                sy += k * dy;
                sxx += k * dx * dx;
                sxy += k * dx * dy;
                syy += k * dy * dy;
                sw += value;
                swx += value * dx;
                swy += value * dy;
            }
        }
        let normal = glam::Mat3::from_cols_array(&[n, sx, sy, sx, sxx, sxy, sy, sxy, syy]);
        // The determinant of n points spread over an area of a square pixel each is about n^3.
        if n < 3.0 || normal.determinant() < 0.01 * n * n * n {
            return None;
        }
        let solution = normal.inverse() * glam::Vec3::new(sw, swx, swy);
        Some((n, [near[0] + solution.x, solution.y, solution.z]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    const WIDTH: usize = 80;
    const FOCAL: f32 = 100.0;

    /// A slanted wall with a step of 0.5 in the middle.
    fn wall(i: usize) -> f32 {
        let (x, y) = ((i % WIDTH) as f32, (i / WIDTH) as f32);
        let near = 1.0 / (0.5 + 0.002 * (x - 40.0) - 0.001 * (y - 30.0));
        if x < 40.0 { near } else { near + 0.5 }
    }

    fn noisy(noise: f32) -> DepthMap {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let normal = |rng: &mut Pcg64Mcg| (0..12).map(|_| rng.random_range(0.0..1.0_f32)).sum::<f32>() - 6.0;
        let depths: Vec<f32> = (0..WIDTH * 60).map(|i| wall(i) + noise * wall(i).powi(2) * normal(&mut rng)).collect();
        DepthMap::nearest(&depths)
    }

    fn error(depth: &DepthMap) -> f32 {
        let squares: f32 = depth.iter().enumerate().map(|(i, z)| (z - wall(i)).powi(2)).sum();
        (squares / depth.len() as f32).sqrt()
    }

    #[test]
    fn noise_is_averaged_and_steps_stay() {
        let given = noisy(0.01);
        let found = smoothed(&given, WIDTH, FOCAL).expect("the noise is as large as two pixels");
        assert!(error(&found) < 0.4 * error(&given), "{} {}", error(&found), error(&given));
        // At the step no pixel is between the two surfaces.
        for y in 5..55 {
            let (left, right) = (found.at(y * WIDTH + 39), found.at(y * WIDTH + 40));
            assert!(right - left > 0.35, "{left} {right}");
        }
    }

    #[test]
    fn noise_of_single_pixels_is_measured_in_sizes_of_a_pixel() {
        // The middle inverse depth is 0.46, so that noise of 0.01 z^2 is that of 0.01 * 100 / 0.46 pixels.
        for noise in [0.002, 0.01] {
            let found = pixel_noise(&noisy(noise), WIDTH, FOCAL).unwrap();
            assert!((found / (noise * FOCAL / 0.46) - 1.0).abs() < 0.1, "{noise} {found}");
        }
        assert!(pixel_noise(&noisy(0.0), WIDTH, FOCAL).unwrap() < 0.05);
        assert_eq!(pixel_noise(&DepthMap::nearest(&[0.0; WIDTH * 60]), WIDTH, FOCAL), None);
    }

    /// A depth map has one unit for all pixels: one immense depth would leave nothing of the others.
    #[test]
    fn pixels_at_a_great_distance_do_not_become_infinite() {
        // Inverse depth falls to almost 0 at the right border: planes through it fall below.
        let given = noisy(0.02);
        let inverse = |i: usize, z: f32| match i % WIDTH {
            x @ 74.. => (0.02 * (77.5 - x as f32)).max(5e-4),
            _ => 1.0 / z,
        };
        let depths: Vec<f32> = given.iter().enumerate().map(|(i, z)| 1.0 / inverse(i, z)).collect();
        let found = smoothed(&DepthMap::nearest(&depths), WIDTH, FOCAL).expect("noise is large");
        assert!(found.iter().all(|z| (0.5..4100.0).contains(&z)));
    }

    #[test]
    fn exact_depth_is_kept_and_holes_stay() {
        assert!(smoothed(&noisy(0.0), WIDTH, FOCAL).is_none());
        assert!(smoothed(&DepthMap::nearest(&vec![0.0; WIDTH * 60]), WIDTH, FOCAL).is_none());
        let given = noisy(0.01);
        let holes: Vec<f32> = given.iter().enumerate().map(|(i, z)| if i % 5 == 0 { 0.0 } else { z }).collect();
        let found = smoothed(&DepthMap::nearest(&holes), WIDTH, FOCAL).expect("noise is large");
        assert!(found.iter().enumerate().all(|(i, z)| (z == 0.0) == (i % 5 == 0)));
    }
}
