#![allow(clippy::unwrap_used, reason = "tests")]

use super::evidence::{Surfel, residual};
use super::judge::{Judgement, truth};
use super::motion::stretch;
use super::*;
use crate::discover::DiscoverConfig;
use crate::discover::scene::{DepthPicture, Scene};
use crate::evaluate::sample_surface;
use artgs_core::{Joint, JointKind, PerState, Rigid, State};
use artgs_synth::{CaptureOptions, Object, object, render_capture};
use glam::DVec3;
use rand::SeedableRng;

const SETTINGS: ExplainSettings = ExplainSettings { spacing: 1.0, ..ExplainSettings::DEFAULT };

/// Parts of the cupboard, the static one included.
const PARTS: usize = 3;

/// A cupboard with two movable parts.
fn cupboard() -> (Object, Scene) {
    cupboard_off_by(DVec3::ZERO)
}

/// The same; the cameras of the end state are stated too far by `off`.
fn cupboard_off_by(off: DVec3) -> (Object, Scene) {
    let object = object("storage2", 0).unwrap();
    let scene = scene_off_by(&object, off);
    (object, scene)
}

/// What 20 views of each state show; the cameras of the end state are stated too far by `off`.
fn scene_off_by(object: &Object, off: DVec3) -> Scene {
    let options = CaptureOptions { views: 20, test_views: 0, size: 120, ..CaptureOptions::default() };
    let mut capture = render_capture(object, &options).unwrap();
    for view in &mut capture.states[State::END].train {
        view.camera.world_to_camera = view.camera.world_to_camera * Rigid::shift(-off);
    }
    let pictures = PerState::from_fn(|s| {
        let picture = |view| DepthPicture { view, depth: view.depth.as_ref().unwrap() };
        capture.states[s].train.iter().map(picture).collect::<Vec<_>>()
    });
    let config = DiscoverConfig { spacing: 0.012, ..DiscoverConfig::default() };
    Scene::new(pictures.as_ref().map(Vec::as_slice), &config).unwrap()
}

fn true_explanation(object: &Object, problem: &Problem<'_>) -> Explanation {
    true_explanation_of(PARTS, object, problem)
}

fn true_explanation_of(parts: usize, object: &Object, problem: &Problem<'_>) -> Explanation {
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(1);
    let surfaces = PerState::from_fn(|s| {
        (0..parts).map(|k| sample_surface(&object.mesh(k, s), 5000, &mut rng)).collect::<Vec<_>>()
    });
    let motions: Vec<Rigid> = (1..parts).map(|k| object.start_to_end(k)).collect();
    let numbers = vec![5; motions.len()];
    truth(problem, motions, numbers, &surfaces)
}

fn without_parts(like: &Explanation) -> Explanation {
    Explanation {
        motions: Vec::new(),
        numbers: Vec::new(),
        labels: like.labels.as_ref().map(|labels| vec![0; labels.len()]),
    }
}

#[test]
fn a_residual_changes_with_the_shift_of_a_surfel_along_its_normal() {
    let (_, scene) = cupboard();
    let (settings, step) = (ExplainSettings::default(), 4e-3);
    let state = &scene.states[State::START];
    let mut ratios = Vec::new();
    for i in (0..state.cloud.len()).step_by(97) {
        let surfel = Surfel::of(&state.cloud, i);
        let moved = |by: f32| Surfel { point: surfel.point + by * surfel.normal, ..surfel };
        for view in &state.views {
            let at = |by: f32| residual(view, &moved(by), settings.facing).filter(|(r, _)| r.abs() < 0.02);
            let (Some((_, cosine)), Some((near, _)), Some((far, _))) = (at(0.0), at(step), at(-step)) else { continue };
            if cosine > 0.5 {
                let slope = (near - far) / (2.0 * step);
                ratios.push(slope * cosine * stretch(view, surfel.point));
            }
        }
    }
    // The pixel that agrees best is compared, which makes residuals a little smaller.
    let (count, median) = (ratios.len(), crate::trimmed::quantile(ratios, 0.5).unwrap());
    assert!(count > 100 && (0.8..1.05).contains(&median), "{median} of {count}");
}

#[test]
fn true_motions_in_any_order_lead_to_the_labels_of_the_truth() {
    let (object, scene) = cupboard();
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let search = SearchSettings::default();
    let right = true_explanation(&object, &problem);
    let right = problem.settled(&right, &search);
    let least = problem.total(&right, &search);
    for order in [[0, 1], [1, 0]] {
        let started = problem.started(&order.map(|k| right.motions[k]), &search);
        assert_eq!(started.motions.len(), 2);
        let total = problem.total(&started, &search);
        assert!(total < least + 10.0, "{order:?}: {total} {least}");
        let number = |label: u16| label.checked_sub(1).map_or(0, |k| order[usize::from(k)] as u16 + 1);
        let labels = started.labels.iter().flatten().zip(right.labels.iter().flatten());
        let same = labels.clone().filter(|(own, right)| number(**own) == **right).count();
        assert!(same as f64 > 0.97 * labels.count() as f64, "{order:?}: {same}");
    }
    // The same motion twice is one part.
    assert_eq!(problem.started(&[right.motions[0]; 2], &search).motions.len(), 1);
}

#[test]
fn the_truth_has_a_lower_energy_than_wrong_explanations() {
    let (object, scene) = cupboard();
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let right = true_explanation(&object, &problem);
    let least = problem.terms(&right).total();
    let none = problem.terms(&without_parts(&right));
    assert!(none.total() > 2.0 * least && none.border == 0.0 && none.length == 0.0, "{none:?} {least}");
    let mut exchanged = right.clone();
    exchanged.motions.swap(0, 1);
    assert!(problem.terms(&exchanged).total() > 2.0 * least);
    for factor in [0.9, 1.1] {
        let mut farther = right.clone();
        farther.motions[0] = farther.motions[0].power(factor);
        assert!(problem.terms(&farther).total() > least + 20.0, "{factor}");
    }
}

#[test]
fn a_face_that_a_state_hides_is_founded_behind_the_other_face_of_its_part() {
    let closed = PerState::new(4f64.to_radians(), 95f64.to_radians());
    let laptop = object("laptop", 0).unwrap().with_values(1, closed);
    let scene = scene_off_by(&laptop, DVec3::ZERO);
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let right = true_explanation_of(2, &laptop, &problem);
    // Of the open lid the face with the screen, which the closed lid turns away from all views.
    let founded = |problem: &mut Problem<'_>, motion: &Rigid| {
        let seen = problem.evidence(motion);
        let lid = right.labels[State::END].iter().zip(&seen[State::END]).filter(|(part, _)| **part == 1);
        let founded = lid.filter(|(part, seen)| seen.backed && seen.is_founded(**part, &right.labels[State::START]));
        founded.count()
    };
    let lid = right.labels[State::END].iter().filter(|part| **part == 1).count();
    let found = founded(&mut problem, &right.motions[0]);
    assert!(4 * found > lid, "{found} of {lid}");
    let halfway = founded(&mut problem, &right.motions[0].power(0.5));
    assert!(20 * halfway < found, "{halfway} of {found}");
    let hidden = problem.by_part(&right)[1].2;
    let thin = ExplainSettings { hidden: SETTINGS.unseen, ..SETTINGS };
    assert!(4.0 * hidden < Problem::new(&scene, &surfels, thin).by_part(&right)[1].2, "{hidden}");
}

#[test]
fn the_first_labels_of_a_lid_have_the_face_that_one_state_hides() {
    let closed = PerState::new(4f64.to_radians(), 95f64.to_radians());
    let laptop = object("laptop", 0).unwrap().with_values(1, closed);
    let scene = scene_off_by(&laptop, DVec3::ZERO);
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let right = true_explanation_of(2, &laptop, &problem);
    let first = problem.roughly_with(&without_parts(&right), right.motions[0], 0.0);
    let seen = problem.evidence(&right.motions[0]);
    let screen =
        (0..seen[State::END].len()).filter(|&i| right.labels[State::END][i] == 1 && seen[State::END][i].backed);
    let taken = screen.clone().filter(|&i| first.labels[State::END][i] == 1).count();
    assert!(10 * taken > 9 * screen.count(), "{taken}");
}

#[test]
fn a_new_part_replaces_a_moving_part_that_explains_as_much_and_takes_nothing_from_what_rests() {
    let (object, scene) = cupboard();
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let right = true_explanation(&object, &problem);
    let right = problem.relabelled(&right);
    let taken_from = |with: &Explanation, part: u16| {
        let labels = right.labels.iter().flatten().zip(with.labels.iter().flatten());
        let own = labels.filter(|(was, _)| **was == part).map(|(_, now)| usize::from(usize::from(*now) == PARTS));
        own.clone().sum::<usize>() as f64 / own.count() as f64
    };
    let kept = problem.roughly_with(&right, right.motions[0], 0.0);
    let replaced = problem.roughly_with(&right, right.motions[0], SearchSettings::default().yielded);
    assert!(taken_from(&kept, 1) < 0.1 && taken_from(&replaced, 1) > 0.9);
    for other in [0, 2] {
        assert!(taken_from(&replaced, other) < 0.02, "{other}: {}", taken_from(&replaced, other));
    }
}

#[test]
fn labels_follow_from_the_motions_and_never_raise_the_energy() {
    let (object, scene) = cupboard();
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let right = true_explanation(&object, &problem);
    let mut ragged = right.clone();
    ragged.labels.iter_mut().for_each(|labels| labels.iter_mut().step_by(2).for_each(|l| *l = 0));
    let cut = problem.relabelled(&ragged);
    assert!(problem.terms(&cut).total() < problem.terms(&ragged).total());
    let same = |s: State| right.labels[s].iter().zip(&cut.labels[s]).filter(|(a, b)| a == b).count() as f64;
    for s in State::ALL {
        assert!(same(s) > 0.93 * right.labels[s].len() as f64, "{s:?}: {} of {}", same(s), right.labels[s].len());
    }
    let before = problem.terms(&right).total();
    let again = problem.relabelled(&right);
    assert!(problem.terms(&again).total() <= before);
}

#[test]
fn regions_that_gain_take_other_labels_beside_regions_that_do_not() {
    let (object, scene) = cupboard();
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let right = true_explanation(&object, &problem);
    let right = problem.relabelled(&right);
    let least = problem.terms(&right).total();
    // What rests right of the middle moves with the first part in one state, with the second part in the other one.
    let mut wrong = right.clone();
    for s in State::ALL {
        let points = &surfels.clouds[s].points;
        let middle = points.iter().map(|p| p.x).sum::<f32>() / points.len() as f32;
        let part = s.index() as u16 + 1;
        let of = |(label, p): (&mut u16, &glam::Vec3)| *label = if *label == 0 && p.x > middle { part } else { *label };
        wrong.labels[s].iter_mut().zip(points).for_each(of);
    }
    let begun = problem.terms(&wrong).total();
    let cut = problem.relabelled(&wrong);
    let found = problem.terms(&cut).total();
    assert!(begun > 2.0 * least && found < 1.02 * least, "{begun} to {found}, {least}");
}

#[test]
fn a_motion_is_registered_from_both_states() {
    let (object, scene) = cupboard();
    let surfels = Surfels::new(&scene, &SETTINGS);
    let problem = Problem::new(&scene, &surfels, SETTINGS);
    let mut explanation = true_explanation(&object, &problem);
    for part in 1..=2 {
        let right = explanation.motions[part - 1];
        let off = Rigid::shift(DVec3::new(0.001, -0.0015, 0.001)) * Rigid::about(DVec3::Y, DVec3::ZERO, 0.002) * right;
        explanation.motions[part - 1] = off;
        let found = problem.registered(&explanation, part);
        let own = problem.members(&explanation, part as u16);
        let points = own[State::START].iter().map(|i| surfels.clouds[State::START].points[*i].as_dvec3());
        let points: Vec<DVec3> = points.collect();
        let error = |m: &Rigid| points.iter().map(|p| m.apply(*p).distance(right.apply(*p))).sum::<f64>();
        let (before, after) = (error(&off), error(&found.motion));
        assert!(!points.is_empty() && after < 0.7 * before, "{part}: {after} of {before}");
        assert!(found.information.cholesky().is_some());
        explanation.motions[part - 1] = right;
    }
}

#[test]
fn what_errors_of_the_states_have_in_common_is_measured_where_nothing_moved() {
    let common = |off: f64| {
        let (_, scene) = cupboard_off_by(DVec3::splat(off));
        let surfels = Surfels::new(&scene, &SETTINGS);
        f64::from(Problem::new(&scene, &surfels, SETTINGS).common)
    };
    // Along each axis the surfaces are off by 1.5 mm. Of four pixels the one that agrees best is compared, which makes it smaller.
    let (none, some) = (common(0.0), common(0.0015));
    assert!(none < 0.0003 && (0.0005..0.003).contains(&some), "{none} {some}");
    // Errors of many times the deviation of depth are measured, too.
    let more = common(0.008);
    assert!((0.004..0.016).contains(&more), "{more}");
}

#[test]
fn a_region_that_errors_of_poses_took_so_far_is_no_part() {
    const OFF: DVec3 = DVec3::splat(0.0015);
    let (object, scene) = cupboard_off_by(OFF);
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let (search, right) = (SearchSettings::default(), true_explanation(&object, &problem));
    assert!((1..PARTS).all(|part| problem.drift(&right, part) > 1000.0));
    assert!(problem.without_drift(&right, &search).is_none());
    // The left half of the static part moves by the error of the poses.
    let mut more = right.clone();
    more.motions.push(Rigid::shift(OFF));
    more.numbers.push(JointKind::Prismatic.numbers());
    for s in State::ALL {
        let points = &surfels.clouds[s].points;
        let middle = points.iter().map(|p| p.x).sum::<f32>() / points.len() as f32;
        let left = |(label, p): (&mut u16, &glam::Vec3)| *label = if *label == 0 && p.x < middle { 3 } else { *label };
        more.labels[s].iter_mut().zip(points).for_each(left);
    }
    assert!(problem.drift(&more, 3) < 20.0, "{}", problem.drift(&more, 3));
    assert_eq!(problem.without_drift(&more, &search).unwrap().motions, right.motions);
    assert_eq!(problem.without_surplus_parts(&more, &search).motions, right.motions);
}

#[test]
fn a_part_that_is_two_drawers_which_open_nearly_as_far_is_divided_and_a_drawer_is_not() {
    let twins = object("twin_drawers", 0).unwrap();
    let (first, second) = (PerState::new(0.0, 0.20), PerState::new(0.0, 0.19));
    let twins = twins.with_values(1, first).with_values(2, second);
    let scene = scene_off_by(&twins, DVec3::ZERO);
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let search = SearchSettings::default();
    let right = true_explanation_of(3, &twins, &problem);
    let mut one = right.joined(1, 2);
    one.motions[0] = Rigid::shift(0.5 * (right.motions[0].translation + right.motions[1].translation));
    let divided = problem.divided(&one, &search).unwrap();
    assert!(problem.total(&divided, &search) < problem.total(&one, &search));
    assert_eq!(divided.motions.len(), 2);
    for motion in &right.motions {
        let off = divided.motions.iter().map(|m| m.translation.distance(motion.translation));
        let off = off.fold(f64::INFINITY, f64::min);
        assert!(off < 0.002, "{off}: {:?}", divided.motions);
    }
    let settled = problem.settled(&right, &search);
    assert!(problem.divided(&settled, &search).is_none());
}

#[test]
fn a_turn_about_an_axis_far_from_the_object_is_a_slide() {
    let (object, scene) = cupboard();
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let search = SearchSettings::default();
    let right = true_explanation(&object, &problem);
    let slides = |m: &Rigid| m.angle() < 1e-6;
    let drawer = (1..PARTS).find(|k| slides(&right.motions[k - 1])).unwrap();
    let middle = problem.middles(&right)[drawer];
    // It takes the middle of the drawer to the same place.
    let shift = right.motions[drawer - 1].translation;
    let far = middle + 8.0 * shift.normalize().any_orthonormal_vector();
    let axis = (middle - far).cross(shift).normalize();
    let turn = Rigid::about(axis, far, shift.length() / 8.0);
    assert!(turn.apply(middle).distance(middle + shift) < 0.1 * shift.length());
    let started = problem.started(&[turn], &search);
    assert!(started.motions.iter().all(slides), "{:?}", started.motions);
    let mut turned = right.clone();
    turned.motions[drawer - 1] = turn;
    assert!(slides(&problem.fitted(&turned, drawer).motions[drawer - 1]));
    // The door keeps its hinge.
    let door = (1..PARTS).find(|k| *k != drawer).unwrap();
    assert_eq!(problem.possible_motion(&right, door), right.motions[door - 1]);
}

#[test]
fn intervals_of_a_cupboard_hold_the_truth_and_are_small() {
    let (object, scene) = cupboard();
    let found = crate::discover::discover(&scene, 2..=2, &DiscoverConfig::default()).unwrap();
    for (k, part) in found.parts.iter().enumerate() {
        let interval = part.interval.unwrap();
        let joint = part.joint_near(&found.parts, found.middle(k + 1, State::START));
        let truth =
            (1..PARTS).map(|k| object.start_to_end(k)).find(|m| (m.angle() > 0.1) == (part.motion.angle() > 0.1));
        let truth = Joint::from_motion(part.kind, &truth.unwrap()).with_origin_near(joint.origin);
        let tilt = crate::evaluate::axis_angle_deg(joint.axis, truth.axis);
        assert!(tilt < 2.0 * interval.axis_deg && interval.axis_deg < 1.0, "{part:?}: {tilt}");
        assert_eq!(interval.position.is_some(), part.kind == JointKind::Revolute);
    }
}

#[test]
fn the_adversary_finds_a_motion_that_the_supposed_truth_lacks() {
    let (object, scene) = cupboard();
    let surfels = Surfels::new(&scene, &SETTINGS);
    let mut problem = Problem::new(&scene, &surfels, SETTINGS);
    let right = true_explanation(&object, &problem);
    let mut poor = right.clone();
    let removed = poor.motions.pop().unwrap();
    poor.numbers.pop();
    poor.labels.iter_mut().flatten().for_each(|l| *l = (*l).min(1));
    assert_ne!(removed, poor.motions[0]);
    // The found explanation is a source of the adversary's motions.
    let Judgement { truth, found, adversary, added, .. } = problem.judged(&poor, &right, 12, 1);
    assert!(found.total() < truth.total(), "{found:?} {truth:?}");
    assert!(adversary.total() < truth.total() && added[0].0.starts_with("found 2"), "{added:?}");
    let honest = problem.judged(&right, &poor, 12, 1);
    assert!(honest.found.total() > honest.truth.total() && honest.added.is_empty(), "{:?}", honest.added);
}
