//! Folders of runs and captures: locked, read, and refused in the words of the command line.

use crate::args::Earlier;
use crate::failure::Failure;
use crate::output::note;
use crate::style::Style;
use artgs::run::{Output, OutputError};
use artgs_core::Capture;
use artgs_io::folder_lock::LockNotice;
use artgs_io::{CaptureOptions, FolderLock, RunFolder};
use std::path::{Path, PathBuf};

/// Locks a folder that exists: nobody else writes into it as long as the value exists. Removes what a killed process left.
pub(crate) fn lock(run: &RunFolder, command: &str, style: Style) -> Result<FolderLock, Failure> {
    let lock = artgs::run::lock(run, command).map_err(Failure::of)?;
    mention(lock.notice(), style);
    Ok(lock)
}

/// Locks a folder that exists, of any content.
pub(crate) fn lock_any(folder: &Path, command: &str, style: Style) -> Result<FolderLock, Failure> {
    let lock = FolderLock::take(folder, command).map_err(|error| Failure::of(OutputError::from(error)))?;
    mention(lock.notice(), style);
    Ok(lock)
}

/// Makes a folder ready for a run and locks it; the images of the run are not removed.
pub(crate) fn open(
    run: RunFolder,
    earlier: Earlier,
    photos: Option<&Path>,
    command: &str,
    style: Style,
) -> Result<Output, Failure> {
    let output = Output::open(run, earlier.into(), photos, command).map_err(Failure::of)?;
    mention(output.notice(), style);
    Ok(output)
}

fn mention(notice: Option<&LockNotice>, style: Style) {
    notice.iter().for_each(|notice| note(&notice.to_string(), style));
}

/// Reads a capture.
pub(crate) fn load_capture(folder: &Path) -> Result<Capture, Failure> {
    artgs::prepare::load_capture(folder, &CaptureOptions::default()).map_err(Failure::of)
}

/// The folder with the photos of a run: `named` by the user, or else as the run noted it; none if it does not exist.
pub(crate) fn photos_of(run: &RunFolder, named: Option<&Path>) -> Option<PathBuf> {
    named.map(Path::to_path_buf).or_else(|| run.capture_folder()).filter(|folder| folder.is_dir())
}

/// Refuses a folder without a replica, and says how to get one.
pub(crate) fn require_replica(run: &RunFolder) -> Result<(), Failure> {
    run.require_replica().map_err(Failure::bad_input)
}
