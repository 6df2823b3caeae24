//! Photographs an object in both states: colour averaged over each pixel, depth of its centre, true parts.

use crate::camera::Stand;
use crate::degrade::{Degradation, depth_count};
use crate::light::LightMap;
use crate::material::{cell_noise, value_noise};
use crate::trace::{Meeting, Surface};
use crate::write::{DEPTH_SCALE, SPLIT_NAMES};
use crate::{Layout, Object, SynthError};
use artgs_core::{Camera, Capture, DepthMap, Rigid, STATE_NAMES, StateViews, View};
use glam::DVec3;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// How an object is photographed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PhotoOptions {
    /// Training views per state, at least 1.
    pub views: usize,
    /// Held-out views per state; may be 0.
    pub test_views: usize,
    /// Width and height, pixels, 16 to 4096.
    pub size: u32,
    /// Seed of placement, textures and degradations.
    pub seed: u64,
    /// How the files are laid out.
    pub layout: Layout,
    /// What is wrong with the capture.
    pub degradation: Degradation,
}

impl Default for PhotoOptions {
    fn default() -> Self {
        Self {
            views: 64,
            test_views: 16,
            size: 400,
            seed: 0,
            layout: Layout::default(),
            degradation: Degradation::default(),
        }
    }
}

impl PhotoOptions {
    /// Refuses what cannot be photographed; whatever takes options does the same.
    pub fn check(&self) -> Result<(), SynthError> {
        match self.degradation.flaw() {
            _ if self.views == 0 => Err(SynthError::Options("`views` must be at least 1")),
            _ if self.views.max(self.test_views) > 10_000 => Err(SynthError::Options("at most 10000 views")),
            _ if !(16..=4096).contains(&self.size) => Err(SynthError::Options("`size` must be 16 to 4096 pixels")),
            Some(flaw) => Err(SynthError::Options(flaw)),
            None => Ok(()),
        }
    }
}

/// Where the colour of a pixel is sampled, offsets from its centre: no two in a row or a column; the first is the centre.
const SAMPLES: [[f64; 2]; 5] = [[0.0, 0.0], [-0.4, -0.2], [0.2, -0.4], [0.4, 0.2], [-0.2, 0.4]];
/// Distance of the cameras, radii of the ball around the object.
const DISTANCE: f64 = 2.8;
/// Cells of glossy patches, scene units.
const GLOSS_CELL: f64 = 0.05;
/// Depth counts as a step where it changes by more than this fraction from one pixel to the next.
const STEP: f64 = 0.02;

/// Which picture to take.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shot {
    pub(crate) state: usize,
    /// 0 train, 1 test.
    pub(crate) split: usize,
    pub(crate) index: usize,
    /// Where the picture is taken from.
    camera: Camera,
    /// Where the capture says that it was taken from.
    pub(crate) stated: Camera,
    /// Path of the colour image.
    pub(crate) name: String,
}

/// An object lit and ready, with cameras around it.
pub(crate) struct Studio<'a> {
    object: &'a Object,
    options: &'a PhotoOptions,
    /// World to object frame of every part in both states.
    homes: [Vec<Rigid>; 2],
    surfaces: [Surface; 2],
    lights: [LightMap; 2],
    pub(crate) shots: Vec<Shot>,
}

/// One ray's answer.
struct Seen {
    meeting: Meeting,
    part: usize,
    color: DVec3,
}

impl<'a> Studio<'a> {
    pub(crate) fn new(object: &'a Object, options: &'a PhotoOptions) -> Self {
        let surfaces = [0, 1].map(|state| Surface::new(object, state));
        let sun = object.placement.turn(DVec3::new(0.45, -0.65, 0.62).normalize());
        let homes = [0, 1].map(|state| (0..object.parts.len()).map(|p| object.pose(p, state).inverse()).collect());
        let lights = [0, 1].map(|state| LightMap::measure(&surfaces[state], sun));
        Self { object, options, homes, surfaces, lights, shots: shots(object, options) }
    }

    /// Takes a picture: the view as the capture states it, and 0 or 1 + the true part of every pixel.
    pub(crate) fn take(&self, shot: &Shot) -> (View, Vec<u8>) {
        let size = self.options.size as usize;
        let mut rng = Pcg64Mcg::seed_from_u64(shot_seed(self.options.seed, shot));
        let degradation = &self.options.degradation;
        let (mut rgba, mut labels) = (vec![[0; 4]; size * size], vec![0; size * size]);
        // Exact depth, and what of it the sensor loses.
        let (mut depth, mut lost) = (vec![0.0; size * size], vec![false; size * size]);
        let (eye, axes) = camera_axes(&shot.camera);
        let k = &shot.camera.intrinsics;
        for pixel in 0..size * size {
            let corner = [(pixel % size) as f64 + 0.5, (pixel / size) as f64 + 0.5];
            let ray = |[dx, dy]: [f64; 2]| {
                axes[0] * ((corner[0] + dx - k.cx) / k.fx) + axes[1] * ((corner[1] + dy - k.cy) / k.fy) + axes[2]
            };
            let seen: [Option<Seen>; SAMPLES.len()] = SAMPLES.map(|offset| self.look(shot.state, eye, ray(offset)));
            let covered = seen.iter().flatten().count();
            if covered == 0 {
                continue;
            }
            let mean = seen.iter().flatten().map(|s| s.color).sum::<DVec3>() / covered as f64;
            let rgb = (mean * 255.0).round().clamp(DVec3::ZERO, DVec3::splat(255.0));
            let alpha = (255.0 * covered as f64 / SAMPLES.len() as f64).round();
            rgba[pixel] = [rgb.x as u8, rgb.y as u8, rgb.z as u8, alpha as u8];
            if let Some(center) = seen[0].as_ref().filter(|_| 2 * covered > SAMPLES.len()) {
                labels[pixel] = 1 + center.part as u8;
                depth[pixel] = center.meeting.t;
                lost[pixel] = self.is_lost(shot.state, center, ray([0.0; 2]), eye);
            }
        }
        if degradation.grazing_deg.is_some() {
            lose_steps(&depth, &mut lost, size);
        }
        let measured = |pixel: usize, rng: &mut Pcg64Mcg| {
            let corner = [(pixel % size) as f64 + 0.5 - k.cx, (pixel / size) as f64 + 0.5 - k.cy];
            let range = depth[pixel] * DVec3::new(corner[0] / k.fx, corner[1] / k.fy, 1.0).length();
            // One draw for every pixel with an object, so that degradations do not change each other's numbers.
            let noisy = degradation.measured(depth[pixel], range, rng);
            if lost[pixel] { 0 } else { depth_count(noisy, DEPTH_SCALE) }
        };
        let counts = || (0..size * size).map(|p| if depth[p] > 0.0 { measured(p, &mut rng) } else { 0 }).collect();
        let depth = (!degradation.no_depth).then(counts).map(|counts| DepthMap::new(counts, DEPTH_SCALE as f32));
        (View { name: shot.name.clone(), camera: shot.stated, rgba, depth }, labels)
    }

    fn look(&self, state: usize, eye: DVec3, ray: DVec3) -> Option<Seen> {
        let surface = &self.surfaces[state];
        let meeting = surface.cast(eye, ray)?;
        let (part, piece) = surface.owner(meeting.triangle);
        let color = self.own_color(state, part, piece, eye + ray * meeting.t);
        let shade = self.lights[state].at(meeting.triangle, meeting.weights[0], meeting.weights[1]);
        let light = if self.options.degradation.camera_light {
            0.35 * shade.sky + 0.70 * -surface.normal(meeting.triangle).dot(ray.normalize())
        } else {
            0.62 * shade.sky + 0.50 * shade.sun
        };
        Some(Seen { meeting, part, color: color * light })
    }

    fn own_color(&self, state: usize, part: usize, piece: usize, point: DVec3) -> DVec3 {
        let p = self.homes[state][part].apply(point) / self.object.scale;
        let salt = (part as u64) << 32 | piece as u64;
        let seed = (self.object.seed ^ salt.wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_add(salt);
        self.object.parts[part].pieces[piece].material.color(p, seed)
    }

    /// True if a sensor with the asked flaws gets no depth here.
    fn is_lost(&self, state: usize, seen: &Seen, ray: DVec3, eye: DVec3) -> bool {
        let degradation = &self.options.degradation;
        let facing = -self.surfaces[state].normal(seen.meeting.triangle).dot(ray.normalize());
        if degradation.grazing_deg.is_some_and(|limit| facing < limit.to_radians().cos()) {
            return true;
        }
        if degradation.gloss == 0.0 {
            return false;
        }
        // Cells of a grid that is bent by noise, so that patches look like stains.
        let p = self.homes[state][seen.part].apply(eye + ray * seen.meeting.t) / GLOSS_CELL;
        let seed = self.object.seed ^ seen.part as u64;
        let bend = |axis: u64| 1.4 * value_noise(p * 0.8, seed ^ (axis << 40));
        let cell = (p + DVec3::new(bend(1), bend(2), bend(3))).floor();
        cell_noise([cell.x as i64, cell.y as i64, cell.z as i64], seed ^ 0x0061_0551) < degradation.gloss
    }
}

/// All pictures of a capture, state by state, training views first.
pub(crate) fn shots(object: &Object, options: &PhotoOptions) -> Vec<Shot> {
    let (middle, radius) = object.ball();
    let degradation = &options.degradation;
    let around = if degradation.front { TAU / 3.0 } else { TAU };
    let front = object.placement.turn(DVec3::NEG_Y);
    let stand = Stand { middle, front, distance: DISTANCE * radius, around };
    // A little air around the ball.
    let intrinsics = stand.intrinsics(1.05 * radius, options.size);
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed ^ 0x0f_f5e7);
    let off = [Rigid::IDENTITY, degradation.misalignment(middle, &mut rng)];
    let mut shots = Vec::new();
    for state in 0..2 {
        for (split, count) in [options.views, options.test_views].into_iter().enumerate() {
            let phase = (2 * state + split) as f64 / 4.0;
            for (index, camera) in stand.cameras(intrinsics, count, phase).into_iter().enumerate() {
                let moved = camera.moved_with(&off[state]);
                let stated = degradation.jittered(moved, &mut rng);
                let name = options.layout.image(STATE_NAMES[state], SPLIT_NAMES[split], index);
                shots.push(Shot { state, split, index, camera, stated, name });
            }
        }
    }
    shots
}

/// A seed of its own for every picture.
fn shot_seed(seed: u64, shot: &Shot) -> u64 {
    let set = (2 * shot.state + shot.split) as u64;
    seed.wrapping_mul(4).wrapping_add(set).wrapping_add((shot.index as u64) << 32)
}

/// Position of a camera and its axes in the world: right, down, forward.
fn camera_axes(camera: &Camera) -> (DVec3, [DVec3; 3]) {
    let pose = camera.world_to_camera.inverse();
    (pose.translation, DVec3::AXES.map(|axis| pose.turn(axis)))
}

/// Sensors lose both sides of a step in depth, and the outline.
fn lose_steps(depth: &[f64], lost: &mut [bool], size: usize) {
    for pixel in 0..size * size {
        let (x, y) = (pixel % size, pixel / size);
        let neighbours = [
            (x > 0).then(|| pixel - 1),
            (x + 1 < size).then(|| pixel + 1),
            (y > 0).then(|| pixel - size),
            (y + 1 < size).then(|| pixel + size),
        ];
        let is_step = |n: usize| (depth[n] - depth[pixel]).abs() > STEP * depth[pixel];
        if neighbours.into_iter().flatten().any(is_step) {
            lost[pixel] = true;
        }
    }
}

/// Photographs an object into memory. Depth is rounded as the files round it, so that the capture equals the one
/// read back.
pub fn photograph(object: &Object, options: &PhotoOptions) -> Result<Capture, SynthError> {
    options.check()?;
    let studio = Studio::new(object, options);
    let pictures: Vec<View> = studio.shots.par_iter().map(|shot| studio.take(shot).0).collect();
    let mut capture = Capture::default();
    for (shot, view) in studio.shots.iter().zip(pictures) {
        let StateViews { train, test } = &mut capture.states[shot.state];
        if shot.split == 0 { train.push(view) } else { test.push(view) }
    }
    Ok(capture)
}
