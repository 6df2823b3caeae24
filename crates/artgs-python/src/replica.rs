//! What is done with a finished replica: exports, checks, scores, its page.

use crate::errors::{CallError, whole};
use crate::work::work;
use artgs::observer::{Event, Observer};
use artgs::prepare::load_capture;
use artgs::run::{Comparison, compare};
use artgs_check::CheckOptions;
use artgs_io::asset::Format;
use artgs_io::{CaptureOptions, RunFolder};
use artgs_physical::Up;
use artgs_physical::export::{ExportError, ExportEvent, ExportOptions, ExportStep, export_run};
use pyo3::prelude::*;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Kilograms per cubic metre of all parts, or of some by their names.
#[derive(Debug, FromPyObject)]
enum Density {
    All(f64),
    Parts(std::collections::BTreeMap<String, f64>),
}

/// The arguments of an export, of a dictionary of Python.
#[derive(Debug, FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct ExportArguments {
    formats: Vec<String>,
    name: Option<String>,
    capture: Option<PathBuf>,
    scale: Option<f64>,
    up: Option<String>,
    front: Option<String>,
    mass: Option<f64>,
    density: Option<Density>,
    collision: Option<String>,
    observed_limits: bool,
    triangles: Option<i64>,
    texel: Option<f64>,
}

impl ExportArguments {
    fn options(self) -> Result<(ExportOptions, Option<Up>), CallError> {
        fn parsed<T: std::str::FromStr>(name: &str, text: Option<String>) -> Result<Option<T>, CallError>
        where
            T::Err: Display,
        {
            text.map(|text| text.parse().map_err(|e| CallError::input(format!("`{name}`: {e}")))).transpose()
        }
        let defaults = ExportOptions::default();
        let formats: Vec<Format> =
            self.formats.iter().map(|name| name.parse().map_err(CallError::input)).collect::<Result<_, _>>()?;
        let (density, densities) = match self.density {
            None => (None, Vec::new()),
            Some(Density::All(density)) => (Some(density), Vec::new()),
            Some(Density::Parts(parts)) => (None, parts.into_iter().collect()),
        };
        let options = ExportOptions {
            formats: if formats.is_empty() { defaults.formats.clone() } else { formats },
            name: self.name.unwrap_or(defaults.name.clone()),
            capture: self.capture,
            scale: self.scale.unwrap_or(defaults.scale),
            front: parsed("front", self.front)?.unwrap_or_default(),
            mass: self.mass,
            density,
            densities,
            collision: parsed("collision", self.collision)?.unwrap_or_default(),
            observed_limits: self.observed_limits,
            triangles: whole("triangles", self.triangles)?,
            texel: self.texel,
            ..defaults
        };
        Ok((options, parsed("up", self.up)?))
    }
}

/// The steps of an export as stages.
struct Steps<'a> {
    observer: &'a mut dyn Observer,
    current: Option<(ExportStep, Instant)>,
}

impl Steps<'_> {
    fn event(&mut self, event: ExportEvent<'_>) {
        match event {
            ExportEvent::Warning(text) => self.observer.event(Event::warning(text)),
            ExportEvent::Begins(step) => {
                self.end();
                self.current = Some((step, Instant::now()));
                self.observer.event(Event::started(step.name()));
            }
            ExportEvent::Written(done, all) => {
                self.observer.event(Event::progress(ExportStep::Write.name(), done, all));
            }
        }
    }

    fn end(&mut self) {
        if let Some((step, begun)) = self.current.take() {
            self.observer.event(Event::finished(step.name(), begun.elapsed().as_secs_f64(), false));
        }
    }
}

/// An error of an export with the arguments that are its remedy; `photos` is the folder that the caller named.
fn failure(error: ExportError, photos: Option<&Path>) -> CallError {
    match (&error, photos) {
        (ExportError::UnknownUp, _) => CallError::input(format!("{error} as `up`")),
        // The loader of runs also says what is wrong with the poses or depths.
        (ExportError::Photos(_), Some(photos)) => {
            let read = load_capture(photos, &CaptureOptions::default());
            read.err().map_or_else(|| CallError::input(&error), CallError::from)
        }
        _ if error.is_bad_input() => CallError::input(error),
        _ => CallError::failed(error),
    }
}

/// Exports the replica in a folder; returns the report as JSON.
#[pyfunction]
pub(crate) fn export(
    py: Python<'_>,
    folder: PathBuf,
    arguments: ExportArguments,
    callback: Option<Bound<'_, PyAny>>,
    threads: Option<usize>,
) -> PyResult<String> {
    work(py, callback, threads, move |observer| {
        let (options, up) = arguments.options()?;
        let photos = options.capture.clone();
        let mut steps = Steps { observer, current: None };
        let report = export_run(&RunFolder::new(folder), options, up, "artgs in Python", |event| steps.event(event));
        let report = report.map_err(|error| failure(error, photos.as_deref()))?;
        steps.end();
        serde_json::to_string(&report).map_err(CallError::failed)
    })
}

/// Checks the exports of the replica in a folder: whether they pass, and the report as JSON.
#[pyfunction]
pub(crate) fn check(py: Python<'_>, folder: PathBuf, threads: Option<usize>) -> PyResult<(bool, String)> {
    work(py, None, threads, move |_| {
        RunFolder::new(&folder).require_replica().map_err(CallError::input)?;
        let report = artgs_check::check(&folder, &CheckOptions::default()).map_err(CallError::input)?;
        Ok((report.passed(), serde_json::to_string(&report).map_err(CallError::failed)?))
    })
}

/// Scores the replica in a folder; returns the scores as JSON.
#[pyfunction]
pub(crate) fn evaluate(
    py: Python<'_>,
    folder: PathBuf,
    ground_truth: Option<PathBuf>,
    capture: Option<PathBuf>,
    threads: Option<usize>,
) -> PyResult<String> {
    work(py, None, threads, move |observer| {
        if ground_truth.is_none() && capture.is_none() {
            return Err(CallError::input("give `ground_truth`, `capture` or both: what the replica is compared with"));
        }
        let with = Comparison { ground_truth: ground_truth.as_deref(), capture: capture.as_deref(), lpips: None };
        let remark = &mut |text: &str| observer.event(Event::warning(text));
        // Files that are only read are for the caller to correct.
        let compared = compare(&RunFolder::new(folder), &with, remark).map_err(CallError::input)?;
        serde_json::to_string(&compared).map_err(CallError::failed)
    })
}

/// The page of the replica in a folder, which loads nothing.
#[pyfunction]
pub(crate) fn page(py: Python<'_>, folder: PathBuf) -> PyResult<String> {
    work(py, None, None, move |_| artgs_cli::replica_page(&folder).map_err(CallError::from))
}
