//! Depth by triangulation, structured light and active stereo: noise and steps of disparity, the shadow of the projector,
//! holes at edges and on dark, shiny or grazing surfaces.

use super::sensor::{SeenImage, SeenPoint, Sensor};
use crate::degrade::gaussian;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// What differs between devices.
pub(crate) struct Device {
    /// Distance between projector and camera, metres.
    baseline: f64,
    /// Steps of disparity per pixel of an image of 640 pixels.
    steps: f64,
    /// Nearest and farthest depth, metres.
    range: [f64; 2],
    /// Cosine of the angle from the normal beyond which there is no depth.
    grazing: f64,
    /// Brightness below which there is no depth.
    dark: f64,
    /// Cosine of the angle from the normal within which metal reflects the light into the camera.
    glare: f64,
}

pub(crate) const KINECT: Device =
    Device { baseline: 0.075, steps: 8.0, range: [0.45, 8.0], grazing: 0.2, dark: 0.09, glare: 0.97 };
pub(crate) const XTION: Device =
    Device { baseline: 0.075, steps: 8.0, range: [0.45, 8.0], grazing: 0.2, dark: 0.09, glare: 0.97 };
/// Passive stereo sees dark and shiny surfaces by their texture.
pub(crate) const D435: Device =
    Device { baseline: 0.05, steps: 32.0, range: [0.2, 10.0], grazing: 0.15, dark: 0.03, glare: 0.995 };

/// Depth counts as a step where it changes by more than this share between neighbours.
const STEP: f64 = 0.04;
/// Share of the pixels beside a step, and of all other pixels, without depth.
const LOST: [f64; 2] = [0.75, 0.003];

/// Depth in metres, 0 for holes.
pub(crate) fn measure(sensor: Sensor, device: &Device, image: &SeenImage, rng: &mut Pcg64Mcg) -> Vec<f64> {
    let shadow = shadows(device, image);
    let height = image.points.len() / image.width;
    let one = |pixel: usize, rng: &mut Pcg64Mcg| {
        let point = &image.points[pixel];
        // One random number each, so that a hole does not change the noise elsewhere.
        let (noise, luck) = (gaussian(rng), rng.random::<f64>());
        let share = if is_edge(image, height, pixel) { LOST[0] } else { LOST[1] };
        if shadow[pixel] || luck < share || !returns_light(device, point) {
            return 0.0;
        }
        let per_metre = image.focal * device.baseline;
        let disparity = per_metre / point.depth;
        // The step of disparity of the device, pixels of this image.
        let step = image.focal / 585.0 / device.steps;
        let metres_per_pixel = point.depth * point.depth / per_metre;
        // Rounding to steps is part of the measured noise.
        let total = sensor.noise(point.depth) / metres_per_pixel;
        let own = (total * total - step * step / 12.0).max((0.8 * total).powi(2)).sqrt();
        let stepped = ((disparity + own * noise) / step).round() * step;
        let depth = if stepped > 0.0 { per_metre / stepped } else { 0.0 };
        if (device.range[0]..device.range[1]).contains(&depth) { depth } else { 0.0 }
    };
    (0..image.points.len()).map(|pixel| one(pixel, rng)).collect()
}

fn returns_light(device: &Device, point: &SeenPoint) -> bool {
    // Inclined surfaces return less light.
    let bright = point.brightness * (0.4 + 0.6 * point.facing) > device.dark;
    point.depth > 0.0 && point.facing > device.grazing && bright && !(point.shiny && point.facing > device.glare)
}

fn is_edge(image: &SeenImage, height: usize, pixel: usize) -> bool {
    let (x, y) = (pixel % image.width, pixel / image.width);
    let depth = image.points[pixel].depth;
    let neighbours = [
        (x > 0).then(|| pixel - 1),
        (x + 1 < image.width).then(|| pixel + 1),
        (y > 0).then(|| pixel - image.width),
        (y + 1 < height).then(|| pixel + image.width),
    ];
    neighbours.into_iter().flatten().any(|n| (image.points[n].depth - depth).abs() > STEP * depth)
}

/// Pixels that the projector, which is to the left of the camera, does not see.
fn shadows(device: &Device, image: &SeenImage) -> Vec<bool> {
    let mut hidden = vec![false; image.points.len()];
    for (row, points) in image.points.chunks(image.width).enumerate() {
        // Column of the projector that each point has; the projector sees increasing ones.
        let mut last = f64::NEG_INFINITY;
        for (x, point) in points.iter().enumerate().filter(|(_, p)| p.depth > 0.0) {
            let column = x as f64 + image.focal * device.baseline / point.depth;
            hidden[row * image.width + x] = column < last - 0.5;
            last = last.max(column);
        }
    }
    hidden
}
