//! Scenes stored as seeds.
#![allow(dead_code, unreachable_pub, missing_docs, clippy::unwrap_used)]

use artgs::fit::{
    AdamConfig, Articulated, Backend, CpuBackend, DeformConfig, Deformation, DepthPick, LogLinear, LossConfig,
    Membership, PlateauConfig, RateConfig, TrainConfig, TrainImage, TrainState,
};
use artgs::low_level::{MotionModel, MotionParameters};
use artgs_core::{DepthMap, Rigid, Splats, State, View};
use artgs_raster::{Rasterizer, RenderOptions};
use glam::DVec3;

#[path = "../../../artgs-raster/benches/scene/mod.rs"]
mod scene;

pub use scene::{GAUSSIANS, ball, camera};

/// An image of the ball in other colours.
pub fn view(size: u32, turn: f64) -> View {
    let (ball, camera, mut raster) = (ball(GAUSSIANS, 2), camera(size, turn), Rasterizer::new());
    let frame = raster.forward((&ball).into(), &camera, &RenderOptions::default());
    let n = frame.alpha.len();
    let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0) as u8;
    let rgba = (0..n)
        .map(|i| [byte(frame.rgb[i]), byte(frame.rgb[n + i]), byte(frame.rgb[2 * n + i]), byte(2.0 * frame.alpha[i])])
        .collect();
    let depth: Vec<f32> =
        (0..n).map(|i| if frame.alpha[i] > 0.5 { frame.depth[i] / frame.alpha[i] } else { 0.0 }).collect();
    View { name: String::new(), camera, rgba, depth: Some(DepthMap::nearest(&depth)), derived: None }
}

pub fn images(size: u32) -> Vec<TrainImage<'static>> {
    let image =
        |i: usize| TrainImage::new(&view(size, 0.8 * i as f64), State::ALL[i % 2], 1, DepthPick::Median).smaller(1);
    (0..8).map(image).collect()
}

/// Losses and schedules of the default preset; rates so small that the scene stays as it is.
pub fn train_config() -> TrainConfig {
    TrainConfig {
        total: 1_000_000,
        loss: LossConfig::default(),
        rates: RateConfig {
            position_from: 1e-9,
            position_to: 1e-9,
            rotation: 1e-9,
            log_scale: 1e-9,
            opacity: 1e-9,
            sh_dc: 1e-9,
            sh_rest: 1e-9,
            ..RateConfig::paper()
        },
        adam: AdamConfig::default(),
        sh_every: 0,
        random_background: true,
        with_replacement: false,
        extent: 4.0,
        depth_unit: 1.0,
        near: 0.05,
        plateau: PlateauConfig::never(),
    }
}

/// `parts - 1` slices of the ball turn, each about its own hinge.
pub fn articulated(splats: &Splats, parts: usize) -> Deformation {
    let slice = |p: &[f32; 3]| {
        let angle = f64::from(p[1]).atan2(f64::from(p[0])) / std::f64::consts::TAU + 0.5;
        ((angle * parts as f64) as usize).min(parts - 1) as u16
    };
    let labels = splats.means.iter().map(slice).collect();
    let joint = |k: usize| {
        let motion = Rigid::about(DVec3::Z, DVec3::new(0.1 * k as f64, 0.0, 0.0), 0.05);
        MotionParameters::from_motion(MotionModel::Hinge, &motion)
    };
    let rate = LogLinear { from: 1e-9, to: 1e-9, steps: 1 };
    let config = DeformConfig {
        exact: true,
        rotate_sh: true,
        learn_joints: true,
        joint_rate: rate,
        assign_rate: rate,
        length_unit: 1.0,
        chamfer: 0.0,
        chamfer_steps: [0, 0],
        centre_after: 0,
    };
    let joints: Vec<_> = (1..parts).map(joint).collect();
    let middles = vec![DVec3::ZERO; parts - 1];
    Deformation::Articulated(Box::new(Articulated::new(Membership::Labels(labels), joints, middles, None, config, 1)))
}

/// A backend ready to step.
pub fn trainer(size: u32, gaussians: usize, parts: Option<usize>) -> CpuBackend<'static> {
    let splats = ball(gaussians, 1);
    let deformation = parts.map_or(Deformation::None, |k| articulated(&splats, k));
    let mut backend = CpuBackend::new(images(size), train_config(), 1).unwrap();
    backend.upload(TrainState { deformation, ..TrainState::new(splats) }).unwrap();
    backend
}
