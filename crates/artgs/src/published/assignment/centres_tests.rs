use super::super::HashGridConfig;
use super::*;
use crate::articulation::model::quaternion::dot;

const PARTS: usize = 3;

fn config() -> AssignConfig {
    let grid =
        HashGridConfig { levels: 4, log2_entries: 8, base_resolution: 4.0, initial_range: 0.3, ..Default::default() };
    AssignConfig { grid, initial_levels: 4, ..Default::default() }
}

fn points(n: usize) -> Vec<[f32; 3]> {
    let mut rng = Pcg64Mcg::new(11);
    (0..n).map(|_| std::array::from_fn(|_| 2.0 * rng.random::<f32>() - 1.0)).collect()
}

/// A module with nothing symmetric about it.
fn module(config: AssignConfig) -> PartAssignment {
    let centres = [[0.0, 0.1, -0.1], [0.5, -0.2, 0.3], [-0.4, 0.6, 0.1]];
    let mut rng = Pcg64Mcg::new(2);
    let bounds = [[-1.0; 3], [1.0; 3]];
    let mut m = PartAssignment::new(config, &centres, &[0.9, 0.6, 0.7], bounds, &mut rng);
    for f in m.frames.chunks_exact_mut(FRAME) {
        f[3..].iter_mut().for_each(|v| *v += 0.3 * (rng.random::<f32>() - 0.5));
    }
    m
}

/// Soft weights `[n][K]` in f64 from the equations at the head of the file.
fn twin(m: &PartAssignment, params: &[f64], points: &[[f32; 3]], seed: u64, inverse_temperature: f64) -> Vec<f64> {
    let (frames, mlp) = params.split_at(PARTS * FRAME);
    let inputs = 4 * PARTS + FEATURES * m.grid.levels() + 3;
    let (b1, w2) = (32 * inputs, 33 * inputs - inputs + 32);
    let b2 = w2 + 2 * PARTS * 32;
    let mut weights = Vec::new();
    for (block, chunk) in points.chunks(LANES).enumerate() {
        let mut noise = gumbel(seed, block);
        for &x in chunk {
            let (mut input, mut squares) = (Vec::new(), Vec::new());
            for f in frames.chunks_exact(FRAME) {
                let q = glam::DQuat::from_xyzw(f[7], f[8], f[9], f[6]).normalize();
                let y = q * glam::DVec3::from_array(std::array::from_fn(|a| f64::from(x[a]) - f[a]));
                let local: [f64; 3] = std::array::from_fn(|a| y[a] / f[3 + a].exp());
                squares.push(dot(local, local));
                input.extend(local.into_iter().chain([dot(local, local).sqrt()]));
            }
            let at = m.coordinate(x);
            (0..m.grid.levels()).for_each(|l| input.extend(m.grid.features(l, at).map(f64::from)));
            input.extend(at.map(f64::from));
            let hidden: Vec<f64> = (0..32)
                .map(|h| mlp[b1 + h] + (0..inputs).map(|i| mlp[h * inputs + i] * input[i]).sum::<f64>())
                .map(|v| v.max(0.0))
                .collect();
            let out = |o: usize| mlp[b2 + o] + (0..32).map(|h| mlp[w2 + o * 32 + h] * hidden[h]).sum::<f64>();
            let scores: Vec<f64> = (0..PARTS)
                .map(|k| -squares[k] * (0.5 * out(2 * k)).exp() + 0.5 * out(2 * k + 1) + f64::from(noise()))
                .map(|logit| (logit * inverse_temperature).exp())
                .collect();
            let sum: f64 = scores.iter().sum();
            weights.extend(scores.iter().map(|s| s / sum));
        }
    }
    weights
}

fn parameters(m: &PartAssignment) -> Vec<f64> {
    m.frames.iter().chain(m.mlp.params()).map(|&v| f64::from(v)).collect()
}

/// The seed that `forward` draws.
fn seed() -> u64 {
    Pcg64Mcg::new(4).random()
}

#[test]
fn schedule_turns_hard_at_the_published_step() {
    let c = AssignConfig::default();
    assert!(!c.is_hard(9787) && c.is_hard(9788) && c.is_hard(20_000));
    assert!((c.temperature(0) - 1.0).abs() < 1e-12 && (c.temperature(5000) - 0.55).abs() < 1e-12);
    assert!((c.temperature(15_000) - 0.1).abs() < 1e-12);
    assert!((c.inverse_temperature(20_000, PARTS) - 20.0).abs() < 1e-5);
}

#[test]
fn weights_match_a_scalar_twin() {
    for c in [config(), AssignConfig { normalise_coordinates: true, ..config() }] {
        let (mut m, x) = (module(c), points(300));
        let mut weights = vec![0.0; x.len() * PARTS];
        m.forward(&x, 4000, &mut Pcg64Mcg::new(4), &mut weights);
        let expected = twin(&m, &parameters(&m), &x, seed(), m.inverse_temperature.into());
        for (a, b) in weights.iter().zip(&expected) {
            assert!((f64::from(*a) - b).abs() < 2e-5, "{a} {b}");
        }
    }
}

#[test]
fn gradients_match_finite_differences_soft_and_straight_through() {
    for step in [4000, 10_000] {
        let (mut m, x) = (module(config()), points(300));
        let mut weights = vec![0.0; x.len() * PARTS];
        m.forward(&x, step, &mut Pcg64Mcg::new(4), &mut weights);
        assert_eq!(step == 10_000, weights.iter().all(|w| *w == 0.0 || *w == 1.0));
        let g: Vec<f32> = (0..weights.len()).map(|i| ((i * 37) % 11) as f32 / 5.0 - 1.0).collect();
        m.backward(&g);
        let t = f64::from(m.inverse_temperature);
        let loss = |m: &PartAssignment, p: &[f64]| -> f64 {
            twin(m, p, &x, seed(), t).iter().zip(&g).map(|(w, &g)| w * f64::from(g)).sum()
        };
        let mut p = parameters(&m);
        let largest = m.gradient.iter().fold(0.0f64, |a, g| a.max(g.abs()));
        for i in (0..PARTS * FRAME).chain((PARTS * FRAME..p.len()).step_by(23)) {
            let at = p[i];
            p[i] = at + 1e-6;
            let up = loss(&m, &p);
            p[i] = at - 1e-6;
            let numeric = (up - loss(&m, &p)) / 2e-6;
            p[i] = at;
            assert!(
                (m.gradient[i] - numeric).abs() < 1e-4 * (largest + numeric.abs()),
                "{i}: {} {numeric}",
                m.gradient[i]
            );
        }
        let mut entries = Vec::new();
        m.grid.for_each_gradient(|l, e, g| entries.push((l, e, g[1])));
        assert!(entries.len() > 300);
        for (l, e, analytic) in entries.into_iter().step_by(41) {
            let [other, at] = m.grid.entry(l, e);
            let mut value = |v: f32| {
                m.grid.set_entry(l, e, [other, v]);
                loss(&m, &p)
            };
            let numeric = (value(at + 1e-3) - value(at - 1e-3)) / f64::from((at + 1e-3) - (at - 1e-3));
            value(at);
            assert!((f64::from(analytic) - numeric).abs() < 2e-3 * (1.0 + numeric.abs()), "{analytic} {numeric}");
        }
    }
}

#[test]
fn centre_regulariser_matches_finite_differences() {
    let (mut m, x) = (module(config()), points(50));
    let splats =
        Splats { logit_opacities: (0..x.len()).map(|i| i as f32 / 20.0 - 1.0).collect(), means: x, ..Splats::empty(0) };
    let mut weights: Vec<f32> = (0..50 * PARTS).map(|i| ((i * 29) % 17) as f32 / 17.0).collect();
    let mut d = vec![1.0; weights.len()];
    let loss = m.centre_regulariser(&splats, &weights, &mut d);
    let gradient = m.gradient.clone();
    let mut rest = vec![0.0; weights.len()];
    for i in 0..weights.len() {
        let (at, h) = (weights[i], 1.0 / 256.0);
        weights[i] = at + h;
        let up = m.centre_regulariser(&splats, &weights, &mut rest);
        weights[i] = at - h;
        let down = m.centre_regulariser(&splats, &weights, &mut rest);
        weights[i] = at;
        let numeric = (up - down) / (2.0 * f64::from(h));
        assert!((f64::from(d[i]) - 1.0 - numeric).abs() < 1e-6, "{} {numeric}", d[i] - 1.0);
    }
    for i in [0, 1, 2, FRAME, 2 * FRAME + 2] {
        m.frames[i] += 1e-2;
        let up = m.centre_regulariser(&splats, &weights, &mut rest);
        m.frames[i] -= 1e-2;
        // Quadratic: the forward difference is off by the curvature.
        let curvature = 0.1 / (3 * PARTS) as f64 * 1e-2;
        assert!(((up - loss) / 1e-2 - curvature - gradient[i]).abs() < 1e-6);
    }
}

#[test]
fn training_learns_a_split_with_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let x = points(3000);
            let mut rng = Pcg64Mcg::new(9);
            let centres = [[0.3, 0.0, 0.0], [-0.3, 0.0, 0.0]];
            let c = AssignConfig { temperature_steps: 150, ..AssignConfig::light() };
            let mut m = PartAssignment::new(c, &centres, &[1.0; 2], [[-1.0; 3], [1.0; 3]], &mut rng);
            let truth = |p: &[f32; 3]| usize::from(p[0] + 0.4 * p[1] > 0.1);
            let mut weights = vec![0.0; 2 * x.len()];
            for step in 0..200 {
                m.forward(&x, step, &mut rng, &mut weights);
                let d: Vec<f32> = x.iter().flat_map(|p| if truth(p) == 1 { [1.0, 0.0] } else { [0.0, 1.0] }).collect();
                m.backward(&d);
                m.step(1e-2);
            }
            let labels = m.labels(&x);
            let wrong = x.iter().zip(&labels).filter(|(p, l)| truth(p) != usize::from(**l)).count();
            assert!(wrong < 120, "{wrong} of 3000 on the wrong side");
            (labels, weights, m.frames)
        })
    };
    assert!(run(1) == run(3));
}
