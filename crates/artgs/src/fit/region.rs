//! Where the object is, found from cameras and masks alone.

use super::images::TrainImage;
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// An axis-aligned box around the object, world frame, scene units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// Lowest corner.
    pub low: DVec3,
    /// Highest corner.
    pub high: DVec3,
}

/// Cells along each side of the carved cube.
const CELLS: usize = 48;

impl Region {
    /// Middle of the box.
    pub fn centre(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }

    /// Half the longest side.
    pub fn half_side(&self) -> f64 {
        0.5 * (self.high - self.low).max_element()
    }

    /// The box around both.
    pub fn union(&self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Carves a cube around the point the cameras look at with the rectangles the object fills in the images. What is
    /// left, grown by half a cell, is the region; the cube itself if nothing is left.
    pub fn of(images: &[TrainImage]) -> Self {
        let cube = Self::seen(images);
        let size = (cube.high - cube.low) / CELLS as f64;
        let carve = |z: usize| {
            let mut kept: Option<Self> = None;
            for (y, x) in (0..CELLS).flat_map(|y| (0..CELLS).map(move |x| (y, x))) {
                let p = cube.low + size * (DVec3::new(x as f64, y as f64, z as f64) + 0.5);
                if images.iter().all(|image| may_hold(image, p, size.max_element())) {
                    let (low, high) = kept.map_or((p, p), |k| (k.low.min(p), k.high.max(p)));
                    kept = Some(Self { low, high });
                }
            }
            kept
        };
        let slices: Vec<Option<Self>> = (0..CELLS).into_par_iter().map(carve).collect();
        slices
            .into_iter()
            .flatten()
            .reduce(|a, b| a.union(&b))
            .map_or(cube, |r| Self { low: r.low - 0.5 * size, high: r.high + 0.5 * size })
    }

    /// The cube around the point nearest to all optical axes that the widest view just covers.
    fn seen(images: &[TrainImage]) -> Self {
        let (mut a, mut b) = (DMat3::ZERO, DVec3::ZERO);
        let mut eyes = DVec3::ZERO;
        for image in images {
            let eye = image.camera.position();
            let axis = image.camera.world_to_camera.inverse().turn(DVec3::Z);
            let across = DMat3::IDENTITY - DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
            a += across;
            b += across * eye;
            eyes += eye;
        }
        let n = images.len().max(1) as f64;
        // Parallel axes have no nearest point; a faint pull to the mean eye keeps the system solvable.
        let faint = 1e-6 * n;
        let centre = (a + DMat3::from_diagonal(DVec3::splat(faint))).inverse() * (b + eyes / n * faint);
        let reach = |image: &TrainImage| {
            let k = image.camera.intrinsics;
            let half_angle = (0.5 * f64::from(k.width) / k.fx).max(0.5 * f64::from(k.height) / k.fy).atan();
            (image.camera.position() - centre).length() * half_angle.sin()
        };
        let half = images.iter().map(reach).fold(0.0, f64::max).max(1e-9);
        Self { low: centre - half, high: centre + half }
    }
}

/// False if the image shows that no part of the object is within a cell at `p`: its projection lies outside the
/// object's rectangle. Beyond a border that the rectangle touches, and behind the camera, an image shows nothing.
fn may_hold(image: &TrainImage, p: DVec3, cell: f64) -> bool {
    let (pixel, z) = image.camera.project(p);
    let r = image.object;
    if z <= 0.0 || r.is_empty() {
        return true;
    }
    let k = image.camera.intrinsics;
    let slack = 0.87 * cell / z * k.fx.max(k.fy);
    let inside = |v: f64, low: usize, high: usize, size: usize| {
        (low == 0 || v >= low as f64 - slack) && (high == size || v <= high as f64 + slack)
    };
    inside(pixel.x, r.x0, r.x1, image.width) && inside(pixel.y, r.y0, r.y1, image.height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::images::DepthPick;
    use artgs_core::{Camera, Intrinsics, State, View};

    #[test]
    fn carving_finds_a_ball_away_from_the_origin() {
        let (centre, radius) = (DVec3::new(3.0, -2.0, 8.0), 0.5);
        let k = Intrinsics { fx: 120.0, fy: 120.0, cx: 50.0, cy: 50.0, width: 100, height: 100 };
        let images: Vec<TrainImage> = (0..12)
            .map(|i| {
                let a = f64::from(i) * 0.55;
                let eye = centre + 4.0 * DVec3::new(a.cos() * 0.8, a.sin() * 0.8, 0.6 * (f64::from(i) * 1.3).sin());
                let camera = Camera::look_at(k, eye, centre + DVec3::new(0.05, 0.0, 0.1), DVec3::Z);
                let (middle, z) = camera.project(centre);
                let size = k.fx * radius / z;
                let rgba = (0..100 * 100)
                    .map(|i| {
                        let d = glam::DVec2::new(f64::from(i % 100) + 0.5, f64::from(i / 100) + 0.5) - middle;
                        [0, 0, 0, if d.length() < size { 255 } else { 0 }]
                    })
                    .collect();
                let view = View { name: String::new(), camera, rgba, depth: None, derived: None };
                TrainImage::new(&view, State::START, 1, DepthPick::Median).smaller(1)
            })
            .collect();
        let region = Region::of(&images);
        assert!((region.centre() - centre).length() < 0.1, "{region:?}");
        assert!((0.5..0.75).contains(&region.half_side()), "{region:?}");
    }
}
