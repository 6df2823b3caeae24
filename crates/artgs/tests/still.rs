//! An object of which nothing moved between the two states: a warning and one static part.

mod common;

use artgs::fit::Cpu;
use artgs::observer::{Event, NullObserver};
use artgs::{Config, PartCount, Prepared, Reconstruction};
use artgs_core::{Capture, State};
use artgs_io::{RunFolder, read_replica};
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};
use common::reconstruct;

/// Both states show the cabinet at the start, from different cameras.
fn still() -> Capture {
    let options = CabinetOptions { views: 40, test_views: 2, size: 96, ..CabinetOptions::default() };
    let (mut capture, _) = cabinet_capture(&options).expect("the cabinet is rendered");
    let views = std::mem::take(&mut capture.states[State::START].train);
    let (even, odd): (Vec<_>, Vec<_>) = views.into_iter().enumerate().partition(|(i, _)| i % 2 == 0);
    capture.states[State::START].train = even.into_iter().map(|v| v.1).collect();
    capture.states[State::END].train = odd.into_iter().map(|v| v.1).collect();
    capture.states[State::END].test = capture.states[State::START].test.clone();
    capture
}

fn short(parts: PartCount) -> Config {
    let mut config = Config { parts, ..Config::default() };
    config.articulate.steps = 60;
    config.surface.resolution = 90.0;
    config
}

#[test]
fn a_still_object_becomes_one_static_part() {
    let (root, capture) = (tempfile::tempdir().unwrap(), still());
    let registration = Config { method: artgs::config::Method::Registration, ..short(3.into()) };
    for (name, config) in [("auto", short(PartCount::Auto)), ("given", short(3.into())), ("baseline", registration)] {
        let run = RunFolder::new(root.path().join(name));
        let summary = reconstruct(&capture, run.root(), &config, false, &Cpu, &mut NullObserver).unwrap();
        assert_eq!(summary.parts, 1, "{name}");
        let warned = summary.warnings.iter().filter(|w| w.contains("nothing moved")).count();
        assert_eq!(warned, 1, "{name}: {:?}", summary.warnings);
        let replica = read_replica(run.root()).unwrap();
        assert!(replica.parts.len() == 1 && replica.joint(0).is_none());
        assert!(run.load_mesh(&replica.parts[0].meshes[State::END]).unwrap().triangles.len() > 1000);
        assert_eq!(run.has_splats(), name != "baseline");
        let mut events: Vec<Event> = Vec::new();
        reconstruct(&capture, run.root(), &config, true, &Cpu, &mut events).unwrap();
        let found_again = |e: &Event| match e {
            Event::StageFinished { stage, reused, .. } => !reused && *stage == "discover",
            _ => false,
        };
        assert!(!events.iter().any(found_again), "{name}");
    }
    let found = Reconstruction::new(&Prepared::as_is(capture.clone())).find_parts(&mut NullObserver).unwrap();
    assert!(found.parts.is_empty() && found.labels.iter().flatten().all(|label| *label == 0));
    assert!(!found.clouds[State::START].is_empty() && found.warnings.len() == 1);
}
