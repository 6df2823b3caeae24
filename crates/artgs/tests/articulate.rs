//! Recovers joints and parts of a known object from its renderings at both states.

#![allow(clippy::unwrap_used)]

use artgs::fit::{Cpu, DensifyConfig, FitError, LogLinear, PlateauConfig, RateConfig, StepStats, mean_score};
use artgs::low_level::{ArticulateConfig, SkinStart, Start, Trained, articulate, score_state};
use artgs::low_level::{MotionModel, MotionParameters};
use artgs_core::{Camera, DepthMap, Intrinsics, PerState, Rigid, Splats, State, View};
use artgs_raster::Rasterizer;
use glam::DVec3;

const SIZE: u32 = 56;

/// A box without a front and a door ajar in front of it, patterned, away from the origin.
fn truth() -> Trained {
    let mut splats = Splats::empty(0);
    let mut labels = Vec::new();
    let mut sheet = |origin: DVec3, u: DVec3, v: DVec3, label: u16| {
        for i in 0..144 {
            let (a, b) = (f64::from(i % 12) / 11.0, f64::from(i / 12) / 11.0);
            let p = DVec3::new(2.0, -1.0, 3.0) + origin + u * a + v * b;
            splats.means.push(p.as_vec3().to_array());
            splats.rotations.push([1.0, 0.0, 0.0, 0.0]);
            splats.log_scales.push([0.045_f32.ln(); 3]);
            splats.logit_opacities.push(3.0);
            let wave = |c: f64| (1.5 * (9.0 * c * p.x + 7.0 * p.y - 6.0 * c * p.z).sin()) as f32;
            splats.sh.extend([wave(0.6), wave(1.0), wave(1.5)]);
            labels.push(label);
        }
    };
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    sheet(DVec3::new(-0.5, 0.5, -0.5), x, z, 0);
    sheet(DVec3::new(-0.5, -0.5, -0.5), x, y, 0);
    sheet(DVec3::new(0.5, -0.5, -0.5), y, z, 0);
    let half_open = 35_f64.to_radians();
    sheet(DVec3::new(-0.5, -0.5, -0.5), DVec3::new(half_open.cos(), -half_open.sin(), 0.0), z, 1);
    let hinge = Rigid::about(-z, DVec3::new(1.5, -1.5, 3.0), 50_f64.to_radians());
    Trained { splats, labels, joints: vec![MotionParameters::from_motion(MotionModel::Hinge, &hinge)] }
}

fn views(truth: &Trained, state: State) -> Vec<View> {
    let k = Intrinsics { fx: 80.0, fy: 80.0, cx: 28.0, cy: 28.0, width: SIZE, height: SIZE };
    let mut rasterizer = Rasterizer::new();
    let posed = truth.posed(state);
    let view = |i: usize| {
        let (a, up) = (i as f64 * 2.4, (i as f64 - 5.5) / 8.0);
        let away = DVec3::new(a.cos() * (1.0 - up * up).sqrt(), a.sin() * (1.0 - up * up).sqrt(), up);
        let middle = DVec3::new(2.0, -1.2, 3.0);
        let camera = Camera::look_at(k, middle + 3.5 * away, middle, DVec3::Z);
        let frame = posed.render(&mut rasterizer, &camera, false);
        let n = frame.alpha.len();
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let straight = |i: usize, c: usize| byte(frame.rgb[c * n + i] / frame.alpha[i].max(1e-3));
        let rgba = (0..n).map(|i| [straight(i, 0), straight(i, 1), straight(i, 2), byte(frame.alpha[i])]).collect();
        let depth: Vec<f32> =
            (0..n).map(|i| if frame.alpha[i] > 0.5 { frame.depth[i] / frame.alpha[i] } else { 0.0 }).collect();
        View { name: format!("{i}"), camera, rgba, depth: Some(DepthMap::nearest(&depth)), derived: None }
    };
    (0..12).map(view).collect()
}

fn captured(truth: &Trained) -> PerState<Vec<View>> {
    PerState::from_fn(|state| views(truth, state))
}

fn gentle(steps: usize) -> ArticulateConfig {
    ArticulateConfig {
        steps,
        rates: RateConfig { position_from: 1e-5, position_to: 1e-6, ..RateConfig::paper() },
        densify: DensifyConfig { every: 0, ..DensifyConfig::default() },
        joint_rate: LogLinear { from: 4e-3, to: 1e-4, steps },
        learn_joints: true,
        plateau: PlateauConfig::never(),
        ..ArticulateConfig::default()
    }
}

fn run(truth: &Trained, start: Start, config: &ArticulateConfig, seed: u64) -> Trained {
    let views = captured(truth);
    articulate(views.as_ref().map(|v| &v[..]), start, None, config, seed, &Cpu, &mut |s: StepStats| {
        assert!(s.loss.is_finite())
    })
    .unwrap()
}

fn tilt(found: &Trained, truth: &Trained) -> f64 {
    let axis = |t: &Trained| t.joints[0].full_motion().screw().axis;
    axis(found).angle_between(axis(truth)).to_degrees()
}

fn open(found: &Trained, truth: &Trained) -> f64 {
    let difference = found.joints[0].full_motion() * truth.joints[0].full_motion().inverse();
    difference.angle().to_degrees()
}

#[test]
fn a_tilted_joint_finds_back() {
    let truth = truth();
    let hinge = truth.joints[0].full_motion().screw();
    let tilted = glam::DQuat::from_axis_angle(DVec3::X, 5_f64.to_radians()) * hinge.axis;
    let wrong = Rigid::about(tilted, hinge.origin + DVec3::new(0.03, 0.02, 0.0), hinge.angle - 0.09);
    for model in [MotionModel::Hinge, MotionModel::Free, MotionModel::Screw] {
        let joints = vec![MotionParameters::from_motion(model, &wrong)];
        let start = Start { splats: truth.splats.clone(), skin: SkinStart::Labels(truth.labels.clone()), joints };
        let found = run(&truth, start, &gentle(500), 1);
        let errors = (tilt(&found, &truth), open(&found, &truth));
        eprintln!("{model:?}: axis off by {:.3} degrees, motion by {:.3}", errors.0, errors.1);
        assert!(errors.0 < 0.5 && errors.1 < 0.5, "{model:?} {errors:?}");
        assert_eq!(found.half_motions().len(), 2);
    }
}

#[test]
fn parts_are_found_from_rough_centres() {
    let truth = truth();
    let mut config = ArticulateConfig { learn_joints: false, ..gentle(500) };
    config.assign.temperature_steps = 400;
    let skin = SkinStart::Centres { centres: vec![[2.1, -0.8, 3.0], [1.9, -1.6, 3.1]], radii: vec![0.4, 0.5] };
    let start = Start { splats: truth.splats.clone(), skin, joints: truth.joints.clone() };
    let share = |found: &Trained| {
        let same = found.labels.iter().zip(&truth.labels).filter(|(a, b)| a == b).count();
        same as f64 / truth.labels.len() as f64
    };
    let before = share(&run(&truth, start.clone(), &ArticulateConfig { steps: 0, ..config.clone() }, 1));
    let after = share(&run(&truth, start, &config, 1));
    eprintln!("labels right: {before:.3}, then {after:.3}");
    assert!(after > 0.95 && after > before + 0.05, "{before} {after}");
}

#[test]
fn labels_follow_densification_and_threads_do_not_show() {
    let truth = truth();
    let densify = DensifyConfig {
        after: 10,
        before: 61,
        every: 20,
        grad_threshold: 3e-4,
        clone_scale: 0.02,
        ..DensifyConfig::default()
    };
    let config = ArticulateConfig { densify, ..gentle(80) };
    for centres in [false, true] {
        let skin = if centres {
            SkinStart::Centres { centres: vec![[2.1, -0.8, 3.0], [1.9, -1.6, 3.1]], radii: vec![0.4, 0.5] }
        } else {
            SkinStart::Labels(truth.labels.clone())
        };
        let start = Start { splats: truth.splats.clone(), skin, joints: truth.joints.clone() };
        let with = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(&truth, start.clone(), &config, seed))
        };
        let found = with(2, 5);
        assert!(found.splats.len() > truth.splats.len() + 20, "{}", found.splats.len());
        assert_eq!(found.labels.len(), found.splats.len());
        assert!(found == with(1, 5), "the number of threads shows");
        assert!(found != with(2, 6));
        if !centres {
            let nearest = |p: &[f32; 3]| {
                let square = |q: &[f32; 3]| (0..3).map(|a| (p[a] - q[a]).powi(2)).sum::<f32>();
                (0..truth.labels.len())
                    .min_by(|&i, &j| square(&truth.splats.means[i]).total_cmp(&square(&truth.splats.means[j])))
                    .unwrap()
            };
            let same = |i: &usize| truth.labels[nearest(&found.splats.means[*i])] == found.labels[*i];
            let right = (0..found.splats.len()).filter(same).count();
            assert!(right * 100 > 95 * found.splats.len(), "{right} of {}", found.splats.len());
            let psnr = |t: &Trained| mean_score(&score_state(t, &views(&truth, State::END), State::END, true)).psnr;
            assert!(psnr(&found) > 25.0, "{}", psnr(&found));
        }
    }
}

#[test]
fn starts_that_do_not_fit_together_are_refused() {
    let truth = truth();
    let views = captured(&truth);
    let refuse = |skin: SkinStart| {
        let start = Start { splats: truth.splats.clone(), skin, joints: truth.joints.clone() };
        let views = views.as_ref().map(|v| &v[..]);
        articulate(views, start, None, &gentle(1), 1, &Cpu, &mut |_: StepStats| {}).unwrap_err()
    };
    let mut labels = truth.labels.clone();
    labels[3] = 2;
    assert!(matches!(refuse(SkinStart::Labels(labels)), FitError::Start(_)));
    assert!(matches!(refuse(SkinStart::Labels(vec![0; 5])), FitError::Start(_)));
    assert!(matches!(refuse(SkinStart::Centres { centres: vec![[0.0; 3]], radii: vec![1.0] }), FitError::Start(_)));
}
