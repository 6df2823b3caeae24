//! `artgs evaluate`: scores of a replica.

use crate::args::Evaluate;
use crate::failure::Failure;
use crate::output::{Report, note, write_json};
use crate::style::Style;
use crate::threads::use_threads;
use artgs::evaluate::Lpips;
use artgs::run::{Comparison, compare};
use artgs_io::RunFolder;
use std::path::Path;

/// Scores, in a file as well if it is named.
pub(crate) fn run(args: &Evaluate, style: Style) -> Result<(), Failure> {
    if args.gt.is_none() && args.capture.is_none() {
        return Err(Failure::bad(
            "nothing to compare with: give --gt DIR, the ground truth, --capture DIR, held-out photos, or both",
        ));
    }
    use_threads(args.threads)?;
    let file = args.json.as_ref().filter(|file| file.as_os_str() != "-");
    file.map_or(Ok(()), |file| require_place(file))?;
    let lpips = args.lpips.as_deref().map(Lpips::load).transpose().map_err(Failure::bad_input)?;
    let with = Comparison { ground_truth: args.gt.as_deref(), capture: args.capture.as_deref(), lpips: lpips.as_ref() };
    let scores = scored(&RunFolder::new(&args.out), &with, &mut |text| note(text, style))?;
    file.map_or(Ok(()), |file| write_json(file, &scores))?;
    scores.show(style.json)
}

/// Scores the replica in a folder; `remark` gets what is unexpected.
pub(crate) fn scored(run: &RunFolder, with: &Comparison<'_>, remark: &mut dyn FnMut(&str)) -> Result<Report, Failure> {
    // Files that are only read are for the user to correct.
    Report::new(&compare(run, with, remark).map_err(|error| Failure::of(error).into_bad_input())?)
}

/// Refuses a place where no file can be, before minutes of work.
fn require_place(file: &Path) -> Result<(), Failure> {
    let above = file.ancestors().skip(1).find(|folder| folder.exists());
    match above {
        _ if file.is_dir() => Err(Failure::bad(format!("{}: is a folder; give a file to --json", file.display()))),
        Some(above) if !above.is_dir() => Err(Failure::bad(format!(
            "{}: {} is a file; give another place to --json",
            file.display(),
            above.display()
        ))),
        _ => Ok(()),
    }
}
