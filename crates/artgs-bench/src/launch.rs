//! Executes one run as a child process, so that its memory, time and crashes are separate.

use crate::measure::Measure;
use serde_json::Value;
use std::ffi::OsString;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time between checks of a child process.
const POLL: Duration = Duration::from_millis(50);
/// Longest reason kept, characters.
const REASON: usize = 400;

/// Program that executes runs and function that measures them.
#[derive(Clone)]
pub struct Tools {
    /// Path of an `artgs` executable.
    pub program: PathBuf,
    /// Measures finished runs.
    pub measure: Measure,
}

/// How a child process ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    Success,
    Failed(String),
    /// Killed because the benchmark was stopped.
    Stopped,
}

impl Tools {
    /// Runs the program with both its streams in `log`, until it ends, `limit` has passed or `stop` is set.
    pub(crate) fn run(&self, args: &[OsString], log: &Path, limit: Option<Duration>, stop: &AtomicBool) -> Ended {
        let mut child = match self.start(args, log) {
            Ok(child) => child,
            Err(error) => return Ended::Failed(format!("{} cannot be started: {error}", self.program.display())),
        };
        let start = Instant::now();
        loop {
            if stop.load(Ordering::Relaxed) {
                kill(&mut child);
                return Ended::Stopped;
            }
            match child.try_wait() {
                Ok(Some(status)) if status.success() => return Ended::Success,
                Ok(Some(status)) => return Ended::Failed(reason(status, log)),
                Ok(None) => {}
                Err(error) => {
                    kill(&mut child);
                    return Ended::Failed(format!("cannot be waited for: {error}"));
                }
            }
            if let Some(limit) = limit.filter(|limit| start.elapsed() > *limit) {
                kill(&mut child);
                return Ended::Failed(format!("stopped after the time limit of {} s", limit.as_secs_f64()));
            }
            std::thread::sleep(POLL);
        }
    }

    fn start(&self, args: &[OsString], log: &Path) -> io::Result<Child> {
        if let Some(folder) = log.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let out = File::create(log)?;
        let err = out.try_clone()?;
        let mut command = Command::new(&self.program);
        command.args(args).stdin(Stdio::null()).stdout(out).stderr(err);
        // With its own group, Ctrl-C on a terminal reaches only the benchmark, which then knows that the child did not fail.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command.spawn()
    }
}

/// Errors are ignored: they mean that the child has already ended.
fn kill(child: &mut Child) {
    let _ = child.kill();
    let _ = child.wait();
}

fn reason(status: ExitStatus, log: &Path) -> String {
    let bytes = std::fs::read(log).unwrap_or_default();
    let message = last_message(&String::from_utf8_lossy(&bytes));
    let how = how_ended(status);
    if message.is_empty() { how } else { format!("{how}: {message}") }
}

#[cfg(unix)]
fn how_ended(status: ExitStatus) -> String {
    use std::os::unix::process::ExitStatusExt;
    match status.signal() {
        Some(9) => "killed by signal 9, which is what a system out of memory does".into(),
        Some(signal) => format!("crashed with signal {signal}"),
        None => exit_code(status),
    }
}

#[cfg(not(unix))]
fn how_ended(status: ExitStatus) -> String {
    exit_code(status)
}

fn exit_code(status: ExitStatus) -> String {
    status.code().map_or_else(|| "ended without an exit code".into(), |code| format!("exit code {code}"))
}

/// The message of the last error event; else of a panic; else the last line.
fn last_message(log: &str) -> String {
    let error = log.lines().rev().find_map(|line| {
        let event: Value = serde_json::from_str(line).ok()?;
        (event["event"] == "error").then(|| event["message"].as_str().map(String::from))?
    });
    let panic = || {
        let mut lines = log.lines().skip_while(|l| !l.contains("panicked at"));
        let place = lines.next()?;
        Some(format!("{place} {}", lines.next().unwrap_or_default()))
    };
    let last = || log.lines().rev().find(|l| !l.trim().is_empty()).unwrap_or_default().to_string();
    let message = error.or_else(panic).unwrap_or_else(last);
    let message: String = message.split_whitespace().collect::<Vec<_>>().join(" ");
    message.chars().take(REASON).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tools(program: &str) -> Tools {
        let measure = std::sync::Arc::new(|_: &Path, _: &Path| Err("nothing is measured here".to_string()));
        Tools { program: program.into(), measure }
    }

    fn shell(script: &str, limit: Option<Duration>, stop: bool) -> (Ended, String) {
        let dir = tempfile::tempdir().unwrap();
        let log = dir.path().join("a/log.txt");
        let tools = tools("sh");
        let args = ["-c".into(), script.into()];
        let ended = tools.run(&args, &log, limit, &AtomicBool::new(stop));
        (ended, std::fs::read_to_string(&log).unwrap())
    }

    #[test]
    fn success_and_output_are_kept() {
        let (ended, log) = shell("echo out; echo err >&2", None, false);
        assert_eq!(ended, Ended::Success);
        assert!(log.contains("out") && log.contains("err"));
    }

    #[test]
    fn failures_have_a_reason() {
        let bad = |script: &str| match shell(script, None, false).0 {
            Ended::Failed(reason) => reason,
            other => panic!("{other:?}"),
        };
        assert_eq!(bad("exit 3"), "exit code 3");
        assert_eq!(bad("echo one; echo two; exit 1"), "exit code 1: two");
        let events = r#"echo '{"event":"error","message":"no depth"}'; echo later; exit 2"#;
        assert_eq!(bad(events), "exit code 2: no depth");
        let panic = "echo \"thread 'main' panicked at a.rs:1:\"; echo 'index 9'; echo note; exit 101";
        assert_eq!(bad(panic), "exit code 101: thread 'main' panicked at a.rs:1: index 9");
        assert!(bad("kill -9 $$").contains("out of memory"));
        assert!(bad("kill -6 $$").contains("signal 6"));
        let nowhere = tools("/nowhere/artgs");
        let dir = tempfile::tempdir().unwrap();
        let ended = nowhere.run(&[], &dir.path().join("log"), None, &AtomicBool::new(false));
        assert!(matches!(ended, Ended::Failed(reason) if reason.contains("/nowhere/artgs")));
    }

    #[test]
    fn slow_and_unwanted_children_are_killed() {
        let start = Instant::now();
        let (ended, _) = shell("sleep 60", Some(Duration::from_millis(200)), false);
        assert!(matches!(ended, Ended::Failed(reason) if reason.contains("time limit of 0.2 s")));
        assert_eq!(shell("sleep 60", None, true).0, Ended::Stopped);
        assert!(start.elapsed() < Duration::from_secs(20));
    }
}
