//! Which code each command runs.

use crate::args::{Cli, Command, Inspect};
use crate::failure::Failure;
use crate::folder::load_capture;
use crate::memory::{self, Plan};
use crate::output::{Report, say};
use crate::recordings::{self, RecordingSummary, Source};
use crate::{agreement, demo, device, evaluate, export, reconstruct, settings, synth, view};
use anyhow::Context;
use artgs::consistency::{check_capture, check_recording};
use artgs_core::State;
use serde_json::{Value, json};
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// How results are shown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Style {
    /// JSON, one object per line, and nothing else on standard output.
    pub(crate) json: bool,
    /// No progress and no summary.
    pub(crate) quiet: bool,
    /// No warnings either: an observer in this process gets them.
    pub(crate) silent: bool,
}

pub(crate) fn run(cli: &Cli) -> Result<(), Failure> {
    let style = Style { json: cli.wants_json(), quiet: cli.quiet, silent: false };
    execute(&cli.command, style)
}

/// Executes one command.
pub(crate) fn execute(command: &Command, style: Style) -> Result<(), Failure> {
    match command {
        Command::Inspect(args) => inspect(args, style),
        Command::Reconstruct(args) => reconstruct::run(args, style),
        Command::Evaluate(args) => evaluate::run(args, style),
        Command::Demo(args) => demo::run(args, style),
        Command::Batch(args) => crate::batch::run(args, style),
        #[cfg(feature = "bench")]
        Command::Bench(args) => crate::bench::run(args, style),
        #[cfg(feature = "bench")]
        Command::Report(args) => crate::report::run(args, style),
        Command::Synth(args) => synth::run(args, style),
        Command::Export(args) => export::run(args, style),
        #[cfg(feature = "check")]
        Command::Check(args) => crate::check::run(args, style),
        Command::View(args) => view::run(args, style),
        Command::Devices(_) => device::list(style),
        Command::Settings(args) => settings::list(args.preset, style),
    }
}

/// Describes a capture, or each of one or two recordings.
fn inspect(args: &Inspect, style: Style) -> Result<(), Failure> {
    let inspected = described(args)?;
    let refused: Vec<String> =
        inspected.iter().filter(|i| i.is_refused).map(|i| i.path.display().to_string()).collect();
    match &inspected[..] {
        [Inspected { report, is_capture: true, .. }] => report.show(style.json)?,
        _ if style.json => {
            let reports: Value = inspected.into_iter().map(|i| i.report.json).collect();
            say(format!("{reports:#}"))?;
        }
        _ => inspected.iter().try_for_each(|i| say(format!("{}\n{}", i.path.display(), i.report.text)))?,
    }
    if refused.is_empty() {
        return Ok(());
    }
    Err(Failure::bad(format!("{}: artgs reconstruct refuses this input for the errors above", refused.join(" and "))))
}

/// What `inspect` says about a capture or a recording.
pub(crate) struct Inspected {
    path: PathBuf,
    is_capture: bool,
    pub(crate) report: Report,
    /// True if `reconstruct` refuses it.
    is_refused: bool,
}

/// The description of a capture, or of each recording.
pub(crate) fn described(args: &Inspect) -> Result<Vec<Inspected>, Failure> {
    let source = Source::new(&args.capture);
    if let Ok(Source::Capture(folder)) = source {
        recordings::require_none(&args.recording, &folder)?;
        let capture = load_capture(&folder)?;
        let found = check_capture(&capture);
        let mut report = Report::new(&artgs_io::summarize(&capture))?;
        report.text.push_str(&agreement::described(&found));
        report.json["consistency"] = json!(found);
        let needed = Plan::unlimited(&folder);
        report.text.push_str(&format!("memory            about {} to reconstruct\n", memory::size(needed as f64)));
        report.json["memory_bytes"] = json!(needed);
        let is_refused = agreement::are_refusals(&found.findings());
        return Ok(vec![Inspected { path: folder, is_capture: true, report, is_refused }]);
    }
    let paths = match source {
        Ok(Source::Recordings(paths)) => paths.into_iter().collect(),
        _ => args.capture.clone(),
    };
    let mut reports = Vec::new();
    for (path, state) in paths.iter().zip(State::ALL) {
        let recording = recordings::load_state(path, state, &args.recording)?;
        let found = check_recording(recording.frames.iter().map(|f| &f.view));
        let mut report = Report::new(&RecordingSummary::new(&recording))?;
        report.text.push_str(&agreement::described_recording(&found, path));
        report.json["consistency"] = json!(found);
        let is_refused = agreement::are_refusals(&found.findings(""));
        reports.push(Inspected { path: path.clone(), is_capture: false, report, is_refused });
    }
    Ok(reports)
}

/// Sizes the thread pool that everything shares: at most four threads per processor.
pub(crate) fn use_threads(count: Option<NonZeroUsize>) -> Result<(), Failure> {
    /// More threads than this many per processor only cost memory.
    const MOST_PER_PROCESSOR: usize = 4;
    let Some(count) = count else { return Ok(()) };
    let processors = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let count = count.get().min(MOST_PER_PROCESSOR * processors);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build_global();
    pool.with_context(|| format!("cannot start {count} threads"))?;
    Ok(())
}
