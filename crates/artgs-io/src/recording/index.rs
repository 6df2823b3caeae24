//! What a format's reader finds before any image is decoded.

use super::RecordingError;
use super::depth::Measured;
use super::files::Odd;
use super::lens::Lens;
use super::pixels::Color;
use artgs_core::Rigid;
use glam::DVec3;
use std::path::Path;

/// Decodes something when it is needed.
pub(super) type Load<T> = Box<dyn Fn() -> Result<T, RecordingError> + Send + Sync>;

/// A frame that is not decoded yet.
pub(super) struct Entry {
    /// Name of the image relative to the recording, for messages.
    pub(super) name: String,
    /// Time stamp, seconds.
    pub(super) time: Option<f64>,
    /// OpenCV axes.
    pub(super) world_to_camera: Rigid,
    pub(super) lens: Lens,
    pub(super) color: Load<Color>,
    pub(super) depth: Option<Load<Measured>>,
    /// Brightness is the mask.
    pub(super) mask: Option<Load<Color>>,
}

/// The frames of a recording, in their order.
#[derive(Default)]
pub(super) struct Index {
    /// Opposite to gravity.
    pub(super) up: Option<DVec3>,
    pub(super) metric: bool,
    /// Frames with a pose and an image.
    pub(super) entries: Vec<Entry>,
    pub(super) warnings: Vec<String>,
    /// Frames that are left out.
    pub(super) skipped: usize,
    /// Why, one sentence for each cause.
    pub(super) reasons: Vec<String>,
}

impl Index {
    /// Adds the warning that frames have no depth image although the recording has `recorded` of them.
    pub(super) fn warn_no_depth(&mut self, path: &Path, recorded: usize, names: &[String]) {
        if recorded > 0 {
            self.warn(path, "frames have no depth image within 20 ms", names);
        }
    }

    /// Adds the warning "N WHAT: a, b, ...", if there is any name.
    pub(super) fn warn(&mut self, path: &Path, what: &str, names: &[String]) {
        if let Some(text) = counted(what, names) {
            self.warnings.push(format!("{}: {text}", path.display()));
        }
    }

    /// The same for frames that are left out: if too few remain, the error says why.
    pub(super) fn skip(&mut self, path: &Path, what: &str, names: &[String]) {
        if let Some(text) = counted(what, names) {
            self.warnings.push(format!("{}: {text}; their frames are ignored", path.display()));
            self.skipped += names.len();
            self.reasons.push(text);
        }
    }

    /// Adds notes about a file as warnings, which also explain why too few frames remain.
    pub(super) fn note(&mut self, path: &Path, notes: Vec<String>) {
        for note in notes {
            let text = format!("{}: {note}", path.display());
            self.warnings.push(text.clone());
            self.reasons.push(text);
        }
    }

    /// Adds the warning that depth images do not exist, and, if some frames have depth, that others have none.
    pub(super) fn warn_gaps(&mut self, path: &Path, gaps: &Gaps) {
        self.warn(path, "frames name a depth image that does not exist", &gaps.missing);
        if self.entries.iter().any(|entry| entry.depth.is_some()) {
            self.warn(path, "frames have no depth image", &gaps.unnamed);
        }
    }

    /// Reads the depth images in another unit, metres per stored number. The same unit again changes nothing.
    pub(super) fn state_depth_unit(&mut self, unit: Option<f64>) {
        let Some(unit) = unit else { return };
        for entry in &mut self.entries {
            entry.depth =
                entry.depth.take().map(|load| -> Load<Measured> { Box::new(move || Ok(load()?.in_unit(unit))) });
        }
    }
}

/// "N WHAT: a, b, ...", if there is any name.
fn counted(what: &str, names: &[String]) -> Option<String> {
    let head = names[..names.len().min(5)].join(", ");
    let more = if names.len() > 5 { format!(" and {} more", names.len() - 5) } else { String::new() };
    (!names.is_empty()).then(|| format!("{} {what}: {head}{more}", names.len()))
}

/// Frames without depth.
#[derive(Default)]
pub(super) struct Gaps {
    /// Names of frames for which the recording has no depth image.
    pub(super) unnamed: Vec<String>,
    /// Depth images that the recording names, and that do not exist.
    pub(super) missing: Vec<String>,
}

/// Frames without a usable pose.
#[derive(Default)]
pub(super) struct Poseless {
    lost: Vec<String>,
    wrong: Vec<String>,
    first: Option<RecordingError>,
}

impl Poseless {
    /// The pose of a frame, or none after noting why it has none. `error` names the file of a wrong one.
    pub(super) fn keep(
        &mut self,
        name: &str,
        pose: Result<Rigid, Odd>,
        error: impl FnOnce(String) -> RecordingError,
    ) -> Option<Rigid> {
        match pose {
            Ok(pose) => return Some(pose),
            Err(Odd::Lost) => self.lost.push(name.into()),
            Err(Odd::Wrong(reason)) => {
                self.wrong.push(format!("{name} ({reason})"));
                self.first.get_or_insert_with(|| error(reason));
            }
        }
        None
    }

    /// Warns of the frames. An error if most of `all` frames have a wrong pose.
    pub(super) fn report(self, index: &mut Index, path: &Path, all: usize) -> Result<(), RecordingError> {
        if let Some(first) = self.first.filter(|_| 2 * self.wrong.len() > all) {
            return Err(first);
        }
        index.skip(path, LOST, &self.lost);
        index.skip(path, "poses cannot be read", &self.wrong);
        Ok(())
    }
}

/// Said of frames in which the device did not know its pose.
pub(super) const LOST: &str = "poses are lost (not finite, or all zero)";
