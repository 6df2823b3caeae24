//! The whole method on a small procedural cabinet: numbers within bounds, the same bytes for the same seed, resuming.

mod common;

use artgs::fit::{Backend, Cpu, Devices, FitError, TrainConfig, TrainImage, WithFallback};
use artgs::observer::{Event, NullObserver};
use artgs::{Config, Prepared, Reconstruction, Summary};
use artgs_core::{Capture, State};
use artgs_io::RunFolder;
use artgs_io::run_folder::load_json;
use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use common::reconstruct;
use std::fs;
use std::path::Path;

fn cabinet(dir: &Path) -> Capture {
    let options = CabinetOptions { views: 24, test_views: 4, size: 112, ..CabinetOptions::default() };
    write_cabinet(dir, &options).expect("the cabinet is written");
    artgs_io::load_capture(dir).expect("the cabinet is read")
}

fn short(parts: usize) -> Config {
    let mut config = Config { parts: parts.into(), ..Config::default() };
    config.articulate.steps = 150;
    config.articulate.densify.before = 60;
    config
}

const FILES: [&str; 6] = [
    "replica.json",
    "meshes/start/part_1.ply",
    "meshes/end/whole.ply",
    "splats/canonical.ply",
    "stages/articulated.ply",
    "preview.png",
];

/// A device that never works.
#[derive(Debug)]
struct Broken;

impl Devices for Broken {
    fn name(&self) -> String {
        "Broken".into()
    }

    fn backend<'a>(
        &'a self,
        _: Vec<TrainImage<'a>>,
        _: TrainConfig,
        _: u64,
    ) -> Result<Box<dyn Backend + 'a>, FitError> {
        Err(FitError::Device("it never works".into()))
    }
}

#[test]
fn a_cabinet_is_reconstructed_repeatably_and_resumably() {
    let root = tempfile::tempdir().unwrap();
    let capture = cabinet(&root.path().join("capture"));
    let (one, two) = (root.path().join("one"), root.path().join("two"));
    let config = short(3);
    let summary = reconstruct(&capture, &one, &config, false, &Cpu, &mut NullObserver).unwrap();
    assert_eq!(summary.parts, 3);
    for state in summary.test {
        assert!(state.unwrap().psnr > 26.0, "{summary}");
    }

    let scores = artgs::run::evaluate(&RunFolder::new(&one), &root.path().join("capture/gt")).unwrap();
    println!("{scores}");
    assert!(scores.counts.found == 2 && scores.counts.wrong_type == 0 && scores.counts.missing == 0, "{scores}");
    assert!(scores.joints.axis_angle_deg.unwrap() < 1.0, "{scores}");
    // The back of the drawer is never seen, which bounds its Chamfer distance from below; F-scores cover what is seen.
    assert!(scores.movable.mean.f_score > 0.6 && scores.fixed.mean.chamfer < 5.0, "{scores}");

    // On a device that fails at once, as on the processor but for one warning.
    let mut events: Vec<Event> = Vec::new();
    let devices = WithFallback::new(Box::new(Broken));
    let fallen = reconstruct(&capture, &two, &config, false, &devices, &mut events).unwrap();
    let named = |e: &&Event| matches!(e, Event::Warning { message } if message.contains("Broken: it never works"));
    assert_eq!(events.iter().filter(named).count(), 1);
    assert!(fallen.warnings.len() == summary.warnings.len() + 1 && fallen.device == summary.device);
    assert_eq!(summary.device, Some(Cpu.name()));
    for file in FILES {
        assert!(fs::read(one.join(file)).unwrap() == fs::read(two.join(file)).unwrap(), "{file} differs");
    }

    // As if interrupted before the parts were trained: discovery is loaded, the rest is the same.
    let run = RunFolder::new(&two);
    fs::remove_file(run.trained_joints()).unwrap();
    fs::remove_file(run.replica()).unwrap();
    let before: Summary = load_json(&run.metrics()).unwrap().unwrap();
    let mut events: Vec<Event> = Vec::new();
    let resumed = reconstruct(&capture, &two, &config, true, &Cpu, &mut events).unwrap();
    // The time of the stage that was loaded is that of the run that computed it.
    let names = |summary: &Summary| summary.seconds.iter().map(|s| s.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&resumed), ["discover", "articulate", "surface", "assemble"]);
    assert!(names(&before) == names(&resumed) && before.seconds[0] == resumed.seconds[0]);
    assert_eq!(load_json::<Summary>(&run.metrics()).unwrap().unwrap(), resumed);
    let reused = |name: &str| {
        events.iter().any(|e| matches!(e, Event::StageFinished { stage, reused: true, .. } if stage == name))
    };
    assert!(reused("discover") && !reused("articulate"));
    for file in FILES {
        assert!(fs::read(one.join(file)).unwrap() == fs::read(two.join(file)).unwrap(), "{file} differs");
    }

    // Changed settings of training leave discovery valid; a changed capture leaves nothing.
    let again = |capture: &Capture, config: &Config| {
        let mut events: Vec<Event> = Vec::new();
        reconstruct(capture, &two, config, true, &Cpu, &mut events).unwrap();
        let noted = events.iter().any(|e| matches!(e, Event::Note { message } if message.contains("changed since")));
        let reused = |name: &str| {
            events.iter().any(|e| matches!(e, Event::StageFinished { stage, reused: true, .. } if stage == name))
        };
        (noted, reused("discover"), reused("articulate"))
    };
    assert_eq!(again(&capture, &config), (false, true, true));
    let mut longer = config.clone();
    longer.articulate.steps += 2;
    assert_eq!(again(&capture, &longer), (true, true, false));
    let mut elsewhere = capture.clone();
    elsewhere.states[State::START].train.swap(0, 1);
    assert_eq!(again(&elsewhere, &longer), (true, false, false));
}

#[test]
fn a_method_that_cannot_count_parts_is_refused_without_their_number() {
    let root = tempfile::tempdir().unwrap();
    let capture = Capture::default();
    let out = root.path().join("out");
    for config in [Config::paper(), Config::registration()] {
        let error = reconstruct(&capture, &out, &config, false, &Cpu, &mut NullObserver).unwrap_err();
        assert!(error.is_bad_input() && error.to_string().contains("--parts"), "{error}");
        assert!(!out.exists(), "nothing is written before the settings are known to be complete");
    }
}

#[test]
fn the_same_is_computed_in_memory() {
    let root = tempfile::tempdir().unwrap();
    let capture = cabinet(&root.path().join("capture"));
    let mut config = Config { parts: 3.into(), ..Config::registration() };
    config.surface.resolution = 100.0;
    let mut prepared = Prepared::as_is(capture).with_config(config);
    prepared.before.push(Event::finished("align", 1000.0, false));
    let reconstruction = Reconstruction::new(&prepared);
    let (disk, saved) = (RunFolder::new(root.path().join("disk")), RunFolder::new(root.path().join("saved")));
    let replica = reconstruction.run(disk.root(), &mut NullObserver).unwrap();
    let computed = reconstruction.compute(&mut NullObserver).unwrap();
    assert_eq!(computed.replica, replica);
    let summary = &computed.summary;
    assert!(
        summary.seconds[0] == ("align".to_string(), 1000.0) && (1000.0..2000.0).contains(&summary.total_seconds),
        "{summary}"
    );
    computed.save(&saved).unwrap();
    for file in ["replica.json", "config.toml", "meshes/start/part_2.ply", "meshes/end/whole.ply"] {
        assert!(fs::read(disk.root().join(file)).unwrap() == fs::read(saved.root().join(file)).unwrap(), "{file}");
    }
    assert!(!saved.stage("").exists());

    let found = reconstruction.find_parts(&mut NullObserver).unwrap();
    let fused = reconstruction.fuse(&found, None, &mut NullObserver).unwrap();
    assert!(fused == computed.meshes);
    // Every joint at its end value: the meshes of the end.
    let end: Vec<f64> =
        (0..3).map(|part| replica.joint(part).map_or(0.0, |joint| joint.state_values[State::END])).collect();
    for (posed, meshes) in computed.posed_meshes(&end).iter().zip(&computed.meshes.parts) {
        let apart = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f32::max);
        let farthest =
            posed.vertices.iter().zip(&meshes[artgs_core::State::END].vertices).map(apart).fold(0.0, f32::max);
        assert!(posed.triangles == meshes[artgs_core::State::END].triangles && farthest < 1e-4, "{farthest}");
    }
}
