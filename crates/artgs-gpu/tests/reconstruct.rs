//! A small reconstruction on a graphics processor, compared with the same one on the CPU.

use artgs::fit::{Cpu, Devices};
use artgs::observer::NullObserver;
use artgs::{Config, Prepared, Reconstruction};
use artgs_core::{Capture, State};
use artgs_gpu::{Gpu, GpuDevices, GpuError};
use artgs_io::RunFolder;
use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use std::path::Path;

#[allow(clippy::print_stderr)]
fn device() -> Option<GpuDevices> {
    match Gpu::open(None, true) {
        Ok(gpu) => Some(GpuDevices::new(gpu).expect("the kernels compile")),
        Err(reason @ GpuError::None) if std::env::var_os("ARTGS_REQUIRE_GPU").is_none() => {
            eprintln!("SKIPPED: {reason}");
            None
        }
        Err(reason) => panic!("{reason}"),
    }
}

fn cabinet(dir: &Path) -> Capture {
    let options = CabinetOptions { views: 16, test_views: 3, size: 80, ..CabinetOptions::default() };
    write_cabinet(dir, &options).expect("the cabinet is written");
    artgs_io::load_capture(dir).expect("the cabinet is read")
}

/// Few steps, in which Gaussians are cloned, held-out views are rendered, and joints are optimised.
fn config() -> Config {
    let mut config = Config { parts: 3.into(), ..Config::default() };
    config.articulate.steps = 90;
    config.articulate.learn_joints = true;
    config.articulate.joint_rate.from = 3e-4;
    config.articulate.plateau.settle = 30;
    config.articulate.plateau.every = 30;
    config.articulate.densify.after = 20;
    config.articulate.densify.every = 20;
    config.articulate.densify.before = 61;
    config
}

#[test]
fn joints_and_renderings_are_those_of_the_cpu() {
    let Some(devices) = device() else { return };
    let root = tempfile::tempdir().expect("a temporary folder");
    let prepared = Prepared::as_is(cabinet(&root.path().join("capture"))).with_config(config());
    let run = |name: &str, devices: &dyn Devices| {
        let out = root.path().join(name);
        let reconstruction = Reconstruction { devices, ..Reconstruction::new(&prepared) };
        let made = reconstruction.run_in(&RunFolder::new(out), &mut NullObserver).expect("it runs");
        (made.summary, made.replica)
    };
    let (on_cpu, cpu) = run("cpu", &Cpu);
    let (on_gpu, gpu) = run("gpu", &devices);
    assert_eq!(on_gpu.device, Some(devices.name()));
    let (mut worst_angle, mut worst_value) = (0.0_f64, 0.0_f64);
    for part in 1..3 {
        let (a, b) = (cpu.joint(part).expect("a joint"), gpu.joint(part).expect("a joint"));
        assert_eq!(a.kind, b.kind);
        worst_angle = worst_angle.max(a.axis.angle_between(b.axis).to_degrees());
        worst_value = worst_value.max((a.state_values[State::END] - b.state_values[State::END]).abs());
    }
    println!("axes within {worst_angle:.4} deg, motions within {worst_value:.5}");
    assert!(worst_angle < 0.05, "axes differ by {worst_angle} deg");
    assert!(worst_value < 0.05_f64.to_radians(), "motions differ by {worst_value}");
    for (a, b) in on_cpu.test.iter().zip(&on_gpu.test) {
        let (a, b) = (a.expect("test views").psnr, b.expect("test views").psnr);
        println!("PSNR {a:.2} on the CPU, {b:.2} on {}", devices.name());
        assert!((a - b).abs() < 0.5 && b > 20.0, "{a} dB and {b} dB");
    }
    let evaluated = artgs::run::evaluate(&RunFolder::new(root.path().join("gpu")), &root.path().join("capture/gt"));
    let evaluated = evaluated.expect("scores");
    println!("{evaluated}");
    assert!(evaluated.counts.found == 2 && evaluated.counts.wrong_type == 0, "{evaluated}");
}
