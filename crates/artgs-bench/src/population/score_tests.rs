use super::*;
use crate::population::overlap::{Confusion, TrueSurface};
use crate::population::testing::{carriage, cupboard, found_as};
use artgs_core::{JointAlternative, PerState, Rigid};

fn scored_if(decidable: bool, found: &Discovery, truth: &GroundTruth) -> Row {
    let surfaces = PerState::from_fn(|state| TrueSurface::new(truth, state));
    let overlaps = Confusion::of(found, &surfaces, truth.joints.len()).overlaps();
    let mut row = Row { decidable, ..Row::default() };
    score(&mut row, found, truth, &overlaps);
    row
}

fn scored(found: &Discovery, truth: &GroundTruth) -> Row {
    scored_if(true, found, truth)
}

#[test]
fn an_exact_result_is_right_in_any_order() {
    for truth in [cupboard(), carriage()] {
        for labels in [[1, 2], [2, 1]] {
            let row = scored(&found_as(&truth, &labels), &truth);
            assert!(row.right && row.joints_right && row.types_right && row.parents_right, "{row:#?}");
            assert_eq!((row.parts_true, row.parts_found, row.missing, row.extra), (2, 2, 0, 0));
            for (index, joint) in row.joints.iter().enumerate() {
                assert_eq!(
                    joint.truth,
                    Some(u32::from(labels.iter().position(|l| usize::from(*l) == index + 1) == Some(1)))
                );
                assert!(joint.axis_deg.unwrap() < 1e-6 && joint.motion.unwrap() < 1e-6, "{joint:?}");
                assert_eq!(joint.position.is_none(), joint.kind == "prismatic");
            }
        }
    }
}

#[test]
fn missing_and_extra_parts_are_counted() {
    let truth = cupboard();
    let row = scored(&found_as(&truth, &[1, 0]), &truth);
    assert_eq!((row.parts_found, row.missing, row.extra, row.count_right), (1, 1, 0, false));
    assert!(!row.right && row.joints[0].correct);

    // The door is found as two parts of which neither covers half.
    let mut found = found_as(&truth, &[1, 2]);
    found.parts.push(found.parts[0]);
    found.parts.push(found.parts[0]);
    for state in State::ALL {
        let door = found.labels[state].iter_mut().filter(|label| **label == 1).enumerate();
        door.for_each(|(i, label)| *label = [1, 3, 4][i % 3]);
    }
    let row = scored(&found, &truth);
    assert_eq!((row.parts_found, row.missing, row.extra), (4, 1, 3));
    assert_eq!((row.joints[0].truth, row.joints[0].kind_true.as_str()), (None, ""));
    assert!(row.joints[0].overlap > 0.3 && row.joints[0].overlap < 0.4 && row.joints[1].correct);

    let nothing = scored(&Discovery::default(), &truth);
    assert_eq!((nothing.parts_found, nothing.missing, nothing.count_right), (0, 2, false));
}

#[test]
fn a_wrong_type_is_wrong_and_has_no_errors() {
    let truth = cupboard();
    let mut found = found_as(&truth, &[1, 2]);
    found.parts[0].kind = JointKind::Screw;
    let row = scored(&found, &truth);
    assert!(row.count_right && row.parents_right && !row.types_right && !row.right);
    let joint = &row.joints[0];
    assert_eq!((&*joint.kind, &*joint.kind_true, joint.axis_deg, joint.motion), ("screw", "revolute", None, None));
    assert!(!joint.correct && row.joints[1].correct);
}

#[test]
fn a_wrong_parent_is_wrong_but_its_joint_is_measured_against_the_true_one() {
    let truth = carriage();
    let mut found = found_as(&truth, &[1, 2]);
    found.parts[1].parent = 0;
    let row = scored(&found, &truth);
    assert!(row.types_right && !row.parents_right && !row.right && !row.joints_right);
    assert!(row.joints[1].correct, "{:?}", row.joints[1]);
}

#[test]
fn alternatives_count_only_where_the_views_cannot_decide() {
    let truth = cupboard();
    let mut found = found_as(&truth, &[1, 2]);
    found.parts[0].kind = JointKind::Screw;
    found.parts[0].confidence = Some(0.6);
    assert!(!scored_if(false, &found, &truth).right, "there is no alternative");
    found.alternatives = vec![vec![JointAlternative {
        kind: JointKind::Revolute,
        motion: Rigid::IDENTITY,
        cost: 0.1,
        what: String::new(),
        advice: String::new(),
    }]];
    assert!(!scored(&found, &truth).right, "the views can decide");
    let row = scored_if(false, &found, &truth);
    assert!(row.right && !row.types_right && !row.joints_right);
    found.parts[0].confidence = Some(0.95);
    assert!(!scored_if(false, &found, &truth).right, "a wrong joint with a high confidence");
}

fn errors(found: &Rigid, truth: &Joint, part: &Mesh) -> Errors {
    Errors::of(&Joint::from_motion(truth.kind, found), truth, part)
}

#[test]
fn errors_have_their_units_and_signs() {
    let truth = cupboard();
    let (door, mesh) = (&truth.joints[0], &truth.movable[0][State::START]);
    let turn = |degrees: f64| Rigid::about(DVec3::Z, DVec3::ZERO, degrees.to_radians());
    let e = errors(&turn(-66.0), door, mesh);
    assert!(e.axis_deg < 1e-9 && (e.motion - 0.1).abs() < 1e-9 && !e.are_small());
    // The far edge, at 1 from the axis, is off by a chord of 6 degrees; the diagonal is the root of two.
    assert!((e.moved - 2.0 * 3_f64.to_radians().sin() / 2_f64.sqrt()).abs() < 1e-6, "{e:?}");
    assert!(errors(&turn(-62.9), door, mesh).are_small(), "5 % of 60 degrees are 3 degrees");
    assert!(errors(&turn(-63.9), door, mesh).are_small(), "5 % of the diagonal are 4.05 degrees");
    assert!(!errors(&turn(-64.2), door, mesh).are_small());
    let opposite = errors(&turn(60.0), door, mesh);
    assert!((opposite.motion - 2.0).abs() < 1e-9, "the wrong direction is an error of twice the motion");

    let beside = Rigid::about(DVec3::Z, DVec3::new(0.1, 0.0, 0.0), -60_f64.to_radians());
    let e = errors(&beside, door, mesh);
    assert!((e.position.unwrap() - 0.1 / 2_f64.sqrt()).abs() < 1e-6 && !e.are_small(), "{e:?}");

    let (drawer, mesh) = (&truth.joints[1], &truth.movable[1][State::START]);
    let e = errors(&Rigid::shift(DVec3::new(0.0, -0.48, 0.0)), drawer, mesh);
    assert!((e.motion - 0.2).abs() < 1e-9 && (e.moved - 0.08 / 2_f64.sqrt()).abs() < 1e-6 && e.position.is_none());
    assert!(errors(&Rigid::shift(DVec3::new(0.0, -0.46, 0.0)), drawer, mesh).are_small());
    let tilted = errors(&Rigid::shift(DVec3::new(0.4 * 0.1, -0.4, 0.0)), drawer, mesh);
    assert!((tilted.axis_deg - 0.1_f64.atan().to_degrees()).abs() < 1e-6 && !tilted.are_small());
}

#[test]
fn axes_that_meet_far_from_the_part_are_apart_at_the_part() {
    let truth = cupboard();
    let (door, mesh) = (&truth.joints[0], &truth.movable[0][State::START]);
    // Skew lines whose shortest distance is zero a hundred units below.
    let axis = DVec3::new(0.2, 0.0, 100.0).normalize();
    let e = errors(&Rigid::about(axis, DVec3::new(0.2, 0.0, 0.5), -60_f64.to_radians()), door, mesh);
    assert!(e.axis_deg < 0.2 && e.position.unwrap() > 0.13, "{e:?}");
}

#[test]
fn screws_are_wrong_in_turn_or_slide() {
    let screw = |turn: f64, slide: f64| {
        let motion = Rigid::about(DVec3::Z, DVec3::ZERO, turn);
        Rigid { translation: motion.translation + slide * DVec3::Z, ..motion }
    };
    let truth = Joint::from_motion(JointKind::Screw, &screw(2.0, 0.5));
    let mesh = &cupboard().movable[0][State::START];
    let e = errors(&screw(2.2, 0.5), &truth, mesh);
    assert!((e.motion - 0.1).abs() < 1e-9 && !e.are_small());
    let e = errors(&screw(2.0, 0.6), &truth, mesh);
    assert!((e.motion - 0.2).abs() < 1e-9 && (e.moved - 0.1 / 2_f64.sqrt()).abs() < 1e-6 && !e.are_small());
    assert!(errors(&screw(2.05, 0.51), &truth, mesh).are_small());
}

#[test]
fn more_than_half_a_circle_is_the_rest_of_it_the_other_way() {
    let door = cupboard();
    let turn = |degrees: f64| Rigid::about(DVec3::Z, DVec3::ZERO, degrees.to_radians());
    let wide = Joint { axis: DVec3::Z, state_values: PerState::new(0.0, 200_f64.to_radians()), ..door.joints[0] };
    let e = errors(&turn(200.0), &wide, &door.movable[0][State::START]);
    assert!(e.motion < 1e-9 && e.are_small(), "{e:?}");
}
