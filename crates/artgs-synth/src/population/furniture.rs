//! Furniture: a carcass whose front is divided recursively into bays, which drawers, doors, flaps, panels and shelves fill.

use super::distribution::{FurnitureKind, MOST_PARTS, NARROW};
use super::fronts::{Bay, Edge, FrontStyle, Pull, Rect, add_plate, add_pull, door, drawer, sliding_pair};
use super::model::{Body, Mechanism, Model, Studio};
use crate::Material;
use crate::object::{Piece, bounds};
use crate::shape::{cuboid, cylinder};
use glam::DVec3;

/// What fills a bay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Leaf {
    Drawer,
    Door,
    DoubleDoor,
    FlapDown,
    FlapUp,
    SlidingPair,
    /// A plate that looks like a front and does not move.
    FixedPanel,
    /// A shelf without a front.
    Open,
}

/// What a carcass stands on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Base {
    Floor,
    Plinth,
    Feet,
}

/// Thickness of boards between bays.
const DIVIDER: [f64; 2] = [0.012, 0.02];
/// Thickness of the back.
const BACK: f64 = 0.008;

impl Leaf {
    /// How many bodies fill an opening of this size; none if it is not made in this size.
    fn bodies(self, wide: f64, high: f64) -> Option<usize> {
        let within = |v: f64, low: f64, high: f64| v >= low && v <= high;
        match self {
            Self::Drawer => (within(wide, 0.14, 1.1) && within(high, 0.06, 0.5)).then_some(1),
            Self::Door => (within(wide, 0.16, 0.75) && high >= 0.24).then_some(1),
            Self::DoubleDoor => (within(wide, 0.45, 1.3) && high >= 0.3).then_some(2),
            Self::FlapDown | Self::FlapUp => (wide >= 0.25 && within(high, 0.16, 0.6)).then_some(1),
            Self::SlidingPair => (wide >= 0.55 && high >= 0.25).then_some(2),
            Self::FixedPanel => (wide >= 0.12 && high >= 0.06).then_some(0),
            Self::Open => Some(0),
        }
    }
}

/// A carcass while it is divided.
struct Carcass<'a, 'b> {
    kind: &'a FurnitureKind,
    studio: &'a mut Studio<'b>,
    style: FrontStyle,
    model: Model,
    /// Depth of the space behind the front plane.
    depth: f64,
    /// Boards are between drawers too, not only around doors.
    boards: bool,
}

/// Furniture of a kind.
pub(super) fn furniture(kind: &FurnitureKind, studio: &mut Studio) -> Model {
    let style = FrontStyle::draw(studio);
    let dice = &mut *studio.dice;
    let [w, d, h] = [kind.width, kind.depth, kind.height].map(|range| dice.stepped(range, 0.01));
    let (board, base) = (dice.within([0.015, 0.022]), dice.weighted(kind.bases));
    let (worktop, boards) = (dice.chance(kind.worktop), dice.chance(0.6));
    let boxes = if kind.name == "desk" { pedestals(studio, w) } else { vec![[-w / 2.0, w / 2.0]] };
    let mut model = Model::new(kind.name, Body::fixed("body"));
    mark_style(&mut model, &style);
    let body = studio.looks.body();
    let lift = base_height(studio, base);
    let mut carcass = Carcass { kind, studio, style, model, depth: d - BACK - 0.004, boards };
    for x in &boxes {
        add_base(carcass.model.base(), base, *x, d, lift, body);
        let cover = Rect { x: *x, z: [lift, lift + h] };
        add_carcass(carcass.model.base(), &cover, d, board, body);
        carcass.divide(Bay { opening: cover.shrunk(board), cover }, 0);
    }
    let Carcass { mut model, studio, .. } = carcass;
    if worktop {
        add_top(&mut model, studio, &style, [w, d], lift + h);
    }
    if kind.name == "desk" && boxes.len() == 1 {
        let x = if boxes[0][0] < 0.0 { w / 2.0 - 0.05 } else { -w / 2.0 };
        model.base().add(body, cuboid([x, 0.02, 0.0], [x + 0.05, d - 0.02, lift + h]));
    }
    model
}

/// Boxes of drawers left, right or on both sides under the top of a desk.
fn pedestals(studio: &mut Studio, w: f64) -> Vec<[f64; 2]> {
    let wide = studio.dice.within([0.3, 0.42]);
    let (left, right) = ([-w / 2.0, -w / 2.0 + wide], [w / 2.0 - wide, w / 2.0]);
    match studio.dice.count(0, 2) {
        0 => vec![left],
        1 => vec![right],
        _ => vec![left, right],
    }
}

fn base_height(studio: &mut Studio, base: Base) -> f64 {
    match base {
        Base::Floor => 0.0,
        Base::Plinth => studio.dice.within([0.05, 0.12]),
        Base::Feet => studio.dice.within([0.04, 0.2]),
    }
}

fn add_base(body: &mut Body, base: Base, x: [f64; 2], d: f64, lift: f64, material: Material) {
    match base {
        Base::Floor => {}
        Base::Plinth => body.add(material, cuboid([x[0] + 0.01, 0.04, 0.0], [x[1] - 0.01, d - 0.02, lift])),
        Base::Feet => {
            for (x, y) in [(x[0] + 0.04, 0.05), (x[1] - 0.04, 0.05), (x[0] + 0.04, d - 0.05), (x[1] - 0.04, d - 0.05)] {
                body.add(material, cylinder(0.02, 0.0, lift).shifted([x, y, 0.0]));
            }
        }
    }
}

/// Adds a box open to the front, whose outline is `cover`.
fn add_carcass(body: &mut Body, cover: &Rect, d: f64, t: f64, material: Material) {
    let ([x0, x1], [z0, z1]) = (cover.x, cover.z);
    body.add(material, cuboid([x0, 0.0, z0], [x0 + t, d, z1]));
    body.add(material, cuboid([x1 - t, 0.0, z0], [x1, d, z1]));
    body.add(material, cuboid([x0 + t, 0.0, z1 - t], [x1 - t, d, z1]));
    body.add(material, cuboid([x0 + t, 0.0, z0], [x1 - t, d, z0 + t]));
    body.add(material, cuboid([x0 + t, d - BACK, z0 + t], [x1 - t, d, z1 - t]));
}

fn add_top(model: &mut Model, studio: &mut Studio, style: &FrontStyle, [w, d]: [f64; 2], z: f64) {
    let (out, thick) = (studio.dice.within([0.0, 0.03]), studio.dice.within([0.018, 0.04]));
    let front = style.thickness + 0.01 + out;
    let material = if studio.looks.is_equal() { studio.looks.body() } else { studio.looks.thing() };
    model.base().add(material, cuboid([-w / 2.0 - out, -front, z], [w / 2.0 + out, d, z + thick]));
}

fn mark_style(model: &mut Model, style: &FrontStyle) {
    model.mark(if style.inset { "inset" } else { "overlay" });
    model.mark(match style.pull {
        Pull::Bar => "handle-bar",
        Pull::Knob => "handle-knob",
        Pull::Recess => "handle-recessed",
        Pull::None => "handle-none",
    });
    if style.framed {
        model.mark("framed");
    }
    if style.reveal > 0.0 {
        model.mark("revealed");
    } else if style.gap <= NARROW {
        model.mark("narrow-gap");
    }
}

impl Carcass<'_, '_> {
    /// Fills a bay, or divides it and fills what results. Equal bays beside or above each other are often filled alike.
    fn divide(&mut self, bay: Bay, level: usize) {
        let (wide, high) = (bay.opening.wide(), bay.opening.high());
        let [most_wide, most_high] = self.kind.largest;
        let must = [wide > most_wide, high > most_high];
        let dice = &mut *self.studio.dice;
        let may = level < 3 && dice.chance(self.kind.divide) && (wide > 0.45 || high > 0.3);
        if !(must[0] || must[1] || may) {
            let leaf = self.choose(&bay);
            return self.fill(&bay, leaf);
        }
        let columns = match must {
            [true, false] => true,
            [false, true] => false,
            [true, true] => wide / most_wide > high / most_high,
            [false, false] => wide > 0.9 * high,
        };
        let (extent, largest) = if columns { (wide, most_wide) } else { (high, most_high) };
        let least = if columns { 0.24 } else { 0.1 };
        let count = ((extent / largest).ceil() as usize).max(2) + usize::from(dice.chance(0.25));
        let count = count.min((extent / least) as usize).max(1);
        if count == 1 {
            let leaf = self.choose(&bay);
            return self.fill(&bay, leaf);
        }
        let shares = shares(self.studio, count);
        let equal = shares.iter().all(|s| (s - shares[0]).abs() < 1e-9);
        let alike = equal && self.studio.dice.chance(0.65);
        let board = if columns || self.boards { self.studio.dice.within(DIVIDER) } else { 0.0 };
        let bays = self.cut(&bay, &shares, columns, board);
        let first = self.choose(&bays[0]);
        for inner in bays {
            if alike && first != Leaf::Open {
                self.fill(&inner, first);
            } else {
                self.divide(inner, level + 1);
            }
        }
    }

    /// Cuts a bay by boards, or without if their thickness is 0.
    fn cut(&mut self, bay: &Bay, shares: &[f64], columns: bool, board: f64) -> Vec<Bay> {
        let (from, to) =
            if columns { (bay.opening.x[0], bay.opening.x[1]) } else { (bay.opening.z[0], bay.opening.z[1]) };
        let clear = to - from - board * (shares.len() - 1) as f64;
        let (mut at, mut bays) = (from, Vec::new());
        for (index, share) in shares.iter().enumerate() {
            let end = at + clear * share;
            let is_last = index + 1 == shares.len();
            let mut inner = *bay;
            let (opening, cover) = match columns {
                true => (&mut inner.opening.x, &mut inner.cover.x),
                false => (&mut inner.opening.z, &mut inner.cover.z),
            };
            *opening = [at, end];
            *cover = [
                if index == 0 { cover[0] } else { at - board / 2.0 },
                if is_last { cover[1] } else { end + board / 2.0 },
            ];
            bays.push(inner);
            if !is_last && board > 0.0 {
                let mut rect = bay.opening;
                *(if columns { &mut rect.x } else { &mut rect.z }) = [end, end + board];
                let material = self.studio.looks.body();
                self.model.base().add(material, rect.slab([0.0, self.depth]));
            }
            at = end + board;
        }
        bays
    }

    /// What a bay is filled with, of what fits it.
    fn choose(&mut self, bay: &Bay) -> Leaf {
        let (wide, high) = (bay.opening.wide(), bay.opening.high());
        let room = MOST_PARTS - self.model.movable().min(MOST_PARTS);
        let fitting: Vec<(Leaf, f64)> = self
            .kind
            .leaves
            .iter()
            .copied()
            .filter(|(leaf, _)| leaf.bodies(wide, high).is_some_and(|bodies| bodies <= room))
            .collect();
        if fitting.is_empty() { Leaf::Open } else { self.studio.dice.weighted(&fitting) }
    }

    fn fill(&mut self, bay: &Bay, leaf: Leaf) {
        let number = self.model.movable();
        let room = MOST_PARTS - number.min(MOST_PARTS);
        let fits = leaf.bodies(bay.opening.wide(), bay.opening.high()).is_some_and(|bodies| bodies <= room);
        let leaf = if fits { leaf } else { Leaf::Open };
        let (style, depth) = (self.style, self.depth);
        let style = &style;
        match leaf {
            Leaf::Drawer => {
                let body = drawer(self.studio, style, bay, depth, format!("drawer_{number}"));
                self.model.push(body);
                if self.studio.dice.chance(0.06) {
                    self.add_tray(number + 1);
                }
            }
            Leaf::Door => {
                let edge = if self.studio.dice.chance(0.5) { Edge::Left } else { Edge::Right };
                self.push_door(bay, edge, "door");
                self.add_inside(bay);
            }
            Leaf::DoubleDoor => {
                let [cx, _] = bay.opening.middle();
                let half = |side: usize| {
                    let mut half = *bay;
                    half.opening.x[1 - side] = cx;
                    half.cover.x[1 - side] = cx;
                    half
                };
                self.push_door(&half(0), Edge::Left, "door");
                self.push_door(&half(1), Edge::Right, "door");
                self.model.mark("double-door");
                self.add_inside(bay);
            }
            Leaf::FlapDown | Leaf::FlapUp => {
                self.push_door(bay, if leaf == Leaf::FlapDown { Edge::Bottom } else { Edge::Top }, "flap");
                self.model.mark("flap");
                self.add_inside(bay);
            }
            Leaf::SlidingPair => {
                for body in sliding_pair(self.studio, bay, number) {
                    self.model.push(body);
                }
                self.model.mark("sliding-panel");
                self.add_inside(bay);
            }
            Leaf::FixedPanel => self.add_fixed(bay),
            Leaf::Open => self.add_inside(bay),
        }
    }

    fn push_door(&mut self, bay: &Bay, edge: Edge, word: &str) {
        let name = format!("{word}_{}", self.model.movable());
        let body = door(self.studio, &self.style, bay, edge, name);
        self.model.push(body);
        if self.style.sheet.is_some() {
            self.model.mark("thin");
        }
    }

    /// A plate that looks like the fronts beside it.
    fn add_fixed(&mut self, bay: &Bay) {
        let (rect, y) = self.style.place(bay, self.style.thickness);
        let (material, handle) = (self.studio.looks.front(), self.studio.looks.handle());
        let mut plate = Body::fixed("plate");
        add_plate(&mut plate, &self.style, &rect, y, material);
        let [cx, cz] = rect.middle();
        if self.studio.dice.chance(0.5) && !self.style.framed {
            add_pull(&mut plate, self.style.pull, handle, [cx, y[0], cz], 0, rect.wide());
        }
        self.model.base().pieces.extend(plate.pieces);
        self.model.mark("fixed-panel");
    }

    /// A tray that slides on the walls of a drawer, which has been added last.
    fn add_tray(&mut self, drawer: usize) {
        let Some(mechanism) = self.model.bodies[drawer].mechanism.clone() else { return };
        // The left and the right wall of the box: thin along x and long along y.
        let is_wall = |piece: &&Piece| {
            let (low, high) = bounds(piece.solid.0.iter().flatten().copied());
            high.x - low.x < 0.011 && high.y - low.y > 0.1
        };
        let walls: Vec<_> = self.model.bodies[drawer].pieces.iter().filter(is_wall).cloned().collect();
        let [left, right] = &walls[..] else { return };
        let low: (DVec3, DVec3) = bounds(left.solid.0.iter().flatten().copied());
        let high: (DVec3, DVec3) = bounds(right.solid.0.iter().flatten().copied());
        let (x0, x1, y0, y1, top) = (low.1.x + 0.002, high.0.x - 0.002, low.0.y + 0.004, low.1.y - 0.014, low.1.z);
        let (long, tall) = (0.45 * (y1 - y0), (0.4 * (top - low.0.z)).min(0.05));
        let travel = y1 - y0 - long;
        if x1 - x0 < 0.1 || tall < 0.02 || travel < 0.06 || self.model.movable() >= MOST_PARTS {
            return;
        }
        self.model.bodies[drawer].pieces.retain(|piece| {
            // What lies in the drawer would be in the way.
            let (low, high) = bounds(piece.solid.0.iter().flatten().copied());
            !(low.y > y0 && high.y < y1 && high.z <= top)
        });
        let slide = Mechanism::slide(DVec3::NEG_Y, [-travel, 0.0], 0.04_f64.min(0.5 * travel)).anywhere();
        let mut tray = Body::new(format!("tray_{}", self.model.movable()), drawer, slide);
        let material =
            if self.studio.looks.is_equal() { self.studio.looks.inside() } else { self.studio.looks.thing() };
        let z0 = top - tall;
        tray.add(material, cuboid([x0, y0, z0], [x1, y0 + long, z0 + 0.006]));
        for (a, b) in [([x0, y0], [x1, y0 + 0.006]), ([x0, y0 + long - 0.006], [x1, y0 + long])] {
            tray.add(material, cuboid([a[0], a[1], z0 + 0.006], [b[0], b[1], top]));
        }
        self.model.push(tray);
        self.model.mark("tray");
        // A tray is of no use in a drawer that is closed: such drawers are found open.
        if let Some(of_drawer) = &mut self.model.bodies[drawer].mechanism {
            of_drawer.rests_closed = mechanism.rests_closed && self.studio.dice.chance(0.3);
        }
    }

    /// Shelves and things behind doors, or in an open bay.
    fn add_inside(&mut self, bay: &Bay) {
        let open = bay.opening.shrunk(0.001);
        let (near, far) = (0.075, self.depth - 0.01);
        if far - near < 0.1 {
            return;
        }
        let levels = ((open.high() / 0.36) as usize).min(4);
        let mut floors = vec![open.z[0]];
        for level in 1..=levels {
            let z = open.z[0] + open.high() * level as f64 / (levels + 1) as f64;
            let inside = self.studio.looks.inside();
            self.model.base().add(inside, cuboid([open.x[0], near, z - 0.008], [open.x[1], far, z + 0.008]));
            floors.push(z + 0.009);
        }
        let room = open.high() / (levels + 1) as f64 - 0.03;
        for floor in floors {
            if self.studio.dice.chance(0.6) && open.wide() > 0.15 && room > 0.05 {
                self.add_things([open.x[0] + 0.02, open.x[1] - 0.02], [near + 0.02, far - 0.02], floor, room);
            }
        }
    }

    /// Books, boxes and jars on a shelf.
    fn add_things(&mut self, x: [f64; 2], y: [f64; 2], z: f64, room: f64) {
        let mut at = x[0];
        for _ in 0..self.studio.dice.count(1, 6) {
            let dice = &mut *self.studio.dice;
            let (wide, deep) = (dice.within([0.03, 0.14]), dice.within([0.5, 0.9]) * (y[1] - y[0]).min(0.25));
            let (high, jar) = (dice.within([0.3, 0.9]) * room.min(0.4), dice.chance(0.3));
            if at + wide > x[1] {
                return;
            }
            let back = y[0] + deep;
            let thing = self.studio.looks.thing();
            let solid = match jar {
                true => cylinder(0.45 * wide, 0.0, high).shifted([at + wide / 2.0, y[0] + wide / 2.0, z]),
                false => cuboid([at, y[0], z], [at + wide, back, z + high]),
            };
            self.model.base().add(thing, solid);
            at += wide + self.studio.dice.within([0.003, 0.05]);
        }
    }
}

/// Shares of a division: equal, or one region larger or smaller than the others.
fn shares(studio: &mut Studio, count: usize) -> Vec<f64> {
    let mut shares = vec![1.0; count];
    if studio.dice.chance(0.35) {
        let odd = if studio.dice.chance(0.5) { 0 } else { count - 1 };
        shares[odd] = studio.dice.pick(&[0.6, 1.5, 1.8]);
    }
    let sum: f64 = shares.iter().sum();
    shares.into_iter().map(|s| s / sum).collect()
}
