//! The walk of a person with a camera: along an arc around the front of the object, back at another height.

use super::room::Room;
use crate::material::value_noise;
use artgs_core::{Rigid, State};
use glam::{DMat3, DVec3};
use std::f64::consts::{PI, TAU};

/// Half the arc, radians.
const HALF_ARC: f64 = 100.0 * PI / 180.0;
/// Least distance of the camera from a wall, metres.
const CLEARANCE: f64 = 0.35;
/// Nearest and farthest distance from the middle of the object, in multiples of its diagonal.
const DISTANCES: [f64; 2] = [0.8, 2.0];

/// A walk in the room frame.
pub(crate) struct Walk {
    middle: DVec3,
    /// Direction that the front of the object faces.
    front: DVec3,
    /// Diagonal of the closed object, metres.
    size: f64,
    /// Radius of a ball around `middle` that holds the object in both states.
    radius: f64,
    /// Heights of the camera on the way there and on the way back.
    heights: [f64; 2],
    /// Corners of the space that the camera stays in.
    low: DVec3,
    high: DVec3,
    /// +1 or -1: where the walk begins.
    side: f64,
    seed: u64,
}

impl Walk {
    /// The walk of a state; the two states differ.
    pub(crate) fn new(room: &Room, state: State, seed: u64) -> Self {
        let (middle, radius) = room.object.ball();
        let (closed_low, closed_high) = room.object.closed_bounds();
        let inset = DVec3::new(CLEARANCE, CLEARANCE, 0.3);
        let seed = seed.wrapping_mul(2).wrapping_add(state.index() as u64) ^ 0x0077_616c_6b00;
        let upper = (room.object_height + 0.45).clamp(1.0, 1.75);
        // Above all clutter.
        let lower = (0.6 * room.object_height).clamp(0.75, 1.1);
        Self {
            middle,
            front: room.object.placement.turn(DVec3::NEG_Y),
            size: (closed_high - closed_low).length(),
            radius,
            heights: if state == State::START { [upper, lower] } else { [lower, upper] },
            low: room.low + inset,
            high: room.high - inset,
            side: if state == State::START { -1.0 } else { 1.0 },
            seed,
        }
    }

    /// Smooth noise in [-1, 1] with features of length 1.
    pub(super) fn noise(&self, at: f64, channel: u64) -> f64 {
        2.0 * value_noise(DVec3::new(at, 0.5, 0.5), self.seed ^ channel << 32) - 1.0
    }

    fn noises(&self, at: f64, channel: u64) -> DVec3 {
        DVec3::new(self.noise(at, channel), self.noise(at, channel + 1), self.noise(at, channel + 2))
    }

    /// Room to camera, OpenCV axes, at a time from 0 (begin) to 1 (end) of a walk of this many seconds.
    pub(crate) fn at(&self, time: f64, seconds: f64) -> Rigid {
        let azimuth = self.side * HALF_ARC * (TAU * time).cos() + 0.12 * self.noise(9.0 * time, 1);
        let away = DVec3::new(
            self.front.x * azimuth.cos() - self.front.y * azimuth.sin(),
            self.front.x * azimuth.sin() + self.front.y * azimuth.cos(),
            0.0,
        );
        let swing = 0.5 + 0.5 * (TAU * (1.7 * time + self.noise(0.5, 2))).sin();
        let [near, far] = DISTANCES.map(|d| d * self.size);
        let distance = (near + (far - near) * swing).max(1.1 * self.radius + 0.15);
        let turned = ((time - 0.4) / 0.2).clamp(0.0, 1.0);
        let smooth = turned * turned * (3.0 - 2.0 * turned);
        let height = self.heights[0] + (self.heights[1] - self.heights[0]) * smooth + 0.08 * self.noise(11.0 * time, 3);
        let tremor = 4.0 * seconds * time;
        let eye = DVec3::new(self.middle.x, self.middle.y, height) + away * distance;
        let eye = eye.clamp(self.low, self.high) + 0.003 * self.noises(tremor, 20);

        let target = self.middle + 0.2 * self.size * self.noises(12.0 * time, 4) + 0.006 * self.noises(tremor, 30);
        let z = (target - eye).normalize_or(-away);
        let roll = 0.07 * self.noise(8.0 * time, 8) + 0.004 * self.noise(tremor, 40);
        let level = z.cross(DVec3::Z).normalize_or(DVec3::X);
        let x = level * roll.cos() + z.cross(level) * roll.sin();
        Rigid::from_matrix(DMat3::from_cols(x, z.cross(x), z), eye).inverse()
    }
}
