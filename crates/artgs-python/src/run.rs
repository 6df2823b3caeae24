//! Reconstruction, discovery, and the description of inputs.

use crate::capture::Capture;
use crate::errors::{CallError, whole};
use crate::settings::{self, Changes, Parts};
use crate::work::work;
use artgs::align::ObjectBox;
use artgs::fit::Chosen;
use artgs::observer::Observer;
use artgs::prepare::{Inspected, RecordingFiles, inspect as inspected};
use artgs::run::{Earlier, FoundReport, Output, RunOptions, finds_parts};
use artgs::{Input, Reconstruction, Request};
use artgs_core::{Intrinsics, PerState, State};
use artgs_io::capture::is_capture;
use artgs_io::recording::{AxisOrder, RecordingFormat, RecordingOptions, parse_depth_unit};
use artgs_io::{BoxBounds, RunFolder};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// A capture in memory, or where files are.
#[derive(FromPyObject)]
pub(crate) enum Source<'py> {
    Memory(Bound<'py, Capture>),
    Files(PathBuf),
}

/// A box of six numbers, or a file with one.
#[derive(Debug, FromPyObject)]
enum Bounds {
    Numbers(Vec<f64>),
    File(PathBuf),
}

/// The arguments of a run, of a dictionary of Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct RunArguments {
    out: PathBuf,
    parts: Option<Parts>,
    preset: String,
    seed: Option<i64>,
    device: String,
    resume: bool,
    force: bool,
    force_input: bool,
    memory: Option<String>,
    r#box: Option<Bounds>,
    recording: RecordingArguments,
}

/// How recordings are read.
#[derive(Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct RecordingArguments {
    format: Option<String>,
    frames: Option<i64>,
    every: Option<i64>,
    intrinsics: Option<Vec<f64>>,
    poses: Vec<PathBuf>,
    depth_unit: Option<String>,
    camera_axes: Option<String>,
    invert_poses: bool,
}

impl RecordingArguments {
    /// An argument that is given.
    fn given(&self) -> Option<&'static str> {
        let all = [
            ("format", self.format.is_some()),
            ("frames", self.frames.is_some()),
            ("every", self.every.is_some()),
            ("intrinsics", self.intrinsics.is_some()),
            ("poses", !self.poses.is_empty()),
            ("depth_unit", self.depth_unit.is_some()),
            ("camera_axes", self.camera_axes.is_some()),
            ("invert_poses", self.invert_poses),
        ];
        all.into_iter().find_map(|(name, given)| given.then_some(name))
    }

    fn options(&self, state: State) -> Result<RecordingOptions, CallError> {
        let default = RecordingOptions::default();
        let wrong = |name: &'static str| move |reason: String| CallError::input(format!("`{name}`: {reason}"));
        let format = |name: &String| {
            let known = RecordingFormat::ALL.map(RecordingFormat::name).join(", ");
            RecordingFormat::from_name(name).ok_or_else(|| format!("there is no format {name:?}; there are {known}"))
        };
        let format = self.format.as_ref().map(format).transpose().map_err(wrong("format"))?;
        let unit = self.depth_unit.as_deref().map(parse_depth_unit).transpose().map_err(wrong("depth_unit"))?;
        let axes = self.camera_axes.as_deref().map(AxisOrder::parse).transpose().map_err(wrong("camera_axes"))?;
        let intrinsics = self.intrinsics.as_deref().map(lens).transpose()?;
        Ok(RecordingOptions {
            format,
            frames: whole("frames", self.frames)?.unwrap_or(default.frames),
            intrinsics,
            poses: self.poses.get(state.index()).or(self.poses.first()).cloned(),
            depth_unit: unit,
            axes,
            inverted_poses: self.invert_poses,
            every: whole("every", self.every)?.unwrap_or(default.every),
            ..default
        })
    }
}

/// Focal lengths and principal point as calibration tools publish them, with the centre of the first pixel at (0, 0).
fn lens(numbers: &[f64]) -> Result<Intrinsics, CallError> {
    match *numbers {
        [fx, fy, cx, cy] if fx > 0.0 && fy > 0.0 && numbers.iter().all(|v| v.is_finite()) => {
            Ok(Intrinsics { fx, fy, cx: cx + 0.5, cy: cy + 0.5, width: 0, height: 0 })
        }
        _ => Err(CallError::input("`intrinsics`: give fx, fy, cx, cy in pixels, focal lengths above 0")),
    }
}

/// What the caller named, before it is looked for.
enum Named {
    Memory(Arc<artgs_core::Capture>),
    Files(Vec<PathBuf>),
}

impl Named {
    fn new(start: Source<'_>, end: Option<PathBuf>) -> Self {
        match start {
            Source::Memory(capture) => Self::Memory(Arc::clone(&capture.get().0)),
            Source::Files(start) => Self::Files(std::iter::once(start).chain(end).collect()),
        }
    }

    fn input(self, recording: &RecordingArguments) -> Result<Input, CallError> {
        let input = match self {
            Self::Memory(capture) => Input::Images((*capture).clone()),
            Self::Files(paths) => Input::new(&paths).map_err(artgs::Error::from)?,
        };
        match (&input, recording.given()) {
            (Input::Images(_), Some(name)) => Err(for_recordings(name)),
            // What is no capture is refused with the reason when it is read.
            (Input::Capture(folder), Some(name)) if is_capture(folder) => Err(for_recordings(name)),
            _ => {
                let options = PerState::from_fn(|state| recording.options(state)).transpose()?;
                Ok(input.with_options(options))
            }
        }
    }
}

fn for_recordings(name: &str) -> CallError {
    CallError::input(format!("`{name}` is for the recordings of two states, and this is a capture"))
}

/// A run that can begin.
struct Job {
    request: Request,
    out: PathBuf,
    earlier: Earlier,
    device: Chosen,
}

impl Job {
    fn new(named: Named, arguments: RunArguments, changes: Option<Changes>, trains: bool) -> Result<Self, CallError> {
        let RunArguments { out, parts, preset, seed, device, resume, force, force_input, memory, r#box, recording } =
            arguments;
        let config = settings::config(&preset, changes, parts, seed)?;
        if !trains && !finds_parts(&config) {
            return Err(artgs::Error::PartsLearnt.into());
        }
        let earlier = match (resume, force) {
            (true, _) => Earlier::Resume,
            (_, true) => Earlier::Discard,
            _ => Earlier::Refuse,
        };
        let input = named.input(&recording)?;
        Output::check(&RunFolder::new(&out), earlier, input.photos()).map_err(artgs::Error::from)?;
        let device = settings::device(&device, &config)?;
        let size = |text: String| {
            let size: Result<bytesize::ByteSize, _> = text.parse();
            size.map(|size| size.as_u64())
                .map_err(|_| CallError::input(format!("`memory` is {text:?}; give a size such as \"4GiB\"")))
        };
        let memory = memory.map(size).transpose()?;
        let object_box = r#box.map(object_box).transpose()?;
        Ok(Self { request: Request { input, config, object_box, memory, force_input }, out, earlier, device })
    }

    /// Prepares the input, locks the folder, and does something with what is ready.
    fn begin<T>(
        self,
        observer: &mut dyn Observer,
        act: impl FnOnce(&Reconstruction<'_>, &RunFolder, &mut dyn Observer) -> Result<T, artgs::Error>,
    ) -> Result<T, CallError> {
        let options = RunOptions { earlier: self.earlier, device: Some(&self.device), owner: "artgs in Python" };
        let begun = self.request.begin(self.out, &options, observer)?;
        let run = begun.reconstruction(options.device);
        Ok(act(&run, begun.output.folder(), observer)?)
    }
}

fn object_box(bounds: Bounds) -> Result<ObjectBox, CallError> {
    let wrong = |reason: &dyn std::fmt::Display| CallError::input(format!("`box`: {reason}"));
    let (lower, upper) = match bounds {
        Bounds::Numbers(numbers) => match numbers[..] {
            [a, b, c, d, e, f] => ([a, b, c], [d, e, f]),
            _ => return Err(wrong(&"a box is six numbers: the lower corner and the upper one")),
        },
        Bounds::File(path) => match BoxBounds::read(&path) {
            Ok(BoxBounds { lower, upper }) => (lower, upper),
            // The form in which a run prints it.
            Err(error) => return path.to_string_lossy().parse().map_err(|_| wrong(&error)),
        },
    };
    ObjectBox::new(lower.into(), upper.into()).map_err(|reason| wrong(&reason))
}

/// Makes a replica in the folder of the arguments.
#[pyfunction]
#[pyo3(signature = (start, end, arguments, config, callback, threads))]
pub(crate) fn reconstruct(
    py: Python<'_>,
    start: Source<'_>,
    end: Option<PathBuf>,
    arguments: RunArguments,
    config: Option<Changes>,
    callback: Option<Bound<'_, PyAny>>,
    threads: Option<usize>,
) -> PyResult<()> {
    let named = Named::new(start, end);
    work(py, callback, threads, move |observer| {
        let job = Job::new(named, arguments, config, true)?;
        job.begin(observer, |run, folder, observer| run.run_in(folder, observer).map(drop))
    })
}

/// Finds parts and joints in the folder of the arguments; returns them as JSON.
#[pyfunction]
#[pyo3(signature = (start, end, arguments, config, callback, threads))]
pub(crate) fn discover(
    py: Python<'_>,
    start: Source<'_>,
    end: Option<PathBuf>,
    arguments: RunArguments,
    config: Option<Changes>,
    callback: Option<Bound<'_, PyAny>>,
    threads: Option<usize>,
) -> PyResult<String> {
    let named = Named::new(start, end);
    work(py, callback, threads, move |observer| {
        let job = Job::new(named, arguments, config, false)?;
        let found = job.begin(observer, |run, folder, observer| run.find_parts_in(folder, observer))?;
        serde_json::to_string(&FoundReport::new(&found)).map_err(CallError::failed)
    })
}

/// Describes a capture, or each of one or two recordings, as JSON.
#[pyfunction]
pub(crate) fn inspect(py: Python<'_>, paths: Vec<PathBuf>) -> PyResult<String> {
    work(py, None, None, move |_| {
        let found = match &paths[..] {
            [path] if RecordingFormat::of(path).is_some() => {
                let files = RecordingFiles { path: path.clone(), options: RecordingOptions::default() };
                vec![Inspected::recording(&files)?]
            }
            _ => inspected(&Input::new(&paths).map_err(artgs::Error::from)?)?,
        };
        serde_json::to_string(&found).map_err(CallError::failed)
    })
}
