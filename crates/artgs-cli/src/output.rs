//! Standard output and standard error. A reader that has gone away (`artgs inspect X | head`) is no error.

use crate::commands::Style;
use crate::failure::Failure;
use anyhow::Context;
use artgs_io::run_folder::save_json;
use serde::Serialize;
use serde_json::{Value, json};
use std::borrow::Cow;
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

/// A text without codes that a terminal would obey, as names of files may hold them: control characters, except line breaks
/// and tabs, and marks that change the direction of writing are written as `\u001b`. JSON reads that as the same character.
pub(crate) fn printable(text: &str) -> Cow<'_, str> {
    let is_code = |c: char| {
        (c.is_control() && c != '\n' && c != '\t') || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !text.contains(is_code) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_code(c) { out.push_str(&format!("\\u{:04x}", u32::from(c))) } else { out.push(c) }
    }
    Cow::Owned(out)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terminal_codes_are_written_as_text() {
        assert_eq!(printable("a b\tc\nd"), "a b\tc\nd");
        assert_eq!(printable("x\u{1b}[2J\u{7f}\u{9b}y\u{202e}z\r"), "x\\u001b[2J\\u007f\\u009by\\u202ez\\u000d");
        let json = json!({ "name": "a\u{9b}b" }).to_string();
        let read: Value = serde_json::from_str(&printable(&json)).unwrap();
        assert_eq!(read["name"], "a\u{9b}b");
    }
}
