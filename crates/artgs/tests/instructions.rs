//! Every instruction set of this machine computes alike: similarity, Adam, perceptron, matching and whole training steps.
//! One test, as the choice is process-wide.

use artgs::fit::{AdamConfig, Cpu, InitKind, Moments, Rect, SingleConfig, StepStats, fit_single};
use artgs::low_level::Ssim;
use artgs::low_level::adam;
use artgs::low_level::match_points;
use artgs::low_level::{LANES, Mlp};
use artgs_core::View;
use artgs_raster::simd::{Instructions, use_instructions};
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Largest difference from the plain code, relative to the largest number of the same kind.
const TOLERANCE: f64 = 2e-5;
/// The same for losses: the first steps of Adam have a fixed length, and where a gradient is all rounding, so is their
/// direction.
const TRAINING_TOLERANCE: f64 = 1e-3;

fn numbers(n: usize, seed: u64) -> Vec<f32> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    (0..n).map(|_| rng.random_range(-1.0..1.0)).collect()
}

fn similarity() -> Vec<f32> {
    let (w, h) = (213, 150);
    let (x, y, mut grad) = (numbers(3 * w * h, 1), numbers(3 * w * h, 2), vec![0.0; 3 * w * h]);
    let value = Ssim::new().evaluate(&x, &y, (w, h), Rect { x0: 7, y0: 3, x1: 204, y1: 149 }, 1e4, &mut grad);
    grad.push(value as f32);
    grad
}

fn optimised() -> Vec<f32> {
    let (mut values, mut moments) = (numbers(1000, 3), Moments::zeros(1000));
    for step in 1..5 {
        adam(&mut values, &numbers(1000, 3 + step), &mut moments, 0.1, step as usize, &AdamConfig::default());
    }
    values
}

fn perceived() -> Vec<f32> {
    let mlp = Mlp::new(9, 16, 5, &mut Pcg64Mcg::seed_from_u64(7));
    let (x, d_out) = (numbers(9 * LANES, 8), numbers(5 * LANES, 9));
    let (mut hidden, mut out) = (vec![0.0; 16 * LANES], vec![0.0; 5 * LANES]);
    mlp.forward(&x, &mut hidden, &mut out);
    let (mut d_hidden, mut d_x) = (vec![0.0; 16 * LANES], vec![0.0; 9 * LANES]);
    let mut gradient = vec![0.0; mlp.params().len()];
    mlp.backward(&mlp.transposed(), (&x, &hidden), &d_out, &mut d_hidden, &mut d_x, &mut gradient);
    [out, d_x, gradient].concat()
}

/// Lengths of the pairs, so that ties may go either way.
fn matched() -> Vec<f32> {
    let cloud = |seed| -> Vec<[f32; 3]> { numbers(900, seed).chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect() };
    let (a, b) = (cloud(10), cloud(11));
    let length = |(i, j): (usize, usize)| (0..3).map(|k| (a[i][k] - b[j][k]).powi(2)).sum::<f32>().sqrt();
    vec![match_points(&a, &b).into_iter().enumerate().map(length).sum()]
}

/// Losses of the first steps of a training: rasteriser, losses and optimiser together.
fn trained(views: &[View]) -> Vec<f32> {
    let config = SingleConfig { steps: 6, init: InitKind::Depth, ..SingleConfig::default() };
    let mut losses = Vec::new();
    fit_single(views, &config, 1, &Cpu, &mut |s: StepStats| losses.push(s.loss as f32))
        .expect("the views can be trained on");
    losses
}

#[test]
fn instruction_sets_agree_with_plain_code() {
    let options = CabinetOptions { views: 6, size: 64, ..CabinetOptions::default() };
    let views =
        cabinet_capture(&options).expect("the cabinet is drawn").0.states[artgs_core::State::START].train.clone();
    let mut results = Vec::new();
    for instructions in Instructions::ALL {
        if !use_instructions(instructions) {
            eprintln!("this machine has no {instructions:?}");
            continue;
        }
        let all = [
            ("similarity", similarity()),
            ("Adam", optimised()),
            ("perceptron", perceived()),
            ("matching", matched()),
            ("training", trained(&views)),
        ];
        results.push((instructions, all));
    }
    let (plain, want) = results.pop().expect("plain code is always there");
    assert_eq!(plain, Instructions::Scalar);
    for (instructions, got) in &results {
        for ((name, want), (_, got)) in want.iter().zip(got) {
            assert_eq!(want.len(), got.len(), "{instructions:?}: {name}");
            let scale = want.iter().fold(0.0, |m: f64, v| m.max(f64::from(v.abs())));
            let worst = want.iter().zip(got).fold(0.0, |m: f64, (a, b)| m.max(f64::from((a - b).abs())));
            let tolerance = if *name == "training" { TRAINING_TOLERANCE } else { TOLERANCE };
            assert!(scale > 0.0 && worst <= tolerance * scale, "{instructions:?}: {name}: {worst} of {scale}");
        }
    }
}
