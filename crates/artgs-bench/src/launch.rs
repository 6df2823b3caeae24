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
use sysinfo::{Pid, ProcessRefreshKind, ProcessesToUpdate, System};

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

/// How a child process ended, and what it took.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Exit {
    pub(crate) ended: Ended,
    /// Its exit code; none if it was killed or not started.
    pub(crate) code: Option<i32>,
    /// Time of all processors together, seconds; 0 if unknown. That of the last [`POLL`] is missing.
    pub(crate) cpu_seconds: f64,
    /// Largest resident memory, MiB; 0 if unknown.
    pub(crate) peak_memory_mib: f64,
}

impl Tools {
    /// Runs the program with both its streams in `log`, until it ends, `limit` has passed or `stop` is set.
    pub(crate) fn run(&self, args: &[OsString], log: &Path, limit: Option<Duration>, stop: &AtomicBool) -> Ended {
        execute(&self.program, args, log, limit, stop).ended
    }
}

/// Runs a program with both its streams in `log`, until it ends, `limit` has passed or `stop` is set.
pub(crate) fn execute(
    program: &Path,
    args: &[OsString],
    log: &Path,
    limit: Option<Duration>,
    stop: &AtomicBool,
) -> Exit {
    let mut child = match start(program, args, log) {
        Ok(child) => child,
        Err(error) => {
            let ended = Ended::Failed(format!("{} cannot be started: {error}", program.display()));
            return Exit { ended, code: None, cpu_seconds: 0.0, peak_memory_mib: 0.0 };
        }
    };
    let mut meter = Meter::new(child.id());
    let begun = Instant::now();
    let (ended, code) = loop {
        if stop.load(Ordering::Relaxed) {
            kill(&mut child);
            break (Ended::Stopped, None);
        }
        meter.read();
        match child.try_wait() {
            Ok(Some(status)) if status.success() => break (Ended::Success, status.code()),
            Ok(Some(status)) => break (Ended::Failed(reason(status, log)), status.code()),
            Ok(None) => {}
            Err(error) => {
                kill(&mut child);
                break (Ended::Failed(format!("cannot be waited for: {error}")), None);
            }
        }
        if let Some(limit) = limit.filter(|limit| begun.elapsed() > *limit) {
            kill(&mut child);
            break (Ended::Failed(format!("stopped after the time limit of {} s", limit.as_secs_f64())), None);
        }
        std::thread::sleep(POLL);
    };
    Exit { ended, code, cpu_seconds: meter.cpu_seconds, peak_memory_mib: meter.peak_memory_mib }
}

fn start(program: &Path, args: &[OsString], log: &Path) -> io::Result<Child> {
    if let Some(folder) = log.parent() {
        std::fs::create_dir_all(folder)?;
    }
    let out = File::create(log)?;
    let err = out.try_clone()?;
    let mut command = Command::new(program);
    command.args(args).stdin(Stdio::null()).stdout(out).stderr(err);
    // With its own group, Ctrl-C on a terminal reaches only the benchmark, which then knows that the child did not fail.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command.spawn()
}

/// Reads what a process takes while it runs: one that has ended has neither time nor memory.
struct Meter {
    process: Pid,
    system: System,
    cpu_seconds: f64,
    peak_memory_mib: f64,
}

impl Meter {
    fn new(process: u32) -> Self {
        Self { process: Pid::from_u32(process), system: System::new(), cpu_seconds: 0.0, peak_memory_mib: 0.0 }
    }

    fn read(&mut self) {
        let what = ProcessRefreshKind::nothing().with_cpu().with_memory().without_tasks();
        self.system.refresh_processes_specifics(ProcessesToUpdate::Some(&[self.process]), false, what);
        if let Some(process) = self.system.process(self.process) {
            self.cpu_seconds = self.cpu_seconds.max(process.accumulated_cpu_time() as f64 / 1000.0);
            let memory = process.memory() as f64 / 1024.0 / 1024.0;
            self.peak_memory_mib = self.peak_memory_mib.max(memory);
        }
        self.peak_memory_mib = self.peak_memory_mib.max(highest_memory_mib(self.process).unwrap_or(0.0));
    }
}

/// Largest resident memory of a process so far, MiB; only Linux reports it. Elsewhere the samples have to do.
fn highest_memory_mib(process: Pid) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().trim_end_matches("kB").trim().parse::<f64>().ok()? / 1024.0)
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
    fn the_exit_code_and_what_a_run_took_are_kept() {
        let dir = tempfile::tempdir().unwrap();
        let work = "i=0; while [ $i -lt 200000 ]; do i=$((i+1)); done; sleep 0.2; exit 2";
        let args = ["-c".into(), work.into()];
        let exit = execute(Path::new("sh"), &args, &dir.path().join("log"), None, &AtomicBool::new(false));
        assert_eq!(exit.code, Some(2));
        if cfg!(target_os = "linux") {
            assert!(exit.cpu_seconds > 0.0 && exit.peak_memory_mib > 0.1, "{exit:?}");
        }
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
