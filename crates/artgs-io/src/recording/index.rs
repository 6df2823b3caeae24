//! What a format's reader finds before any image is decoded.

use super::RecordingError;
use super::depth::Measured;
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
        if !names.is_empty() {
            let head = names[..names.len().min(5)].join(", ");
            let more = if names.len() > 5 { format!(" and {} more", names.len() - 5) } else { String::new() };
            self.warnings.push(format!("{}: {} {what}: {head}{more}", path.display(), names.len()));
        }
    }
}
