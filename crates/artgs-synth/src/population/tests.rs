//! The population: its physical rules, its variety, and what the truth says of it.

#![allow(clippy::unwrap_used, reason = "tests")]

use super::undecidable::{Reason, of_geometry};
use super::*;
use crate::object::bounds;
use crate::trace::Surface;
use artgs_core::{Joint, State};
use glam::DVec3;
use std::collections::BTreeMap;

/// Looked at by tests; `ARTGS_POPULATION=0..1000` looks at others.
fn seeds() -> std::ops::Range<u64> {
    let asked = std::env::var("ARTGS_POPULATION").ok();
    let range = asked.as_deref().and_then(|text| text.split_once(".."));
    range.map_or(0..40, |(from, to)| from.parse().unwrap()..to.parse().unwrap())
}

#[test]
fn the_same_seed_gives_the_same_object() {
    for seed in seeds().take(10) {
        let [a, b] = [0; 2].map(|_| random_object(seed, 2).unwrap());
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
        assert_eq!(random_object(seed, 4).unwrap().category, a.category);
    }
    assert_ne!(format!("{:?}", random_object(0, 2)), format!("{:?}", random_object(1, 2)));
}

#[test]
fn objects_have_1_to_20_parts_that_move_within_their_limits() {
    for seed in seeds() {
        let drawn = random_object(seed, 3).unwrap();
        let parts = &drawn.object.parts;
        assert!((2..=21).contains(&parts.len()), "{seed}: {} parts", parts.len());
        assert!(parts[0].joint.is_none() && drawn.states() == 3, "{seed}");
        for (index, part) in parts.iter().enumerate().skip(1) {
            let joint: Joint = part.joint.unwrap();
            assert!(part.parent.is_none_or(|p| p > 0 && p < index), "{seed} {}", part.name);
            let [low, high] = joint.limits;
            let values = [joint.state_values[State::START], joint.state_values[State::END], part.further[0]];
            assert!(values.iter().all(|v| (low - 1e-9..=high + 1e-9).contains(v)), "{seed} {}: {values:?}", part.name);
            let moved = values.windows(2).any(|pair| (pair[1] - pair[0]).abs() > 1e-3);
            assert!(moved, "{seed} {}: {values:?}", part.name);
            assert!(!part.pieces.is_empty() && (joint.axis.length() - 1.0).abs() < 1e-9, "{seed} {}", part.name);
        }
        let (low, high) = bounds(parts.iter().flat_map(crate::Part::points));
        let diagonal = (high - low).length();
        assert!((LEAST_DIAGONAL - 1e-9..3.3).contains(&diagonal), "{seed} {}: {diagonal}", drawn.category);
    }
}

#[test]
fn every_surface_is_closed_and_faces_outward() {
    for seed in seeds() {
        let drawn = random_object(seed, 2).unwrap();
        for part in &drawn.object.parts {
            for (index, piece) in part.pieces.iter().enumerate() {
                let name = format!("{seed} {} {} {index}", drawn.category, part.name);
                let mut edges = BTreeMap::new();
                let key = |p: DVec3| (p * 1e7).round().as_i64vec3().to_array();
                let mut volume = 0.0;
                for [a, b, c] in &piece.solid.0 {
                    volume += (a - piece.solid.0[0][0]).dot((b - a).cross(c - a)) / 6.0;
                    for (p, q) in [(a, b), (b, c), (c, a)] {
                        *edges.entry((key(*p), key(*q))).or_insert(0) += 1;
                        *edges.entry((key(*q), key(*p))).or_insert(0) -= 1;
                    }
                }
                assert!(volume > 1e-10, "{name}: volume {volume}");
                assert!(edges.values().all(|n| *n == 0), "{name} is not closed");
            }
        }
    }
}

/// Independent of the test that the generator uses: points of all surfaces are not inside another part.
#[test]
fn no_part_is_inside_another_one_in_any_state() {
    let toward = DVec3::new(0.31, 0.52, 0.79);
    for seed in seeds() {
        let drawn = random_object(seed, 3).unwrap();
        for (first, last) in [(0, 1), (2, 2)] {
            let object = drawn.with_states(first, last);
            for state in State::ALL {
                let surface = Surface::new(&object, state);
                for triangle in 0..surface.len() {
                    let [a, b, c] = surface.corners(triangle);
                    let (own, _) = surface.owner(triangle);
                    for weights in [[0.34, 0.33, 0.33], [0.9, 0.05, 0.05], [0.05, 0.9, 0.05], [0.05, 0.05, 0.9]] {
                        let p = a * weights[0] + b * weights[1] + c * weights[2];
                        for other in (0..object.parts.len()).filter(|o| *o != own) {
                            let inside = surface.depth_inside(p, toward, other) > 0;
                            let [one, two] = [own, other].map(|part| &object.parts[part].name);
                            assert!(!inside, "{seed} {} state {first}: {one} in {two}", drawn.category);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn what_views_cannot_decide_is_marked() {
    use crate::object::Part;
    use crate::shape::{cuboid, cylinder};
    use crate::{Material, Object};
    let grey = Material::Plain { color: [0.5; 3] };
    let base = || Part::fixed("base").with(grey, cuboid([-1.0, 0.0, 0.0], [1.0, 1.0, 1.0]));
    let drawer = |name: &str, x: f64, by: f64| {
        Part::sliding(name, DVec3::NEG_Y, [0.0, by]).with(grey, cuboid([x, -0.1, 0.0], [x + 0.3, -0.01, 0.3]))
    };
    let reasons = |parts: Vec<Part>| {
        let object = Object::new("test", parts, false, 1);
        of_geometry(&object, 0.01).into_iter().map(|u| (u.reason, u.parts)).collect::<Vec<_>>()
    };
    // Side by side with the same motion, farther apart, with another motion.
    assert_eq!(
        reasons(vec![base(), drawer("a", 0.0, 0.2), drawer("b", 0.304, 0.2)]),
        [(Reason::EqualMotion, vec![1, 2])]
    );
    assert_eq!(reasons(vec![base(), drawer("a", 0.0, 0.2), drawer("b", 0.34, 0.2)]), []);
    assert_eq!(reasons(vec![base(), drawer("a", 0.0, 0.2), drawer("b", 0.304, 0.21)]), []);
    let knob = |material: Material, pointer: bool| {
        let mut knob = Part::hinged("knob", DVec3::NEG_Y, [0.0, -0.1, 0.5], [0.0, 45.0]);
        knob.add(material, cylinder(0.2, 0.0, 0.1).facing_front().shifted([0.0, -0.05, 0.5]));
        if pointer {
            knob.add(material, cuboid([-0.02, -0.2, 0.5], [0.02, -0.15, 0.69]));
        }
        knob
    };
    let speckle = Material::Speckle { base: [0.5; 3], spots: [0.2; 3], size: 0.05 };
    assert_eq!(reasons(vec![base(), knob(grey, false)]), [(Reason::Revolution, vec![1])]);
    assert_eq!(reasons(vec![base(), knob(grey, true)]), []);
    assert_eq!(reasons(vec![base(), knob(speckle, false)]), []);
    let object = Object::new("test", vec![base(), drawer("a", 0.0, 0.2)], false, 1);
    let unseen = super::undecidable::of_views(&object, &[vec![900, 29], vec![900, 400]]);
    assert_eq!(unseen.iter().map(|u| (u.reason, u.parts.clone())).collect::<Vec<_>>(), [(Reason::Unseen, vec![1])]);
}

/// Numbers for the book: `ARTGS_POPULATION=0..1000 cargo test -p artgs-synth population::tests::variety -- --nocapture`.
#[test]
fn variety() {
    let (mut categories, mut features, mut parts) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    let count = seeds().count();
    for seed in seeds() {
        let drawn = random_object(seed, 2).unwrap();
        let (_, recorded) = random_capture(seed, &RandomOptions::default());
        *categories.entry(drawn.category).or_insert(0) += 1;
        *parts.entry(drawn.object.parts.len() - 1).or_insert(0) += 1;
        for feature in drawn.features.iter().chain(&recorded) {
            *features.entry(*feature).or_insert(0) += 1;
        }
    }
    let lines = format!("{count} objects\n{categories:?}\n{features:?}\nparts {parts:?}");
    let _ = std::io::Write::write_all(&mut std::io::stderr(), lines.as_bytes());
    assert!(categories.len() > 8 && features.len() > 25 && parts.len() > 4, "{lines}");
}

/// Seeds that are recorded with few views.
fn quick(device: Device) -> impl Iterator<Item = u64> {
    let views = move |seed: u64| match random_capture(seed, &RandomOptions { device, ..RandomOptions::default() }).0 {
        RandomCapture::Exact(options) => options.views,
        RandomCapture::Room { options, .. } => options.views,
    };
    (0..200).filter(move |seed| views(*seed) <= 32)
}

#[test]
fn written_objects_are_read_back_with_all_their_states() {
    for device in [Device::Exact, Device::Room] {
        let seed = quick(device).next().unwrap();
        let options = RandomOptions { device, size: Some(64), states: Some(3), test_views: 0, still: false };
        let dir = tempfile::tempdir().unwrap();
        let info = write_random(seed, &options, dir.path()).unwrap();
        assert_eq!((random_info(dir.path()), info.states), (Some(info.clone()), 3));
        let truth = artgs_io::load_ground_truth(&dir.path().join("gt")).unwrap();
        assert_eq!(truth.joints.len() + 1, info.parts);
        let json: serde_json::Value =
            serde_json::from_slice(&std::fs::read(dir.path().join("gt/trans.json")).unwrap()).unwrap();
        assert_eq!(json["population"]["seed"], seed);
        assert_eq!(json["population"]["pixels"].as_array().unwrap().len(), 3);
        assert!(json["trans_info"].as_array().unwrap().iter().all(|t| t["states"].as_array().unwrap().len() == 3));
        assert!(dir.path().join("gt/state_2/state_2_static_rotate.ply").is_file());
        if device == Device::Exact {
            let capture = artgs_io::load_capture(dir.path()).unwrap();
            assert_eq!(capture.warnings, Vec::<String>::new());
            assert!(dir.path().join("transforms_train_state_2.json").is_file());
            assert!(dir.path().join("state_2/train/rgba/0000.png").is_file());
        } else {
            let read = |state: &str| {
                artgs_io::recording::load_recording(&dir.path().join(state), &Default::default()).unwrap().frames.len()
            };
            assert_eq!(read("start"), read("state_2"));
            assert!(artgs_io::recording::RecordingFormat::of_two_states(dir.path()).is_some());
        }
    }
}

#[test]
fn a_still_object_is_as_its_start_in_all_states() {
    let (moved, still) = (random_object(5, 3).unwrap(), still_object(5, 3).unwrap());
    assert_eq!((still.category, still.object.parts.len()), (moved.category, 1));
    // The same surface as that of all parts at the start, up to rounding of where pieces were moved.
    let corners = |object: &Object, state| {
        let points = (0..object.parts.len()).flat_map(|part| object.mesh(part, state).vertices);
        bounds(points.map(|v| DVec3::from_array(v.map(f64::from))))
    };
    let start = corners(&moved.object, State::START);
    for state in State::ALL {
        let now = corners(&still.object, state);
        // Each object is placed by the middle of its own box.
        assert!(((now.1 - now.0) - (start.1 - start.0)).length() < 0.05, "{now:?} {start:?}");
    }
    assert_eq!(corners(&still.object, State::START), corners(&still.object, State::END));

    let dir = tempfile::tempdir().unwrap();
    let options = RandomOptions { device: Device::Exact, size: Some(32), still: true, ..RandomOptions::default() };
    let info = write_random(5, &options, dir.path()).unwrap();
    assert_eq!((info.parts, info.still), (1, true));
    assert_eq!(artgs_io::load_ground_truth(&dir.path().join("gt")).unwrap().joints.len(), 0);
    let again = write_random(5, &RandomOptions { still: false, ..options }, dir.path()).unwrap();
    assert!(again.parts > 1, "a folder of a still object is not kept for one that moves");
}

#[test]
fn the_device_does_not_change_the_object() {
    let drawn = |device: Device| {
        let (capture, features) = random_capture(7, &RandomOptions { device, ..RandomOptions::default() });
        (capture.sensor(), features.contains("own-frames"))
    };
    assert_eq!(drawn(Device::Exact).0, "exact");
    let (sensor, own_frames) = drawn(Device::Room);
    assert_ne!(sensor, "exact");
    // Drift and frames of a room are drawn by the seed, whether the device is asked for or drawn.
    let asked = drawn(Device::Sensor(crate::recording::Sensor::from_name(sensor).unwrap()));
    assert_eq!(asked, (sensor, own_frames));
}

#[test]
fn bad_numbers_of_states_are_refused() {
    for states in [0, 1, 101] {
        assert!(matches!(random_object(3, states), Err(crate::SynthError::Options(_))));
    }
}
