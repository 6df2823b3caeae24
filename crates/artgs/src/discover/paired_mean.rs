//! Mean depth around a pixel, exact on planes.

use artgs_core::DepthMap;

/// Tangent of the angle between line of sight and normal above which two neighbouring pixels show different surfaces.
const EDGE_SLOPE: f32 = 5.0;

/// A square window of a depth map.
pub(super) struct PairedMean<'a> {
    depth: &'a DepthMap,
    width: usize,
    height: usize,
    /// Pixels.
    focal: f32,
    /// Half the width of the window, pixels.
    radius: usize,
}

impl<'a> PairedMean<'a> {
    /// `size` is the width and height of the image, `focal` the focal length in pixels.
    pub(super) fn new(depth: &'a DepthMap, (width, height): (usize, usize), focal: f32, radius: usize) -> Self {
        Self { depth, width, height, focal, radius }
    }

    /// Depth at a pixel, scene units; 0 where the pixel itself has none.
    ///
    /// Pixels count in pairs on opposite sides of the centre, so that the mean of a plane, whose inverse depth is linear in
    /// the image, is the plane's depth at the centre also where a part of the window shows something else.
    pub(super) fn depth(&self, index: usize) -> f32 {
        let (x, y, z) = (index % self.width, index / self.width, self.depth.at(index));
        if z <= 0.0 {
            return 0.0;
        }
        let (mut sum, mut count) = (1.0 / z, 1.0);
        let reach = |at: usize, size: usize| self.radius.min(at).min(size - 1 - at) as isize;
        let (across, down) = (reach(x, self.width), reach(y, self.height));
        for dy in 0..=down {
            for dx in -across..=across {
                if dy == 0 && dx <= 0 {
                    continue;
                }
                let offset = dy * self.width as isize + dx;
                let limit = EDGE_SLOPE * z / self.focal * ((dx * dx + dy * dy) as f32).sqrt();
                let at = |sign: isize| self.depth.at(index.wrapping_add_signed(sign * offset));
                let (a, b) = (at(1), at(-1));
                if a.min(b) > 0.0 && (a - z).abs() <= limit && (b - z).abs() <= limit {
                    sum += 1.0 / a + 1.0 / b;
                    count += 2.0;
                }
            }
        }
        count / sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (40, 30);
    const FOCAL: f32 = 50.0;

    /// A slanted plane, before a wall on the right.
    fn plane(x: usize, y: usize) -> f32 {
        let (u, v) = ((x as f32 - 20.0) / FOCAL, (y as f32 - 15.0) / FOCAL);
        1.0 / (0.5 + 0.3 * u - 0.2 * v)
    }

    fn map(depth: impl Fn(usize, usize) -> f32) -> DepthMap {
        DepthMap::nearest(&(0..SIZE.0 * SIZE.1).map(|i| depth(i % SIZE.0, i / SIZE.0)).collect::<Vec<_>>())
    }

    #[test]
    fn planes_keep_their_depth_beside_edges_and_holes() {
        let scene = |x: usize, y: usize| {
            if y == 9 && x < 20 {
                0.0
            } else if x < 30 {
                plane(x, y)
            } else {
                9.0
            }
        };
        let depth = map(scene);
        let window = PairedMean::new(&depth, SIZE, FOCAL, 2);
        for i in 0..depth.len() {
            let expected = scene(i % SIZE.0, i / SIZE.0);
            assert!(
                (window.depth(i) - expected).abs() < 1e-3 * expected.max(1.0),
                "{i}: {} {expected}",
                window.depth(i)
            );
        }
    }

    #[test]
    fn noise_of_single_pixels_becomes_smaller() {
        let noise = |x: usize, y: usize| 0.01 * (((x * 7919 + y * 104_729) % 97) as f32 / 48.0 - 1.0);
        let depth = map(|x, y| plane(x, y) + noise(x, y));
        let error = |radius: usize| {
            let window = PairedMean::new(&depth, SIZE, FOCAL, radius);
            let squares = (0..depth.len()).map(|i| (window.depth(i) - plane(i % SIZE.0, i / SIZE.0)).powi(2));
            (squares.sum::<f32>() / depth.len() as f32).sqrt()
        };
        assert!(error(1) < 0.6 * error(0) && error(2) < 0.5 * error(0), "{} {} {}", error(0), error(1), error(2));
    }
}
