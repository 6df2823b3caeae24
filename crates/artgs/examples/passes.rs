//! Where a training step spends its time: the passes of the scene of the benchmarks, for every instruction set.
//! `cargo run --release -p artgs --example passes`
#![allow(clippy::print_stdout, clippy::unwrap_used)]

#[path = "../benches/common/mod.rs"]
mod common;

use artgs::fit::{AdamConfig, ImageLoss, LossConfig, RateConfig, Rect, SplatAdam};
use artgs::low_level::Ssim;
use artgs_raster::simd::{Instructions, use_instructions};
use artgs_raster::{PassSeconds, Rasterizer, RenderOptions, SplatGrads};
use common::{GAUSSIANS, ball, images};
use std::time::Instant;

const REPEATS: usize = 41;

fn median(mut seconds: Vec<f64>) -> f64 {
    seconds.sort_by(f64::total_cmp);
    seconds[seconds.len() / 2]
}

fn timed(seconds: &mut Vec<f64>, work: impl FnOnce()) {
    let begun = Instant::now();
    work();
    seconds.push(begun.elapsed().as_secs_f64());
}

fn table(size: u32) {
    let mut splats = ball(GAUSSIANS, 1);
    let image = images(size).swap_remove(0);
    let (options, config) = (RenderOptions::default(), LossConfig::default());
    let (mut raster, mut loss, mut grads) = (Rasterizer::new(), ImageLoss::new(), SplatGrads::default());
    let mut adam = SplatAdam::new(&splats);
    let rates = RateConfig { position_from: 1e-12, position_to: 1e-12, ..RateConfig::paper() }.at(0, 1, 1e-9);
    let (mut passes, mut losses, mut updates) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..REPEATS {
        raster.forward((&splats).into(), &image.camera, &options);
        timed(&mut losses, || {
            loss.evaluate(raster.frame(), &image, [0.1, 0.2, 0.3], &config, 1.0);
        });
        raster.backward((&splats).into(), &image.camera, &options, &loss.grad, &mut grads);
        passes.push(raster.seconds());
        timed(&mut updates, || adam.step(&mut splats, &grads, &rates, 3, &AdamConfig::default()));
    }
    let (mut ssim, mut similarities) = (Ssim::new(), Vec::new());
    let (x, y) = (raster.frame().rgb.clone(), vec![0.5; raster.frame().rgb.len()]);
    let (side, mut d) = (size as usize, vec![0.0; x.len()]);
    for _ in 0..REPEATS {
        timed(&mut similarities, || {
            ssim.evaluate(&x, &y, (side, side), Rect::full(side, side), 0.2, &mut d);
        });
    }
    let pass = |f: fn(&PassSeconds) -> f64| median(passes.iter().map(f).collect());
    let rate = |seconds: f64| format!("{:.2}e9 evaluations/s", raster.evaluations() as f64 / seconds / 1e9);
    let rows = [
        ("project", pass(|p| p.project), String::new()),
        ("bin", pass(|p| p.bin), format!("{} intersections", raster.intersections())),
        ("blend", pass(|p| p.blend), rate(pass(|p| p.blend))),
        ("assemble", pass(|p| p.assemble), String::new()),
        ("losses", median(losses), format!("of which SSIM; {:.2} ms on the whole image", 1e3 * median(similarities))),
        ("blend back", pass(|p| p.blend_back), rate(pass(|p| p.blend_back))),
        ("gather, project back", pass(|p| p.gather), String::new()),
        ("Adam", median(updates), String::new()),
    ];
    let total: f64 = rows.iter().map(|r| r.1).sum();
    for (name, seconds, note) in rows {
        println!("  {name:22} {:7.2} ms {:4.0} %  {note}", 1e3 * seconds, 100.0 * seconds / total);
    }
    println!("  {:22} {:7.2} ms", "step", 1e3 * total);
}

fn main() {
    for instructions in Instructions::ALL.into_iter().skip(1).filter(|i| use_instructions(*i)) {
        for size in [400, 800] {
            println!("{instructions:?}, {size} x {size}, {GAUSSIANS} Gaussians");
            table(size);
        }
    }
}
