//! Pinhole cameras: OpenCV axes (x right, y down, z forward), pixel centres at half integers.

use crate::Rigid;
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// Pinhole intrinsics in pixels. The centre of the top left pixel is (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point x, pixels; the image centre is `width / 2`.
    pub cx: f64,
    /// Principal point y, pixels; the image centre is `height / 2`.
    pub cy: f64,
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
}

impl Intrinsics {
    /// The same field of view at another image size.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let (sx, sy) = (f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        Self { fx: self.fx * sx, fy: self.fy * sy, cx: self.cx * sx, cy: self.cy * sy, width, height }
    }
}

/// A posed pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Pinhole intrinsics.
    pub intrinsics: Intrinsics,
    /// World to camera, OpenCV axes.
    pub world_to_camera: Rigid,
}

impl Camera {
    /// A camera at `eye` looking at `target`; `up` points up in the image.
    pub fn look_at(intrinsics: Intrinsics, eye: DVec3, target: DVec3, up: DVec3) -> Self {
        let z = (target - eye).normalize();
        let x = z.cross(up).normalize_or(z.any_orthonormal_vector());
        let y = z.cross(x);
        let camera_to_world = Rigid::from_matrix(glam::DMat3::from_cols(x, y, z), eye);
        Self { intrinsics, world_to_camera: camera_to_world.inverse() }
    }

    /// Camera centre in the world frame.
    pub fn position(&self) -> DVec3 {
        self.world_to_camera.inverse().translation
    }

    /// Pixel coordinates and depth (along the optical axis) of a world point; the pixel is meaningless for depth <= 0.
    pub fn project(&self, world: DVec3) -> (DVec2, f64) {
        let p = self.world_to_camera.apply(world);
        let k = &self.intrinsics;
        (DVec2::new(k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy), p.z)
    }

    /// World point at pixel coordinates `pixel` and planar depth `depth`.
    pub fn unproject(&self, pixel: DVec2, depth: f64) -> DVec3 {
        let k = &self.intrinsics;
        let p = DVec3::new((pixel.x - k.cx) / k.fx * depth, (pixel.y - k.cy) / k.fy * depth, depth);
        self.world_to_camera.inverse().apply(p)
    }

    /// The camera of an image with every `step`-th pixel in both directions, starting with the first.
    pub fn thinned(&self, step: usize) -> Self {
        let (k, s) = (self.intrinsics, step as f64);
        // The centre of pixel x is the centre of pixel x / step.
        let along = |c: f64| (c - 0.5) / s + 0.5;
        let (width, height) = (k.width / step as u32, k.height / step as u32);
        let intrinsics = Intrinsics { fx: k.fx / s, fy: k.fy / s, cx: along(k.cx), cy: along(k.cy), width, height };
        Self { intrinsics, ..*self }
    }

    /// The same view at another image size.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        Self { intrinsics: self.intrinsics.resized(width, height), ..*self }
    }

    /// The camera in the frame before `motion`: it sees `x` where this camera sees `motion * x`.
    pub fn moved_with(&self, motion: &Rigid) -> Self {
        Self { world_to_camera: self.world_to_camera * *motion, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn project_inverts_unproject() {
        let k = Intrinsics { fx: 500.0, fy: 480.0, cx: 200.0, cy: 140.0, width: 400, height: 300 };
        let camera = Camera::look_at(k, DVec3::new(1.0, -2.0, 1.5), DVec3::new(0.1, 0.2, 0.0), DVec3::Z);
        let p = camera.unproject(DVec2::new(12.5, 280.5), 1.75);
        let (uv, z) = camera.project(p);
        assert!((uv - DVec2::new(12.5, 280.5)).length() < 1e-9 && (z - 1.75).abs() < 1e-12);
        let above = camera.project(DVec3::new(0.1, 0.2, 0.1)).0;
        assert!(above.y < 140.0, "up in the world is up in the image");
    }

    #[test]
    fn pixels_of_a_thinned_camera_keep_their_rays() {
        let k = Intrinsics { fx: 300.0, fy: 280.0, cx: 101.25, cy: 90.5, width: 203, height: 180 };
        let camera = Camera::look_at(k, DVec3::new(2.0, -1.0, 0.7), DVec3::ZERO, DVec3::Z);
        let thin = camera.thinned(3);
        assert_eq!((thin.intrinsics.width, thin.intrinsics.height), (67, 60));
        for (x, y) in [(0.0, 0.0), (66.0, 59.0), (20.0, 31.0)] {
            let was = camera.unproject(DVec2::new(3.0 * x + 0.5, 3.0 * y + 0.5), 2.0);
            let is = thin.unproject(DVec2::new(x + 0.5, y + 0.5), 2.0);
            assert!(was.distance(is) < 1e-12);
        }
        assert_eq!(camera.thinned(1), camera);
    }
}
