//! The baseline without Gaussians on a procedural cabinet: a door and a drawer, the files of a replica but splats.

mod common;

use artgs::Config;
use artgs::fit::Cpu;
use artgs::observer::{Event, NullObserver};
use artgs_io::RunFolder;
use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use common::reconstruct;
use std::fs;

#[test]
fn a_door_and_a_drawer_are_registered_and_written_without_splats() {
    let root = tempfile::tempdir().unwrap();
    let (folder, out) = (root.path().join("capture"), root.path().join("out"));
    let options = CabinetOptions { views: 24, test_views: 2, size: 112, ..CabinetOptions::default() };
    write_cabinet(&folder, &options).unwrap();
    let mut capture = artgs_io::load_capture(&folder).unwrap();
    let mut config = Config { parts: 3.into(), ..Config::registration() };
    config.surface.resolution = 200.0;
    let summary = reconstruct(&capture, &out, &config, false, &Cpu, &mut NullObserver).unwrap();
    assert!(summary.gaussians == 0 && summary.test == [None, None] && summary.train == [None, None]);
    assert!(!out.join("splats").exists() && !out.join("preview.png").exists());
    for file in ["metrics.json", "meshes/start/part_1.ply", "meshes/end/whole.ply"] {
        assert!(out.join(file).is_file(), "{file}");
    }

    let scores = artgs::run::evaluate(&RunFolder::new(&out), &folder.join("gt")).unwrap();
    println!("{scores}");
    assert!(scores.counts.found == 2 && scores.counts.missing == 0 && scores.counts.wrong_type == 0, "{scores}");
    assert!(scores.joints.axis_angle_deg.unwrap() < 1.0, "{scores}");
    assert!(scores.movable.mean.f_score > 0.5, "{scores}");

    let replica = fs::read(out.join("replica.json")).unwrap();
    fs::remove_file(out.join("replica.json")).unwrap();
    let mut events: Vec<Event> = Vec::new();
    reconstruct(&capture, &out, &config, true, &Cpu, &mut events).unwrap();
    assert!(
        events.iter().any(|e| matches!(e, Event::StageFinished { stage, reused: true, .. } if stage == "register"))
    );
    assert!(replica == fs::read(out.join("replica.json")).unwrap());
    let again = root.path().join("again");
    reconstruct(&capture, &again, &config, false, &Cpu, &mut NullObserver).unwrap();
    assert!(replica == fs::read(again.join("replica.json")).unwrap());

    capture.states[artgs_core::State::END].train[3].depth = None;
    let error = reconstruct(&capture, &again, &config, false, &Cpu, &mut NullObserver).unwrap_err();
    assert!(error.is_bad_input() && error.to_string().contains("state end lacks it"), "{error}");
}
