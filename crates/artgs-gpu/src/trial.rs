//! How fast a device trains, found by trying: graphics processors that share the processor's memory may be slower than it.

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

const GAUSSIANS: usize = 20_000;
const SIDE: u32 = 320;
/// Steps before the clock starts, and while it runs.
const STEPS: [usize; 2] = [4, 8];

/// Seconds that a device needs for a training step on a small made-up scene.
pub fn seconds_per_step(devices: &dyn Devices) -> Result<f64, FitError> {
    let views = [0.0, 2.0].map(disc);
    let images = views.iter().map(|view| TrainImage::new(view, 0, 1, DepthPick::Median)).collect();
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
    backend.upload(TrainState::new(ball()))?;
    let mut run = |steps: usize| backend.run(steps, true, &mut |_| ControlFlow::Continue(()));
    run(STEPS[0])?;
    let clock = Instant::now();
    run(STEPS[1])?;
    Ok(clock.elapsed().as_secs_f64() / STEPS[1] as f64)
}

/// A photograph of a disc.
fn disc(turn: f64) -> View {
    let side = f64::from(SIDE);
    let k = Intrinsics { fx: side, fy: side, cx: side / 2.0, cy: side / 2.0, width: SIDE, height: SIDE };
    let eye = DVec3::new(3.0 * turn.cos(), 3.0 * turn.sin(), 0.5);
    let pixel = |p: u32| {
        let (x, y) = (f64::from(p % SIDE) - k.cx, f64::from(p / SIDE) - k.cy);
        [200, 120, 60, if x * x + y * y < 0.1 * side * side { 255 } else { 0 }]
    };
    let camera = Camera::look_at(k, eye, DVec3::ZERO, DVec3::Z);
    View { name: String::new(), camera, rgba: (0..SIDE * SIDE).map(pixel).collect(), depth: None }
}

/// Small Gaussians on a sphere.
fn ball() -> Splats {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut splats = Splats::empty(2);
    for _ in 0..GAUSSIANS {
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
    fn a_trial_takes_some_time_on_any_device() {
        assert!(seconds_per_step(&Cpu).unwrap() > 0.0);
        let Some(gpu) = crate::testing::gpu() else { return };
        assert!(seconds_per_step(&crate::GpuDevices::new(gpu).unwrap()).unwrap() > 0.0);
    }
}
