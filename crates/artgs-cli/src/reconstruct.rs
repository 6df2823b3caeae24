//! `artgs reconstruct`, and runs as other commands start them.

use crate::args::Reconstruct;
use crate::commands::{Style, use_threads};
use crate::crash::StageNote;
use crate::device;
use crate::failure::Failure;
use crate::output::{Report, say};
use crate::recordings;
use crate::settings::configure;
use crate::{doubts, folder, live, object_box, parts_table, progress, rerun};
use artgs::fit::Chosen;
use artgs::observer::{Event, NullObserver, Observer, Tee};
use artgs::run::{FoundReport, Output, finds_parts};
use artgs::{Prepared, Reconstruction, Request};
use artgs_core::JointEstimate;
use artgs_io::RunFolder;
use serde_json::json;
use std::path::PathBuf;

/// What a command computes, and where.
pub(crate) struct Job {
    prepared: Prepared,
    pub(crate) run: RunFolder,
    resume: bool,
    device: Chosen,
    pub(crate) style: Style,
}

impl Job {
    /// Events of the run begin with those of its preparation and with its device.
    pub(crate) fn new(mut prepared: Prepared, run: &RunFolder, resume: bool, device: Chosen, style: Style) -> Self {
        prepared.before.extend(device.description.as_ref().map(Event::note));
        Self { prepared, run: run.clone(), resume, device, style }
    }
}

pub(crate) fn run(args: &Reconstruct, style: Style) -> Result<(), Failure> {
    use_threads(args.method.threads)?;
    let (job, output) = ready(args, style)?;
    if args.stop_after.is_some() {
        return find_parts_only(args, &job, output);
    }
    let summary = if args.view { live::reconstruct(&job)? } else { job.reconstruct(&mut NullObserver)? };
    drop(output);
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

/// Reads the input, refuses what cannot be used, and locks the folder.
fn ready(args: &Reconstruct, style: Style) -> Result<(Job, Output), Failure> {
    let config = configure(&args.method, None)?;
    let run = RunFolder::new(&args.out);
    let input = recordings::input(&args.capture, &args.recording)?;
    Output::check(&run, args.earlier.into(), Some(&input)).map_err(|error| Failure::of(error.into()))?;
    if args.stop_after.is_some() && !finds_parts(&config) {
        return Err(Failure::bad(format!("--stop-after: {}", artgs::Error::PartsLearnt)));
    }
    let object_box = args.object_box.as_deref().map(|text| object_box::given(text, &input)).transpose()?;
    let device = device::choose(args.method.device, &config)?;
    let memory = args.memory.map(|size| size.as_u64());
    let request = Request { input, config, object_box, memory, force_input: args.force_input };
    let prepared = request.prepare(progress::renderer(style).as_mut()).map_err(Failure::of)?;
    let output = folder::open(run, args.earlier, "artgs reconstruct", style)?;
    Ok((Job::new(prepared, output.folder(), output.resumes(), device, style), output))
}

/// The stages before training; with `--view` the page stays, takes corrections and continues the run.
fn find_parts_only(args: &Reconstruct, job: &Job, output: Output) -> Result<(), Failure> {
    if args.view {
        return rerun::find_parts(job, args.method.device, output.into_lock());
    }
    let found = job.find_parts(&mut NullObserver)?;
    drop(output);
    if job.style.json {
        return say(json!({ "event": "result", "out": args.out, "found": found.json }));
    }
    if !job.style.quiet {
        found.show(false)?;
        let shown = args.out.display();
        say(format!("parts in {shown}; artgs view {shown} shows them, takes corrections and continues the run"))?;
    }
    Ok(())
}

impl Job {
    /// Reconstructs while showing events; `also` gets them, too.
    pub(crate) fn reconstruct(&self, also: &mut dyn Observer) -> Result<Report, Failure> {
        let made = self.observed(also, |reconstruction, observer| reconstruction.run_in(&self.run, observer))?;
        let mut report = Report::new(&made.summary)?;
        report.text.push_str(&parts_table::of_result(&made));
        report.text.push_str(&doubts::of_replica(&made.replica));
        Ok(report)
    }

    /// The stages before training likewise.
    pub(crate) fn find_parts(&self, also: &mut dyn Observer) -> Result<Report, Failure> {
        let found =
            self.observed(also, |reconstruction, observer| reconstruction.find_parts_in(&self.run, observer))?;
        let json = json!(FoundReport::new(&found));
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
        let mut shown = progress::renderer(self.style);
        let mut noted = StageNote;
        let mut also_noted = Tee(&mut noted, also);
        let mut observer = Tee(shown.as_mut(), &mut also_noted);
        self.device.announce(&mut observer);
        let reconstruction =
            Reconstruction { prepared: &self.prepared, devices: self.device.devices.as_ref(), resume: self.resume };
        act(&reconstruction, &mut observer).map_err(Failure::of)
    }

    /// The folder with the images.
    pub(crate) fn photos(&self) -> Option<PathBuf> {
        self.prepared.photos(&self.run)
    }
}

fn part_line(number: usize, part: &JointEstimate) -> String {
    let share = part.confidence.map(|c| format!(", confidence {c:.2}"));
    let carrier = if part.parent > 0 { format!(" on part {}", part.parent) } else { String::new() };
    format!("part {number}: {}{carrier}{}\n", part.kind.name(), share.unwrap_or_default())
}
