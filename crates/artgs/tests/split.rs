//! Two drawers with the same motion, found as one part, are split by a person and registered separately.

use artgs::discover::{CorrectError, DepthPicture, DiscoverConfig, Discovery, Scene, correct};
use artgs::observer::NullObserver;
use artgs::{Prepared, Reconstruction};
use artgs_core::{Capture, JointKind, PerState, State, View};
use artgs_io::{CentreEdit, Corrections, CutPlane, JointMark, MarkedJoint};
use artgs_synth::{CaptureOptions, Object, object, render_capture};
use glam::DVec3;

fn pictures(views: &[View]) -> Vec<DepthPicture<'_>> {
    views.iter().map(|view| DepthPicture { view, depth: view.depth.as_ref().expect("objects have depth") }).collect()
}

fn centre(points: impl Iterator<Item = DVec3>) -> DVec3 {
    let (sum, n) = points.fold((DVec3::ZERO, 0), |(sum, n), p| (sum + p, n + 1));
    sum / f64::from(n)
}

/// Middle of the vertices of a true part at the start.
fn true_centre(object: &Object, part: usize) -> DVec3 {
    centre(object.mesh(part, State::START).vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))))
}

/// Points of a part in a state.
fn points(found: &Discovery, part: u16, state: State) -> Vec<DVec3> {
    let labelled = found.clouds[state].points.iter().zip(&found.labels[state]);
    labelled.filter(|(_, label)| **label == part).map(|(p, _)| p.as_dvec3()).collect()
}

/// The drawers, with both found as part 1, and the plane between them; its normal points to the upper one.
fn twins() -> (Capture, Object, Discovery, CutPlane) {
    let twins = object("twin_drawers", 0).expect("the object exists");
    let options = CaptureOptions { views: 24, test_views: 0, size: 112, ..CaptureOptions::default() };
    let capture = render_capture(&twins, &options).expect("it is rendered");
    let found = Reconstruction::new(&Prepared::as_is(capture.clone()).with_parts(2))
        .find_parts(&mut NullObserver)
        .expect("the drawers are found");
    assert_eq!(found.parts.len(), 1);
    let [lower, upper] = [1, 2].map(|part| true_centre(&twins, part));
    let plane = CutPlane { point: (0.5 * (lower + upper)).to_array(), normal: (upper - lower).to_array() };
    (capture, twins, found, plane)
}

fn corrections(centres: Vec<CentreEdit>) -> Corrections {
    Corrections { centres, ..Corrections::default() }
}

#[test]
fn twin_drawers_are_split_and_keep_their_points() {
    let (capture, twins, found, plane) = twins();
    let config = DiscoverConfig::default();
    let states = capture.states.as_ref().map(|s| pictures(&s.train));
    let scene = Scene::new(states.as_ref().map(Vec::as_slice), &config).unwrap();
    let split = CentreEdit::Split { part: 1, plane: Some(plane), points: vec![] };
    let apply = |corrections: &Corrections| correct(&scene, &found, corrections, &config);

    let parted = apply(&corrections(vec![split.clone()])).unwrap();
    assert_eq!(parted.parts.len(), 2);
    let (point, normal) = (DVec3::from_array(plane.point), DVec3::from_array(plane.normal));
    for (k, part) in parted.parts.iter().enumerate() {
        let truth = twins.start_to_end(k + 1);
        assert_eq!(part.kind, JointKind::Prismatic);
        let off = part.motion.translation.distance(truth.translation);
        assert!(off < 0.003 * parted.diagonal && part.confidence.unwrap() > 0.9, "{off} {:?}", part.confidence);
        // No point is on the other side, also not after the motion.
        for state in State::ALL {
            let own = points(&parted, k as u16 + 1, state);
            let to_start = if state == State::START { artgs_core::Rigid::IDENTITY } else { part.motion.inverse() };
            let above = own.iter().filter(|p| (to_start.apply(**p) - point).dot(normal) > 0.0).count();
            let wrong = if k == 0 { above } else { own.len() - above };
            assert!(
                own.len() > 100 && wrong * 100 <= own.len(),
                "part {} {}: {wrong} of {}",
                k + 1,
                state.name(),
                own.len()
            );
        }
    }

    // The same by points.
    let upper: Vec<[f64; 3]> = points(&parted, 2, State::START).iter().map(|p| p.to_array()).collect();
    let by_points = CentreEdit::Split { part: 1, plane: None, points: upper };
    let picked = apply(&corrections(vec![by_points])).unwrap();
    assert_eq!(picked.labels[State::START], parted.labels[State::START]);

    // Later edits take pieces by their new numbers.
    let less = apply(&corrections(vec![split.clone(), CentreEdit::Delete { part: 1 }])).unwrap();
    assert_eq!((less.parts.len(), points(&less, 1, State::START)), (1, points(&parted, 2, State::START)));
    let whole = apply(&corrections(vec![split.clone(), CentreEdit::Merge { part: 2, into: 1 }])).unwrap();
    assert_eq!(whole.parts.len(), 1);
    let count = |d: &Discovery, part| points(d, part, State::START).len();
    assert_eq!(count(&whole, 1), count(&parted, 1) + count(&parted, 2));

    // A joint for a piece: its type holds for the piece alone.
    let joint = MarkedJoint { axis: (-DVec3::Y).to_array(), origin: [0.0; 3], value: None, pitch: 0.0 };
    let marked = JointMark { part: 2, kind: JointKind::Screw, joint: Some(joint) };
    let screwed = apply(&Corrections { centres: vec![split], joints: vec![marked], ..Corrections::default() }).unwrap();
    assert_eq!(screwed.parts.iter().map(|p| p.kind).collect::<Vec<_>>(), [JointKind::Prismatic, JointKind::Screw]);

    let beside = CutPlane { point: [9.0, 9.0, 9.0], ..plane };
    let refused = apply(&corrections(vec![CentreEdit::Split { part: 1, plane: Some(beside), points: vec![] }]));
    assert!(matches!(refused, Err(CorrectError::NothingSplit { part: 1 })), "{refused:?}");
    let nobody = apply(&corrections(vec![CentreEdit::Split { part: 7, plane: Some(plane), points: vec![] }]));
    assert!(matches!(nobody, Err(CorrectError::NoSuchPart { part: 7, count: 1 })), "{nobody:?}");
}

#[test]
fn a_part_is_registered_from_the_joint_that_is_given() {
    let (capture, twins, found, _) = twins();
    let config = DiscoverConfig::default();
    let states: PerState<Vec<DepthPicture<'_>>> = capture.states.as_ref().map(|s| pictures(&s.train));
    let scene = Scene::new(states.as_ref().map(Vec::as_slice), &config).unwrap();
    let truth = twins.start_to_end(1).translation;
    // A little off in direction and length.
    let axis = (truth.normalize() + DVec3::new(0.02, 0.0, 0.02)).to_array();
    let joint = MarkedJoint { axis, origin: [0.0; 3], value: Some(1.02 * truth.length()), pitch: 0.0 };
    let mark = JointMark { part: 1, kind: JointKind::Prismatic, joint: Some(joint) };
    // Found with a wrong motion, which the joint replaces.
    let mut wrong = found.clone();
    wrong.parts[0].motion = artgs_core::Rigid::shift(DVec3::new(0.4, 0.4, 0.4));
    let corrected =
        correct(&scene, &wrong, &Corrections { joints: vec![mark], ..Corrections::default() }, &config).unwrap();
    let off = corrected.parts[0].motion.translation.distance(truth);
    assert!(off < 0.003 * corrected.diagonal, "{off}");
}
