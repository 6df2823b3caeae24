//! The objects.

use crate::trace::Surface;
use crate::{Object, SUITES, SynthError, object, objects, suite};
use artgs_core::{JointKind, State};
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;

fn all() -> impl Iterator<Item = Object> {
    objects().iter().map(|info| object(info.name, 0).unwrap())
}

#[test]
fn suites_hold_what_the_paper_lists() {
    let count = |name: &str| suite(name).unwrap().len();
    assert_eq!(["paris", "dta", "multi", "paper", "hard", "real-like"].map(count), [10, 2, 5, 17, 14, 22]);
    assert!(SUITES.iter().all(|name| suite(name).is_some()) && suite("sofa").is_none());
    let error = object("sofa", 0).unwrap_err();
    assert!(matches!(&error, SynthError::Unknown { .. }) && error.to_string().contains("foldchair"), "{error}");
    let mut names = suite("all").unwrap();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), objects().len());
}

#[test]
fn every_object_has_the_stated_parts_and_joints_that_move() {
    for (info, object) in objects().iter().zip(all()) {
        assert_eq!((info.name, info.parts()), (object.name, object.parts.len()));
        let kinds: Vec<JointKind> = object.parts.iter().filter_map(|p| Some(p.joint?.kind)).collect();
        assert_eq!(kinds, info.joints, "{}", info.name);
        assert!(object.parts[0].joint.is_none() && object.parts.len() < 255);
        for (index, part) in object.parts.iter().enumerate().skip(1) {
            assert!(part.parent.is_none_or(|p| p < index), "{} {}", info.name, part.name);
            let joint = object.world_joint(index).unwrap();
            let (by, least) = match joint.kind {
                JointKind::Prismatic => (joint.state_values[State::END] - joint.state_values[State::START], 0.04),
                _ => (joint.state_values[State::END] - joint.state_values[State::START], 0.45),
            };
            assert!(by.abs() > least, "{} {}: moves by {by} only", info.name, part.name);
            assert!((joint.axis.length() - 1.0).abs() < 1e-12);
        }
        if info.scaled {
            let (_, radius) = object.ball();
            assert!((0.45..1.2).contains(&radius), "{} {radius}", info.name);
        }
    }
}

#[test]
fn every_surface_is_closed_and_faces_outward() {
    for object in all() {
        for part in &object.parts {
            for (index, piece) in part.pieces.iter().enumerate() {
                let name = format!("{} {} {index}", object.name, part.name);
                let mut edges = BTreeMap::new();
                let key = |p: DVec3| (p * 1e8).round().as_i64vec3().to_array();
                let mut volume = 0.0;
                for [a, b, c] in &piece.solid.0 {
                    let area = (b - a).cross(c - a).length() / 2.0;
                    assert!(area > 1e-9, "{name}: triangle {a} {b} {c}");
                    volume += (a - piece.solid.0[0][0]).dot((b - a).cross(c - a)) / 6.0;
                    for (p, q) in [(a, b), (b, c), (c, a)] {
                        *edges.entry((key(*p), key(*q))).or_insert(0) += 1;
                        *edges.entry((key(*q), key(*p))).or_insert(0) -= 1;
                    }
                }
                assert!(volume > 1e-9, "{name}: volume {volume}");
                assert!(edges.values().all(|n| *n == 0), "{name} is not closed");
            }
        }
    }
}

#[test]
fn the_start_part_moved_by_the_true_joint_is_the_end_part() {
    for object in all() {
        for part in 0..object.parts.len() {
            let joint = object.world_joint(part);
            let own = joint.map_or(artgs_core::Rigid::IDENTITY, |j| j.start_to_end());
            let motion = object.parts[part].parent.map_or(own, |p| object.start_to_end(p) * own);
            let (moved, end) = (object.mesh(part, State::START).moved(&motion), object.mesh(part, State::END));
            for (a, b) in moved.vertices.iter().zip(&end.vertices) {
                let distance = (Vec3::from(*a) - Vec3::from(*b)).length();
                assert!(distance < 1e-5, "{} part {part}: {distance}", object.name);
            }
            assert_eq!(object.mesh(part, State::START) == end, part == 0, "{} part {part}", object.name);
        }
    }
}

#[test]
fn parts_do_not_penetrate_each_other_in_either_state() {
    let toward = DVec3::new(0.31, 0.52, 0.79);
    for object in all() {
        for state in State::ALL {
            let surface = Surface::new(&object, state);
            for triangle in 0..surface.len() {
                let [a, b, c] = surface.corners(triangle);
                let (own, piece) = surface.owner(triangle);
                let steps = (a.distance(b).max(c.distance(a)) / 0.03).ceil() as usize + 1;
                for (i, j) in (0..=steps).flat_map(|i| (0..=steps - i).map(move |j| (i, j))) {
                    let p = a + (b - a) * (i as f64 / steps as f64) + (c - a) * (j as f64 / steps as f64);
                    for other in (0..object.parts.len()).filter(|o| *o != own) {
                        let inside = surface.depth_inside(p, toward, other) > 0;
                        assert!(!inside, "{} {}: part {own} piece {piece} in part {other}", object.name, state.name());
                    }
                }
            }
        }
    }
}

#[test]
fn neighbours_are_a_centimetre_apart_and_sheets_three_millimetres_thick() {
    let near = object("near_drawers", 0).unwrap();
    let across = |part: usize| {
        let front = near.parts[part].pieces[0].solid.0.as_flattened();
        front.iter().map(|p| p.x).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
    };
    assert!((across(2).0 - across(1).1 - 0.01).abs() < 1e-12);
    let thin = object("thin_door", 0).unwrap();
    let y = thin.parts[1].pieces[0].solid.0.as_flattened().iter().map(|p| p.y);
    let (low, high) = y.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
    assert!((high - low - 0.003).abs() < 1e-12);
    let wide = object("wide_door", 0).unwrap();
    assert!((wide.start_to_end(1).angle().to_degrees() - 120.0).abs() < 1e-9);
    let twin = object("twin_drawers", 0).unwrap();
    assert!((twin.start_to_end(1).translation - twin.start_to_end(2).translation).length() < 1e-12);
}
