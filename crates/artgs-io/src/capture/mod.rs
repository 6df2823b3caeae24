//! Reads a capture folder: posed images of one object in its observed states, in one of three layouts.
//!
//! * ArtGS: `transforms_{train,test}_{start,end}.json`, each frame naming its image.
//! * ArtGS as its authors publish captures: `transforms_{train,test}.json` with both states, split by the `time` of frames, 0 or 1.
//! * PARIS: `{start,end}/camera_{train,test}.json`, `K` and one pose per image id.
//!
//! If both are complete, the first is read. The reader writes no files and never reads `gt/`.

mod artgs_layout;
mod check;
mod error;
mod fingerprint;
mod images;
pub(crate) mod json;
mod paris_layout;
pub(crate) mod pose;
mod stored;
mod timed;
mod views;
mod write;

pub use error::CaptureError;
pub use fingerprint::fingerprint;
pub use images::{CameraAxes, PosedImage, capture_of_images};
pub use pose::opengl_pose;
pub use stored::{RecordedNames, as_stored, check_images};
pub use write::write_capture;

use crate::image_io::LARGEST;
use crate::recording::{RecordingFormat, survey};
use artgs_core::{Capture, PerState, State, StateViews, View};
use std::path::{Path, PathBuf};
use views::Entry;

/// Training or held-out views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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

/// True for a folder with the camera files of both states, in either layout.
pub fn is_capture(folder: &Path) -> bool {
    let split =
        ["transforms_train_start.json", "start/camera_train.json"].iter().any(|file| folder.join(file).is_file());
    split || timed::is_capture(folder)
}

/// Loads a capture folder. Problems that do not prevent its use are in [`Capture::warnings`]; others are errors that name the
/// file, the frame, the key and a remedy. Views are in the order of their image paths.
pub fn load_capture(dir: &Path) -> Result<Capture, CaptureError> {
    load_capture_with(dir, &CaptureOptions::default())
}

/// How a capture is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CaptureOptions {
    /// Largest image width or height, pixels, at least 16: larger images are reduced when they are read.
    pub longest_side: u32,
    /// States whose objects do not overlap are loaded, to examine what is wrong with them.
    pub apart: bool,
}

impl Default for CaptureOptions {
    /// 1600 pixels, as 3D Gaussian Splatting reads photos: meshes have 425 voxels along an object, so that more pixels do not
    /// improve them.
    fn default() -> Self {
        Self { longest_side: 1600, apart: false }
    }
}

/// Sizes of the images of a capture, width and height in pixels, from their headers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ImageSizes {
    /// Training images of both states.
    pub train: Vec<(u32, u32)>,
    /// Held-out images of both states.
    pub test: Vec<(u32, u32)>,
}

/// Reads the headers of the images of a capture. Images that cannot be read, or are too large to be, are absent: loading them
/// says why.
pub fn image_sizes(dir: &Path) -> Result<ImageSizes, CaptureError> {
    let layout = Layout::detect(dir)?;
    let sizes = |split| -> Result<Vec<(u32, u32)>, CaptureError> {
        let mut sizes = Vec::new();
        for state in State::ALL {
            let entries = entries_of(dir, layout, state, split, &mut Vec::new())?;
            let size = |entry: &Entry| image::image_dimensions(dir.join(&entry.image)).ok();
            let readable = |(w, h): &(u32, u32)| 4 * u64::from(*w) * u64::from(*h) <= LARGEST;
            sizes.extend(entries.iter().filter_map(size).filter(readable));
        }
        Ok(sizes)
    };
    Ok(ImageSizes { train: sizes(Split::Train)?, test: sizes(Split::Test)? })
}

/// Loads a capture folder with images of a limited size; see [`load_capture`].
pub fn load_capture_with(dir: &Path, options: &CaptureOptions) -> Result<Capture, CaptureError> {
    if dir.exists() && !dir.is_dir() {
        let found = survey::identify(dir).map_or("; give the folder of the capture".into(), |what| format!(", {what}"));
        return Err(CaptureError::NotADirectory { path: dir.into(), found });
    }
    if !dir.is_dir() {
        return Err(CaptureError::DirectoryMissing { dir: dir.into() });
    }
    let layout = Layout::detect(dir)?;
    let mut warnings = Vec::new();
    let mut load = |state| -> Result<StateViews, CaptureError> {
        let [train, test] =
            [Split::Train, Split::Test].map(|split| load_split(dir, layout, state, split, options, &mut warnings));
        Ok(StateViews { train: train?, test: test? })
    };
    let states = PerState::new(load(State::START)?, load(State::END)?);
    check::depth_is_everywhere(&states, &mut warnings);
    if !options.apart {
        check::states_overlap(&states)?;
    }
    let mut capture = Capture { states, warnings, ..Capture::default() };
    write::read_frames(dir, &mut capture)?;
    Ok(capture)
}

/// Layout of the folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Layout {
    ArtGs,
    /// ArtGS with both states in one file.
    Timed,
    Paris,
}

impl Layout {
    /// The camera file of a state and split, relative to the folder.
    fn camera_file(self, state: State, split: Split) -> PathBuf {
        let (state, split) = (state.name(), split.name());
        match self {
            Self::ArtGs => format!("transforms_{split}_{state}.json").into(),
            Self::Timed => format!("transforms_{split}.json").into(),
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
        if timed::is_capture(dir) {
            return Ok(Self::Timed);
        }
        Err(match half {
            Some((found, missing)) => CaptureError::OneState { dir: dir.into(), found, missing },
            None if has_only_images(dir) => CaptureError::NoPoses { dir: dir.into() },
            None => CaptureError::NoLayout {
                dir: dir.into(),
                found: survey::identify(dir).map(|what| format!(": {what}")).unwrap_or_default(),
                recordings: RecordingFormat::known(),
                looked_for: looked_for.join(", "),
            },
        })
    }
}

/// Said of a folder of images without poses.
pub(crate) const NO_POSES: &str = "contains images but no camera poses; recordings need depth and a pose of every frame: record with an app \
                                   that saves both, or compute poses with COLMAP and give the folder with its files `cameras` and \
                                   `images`, and depth";

/// True for a folder with images and without any other file but hidden ones.
pub(crate) fn has_only_images(dir: &Path) -> bool {
    const IMAGES: [&str; 7] = ["jpg", "jpeg", "png", "heic", "webp", "tif", "tiff"];
    let Ok(listed) = std::fs::read_dir(dir) else { return false };
    let names = listed.flatten().filter(|e| e.path().is_file()).filter_map(|e| e.file_name().into_string().ok());
    let is_image = |name: &String| {
        let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_lowercase());
        ending.is_some_and(|ending| IMAGES.contains(&ending.as_str()))
    };
    let mut shown = names.filter(|name| !name.starts_with('.')).peekable();
    shown.peek().is_some() && shown.all(|name| is_image(&name))
}

fn load_split(
    dir: &Path,
    layout: Layout,
    state: State,
    split: Split,
    options: &CaptureOptions,
    warnings: &mut Vec<String>,
) -> Result<Vec<View>, CaptureError> {
    let file = layout.camera_file(state, split);
    let entries = entries_of(dir, layout, state, split, warnings)?;
    if entries.is_empty() && split == Split::Test {
        return Ok(Vec::new());
    }
    views::load(dir, &file, &entries, split == Split::Train, options.longest_side, warnings)
}

/// Listed frames in the order of their image paths; none if there is no camera file of held-out views.
fn entries_of(
    dir: &Path,
    layout: Layout,
    state: State,
    split: Split,
    warnings: &mut Vec<String>,
) -> Result<Vec<Entry>, CaptureError> {
    let file = layout.camera_file(state, split);
    if split == Split::Test && !dir.join(&file).is_file() {
        return Ok(Vec::new());
    }
    let mut root = json::read_object(&dir.join(&file), &file)?;
    if layout == Layout::Timed {
        timed::keep(&mut root, state);
    }
    let mut entries = match layout {
        Layout::ArtGs | Layout::Timed => artgs_layout::entries(dir, &file, &root, state, warnings)?,
        Layout::Paris => paris_layout::entries(dir, &file, &root, state, split.name())?,
    };
    entries.sort_by(|a, b| a.sort_key.cmp(&b.sort_key));
    Ok(entries)
}
