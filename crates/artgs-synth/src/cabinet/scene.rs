//! The cabinet: boxes, materials and joints.

use crate::Material;
use artgs_core::{Joint, JointKind, Mesh, PerState, Rigid, State};
use glam::{BVec3, DVec3};

/// A box whose faces are parallel to the axes of the cabinet while all parts are closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cuboid {
    /// Centre, cabinet frame, all parts closed.
    pub(crate) center: DVec3,
    /// Half the edges.
    pub(crate) half: DVec3,
    /// Its colour.
    pub(crate) material: Material,
}

impl Cuboid {
    /// The box between two corners.
    fn between(low: [f64; 3], high: [f64; 3], material: Material) -> Self {
        let (low, high) = (DVec3::from(low), DVec3::from(high));
        Self { center: (low + high) / 2.0, half: (high - low) / 2.0, material }
    }

    fn mesh(&self) -> Mesh {
        let corner = |i: u32| {
            let high = BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0);
            (self.center + DVec3::select(high, self.half, -self.half)).as_vec3().to_array()
        };
        // Corners counter-clockwise from outside; bit 0, 1, 2 of a corner is its side in x, y, z.
        const FACES: [[u32; 4]; 6] =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        Mesh {
            vertices: (0..8).map(corner).collect(),
            colors: Vec::new(),
            triangles: FACES.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).collect(),
        }
    }
}

/// One rigid part of the cabinet.
#[derive(Clone, Debug)]
pub struct CabinetPart {
    /// Name in the ground truth.
    pub name: &'static str,
    /// Boxes that do not overlap.
    pub(crate) cuboids: Vec<Cuboid>,
    /// Joint in the world frame, value 0 = closed (not the start state). None for the carcass.
    pub joint: Option<Joint>,
}

/// A cabinet with a door, a drawer and contents, 0.8 wide, 0.5 deep and 0.9 high. It is rotated and away from the world
/// origin, so that tests notice wrong frames and axes assumed at the origin.
#[derive(Clone, Debug)]
pub struct Cabinet {
    /// Cabinet frame (x to its right as seen from the front, front towards -y, z up, origin in its middle) to world.
    pub(crate) placement: Rigid,
    /// Carcass, door, drawer.
    pub parts: Vec<CabinetPart>,
    /// Seed of the textures.
    pub(crate) seed: u64,
}

/// Where the open cabinet is: middle and radius of a ball around both states, cabinet frame.
const BALL: ([f64; 3], f64) = ([0.0, -0.3, 0.0], 0.89);

const DARK_WOOD: Material =
    Material::Wood { grain: 2, light: [0.62, 0.42, 0.26], dark: [0.38, 0.23, 0.13], period: 0.07 };
const PALE_WOOD: Material =
    Material::Wood { grain: 0, light: [0.86, 0.74, 0.55], dark: [0.66, 0.50, 0.32], period: 0.06 };
const DOOR_WOOD: Material =
    Material::Wood { grain: 2, light: [0.45, 0.62, 0.66], dark: [0.22, 0.38, 0.45], period: 0.08 };
const DRAWER_CHECKS: Material = Material::Checks { even: [0.80, 0.45, 0.30], odd: [0.62, 0.28, 0.20], cell: 0.061 };
const TRAY_CHECKS: Material = Material::Checks { even: [0.78, 0.78, 0.68], odd: [0.55, 0.58, 0.50], cell: 0.053 };
const PARCEL_CHECKS: Material = Material::Checks { even: [0.85, 0.75, 0.25], odd: [0.30, 0.50, 0.30], cell: 0.047 };
const BRASS: Material = Material::Wood { grain: 0, light: [0.92, 0.85, 0.55], dark: [0.75, 0.65, 0.35], period: 0.05 };

/// Front plane of the carcass, cabinet frame.
const FRONT: f64 = -0.25;
/// Back face of closed door and drawer front: a small gap in front of the carcass.
const LID: f64 = FRONT - 0.002;

impl Cabinet {
    /// The cabinet; `seed` varies its textures only.
    pub fn new(seed: u64) -> Self {
        Self::leaning(seed, super::LEAN)
    }

    /// The same, leaning back by this angle, radians.
    pub fn leaning(seed: u64, angle: f64) -> Self {
        let turn = Rigid::about(DVec3::Z, DVec3::ZERO, 25_f64.to_radians());
        let lean = Rigid::about(DVec3::X, DVec3::ZERO, angle);
        let placement = Rigid::shift(DVec3::new(0.35, -0.2, 0.6)) * turn * lean;
        let hinge = Joint {
            kind: JointKind::Revolute,
            axis: placement.turn(DVec3::NEG_Z),
            origin: placement.apply(DVec3::new(-0.398, LID, 0.0)),
            pitch: 0.0,
            state_values: PerState::new(8_f64.to_radians(), 70_f64.to_radians()),
            limits: [0.0, 110_f64.to_radians()],
        };
        let rail = Joint {
            kind: JointKind::Prismatic,
            axis: placement.turn(DVec3::NEG_Y),
            origin: placement.apply(DVec3::new(0.0, LID, 0.28)),
            pitch: 0.0,
            state_values: PerState::new(0.03, 0.25),
            limits: [0.0, 0.35],
        };
        let parts = vec![
            CabinetPart { name: "carcass", cuboids: carcass(), joint: None },
            CabinetPart { name: "door", cuboids: door(), joint: Some(hinge) },
            CabinetPart { name: "drawer", cuboids: drawer(), joint: Some(rail) },
        ];
        Self { placement, parts, seed }
    }

    /// Cabinet frame (all parts closed) to world for the points of a part in a state.
    pub fn pose(&self, part: usize, state: State) -> Rigid {
        match &self.parts[part].joint {
            Some(joint) => joint.motion(joint.state_values[state]) * self.placement,
            None => self.placement,
        }
    }

    /// Exact surface of a part in a state, world frame, inner faces included.
    pub fn mesh(&self, part: usize, state: State) -> Mesh {
        let mut mesh = Mesh::default();
        for cuboid in &self.parts[part].cuboids {
            mesh.append(&cuboid.mesh());
        }
        mesh.moved(&self.pose(part, state))
    }

    /// Joints of the movable parts, world frame, value 0 = closed.
    pub fn joints(&self) -> impl Iterator<Item = &Joint> {
        self.parts.iter().filter_map(|p| p.joint.as_ref())
    }

    /// Middle (world frame) and radius of a ball that holds the cabinet in both states.
    pub fn ball(&self) -> (DVec3, f64) {
        (self.placement.apply(BALL.0.into()), BALL.1)
    }
}

fn carcass() -> Vec<Cuboid> {
    let board = |low, high| Cuboid::between(low, high, DARK_WOOD);
    let shelf = |low, high| Cuboid::between(low, high, PALE_WOOD);
    vec![
        board([-0.40, FRONT, -0.45], [-0.38, 0.25, 0.45]),
        board([0.38, FRONT, -0.45], [0.40, 0.25, 0.45]),
        shelf([-0.38, FRONT, 0.43], [0.38, 0.25, 0.45]),
        shelf([-0.38, FRONT, -0.45], [0.38, 0.25, -0.43]),
        board([-0.38, 0.23, -0.43], [0.38, 0.25, 0.43]),
        shelf([-0.38, FRONT, 0.12], [0.38, 0.23, 0.14]),
        shelf([-0.38, -0.15, -0.17], [0.38, 0.23, -0.15]),
        Cuboid::between([0.05, -0.08, -0.149], [0.27, 0.12, 0.01], PARCEL_CHECKS),
    ]
}

fn door() -> Vec<Cuboid> {
    let brass = |low, high| Cuboid::between(low, high, BRASS);
    vec![
        Cuboid::between([-0.398, LID - 0.025, -0.445], [0.398, LID, 0.125], DOOR_WOOD),
        brass([0.31, LID - 0.065, -0.04], [0.33, LID - 0.025, -0.02]),
        brass([0.31, LID - 0.065, -0.22], [0.33, LID - 0.025, -0.20]),
        brass([0.305, LID - 0.085, -0.24], [0.335, LID - 0.065, 0.0]),
    ]
}

fn drawer() -> Vec<Cuboid> {
    let tray = |low, high| Cuboid::between(low, high, TRAY_CHECKS);
    let brass = |low, high| Cuboid::between(low, high, BRASS);
    vec![
        Cuboid::between([-0.398, LID - 0.025, 0.135], [0.398, LID, 0.445], DRAWER_CHECKS),
        tray([-0.36, LID, 0.16], [0.36, 0.20, 0.175]),
        tray([-0.36, LID, 0.175], [-0.345, 0.20, 0.34]),
        tray([0.345, LID, 0.175], [0.36, 0.20, 0.34]),
        tray([-0.345, 0.185, 0.175], [0.345, 0.20, 0.34]),
        brass([-0.11, LID - 0.065, 0.28], [-0.09, LID - 0.025, 0.30]),
        brass([0.09, LID - 0.065, 0.28], [0.11, LID - 0.025, 0.30]),
        brass([-0.13, LID - 0.085, 0.275], [0.13, LID - 0.065, 0.305]),
    ]
}
