//! Times the parts of a training step.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use artgs::fit::ssim::Ssim;
use artgs::fit::{
    AdamConfig, DepthPick, ImageLoss, InitKind, LossConfig, RateConfig, Rect, SingleConfig, SplatAdam, TrainImage,
    fit_single,
};
use artgs_raster::{Rasterizer, RenderOptions, SplatGrads, SplatView};
use std::time::Instant;

fn time(name: &str, mut f: impl FnMut()) {
    f();
    let mut best = f64::MAX;
    for _ in 0..12 {
        let start = Instant::now();
        f();
        best = best.min(start.elapsed().as_secs_f64());
    }
    println!("{name:32} {:8.2} ms", best * 1e3);
}

fn main() {
    let (w, h) = (800, 800);
    let x: Vec<f32> = (0..3 * w * h).map(|i| (i as f32 * 0.37).sin() * 0.5 + 0.5).collect();
    let y: Vec<f32> = (0..3 * w * h).map(|i| (i as f32 * 0.38).sin() * 0.5 + 0.5).collect();
    let (mut grad, mut ssim) = (vec![0.0; x.len()], Ssim::new());
    time("ssim 800x800x3", || {
        ssim.evaluate(&x, &y, w, h, Rect::full(w, h), -0.2, &mut grad);
    });
    let Some(path) = std::env::args().nth(1) else { return };
    let capture = artgs_io::load_capture(path.as_ref()).unwrap();
    let views = &capture.states[0].train;
    let config = SingleConfig { steps: 20, init: InitKind::Depth, ..SingleConfig::default() };
    let mut splats = fit_single(views, &config, 1, &mut |_| {}).unwrap();
    let image = TrainImage::new(&views[5], 0, 1, DepthPick::Median);
    println!("{} Gaussians, {} x {}", splats.len(), image.width, image.height);
    let (mut rasterizer, mut loss, mut grads) = (Rasterizer::new(), ImageLoss::new(), SplatGrads::default());
    for degree in 0..=2 {
        let options = RenderOptions { sh_degree: degree, ..RenderOptions::default() };
        time("forward", || {
            rasterizer.forward(SplatView::from(&splats), &image.camera, &options);
        });
        time("loss", || {
            loss.evaluate(rasterizer.frame(), &image, [0.1, 0.2, 0.3], &LossConfig::default(), 1.0);
        });
        time("backward", || {
            rasterizer.backward(SplatView::from(&splats), &image.camera, &options, &loss.grad, &mut grads);
        });
        let mut adam = SplatAdam::new(&splats);
        let rates = RateConfig { position_from: 1e-12, ..RateConfig::paper() }.at(0, 1, 1e-9);
        time("adam", || adam.step(&mut splats, &grads, &rates, degree, &AdamConfig::default()));
    }
}
