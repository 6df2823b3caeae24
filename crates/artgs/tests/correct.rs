//! Cameras of captures whose states share a frame are corrected where depth shows that they are wrong.

use artgs::align::{AlignConfig, Correction, correct};
use artgs_core::{Capture, PerState, Rigid, State};
use artgs_synth::population::random_object;
use artgs_synth::{CaptureOptions, Degradation, object, render_capture};

fn capture(degradation: Degradation) -> Capture {
    let storage = object("storage2", 0).expect("the object exists");
    let options = CaptureOptions { views: 48, test_views: 0, size: 240, degradation, ..CaptureOptions::default() };
    render_capture(&storage, &options).expect("it is rendered")
}

/// Root mean squares of the angles in degrees between the cameras of two captures, and of the distances between the places
/// where they see the object's centre.
fn difference(a: &Capture, b: &Capture, state: State) -> (f64, f64) {
    let pairs = a.states[state].train.iter().zip(&b.states[state].train);
    let (mut angle, mut length, mut count) = (0.0, 0.0, 0.0);
    for (a, b) in pairs {
        let off = a.camera.world_to_camera.inverse() * b.camera.world_to_camera;
        angle += off.angle().to_degrees().powi(2);
        length += off.translation.length_squared();
        count += 1.0;
    }
    (f64::sqrt(angle / count), f64::sqrt(length / count))
}

fn corrected(degradation: Degradation) -> (Capture, Correction) {
    let mut given = capture(degradation);
    let correction = correct(&mut given, &AlignConfig::default());
    (given, correction)
}

#[test]
fn exact_cameras_are_kept_with_exact_and_with_noisy_depth() {
    for depth_noise in [0.0, 0.002] {
        let degradation = Degradation { depth_noise, ..Degradation::default() };
        let (kept, correction) = corrected(degradation);
        assert!(correction.is_none(), "{correction:?}");
        assert!(kept.frames.is_none() && kept.warnings.is_empty());
        for state in State::ALL {
            assert!(difference(&kept, &capture(degradation), state).1 < 1e-9);
        }
    }
}

#[test]
fn jitter_of_the_cameras_is_reduced() {
    let degradation = Degradation { pose_deg: 0.3, pose_shift: 0.005, ..Degradation::default() };
    let (found, correction) = corrected(degradation);
    let truth = capture(Degradation::default());
    for state in State::ALL {
        assert!(correction.poses[state].is_some_and(|[before, after]| after < 0.4 * before), "{correction:?}");
        let (given, left) = (difference(&capture(degradation), &truth, state), difference(&found, &truth, state));
        assert!(left.0 < 0.9 * given.0 && left.1 < 0.5 * given.1, "{given:?} {left:?}");
    }
    assert!(!found.warnings.is_empty());
}

#[test]
fn a_small_misalignment_of_the_end_state_is_removed() {
    let degradation = Degradation { misalign_deg: 3.0, misalign_shift: 0.04, ..Degradation::default() };
    let (found, correction) = corrected(degradation);
    let truth = capture(Degradation::default());
    assert!(difference(&found, &truth, State::START).1 < 1e-9);
    let (angle, length) = difference(&found, &truth, State::END);
    assert!(angle < 0.05 && length < 0.003, "{angle} {length} {correction:?}");
    let end = correction.end.expect("the end state was moved");
    assert_eq!(found.frames.expect("it is noted")[State::END], end.motion);
    assert!(end.agreement[1] > 1.3 * end.agreement[0]);
    // The alignment of a capture that states its frames is known.
    let mut aligned = capture(degradation);
    aligned.frames = Some(PerState::new(Rigid::IDENTITY, Rigid::IDENTITY));
    assert!(correct(&mut aligned, &AlignConfig::default()).is_none());
}

#[test]
fn exposure_and_white_balance_of_the_views_are_equalised() {
    let truth = capture(Degradation::default());
    let mut given = truth.clone();
    let gain = |i: usize, channel: usize| {
        let i = i as f32;
        (1.0 + 0.25 * (0.9 * i).sin()) * [1.0 + 0.05 * (0.4 * i).cos(), 1.0, 1.0 - 0.05 * (0.4 * i).cos()][channel]
    };
    for (i, view) in given.states.iter_mut().flat_map(|s| &mut s.train).enumerate() {
        for color in &mut view.rgba {
            (0..3).for_each(|c| color[c] = (f32::from(color[c]) * gain(i, c)).round().min(255.0) as u8);
        }
    }
    let correction = correct(&mut given, &AlignConfig::default());
    let exposure = correction.exposure.expect("the gains differ");
    assert!(correction.end.is_none() && correction.poses.iter().all(Option::is_none), "{correction:?}");
    assert!(exposure.gains[0] < 0.8 && exposure.gains[1] > 1.2, "{exposure:?}");
    assert!(exposure.disagreement[1] < 0.03 && exposure.disagreement[0] > 0.1, "{exposure:?}");
    let views = |c: &Capture| c.states.iter().flat_map(|s| s.train.clone()).collect::<Vec<_>>();
    let (found, truth) = (views(&given), views(&truth));
    for channel in 0..3 {
        let mean = |view: &artgs_core::View| {
            let used = view.rgba.iter().filter(|p| p[3] == 255).map(|p| f64::from(p[channel]));
            used.clone().sum::<f64>() / used.count() as f64
        };
        let ratios: Vec<f64> = found.iter().zip(&truth).map(|(f, t)| mean(f) / mean(t)).collect();
        let middle = ratios.iter().sum::<f64>() / ratios.len() as f64;
        let spread = (ratios.iter().map(|r| (r / middle - 1.0).powi(2)).sum::<f64>() / ratios.len() as f64).sqrt();
        assert!(spread < 0.02 && (middle - 1.0).abs() < 0.06, "channel {channel}: {middle} {spread}");
    }
    assert!(given.warnings.iter().any(|w| w.contains("white balance")), "{:?}", given.warnings);
}

#[test]
fn a_lid_that_closes_on_its_base_leaves_the_end_state_where_it_is() {
    // The sides of the base agree, 8 % of what is compared; moved by the thickness of the lid, the lid agrees with the base.
    let laptop = random_object(1249, 2).expect("the object exists").object;
    let options = CaptureOptions { views: 48, test_views: 0, size: 320, ..CaptureOptions::default() };
    let correction = correct(&mut render_capture(&laptop, &options).expect("it is rendered"), &AlignConfig::default());
    assert!(correction.end.is_none(), "{correction:?}");
}
