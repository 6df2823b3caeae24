//! Captures of procedural objects.

use crate::errors::{CallError, whole};
use crate::work::work;
use artgs::run::OutputError;
use artgs_io::FolderLock;
use artgs_synth::target::{Kind, TargetError, require_free, targets};
use artgs_synth::{CaptureOptions, SynthError, write_object};
use pyo3::prelude::*;
use std::path::PathBuf;

/// The arguments of a capture, of a dictionary of Python.
#[derive(Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct SynthArguments {
    views: Option<i64>,
    test_views: Option<i64>,
    size: Option<i64>,
    seed: i64,
    noise: Vec<String>,
    force: bool,
}

/// Renders the capture of an object, or of every object of a suite, into a folder.
#[pyfunction]
pub(crate) fn synth(py: Python<'_>, what: String, out: PathBuf, arguments: SynthArguments) -> PyResult<()> {
    work(py, None, None, move |_| {
        let SynthArguments { views, test_views, size, seed, noise, force } = arguments;
        let default = CaptureOptions::default();
        let mut options = CaptureOptions {
            views: whole("views", views)?.unwrap_or(default.views),
            test_views: whole("test_views", test_views)?.unwrap_or(default.test_views),
            size: whole("size", size)?.unwrap_or(default.size),
            seed: whole("seed", Some(seed))?.unwrap_or(default.seed),
            ..default
        };
        for setting in &noise {
            options.degradation.set(setting).map_err(CallError::input)?;
        }
        options.check().map_err(CallError::input)?;
        let targets = targets(&what, &out).map_err(CallError::input)?;
        for (_, folder) in &targets {
            require_free(Kind::Capture, folder, force).map_err(|error| match error {
                TargetError::Foreign(_) => {
                    CallError::input(format!("{error}, or give `force=True`, which writes among them"))
                }
                _ => CallError::input(error),
            })?;
        }
        for (name, folder) in &targets {
            std::fs::create_dir_all(folder)
                .map_err(|error| CallError::failed(format!("cannot create {}: {error}", folder.display())))?;
            let _lock = FolderLock::take(folder, "artgs in Python")
                .map_err(|error| artgs::Error::from(OutputError::from(error)))?;
            write_object(name, &options, folder).map_err(|error| match error {
                SynthError::File(_) => CallError::failed(error),
                _ => CallError::input(error),
            })?;
        }
        Ok(())
    })
}
