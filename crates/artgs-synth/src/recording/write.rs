//! Recordings on disk: `start`, `end`, and their truth under `gt`.

use super::{RecordingCaptureOptions, RecordingTruth, WorldAxes, record_object, render_recording};
use crate::replace::replace;
use crate::write::{GENERATOR, MARKER, StatePair, count_labels, ground_truth, write_json, write_meshes};
use crate::{Object, SynthError, objects};
use artgs_core::{Camera, Mesh, PerState, Recording, Rigid, State};
use artgs_io::capture::opengl_pose;
use artgs_io::image_io::write_gray;
use artgs_io::recording::{RecordingFormat, write_recording};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::Path;

/// What a folder made by [`write_recorded_object`] holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordingInfo {
    /// Name of the object.
    pub object: String,
    /// Number of its parts, the static part included.
    pub parts: usize,
    /// Name of the format of `start` and `end`.
    pub format: String,
    /// How it was rendered.
    pub recording: RecordingCaptureOptions,
    /// False while it is being written.
    pub complete: bool,
}

/// The marker of a folder that [`write_recorded_object`] wrote or began to write; None for any other folder.
pub fn recording_info(folder: &Path) -> Option<RecordingInfo> {
    serde_json::from_slice(&std::fs::read(folder.join(MARKER)).ok()?).ok()
}

/// Renders recordings of the object of this name, [`render_recording`], and writes them into `folder/start` and `folder/end`,
/// their truth into `folder/gt`. The axes of the worlds are those of the format; the focal length is fixed where a format has
/// one camera for all frames. Recordings that this function wrote earlier
/// are kept if they are complete and have the same options, else replaced. The marker that [`recording_info`] reads is
/// `complete` only once all files are written.
pub fn write_recorded_object(
    name: &str,
    options: &RecordingCaptureOptions,
    format: RecordingFormat,
    folder: &Path,
) -> Result<RecordingInfo, SynthError> {
    let fixed_focus = options.fixed_focus || matches!(format, RecordingFormat::Tum | RecordingFormat::SevenScenes);
    let options = RecordingCaptureOptions { world: WorldAxes::of(format), fixed_focus, ..*options };
    options.check()?;
    let parts = objects().iter().find(|info| info.name == name).map_or(0, |info| info.parts());
    let marker = |complete| RecordingInfo {
        object: name.into(),
        parts,
        format: format.name().into(),
        recording: options,
        complete,
    };
    if recording_info(folder) == Some(marker(true)) {
        return Ok(marker(true));
    }
    // Before any file, so that an unknown object leaves no trace.
    let (recordings, truth) = render_recording(name, &options)?;
    replace(
        folder,
        |complete| json!(marker(complete)),
        |new| {
            for (state, recording) in recordings.enumerate() {
                write_recording(&new.join(state.name()), recording, format)?;
            }
            write_truth(new, &recordings, &truth, &options)
        },
    )?;
    Ok(marker(true))
}

/// Writes the truth of recordings into `folder/gt`: joints and meshes of the object alone in the true world frame of the
/// start state, `alignment.json` with the transformation between the worlds and true and stated poses, and part masks of all
/// frames. `options` are recorded in `trans.json`.
pub fn write_truth(
    folder: &Path,
    recordings: &PerState<Recording>,
    truth: &RecordingTruth,
    options: &impl Serialize,
) -> Result<(), SynthError> {
    let object = &truth.object;
    let input = json!({
        "generator": GENERATOR,
        "object": object.name,
        "options": options,
        "world": "true world of the start state, metres",
    });
    write_json(&folder.join("gt/trans.json"), &ground_truth(object, input))?;
    write_json(&folder.join("gt/alignment.json"), &alignment(recordings, truth))?;
    State::ALL.into_iter().try_for_each(|state| write_true_state(folder, truth, StatePair(0), state))
}

/// Writes true meshes and part masks of a state.
fn write_true_state(folder: &Path, truth: &RecordingTruth, pair: StatePair, state: State) -> Result<(), SynthError> {
    let object = &truth.object;
    let meshes: Vec<Mesh> = (0..object.parts.len()).map(|part| object.mesh(part, state)).collect();
    write_meshes(folder, &meshes, &pair.name(state))?;
    let masks = folder.join("gt/part_masks").join(pair.name(state));
    let cameras = truth.cameras[state].par_iter();
    cameras.zip(truth.labels[state].par_iter()).enumerate().try_for_each(|(index, (camera, labels))| {
        let name = format!("frame_{index:05}.png");
        let k = &camera.intrinsics;
        write_gray(&masks.join("colour").join(&name), k.width, k.height, &labels.colour)?;
        let height = labels.depth.len() as u32 / labels.depth_width;
        Ok(write_gray(&masks.join("depth").join(&name), labels.depth_width, height, &labels.depth)?)
    })
}

/// Renders and writes recordings of some states of a pair, their alignment, true masks and meshes. Returns for every state that was
/// written the number of depth pixels of all frames that show each part, and the object in the true world of the start state.
pub(crate) fn write_recorded_states(
    folder: &Path,
    object: Object,
    options: &RecordingCaptureOptions,
    format: RecordingFormat,
    pair: StatePair,
    states: &[State],
) -> Result<(Vec<Vec<usize>>, Object), SynthError> {
    let (recordings, truth) = record_object(object, options, pair.number(State::START))?;
    let mut seen = Vec::new();
    for &state in states {
        write_recording(&folder.join(pair.name(state)), &recordings[state], format)?;
        write_true_state(folder, &truth, pair, state)?;
        let parts = truth.object.parts.len();
        let counts = truth.labels[state].iter().map(|labels| count_labels(&labels.depth, parts));
        seen.push(counts.fold(vec![0; parts], |sum, n| sum.iter().zip(n).map(|(a, b)| a + b).collect()));
    }
    let file = match pair.number(State::START) {
        0 => "gt/alignment.json".to_string(),
        first => format!("gt/alignment_{first}.json"),
    };
    write_json(&folder.join(file), &alignment(&recordings, &truth))?;
    Ok((seen, truth.object))
}

/// `alignment.json`. Poses are camera to world, OpenGL axes; intrinsics are focal length and principal point of the colour
/// image, pixels.
fn alignment(recordings: &PerState<Recording>, truth: &RecordingTruth) -> Value {
    let state = |state: State| {
        let cameras = &truth.cameras[state];
        let stated: Vec<_> = recordings[state].frames.iter().map(|f| opengl_pose(&f.view.camera)).collect();
        let intrinsics = |c: &Camera| [c.intrinsics.fx, c.intrinsics.cx, c.intrinsics.cy];
        json!({
            "true_poses": cameras.iter().map(opengl_pose).collect::<Vec<_>>(),
            "stated_poses": stated,
            "intrinsics": cameras.iter().map(intrinsics).collect::<Vec<_>>(),
            "room_to_world": rows(&truth.room_to_world[state]),
        })
    };
    json!({
        "axes": "OpenGL camera to world",
        "end_to_start": rows(&truth.end_to_start),
        "start": state(State::START),
        "end": state(State::END),
    })
}

fn rows(motion: &Rigid) -> [[f64; 4]; 4] {
    let (m, t) = (motion.matrix().transpose(), motion.translation);
    let row = |r: glam::DVec3, t: f64| [r.x, r.y, r.z, t];
    [row(m.x_axis, t.x), row(m.y_axis, t.y), row(m.z_axis, t.z), [0.0, 0.0, 0.0, 1.0]]
}
