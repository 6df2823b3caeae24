//! Renders an object in both states: colour averaged over each pixel, depth of its centre, ground-truth parts.

use crate::camera::CameraRing;
use crate::degrade::{Degradation, depth_count};
use crate::light::LightMap;
use crate::material::{cell_noise, value_noise};
use crate::trace::{Intersection, Surface};
use crate::visible::visible;
use crate::write::{DEPTH_SCALE, SPLIT_NAMES, StatePair};
use crate::{Layout, Object, SynthError};
use artgs_core::{Camera, Capture, DepthMap, PerState, Rigid, State, StateViews, View};
use glam::DVec3;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// How the capture of an object is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureOptions {
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
    /// Simulated errors of the capture.
    pub degradation: Degradation,
    /// Where the cameras are.
    #[serde(default)]
    pub arc: Arc,
}

/// Where the cameras of a capture are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Arc {
    /// All around, from 10 degrees below to 75 degrees above.
    #[default]
    Full,
    /// At most 90 degrees from the front, at the same elevations.
    Half,
    /// All around, 30 to 80 degrees above.
    Above,
}

impl Default for CaptureOptions {
    fn default() -> Self {
        Self {
            views: 64,
            test_views: 16,
            size: 400,
            seed: 0,
            layout: Layout::default(),
            degradation: Degradation::default(),
            arc: Arc::default(),
        }
    }
}

impl CaptureOptions {
    /// An error for options that cannot be rendered; every function that takes options checks them.
    pub fn check(&self) -> Result<(), SynthError> {
        match self.degradation.invalid() {
            _ if self.views == 0 => Err(SynthError::Options("`views` must be at least 1")),
            _ if self.views.max(self.test_views) > 10_000 => Err(SynthError::Options("`views` must be at most 10000")),
            _ if !(16..=4096).contains(&self.size) => Err(SynthError::Options("`size` must be 16 to 4096 pixels")),
            Some(message) => Err(SynthError::Options(message)),
            None => Ok(()),
        }
    }
}

/// Samples of the colour of a pixel, offsets from its centre, no two in a row or column; the first one is the centre.
const SAMPLES: [[f64; 2]; 5] = [[0.0, 0.0], [-0.4, -0.2], [0.2, -0.4], [0.4, 0.2], [-0.2, 0.4]];
/// Distance of the cameras, radii of the ball around the object.
const DISTANCE: f64 = 2.8;
/// Cells of glossy patches, scene units.
const GLOSS_CELL: f64 = 0.05;
/// Depth counts as a step where it changes by more than this fraction from one pixel to the next.
const STEP: f64 = 0.02;

/// A view to render.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlannedView {
    pub(crate) state: State,
    /// 0 train, 1 test.
    pub(crate) split: usize,
    pub(crate) index: usize,
    /// The camera that renders the view.
    camera: Camera,
    /// The camera that the capture states.
    pub(crate) stated: Camera,
    /// Path of the colour image.
    pub(crate) name: String,
}

/// An object with its light in both states, and the views to render.
pub(crate) struct Renderer<'a> {
    object: &'a Object,
    options: &'a CaptureOptions,
    /// World to object frame of every part in both states.
    object_from_world: PerState<Vec<Rigid>>,
    surfaces: PerState<Surface>,
    lights: PerState<LightMap>,
    pub(crate) planned_views: Vec<PlannedView>,
}

/// Part and colour at the intersection of a ray.
struct Hit {
    intersection: Intersection,
    part: usize,
    color: DVec3,
}

impl<'a> Renderer<'a> {
    pub(crate) fn new(object: &'a Object, options: &'a CaptureOptions) -> Self {
        Self::with_names(object, options, StatePair(0))
    }

    /// With the names of these states in paths.
    pub(crate) fn with_names(object: &'a Object, options: &'a CaptureOptions, pair: StatePair) -> Self {
        let surfaces = PerState::from_fn(|state| Surface::new(object, state));
        let sun = object.placement.turn(DVec3::new(0.45, -0.65, 0.62).normalize());
        let object_from_world =
            PerState::from_fn(|state| (0..object.parts.len()).map(|p| object.pose(p, state).inverse()).collect());
        let lights = PerState::from_fn(|state| LightMap::new(&surfaces[state], sun, object.light));
        let planned_views = planned_views(object, options, pair);
        Self { object, options, object_from_world, surfaces, lights, planned_views }
    }

    /// Renders a view: the view as the capture states it, and 0 or 1 + the ground-truth part of every pixel.
    pub(crate) fn render(&self, planned: &PlannedView) -> (View, Vec<u8>) {
        let size = self.options.size as usize;
        let mut rng = Pcg64Mcg::seed_from_u64(view_seed(self.options.seed, planned));
        let degradation = &self.options.degradation;
        let (mut rgba, mut labels) = (vec![[0; 4]; size * size], vec![0; size * size]);
        // Exact depth, and the pixels where the simulated sensor has none.
        let (mut depth, mut lost) = (vec![0.0; size * size], vec![false; size * size]);
        let (eye, axes) = camera_axes(&planned.camera);
        let k = &planned.camera.intrinsics;
        let seen =
            SAMPLES.map(|offset| visible(&self.surfaces[planned.state], &planned.camera.world_to_camera, k, offset));
        for pixel in 0..size * size {
            if seen.iter().all(|sample| sample[pixel].is_none()) {
                continue;
            }
            let corner = [(pixel % size) as f64 + 0.5, (pixel / size) as f64 + 0.5];
            let ray = |[dx, dy]: [f64; 2]| {
                axes[0] * ((corner[0] + dx - k.cx) / k.fx) + axes[1] * ((corner[1] + dy - k.cy) / k.fy) + axes[2]
            };
            let sample = |k: usize| Some(self.hit(planned.state, eye, ray(SAMPLES[k]), seen[k][pixel]?));
            let hits: [Option<Hit>; SAMPLES.len()] = std::array::from_fn(sample);
            let covered = hits.iter().flatten().count();
            let mean = hits.iter().flatten().map(|s| s.color).sum::<DVec3>() / covered as f64;
            let rgb = (mean * 255.0).round().clamp(DVec3::ZERO, DVec3::splat(255.0));
            let alpha = (255.0 * covered as f64 / SAMPLES.len() as f64).round();
            rgba[pixel] = [rgb.x as u8, rgb.y as u8, rgb.z as u8, alpha as u8];
            if let Some(center) = hits[0].as_ref().filter(|_| 2 * covered > SAMPLES.len()) {
                labels[pixel] = 1 + center.part as u8;
                depth[pixel] = center.intersection.t;
                lost[pixel] = self.is_lost(planned.state, center, ray([0.0; 2]), eye);
            }
        }
        if degradation.grazing_deg.is_some() {
            lose_steps(&depth, &mut lost, size);
        }
        let measured = |pixel: usize, rng: &mut Pcg64Mcg| {
            let corner = [(pixel % size) as f64 + 0.5 - k.cx, (pixel / size) as f64 + 0.5 - k.cy];
            let range = depth[pixel] * DVec3::new(corner[0] / k.fx, corner[1] / k.fy, 1.0).length();
            // One random number for every pixel with an object, so that one degradation does not change the noise of another.
            let noisy = degradation.measured(depth[pixel], range, rng);
            if lost[pixel] { 0 } else { depth_count(noisy, DEPTH_SCALE) }
        };
        let counts = || (0..size * size).map(|p| if depth[p] > 0.0 { measured(p, &mut rng) } else { 0 }).collect();
        let depth = (!degradation.no_depth).then(counts).map(|counts| DepthMap::new(counts, DEPTH_SCALE as f32));
        (View { name: planned.name.clone(), camera: planned.stated, rgba, depth, derived: None }, labels)
    }

    fn hit(&self, state: State, eye: DVec3, ray: DVec3, intersection: Intersection) -> Hit {
        let surface = &self.surfaces[state];
        let (part, piece) = surface.owner(intersection.triangle);
        let color = self.own_color(state, part, piece, eye + ray * intersection.t);
        let [u, v] = intersection.weights;
        let shade = self.lights[state].at(surface, intersection.triangle, u, v);
        let light = if self.options.degradation.camera_light {
            0.35 * shade.sky + 0.70 * -surface.normal(intersection.triangle).dot(ray.normalize())
        } else {
            0.62 * shade.sky + 0.50 * shade.sun
        };
        Hit { intersection, part, color: color * light }
    }

    fn own_color(&self, state: State, part: usize, piece: usize, point: DVec3) -> DVec3 {
        let p = self.object_from_world[state][part].apply(point) / self.object.scale;
        let salt = (part as u64) << 32 | piece as u64;
        let seed = (self.object.seed ^ salt.wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_add(salt);
        self.object.parts[part].pieces[piece].material.color(p, seed)
    }

    /// True if the simulated sensor has no depth at this point.
    fn is_lost(&self, state: State, hit: &Hit, ray: DVec3, eye: DVec3) -> bool {
        let degradation = &self.options.degradation;
        let facing = -self.surfaces[state].normal(hit.intersection.triangle).dot(ray.normalize());
        if degradation.grazing_deg.is_some_and(|limit| facing < limit.to_radians().cos()) {
            return true;
        }
        if degradation.gloss == 0.0 {
            return false;
        }
        // Cells of a grid that is deformed by noise, so that patches have irregular outlines.
        let p = self.object_from_world[state][hit.part].apply(eye + ray * hit.intersection.t) / GLOSS_CELL;
        let seed = self.object.seed ^ hit.part as u64;
        let bend = |axis: u64| 1.4 * value_noise(p * 0.8, seed ^ (axis << 40));
        let cell = (p + DVec3::new(bend(1), bend(2), bend(3))).floor();
        cell_noise([cell.x as i64, cell.y as i64, cell.z as i64], seed ^ 0x0061_0551) < degradation.gloss
    }
}

/// All views of a capture, state by state, training views first.
pub(crate) fn planned_views(object: &Object, options: &CaptureOptions, pair: StatePair) -> Vec<PlannedView> {
    let (middle, radius) = object.ball();
    let degradation = &options.degradation;
    let (around, elevations) = match options.arc {
        Arc::Full => (TAU, [-10.0, 75.0]),
        Arc::Half => (TAU / 2.0, [-10.0, 75.0]),
        Arc::Above => (TAU, [30.0, 80.0]),
    };
    let around = if degradation.front { TAU / 3.0 } else { around };
    let front = object.placement.turn(DVec3::NEG_Y);
    let elevations = elevations.map(f64::to_radians);
    let ring = CameraRing { middle, front, distance: DISTANCE * radius, around, elevations };
    // A margin around the ball.
    let intrinsics = ring.intrinsics(1.05 * radius, options.size);
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed ^ 0x0f_f5e7);
    let misalignment = PerState::new(Rigid::IDENTITY, degradation.misalignment(middle, &mut rng));
    let mut planned_views = Vec::new();
    for state in State::ALL {
        for (split, count) in [options.views, options.test_views].into_iter().enumerate() {
            // Views of every pair of states differ.
            let phase = ((2 * state.index() + split) as f64 / 4.0 + 0.11 * pair.0 as f64).fract();
            for (index, camera) in ring.cameras(intrinsics, count, phase).into_iter().enumerate() {
                let moved = camera.moved_with(&misalignment[state]);
                let stated = degradation.jittered(moved, &mut rng);
                let name = options.layout.image(&pair.name(state), SPLIT_NAMES[split], index);
                planned_views.push(PlannedView { state, split, index, camera, stated, name });
            }
        }
    }
    planned_views
}

/// A different seed for every view.
fn view_seed(seed: u64, planned: &PlannedView) -> u64 {
    let set = (2 * planned.state.index() + planned.split) as u64;
    seed.wrapping_mul(4).wrapping_add(set).wrapping_add((planned.index as u64) << 32)
}

/// Position of a camera and its axes in the world: right, down, forward.
fn camera_axes(camera: &Camera) -> (DVec3, [DVec3; 3]) {
    let pose = camera.world_to_camera.inverse();
    (pose.translation, DVec3::AXES.map(|axis| pose.turn(axis)))
}

/// Marks both sides of every step in depth, and the outline, as lost.
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

/// Renders the capture of an object in memory. Depth is rounded as in the files, so that the capture equals the one read from
/// them.
pub fn render_capture(object: &Object, options: &CaptureOptions) -> Result<Capture, SynthError> {
    options.check()?;
    let renderer = Renderer::new(object, options);
    let views: Vec<View> = renderer.planned_views.par_iter().map(|planned| renderer.render(planned).0).collect();
    let mut capture = Capture::default();
    for (planned, view) in renderer.planned_views.iter().zip(views) {
        let StateViews { train, test } = &mut capture.states[planned.state];
        if planned.split == 0 { train.push(view) } else { test.push(view) }
    }
    Ok(capture)
}
