//! One object of the population from its seed to its row.

use super::overlap::{Confusion, TrueSurface, pairs};
use super::preview::{Shown, draw};
use super::row::{Row, Status};
use super::run::Options;
use super::score::{result_of, score};
use super::truth::Description;
use crate::launch::{Ended, Exit, execute};
use artgs_core::{PerState, State};
use artgs_io::ground_truth::read_true_joints;
use artgs_io::image_io::write_rgb;
use artgs_io::recording::RecordingFormat;
use artgs_io::run_folder::remove_folder;
use artgs_io::{FileError, RunFolder, load_capture_with};
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Longest side of the photos in a preview before they are cut out, pixels.
const PHOTO: u32 = 400;
/// How [`crate::launch`] begins the reason of a refused capture.
const REFUSED: &str = "exit code 2: ";

/// Files of one object in the folder of a bench.
pub(super) struct Files {
    /// Removed at the end unless it is to be kept.
    work: PathBuf,
    capture: PathBuf,
    run: PathBuf,
    make_log: PathBuf,
    run_log: PathBuf,
    preview: PathBuf,
}

impl Files {
    pub(super) fn new(out: &Path, seed: u64) -> Self {
        let work = out.join("objects").join(seed.to_string());
        let log = |what: &str| out.join("logs").join(format!("{seed}.{what}.log"));
        Self {
            capture: work.join("capture"),
            run: work.join("run"),
            work,
            make_log: log("make"),
            run_log: log("run"),
            preview: out.join("previews").join(format!("{seed}.png")),
        }
    }
}

/// Makes an object, runs and scores it; none if the bench was stopped. Failures are rows.
pub(super) fn measured(
    seed: u64,
    options: &Options,
    program: &Path,
    version: &str,
    stop: &AtomicBool,
) -> Result<Option<Row>, FileError> {
    let files = Files::new(&options.out, seed);
    let mut row = Row { seed, sensor: options.sensor.clone(), program: version.into(), ..Row::default() };
    let begun = Instant::now();
    let made = execute(program, &make(seed, options, &files), &files.make_log, options.timeout, stop);
    row.make_seconds = begun.elapsed().as_secs_f64();
    match made.ended {
        Ended::Stopped => return Ok(None),
        Ended::Failed(reason) => fail(&mut row, format!("the object could not be made: {reason}")),
        Ended::Success => {
            // Files of an unfinished run would be reused and make the time of this one too short.
            remove_folder(&files.run)?;
            let begun = Instant::now();
            let exit = execute(program, &reconstruct(options, &files), &files.run_log, options.timeout, stop);
            if exit.ended == Ended::Stopped {
                return Ok(None);
            }
            row.seconds = begun.elapsed().as_secs_f64();
            let completed = catch_unwind(AssertUnwindSafe(|| complete(&mut row, &exit, &files)));
            if let Err(reason) = completed.unwrap_or_else(|_| Err("scoring crashed".into())) {
                fail(&mut row, format!("cannot be scored: {reason}"));
            }
        }
    }
    if !options.keep {
        remove_folder(&files.work)?;
    }
    Ok(Some(row))
}

fn fail(row: &mut Row, reason: String) {
    // Nothing of an unfinished score may count.
    let unscored = Row {
        seed: row.seed,
        category: row.category.clone(),
        sensor: row.sensor.clone(),
        features: row.features.clone(),
        decidable: row.decidable,
        undecidable: row.undecidable.clone(),
        parts_true: row.parts_true,
        missing: row.parts_true,
        make_seconds: row.make_seconds,
        seconds: row.seconds,
        cpu_seconds: row.cpu_seconds,
        peak_memory_mib: row.peak_memory_mib,
        program: row.program.clone(),
        ..Row::default()
    };
    *row = Row { status: Status::Failed, reason, ..unscored };
}

/// The command that makes an object. A capture that is complete is reused by it.
fn make(seed: u64, options: &Options, files: &Files) -> Vec<OsString> {
    let mut args: Vec<OsString> = vec!["synth".into(), "--random".into(), seed.to_string().into()];
    args.extend(["-o".into(), files.capture.clone().into()]);
    if options.sensor != Options::ANY {
        args.extend(["--sensor".into(), options.sensor.clone().into()]);
    }
    if let Some(size) = options.size {
        args.extend(["--size".into(), size.to_string().into()]);
    }
    if options.still {
        args.push("--still".into());
    }
    add_threads(&mut args, options);
    args
}

/// The command that runs an object. The number of parts is never given.
fn reconstruct(options: &Options, files: &Files) -> Vec<OsString> {
    let mut args: Vec<OsString> = vec!["reconstruct".into(), files.capture.clone().into()];
    args.extend(["-o".into(), files.run.clone().into(), "--json".into()]);
    if options.stop_after_discover {
        args.extend(["--stop-after".into(), "discover".into()]);
    }
    if let Some(device) = &options.device {
        args.extend(["--device".into(), device.into()]);
    }
    add_threads(&mut args, options);
    args
}

fn add_threads(args: &mut Vec<OsString>, options: &Options) {
    if let Some(threads) = options.threads {
        args.extend(["--threads".into(), threads.to_string().into()]);
    }
}

/// Adds what the object is, how its run ended, and its scores; draws the preview.
fn complete(row: &mut Row, exit: &Exit, files: &Files) -> Result<(), String> {
    row.cpu_seconds = exit.cpu_seconds;
    row.peak_memory_mib = exit.peak_memory_mib;
    describe(row, &files.capture)?;
    let run = RunFolder::new(&files.run);
    match &exit.ended {
        Ended::Failed(reason) if exit.code == Some(2) => {
            row.status = Status::Refused;
            row.reason = reason.strip_prefix(REFUSED).unwrap_or(reason).into();
        }
        Ended::Failed(reason) => fail(row, reason.clone()),
        Ended::Success | Ended::Stopped => {}
    }
    let truth = artgs_io::load_ground_truth_of_run(&files.capture, &run).map_err(|e| e.to_string())?;
    let surfaces = PerState::from_fn(|state| TrueSurface::new(&truth, state));
    let found = if row.status == Status::Done { Some(result_of(&run)?.ok_or("the run left no result")?) } else { None };
    let mut covered = Vec::new();
    if let Some(found) = &found {
        let overlaps = Confusion::of(found, &surfaces, truth.joints.len()).overlaps();
        score(row, found, &truth, &overlaps);
        covered = pairs(&overlaps, truth.joints.len());
    }
    let source =
        if RecordingFormat::of_two_states(&files.capture).is_some() { run.aligned() } else { files.capture.clone() };
    let reading = artgs_io::CaptureOptions { longest_side: PHOTO, ..artgs_io::CaptureOptions::default() };
    // A refused capture may have no photos that can be read: then there is no preview.
    if let Ok(photos) = load_capture_with(&source, &reading) {
        let views = PerState::from_fn(|state: State| &photos.states[state].train[..]);
        let found = found.as_ref().map(|found| (found, &covered[..]));
        let picture = draw(&Shown { views, truth: &truth, surfaces: &surfaces, found });
        let size = (picture.width as u32, picture.height as u32);
        write_rgb(&files.preview, size.0, size.1, &picture.rgb).map_err(|e| e.to_string())?;
    }
    Ok(())
}

/// Adds what the capture says about the object.
fn describe(row: &mut Row, capture: &Path) -> Result<(), String> {
    let description = Description::load(capture)?;
    row.undecidable = description.reasons();
    row.decidable = row.undecidable.is_empty();
    row.category = description.category;
    if !description.sensor.is_empty() {
        row.sensor = description.sensor;
    }
    row.features = description.features;
    let joints = read_true_joints(&capture.join("gt")).map_err(|e| e.to_string())?;
    row.parts_true = joints.len() as u32;
    row.missing = row.parts_true;
    Ok(())
}

/// Whether a row is right, in a few words.
pub fn verdict(row: &Row) -> String {
    match row.status {
        Status::Refused => return format!("refused, {}", row.reason),
        Status::Failed => return format!("failed, {}", row.reason),
        Status::Done => {}
    }
    let correct = row.joints.iter().filter(|joint| joint.correct).count();
    let joints = match row.joints.len() - correct {
        0 => String::new(),
        wrong => format!(", {wrong} of {} joints not correct", row.joints.len()),
    };
    let undecidable = if row.decidable { "" } else { ", undecidable" };
    if row.right {
        return format!("right{joints}{undecidable}");
    }
    let parts = [(row.missing, "missing"), (row.extra, "extra")];
    let mut wrong: Vec<String> =
        parts.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}")).collect();
    if row.count_right {
        let what = [(row.types_right, "types"), (row.parents_right, "parents")];
        wrong.extend(what.iter().filter(|(right, _)| !right).map(|(_, what)| (*what).to_string()));
    }
    format!("wrong: {} of {} parts{undecidable}", wrong.join(", "), row.parts_true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::population::row::JointRow;

    #[test]
    fn verdicts_name_what_is_wrong() {
        let joint = |correct| JointRow { correct, ..JointRow::default() };
        let right = Row {
            decidable: true,
            parts_true: 2,
            count_right: true,
            types_right: true,
            parents_right: true,
            right: true,
            joints: vec![joint(true), joint(true)],
            ..Row::default()
        };
        let with = |change: &dyn Fn(&mut Row)| {
            let mut row = right.clone();
            change(&mut row);
            verdict(&row)
        };
        assert_eq!(verdict(&right), "right");
        assert_eq!(with(&|r| r.joints[0].correct = false), "right, 1 of 2 joints not correct");
        let undecidable = with(&|r| (r.right, r.types_right, r.decidable) = (false, false, false));
        assert_eq!(undecidable, "wrong: types of 2 parts, undecidable");
        let count = with(&|r| (r.right, r.count_right, r.missing, r.extra) = (false, false, 1, 3));
        assert_eq!(count, "wrong: 1 missing, 3 extra of 2 parts");
        let refused = with(&|r| (r.status, r.reason) = (Status::Refused, "no depth".into()));
        assert_eq!(refused, "refused, no depth");
    }
}
