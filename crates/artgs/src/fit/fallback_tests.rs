use super::*;
use crate::fit::adam::AdamConfig;
use crate::fit::follow::Follow;
use crate::fit::train::{RunPlan, train};
use crate::fit::{CpuBackend, DensifyConfig, DepthPick, LossConfig, PlateauConfig, RateConfig};
use artgs_core::{Camera, Intrinsics, Splats, State, View};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

const STEPS: usize = 20;

/// Stretches end after steps 5, 10, 14 and 20; the state is uploaded before the first and the last of them.
fn plateau() -> PlateauConfig {
    PlateauConfig { settle: 6, hold_back: 1, every: 5, least_gain: -1e9, ..PlateauConfig::default() }
}

fn images() -> Vec<TrainImage<'static>> {
    let k = Intrinsics { fx: 30.0, fy: 30.0, cx: 12.0, cy: 12.0, width: 24, height: 24 };
    let image = |i: usize| {
        let angle = 0.7 * i as f64;
        let camera = Camera::look_at(k, DVec3::new(4.0 * angle.cos(), 4.0 * angle.sin(), 1.0), DVec3::ZERO, DVec3::Z);
        let rgba = (0..576).map(|p| [(p / 3) as u8, (40 * i) as u8, 90, 255]).collect();
        TrainImage::new(
            &View { name: String::new(), camera, rgba, depth: None, derived: None },
            State::START,
            1,
            DepthPick::Median,
        )
        .smaller(1)
    };
    (0..8).map(image).collect()
}

fn start() -> TrainState {
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let mut splats = Splats::empty(0);
    for _ in 0..15 {
        splats.means.push(std::array::from_fn(|_| rng.random::<f32>() - 0.5));
        splats.rotations.push([1.0, 0.0, 0.0, 0.0]);
        splats.log_scales.push([-1.5; 3]);
        splats.logit_opacities.push(0.5);
        splats.sh.extend([0.2, 0.1, 0.3]);
    }
    TrainState::new(splats)
}

fn config() -> TrainConfig {
    TrainConfig {
        total: STEPS,
        loss: LossConfig::default(),
        rates: RateConfig::default(),
        adam: AdamConfig::default(),
        sh_every: 0,
        random_background: true,
        with_replacement: false,
        extent: 1.0,
        depth_unit: 1.0,
        near: 0.1,
        plateau: plateau(),
    }
}

/// Where a device fails; uploads count from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
enum At {
    Making,
    Upload(usize),
    Step(usize),
    HeldBack(usize),
    Download(usize),
}

/// The processor under another name, that makes several steps at once and fails once it gets somewhere.
#[derive(Debug)]
struct FailingDevices {
    at: At,
    at_once: usize,
    made: Arc<AtomicUsize>,
}

struct FailingDevicesBackend<'a> {
    cpu: CpuBackend<'a>,
    at: At,
    at_once: usize,
    uploads: usize,
    step: usize,
}

impl FailingDevicesBackend<'_> {
    fn check(&self, at: At) -> Result<(), FitError> {
        if self.at == at { Err(FitError::Device("scripted".into())) } else { Ok(()) }
    }
}

impl Devices for FailingDevices {
    fn name(&self) -> String {
        "FailingDevices".into()
    }

    fn backend<'a>(
        &'a self,
        images: Vec<TrainImage<'a>>,
        config: TrainConfig,
        seed: u64,
    ) -> Result<Box<dyn Backend + 'a>, FitError> {
        self.made.fetch_add(1, Ordering::Relaxed);
        if self.at == At::Making {
            return Err(FitError::Device("scripted".into()));
        }
        let cpu = CpuBackend::new(images, config, seed)?;
        Ok(Box::new(FailingDevicesBackend { cpu, at: self.at, at_once: self.at_once, uploads: 0, step: 0 }))
    }
}

impl Backend for FailingDevicesBackend<'_> {
    fn upload(&mut self, state: TrainState) -> Result<(), FitError> {
        self.uploads += 1;
        self.step = state.step;
        self.cpu.upload(state)?;
        self.check(At::Upload(self.uploads - 1))
    }

    fn run(
        &mut self,
        steps: usize,
        update_last: bool,
        on_step: &mut dyn FnMut(StepStats) -> ControlFlow<()>,
    ) -> Result<(), FitError> {
        let (at, at_once, mut broken) = (self.at, self.at_once, false);
        self.cpu.run(steps, update_last, &mut |s| {
            self.step = s.step;
            broken |= on_step(s).is_break();
            let stops = at == At::Step(s.step) || broken && s.step.is_multiple_of(at_once);
            if stops { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        })?;
        self.check(At::Step(self.step))
    }

    fn held_back(&mut self) -> Result<Option<f64>, FitError> {
        self.check(At::HeldBack(self.step))?;
        self.cpu.held_back()
    }

    fn download(&mut self) -> Result<TrainState, FitError> {
        self.check(At::Download(self.step))?;
        self.cpu.download()
    }
}

/// The processor, created again before one of the uploads: the result that a fallback must give.
struct Recreated {
    cpu: CpuBackend<'static>,
    uploads: usize,
    recreated_at: usize,
}

impl Backend for Recreated {
    fn upload(&mut self, state: TrainState) -> Result<(), FitError> {
        if self.uploads == self.recreated_at {
            self.cpu = CpuBackend::new(images(), config(), 7)?;
        }
        self.uploads += 1;
        self.cpu.upload(state)
    }

    fn run(
        &mut self,
        steps: usize,
        update_last: bool,
        on_step: &mut dyn FnMut(StepStats) -> ControlFlow<()>,
    ) -> Result<(), FitError> {
        self.cpu.run(steps, update_last, on_step)
    }

    fn held_back(&mut self) -> Result<Option<f64>, FitError> {
        self.cpu.held_back()
    }

    fn download(&mut self) -> Result<TrainState, FitError> {
        self.cpu.download()
    }
}

/// Asks for a look from a step on, gets it once.
#[derive(Default)]
struct SnapshotFollower {
    wants_at: Option<usize>,
    steps: Vec<usize>,
    looks: Vec<(usize, String)>,
}

impl Follow for SnapshotFollower {
    fn step(&mut self, s: StepStats) {
        self.steps.push(s.step);
    }

    fn wants_snapshot(&mut self) -> bool {
        self.looks.is_empty() && self.steps.last().copied() >= self.wants_at && self.wants_at.is_some()
    }

    fn snapshot(&mut self, state: &TrainState, _: usize) {
        self.looks.push((state.step, format!("{state:?}")));
    }
}

/// All of the state at the end, and what was followed.
fn trained(backend: &mut dyn Backend, wants_at: Option<usize>) -> (String, SnapshotFollower) {
    let densify = DensifyConfig { every: 0, ..DensifyConfig::default() };
    let plan = RunPlan { steps: STEPS, plateau: plateau(), update_always: false, densify, extent: 1.0 };
    let mut looker = SnapshotFollower { wants_at, ..SnapshotFollower::default() };
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let state = train(backend, start(), &plan, &mut rng, &mut looker).unwrap();
    (format!("{state:?}"), looker)
}

fn expected(recreated_at: usize, wants_at: Option<usize>) -> (String, SnapshotFollower) {
    let cpu = CpuBackend::new(images(), config(), 7).unwrap();
    trained(&mut Recreated { cpu, uploads: 0, recreated_at }, wants_at)
}

fn falling(at: At, at_once: usize) -> (WithFallback, Arc<AtomicUsize>) {
    let made = Arc::new(AtomicUsize::new(0));
    (WithFallback::new(Box::new(FailingDevices { at, at_once, made: made.clone() })), made)
}

#[test]
fn wherever_a_device_fails_the_processor_resumes_from_the_last_upload() {
    let places = [
        (At::Making, 0),
        (At::Upload(0), 0),
        (At::Upload(1), 1),
        (At::Step(1), 0),
        (At::Step(8), 0),
        (At::Step(20), 1),
        (At::HeldBack(10), 0),
        (At::Download(14), 0),
        (At::Download(20), 1),
    ];
    let undisturbed = expected(STEPS, None).0;
    for (at, recreated_at) in places {
        let (devices, made) = falling(at, 4);
        let mut backend = devices.backend(images(), config(), 7).unwrap();
        let (state, looker) = trained(backend.as_mut(), None);
        assert_eq!(looker.steps, (1..=STEPS).collect::<Vec<usize>>(), "{at:?}");
        assert!(state == expected(recreated_at, None).0, "{at:?}");
        assert_eq!(state == undisturbed, recreated_at == 0, "views would come in another order: {at:?}");
        let notice = devices.notice().unwrap();
        assert!(notice.contains("FailingDevices: scripted") && notice.contains("CPU"), "{notice}");
        assert!(devices.notice().is_none(), "returned once");
        drop(backend);
        assert_eq!(devices.name(), Cpu.name());
        let (state, _) = trained(devices.backend(images(), config(), 7).unwrap().as_mut(), None);
        assert!(state == undisturbed && made.load(Ordering::Relaxed) == 1, "once fallen, never tried again");
    }
}

#[test]
fn a_device_that_works_is_left_alone() {
    let (devices, _) = falling(At::Upload(99), 4);
    let (state, _) = trained(devices.backend(images(), config(), 7).unwrap().as_mut(), None);
    assert!(state == expected(STEPS, None).0 && devices.notice().is_none() && devices.name() == "FailingDevices");
}

#[test]
fn what_was_reported_has_happened_when_a_look_is_taken() {
    // Asked for after step 7, but the device makes steps 5 to 8 at once.
    let (expected, reference) = expected(0, Some(8));
    for at in [At::Step(8), At::Download(8)] {
        let (devices, _) = falling(at, 4);
        let (state, looker) = trained(devices.backend(images(), config(), 7).unwrap().as_mut(), Some(7));
        assert_eq!(looker.steps, (1..=STEPS).collect::<Vec<usize>>(), "{at:?}");
        assert_eq!(looker.looks[0].0, 8, "{at:?}");
        assert!(looker.looks == reference.looks && state == expected, "{at:?}");
        assert!(devices.notice().is_some());
    }
}

#[test]
fn long_stretches_are_saved_on_the_way() {
    let (devices, _) = falling(At::Step(SAVE_EVERY + 40), 1);
    let mut backend = devices.backend(images(), config(), 7).unwrap();
    let mut steps = Vec::new();
    backend.upload(start()).unwrap();
    let report = &mut |s: StepStats| {
        steps.push(s.step);
        ControlFlow::Continue(())
    };
    backend.run(SAVE_EVERY + 60, false, report).unwrap();
    let state = backend.download().unwrap();
    assert_eq!(steps, (1..=SAVE_EVERY + 60).collect::<Vec<usize>>());

    let mut cpu = CpuBackend::new(images(), config(), 7).unwrap();
    let mut silent = |_: StepStats| ControlFlow::Continue(());
    cpu.upload(start()).unwrap();
    cpu.run(SAVE_EVERY, true, &mut silent).unwrap();
    let saved = cpu.download().unwrap();
    let mut cpu = CpuBackend::new(images(), config(), 7).unwrap();
    cpu.upload(saved).unwrap();
    cpu.run(60, false, &mut silent).unwrap();
    assert_eq!(format!("{state:?}"), format!("{:?}", cpu.download().unwrap()));
}

#[test]
fn other_errors_pass_through() {
    let (devices, _) = falling(At::Upload(99), 1);
    assert!(matches!(devices.backend(Vec::new(), config(), 7), Err(FitError::NoViews)));
    let mut backend = devices.backend(images(), config(), 7).unwrap();
    assert!(matches!(backend.upload(TrainState::default()), Err(FitError::Empty)));
    assert!(devices.notice().is_none() && !devices.has_failed());
}
