//! Recordings of phones and depth cameras: read, and aligned into one capture.

use super::PrepareError;
use super::input::{RecordingFiles, require_two};
use crate::align::{AlignReport, LEAST_FRAMES, ObjectBox, align_with_progress};
use crate::config::Config;
use crate::observer::{Event, Observer, percent};
use artgs_core::{Capture, PerState, Recording, State, Upward};
use artgs_io::recording::{RecordingOptions, load_recording};
use std::path::Path;
use std::time::Instant;

/// Reads the recording of each state, with images of at most `longest_side` pixels. Refuses one without depth.
pub(super) fn load(files: PerState<RecordingFiles>, longest_side: u32) -> Result<PerState<Recording>, PrepareError> {
    require_two(&files)?;
    let read = |RecordingFiles { path, options }| {
        let longest_side = options.longest_side.min(longest_side);
        let recording = load_recording(&path, &RecordingOptions { longest_side, ..options })?;
        few_depths(&path, &recording).map_or(Ok(recording), |why| Err(PrepareError::FewDepths(why)))
    };
    files.map(read).transpose()
}

/// Why a recording has too little depth to be aligned with that of the other state, if it has: also what the reader said of it.
pub(super) fn few_depths(path: &Path, recording: &Recording) -> Option<String> {
    let count = recording.frames.iter().filter(|frame| frame.view.depth.is_some()).count();
    let path = path.display();
    let refused = format!(
        "{path}: {count} frames have depth, at least {LEAST_FRAMES} are needed to align the recordings of two states; add depth \
         images that are missing, record with depth, or give one capture with the cameras of both states in one frame"
    );
    (count < LEAST_FRAMES)
        .then(|| recording.warnings.iter().fold(refused, |text, warning| format!("{text}\n{warning}")))
}

/// Aligns recordings in the stage `align`, and reports what was found. The capture has a warning for everything else that moved.
pub(super) fn aligned(
    recordings: &PerState<Recording>,
    config: &Config,
    object_box: Option<&ObjectBox>,
    observer: &mut dyn Observer,
) -> Result<(Capture, AlignReport), PrepareError> {
    let begun = Instant::now();
    observer.event(Event::started("align"));
    let (mut capture, report) = {
        let mut done = percent(observer, "align");
        align_with_progress(recordings, &config.align, object_box, config.seed, &mut done)?
    };
    observer.event(Event::finished("align", begun.elapsed().as_secs_f64(), false));
    observer.event(Event::note(described(&report)));
    observer.event(Event::note(upward(&report)));
    if !report.upward.is_certain() {
        let what = "which way is up is not known: the recordings do not state it, and no floor or walls say it";
        capture.warnings.push(format!("{what}; an export needs --up"));
    }
    capture.warnings.extend(report.bystanders.iter().map(|b| format!("{b}; --box with a larger box includes it")));
    capture.warnings.extend(report.left_out.map(|left| {
        format!(
            "what stands on the object and did not move was left out (in {}); --box {} keeps it",
            left.rounded(),
            report.object.joined(&left).rounded()
        )
    }));
    Ok((capture, report))
}

/// One sentence for people.
fn described(report: &AlignReport) -> String {
    let size = report.object.upper() - report.object.lower();
    let views = &report.views;
    let other = report.runner_up.map_or("no other is possible".into(), |s| format!("the next has {s:.2}"));
    let disagreement = report.disagreement.as_ref().map(|d| format!("{:.4} to {:.4}", d[0], d[1]));
    let exposure = report.exposure.map_or_else(String::new, |e| format!("; {}", e.sentence()));
    format!(
        "the states are aligned with score {:.2} ({other}); surfaces of different frames disagreed by {} at the start and {} \
         at the end; the object is {:.2} x {:.2} x {:.2} units, shown by {} and {} frames; \
         its box is --box {}{exposure}",
        report.score,
        disagreement[State::START],
        disagreement[State::END],
        size.x,
        size.y,
        size.z,
        views[State::START],
        views[State::END],
        report.object.rounded()
    )
}

/// Which way is up, one sentence.
fn upward(report: &AlignReport) -> String {
    let Upward { direction, source, confidence } = report.upward;
    let [x, y, z] = direction.to_array().map(|v| v + 0.0);
    format!(
        "up is ({x:.3}, {y:.3}, {z:.3}) in the world of the start recording, {}, certainty {confidence:.2}",
        source.words()
    )
}
