//! `artgs reconstruct`, and runs as other commands start them.

use crate::args::Reconstruct;
use crate::failure::Failure;
use crate::job::Job;
use crate::output::say;
use crate::settings::configure;
use crate::style::Style;
use crate::threads::use_threads;
use crate::{device, folder, live, object_box, progress, recordings, rerun};
use artgs::Request;
use artgs::observer::NullObserver;
use artgs::run::{Output, finds_parts};
use artgs_io::RunFolder;
use serde_json::json;
use std::path::PathBuf;

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
    Output::check(&run, args.earlier.into(), input.photos()).map_err(Failure::of)?;
    if args.stop_after.is_some() && !finds_parts(&config) {
        return Err(Failure::bad(format!("--stop-after: {}", artgs::Error::PartsLearnt)));
    }
    let object_box = args.object_box.as_deref().map(|text| object_box::given(text, &input)).transpose()?;
    let device = device::choose(args.method.device, &config)?;
    let memory = args.memory.map(|size| size.as_u64());
    let photos = input.photos().map(PathBuf::from);
    let request = Request { input, config, object_box, memory, force_input: args.force_input };
    let prepared = request.prepare(progress::renderer(style).as_mut()).map_err(Failure::of)?;
    let output = folder::open(run, args.earlier, photos.as_deref(), "artgs reconstruct", style)?;
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
