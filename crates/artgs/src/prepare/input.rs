//! What is reconstructed from.

use artgs_core::{Capture, PerState, State};
use artgs_io::capture::is_capture;
use artgs_io::recording::{RecordingFormat, RecordingOptions};
use std::path::{Path, PathBuf};

/// What is reconstructed from.
#[derive(Clone, Debug)]
pub enum Input {
    /// Folder with the images and cameras of both states.
    Capture(PathBuf),
    /// A recording of each state, as phones and depth cameras write them.
    Recordings(PerState<RecordingFiles>),
    /// Images in memory.
    Images(Capture),
}

/// The recording of one state.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingFiles {
    /// File or folder.
    pub path: PathBuf,
    /// How it is read; images have at most its `longest_side`, fewer where memory is short.
    pub options: RecordingOptions,
}

/// Why something is no input.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// No path, or more than two.
    #[error("give one capture, or the recordings of two states")]
    Count,
    /// One recording.
    #[error("{}: a recording of one state ({format}); give the recordings of both states", path.display())]
    OneState {
        /// Where it is.
        path: PathBuf,
        /// Name of its format.
        format: &'static str,
    },
    /// One of two recordings is a capture.
    #[error("{}: not a recording, but a capture of both states; give it alone", .0.display())]
    CaptureAmongTwo(PathBuf),
    /// Both recordings are the same frames.
    #[error("{}: the same recording twice; give the recordings of two states", .0.display())]
    Twice(PathBuf),
    /// A file where a folder is needed.
    #[error("{}: is a file; give a folder", .0.display())]
    IsFile(PathBuf),
    /// A folder that does not exist.
    #[error("{}: no such folder", .0.display())]
    NoFolder(PathBuf),
    /// A capture in place of its ground truth.
    #[error("{shown}: a capture; give the folder of its ground truth, {shown}/gt", shown = .0.display())]
    CaptureForTruth(PathBuf),
    /// A box for a capture.
    #[error("a box selects the object in two recordings; the masks of a capture select it")]
    BoxOfCapture,
}

impl Input {
    /// One path is a capture, or a folder with the recordings `start` and `end`; two are the recordings of the states, which are
    /// recognised by content.
    pub fn new<P: AsRef<Path>>(paths: &[P]) -> Result<Self, InputError> {
        let recording = |path: &Path| RecordingFiles { path: path.into(), options: RecordingOptions::default() };
        match paths {
            [path] => {
                let path = path.as_ref();
                if let Some(format) = RecordingFormat::of(path) {
                    return Err(InputError::OneState { path: path.into(), format: format.name() });
                }
                let both = RecordingFormat::of_two_states(path);
                Ok(both.map_or_else(|| Self::Capture(path.into()), |p| Self::Recordings(p.map(|p| recording(&p)))))
            }
            [start, end] => Ok(Self::Recordings(PerState::new(recording(start.as_ref()), recording(end.as_ref())))),
            _ => Err(InputError::Count),
        }
    }

    /// The folder of a capture; none for recordings, which a run does not write, and for images in memory.
    pub fn photos(&self) -> Option<&Path> {
        match self {
            Self::Capture(folder) => Some(folder),
            Self::Recordings(_) | Self::Images(_) => None,
        }
    }

    /// The same with these options for recordings; others have none.
    pub fn with_options(mut self, options: PerState<RecordingOptions>) -> Self {
        if let Self::Recordings(files) = &mut self {
            files.iter_mut().zip(options).for_each(|(files, options)| files.options = options);
        }
        self
    }
}

/// Refuses what are not the recordings of two states.
pub(super) fn require_two(files: &PerState<RecordingFiles>) -> Result<(), InputError> {
    if let Some(capture) = files.iter().map(|f| &f.path).find(|path| is_capture(path)) {
        return Err(InputError::CaptureAmongTwo(capture.clone()));
    }
    let [start, end] = [&files[State::START], &files[State::END]];
    if start.path == end.path && share_frames(&start.options, &end.options) {
        return Err(InputError::Twice(start.path.clone()));
    }
    Ok(())
}

/// True if a frame of one recording would be in both states. Of every second frame, the even ones can be one state and the odd ones
/// the other.
fn share_frames(start: &RecordingOptions, end: &RecordingOptions) -> bool {
    start.every != end.every || start.offset.abs_diff(end.offset).is_multiple_of(start.every.max(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_one_capture_or_two_recordings() {
        let paths = ["a", "b"];
        assert!(matches!(Input::new(&paths[..1]), Ok(Input::Capture(folder)) if folder == Path::new("a")));
        let Ok(Input::Recordings(files)) = Input::new(&paths) else { panic!("two paths are recordings") };
        assert_eq!(files.iter().map(|f| f.path.to_str().unwrap()).collect::<Vec<_>>(), paths);
        assert_eq!(Input::new(&["a", "b", "c"]).err(), Some(InputError::Count));
        assert_eq!(Input::new::<&str>(&[]).err(), Some(InputError::Count));
    }

    #[test]
    fn one_recording_is_two_states_only_with_different_frames() {
        let Ok(input @ Input::Recordings(_)) = Input::new(&["a", "a"]) else { panic!("two paths are recordings") };
        let options = |every, offset| RecordingOptions { every, offset, ..RecordingOptions::default() };
        let required = |input: Input| match input {
            Input::Recordings(files) => require_two(&files),
            other => panic!("{other:?}"),
        };
        assert_eq!(required(input.clone()), Err(InputError::Twice("a".into())));
        let with = |every, offset| {
            required(input.clone().with_options(PerState::new(options(every, 0), options(every, offset))))
        };
        assert_eq!(with(2, 1), Ok(()));
        assert_eq!(with(3, 2), Ok(()));
        // All frames but the first, or every second one but the first, are in both.
        for (every, offset) in [(1, 1), (2, 2)] {
            assert_eq!(with(every, offset), Err(InputError::Twice("a".into())), "{every} {offset}");
        }
    }
}
