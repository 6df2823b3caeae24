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
    let twice = [paths, paths].concat();
    let paths = if is_both_states(paths, args) { &twice } else { paths };
    let input = Input::new(paths).map_err(Failure::of)?;
    match &input {
        Input::Capture(folder) => match given_option(args).filter(|_| is_capture(folder)) {
            Some(option) => Err(for_recordings(option)),
            None => Ok(input),
        },
        _ => Ok(input.with_options(PerState::from_fn(|state| options(state, args)).transpose()?)),
    }
}

/// One recording of which some frames are one state and some the other.
pub(crate) fn is_both_states(paths: &[PathBuf], args: &RecordingArgs) -> bool {
    matches!((paths, &args.offset[..]), ([one], [_, _]) if RecordingFormat::of(one).is_some())
}

/// The recording of one state.
pub(crate) fn of_state(path: &Path, state: State, args: &RecordingArgs) -> Result<RecordingFiles, Failure> {
    Ok(RecordingFiles { path: path.into(), options: options(state, args)? })
}

/// Refuses an option of recordings where the input is a capture.
fn for_recordings(option: &str) -> Failure {
    Failure::bad(format!("{option} is for the recordings of two states, and this is a capture"))
}

/// The first option of recordings that is given.
pub(crate) fn given_option(args: &RecordingArgs) -> Option<&'static str> {
    given(args).first().map(|(option, _)| *option)
}

/// The options of recordings that are given, as they are written after the paths of a command.
pub(crate) fn given_options(args: &RecordingArgs) -> String {
    let word = |(option, values): (&str, Vec<String>)| {
        values.iter().fold(format!(" {option}"), |words, value| format!("{words} {value}"))
    };
    given(args).into_iter().map(word).collect()
}

/// The options of recordings that are given, and their values.
fn given(args: &RecordingArgs) -> Vec<(&'static str, Vec<String>)> {
    let one = |value: &Option<String>| value.clone().map(|value| vec![value]);
    let offset: Vec<String> = args.offset.iter().map(usize::to_string).collect();
    let poses: Vec<String> = args.poses.iter().map(|file| file.display().to_string()).collect();
    let all = [
        ("--format", one(&args.format)),
        ("--frames", args.frames.map(|frames| vec![frames.to_string()])),
        ("--intrinsics", one(&args.intrinsics)),
        ("--poses", (!poses.is_empty()).then_some(poses)),
        ("--depth-unit", one(&args.depth_unit)),
        ("--camera-axes", one(&args.camera_axes)),
        ("--invert-poses", args.invert_poses.then(Vec::new)),
        ("--every", (args.every != 1).then(|| vec![args.every.to_string()])),
        ("--offset", (!offset.is_empty()).then(|| vec![offset.join(",")])),
    ];
    all.into_iter().filter_map(|(option, values)| Some((option, values?))).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    fn parsed(line: &str) -> RecordingArgs {
        let cli = crate::args::Cli::try_parse_from(format!("artgs inspect {line}").split_whitespace()).unwrap();
        let crate::args::Command::Inspect(args) = cli.command else { panic!("another command") };
        args.recording
    }

    #[test]
    fn given_options_are_written_as_they_are_read() {
        assert_eq!(given_options(&parsed("a b")), "");
        let all = "a b --format tum --frames 9 --intrinsics 1,2,3,4 --poses p q --depth-unit mm --camera-axes robot \
                   --invert-poses --every 2 --offset 0,1";
        let args = parsed(all);
        assert_eq!(given_option(&args), Some("--format"));
        assert_eq!(format!("{args:?}"), format!("{:?}", parsed(&format!("a b{}", given_options(&args)))));
        assert_eq!(given(&args).len(), 9);
    }
}
