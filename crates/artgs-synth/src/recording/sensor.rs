//! Depth sensors: sizes, lenses, and noise with the magnitudes that were measured on recordings of each device.
//!
//! The measured quantity is the residual of small plane fits, its high-frequency part, at several distances:
//! Xtion on TUM RGB-D (`fr3`), Kinect on 7-Scenes, D435 on a public RealSense recording, LiDAR on iPhone recordings.

use super::{lidar, triangulation};
use artgs_core::Intrinsics;
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// A simulated device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Sensor {
    /// Structured light, first Kinect: 640x480, steps of disparity, holes.
    Kinect,
    /// Structured light, Asus Xtion Pro Live.
    Xtion,
    /// Active stereo, Intel RealSense D435.
    D435,
    /// LiDAR of a phone: 256x192, no steps; a smooth error, blurred edges.
    #[default]
    Lidar,
}

/// What one pixel of the depth image sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SeenPoint {
    /// True planar depth, metres; 0 = nothing.
    pub(crate) depth: f64,
    /// Cosine of the angle between the ray and the normal.
    pub(crate) facing: f64,
    /// Brightness of the surface, 0 to 1.
    pub(crate) brightness: f64,
    /// True for metal.
    pub(crate) shiny: bool,
}

/// One depth image as it is without errors, row-major, and what its errors depend on.
pub(crate) struct SeenImage<'a> {
    pub(crate) points: &'a [SeenPoint],
    pub(crate) width: usize,
    /// Focal length, pixels of the depth image.
    pub(crate) focal: f64,
    /// Number of the frame, for errors that change slowly.
    pub(crate) time: f64,
    /// Seed of errors that are common to all frames.
    pub(crate) seed: u64,
}

impl Sensor {
    /// Reads `kinect`, `xtion`, `d435` or `lidar`.
    pub fn from_name(name: &str) -> Option<Self> {
        [Self::Kinect, Self::Xtion, Self::D435, Self::Lidar].into_iter().find(|s| s.name() == name)
    }

    /// Name in options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kinect => "kinect",
            Self::Xtion => "xtion",
            Self::D435 => "d435",
            Self::Lidar => "lidar",
        }
    }

    /// Width of colour images where none is asked for, pixels; images are 4:3.
    pub fn default_width(self) -> u32 {
        if self == Self::Lidar { 720 } else { 640 }
    }

    /// Size of the depth image that belongs to a colour image of this size.
    pub(crate) fn depth_size(self, width: u32, height: u32) -> (u32, u32) {
        match self {
            Self::Lidar if width > 256 => (256, (f64::from(height) * 256.0 / f64::from(width)).round() as u32),
            _ => (width, height),
        }
    }

    /// Intrinsics of the colour camera at an image size; focal length and principal point as shares of the width are those
    /// of the device.
    pub(crate) fn intrinsics(self, width: u32, height: u32) -> Intrinsics {
        let (f, cx, cy) = match self {
            Self::Kinect => (585.0 / 640.0, 0.5, 0.5),
            Self::Xtion => (537.3 / 640.0, 320.1 / 640.0, 247.6 / 480.0),
            Self::D435 => (613.0 / 640.0, 0.503, 0.496),
            Self::Lidar => (1590.0 / 1920.0, 0.4933, 0.5052),
        };
        let (w, h) = (f64::from(width), f64::from(height));
        Intrinsics { fx: f * w, fy: f * w, cx: cx * w, cy: cy * h, width, height }
    }

    /// True if the focal length changes from frame to frame (optical stabilisation of phones).
    pub(crate) fn refocuses(self) -> bool {
        self == Self::Lidar
    }

    /// Standard deviation of the high-frequency noise of depth at a distance: pairs of distance, metres, and noise, millimetres.
    /// The noise of LiDAR is without the rounding to millimetres.
    pub(crate) fn noise_table(self) -> &'static [(f64, f64)] {
        match self {
            Self::Kinect => &[(0.75, 1.3), (1.25, 2.05), (1.75, 3.85), (2.5, 7.1), (4.0, 11.0)],
            Self::Xtion => &[(0.75, 1.4), (1.25, 2.2), (1.75, 3.75), (2.5, 7.8), (4.0, 16.5)],
            Self::D435 => &[(0.35, 0.42), (0.75, 0.67), (1.25, 2.6), (4.0, 20.0)],
            Self::Lidar => &[(0.35, 0.1), (0.75, 0.25), (1.75, 0.7), (2.5, 0.8), (4.0, 1.45)],
        }
    }

    /// The table of noise at a distance, metres; beyond its ends it is proportional to the distance.
    pub(crate) fn noise(self, depth: f64) -> f64 {
        let table = self.noise_table();
        let (first, last) = (table[0], table[table.len() - 1]);
        let millimetres = match table.iter().position(|(z, _)| *z > depth) {
            Some(0) => first.1 * depth / first.0,
            None => last.1 * depth / last.0,
            Some(next) => {
                let ((z0, n0), (z1, n1)) = (table[next - 1], table[next]);
                n0 + (n1 - n0) * (depth - z0) / (z1 - z0)
            }
        };
        millimetres / 1000.0
    }

    /// Depth as the device reports it, millimetres, 0 = none. For LiDAR, depth of low confidence counts as none.
    pub(crate) fn measure(self, image: &SeenImage, rng: &mut Pcg64Mcg) -> Vec<u16> {
        let metres = match self {
            Self::Lidar => lidar::measure(image, rng),
            Self::Kinect => triangulation::measure(self, &triangulation::KINECT, image, rng),
            Self::Xtion => triangulation::measure(self, &triangulation::XTION, image, rng),
            Self::D435 => triangulation::measure(self, &triangulation::D435, image, rng),
        };
        metres.into_iter().map(|d| crate::degrade::depth_count(d, super::MILLIMETRES)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    const WIDTH: usize = 256;
    const HEIGHT: usize = 192;

    /// An image of a bright plane at a distance, inclined by a slope of depth per metre across.
    fn plane(distance: f64, slope: f64, focal: f64) -> Vec<SeenPoint> {
        let point = |i: usize| {
            let x = ((i % WIDTH) as f64 + 0.5 - WIDTH as f64 / 2.0) / focal;
            SeenPoint { depth: distance / (1.0 - slope * x), facing: 0.95, brightness: 0.6, shiny: false }
        };
        (0..WIDTH * HEIGHT).map(point).collect()
    }

    fn measured(sensor: Sensor, points: &[SeenPoint], time: f64) -> Vec<f64> {
        let focal = sensor.intrinsics(if sensor == Sensor::Lidar { 256 } else { 640 }, 192).fx;
        let image = SeenImage { points, width: WIDTH, focal, time, seed: 5 };
        let counts = sensor.measure(&image, &mut Pcg64Mcg::seed_from_u64(3));
        counts.into_iter().map(|c| f64::from(c) / 1000.0).collect()
    }

    /// Median, over patches of 7x7 pixels, of the residual of a plane fit to the depth, millimetres.
    fn residual(depth: &[f64]) -> f64 {
        let half = 3_i32;
        let mut residuals = Vec::new();
        for (cy, cx) in (8..HEIGHT - 8).step_by(11).flat_map(|y| (8..WIDTH - 8).step_by(11).map(move |x| (y, x))) {
            let offsets = (-half..=half).flat_map(|v| (-half..=half).map(move |u| (u, v)));
            let patch: Vec<[f64; 3]> = offsets
                .map(|(u, v)| {
                    let i = (cy as i32 + v) as usize * WIDTH + (cx as i32 + u) as usize;
                    [f64::from(u), f64::from(v), depth[i]]
                })
                .collect();
            if patch.iter().any(|p| p[2] == 0.0) {
                continue;
            }
            let n = patch.len() as f64;
            let mean = patch.iter().map(|p| p[2]).sum::<f64>() / n;
            // The offsets are symmetric, so that the slopes are independent.
            let squares = patch.iter().map(|p| p[0] * p[0]).sum::<f64>();
            let slope = |k: usize| patch.iter().map(|p| p[k] * p[2]).sum::<f64>() / squares;
            let (a, b) = (slope(0), slope(1));
            let rest = patch.iter().map(|p| (p[2] - mean - a * p[0] - b * p[1]).powi(2)).sum::<f64>();
            residuals.push((rest / (n - 3.0)).sqrt());
        }
        residuals.sort_by(f64::total_cmp);
        assert!(residuals.len() > 50, "{} patches", residuals.len());
        residuals[residuals.len() / 2] * 1000.0
    }

    #[test]
    fn noise_on_planes_is_that_of_the_recordings() {
        // Percentiles 25 and 50 of the recordings, millimetres.
        type Rows = &'static [(f64, f64, f64)];
        let table: [(Sensor, Rows); 4] = [
            (
                Sensor::Xtion,
                &[(0.75, 1.3, 1.5), (1.25, 2.0, 2.4), (1.75, 3.4, 4.1), (2.5, 6.8, 8.8), (4.0, 15.0, 18.0)],
            ),
            (
                Sensor::Kinect,
                &[(0.75, 1.2, 1.4), (1.25, 1.8, 2.3), (1.75, 3.5, 4.2), (2.5, 6.2, 8.0), (4.0, 10.0, 12.0)],
            ),
            (Sensor::D435, &[(0.35, 0.38, 0.45), (0.75, 0.56, 0.77), (1.25, 1.9, 3.4), (4.0, 17.0, 24.0)]),
            (Sensor::Lidar, &[(0.75, 0.27, 0.41), (1.75, 0.6, 1.1), (2.5, 0.8, 0.9), (4.0, 1.1, 1.9)]),
        ];
        for (sensor, rows) in table {
            for (distance, low, high) in rows {
                let points = plane(*distance, 0.3, if sensor == Sensor::Lidar { 212.0 } else { 570.0 });
                let found = residual(&measured(sensor, &points, 4.0));
                assert!(
                    (0.75 * low..=1.3 * high).contains(&found),
                    "{} at {distance}: {found} is not in {low}..{high}",
                    sensor.name()
                );
            }
        }
    }

    #[test]
    fn structured_light_has_steps_and_lidar_a_smooth_error() {
        let points = plane(2.5, 0.0, 570.0);
        let mut depths: Vec<u64> = measured(Sensor::Kinect, &points, 0.0).iter().map(|d| (d * 1000.0) as u64).collect();
        depths.sort_unstable();
        depths.dedup();
        assert!(depths.len() < 12, "few values: {depths:?}");

        let points = plane(0.4, 0.0, 212.0);
        let error =
            |time: f64| -> Vec<f64> { measured(Sensor::Lidar, &points, time).iter().map(|d| d - 0.4).collect() };
        let (one, next, late) = (error(0.0), error(1.0), error(40.0));
        let between = |a: &[f64], b: &[f64]| {
            (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt() * 1000.0
        };
        let (near, far) = (between(&one, &next), between(&one, &late));
        assert!((1.4..4.8).contains(&far) && near < 0.7 * far, "{near} {far} mm between views");
    }

    /// A near square in front of a wall.
    fn step() -> Vec<SeenPoint> {
        let mut points = plane(2.0, 0.0, 570.0);
        for i in 0..points.len() {
            if (80..160).contains(&(i % WIDTH)) && (60..130).contains(&(i / WIDTH)) {
                points[i].depth = 1.2;
            }
        }
        points
    }

    #[test]
    fn edges_are_blurred_by_lidar_and_lost_by_structured_light() {
        let lidar = measured(Sensor::Lidar, &step(), 0.0);
        let between = |d: &f64| (1.28..1.92).contains(d);
        let (floating, lost) =
            (lidar.iter().filter(|d| between(d)).count(), lidar.iter().filter(|d| **d == 0.0).count());
        assert!(floating > 150 && lost > 150, "{floating} points float, {lost} have low confidence");
        let kinect = measured(Sensor::Kinect, &step(), 0.0);
        assert!(kinect.iter().filter(|d| between(d)).count() == 0);
        // The shadow of the projector is on one side of the near square only.
        let row = |x: std::ops::Range<usize>| x.filter(|x| kinect[90 * WIDTH + x] == 0.0).count();
        let (left, right) = (row(60..78), row(162..180));
        assert!(left.abs_diff(right) > 5, "{left} {right}");
    }

    #[test]
    fn dark_and_grazing_surfaces_have_holes() {
        let mut points = plane(1.5, 0.0, 570.0);
        points[..WIDTH * 60].iter_mut().for_each(|p| p.brightness = 0.03);
        points[WIDTH * 120..].iter_mut().for_each(|p| p.facing = 0.1);
        let depth = measured(Sensor::Xtion, &points, 0.0);
        let valid = |rows: std::ops::Range<usize>| {
            depth[rows.start * WIDTH..rows.end * WIDTH].iter().filter(|d| **d > 0.0).count() as f64
                / (60 * WIDTH) as f64
        };
        assert!(valid(0..60) < 0.1 && valid(60..120) > 0.97 && valid(120..180) < 0.1);
    }

    #[test]
    fn names_are_read_back() {
        for sensor in [Sensor::Kinect, Sensor::Xtion, Sensor::D435, Sensor::Lidar] {
            assert_eq!(Sensor::from_name(sensor.name()), Some(sensor));
        }
        assert_eq!(Sensor::from_name("sonar"), None);
    }
}
