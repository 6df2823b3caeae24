//! Commands for bindings to other languages: no terminal, progress to an observer, results as JSON.

use crate::args::{Cli, Command};
use crate::commands::{self, Style};
use crate::crash::caught;
use crate::failure::Failure;
use crate::{evaluate, export, reconstruct};
use artgs::observer::{Event, Observer, until_stopped};
use artgs_core::Capture;
use clap::Parser;
use serde_json::Value;
use std::ffi::OsString;
use std::sync::atomic::AtomicBool;

const STYLE: Style = Style { json: false, quiet: true, silent: true };

/// Why a command did not finish: what the program prints after `error: `, and the exit code that it ends with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CallError {
    /// The message.
    pub message: String,
    /// 1, 2, 3, 70 or 130.
    pub exit_code: u8,
}

/// How a command ended.
pub type Done = Result<Value, CallError>;

/// Executes a command on this thread and the thread pool that it belongs to; `--threads` is ignored. `words` follow the name of
/// the program. `given` is a capture in memory for `reconstruct`, instead of the folder that the words name. When `stop` becomes true, the
/// command ends at its next report of progress with exit code 130; a run can be resumed then.
///
/// The result is what `--json` prints: of `reconstruct` the summary, or with `--stop-after` the parts; of `check` an object with `passed`
/// and `report`; of `inspect`, `export` and `evaluate` their report. Other commands have no result.
pub fn call(
    words: &[OsString],
    given: Option<Capture>,
    observer: &mut (dyn Observer + Send),
    stop: &AtomicBool,
) -> Done {
    let run = || until_stopped(stop, observer, |observer| executed(words, given, observer));
    match caught(run) {
        Ok(Some(Ok(value))) => Ok(value),
        Ok(Some(Err(failure))) => Err(CallError { message: failure.to_string(), exit_code: failure.exit_code() }),
        Ok(None) => Err(CallError { message: "interrupted".into(), exit_code: 130 }),
        Err((message, exit_code)) => Err(CallError { message, exit_code }),
    }
}

fn executed(words: &[OsString], given: Option<Capture>, observer: &mut dyn Observer) -> Result<Value, Failure> {
    let cli = Cli::try_parse_from(std::iter::once(&OsString::from("artgs")).chain(words)).map_err(usage)?;
    let mut remark = |text: &str| observer.event(Event::warning(text));
    match &cli.command {
        Command::Reconstruct(args) => reconstruct::call(args, given, STYLE, observer),
        Command::Export(args) => Ok(export::report(args, STYLE, &mut remark)?.json),
        Command::Evaluate(args) => Ok(evaluate::scores(args, &mut remark)?.json),
        #[cfg(feature = "check")]
        Command::Check(args) => {
            let checked = crate::check::checked(args)?;
            Ok(serde_json::json!({ "passed": checked.passed, "report": checked.report.json }))
        }
        Command::Inspect(args) => {
            Ok(commands::described(args)?.into_iter().map(|inspected| inspected.report.json).collect())
        }
        _ => commands::execute(&cli.command, STYLE).map(|()| Value::Null),
    }
}

/// The message of a wrong command line without the parts that a terminal is needed for.
fn usage(error: clap::Error) -> Failure {
    let text = error.to_string();
    let text = text.strip_prefix("error: ").unwrap_or(&text);
    Failure::bad(
        text.split("\n\nUsage:").next().unwrap_or(text).split("\n\nFor more").next().unwrap_or(text).trim_end(),
    )
}
