//! Fits known Gaussians from their own renderings, and a real capture where one is at hand.

use artgs::fit::{
    Cpu, DensifyConfig, Follow, InitKind, PlateauConfig, SingleConfig, StepStats, TrainState, fit_single, score_views,
};
use artgs_core::{Camera, DepthMap, Intrinsics, Splats, View};
use artgs_raster::{Rasterizer, RenderOptions, SplatView};
use glam::DVec3;

const SIZE: u32 = 64;

/// Opaque blobs on a sphere that is neither at the origin nor of size 1.
fn truth() -> Splats {
    let n = 600;
    let mut splats = Splats::empty(0);
    for i in 0..n {
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(n);
        let (a, r) = (f64::from(i) * 2.399_963, (1.0 - z * z).sqrt());
        let p = DVec3::new(30.0, -10.0, 5.0) + 4.0 * DVec3::new(r * a.cos(), r * a.sin(), z);
        splats.means.push(p.as_vec3().to_array());
        splats.rotations.push([1.0, 0.0, 0.0, 0.0]);
        splats.log_scales.push([0.35_f32.ln(); 3]);
        splats.logit_opacities.push(3.0);
        let stripes = |c: f64| (1.4 * (0.9 * c * p.x + 0.7 * p.y - c * p.z).sin()) as f32;
        splats.sh.extend([stripes(0.5), stripes(1.0), stripes(1.5)]);
    }
    splats
}

fn views(splats: &Splats, count: usize, phase: f64) -> Vec<View> {
    let k = Intrinsics { fx: 90.0, fy: 90.0, cx: 32.0, cy: 32.0, width: SIZE, height: SIZE };
    let mut rasterizer = Rasterizer::new();
    let options = RenderOptions { sh_degree: 0, ..RenderOptions::default() };
    let view = |i: usize| {
        let a = i as f64 * 2.4 + phase;
        let up = (i as f64 + 0.5) / count as f64 * 1.6 - 0.8;
        let away = DVec3::new(a.cos() * (1.0 - up * up).sqrt(), a.sin() * (1.0 - up * up).sqrt(), up);
        let middle = DVec3::new(30.0, -10.0, 5.0);
        let camera = Camera::look_at(k, middle + 15.0 * away, middle, DVec3::Z);
        let frame = rasterizer.forward(SplatView::from(splats), &camera, &options);
        let n = frame.alpha.len();
        let byte = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
        let straight = |i: usize, c: usize| byte(frame.rgb[c * n + i] / frame.alpha[i].max(1e-3));
        let rgba = (0..n).map(|i| [straight(i, 0), straight(i, 1), straight(i, 2), byte(frame.alpha[i])]).collect();
        let depth: Vec<f32> =
            (0..n).map(|i| if frame.alpha[i] > 0.5 { frame.depth[i] / frame.alpha[i] } else { 0.0 }).collect();
        View { name: format!("{i}"), camera, rgba, depth: Some(DepthMap::nearest(&depth)), derived: None }
    };
    (0..count).map(view).collect()
}

fn mean_psnr(splats: &Splats, views: &[View]) -> f64 {
    artgs::fit::mean_score(&score_views(splats, views)).psnr
}

fn quick(init: InitKind) -> SingleConfig {
    let mut config = SingleConfig { steps: 300, sh_degree: 0, init, ..SingleConfig::default() };
    config.random.count = 2000;
    config.depth.count = 600;
    config.densify.every = 0;
    config
}

#[test]
fn a_start_on_depth_comes_back_to_the_truth() {
    let truth = truth();
    let (train, test) = (views(&truth, 12, 0.0), views(&truth, 4, 1.1));
    let config = quick(InitKind::Depth);
    let mut steps = 0;
    let splats = fit_single(&train, &config, 1, &Cpu, &mut |s: StepStats| steps = s.step).unwrap();
    assert_eq!(steps, 300);
    let (before, after) = (
        mean_psnr(
            &fit_single(&train, &SingleConfig { steps: 0, ..config }, 1, &Cpu, &mut |_: StepStats| {}).unwrap(),
            &test,
        ),
        mean_psnr(&splats, &test),
    );
    eprintln!("held out: {before:.2} dB at the start, {after:.2} dB after 300 steps, {} Gaussians", splats.len());
    assert!(after > 27.5 && after > before + 7.0, "{before} {after}");
}

#[test]
fn a_random_start_with_densification_learns_too_and_the_seed_decides_every_byte() {
    let truth = truth();
    let (train, test) = (views(&truth, 12, 0.0), views(&truth, 4, 1.1));
    let densify =
        DensifyConfig { after: 50, before: 201, late_after: 50, max_gaussians: 5000, ..DensifyConfig::paper() };
    let config = SingleConfig { steps: 400, densify, ..quick(InitKind::Random) };
    let fit = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fit_single(&train, &config, seed, &Cpu, &mut |_: StepStats| {}).unwrap())
    };
    let splats = fit(2, 3);
    let psnr = mean_psnr(&splats, &test);
    let before = mean_psnr(
        &fit_single(&train, &SingleConfig { steps: 0, ..config }, 3, &Cpu, &mut |_: StepStats| {}).unwrap(),
        &test,
    );
    eprintln!("random start: {psnr:.2} dB from {before:.2} dB, {} Gaussians", splats.len());
    assert!(psnr > 18.0 && psnr > before + 8.0, "{before} {psnr}");
    assert!(splats == fit(1, 3), "the number of threads shows");
    assert!(splats != fit(2, 4));
}

/// Looks at the Gaussians after every seventh step.
#[derive(Default)]
struct Looker {
    step: usize,
    looks: Vec<(usize, usize)>,
}

impl Follow for Looker {
    fn step(&mut self, stats: StepStats) {
        self.step = stats.step;
    }

    fn wants_snapshot(&mut self) -> bool {
        self.step.is_multiple_of(7)
    }

    fn snapshot(&mut self, state: &TrainState, _: usize) {
        assert_eq!(state.step, self.step);
        self.looks.push((state.step, state.splats.len()));
    }
}

#[test]
fn looking_on_changes_nothing() {
    let train = views(&truth(), 16, 0.0);
    // Steps 70 and 105 both change the set of Gaussians and are looked at.
    let densify = DensifyConfig {
        after: 30,
        before: 120,
        every: 35,
        late_after: 30,
        max_gaussians: 4000,
        ..DensifyConfig::paper()
    };
    let plateau = PlateauConfig { settle: 40, hold_back: 2, every: 30, ..PlateauConfig::default() };
    for (update_always, plateau) in [(false, PlateauConfig::never()), (true, plateau)] {
        let config = SingleConfig { steps: 160, densify, update_always, plateau, ..quick(InitKind::Random) };
        let alone = fit_single(&train, &config, 5, &Cpu, &mut |_: StepStats| {}).unwrap();
        let mut looker = Looker::default();
        let seen = fit_single(&train, &config, 5, &Cpu, &mut looker).unwrap();
        assert!(alone == seen, "looking on shows, update_always {update_always}");
        assert!(looker.looks.windows(2).all(|w| w[1].0 == w[0].0 + 7), "{:?}", looker.looks);
        assert!(looker.looks.len() >= looker.step / 7 && looker.step >= 70, "{:?}", looker.looks);
        assert!(looker.looks.iter().any(|l| l.1 != looker.looks[0].1), "the set never changed");
    }
}

#[test]
fn a_real_capture_is_explained() {
    let root = std::env::var("ARTGS_DATASETS").map_or_else(
        |_| concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/datasets").into(),
        std::path::PathBuf::from,
    );
    let dir = root.join("mini_fridge_habitat_200");
    if !dir.is_dir() {
        eprintln!("SKIPPED: no capture at {}; set ARTGS_DATASETS", dir.display());
        return;
    }
    let capture = artgs_io::load_capture(&dir).unwrap();
    let mut config = SingleConfig { steps: 150, ..SingleConfig::default() };
    config.depth.count = 8000;
    let splats =
        fit_single(&capture.states[artgs_core::State::START].train, &config, 1, &Cpu, &mut |_: StepStats| {}).unwrap();
    let psnr = mean_psnr(&splats, &capture.states[artgs_core::State::START].test);
    eprintln!("150 steps: {psnr:.2} dB on held-out views, {} Gaussians", splats.len());
    assert!(psnr > 34.0, "{psnr}");
}
