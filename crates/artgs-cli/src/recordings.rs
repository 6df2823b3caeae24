//! The input of `reconstruct`, `inspect` and `view`: a capture, or recordings with the options that say how they are read.

use crate::args::RecordingArgs;
use crate::failure::Failure;
use artgs::Input;
use artgs::prepare::RecordingFiles;
use artgs_core::{PerState, State};
use artgs_io::capture::is_capture;
use artgs_io::recording::{AxisOrder, RecordingFormat, RecordingOptions, parse_depth_unit, parse_intrinsics};
use std::path::{Path, PathBuf};

/// What the user named: one capture folder with both states, or one recording of each state.
pub(crate) fn input(paths: &[PathBuf], args: &RecordingArgs) -> Result<Input, Failure> {
    let input = Input::new(paths).map_err(Failure::of)?;
    match &input {
        Input::Capture(folder) => match given_option(args).filter(|_| is_capture(folder)) {
            Some(option) => Err(for_recordings(option)),
            None => Ok(input),
        },
        _ => Ok(input.with_options(PerState::from_fn(|state| options(state, args)).transpose()?)),
    }
}

/// The recording of one state.
pub(crate) fn of_state(path: &Path, state: State, args: &RecordingArgs) -> Result<RecordingFiles, Failure> {
    Ok(RecordingFiles { path: path.into(), options: options(state, args)? })
}

/// Refuses an option of recordings where the input is a capture.
fn for_recordings(option: &str) -> Failure {
    Failure::bad(format!("{option} is for the recordings of two states, and this is a capture"))
}

/// An option of recordings that is given.
pub(crate) fn given_option(args: &RecordingArgs) -> Option<&'static str> {
    let all = [
        ("--format", args.format.is_some()),
        ("--frames", args.frames.is_some()),
        ("--intrinsics", args.intrinsics.is_some()),
        ("--poses", !args.poses.is_empty()),
        ("--depth-unit", args.depth_unit.is_some()),
        ("--camera-axes", args.camera_axes.is_some()),
        ("--invert-poses", args.invert_poses),
        ("--every", args.every != 1),
        ("--offset", !args.offset.is_empty()),
    ];
    all.into_iter().find_map(|(option, given)| given.then_some(option))
}

fn options(state: State, args: &RecordingArgs) -> Result<RecordingOptions, Failure> {
    let default = RecordingOptions::default();
    let format = match args.format.as_deref() {
        None => None,
        Some(name) => Some(RecordingFormat::from_name(name).ok_or_else(|| {
            let known = RecordingFormat::ALL.map(RecordingFormat::name).join(", ");
            Failure::bad(format!("--format {name}: there is no such format; there are {known}"))
        })?),
    };
    let intrinsics = args.intrinsics.as_deref().map(parse_intrinsics).transpose();
    let depth_unit = args.depth_unit.as_deref().map(parse_depth_unit).transpose();
    let axes = args.camera_axes.as_deref().map(AxisOrder::parse).transpose();
    Ok(RecordingOptions {
        format,
        frames: args.frames.unwrap_or(default.frames),
        intrinsics: intrinsics.map_err(|reason| Failure::bad(format!("--intrinsics: {reason}")))?,
        poses: args.poses.get(state.index()).or(args.poses.first()).cloned(),
        depth_unit: depth_unit.map_err(|reason| Failure::bad(format!("--depth-unit: {reason}")))?,
        axes: axes.map_err(|reason| Failure::bad(format!("--camera-axes: {reason}")))?,
        inverted_poses: args.invert_poses,
        every: args.every,
        offset: args.offset.get(state.index()).copied().unwrap_or(0),
        ..default
    })
}
