//! From bodies with values to an object: what rests becomes a piece of what carries it, and features are found.

use super::looks::Looks;
use super::model::{Body, Model};
use super::states::is_moved;
use super::{LEAST_DIAGONAL, RandomObject};
use crate::light::LightQuality;
use crate::object::{Part, bounds};
use crate::{Material, Object};
use artgs_core::{JointKind, Rigid, State};
use std::collections::BTreeSet;

/// Words of names of parts and the features that they stand for.
const WORDS: [(&str, &str); 8] = [
    ("drawer", "drawer"),
    ("door", "door"),
    ("flap", "flap"),
    ("panel", "sliding-panel"),
    ("tray", "tray"),
    ("dial", "dial"),
    ("lid", "lid"),
    ("sash", "sash"),
];
/// Parts smaller than this share of the object's diagonal are small.
const SMALL: f64 = 0.15;

/// The object of a model whose bodies have these values in all states.
pub(super) fn assemble(model: Model, looks: &Looks, values: Vec<Vec<f64>>, seed: u64) -> RandomObject {
    let rested = (1..model.bodies.len()).any(|b| !is_moved(&values[b]));
    let Model { category, bodies, mut features } = model;
    let (bodies, values) = merged(bodies, values);
    // Marks of the makers that are of parts are found again: some of these parts rest now.
    features.retain(|f| !["dial", "small", "symmetric", "screw", "chain", "tray", "flap", "sliding-panel"].contains(f));
    if rested {
        features.insert("resting");
    }
    features.insert(looks.family.name());
    if looks.is_equal() {
        features.insert("equal-materials");
    }
    add_features_of_values(&bodies, &values, &mut features);
    add_features_of_bodies(&bodies, looks, &mut features);
    let parts = bodies.iter().zip(&values).map(|(body, values)| part(body, values)).collect();
    let object = Object::with_diagonal(category, parts, [LEAST_DIAGONAL, f64::INFINITY], seed);
    let object = Object { light: LightQuality::COARSE, ..object };
    RandomObject { category, object, features }
}

/// Bodies that rest become pieces of their parents, in the order of the bodies.
fn merged(mut bodies: Vec<Body>, mut values: Vec<Vec<f64>>) -> (Vec<Body>, Vec<Vec<f64>>) {
    let mut body = bodies.len();
    while body > 1 {
        body -= 1;
        if is_moved(&values[body]) {
            continue;
        }
        let resting = bodies.remove(body);
        let value = values.remove(body)[0];
        let motion = resting.mechanism.as_ref().map_or(Rigid::IDENTITY, |m| m.joint([0.0; 2]).motion(value));
        for piece in resting.pieces {
            let solid = piece.solid.moved(&motion);
            bodies[resting.parent].add(piece.material, solid);
        }
        let carried: Vec<usize> = (1..bodies.len()).filter(|&b| descends(&bodies, b, body)).collect();
        carried.into_iter().for_each(|b| carry(&mut bodies[b], &motion));
        for child in &mut bodies[1..] {
            child.parent = match child.parent {
                p if p == body => resting.parent,
                p if p > body => p - 1,
                p => p,
            };
        }
    }
    (bodies, values)
}

/// True if a body is carried by the one that had the index `ancestor` before it was removed, directly or not. Parents have the old
/// indices.
fn descends(bodies: &[Body], body: usize, ancestor: usize) -> bool {
    let mut parent = bodies[body].parent;
    while parent > ancestor {
        parent = bodies[parent - 1].parent;
    }
    parent == ancestor
}

/// Moves a body whose carrier has moved from its closed place.
fn carry(body: &mut Body, motion: &Rigid) {
    for piece in &mut body.pieces {
        piece.solid = std::mem::take(&mut piece.solid).moved(motion);
    }
    if let Some(mechanism) = &mut body.mechanism {
        mechanism.axis = motion.turn(mechanism.axis);
        mechanism.origin = motion.apply(mechanism.origin);
    }
}

fn part(body: &Body, values: &[f64]) -> Part {
    let joint = body.mechanism.as_ref().map(|m| m.joint([values[0], values[1]]));
    let parent = (body.parent > 0).then_some(body.parent);
    let further = if joint.is_some() { values[2..].to_vec() } else { Vec::new() };
    Part { name: body.name.clone(), pieces: body.pieces.clone(), joint, parent, further }
}

/// Features of the values.
fn add_features_of_values(bodies: &[Body], values: &[Vec<f64>], features: &mut BTreeSet<&'static str>) {
    let natural: Vec<(f64, [f64; 2])> = (1..bodies.len())
        .filter_map(|b| {
            Some((bodies[b].mechanism.as_ref().filter(|m| m.rests_closed)?.range[0], [values[b][0], values[b][1]]))
        })
        .collect();
    let opens = natural.iter().any(|(_, [a, b])| b > a);
    let closes = natural.iter().any(|(_, [a, b])| b < a);
    if opens && closes {
        features.insert("opening-and-closing");
    }
    if natural.iter().any(|(closed, pair)| pair.iter().all(|v| *v > *closed)) {
        features.insert("open-in-both");
    }
    if natural.iter().any(|(closed, pair)| pair.contains(closed)) {
        features.insert("closed-in-one");
    }
    let equal = |a: usize, b: usize| {
        bodies[a].parent == bodies[b].parent
            && bodies[a].group.is_some()
            && bodies[a].group == bodies[b].group
            && values[a] == values[b]
    };
    if (1..bodies.len()).any(|a| (a + 1..bodies.len()).any(|b| equal(a, b))) {
        features.insert("equal-motion");
    }
}

/// Features of the bodies that move.
fn add_features_of_bodies(bodies: &[Body], looks: &Looks, features: &mut BTreeSet<&'static str>) {
    let (low, high) = bounds(bodies.iter().flat_map(Body::points));
    let diagonal = (high - low).length();
    for (index, body) in bodies.iter().enumerate().skip(1) {
        let Some(mechanism) = &body.mechanism else { continue };
        features.insert(match mechanism.kind {
            JointKind::Revolute => "hinge",
            JointKind::Prismatic => "slide",
            JointKind::Screw => "screw",
        });
        if let Some((_, feature)) = WORDS.iter().find(|(word, _)| body.name.contains(word)) {
            features.insert(feature);
        }
        if body.parent > 0 {
            features.insert("chain");
        }
        let (low, high) = bounds(body.points());
        if (high - low).max_element() < SMALL * diagonal {
            features.insert("small");
        }
        let twin = |other: &Body| other.group.is_some() && other.group == body.group;
        if looks.fronts_look_alike() && bodies[1..index].iter().any(twin) {
            features.insert("look-alike");
        }
        if body.pieces.iter().all(|p| matches!(p.material, Material::Plain { .. })) {
            features.insert("plain-part");
        }
    }
}

impl RandomObject {
    /// The object with two other of its states as its start and end.
    pub(super) fn with_states(&self, start: usize, end: usize) -> Object {
        let mut object = self.object.clone();
        for part in &mut object.parts {
            let Some(joint) = &mut part.joint else { continue };
            let first = [joint.state_values[State::START], joint.state_values[State::END]];
            let all: Vec<f64> = first.into_iter().chain(part.further.iter().copied()).collect();
            joint.state_values = artgs_core::PerState::new(all[start], all[end]);
            part.further = first.into_iter().chain(part.further.iter().copied()).collect();
        }
        object
    }

    /// Number of states.
    pub fn states(&self) -> usize {
        2 + self.object.parts.iter().map(|part| part.further.len()).max().unwrap_or(0)
    }
}
