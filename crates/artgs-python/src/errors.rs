//! Errors as Python exceptions.

use artgs::Error;
use artgs::fit::FitError;
use artgs::prepare::{InputError, MemoryError, PrepareError};
use artgs::run::OutputError;
use pyo3::prelude::*;
use std::fmt::Display;

/// Why a call did not finish: the message, and the exit code that the program ends with for the same reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct CallError {
    message: String,
    exit_code: u8,
}

impl CallError {
    /// The user interrupted it.
    pub(crate) fn interrupted() -> Self {
        Self { message: "interrupted".into(), exit_code: 130 }
    }

    /// Something that the caller must change.
    pub(crate) fn input(message: impl Display) -> Self {
        Self { message: message.to_string(), exit_code: 2 }
    }

    /// Anything else.
    pub(crate) fn failed(message: impl Display) -> Self {
        Self { message: message.to_string(), exit_code: 1 }
    }

    /// An error of the program itself.
    pub(crate) fn internal(message: impl Display) -> Self {
        Self { message: message.to_string(), exit_code: 70 }
    }
}

/// A whole number of Python as one of the library, or why not.
pub(crate) fn whole<T: TryFrom<i64>>(name: &str, number: Option<i64>) -> Result<Option<T>, CallError> {
    let wrong = |n: i64| {
        CallError::input(format!("`{name}` is {n}; give a whole number that is not negative, or a smaller one"))
    };
    number.map(|n| T::try_from(n).map_err(|_| wrong(n))).transpose()
}

/// A message with an exit code of the program.
impl From<(String, u8)> for CallError {
    fn from((message, exit_code): (String, u8)) -> Self {
        Self { message, exit_code }
    }
}

/// An error of the library with the arguments that are its remedy.
impl From<Error> for CallError {
    fn from(error: Error) -> Self {
        Self::input(match &error {
            Error::Prepare(reason) => match &**reason {
                PrepareError::Contradiction(what) => format!("{what}\n`force_input=True` uses the capture as it is"),
                PrepareError::Memory(MemoryError::Allowed { .. }) => format!("`memory`: {error}"),
                PrepareError::Input(InputError::OneState { .. }) => {
                    format!("{error}: reconstruct(closed, open, out=...)")
                }
                _ => error.to_string(),
            },
            Error::Output(OutputError::Earlier(folder)) => {
                let shown = folder.display();
                format!("{shown} holds an earlier run; `resume=True` continues it, `force=True` discards it")
            }
            Error::Fit(FitError::Device(_)) => {
                return Self::failed(format!("{error}; with `device=\"auto\"` training would continue on the CPU"));
            }
            _ if error.is_bad_input() => error.to_string(),
            _ => return Self::failed(error),
        })
    }
}

impl From<PrepareError> for CallError {
    fn from(error: PrepareError) -> Self {
        Error::from(error).into()
    }
}

/// The exception of an error; the classes are those of `artgs._errors`.
pub(crate) fn exception(py: Python<'_>, error: &CallError) -> PyErr {
    let made =
        py.import("artgs._errors").and_then(|m| m.getattr("of_exit_code")?.call1((error.exit_code, &error.message)));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// The exception for something that the caller must change.
pub(crate) fn bad_input(py: Python<'_>, message: impl Display) -> PyErr {
    exception(py, &CallError::input(message))
}
