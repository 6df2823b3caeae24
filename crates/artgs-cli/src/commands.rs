//! Which code each command runs.

use crate::args::{Cli, Command, Inspect};
use crate::failure::Failure;
use crate::output::{Report, say};
use crate::{demo, device, evaluate, export, reconstruct, recordings, settings, synth, view};
use anyhow::Context;
use artgs::prepare::{self, Inspected};
use artgs_core::State;
use artgs_io::recording::RecordingFormat;
use serde_json::json;
use std::num::NonZeroUsize;

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
    let inspected = inspected(args)?;
    match &inspected[..] {
        [one] if one.is_capture() => Report::new(one)?.show(style.json)?,
        all if style.json => say(format!("{:#}", json!(all)))?,
        all => all.iter().try_for_each(|one| say(format!("{}\n{one}", one.path().display())))?,
    }
    let refused: Vec<String> =
        inspected.iter().filter(|one| one.is_refused()).map(|one| one.path().display().to_string()).collect();
    if refused.is_empty() {
        return Ok(());
    }
    Err(Failure::bad(format!("{}: artgs reconstruct refuses this input for the errors above", refused.join(" and "))))
}

/// The description of a capture, or of each recording; unlike a reconstruction, also of one recording.
pub(crate) fn inspected(args: &Inspect) -> Result<Vec<Inspected>, Failure> {
    if let [path] = &args.capture[..]
        && RecordingFormat::of(path).is_some()
    {
        let files = recordings::of_state(path, State::START, &args.recording)?;
        return Ok(vec![Inspected::recording(&files).map_err(Failure::of)?]);
    }
    prepare::inspect(&recordings::input(&args.capture, &args.recording)?).map_err(Failure::of)
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
