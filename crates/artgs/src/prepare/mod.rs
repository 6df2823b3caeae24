//! From files or images to a capture that the stages can use: read, checked, corrected, aligned, reduced to the memory there is.
//!
//! [`Request`] says what to reconstruct and how, [`Request::prepare`] makes it [`Prepared`], and a [`Reconstruction`](crate::Reconstruction) runs the stages on
//! that. Every front door (program, Python, batches, pages) takes these steps, so the same input gives the same replica.

mod agreement;
mod error;
mod input;
mod inspect;
mod memory;
mod recordings;
mod viewpoints;

pub use agreement::load_capture;
pub use error::PrepareError;
pub use input::{Input, InputError, RecordingFiles};
pub(crate) use inspect::RENDERED_DEPTH;
pub use inspect::{Inspected, inspect};
pub use memory::{MemoryError, Plan};

use crate::align::{AlignReport, Correction, ObjectBox, correct};
use crate::config::Config;
use crate::consistency::check_aligned;
use crate::observer::{Event, Observer, Tee};
use crate::part_count::PartCount;
use artgs_core::Capture;
use artgs_io::FileError;
use artgs_io::capture::{CaptureOptions, RecordedNames, as_stored, check_images, write_capture};
use artgs_io::run_folder::{RunFolder, remove_folder, save_json};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What to reconstruct, and how.
#[derive(Clone, Debug)]
pub struct Request {
    /// Files or images of both states.
    pub input: Input,
    /// All settings. The default method finds the number of parts unless `parts` gives it; the others need it.
    pub config: Config,
    /// Two recordings: the object is what is in this box, world and unit of the start recording; none: what the cameras look at.
    pub object_box: Option<ObjectBox>,
    /// Memory that the run may take, bytes: larger images are reduced to fit. None: what is free on the machine.
    pub memory: Option<u64>,
    /// Use views and states that contradict each other.
    pub force_input: bool,
}

impl Request {
    /// With the default method.
    pub fn new(input: Input) -> Self {
        Self { input, config: Config::default(), object_box: None, memory: None, force_input: false }
    }

    /// With a known number of parts, or bounds of it; it counts the static part.
    pub fn with_parts(mut self, parts: impl Into<PartCount>) -> Self {
        self.config.parts = parts.into();
        self
    }

    /// Reads the input, refuses what cannot be used, aligns recordings, and corrects poses. Writes nothing.
    pub fn prepare(self, observer: &mut dyn Observer) -> Result<Prepared, PrepareError> {
        let Self { input, mut config, object_box, memory, force_input } = self;
        config.check()?;
        config.check_part_count()?;
        if force_input {
            config.discover = config.discover.without_refusals();
        }
        if object_box.is_some() && !matches!(input, Input::Recordings(_)) {
            return Err(InputError::BoxOfCapture.into());
        }
        let mut before = Vec::new();
        let observer = &mut Tee(&mut before, observer);
        let plan = Plan::new(&input, memory)?;
        plan.notice().into_iter().for_each(|text| observer.event(Event::note(text)));
        if let Some(mib) = plan.volume_mib {
            config.surface.memory_mib = config.surface.memory_mib.min(mib);
        }
        let (capture, photos) = match input {
            Input::Capture(folder) => {
                let options = CaptureOptions { longest_side: plan.longest_side, ..CaptureOptions::default() };
                let mut capture = load_capture(&folder, &options)?;
                agreement::require(&mut capture, force_input)?;
                let correction = correct(&mut capture, &config.align);
                if correction.is_none() {
                    (capture, Photos::Folder(folder))
                } else {
                    changed(capture, Report::Corrected(correction), plan.longest_side)?
                }
            }
            Input::Images(mut capture) => {
                check_images(&capture)?;
                agreement::require(&mut capture, force_input)?;
                let correction = correct(&mut capture, &config.align);
                changed(capture, Report::Corrected(correction), plan.longest_side)?
            }
            Input::Recordings(files) => {
                let paths = files.as_ref().map(|files| files.path.clone());
                let mut read = recordings::load(files, plan.longest_side)?;
                agreement::require_recordings(&mut read, &paths, force_input)?;
                let (mut capture, report) = recordings::aligned(&read, &config, object_box.as_ref(), observer)?;
                drop(read);
                capture.warnings.extend(check_aligned(&capture));
                changed(capture, Report::Aligned(report.into()), CaptureOptions::default().longest_side)?
            }
        };
        Ok(Prepared { capture, config, photos, before })
    }
}

/// A capture that stages can use, with the settings for it.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// Images of both states.
    pub capture: Capture,
    /// All settings.
    pub config: Config,
    /// What happened before, such as the alignment of recordings: the event file of a run begins with it.
    pub before: Vec<Event>,
    photos: Photos,
}

/// Where exports and pages find the images.
#[derive(Clone, Debug)]
enum Photos {
    /// In this folder, as they are.
    Folder(PathBuf),
    /// In the folder of the run, which saves them with this report of what was done to them, and with the names that they were recorded with.
    Run(Box<Report>, RecordedNames),
    /// In memory only.
    Unsaved,
}

/// What was done to images.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
enum Report {
    Corrected(Correction),
    Aligned(Box<AlignReport>),
}

impl Prepared {
    /// A capture as it is, with the default settings: neither checked nor corrected, and its images are not saved. For captures that are
    /// known to be right.
    pub fn as_is(capture: Capture) -> Self {
        Self { capture, config: Config::default(), before: Vec::new(), photos: Photos::Unsaved }
    }

    /// The images in a folder as a run saw them that is continued: those that it saved are as they were, others are prepared again.
    pub fn again(
        run: &RunFolder,
        photos: &Path,
        config: Config,
        observer: &mut dyn Observer,
    ) -> Result<Self, PrepareError> {
        let own = |path: &Path| path.canonicalize().ok();
        if own(photos).is_some() && own(photos) == own(&run.aligned()) {
            return Self::saved(photos, config);
        }
        let force_input = config.discover == config.discover.clone().without_refusals();
        Request { config, force_input, ..Request::new(Input::Capture(photos.into())) }.prepare(observer)
    }

    /// The capture in a folder that an earlier run has prepared.
    pub fn saved(folder: &Path, config: Config) -> Result<Self, PrepareError> {
        let capture = load_capture(folder, &CaptureOptions::default())?;
        Ok(Self { config, photos: Photos::Folder(folder.into()), ..Self::as_is(capture) })
    }

    /// The same with other settings.
    pub fn with_config(self, config: Config) -> Self {
        Self { config, ..self }
    }

    /// The same with a known number of parts, or bounds of it; it counts the static part.
    pub fn with_parts(mut self, parts: impl Into<PartCount>) -> Self {
        self.config.parts = parts.into();
        self
    }

    /// Names and wall-clock seconds of what was done before the stages.
    pub(crate) fn seconds(&self) -> impl Iterator<Item = (String, f64)> + '_ {
        self.before.iter().filter_map(|event| match event {
            Event::StageFinished { stage, seconds, .. } => Some((stage.to_string(), *seconds)),
            _ => None,
        })
    }

    /// Writes images that no other folder has into the folder of the run, and notes where the images are.
    pub(crate) fn save_photos(&self, run: &RunFolder) -> Result<(), FileError> {
        let folder = match &self.photos {
            Photos::Folder(folder) => folder.clone(),
            Photos::Run(report, recorded) => {
                let folder = run.aligned();
                // An earlier one may have more frames.
                remove_folder(&folder)?;
                write_capture(&folder, &self.capture, recorded)?;
                save_json(&folder.join("report.json"), report)?;
                folder
            }
            Photos::Unsaved => return Ok(()),
        };
        run.save_capture_folder(&folder)
    }

    /// The folder with the images: of the input, or where `run` saves them; none for images in memory.
    pub fn photos(&self, run: &RunFolder) -> Option<PathBuf> {
        match &self.photos {
            Photos::Folder(folder) => Some(folder.clone()),
            Photos::Run(..) => Some(run.aligned()),
            Photos::Unsaved => None,
        }
    }
}

/// A capture that differs from its files, as it will be read from those that the run writes: depth in files is rounded, and a later run
/// on them must see the same numbers.
fn changed(capture: Capture, report: Report, longest_side: u32) -> Result<(Capture, Photos), PrepareError> {
    let (capture, recorded) = as_stored(capture, longest_side)?;
    Ok((capture, Photos::Run(Box::new(report), recorded)))
}
