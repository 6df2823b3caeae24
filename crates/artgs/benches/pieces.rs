//! The pieces around the splats: sampling, matching, clustering, assignment to parts, fusion, loading.

mod common;

use artgs::low_level::farthest_points;
use artgs::low_level::match_points;
use artgs::low_level::{AssignConfig, PartAssignment};
use artgs::low_level::{ClusterConfig, spectral_clusters};
use artgs::surface::{FusionView, Selection, Tsdf, TsdfParams, marching_cubes};
use artgs_core::{JointKind, Rigid};
use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use common::{GAUSSIANS, ball, camera};
use divan::{Bencher, counter::BytesCount, counter::ItemsCount};
use glam::DVec3;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

fn main() {
    divan::main();
}

/// Two states of the same ball: other points, and a slice of it turned.
fn moved_clouds(points: usize) -> [Vec<[f32; 3]>; 2] {
    let turn = Rigid::about(DVec3::Z, DVec3::new(0.7, 0.7, 0.0), 0.5);
    let cloud = |seed: u64| {
        let all = ball(20 * points, seed).means;
        farthest_points(&all, points).into_iter().map(|i| all[i]).collect::<Vec<_>>()
    };
    let mut clouds = [cloud(1), cloud(2)];
    for p in clouds[1].iter_mut().filter(|p| p[0] > 0.4) {
        *p = turn.apply(DVec3::from(p.map(f64::from))).as_vec3().to_array();
    }
    clouds
}

/// 200,000 to 5,000 points.
#[divan::bench(sample_count = 10)]
fn farthest_point_sampling(bencher: Bencher<'_, '_>) {
    let points = ball(200_000, 1).means;
    bencher.bench_local(|| farthest_points(&points, 5000));
}

/// 5,000 pairs.
#[divan::bench(sample_count = 5)]
fn optimal_matching(bencher: Bencher<'_, '_>) {
    let [a, b] = moved_clouds(5000);
    bencher.bench_local(|| match_points(&a, &b));
}

/// 5,000 points into 6 clusters: the nearest-neighbour graph of the default, and the dense affinity of the paper.
#[divan::bench(args = ["graph", "dense"], sample_count = 5)]
fn clustering(bencher: Bencher<'_, '_>, kind: &str) {
    let [points, _] = moved_clouds(5000);
    let config = if kind == "graph" { ClusterConfig::default() } else { ClusterConfig::paper() };
    bencher.bench_local(|| spectral_clusters(&points, 6, &config, &mut Pcg64Mcg::seed_from_u64(1)));
}

/// Learnt assignment of 30,000 Gaussians to 7 parts, there and back with the optimiser: hash grid and perceptron.
#[divan::bench(args = ["paper", "light"])]
fn assignment(bencher: Bencher<'_, '_>, kind: &str) {
    let config = if kind == "paper" { AssignConfig::default() } else { AssignConfig::light() };
    let means = ball(GAUSSIANS, 1).means;
    let centres: Vec<[f32; 3]> = (0..7).map(|k| means[k * 4000]).collect();
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut parts = PartAssignment::new(config, &centres, &[0.5; 7], [[-1.1; 3], [1.1; 3]], &mut rng);
    let (mut weights, d) = (vec![0.0; 7 * GAUSSIANS], vec![0.1; 7 * GAUSSIANS]);
    let counter = ItemsCount::new(GAUSSIANS);
    bencher.counter(counter).bench_local(|| {
        parts.forward(&means, 10_000, &mut rng, &mut weights);
        parts.backward(&d);
        parts.step(1e-4);
    });
}

/// Depth of a ball of radius 0.65, exactly.
fn ball_depth(size: u32, turn: f64) -> (artgs_core::Camera, Vec<f32>) {
    let camera = camera(size, turn);
    let eye = camera.position();
    let depth = |i: u32| {
        let pixel = glam::DVec2::new(f64::from(i % size) + 0.5, f64::from(i / size) + 0.5);
        let ray = camera.unproject(pixel, 1.0) - eye;
        let (a, b, c) = (ray.length_squared(), ray.dot(eye), eye.length_squared() - 0.65 * 0.65);
        let root = b * b - a * c;
        if root > 0.0 { ((-b - root.sqrt()) / a) as f32 } else { 0.0 }
    };
    (camera, (0..size * size).map(depth).collect())
}

/// 64 depth maps of an object 1.3 wide: allocation, fusion and mesh. Size of the maps, and voxels per unit of length.
#[divan::bench(args = [(400, 100.0), (400, 200.0), (800, 100.0), (800, 200.0)], sample_count = 5)]
fn fusion(bencher: Bencher<'_, '_>, (size, resolution): (u32, f64)) {
    let maps: Vec<_> = (0..64).map(|i| ball_depth(size, 0.1 * f64::from(i))).collect();
    let views: Vec<FusionView> = maps.iter().map(|(camera, depth)| FusionView::new(*camera, depth)).collect();
    bencher.bench_local(|| {
        let mut volume = Tsdf::new(TsdfParams::with_voxel(1.0 / resolution));
        assert!(volume.allocate(&views, Selection::ALL, 1 << 20));
        volume.integrate(&views, Selection::ALL);
        marching_cubes(&volume, 0.1)
    });
}

/// 2 x 64 pairs of colour and depth PNGs.
#[divan::bench(args = [200, 400], sample_count = 5)]
fn loading(bencher: Bencher<'_, '_>, size: u32) {
    let folder = tempfile::tempdir().unwrap_or_else(|e| panic!("a temporary folder: {e}"));
    let options = CabinetOptions { views: 64, test_views: 0, size, ..CabinetOptions::default() };
    let (_, cabinet) = write_cabinet(folder.path(), &options).unwrap_or_else(|e| panic!("the cabinet: {e}"));
    assert!(cabinet.joints().any(|j| j.kind == JointKind::Revolute));
    let pixels = 128 * u64::from(size) * u64::from(size);
    bencher.counter(BytesCount::new(6 * pixels)).bench_local(|| artgs_io::load_capture(folder.path()));
}
