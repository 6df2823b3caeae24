//! Recordings of phones and depth cameras, one per state, as input of `reconstruct` and `inspect`.

use crate::args::RecordingArgs;
use crate::commands::Style;
use crate::failure::Failure;
use crate::progress;
use artgs::align::{AlignConfig, AlignReport, ObjectBox, align_with_progress};
use artgs::observer::{Event, Observer, Tee, percent};
use artgs_core::{Capture, PerState, Recording, State, Upward};
use artgs_io::RunFolder;
use artgs_io::capture::{is_capture, write_capture};
use artgs_io::recording::{
    AxisOrder, RecordingFormat, RecordingOptions, load_recording, parse_depth_unit, parse_intrinsics,
};
use artgs_io::run_folder::{remove_folder, save_json};
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What the user named: one capture folder with both states, or one recording of each state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    Capture(PathBuf),
    Recordings(PerState<PathBuf>),
}

impl Source {
    /// One path is a capture, or a folder with the recordings `start` and `end`; two are recordings.
    pub(crate) fn new(paths: &[PathBuf]) -> Result<Self, Failure> {
        match paths {
            [capture] => match RecordingFormat::of(capture) {
                Some(format) => Err(Failure::bad(format!(
                    "{}: a recording of one state ({}); give the recordings of both states: artgs reconstruct CLOSED OPEN \
                     -o OUT",
                    capture.display(),
                    format.name()
                ))),
                None => Ok(RecordingFormat::of_two_states(capture)
                    .map_or_else(|| Self::Capture(capture.clone()), Self::Recordings)),
            },
            [start, end] => Ok(Self::Recordings(PerState::new(start.clone(), end.clone()))),
            _ => Err(Failure::bad("give one capture, or the recordings of two states")),
        }
    }
}

/// An option of recordings that is given.
pub(crate) fn given_option(args: &RecordingArgs) -> Option<&'static str> {
    let all = [
        ("--format", args.format.is_some()),
        ("--frames", args.frames.is_some()),
        ("--intrinsics", args.intrinsics.is_some()),
        ("--poses", !args.poses.is_empty()),
        ("--depth-unit", args.depth_unit.is_some()),
        ("--camera-axes", args.camera_axes.is_some()),
        ("--invert-poses", args.invert_poses),
        ("--every", args.every != 1),
        ("--offset", !args.offset.is_empty()),
    ];
    all.into_iter().find_map(|(option, given)| given.then_some(option))
}

/// Refuses options of recordings where there is a capture.
pub(crate) fn require_none(args: &RecordingArgs, capture: &Path) -> Result<(), Failure> {
    match given_option(args).filter(|_| is_capture(capture)) {
        Some(option) => {
            Err(Failure::bad(format!("{option} is for the recordings of two states, and this is a capture")))
        }
        None => Ok(()),
    }
}

/// Largest number of frames of one recording that are used.
pub(crate) fn most_frames(args: &RecordingArgs) -> usize {
    args.frames.unwrap_or(RecordingOptions::default().frames)
}

/// Reads the recording of each state, with images of at most `longest_side` pixels.
pub(crate) fn load(
    paths: &PerState<PathBuf>,
    args: &RecordingArgs,
    longest_side: u32,
) -> Result<PerState<Recording>, Failure> {
    if let Some(capture) = paths.iter().find(|path| is_capture(path)) {
        return Err(Failure::bad(format!(
            "{}: not a recording, but a capture of both states; give it alone",
            capture.display()
        )));
    }
    if paths[State::START] == paths[State::END] && args.offset.is_empty() {
        let shown = paths[State::START].display();
        return Err(Failure::bad(format!("{shown}: the same recording twice; give the recordings of two states")));
    }
    let read = |state: State| {
        let options = RecordingOptions { longest_side, ..options(state, args)? };
        load_recording(&paths[state], &options).map_err(Failure::bad_input)
    };
    PerState::from_fn(read).transpose()
}

/// Reads the recording of one state.
pub(crate) fn load_state(path: &Path, state: State, args: &RecordingArgs) -> Result<Recording, Failure> {
    load_recording(path, &options(state, args)?).map_err(Failure::bad_input)
}

fn options(state: State, args: &RecordingArgs) -> Result<RecordingOptions, Failure> {
    let default = RecordingOptions::default();
    let format = match args.format.as_deref() {
        None => None,
        Some(name) => Some(RecordingFormat::from_name(name).ok_or_else(|| {
            let known = RecordingFormat::ALL.map(RecordingFormat::name).join(", ");
            Failure::bad(format!("--format {name}: there is no such format; there are {known}"))
        })?),
    };
    let intrinsics = args.intrinsics.as_deref().map(parse_intrinsics).transpose();
    let depth_unit = args.depth_unit.as_deref().map(parse_depth_unit).transpose();
    let axes = args.camera_axes.as_deref().map(AxisOrder::parse).transpose();
    Ok(RecordingOptions {
        format,
        frames: most_frames(args),
        intrinsics: intrinsics.map_err(|reason| Failure::bad(format!("--intrinsics: {reason}")))?,
        poses: args.poses.get(state.index()).or(args.poses.first()).cloned(),
        depth_unit: depth_unit.map_err(|reason| Failure::bad(format!("--depth-unit: {reason}")))?,
        axes: axes.map_err(|reason| Failure::bad(format!("--camera-axes: {reason}")))?,
        inverted_poses: args.invert_poses,
        every: args.every,
        offset: args.offset.get(state.index()).copied().unwrap_or(0),
        ..default
    })
}

/// Aligns recordings; shows progress and what was found, `also` gets it, too. The capture has a warning for everything else that moved.
pub(crate) fn aligned(
    recordings: &PerState<Recording>,
    config: &AlignConfig,
    given: Option<&ObjectBox>,
    seed: u64,
    style: Style,
    also: &mut dyn Observer,
) -> Result<(Capture, AlignReport), Failure> {
    let mut renderer = progress::renderer(style);
    let mut shown = Tee(renderer.as_mut(), also);
    let begun = Instant::now();
    shown.event(Event::started("align"));
    let (mut capture, report) = {
        let mut done = percent(&mut shown, "align");
        align_with_progress(recordings, config, given, seed, &mut done).map_err(Failure::bad_input)?
    };
    shown.event(Event::finished("align", begun.elapsed().as_secs_f64(), false));
    shown.event(Event::note(described(&report)));
    shown.event(Event::note(upward(&report)));
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

/// Writes an aligned or corrected capture, and the report of what was done, into the folder of a run, where exports and the page find its photos.
pub(crate) fn save(run: &RunFolder, capture: &Capture, report: &impl Serialize) -> Result<PathBuf, Failure> {
    let folder = run.aligned();
    // An earlier one may have more frames.
    remove_folder(&folder).map_err(Failure::failed)?;
    write_capture(&folder, capture).map_err(Failure::failed)?;
    save_json(&folder.join("report.json"), report).map_err(Failure::failed)?;
    Ok(folder)
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

/// What `inspect` says about a recording.
#[derive(Debug, Serialize)]
pub(crate) struct RecordingSummary {
    format: &'static str,
    recorded: usize,
    kept: usize,
    image_size: [usize; 2],
    focal_length: [f64; 2],
    depth_frames: usize,
    depth_step: f64,
    /// Share of pixels with depth, 0 to 1.
    depth_share: f64,
    masks: bool,
    metric: bool,
    up: Option<[f64; 3]>,
    /// Length of the camera's path, scene units.
    path: f64,
    warnings: Vec<String>,
}

impl RecordingSummary {
    pub(crate) fn new(recording: &Recording) -> Self {
        let first = recording.frames.first().map(|f| &f.view);
        let depths = || recording.frames.iter().filter_map(|f| f.view.depth.as_ref());
        let pixels: usize = depths().map(|d| d.len()).sum();
        let valid: usize = depths().map(|d| d.counts().iter().filter(|c| **c > 0).count()).sum();
        let eyes = recording.frames.iter().map(|f| f.view.camera.position());
        let path = eyes.clone().zip(eyes.skip(1)).map(|(a, b)| a.distance(b)).sum();
        Self {
            format: recording.format,
            recorded: recording.recorded,
            kept: recording.frames.len(),
            image_size: first.map_or([0, 0], |v| v.size().into()),
            focal_length: first.map_or([0.0; 2], |v| [v.camera.intrinsics.fx, v.camera.intrinsics.fy]),
            depth_frames: depths().count(),
            depth_step: recording.frames.first().map_or(1.0, |f| f.depth_step),
            depth_share: valid as f64 / pixels.max(1) as f64,
            masks: recording.has_masks(),
            metric: recording.metric,
            up: recording.up.map(|u| u.to_array()),
            path,
            warnings: recording.warnings.clone(),
        }
    }
}

impl fmt::Display for RecordingSummary {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let ([w, h], [fx, fy]) = (self.image_size, self.focal_length);
        writeln!(f, "format        {}", self.format)?;
        writeln!(f, "frames        {} of {} recorded", self.kept, self.recorded)?;
        writeln!(f, "images        {w}x{h}, focal length {fx:.1} x {fy:.1} pixels")?;
        match self.depth_frames {
            0 => writeln!(f, "depth         none; the recordings of two states cannot be aligned without depth")?,
            n => writeln!(
                f,
                "depth         in {n} frames, on {:.1} % of the pixels, one measurement per {:.1} pixels",
                100.0 * self.depth_share,
                self.depth_step
            )?,
        }
        writeln!(
            f,
            "masks         {}",
            if self.masks { "yes" } else { "no; the object is selected by what the cameras look at" }
        )?;
        writeln!(f, "unit          {}", if self.metric { "metres" } else { "unknown" })?;
        match self.up {
            Some([x, y, z]) => writeln!(f, "up            ({x:.2}, {y:.2}, {z:.2})")?,
            None => writeln!(f, "up            not stated")?,
        }
        writeln!(f, "camera path   {:.2} long", self.path)?;
        self.warnings.iter().try_for_each(|w| writeln!(f, "warning: {w}"))
    }
}
