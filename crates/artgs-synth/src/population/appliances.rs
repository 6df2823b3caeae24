//! Appliances: refrigerators, ovens, microwaves, washing machines, dishwashers.

use super::fronts::{Bay, Edge, FrontStyle, Pull, Rect, TrayStyle, door, drawer};
use super::model::{Body, Mechanism, Model, Studio};
use crate::Material;
use crate::shape::{circle, cuboid, cylinder, frame, lathe, rectangle, rod};
use glam::{DVec2, DVec3};

/// Fronts of appliances: plain plates before the carcass.
fn style(studio: &mut Studio, thickness: [f64; 2], pulls: &[Pull]) -> FrontStyle {
    FrontStyle {
        inset: false,
        gap: studio.dice.within([0.003, 0.006]),
        reveal: 0.0,
        thickness: studio.dice.within(thickness),
        sheet: None,
        framed: false,
        pull: studio.dice.pick(pulls),
        behind: 0.003,
        tray: TrayStyle::draw(studio),
    }
}

/// A box open to the front: walls of thickness `t`, outside `x`, `z`, depth `d`.
fn shell(model: &mut Model, studio: &Studio, x: [f64; 2], z: [f64; 2], d: f64, t: f64) {
    let (outer, lining) = (studio.looks.body(), studio.looks.inside());
    let base = model.base();
    base.add(outer, cuboid([x[0], 0.0, z[0]], [x[0] + t, d, z[1]]));
    base.add(outer, cuboid([x[1] - t, 0.0, z[0]], [x[1], d, z[1]]));
    base.add(outer, cuboid([x[0] + t, 0.0, z[1] - t], [x[1] - t, d, z[1]]));
    base.add(outer, cuboid([x[0] + t, 0.0, z[0]], [x[1] - t, d, z[0] + t]));
    base.add(lining, cuboid([x[0] + t, d - t, z[0] + t], [x[1] - t, d, z[1] - t]));
}

/// The bay of a front that covers a rectangle, walls of thickness `t` around its opening.
fn bay(x: [f64; 2], z: [f64; 2], t: f64) -> Bay {
    let cover = Rect { x, z };
    Bay { opening: cover.shrunk(t), cover }
}

/// A refrigerator: one to three doors, perhaps a drawer for frozen food below.
pub(super) fn fridge(studio: &mut Studio) -> Model {
    let style = style(studio, [0.04, 0.06], &[Pull::Bar, Pull::Bar, Pull::Recess, Pull::None]);
    let dice = &mut *studio.dice;
    let layout = dice.count(0, 3);
    let wide = if layout == 3 { dice.within([0.8, 0.92]) } else { dice.within([0.54, 0.7]) };
    let (deep, high, t) = (dice.within([0.5, 0.62]), dice.within([1.2, 1.85]), dice.within([0.035, 0.05]));
    let mut model = Model::new("fridge", Body::fixed("body"));
    let (x, lift) = ([-wide / 2.0, wide / 2.0], 0.04);
    shell(&mut model, studio, x, [lift, lift + high], deep, t);
    for (fx, fy) in [(x[0] + 0.05, 0.05), (x[1] - 0.05, 0.05), (x[0] + 0.05, deep - 0.05), (x[1] - 0.05, deep - 0.05)] {
        model.base().add(studio.looks.handle(), cylinder(0.02, 0.0, lift).shifted([fx, fy, 0.0]));
    }
    let top = lift + high;
    let split = lift + high * studio.dice.within([0.3, 0.4]);
    let hinge = if studio.dice.chance(0.5) { Edge::Left } else { Edge::Right };
    let middle = 0.0;
    let board = |model: &mut Model, z: f64| {
        let lining = studio.looks.inside();
        model.base().add(lining, cuboid([x[0] + t, 0.0, z - 0.02], [x[1] - t, deep - t, z + 0.02]));
    };
    let (mut doors, mut with_drawer) = (Vec::new(), None);
    match layout {
        0 => doors.push((bay(x, [lift, top], t), hinge)),
        1 => {
            board(&mut model, split);
            doors.push((bay(x, [lift, split], t), hinge));
            doors.push((bay(x, [split, top], t), hinge));
        }
        2 => {
            board(&mut model, split);
            with_drawer = Some(Bay {
                opening: Rect { x: [x[0] + t, x[1] - t], z: [lift + t, split - 0.02] },
                cover: Rect { x, z: [lift, split] },
            });
            doors.push((bay(x, [split, top], t), hinge));
        }
        _ => {
            model.base().add(studio.looks.inside(), cuboid([-0.02, 0.0, lift + t], [0.02, deep - t, top - t]));
            doors.push((bay([x[0], middle], [lift, top], t), Edge::Left));
            doors.push((bay([middle, x[1]], [lift, top], t), Edge::Right));
        }
    }
    for (index, (bay, edge)) in doors.into_iter().enumerate() {
        let mut leaf = door(studio, &style, &bay, edge, format!("door_{index}"));
        add_bins(&mut leaf, studio, &bay.opening);
        model.push(leaf);
    }
    if let Some(bay) = with_drawer {
        let body = drawer(studio, &style, &bay, deep - t - 0.01, "freezer_drawer".into());
        model.push(body);
    }
    let columns = if layout == 3 { vec![[x[0] + t, -0.02], [0.02, x[1] - t]] } else { vec![[x[0] + t, x[1] - t]] };
    let from = if matches!(layout, 1 | 2) { split + 0.02 } else { lift + t };
    for column in columns {
        add_shelves(&mut model, studio, column, [from, top - t], deep - t);
    }
    model
}

/// Glass shelves with food.
fn add_shelves(model: &mut Model, studio: &mut Studio, x: [f64; 2], z: [f64; 2], far: f64) {
    let levels = ((z[1] - z[0]) / 0.28) as usize;
    for level in 0..=levels {
        let floor = z[0] + (z[1] - z[0]) * level as f64 / (levels + 1) as f64;
        let inside = studio.looks.inside();
        if level > 0 {
            model.base().add(inside, cuboid([x[0], 0.13, floor - 0.004], [x[1], far, floor + 0.004]));
        }
        let room = (z[1] - z[0]) / (levels + 1) as f64 - 0.03;
        let mut at = x[0] + 0.02;
        for _ in 0..studio.dice.count(0, 4) {
            let (wide, high) = (studio.dice.within([0.05, 0.12]), studio.dice.within([0.3, 0.9]) * room);
            if at + wide > x[1] - 0.02 {
                break;
            }
            let thing = studio.looks.thing();
            let y = studio.dice.within([0.15, 0.3]);
            let solid = match studio.dice.chance(0.5) {
                true => cylinder(wide / 2.0, 0.0, high).shifted([at + wide / 2.0, y + wide / 2.0, floor + 0.005]),
                false => cuboid([at, y, floor + 0.005], [at + wide, y + wide, floor + 0.005 + high]),
            };
            model.base().add(thing, solid);
            at += wide + studio.dice.within([0.01, 0.06]);
        }
    }
}

/// Bins on the inner face of a door, narrower than its opening so that they turn out of it.
fn add_bins(door: &mut Body, studio: &mut Studio, opening: &Rect) {
    let inset = 0.035 + 0.06 * opening.wide();
    let (x, z) = ([opening.x[0] + inset, opening.x[1] - inset], opening.z);
    let y = -0.003;
    let count = ((z[1] - z[0]) / 0.35) as usize;
    for level in 0..count {
        let floor = z[0] + 0.05 + (z[1] - z[0] - 0.1) * level as f64 / count as f64;
        let inside = studio.looks.inside();
        door.add(inside, cuboid([x[0], y, floor], [x[1], 0.08, floor + 0.01]));
        door.add(inside, cuboid([x[0], 0.072, floor + 0.01], [x[1], 0.08, floor + 0.07]));
        if studio.dice.chance(0.6) && x[1] - x[0] > 0.14 {
            let thing = studio.looks.thing();
            let at = studio.dice.within([x[0] + 0.04, x[1] - 0.04]);
            door.add(thing, cylinder(0.03, 0.0, 0.16).shifted([at, 0.036, floor + 0.01]));
        }
    }
}

/// An oven door: a slab with a dark window and a bar.
fn add_window(body: &mut Body, studio: &Studio, rect: &Rect, outer: f64) {
    let hole = rect.shrunk((0.22 * rect.wide().min(rect.high())).min(0.08));
    body.add(studio.looks.glass(), hole.slab([outer - 0.004, outer]));
}

/// A rack of wire: rods along y with bars across, at a height.
fn wire_rack(body: &mut Body, studio: &Studio, x: [f64; 2], y: [f64; 2], z: f64, rods: usize) {
    let metal = studio.looks.handle();
    for k in 0..rods {
        let at = x[0] + 0.006 + (x[1] - x[0] - 0.012) * k as f64 / (rods - 1) as f64;
        body.add(metal, rod([at, y[0], z], [at, y[1], z], 0.0025));
    }
    for at in [y[0] + 0.004, (y[0] + y[1]) / 2.0, y[1] - 0.004] {
        body.add(metal, rod([x[0], at, z - 0.005], [x[1], at, z - 0.005], 0.003));
    }
}

/// A knob that turns; with a pointer its turn can be seen.
pub(super) fn dial(studio: &mut Studio, at: [f64; 3], radius: f64, pointer: bool, name: String) -> Body {
    let range = studio.dice.within([150.0, 290.0]);
    let turn = Mechanism::hinge(DVec3::NEG_Y, at, [0.0, range], 25.0).anywhere();
    let mut body = Body::new(name, 0, turn);
    let plain = Material::Plain { color: [0.2, 0.2, 0.22] };
    let material = if studio.dice.chance(0.5) { plain } else { studio.looks.handle() };
    let mark = studio.looks.body();
    let depth = (0.8 * radius).max(0.015);
    body.add(material, cylinder(radius, 0.001, depth).facing_front().shifted(at));
    if pointer {
        let bar = cuboid([-0.2 * radius, 0.0, depth], [0.2 * radius, 1.35 * radius, depth + 0.35 * radius]);
        body.add(mark, bar.facing_front().shifted(at));
    }
    body
}

/// Adds dials in a row on a panel of the front; returns whether there is one without a pointer.
fn add_dials(model: &mut Model, studio: &mut Studio, x: [f64; 2], z: f64, y: f64, radius: f64, count: usize) {
    let pointer = studio.dice.chance(0.7);
    for k in 0..count {
        let at = x[0] + (x[1] - x[0]) * (k as f64 + 0.5) / count as f64;
        let body = dial(studio, [at, y, z], radius, pointer, format!("dial_{k}"));
        model.push(body);
    }
    model.mark("dial");
    model.mark("small");
    if !pointer {
        model.mark("symmetric");
    }
}

/// An oven or a range: one to three doors, a rack of wire inside, a panel with dials.
pub(super) fn oven(studio: &mut Studio) -> Model {
    let style = style(studio, [0.03, 0.045], &[Pull::Bar]);
    let dice = &mut *studio.dice;
    let layout = dice.count(0, 2);
    let wide = if layout == 2 { dice.within([0.85, 1.0]) } else { dice.within([0.56, 0.62]) };
    let (deep, t) = (dice.within([0.5, 0.58]), 0.02);
    let high = if layout == 0 { dice.within([0.55, 0.62]) } else { dice.within([0.82, 0.9]) };
    let (panel, dials) = (dice.within([0.1, 0.13]), if dice.chance(0.35) { dice.count(1, 4) } else { 0 });
    let (x, top) = ([-wide / 2.0, wide / 2.0], high - panel);
    let mut model = Model::new("oven", Body::fixed("body"));
    shell(&mut model, studio, x, [0.0, high], deep, t);
    let lining = studio.looks.inside();
    model.base().add(lining, cuboid([x[0] + t, 0.0, top - 0.01], [x[1] - t, deep - t, top + 0.01]));
    model.base().add(studio.looks.body(), cuboid([x[0], -0.02, top + 0.006], [x[1], 0.0, high]));
    let (low, side) = (0.3 * top, 0.1 * wide);
    let bays = match layout {
        0 => vec![(bay(x, [0.0, top], t), Edge::Bottom)],
        1 => {
            model.base().add(lining, cuboid([x[0] + t, 0.0, low - 0.01], [x[1] - t, deep - t, low + 0.01]));
            vec![(bay(x, [low, top], t), Edge::Bottom), (bay(x, [0.0, low], t), Edge::Bottom)]
        }
        _ => {
            model.base().add(lining, cuboid([side - 0.01, 0.0, t], [side + 0.01, deep - t, top - 0.01]));
            model.base().add(lining, cuboid([x[0] + t, 0.0, low - 0.01], [side - 0.01, deep - t, low + 0.01]));
            let edge = if studio.dice.chance(0.5) { Edge::Right } else { Edge::Bottom };
            vec![
                (bay([x[0], side], [low, top], t), Edge::Bottom),
                (bay([x[0], side], [0.0, low], t), Edge::Bottom),
                (bay([side, x[1]], [0.0, top], t), edge),
            ]
        }
    };
    for (index, (bay, edge)) in bays.into_iter().enumerate() {
        let mut leaf = door(studio, &style, &bay, edge, format!("door_{index}"));
        let (rect, y) = style.place(&bay, style.thickness);
        add_window(&mut leaf, studio, &rect, y[0]);
        model.push(leaf);
        let open = bay.opening;
        let z = open.middle()[1];
        if open.high() > 0.25 {
            let mut rack = Body::fixed("rack");
            wire_rack(&mut rack, studio, [open.x[0] + 0.003, open.x[1] - 0.003], [0.03, deep - 0.05], z, 9);
            model.base().pieces.extend(rack.pieces);
            let thing = studio.looks.thing();
            let [cx, _] = open.middle();
            model.base().add(thing, cuboid([cx - 0.09, 0.12, z + 0.004], [cx + 0.09, 0.32, z + 0.08]));
        }
    }
    if dials > 0 {
        add_dials(&mut model, studio, [x[0] + 0.06, x[1] - 0.06], high - panel / 2.0, -0.021, 0.022, dials);
    }
    model.mark("wire");
    model
}

/// A microwave oven: a door on the left, dials on the right.
pub(super) fn microwave(studio: &mut Studio) -> Model {
    let style = style(studio, [0.02, 0.03], &[Pull::Bar, Pull::Recess, Pull::None]);
    let dice = &mut *studio.dice;
    let (wide, deep, high) = (dice.within([0.44, 0.55]), dice.within([0.3, 0.4]), dice.within([0.26, 0.32]));
    let (split, t, dials) = (wide / 2.0 - dice.within([0.1, 0.13]), 0.015, dice.count(0, 2));
    let x = [-wide / 2.0, wide / 2.0];
    let mut model = Model::new("microwave", Body::fixed("body"));
    shell(&mut model, studio, x, [0.0, high], deep, t);
    let body = studio.looks.body();
    model.base().add(body, cuboid([split, -0.02, 0.002], [x[1], 0.0, high - 0.002]));
    model.base().add(body, cuboid([split, 0.0, t], [split + t, deep - t, high - t]));
    let cover = Rect { x: [x[0], split], z: [0.0, high] };
    let bay = Bay { opening: cover.shrunk(t), cover };
    let mut leaf = door(studio, &style, &bay, Edge::Left, "door".into());
    let (rect, y) = style.place(&bay, style.thickness);
    add_window(&mut leaf, studio, &rect, y[0]);
    model.push(leaf);
    let plate = [(0.0, 0.0), (0.11, 0.0), (0.12, 0.012), (0.0, 0.012)];
    let glass = studio.looks.inside();
    let cx = (x[0] + split) / 2.0;
    model.base().add(glass, lathe(&plate.map(DVec2::from), 32).shifted([cx, deep / 2.0, t + 0.004]));
    let thing = studio.looks.thing();
    model.base().add(thing, cylinder(0.05, 0.0, 0.09).shifted([cx + 0.02, deep / 2.0, t + 0.018]));
    if dials > 0 {
        for k in 0..dials {
            let pointer = studio.dice.chance(0.6);
            let at = [(split + x[1]) / 2.0, -0.021, high * (0.3 + 0.35 * k as f64)];
            let body = dial(studio, at, 0.025, pointer, format!("dial_{k}"));
            model.push(body);
            if !pointer {
                model.mark("symmetric");
            }
        }
        model.mark("dial");
        model.mark("small");
    }
    model
}

/// A washing machine or dryer: a round door before a drum, a drawer for detergent, perhaps a dial.
pub(super) fn washer(studio: &mut Studio) -> Model {
    const POINTS: usize = 64;
    let dice = &mut *studio.dice;
    let (wide, deep, high) = (0.6, dice.within([0.5, 0.62]), dice.within([0.82, 0.86]));
    let (x, z, hole, t) = ([-wide / 2.0, wide / 2.0], dice.within([0.38, 0.44]), dice.within([0.15, 0.18]), 0.02);
    let center = DVec2::new(0.0, z);
    let (body, lining) = (studio.looks.body(), studio.looks.inside());
    let mut model = Model::new("washer", Body::fixed("body"));
    shell(&mut model, studio, x, [0.0, high], deep, t);
    let (low, top) = (z - 0.29, z + 0.29);
    let panel = rectangle(DVec2::new(x[0] + t, low), DVec2::new(x[1] - t, top), POINTS);
    let base = model.base();
    base.add(body, frame(&panel, &circle(center, hole, POINTS), -0.02, 0.0).facing_front());
    base.add(body, cuboid([x[0] + t, 0.0, t], [x[1] - t, 0.02, low]));
    let drum = [(0.0, -0.42), (0.23, -0.42), (0.23, -0.03), (0.22, -0.03), (0.22, -0.41), (0.0, -0.41)];
    base.add(lining, lathe(&drum.map(DVec2::from), POINTS).facing_front().shifted([0.0, 0.0, z]));
    let thing = studio.looks.thing();
    model.base().add(thing, cuboid([-0.1, 0.12, z - 0.17], [0.09, 0.32, z - 0.1]));
    // The strip above the door: a drawer on the left, the rest closed.
    let (from, to) = (top, high - t);
    let with_drawer = studio.dice.chance(0.6);
    let end = if with_drawer { x[0] + 0.2 } else { x[0] + t };
    model.base().add(body, cuboid([end, 0.0, from], [x[1] - t, 0.02, to]));
    let side = if studio.dice.chance(0.5) { 1.0 } else { -1.0 };
    let ring_radius = hole + studio.dice.within([0.03, 0.05]);
    let ring = [(hole - 0.03, 0.006), (ring_radius, 0.006), (ring_radius - 0.005, 0.04), (hole - 0.02, 0.05)];
    let bowl = [(0.0, -0.05), (0.55 * hole, -0.04), (hole - 0.032, 0.006), (hole - 0.032, 0.03), (0.0, 0.02)];
    let axis = if side < 0.0 { DVec3::NEG_Z } else { DVec3::Z };
    let widest = studio.dice.within([80.0, 130.0]);
    let hinge = Mechanism::hinge(axis, [side * (ring_radius + 0.005), -0.04, z], [0.0, widest], 15.0);
    let mut door = Body::new("door", 0, hinge);
    let front = studio.looks.front();
    door.add(front, lathe(&ring.map(DVec2::from), POINTS).facing_front().shifted([0.0, 0.0, z]));
    door.add(studio.looks.glass(), lathe(&bowl.map(DVec2::from), POINTS).facing_front().shifted([0.0, 0.0, z]));
    if studio.dice.chance(0.6) {
        let at = [-side * (hole + 0.005), -0.05, z];
        door.add(studio.looks.handle(), cylinder(0.018, 0.0, 0.015).facing_front().shifted(at));
    }
    model.push(door);
    if with_drawer {
        let style = style(studio, [0.016, 0.02], &[Pull::Recess, Pull::None]);
        let style = FrontStyle { inset: true, gap: 0.003, ..style };
        let opening = Rect { x: [x[0] + t, end], z: [from + 0.002, to] };
        let body = drawer(studio, &style, &Bay { opening, cover: opening }, 0.3, "detergent_drawer".into());
        model.push(body);
        model.mark("small");
    }
    if studio.dice.chance(0.6) {
        let at = [studio.dice.within([0.0, 0.15]), -0.001, (from + to) / 2.0];
        let pointer = studio.dice.chance(0.6);
        let body = dial(studio, at, 0.028, pointer, "dial".into());
        model.push(body);
        model.mark("dial");
        if !pointer {
            model.mark("symmetric");
        }
    }
    model
}

/// A dishwasher: a door that opens downward, baskets of wire that slide out above it.
pub(super) fn dishwasher(studio: &mut Studio) -> Model {
    let style = style(studio, [0.02, 0.04], &[Pull::Bar, Pull::Recess, Pull::None]);
    let dice = &mut *studio.dice;
    let (wide, deep, high, t) = (0.6, dice.within([0.55, 0.6]), dice.within([0.8, 0.86]), 0.025);
    let (plinth, baskets) = (dice.within([0.08, 0.12]), dice.count(1, 2));
    let x = [-wide / 2.0, wide / 2.0];
    let mut model = Model::new("dishwasher", Body::fixed("body"));
    shell(&mut model, studio, x, [plinth, high], deep, t);
    model.base().add(studio.looks.handle(), cuboid([x[0] + 0.01, 0.05, 0.0], [x[1] - 0.01, deep, plinth]));
    let mut leaf = door(studio, &style, &bay(x, [plinth, high], t), Edge::Bottom, "door".into());
    if let Some(mechanism) = &mut leaf.mechanism {
        mechanism.range[1] = studio.dice.within([80.0, 90.0]).to_radians();
    }
    let door = model.push(leaf);
    let long = deep - t - 0.03;
    let travel = studio.dice.within([0.6, 0.85]) * long;
    for k in 0..baskets {
        let z = plinth + t + 0.05 + 0.36 * k as f64;
        let slide = Mechanism::slide(DVec3::NEG_Y, [0.0, travel], 0.12).behind(door, 78_f64.to_radians());
        let mut basket = Body::new(format!("basket_{k}"), 0, slide);
        add_basket(&mut basket, studio, [x[0] + t + 0.012, x[1] - t - 0.012], [0.012, 0.012 + long], z);
        model.push(basket);
    }
    model.mark("wire");
    model
}

/// A basket of wire: floor, rims and uprights, with some plates.
fn add_basket(body: &mut Body, studio: &mut Studio, x: [f64; 2], y: [f64; 2], z: f64) {
    let (metal, high) = (studio.looks.handle(), studio.dice.within([0.08, 0.14]));
    let thick = studio.dice.within([0.0015, 0.003]);
    let count = studio.dice.count(8, 12);
    for k in 0..count {
        let at = x[0] + (x[1] - x[0]) * k as f64 / (count - 1) as f64;
        body.add(metal, rod([at, y[0], z], [at, y[1], z], thick));
        for end in y {
            body.add(metal, rod([at, end, z], [at, end, z + high], thick));
        }
    }
    for k in 0..7 {
        let at = y[0] + (y[1] - y[0]) * f64::from(k) / 6.0;
        body.add(metal, rod([x[0], at, z], [x[1], at, z], thick));
        for side in x {
            body.add(metal, rod([side, at, z], [side, at, z + high], thick));
        }
    }
    for (a, b) in [([x[0], y[0]], [x[1], y[0]]), ([x[0], y[1]], [x[1], y[1]])] {
        body.add(metal, rod([a[0], a[1], z + high], [b[0], b[1], z + high], 1.3 * thick));
    }
    for side in x {
        body.add(metal, rod([side, y[0], z + high], [side, y[1], z + high], 1.3 * thick));
    }
    for k in 0..studio.dice.count(0, 4) {
        let thing = studio.looks.thing();
        let at = x[0] + 0.08 + 0.1 * k as f64;
        if at + 0.04 < x[1] {
            let plate = cylinder(0.09, 0.0, 0.012).along_x().shifted([at, (y[0] + y[1]) / 2.0, z + 0.1]);
            body.add(thing, plate);
        }
    }
}
