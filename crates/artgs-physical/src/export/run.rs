//! The export of a run's folder: its lock, its photos, which way is up.

use super::{ExportError, ExportEvent, ExportOptions, export};
use crate::Up;
use artgs_core::{Capture, UpSource, Upward};
use artgs_io::export_report::ExportReport;
use artgs_io::folder_lock::FolderLock;
use artgs_io::{RunFolder, load_capture};
use glam::DVec3;
use std::path::Path;

/// Exports the replica in a folder with the photos of its run, while nobody else writes there; `command` is what others read meanwhile.
/// The object is upright: `up` is the given direction, none: what the run found out; `up` of the options is replaced.
pub fn export_run(
    folder: &RunFolder,
    options: ExportOptions,
    up: Option<Up>,
    command: &str,
    mut watch: impl FnMut(ExportEvent<'_>),
) -> Result<ExportReport, ExportError> {
    options.check()?;
    folder.require_replica()?;
    let known = upward(folder, up)?;
    let options =
        ExportOptions { up: Up::towards(known.direction).or(up).unwrap_or_default(), up_known: Some(known), ..options };
    options.config()?;
    if known.source == UpSource::Assumed {
        let text = format!("up is assumed to be {} of the capture; --up gives another direction", options.up);
        watch(ExportEvent::Warning(&text));
    }
    let lock = FolderLock::take(folder.root(), command)?;
    if let Some(notice) = lock.notice() {
        watch(ExportEvent::Warning(&notice.to_string()));
    }
    folder.remove_leftovers().map_err(ExportError::Output)?;
    export_with_photos(folder, &options, watch)
}

/// Exports with the photos that the options name, or else those of the run, where there are any. The folder is locked by the caller.
pub fn export_with_photos(
    folder: &RunFolder,
    options: &ExportOptions,
    mut watch: impl FnMut(ExportEvent<'_>),
) -> Result<ExportReport, ExportError> {
    options.config()?;
    folder.require_replica()?;
    let (photos, odd) = photos(folder, options.capture.as_deref())?;
    odd.iter().for_each(|text| watch(ExportEvent::Warning(text)));
    export(folder, options, photos.as_ref(), watch)
}

/// The photos of the replica, in the folder that the user named, or else where the run found them; and what is odd about them.
fn photos(folder: &RunFolder, named: Option<&Path>) -> Result<(Option<Capture>, Option<String>), ExportError> {
    const COLORS: &str = "textures hold the colours of the meshes; see --capture";
    let read = match (named, folder.capture_folder().filter(|photos| photos.is_dir())) {
        (Some(named), _) => load_capture(named)?,
        (None, None) => return Ok((None, Some(format!("the photos are not where they were: {COLORS}")))),
        (None, Some(found)) => match load_capture(&found) {
            Ok(read) => read,
            Err(error) => return Ok((None, Some(format!("the photos cannot be read ({error}): {COLORS}")))),
        },
    };
    let other = folder.is_of(&read) == Some(false);
    let odd = other.then(|| "the capture is not the one the replica was made of: textures may not fit".into());
    Ok((Some(read), odd))
}

/// Which way is up in the world of a run's replica: as given, or as its reconstruction found out. An error where neither is
/// certain.
pub fn upward(folder: &RunFolder, given: Option<Up>) -> Result<Upward, ExportError> {
    if let Some(up) = given {
        return Ok(Upward { direction: up.direction(), source: UpSource::Option, confidence: 1.0 });
    }
    let replica = artgs_io::read_replica(folder.root())?;
    match replica.up {
        Some(up) if up.is_certain() => Ok(up),
        Some(_) => Err(ExportError::UnknownUp),
        None => Ok(Upward { direction: DVec3::Z, source: UpSource::Assumed, confidence: Upward::CERTAIN }),
    }
}
