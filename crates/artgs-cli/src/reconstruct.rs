//! `artgs reconstruct`, and runs as other commands start them.

use crate::args::Reconstruct;
use crate::commands::{Style, use_threads};
use crate::crash::StageNote;
use crate::device::{self, Chosen};
use crate::failure::Failure;
use crate::folder::{self, load_capture, load_capture_with};
use crate::memory::Plan;
use crate::output::{Report, note, say};
use crate::recordings::{self, Source};
use crate::settings::configure;
use crate::{agreement, doubts, live, object_box, parts_table, progress, rerun};
use anyhow::Context;
use artgs::align::correct;
use artgs::fit::FitError;
use artgs::observer::{Event, JsonLines, NullObserver, Observer, Tee};
use artgs::run::{finds_parts, found_parts};
use artgs::{Config, Reconstruction};
use artgs_core::{Capture, JointEstimate};
use artgs_io::{CaptureOptions, FolderLock, RunFolder, read_corrections};
use serde::Serialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// What a command computes, and where.
pub(crate) struct Job<'a> {
    pub(crate) capture: &'a Capture,
    pub(crate) run: &'a RunFolder,
    pub(crate) config: &'a Config,
    pub(crate) resume: bool,
    pub(crate) device: &'a Chosen,
    pub(crate) style: Style,
    /// Events of its preparation, such as the alignment of two recordings.
    pub(crate) before: &'a [Event],
}

/// A run that can begin: its input is read and accepted, its folder is locked.
struct Ready {
    capture: Capture,
    photos: PathBuf,
    run: RunFolder,
    config: Config,
    device: Chosen,
    lock: FolderLock,
    before: Vec<Event>,
}

impl Ready {
    fn job(&self, args: &Reconstruct, style: Style) -> Job<'_> {
        let Self { capture, run, config, device, before, .. } = self;
        Job { capture, run, config, resume: args.earlier.resume, device, style, before }
    }
}

pub(crate) fn run(args: &Reconstruct, style: Style) -> Result<(), Failure> {
    use_threads(args.method.threads)?;
    let ready = ready(args, None, style, &mut NullObserver)?;
    if args.stop_after.is_some() {
        return find_parts_only(args, ready, style);
    }
    let job = ready.job(args, style);
    let summary = if args.view { live::reconstruct(&job)? } else { job.reconstruct(&mut NullObserver)? };
    drop(ready);
    if style.json {
        return say(json!({ "event": "result", "out": args.out, "summary": summary.json }));
    }
    if !style.quiet {
        summary.show(false)?;
        let shown = args.out.display();
        say(format!(
            "replica in {shown}; open {shown}/preview.png or run artgs view {shown} to look at it; artgs export {shown} writes \
             it as files for simulators and browsers"
        ))?;
    }
    Ok(())
}

/// The same without a terminal, of a capture in memory if there is one: summary, or what was found.
pub(crate) fn call(
    args: &Reconstruct,
    given: Option<Capture>,
    style: Style,
    also: &mut dyn Observer,
) -> Result<Value, Failure> {
    if args.view {
        return Err(Failure::bad("--view needs a terminal that Ctrl-C reaches"));
    }
    let ready = ready(args, given, style, also)?;
    let job = ready.job(args, style);
    let report = if args.stop_after.is_some() { job.find_parts(also)? } else { job.reconstruct(also)? };
    Ok(report.json)
}

/// Reads the input, refuses what cannot be used, and prepares the folder. `given` is a capture in memory that replaces
/// the one of the arguments.
fn ready(args: &Reconstruct, given: Option<Capture>, style: Style, also: &mut dyn Observer) -> Result<Ready, Failure> {
    let mut config = configure(&args.method, None)?;
    if args.force_input {
        config.discover = config.discover.without_refusals();
    }
    let run = RunFolder::new(&args.out);
    folder::check(&run, args.earlier)?;
    if args.stop_after.is_some() && !finds_parts(&config) {
        return Err(Failure::bad(format!("--stop-after: {}", artgs::Error::PartsLearnt)));
    }
    if args.earlier.resume {
        require_corrections(&run)?;
    }
    if let Some(capture) = given {
        let device = device::choose(args.method.device, &config)?;
        return ready_in_memory(args, capture, run, config, device, style);
    }
    let source = Source::new(&args.capture)?;
    let given = args.object_box.as_deref().map(|text| object_box::given(text, &source)).transpose()?;
    let device = device::choose(args.method.device, &config)?;
    let plan = match &source {
        Source::Capture(folder) => Plan::of_capture(folder, args.memory)?,
        Source::Recordings(_) => Plan::of_recordings(recordings::most_frames(&args.recording), args.memory)?,
    };
    let mut before = Vec::new();
    let also = &mut Tee(&mut before, also);
    if let Some(text) = plan.notice() {
        note(&text, style);
        also.event(Event::note(text));
    }
    if let Some(mib) = plan.volume_mib {
        config.surface.memory_mib = config.surface.memory_mib.min(mib);
    }
    let (capture, photos, lock) = match source {
        Source::Capture(folder) => {
            recordings::require_none(&args.recording, &folder)?;
            let mut capture = load_capture_with(
                &folder,
                &CaptureOptions { longest_side: plan.longest_side, ..CaptureOptions::default() },
            )?;
            agreement::require(&mut capture, args.force_input)?;
            let correction = correct(&mut capture, &config.align);
            let lock = prepare(&run, args, &folder, style)?;
            let (capture, folder) =
                if correction.is_none() { (capture, folder) } else { saved(&run, capture, &correction)? };
            (capture, folder, lock)
        }
        Source::Recordings(paths) => {
            let mut found = recordings::load(&paths, &args.recording, plan.longest_side)?;
            agreement::require_recordings(&mut found, args.force_input)?;
            let (mut capture, report) =
                recordings::aligned(&found, &config.align, given.as_ref(), config.seed, style, also)?;
            drop(found);
            agreement::require_one_object(&mut capture, args.force_input)?;
            let lock = folder::prepare(&run, args.earlier, COMMAND, style)?;
            let (capture, folder) = saved(&run, capture, &report)?;
            (capture, folder, lock)
        }
    };
    run.save_capture_folder(&photos).map_err(Failure::failed)?;
    Ok(Ready { capture, photos, run, config, device, lock, before })
}

/// The same for a capture in memory, which is saved in the folder of the run: exports and the page need its photos.
fn ready_in_memory(
    args: &Reconstruct,
    mut capture: Capture,
    run: RunFolder,
    config: Config,
    device: Chosen,
    style: Style,
) -> Result<Ready, Failure> {
    if let Some(option) = recordings::given_option(&args.recording) {
        return Err(Failure::bad(format!("{option} is for the recordings of two states, and this is a capture")));
    }
    agreement::require(&mut capture, args.force_input)?;
    let correction = correct(&mut capture, &config.align);
    let lock = folder::prepare(&run, args.earlier, COMMAND, style)?;
    let (capture, photos) = saved(&run, capture, &correction)?;
    run.save_capture_folder(&photos).map_err(Failure::failed)?;
    Ok(Ready { capture, photos, run, config, device, lock, before: Vec::new() })
}

/// What others read who find the folder locked.
const COMMAND: &str = "artgs reconstruct";

/// Prepares the folder of a run. `--force` must not remove the capture that it reads.
fn prepare(run: &RunFolder, args: &Reconstruct, photos: &Path, style: Style) -> Result<FolderLock, Failure> {
    let stages = run.stage("");
    let inside = || Some(photos.canonicalize().ok()?.starts_with(stages.canonicalize().ok()?));
    if args.earlier.force && inside() == Some(true) {
        let (photos, stages) = (photos.display(), stages.display());
        return Err(Failure::bad(format!(
            "{photos} is inside {stages}, which --force removes; give another folder to -o"
        )));
    }
    folder::prepare(run, args.earlier, COMMAND, style)
}

/// Refuses corrections that cannot be applied before anything is read or computed.
fn require_corrections(run: &RunFolder) -> Result<(), Failure> {
    let refused = |reason: String| Failure::bad(format!("{reason}; correct the file or remove it"));
    let Some(corrections) = read_corrections(run.root()).map_err(|e| refused(e.to_string()))? else { return Ok(()) };
    let Some(found) = found_parts(run) else { return Ok(()) };
    let wrong = |reason: String| refused(format!("{}: {reason}", run.corrections().display()));
    corrections.check_parts(found.parts.len()).map_err(wrong)
}

/// Saves a capture with new cameras in the folder of a run, and reads it again: depth in files is rounded, and a later run
/// on the same files must see the same numbers.
fn saved(run: &RunFolder, capture: Capture, report: &impl Serialize) -> Result<(Capture, PathBuf), Failure> {
    let folder = recordings::save(run, &capture, report)?;
    let warnings = capture.warnings;
    let mut capture = load_capture(&folder)?;
    // What the files themselves give reason to warn of was said before.
    capture.warnings = warnings;
    Ok((capture, folder))
}

/// The stages before training; with `--view` the page stays, takes corrections and continues the run.
fn find_parts_only(args: &Reconstruct, ready: Ready, style: Style) -> Result<(), Failure> {
    let Ready { capture, photos, run, config, device, lock, before } = ready;
    let resume = args.earlier.resume;
    let before = &before[..];
    let job = Job { capture: &capture, run: &run, config: &config, resume, device: &device, style, before };
    if args.view {
        return rerun::find_parts(&job, &photos, args.method.device, lock);
    }
    let found = job.find_parts(&mut NullObserver)?;
    drop(lock);
    if style.json {
        return say(json!({ "event": "result", "out": args.out, "found": found.json }));
    }
    if !style.quiet {
        found.show(false)?;
        let shown = args.out.display();
        say(format!("parts in {shown}; artgs view {shown} shows them, takes corrections and continues the run"))?;
    }
    Ok(())
}

impl Job<'_> {
    /// Reconstructs while showing events and appending them to the event file of the folder; `also` gets them, too.
    pub(crate) fn reconstruct(&self, also: &mut dyn Observer) -> Result<Report, Failure> {
        let made = self.observed(also, |reconstruction, observer| reconstruction.run_in(self.run, observer))?;
        let mut report = Report::new(&made.summary)?;
        report.text.push_str(&parts_table::of_result(&made));
        report.text.push_str(&doubts::of_replica(&made.replica));
        Ok(report)
    }

    /// The stages before training likewise.
    pub(crate) fn find_parts(&self, also: &mut dyn Observer) -> Result<Report, Failure> {
        let found = self.observed(also, |reconstruction, observer| reconstruction.find_parts_in(self.run, observer))?;
        let others = |k: usize| found.alternatives.get(k).map_or(&[][..], Vec::as_slice);
        let part = |(k, p): (usize, &JointEstimate)| {
            let alternatives = others(k);
            json!({ "type": p.kind, "parent": p.parent, "confidence": p.confidence, "interval": p.interval,
                "alternatives": alternatives })
        };
        let parts = found.parts.iter().enumerate().map(part);
        let json = json!({ "parts": parts.collect::<Value>(), "warnings": found.warnings });
        let line = |(k, p)| part_line(k + 1, p);
        let mut text: String = found.parts.iter().enumerate().map(line).collect();
        text.push_str(&doubts::of_found(&found));
        Ok(Report { text, json })
    }

    fn observed<T>(
        &self,
        also: &mut dyn Observer,
        act: impl FnOnce(&Reconstruction<'_>, &mut dyn Observer) -> Result<T, artgs::Error>,
    ) -> Result<T, Failure> {
        let path = self.run.events();
        let mut log = JsonLines::append(&path).with_context(|| format!("cannot write {}", path.display()))?;
        // These were shown while the folder was not yet prepared.
        self.before.iter().for_each(|event| log.event(event.clone()));
        let mut shown = progress::renderer(self.style);
        let mut log_and_shown = Tee(&mut log, shown.as_mut());
        let mut noted = StageNote;
        let mut also_noted = Tee(&mut noted, also);
        let mut observer = Tee(&mut log_and_shown, &mut also_noted);
        self.device.announce(&mut observer);
        let (config, devices) = (self.config.clone(), self.device.devices.as_ref());
        let finished = |event: &Event| match event {
            Event::StageFinished { stage, seconds, .. } => Some((stage.to_string(), *seconds)),
            _ => None,
        };
        let preparation = self.before.iter().filter_map(finished).collect();
        let reconstruction =
            Reconstruction { capture: self.capture, config, devices, resume: self.resume, preparation };
        let result = act(&reconstruction, &mut observer).map_err(failure);
        drop(shown);
        if let (Err(Failure::BadInput(reason)), false) = (&result, self.resume) {
            // The refusal itself matters more than a note of it.
            let _ = self.run.note_refusal(&reason.to_string());
        }
        let logged = log.finish().with_context(|| format!("cannot write {}", path.display()));
        let result = result?;
        logged?;
        Ok(result)
    }
}

fn part_line(number: usize, part: &JointEstimate) -> String {
    let share = part.confidence.map(|c| format!(", confidence {c:.2}"));
    let carrier = if part.parent > 0 { format!(" on part {}", part.parent) } else { String::new() };
    format!("part {number}: {}{carrier}{}\n", part.kind.name(), share.unwrap_or_default())
}

fn failure(error: artgs::Error) -> Failure {
    if matches!(error, artgs::Error::Fit(FitError::Device(_))) {
        return Failure::Failed(anyhow::anyhow!("{error}; with --device auto training would continue on the CPU"));
    }
    if error.is_bad_input() { Failure::bad_input(error) } else { Failure::failed(error) }
}
