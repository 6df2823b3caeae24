//! Refrigerators, ovens, a washing machine.

use super::furniture::*;
use crate::shape::{circle, cuboid, cylinder, frame, lathe, rectangle, rod};
use crate::{Material, Part};
use glam::{DVec2, DVec3};

const ENAMEL: Material = Material::Speckle { base: [0.16, 0.18, 0.24], spots: [0.26, 0.28, 0.33], size: 0.015 };
const GLASS_SHELF: Material = plain([0.66, 0.78, 0.80]);
const LABEL: Material = Material::Stripes { across: 2, even: [0.75, 0.25, 0.20], odd: [0.92, 0.88, 0.78], width: 0.03 };
const MINT: Material = plain([0.56, 0.74, 0.68]);
const CARTON: Material = Material::Checks { even: [0.30, 0.48, 0.72], odd: [0.88, 0.88, 0.84], cell: 0.05 };
const GREENS: Material = Material::Speckle { base: [0.30, 0.52, 0.22], spots: [0.62, 0.70, 0.30], size: 0.03 };
const KNOB: (Pull, Material) = (Pull::Knob, BLACK);

/// Bins on the inner face of a fridge door.
fn add_bins(door: &mut Part, bay: Bay, levels: &[f64]) {
    const INSET: f64 = 0.075;
    let [x0, x1] = [bay.x[0] + INSET, bay.x[1] - INSET];
    for (k, z) in levels.iter().enumerate() {
        door.add(WHITE, cuboid([x0, -GAP, *z], [x1, 0.085, z + 0.012]));
        door.add(GLASS_SHELF, cuboid([x0, 0.075, z + 0.012], [x1, 0.085, z + 0.07]));
        let jar = [x0 + 0.07 + 0.08 * k as f64, 0.04, z + 0.012];
        add_jar(door, jar, 0.03, 0.15, if k % 2 == 0 { [LABEL, BLACK] } else { [GREENS, WHITE] });
    }
}

fn food(body: &mut Part, levels: [f64; 3]) {
    let [low, middle, high] = levels;
    body.add(CARTON, cuboid([-0.24, 0.20, low], [-0.14, 0.30, low + 0.22]));
    add_jar(body, [0.10, 0.28, low], 0.06, 0.20, [GREENS, WHITE]);
    body.add(LABEL, cuboid([-0.10, 0.20, middle], [0.16, 0.42, middle + 0.10]));
    add_jar(body, [-0.20, 0.30, middle], 0.045, 0.18, [MINT, BRASS]);
    add_jar(body, [0.18, 0.26, high], 0.05, 0.16, [LABEL, WHITE]);
    body.add(CARTON, cuboid([-0.22, 0.22, high], [-0.02, 0.40, high + 0.08]));
}

/// A shelf of glass between the walls of a fridge.
fn glass(width: f64, depth: f64, z: f64) -> crate::Solid {
    cuboid([-width / 2.0 + 0.05, 0.11, z - 0.006], [width / 2.0 - 0.05, depth - 0.05, z + 0.006])
}

pub(super) fn fridge() -> Vec<Part> {
    let size = [0.66, 0.62, 1.25];
    let mut body = carcass(size, 0.05, [WHITE, WHITE, plain([0.80, 0.84, 0.86])]);
    for z in [0.40, 0.72, 0.98] {
        body.add(GLASS_SHELF, glass(size[0], size[1], z));
    }
    body.add(MINT, cuboid([-0.26, 0.12, 0.06], [0.26, 0.5, 0.24]));
    food(&mut body, [0.406, 0.726, 0.986]);
    add_feet(&mut body, size, 0.04, BLACK);
    let bay = Bay::new(-0.33, 0.33, 0.0, 1.25);
    let mut door = door("door", bay, 0.05, Hinge::Right, [12.0, 78.0], MINT, (Pull::Bar(0.5), STEEL));
    add_bins(&mut door, bay, &[0.30, 0.62, 0.90]);
    vec![body, door]
}

pub(super) fn fridge2() -> Vec<Part> {
    let size = [0.64, 0.60, 1.40];
    let mut body = carcass(size, 0.045, [STEEL, STEEL, WHITE]);
    body.add(WHITE, cuboid([-0.275, 0.0, 0.90], [0.275, 0.555, 0.94]));
    for z in [0.32, 0.60, 1.14] {
        body.add(GLASS_SHELF, glass(size[0], size[1], z));
    }
    food(&mut body, [0.326, 0.606, 0.941]);
    body.add(LABEL, cuboid([-0.20, 0.20, 1.146], [0.0, 0.40, 1.24]));
    add_feet(&mut body, size, 0.04, BLACK);
    let (low, high) = (Bay::new(-0.32, 0.32, 0.0, 0.92), Bay::new(-0.32, 0.32, 0.92, 1.40));
    let brushed = Material::Brushed { along: 2, color: [0.74, 0.76, 0.80], period: 0.008 };
    let mut fresh = door("door", low, 0.05, Hinge::Left, [10.0, 75.0], brushed, (Pull::Bar(0.4), BLACK));
    add_bins(&mut fresh, low, &[0.15, 0.42, 0.64]);
    let mut freezer = door(
        "freezer_door",
        high,
        0.05,
        Hinge::Left,
        [60.0, 20.0],
        plain([0.30, 0.42, 0.60]),
        (Pull::Bar(0.25), STEEL),
    );
    add_bins(&mut freezer, high, &[1.05]);
    vec![body, fresh, freezer]
}

/// An oven cavity: walls behind a bay, with a rack.
fn add_cavity(body: &mut Part, bay: Bay, depth: f64) {
    let ([x0, x1], [z0, z1]) = ([bay.x[0] + 0.02, bay.x[1] - 0.02], [bay.z[0] + 0.02, bay.z[1] - 0.02]);
    let z = 0.5 * (z0 + z1);
    for k in 0..8 {
        let x = x0 + 0.01 + (x1 - x0 - 0.02) * f64::from(k) / 7.0;
        body.add(STEEL, rod([x, 0.03, z], [x, depth - 0.05, z], 0.005));
    }
    for y in [0.04, depth - 0.06] {
        body.add(STEEL, rod([x0, y, z - 0.008], [x1, y, z - 0.008], 0.006));
    }
    let (cx, cy) = ((x0 + x1) / 2.0, depth / 2.0);
    let dish = [(0.0, 0.0), (0.09, 0.0), (0.12, 0.055), (0.11, 0.055), (0.085, 0.012), (0.0, 0.012)];
    body.add(CARTON, lathe(&dish.map(DVec2::from), 40).shifted([cx, cy, z + 0.006]));
    body.add(
        Material::Speckle { base: [0.75, 0.50, 0.22], spots: [0.50, 0.28, 0.12], size: 0.03 },
        cuboid([cx - 0.05, cy - 0.06, z + 0.02], [cx + 0.05, cy + 0.06, z + 0.10]),
    );
}

/// An oven door: slab, dark window, bar.
fn oven_door(name: &str, bay: Bay, hinge: Hinge, degrees: [f64; 2], material: Material) -> Part {
    let wide = bay.x[1] - bay.x[0];
    let length = if hinge == Hinge::Bottom { 0.75 * wide } else { 0.6 * (bay.z[1] - bay.z[0]) };
    let mut door = door(name, bay, 0.035, hinge, degrees, material, (Pull::Bar(length), STEEL));
    let (mx, mz) = (0.2 * wide, 0.24 * (bay.z[1] - bay.z[0]));
    let window =
        |low: f64, high: f64| cuboid([bay.x[0] + mx, low, bay.z[0] + mz], [bay.x[1] - mx, high, bay.z[1] - mz]);
    door.add(plain([0.20, 0.22, 0.25]), window(face(0.035) - 0.004, face(0.035)));
    door.add(ENAMEL, window(-GAP, 0.008));
    door
}

pub(super) fn oven() -> Vec<Part> {
    let size = [0.62, 0.56, 0.60];
    let mut body = carcass(size, 0.02, [STEEL, STONE, ENAMEL]);
    let top = 0.47;
    body.add(ENAMEL, cuboid([-0.29, 0.0, top - 0.01], [0.29, 0.54, top + 0.01]));
    body.add(WHITE, cuboid([-0.305, -0.02, top + 0.015], [0.305, 0.0, 0.595]));
    for k in 0..4 {
        add_pull(&mut body, KNOB, [-0.21 + 0.14 * f64::from(k), -0.02, 0.535], 0);
    }
    let bay = Bay::new(-0.31, 0.31, 0.0, top);
    add_cavity(&mut body, bay, 0.54);
    vec![body, oven_door("door", bay, Hinge::Bottom, [8.0, 70.0], CREAM)]
}

pub(super) fn oven_3o() -> Vec<Part> {
    let size = [0.98, 0.58, 0.86];
    let mut body = carcass(size, 0.02, [plain([0.46, 0.14, 0.14]), STEEL, ENAMEL]);
    let (split, low, top) = (0.08, 0.30, 0.74);
    body.add(ENAMEL, cuboid([split - 0.01, 0.0, 0.02], [split + 0.01, 0.56, top - 0.01]));
    body.add(ENAMEL, cuboid([-0.47, 0.0, top - 0.01], [0.47, 0.56, top + 0.01]));
    body.add(ENAMEL, cuboid([-0.47, 0.0, low - 0.01], [split - 0.01, 0.56, low + 0.01]));
    body.add(BLACK, cuboid([-0.48, -0.02, top + 0.015], [0.48, 0.0, 0.855]));
    for k in 0..7 {
        add_pull(&mut body, (Pull::Knob, BRASS), [-0.39 + 0.13 * f64::from(k), -0.02, 0.80], 0);
    }
    for (x, y) in [(-0.28, 0.16), (-0.28, 0.42), (0.02, 0.29), (0.30, 0.16), (0.30, 0.42)] {
        body.add(BLACK, crate::shape::tube(0.05, 0.09, 0.86, 0.878).shifted([x, y, 0.0]));
    }
    let bays = [Bay::new(-0.49, split, low, top), Bay::new(-0.49, split, 0.0, low), Bay::new(split, 0.49, 0.0, top)];
    add_cavity(&mut body, bays[0], 0.56);
    add_cavity(&mut body, bays[2], 0.56);
    body.add(LABEL, cuboid([-0.36, 0.12, 0.02], [-0.12, 0.34, 0.12]));
    let red = plain([0.58, 0.17, 0.16]);
    vec![
        body,
        oven_door("upper_door", bays[0], Hinge::Bottom, [10.0, 62.0], red),
        oven_door("lower_door", bays[1], Hinge::Bottom, [5.0, 48.0], STEEL),
        oven_door("side_door", bays[2], Hinge::Right, [65.0, 12.0], red),
    ]
}

pub(super) fn washer() -> Vec<Part> {
    const POINTS: usize = 64;
    let (w, d, h, hole) = (0.30, 0.56, 0.84, [0.0, 0.42]);
    let center = DVec2::from(hole);
    let radius = 0.17;
    let panel = rectangle(DVec2::new(-w, hole[1] - 0.30), DVec2::new(w, hole[1] + 0.30), POINTS);
    // The panel's front is the plane y = 0.
    let facing = |solid: crate::Solid| solid.facing_front();
    let mut body = Part::fixed("body")
        .with(WHITE, facing(frame(&panel, &circle(center, radius, POINTS), -0.02, 0.0)))
        .with(WHITE, cuboid([-w, 0.0, 0.0], [w, 0.02, hole[1] - 0.30]))
        .with(plain([0.36, 0.40, 0.48]), cuboid([-w, 0.0, hole[1] + 0.30], [w, 0.02, h]))
        .with(WHITE, cuboid([-w, 0.02, 0.0], [-w + 0.02, d, h]))
        .with(WHITE, cuboid([w - 0.02, 0.02, 0.0], [w, d, h]))
        .with(STONE, cuboid([-w + 0.02, 0.02, h - 0.02], [w - 0.02, d, h]))
        .with(WHITE, cuboid([-w + 0.02, 0.02, 0.0], [w - 0.02, d, 0.02]))
        .with(WHITE, cuboid([-w + 0.02, d - 0.02, 0.02], [w - 0.02, d, h - 0.02]));
    let drum = [(0.0, -0.45), (0.23, -0.45), (0.23, -0.03), (0.215, -0.03), (0.215, -0.435), (0.0, -0.435)];
    let holes = Material::Checks { even: [0.70, 0.71, 0.73], odd: [0.50, 0.52, 0.55], cell: 0.035 };
    body.add(holes, facing(lathe(&drum.map(DVec2::from), POINTS)).shifted([0.0, 0.0, hole[1]]));
    body.add(CLOTH, cuboid([-0.10, 0.12, hole[1] - 0.17], [0.09, 0.34, hole[1] - 0.10]));
    add_pull(&mut body, (Pull::Knob, STEEL), [0.18, 0.0, 0.78], 0);
    body.add(BLACK, cuboid([-0.06, -0.004, 0.755], [0.10, 0.0, 0.805]));
    body.add(CARTON, cuboid([-0.26, -0.006, 0.745], [-0.12, 0.0, 0.815]));
    // A ring, and a bowl of glass that reaches into the drum.
    let ring = [(0.14, 0.006), (0.21, 0.006), (0.205, 0.04), (0.15, 0.05)];
    let bowl = [(0.0, -0.06), (0.09, -0.05), (0.14, 0.006), (0.14, 0.03), (0.0, 0.02)];
    let mut door = Part::hinged("door", DVec3::NEG_Z, [-0.215, -0.03, hole[1]], [10.0, 80.0]);
    let at = |solid: crate::Solid| facing(solid).shifted([0.0, 0.0, hole[1]]);
    door.add(STEEL, at(lathe(&ring.map(DVec2::from), POINTS)));
    door.add(plain([0.40, 0.50, 0.58]), at(lathe(&bowl.map(DVec2::from), POINTS)));
    door.add(BLACK, at(cylinder(0.022, 0.045, 0.06)).shifted([0.178, 0.0, 0.0]));
    vec![body, door]
}
