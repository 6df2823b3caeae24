//! Wall times of the method's heavier pieces. Run with `cargo test -p artgs --test timings -- --ignored --nocapture`.

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use artgs::low_level::*;
use artgs::low_level::{ClusterConfig, analyse, farthest_points, match_points, spectral_clusters};
use artgs_core::Rigid;
use glam::DVec3;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use std::time::Instant;

/// Processor time of all threads so far, seconds; zero where the system does not report it.
fn processor() -> f64 {
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let of = |task: std::fs::DirEntry| -> Option<f64> {
        let text = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse().ok()
    };
    tasks.filter_map(of).sum::<f64>() * 1e-9
}

fn time<T>(what: &str, mut run: impl FnMut() -> T) -> T {
    let mut best = [f64::INFINITY; 2];
    let mut last = run();
    for _ in 0..3 {
        let (start, used) = (Instant::now(), processor());
        last = run();
        best = [best[0].min(start.elapsed().as_secs_f64()), best[1].min(processor() - used)];
    }
    println!("{what:60} wall {:9.2} ms, processor {:9.2} ms", 1e3 * best[0], 1e3 * best[1]);
    last
}

/// Points on the surfaces of a few unit boxes.
fn surface(n: usize, rng: &mut Pcg64Mcg) -> Vec<[f32; 3]> {
    (0..n)
        .map(|i| {
            let face = rng.random_range(0..6usize);
            let mut u: [f32; 3] = std::array::from_fn(|_| 0.6 * rng.random::<f32>());
            u[face / 2] = 0.6 * (face % 2) as f32;
            u[0] += (i % 3) as f32 - 1.0;
            u
        })
        .collect()
}

#[test]
#[ignore = "measures"]
fn timings() {
    let mut rng = Pcg64Mcg::new(1);
    let large = surface(200_000, &mut rng);
    time("farthest points 200000 -> 5000", || farthest_points(&large, 5000));
    let a = surface(5000, &mut rng);
    let near: Vec<[f32; 3]> = a.iter().rev().map(|p| p.map(|c| c + 0.03 * (rng.random::<f32>() - 0.5))).collect();
    time("matching 5000, noisy copy", || match_points(&a, &near));
    let fa: Vec<[f32; 3]> = farthest_points(&large, 5000).into_iter().map(|i| large[i]).collect();
    let moved: Vec<[f32; 3]> =
        surface(200_000, &mut rng).iter().map(|p| if p[0] > 0.9 { [p[0], p[1] + 0.5, p[2]] } else { *p }).collect();
    let fb: Vec<[f32; 3]> = farthest_points(&moved, 5000).into_iter().map(|i| moved[i]).collect();
    time("matching 5000, one of three parts moved", || match_points(&fa, &fb));
    let random =
        |rng: &mut Pcg64Mcg| -> Vec<[f32; 3]> { (0..5000).map(|_| std::array::from_fn(|_| rng.random())).collect() };
    let (ra, rb) = (random(&mut rng), random(&mut rng));
    time("matching 5000, random", || match_points(&ra, &rb));
    time("motion analysis 200000 both ways", || analyse(artgs_core::PerState::new(&large, &moved)).unwrap());
    time("clusters, graph 5000", || {
        spectral_clusters(&a, 3, &ClusterConfig::default(), &mut Pcg64Mcg::new(1)).unwrap()
    });
    time("clusters, graph 200000 thinned to 5000", || {
        spectral_clusters(&large, 3, &ClusterConfig::default(), &mut Pcg64Mcg::new(1)).unwrap()
    });
    time("clusters, dense 2500", || spectral_clusters(&a, 3, &ClusterConfig::paper(), &mut Pcg64Mcg::new(1)).unwrap());

    let (n, k) = (50_000, 4);
    let means = surface(n, &mut rng);
    let rotations = vec![[1.0, 0.1, 0.2, 0.3]; n];
    let motions: Vec<DualQuaternion> =
        (0..k).map(|i| Rigid::about(DVec3::Y, DVec3::X, 0.1 * f64::from(i)).into()).collect();
    let motions = &motions;
    let mut weights = vec![0.0; n * 4];
    for (name, config) in [("paper", AssignConfig::default()), ("light", AssignConfig::light())] {
        let centres = [[0.0; 3], [0.5; 3], [-0.5; 3], [0.1, 0.9, 0.2]];
        let mut m = PartAssignment::new(config, &centres, &[0.5; 4], [[-1.0; 3], [1.6; 3]], &mut rng);
        let d = vec![0.1; n * 4].iter().enumerate().map(|(i, v)| v * (i % 5) as f32).collect::<Vec<f32>>();
        time(&format!("{name}: assignment forward, 50000, K = 4"), || m.forward(&means, 5000, &mut rng, &mut weights));
        time(&format!("{name}: forward and backward"), || {
            m.forward(&means, 5000, &mut rng, &mut weights);
            m.backward(&d);
        });
        time(&format!("{name}: step"), || m.step(1e-3));
        time(&format!("{name}: labels"), || m.labels(&means));
    }
    let labels = vec![2u16; n];
    for (name, skin) in [("weights", Skin::Weights(&weights)), ("labels", Skin::Labels(&labels))] {
        let input = WarpInput { means: &means, rotations: &rotations, skin, motions, state: artgs_core::State::END };
        let mut warp = Warp::new(true);
        let (mut x, mut q) = (means.clone(), rotations.clone());
        time(&format!("warp forward, 50000, {name}"), || warp.forward(&input, &mut x, &mut q));
        let (mut gx, mut gq, mut gw, mut gm) =
            (means.clone(), rotations.clone(), vec![0.0; 4 * n], vec![DualQuaternion::IDENTITY; 4]);
        time(&format!("warp backward, 50000, {name}"), || {
            let out = WarpGradients { means: &mut gx, rotations: &mut gq, weights: Some(&mut gw), motions: &mut gm };
            warp.backward(&input, &x, &q, out);
        });
    }
}
