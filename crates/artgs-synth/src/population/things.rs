//! Small things: laptop, boxes with lids, scissors, stapler, tap, window, panel of dials, bottle.

use super::appliances::dial;
use super::model::{Body, Mechanism, Model, Studio};
use crate::shape::{cuboid, cylinder, frame, lathe, prism, rectangle, rod, tube};
use crate::{Material, Solid};
use artgs_core::{JointKind, Rigid};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

fn outline(points: &[(f64, f64)]) -> Vec<DVec2> {
    points.iter().copied().map(DVec2::from).collect()
}

/// A laptop whose lid opens from closed to far back.
pub(super) fn laptop(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let (w, d) = (dice.within([0.29, 0.40]), dice.within([0.2, 0.27]));
    let (h, lid) = (dice.within([0.010, 0.018]), dice.within([0.005, 0.008]));
    let (shell, x) = (studio.looks.body(), w / 2.0);
    let mut model = Model::new("laptop", Body::fixed("base").with(shell, cuboid([-x, 0.0, 0.0], [x, d, h])));
    let (columns, key) = (studio.dice.count(10, 14), studio.looks.glass());
    let pitch = 0.9 * w / columns as f64;
    for row in 0..5 {
        for column in 0..columns {
            let (kx, ky) = (-0.45 * w + pitch * column as f64, d * (0.42 + 0.095 * f64::from(row)));
            let cap = cuboid([kx, ky, h], [kx + 0.85 * pitch, ky + 0.08 * d, h + 0.0015]);
            model.base().add(key, cap);
        }
    }
    model.base().add(key, cuboid([-0.15 * w, 0.06 * d, h], [0.15 * w, 0.36 * d, h + 0.0005]));
    let (z, widest) = (h + 0.003, studio.dice.within([100.0, 140.0]));
    let mut top = Body::new("lid", 0, Mechanism::hinge(DVec3::NEG_X, [0.0, d, z - 0.001], [0.0, widest], 15.0));
    top.add(studio.looks.front(), cuboid([-x, 0.0, z], [x, d - 0.004, z + lid]));
    top.add(key, cuboid([-x + 0.008, 0.01, z - 0.0006], [x - 0.008, d - 0.02, z]));
    if studio.dice.chance(0.5) {
        let thing = studio.looks.thing();
        top.add(thing, cylinder(0.09 * d, z + lid, z + lid + 0.0006).shifted([0.0, 0.5 * d, 0.0]));
    }
    model.push(top);
    model
}

/// Walls and floor of a box open above, outside `x`, `y` from 0 to `d`, height `h`.
fn open_box(base: &mut Body, material: Material, inside: Material, [w, d, h]: [f64; 3], t: f64) {
    let x = w / 2.0;
    base.add(material, cuboid([-x, 0.0, 0.0], [-x + t, d, h]));
    base.add(material, cuboid([x - t, 0.0, 0.0], [x, d, h]));
    base.add(material, cuboid([-x + t, 0.0, 0.0], [x - t, t, h]));
    base.add(material, cuboid([-x + t, d - t, 0.0], [x - t, d, h]));
    base.add(inside, cuboid([-x + t, t, 0.0], [x - t, d - t, t]));
}

/// A box or chest with a lid; perhaps a second lid beside it.
pub(super) fn chest_with_lid(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let [w, d, h] = [dice.within([0.3, 1.0]), dice.within([0.25, 0.5]), dice.within([0.18, 0.5])];
    let (t, lid, two) = (dice.within([0.006, 0.018]), dice.within([0.008, 0.02]), w > 0.6 && dice.chance(0.4));
    let mut model = Model::new("box", Body::fixed("box"));
    let (body, inside) = (studio.looks.body(), studio.looks.inside());
    open_box(model.base(), body, inside, [w, d, h], t);
    for _ in 0..studio.dice.count(0, 3) {
        let (thing, side) = (studio.looks.thing(), studio.dice.within([0.08, 0.3 * d]));
        let at = studio.dice.within([-w / 2.0 + t + 0.01, w / 2.0 - t - 0.01 - side]);
        let y = studio.dice.within([t + 0.01, d - t - 0.01 - side]);
        let high = studio.dice.within([0.2, 0.8]) * (h - t);
        model.base().add(thing, cuboid([at, y, t], [at + side, y + side, t + high]));
    }
    let spans = if two { vec![[-w / 2.0, -0.002], [0.002, w / 2.0]] } else { vec![[-w / 2.0, w / 2.0]] };
    for (index, x) in spans.into_iter().enumerate() {
        add_lid(&mut model, studio, x, [d, h], lid, format!("lid_{index}"));
    }
    model
}

fn add_lid(model: &mut Model, studio: &mut Studio, x: [f64; 2], [d, h]: [f64; 2], thick: f64, name: String) -> usize {
    let (z, widest) = (h + 0.0015, studio.dice.within([75.0, 125.0]));
    let hinge = Mechanism::hinge(DVec3::NEG_X, [(x[0] + x[1]) / 2.0, d, z], [0.0, widest], 15.0);
    let mut lid = Body::new(name, 0, hinge);
    let out = studio.dice.within([0.0, 0.015]);
    lid.add(studio.looks.front(), cuboid([x[0], -out, z], [x[1], d, z + thick]));
    if studio.dice.chance(0.4) {
        let grip =
            cuboid([(x[0] + x[1]) / 2.0 - 0.05, -out - 0.012, z], [(x[0] + x[1]) / 2.0 + 0.05, -out, z + 0.8 * thick]);
        lid.add(studio.looks.handle(), grip);
    }
    model.push(lid)
}

/// A waste bin, round or rectangular, with a lid.
pub(super) fn bin(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let (r, h, round) = (dice.within([0.11, 0.2]), dice.within([0.3, 0.7]), dice.chance(0.6));
    let mut model = Model::new("bin", Body::fixed("bin"));
    let (body, inside, front) = (studio.looks.body(), studio.looks.inside(), studio.looks.front());
    let (z, widest) = (h + 0.0015, studio.dice.within([70.0, 105.0]));
    if round {
        let wall = [(0.0, 0.0), (0.85 * r, 0.0), (r, h), (r - 0.006, h), (0.85 * r - 0.006, 0.008), (0.0, 0.008)];
        model.base().add(body, lathe(&wall.map(DVec2::from), 40));
        let mut lid = Body::new("lid", 0, Mechanism::hinge(DVec3::NEG_X, [0.0, r + 0.004, z], [0.0, widest], 15.0));
        let dome = [(0.0, 0.0), (r, 0.0), (r, 0.015), (0.6 * r, 0.035), (0.0, 0.04)];
        lid.add(front, lathe(&dome.map(DVec2::from), 40).shifted([0.0, 0.0, z]));
        lid.add(studio.looks.handle(), cuboid([-0.03, -r - 0.02, z], [0.03, -r + 0.004, z + 0.012]));
        model.push(lid);
    } else {
        open_box(model.base(), body, inside, [2.0 * r, 1.6 * r, h], 0.005);
        add_lid(&mut model, studio, [-r, r], [1.6 * r, h], 0.02, "lid".into());
    }
    model
}

/// A toolbox: a lid that carries a handle, which folds down.
pub(super) fn toolbox(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let [w, d, h] = [dice.within([0.36, 0.6]), dice.within([0.18, 0.28]), dice.within([0.15, 0.26])];
    let thick = dice.within([0.02, 0.04]);
    let mut model = Model::new("toolbox", Body::fixed("box"));
    let (body, inside) = (studio.looks.body(), studio.looks.inside());
    open_box(model.base(), body, inside, [w, d, h], 0.006);
    let thing = studio.looks.thing();
    model.base().add(thing, cuboid([-0.3 * w, 0.05, 0.006], [0.1 * w, 0.12, 0.6 * h]));
    let lid = add_lid(&mut model, studio, [-w / 2.0, w / 2.0], [d, h], thick, "lid".into());
    let (top, half, y) = (h + 0.0015 + thick, studio.dice.within([0.08, 0.13]), d / 2.0);
    let metal = studio.looks.handle();
    for side in [-1.0, 1.0] {
        let post = cuboid([side * half - 0.006, y - 0.008, top], [side * half + 0.006, y + 0.008, top + 0.016]);
        model.bodies[lid].add(body, post);
    }
    // The handle lies flat towards the front at 0 and stands upright at 90 degrees.
    let reach = (0.6 * d / 2.0).min(0.07);
    let hinge = Mechanism::hinge(DVec3::NEG_X, [0.0, y, top + 0.008], [0.0, 100.0], 25.0);
    let mut bail = Body::new("handle", lid, hinge.anywhere());
    let (inner, z) = (half - 0.009, top + 0.008);
    for side in [-1.0, 1.0] {
        bail.add(
            metal,
            cuboid([side * inner - 0.003, y - reach, z - 0.004], [side * inner + 0.003, y + 0.004, z + 0.004]),
        );
    }
    bail.add(metal, cuboid([-inner + 0.003, y - reach, z - 0.005], [inner - 0.003, y - reach + 0.012, z + 0.005]));
    model.push(bail);
    model.mark("small");
    model
}

/// Scissors that stand on their handles; one half turns.
pub(super) fn scissors(studio: &mut Studio) -> Model {
    let scale = studio.dice.within([0.9, 1.15]);
    let half = |side: f64, y: [f64; 2], blade: Material, handle: Material, into: &mut Body| {
        let mirror = |points: &[(f64, f64)]| -> Vec<DVec2> {
            let mut points: Vec<DVec2> = points.iter().map(|(x, z)| DVec2::new(x * side, *z) * scale * 0.25).collect();
            if side < 0.0 {
                points.reverse();
            }
            points
        };
        let edge =
            [(-0.05, -0.06), (0.03, -0.07), (0.045, 0.02), (0.035, 0.2), (0.006, 0.54), (-0.012, 0.54), (-0.03, 0.1)];
        let shank = [(-0.045, -0.061), (0.075, -0.24), (0.12, -0.24), (0.03, -0.071)];
        into.add(blade, prism(&mirror(&edge), -y[1], -y[0]).facing_front());
        into.add(handle, prism(&mirror(&shank), -y[1], -y[0]).facing_front());
        let ring = tube(0.0165 * scale, 0.0255 * scale, -y[1], -y[0]).facing_front();
        into.add(handle, ring.shifted([0.032 * side * scale, 0.0, -0.082 * scale]));
    };
    let thick = studio.dice.within([0.004, 0.009]);
    let (metal, front) = (studio.looks.handle(), studio.looks.front());
    let mut fixed = Body::fixed("left_half");
    half(-1.0, [0.0004, thick], metal, front, &mut fixed);
    let mut model = Model::new("scissors", fixed);
    let hinge = Mechanism::hinge(DVec3::NEG_Y, [0.0; 3], [5.0, 70.0], 15.0).anywhere();
    let mut moving = Body::new("right_half", 0, hinge);
    half(1.0, [-thick, -0.0004], metal, front, &mut moving);
    moving.add(metal, cylinder(0.006 * scale, thick, thick + 0.003).facing_front());
    model.push(moving);
    model.mark("thin");
    model
}

/// A stapler whose arm lifts.
pub(super) fn stapler(studio: &mut Studio) -> Model {
    let s = studio.dice.within([0.13, 0.18]);
    let at = |points: &[(f64, f64)]| -> Vec<DVec2> { points.iter().map(|(x, z)| DVec2::new(x * s, z * s)).collect() };
    let sole = [(-0.5, -0.09), (0.5, -0.09), (0.5, 0.09), (-0.5, 0.09)];
    let (body, metal) = (studio.looks.body(), studio.looks.handle());
    let mut base = Body::fixed("base").with(body, prism(&at(&sole), 0.0, 0.04 * s));
    let cheek = [(0.26, 0.04), (0.49, 0.04), (0.49, 0.14), (0.45, 0.20), (0.36, 0.20)];
    for y in [-0.088, 0.07] {
        base.add(body, prism(&at(&cheek), (-y - 0.018) * s, -y * s).facing_front());
    }
    let mut model = Model::new("stapler", base);
    let hinge = Mechanism::hinge(DVec3::Y, [0.42 * s, 0.0, 0.15 * s], [0.0, 50.0], 10.0);
    let mut arm = Body::new("arm", 0, hinge);
    let grip = [
        (-0.5, 0.115),
        (0.3, 0.12),
        (0.46, 0.12),
        (0.46, 0.17),
        (0.36, 0.21),
        (-0.05, 0.22),
        (-0.44, 0.185),
        (-0.5, 0.145),
    ];
    arm.add(studio.looks.front(), prism(&at(&grip), -0.064 * s, 0.064 * s).facing_front());
    arm.add(metal, cuboid([-0.49 * s, -0.045 * s, 0.06 * s], [0.26 * s, 0.045 * s, 0.118 * s]));
    model.push(arm);
    model
}

/// A tap on a basin: a spout that turns, a lever.
pub(super) fn tap(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let (r, h, reach) = (dice.within([0.018, 0.026]), dice.within([0.16, 0.32]), dice.within([0.14, 0.24]));
    let (spout_turns, lever_lifts) = (dice.chance(0.7), dice.chance(0.6));
    let (body, metal, front) = (studio.looks.body(), studio.looks.handle(), studio.looks.front());
    let mut base = Body::fixed("basin").with(body, cuboid([-0.25, -0.35, -0.03], [0.25, 0.06, 0.0]));
    base.add(metal, cylinder(r, 0.0, h));
    let mut model = Model::new("tap", base);
    let (low, high) = (0.6 * h, 0.6 * h + 2.2 * r);
    let mut spout = Body::new("spout", 0, Mechanism::hinge(DVec3::Z, [0.0; 3], [-70.0, 70.0], 20.0).anywhere());
    let z = (low + high) / 2.0;
    spout.add(metal, tube(r + 0.001, r + 0.009, low, high));
    spout.add(metal, rod([0.0, -r - 0.005, z], [0.0, -reach, z + 0.05], 0.012));
    spout.add(metal, rod([0.0, -reach + 0.006, z + 0.053], [0.0, -reach + 0.006, z + 0.01], 0.011));
    if spout_turns {
        model.push(spout);
    } else {
        model.base().pieces.extend(spout.pieces);
    }
    let top = h + 0.002;
    let turn = match lever_lifts {
        true => Mechanism::hinge(DVec3::NEG_X, [0.0, 0.0, top + 0.4 * r], [0.0, 50.0], 15.0),
        false => Mechanism::hinge(DVec3::Z, [0.0; 3], [-60.0, 60.0], 20.0),
    };
    let mut lever = Body::new("lever", 0, turn.anywhere());
    // Above the column by as much as its cap sinks when the lever lifts.
    let cap = top + if lever_lifts { 0.8 * r } else { 0.0 };
    lever.add(front, cylinder(0.9 * r, cap, cap + 0.7 * r));
    lever.add(front, rod([0.0, -0.5 * r, cap + 0.4 * r], [0.0, -0.11, cap + 0.03], 0.007));
    model.push(lever);
    model.mark("small");
    model
}

/// A window in a piece of wall: a casement, a pair of them, a tilting sash or a sash that slides.
pub(super) fn window(studio: &mut Studio) -> Model {
    const POINTS: usize = 8;
    let dice = &mut *studio.dice;
    let (w, h) = (dice.within([0.5, 1.2]), dice.within([0.6, 1.3]));
    let (layout, thick, bar) = (dice.count(0, 3), dice.within([0.035, 0.05]), dice.within([0.04, 0.06]));
    let rect = |x: [f64; 2], z: [f64; 2]| rectangle(DVec2::new(x[0], z[0]), DVec2::new(x[1], z[1]), POINTS);
    let ring = |x: [f64; 2], z: [f64; 2], by: f64, y: [f64; 2]| -> Solid {
        let inner = rect([x[0] + by, x[1] - by], [z[0] + by, z[1] - by]);
        frame(&rect(x, z), &inner, -y[1], -y[0]).facing_front()
    };
    let (x, z) = ([-w / 2.0, w / 2.0], [0.1, 0.1 + h]);
    let (wall, wood) = (studio.looks.thing(), studio.looks.body());
    let (outer, outer_z) = ([x[0] - 0.13, x[1] + 0.13], [0.0, z[1] + 0.13]);
    let mut base =
        Body::fixed("frame").with(wall, frame(&rect(outer, outer_z), &rect(x, z), -0.14, -0.001).facing_front());
    base.add(wood, ring(x, z, bar, [0.01, 0.01 + thick]));
    let mut model = Model::new("window", base);
    let (open, open_z) = ([x[0] + bar, x[1] - bar], [z[0] + bar, z[1] - bar]);
    let glass = studio.looks.glass();
    let mut sash = |name: &str, mechanism: Mechanism, x: [f64; 2], z: [f64; 2], y: [f64; 2]| {
        let mut body = Body::new(name, 0, mechanism);
        body.add(studio.looks.front(), ring(x, z, bar, y));
        let middle = (y[0] + y[1]) / 2.0;
        body.add(glass, cuboid([x[0] + bar, middle - 0.004, z[0] + bar], [x[1] - bar, middle + 0.004, z[1] - bar]));
        model.push(body);
    };
    // Sashes lie before the frame, which they cover by a little.
    let lap = 0.015;
    let (front, cover, cover_z) =
        ([-0.002 - thick, -0.002], [open[0] - lap, open[1] + lap], [open_z[0] - lap, open_z[1] + lap]);
    let upright = |side: f64, at: f64| Mechanism::hinge(DVec3::Z * side, [at, front[0], z[0]], [0.0, 100.0], 15.0);
    match layout {
        0 => sash("sash", upright(-1.0, cover[0]), cover, cover_z, front),
        1 => {
            sash("left_sash", upright(-1.0, cover[0]), [cover[0], -0.002], cover_z, front);
            sash("right_sash", upright(1.0, cover[1]), [0.002, cover[1]], cover_z, front);
        }
        2 => {
            let tilt = Mechanism::hinge(DVec3::X, [0.0, front[0], cover_z[0]], [0.0, 60.0], 12.0);
            sash("sash", tilt, cover, cover_z, front);
        }
        _ => {
            let half = (cover_z[0] + cover_z[1]) / 2.0;
            let travel = 0.9 * (cover_z[1] - half);
            sash("sash", Mechanism::slide(DVec3::Z, [0.0, travel], 0.08), cover, [cover_z[0], half + 0.03], front);
        }
    }
    model
}

/// A box with dials, as a thermostat or an amplifier.
pub(super) fn dial_panel(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let (count, radius) = (dice.count(1, 4), dice.within([0.02, 0.045]));
    let (w, d, h) = ((count as f64 + 0.6) * 3.4 * radius, dice.within([0.1, 0.25]), dice.within([0.1, 0.18]));
    let body = studio.looks.body();
    let mut model =
        Model::new("dial-panel", Body::fixed("box").with(body, cuboid([-w / 2.0, 0.0, 0.0], [w / 2.0, d, h])));
    for k in 0..count {
        let x = -w / 2.0 + w * (k as f64 + 0.5) / count as f64;
        let pointer = studio.dice.chance(0.7);
        let body = dial(studio, [x, 0.0, h / 2.0], radius, pointer, format!("dial_{k}"));
        model.push(body);
        if !pointer {
            model.mark("symmetric");
        }
    }
    model.mark("dial");
    model
}

/// A bottle with a screw cap, smooth or with wings.
pub(super) fn bottle(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let (r, h, neck) = (dice.within([0.035, 0.09]), dice.within([0.16, 0.34]), dice.within([0.012, 0.02]));
    let (wings, turns, pitch) = (dice.chance(0.6), dice.within([220.0, 500.0]), dice.within([0.003, 0.006]));
    let shoulder = [
        (0.0, 0.0),
        (r, 0.0),
        (r, 0.72 * h),
        (neck, 0.86 * h),
        (neck, h),
        (neck - 0.003, h),
        (neck - 0.003, 0.86 * h),
        (0.0, 0.8 * h),
    ];
    let glass = studio.looks.body();
    let mut model = Model::new("bottle", Body::fixed("bottle").with(glass, lathe(&shoulder.map(DVec2::from), 48)));
    let screw = Mechanism {
        kind: JointKind::Screw,
        pitch: pitch * 4.0 / TAU,
        ..Mechanism::hinge(DVec3::Z, [0.0; 3], [0.0, turns], 60.0)
    };
    let mut cap = Body::new("cap", 0, screw);
    let (inner, outer, low, top) = (neck + 0.001, neck + 0.006, 0.9 * h, h + 0.002);
    let cup = [(0.0, top), (inner, top), (inner, low), (outer, low), (outer, top + 0.008), (0.0, top + 0.008)];
    let front = studio.looks.front();
    cap.add(front, lathe(&cup.map(DVec2::from), 40));
    if wings {
        let wing = cuboid([outer - 0.002, -0.003, low + 0.004], [outer + 0.6 * neck, 0.003, top + 0.004]);
        for turn in [0.0, PI] {
            cap.add(front, wing.clone().moved(&Rigid::about(DVec3::Z, DVec3::ZERO, turn)));
        }
    } else {
        model.mark("symmetric");
    }
    model.push(cap);
    model.mark("screw");
    model.mark("small");
    model
}

/// A chair whose seat swings up.
pub(super) fn folding_chair(studio: &mut Studio) -> Model {
    let dice = &mut *studio.dice;
    let (half, high, lean) = (dice.within([0.19, 0.24]), dice.within([0.78, 0.98]), dice.within([0.35, 0.55]));
    let (metal, wood, slats) = (studio.looks.body(), studio.looks.front(), studio.dice.count(2, 4));
    let mut base = Body::fixed("frame");
    for side in [-1.0, 1.0] {
        let (x, inner) = (half * side, (half + 0.034) * side);
        base.add(metal, rod([x, -0.24, 0.0], [x, lean * high - 0.24, high], 0.013));
        base.add(metal, rod([inner, 0.28, 0.0], [inner, -0.03, 0.5], 0.012));
    }
    base.add(metal, rod([-half, lean * 0.14 - 0.24, 0.14], [half, lean * 0.14 - 0.24, 0.14], 0.01));
    base.add(metal, rod([-half - 0.034, 0.2, 0.13], [half + 0.034, 0.2, 0.13], 0.01));
    for k in 0..slats {
        let z = 0.72 * high + 0.09 * k as f64;
        if z + 0.06 > high {
            break;
        }
        let y = lean * z - 0.24;
        let (dy, dz) = (lean * 0.06, 0.06);
        let slat = outline(&[(-z, y - 0.008), (-z, y + 0.008), (-z - dz, y + 0.008 + dy), (-z - dz, y - 0.008 + dy)]);
        let slat = if area(&slat) < 0.0 { slat.into_iter().rev().collect() } else { slat };
        base.add(wood, prism(&slat, -half, half).along_x());
    }
    let mut model = Model::new("folding-chair", base);
    let widest = studio.dice.within([55.0, 80.0]);
    let hinge = Mechanism::hinge(DVec3::NEG_X, [0.0, 0.005, 0.44], [0.0, widest], 15.0);
    let mut seat = Body::new("seat", 0, hinge);
    let reach = half - 0.03;
    if studio.dice.chance(0.5) {
        seat.add(wood, cuboid([-reach, -0.4, 0.445], [reach, 0.0, 0.463]));
    } else {
        for k in 0..5 {
            let y = -0.4 + 0.078 * f64::from(k);
            seat.add(wood, cuboid([-reach, y, 0.445], [reach, y + 0.066, 0.463]));
        }
    }
    for x in [-reach + 0.02, reach - 0.04] {
        seat.add(metal, cuboid([x, -0.4, 0.425], [x + 0.02, 0.01, 0.445]));
    }
    model.push(seat);
    model
}

fn area(outline: &[DVec2]) -> f64 {
    (0..outline.len()).map(|i| outline[i].perp_dot(outline[(i + 1) % outline.len()])).sum::<f64>() / 2.0
}
