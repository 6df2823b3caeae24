//! Learned membership and the Chamfer term against the same computation on the CPU; noise is off except where it is tested.

use super::tests::{backend, both, compare, config, distance, floats};
use super::*;
use crate::testing::{articulated, gpu, images, parts, rng, splats};
use artgs::fit::{Articulated, ChamferTargets, CpuBackend, DeformConfig};
use artgs::low_level::{AssignConfig, AssignKind, AssignState, HashGridConfig, PartAssignment};
use artgs_core::{PerState, Splats};
use rand::RngExt;

const PARTS: usize = 5;

/// Three levels of which two learn at first, and the third from step 5 on.
fn settings() -> AssignConfig {
    let grid = HashGridConfig { levels: 3, log2_entries: 9, base_resolution: 5.0, growth: 1.7, initial_range: 0.3 };
    AssignConfig {
        grid,
        normalise_coordinates: true,
        gumbel: false,
        initial_levels: 2,
        steps_per_level: 5,
        temperature_steps: 100,
        ..AssignConfig::default()
    }
}

/// A module without symmetries.
fn assignment(settings: AssignConfig, seed: u64) -> Assignment {
    let mut rng = rng(seed);
    let centres: Vec<[f32; 3]> = (0..PARTS).map(|_| [0; 3].map(|_| rng.random_range(-0.6..0.6))).collect();
    let mut module =
        PartAssignment::new(settings, &centres, &[0.7, 0.4, 0.5, 0.6, 0.45], [[-2.2; 3], [2.2; 3]], &mut rng);
    let mut state = module.state();
    for frame in state.values[..10 * PARTS].chunks_exact_mut(10) {
        frame[3..].iter_mut().for_each(|v| *v += rng.random_range(-0.3..0.3));
    }
    module.set_state(&state);
    Assignment::Centres(module)
}

fn targets(seed: u64) -> Arc<ChamferTargets> {
    let mut rng = rng(seed);
    let mut cloud = |n: usize| (0..n).map(|_| [0; 3].map(|_| rng.random_range(-0.8..0.8f32))).collect::<Vec<_>>();
    Arc::new(ChamferTargets::new(&PerState::new(cloud(700), cloud(300))))
}

fn state(splats: Splats, articulated: Articulated) -> TrainState {
    TrainState { deformation: Deformation::Articulated(Box::new(articulated)), ..TrainState::new(splats) }
}

fn learned_state(settings: AssignConfig, seed: u64, n: usize, exact: bool, pulled: bool) -> TrainState {
    let membership = Membership::Learned(Box::new(assignment(settings, seed)));
    state(splats(&mut rng(seed), n, 2), parts(membership, exact, true, pulled.then(|| targets(seed))))
}

fn parts_of(state: &TrainState) -> &Articulated {
    let Deformation::Articulated(articulated) = &state.deformation else { panic!("it is articulated") };
    articulated
}

fn module_of(state: &TrainState) -> AssignState {
    membership::module(parts_of(state)).unwrap().state()
}

fn hard() -> AssignConfig {
    AssignConfig { temperature_steps: 1, end_temperature: 0.3, ..settings() }
}

#[test]
fn learned_parts_agree_with_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let published = AssignConfig { normalise_coordinates: false, centre_weight: 0.0, ..settings() };
    for (what, settings, exact, pulled) in [
        ("soft", settings(), true, false),
        ("soft, pulled", settings(), true, true),
        ("hard", hard(), true, true),
        ("as published", published, false, true),
    ] {
        compare(&gpu, learned_state(settings, 21, 500, exact, pulled), 21, config(LossConfig::default()), what);
    }
}

#[test]
fn the_chamfer_term_also_acts_on_fixed_parts() {
    let Some(gpu) = gpu() else { return };
    let labels = (0..400).map(|i| (i * 7 % PARTS) as u16).collect();
    let start = state(splats(&mut rng(22), 400, 1), parts(Membership::Labels(labels), true, true, Some(targets(22))));
    compare(&gpu, start.clone(), 22, config(LossConfig::default()), "labels, pulled");
    let [cpu, gpu] = both(&gpu, &start, config(LossConfig::default()), 1);
    let (off, size) = joint_moments_apart(&cpu, &gpu);
    assert!(size > 0.0 && off < 1e-4, "{off}");
}

/// Relative distance of the first moments of all motions, and their length.
fn joint_moments_apart(want: &TrainState, got: &TrainState) -> (f64, f64) {
    let first = |s: &TrainState| -> Vec<f32> {
        parts_of(s).joint_states().iter().flat_map(|j| j.moments.map(|m| m[0] as f32)).collect()
    };
    let (want, got) = (first(want), first(got));
    (distance(&got, &want), want.iter().map(|v| f64::from(v * v)).sum::<f64>().sqrt())
}

/// After one step the first moments are a tenth of the gradients.
#[test]
fn gradients_of_membership_and_motions_agree_with_the_cpu() {
    let Some(gpu) = gpu() else { return };
    let published = AssignConfig { normalise_coordinates: false, ..settings() };
    for (what, settings, exact) in [("soft", settings(), true), ("hard", hard(), true), ("published", published, false)]
    {
        let start = learned_state(settings, 23, 600, exact, true);
        let [cpu, gpu] = both(&gpu, &start, config(LossConfig::default()), 1);
        let (off, size) = joint_moments_apart(&cpu, &gpu);
        assert!(size > 0.0 && off < 1e-4, "{what}: motions {off}");
        let (a, b) = (module_of(&cpu), module_of(&gpu));
        let first = |s: &AssignState| s.moments.iter().map(|m| m[0] as f32).collect::<Vec<f32>>();
        let (want, got) = (first(&a), first(&b));
        let mut at = 0;
        let [inputs, hidden] = [4 * PARTS + 2 * 3 + 3, 32];
        let lengths = [10 * PARTS, hidden * inputs, hidden, 2 * PARTS * hidden, 2 * PARTS];
        for (kind, length) in ["frames", "W1", "b1", "W2", "b2"].iter().zip(lengths) {
            let off = distance(&got[at..at + length], &want[at..at + length]);
            assert!(want[at..at + length].iter().any(|v| *v != 0.0) && off < 1e-4, "{what}: {kind} {off}");
            at += length;
        }
        assert_eq!(at, want.len());
        for (level, (a, b)) in a.grid.iter().zip(&b.grid).enumerate() {
            let off = distance(b.means.as_flattened(), a.means.as_flattened());
            let learns = a.means.as_flattened().iter().any(|v| *v != 0.0);
            assert!(learns == (level < 2) && off < 1e-4, "{what}: level {level} {off}");
        }
    }
}

#[test]
fn some_steps_give_the_same_membership() {
    let Some(gpu) = gpu() else { return };
    let start = learned_state(settings(), 24, 500, true, true);
    let [cpu, gpu] = both(&gpu, &start, config(LossConfig::default()), 8);
    let (a, b, start_values) = (module_of(&cpu), module_of(&gpu), module_of(&start));
    let moved = distance(&a.values, &start_values.values);
    let off = distance(&b.values, &a.values);
    // Adam makes steps of full length for the smallest gradients, whose sign depends on rounding.
    assert!(moved > 1e-2 && off < 5e-3 * moved, "values {off} of {moved}");
    for (level, ((a, b), start_values)) in a.grid.iter().zip(&b.grid).zip(&start_values.grid).enumerate() {
        // Gradients below a millionth of the largest depend on rounding, and Adam scales them up.
        let roots = || a.squares.as_flattened().iter().map(|s| s.sqrt());
        let floor = 1e-6 * roots().fold(0.0, f32::max);
        let pick = |values: &[[f32; 2]]| -> Vec<f32> {
            values.as_flattened().iter().zip(roots()).filter(|(_, r)| *r > floor).map(|(v, _)| *v).collect()
        };
        let (want, got, start_values) = (pick(&a.values), pick(&b.values), pick(&start_values.values));
        let (off, moved) = (distance(&got, &want), distance(&want, &start_values));
        assert!(
            want.len() > 60 && moved > 1e-3 && off < 5e-3 * moved,
            "level {level}: {off} of {moved}, {}",
            want.len()
        );
    }
    for (a, b) in parts_of(&cpu).joint_states().iter().zip(parts_of(&gpu).joint_states()) {
        let off = (0..8).map(|i| (a.values[i] - b.values[i]).abs()).fold(0.0, f64::max);
        assert!(off < 2e-4, "{a:?} {b:?}");
    }
    assert_eq!(parts_of(&cpu).labels(&start.splats), parts_of(&gpu).labels(&start.splats));
}

#[test]
fn an_uploaded_state_is_downloaded_unchanged() {
    let Some(gpu) = gpu() else { return };
    let mut cpu = CpuBackend::new(images(9), config(LossConfig::default()), 3).unwrap();
    cpu.upload(learned_state(settings(), 25, 300, true, true)).unwrap();
    cpu.run(6, true, &mut |_| ControlFlow::Continue(())).unwrap();
    let trained = cpu.download().unwrap();
    let mut other = backend(&gpu, images(9), config(LossConfig::default()));
    other.upload(trained.clone()).unwrap();
    let returned = other.download().unwrap();
    let (a, b) = (module_of(&trained), module_of(&returned));
    assert_eq!((a.values, a.grid.len()), (b.values, b.grid.len()));
    for (a, b) in a.grid.iter().zip(&b.grid) {
        assert_eq!((&a.values, &a.means, &a.squares), (&b.values, &b.means, &b.squares));
    }
    assert_eq!(trained.splats, returned.splats);
}

#[test]
fn the_cpu_can_continue_after_the_device() {
    let Some(gpu) = gpu() else { return };
    let start = learned_state(settings(), 26, 400, true, true);
    let settings = config(LossConfig::default());
    let finish = |state: TrainState| {
        let mut cpu = CpuBackend::new(images(9), settings, 4).unwrap();
        cpu.upload(state).unwrap();
        let mut losses = Vec::new();
        cpu.run(6, true, &mut |s| {
            losses.push(s.loss);
            ControlFlow::Continue(())
        })
        .unwrap();
        (losses, cpu.download().unwrap())
    };
    let [cpu, gpu] = both(&gpu, &start, settings, 7);
    let ((a, cpu), (b, gpu)) = (finish(cpu), finish(gpu));
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-3 * a.abs()), "{a:?} {b:?}");
    let (a, b, start_values) = (module_of(&cpu), module_of(&gpu), module_of(&start));
    let (off, moved) = (distance(&b.values, &a.values), distance(&a.values, &start_values.values));
    assert!(off < 0.05 * moved, "values {off} of {moved}");
}

#[test]
fn noise_chooses_parts_as_often_as_they_are_likely_and_the_same_for_the_same_seed() {
    let Some(gpu) = gpu() else { return };
    let n = 4000;
    let weights = |gumbel: bool, hard_margin: f64| {
        let settings = AssignConfig {
            gumbel,
            hard_margin,
            start_temperature: 1.0,
            end_temperature: 1.0,
            divide_temperature_by_movable: false,
            ..settings()
        };
        let mut backend = backend(&gpu, images(9), config(LossConfig::default()));
        backend.upload(learned_state(settings, 27, n, true, false)).unwrap();
        backend.run(1, false, &mut |_| ControlFlow::Continue(())).unwrap();
        let resident = backend.resident.as_ref().unwrap();
        let weights = floats(&gpu, &resident.membership.as_ref().unwrap().weights, PARTS * n);
        (weights, backend.download().unwrap())
    };
    let ((likely, _), (chosen, first), (again, second)) = (weights(false, 0.0), weights(true, 1.0), weights(true, 1.0));
    assert!(chosen.iter().all(|&w| w == 0.0 || w == 1.0));
    for (k, (likely, chosen)) in likely.chunks_exact(n).zip(chosen.chunks_exact(n)).enumerate() {
        let sum = |row: &[f32]| row.iter().map(|&w| f64::from(w)).sum::<f64>();
        let deviation = likely.iter().map(|&w| f64::from(w * (1.0 - w))).sum::<f64>().sqrt();
        let off = (sum(likely) - sum(chosen)).abs();
        assert!(deviation > 5.0 && off < 4.0 * deviation, "part {k}: {off} with a deviation of {deviation}");
    }
    assert_eq!(chosen, again);
    assert_eq!(module_of(&first), module_of(&second));
    assert_eq!(parts_of(&first).joint_states(), parts_of(&second).joint_states());
}

#[test]
fn the_same_seed_gives_the_same_bytes_with_noise() {
    let Some(gpu) = gpu() else { return };
    let settings = AssignConfig { gumbel: true, ..settings() };
    let train = || {
        let mut backend = backend(&gpu, images(9), config(LossConfig::default()));
        backend.upload(learned_state(settings.clone(), 28, 300, true, true)).unwrap();
        backend.run(5, true, &mut |_| ControlFlow::Continue(())).unwrap();
        backend.download().unwrap()
    };
    let (a, b) = (train(), train());
    assert_eq!(a.splats, b.splats);
    assert_eq!(module_of(&a), module_of(&b));
}

#[test]
fn a_step_that_overflows_changes_no_parameters() {
    let Some(gpu) = gpu() else { return };
    let start = learned_state(AssignConfig { gumbel: true, ..settings() }, 29, 300, true, true);
    let run = |capacity: Option<usize>| {
        let mut backend = backend(&gpu, images(9), config(LossConfig::default()));
        backend.upload(start.clone()).unwrap();
        if let Some(capacity) = capacity {
            backend.reserve(capacity).unwrap();
        }
        backend.run(4, true, &mut |_| ControlFlow::Continue(())).unwrap();
        backend.download().unwrap()
    };
    let (large, small) = (run(None), run(Some(50)));
    assert_eq!(large.splats, small.splats);
    assert_eq!(module_of(&large), module_of(&small));
}

#[test]
fn other_kinds_of_assignment_are_errors_with_a_reason() {
    let Some(gpu) = gpu() else { return };
    for (kind, name) in [(AssignKind::Mlp, "mlp"), (AssignKind::Slots, "slots")] {
        let settings = AssignConfig { kind, ..settings() };
        let bounds = [[-1.0; 3], [1.0; 3]];
        let assignment = Assignment::new(settings, &[[0.0; 3]; PARTS], &[1.0; PARTS], bounds, &mut rng(30));
        let articulated = parts(Membership::Learned(Box::new(assignment)), true, true, None);
        let mut backend = backend(&gpu, images(9), config(LossConfig::default()));
        let error = backend.upload(state(splats(&mut rng(30), 50, 0), articulated)).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("--device cpu"), "{error}");
    }
}

#[test]
fn a_device_trains_different_kinds_of_states_in_turn() {
    let Some(gpu) = gpu() else { return };
    let mut backend = backend(&gpu, images(9), config(LossConfig::default()));
    let fixed = state(splats(&mut rng(31), 200, 2), articulated(&mut rng(31), 200, true, true));
    let states =
        [learned_state(settings(), 31, 200, true, true), fixed, learned_state(settings(), 31, 200, true, false)];
    for state in states {
        let pulled: &DeformConfig = parts_of(&state).config();
        let pulled = pulled.chamfer > 0.0;
        backend.upload(state).unwrap();
        let mut losses = Vec::new();
        backend
            .run(3, true, &mut |s| {
                losses.push(s.loss - s.terms.total);
                ControlFlow::Continue(())
            })
            .unwrap();
        assert!(!pulled || losses.iter().all(|l| *l > 1e-4), "{losses:?}");
        backend.download().unwrap();
    }
}

#[test]
fn targets_are_found_in_flat_and_empty_clouds_and_from_a_distance() {
    let Some(gpu) = gpu() else { return };
    let mut draw = rng(33);
    let mut plane = |n: usize| (0..n).map(|_| [draw.random(), draw.random_range(-0.9..0.9), 0.25]).collect::<Vec<_>>();
    let line: Vec<[f32; 3]> = (0..90).map(|i| [0.01 * i as f32, -0.3, 0.2]).collect();
    for (what, [start, end]) in [
        ("plane and nothing", [plane(900), vec![]]),
        ("line and point", [line, vec![[0.1, 0.2, 0.3]]]),
        ("distant one", [[plane(50), vec![[40.0, -7.0, 3.0]]].concat(), plane(1)]),
    ] {
        let mut far = splats(&mut rng(33), 300, 1);
        (far.means[5], far.means[6]) = ([30.0, 2.0, -50.0], [-0.3, 9.0, 0.1]);
        let labels = (0..300).map(|i| (i % PARTS) as u16).collect();
        let targets = Arc::new(ChamferTargets::new(&PerState::new(start, end)));
        let start = state(far, parts(Membership::Labels(labels), true, true, Some(targets)));
        let terms = |backend: &mut dyn Backend| {
            let mut terms = Vec::new();
            backend.upload(start.clone()).unwrap();
            let mut on_step = |s: StepStats| {
                terms.push(s.loss - s.terms.total);
                ControlFlow::Continue(())
            };
            backend.run(4, true, &mut on_step).unwrap();
            terms
        };
        let settings = config(LossConfig::default());
        let want = terms(&mut CpuBackend::new(images(9), settings, 3).unwrap());
        let got = terms(&mut backend(&gpu, images(9), settings));
        let close = |a: f64, b: f64| (a - b).abs() <= 2e-4 * b.abs() + 1e-6;
        assert!(want.iter().any(|t| *t > 1.0), "{what}: {want:?}");
        assert!(got.iter().zip(&want).all(|(a, b)| close(*a, *b)), "{what}: {got:?} not {want:?}");
    }
}
