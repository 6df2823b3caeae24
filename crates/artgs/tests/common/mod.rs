//! Runs as tests start them.

use artgs::fit::Devices;
use artgs::observer::Observer;
use artgs::{Config, Error, Prepared, Reconstruction, Summary};
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
    let prepared = Prepared::as_is(capture.clone()).with_config(config.clone());
    let reconstruction = Reconstruction { prepared: &prepared, devices, resume };
    Ok(reconstruction.run_in(&RunFolder::new(out), observer)?.summary)
}
