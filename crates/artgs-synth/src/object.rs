//! Articulated objects: parts of closed surfaces with materials, joints, and the placement of the object.

use crate::light::LightQuality;
use crate::{Material, Solid};
use artgs_core::{Joint, JointKind, Mesh, PerState, Rigid, State};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// Closed surface of one material.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// Its surface, object frame, all parts closed.
    pub(crate) solid: Solid,
    /// Its colour.
    pub(crate) material: Material,
}

/// A rigid part.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// Name in the ground truth.
    pub(crate) name: String,
    /// Its closed surfaces. Those of one part may overlap.
    pub(crate) pieces: Vec<Piece>,
    /// Joint in the object frame while all parts are closed, value 0 = closed. None for the static part.
    pub(crate) joint: Option<Joint>,
    /// The part that carries the joint, of smaller index; None: the static part.
    pub(crate) parent: Option<usize>,
    /// Values of the joint in further states, after the start and the end; empty if there are none.
    pub(crate) further: Vec<f64>,
}

/// An articulated object. Object frame while all parts are closed: x to the right seen from the front, front towards -y,
/// z up.
#[derive(Clone, Debug)]
pub struct Object {
    /// Name of the object.
    pub(crate) name: &'static str,
    /// Part 0 is static and has no joint; all others have one.
    pub(crate) parts: Vec<Part>,
    /// Object frame to world.
    pub(crate) placement: Rigid,
    /// Factor by which the object was scaled after its materials were measured.
    pub(crate) scale: f64,
    /// Seed of textures and placement.
    pub(crate) seed: u64,
    /// How finely light is computed.
    pub(crate) light: LightQuality,
}

impl Part {
    /// The static part.
    pub(crate) fn fixed(name: &str) -> Self {
        Self { name: name.into(), pieces: Vec::new(), joint: None, parent: None, further: Vec::new() }
    }

    /// A part that moves about or along `axis` through `origin`. `values` are those at the start and at the end, in degrees
    /// or, for prismatic joints, in scene units.
    pub(crate) fn moving(name: &str, kind: JointKind, axis: DVec3, origin: DVec3, values: [f64; 2]) -> Self {
        let values = if kind == JointKind::Prismatic { values } else { values.map(f64::to_radians) };
        let limits = [values[0].min(values[1]), values[0].max(values[1])];
        let joint = Joint {
            kind,
            axis: axis.normalize(),
            origin,
            pitch: 0.0,
            state_values: PerState::new(values[0], values[1]),
            limits,
        };
        Self { joint: Some(joint), ..Self::fixed(name) }
    }

    /// A part with a revolute joint.
    pub(crate) fn hinged(name: &str, axis: DVec3, origin: [f64; 3], degrees: [f64; 2]) -> Self {
        Self::moving(name, JointKind::Revolute, axis, origin.into(), degrees)
    }

    /// A part with a prismatic joint.
    pub(crate) fn sliding(name: &str, axis: DVec3, values: [f64; 2]) -> Self {
        Self::moving(name, JointKind::Prismatic, axis, DVec3::ZERO, values)
    }

    /// The part with one more surface.
    pub(crate) fn with(mut self, material: Material, solid: Solid) -> Self {
        self.add(material, solid);
        self
    }

    /// Adds a surface.
    pub(crate) fn add(&mut self, material: Material, solid: Solid) {
        self.pieces.push(Piece { solid, material });
    }

    pub(crate) fn points(&self) -> impl Iterator<Item = DVec3> {
        self.pieces.iter().flat_map(|p| p.solid.0.iter().flatten().copied())
    }
}

impl Object {
    /// An object at a random placement: turned about z, tilted by up to 5 degrees and shifted. With `unit_diagonal` it is
    /// scaled so that its bounding box, all parts closed, has a diagonal of 1.
    pub(crate) fn new(name: &'static str, parts: Vec<Part>, unit_diagonal: bool, seed: u64) -> Self {
        let diagonal = if unit_diagonal { [1.0; 2] } else { [0.0, f64::INFINITY] };
        Self::with_diagonal(name, parts, diagonal, seed)
    }

    /// An object at a random placement as [`Object::new`] makes it. It is scaled where the diagonal of its bounding box, all
    /// parts closed, is outside the range `diagonal`, scene units.
    pub(crate) fn with_diagonal(name: &'static str, mut parts: Vec<Part>, diagonal: [f64; 2], seed: u64) -> Self {
        let (low, high) = bounds(parts.iter().flat_map(Part::points));
        let is = (high - low).length();
        let scale = is.clamp(diagonal[0], diagonal[1]) / is;
        let middle = (low + high) / 2.0;
        for part in &mut parts {
            let solids = part.pieces.iter_mut().flat_map(|p| p.solid.0.iter_mut());
            solids.for_each(|t| *t = t.map(|p| p * scale));
            if let Some(joint) = &mut part.joint {
                joint.origin *= scale;
                joint.pitch *= scale;
                if joint.kind == JointKind::Prismatic {
                    joint.state_values = joint.state_values.map(|v| v * scale);
                    joint.limits = joint.limits.map(|v| v * scale);
                    part.further.iter_mut().for_each(|v| *v *= scale);
                }
            }
            let box_of_part = bounds(part.points());
            part.joint = part.joint.map(|j| j.with_origin_near((box_of_part.0 + box_of_part.1) / 2.0));
        }
        let placement = placement(name, seed) * Rigid::shift(-middle * scale);
        Self { name, parts, placement, scale, seed, light: LightQuality::FINE }
    }

    /// The same object with other values of the joint of a movable part in the two states, radians or scene units. The static
    /// part has none, and does not change.
    pub fn with_values(mut self, part: usize, values: PerState<f64>) -> Self {
        let [start, end] = [values[State::START], values[State::END]];
        if let Some(joint) = &mut self.parts[part].joint {
            joint.state_values = values;
            joint.limits = [start.min(end), start.max(end)];
        }
        self
    }

    /// Motion of a part from its closed position to a state, object frame; parents included.
    fn opened(&self, part: usize, state: State) -> Rigid {
        self.opened_with(part, &|joint, _| joint.state_values[state])
    }

    /// The same with the values of the joints that `value` gives for a joint and its part.
    fn opened_with(&self, part: usize, value: &dyn Fn(&Joint, &Part) -> f64) -> Rigid {
        let own = &self.parts[part];
        let motion = own.joint.map_or(Rigid::IDENTITY, |j| j.motion(value(&j, own)));
        own.parent.map_or(motion, |p| self.opened_with(p, value) * motion)
    }

    /// Object frame (all parts closed) to world for the points of a part in a state.
    pub fn pose(&self, part: usize, state: State) -> Rigid {
        self.placement * self.opened(part, state)
    }

    /// World motion of a part from the start to the end state, parents included.
    pub fn start_to_end(&self, part: usize) -> Rigid {
        self.pose(part, State::END) * self.pose(part, State::START).inverse()
    }

    /// The part that carries a part, 0 for the static one and its direct children.
    pub fn parent(&self, part: usize) -> usize {
        self.parts[part].parent.unwrap_or(0)
    }

    /// The joint of a movable part in the world frame, where the part is in the start state. A child's world motion is
    /// `parent's start_to_end * joint.start_to_end()`.
    pub fn world_joint(&self, part: usize) -> Option<Joint> {
        // The motion of a joint does not move its own axis.
        let pose = self.pose(part, State::START);
        self.parts[part].joint.map(|j| Joint { axis: pose.turn(j.axis), origin: pose.apply(j.origin), ..j })
    }

    /// Exact surface of a part in a state, world frame, inner faces included; neighbouring triangles do not share vertices.
    pub fn mesh(&self, part: usize, state: State) -> Mesh {
        let pose = self.pose(part, state);
        let vertices: Vec<[f32; 3]> = self.parts[part].points().map(|p| pose.apply(p).as_vec3().to_array()).collect();
        let triangles = (0..vertices.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        Mesh { vertices, colors: Vec::new(), triangles }
    }

    /// Points of all parts in all states, object frame.
    fn points_of_all_states(&self) -> Vec<DVec3> {
        let further = self.parts.iter().map(|part| part.further.len()).max().unwrap_or(0);
        let mut points = Vec::new();
        for state in 0..2 + further {
            let value = |joint: &Joint, part: &Part| match State::from_index(state) {
                Some(state) => joint.state_values[state],
                None => part.further[state - 2],
            };
            for part in 0..self.parts.len() {
                let opened = self.opened_with(part, &value);
                points.extend(self.parts[part].points().map(|p| opened.apply(p)));
            }
        }
        points
    }

    /// Corners of the box, parallel to the axes of the object frame, that holds the object in all states.
    pub(crate) fn bounds_of_all_states(&self) -> (DVec3, DVec3) {
        bounds(self.points_of_all_states().into_iter())
    }

    /// Corners of the box around the object with all parts closed, object frame.
    pub(crate) fn closed_bounds(&self) -> (DVec3, DVec3) {
        bounds(self.parts.iter().flat_map(Part::points))
    }

    /// Middle (world frame) and radius of a ball that holds the object in all states.
    pub fn ball(&self) -> (DVec3, f64) {
        let points = self.points_of_all_states();
        let (low, high) = bounds(points.iter().copied());
        let middle = (low + high) / 2.0;
        let radius = points.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        (self.placement.apply(middle), radius)
    }
}

/// Corners of the box around some points.
pub(crate) fn bounds(points: impl Iterator<Item = DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

/// A random turn about z, a tilt of up to 5 degrees and a shift of up to 0.5.
fn placement(name: &str, seed: u64) -> Rigid {
    let salt = name.bytes().fold(seed, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
    let mut rng = Pcg64Mcg::seed_from_u64(salt);
    let mut within = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let turn = Rigid::about(DVec3::Z, DVec3::ZERO, within(0.0, TAU));
    let heading = within(0.0, TAU);
    let tilt = Rigid::about(DVec3::new(heading.cos(), heading.sin(), 0.0), DVec3::ZERO, within(0.02, 0.087));
    let shift = DVec3::new(within(-0.3, 0.3), within(-0.3, 0.3), within(0.0, 0.25));
    Rigid::shift(shift) * tilt * turn
}
