//! Time of a training step on a graphics processor, and the share of each kernel.
//!
//! `cargo run --release -p artgs-gpu --example step -- [DEVICE] [PIXELS,... GAUSSIANS,...]`; without a device the most capable
//! one. Prints, for every size of images and number of Gaussians (four parts, motions learned), the mean time of a step, the
//! memory in use, and the share of each kernel.
#![allow(clippy::print_stdout, clippy::unwrap_used, missing_docs)]

#[path = "../../artgs/benches/common/mod.rs"]
mod common;

use artgs::fit::{Backend, TrainState};
use artgs_gpu::{Gpu, GpuDevices};
use std::ops::ControlFlow;
use std::time::Instant;

/// Steps before the measurement, in which buffers and batches grow.
const WARM_UP: usize = 200;
const STEPS: usize = 400;
/// Most seconds for one size; slow devices run fewer steps.
const MAX_SECONDS: f64 = 20.0;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let numbers = |i: usize, default: &str| -> Vec<usize> {
        let text = arguments.get(i).map_or(default, String::as_str);
        text.split(',').map(|v| v.parse().expect("numbers, with commas between them")).collect()
    };
    let gpu = Gpu::open(arguments.first().map(|d| d.parse().expect("the number of a device")), true).unwrap();
    println!("{}", gpu.name);
    let devices = GpuDevices::new(gpu).unwrap();
    println!("| pixels | Gaussians | ms per step | MiB |\n|---|---|---|---|");
    let mut shares = Vec::new();
    for pixels in numbers(1, "400,800,1600") {
        for gaussians in numbers(2, "30000,100000,300000") {
            let splats = common::ball(gaussians, 1);
            let deformation = common::articulated(&splats, 4);
            let mut backend = devices.train(common::images(pixels as u32), common::train_config(), 1).unwrap();
            backend.upload(TrainState { deformation, ..TrainState::new(splats) }).unwrap();
            let mut run = |steps: usize| backend.run(steps, true, &mut |_| ControlFlow::Continue(())).unwrap();
            let clock = Instant::now();
            run(1);
            let slow = clock.elapsed().as_secs_f64() > 0.2;
            if !slow {
                run(WARM_UP);
            }
            let steps =
                if slow { (MAX_SECONDS / clock.elapsed().as_secs_f64()) as usize } else { STEPS }.clamp(1, STEPS);
            let clock = Instant::now();
            run(steps);
            let each = 1e3 * clock.elapsed().as_secs_f64() / steps as f64;
            let memory = backend.allocated().map_or("?".into(), |bytes| (bytes >> 20).to_string());
            println!("| {pixels} | {gaussians} | {each:.3} | {memory} |");
            shares.push((pixels, gaussians, backend.profile()));
        }
    }
    for (pixels, gaussians, profile) in shares {
        println!("\n{pixels} x {pixels}, {gaussians} Gaussians:");
        match profile {
            Ok(profile) => {
                let total: f64 = profile.values().map(|v| v.0).sum();
                for (name, (ms, calls)) in profile {
                    println!("  {name:<14} {ms:8.3} ms {:5.1} %  ({calls})", 100.0 * ms / total);
                }
                println!("  all            {total:8.3} ms");
            }
            Err(reason) => println!("  {reason}"),
        }
    }
}
