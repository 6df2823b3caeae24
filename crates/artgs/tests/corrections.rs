//! A person's corrections are honoured when a run is resumed, and whatever depends on them is made anew.

use artgs::fit::Cpu;
use artgs::observer::{Event, NullObserver};
use artgs::run::{corrections_of, find_parts};
use artgs::{Config, reconstruct};
use artgs_core::{Capture, JointKind, Replica};
use artgs_io::{CentreEdit, Corrections, JointMark, read_replica, write_corrections};
use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use std::path::Path;

fn resume(capture: &Capture, out: &Path, config: &Config) -> (Replica, Vec<String>) {
    let mut events: Vec<Event> = Vec::new();
    reconstruct(capture, out, config, true, &Cpu, &mut events).expect("a resumed run ends");
    let made = events.iter().filter_map(|e| match e {
        Event::StageFinished { stage, reused: false, .. } => Some(stage.to_string()),
        _ => None,
    });
    (read_replica(out).expect("a run leaves a replica"), made.collect())
}

#[test]
fn parts_are_deleted_added_and_given_their_types() {
    let root = tempfile::tempdir().unwrap();
    let (folder, out) = (root.path().join("capture"), root.path().join("out"));
    let options = CabinetOptions { views: 24, test_views: 0, size: 112, ..CabinetOptions::default() };
    write_cabinet(&folder, &options).unwrap();
    let capture = artgs_io::load_capture(&folder).unwrap();
    let mut config = Config { parts: Some(3), ..Config::registration() };
    config.surface.resolution = 120.0;
    // Parts can be looked at before the rest is made of them.
    let found = find_parts(&capture, &out, &config, false, &Cpu, &mut NullObserver).unwrap();
    assert!(found.parts.len() == 2 && !out.join("replica.json").exists());
    assert!(found.parts.iter().all(|part| part.confidence.unwrap() > 0.9), "{:?}", found.parts);
    let read = artgs::run::found(&out).unwrap();
    assert_eq!((read.labels, read.parts.len()), (found.labels, 2));
    let learnt = Config { parts: Some(3), ..Config::paper_scaled(0.1).unwrap() };
    let refused = find_parts(&capture, &root.path().join("b"), &learnt, false, &Cpu, &mut NullObserver).unwrap_err();
    assert!(refused.is_bad_input() && refused.to_string().contains("learnt"), "{refused}");
    let (_, made) = resume(&capture, &out, &config);
    assert_eq!(made, ["surface", "assemble"]);
    let first = read_replica(&out).unwrap();
    let kinds = |r: &Replica| (1..r.parts.len()).map(|i| r.joint(i).unwrap().kind).collect::<Vec<_>>();
    let drawer = 1 + kinds(&first).iter().position(|k| *k == JointKind::Prismatic).unwrap();
    let (origin, travel) = {
        let joint = first.joint(drawer).unwrap();
        (joint.origin, joint.state_values[1])
    };

    // Without corrections nothing but what is always made is made.
    assert_eq!(corrections_of(&out), None);
    let (same, made) = resume(&capture, &out, &config);
    assert!(same == first && !made.iter().any(|stage| stage == "correct"), "{made:?}");

    let delete = Corrections { centres: vec![CentreEdit::Delete { part: drawer }], joints: vec![] };
    write_corrections(&out, &delete).unwrap();
    let (less, made) = resume(&capture, &out, &config);
    assert_eq!(kinds(&less), [JointKind::Revolute]);
    assert_eq!(corrections_of(&out), Some((delete, 2)));
    assert!(made.iter().any(|stage| stage == "correct") && !made.iter().any(|stage| stage == "register"), "{made:?}");

    // Added again where it was, as the last part, with its motion.
    let back = Corrections {
        centres: vec![CentreEdit::Delete { part: drawer }, CentreEdit::Add { position: origin.to_array() }],
        joints: vec![],
    };
    write_corrections(&out, &back).unwrap();
    let (again, _) = resume(&capture, &out, &config);
    assert_eq!(kinds(&again), [JointKind::Revolute, JointKind::Prismatic]);
    assert!((again.joint(2).unwrap().state_values[1] - travel).abs() < 0.02 * travel);

    // What was measured bears the right joints out, and a wrong one less.
    let sure = |r: &Replica, part: usize| r.parts[part].confidence.unwrap();
    assert!(sure(&again, 1) > 0.9 && sure(&again, 2) > 0.9, "{} {}", sure(&again, 1), sure(&again, 2));
    let door = 3 - drawer;
    let slides = Corrections { centres: vec![], joints: vec![JointMark { part: door, kind: JointKind::Prismatic }] };
    write_corrections(&out, &slides).unwrap();
    let (doubted, _) = resume(&capture, &out, &config);
    assert!(sure(&doubted, door) < 0.7 && sure(&doubted, drawer) > 0.9, "{}", sure(&doubted, door));

    let marked = Corrections { centres: vec![], joints: vec![JointMark { part: door, kind: JointKind::Screw }] };
    write_corrections(&out, &marked).unwrap();
    let (told, _) = resume(&capture, &out, &config);
    assert_eq!(told.joint(door).unwrap().kind, JointKind::Screw);
    assert_eq!(told.parts.len(), 3);

    let wrong = Corrections { centres: vec![CentreEdit::Delete { part: 7 }], joints: vec![] };
    let honoured = || std::fs::read(out.join("stages/corrections.json")).unwrap();
    let before = honoured();
    write_corrections(&out, &wrong).unwrap();
    let refused = reconstruct(&capture, &out, &config, true, &Cpu, &mut NullObserver).unwrap_err();
    assert!(refused.is_bad_input() && refused.to_string().contains("part 7"), "{refused}");
    assert!(honoured() == before, "what is refused changes nothing");
    std::fs::write(out.join("corrections.json"), "{").unwrap();
    let refused = reconstruct(&capture, &out, &config, true, &Cpu, &mut NullObserver).unwrap_err();
    assert!(refused.is_bad_input() && refused.to_string().contains("corrections.json"), "{refused}");
}
