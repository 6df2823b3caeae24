//! One capture of a batch: a run in a process of its own, so that a killed run gives a row, too.

use super::manifest::Entry;
use super::row::Row;
use crate::failure::Failure;
use anyhow::{Context, anyhow};
use artgs_io::digest::tree_digest;
use artgs_io::{FolderLock, RunFolder};
use std::ffi::OsString;
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use sysinfo::{Pid, ProcessRefreshKind, ProcessesToUpdate, System};

/// Time between two looks at the process.
const POLL: Duration = Duration::from_millis(20);
/// Time in which a signal for the whole group of processes reaches this one as well.
const BOTH: Duration = Duration::from_millis(300);
/// Longest reason kept, characters.
const REASON: usize = 1000;

/// What all captures of a batch share.
pub(super) struct Worker<'a> {
    /// Executes `artgs`.
    pub(super) program: &'a Path,
    /// Folder of the batch.
    pub(super) out: &'a Path,
    /// Formats to export to, as `--to` reads them; none: no exports.
    pub(super) formats: Option<&'a str>,
    /// Run captures again whose failure was final.
    pub(super) retry_failed: bool,
    /// Becomes true at Ctrl-C and when the process is to end.
    pub(super) stop: &'a AtomicBool,
}

/// How a process ended.
struct Ended {
    status: ExitStatus,
    /// Its message, empty if it succeeded.
    message: String,
    /// Seconds of all processors that it took; those of the last [`POLL`] are missing.
    cpu_seconds: Option<f64>,
}

impl Worker<'_> {
    /// The row of a capture, and true if it is of an earlier run.
    pub(super) fn run(&self, entry: &Entry) -> Result<(Row, bool), Failure> {
        let run = RunFolder::new(self.out.join("replicas").join(&entry.id));
        let begun = (Instant::now(), SystemTime::now());
        let content = self.content(entry);
        let earlier = Row::load(self.out, &entry.id).filter(|row| {
            row.program == env!("CARGO_PKG_VERSION") && content.as_ref().is_ok_and(|content| *content == row.content)
        });
        if let Some(row) = earlier.as_ref().filter(|row| self.is_final(row, &run)) {
            return Ok((row.clone(), true));
        }
        FolderLock::require_free(run.root()).map_err(|error| Failure::Retry(error.into()))?;
        let mut row = Row {
            id: entry.id.clone(),
            status: "failed".into(),
            program: env!("CARGO_PKG_VERSION").into(),
            content: content.as_ref().ok().cloned().unwrap_or_default(),
            attempts: earlier.map_or(0, |row| row.attempts) + 1,
            started: begun.1.duration_since(UNIX_EPOCH).map_or(0, |t| t.as_secs()),
            ..Row::default()
        };
        match content {
            Err(reason) => row.reason = reason,
            Ok(_) => self.fill(&mut row, entry, &run)?,
        }
        row.seconds = begun.0.elapsed().as_secs_f64();
        row.save(self.out).map_err(Failure::failed)?;
        Ok((row, false))
    }

    fn is_final(&self, row: &Row, run: &RunFolder) -> bool {
        if row.is_done() { run.has_replica() } else { !row.retry && !self.retry_failed }
    }

    /// Hash of the files of a capture, its settings and options; or why they cannot be read.
    fn content(&self, entry: &Entry) -> Result<String, String> {
        let text = format!("{}to={}\n", entry.described(), self.formats.unwrap_or_default());
        tree_digest(&text, &entry.files()).map_err(|error| error.to_string())
    }

    /// Runs what makes the replica and its exports, and adds how it ended.
    fn fill(&self, row: &mut Row, entry: &Entry, run: &RunFolder) -> Result<(), Failure> {
        let mut commands = vec![entry.words(run.root())];
        if let Some(formats) = self.formats {
            let mut words: Vec<OsString> = ["export", "--quiet", "--to", formats, "--"].map(OsString::from).into();
            words.push(run.root().into());
            commands.push(words);
        }
        let log = self.out.join("logs").join(format!("{}.log", row.id));
        for words in commands {
            let ended = self.execute(&words, &log)?;
            row.exit_code = ended.status.code();
            row.cpu_seconds = ended.cpu_seconds.map(|seconds| seconds + row.cpu_seconds.unwrap_or(0.0));
            if !ended.status.success() {
                row.reason = ended.message.chars().take(REASON).collect();
                // Wrong input and errors in the program remain; a full disk, too little memory and a killed process may not.
                row.retry = !matches!(row.exit_code, Some(2 | 3 | 70));
                return Ok(());
            }
        }
        match row.add_results(run) {
            Ok(()) => {
                row.status = "done".into();
                row.replica = Some(format!("replicas/{}", row.id));
            }
            Err(reason) => (row.reason, row.retry) = (reason, true),
        }
        Ok(())
    }

    /// Waits for a process; kills it and fails if this process is to end.
    fn execute(&self, words: &[OsString], log: &Path) -> Result<Ended, Failure> {
        if let Some(folder) = log.parent() {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        }
        let errors = File::create(log).with_context(|| format!("cannot write {}", log.display()))?;
        let mut command = Command::new(self.program);
        command.args(words).stdin(Stdio::null()).stdout(Stdio::null()).stderr(errors);
        let mut child = command.spawn().with_context(|| format!("cannot start {}", self.program.display()))?;
        let mut meter = Meter::new(child.id());
        let status = loop {
            if self.stop.load(Ordering::Relaxed) {
                return Err(interrupted(&mut child));
            }
            meter.read();
            match child.try_wait().context("cannot wait for the run")? {
                Some(status) => break status,
                None => std::thread::sleep(POLL),
            }
        };
        if status.code().is_none() {
            std::thread::sleep(BOTH);
            if self.stop.load(Ordering::Relaxed) {
                return Err(interrupted(&mut child));
            }
        }
        let text = std::fs::read(log).unwrap_or_default();
        let message = if status.success() { String::new() } else { message(status, &String::from_utf8_lossy(&text)) };
        Ok(Ended { status, message, cpu_seconds: meter.seconds })
    }
}

/// Reads the processor time of a process while it runs.
struct Meter {
    process: Pid,
    system: System,
    seconds: Option<f64>,
}

impl Meter {
    fn new(process: u32) -> Self {
        Self { process: Pid::from_u32(process), system: System::new(), seconds: None }
    }

    fn read(&mut self) {
        let what = ProcessRefreshKind::nothing().with_cpu().without_tasks();
        self.system.refresh_processes_specifics(ProcessesToUpdate::Some(&[self.process]), false, what);
        if let Some(process) = self.system.process(self.process) {
            let seconds = process.accumulated_cpu_time() as f64 / 1000.0;
            // A process that has ended has none.
            self.seconds = Some(self.seconds.map_or(seconds, |earlier| earlier.max(seconds)));
        }
    }
}

fn interrupted(child: &mut Child) -> Failure {
    // Errors mean that it has ended.
    let _ = child.kill();
    let _ = child.wait();
    Failure::Interrupted(anyhow!("interrupted; the same command continues"))
}

/// Why a process failed: its message, else how it ended.
fn message(status: ExitStatus, log: &str) -> String {
    let said = log.find("error: ").map(|at| log[at + "error: ".len()..].trim_end()).filter(|text| !text.is_empty());
    said.map_or_else(|| format!("the run ended with {status}"), String::from)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn the_message_of_a_run_follows_its_warnings() {
        use std::os::unix::process::ExitStatusExt;
        let log = "warning: a\nerror: b: no such file\nsecond line\n";
        assert_eq!(message(ExitStatus::from_raw(0x200), log), "b: no such file\nsecond line");
        assert!(message(ExitStatus::from_raw(9), "warning: a\n").contains("signal: 9"));
    }
}
