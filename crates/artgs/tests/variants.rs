//! Every ablation runs from photographs to a scored replica, with both presets, and does without what it says.

mod common;

use artgs::Config;
use artgs::ablation::{apply, variants};
use artgs::fit::Cpu;
use artgs::observer::{Event, NullObserver};
use artgs_core::{Capture, JointKind};
use artgs_io::RunFolder;
use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use common::reconstruct;
use std::fs;
use std::path::Path;

fn cabinet(folder: &Path, views: usize, size: u32) -> Capture {
    let options = CabinetOptions { views, test_views: 1, size, ..CabinetOptions::default() };
    write_cabinet(folder, &options).expect("the cabinet is written");
    artgs_io::load_capture(folder).expect("the cabinet is read")
}

/// So short that only the way is tested, not where it leads.
fn hasty(mut config: Config) -> Config {
    config.parts = 3.into();
    config.canonical.max_matched = 300;
    config.canonical.cluster.max_points = 300;
    config.canonical.random.count = 1500;
    config.single.random.count = 1500;
    config.surface.resolution = 60.0;
    // Few steps with large rates turn a part by chance; as prismatic it differs from the variant that decides no types.
    config.types.half_angle_deg = 90.0;
    for assign in [&mut config.articulate.assign, &mut config.types.train.assign] {
        assign.grid.levels = 4;
        assign.grid.log2_entries = 12;
    }
    config
}

fn started(events: &[Event], name: &str) -> bool {
    events.iter().any(|e| matches!(e, Event::Progress { stage, .. } if stage == name))
}

#[test]
fn published_variants_run_and_only_one_skips_the_types() {
    let root = tempfile::tempdir().unwrap();
    let capture = cabinet(&root.path().join("capture"), 10, 56);
    let mut seen: Vec<Vec<u8>> = Vec::new();
    for (name, _) in variants() {
        let Ok(config) = apply(name, hasty(Config::paper_scaled(0.002).unwrap())) else { continue };
        let out = root.path().join(name);
        let mut events: Vec<Event> = Vec::new();
        let summary = reconstruct(&capture, &out, &config, false, &Cpu, &mut events).unwrap();
        assert!(summary.parts == 3 && summary.test[0].is_some(), "{name}");
        assert_eq!(started(&events, "types"), *name != "no-types", "{name}");
        if *name == "mlp" {
            artgs::run::evaluate(&RunFolder::new(&out), &root.path().join("capture/gt")).unwrap();
        }
        let splats = fs::read(out.join("splats/canonical.ply")).unwrap();
        assert!(!seen.contains(&splats), "{name} comes out like another variant");
        seen.push(splats);
    }
    assert_eq!(seen.len(), 7);
}

#[test]
fn default_variants_run_repeatably() {
    let root = tempfile::tempdir().unwrap();
    let capture = cabinet(&root.path().join("capture"), 16, 72);
    // The full method has tests of its own.
    for (name, _) in &variants()[1..] {
        let mut config = hasty(Config::default());
        config.articulate.steps = 24;
        let config = apply(name, config).unwrap();
        let run = |out: &Path| {
            let summary = reconstruct(&capture, out, &config, false, &Cpu, &mut NullObserver).unwrap();
            assert!(summary.parts == 3 && summary.gaussians > 500, "{name}: {summary}");
        };
        let out = root.path().join(name);
        run(&out);
        let replica = artgs_io::read_replica(&out).unwrap();
        assert!((1..3).all(|k| replica.joint(k).unwrap().kind != JointKind::Screw), "{name}");
        if *name == "no-types" {
            // Discovery's motions are good enough to determine types without deciding on them first.
            let scores = artgs::run::evaluate(&RunFolder::new(&out), &root.path().join("capture/gt")).unwrap();
            assert!(scores.counts.wrong_type == 0 && scores.joints.axis_angle_deg.unwrap() < 2.0, "{name}: {scores}");
        }
        if *name == "slots" {
            let again = root.path().join("again");
            run(&again);
            for file in ["replica.json", "splats/canonical.ply", "meshes/start/part_1.ply"] {
                assert!(fs::read(out.join(file)).unwrap() == fs::read(again.join(file)).unwrap(), "{file}");
            }
            // As if stopped before the meshes: what training learnt is taken over.
            let before = fs::read(out.join("metrics.json")).unwrap();
            reconstruct(&capture, &out, &config, true, &Cpu, &mut NullObserver).unwrap();
            let psnr = |bytes: &[u8]| serde_json::from_slice::<serde_json::Value>(bytes).unwrap()["test"].clone();
            assert_eq!(psnr(&before), psnr(&fs::read(out.join("metrics.json")).unwrap()));
        }
    }
}
