//! A whole training step: draw, compare (L1, SSIM, depth), carry back, update. Harmonics of degree 3.

mod common;

use artgs::fit::Backend;
use common::{GAUSSIANS, trainer};
use divan::Bencher;
use std::ops::ControlFlow;

fn main() {
    divan::main();
}

fn bench(bencher: Bencher<'_, '_>, size: u32, gaussians: usize, parts: Option<usize>) {
    let mut trainer = trainer(size, gaussians, parts);
    let mut step = || trainer.run(1, true, &mut |_| ControlFlow::Continue(())).unwrap_or_default();
    step();
    bencher.bench_local(step);
}

/// One state, 30,000 Gaussians on a fifth of the pixels.
#[divan::bench(args = [200, 400, 800, 1600])]
fn pixels(bencher: Bencher<'_, '_>, size: u32) {
    bench(bencher, size, GAUSSIANS, None);
}

/// At 400 x 400.
#[divan::bench(args = [10_000, 30_000, 100_000])]
fn gaussians(bencher: Bencher<'_, '_>, gaussians: usize) {
    bench(bencher, 400, gaussians, None);
}

/// Two states, motions learned, at 400 x 400.
#[divan::bench(args = [2, 4, 7, 12])]
fn parts(bencher: Bencher<'_, '_>, parts: usize) {
    bench(bencher, 400, GAUSSIANS, Some(parts));
}
