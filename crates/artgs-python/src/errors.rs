//! Errors as Python exceptions, with the message of the command.

use artgs_cli::CallError;
use pyo3::prelude::*;
use std::fmt::Display;

/// The exception for the exit code of a command; the classes are those of `artgs._errors`.
pub(crate) fn exception(py: Python<'_>, error: &CallError) -> PyErr {
    let made =
        py.import("artgs._errors").and_then(|m| m.getattr("of_exit_code")?.call1((error.exit_code, &error.message)));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// The exception for something that the caller must change.
pub(crate) fn bad_input(py: Python<'_>, message: impl Display) -> PyErr {
    exception(py, &CallError { message: message.to_string(), exit_code: 2 })
}
