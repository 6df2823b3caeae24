//! A device and random scenes for the tests of kernels.

use crate::{Gpu, GpuError};
use artgs::fit::{Articulated, ChamferTargets, DeformConfig, DepthPick, LogLinear, Membership, TrainImage};
use artgs::low_level::{MotionModel, MotionParameters};
use artgs_core::{Camera, DepthMap, Intrinsics, Rigid, Splats, State, View};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;

/// Any device, also in software. Without a driver it prints that the test is skipped, unless `ARTGS_REQUIRE_GPU` is set.
///
/// # Panics
/// If there is no device but one is required.
#[allow(clippy::print_stderr)]
pub(crate) fn gpu() -> Option<Gpu> {
    match Gpu::open(None, true) {
        Ok(gpu) => Some(gpu),
        Err(reason @ GpuError::None) if std::env::var_os("ARTGS_REQUIRE_GPU").is_none() => {
            eprintln!("SKIPPED: {reason}");
            None
        }
        Err(reason) => panic!("{reason}"),
    }
}

pub(crate) fn rng(seed: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed)
}

/// Gaussians about the origin, some of them elongated, faint, saturated or beyond the border of the image.
pub(crate) fn splats(rng: &mut Pcg64Mcg, n: usize, degree: usize) -> Splats {
    let mut s = Splats::empty(degree);
    for i in 0..n {
        let reach = if i % 8 == 7 { 2.2 } else { 0.6 };
        s.means.push([0; 3].map(|_| rng.random_range(-reach..reach)));
        s.rotations.push([0; 4].map(|_| rng.random_range(-1.0..1.0)));
        s.log_scales.push([0; 3].map(|_| rng.random_range(-4.0..-1.5)));
        s.logit_opacities.push(if i % 9 == 8 { 6.0 } else { rng.random_range(-4.0..2.0) });
        s.sh.extend((0..s.sh_stride()).map(|_| rng.random_range(-0.6..0.6f32)));
    }
    s
}

/// Images of noise in a disc, with depth except for some pixels, of different sizes, in both states.
pub(crate) fn images(seed: u64) -> Vec<TrainImage<'static>> {
    let mut rng = rng(seed + 1000);
    (0..4)
        .map(|i| {
            let (width, height) = ([45, 61, 64, 50][i], [37, 49, 48, 70][i]);
            let f = 50.0 + 3.0 * i as f64;
            let k = Intrinsics {
                fx: f,
                fy: 0.9 * f,
                cx: 0.45 * f64::from(width),
                cy: 0.55 * f64::from(height),
                width,
                height,
            };
            let turn = i as f64 * 1.7;
            let eye = DVec3::new(2.2 * turn.cos(), 2.2 * turn.sin(), 0.8);
            let camera = Camera::look_at(k, eye, DVec3::new(0.05, 0.02, -0.03), DVec3::Z);
            let inside = |p: u32| {
                let (x, y) = (f64::from(p % width) - k.cx, f64::from(p / width) - k.cy);
                (x * x + y * y).sqrt() < 0.35 * f64::from(height)
            };
            let pixel = |p: u32| {
                let alpha = if inside(p) { [255, 255, 200, 90][p as usize % 4] } else { 0 };
                [rng.random(), rng.random(), rng.random(), alpha]
            };
            let rgba: Vec<[u8; 4]> = (0..width * height).map(pixel).collect();
            let depth: Vec<f32> = (0..width * height)
                .map(|p| if inside(p) && p % 7 != 0 { rng.random_range(1.5..3.0) } else { 0.0 })
                .collect();
            let view =
                View { name: String::new(), camera, rgba, depth: Some(DepthMap::nearest(&depth)), derived: None };
            TrainImage::new(&view, State::ALL[i % 2], 1, DepthPick::Median).smaller(1)
        })
        .collect()
}

/// Five parts with random Gaussians.
pub(crate) fn articulated(rng: &mut Pcg64Mcg, n: usize, exact: bool, learn_joints: bool) -> Articulated {
    let labels = (0..n).map(|_| rng.random_range(0..5)).collect();
    parts(Membership::Labels(labels), exact, learn_joints, None)
}

/// Five parts: a static one, and one for each kind of motion.
pub(crate) fn parts(
    membership: Membership,
    exact: bool,
    learn_joints: bool,
    targets: Option<Arc<ChamferTargets>>,
) -> Articulated {
    let axis = DVec3::new(0.2, 0.9, -0.4).normalize();
    let turn = Rigid::about(axis, DVec3::new(0.3, 0.2, 0.5), 0.7);
    let joints = [
        (MotionModel::Hinge, turn),
        (MotionModel::Prismatic, Rigid::shift(DVec3::new(0.2, -0.3, 0.1))),
        (MotionModel::Free, Rigid::shift(DVec3::new(0.0, 0.1, 0.1)) * turn),
        (MotionModel::Screw, Rigid::shift(0.2 * axis) * turn),
    ];
    let middles = vec![DVec3::new(0.3, 0.1, 0.2), DVec3::ZERO, DVec3::new(-0.2, 0.3, 0.1), DVec3::new(0.1, 0.0, 0.4)];
    let joints = joints.map(|(model, motion)| MotionParameters::from_motion(model, &motion)).to_vec();
    let rate = LogLinear { from: 5e-3, to: 1e-3, steps: 100 };
    let config = DeformConfig {
        exact,
        rotate_sh: exact,
        learn_joints,
        joint_rate: rate,
        assign_rate: rate,
        length_unit: 0.8,
        chamfer: if targets.is_some() { 0.5 } else { 0.0 },
        chamfer_steps: [0, 100],
        centre_after: 0,
    };
    Articulated::new(membership, joints, middles, targets, config, 1)
}
