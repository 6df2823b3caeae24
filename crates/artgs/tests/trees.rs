//! Parts with screws and parts that other parts carry, from photos with depth to the joints of the replica.

use artgs::discover::{DepthPicture, DiscoverConfig, Discovery, Scene, correct};
use artgs::observer::NullObserver;
use artgs::{Prepared, Reconstruction};
use artgs_core::{Capture, Joint, JointKind, State};
use artgs_io::{Corrections, JointMark};
use artgs_synth::{CaptureOptions, Object, object, render_capture};

/// Parts of a procedural object, found in views of 200 pixels.
fn found(name: &str, movable: usize) -> (Object, Capture, Discovery) {
    let object = object(name, 0).expect("an object of the catalogue");
    let options = CaptureOptions { views: 24, test_views: 0, size: 200, ..CaptureOptions::default() };
    let capture: Capture = render_capture(&object, &options).expect("the object is drawn");
    let found = Reconstruction::new(&Prepared::as_is(capture.clone()).with_parts(movable + 1))
        .find_parts(&mut NullObserver)
        .expect("parts are found");
    (object, capture, found)
}

fn joint(found: &Discovery, part: usize) -> Joint {
    found.parts[part - 1].joint_near(&found.parts, found.middle(part, State::START))
}

fn axis_error_deg(joint: &Joint, truth: &Joint) -> f64 {
    joint.axis.cross(truth.axis).length().asin().to_degrees()
}

#[test]
fn a_screw_cap_turns_and_rises() {
    let (object, capture, found) = found("screw_cap", 1);
    let (cap, truth) = (joint(&found, 1), object.world_joint(1).expect("the cap moves"));
    assert_eq!((cap.kind, found.parts[0].parent), (JointKind::Screw, 0), "{cap:?}");
    assert!(axis_error_deg(&cap, &truth) < 0.5, "{cap:?} {truth:?}");
    let sign = cap.axis.dot(truth.axis).signum();
    let turn = truth.state_values[State::END] - truth.state_values[State::START];
    assert!((sign * cap.state_values[State::END] - turn).abs().to_degrees() < 2.0, "{cap:?} {truth:?}");
    assert!((cap.pitch - truth.pitch).abs() < 0.03 * truth.pitch, "{cap:?} {truth:?}");
    // What a person says of the type is kept.
    let config = DiscoverConfig::default();
    let pictures = capture.states.as_ref().map(|state| {
        let views = state.train.iter();
        views.filter_map(|view| Some(DepthPicture { view, depth: view.depth.as_ref()? })).collect::<Vec<_>>()
    });
    let scene = Scene::new(pictures.as_ref().map(Vec::as_slice), &config).expect("there are surface points");
    let marked = |kind| {
        let corrections =
            Corrections { joints: vec![JointMark { part: 1, kind, joint: None }], ..Corrections::default() };
        correct(&scene, &found, &corrections, &config).expect("part 1 exists").parts[0]
    };
    assert_eq!(marked(JointKind::Prismatic).kind, JointKind::Prismatic);
    let screw = marked(JointKind::Screw);
    assert!(
        screw.kind == JointKind::Screw && (screw.motion.angle() - turn.abs()).abs().to_degrees() < 2.0,
        "{screw:?}"
    );
}

#[test]
fn a_drawer_in_a_door_is_carried_by_the_door() {
    let (object, _, found) = found("door_with_drawer", 2);
    let (door, drawer) = (joint(&found, 1), joint(&found, 2));
    assert_eq!(found.parts.iter().map(|p| p.parent).collect::<Vec<_>>(), [0, 1], "{:?}", found.parts);
    assert_eq!((door.kind, drawer.kind), (JointKind::Revolute, JointKind::Prismatic));
    for (joint, part) in [(door, 1), (drawer, 2)] {
        let truth = object.world_joint(part).expect("it moves");
        let value = truth.state_values[State::END] - truth.state_values[State::START];
        assert!(axis_error_deg(&joint, &truth) < 0.5, "{joint:?} {truth:?}");
        assert!((joint.state_values[State::END] - value).abs() < 0.02 * value, "{joint:?} {truth:?}");
    }
}
