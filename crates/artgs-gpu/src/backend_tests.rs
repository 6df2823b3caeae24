//! Every kernel against the same computation on the CPU, on small random scenes.

use super::*;
use crate::scene::PLAIN;
use crate::testing::{articulated, gpu, images, rng, splats};
use artgs::fit::{CpuBackend, DepthMode, ImageLoss, PlateauConfig, RateConfig, ViewSampler};
use artgs::low_level::DeformWorkspace;
use artgs::low_level::Warp;
use artgs::low_level::opacity_entropy;
use artgs_core::State;
use artgs_raster::{Frame, Rasterizer, RenderOptions, SplatGrads, SplatView};

pub(super) fn config(loss: LossConfig) -> TrainConfig {
    TrainConfig {
        total: 100,
        loss,
        rates: RateConfig::default(),
        adam: artgs::fit::AdamConfig::default(),
        sh_every: 0,
        random_background: true,
        with_replacement: false,
        extent: 2.0,
        depth_unit: 0.7,
        near: 0.2,
        plateau: PlateauConfig::never(),
    }
}

/// Frame, loss and gradients of one step on the CPU.
struct Expected {
    frame: Frame,
    terms: LossTerms,
    total: f64,
    grads: SplatGrads,
}

fn expected(state: &mut TrainState, image: &TrainImage<'_>, background: [f32; 3], config: &TrainConfig) -> Expected {
    let (mut raster, mut loss, mut grads) = (Rasterizer::new(), ImageLoss::new(), SplatGrads::default());
    let (mut warp, mut work) = (Warp::new(true), DeformWorkspace::default());
    let TrainState { splats, deformation, step, .. } = state;
    let sh_degree = config.sh_degree(*step + 1, splats.sh_degree);
    let options = RenderOptions { sh_degree, background, near: config.near, ..RenderOptions::default() };
    let view = match deformation {
        Deformation::None => SplatView::from(&*splats),
        Deformation::Articulated(a) => {
            a.forward(splats, image.state, 1, &mut work);
            a.view(splats, &work)
        }
    };
    let frame = raster.forward(view, &image.camera, &options).clone();
    let terms = loss.evaluate(&frame, image, background, &config.loss, config.depth_unit);
    raster.backward(view, &image.camera, &options, &loss.grad, &mut grads);
    let mut total = terms.total;
    if let Deformation::Articulated(a) = deformation {
        total += a.backward(splats, image.state, 1, &mut warp, &mut grads, &mut work);
    }
    if config.loss.opacity_entropy > 0.0 {
        let weight = config.loss.opacity_entropy;
        total += f64::from(weight) * opacity_entropy(&splats.logit_opacities, weight, &mut grads.logit_opacities);
    }
    Expected { frame, terms, total, grads }
}

/// Largest difference relative to the largest value.
pub(super) fn apart(got: &[f32], want: &[f32]) -> f32 {
    assert_eq!(got.len(), want.len());
    let size = want.iter().fold(0.0_f32, |m, v| m.max(v.abs())).max(1e-20);
    got.iter().zip(want).fold(0.0_f32, |m, (a, b)| m.max(if a.is_finite() { (a - b).abs() } else { f32::MAX })) / size
}

/// Length of the difference relative to that of the vector.
pub(super) fn distance(got: &[f32], want: &[f32]) -> f64 {
    let square = |v: f32| f64::from(v) * f64::from(v);
    let off: f64 = got.iter().zip(want).map(|(a, b)| square(a - b)).sum();
    (off / want.iter().map(|&b| square(b)).sum::<f64>().max(1e-40)).sqrt()
}

pub(super) fn backend<'a>(gpu: &Gpu, images: Vec<TrainImage<'a>>, config: TrainConfig) -> GpuBackend<'a> {
    backend_with(gpu, images, config, PixelTransfer::Memory)
}

fn backend_with<'a>(
    gpu: &Gpu,
    images: Vec<TrainImage<'a>>,
    config: TrainConfig,
    transfer: PixelTransfer,
) -> GpuBackend<'a> {
    let kernels = Arc::new(Kernels::new(gpu, transfer).unwrap());
    GpuBackend::new(gpu.clone(), kernels, images, config, 3).unwrap()
}

pub(super) fn floats(gpu: &Gpu, buffer: &wgpu::Buffer, count: usize) -> Vec<f32> {
    bytemuck::cast_slice(&gpu.read(&[(buffer, count)]).unwrap()[0]).to_vec()
}

/// One step without an update on both devices, compared.
pub(super) fn compare(gpu: &Gpu, state: TrainState, seed: u64, config: TrainConfig, what: &str) {
    compare_with(gpu, state, seed, config, PixelTransfer::Memory, what);
}

fn compare_with(gpu: &Gpu, mut state: TrainState, seed: u64, config: TrainConfig, transfer: PixelTransfer, what: &str) {
    let images = images(seed);
    let mut backend = backend_with(gpu, images.clone(), config, transfer);
    backend.upload(state.clone()).unwrap();
    let mut stats = Vec::new();
    backend
        .run(1, false, &mut |s| {
            stats.push(s);
            ControlFlow::Continue(())
        })
        .unwrap();
    // The same sampler on the CPU gives the view.
    let states: Vec<State> = images.iter().map(|i| i.state).collect();
    let mut sampler = ViewSampler::new(&states, config.with_replacement, 3);
    let (view, background) = (sampler.view(), sampler.color());
    let want = expected(&mut state, &images[view], background, &config);
    let area = images[view].area();
    let image_buffers = &backend.image_buffers;
    let frame = floats(gpu, &image_buffers.frame, 4 * area);
    let planar: Vec<f32> = (0..3 * area).map(|i| frame[4 * (i % area) + i / area]).collect();
    let alpha: Vec<f32> = (0..area).map(|p| frame[4 * p + 3]).collect();
    assert!(apart(&planar, &want.frame.rgb) < 1e-4, "{what}: colour {}", apart(&planar, &want.frame.rgb));
    assert!(apart(&alpha, &want.frame.alpha) < 1e-4, "{what}: alpha");
    let depth = floats(gpu, &image_buffers.frame_depth, area);
    assert!(apart(&depth, &want.frame.depth) < 1e-4, "{what}: depth {}", apart(&depth, &want.frame.depth));

    let close = |a: f64, b: f64, of: &str| assert!((a - b).abs() <= 1e-4 * b.abs() + 1e-7, "{what}: {of} {a} not {b}");
    close(stats[0].terms.l1, want.terms.l1, "l1");
    close(stats[0].terms.mse, want.terms.mse, "mse");
    close(stats[0].terms.ssim, want.terms.ssim, "ssim");
    close(stats[0].terms.depth, want.terms.depth, "depth term");
    close(stats[0].terms.mask, want.terms.mask, "mask");
    close(stats[0].loss, want.total, "loss");

    let g = &backend.resident.as_ref().unwrap().gaussians;
    let grads = floats(gpu, &g.grads, g.n * (PLAIN + g.sh_stride));
    let kinds: [(&str, &[f32]); 5] = [
        ("means", want.grads.means.as_flattened()),
        ("rotations", want.grads.rotations.as_flattened()),
        ("log scales", want.grads.log_scales.as_flattened()),
        ("opacities", &want.grads.logit_opacities),
        ("harmonics", &want.grads.sh),
    ];
    let mut at = 0;
    for (kind, want) in kinds {
        let got = &grads[at..at + want.len()];
        at += want.len();
        let off = distance(got, want);
        assert!(off < 1e-4, "{what}: gradient of {kind} {off}");
    }
    let seen = floats(gpu, &g.densify_stats, 4 * g.n);
    let column = |c: usize| -> Vec<f32> { seen.iter().skip(c).step_by(4).copied().collect() };
    assert!(distance(&column(0), &want.grads.mean2d) < 1e-4, "{what}: screen gradients");
    let drawn: Vec<f32> = want.grads.radii.iter().map(|&r| f32::from(u8::from(r > 0.0))).collect();
    assert_eq!(column(1), drawn, "{what}: drawn");
    assert!(apart(&column(2), &want.grads.radii) < 1e-6 + 1.0 / 50.0, "{what}: radii");
}

#[test]
fn a_step_on_static_gaussians_agrees_with_the_cpu() {
    let Some(gpu) = gpu() else { return };
    for (seed, n, degree) in [(1, 300, 3), (2, 700, 1), (3, 40, 0), (4, 2500, 2)] {
        let state = TrainState::new(splats(&mut rng(seed), n, degree));
        compare(&gpu, state, seed, config(LossConfig::default()), &format!("{n} Gaussians of degree {degree}"));
    }
}

#[test]
fn every_form_of_the_loss_agrees_with_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let published = LossConfig {
        crop_ssim: false,
        double_alpha: true,
        depth: 1.0,
        depth_mode: DepthMode::Accumulated,
        mask: 0.0,
        opacity_entropy: 0.1,
        ..LossConfig::default()
    };
    let no_ssim = LossConfig { ssim: 0.0, ..LossConfig::default() };
    let no_depth = LossConfig { depth: 0.0, ..LossConfig::default() };
    for (what, loss) in [("as published", published), ("without similarity", no_ssim), ("without depth", no_depth)] {
        compare(&gpu, TrainState::new(splats(&mut rng(5), 400, 2)), 5, config(loss), what);
    }
}

#[test]
fn pixels_moved_in_registers_agree_with_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let Some([least, most]) = gpu.subgroup else { return };
    if least == most {
        let state = TrainState::new(splats(&mut rng(13), 900, 1));
        compare_with(&gpu, state, 13, config(LossConfig::default()), PixelTransfer::Subgroup(most), "registers");
    }
}

#[test]
fn moved_parts_agree_with_the_cpu() {
    let Some(gpu) = gpu() else { return };
    for (seed, exact) in [(6, true), (7, false), (8, true)] {
        let splats = splats(&mut rng(seed), 500, 2);
        let deformation = Deformation::Articulated(Box::new(articulated(&mut rng(seed), splats.len(), exact, false)));
        let state = TrainState { deformation, ..TrainState::new(splats) };
        compare(&gpu, state, seed, config(LossConfig::default()), &format!("articulated, exact {exact}"));
    }
}

/// Runs both devices for some steps from the same state and returns the results.
pub(super) fn both(gpu: &Gpu, state: &TrainState, config: TrainConfig, steps: usize) -> [TrainState; 2] {
    let mut cpu = CpuBackend::new(images(9), config, 3).unwrap();
    let mut other = backend(gpu, images(9), config);
    let run = |backend: &mut dyn Backend| {
        let mut numbers = Vec::new();
        backend.upload(state.clone()).unwrap();
        backend
            .run(steps, true, &mut |s| {
                numbers.push(s.step);
                ControlFlow::Continue(())
            })
            .unwrap();
        assert_eq!(numbers, (1..=steps).collect::<Vec<usize>>());
        backend.download().unwrap()
    };
    [run(&mut cpu), run(&mut other)]
}

#[test]
fn some_steps_lead_to_the_same_gaussians_and_joints() {
    let Some(gpu) = gpu() else { return };
    let splats = splats(&mut rng(10), 400, 2);
    let articulated = articulated(&mut rng(10), splats.len(), true, true);
    let deformation = Deformation::Articulated(Box::new(articulated));
    let state = TrainState { deformation, ..TrainState::new(splats) };
    let [cpu, gpu] = both(&gpu, &state, config(LossConfig::default()), 8);
    assert_eq!((cpu.step, cpu.adam.count), (gpu.step, gpu.adam.count));
    let moved = |a: &[f32], b: &[f32]| distance(a, b);
    let off = moved(gpu.splats.means.as_flattened(), cpu.splats.means.as_flattened());
    assert!(off < 1e-4, "means {off}");
    let off = moved(&gpu.splats.sh, &cpu.splats.sh);
    assert!(off < 5e-3, "harmonics {off}");
    assert!(moved(&gpu.stats.grad, &cpu.stats.grad) < 1e-2);
    let (Deformation::Articulated(a), Deformation::Articulated(b)) = (&cpu.deformation, &gpu.deformation) else {
        panic!("both are articulated");
    };
    let Deformation::Articulated(start) = &state.deformation else { panic!("the start is articulated") };
    for ((a, b), start) in a.joint_states().iter().zip(b.joint_states()).zip(start.joint_states()) {
        let shift = |x: &[f64; 8], y: &[f64; 8]| (0..8).map(|i| (x[i] - y[i]).abs()).fold(0.0, f64::max);
        assert!(shift(&a.values, &start.values) > 1e-3, "joints learn: {a:?}");
        assert!(shift(&a.values, &b.values) < 2e-4, "{a:?} {b:?}");
    }
}

#[test]
fn a_step_that_overflows_is_repeated_with_larger_buffers() {
    let Some(gpu) = gpu() else { return };
    let state = TrainState::new(splats(&mut rng(11), 300, 1));
    let run = |capacity: usize| {
        let mut backend = backend(&gpu, images(9), config(LossConfig::default()));
        backend.capacity = capacity;
        backend.upload(state.clone()).unwrap();
        if capacity > 0 {
            backend.resident.as_mut().unwrap().intersections = None;
            backend.reserve(capacity).unwrap();
        }
        let mut steps = Vec::new();
        backend
            .run(5, true, &mut |s| {
                steps.push((s.step, s.loss));
                ControlFlow::Continue(())
            })
            .unwrap();
        (steps, backend.download().unwrap())
    };
    let (large, small) = (run(0), run(50));
    assert_eq!(large.0, small.0);
    assert_eq!(large.1.splats, small.1.splats);
    assert_eq!(large.1.stats, small.1.stats);
}

#[test]
fn the_same_seed_gives_the_same_bytes_also_if_training_stops_between() {
    let Some(gpu) = gpu() else { return };
    let state = TrainState::new(splats(&mut rng(12), 200, 1));
    let train = |stops: &[usize]| {
        let mut backend = backend(&gpu, images(9), config(LossConfig::default()));
        let mut state = state.clone();
        for &steps in stops {
            backend.upload(state).unwrap();
            backend.run(steps, true, &mut |_| ControlFlow::Break(())).unwrap();
            state = backend.download().unwrap();
        }
        state
    };
    // Stops after batches of 1 and 2 steps.
    let (a, b) = (train(&[3, 2]), train(&[3, 2]));
    assert_eq!((a.step, &a.splats), (b.step, &b.splats));
    assert_eq!(a.step, 3);
}

#[test]
fn a_lost_device_is_an_error_and_the_cpu_can_continue() {
    let Some(gpu) = gpu() else { return };
    let state = TrainState::new(splats(&mut rng(14), 200, 1));
    let mut lost = backend(&gpu, images(9), config(LossConfig::default()));
    lost.upload(state.clone()).unwrap();
    gpu.device.destroy();
    let error = lost.run(2, true, &mut |_| ControlFlow::Continue(())).unwrap_err();
    assert!(matches!(&error, FitError::Device(_)), "{error}");
    assert!(matches!(lost.download(), Err(FitError::Device(_))));

    #[derive(Debug)]
    struct Lost(GpuDevices);
    impl Devices for Lost {
        fn name(&self) -> String {
            self.0.name()
        }
        fn backend<'a>(
            &'a self,
            images: Vec<TrainImage<'a>>,
            config: TrainConfig,
            seed: u64,
        ) -> Result<Box<dyn Backend + 'a>, FitError> {
            let backend = self.0.backend(images, config, seed)?;
            self.0.gpu.device.destroy();
            Ok(backend)
        }
    }
    let fresh = crate::testing::gpu().unwrap();
    let devices = artgs::fit::WithFallback::new(Box::new(Lost(GpuDevices::new(fresh).unwrap())));
    let mut falling = devices.backend(images(9), config(LossConfig::default()), 3).unwrap();
    falling.upload(state).unwrap();
    let mut steps = Vec::new();
    falling
        .run(3, true, &mut |s| {
            steps.push(s.step);
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(steps, [1, 2, 3]);
    assert!(devices.notice().is_some_and(|n| n.contains("CPU")));
}

#[test]
fn unsupported_states_are_errors_with_a_reason() {
    let Some(gpu) = gpu() else { return };
    let mut backend = backend(&gpu, images(9), config(LossConfig::default()));
    assert!(matches!(backend.upload(TrainState::default()), Err(FitError::Empty)));
    assert!(matches!(backend.held_back(), Err(FitError::Empty)));
    assert!(matches!(
        GpuBackend::new(
            gpu.clone(),
            Arc::new(Kernels::new(&gpu, PixelTransfer::Memory).unwrap()),
            vec![],
            config(LossConfig::default()),
            1
        ),
        Err(FitError::NoViews)
    ));
}
