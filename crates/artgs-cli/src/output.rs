//! Standard output and standard error. A reader that has gone away (`artgs inspect X | head`) is no error.

use crate::failure::Failure;
use crate::printable::printable;
use crate::style::Style;
use anyhow::Context;
use artgs_io::run_folder::save_json;
use serde::Serialize;
use serde_json::{Value, json};
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::path::Path;

/// The result of a command, for people and for programs.
pub(crate) struct Report {
    pub(crate) text: String,
    pub(crate) json: Value,
}

impl Report {
    /// Both forms of a result.
    pub(crate) fn new(result: &(impl Display + Serialize)) -> Result<Self, Failure> {
        let json = serde_json::to_value(result).context("the result has no JSON form")?;
        Ok(Self { text: result.to_string(), json })
    }

    /// Puts one of the forms on standard output.
    pub(crate) fn show(&self, as_json: bool) -> Result<(), Failure> {
        if as_json { say(format!("{:#}", self.json)) } else { say(self.text.trim_end()) }
    }
}

/// Writes a report's JSON form to a file.
pub(crate) fn write_json(path: &Path, report: &Report) -> Result<(), Failure> {
    save_json(path, &report.json).map_err(Failure::failed)
}

/// A line on standard output.
pub(crate) fn say(text: impl Display) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{}", printable(&text.to_string())).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(anyhow::Error::new(error).context("cannot write to standard output").into())
        }
        _ => Ok(()),
    }
}

/// A remark about a result, on standard error so that it never mixes with the result itself.
pub(crate) fn note(text: &str, style: Style) {
    if !style.quiet {
        // The result is what matters.
        let _ = writeln!(io::stderr(), "note: {}", printable(text));
    }
}

/// The message of a command that failed.
pub(crate) fn error(failure: &Failure, json: bool) {
    if json {
        // If this fails, too, the message on standard error remains.
        let _ = say(json!({ "event": "error", "message": failure.to_string() }));
    }
    let _ = writeln!(io::stderr(), "error: {}", printable(&failure.to_string()));
}
