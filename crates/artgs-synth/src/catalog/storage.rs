//! Cupboards, shelves and desks.

use super::furniture::*;
use crate::shape::{cuboid, cylinder};
use crate::{Material, Part};

const CHESS: Material = Material::Checks { even: [0.78, 0.46, 0.30], odd: [0.60, 0.28, 0.20], cell: 0.061 };
const BASKET: Material =
    Material::Stripes { across: 2, even: [0.72, 0.58, 0.38], odd: [0.52, 0.38, 0.22], width: 0.018 };
const VASE: Material = Material::Speckle { base: [0.24, 0.36, 0.58], spots: [0.84, 0.84, 0.80], size: 0.04 };
const TEAL: Material = plain([0.26, 0.50, 0.52]);
const BAR: (Pull, Material) = (Pull::Bar(0.16), STEEL);
const KNOB: (Pull, Material) = (Pull::Knob, BRASS);

/// A board between x and z limits that reaches from near the front to the back.
fn board(x: [f64; 2], z: [f64; 2], depth: f64) -> crate::Solid {
    cuboid([x[0], 0.0, z[0]], [x[1], depth, z[1]])
}

pub(super) fn storage() -> Vec<Part> {
    let size = [0.70, 0.42, 0.84];
    let mut body = carcass(size, 0.02, [WALNUT, OAK, PINE]);
    body.add(OAK, board([-0.33, 0.33], [0.56, 0.58], 0.40));
    body.add(WALNUT_FLAT, board([-0.33, 0.33], [0.28, 0.30], 0.40));
    body.add(WALNUT, board([0.04, 0.06], [0.30, 0.56], 0.40));
    add_books(&mut body, [-0.31, 0.06, 0.301], 6, 0.23);
    body.add(BASKET, cuboid([-0.26, 0.05, 0.021], [0.10, 0.34, 0.19]));
    add_jar(&mut body, [0.20, 0.20, 0.301], 0.07, 0.20, [VASE, BRASS]);
    add_feet(&mut body, size, 0.05, BLACK);
    let bay = Bay::new(-0.35, 0.35, 0.57, 0.84);
    vec![body, drawer("drawer", bay, 0.36, [0.04, 0.28], [CHESS, CLOTH], (Pull::Bar(0.24), STEEL))]
}

pub(super) fn storage2() -> Vec<Part> {
    let size = [0.90, 0.45, 0.70];
    let mut body = carcass(size, 0.02, [CREAM, WALNUT_FLAT, CREAM]);
    body.add(CREAM, board([0.03, 0.05], [0.02, 0.68], 0.43));
    body.add(WALNUT_FLAT, board([0.05, 0.43], [0.39, 0.41], 0.43));
    body.add(OAK, cuboid([-0.43, 0.06, 0.33], [0.03, 0.43, 0.35]));
    add_books(&mut body, [-0.40, 0.10, 0.351], 8, 0.25);
    body.add(BASKET, cuboid([-0.36, 0.10, 0.021], [-0.08, 0.36, 0.22]));
    add_jar(&mut body, [0.24, 0.20, 0.021], 0.09, 0.26, [VASE, BRASS]);
    add_feet(&mut body, size, 0.08, WALNUT);
    let (left, right) = (Bay::new(-0.45, 0.04, 0.0, 0.70), Bay::new(0.04, 0.45, 0.40, 0.70));
    vec![
        body,
        door("door", left, FRONT, Hinge::Left, [10.0, 72.0], GREEN_PAINT, (Pull::Bar(0.2), BRASS)),
        drawer("drawer", right, 0.38, [0.22, 0.05], [OAK, PINE], BAR),
    ]
}

/// A desk top on legs or on a pedestal at either side, 0.72 high.
fn desk(width: f64, materials: [Material; 2]) -> Part {
    let [top, legs] = materials;
    let half = width / 2.0;
    let mut body = Part::fixed("body").with(top, cuboid([-half, -0.04, 0.70], [half, 0.60, 0.73]));
    body.add(legs, cuboid([-half + 0.06, 0.54, 0.40], [half - 0.06, 0.56, 0.70]));
    body
}

/// A pedestal under a desk, open to the front, between two x.
fn add_pedestal(body: &mut Part, x: [f64; 2], levels: &[f64], materials: [Material; 2]) {
    const T: f64 = 0.018;
    let [sides, flats] = materials;
    body.add(sides, cuboid([x[0], 0.0, 0.04], [x[0] + T, 0.54, 0.70]));
    body.add(sides, cuboid([x[1] - T, 0.0, 0.04], [x[1], 0.54, 0.70]));
    body.add(sides, cuboid([x[0] + T, 0.52, 0.04 + T], [x[1] - T, 0.54, 0.70]));
    body.add(flats, cuboid([x[0] + T, 0.0, 0.04], [x[1] - T, 0.54, 0.04 + T]));
    for z in levels {
        body.add(flats, cuboid([x[0] + T, 0.0, z - T / 2.0], [x[1] - T, 0.52, z + T / 2.0]));
    }
}

pub(super) fn table_3d() -> Vec<Part> {
    let mut body = desk(1.20, [OAK, WALNUT_FLAT]);
    for y in [0.04, 0.48] {
        body.add(WALNUT, cuboid([-0.58, y, 0.0], [-0.52, y + 0.06, 0.70]));
    }
    let x = [0.16, 0.56];
    add_pedestal(&mut body, x, &[0.27, 0.49], [WALNUT, PINE]);
    add_jar(&mut body, [-0.38, 0.30, 0.73], 0.05, 0.14, [VASE, BRASS]);
    add_books(&mut body, [-0.10, 0.22, 0.731], 4, 0.2);
    let bay = |z0: f64, z1: f64| Bay::new(x[0], x[1], z0, z1);
    vec![
        body,
        drawer("upper_drawer", bay(0.49, 0.695), 0.46, [0.05, 0.26], [CHERRY, PINE], KNOB),
        drawer("middle_drawer", bay(0.27, 0.49), 0.46, [0.02, 0.16], [CHERRY, PINE], KNOB),
        drawer("lower_drawer", bay(0.04, 0.27), 0.46, [0.34, 0.08], [CHERRY, PINE], KNOB),
    ]
}

pub(super) fn table_2d2o() -> Vec<Part> {
    let mut body = desk(1.36, [WALNUT_FLAT, CREAM]);
    let (left, right) = ([-0.64, -0.24], [0.24, 0.64]);
    for x in [left, right] {
        add_pedestal(&mut body, x, &[0.50], [CREAM, OAK]);
    }
    body.add(BASKET, cuboid([-0.54, 0.14, 0.059], [-0.34, 0.40, 0.24]));
    add_books(&mut body, [0.30, 0.16, 0.059], 7, 0.28);
    add_jar(&mut body, [0.0, 0.3, 0.73], 0.06, 0.16, [VASE, BRASS]);
    let bay = |x: [f64; 2], z0: f64, z1: f64| Bay::new(x[0], x[1], z0, z1);
    vec![
        body,
        drawer("left_drawer", bay(left, 0.50, 0.695), 0.46, [0.04, 0.25], [OAK, PINE], BAR),
        door("left_door", bay(left, 0.04, 0.50), FRONT, Hinge::Left, [8.0, 66.0], BLUE_PAINT, KNOB),
        drawer("right_drawer", bay(right, 0.50, 0.695), 0.46, [0.20, 0.03], [OAK, PINE], BAR),
        door("right_door", bay(right, 0.04, 0.50), FRONT, Hinge::Right, [5.0, 80.0], BLUE_PAINT, KNOB),
    ]
}

pub(super) fn storage_3o() -> Vec<Part> {
    let size = [1.26, 0.42, 0.74];
    let mut body = carcass(size, 0.02, [OAK_UP, OAK, WALNUT]);
    for x in [-0.22, 0.22] {
        body.add(OAK_UP, board([x - 0.009, x + 0.009], [0.02, 0.72], 0.40));
    }
    for (x0, x1, z) in [(-0.61, -0.229, 0.36), (-0.211, 0.211, 0.46), (0.229, 0.61, 0.30)] {
        body.add(PINE, cuboid([x0, 0.05, z - 0.009], [x1, 0.40, z + 0.009]));
    }
    add_books(&mut body, [-0.58, 0.10, 0.37], 9, 0.26);
    body.add(BASKET, cuboid([-0.14, 0.10, 0.021], [0.14, 0.34, 0.26]));
    add_jar(&mut body, [0.40, 0.20, 0.31], 0.09, 0.28, [VASE, BRASS]);
    add_jar(&mut body, [-0.42, 0.20, 0.021], 0.08, 0.22, [CHESS, WHITE]);
    add_feet(&mut body, size, 0.10, BLACK);
    let bay = |x0: f64, x1: f64| Bay::new(x0, x1, 0.0, 0.74);
    vec![
        body,
        door("left_door", bay(-0.63, -0.22), FRONT, Hinge::Left, [10.0, 76.0], TEAL, BAR),
        door("middle_door", bay(-0.22, 0.22), FRONT, Hinge::Left, [50.0, 8.0], CHERRY, BAR),
        door("right_door", bay(0.22, 0.63), FRONT, Hinge::Right, [6.0, 60.0], TEAL, BAR),
    ]
}

pub(super) fn storage_2d4o() -> Vec<Part> {
    let size = [1.00, 0.46, 1.20];
    let mut body = carcass(size, 0.02, [WALNUT, WALNUT_FLAT, PINE]);
    body.add(OAK_UP, board([-0.009, 0.009], [0.02, 1.18], 0.44));
    for side in [[-0.48, -0.009], [0.009, 0.48]] {
        body.add(OAK, board(side, [0.47, 0.49], 0.44));
        body.add(OAK, board(side, [0.67, 0.69], 0.44));
        body.add(PINE, cuboid([side[0], 0.06, 0.93], [side[1], 0.44, 0.945]));
    }
    add_books(&mut body, [-0.45, 0.10, 0.691], 8, 0.22);
    add_books(&mut body, [0.05, 0.10, 0.946], 6, 0.2);
    body.add(BASKET, cuboid([-0.40, 0.10, 0.021], [-0.10, 0.36, 0.24]));
    add_jar(&mut body, [0.24, 0.22, 0.021], 0.10, 0.34, [VASE, BRASS]);
    add_jar(&mut body, [0.30, 0.2, 0.691], 0.05, 0.18, [CHESS, WHITE]);
    body.add(BLACK, cylinder(0.04, 1.20, 1.23).shifted([0.3, 0.2, 0.0]));
    let (left, right) = ([-0.50, 0.0], [0.0, 0.50]);
    let bay = |x: [f64; 2], z0: f64, z1: f64| Bay::new(x[0], x[1], z0, z1);
    let leaf = |name: &str, bay: Bay, hinge: Hinge, degrees: [f64; 2], material: Material| {
        door(name, bay, FRONT, hinge, degrees, material, BAR)
    };
    vec![
        body,
        drawer("left_drawer", bay(left, 0.48, 0.68), 0.40, [0.02, 0.14], [CHERRY, PINE], BAR),
        drawer("right_drawer", bay(right, 0.48, 0.68), 0.40, [0.02, 0.20], [CHERRY, PINE], BAR),
        leaf("upper_left_door", bay(left, 0.68, 1.20), Hinge::Left, [8.0, 70.0], CREAM),
        leaf("upper_right_door", bay(right, 0.68, 1.20), Hinge::Right, [8.0, 55.0], CREAM),
        leaf("lower_left_door", bay(left, 0.0, 0.48), Hinge::Left, [60.0, 10.0], BLUE_PAINT),
        leaf("lower_right_door", bay(right, 0.0, 0.48), Hinge::Right, [6.0, 80.0], BLUE_PAINT),
    ]
}
