//! Errors in the program itself: one line that names the stage, and an exit code of their own.

use artgs::observer::{Event, Observer};
use std::io::Write;
use std::panic::{self, AssertUnwindSafe, PanicHookInfo};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Exit code after a panic (`EX_SOFTWARE` of sysexits.h).
const CODE: u8 = 70;

/// Stage that is running; empty outside of stages.
static STAGE: Mutex<String> = Mutex::new(String::new());
/// True once a panic was reported: those of other threads follow from it.
static REPORTED: AtomicBool = AtomicBool::new(false);

/// What happened in the first panic, in a process of something else.
static NOTED: Mutex<Option<String>> = Mutex::new(None);

/// Runs the program; a panic becomes one line on standard error and the exit code 70. Files are written under other names
/// and renamed, so that only whole ones remain.
pub(crate) fn guarded(run: impl FnOnce() -> u8) -> u8 {
    panic::set_hook(Box::new(report));
    panic::catch_unwind(AssertUnwindSafe(run)).unwrap_or(CODE)
}

/// To be called once in a process of something else: panics are not printed, but become the error of [`caught`].
pub fn describe_panics() {
    panic::set_hook(Box::new(|panic| {
        if !is_expected() {
            let mut noted = NOTED.lock().unwrap_or_else(PoisonError::into_inner);
            // Panics of other threads follow from the first one.
            noted.get_or_insert_with(|| description(panic));
        }
    }));
}

/// Does something that may panic; the error is the line about the panic, and its exit code.
pub fn caught<T>(run: impl FnOnce() -> T) -> Result<T, (String, u8)> {
    panic::catch_unwind(AssertUnwindSafe(run)).map_err(|_| {
        let noted = NOTED.lock().unwrap_or_else(PoisonError::into_inner).take();
        (noted.unwrap_or_else(|| "artgs itself failed".into()), CODE)
    })
}

/// True for a reader that fails on a damaged file: the panic is caught, and the file reported.
fn is_expected() -> bool {
    #[cfg(feature = "check")]
    let checks = artgs_check::is_reading();
    #[cfg(not(feature = "check"))]
    let checks = false;
    #[cfg(feature = "bench")]
    return checks || artgs_bench::batch::is_reading();
    #[cfg(not(feature = "bench"))]
    return checks;
}

fn report(panic: &PanicHookInfo<'_>) {
    if is_expected() || REPORTED.swap(true, Ordering::SeqCst) {
        return;
    }
    // Nothing more can be done if this fails.
    let _ = writeln!(std::io::stderr(), "error: {}", description(panic));
    if std::env::var_os("RUST_BACKTRACE").is_some_and(|v| v != "0") {
        let _ = writeln!(std::io::stderr(), "{}", std::backtrace::Backtrace::force_capture());
    }
}

/// One line about a panic.
fn description(panic: &PanicHookInfo<'_>) -> String {
    let message = panic.payload_as_str().unwrap_or("no message").lines().next().unwrap_or_default().to_string();
    let place = panic.location().map_or(String::new(), |l| format!(" ({}:{})", file_name(l.file()), l.line()));
    // A panic while the stage changes would block here.
    let stage = STAGE.try_lock().map(|s| s.clone()).unwrap_or_default();
    let during = if stage.is_empty() { String::new() } else { format!(" during {stage}") };
    format!(
        "artgs itself failed{during}: {message}{place}; please report this line with the command and, if possible, the input"
    )
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
