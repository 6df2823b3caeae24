//! `artgs demo`: capture, replica, exports and scores of a procedural cabinet, in one folder.

use crate::args::{Demo, Export};
use crate::commands::{Style, observed, settings, use_threads, write_json};
use crate::device;
use crate::failure::Failure;
use crate::output::say;
use crate::{export, folder, library};
use artgs_synth::cabinet::{CabinetOptions, GENERATOR, write_cabinet};
use serde_json::{Value, json};
use std::path::Path;

/// Carcass, door, drawer.
const PARTS: usize = 3;

pub(crate) fn run(args: &Demo, style: Style) -> Result<(), Failure> {
    use_threads(args.method.threads)?;
    let config = library::configure(&settings(&args.method, Some(PARTS)))?;
    let (capture, replica) = (args.out.join("capture"), args.out.join("replica"));
    let seed = args.method.seed.unwrap_or_default();
    let options = CabinetOptions { views: args.views, size: args.size, seed, ..CabinetOptions::default() };
    options.check().map_err(Failure::bad)?;
    let device = device::choose(args.method.device, &config)?;
    check_folder(&args.out)?;
    let found = Found::at(&capture, &options)?;
    folder::prepare(&replica, args.earlier)?;
    if !(args.earlier.resume && found == Found::Same) {
        write_cabinet(&capture, &options).map_err(anyhow::Error::from)?;
    }
    let loaded = library::load(&capture)?;
    let summary = observed(&loaded, &replica, &config, args.earlier.resume, &device, style)?;
    let scores = library::evaluate(&replica, &capture.join("gt"))?;
    write_json(&args.out.join("scores.json"), &scores)?;
    let mut exports = Export::of(replica.clone());
    exports.capture = Some(capture.clone());
    let exported = export::export(&exports, style)?;
    let checked = library::check(&replica)?;
    if style.json {
        say(json!({
            "event": "result", "out": replica, "summary": summary.json, "scores": scores.json,
            "exports": exported.json, "check": checked.shown.json,
        }))?;
    } else if !style.quiet {
        summary.show(false)?;
        scores.show(false)?;
        exported.show(false)?;
        checked.shown.show(false)?;
        say(format!("capture in {}, replica in {}", capture.display(), replica.display()))?;
    }
    if checked.passed { Ok(()) } else { Err(Failure::ChecksFailed(format!("{} does not pass", replica.display()))) }
}

/// Refuses a folder with files of someone else: every demo makes one of two folders first.
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

/// What is where the capture shall be.
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
        let truth = std::fs::read(capture.join("gt/trans.json")).unwrap_or_default();
        let truth: Value = serde_json::from_slice(&truth).unwrap_or_default();
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
