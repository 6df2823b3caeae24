//! An object before its states are drawn: bodies with mechanisms.

use super::dice::Dice;
use super::looks::Looks;
use crate::object::bounds;
use crate::{Material, Solid, object::Piece};
use artgs_core::{Joint, JointKind, PerState};
use glam::DVec3;
use std::collections::BTreeSet;

/// How a body can move against the one that carries it. Object frame with all joints at 0, closed.
#[derive(Clone, Debug)]
pub(super) struct Mechanism {
    pub(super) kind: JointKind,
    /// Unit axis; positive values open.
    pub(super) axis: DVec3,
    /// A point of the axis.
    pub(super) origin: DVec3,
    /// Slide per radian, metres; screws only.
    pub(super) pitch: f64,
    /// Closed and widest value, radians or metres.
    pub(super) range: [f64; 2],
    /// Least change between two states, radians or metres.
    pub(super) least: f64,
    /// It is closed unless this body has at least this value: a rack behind a door.
    pub(super) behind: Option<(usize, f64)>,
    /// Things with a natural closed position are found there; others are found anywhere in their range.
    pub(super) rests_closed: bool,
}

/// A rigid body.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) name: String,
    pub(super) pieces: Vec<Piece>,
    /// None for what stands on the floor.
    pub(super) mechanism: Option<Mechanism>,
    /// The body that carries it; body 0 if it is the static part.
    pub(super) parent: usize,
    /// Bodies of one group have the same size and kind.
    pub(super) group: Option<usize>,
}

/// An object without states. Body 0 is static.
pub(super) struct Model {
    pub(super) category: &'static str,
    pub(super) bodies: Vec<Body>,
    pub(super) features: BTreeSet<&'static str>,
}

impl Mechanism {
    pub(super) fn hinge(axis: DVec3, origin: impl Into<DVec3>, range_deg: [f64; 2], least_deg: f64) -> Self {
        Self {
            kind: JointKind::Revolute,
            axis: axis.normalize(),
            origin: origin.into(),
            pitch: 0.0,
            range: range_deg.map(f64::to_radians),
            least: least_deg.to_radians(),
            behind: None,
            rests_closed: true,
        }
    }

    pub(super) fn slide(axis: DVec3, range: [f64; 2], least: f64) -> Self {
        Self { kind: JointKind::Prismatic, range, least, ..Self::hinge(axis, DVec3::ZERO, [0.0; 2], 0.0) }
    }

    /// Found anywhere in its range, as a lamp is.
    pub(super) fn anywhere(self) -> Self {
        Self { rests_closed: false, ..self }
    }

    pub(super) fn behind(self, door: usize, least: f64) -> Self {
        Self { behind: Some((door, least)), ..self }
    }

    /// The joint with two of its values.
    pub(super) fn joint(&self, values: [f64; 2]) -> Joint {
        Joint {
            kind: self.kind,
            axis: self.axis,
            origin: self.origin,
            pitch: self.pitch,
            state_values: PerState::new(values[0], values[1]),
            limits: self.range,
        }
    }
}

impl Body {
    pub(super) fn new(name: impl Into<String>, parent: usize, mechanism: Mechanism) -> Self {
        Self { mechanism: Some(mechanism), parent, ..Self::fixed(name) }
    }

    pub(super) fn fixed(name: impl Into<String>) -> Self {
        Self { name: name.into(), pieces: Vec::new(), mechanism: None, parent: 0, group: None }
    }

    pub(super) fn add(&mut self, material: Material, solid: Solid) {
        self.pieces.push(Piece { solid, material });
    }

    pub(super) fn with(mut self, material: Material, solid: Solid) -> Self {
        self.add(material, solid);
        self
    }

    pub(super) fn points(&self) -> impl Iterator<Item = DVec3> {
        self.pieces.iter().flat_map(|p| p.solid.0.iter().flatten().copied())
    }

    /// Shifts its pieces and its axis.
    pub(super) fn shift(&mut self, by: DVec3) {
        for piece in &mut self.pieces {
            piece.solid = std::mem::take(&mut piece.solid).shifted(by.to_array());
        }
        if let Some(mechanism) = &mut self.mechanism {
            mechanism.origin += by;
        }
    }
}

impl Model {
    pub(super) fn new(category: &'static str, base: Body) -> Self {
        Self { category, bodies: vec![base], features: BTreeSet::new() }
    }

    /// Adds a body; returns its index.
    pub(super) fn push(&mut self, body: Body) -> usize {
        self.bodies.push(body);
        self.bodies.len() - 1
    }

    pub(super) fn base(&mut self) -> &mut Body {
        &mut self.bodies[0]
    }

    /// Number of bodies that can move.
    pub(super) fn movable(&self) -> usize {
        self.bodies.len() - 1
    }

    pub(super) fn mark(&mut self, feature: &'static str) {
        self.features.insert(feature);
    }

    /// Bodies of the same kind of mechanism, whose largest piece (the plate of a front) has the same size to a millimetre become
    /// groups: they look alike.
    pub(super) fn group_equals(&mut self) {
        let size = |piece: &Piece| {
            let (low, high) = bounds(piece.solid.0.iter().flatten().copied());
            ((high - low) * 1000.0).round().as_i64vec3().to_array()
        };
        let key = |body: &Body| {
            let plate = body.pieces.iter().map(size).max_by_key(|[x, y, z]| x * z + x * y + y * z);
            (body.mechanism.as_ref().map(|m| m.kind.name()), plate)
        };
        let keys: Vec<_> = self.bodies.iter().map(key).collect();
        for (index, body) in self.bodies.iter_mut().enumerate().skip(1) {
            let first = (1..keys.len()).find(|&other| keys[other] == keys[index]);
            let shared = (1..keys.len()).filter(|&other| keys[other] == keys[index]).count() > 1;
            body.group = first.filter(|_| shared);
        }
    }
}

/// What makers of objects work with.
pub(super) struct Studio<'a> {
    pub(super) dice: &'a mut Dice,
    pub(super) looks: &'a mut Looks,
}
