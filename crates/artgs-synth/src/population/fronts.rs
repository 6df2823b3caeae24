//! What fills a region of the front of furniture: drawers, doors, flaps, sliding panels, handles.
//! The front of the carcass is the plane y = 0, its inside at y > 0; the front faces -y.

use super::distribution::{FRAMED, FRONT, GAP, INSET, REVEAL, REVEALED, SHEET, THIN};
use super::model::{Body, Mechanism, Studio};
use crate::shape::{cuboid, frame, lathe, rectangle};
use crate::{Material, Solid};
use glam::{DVec2, DVec3};

/// A region of the front.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rect {
    pub(super) x: [f64; 2],
    pub(super) z: [f64; 2],
}

impl Rect {
    pub(super) fn wide(&self) -> f64 {
        self.x[1] - self.x[0]
    }

    pub(super) fn high(&self) -> f64 {
        self.z[1] - self.z[0]
    }

    pub(super) fn middle(&self) -> [f64; 2] {
        [(self.x[0] + self.x[1]) / 2.0, (self.z[0] + self.z[1]) / 2.0]
    }

    pub(super) fn shrunk(&self, by: f64) -> Self {
        Self { x: [self.x[0] + by, self.x[1] - by], z: [self.z[0] + by, self.z[1] - by] }
    }

    /// The box over it between two y.
    pub(super) fn slab(&self, y: [f64; 2]) -> Solid {
        cuboid([self.x[0], y[0], self.z[0]], [self.x[1], y[1], self.z[1]])
    }
}

/// A bay: the opening between boards, and what a front before it covers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bay {
    pub(super) opening: Rect,
    pub(super) cover: Rect,
}

/// Edge with the hinge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edge {
    Left,
    Right,
    Bottom,
    Top,
}

/// A handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pull {
    Bar,
    Knob,
    Recess,
    None,
}

/// How the fronts of an object are made.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrontStyle {
    pub(super) inset: bool,
    /// Between neighbouring fronts, or around inset ones.
    pub(super) gap: f64,
    /// Half the strip of carcass that is seen between fronts.
    pub(super) reveal: f64,
    pub(super) thickness: f64,
    /// Thickness of doors if they are sheets.
    pub(super) sheet: Option<f64>,
    pub(super) framed: bool,
    pub(super) pull: Pull,
    /// Gap between a closed front and the carcass.
    pub(super) behind: f64,
    pub(super) tray: TrayStyle,
}

/// How the boxes of the drawers of an object are made.
#[derive(Clone, Copy, Debug)]
pub(super) struct TrayStyle {
    /// Space on both sides.
    air: f64,
    /// Space below.
    rise: f64,
    /// Height as a share of that of the space.
    tall: f64,
    /// Depth as a share of that of the space.
    long: f64,
    /// Share of its depth that it slides out by at most.
    open: f64,
}

impl TrayStyle {
    pub(super) fn draw(studio: &mut Studio) -> Self {
        let dice = &mut *studio.dice;
        Self {
            air: dice.within([0.012, 0.026]),
            rise: dice.within([0.012, 0.024]),
            tall: dice.within([0.4, 0.85]),
            long: dice.within([0.7, 0.93]),
            open: dice.within([0.75, 0.95]),
        }
    }
}

impl FrontStyle {
    pub(super) fn draw(studio: &mut Studio) -> Self {
        let dice = &mut *studio.dice;
        let inset = dice.chance(INSET);
        Self {
            inset,
            gap: dice.within(GAP),
            reveal: if !inset && dice.chance(REVEALED) { dice.within(REVEAL) } else { 0.0 },
            thickness: dice.within(FRONT),
            sheet: dice.chance(THIN).then(|| dice.within(SHEET)),
            framed: dice.chance(FRAMED),
            pull: dice.weighted(&[(Pull::Bar, 0.4), (Pull::Knob, 0.3), (Pull::Recess, 0.15), (Pull::None, 0.15)]),
            behind: dice.within([0.002, 0.004]),
            tray: TrayStyle::draw(studio),
        }
    }

    /// Where the front over a bay is: its rectangle, and y of its outer and inner face.
    pub(super) fn place(&self, bay: &Bay, thickness: f64) -> (Rect, [f64; 2]) {
        if self.inset {
            (bay.opening.shrunk(self.gap), [0.0, thickness])
        } else {
            let rect = bay.cover.shrunk(self.reveal + self.gap / 2.0);
            (rect, [-self.behind - thickness, -self.behind])
        }
    }

    /// Thickness of doors, flaps and panels.
    pub(super) fn door(&self) -> f64 {
        self.sheet.unwrap_or(self.thickness)
    }
}

/// Adds the plate of a front, plain, framed or with a recess to grip.
pub(super) fn add_plate(body: &mut Body, style: &FrontStyle, rect: &Rect, y: [f64; 2], material: Material) {
    const POINTS: usize = 8;
    let outline = |r: &Rect| rectangle(DVec2::new(r.x[0], r.z[0]), DVec2::new(r.x[1], r.z[1]), POINTS);
    let (thick, least) = (y[1] - y[0], rect.wide().min(rect.high()));
    let solid_enough = thick > 0.01;
    let hole = match () {
        () if style.framed && solid_enough && least > 0.16 => Some(rect.shrunk((0.22 * least).clamp(0.035, 0.07))),
        () if style.pull == Pull::Recess && solid_enough && least > 0.09 => {
            let [cx, _] = rect.middle();
            let (half, top) = ((0.2 * rect.wide()).min(0.06), rect.z[1] - 0.02);
            Some(Rect { x: [cx - half, cx + half], z: [top - 0.03, top] })
        }
        () => None,
    };
    let Some(hole) = hole else {
        body.add(material, rect.slab(y));
        return;
    };
    // The outline lies in (x, z) and is extruded along -y.
    body.add(material, frame(&outline(rect), &outline(&hole), -y[1], -y[0]).facing_front());
    body.add(material, hole.slab([y[1] - 0.35 * thick, y[1]]));
}

/// Adds a handle at a point of a front face, along x (0) or z (2); `room` is the length that it may take.
pub(super) fn add_pull(body: &mut Body, pull: Pull, material: Material, at: [f64; 3], along: usize, room: f64) {
    let [x, y, z] = at;
    match pull {
        Pull::Bar => {
            const HALF: f64 = 0.006;
            let half = (0.42 * room).clamp(0.02, 0.16);
            let post = half - 0.012;
            let block = |from: f64, to: f64, near: f64, far: f64, thin: f64| {
                let (mut low, mut high) = ([x - thin, y - far, z - thin], [x + thin, y - near, z + thin]);
                low[along] = at[along] + from;
                high[along] = at[along] + to;
                cuboid(low, high)
            };
            body.add(material, block(-post - HALF, -post + HALF, 0.0, 0.028, 0.7 * HALF));
            body.add(material, block(post - HALF, post + HALF, 0.0, 0.028, 0.7 * HALF));
            body.add(material, block(-half, half, 0.028, 0.04, HALF));
        }
        Pull::Knob => {
            let profile = [(0.0, 0.0), (0.008, 0.0), (0.007, 0.012), (0.016, 0.02), (0.016, 0.028), (0.0, 0.034)];
            body.add(material, lathe(&profile.map(DVec2::from), 20).facing_front().shifted(at));
        }
        Pull::Recess | Pull::None => {}
    }
}

/// A drawer: a front, and a box behind it that is smaller. `depth` is that of the space behind the front plane.
pub(super) fn drawer(studio: &mut Studio, style: &FrontStyle, bay: &Bay, depth: f64, name: String) -> Body {
    let (rect, y) = style.place(bay, style.thickness);
    let tray = style.tray;
    let (wall, air) = (0.010, tray.air.min(0.12 * bay.opening.wide()));
    let (long, rise) = ((depth - y[1]) * tray.long, tray.rise.min(0.15 * bay.opening.high()));
    let (x0, x1) = (bay.opening.x[0].max(rect.x[0]) + air, bay.opening.x[1].min(rect.x[1]) - air);
    let z0 = bay.opening.z[0].max(rect.z[0]) + rise;
    let z1 = z0 + tray.tall * (bay.opening.z[1].min(rect.z[1]) - rise - z0);
    let (back, open) = (y[1] + long, long * tray.open);
    let slide = Mechanism::slide(DVec3::NEG_Y, [0.0, open], (0.25 * open).max(0.03));
    let inside = studio.looks.inside();
    let front = studio.looks.front();
    let mut body = Body::new(name, 0, slide);
    add_plate(&mut body, style, &rect, y, front);
    body.add(inside, cuboid([x0, y[1], z0], [x1, back, z0 + wall]));
    body.add(inside, cuboid([x0, y[1], z0 + wall], [x0 + wall, back, z1]));
    body.add(inside, cuboid([x1 - wall, y[1], z0 + wall], [x1, back, z1]));
    body.add(inside, cuboid([x0 + wall, back - wall, z0 + wall], [x1 - wall, back, z1]));
    let [cx, cz] = rect.middle();
    // In the frame of a framed front there is no wall behind the middle: the handle is on the panel.
    let sunk = if style.framed && rect.wide().min(rect.high()) > 0.16 { 0.65 * style.thickness } else { 0.0 };
    add_pull(&mut body, style.pull, studio.looks.handle(), [cx, y[0] + sunk, cz], 0, rect.wide());
    if studio.dice.chance(0.3) && x1 - x0 > 0.12 && z1 - z0 > 0.04 {
        let (w, d) = (0.4 * (x1 - x0), 0.35 * long);
        let at = studio.dice.within([x0 + 0.02, x1 - 0.02 - w]);
        let high = studio.dice.within([0.4, 0.9]) * (z1 - z0 - wall);
        let thing = studio.looks.thing();
        body.add(thing, cuboid([at, y[1] + 0.05, z0 + wall], [at + w, y[1] + 0.05 + d, z0 + wall + high]));
    }
    body
}

/// A door or flap over a bay, hinged at an edge of its outer face, so that it clears its neighbours.
pub(super) fn door(studio: &mut Studio, style: &FrontStyle, bay: &Bay, edge: Edge, name: String) -> Body {
    let thick = style.door();
    let (mut rect, y) = style.place(bay, thick);
    let across = if matches!(edge, Edge::Left | Edge::Right) { rect.wide() } else { rect.high() };
    if style.inset {
        // The far edge turns through an arc that is wider than the door.
        rect = rect.shrunk((0.5 * thick * thick / across + 0.0005 - style.gap).max(0.0));
    }
    let [cx, cz] = rect.middle();
    let (axis, origin) = match edge {
        Edge::Left => (DVec3::NEG_Z, [rect.x[0], y[0], cz]),
        Edge::Right => (DVec3::Z, [rect.x[1], y[0], cz]),
        Edge::Bottom => (DVec3::X, [cx, y[0], rect.z[0]]),
        Edge::Top => (DVec3::NEG_X, [cx, y[0], rect.z[1]]),
    };
    let widest = match edge {
        Edge::Left | Edge::Right => studio.dice.within([75.0, 115.0]),
        Edge::Bottom => studio.dice.within([60.0, 92.0]),
        Edge::Top => studio.dice.within([60.0, 100.0]),
    };
    let mut body = Body::new(name, 0, Mechanism::hinge(axis, origin, [0.0, widest], 15.0));
    let material = studio.looks.front();
    add_plate(&mut body, style, &rect, y, material);
    let inset = 0.03_f64.min(0.15 * rect.wide().min(rect.high()));
    let (at, along) = match edge {
        Edge::Left => ([rect.x[1] - inset, y[0], cz], 2),
        Edge::Right => ([rect.x[0] + inset, y[0], cz], 2),
        Edge::Bottom => ([cx, y[0], rect.z[1] - inset], 0),
        Edge::Top => ([cx, y[0], rect.z[0] + inset], 0),
    };
    let room = if along == 2 { rect.high() } else { rect.wide() };
    add_pull(&mut body, style.pull, studio.looks.handle(), at, along, room.min(0.4));
    body
}

/// Two panels on rails one behind the other that close an opening; each slides over the other one.
pub(super) fn sliding_pair(studio: &mut Studio, bay: &Bay, number: usize) -> Vec<Body> {
    let open = bay.opening.shrunk(0.004);
    let (thick, lap) = (studio.dice.within([0.010, 0.018]), studio.dice.within([0.02, 0.06]));
    let [cx, cz] = open.middle();
    let travel = open.wide() / 2.0 - lap;
    let mut leaf = |side: f64, y: f64| {
        let x = if side < 0.0 { [open.x[0], cx + lap / 2.0] } else { [cx - lap / 2.0, open.x[1]] };
        let slide = Mechanism::slide(DVec3::NEG_X * side, [0.0, travel], 0.25 * travel);
        let word = if side < 0.0 { "left" } else { "right" };
        let rect = Rect { x, z: open.z };
        let mut body = Body::new(format!("panel_{number}_{word}"), 0, slide);
        let material = studio.looks.front();
        body.add(material, rect.slab([y, y + thick]));
        // A groove has no depth that a sensor sees: a strip to grip, thinner than the space between the panels.
        let grip = if side < 0.0 { x[0] + 0.03 } else { x[1] - 0.03 };
        let high = 0.1_f64.min(0.3 * open.high());
        body.add(studio.looks.handle(), cuboid([grip - 0.008, y - 0.006, cz - high], [grip + 0.008, y, cz + high]));
        body
    };
    vec![leaf(-1.0, 0.012), leaf(1.0, 0.012 + thick + 0.012)]
}
