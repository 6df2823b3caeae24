//! Depth of one camera as another camera beside it would measure it.

use super::depth::{Measured, Registered, edges};
use artgs_core::{DepthMap, Intrinsics, Rigid};
use glam::{DVec2, DVec3};

/// A depth camera beside the colour camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DepthCamera {
    /// Of the depth image.
    pub(super) intrinsics: Intrinsics,
    /// From the frame of the depth camera to that of the colour camera, OpenCV axes.
    pub(super) color_from_depth: Rigid,
}

/// A measured point in the colour image.
#[derive(Clone, Copy)]
struct Seen {
    pixel: DVec2,
    depth: f64,
}

impl Measured {
    /// Depth for the pixels of a colour camera with intrinsics `k`. Squares of four measured neighbours without a depth edge are
    /// drawn; the nearest surface remains.
    pub(super) fn warped(&self, camera: &DepthCamera, k: &Intrinsics) -> Registered {
        let (w, h) = (self.width as usize, self.height as usize);
        let own = camera.intrinsics.resized(self.width, self.height);
        let edge = edges(&self.map, w, h, own.fx as f32);
        let seen: Vec<Option<Seen>> = (0..w * h)
            .map(|i| {
                let depth = f64::from(self.map.at(i));
                let at = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
                let ray = DVec3::new((at.x - own.cx) / own.fx, (at.y - own.cy) / own.fy, 1.0);
                let p = camera.color_from_depth.apply(ray * depth);
                let pixel = DVec2::new(k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy);
                (!edge[i] && p.z > 0.0).then_some(Seen { pixel, depth: p.z })
            })
            .collect();
        let mut canvas = Canvas::new(k.width as usize, k.height as usize);
        for y in 1..h {
            for x in 1..w {
                let i = y * w + x;
                let corners = [seen[i - w - 1], seen[i - w], seen[i], seen[i - 1]];
                if let [Some(a), Some(b), Some(c), Some(d)] = corners {
                    canvas.triangle([a, b, c]);
                    canvas.triangle([a, c, d]);
                }
            }
        }
        let step = (k.fx / own.fx).max(1.0);
        Registered { map: DepthMap::nearest(&canvas.depth), step }
    }
}

/// A depth buffer; 0 where nothing was drawn.
struct Canvas {
    width: usize,
    height: usize,
    depth: Vec<f32>,
}

impl Canvas {
    fn new(width: usize, height: usize) -> Self {
        Self { width, height, depth: vec![0.0; width * height] }
    }

    /// Draws a triangle where pixel centres are inside; inverse depth is linear in the image.
    fn triangle(&mut self, [a, b, c]: [Seen; 3]) {
        let area = (b.pixel - a.pixel).perp_dot(c.pixel - a.pixel);
        if area.abs() < 1e-12 {
            return;
        }
        let low = a.pixel.min(b.pixel).min(c.pixel);
        let high = a.pixel.max(b.pixel).max(c.pixel);
        let range = |low: f64, high: f64, n: usize| {
            let first = (low - 0.5).ceil().clamp(0.0, n as f64) as usize;
            first..((high - 0.5).floor() + 1.0).clamp(first as f64, n as f64) as usize
        };
        for y in range(low.y, high.y, self.height) {
            for x in range(low.x, high.x, self.width) {
                let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let u = (c.pixel - b.pixel).perp_dot(at - b.pixel) / area;
                let v = (a.pixel - c.pixel).perp_dot(at - c.pixel) / area;
                let w = 1.0 - u - v;
                if u.min(v).min(w) < -1e-9 {
                    continue;
                }
                let depth = (1.0 / (u / a.depth + v / b.depth + w / c.depth)) as f32;
                let held = &mut self.depth[y * self.width + x];
                if *held == 0.0 || depth < *held {
                    *held = depth;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A near square before a wall, measured by a camera 5 cm to the left with other intrinsics.
    #[test]
    fn surfaces_move_to_the_other_camera() {
        let own = Intrinsics { fx: 60.0, fy: 60.0, cx: 40.0, cy: 30.0, width: 80, height: 60 };
        let k = Intrinsics { fx: 90.0, fy: 90.0, cx: 48.0, cy: 36.0, width: 96, height: 72 };
        let inside = |x: usize, y: usize| (30..50).contains(&x) && (20..40).contains(&y);
        let counts = (0..80 * 60).map(|i| if inside(i % 80, i / 80) { 1000 } else { 2000 }).collect();
        let camera = DepthCamera { intrinsics: own, color_from_depth: Rigid::shift(DVec3::new(-0.05, 0.0, 0.0)) };
        let measured = Measured {
            place: "d".into(),
            width: 80,
            height: 60,
            map: DepthMap::new(counts, 1000.0),
            camera: Some(camera),
            stored_per_unit: 1000.0,
        };
        let registered = measured.onto(&k).unwrap();
        let at = |x: f64, y: f64, z: f64| {
            let pixel = DVec2::new(k.fx * (x - 0.05) / z + k.cx, k.fy * y / z + k.cy);
            registered.map.at(pixel.y as usize * 96 + pixel.x as usize)
        };
        assert!((at(0.0, 0.0, 1.0) - 1.0).abs() < 1e-3 && (at(0.12, 0.1, 1.0) - 1.0).abs() < 1e-3);
        assert!((at(0.7, 0.3, 2.0) - 2.0).abs() < 1e-3);
        assert!(registered.map.iter().all(|d| d == 0.0 || (d - 1.0).abs() < 1e-3 || (d - 2.0).abs() < 1e-3));
        assert_eq!(registered.step, 1.5);
    }
}
