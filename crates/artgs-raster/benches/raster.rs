//! Speed of one step: 30,000 Gaussians on a bumpy ball that fills about a fifth of the image, harmonics of degree 3.
//! `items` are Gaussian-pixel evaluations.

use artgs_core::{Camera, Intrinsics, Splats};
use artgs_raster::{FrameGrad, Rasterizer, RenderOptions, SplatGrads};
use divan::{Bencher, counter::ItemsCount};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

const GAUSSIANS: usize = 30_000;
const SEED: u64 = 30_000;

fn main() {
    divan::main();
}

fn camera(size: u32) -> Camera {
    let (f, c) = (1.1 * f64::from(size), 0.5 * f64::from(size));
    let k = Intrinsics { fx: f, fy: f, cx: c, cy: c, width: size, height: size };
    Camera::look_at(k, DVec3::new(2.9, -3.2, 1.4), DVec3::ZERO, DVec3::Z)
}

fn splats() -> Splats {
    let mut rng = Pcg64Mcg::seed_from_u64(SEED);
    let mut s = Splats::empty(3);
    while s.len() < GAUSSIANS {
        let p = DVec3::from([0; 3].map(|_| rng.random_range(-1.0..1.0)));
        if !(0.1..1.0).contains(&p.length()) {
            continue;
        }
        let radius = 1.0 + 0.03 * rng.random_range(-1.0..1.0);
        s.means.push((radius * p.normalize()).as_vec3().to_array());
        s.rotations.push([0; 4].map(|_| rng.random_range(-1.0..1.0)));
        s.log_scales.push([0; 3].map(|_| rng.random_range(-5.3..-3.9)));
        s.logit_opacities.push(rng.random_range(-1.5..4.0));
        s.sh.extend((0..s.sh_stride()).map(|_| rng.random_range(-0.2..0.2f32)));
    }
    s
}

fn gradient(size: u32) -> FrameGrad {
    let mut rng = Pcg64Mcg::seed_from_u64(SEED);
    let n = (size * size) as usize;
    let mut plane = |n: usize| (0..n).map(|_| rng.random_range(-1.0..1.0)).collect();
    FrameGrad { rgb: plane(3 * n), depth: plane(n), alpha: plane(n) }
}

#[divan::bench(args = [400, 800])]
fn forward(bencher: Bencher<'_, '_>, size: u32) {
    let (s, camera, options) = (splats(), camera(size), RenderOptions::default());
    let mut raster = Rasterizer::new();
    raster.forward((&s).into(), &camera, &options);
    let work = raster.evaluations();
    bencher.counter(ItemsCount::new(work)).bench_local(|| {
        raster.forward((&s).into(), &camera, &options);
    });
}

#[divan::bench(args = [400, 800])]
fn backward(bencher: Bencher<'_, '_>, size: u32) {
    let (s, camera, options, d) = (splats(), camera(size), RenderOptions::default(), gradient(size));
    let (mut raster, mut grads) = (Rasterizer::new(), SplatGrads::default());
    raster.forward((&s).into(), &camera, &options);
    let work = raster.evaluations();
    bencher.counter(ItemsCount::new(work)).bench_local(|| {
        raster.backward((&s).into(), &camera, &options, &d, &mut grads);
    });
}
