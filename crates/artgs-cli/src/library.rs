//! Where the command line meets the libraries: their types end here.

use crate::args::Preset;
use crate::failure::Failure;
use crate::output::Report;
use artgs::observer::Observer;
use std::path::{Path, PathBuf};

/// What the command line says about the method.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    pub(crate) preset: Preset,
    pub(crate) file: Option<PathBuf>,
    pub(crate) parts: Option<usize>,
    pub(crate) seed: Option<u64>,
}

/// The complete configuration of a run.
pub(crate) type Config = Settings;

/// What a capture contains.
pub(crate) fn inspect(capture: &Path) -> Result<Report, Failure> {
    let capture = artgs_io::load_capture(capture).map_err(|error| Failure::BadInput(error.into()))?;
    Report::new(&artgs_io::summarize(&capture))
}

/// The preset, overridden by the file, overridden by the flags.
pub(crate) fn configure(settings: &Settings) -> Result<Config, Failure> {
    if let Some(file) = &settings.file {
        std::fs::read_to_string(file).map_err(|e| Failure::bad(format!("{}: {e}", file.display())))?;
    }
    Ok(settings.clone())
}

/// Runs the method on a capture; files go to `out`.
pub(crate) fn reconstruct(
    capture: &Path,
    out: &Path,
    config: &Config,
    resume: bool,
    observer: &mut dyn Observer,
) -> Result<Report, Failure> {
    let _ = (capture, out, config.preset.name(), config.parts, config.seed, resume, observer);
    Err(anyhow::anyhow!("the method is not built into this program").into())
}

/// Scores a replica against the truth.
pub(crate) fn evaluate(out: &Path, gt: &Path) -> Result<Report, Failure> {
    let _ = (out, gt);
    Err(anyhow::anyhow!("the scores are not built into this program").into())
}
