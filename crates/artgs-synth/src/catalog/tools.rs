//! Small things: chair, laptop, scissors, stapler, USB stick, box cutter.

use super::furniture::*;
use crate::shape::{cuboid, cylinder, frame, prism, rectangle, rod, tube};
use crate::{Material, Part};
use glam::{DVec2, DVec3};

const RED_PLASTIC: Material = Material::Speckle { base: [0.74, 0.20, 0.17], spots: [0.62, 0.14, 0.13], size: 0.02 };
const YELLOW: Material = plain([0.88, 0.72, 0.18]);
const GRAPHITE: Material = Material::Speckle { base: [0.24, 0.25, 0.28], spots: [0.32, 0.33, 0.36], size: 0.015 };

fn outline(points: &[(f64, f64)]) -> Vec<DVec2> {
    points.iter().copied().map(DVec2::from).collect()
}

pub(super) fn foldchair() -> Vec<Part> {
    let mut body = Part::fixed("frame");
    for side in [-1.0, 1.0] {
        let (x, inner) = (0.21 * side, 0.245 * side);
        body.add(STEEL, rod([x, -0.24, 0.0], [x, 0.24, 0.96], 0.015));
        body.add(STEEL, rod([inner, 0.28, 0.0], [inner, -0.03, 0.50], 0.013));
        body.add(BLACK, cylinder(0.022, -0.02, 0.03).shifted([x, -0.24, 0.0]));
        body.add(BLACK, cylinder(0.022, -0.02, 0.03).shifted([inner, 0.28, 0.0]));
    }
    body.add(STEEL, rod([-0.21, -0.17, 0.14], [0.21, -0.17, 0.14], 0.011));
    body.add(STEEL, rod([-0.245, 0.205, 0.12], [0.245, 0.205, 0.12], 0.011));
    // The frame is inclined backwards by half a unit per unit of height.
    for (z, high) in [(0.70, 0.07), (0.80, 0.07), (0.90, 0.05)] {
        let y = 0.5 * z - 0.24;
        let slat =
            [(y - 0.010, z), (y + 0.010, z), (y + 0.010 + high / 2.0, z + high), (y - 0.010 + high / 2.0, z + high)];
        // The outline lies in (y, z); along_x points the extrusion along x and the first axis down, so it is turned back.
        let slat = prism(&outline(&slat.map(|(y, z)| (-z, y))), -0.20, 0.20).along_x();
        body.add(CHERRY, slat);
    }
    let hinge = [0.0, 0.005, 0.44];
    let mut seat = Part::hinged("seat", DVec3::NEG_X, hinge, [6.0, 68.0]);
    for k in 0..5 {
        let y = -0.40 + 0.078 * f64::from(k);
        seat.add(if k % 2 == 0 { OAK } else { CHERRY }, cuboid([-0.175, y, 0.445], [0.175, y + 0.066, 0.463]));
    }
    for x in [-0.15, 0.13] {
        seat.add(PINE, cuboid([x, -0.40, 0.425], [x + 0.02, 0.02, 0.445]));
    }
    seat.add(STEEL, rod([-0.19, 0.005, 0.435], [0.19, 0.005, 0.435], 0.009));
    vec![body, seat]
}

pub(super) fn laptop() -> Vec<Part> {
    const SHELL: Material = Material::Brushed { along: 0, color: [0.66, 0.67, 0.70], period: 0.01 };
    let mut base = Part::fixed("base").with(SHELL, cuboid([-0.40, 0.0, 0.0], [0.40, 0.56, 0.030]));
    for row in 0..5 {
        for column in 0..13 {
            let (x, y) = (-0.352 + 0.0545 * f64::from(column), 0.23 + 0.055 * f64::from(row));
            let key = cuboid([x, y, 0.030], [x + 0.046, y + 0.046, 0.038]);
            base.add(if (row + 3 * column) % 11 == 0 { YELLOW } else { GRAPHITE }, key);
        }
    }
    base.add(BLACK, cuboid([-0.12, 0.04, 0.030], [0.12, 0.19, 0.032]));
    base.add(RED_PLASTIC, cuboid([0.20, 0.07, 0.030], [0.34, 0.14, 0.0315]));
    let desktop = Material::Speckle { base: [0.16, 0.34, 0.58], spots: [0.62, 0.78, 0.80], size: 0.11 };
    let stripes = Material::Stripes { across: 0, even: [0.92, 0.90, 0.84], odd: [0.30, 0.36, 0.40], width: 0.022 };
    let mut lid = Part::hinged("lid", DVec3::NEG_X, [0.0, 0.55, 0.044], [28.0, 104.0])
        .with(plain([0.30, 0.42, 0.60]), cuboid([-0.40, 0.0, 0.046], [0.40, 0.545, 0.062]))
        .with(desktop, cuboid([-0.375, 0.03, 0.044], [0.375, 0.50, 0.046]))
        .with(stripes, cuboid([-0.30, 0.30, 0.043], [0.02, 0.44, 0.044]));
    lid.add(YELLOW, cylinder(0.05, 0.062, 0.0635).shifted([0.0, 0.27, 0.0]));
    vec![base, lid]
}

/// One half of a pair of scissors in the xz plane, pivot at the origin, between two y: blade up, handle down at `side`.
fn scissor_half(part: &mut Part, side: f64, y: [f64; 2], handle: Material) {
    let mirror = |points: &[(f64, f64)]| -> Vec<DVec2> {
        let mut points: Vec<DVec2> = points.iter().map(|(x, z)| DVec2::new(x * side, *z)).collect();
        if side < 0.0 {
            points.reverse();
        }
        points
    };
    let blade =
        [(-0.045, -0.06), (0.03, -0.07), (0.045, 0.02), (0.035, 0.20), (0.006, 0.54), (-0.012, 0.54), (-0.030, 0.10)];
    let shank = [(-0.045, -0.061), (0.075, -0.24), (0.12, -0.24), (0.03, -0.071)];
    part.add(STEEL, prism(&mirror(&blade), -y[1], -y[0]).facing_front());
    part.add(handle, prism(&mirror(&shank), -y[1], -y[0]).facing_front());
    part.add(handle, tube(0.066, 0.102, -y[1], -y[0]).facing_front().shifted([0.128 * side, 0.0, -0.328]));
}

pub(super) fn scissor() -> Vec<Part> {
    // The half whose handle is on the right turns; what is in front is nearer to -y.
    let mut fixed = Part::fixed("left_half");
    scissor_half(&mut fixed, -1.0, [0.001, 0.036], RED_PLASTIC);
    fixed.add(BRASS, cylinder(0.024, -0.044, -0.036).facing_front());
    let mut moving = Part::hinged("right_half", DVec3::NEG_Y, [0.0; 3], [12.0, 52.0]);
    scissor_half(&mut moving, 1.0, [-0.036, -0.001], plain([0.20, 0.34, 0.60]));
    moving.add(BRASS, cylinder(0.024, 0.036, 0.046).facing_front());
    vec![fixed, moving]
}

pub(super) fn stapler() -> Vec<Part> {
    let sole = [
        (-0.48, -0.08),
        (0.46, -0.08),
        (0.50, -0.04),
        (0.50, 0.04),
        (0.46, 0.08),
        (-0.48, 0.08),
        (-0.52, 0.04),
        (-0.52, -0.04),
    ];
    let mut base = Part::fixed("base")
        .with(GRAPHITE, prism(&outline(&sole), 0.0, 0.035))
        .with(STEEL, cuboid([-0.46, -0.05, 0.035], [-0.34, 0.05, 0.045]))
        .with(YELLOW, cuboid([-0.20, -0.045, 0.035], [0.10, 0.045, 0.038]));
    let cheek = [(0.26, 0.035), (0.49, 0.035), (0.49, 0.14), (0.45, 0.20), (0.36, 0.20)];
    for y in [-0.084, 0.068] {
        base.add(RED_PLASTIC, prism(&outline(&cheek), -y - 0.016, -y).facing_front());
    }
    base.add(STEEL, rod([0.42, -0.098, 0.155], [0.42, -0.084, 0.155], 0.022));
    base.add(STEEL, rod([0.42, 0.084, 0.155], [0.42, 0.098, 0.155], 0.022));
    let grip = [
        (-0.50, 0.115),
        (0.30, 0.125),
        (0.465, 0.125),
        (0.465, 0.175),
        (0.36, 0.215),
        (-0.05, 0.220),
        (-0.44, 0.185),
        (-0.50, 0.145),
    ];
    let arm = Part::hinged("arm", DVec3::Y, [0.42, 0.0, 0.155], [6.0, 38.0])
        .with(RED_PLASTIC, prism(&outline(&grip), -0.062, 0.062).facing_front())
        .with(STEEL, cuboid([-0.49, -0.045, 0.075], [0.30, 0.045, 0.115]))
        .with(BLACK, cuboid([-0.30, -0.066, 0.145], [0.10, -0.062, 0.185]))
        .with(CREAM, cuboid([-0.20, 0.062, 0.140], [0.10, 0.064, 0.180]));
    vec![base, arm]
}

pub(super) fn usb() -> Vec<Part> {
    const POINTS: usize = 32;
    let body_side = [(-0.42, -0.07), (-0.38, -0.11), (0.24, -0.11), (0.24, 0.11), (-0.38, 0.11), (-0.42, 0.07)];
    let rim = |y: f64, z: f64| rectangle(DVec2::new(-z, -y), DVec2::new(z, y), POINTS);
    let plug = frame(&rim(0.080, 0.034), &rim(0.070, 0.024), 0.24, 0.48).along_x();
    let label = Material::Checks { even: [0.86, 0.84, 0.74], odd: [0.22, 0.40, 0.58], cell: 0.03 };
    let mut stick = Part::fixed("stick")
        .with(GRAPHITE, prism(&outline(&body_side), -0.045, 0.045))
        .with(STEEL, plug)
        .with(WHITE, cuboid([0.24, -0.060, -0.020], [0.47, 0.060, -0.004]));
    for y in [-0.045, -0.015, 0.015, 0.045] {
        stick.add(BRASS, cuboid([0.30, y - 0.008, -0.004], [0.46, y + 0.008, 0.0]));
    }
    stick.add(label, cuboid([-0.04, -0.115, -0.03], [0.20, -0.11, 0.03]));
    stick.add(YELLOW, cuboid([-0.04, 0.11, -0.03], [0.20, 0.115, 0.03]));
    let pivot = [-0.28, 0.0, 0.0];
    let plate = [(-0.40, -0.06), (-0.36, -0.10), (0.53, -0.10), (0.53, 0.10), (-0.36, 0.10), (-0.40, 0.06)];
    let steel = Material::Brushed { along: 1, color: [0.70, 0.71, 0.74], period: 0.01 };
    let mut cover = Part::hinged("cover", DVec3::Z, pivot, [20.0, 110.0])
        .with(steel, prism(&outline(&plate), 0.050, 0.064))
        .with(steel, prism(&outline(&plate), -0.064, -0.050))
        .with(RED_PLASTIC, cuboid([0.515, -0.10, -0.050], [0.53, 0.10, 0.050]));
    for (low, high) in [(0.064, 0.076), (-0.076, -0.064)] {
        cover.add(BRASS, cylinder(0.05, low, high).shifted(pivot));
    }
    cover.add(label, cuboid([-0.10, -0.05, 0.064], [0.30, 0.05, 0.0665]));
    vec![stick, cover]
}

pub(super) fn blade() -> Vec<Part> {
    let ribbed = Material::Stripes { across: 0, even: [0.88, 0.62, 0.16], odd: [0.74, 0.48, 0.10], width: 0.03 };
    let mut handle = Part::fixed("handle")
        .with(ribbed, cuboid([-0.50, -0.050, 0.0], [0.22, -0.018, 0.15]))
        .with(ribbed, cuboid([-0.50, 0.018, 0.0], [0.22, 0.050, 0.15]))
        .with(GRAPHITE, cuboid([-0.50, -0.018, 0.0], [0.20, 0.018, 0.022]))
        .with(GRAPHITE, cuboid([-0.54, -0.045, 0.005], [-0.50, 0.045, 0.145]));
    handle.add(BLACK, cuboid([-0.30, -0.054, 0.045], [0.05, -0.050, 0.105]));
    handle.add(CREAM, cuboid([-0.30, 0.050, 0.045], [0.05, 0.053, 0.105]));
    let segments = Material::Stripes { across: 0, even: [0.76, 0.77, 0.80], odd: [0.60, 0.61, 0.65], width: 0.045 };
    let edge = [(-0.36, 0.030), (0.20, 0.030), (0.29, 0.120), (-0.36, 0.120)];
    let mut knife = Part::sliding("blade", DVec3::X, [0.06, 0.30])
        .with(segments, prism(&outline(&edge), -0.006, 0.006).facing_front());
    knife.add(RED_PLASTIC, cuboid([-0.36, -0.013, 0.120], [-0.20, 0.013, 0.165]));
    knife.add(RED_PLASTIC, cuboid([-0.34, -0.030, 0.165], [-0.22, 0.030, 0.185]));
    vec![handle, knife]
}
