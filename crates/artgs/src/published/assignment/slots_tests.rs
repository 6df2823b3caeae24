use super::*;
use crate::published::assignment::encoder_testing::{config, hash_input, perceptron, points, seed, softmax_rows};

const PARTS: usize = 3;
const WIDTH: usize = 6;

fn small() -> AssignConfig {
    AssignConfig { slots: crate::published::SlotConfig { width: WIDTH, iterations: 2 }, ..config() }
}

fn module(config: AssignConfig) -> SlotAssignment {
    SlotAssignment::new(config, PARTS, [[-1.0; 3], [1.0; 3]], &mut Pcg64Mcg::new(2))
}

fn normed(x: &[f64]) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let variance = x.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / x.len() as f64;
    x.iter().map(|v| (v - mean) / (variance + 1e-5).sqrt()).collect()
}

/// Takes matrices off the front of the parameters, in the order of the published description.
struct Reader<'a>(&'a [f64]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> &'a [f64] {
        let (head, tail) = self.0.split_at(n);
        self.0 = tail;
        head
    }
}

fn times(w: &[f64], x: &[f64]) -> Vec<f64> {
    w.chunks_exact(x.len()).map(|r| r.iter().zip(x).map(|(a, b)| a * b).sum()).collect()
}

fn plus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// Soft weights `[n][K]` in f64 with keys and values of every point, as slot attention is described.
fn twin(m: &SlotAssignment, p: &[f64], x: &[[f32; 3]]) -> Vec<f64> {
    let (mlp, slots) = p.split_at(m.encoder.mlp.params().len());
    let (mut r, d) = (Reader(slots), WIDTH);
    let mut slots: Vec<Vec<f64>> = r.take(PARTS * d).chunks(d).map(<[f64]>::to_vec).collect();
    let [wq, bq, wk, wv, bv] = [d * d, d, d * d, d * d, d].map(|n| r.take(n));
    let [wi, bi, wh, bh] = [3 * d * d, 3 * d, 3 * d * d, 3 * d].map(|n| r.take(n));
    let [m1, c1, m2, c2] = [2 * d * d, 2 * d, 2 * d * d, d].map(|n| r.take(n));
    assert!(r.0.is_empty());
    let features: Vec<Vec<f64>> =
        hash_input(&m.encoder, x).iter().map(|i| normed(&perceptron(mlp, i, m.config.hidden, d))).collect();
    let logits = |slots: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let queries: Vec<Vec<f64>> = slots.iter().map(|s| plus(&times(wq, &normed(s)), bq)).collect();
        let of = |n: &Vec<f64>| {
            let key = times(wk, n);
            let dot = |q: &Vec<f64>| q.iter().zip(&key).map(|(a, b)| a * b).sum::<f64>() / (d as f64).sqrt();
            queries.iter().map(dot).collect()
        };
        features.iter().map(of).collect()
    };
    let sigmoid = |v: f64| 1.0 / (1.0 + (-v).exp());
    for _ in 0..m.config.slots.iterations {
        let shares = softmax_rows(&logits(&slots), None, 1.0);
        for k in 0..PARTS {
            let (mut sum, mut mass) = (vec![0.0; d], 1e-8);
            for (i, n) in features.iter().enumerate() {
                let share = shares[i * PARTS + k];
                mass += share;
                let value = plus(&times(wv, n), bv);
                sum.iter_mut().zip(value).for_each(|(s, v)| *s += share * v);
            }
            let update: Vec<f64> = sum.iter().map(|s| s / mass).collect();
            let (input, state) = (plus(&times(wi, &update), bi), plus(&times(wh, &slots[k]), bh));
            let after: Vec<f64> = (0..d)
                .map(|i| {
                    let (reset, keep) = (sigmoid(input[i] + state[i]), sigmoid(input[d + i] + state[d + i]));
                    (1.0 - keep) * (input[2 * d + i] + reset * state[2 * d + i]).tanh() + keep * slots[k][i]
                })
                .collect();
            let hidden: Vec<f64> = plus(&times(m1, &normed(&after)), c1).iter().map(|v| v.max(0.0)).collect();
            slots[k] = plus(&after, &plus(&times(m2, &hidden), c2));
        }
    }
    softmax_rows(&logits(&slots), Some(seed()), m.inverse_temperature.into())
}

#[test]
fn weights_and_gradients_match_a_twin_and_finite_differences() {
    for step in [4000, 10_000] {
        let (mut m, x) = (module(small()), points(300));
        let mut weights = vec![0.0; x.len() * PARTS];
        m.forward(&x, step, &mut Pcg64Mcg::new(4), &mut weights);
        let mlp = m.encoder.mlp.params().iter().map(|&v| f64::from(v));
        let mut p: Vec<f64> = mlp.chain(m.params.iter().copied()).collect();
        let expected = twin(&m, &p, &x);
        if step == 10_000 {
            assert!(weights.iter().all(|w| *w == 0.0 || *w == 1.0));
        } else {
            assert!(weights.iter().zip(&expected).all(|(a, b)| (f64::from(*a) - b).abs() < 5e-5));
        }
        let g: Vec<f32> = (0..weights.len()).map(|i| ((i * 37) % 11) as f32 / 5.0 - 1.0).collect();
        m.backward(&g);
        let loss = |m: &SlotAssignment, p: &[f64]| -> f64 {
            twin(m, p, &x).iter().zip(&g).map(|(w, &g)| w * f64::from(g)).sum()
        };
        let split = m.encoder.mlp.params().len();
        for (range, stride) in [(0..split, 13), (split..p.len(), 5)] {
            let largest = m.gradient[range.clone()].iter().fold(0.0f64, |a, g| a.max(g.abs()));
            for i in range.step_by(stride) {
                let at = p[i];
                p[i] = at + 1e-5;
                let up = loss(&m, &p);
                p[i] = at - 1e-5;
                let numeric = (up - loss(&m, &p)) / 2e-5;
                p[i] = at;
                let gap = (m.gradient[i] - numeric).abs();
                assert!(gap < 3e-4 * (largest + numeric.abs()), "{i}: {} {numeric}", m.gradient[i]);
            }
        }
        /// Small enough that few hidden units turn on or off within it.
        const STEP: f32 = 2e-4;
        let mut entries = Vec::new();
        m.encoder.grid.for_each_gradient(|l, e, g| entries.push((l, e, g[1])));
        assert!(entries.len() > 300);
        for (l, e, analytic) in entries.into_iter().step_by(41) {
            let [other, at] = m.encoder.grid.entry(l, e);
            let mut value = |v: f32| {
                m.encoder.grid.set_entry(l, e, [other, v]);
                loss(&m, &p)
            };
            let numeric = (value(at + STEP) - value(at - STEP)) / f64::from((at + STEP) - (at - STEP));
            value(at);
            assert!((f64::from(analytic) - numeric).abs() < 3e-3 * (1.0 + numeric.abs()), "{analytic} {numeric}");
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
            assert!(wrong < 150, "{wrong} of 3000 on the wrong side");
            (labels, weights)
        })
    };
    assert!(run(1) == run(3));
}
