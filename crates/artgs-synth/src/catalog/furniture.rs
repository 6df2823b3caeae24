//! Components of furniture: boards, doors, drawers, handles, and contents.
//! Lengths are metres before scaling; the front of a carcass is the plane y = 0, its inside at y > 0.

use crate::shape::{cuboid, cylinder, lathe};
use crate::{Material, Part, Solid};
use glam::{DVec2, DVec3};

/// Gap between a closed front and the carcass.
pub(super) const GAP: f64 = 0.003;
/// Gap around a front.
const MARGIN: f64 = 0.004;
/// Thickness of the fronts of doors and drawers.
pub(super) const FRONT: f64 = 0.022;

pub(super) const fn plain(color: [f64; 3]) -> Material {
    Material::Plain { color }
}

pub(super) const fn wood(grain: usize, light: [f64; 3], dark: [f64; 3], period: f64) -> Material {
    Material::Wood { grain, light, dark, period }
}

pub(super) const OAK: Material = wood(0, [0.84, 0.70, 0.50], [0.68, 0.50, 0.31], 0.07);
pub(super) const OAK_UP: Material = wood(2, [0.82, 0.68, 0.48], [0.66, 0.48, 0.30], 0.08);
pub(super) const WALNUT: Material = wood(2, [0.52, 0.36, 0.25], [0.33, 0.21, 0.14], 0.06);
pub(super) const WALNUT_FLAT: Material = wood(0, [0.50, 0.34, 0.23], [0.31, 0.20, 0.13], 0.07);
pub(super) const PINE: Material = wood(1, [0.92, 0.82, 0.62], [0.80, 0.64, 0.42], 0.05);
pub(super) const CHERRY: Material = wood(0, [0.68, 0.36, 0.24], [0.50, 0.22, 0.14], 0.09);
pub(super) const BLUE_PAINT: Material = wood(2, [0.45, 0.60, 0.70], [0.30, 0.44, 0.56], 0.10);
pub(super) const GREEN_PAINT: Material = wood(0, [0.52, 0.66, 0.50], [0.38, 0.52, 0.37], 0.09);
pub(super) const STEEL: Material = Material::Brushed { along: 0, color: [0.72, 0.73, 0.75], period: 0.006 };
pub(super) const BRASS: Material = Material::Brushed { along: 2, color: [0.80, 0.66, 0.36], period: 0.008 };
pub(super) const WHITE: Material = plain([0.90, 0.90, 0.88]);
pub(super) const CREAM: Material = plain([0.88, 0.82, 0.68]);
pub(super) const BLACK: Material = plain([0.14, 0.14, 0.15]);
pub(super) const FELT: Material = Material::Speckle { base: [0.40, 0.16, 0.18], spots: [0.56, 0.26, 0.26], size: 0.02 };
pub(super) const STONE: Material =
    Material::Speckle { base: [0.60, 0.60, 0.58], spots: [0.36, 0.37, 0.40], size: 0.05 };
pub(super) const CLOTH: Material = Material::Checks { even: [0.80, 0.78, 0.68], odd: [0.52, 0.58, 0.62], cell: 0.043 };

/// A rectangle of the front that one door or drawer covers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bay {
    pub(super) x: [f64; 2],
    pub(super) z: [f64; 2],
}

impl Bay {
    pub(super) fn new(x0: f64, x1: f64, z0: f64, z1: f64) -> Self {
        Self { x: [x0, x1], z: [z0, z1] }
    }

    fn middle(&self) -> [f64; 2] {
        [(self.x[0] + self.x[1]) / 2.0, (self.z[0] + self.z[1]) / 2.0]
    }
}

/// Edge of a door with the hinge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Hinge {
    Left,
    Right,
    Bottom,
}

/// A handle.
#[derive(Clone, Copy, Debug)]
pub(super) enum Pull {
    /// A bar of this length on two posts.
    Bar(f64),
    /// A round knob.
    Knob,
}

/// y of the front face of a front of this thickness.
pub(super) fn face(thickness: f64) -> f64 {
    -GAP - thickness
}

/// The slab that covers a bay.
pub(super) fn slab(bay: Bay, thickness: f64) -> Solid {
    cuboid([bay.x[0] + MARGIN, face(thickness), bay.z[0] + MARGIN], [bay.x[1] - MARGIN, -GAP, bay.z[1] - MARGIN])
}

/// A door over a bay, hinged at the outer edge of its front face so that it clears its neighbours.
pub(super) fn door(
    name: &str,
    bay: Bay,
    thickness: f64,
    hinge: Hinge,
    degrees: [f64; 2],
    material: Material,
    pull: (Pull, Material),
) -> Part {
    let (y, [cx, cz]) = (face(thickness), bay.middle());
    let (axis, origin) = match hinge {
        Hinge::Left => (DVec3::NEG_Z, [bay.x[0] + MARGIN, y, cz]),
        Hinge::Right => (DVec3::Z, [bay.x[1] - MARGIN, y, cz]),
        Hinge::Bottom => (DVec3::X, [cx, y, bay.z[0] + MARGIN]),
    };
    let inset = 0.05_f64.min(0.2 * (bay.x[1] - bay.x[0]));
    let (at, along) = match hinge {
        Hinge::Left => ([bay.x[1] - inset, y, cz], 2),
        Hinge::Right => ([bay.x[0] + inset, y, cz], 2),
        Hinge::Bottom => ([cx, y, bay.z[1] - inset], 0),
    };
    let mut part = Part::hinged(name, axis, origin, degrees).with(material, slab(bay, thickness));
    add_pull(&mut part, pull, at, along);
    part
}

/// A drawer over a bay: front and an open tray of this depth.
pub(super) fn drawer(
    name: &str,
    bay: Bay,
    depth: f64,
    values: [f64; 2],
    materials: [Material; 2],
    pull: (Pull, Material),
) -> Part {
    const WALL: f64 = 0.012;
    const AIR: f64 = 0.024;
    let [front, tray] = materials;
    let ([x0, x1], [z0, z1]) = ([bay.x[0] + AIR, bay.x[1] - AIR], [bay.z[0] + AIR, bay.z[1] - 1.6 * AIR]);
    let top = z0 + 0.8 * (z1 - z0);
    let mut part = Part::sliding(name, DVec3::NEG_Y, values)
        .with(front, slab(bay, FRONT))
        .with(FELT, cuboid([x0, -GAP, z0], [x1, depth, z0 + WALL]))
        .with(tray, cuboid([x0, -GAP, z0 + WALL], [x0 + WALL, depth, top]))
        .with(tray, cuboid([x1 - WALL, -GAP, z0 + WALL], [x1, depth, top]))
        .with(tray, cuboid([x0 + WALL, depth - WALL, z0 + WALL], [x1 - WALL, depth, top]));
    let [cx, cz] = bay.middle();
    add_pull(&mut part, pull, [cx, face(FRONT), cz], 0);
    part
}

/// Adds a handle at a point of a front face, along x (0) or z (2).
pub(super) fn add_pull(part: &mut Part, (pull, material): (Pull, Material), at: [f64; 3], along: usize) {
    let [x, y, z] = at;
    match pull {
        Pull::Bar(length) => {
            const HALF: f64 = 0.008;
            let (half, post) = (length / 2.0, length / 2.0 - 0.02);
            let block = |from: f64, to: f64, near: f64, far: f64, half: f64| {
                let (mut low, mut high) = ([x - half, y - far, z - half], [x + half, y - near, z + half]);
                low[along] = at[along] + from;
                high[along] = at[along] + to;
                cuboid(low, high)
            };
            part.add(material, block(-post - HALF, -post + HALF, 0.0, 0.035, 0.7 * HALF));
            part.add(material, block(post - HALF, post + HALF, 0.0, 0.035, 0.7 * HALF));
            part.add(material, block(-half, half, 0.035, 0.05, HALF));
        }
        Pull::Knob => {
            let profile = [(0.0, 0.0), (0.010, 0.0), (0.009, 0.015), (0.020, 0.024), (0.020, 0.034), (0.0, 0.042)];
            part.add(material, lathe(&profile.map(DVec2::from), 24).facing_front().shifted(at));
        }
    }
}

/// A box open to the front: outer size (x symmetric, y from 0, z from 0), board thickness, and materials of sides,
/// top and bottom, back.
pub(super) fn carcass(size: [f64; 3], board: f64, materials: [Material; 3]) -> Part {
    let [w, d, h] = [size[0] / 2.0, size[1], size[2]];
    let [sides, flats, back] = materials;
    let (t, i) = (board, w - board);
    Part::fixed("body")
        .with(sides, cuboid([-w, 0.0, 0.0], [-i, d, h]))
        .with(sides, cuboid([i, 0.0, 0.0], [w, d, h]))
        .with(flats, cuboid([-i, 0.0, h - t], [i, d, h]))
        .with(flats, cuboid([-i, 0.0, 0.0], [i, d, t]))
        .with(back, cuboid([-i, d - t, t], [i, d, h - t]))
}

/// Feet under the corners of a carcass.
pub(super) fn add_feet(part: &mut Part, size: [f64; 3], height: f64, material: Material) {
    for x in [-size[0] / 2.0 + 0.05, size[0] / 2.0 - 0.05] {
        for y in [0.05, size[1] - 0.05] {
            part.add(material, cylinder(0.025, -height, 0.0).shifted([x, y, 0.0]));
        }
    }
}

/// Adds a jar with a lid that stands at a point.
pub(super) fn add_jar(part: &mut Part, at: [f64; 3], radius: f64, height: f64, materials: [Material; 2]) {
    part.add(materials[0], cylinder(radius, 0.0, 0.8 * height).shifted(at));
    part.add(materials[1], cylinder(0.8 * radius, 0.8 * height, height).shifted(at));
}

/// Adds a row of books that stand at a point, spines towards the front.
pub(super) fn add_books(part: &mut Part, at: [f64; 3], count: usize, height: f64) {
    const COVERS: [Material; 4] = [
        plain([0.62, 0.20, 0.18]),
        Material::Stripes { across: 2, even: [0.20, 0.34, 0.55], odd: [0.80, 0.74, 0.50], width: 0.035 },
        plain([0.24, 0.42, 0.30]),
        Material::Speckle { base: [0.78, 0.62, 0.24], spots: [0.55, 0.36, 0.16], size: 0.03 },
    ];
    let mut x = at[0];
    for k in 0..count {
        let (wide, high) = (0.022 + 0.009 * ((k * 3) % 4) as f64, height * (0.84 + 0.05 * ((k * 5) % 4) as f64));
        part.add(COVERS[k % 4], cuboid([x, at[1], at[2]], [x + wide, at[1] + 0.16, at[2] + high]));
        x += wide + 0.001;
    }
}
