//! A procedural cabinet with a door and a drawer, rendered in two states with ground truth: for tests, for the demo, and to
//! try the program without a camera.

mod render;
mod scene;
#[cfg(test)]
mod tests;
mod write;

pub use render::{Rendering, render};
pub use scene::{Cabinet, CabinetPart};
pub use write::{GENERATOR, write_cabinet};

use crate::SynthError;
use crate::camera::CameraRing;
use crate::degrade::{depth_count, gaussian};
use crate::write::{DEPTH_SCALE, SPLIT_NAMES};
use artgs_core::{Camera, Capture, DepthMap, Intrinsics, State, StateViews, View};
use glam::DVec3;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How the capture of the cabinet is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CabinetOptions {
    /// Training views per state, at least 1.
    pub views: usize,
    /// Held-out views per state; may be 0.
    pub test_views: usize,
    /// Width and height, pixels, 16 to 4096.
    pub size: u32,
    /// Seed of textures and depth noise.
    pub seed: u64,
    /// Standard deviation of the noise of the depth images, scene units; 0 leaves only the rounding to 0.001.
    pub depth_noise: f64,
    /// Principal point minus image centre, pixels.
    pub principal_offset: [f64; 2],
    /// Angle by which the cabinet leans back, radians, within a quarter of a turn; 0: it stands upright, +Z up.
    pub lean: f64,
}

/// Lean of the cabinet by default: no axis of a joint is an axis of the frame.
const LEAN: f64 = 4.0 * std::f64::consts::PI / 180.0;

impl Default for CabinetOptions {
    fn default() -> Self {
        Self { views: 40, test_views: 8, size: 200, seed: 0, depth_noise: 0.0, principal_offset: [0.0; 2], lean: LEAN }
    }
}

impl CabinetOptions {
    /// An error for options that cannot be rendered; [`cabinet_capture`] and [`write_cabinet`] check them too.
    pub fn check(&self) -> Result<(), SynthError> {
        let offsets = self.principal_offset.iter().all(|v| v.abs() < f64::from(self.size) / 2.0);
        match () {
            () if self.views == 0 => Err(SynthError::Options("`views` must be at least 1")),
            () if self.views.max(self.test_views) > 10_000 => Err(SynthError::Options("`views` must be at most 10000")),
            () if !(16..=4096).contains(&self.size) => Err(SynthError::Options("`size` must be 16 to 4096 pixels")),
            () if !(0.0..1.0).contains(&self.depth_noise) => {
                Err(SynthError::Options("`depth_noise` must be in [0, 1)"))
            }
            () if self.lean.is_nan() || self.lean.abs() > std::f64::consts::FRAC_PI_2 => {
                Err(SynthError::Options("`lean` must be within a quarter of a turn"))
            }
            () if !offsets => {
                Err(SynthError::Options("`principal_offset` must leave the principal point in the image"))
            }
            () => Ok(()),
        }
    }

    /// Intrinsics whose image contains the whole cabinet from [`DISTANCE`].
    fn intrinsics(&self, radius: f64) -> Intrinsics {
        let size = f64::from(self.size);
        let focal = 0.5 * size / (radius / DISTANCE).asin().tan();
        let [dx, dy] = self.principal_offset;
        let (cx, cy) = (size / 2.0 + dx, size / 2.0 + dy);
        Intrinsics { fx: focal, fy: focal, cx, cy, width: self.size, height: self.size }
    }
}

/// Distance of the cameras from the middle of the cabinet, scene units.
const DISTANCE: f64 = 2.5;

/// Renders the capture of the cabinet. Depth is rounded as in the files, so that the capture equals the one read from them.
pub fn cabinet_capture(options: &CabinetOptions) -> Result<(Capture, Cabinet), SynthError> {
    options.check()?;
    let cabinet = Cabinet::leaning(options.seed, options.lean);
    let mut capture = Capture::default();
    for state in State::ALL {
        let views = |split: usize, count: usize| render_views(&cabinet, options, state, split, count);
        capture.states[state] = StateViews { train: views(0, options.views), test: views(1, options.test_views) };
    }
    Ok((capture, cabinet))
}

fn render_views(cabinet: &Cabinet, options: &CabinetOptions, state: State, split: usize, count: usize) -> Vec<View> {
    let folder = format!("{}/{}/rgba", state.name(), SPLIT_NAMES[split]);
    let set = 2 * state.index() + split;
    let cameras = cameras(cabinet, options, count, set as f64 / 4.0);
    let view = |(index, camera): (usize, Camera)| {
        let mut rng = Pcg64Mcg::seed_from_u64(options.seed.wrapping_mul(4) + set as u64 + ((index as u64) << 32));
        let rendering = render(cabinet, state, &camera);
        let measured =
            |d: &f64| if *d > 0.0 { depth_count(d + options.depth_noise * gaussian(&mut rng), DEPTH_SCALE) } else { 0 };
        View {
            name: format!("{folder}/{index:04}.png"),
            camera,
            depth: Some(DepthMap::new(rendering.depth.iter().map(measured).collect(), DEPTH_SCALE as f32)),
            derived: None,
            rgba: rendering.rgba,
        }
    };
    cameras.into_par_iter().enumerate().map(view).collect()
}

/// Cameras all around, denser in front of the cabinet.
fn cameras(cabinet: &Cabinet, options: &CabinetOptions, count: usize, phase: f64) -> Vec<Camera> {
    let (middle, radius) = cabinet.ball();
    let front = cabinet.placement.turn(DVec3::NEG_Y);
    let elevations = [-10_f64, 75.0].map(f64::to_radians);
    let ring = CameraRing { middle, front, distance: DISTANCE, around: std::f64::consts::TAU, elevations };
    ring.cameras(options.intrinsics(radius), count, phase)
}
