//! A furnished room around an object: floor, walls, pictures, a rug, clutter that stays and, if wanted, a box that a person
//! moves between the states. Lengths are metres.

use crate::object::{Object, Part, Piece, bounds};
use crate::shape::{Solid, cuboid, cylinder, lathe};
use crate::{Material, SynthError};
use artgs_core::{JointKind, Rigid};
use glam::{DVec2, DVec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Label of clutter in part masks.
pub const CLUTTER_LABEL: u8 = 200;
/// Label, in part masks, of a thing beside the object that is elsewhere in the other state.
pub const BYSTANDER_LABEL: u8 = 201;
/// Height of the walls.
const HEIGHT: f64 = 2.6;
/// Edge of the squares of floor and walls, for which light is computed.
const SQUARE: f64 = 1.0;

/// An object in its room. Room frame: z up, the floor is z = 0, the walls are parallel to the axes, the object is in front
/// of the wall with the largest y.
pub(crate) struct Room {
    /// The articulated object alone; its placement leads to the room frame.
    pub(crate) object: Object,
    /// Everything that cameras see: the parts of the object, then those of the room.
    pub(crate) all: Object,
    /// What part masks hold for every part of `all`.
    pub(crate) labels: Vec<u8>,
    /// Corners of the space between the walls; the ceiling is at `high.z`.
    pub(crate) low: DVec3,
    pub(crate) high: DVec3,
    /// Height of the object above the floor, all parts closed.
    pub(crate) object_height: f64,
}

/// Random numbers and colours of furnishings.
struct Dice(Pcg64Mcg);

impl Dice {
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    fn sign(&mut self) -> f64 {
        if self.0.random::<f64>() < 0.5 { -1.0 } else { 1.0 }
    }

    fn color(&mut self, low: f64, high: f64) -> [f64; 3] {
        [0; 3].map(|_| self.within(low, high))
    }

    /// A pattern with edges that colour alignment can use.
    fn pattern(&mut self) -> Material {
        let (one, other) = (self.color(0.45, 0.9), self.color(0.15, 0.5));
        match (self.within(0.0, 4.0)) as usize {
            0 => Material::Checks { even: one, odd: other, cell: self.within(0.04, 0.08) },
            1 => Material::Stripes { across: 2, even: one, odd: other, width: self.within(0.03, 0.06) },
            2 => Material::Speckle { base: one, spots: other, size: self.within(0.04, 0.08) },
            _ => Material::Wood { grain: 0, light: one, dark: other, period: self.within(0.05, 0.09) },
        }
    }
}

impl Room {
    /// Puts an object, whose lengths are metres, on the floor of a room; `seed` varies the room.
    pub(crate) fn new(object: Object, bystander: bool, seed: u64) -> Result<Self, SynthError> {
        if object.parts.len() >= usize::from(CLUTTER_LABEL) {
            return Err(SynthError::Options("a room holds objects of fewer than 199 parts"));
        }
        let mut dice = Dice(Pcg64Mcg::seed_from_u64(seed ^ 0x0072_6f6f_6d00));
        let (low, high) = object.bounds_of_all_states();
        let closed = object.closed_bounds();
        let mut clutter = Part::fixed("clutter");
        // The side of the object where the box stands that is moved.
        let side = dice.sign();
        furnish(&mut clutter, &mut dice, [low, high], side);
        let moved = bystander.then(|| moving_box(&mut dice, [low, high], side));

        // The walls are turned against the object, and the back wall is just behind everything.
        let turn = Rigid::about(DVec3::Z, DVec3::ZERO, dice.within(-0.1, 0.1));
        let turned = |points: &mut dyn Iterator<Item = DVec3>| bounds(points.map(|p| turn.apply(p)));
        let corners = (0..8).map(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
            DVec3::new(pick(0), pick(1), pick(2))
        });
        let in_both = |part: &Part| -> Vec<DVec3> {
            let motion = part.joint.map_or(Rigid::IDENTITY, |j| j.start_to_end());
            part.points().flat_map(|p| [p, motion.apply(p)]).collect()
        };
        let beside = moved.iter().flat_map(in_both);
        let (from, to) = turned(&mut corners.chain(clutter.points()).chain(beside));
        let space = (3.2 * (closed.1 - closed.0).length()).max(2.6);
        let room_low = DVec3::new(from.x - dice.within(0.9, 1.4), to.y - space, low.z);
        let room_high = DVec3::new(to.x + dice.within(0.9, 1.4), to.y + dice.within(0.05, 0.2), low.z + HEIGHT);
        let origin = DVec3::new((room_low.x + room_high.x) / 2.0, (room_low.y + room_high.y) / 2.0, low.z);
        let placement = Rigid::shift(-origin) * turn;
        let (room_low, room_high) = (room_low - origin, room_high - origin);

        let mut shell = shell(room_low, room_high, &mut dice);
        let rug = placement.apply(DVec3::new((low.x + high.x) / 2.0, low.y - 0.75, low.z));
        let half = DVec3::new(dice.within(0.7, 1.0), dice.within(0.45, 0.6), 0.001);
        shell.add(dice.pattern(), cuboid((rug - half).to_array(), (rug + half).to_array()));
        let object_from_room = placement.inverse();
        shell
            .pieces
            .iter_mut()
            .for_each(|piece| piece.solid = std::mem::take(&mut piece.solid).moved(&object_from_room));

        let object_height = closed.1.z - low.z;
        let object = Object { placement, ..object };
        let mut labels: Vec<u8> = (1..=object.parts.len() as u8).collect();
        let mut parts = object.parts.clone();
        for (part, label) in [(Some(clutter), CLUTTER_LABEL), (moved, BYSTANDER_LABEL), (Some(shell), 0)] {
            if let Some(part) = part {
                parts.push(part);
                labels.push(label);
            }
        }
        let all = Object { parts, ..object.clone() };
        Ok(Self { object, all, labels, low: room_low, high: room_high, object_height })
    }
}

/// Adds things that stay, object frame, outside of the box that the object needs in both states.
fn furnish(clutter: &mut Part, dice: &mut Dice, [low, high]: [DVec3; 2], side: f64) {
    let floor = low.z;
    let edge = |s: f64, out: f64| if s < 0.0 { low.x - out } else { high.x + out };
    // On the side of the moved box there is space for it.
    for (s, out) in [(side, dice.within(0.85, 1.0)), (-side, dice.within(0.15, 0.3))] {
        let (wide, deep, tall) = (dice.within(0.3, 0.42), dice.within(0.25, 0.34), dice.within(0.25, 0.36));
        let at = DVec3::new(edge(s, out + wide / 2.0), high.y - deep / 2.0 - 0.06, floor);
        let turn = dice.within(-0.15, 0.15);
        stand(clutter, dice.pattern(), block([wide, deep, tall]), at, turn);
        let top = at + DVec3::Z * tall;
        let pattern = dice.pattern();
        stand(
            clutter,
            pattern,
            block([0.6 * wide, 0.6 * deep, dice.within(0.1, 0.16)]),
            top,
            turn + dice.within(-0.5, 0.5),
        );
        let next = DVec3::new(edge(s, out + wide + dice.within(0.2, 0.3)), high.y - dice.within(0.2, 0.3), floor);
        let radius = dice.within(0.09, 0.12);
        stand(clutter, dice.pattern(), pot(radius, dice.within(0.35, 0.48)), next, 0.0);
    }
    for s in [-1.0, 1.0] {
        // In front of where the moved box may be.
        let front = if s == side { low.y.min(beside(low, high) - 0.55) } else { low.y };
        let at = DVec3::new(edge(s, dice.within(0.3, 0.5)), front - dice.within(0.3, 0.6), floor);
        let sizes = [dice.within(0.2, 0.34), dice.within(0.2, 0.3), dice.within(0.12, 0.26)];
        let solid = if s == side { cylinder(sizes[0] / 2.0, 0.0, sizes[2]) } else { block(sizes) };
        stand(clutter, dice.pattern(), solid, at, dice.within(-0.8, 0.8));
    }
}

/// Where the moved box stands in the start state, along the depth of the object.
fn beside(low: DVec3, high: DVec3) -> f64 {
    high.y - 0.3 * (high.y - low.y)
}

/// A box beside the object whose motion between the states is a turn by 15 to 40 degrees and a shift by 0.15 to 0.3, together
/// a turn about an upright axis beside it.
fn moving_box(dice: &mut Dice, [low, high]: [DVec3; 2], side: f64) -> Part {
    let half = DVec3::new(dice.within(0.12, 0.16), dice.within(0.10, 0.14), dice.within(0.12, 0.18));
    let x = if side < 0.0 { low.x } else { high.x };
    let at = DVec3::new(x + side * (0.12 + half.x + half.y), beside(low, high), low.z);
    // With this sign it moves to the front, away from the wall.
    let angle = dice.within(15.0, 40.0) * side;
    let out = dice.within(0.15, 0.3) / (2.0 * (angle.to_radians().abs() / 2.0).sin());
    let pivot = at + DVec3::X * side * out;
    let mut part = Part::moving("bystander", JointKind::Revolute, DVec3::Z, pivot, [0.0, angle]);
    stand(&mut part, dice.pattern(), block((2.0 * half).to_array()), at, dice.within(-0.3, 0.3));
    part
}

/// Adds a solid that stands on z = 0 at a place, turned about the vertical.
fn stand(part: &mut Part, material: Material, solid: Solid, at: DVec3, turn: f64) {
    let solid = solid.moved(&(Rigid::shift(at) * Rigid::about(DVec3::Z, DVec3::ZERO, turn)));
    part.pieces.push(Piece { solid, material });
}

/// A block of these edges, standing on z = 0 around the z axis.
fn block([wide, deep, tall]: [f64; 3]) -> Solid {
    cuboid([-wide / 2.0, -deep / 2.0, 0.0], [wide / 2.0, deep / 2.0, tall])
}

/// A vase.
fn pot(radius: f64, height: f64) -> Solid {
    let profile = [(0.0, 0.0), (0.7, 0.0), (1.0, 0.4), (0.55, 0.85), (0.7, 1.0), (0.0, 1.0)];
    lathe(&profile.map(|(r, z)| DVec2::new(r * radius, z * height)), 32)
}

/// Floor, four walls and pictures on them, room frame. Floor and walls are seen from inside only.
fn shell(low: DVec3, high: DVec3, dice: &mut Dice) -> Part {
    let mut shell = Part::fixed("room");
    let plank = Material::Wood { grain: 0, light: [0.72, 0.56, 0.40], dark: [0.52, 0.37, 0.24], period: 0.11 };
    let tone = dice.within(0.80, 0.88);
    let plaster = Material::Speckle { base: [tone + 0.04, tone + 0.02, tone], spots: [tone - 0.05; 3], size: 0.12 };
    let (x, y, z) = (DVec3::X * (high.x - low.x), DVec3::Y * (high.y - low.y), DVec3::Z * (high.z - low.z));
    shell.add(plank, sheet(low, x, y));
    for (corner, along) in [(low, x), (low + x, y), (low + x + y, -x), (low + y, -y)] {
        // A sheet faces up cross along: inward.
        shell.add(plaster, sheet(corner, z, along));
    }
    for (wall, count) in [(0, 2), (1, 1), (2, 1), (3, 2)] {
        for k in 0..count {
            let half = DVec3::new(dice.within(0.18, 0.38), 0.008, dice.within(0.2, 0.34));
            let share = (f64::from(k) + dice.within(0.35, 0.65)) / f64::from(count);
            let up = low.z + dice.within(1.35, 1.75);
            let at = match wall {
                0 => DVec3::new(low.x + share * x.x, high.y, up),
                1 => DVec3::new(low.x + share * x.x, low.y, up),
                2 => DVec3::new(low.x, low.y + share * y.y, up),
                _ => DVec3::new(high.x, low.y + share * y.y, up),
            };
            let half = if wall < 2 { half } else { DVec3::new(half.y, half.x, half.z) };
            shell.add(dice.pattern(), cuboid((at - half).to_array(), (at + half).to_array()));
        }
    }
    shell
}

/// A rectangle in squares, facing `u` cross `v`.
fn sheet(corner: DVec3, u: DVec3, v: DVec3) -> Solid {
    let count = |edge: DVec3| (edge.length() / SQUARE).ceil().max(1.0) as usize;
    let (m, n) = (count(u), count(v));
    let at = |i: usize, j: usize| corner + u * (i as f64 / m as f64) + v * (j as f64 / n as f64);
    let squares = (0..m).flat_map(|i| (0..n).map(move |j| (i, j)));
    let triangles = squares.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    Solid(triangles.collect())
}
