use super::*;
use crate::articulation::{MotionModel, MotionParameters};
use crate::fit::images::{DepthPick, TrainImage};
use crate::fit::{
    AdamConfig, Articulated, ChamferTargets, DeformConfig, DepthMode, LogLinear, LossConfig, Membership, PlateauConfig,
    RateConfig,
};
use crate::published::{AssignConfig, AssignKind, Assignment};
use artgs_core::{Camera, DepthMap, Intrinsics, PerState, Rigid, Splats, State, View};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;

const COUNT: usize = 15;

/// Faint Gaussians that fill the whole image and lie one behind another, so that no edge and no change of order
/// disturbs a difference quotient.
fn splats() -> Splats {
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let mut draw = |from: f32, to: f32| from + (to - from) * rng.random::<f32>();
    let mut splats = Splats::empty(1);
    for i in 0..COUNT {
        splats.means.push([draw(-0.3, 0.3), draw(-0.3, 0.3), 0.1 * i as f32 - 0.7]);
        splats.rotations.push(std::array::from_fn(|c| if c == 0 { 1.0 } else { draw(-0.5, 0.5) }));
        splats.log_scales.push(std::array::from_fn(|_| draw(-0.4, -0.1)));
        splats.logit_opacities.push(draw(-2.2, -1.6));
        for coefficient in 0..4 {
            let range = if coefficient == 0 { 0.6 } else { 0.15 };
            splats.sh.extend((0..3).map(|_| draw(-range, range)));
        }
    }
    splats
}

/// A black photograph far behind everything, per state: no difference changes its sign.
fn images() -> Vec<TrainImage<'static>> {
    let k = Intrinsics { fx: 300.0, fy: 300.0, cx: 20.0, cy: 20.0, width: 40, height: 40 };
    let image = |state: State| {
        let eye = DVec3::new(0.4 - state.index() as f64, 0.2, 6.0);
        let camera = Camera::look_at(k, eye, DVec3::ZERO, DVec3::Y);
        let view = View {
            name: String::new(),
            camera,
            rgba: vec![[0, 0, 0, 255]; 1600],
            depth: Some(DepthMap::new(vec![20; 1600], 1.0)),
            derived: None,
        };
        TrainImage::new(&view, state, 1, DepthPick::Median).smaller(1)
    };
    State::ALL.map(image).into()
}

fn deform() -> DeformConfig {
    let rate = LogLinear { from: 1e-3, to: 1e-3, steps: 1 };
    DeformConfig {
        exact: true,
        rotate_sh: false,
        learn_joints: true,
        joint_rate: rate,
        assign_rate: rate,
        length_unit: 1.0,
        chamfer: 0.0,
        chamfer_steps: [0, 10],
        centre_after: 0,
    }
}

fn joints() -> Vec<MotionParameters> {
    let turn = Rigid::about(DVec3::new(0.3, 0.9, 0.1).normalize(), DVec3::new(0.5, 0.0, 0.2), 0.3);
    vec![
        MotionParameters::from_motion(MotionModel::Hinge, &turn),
        MotionParameters::from_motion(MotionModel::Free, &(Rigid::shift(DVec3::new(0.1, -0.1, 0.02)) * turn)),
        MotionParameters::from_motion(MotionModel::Prismatic, &Rigid::shift(DVec3::new(0.1, -0.2, 0.01))),
    ]
}

fn backend_config() -> TrainConfig {
    TrainConfig {
        total: 10,
        loss: LossConfig {
            depth: 0.3,
            depth_mode: DepthMode::Accumulated,
            mask: 0.2,
            crop_ssim: false,
            opacity_entropy: 0.1,
            ..LossConfig::default()
        },
        rates: RateConfig::default(),
        adam: AdamConfig::default(),
        sh_every: 0,
        random_background: false,
        with_replacement: false,
        extent: 1.0,
        depth_unit: 1.5,
        near: 0.1,
        plateau: PlateauConfig::never(),
    }
}

fn backend(membership: Membership, config: DeformConfig) -> CpuBackend<'static> {
    // One target each: a change of neighbour would disturb a difference quotient.
    let targets = Arc::new(ChamferTargets::new(&PerState::new(vec![[0.5, -0.3, 0.2]], vec![[-0.4, -0.3, 0.2]])));
    let middles = vec![DVec3::new(0.3, -0.2, 0.5), DVec3::new(-0.4, 0.1, 0.2), DVec3::X];
    let articulated = Articulated::new(membership, joints(), middles, Some(targets), config, 1);
    let mut backend = CpuBackend::new(images(), backend_config(), 1).unwrap();
    let deformation = Deformation::Articulated(Box::new(articulated));
    backend.upload(TrainState { deformation, ..TrainState::new(splats()) }).unwrap();
    backend
}

fn articulated<'a>(backend: &'a mut CpuBackend<'_>) -> &'a mut Articulated {
    match &mut backend.state.deformation {
        Deformation::Articulated(articulated) => articulated,
        Deformation::None => panic!("articulated"),
    }
}

fn loss(backend: &mut CpuBackend, view: usize) -> f64 {
    backend.differentiate(view, [0.0; 3]).1
}

fn labels() -> Membership {
    Membership::Labels((0..COUNT).map(|i| (i % 4) as u16).collect())
}

fn assert_close(analytic: &[f64], numeric: &[f64], tolerance: f64) {
    let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let gap: Vec<f64> = analytic.iter().zip(numeric).map(|(a, b)| a - b).collect();
    assert!(norm(numeric) > 1e-4, "{numeric:?}");
    assert!(norm(&gap) < tolerance * norm(numeric), "{analytic:?} against {numeric:?}");
}

fn check_joints(backend: &mut CpuBackend, view: usize) {
    const H: f64 = 1e-3;
    loss(backend, view);
    let analytic = backend.work.d_joints.clone();
    for k in 0..3 {
        let n = joints()[k].values().len();
        let slope = |i: usize| {
            let mut at = |by: f64| {
                articulated(backend).joints[k].values_mut()[i] += by;
                let value = loss(backend, view);
                articulated(backend).joints[k].values_mut()[i] -= by;
                value
            };
            (at(H) - at(-H)) / (2.0 * H)
        };
        let numeric: Vec<f64> = (0..n).map(slope).collect();
        assert_close(&analytic[k][..n], &numeric, 0.02);
    }
}

#[test]
fn gradients_of_a_step_by_motions_are_exact() {
    for (view, chamfer) in [(0, 0.0), (1, 0.0), (0, 2.0), (1, 2.0)] {
        check_joints(&mut backend(labels(), DeformConfig { chamfer, ..deform() }), view);
    }
}

#[test]
fn gradients_by_motions_are_exact_for_soft_parts_too() {
    let centres: Vec<[f32; 3]> = (0..4).map(|k| [0.2 * k as f32 - 0.3, 0.1, 0.2 - 0.1 * k as f32]).collect();
    for kind in [AssignKind::Centres, AssignKind::Mlp, AssignKind::Slots] {
        let config = AssignConfig { kind, gumbel: false, centre_weight: 0.0, ..AssignConfig::light() };
        let mut rng = Pcg64Mcg::seed_from_u64(2);
        let parts = Assignment::new(config, &centres, &[0.5; 4], [[-1.0; 3], [1.0; 3]], &mut rng);
        for view in 0..2 {
            let membership = Membership::Learned(Box::new(parts.clone()));
            check_joints(&mut backend(membership, DeformConfig { chamfer: 2.0, ..deform() }), view);
        }
    }
}

#[test]
fn gradients_of_a_step_by_canonical_gaussians_are_exact() {
    const H: f32 = 2e-3;
    for view in 0..2 {
        let mut backend = backend(labels(), deform());
        loss(&mut backend, view);
        let grads = backend.grads.clone();
        let mut slope = |entry: &dyn Fn(&mut Splats) -> &mut f32| {
            let start = *entry(&mut backend.state.splats);
            let mut at = |v: f32| {
                *entry(&mut backend.state.splats) = v;
                (loss(&mut backend, view), f64::from(v))
            };
            let ((up, a), (down, b)) = (at(start + H), at(start - H));
            *entry(&mut backend.state.splats) = start;
            (up - down) / (a - b)
        };
        for i in 0..COUNT {
            let numeric = [0, 1, 2].map(|a| slope(&|s| &mut s.means[i][a]));
            assert_close(&grads.means[i].map(f64::from), &numeric, 0.03);
        }
        let all: Vec<(usize, usize)> = (0..COUNT).flat_map(|i| (0..4).map(move |c| (i, c))).collect();
        let numeric: Vec<f64> = all.iter().map(|&(i, c)| slope(&|s| &mut s.rotations[i][c])).collect();
        let analytic: Vec<f64> = grads.rotations.as_flattened().iter().map(|&g| f64::from(g)).collect();
        assert_close(&analytic, &numeric, 0.05);
    }
}

#[test]
fn the_chamfer_term_leaves_canonical_gaussians_alone_and_published_routing_does_not_turn_gradients() {
    let run = |config: DeformConfig| {
        let mut backend = backend(labels(), config);
        let value = loss(&mut backend, 1);
        (value, backend.grads.clone(), backend.work.d_joints.clone())
    };
    let (without, plain, d_joints) = run(deform());
    let (with, pulled, d_pulled) = run(DeformConfig { chamfer: 5.0, ..deform() });
    assert!(with > without + 0.1 && d_joints != d_pulled);
    assert_eq!((&plain.means, &plain.rotations), (&pulled.means, &pulled.rotations));
    let (outside, ..) = run(DeformConfig { chamfer: 5.0, chamfer_steps: [1, 10], ..deform() });
    assert_eq!(outside, without, "the first step is before the term begins");
    let (_, published, _) = run(DeformConfig { exact: false, ..deform() });
    for i in 0..COUNT {
        assert_eq!(published.means[i] == plain.means[i], i % 4 == 0 || i % 4 == 3, "{i}");
    }
}

#[test]
fn large_images_are_small_until_the_run_settles() {
    let plateau = PlateauConfig { settle: 5, coarse_pixels: 500, ..PlateauConfig::default() };
    let train = TrainConfig { plateau, ..TrainConfig { total: 10, ..backend_config() } };
    let mut backend = CpuBackend::new(images(), train, 1).unwrap();
    let state = TrainState::new(splats());
    backend.upload(state.clone()).unwrap();
    assert!(backend.images.iter().all(|i| (i.width, i.height) == (20, 20) && i.depth.is_some()));
    assert_eq!(backend.images[1].camera.intrinsics.fx, 150.0);
    backend.upload(TrainState { settling: Some(0), ..state }).unwrap();
    assert!(backend.images.iter().all(|i| (i.width, i.height) == (40, 40)));
    let never = TrainConfig { plateau: PlateauConfig::never(), ..train };
    assert_eq!(CpuBackend::new(images(), never, 1).unwrap().images[0].width, 40);
}
