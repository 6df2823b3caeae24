//! The hard cases that the paper names.

use super::furniture::*;
use crate::shape::{cuboid, lathe};
use crate::{Material, Part};
use artgs_core::JointKind;
use glam::{DVec2, DVec3};

const KNOB: (Pull, Material) = (Pull::Knob, BRASS);
const BAR: (Pull, Material) = (Pull::Bar(0.18), STEEL);
const PARCEL: Material = Material::Checks { even: [0.85, 0.75, 0.25], odd: [0.30, 0.50, 0.30], cell: 0.047 };
const ORANGE: Material = plain([0.82, 0.48, 0.20]);

pub(super) fn twin_drawers() -> Vec<Part> {
    let size = [0.62, 0.44, 0.66];
    let mut body = carcass(size, 0.02, [WALNUT, OAK, PINE]);
    body.add(OAK, cuboid([-0.29, 0.0, 0.32], [0.29, 0.42, 0.34]));
    let twin = |name: &str, z0: f64, z1: f64| {
        drawer(name, Bay::new(-0.31, 0.31, z0, z1), 0.38, [0.04, 0.24], [BLUE_PAINT, PINE], BAR)
    };
    vec![body, twin("lower_drawer", 0.0, 0.33), twin("upper_drawer", 0.33, 0.66)]
}

pub(super) fn near_drawers() -> Vec<Part> {
    // A front ends 4 mm before its bay, so bays 2 mm apart leave 1 cm.
    let (w, h, split) = (0.66, 0.34, 0.001);
    let mut body = carcass([w, 0.52, h], 0.02, [OAK_UP, OAK, PINE]);
    body.add(OAK_UP, cuboid([-0.006, 0.0, 0.02], [0.006, 0.50, h - 0.02]));
    body.add(PARCEL, cuboid([-0.20, 0.12, h], [0.02, 0.34, h + 0.12]));
    let bay = |x0: f64, x1: f64| Bay::new(x0, x1, 0.0, h);
    vec![
        body,
        drawer("left_drawer", bay(-w / 2.0, -split), 0.44, [0.05, 0.28], [CHERRY, PINE], BAR),
        drawer("right_drawer", bay(split, w / 2.0), 0.44, [0.03, 0.18], [CHERRY, PINE], BAR),
    ]
}

pub(super) fn thin_door() -> Vec<Part> {
    let size = [0.56, 0.36, 0.72];
    let mut body = carcass(size, 0.018, [GREEN_PAINT, OAK, PINE]);
    body.add(OAK, cuboid([-0.26, 0.04, 0.36], [0.26, 0.34, 0.378]));
    add_books(&mut body, [-0.24, 0.08, 0.379], 8, 0.26);
    body.add(PARCEL, cuboid([-0.10, 0.08, 0.019], [0.14, 0.28, 0.22]));
    let sheet = Material::Brushed { along: 2, color: [0.70, 0.72, 0.76], period: 0.012 };
    let bay = Bay::new(-0.28, 0.28, 0.0, 0.72);
    vec![body, door("door", bay, 0.003, Hinge::Left, [14.0, 74.0], sheet, KNOB)]
}

pub(super) fn hidden_drawer() -> Vec<Part> {
    let size = [0.70, 0.44, 0.56];
    let mut body = carcass(size, 0.02, [CREAM, WALNUT_FLAT, CREAM]);
    body.add(WALNUT_FLAT, cuboid([-0.33, 0.0, 0.25], [0.33, 0.42, 0.27]));
    add_books(&mut body, [-0.30, 0.06, 0.021], 7, 0.2);
    add_feet(&mut body, size, 0.06, BLACK);
    let bay = Bay::new(-0.35, 0.35, 0.26, 0.56);
    let mut inside = drawer("drawer", bay, 0.38, [0.0, 0.30], [CHERRY, CLOTH], BAR);
    inside.add(PARCEL, cuboid([-0.22, 0.04, 0.297], [-0.02, 0.20, 0.38]));
    add_jar(&mut inside, [0.16, 0.14, 0.297], 0.05, 0.12, [ORANGE, WHITE]);
    vec![body, inside]
}

pub(super) fn wide_door() -> Vec<Part> {
    let size = [0.60, 0.40, 0.74];
    let mut body = carcass(size, 0.02, [OAK_UP, OAK, WALNUT]);
    body.add(PINE, cuboid([-0.28, 0.03, 0.38], [0.28, 0.38, 0.40]));
    add_books(&mut body, [-0.25, 0.08, 0.401], 9, 0.26);
    add_jar(&mut body, [0.10, 0.20, 0.021], 0.09, 0.28, [ORANGE, WHITE]);
    let bay = Bay::new(-0.30, 0.30, 0.0, 0.74);
    vec![body, door("door", bay, FRONT, Hinge::Left, [0.0, 120.0], BLUE_PAINT, BAR)]
}

/// A carcass cut into columns and rows of equal bays, with boards between them.
fn grid(size: [f64; 3], columns: usize, rows: usize) -> (Part, impl Fn(usize, usize) -> Bay) {
    let mut body = carcass(size, 0.018, [WALNUT, WALNUT_FLAT, PINE]);
    let (wide, high) = (size[0] / columns as f64, size[2] / rows as f64);
    let x = move |column: usize| -size[0] / 2.0 + wide * column as f64;
    let z = move |row: usize| high * row as f64;
    for column in 1..columns {
        body.add(
            OAK_UP,
            cuboid([x(column) - 0.006, 0.0, 0.018], [x(column) + 0.006, size[1] - 0.018, size[2] - 0.018]),
        );
    }
    for row in 1..rows {
        for column in 0..columns {
            let first = if column == 0 { 0.018 } else { 0.006 };
            let last = if column + 1 == columns { 0.018 } else { 0.006 };
            let (low, high) =
                ([x(column) + first, 0.0, z(row) - 0.006], [x(column + 1) - last, size[1] - 0.018, z(row) + 0.006]);
            body.add(OAK, cuboid(low, high));
        }
    }
    (body, move |column, row| Bay::new(x(column), x(column + 1), z(row), z(row + 1)))
}

/// Drawers of a grid; every motion differs, and every fourth drawer closes.
fn drawers(bay: &impl Fn(usize, usize) -> Bay, columns: usize, rows: std::ops::Range<usize>, parts: &mut Vec<Part>) {
    const FRONTS: [Material; 4] = [OAK, CHERRY, BLUE_PAINT, GREEN_PAINT];
    for row in rows {
        for column in 0..columns {
            let k = row * columns + column;
            let (shut, open) = (0.02 + 0.005 * (k % 3) as f64, 0.11 + 0.017 * ((k * 7) % 11) as f64);
            let values = if k % 4 == 3 { [open, shut] } else { [shut, open] };
            let name = format!("drawer_{row}_{column}");
            parts.push(drawer(&name, bay(column, row), 0.32, values, [FRONTS[(k + row) % 4], PINE], KNOB));
        }
    }
}

pub(super) fn drawers_12() -> Vec<Part> {
    let (body, bay) = grid([1.05, 0.40, 0.88], 3, 4);
    let mut parts = vec![body];
    drawers(&bay, 3, 0..4, &mut parts);
    parts
}

pub(super) fn parts_20() -> Vec<Part> {
    let (body, bay) = grid([1.32, 0.40, 1.20], 4, 5);
    let mut parts = vec![body];
    drawers(&bay, 4, 0..4, &mut parts);
    for column in 0..4 {
        let hinge = if column % 2 == 0 { Hinge::Left } else { Hinge::Right };
        let degrees = [8.0 + 2.0 * column as f64, 50.0 + 9.0 * column as f64];
        parts.push(door(&format!("door_{column}"), bay(column, 4), FRONT, hinge, degrees, CREAM, KNOB));
    }
    parts
}

/// Closed and open values of drawers with equal fronts.
fn equal_drawers(bays: &[(Bay, [f64; 2])], depth: f64, front: Material) -> impl Iterator<Item = Part> {
    let drawer_at = move |(k, (bay, values)): (usize, &(Bay, [f64; 2]))| {
        drawer(&format!("drawer_{k}"), *bay, depth, *values, [front, PINE], BAR)
    };
    bays.iter().enumerate().map(drawer_at).collect::<Vec<_>>().into_iter()
}

pub(super) fn five_drawers() -> Vec<Part> {
    let (body, bay) = grid([0.56, 0.44, 1.00], 1, 5);
    // Two are open at the start, two others at the end; the one in the middle moves a little.
    let values = [[0.20, 0.0], [0.0, 0.24], [0.08, 0.02], [0.15, 0.0], [0.0, 0.17]];
    let bays: Vec<(Bay, [f64; 2])> = values.iter().enumerate().map(|(row, v)| (bay(0, row), *v)).collect();
    std::iter::once(body).chain(equal_drawers(&bays, 0.38, CREAM)).collect()
}

pub(super) fn counter_7() -> Vec<Part> {
    let size = [1.26, 0.46, 0.72];
    let mut body = carcass(size, 0.018, [WHITE, STONE, PINE]);
    body.add(STONE, cuboid([-0.66, -0.04, 0.72], [0.66, 0.48, 0.75]));
    let x = |column: usize| -0.63 + 0.42 * column as f64;
    for column in 1..3 {
        body.add(OAK_UP, cuboid([x(column) - 0.009, 0.0, 0.018], [x(column) + 0.009, 0.44, 0.702]));
    }
    // Three, two and two rows; some open while others close.
    let rows: [&[[f64; 2]]; 3] =
        [&[[0.0, 0.22], [0.18, 0.0], [0.02, 0.12]], &[[0.25, 0.03], [0.0, 0.16]], &[[0.0, 0.20], [0.14, 0.01]]];
    let mut bays = Vec::new();
    for (column, values) in rows.iter().enumerate() {
        let high = 0.72 / values.len() as f64;
        for (row, value) in values.iter().enumerate() {
            let z = high * row as f64;
            if row > 0 {
                body.add(OAK, cuboid([x(column) + 0.009, 0.0, z - 0.009], [x(column + 1) - 0.009, 0.44, z + 0.009]));
            }
            bays.push((Bay::new(x(column), x(column + 1), z, z + high), *value));
        }
    }
    std::iter::once(body).chain(equal_drawers(&bays, 0.40, WHITE)).collect()
}

pub(super) fn doors_12() -> Vec<Part> {
    let (body, bay) = grid([1.80, 0.50, 1.50], 6, 2);
    let mut parts = vec![body];
    for k in 0..12 {
        let (column, row) = (k % 6, k / 6);
        let hinge = if column % 2 == 0 { Hinge::Left } else { Hinge::Right };
        let (low, high) = (4.0 * (k % 3) as f64, 35.0 + 7.0 * ((k * 5) % 9) as f64);
        let degrees = if k % 4 == 1 { [high, low] } else { [low, high] };
        parts.push(door(&format!("door_{k}"), bay(column, row), FRONT, hinge, degrees, WHITE, KNOB));
    }
    parts
}

pub(super) fn mirrored_doors() -> Vec<Part> {
    let size = [0.90, 0.42, 0.80];
    let mut body = carcass(size, 0.02, [OAK_UP, OAK, PINE]);
    body.add(PINE, cuboid([-0.43, 0.03, 0.39], [0.43, 0.40, 0.41]));
    add_books(&mut body, [-0.35, 0.08, 0.411], 9, 0.26);
    add_jar(&mut body, [0.20, 0.20, 0.021], 0.09, 0.28, [ORANGE, WHITE]);
    let leaf = |name: &str, x0: f64, x1: f64, hinge: Hinge, degrees: [f64; 2]| {
        door(name, Bay::new(x0, x1, 0.0, 0.80), FRONT, hinge, degrees, CREAM, KNOB)
    };
    vec![
        body,
        leaf("left_door", -0.45, 0.0, Hinge::Left, [10.0, 75.0]),
        leaf("right_door", 0.0, 0.45, Hinge::Right, [80.0, 15.0]),
    ]
}

pub(super) fn sliding_doors() -> Vec<Part> {
    let size = [1.10, 0.46, 0.80];
    let mut body = carcass(size, 0.02, [WALNUT, WALNUT_FLAT, PINE]);
    body.add(PINE, cuboid([-0.53, 0.10, 0.39], [0.53, 0.44, 0.41]));
    add_books(&mut body, [-0.45, 0.14, 0.411], 10, 0.26);
    // Two leaves on rails one behind the other: the front one slides to the right, the back one to the left.
    let leaf = |name: &str, x: [f64; 2], y: f64, material: Material, values: [f64; 2]| {
        let mut leaf =
            Part::sliding(name, DVec3::X, values).with(material, cuboid([x[0], y, 0.03], [x[1], y + 0.018, 0.77]));
        add_pull(&mut leaf, KNOB, [if x[0] < -0.1 { x[0] + 0.06 } else { x[1] - 0.06 }, y, 0.40], 2);
        leaf
    };
    vec![
        body,
        leaf("front_door", [-0.52, 0.04], 0.004, BLUE_PAINT, [0.02, 0.36]),
        leaf("back_door", [-0.04, 0.52], 0.08, GREEN_PAINT, [-0.05, -0.30]),
    ]
}

pub(super) fn door_with_drawer() -> Vec<Part> {
    let size = [0.64, 0.44, 0.90];
    let mut body = carcass(size, 0.025, [WHITE, OAK, WALNUT]);
    body.add(PINE, cuboid([-0.295, 0.16, 0.45], [0.295, 0.415, 0.47]));
    add_books(&mut body, [-0.26, 0.20, 0.471], 9, 0.28);
    body.add(PARCEL, cuboid([-0.14, 0.18, 0.026], [0.14, 0.38, 0.28]));
    // A door as thick as a crate: a frame of boards whose middle third is a compartment for a drawer.
    const THICK: f64 = 0.15;
    let (front, x, z) = (-GAP - THICK, 0.316, [0.004, 0.896]);
    let (low, high) = (0.34, 0.58);
    let mut leaf = Part::hinged("door", DVec3::NEG_Z, [-x, front, 0.45], [15.0, 62.0])
        .with(BLUE_PAINT, cuboid([-x, front, z[0]], [x, -GAP, low]))
        .with(BLUE_PAINT, cuboid([-x, front, high], [x, -GAP, z[1]]))
        .with(OAK_UP, cuboid([-x, front, low], [-x + 0.03, -GAP, high]))
        .with(OAK_UP, cuboid([x - 0.03, front, low], [x, -GAP, high]))
        .with(PINE, cuboid([-x + 0.03, -GAP - 0.015, low], [x - 0.03, -GAP, high]));
    add_pull(&mut leaf, (Pull::Bar(0.2), STEEL), [x - 0.05, front, 0.75], 2);
    // Its own drawer, whose front lies before the door.
    let bay = Bay::new(-x + 0.02, x - 0.09, low - 0.01, high + 0.01);
    let mut inner = drawer("door_drawer", bay, THICK - 0.03, [0.01, 0.10], [CHERRY, CLOTH], BAR);
    for piece in &mut inner.pieces {
        piece.solid = std::mem::take(&mut piece.solid).shifted([0.0, front, 0.0]);
    }
    inner.parent = Some(1);
    vec![body, leaf, inner]
}

pub(super) fn screw_cap() -> Vec<Part> {
    let glass = Material::Speckle { base: [0.30, 0.52, 0.40], spots: [0.42, 0.62, 0.48], size: 0.08 };
    let paper = Material::Checks { even: [0.90, 0.86, 0.72], odd: [0.70, 0.28, 0.22], cell: 0.08 };
    let bottle = [
        (0.0, 0.0),
        (0.19, 0.0),
        (0.21, 0.03),
        (0.21, 0.50),
        (0.18, 0.58),
        (0.09, 0.66),
        (0.075, 0.69),
        (0.075, 0.86),
        (0.060, 0.86),
        (0.060, 0.69),
        (0.16, 0.57),
        (0.19, 0.50),
        (0.19, 0.03),
        (0.0, 0.03),
    ];
    let label = [(0.205, 0.14), (0.216, 0.14), (0.216, 0.42), (0.205, 0.42)];
    let mut body = Part::fixed("bottle").with(glass, lathe(&bottle.map(DVec2::from), 64));
    body.add(paper, lathe(&label.map(DVec2::from), 64));
    // Thread rings on the neck.
    for z in [0.73, 0.77, 0.81] {
        let ring = [(0.074, z - 0.006), (0.083, z), (0.074, z + 0.006)];
        body.add(STONE, lathe(&ring.map(DVec2::from), 48));
    }
    let cup = [(0.0, 0.87), (0.092, 0.87), (0.092, 0.71), (0.118, 0.71), (0.118, 0.885), (0.105, 0.90), (0.0, 0.90)];
    let half_and_half = Material::Checks { even: [0.82, 0.48, 0.20], odd: [0.62, 0.30, 0.14], cell: 0.07 };
    let mut cap = Part::moving("cap", JointKind::Screw, DVec3::Z, DVec3::new(0.0, 0.0, 0.8), [20.0, 160.0]);
    cap.joint = cap.joint.map(|j| artgs_core::Joint { pitch: 0.055, ..j });
    cap.add(half_and_half, lathe(&cup.map(DVec2::from), 48));
    for k in 0..18 {
        let rib = cuboid([0.112, -0.007, 0.715], [0.127, 0.007, 0.875]);
        let turn = artgs_core::Rigid::about(DVec3::Z, DVec3::ZERO, std::f64::consts::TAU * f64::from(k) / 18.0);
        cap.add(if k % 6 == 0 { WHITE } else { ORANGE }, rib.moved(&turn));
    }
    cap.add(plain([0.22, 0.36, 0.62]), cuboid([-0.02, -0.09, 0.90], [0.02, 0.09, 0.908]));
    vec![body, cap]
}
