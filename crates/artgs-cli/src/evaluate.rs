//! `artgs evaluate`: scores of a replica.

use crate::args::Evaluate;
use crate::commands::{Style, use_threads};
use crate::failure::Failure;
use crate::folder::{load_capture, require_replica};
use crate::output::{Report, note, write_json};
use artgs::evaluate::{Lpips, PictureReport, Scores, score_replica};
use artgs_core::Capture;
use artgs_io::RunFolder;
use std::path::Path;

pub(crate) fn run(args: &Evaluate, style: Style) -> Result<(), Failure> {
    use_threads(args.threads)?;
    let scores = scores(args, &mut |text| note(text, style))?;
    scores.show(style.json)
}

/// The scores that are asked for, in a file as well if it is named; `remark` gets what is unexpected.
pub(crate) fn scores(args: &Evaluate, remark: &mut dyn FnMut(&str)) -> Result<Report, Failure> {
    for folder in std::iter::once(&args.out).chain(&args.gt) {
        if !folder.is_dir() {
            let what = if folder.exists() { "is a file; give a folder" } else { "no such folder" };
            return Err(Failure::bad(format!("{}: {what}", folder.display())));
        }
    }
    if let Some(capture) =
        args.gt.as_ref().filter(|gt| !gt.join("trans.json").exists() && gt.join("gt/trans.json").exists())
    {
        let shown = capture.display();
        return Err(Failure::bad(format!("{shown}: a capture; give the folder of its ground truth: --gt {shown}/gt")));
    }
    if let Some(file) = args.json.as_ref().filter(|file| file.as_os_str() != "-") {
        require_place(file)?;
    }
    let run = RunFolder::new(&args.out);
    require_replica(&run)?;
    let ground_truth = args.gt.as_deref();
    let scores = match &args.capture {
        None => score(&run, ground_truth, None)?,
        Some(folder) => {
            let lpips = args.lpips.as_deref().map(Lpips::load).transpose().map_err(Failure::bad_input)?;
            let capture = load_capture(folder)?;
            if let Some(reason) = no_pictures(&run, &capture) {
                remark(&format!("images are not scored: {reason}"));
            }
            score(&run, ground_truth, Some((&capture, lpips.as_ref())))?
        }
    };
    if let Some(file) = args.json.as_ref().filter(|file| file.as_os_str() != "-") {
        write_json(file, &scores)?;
    }
    Ok(scores)
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

/// Why a replica cannot be compared with the held-out views of a capture.
fn no_pictures(run: &RunFolder, capture: &Capture) -> Option<String> {
    if !run.has_splats() {
        return Some(format!("{} has no Gaussians, splats/canonical.ply is missing", run.root().display()));
    }
    capture.states.iter().all(|s| s.test.is_empty()).then(|| "the capture has no held-out views".into())
}

/// Scores a replica against the ground truth, against the held-out views of a capture, or both.
pub(crate) fn score(
    run: &RunFolder,
    ground_truth: Option<&Path>,
    capture: Option<(&Capture, Option<&Lpips>)>,
) -> Result<Report, Failure> {
    let pictures = capture.map(|(capture, lpips)| score_replica(run, capture, lpips));
    let pictures = pictures.transpose().map_err(Failure::bad_input)?;
    match ground_truth {
        None => Report::new(&PictureReport { pictures: pictures.unwrap_or_default() }),
        Some(folder) => {
            // Files that are only read are for the user to correct.
            let scores = artgs::run::evaluate(run, folder).map_err(Failure::bad_input)?;
            Report::new(&Scores { pictures, ..scores })
        }
    }
}
