//! Placement of cameras.

use artgs_core::{Camera, Intrinsics};
use glam::DVec3;
use std::f64::consts::TAU;

/// A ring of cameras that look at one point from one distance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraRing {
    /// Point that all cameras look at, world frame.
    pub(crate) middle: DVec3,
    /// Direction that the front of the object faces, world frame.
    pub(crate) front: DVec3,
    /// Distance from `middle`, scene units.
    pub(crate) distance: f64,
    /// Range of azimuths, radians; half of it on each side of the front. A full turn is `TAU`.
    pub(crate) around: f64,
    /// Lowest and highest elevation, radians.
    pub(crate) elevations: [f64; 2],
}

impl CameraRing {
    /// Intrinsics of square images that just hold a ball of this radius around `middle`.
    pub(crate) fn intrinsics(&self, radius: f64, size: u32) -> Intrinsics {
        let pixels = f64::from(size);
        let focal = 0.5 * pixels / (radius / self.distance).asin().tan();
        Intrinsics { fx: focal, fy: focal, cx: pixels / 2.0, cy: pixels / 2.0, width: size, height: size }
    }

    /// Cameras on a spiral from the lowest to the highest elevation, denser in front of the object.
    /// `phase` in [0, 1) rotates and shifts the spiral.
    pub(crate) fn cameras(&self, intrinsics: Intrinsics, count: usize, phase: f64) -> Vec<Camera> {
        let facing = self.front.y.atan2(self.front.x);
        let [low, high] = self.elevations.map(f64::sin);
        let golden = (5_f64.sqrt() - 1.0) / 2.0;
        let at = |index: usize| {
            let sin = low + (high - low) * (index as f64 + 0.25 + 0.5 * phase) / count as f64;
            let turn = TAU * ((index as f64 * golden + phase).fract() - 0.5);
            let azimuth = facing + (turn - 0.55 * turn.sin()) * (self.around / TAU);
            let flat = (1.0 - sin * sin).sqrt();
            let eye = self.middle + self.distance * DVec3::new(flat * azimuth.cos(), flat * azimuth.sin(), sin);
            Camera::look_at(intrinsics, eye, self.middle, DVec3::Z)
        };
        (0..count).map(at).collect()
    }
}
