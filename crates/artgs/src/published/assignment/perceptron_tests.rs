use super::*;
use crate::published::assignment::encoder_testing::{config, hash_input, perceptron, points, seed, softmax_rows};

const PARTS: usize = 3;

fn module(config: AssignConfig) -> MlpAssignment {
    MlpAssignment::new(config, PARTS, [[-1.0; 3], [1.0; 3]], &mut Pcg64Mcg::new(2))
}

/// Soft weights `[n][K]` in f64 from the equation at the head of the file.
fn twin(m: &MlpAssignment, mlp: &[f64], x: &[[f32; 3]]) -> Vec<f64> {
    let inputs = hash_input(&m.encoder, x);
    let logits: Vec<Vec<f64>> = inputs.iter().map(|i| perceptron(mlp, i, m.config.hidden, PARTS)).collect();
    softmax_rows(&logits, Some(seed()), m.inverse_temperature.into())
}

#[test]
fn weights_and_gradients_match_a_twin_and_finite_differences() {
    for (step, normalise_coordinates) in [(4000, false), (4000, true), (10_000, false)] {
        let (mut m, x) = (module(AssignConfig { normalise_coordinates, ..config() }), points(300));
        let mut weights = vec![0.0; x.len() * PARTS];
        m.forward(&x, step, &mut Pcg64Mcg::new(4), &mut weights);
        let mut p: Vec<f64> = m.encoder.mlp.params().iter().map(|&v| v.into()).collect();
        let expected = twin(&m, &p, &x);
        if step == 10_000 {
            assert!(weights.iter().all(|w| *w == 0.0 || *w == 1.0));
        } else {
            assert!(weights.iter().zip(&expected).all(|(a, b)| (f64::from(*a) - b).abs() < 2e-5));
        }
        let g: Vec<f32> = (0..weights.len()).map(|i| ((i * 37) % 11) as f32 / 5.0 - 1.0).collect();
        m.backward(&g);
        let loss = |m: &MlpAssignment, p: &[f64]| -> f64 {
            twin(m, p, &x).iter().zip(&g).map(|(w, &g)| w * f64::from(g)).sum()
        };
        let largest = m.gradient.iter().fold(0.0f64, |a, g| a.max(g.abs()));
        for i in (0..p.len()).step_by(7) {
            let at = p[i];
            p[i] = at + 1e-6;
            let up = loss(&m, &p);
            p[i] = at - 1e-6;
            let numeric = (up - loss(&m, &p)) / 2e-6;
            p[i] = at;
            assert!((m.gradient[i] - numeric).abs() < 1e-4 * (largest + numeric.abs()), "{i}: {numeric}");
        }
        let mut entries = Vec::new();
        m.encoder.grid.for_each_gradient(|l, e, g| entries.push((l, e, g[1])));
        assert!(entries.len() > 300);
        for (l, e, analytic) in entries.into_iter().step_by(41) {
            let [other, at] = m.encoder.grid.entry(l, e);
            let mut value = |v: f32| {
                m.encoder.grid.set_entry(l, e, [other, v]);
                loss(&m, &p)
            };
            let numeric = (value(at + 1e-3) - value(at - 1e-3)) / f64::from((at + 1e-3) - (at - 1e-3));
            value(at);
            assert!((f64::from(analytic) - numeric).abs() < 2e-3 * (1.0 + numeric.abs()), "{analytic} {numeric}");
        }
    }
}

#[test]
fn training_learns_a_split_with_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut m = module(AssignConfig { temperature_steps: 150, ..AssignConfig::light() });
            let mut rng = Pcg64Mcg::new(9);
            let (x, mut weights) = (points(3000), vec![0.0; 3000 * PARTS]);
            let truth = |p: &[f32; 3]| usize::from(p[0] + 0.4 * p[1] > 0.1);
            for step in 0..200 {
                m.forward(&x, step, &mut rng, &mut weights);
                let price = |p: &[f32; 3]| std::array::from_fn::<f32, PARTS, _>(|k| f32::from(u8::from(k != truth(p))));
                m.backward(&x.iter().flat_map(price).collect::<Vec<f32>>());
                m.step(1e-2);
            }
            let labels = m.labels(&x);
            let wrong = x.iter().zip(&labels).filter(|(p, l)| truth(p) != usize::from(**l)).count();
            assert!(wrong < 120, "{wrong} of 3000 on the wrong side");
            (labels, weights)
        })
    };
    assert!(run(1) == run(3));
}
