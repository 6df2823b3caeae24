//! How stages report: they pass events to an [`Observer`] and never print.

use artgs_core::Splats;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Something that happened during a run. As JSON: an object whose key `event` names the variant in snake case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// A stage begins.
    StageStarted {
        /// Name of the stage.
        stage: Cow<'static, str>,
    },
    /// A stage is `step` of `total` steps along.
    Progress {
        /// Name of the stage.
        stage: Cow<'static, str>,
        /// Steps done.
        step: usize,
        /// Steps there will be; 0 where that is not known.
        total: usize,
        /// Value that the stage minimises.
        loss: Option<f64>,
        /// Peak signal-to-noise ratio on training pixels, dB.
        psnr: Option<f64>,
        /// Number of Gaussians.
        gaussians: Option<usize>,
    },
    /// A stage is complete and its files are written.
    StageFinished {
        /// Name of the stage.
        stage: Cow<'static, str>,
        /// Wall-clock time, seconds.
        seconds: f64,
        /// True if the result of an earlier run was loaded instead of computing.
        reused: bool,
    },
    /// Something is unexpected, and the run continues.
    Warning {
        /// What, where, and what to do about it.
        message: String,
    },
    /// Something worth knowing.
    Note {
        /// One sentence.
        message: String,
    },
}

impl Event {
    /// A stage begins.
    pub fn started(stage: &'static str) -> Self {
        Self::StageStarted { stage: stage.into() }
    }

    /// A stage is `step` of `total` steps along; numbers that only some stages have are added by the caller.
    pub fn progress(stage: &'static str, step: usize, total: usize) -> Self {
        Self::Progress { stage: stage.into(), step, total, loss: None, psnr: None, gaussians: None }
    }

    /// A stage is complete.
    pub fn finished(stage: &'static str, seconds: f64, reused: bool) -> Self {
        Self::StageFinished { stage: stage.into(), seconds, reused }
    }

    /// Something is unexpected.
    pub fn warning(message: impl Into<String>) -> Self {
        Self::Warning { message: message.into() }
    }

    /// Something worth knowing.
    pub fn note(message: impl Into<String>) -> Self {
        Self::Note { message: message.into() }
    }
}

/// Takes the share of a stage's work that is done, 0 to 1.
pub type Share<'a> = &'a mut dyn FnMut(f64);

/// A part of the work behind `done`, from the share `from` to the share `to`.
pub(crate) fn within<'a>(done: Share<'a>, from: f64, to: f64) -> impl FnMut(f64) + 'a {
    move |share| done(from + (to - from) * share)
}

/// Reports shares of a stage as steps of 100.
pub fn percent<'a>(observer: &'a mut dyn Observer, stage: &'static str) -> impl FnMut(f64) + 'a {
    /// Steps of a stage that has no steps of its own.
    const STEPS: usize = 100;
    move |share| {
        let step = (share.clamp(0.0, 1.0) * STEPS as f64) as usize;
        observer.event(Event::progress(stage, step, STEPS));
    }
}

/// The state of training between two steps.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot<'a> {
    /// Name of the stage.
    pub stage: &'static str,
    /// Steps done.
    pub step: usize,
    /// Steps there will be.
    pub total: usize,
    /// Gaussians, capture's frame: canonical ones, or in the stage `single` those of the state that is being fitted.
    pub splats: &'a Splats,
    /// Part of each, `[n]`; empty where parts are not looked for.
    pub labels: &'a [u16],
}

/// Receives the events of a run, in order, on the thread that runs it.
pub trait Observer {
    /// Takes one event. Must return quickly: stages call it between optimiser steps.
    fn event(&mut self, event: Event);

    /// True if training is to pause for [`Observer::snapshot`]; asked after every step. Stays true until it was called.
    fn wants_snapshot(&mut self) -> bool {
        false
    }

    /// Takes a look at the Gaussians. Training waits meanwhile.
    fn snapshot(&mut self, _: &Snapshot<'_>) {}
}

/// Ignores everything.
#[derive(Clone, Copy, Debug, Default)]
pub struct NullObserver;

impl Observer for NullObserver {
    fn event(&mut self, _: Event) {}
}

/// Keeps everything.
impl Observer for Vec<Event> {
    fn event(&mut self, event: Event) {
        self.push(event);
    }
}

/// Hands every event to two observers, the first one first, and snapshots to those that want them.
pub struct Tee<'a>(pub &'a mut dyn Observer, pub &'a mut dyn Observer);

impl Observer for Tee<'_> {
    fn event(&mut self, event: Event) {
        self.0.event(event.clone());
        self.1.event(event);
    }

    fn wants_snapshot(&mut self) -> bool {
        self.0.wants_snapshot() || self.1.wants_snapshot()
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        for observer in [&mut *self.0, &mut *self.1] {
            if observer.wants_snapshot() {
                observer.snapshot(snapshot);
            }
        }
    }
}

/// Does something that reports to an observer, `also`, and ends it at its next report, or step of training, after `stop` has
/// become true: then the result is none. Files of a run are replaced as a whole, so it can be resumed. Needs unwinding panics.
pub fn until_stopped<T>(
    stop: &AtomicBool,
    also: &mut dyn Observer,
    work: impl FnOnce(&mut dyn Observer) -> T,
) -> Option<T> {
    let mut stopper = Stopper(stop, also);
    // What the work leaves incomplete is dropped with it.
    catch_unwind(AssertUnwindSafe(|| work(&mut stopper)))
        .map_err(|payload| if payload.is::<Stopped>() { payload } else { resume_unwind(payload) })
        .ok()
}

/// What a stage is left with.
struct Stopped;

/// Leaves the stage that reports to it once it is to stop: stages have no other way out of their inner loops. No message is
/// printed, because the panic hook is not called.
struct Stopper<'a>(&'a AtomicBool, &'a mut dyn Observer);

impl Stopper<'_> {
    fn check(&self) {
        if self.0.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Stopped));
        }
    }
}

impl Observer for Stopper<'_> {
    fn event(&mut self, event: Event) {
        self.check();
        self.1.event(event);
    }

    fn wants_snapshot(&mut self) -> bool {
        self.check();
        self.1.wants_snapshot()
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        self.1.snapshot(snapshot);
    }
}

/// Writes one JSON object per line and flushes after each, so that a reader can follow a run.
/// Numbers that are not finite become `null`.
#[derive(Debug)]
pub struct JsonLines<W: Write> {
    sink: W,
    failure: Option<io::Error>,
}

impl JsonLines<File> {
    /// Appends to a file, which is created if it does not exist.
    pub fn append(path: &Path) -> io::Result<Self> {
        Ok(Self::new(OpenOptions::new().create(true).append(true).open(path)?))
    }
}

impl<W: Write> JsonLines<W> {
    /// Writes to `sink`.
    pub fn new(sink: W) -> Self {
        Self { sink, failure: None }
    }

    /// The sink, or the first error: after it nothing more was written.
    pub fn finish(self) -> io::Result<W> {
        self.failure.map_or(Ok(self.sink), Err)
    }

    fn write(&mut self, event: &Event) -> io::Result<()> {
        let mut line = serde_json::to_vec(event)?;
        line.push(b'\n');
        self.sink.write_all(&line)?;
        self.sink.flush()
    }
}

impl<W: Write> Observer for JsonLines<W> {
    fn event(&mut self, event: Event) {
        if self.failure.is_none() {
            self.failure = self.write(&event).err();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Vec<Event> {
        vec![
            Event::started("single"),
            Event::Progress {
                stage: "single".into(),
                step: 10,
                total: 100,
                loss: Some(0.25),
                psnr: None,
                gaussians: Some(1234),
            },
            Event::finished("single", 1.5, false),
            Event::warning("no depth in \"end\"\nuse more views"),
        ]
    }

    #[test]
    fn json_lines_read_back_as_the_same_events() {
        let (mut lines, mut kept) = (JsonLines::new(Vec::new()), Vec::new());
        for event in sample() {
            Tee(&mut lines, &mut kept).event(event);
        }
        let text = String::from_utf8(lines.finish().unwrap()).unwrap();
        let back: Vec<Event> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
        assert_eq!(back, sample());
        assert_eq!(kept, sample());
        assert_eq!(text.lines().next(), Some(r#"{"event":"stage_started","stage":"single"}"#));
    }

    #[test]
    fn snapshots_go_to_those_that_want_them() {
        struct Wants(bool, usize);
        impl Observer for Wants {
            fn event(&mut self, _: Event) {}
            fn wants_snapshot(&mut self) -> bool {
                self.0
            }
            fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
                self.1 += snapshot.step;
            }
        }
        let splats = Splats::empty(0);
        let snapshot = Snapshot { stage: "single", step: 3, total: 10, splats: &splats, labels: &[] };
        let (mut eager, mut idle) = (Wants(true, 0), Wants(false, 0));
        let mut tee = Tee(&mut idle, &mut eager);
        assert!(tee.wants_snapshot());
        tee.snapshot(&snapshot);
        assert_eq!((idle.1, eager.1), (0, 3));
        assert!(!Tee(&mut idle, &mut NullObserver).wants_snapshot());
    }

    #[test]
    fn work_ends_at_the_first_report_after_a_stop() {
        let (stop, mut seen) = (AtomicBool::new(false), Vec::new());
        let count = |observer: &mut dyn Observer| {
            for step in 0..5 {
                observer.event(Event::progress("single", step, 5));
                stop.store(step == 2, Ordering::Relaxed);
            }
            true
        };
        assert_eq!(until_stopped(&stop, &mut seen, count), None);
        assert_eq!(seen.len(), 3);
        stop.store(false, Ordering::Relaxed);
        assert_eq!(until_stopped(&stop, &mut NullObserver, |_| 7), Some(7));
        let other = || until_stopped(&stop, &mut NullObserver, |_| resume_unwind(Box::new("other")));
        assert!(catch_unwind(AssertUnwindSafe(|| -> Option<()> { other() })).is_err());
    }

    #[test]
    fn a_file_is_continued_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("events.jsonl");
        for _ in 0..2 {
            let mut lines = JsonLines::append(&path).unwrap();
            lines.event(Event::note("hello"));
            lines.finish().unwrap();
        }
        assert_eq!(std::fs::read_to_string(path).unwrap().lines().count(), 2);
    }

    #[test]
    fn a_full_disk_is_reported_at_the_end_and_not_a_panic() {
        struct Full;
        impl Write for Full {
            fn write(&mut self, _: &[u8]) -> io::Result<usize> {
                Err(io::ErrorKind::StorageFull.into())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let mut lines = JsonLines::new(Full);
        lines.event(Event::note("a"));
        lines.event(Event::note("b"));
        assert!(lines.finish().is_err_and(|e| e.kind() == io::ErrorKind::StorageFull));
    }
}
