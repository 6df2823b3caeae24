//! Recordings as people make them: an object in a furnished room, a walk around it with a simulated device in each state, no
//! masks, poses that drift, and a world frame of its own for every state.

mod drift;
mod exposure;
mod lidar;
mod path;
mod render;
mod room;
mod sensor;
#[cfg(test)]
mod tests;
mod triangulation;
mod write;

pub use drift::Drift;
pub use room::{BYSTANDER_LABEL, CLUTTER_LABEL};
pub use sensor::Sensor;
pub(crate) use write::write_recorded_states;
pub use write::{RecordingInfo, recording_info, write_recorded_object, write_truth};

use crate::catalog::object_in_metres;
use crate::{Object, SynthError};
use artgs_core::{Camera, PerState, RecordedFrame, Recording, Rigid, State};
use artgs_io::recording::RecordingFormat;
use glam::{DQuat, DVec3};
use path::Walk;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
pub use render::FrameLabels;
use render::{FramePlan, Renderer};
use room::Room;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Counts of depth per metre.
pub(crate) const MILLIMETRES: f64 = 1000.0;
/// Seconds that a person walks around the object.
const DURATION: f64 = 18.0;
/// Seconds that the shutter is open.
const SHUTTER: f64 = 1.0 / 60.0;
/// Largest change of the focal length of a phone, as a share.
const REFOCUS: f64 = 0.012;

/// Directions of the axes of the world frames of a recording.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WorldAxes {
    /// +Y is opposite to gravity, as apps on phones define it.
    #[default]
    YUp,
    /// Any rotation, as structure from motion and motion capture give.
    Any,
}

/// How a recording is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordingCaptureOptions {
    /// Frames per state, at least 2.
    pub views: usize,
    /// Width of the colour images, pixels, a multiple of 4 from 32 to 4096; the height is three quarters of it.
    pub width: u32,
    /// The device.
    pub sensor: Sensor,
    /// Error of the stated poses.
    pub drift: Drift,
    /// Each state has a world frame of its own; otherwise the end state has that of the start state.
    pub own_frames: bool,
    /// Directions of the axes of the world frames.
    pub world: WorldAxes,
    /// The focal length is the same in all frames, even if that of the device changes.
    pub fixed_focus: bool,
    /// A box beside the object is elsewhere in the end state.
    pub bystander: bool,
    /// Seed of everything random.
    pub seed: u64,
}

impl WorldAxes {
    /// The axes that a format states.
    pub fn of(format: RecordingFormat) -> Self {
        use RecordingFormat::{Polycam, Record3d, ScannerApp, Stray};
        if matches!(format, ScannerApp | Record3d | Polycam | Stray) { Self::YUp } else { Self::Any }
    }
}

impl Default for RecordingCaptureOptions {
    fn default() -> Self {
        Self {
            views: 90,
            width: Sensor::Lidar.default_width(),
            sensor: Sensor::Lidar,
            drift: Drift { metres: 0.01, degrees: 0.4 },
            own_frames: true,
            world: WorldAxes::YUp,
            fixed_focus: false,
            bystander: false,
            seed: 0,
        }
    }
}

impl RecordingCaptureOptions {
    /// An error for options that cannot be rendered; every function that takes options checks them.
    pub fn check(&self) -> Result<(), SynthError> {
        match () {
            () if self.views < 2 => Err(SynthError::Options("a recording needs at least 2 views")),
            () if self.views > 10_000 => Err(SynthError::Options("at most 10000 views")),
            () if !(32..=4096).contains(&self.width) || !self.width.is_multiple_of(4) => {
                Err(SynthError::Options("the width of a recording must be a multiple of 4 from 32 to 4096 pixels"))
            }
            () if !self.drift.is_valid() => Err(SynthError::Options("drift must be within 1 metre and 45 degrees")),
            () => Ok(()),
        }
    }

    /// Height of the colour images, pixels.
    pub fn height(&self) -> u32 {
        self.width / 4 * 3
    }
}

/// What is true of a recording.
#[derive(Clone, Debug)]
pub struct RecordingTruth {
    /// The object, metres, in the true world frame of the start state.
    pub object: Object,
    /// True world frame of the end state to that of the start state.
    pub end_to_start: Rigid,
    /// True camera of every frame, in the true world frame of its state.
    pub cameras: PerState<Vec<Camera>>,
    /// True parts that the pixels of every frame see.
    pub labels: PerState<Vec<FrameLabels>>,
    /// Room (z up, the floor is z = 0) to the true world frame of each state.
    pub room_to_world: PerState<Rigid>,
}

/// Renders the recordings of an object of the catalogue in both states. Poses of the recordings are those that the device
/// states; the truth has the true ones.
pub fn render_recording(
    name: &str,
    options: &RecordingCaptureOptions,
) -> Result<(PerState<Recording>, RecordingTruth), SynthError> {
    options.check()?;
    record_object(object_in_metres(name, options.seed)?, options, 0)
}

/// Renders the recordings of an object, whose lengths are metres, in its two states. They are the states `first` and `first + 1` of
/// all: room and worlds are the same for all pairs of states, walks are not.
pub(crate) fn record_object(
    object: Object,
    options: &RecordingCaptureOptions,
    first: usize,
) -> Result<(PerState<Recording>, RecordingTruth), SynthError> {
    options.check()?;
    let room = Room::new(object, options.bystander, options.seed)?;
    let renderer = Renderer::new(&room, options);
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed ^ 0x0077_6f72_6c64);
    let worlds: Vec<Rigid> = (0..first + 2).map(|_| world_from_room(&room, options.world, &mut rng)).collect();
    let world = |state: usize| worlds[if options.own_frames { state } else { 0 }];
    let room_to_world = PerState::new(world(first), world(first + 1));
    let walks = RecordingCaptureOptions { seed: options.seed.wrapping_add(0x5_0000 * first as u64), ..*options };
    let states = PerState::from_fn(|state| record(&room, &renderer, &walks, state, &room_to_world[state]));
    let placed = Object { placement: worlds[0] * room.object.placement, ..room.object.clone() };
    let (mut recordings, mut cameras, mut labels) = (PerState::default(), PerState::default(), PerState::default());
    for (state, recorded) in State::ALL.into_iter().zip(states) {
        (recordings[state], cameras[state], labels[state]) = recorded;
    }
    let end_to_start = worlds[0] * room_to_world[State::END].inverse();
    Ok((recordings, RecordingTruth { object: placed, end_to_start, cameras, labels, room_to_world }))
}

/// The surface of an object and the room around it.
#[cfg(test)]
pub(crate) fn room_surface(object: Object, state: State) -> crate::trace::Surface {
    crate::trace::Surface::new(&Room::new(object, false, 0).expect("a room").all, state)
}

/// A world frame whose origin is within two metres of the middle of the room, about where a recording begins.
fn world_from_room(room: &Room, axes: WorldAxes, rng: &mut Pcg64Mcg) -> Rigid {
    let mut within = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let yaw = Rigid::about(DVec3::Z, DVec3::ZERO, within(0.0, TAU));
    let origin = DVec3::new(
        within(0.7 * room.low.x, 0.7 * room.high.x),
        within(0.7 * room.low.y, 0.7 * room.high.y),
        within(1.1, 1.5),
    );
    // Drawn for either kind of axes, so that yaw and origin do not depend on it.
    let turn = DVec3::new(within(-1.0, 1.0), within(-1.0, 1.0), within(-1.0, 1.0));
    let up = match axes {
        WorldAxes::YUp => DQuat::from_rotation_x(-TAU / 4.0),
        WorldAxes::Any => DQuat::from_scaled_axis(2.0 * turn),
    };
    Rigid { rotation: up, translation: DVec3::ZERO } * yaw * Rigid::shift(-origin)
}

/// Renders all frames of a state.
fn record(
    room: &Room,
    renderer: &Renderer,
    options: &RecordingCaptureOptions,
    state: State,
    room_to_world: &Rigid,
) -> (Recording, Vec<Camera>, Vec<FrameLabels>) {
    let walk = Walk::new(room, state, options.seed);
    let seed = options.seed.wrapping_mul(2).wrapping_add(state.index() as u64);
    let plans: Vec<FramePlan> = (0..options.views).map(|index| plan(&walk, options, seed, index)).collect();
    let pose = |time: f64| walk.at(time, DURATION);
    let rendered: Vec<_> = plans.par_iter().map(|plan| renderer.render(state, plan, &pose)).collect();

    let world_from_camera: Vec<Rigid> = plans.iter().map(|plan| *room_to_world * pose(plan.time).inverse()).collect();
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0x64_7269_6674);
    let stated = options.drift.stated(&world_from_camera, &mut rng);
    let camera = |plan: &FramePlan, world_from_camera: &Rigid| Camera {
        intrinsics: plan.intrinsics,
        world_to_camera: world_from_camera.inverse(),
    };
    let cameras = plans.iter().zip(&world_from_camera).map(|(p, w)| camera(p, w)).collect();
    let (mut frames, mut labels) = (Vec::new(), Vec::new());
    for (((plan, stated), mut view), index) in plans.iter().zip(&stated).zip(rendered).zip(0..) {
        view.view.camera = camera(plan, stated);
        view.view.name = format!("{}/frame_{index:05}", state.name());
        labels.push(view.labels);
        let time = Some(1000.0 + DURATION * plan.time);
        frames.push(RecordedFrame { view: view.view, time, depth_step: view.depth_step });
    }
    let up = (options.world == WorldAxes::YUp).then_some(DVec3::Y);
    let recorded = frames.len();
    let recording = Recording { format: "artgs synth", up, metric: true, frames, recorded, warnings: Vec::new() };
    (recording, cameras, labels)
}

fn plan(walk: &Walk, options: &RecordingCaptureOptions, seed: u64, index: usize) -> FramePlan {
    let mut intrinsics = options.sensor.intrinsics(options.width, options.height());
    if options.sensor.refocuses() && !options.fixed_focus {
        let factor = 1.0 + REFOCUS * walk.noise(index as f64 / 5.0, 50);
        intrinsics.fx *= factor;
        intrinsics.fy *= factor;
    }
    // The walk is a closed curve; its last frame is before its begin.
    FramePlan {
        index,
        time: index as f64 / options.views as f64,
        shutter: SHUTTER / DURATION,
        intrinsics,
        seed: seed ^ (index as u64 + 1) << 32,
        state_seed: seed,
    }
}
