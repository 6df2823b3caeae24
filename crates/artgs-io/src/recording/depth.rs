//! Measured depth: confidence, and resampling to the pixels of the colour image.

use super::RecordingError;
use super::depth_file::{self, Scale};
use super::lens::same_shape;
use super::warp::DepthCamera;
use crate::image_io::read_rgba;
use artgs_core::{DepthMap, Intrinsics};
use std::path::Path;

/// A depth image as recorded.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    /// File or frame, for messages.
    pub(super) place: String,
    pub(super) width: u32,
    pub(super) height: u32,
    /// Row-major.
    pub(super) map: DepthMap,
    /// The camera that measured it; none: that of the colour image.
    pub(super) camera: Option<DepthCamera>,
    /// Stored numbers per scene unit, as the file was read.
    pub(super) stored_per_unit: f32,
}

/// Depth of every pixel of a colour image.
pub(super) struct Registered {
    pub(super) map: DepthMap,
    /// Width of a measured pixel, image pixels, at least 1.
    pub(super) step: f64,
}

impl Measured {
    /// The depths of a file with `stored_per_unit` numbers per scene unit.
    pub(super) fn new(path: &Path, width: u32, height: u32, map: DepthMap, stored_per_unit: f32) -> Self {
        Self { place: path.display().to_string(), width, height, map, camera: None, stored_per_unit }
    }

    /// The same numbers read in another unit, scene units per stored number.
    pub(super) fn in_unit(self, unit: f64) -> Self {
        let factor = unit as f32 * self.stored_per_unit;
        let map = DepthMap::new(self.map.counts().to_vec(), self.map.per_unit() / factor);
        Self { map, stored_per_unit: (1.0 / unit) as f32, ..self }
    }

    /// An image in millimetres, without the depth that a PNG gives the lowest confidence.
    pub(super) fn read_phone(depth: &Path, confidence: Option<&Path>) -> Result<Self, RecordingError> {
        let measured = depth_file::read(depth, Scale::MILLIMETRES, false)?;
        let Some(path) = confidence else { return Ok(measured) };
        let levels = read_rgba(path)?;
        let place = path.display().to_string();
        measured.without_untrusted(levels.width, levels.height, levels.pixels.iter().map(|p| p[0]), &place)
    }

    /// Removes depth of the lowest confidence.
    pub(super) fn without_untrusted(
        mut self,
        width: u32,
        height: u32,
        confidence: impl Iterator<Item = u8>,
        place: &str,
    ) -> Result<Self, RecordingError> {
        if (width, height) != (self.width, self.height) {
            let reason = format!(
                "the confidence is {width}x{height}, its depth image {} {}x{}; copy or export the recording again",
                self.place, self.width, self.height
            );
            return Err(RecordingError::malformed(Path::new(place), reason));
        }
        let trusted =
            |(count, level): (&u16, u8)| if level > artgs_core::recording::LOW_CONFIDENCE { *count } else { 0 };
        self.map = DepthMap::new(self.map.counts().iter().zip(confidence).map(trusted).collect(), self.map.per_unit());
        Ok(self)
    }

    /// Depth for the pixels of the same camera's image with intrinsics `k`. Depth of a smaller image is interpolated within
    /// surfaces and removed across depth edges; of a larger or equal one the nearest pixel is taken.
    pub(super) fn onto(&self, k: &Intrinsics) -> Result<Registered, RecordingError> {
        if let Some(camera) = &self.camera {
            return Ok(self.warped(camera, k));
        }
        if !same_shape((self.width, self.height), (k.width, k.height)) {
            let reason = format!(
                "the depth image is {}x{}, its colour image has the aspect ratio {}:{}; depth must show the same field of \
                 view, register it to the colour camera first",
                self.width, self.height, k.width, k.height
            );
            return Err(RecordingError::malformed(Path::new(&self.place), reason));
        }
        let step = (f64::from(k.width) / f64::from(self.width)).max(1.0);
        let (w, h) = (self.width as usize, self.height as usize);
        if self.width < k.width {
            let edges = edges(&self.map, w, h, k.resized(self.width, self.height).fx as f32);
            return Ok(Registered {
                map: enlarged(&self.map, &edges, (w, h), (k.width as usize, k.height as usize)),
                step,
            });
        }
        let along = |i: u32, to: u32, from: usize| ((f64::from(i) + 0.5) * from as f64 / f64::from(to)) as usize;
        let pixels = (0..k.height).flat_map(|y| {
            let row = along(y, k.height, h) * w;
            (0..k.width).map(move |x| row + along(x, k.width, w))
        });
        Ok(Registered { map: self.map.select(pixels), step })
    }
}

/// Tangent of the angle between the viewing ray and a surface's normal above which a depth step is an edge: 79 degrees.
const EDGE_SLOPE: f32 = 5.0;
/// The same for pixels beside an edge: the sensor blurs edges over some pixels, which float between two surfaces.
const BLURRED_SLOPE: f32 = 2.0;
/// Width of a blurred edge on either side, pixels.
const BLUR: usize = 2;

/// Pixels at depth edges, and holes. `focal` in pixels of the depth image.
pub(super) fn edges(map: &DepthMap, width: usize, height: usize, focal: f32) -> Vec<bool> {
    // Rounding of counts is no edge.
    let floor = 2.5 / map.per_unit();
    let exceeds = |a: f32, b: f32, slope: f32| a == 0.0 || b == 0.0 || (a - b).abs() > floor + a.min(b) * slope / focal;
    let steep = |i: usize, slope: f32| {
        let (x, y, z) = (i % width, i / width, map.at(i));
        (x + 1 < width && exceeds(z, map.at(i + 1), slope))
            || (x > 0 && exceeds(z, map.at(i - 1), slope))
            || (y + 1 < height && exceeds(z, map.at(i + width), slope))
            || (y > 0 && exceeds(z, map.at(i - width), slope))
    };
    let mut edge: Vec<bool> = (0..width * height).map(|i| map.at(i) == 0.0 || steep(i, EDGE_SLOPE)).collect();
    for _ in 0..BLUR {
        let near = |i: usize| {
            let (x, y) = (i % width, i / width);
            (y.saturating_sub(1)..(y + 2).min(height))
                .any(|v| (x.saturating_sub(1)..(x + 2).min(width)).any(|u| edge[v * width + u]))
        };
        edge = (0..width * height).map(|i| edge[i] || (near(i) && steep(i, BLURRED_SLOPE))).collect();
    }
    edge
}

/// Linear interpolation between pixels that are not at an edge; 0 elsewhere.
fn enlarged(map: &DepthMap, edge: &[bool], from: (usize, usize), to: (usize, usize)) -> DepthMap {
    let taps = |i: usize, from: usize, to: usize| {
        let at = ((i as f64 + 0.5) * from as f64 / to as f64 - 0.5).clamp(0.0, (from - 1) as f64);
        (at as usize, (at as usize + 1).min(from - 1), (at - at.floor()) as f32)
    };
    let columns: Vec<_> = (0..to.0).map(|x| taps(x, from.0, to.0)).collect();
    let mut depths = Vec::with_capacity(to.0 * to.1);
    for y in 0..to.1 {
        let (y0, y1, fy) = taps(y, from.1, to.1);
        depths.extend(columns.iter().map(|&(x0, x1, fx)| {
            let corners =
                [(y0, x0, 1.0 - fy, 1.0 - fx), (y0, x1, 1.0 - fy, fx), (y1, x0, fy, 1.0 - fx), (y1, x1, fy, fx)];
            let mut depth = 0.0;
            for (v, u, a, b) in corners {
                let i = v * from.0 + u;
                if edge[i] && a * b > 1e-6 {
                    return 0.0;
                }
                depth += a * b * map.at(i);
            }
            depth
        }));
    }
    DepthMap::nearest(&depths)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(width: u32, height: u32, depth: impl Fn(usize, usize) -> f64) -> Measured {
        let (w, h) = (width as usize, height as usize);
        let counts = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
        let counts = counts.map(|(x, y)| (1000.0 * depth(x, y)).round() as u16).collect();
        Measured::new(Path::new("d.png"), width, height, DepthMap::new(counts, 1000.0), 1000.0)
    }

    const K: Intrinsics = Intrinsics { fx: 64.0, fy: 64.0, cx: 32.0, cy: 24.0, width: 64, height: 48 };

    #[test]
    fn planes_are_interpolated() {
        let small = measured(16, 12, |x, y| 1.0 + 0.02 * (x as f64 + 0.5) + 0.01 * (y as f64 + 0.5));
        let full = small.onto(&K).unwrap();
        assert_eq!(full.step, 4.0);
        for (x, y) in [(2, 2), (31, 24), (60, 40), (33, 7)] {
            let truth = 1.0 + 0.005 * (x as f64 + 0.5) + 0.0025 * (y as f64 + 0.5);
            assert!((f64::from(full.map.at(y * 64 + x)) - truth).abs() < 1e-3, "{x} {y}");
        }
        assert!(full.map.iter().all(|d| d > 0.0));
    }

    /// A near and a far surface with two blurred columns between: no depth lies between the surfaces.
    #[test]
    fn nothing_floats_at_blurred_edges() {
        let ramp = [0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 1.1, 1.7, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0];
        let full = measured(16, 12, |x, _| ramp[x]).onto(&K).unwrap();
        assert!(full.map.iter().all(|d| d == 0.0 || (d - 0.8).abs() < 1e-3 || (d - 2.0).abs() < 1e-3));
        let kept = full.map.iter().filter(|d| *d > 0.0).count();
        assert!(kept > 64 * 48 / 2, "{kept}");
    }

    #[test]
    fn larger_and_equal_depth_keeps_its_counts() {
        let same = measured(64, 48, |x, y| 1.0 + 0.003 * (x * y % 7) as f64);
        assert_eq!(same.onto(&K).unwrap().map, same.map);
        let large = measured(128, 96, |x, _| if x < 64 { 1.0 } else { 2.0 });
        let small = large.onto(&K).unwrap();
        assert_eq!((small.map.at(31), small.map.at(32), small.step), (1.0, 2.0, 1.0));
    }

    #[test]
    fn another_unit_can_be_stated() {
        let tenth = measured(2, 1, |_, _| 3.0).in_unit(1e-4);
        assert!((tenth.map.at(0) - 0.3).abs() < 1e-6);
        assert!((tenth.in_unit(1e-4).map.at(0) - 0.3).abs() < 1e-6);
    }

    #[test]
    fn other_shapes_are_refused() {
        let message = measured(12, 16, |_, _| 1.0).onto(&K).err().unwrap().to_string();
        assert!(message.contains("d.png") && message.contains("12x16"), "{message}");
    }

    #[test]
    fn untrusted_depth_is_removed() {
        let all = measured(2, 1, |_, _| 1.0);
        let some = all.clone().without_untrusted(2, 1, [0, 2].into_iter(), "c.png").unwrap();
        assert_eq!(some.map.counts(), [0, 1000]);
        let message = all.without_untrusted(1, 1, [0].into_iter(), "c.png").unwrap_err().to_string();
        assert!(message.contains("c.png") && message.contains("1x1"), "{message}");
    }
}
