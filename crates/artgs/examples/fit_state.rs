//! Fits one state of a capture and prints scores and times: `fit_state CAPTURE start|end [CONFIG.toml]`.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

use artgs::fit::{Cpu, SingleConfig, StepStats, depth_error, fit_single, mean_score, score_views};
use artgs_core::State;
use std::time::Instant;

fn main() {
    let mut args = std::env::args().skip(1);
    let capture = artgs_io::load_capture(args.next().unwrap().as_ref()).unwrap();
    let name = args.next().unwrap();
    let state = State::ALL.into_iter().find(|state| state.name() == name).unwrap();
    let config: SingleConfig = match args.next().as_deref() {
        Some("paper") => SingleConfig::paper(),
        Some(file) => toml::from_str(&std::fs::read_to_string(file).unwrap()).unwrap(),
        None => SingleConfig::default(),
    };
    let views = &capture.states[state];
    let (start, mut first, mut last) = (Instant::now(), None, 0);
    let splats = fit_single(&views.train, &config, 1, &Cpu, &mut |s: StepStats| {
        first.get_or_insert_with(Instant::now);
        last = s.step;
        if s.step.is_multiple_of(100) || s.step == 1 {
            println!(
                "{:5} {:7.2?} loss {:.4} {:5.2} dB {} Gaussians",
                s.step,
                start.elapsed(),
                s.loss,
                s.psnr,
                s.gaussians
            );
        }
    })
    .unwrap();
    let stepping = first.unwrap().elapsed().as_secs_f64() / last as f64;
    let mean = mean_score(&score_views(&splats, &views.test));
    let depth = depth_error(&splats, &views.test);
    println!(
        "{:.2?} in all, {:.1} ms per step; held out: {:.2} dB, SSIM {:.4}, depth error {depth:.5?}",
        start.elapsed(),
        stepping * 1e3,
        mean.psnr,
        mean.ssim
    );
}
