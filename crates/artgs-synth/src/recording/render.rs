//! Renders the frames of a recording: colour with motion blur and exposure, depth as the device reports it, true parts.

use super::room::Room;
use super::sensor::{SeenImage, SeenPoint, Sensor};
use super::{MILLIMETRES, RecordingCaptureOptions, exposure};
use crate::Material;
use crate::light::{LightMap, LightQuality};
use crate::material::value_noise;
use crate::trace::{Intersection, Surface};
use crate::visible::visible;
use artgs_core::{Camera, DepthMap, Intrinsics, PerState, Rigid, State, View};
use glam::DVec3;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// Samples of a pixel: offsets from its centre, pixels, and time, shutter times from the middle of the exposure. The first
/// one is the centre.
const SAMPLES: [([f64; 2], f64); 5] =
    [([0.0, 0.0], 0.0), ([-0.4, -0.2], -0.4), ([0.2, -0.4], -0.2), ([0.4, 0.2], 0.2), ([-0.2, 0.4], 0.4)];
/// Distance between points at which light is computed, metres; larger for images of fewer than [`LIGHT_WIDTH`] pixels.
const LIGHT_SPACING: f64 = 0.045;
const LIGHT_WIDTH: f64 = 320.0;

/// True parts that the pixels of a frame see: 0 room, 1 the static part, 2.. movable parts, and the labels of things beside
/// the object. Row-major.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameLabels {
    /// Of the colour image.
    pub colour: Vec<u8>,
    /// Of the depth image that the device measures.
    pub depth: Vec<u8>,
    /// Width of that depth image, pixels.
    pub depth_width: u32,
}

/// A frame to render.
pub(super) struct FramePlan {
    pub(super) index: usize,
    /// Time of the walk, 0 to 1, in the middle of the exposure.
    pub(super) time: f64,
    /// Time that the shutter is open.
    pub(super) shutter: f64,
    pub(super) intrinsics: Intrinsics,
    pub(super) seed: u64,
    /// Seed of what changes slowly from frame to frame.
    pub(super) state_seed: u64,
}

/// A rendered frame; the camera of the view is the true one, in the room.
pub(super) struct RenderedFrame {
    pub(super) view: View,
    pub(super) depth_step: f64,
    pub(super) labels: FrameLabels,
}

/// A room with its light in both states.
pub(super) struct Renderer<'a> {
    room: &'a Room,
    sensor: Sensor,
    seed: u64,
    /// Room to object frame of every part in both states.
    object_from_room: PerState<Vec<Rigid>>,
    surfaces: PerState<Surface>,
    lights: PerState<LightMap>,
}

/// What a ray sees.
struct Seen {
    point: SeenPoint,
    /// Colour with light, before exposure.
    color: DVec3,
    label: u8,
}

/// Rays of the pixels of an image.
struct Rays {
    room_to_camera: Rigid,
    eye: DVec3,
    axes: [DVec3; 3],
    k: Intrinsics,
}

impl Rays {
    fn new(room_to_camera: &Rigid, k: Intrinsics) -> Self {
        let pose = room_to_camera.inverse();
        Self {
            room_to_camera: *room_to_camera,
            eye: pose.translation,
            axes: DVec3::AXES.map(|axis| pose.turn(axis)),
            k,
        }
    }

    /// Direction through a point of the image, 1 along the optical axis.
    fn direction(&self, x: f64, y: f64) -> DVec3 {
        self.axes[0] * ((x - self.k.cx) / self.k.fx) + self.axes[1] * ((y - self.k.cy) / self.k.fy) + self.axes[2]
    }
}

impl<'a> Renderer<'a> {
    pub(super) fn new(room: &'a Room, options: &RecordingCaptureOptions) -> Self {
        let all = &room.all;
        let surfaces = PerState::from_fn(|state| Surface::new(all, state));
        // A lamp above the object, so that walls do not shade it. There is no ceiling for the light.
        let sun = all.placement.turn(DVec3::new(0.3, -0.38, 0.87).normalize());
        let spacing = LIGHT_SPACING * (LIGHT_WIDTH / f64::from(options.width)).max(1.0);
        let lights =
            PerState::from_fn(|state| LightMap::new(&surfaces[state], sun, LightQuality { spacing, ..all.light }));
        let object_from_room =
            PerState::from_fn(|state| (0..all.parts.len()).map(|p| all.pose(p, state).inverse()).collect());
        Self { room, sensor: options.sensor, seed: options.seed, object_from_room, surfaces, lights }
    }

    pub(super) fn render(&self, state: State, plan: &FramePlan, pose: &dyn Fn(f64) -> Rigid) -> RenderedFrame {
        let mut rng = Pcg64Mcg::seed_from_u64(plan.seed);
        let (width, height) = (plan.intrinsics.width, plan.intrinsics.height);
        let pixels = width as usize * height as usize;
        let (mut colors, mut points, mut labels) = (vec![DVec3::ZERO; pixels], Vec::new(), Vec::new());
        for (offset, at) in SAMPLES {
            let rays = Rays::new(&pose(plan.time + at * plan.shutter), plan.intrinsics);
            let keep = points.is_empty();
            for (color, seen) in colors.iter_mut().zip(self.look(state, &rays, offset)) {
                *color += seen.color / SAMPLES.len() as f64;
                if keep {
                    points.push(seen.point);
                    labels.push(seen.label);
                }
            }
        }
        let mean = colors.iter().map(|c| c.element_sum() / 3.0).sum::<f64>() / pixels as f64;
        let gains = exposure::gains(mean, plan.index as f64, plan.state_seed);
        let rgba = colors.into_iter().map(|c| exposure::recorded(c, gains, &mut rng)).collect();

        let (depth_width, depth_height) = self.sensor.depth_size(width, height);
        let k = plan.intrinsics.resized(depth_width, depth_height);
        let mut depth_labels = labels.clone();
        if depth_width != width {
            let rays = Rays::new(&pose(plan.time), k);
            (points, depth_labels) = self.look(state, &rays, [0.0; 2]).map(|seen| (seen.point, seen.label)).unzip();
        }
        let seed = plan.state_seed;
        let image =
            SeenImage { points: &points, width: depth_width as usize, focal: k.fx, time: plan.index as f64, seed };
        let counts = self.sensor.measure(&image, &mut rng);
        let counts = enlarged(&counts, (depth_width, depth_height), (width, height));
        let camera = Camera { intrinsics: plan.intrinsics, world_to_camera: pose(plan.time) };
        let depth = Some(DepthMap::new(counts, MILLIMETRES as f32));
        RenderedFrame {
            view: View { name: String::new(), camera, rgba, depth, derived: None },
            depth_step: f64::from(width) / f64::from(depth_width),
            labels: FrameLabels { colour: labels, depth: depth_labels, depth_width },
        }
    }

    /// What all pixels see, row-major, `offset` (pixels) from their centres.
    fn look<'b>(&'b self, state: State, rays: &'b Rays, offset: [f64; 2]) -> impl Iterator<Item = Seen> + 'b {
        let hits = visible(&self.surfaces[state], &rays.room_to_camera, &rays.k, offset);
        let width = rays.k.width as usize;
        hits.into_iter().enumerate().map(move |(pixel, hit)| {
            let (x, y) = ((pixel % width) as f64 + 0.5 + offset[0], (pixel / width) as f64 + 0.5 + offset[1]);
            let ray = rays.direction(x, y);
            hit.map_or_else(|| self.ceiling(rays.eye, ray), |hit| self.surface(state, rays.eye, ray, &hit))
        })
    }

    fn surface(&self, state: State, eye: DVec3, ray: DVec3, hit: &Intersection) -> Seen {
        let surface = &self.surfaces[state];
        let (part, piece) = surface.owner(hit.triangle);
        let all = &self.room.all;
        let material = &all.parts[part].pieces[piece].material;
        let p = self.object_from_room[state][part].apply(eye + ray * hit.t) / all.scale;
        let salt = (part as u64) << 32 | piece as u64;
        let own = material.color(p, all.seed ^ salt.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let shade = self.lights[state].at(surface, hit.triangle, hit.weights[0], hit.weights[1]);
        let point = SeenPoint {
            depth: hit.t,
            facing: -surface.normal(hit.triangle).dot(ray.normalize()),
            brightness: own.element_sum() / 3.0,
            shiny: matches!(material, Material::Brushed { .. }),
        };
        Seen { point, color: own * (0.72 * shade.sky + 0.38 * shade.sun), label: self.room.labels[part] }
    }

    /// The ceiling, which only cameras see: light comes through it.
    fn ceiling(&self, eye: DVec3, ray: DVec3) -> Seen {
        let t = if ray.z > 0.0 { (self.room.high.z - eye.z) / ray.z } else { 0.0 };
        let at = eye + ray * t;
        let grey = 0.80 + 0.1 * value_noise(at / 0.15, self.seed ^ 0xce11);
        let point = SeenPoint { depth: t, facing: ray.z / ray.length(), brightness: grey, shiny: false };
        Seen { point, color: DVec3::splat(0.75 * grey), label: 0 }
    }
}

/// An image enlarged by repeating pixels, so that the nearest pixel to the centre of each block is that of the small image.
fn enlarged(small: &[u16], from: (u32, u32), to: (u32, u32)) -> Vec<u16> {
    let nearest = |at: u32, from: u32, to: u32| {
        let place = (f64::from(at) + 0.5) * f64::from(from) / f64::from(to);
        (place as u32).min(from - 1)
    };
    let pixels = (0..to.1).flat_map(|y| (0..to.0).map(move |x| (x, y)));
    let value = |(x, y): (u32, u32)| small[(nearest(y, from.1, to.1) * from.0 + nearest(x, from.0, to.0)) as usize];
    pixels.map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_of_every_block_is_the_pixel_of_the_small_image() {
        let small: Vec<u16> = (0..256 * 192).map(|i| (i % 60_000) as u16).collect();
        for width in [260, 320, 480, 720, 1440, 1920] {
            let height = width / 4 * 3;
            let large = enlarged(&small, (256, 192), (width, height));
            let (sx, sy) = (f64::from(width) / 256.0, f64::from(height) / 192.0);
            for i in 0..small.len() {
                let x = (((i % 256) as f64 + 0.5) * sx) as usize;
                let y = (((i / 256) as f64 + 0.5) * sy) as usize;
                assert_eq!(large[y * width as usize + x], small[i], "{width} {i}");
            }
        }
    }
}
