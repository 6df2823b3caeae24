//! The command `artgs` of the package: the program itself.

use pyo3::prelude::*;
use std::ffi::OsString;
use std::path::PathBuf;

/// Executes a command line as the program does, on the streams of the process, and returns its exit code. `program` executes
/// `artgs` when it is started.
#[pyfunction]
pub(crate) fn command(py: Python<'_>, program: PathBuf, words: Vec<OsString>) -> u8 {
    py.detach(|| artgs_cli::command(&program, words))
}
