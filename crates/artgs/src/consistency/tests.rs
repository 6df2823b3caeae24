use super::*;
use artgs_core::Rigid;
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};
use artgs_synth::{CaptureOptions, object, render_capture};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::PI;

fn capture() -> Capture {
    cabinet_capture(&CabinetOptions { views: 12, size: 120, ..CabinetOptions::default() }).unwrap().0
}

/// The capture with every training view of the `states` changed.
fn changed(states: &[State], change: impl Fn(&mut View)) -> Capture {
    let mut capture = capture();
    for state in states {
        capture.states[*state].train.iter_mut().for_each(&change);
    }
    capture
}

/// What the reader returns where `matrix` replaces every camera-to-world matrix with OpenGL axes.
fn with_matrix(states: &[State], matrix: impl Fn(Rigid) -> Rigid) -> Capture {
    let flip = Rigid::about(DVec3::X, DVec3::ZERO, PI);
    changed(states, |view| {
        let right = view.camera.world_to_camera.inverse() * flip;
        view.camera.world_to_camera = flip * matrix(right).inverse();
    })
}

fn scale_depth(view: &mut View, factor: f32) {
    let depth = view.depth.take().unwrap();
    let values: Vec<f32> = depth.iter().map(|z| z * factor).collect();
    view.depth = Some(artgs_core::DepthMap::nearest(&values));
}

/// The only refusal, which must contain the key words.
fn refusal(capture: &Capture, words: &[&str]) {
    let findings = check_capture(capture).findings();
    let [Finding::Refused(text)] = &findings[..] else { panic!("{findings:?}") };
    words.iter().for_each(|word| assert!(text.contains(word), "{word}: {text}"));
}

#[test]
fn a_right_capture_agrees() {
    let found = check_capture(&capture());
    assert!(found.states.iter().all(|s| s.agreement.unwrap() > 0.9), "{found:?}");
    assert_eq!(found.findings(), []);
}

#[test]
fn wrong_poses_are_named() {
    let flip = Rigid::about(DVec3::X, DVec3::ZERO, PI);
    refusal(&with_matrix(&State::ALL, |m| m * flip), &["both states", "OpenCV", "y and z"]);
    refusal(&with_matrix(&State::ALL, |m| m.inverse()), &["both states", "world-to-camera", "Invert"]);
    refusal(&with_matrix(&State::ALL, |m| (m * flip).inverse()), &["world-to-camera", "OpenCV"]);
    refusal(&with_matrix(&[State::END], |m| m * flip), &["the end state", "OpenCV"]);
    refusal(&with_matrix(&State::ALL, |_| Rigid::IDENTITY), &["both states", "all camera poses are the same"]);
}

/// Poses of other camera frames: the world-to-camera motion is read with axes that are turned by `turn`.
#[test]
fn turned_axes_are_named_with_the_option_that_reads_them() {
    let axes = |x: DVec3, y: DVec3, z: DVec3| Rigid::from_matrix(glam::DMat3::from_cols(x, y, z), DVec3::ZERO);
    // As OpenCV axes: x forward, y left, z up; and images that are turned by a quarter of a turn.
    let robot = axes(DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y);
    let roll = axes(DVec3::Y, DVec3::NEG_X, DVec3::Z);
    let flip = Rigid::about(DVec3::X, DVec3::ZERO, PI);
    for (turn, words) in [
        (robot, &["robot base", "x forward", "z up", "--camera-axes robot"][..]),
        // The same, read with OpenGL axes.
        (robot * flip, &["robot base", "--camera-axes robot"]),
        (roll, &["turned by", "viewing axis", "--camera-axes DLF (DRB in"]),
    ] {
        let read = changed(&State::ALL, |view| {
            let right = view.camera.world_to_camera.inverse();
            view.camera.world_to_camera = (right * turn).inverse();
        });
        let findings = check_recording(read.states[State::START].train.iter()).findings("it");
        let [Finding::Refused(text)] = &findings[..] else { panic!("{findings:?}") };
        words.iter().for_each(|word| assert!(text.contains(word), "{word}: {text}"));
    }
}

#[test]
fn the_unit_of_depth_of_a_recording_is_an_option() {
    let read = changed(&[State::START], |view| {
        let depth = view.depth.take().unwrap();
        // Millimetres that are read as fifths of one.
        let counts = depth.iter().map(|z| (z * 1000.0).round() as u16).collect();
        view.depth = Some(artgs_core::DepthMap::new(counts, 5000.0));
    });
    let findings = check_recording(read.states[State::START].train.iter()).findings("it");
    let [Finding::Refused(text)] = &findings[..] else { panic!("{findings:?}") };
    assert!(
        text.contains("multiplied by 5") && text.contains("--depth-unit mm") && !text.contains("depth_scale"),
        "{text}"
    );
}

#[test]
fn wrong_depth_and_intrinsics_are_named() {
    for (factor, name) in [(1000.0, "by 1000"), (1e-3, "by 0.001"), (0.2, "by 0.2"), (5.0, "by 5")] {
        refusal(&changed(&State::ALL, |view| scale_depth(view, factor)), &["both states", "depth_scale", name]);
    }
    refusal(&changed(&[State::START], |view| scale_depth(view, 5.0)), &["the start state", "depth_scale"]);
    let wider = changed(&State::ALL, |view| {
        (view.camera.intrinsics.fx, view.camera.intrinsics.fy) =
            (view.camera.intrinsics.fx * 1.25, view.camera.intrinsics.fy * 1.25);
    });
    refusal(&wider, &["both states", "focal length"]);
    for state in check_capture(&wider).states {
        let Some(Explained { cause: Cause::FocalLength(factor), .. }) = state.cause else { panic!("{state:?}") };
        assert!((factor * 1.25 - 1.0).abs() < 0.05, "{factor}");
    }
}

#[test]
fn a_mistake_that_does_little_harm_is_suspected() {
    let wider = |factor: f64| {
        changed(&State::ALL, |view| {
            (view.camera.intrinsics.fx, view.camera.intrinsics.fy) =
                (view.camera.intrinsics.fx * factor, view.camera.intrinsics.fy * factor);
        })
    };
    let findings = check_capture(&wider(1.07)).findings();
    let suspected = |f: &Finding| matches!(f, Finding::Warning(text) if text.contains("focal lengths multiplied by"));
    assert!(findings.iter().any(suspected), "{findings:?}");
    assert!(check_capture(&wider(1.0)).states.iter().all(|s| s.suspected.is_none()));
}

#[test]
fn states_with_different_mistakes_are_named_one_by_one() {
    let mut capture = changed(&[State::START], |view| scale_depth(view, 5.0));
    capture.states[State::END].train.iter_mut().for_each(|view| scale_depth(view, 1000.0));
    let findings = check_capture(&capture).findings();
    let [Finding::Refused(start), Finding::Refused(end)] = &findings[..] else { panic!("{findings:?}") };
    assert!(start.contains("the start state") && start.contains("by 5"), "{start}");
    assert!(end.contains("the end state") && end.contains("by 1000"), "{end}");
    // Poses of other views, which no single mistake explains, in one state.
    let mut capture = self::capture();
    let views = &mut capture.states[State::START].train;
    let poses: Vec<Rigid> = views.iter().map(|v| v.camera.world_to_camera).collect();
    let count = views.len();
    views.iter_mut().enumerate().for_each(|(i, view)| view.camera.world_to_camera = poses[(5 * i + 3) % count]);
    let findings = check_capture(&capture).findings();
    let [Finding::Refused(text), ..] = &findings[..] else { panic!("{findings:?}") };
    assert!(text.contains("the start state") && text.contains("no usual mistake"), "{text}");
}

#[test]
fn states_of_different_scales_and_places_are_named() {
    let scaled = changed(&[State::END], |view| {
        view.camera.world_to_camera.translation *= 2.0;
        scale_depth(view, 2.0);
    });
    refusal(&scaled, &["between the two states", "end state multiplied by 0.5", "units"]);
    let apart = changed(&[State::END], |view| {
        view.camera = view.camera.moved_with(&Rigid::about(DVec3::Z, DVec3::new(0.8, 0.0, 0.0), 1.5));
    });
    // Some surfaces agree by chance: whether anything rests is decided after the search for parts.
    let findings = check_capture(&apart).findings();
    let [Finding::Warning(text)] = &findings[..] else { panic!("{findings:?}") };
    assert!(text.contains("between the two states") && text.contains("one frame"), "{text}");
    // Nothing agrees.
    let beside = changed(&[State::END], |view| {
        view.camera = view.camera.moved_with(&Rigid::shift(DVec3::new(0.0, 0.0, 1.1)));
    });
    refusal(&beside, &["between the two states", "different objects", "where both are seen"]);
}

/// A laptop that is closed at the start and open at the end: closed, the lid hides most of what rests.
fn laptop() -> Capture {
    let object = object("laptop", 0).unwrap().with_values(1, PerState::new(4f64.to_radians(), 95f64.to_radians()));
    render_capture(&object, &CaptureOptions { views: 16, test_views: 0, size: 120, ..CaptureOptions::default() })
        .unwrap()
}

#[test]
fn a_lid_that_hides_what_rests_is_a_doubt_and_no_refusal() {
    let found = check_capture(&laptop());
    let shares = (found.across.unwrap(), found.across_shown.unwrap());
    assert!(shares.0 < 0.15 && shares.1 > 5.0 * NOWHERE, "{shares:?}");
    let [Finding::Warning(text)] = &found.findings()[..] else { panic!("{:?}", found.findings()) };
    assert!(text.contains("hides most of what rests") && !text.contains("different objects"), "{text}");
}

#[test]
fn captures_without_depth_are_not_judged() {
    let without = changed(&State::ALL, |view| view.depth = None);
    let found = check_capture(&without);
    assert!(found.states.iter().all(|s| s.agreement.is_none()) && found.findings().is_empty());
}

/// Depths without any surface.
fn noise(view: &mut View, seed: u64) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let depth = view.depth.take().unwrap();
    let values: Vec<f32> = depth.iter().map(|z| if z > 0.0 { random.random_range(0.5..4.0) } else { 0.0 }).collect();
    view.depth = Some(artgs_core::DepthMap::nearest(&values));
}

#[test]
fn poses_and_depths_that_do_not_belong_to_the_images_are_refused() {
    // The pose of the next image.
    let mut shifted = capture();
    for state in &mut shifted.states {
        let poses: Vec<Rigid> = state.train.iter().map(|v| v.camera.world_to_camera).collect();
        let count = poses.len();
        state.train.iter_mut().enumerate().for_each(|(i, v)| v.camera.world_to_camera = poses[(i + 1) % count]);
    }
    refusal(&shifted, &["both states", "no usual mistake", "belong together"]);

    let mut half = capture();
    for state in &mut half.states {
        state.train.iter_mut().step_by(2).for_each(|view| scale_depth(view, 1.1));
    }
    refusal(&half, &["both states", "no usual mistake"]);

    let mut seed = 0;
    let mut noisy = capture();
    for view in noisy.states.iter_mut().flat_map(|s| &mut s.train) {
        seed += 1;
        noise(view, seed);
    }
    refusal(&noisy, &["both states", "12 of 12 images", "(noise)", "16-bit"]);
}

#[test]
fn single_views_that_contradict_the_others_are_named() {
    let mut capture = capture();
    let views = &mut capture.states[State::START].train;
    noise(&mut views[2], 1);
    let other = views[0].camera.world_to_camera;
    views[7].camera.world_to_camera = other;
    let names = [views[2].name.clone(), views[7].name.clone()];
    let found = check_capture(&capture);
    let [Finding::Warning(text)] = &found.findings()[..] else { panic!("{:?}", found.findings()) };
    assert!(text.contains("the start state") && text.contains("2 of 12 images"), "{text}");
    assert!(names.iter().all(|name| text.contains(name.as_str())), "{text}");
    let ignored =
        |state: State| capture.states[state].train.iter().filter(|v| found.states[state].ignores(&v.name)).count();
    assert_eq!((ignored(State::START), ignored(State::END)), (2, 0));
}

#[test]
fn images_copied_from_the_other_state_are_refused() {
    let mut copied = capture();
    let start = copied.states[State::START].train.clone();
    // Images of one state with the poses of other images of it.
    for (i, view) in copied.states[State::END].train.iter_mut().enumerate() {
        view.rgba = start[(i + 1) % start.len()].rgba.clone();
    }
    let found = check_capture(&copied);
    assert!(found.copied > 0.9);
    let refused = |f: &Finding| matches!(f, Finding::Refused(text) if text.contains("copied from"));
    assert!(found.findings().iter().any(refused), "{:?}", found.findings());
    // A capture in which nothing moved, by a simulated camera at the same places.
    copied.states[State::END] = copied.states[State::START].clone();
    assert_eq!(check_capture(&copied).findings(), []);
}

#[test]
fn aligned_recordings_that_hardly_agree_are_doubtful() {
    assert_eq!(check_aligned(&capture()), None);
    let other = changed(&[State::END], |view| scale_depth(view, 0.9));
    let text = check_aligned(&other).unwrap();
    assert!(text.contains("different objects") && text.contains("--box"), "{text}");
}

#[test]
fn all_views_whose_poses_jump_are_named_though_they_lower_the_agreement_of_right_ones() {
    let mut capture = capture();
    let train = &mut capture.states[State::START].train;
    let wrong: Vec<String> = train.iter().skip(1).step_by(4).map(|v| v.name.clone()).collect();
    for (i, view) in train.iter_mut().skip(1).step_by(4).enumerate() {
        let pose = view.camera.world_to_camera.inverse();
        let shift = DVec3::new(0.12, -0.08, 0.05) * (1.0 + i as f64);
        view.camera.world_to_camera = Rigid { translation: pose.translation + shift, ..pose }.inverse();
    }
    let found = check_capture(&capture);
    let named: Vec<&str> = found.states[State::START].odd.views.iter().map(|v| &v.name[..]).collect();
    assert_eq!(named, wrong);
}

/// The start state as a hand-held recording, with the camera-to-world poses of the frames from `first` on shifted by `shift`.
fn recording(first: usize, shift: DVec3) -> Vec<View> {
    let capture = cabinet_capture(&CabinetOptions { views: 24, size: 100, ..CabinetOptions::default() }).unwrap().0;
    let mut left: Vec<View> = capture.states[State::START].train.clone();
    let center = |v: &View| v.camera.world_to_camera.inverse().translation;
    // Neighbours follow each other, as a walk visits them.
    let mut walk = vec![left.remove(0)];
    while !left.is_empty() {
        let last = center(&walk[walk.len() - 1]);
        let nearest = (0..left.len())
            .min_by(|a, b| center(&left[*a]).distance(last).total_cmp(&center(&left[*b]).distance(last)));
        walk.push(left.remove(nearest.unwrap()));
    }
    for view in walk.iter_mut().skip(first) {
        let pose = view.camera.world_to_camera.inverse();
        view.camera.world_to_camera = Rigid { translation: pose.translation + shift, ..pose }.inverse();
    }
    walk
}

#[test]
fn frames_after_a_jump_that_show_nothing_of_the_others_are_ignored_with_a_warning() {
    assert_eq!(check_recording(recording(24, DVec3::ZERO).iter()).apart, None);
    let frames = recording(18, DVec3::new(0.0, 0.0, 40.0));
    let found = check_recording(frames.iter());
    let findings = found.findings("this recording");
    let [Finding::Warning(text)] = &findings[..] else { panic!("{findings:?}") };
    assert!(text.contains("jump by") && text.contains("6 of 24 images") && text.contains(&frames[18].name), "{text}");
    let ignored: Vec<bool> = frames.iter().map(|v| found.ignores(&v.name)).collect();
    assert!(ignored.iter().enumerate().all(|(i, is)| *is == (i >= 18)), "{ignored:?}");
}
