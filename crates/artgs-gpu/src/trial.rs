//! Measures how fast a device trains, and whether its results are right. Integrated graphics processors may be slower than
//! the CPU, and drivers have errors.

use artgs::fit::{
    AdamConfig, DepthPick, Devices, FitError, LossConfig, PlateauConfig, RateConfig, TrainConfig, TrainImage,
    TrainState,
};
use artgs_core::{Camera, Intrinsics, Splats, View};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::ops::ControlFlow;
use std::time::Instant;

/// Number of steps before the measurement, and during it.
const STEPS: [usize; 2] = [4, 8];
/// Largest relative difference of losses; rounding alone causes a hundredth of it.
const TOLERANCE: f64 = 2e-3;

/// Size of the synthetic scene of a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scene {
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Width and height of both images, pixels.
    pub side: u32,
}

impl Scene {
    /// Enough to find errors.
    pub const SMALL: Self = Self { gaussians: 3_000, side: 96 };
    /// Enough to measure the speed.
    pub const USUAL: Self = Self { gaussians: 20_000, side: 320 };
}

/// Result of a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Seconds per step.
    pub seconds_per_step: f64,
    /// Loss of every step.
    pub losses: Vec<f64>,
}

impl Trial {
    /// The first step whose loss differs from that of the other trial, and both losses; none if the devices agree.
    pub fn disagrees(&self, other: &Self) -> Option<(usize, [f64; 2])> {
        let pairs = self.losses.iter().zip(&other.losses).enumerate();
        let apart = |a: f64, b: f64| a.is_nan() || b.is_nan() || (a - b).abs() > TOLERANCE * b.abs();
        pairs.map(|(i, (&a, &b))| (i + 1, [a, b])).find(|(_, [a, b])| apart(*a, *b))
    }
}

/// Trains on a synthetic scene for a few steps.
pub fn trial(devices: &dyn Devices, scene: Scene) -> Result<Trial, FitError> {
    let views = [0.0, 2.0].map(|turn| disc(turn, scene.side));
    let images =
        views.iter().map(|view| TrainImage::new(view, artgs_core::State::START, 1, DepthPick::Median)).collect();
    let config = TrainConfig {
        total: 100,
        loss: LossConfig::default(),
        rates: RateConfig::default(),
        adam: AdamConfig::default(),
        sh_every: 0,
        random_background: true,
        with_replacement: false,
        extent: 3.0,
        depth_unit: 1.0,
        near: 0.1,
        plateau: PlateauConfig::never(),
    };
    let mut backend = devices.backend(images, config, 1)?;
    backend.upload(TrainState::new(ball(scene.gaussians)))?;
    let mut losses = Vec::new();
    let mut run = |steps: usize| {
        backend.run(steps, true, &mut |s| {
            losses.push(s.loss);
            ControlFlow::Continue(())
        })
    };
    run(STEPS[0])?;
    let clock = Instant::now();
    run(STEPS[1])?;
    let seconds_per_step = clock.elapsed().as_secs_f64() / STEPS[1] as f64;
    Ok(Trial { seconds_per_step, losses })
}

/// An image of a disc.
fn disc(turn: f64, pixels: u32) -> View {
    let side = f64::from(pixels);
    let k = Intrinsics { fx: side, fy: side, cx: side / 2.0, cy: side / 2.0, width: pixels, height: pixels };
    let eye = DVec3::new(3.0 * turn.cos(), 3.0 * turn.sin(), 0.5);
    let pixel = |p: u32| {
        let (x, y) = (f64::from(p % pixels) - k.cx, f64::from(p / pixels) - k.cy);
        [200, 120, 60, if x * x + y * y < 0.1 * side * side { 255 } else { 0 }]
    };
    let camera = Camera::look_at(k, eye, DVec3::ZERO, DVec3::Z);
    View { name: String::new(), camera, rgba: (0..pixels * pixels).map(pixel).collect(), depth: None, derived: None }
}

/// Small Gaussians on a sphere.
fn ball(gaussians: usize) -> Splats {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut splats = Splats::empty(2);
    for _ in 0..gaussians {
        let p = DVec3::from([0; 3].map(|_| rng.random_range(-1.0..1.0))).normalize_or(DVec3::Z);
        splats.means.push(p.as_vec3().to_array());
        splats.rotations.push([1.0, 0.0, 0.0, 0.0]);
        splats.log_scales.push([-4.0; 3]);
        splats.logit_opacities.push(1.0);
        splats.sh.extend((0..27).map(|_| rng.random_range(-0.3..0.3_f32)));
    }
    splats
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs::fit::Cpu;

    #[test]
    fn devices_agree_and_differences_are_found() {
        let cpu = trial(&Cpu, Scene::SMALL).unwrap();
        assert!(cpu.seconds_per_step > 0.0 && cpu.losses.len() == 12 && cpu.disagrees(&cpu).is_none());
        let mut wrong = cpu.clone();
        wrong.losses[7] *= 1.01;
        assert_eq!(wrong.disagrees(&cpu), Some((8, [wrong.losses[7], cpu.losses[7]])));
        wrong.losses[2] = f64::NAN;
        assert!(wrong.disagrees(&cpu).is_some_and(|d| d.0 == 3));
        let Some(gpu) = crate::testing::gpu() else { return };
        let gpu = trial(&crate::GpuDevices::new(gpu).unwrap(), Scene::SMALL).unwrap();
        assert_eq!(gpu.disagrees(&cpu), None, "{gpu:?} {cpu:?}");
    }
}
