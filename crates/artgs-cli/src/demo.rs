//! `artgs demo`: capture, replica, exports and scores of a procedural cabinet, in one folder.

use crate::args::Demo;
use crate::device;
use crate::evaluate::scored;
use crate::failure::Failure;
use crate::folder;
use crate::job::Job;
use crate::output::{say, write_json};
use crate::settings::configure;
use crate::style::Style;
use crate::threads::use_threads;
use crate::{export, progress};
use artgs::observer::NullObserver;
use artgs::run::Comparison;
use artgs::{Input, Request};
use artgs_io::RunFolder;
use artgs_io::run_folder::load_json;
use artgs_physical::export::ExportOptions;
use artgs_synth::cabinet::{CabinetOptions, GENERATOR, write_cabinet};
use serde_json::{Value, json};
use std::path::Path;

/// Carcass, door, drawer.
const PARTS: usize = 3;

pub(crate) fn run(args: &Demo, style: Style) -> Result<(), Failure> {
    use_threads(args.method.threads)?;
    let config = configure(&args.method, Some(PARTS))?;
    let (capture, run) = (args.out.join("capture"), RunFolder::new(args.out.join("replica")));
    let seed = args.method.seed.unwrap_or_default();
    // Upright, so that its drawer stays where it is put in a simulator.
    let options = CabinetOptions { views: args.views, size: args.size, seed, lean: 0.0, ..CabinetOptions::default() };
    options.check().map_err(Failure::bad)?;
    let device = device::choose(args.method.device, &config)?;
    check_folder(&args.out)?;
    let found = Found::at(&capture, &options)?;
    let output = folder::open(run.clone(), args.earlier, Some(&capture), "artgs demo", style)?;
    if !(args.earlier.resume && found == Found::Same) {
        write_cabinet(&capture, &options).map_err(anyhow::Error::from)?;
    }
    let request = Request { config, ..Request::new(Input::Capture(capture.clone())) };
    let prepared = request.prepare(progress::renderer(style).as_mut()).map_err(Failure::of)?;
    let job = Job::new(prepared, &run, output.resumes(), device, style);
    let summary = job.reconstruct(&mut NullObserver)?;
    let truth = capture.join("gt");
    let with = Comparison { ground_truth: Some(&truth), ..Comparison::default() };
    let scores = scored(&run, &with, &mut |_| ())?;
    write_json(&args.out.join("scores.json"), &scores)?;
    let options = ExportOptions { capture: Some(capture.clone()), ..ExportOptions::default() };
    let exported = export::export_locked(&run, &options, style)?;
    #[cfg(feature = "check")]
    let checked = Some(crate::check::check(&run)?);
    #[cfg(not(feature = "check"))]
    let checked: Option<crate::check::Checked> = None;
    if style.json {
        say(json!({
            "event": "result", "out": run.root(), "summary": summary.json, "scores": scores.json,
            "exports": exported.json, "check": checked.as_ref().map(|c| &c.report.json),
        }))?;
    } else if !style.quiet {
        for report in [&summary, &scores, &exported].into_iter().chain(checked.as_ref().map(|c| &c.report)) {
            report.show(false)?;
        }
        say(format!("capture in {}, replica in {}", capture.display(), run.root().display()))?;
    }
    checked.map_or(Ok(()), |checked| checked.result(&run))
}

/// Refuses a folder with other files: a demo starts with one of two folders.
fn check_folder(out: &Path) -> Result<(), Failure> {
    let shown = out.display();
    if out.exists() && !out.is_dir() {
        return Err(Failure::bad(format!("{shown} is a file; give a folder to -o")));
    }
    let filled = std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some());
    if filled && !["capture", "replica"].iter().any(|name| out.join(name).exists()) {
        return Err(Failure::bad(format!("{shown} holds files that no demo wrote; give an empty folder to -o")));
    }
    Ok(())
}

/// What is at the place of the capture.
#[derive(Debug, PartialEq)]
enum Found {
    Nothing,
    Other,
    Same,
}

impl Found {
    /// Refuses a folder that holds anything but a cabinet.
    fn at(capture: &Path, options: &CabinetOptions) -> Result<Self, Failure> {
        if !capture.exists() {
            return Ok(Self::Nothing);
        }
        // What cannot be read was not written by a demo.
        let truth: Value = load_json(&capture.join("gt/trans.json")).ok().flatten().unwrap_or_default();
        let empty = std::fs::read_dir(capture).is_ok_and(|mut e| e.next().is_none());
        if truth["input"]["generator"] != GENERATOR && !empty {
            return Err(Failure::bad(format!(
                "{} holds something other than a finished demo capture; remove it or give another folder to -o",
                capture.display()
            )));
        }
        let same =
            serde_json::from_value(truth["input"]["options"].clone()).is_ok_and(|o: CabinetOptions| o == *options);
        Ok(if same { Self::Same } else { Self::Other })
    }
}
