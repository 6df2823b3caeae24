//! Corrections by a person are applied when a run is resumed, and the stages that depend on them are computed again.

mod common;

use artgs::fit::Cpu;
use artgs::observer::{Event, NullObserver};
use artgs::run::{corrections_of, found_parts};
use artgs::{Config, Prepared, Reconstruction};
use artgs_core::{Capture, JointKind, PartClass, Replica};
use artgs_io::{CentreEdit, ClassMark, Corrections, JointMark, RunFolder, read_replica, write_corrections};
use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use common::reconstruct;
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
    let mut config = Config { parts: 3.into(), ..Config::registration() };
    config.surface.resolution = 120.0;
    // Parts can be viewed before the other stages run.
    let run = RunFolder::new(&out);
    let prepared = |config: &Config| Prepared::as_is(capture.clone()).with_config(config.clone());
    let found = Reconstruction::new(&prepared(&config)).find_parts_in(&run, &mut NullObserver).unwrap();
    assert!(found.parts.len() == 2 && !run.has_replica());
    assert!(found.parts.iter().all(|part| part.confidence.unwrap() > 0.9), "{:?}", found.parts);
    let read = found_parts(&run).unwrap();
    assert_eq!((read.labels, read.parts.len()), (found.labels, 2));
    let learnt = Config { parts: 3.into(), ..Config::paper_scaled(0.1).unwrap() };
    let other = RunFolder::new(root.path().join("b"));
    let refused = Reconstruction::new(&prepared(&learnt)).find_parts_in(&other, &mut NullObserver).unwrap_err();
    assert!(refused.is_bad_input() && refused.to_string().contains("learnt"), "{refused}");
    let (_, made) = resume(&capture, &out, &config);
    assert_eq!(made, ["surface", "assemble"]);
    let first = read_replica(&out).unwrap();
    let kinds = |r: &Replica| (1..r.parts.len()).map(|i| r.joint(i).unwrap().kind).collect::<Vec<_>>();
    let drawer = 1 + kinds(&first).iter().position(|k| *k == JointKind::Prismatic).unwrap();
    let (origin, travel) = {
        let joint = first.joint(drawer).unwrap();
        (joint.origin, joint.state_values[artgs_core::State::END])
    };

    // Without corrections only the stages run that always do.
    assert_eq!(corrections_of(&run), None);
    let (same, made) = resume(&capture, &out, &config);
    assert!(same == first && !made.iter().any(|stage| stage == "correct"), "{made:?}");

    // Classes change exports only.
    let classes = vec![ClassMark { part: drawer, class: PartClass::Lid }];
    write_corrections(&out, &Corrections { classes, ..Corrections::default() }).unwrap();
    let (same, again) = resume(&capture, &out, &config);
    assert!(same == first && again == made && corrections_of(&run).is_none(), "{again:?}");

    let delete = Corrections { centres: vec![CentreEdit::Delete { part: drawer }], ..Corrections::default() };
    write_corrections(&out, &delete).unwrap();
    let (less, made) = resume(&capture, &out, &config);
    assert_eq!(kinds(&less), [JointKind::Revolute]);
    assert_eq!(corrections_of(&run), Some((delete, 2)));
    assert!(made.iter().any(|stage| stage == "correct") && !made.iter().any(|stage| stage == "register"), "{made:?}");

    // Added again where it was, as the last part, with its motion.
    let back = Corrections {
        centres: vec![CentreEdit::Delete { part: drawer }, CentreEdit::Add { position: origin.to_array() }],
        ..Corrections::default()
    };
    write_corrections(&out, &back).unwrap();
    let (again, _) = resume(&capture, &out, &config);
    assert_eq!(kinds(&again), [JointKind::Revolute, JointKind::Prismatic]);
    // Corrected parts have intervals, those of the baseline none.
    let intervals = |r: &Replica| r.parts.iter().filter_map(|part| part.interval).count();
    assert_eq!([&first, &again].map(intervals), [0, 2]);
    assert!((again.joint(2).unwrap().state_values[artgs_core::State::END] - travel).abs() < 0.02 * travel);

    // Right joints have a high confidence, wrong ones a low one.
    let sure = |r: &Replica, part: usize| r.parts[part].confidence.unwrap();
    assert!(sure(&again, 1) > 0.75 && sure(&again, 2) > 0.75, "{} {}", sure(&again, 1), sure(&again, 2));
    let door = 3 - drawer;
    let slides = Corrections {
        joints: vec![JointMark { part: door, kind: JointKind::Prismatic, joint: None }],
        ..Corrections::default()
    };
    write_corrections(&out, &slides).unwrap();
    let (doubted, _) = resume(&capture, &out, &config);
    assert!(sure(&doubted, door) < 0.7 && sure(&doubted, drawer) > 0.75, "{}", sure(&doubted, door));

    let marked = Corrections {
        joints: vec![JointMark { part: door, kind: JointKind::Screw, joint: None }],
        ..Corrections::default()
    };
    write_corrections(&out, &marked).unwrap();
    let (marked, _) = resume(&capture, &out, &config);
    assert_eq!(marked.joint(door).unwrap().kind, JointKind::Screw);
    assert_eq!(marked.parts.len(), 3);

    let wrong = Corrections { centres: vec![CentreEdit::Delete { part: 7 }], ..Corrections::default() };
    let applied = || std::fs::read(run.applied_corrections()).unwrap();
    let before = applied();
    write_corrections(&out, &wrong).unwrap();
    let refused = reconstruct(&capture, &out, &config, true, &Cpu, &mut NullObserver).unwrap_err();
    assert!(refused.is_bad_input() && refused.to_string().contains("part 7"), "{refused}");
    assert!(applied() == before, "what is refused changes nothing");
    std::fs::write(run.corrections(), "{").unwrap();
    let refused = reconstruct(&capture, &out, &config, true, &Cpu, &mut NullObserver).unwrap_err();
    assert!(refused.is_bad_input() && refused.to_string().contains("corrections.json"), "{refused}");
}
