//! Cameras of captures whose states share a frame are corrected where depth shows that they are wrong.

use artgs::align::{AlignConfig, Correction, correct};
use artgs_core::{Capture, State};
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
}
