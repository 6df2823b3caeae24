//! Speed of one step: 30,000 Gaussians on a bumpy ball that fills about a fifth of the image, harmonics of degree 3.
//! `items` are Gaussian-pixel evaluations.

mod scene;

use artgs_raster::{FrameGrad, Rasterizer, RenderOptions, SplatGrads};
use divan::{Bencher, counter::ItemsCount};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use scene::{GAUSSIANS, ball, camera};

/// Of the Gaussians and of the gradients.
const SEED: u64 = 30_000;

fn main() {
    divan::main();
}

fn gradient(size: u32) -> FrameGrad {
    let mut rng = Pcg64Mcg::seed_from_u64(SEED);
    let n = (size * size) as usize;
    let mut plane = |n: usize| (0..n).map(|_| rng.random_range(-1.0..1.0)).collect();
    FrameGrad { rgb: plane(3 * n), depth: plane(n), alpha: plane(n) }
}

#[divan::bench(args = [400, 800])]
fn forward(bencher: Bencher<'_, '_>, size: u32) {
    let (s, camera, options) = (ball(GAUSSIANS, SEED), camera(size, 0.0), RenderOptions::default());
    let mut raster = Rasterizer::new();
    raster.forward((&s).into(), &camera, &options);
    let work = raster.evaluations();
    bencher.counter(ItemsCount::new(work)).bench_local(|| {
        raster.forward((&s).into(), &camera, &options);
    });
}

#[divan::bench(args = [400, 800])]
fn backward(bencher: Bencher<'_, '_>, size: u32) {
    let (s, camera, options, d) = (ball(GAUSSIANS, SEED), camera(size, 0.0), RenderOptions::default(), gradient(size));
    let (mut raster, mut grads) = (Rasterizer::new(), SplatGrads::default());
    raster.forward((&s).into(), &camera, &options);
    let work = raster.evaluations();
    bencher.counter(ItemsCount::new(work)).bench_local(|| {
        raster.backward((&s).into(), &camera, &options, &d, &mut grads);
    });
}
