//! Errors in the program itself: one line that names the stage, and an exit code of their own.

use artgs::observer::{Event, Observer};
use std::io::Write;
use std::panic::{self, AssertUnwindSafe, PanicHookInfo};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code after a panic (`EX_SOFTWARE` of sysexits.h).
const CODE: u8 = 70;

/// Stage that is running; empty outside of stages.
static STAGE: Mutex<String> = Mutex::new(String::new());
/// True once a panic was reported: those of other threads follow from it.
static REPORTED: AtomicBool = AtomicBool::new(false);

/// Runs the program; a panic becomes one line on standard error and the exit code 70. Files are written under other names
/// and renamed, so that only whole ones remain.
pub(crate) fn guarded(run: impl FnOnce() -> ExitCode) -> ExitCode {
    panic::set_hook(Box::new(report));
    panic::catch_unwind(AssertUnwindSafe(run)).unwrap_or(ExitCode::from(CODE))
}

fn report(panic: &PanicHookInfo<'_>) {
    // A reader that fails on a damaged export is caught, and the check reports the file.
    #[cfg(feature = "check")]
    if artgs_check::is_reading() {
        return;
    }
    if REPORTED.swap(true, Ordering::SeqCst) {
        return;
    }
    let message = panic.payload_as_str().unwrap_or("no message").lines().next().unwrap_or_default().to_string();
    let place = panic.location().map_or(String::new(), |l| format!(" ({}:{})", file_name(l.file()), l.line()));
    // A panic while the stage changes would block here.
    let stage = STAGE.try_lock().map(|s| s.clone()).unwrap_or_default();
    let during = if stage.is_empty() { String::new() } else { format!(" during {stage}") };
    // Nothing more can be done if this fails.
    let _ = writeln!(
        std::io::stderr(),
        "error: artgs itself failed{during}: {message}{place}; please report this line with the command and, if possible, \
         the input"
    );
    if std::env::var_os("RUST_BACKTRACE").is_some_and(|v| v != "0") {
        let _ = writeln!(std::io::stderr(), "{}", std::backtrace::Backtrace::force_capture());
    }
}

/// The last component of a path of source code.
fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

/// Notes the running stage for the report of a panic.
pub(crate) struct StageNote;

impl Observer for StageNote {
    fn event(&mut self, event: Event) {
        let Ok(mut stage) = STAGE.lock() else { return };
        match event {
            Event::StageStarted { stage: name } => *stage = name.into_owned(),
            Event::StageFinished { .. } => stage.clear(),
            _ => {}
        }
    }
}
