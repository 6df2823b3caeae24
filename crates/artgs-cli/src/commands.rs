//! What each command does.

use crate::args::{Cli, Command, Evaluate, Method, Reconstruct};
use crate::device::{self, Chosen};
use crate::failure::Failure;
use crate::library::{Config, Settings};
use crate::output::{Report, note, say};
use crate::{bench, demo, export, folder, library, live, progress, rerun, synth, view};
use anyhow::Context;
use artgs::observer::{JsonLines, NullObserver, Observer, Tee};
use artgs_core::Capture;
use serde_json::json;
use std::num::NonZeroUsize;
use std::path::Path;

/// How results are shown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Style {
    /// JSON, one object per line, and nothing else on standard output.
    pub(crate) json: bool,
    /// No progress and no summary.
    pub(crate) quiet: bool,
}

pub(crate) fn run(cli: &Cli) -> Result<(), Failure> {
    let style = Style { json: cli.wants_json(), quiet: cli.quiet };
    match &cli.command {
        Command::Inspect(args) => library::inspect(&args.capture)?.show(style.json),
        Command::Reconstruct(args) => reconstruct(args, style),
        Command::Evaluate(args) => evaluate(args, style),
        Command::Demo(args) => demo::run(args, style),
        Command::Bench(args) => bench::run(args, style),
        Command::Synth(args) => synth::run(args, style),
        Command::Export(args) => export::run(args, style),
        Command::Check(args) => check(&args.out, style),
        Command::View(args) => view::run(args, style),
        Command::Devices(_) => device::list(style),
    }
}

fn reconstruct(args: &Reconstruct, style: Style) -> Result<(), Failure> {
    use_threads(args.method.threads)?;
    let config = library::configure(&settings(&args.method, args.parts))?;
    folder::check(&args.out, args.earlier)?;
    if args.stop_after.is_some() && !artgs::run::finds_parts(&config) {
        return Err(Failure::bad(format!("--stop-after: {}", artgs::run::Error::PartsLearnt)));
    }
    let device = device::choose(args.method.device, &config)?;
    let capture = library::load(&args.capture)?;
    folder::prepare(&args.out, args.earlier)?;
    folder::note_capture(&args.out, &args.capture)?;
    if args.stop_after.is_some() {
        return find_parts(args, &capture, &config, &device, style);
    }
    let observed = if args.view { live::observed } else { observed };
    let summary = observed(&capture, &args.out, &config, args.earlier.resume, &device, style)?;
    if style.json {
        return say(json!({ "event": "result", "out": args.out, "summary": summary.json }));
    }
    if !style.quiet {
        summary.show(false)?;
        let shown = args.out.display();
        say(format!("replica in {shown}; artgs export {shown} makes files for simulators and browsers of it"))?;
    }
    Ok(())
}

/// The stages before training; with `--view` the page stays, takes corrections and goes on.
fn find_parts(
    args: &Reconstruct,
    capture: &Capture,
    config: &Config,
    device: &Chosen,
    style: Style,
) -> Result<(), Failure> {
    if args.view {
        let (resume, choice) = (args.earlier.resume, args.method.device);
        return rerun::find_parts(capture, &args.capture, &args.out, config, resume, (device, choice), style);
    }
    let found = watched(&mut NullObserver, &args.out, style, |observer| {
        device.tell(observer);
        library::find_parts(capture, &args.out, config, args.earlier.resume, device.devices.as_ref(), observer)
    })?;
    if style.json {
        return say(json!({ "event": "result", "out": args.out, "found": found.json }));
    }
    if !style.quiet {
        found.show(false)?;
        let shown = args.out.display();
        say(format!("parts in {shown}; artgs view {shown} shows them, takes corrections and goes on"))?;
    }
    Ok(())
}

fn evaluate(args: &Evaluate, style: Style) -> Result<(), Failure> {
    use_threads(args.threads)?;
    for folder in std::iter::once(&args.out).chain(&args.gt) {
        if !folder.is_dir() {
            let what = if folder.exists() { "is a file; give a folder" } else { "no such folder" };
            return Err(Failure::bad(format!("{}: {what}", folder.display())));
        }
    }
    folder::holds_replica(&args.out)?;
    let truth = args.gt.as_deref();
    let scores = match &args.capture {
        None => library::score(&args.out, truth, None)?,
        Some(folder) => {
            let (weights, capture) = (library::weights(args.lpips.as_deref())?, library::load(folder)?);
            if let Some(reason) = library::no_pictures(&args.out, &capture) {
                note(&format!("pictures are not scored: {reason}"), style);
            }
            library::score(&args.out, truth, Some((&capture, weights.as_ref())))?
        }
    };
    if let Some(file) = args.json.as_ref().filter(|file| file.as_os_str() != "-") {
        write_json(file, &scores)?;
    }
    scores.show(style.json)
}

fn check(out: &Path, style: Style) -> Result<(), Failure> {
    folder::holds_replica(out)?;
    let report = library::check(out)?;
    report.shown.show(style.json)?;
    if report.passed { Ok(()) } else { Err(Failure::ChecksFailed(format!("{} does not pass", out.display()))) }
}

/// Runs the method while showing its events and appending them to the folder's event file.
pub(crate) fn observed(
    capture: &Capture,
    out: &Path,
    config: &Config,
    resume: bool,
    device: &Chosen,
    style: Style,
) -> Result<Report, Failure> {
    observed_by(&mut NullObserver, capture, out, config, resume, device, style)
}

/// The same with one more who looks on.
pub(crate) fn observed_by(
    onlooker: &mut dyn Observer,
    capture: &Capture,
    out: &Path,
    config: &Config,
    resume: bool,
    device: &Chosen,
    style: Style,
) -> Result<Report, Failure> {
    watched(onlooker, out, style, |observer| {
        device.tell(observer);
        library::reconstruct(capture, out, config, resume, device.devices.as_ref(), observer)
    })
}

/// Does something of which a folder's event file, the terminal and one more are told.
pub(crate) fn watched<T>(
    onlooker: &mut dyn Observer,
    out: &Path,
    style: Style,
    act: impl FnOnce(&mut dyn Observer) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let path = out.join(folder::EVENTS);
    let mut log = JsonLines::append(&path).with_context(|| format!("cannot write {}", path.display()))?;
    let mut shown = progress::renderer(style);
    let mut told = Tee(&mut log, shown.as_mut());
    let result = act(&mut Tee(&mut told, onlooker));
    drop(shown);
    let logged = log.finish().with_context(|| format!("cannot write {}", path.display()));
    let summary = result?;
    logged?;
    Ok(summary)
}

/// The part of the method's configuration that flags set.
pub(crate) fn settings(method: &Method, parts: Option<usize>) -> Settings {
    Settings {
        preset: method.preset,
        schedule: method.schedule,
        variant: method.variant.clone(),
        file: method.config.clone(),
        parts,
        seed: method.seed,
    }
}

/// Sizes the thread pool that everything shares.
pub(crate) fn use_threads(count: Option<NonZeroUsize>) -> Result<(), Failure> {
    let Some(count) = count else { return Ok(()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(count.get()).build_global();
    pool.with_context(|| format!("cannot start {count} threads"))?;
    Ok(())
}

/// Writes a report's JSON form to a file.
pub(crate) fn write_json(path: &Path, report: &Report) -> Result<(), Failure> {
    artgs_io::write_atomic(path, format!("{:#}\n", report.json).as_bytes()).map_err(anyhow::Error::from)?;
    Ok(())
}
