//! Chains of joints: desk lamp, monitor arm, office chair, a drawer in a door.

use super::fronts::{Bay, Edge, FrontStyle, Pull, Rect, TrayStyle, drawer};
use super::model::{Body, Mechanism, Model, Studio};
use crate::shape::{cuboid, cylinder, lathe, rod};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// A pin along x between two x, around a point of the yz plane.
fn pin(x: [f64; 2], y: f64, z: f64, radius: f64) -> crate::Solid {
    rod([x[0], y, z], [x[1], y, z], radius)
}

/// A lamp: two arms and perhaps a head, each on a horizontal pin. The arms lie side by side, so that they pass each other.
pub(super) fn desk_lamp(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let (foot, post) = (dice.within([0.08, 0.12]), dice.within([0.05, 0.09]));
    let (lower, upper) = (dice.within([0.26, 0.4]), dice.within([0.24, 0.38]));
    let (bar, head_turns) = (dice.within([0.005, 0.009]), dice.chance(0.7));
    let (metal, front) = (studio.looks.handle(), studio.looks.front());
    let slot = |k: i32| [-0.022 * f64::from(k) - 0.008, -0.022 * f64::from(k) + 0.008];
    let mut base = Body::fixed("foot").with(studio.looks.body(), cylinder(foot, 0.0, 0.025));
    let pivot = 0.025 + post;
    base.add(metal, cuboid([0.011, -0.012, 0.025], [0.025, 0.012, pivot + 0.012]));
    let mut model = Model::new("desk-lamp", base);
    let hinge = |z: f64, y: f64, range: [f64; 2]| Mechanism::hinge(DVec3::X, [0.0, y, z], range, 12.0).anywhere();

    let mut arm = Body::new("lower_arm", 0, hinge(pivot, 0.0, [-40.0, 40.0]));
    let [a, b] = slot(0);
    arm.add(metal, pin([a, b + 0.002], 0.0, pivot, 0.013));
    arm.add(metal, cuboid([-bar, -bar, pivot + 0.012], [bar, bar, pivot + lower - 0.012]));
    let elbow = pivot + lower;
    arm.add(metal, pin([a, b], 0.0, elbow, 0.013));
    let arm = model.push(arm);

    let mut second = Body::new("upper_arm", arm, hinge(elbow, 0.0, [-45.0, 50.0]));
    let [a, b] = slot(1);
    second.add(metal, pin([a, b + 0.004], 0.0, elbow, 0.013));
    let x = (a + b) / 2.0;
    second.add(metal, cuboid([x - bar, -upper + 0.012, elbow - bar], [x + bar, -0.012, elbow + bar]));
    second.add(metal, pin([a, b], -upper, elbow, 0.013));

    let mut head = Body::new("head", 0, hinge(elbow, -upper, [-50.0, 50.0]));
    let [a, b] = slot(2);
    let x = (a + b) / 2.0;
    head.add(metal, pin([a, b + 0.004], -upper, elbow, 0.012));
    head.add(metal, cuboid([x - bar, -upper - 0.05, elbow - bar], [x + bar, -upper - 0.01, elbow + bar]));
    let (wide, tall) = (studio.dice.within([0.055, 0.085]), studio.dice.within([0.07, 0.12]));
    let shade = [(0.0, 0.0), (0.025, 0.0), (wide, -tall), (wide - 0.003, -tall), (0.022, -0.004), (0.0, -0.004)];
    let shade: Vec<DVec2> = shade.iter().rev().copied().map(DVec2::from).collect();
    head.add(front, lathe(&shade, 32).shifted([x, -upper - 0.07, elbow]));
    if head_turns {
        let second = model.push(second);
        head.parent = second;
        model.push(head);
    } else {
        second.pieces.extend(head.pieces);
        model.push(second);
    }
    model.mark("chain");
    model
}

/// A screen on an arm with two upright joints, and perhaps a third one that turns or tilts the screen.
pub(super) fn monitor_arm(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let (first, second) = (dice.within([0.18, 0.28]), dice.within([0.18, 0.28]));
    let (height, end) = (dice.within([0.28, 0.42]), dice.count(0, 2));
    let (w, h) = (dice.within([0.45, 0.7]), dice.within([0.28, 0.4]));
    let (body, metal, front) = (studio.looks.body(), studio.looks.handle(), studio.looks.front());
    let thing = studio.looks.thing();
    let mut base = Body::fixed("post").with(thing, cuboid([-0.35, -0.3, -0.03], [0.35, 0.08, 0.0]));
    base.add(metal, cuboid([-0.05, -0.05, 0.0], [0.05, 0.05, 0.02]));
    base.add(metal, cylinder(0.018, 0.02, height));
    let mut model = Model::new("monitor-arm", base);
    let upright = |y: f64, range: [f64; 2]| Mechanism::hinge(DVec3::Z, [0.0, y, 0.0], range, 15.0).anywhere();
    // Each arm lies above the one before it.
    let level = |k: i32| [height + 0.002 + 0.034 * f64::from(k), height + 0.034 + 0.034 * f64::from(k) - 0.002];

    let mut arm = Body::new("arm", 0, upright(0.0, [-70.0, 70.0]));
    let [low, high] = level(0);
    arm.add(metal, cylinder(0.022, low, high));
    arm.add(metal, cuboid([-0.016, -first, low + 0.004], [0.016, -0.015, high - 0.004]));
    arm.add(metal, cylinder(0.022, low, high).shifted([0.0, -first, 0.0]));
    let arm = model.push(arm);

    let mut fore = Body::new("fore_arm", arm, upright(-first, [-100.0, 100.0]));
    let [low, high] = level(1);
    let far = -first - second;
    fore.add(metal, cylinder(0.022, low, high).shifted([0.0, -first, 0.0]));
    fore.add(metal, cuboid([-0.014, far, low + 0.004], [0.014, -first - 0.015, high - 0.004]));
    fore.add(metal, cylinder(0.02, low, high).shifted([0.0, far, 0.0]));

    let [low, high] = level(2);
    let z = (low + high) / 2.0;
    let turn = match end {
        0 => None,
        1 => Some(upright(far, [-60.0, 60.0])),
        _ => Some(Mechanism::hinge(DVec3::X, [0.0, far, z], [-25.0, 25.0], 10.0).anywhere()),
    };
    // Room below the bracket for a screen that tilts.
    let lift = if end == 2 { 0.016 } else { 0.0 };
    let mut screen = Body::fixed("screen");
    screen.add(metal, cuboid([-0.025, far - 0.05, low + lift], [0.025, far + 0.01, high + lift]));
    screen.add(body, cuboid([-w / 2.0, far - 0.08, z - h / 2.0], [w / 2.0, far - 0.05, z + h / 2.0]));
    screen.add(
        front,
        cuboid([-w / 2.0 + 0.01, far - 0.082, z - h / 2.0 + 0.01], [w / 2.0 - 0.01, far - 0.08, z + h / 2.0 - 0.01]),
    );
    match turn {
        Some(mechanism) => {
            let fore = model.push(fore);
            screen.mechanism = Some(mechanism);
            screen.parent = fore;
            model.push(screen);
        }
        None => {
            fore.pieces.extend(screen.pieces);
            model.push(fore);
        }
    }
    model.mark("chain");
    model
}

/// An office chair: a seat that turns on a star, a back that tilts.
pub(super) fn office_chair(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let (seat_z, half, back) = (dice.within([0.42, 0.5]), dice.within([0.21, 0.26]), dice.within([0.4, 0.6]));
    let (arms, legs, spoke) = (dice.chance(0.6), dice.count(4, 5), dice.within([0.26, 0.33]));
    let (body, metal, front) = (studio.looks.body(), studio.looks.handle(), studio.looks.front());
    let mut base = Body::fixed("star").with(metal, cylinder(0.03, 0.07, seat_z - 0.06));
    for k in 0..legs {
        let direction = DVec2::from_angle(TAU * (k as f64 + 0.25) / legs as f64);
        let (near, far) = (0.02 * direction, spoke * direction);
        base.add(body, rod([near.x, near.y, 0.1], [far.x, far.y, 0.065], 0.018));
        base.add(body, rod([far.x, far.y - 0.02, 0.028], [far.x, far.y + 0.02, 0.028], 0.028));
    }
    let mut model = Model::new("office-chair", base);
    let turn = Mechanism::hinge(DVec3::Z, [0.0; 3], [-150.0, 150.0], 20.0).anywhere();
    let mut seat = Body::new("seat", 0, turn);
    seat.add(metal, cuboid([-0.1, -0.1, seat_z - 0.056], [0.1, 0.1, seat_z - 0.03]));
    seat.add(front, cuboid([-half, -half, seat_z - 0.03], [half, half, seat_z + 0.04]));
    if arms {
        for side in [-1.0, 1.0] {
            let x = side * (half + 0.03);
            seat.add(body, cuboid([x - 0.015, -0.03, seat_z - 0.02], [x + 0.015, 0.03, seat_z + 0.2]));
            seat.add(body, cuboid([x - 0.03, -0.14, seat_z + 0.2], [x + 0.03, 0.1, seat_z + 0.23]));
            let inner = side * half;
            let (low, high) = (inner.min(x - side * 0.015), inner.max(x - side * 0.015));
            seat.add(body, cuboid([low, -0.03, seat_z - 0.02], [high, 0.03, seat_z + 0.01]));
        }
    }
    let y = half + 0.02;
    seat.add(metal, cuboid([-0.06, half, seat_z - 0.02], [-0.045, y + 0.02, seat_z + 0.03]));
    seat.add(metal, cuboid([0.045, half, seat_z - 0.02], [0.06, y + 0.02, seat_z + 0.03]));
    let seat = model.push(seat);
    let tilt = Mechanism::hinge(DVec3::NEG_X, [0.0, y, seat_z + 0.005], [-5.0, 35.0], 10.0).anywhere();
    let mut rest = Body::new("back", seat, tilt);
    rest.add(metal, pin([-0.043, 0.043], y, seat_z + 0.005, 0.012));
    rest.add(metal, cuboid([-0.03, y - 0.004, seat_z + 0.015], [0.03, y + 0.012, seat_z + 0.18]));
    rest.add(front, cuboid([-0.9 * half, y - 0.012, seat_z + 0.18], [0.9 * half, y + 0.025, seat_z + 0.18 + back]));
    model.push(rest);
    model.mark("chain");
    model
}

/// A cabinet with a thick door that carries a drawer.
pub(super) fn door_with_drawer(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let (w, d, h) = (dice.within([0.5, 0.8]), dice.within([0.36, 0.5]), dice.within([0.7, 1.2]));
    let (thick, t, edge) = (dice.within([0.12, 0.18]), 0.02, if dice.chance(0.5) { Edge::Left } else { Edge::Right });
    let (low, tall) = (dice.within([0.25, 0.5]) * h, dice.within([0.16, 0.26]));
    let high = low + tall;
    let (body, inside, front) = (studio.looks.body(), studio.looks.inside(), studio.looks.front());
    let x = w / 2.0;
    let mut base = Body::fixed("body");
    base.add(body, cuboid([-x, 0.0, 0.0], [-x + t, d, h]));
    base.add(body, cuboid([x - t, 0.0, 0.0], [x, d, h]));
    base.add(body, cuboid([-x + t, 0.0, h - t], [x - t, d, h]));
    base.add(body, cuboid([-x + t, 0.0, 0.0], [x - t, d, t]));
    base.add(inside, cuboid([-x + t, d - t, t], [x - t, d, h - t]));
    base.add(inside, cuboid([-x + t, 0.14, 0.5 * h - 0.008], [x - t, d - t, 0.5 * h + 0.008]));
    let thing = studio.looks.thing();
    base.add(thing, cuboid([-0.1, 0.16, t], [0.12, 0.3, 0.3 * h]));
    let mut model = Model::new("door-with-drawer", base);

    let (near, x, z) = (-0.003 - thick, x - 0.003, [0.003, h - 0.003]);
    let (axis, at) = if edge == Edge::Left { (DVec3::NEG_Z, -x) } else { (DVec3::Z, x) };
    let mut leaf = Body::new("door", 0, Mechanism::hinge(axis, [at, near, h / 2.0], [0.0, 95.0], 15.0));
    leaf.add(front, cuboid([-x, near, z[0]], [x, -0.003, low]));
    leaf.add(front, cuboid([-x, near, high], [x, -0.003, z[1]]));
    leaf.add(front, cuboid([-x, near, low], [-x + 0.03, -0.003, high]));
    leaf.add(front, cuboid([x - 0.03, near, low], [x, -0.003, high]));
    leaf.add(inside, cuboid([-x + 0.03, -0.013, low], [x - 0.03, -0.003, high]));
    let leaf = model.push(leaf);

    let style = FrontStyle {
        inset: studio.dice.chance(0.5),
        gap: 0.004,
        reveal: 0.0,
        thickness: 0.018,
        sheet: None,
        framed: false,
        pull: studio.dice.pick(&[Pull::Bar, Pull::Knob, Pull::None]),
        behind: 0.003,
        tray: TrayStyle::draw(studio),
    };
    let opening = Rect { x: [-x + 0.03, x - 0.03], z: [low, high] };
    let bay = Bay { opening, cover: opening.shrunk(-0.012) };
    let mut inner = drawer(studio, &style, &bay, thick - 0.014, "door_drawer".into());
    inner.parent = leaf;
    inner.shift(DVec3::new(0.0, near, 0.0));
    if let Some(mechanism) = &mut inner.mechanism {
        mechanism.least = mechanism.least.min(0.4 * mechanism.range[1]);
    }
    model.push(inner);
    model.mark("chain");
    model
}
