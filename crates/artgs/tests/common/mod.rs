//! Runs as tests start them.

use artgs::fit::Devices;
use artgs::observer::Observer;
use artgs::{Config, Error, Reconstruction, Summary};
use artgs_core::Capture;
use artgs_io::RunFolder;
use std::path::Path;

/// Reconstructs into a folder.
pub(crate) fn reconstruct(
    capture: &Capture,
    out: &Path,
    config: &Config,
    resume: bool,
    devices: &dyn Devices,
    observer: &mut dyn Observer,
) -> Result<Summary, Error> {
    let reconstruction = Reconstruction { config: config.clone(), devices, resume, ..Reconstruction::new(capture) };
    Ok(reconstruction.run_in(&RunFolder::new(out), observer)?.summary)
}
