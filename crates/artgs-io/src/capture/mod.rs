//! Reads a capture folder: posed images of one object in its observed states, in one of two layouts.
//!
//! * ArtGS: `transforms_{train,test}_{start,end}.json`, each frame naming its image.
//! * PARIS: `{start,end}/camera_{train,test}.json`, `K` and one pose per image id.
//!
//! If both are complete, the first is read. The reader writes no files and never reads `gt/`.

mod artgs_layout;
mod check;
mod error;
pub(crate) mod json;
mod paris_layout;
pub(crate) mod pose;
mod views;
mod write;

pub use error::CaptureError;
pub use pose::opengl_pose;
pub use write::write_capture;

use artgs_core::{Capture, PerState, State, StateViews, View};
use std::path::{Path, PathBuf};

/// Training or held-out views.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Split {
    Train,
    Test,
}

impl Split {
    /// Name in paths of files.
    fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Test => "test",
        }
    }
}

/// Loads a capture folder. Problems that do not prevent its use are in [`Capture::warnings`]; others are errors that name the
/// file, the frame, the key and a remedy. Views are in the order of their image paths.
pub fn load_capture(dir: &Path) -> Result<Capture, CaptureError> {
    if dir.exists() && !dir.is_dir() {
        return Err(CaptureError::NotADirectory { path: dir.into() });
    }
    if !dir.is_dir() {
        return Err(CaptureError::DirectoryMissing { dir: dir.into() });
    }
    let layout = Layout::detect(dir)?;
    let mut warnings = Vec::new();
    let mut load = |state| -> Result<StateViews, CaptureError> {
        let [train, test] =
            [Split::Train, Split::Test].map(|split| load_split(dir, layout, state, split, &mut warnings));
        Ok(StateViews { train: train?, test: test? })
    };
    let states = PerState::new(load(State::START)?, load(State::END)?);
    check::depth_is_everywhere(&states, &mut warnings);
    check::states_overlap(&states)?;
    let frames = write::read_frames(dir)?;
    Ok(Capture { states, frames, warnings })
}

/// Layout of the folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    ArtGs,
    Paris,
}

impl Layout {
    /// The camera file of a state and split, relative to the folder.
    fn camera_file(self, state: State, split: Split) -> PathBuf {
        let (state, split) = (state.name(), split.name());
        match self {
            Self::ArtGs => format!("transforms_{split}_{state}.json").into(),
            Self::Paris => Path::new(state).join(format!("camera_{split}.json")),
        }
    }

    fn detect(dir: &Path) -> Result<Self, CaptureError> {
        let mut half = None;
        let mut looked_for = Vec::new();
        for layout in [Self::ArtGs, Self::Paris] {
            let files = State::ALL.map(|state| layout.camera_file(state, Split::Train));
            match files.clone().map(|f| dir.join(f).is_file()) {
                [true, true] => return Ok(layout),
                [true, false] => half = half.or(Some((files[0].clone(), files[1].clone()))),
                [false, true] => half = half.or(Some((files[1].clone(), files[0].clone()))),
                [false, false] => {}
            }
            looked_for.extend(files.map(|f| f.display().to_string()));
        }
        Err(match half {
            Some((found, missing)) => CaptureError::OneState { dir: dir.into(), found, missing },
            None => CaptureError::NoLayout { dir: dir.into(), looked_for: looked_for.join(", ") },
        })
    }
}

fn load_split(
    dir: &Path,
    layout: Layout,
    state: State,
    split: Split,
    warnings: &mut Vec<String>,
) -> Result<Vec<View>, CaptureError> {
    let file = layout.camera_file(state, split);
    if split == Split::Test && !dir.join(&file).is_file() {
        return Ok(Vec::new());
    }
    let root = json::read_object(&dir.join(&file), &file)?;
    let mut entries = match layout {
        Layout::ArtGs => artgs_layout::entries(dir, &file, &root, state, warnings)?,
        Layout::Paris => paris_layout::entries(dir, &file, &root, state, split.name())?,
    };
    entries.sort_by(|a, b| a.sort_key.cmp(&b.sort_key));
    views::load(dir, &file, &entries, split == Split::Train, warnings)
}
