//! Recordings: frames that a phone or a depth camera took of one state. One source file per format.
//!
//! A format's reader lists the frames with poses and intrinsics (`index`); then frames are selected (`select`), and only
//! those are decoded (`decode`), in parallel. The result has pinhole cameras with OpenCV axes, images without lens
//! distortion, and depth for their pixels.

mod axes;
mod binary;
mod colmap;
mod colmap_model;
mod colmap_models;
mod colmap_scale;
mod container;
mod decode;
mod depth;
mod depth_file;
mod error;
mod exr_depth;
mod files;
mod folder_poses;
mod folders;
mod format;
mod index;
mod intrinsics;
mod lens;
mod matrices;
mod mcap;
mod nerfstudio;
mod npy;
mod options;
mod pixels;
mod polycam;
mod pose;
mod record3d;
mod ros;
mod ros_depth;
mod ros_topics;
mod rosbag;
mod scanner_app;
mod select;
mod seven_scenes;
mod store;
mod stray;
pub(crate) mod survey;
pub(crate) use files::natural;
mod trajectory;
mod tum;
mod values;
mod video;
mod warp;
mod write;

pub use axes::AxisOrder;
pub use error::RecordingError;
pub use format::RecordingFormat;
pub use options::{RecordingOptions, parse_depth_unit, parse_intrinsics};

use artgs_core::{RecordedFrame, Recording};
use index::Index;
use rayon::prelude::*;
use std::path::Path;

/// Loads the recording of one state: a folder or a file. Problems that do not prevent its use are in [`Recording::warnings`];
/// others are errors that name the file, the frame or field, and a remedy.
pub fn load_recording(path: &Path, options: &RecordingOptions) -> Result<Recording, RecordingError> {
    if !path.exists() {
        return Err(RecordingError::Missing { path: path.into() });
    }
    options.check(path)?;
    let format = options.format.or_else(|| RecordingFormat::detect(path)).or_else(|| RecordingFormat::by_name(path));
    let folder = path.parent().filter(|_| path.is_file()).filter(|folder| RecordingFormat::detect(folder).is_some());
    let whole = || path.parent().filter(|above| crate::capture::is_capture(above));
    let unknown = || match (whole(), folder, crate::capture::has_only_images(path)) {
        (Some(whole), ..) => RecordingError::OneState { path: path.into(), whole: whole.into() },
        (None, Some(folder), _) => RecordingError::OneFile { path: path.into(), folder: folder.into() },
        (None, None, true) => RecordingError::NoPoses { path: path.into() },
        (None, None, false) => RecordingError::Unknown {
            path: path.into(),
            found: survey::identify(path).map(|what| format!(": {what}")).unwrap_or_default(),
            known: RecordingFormat::known(),
        },
    };
    let format = format.ok_or_else(unknown)?;
    let mut index = match format {
        RecordingFormat::ScannerApp => scanner_app::index(path)?,
        RecordingFormat::Tum => tum::index(path, options)?,
        RecordingFormat::Nerfstudio => nerfstudio::index(path)?,
        RecordingFormat::Record3d => record3d::index(path)?,
        RecordingFormat::Polycam => polycam::index(path)?,
        RecordingFormat::Stray => stray::index(path, options)?,
        RecordingFormat::Colmap => colmap::index(path, options)?,
        RecordingFormat::SevenScenes => seven_scenes::index(path, options)?,
        RecordingFormat::RealsenseBag => rosbag::index(path, options)?,
        RecordingFormat::Mcap => mcap::index(path, options)?,
        RecordingFormat::Folders => folders::index(path, options)?,
    };
    axes::restate(&mut index, format, options.axes, options.inverted_poses);
    index.state_depth_unit(options.depth_unit);
    load(path, format, index, options)
}

/// Writes a recording in a format of its own, into a new or empty folder. World frames are kept, except that formats of phones
/// have +Y up. Formats without masks lose alpha, formats with JPEG images lose a little colour.
pub fn write_recording(dir: &Path, recording: &Recording, format: RecordingFormat) -> Result<(), RecordingError> {
    match format {
        RecordingFormat::ScannerApp => scanner_app::write(dir, recording),
        RecordingFormat::Tum => tum::write(dir, recording),
        RecordingFormat::Nerfstudio => nerfstudio::write(dir, recording),
        RecordingFormat::Record3d => record3d::write(dir, recording),
        RecordingFormat::Polycam => polycam::write(dir, recording),
        RecordingFormat::Stray => stray::write(dir, recording),
        RecordingFormat::Colmap => colmap::write(dir, recording),
        RecordingFormat::SevenScenes => seven_scenes::write(dir, recording),
        RecordingFormat::RealsenseBag | RecordingFormat::Mcap | RecordingFormat::Folders => {
            let reason = format!("{} recordings cannot be written; choose another format", format.name());
            Err(RecordingError::incomplete(dir, reason))
        }
    }
}

/// Selects and decodes frames.
fn load(
    path: &Path,
    format: RecordingFormat,
    index: Index,
    options: &RecordingOptions,
) -> Result<Recording, RecordingError> {
    let Index { up, metric, entries, mut warnings, skipped, reasons } = index;
    let recorded = entries.len();
    require_moving(path, format, &entries)?;
    if !entries.is_empty() && entries.iter().all(|entry| entry.depth.is_none()) {
        warnings.extend(unused_depth(path, format));
    }
    let entries: Vec<_> = entries.into_iter().skip(options.offset).step_by(options.every).collect();
    let with_depth = entries.iter().filter(|e| e.depth.is_some()).count();
    // A few frames without depth would hide that the others have it.
    let only_depth = with_depth > 0 && 2 * with_depth >= entries.len();
    let entries: Vec<_> = entries.into_iter().filter(|e| !only_depth || e.depth.is_some()).collect();
    if entries.len() < 2 {
        let mut reason = format!(
            "{} of {} frames with a pose and an image can be used, at least 2 are needed",
            entries.len(),
            recorded + skipped
        );
        if reasons.is_empty() {
            reason += "; record more frames or use more of them";
        } else {
            reason += &format!(": {}", reasons.join("; "));
        }
        if reasons.iter().any(|reason| reason.contains(index::LOST)) {
            reason += &format!("; {}", format.pose_hint());
        }
        return Err(RecordingError::incomplete(path, reason));
    }
    let kept = select::keyframes(&entries, options.frames)?;
    let frames: Vec<RecordedFrame> =
        kept.par_iter().map(|i| decode::frame(&entries[*i], options.longest_side)).collect::<Result<_, _>>()?;
    let without_depth = |f: &&RecordedFrame| f.view.depth.as_ref().is_some_and(|d| d.counts().iter().all(|c| *c == 0));
    if only_depth && frames.iter().filter(without_depth).count() == frames.len() {
        let reason = "depth is 0 in every frame; check the depth and confidence images, or remove them";
        return Err(RecordingError::incomplete(path, reason));
    }
    if let Some(first) = frames.iter().find(without_depth) {
        let count = frames.iter().filter(without_depth).count();
        warnings.push(format!("{}: {count} depth images are empty, first of {}", path.display(), first.view.name));
    }
    Ok(Recording { format: format.name(), up, metric, frames, recorded, warnings })
}

/// Refuses poses that are all the same, by the cause that the format implies.
fn require_moving(path: &Path, format: RecordingFormat, entries: &[index::Entry]) -> Result<(), RecordingError> {
    let Some(first) = entries.first().map(|entry| entry.world_to_camera) else { return Ok(()) };
    let same = |entry: &index::Entry| {
        let off = entry.world_to_camera * first.inverse();
        off.translation.length() < 1e-9 && off.angle() < 1e-9
    };
    if entries.len() < 2 || !entries.iter().all(same) {
        return Ok(());
    }
    let reason = format!("all {} camera poses are the same: {}", entries.len(), format.pose_hint());
    Err(RecordingError::incomplete(path, reason))
}

/// The warning that files look like depth images where no frame has depth.
fn unused_depth(path: &Path, format: RecordingFormat) -> Option<String> {
    let files = depth_file::lookalikes(path);
    let first = files.first()?;
    Some(format!(
        "{}: no frame has depth although {} files look like depth images, first {first}; {} has {}",
        path.display(),
        files.len(),
        format.name(),
        format.depth_names()
    ))
}
