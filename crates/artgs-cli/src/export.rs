//! `artgs export`: a replica as files of simulators, browsers and renderers.

use crate::args::{CollisionKind, Export, UpAxis};
use crate::commands::{Style, use_threads};
use crate::failure::Failure;
use crate::folder::{load_capture, lock, photos_of, require_replica};
use crate::output::{Report, note};
use crate::progress;
use artgs::observer::{Event, Observer};
use artgs_core::Capture;
use artgs_io::RunFolder;
use artgs_io::asset::WriteOptions;
use artgs_io::run_folder::load_json;
use artgs_physical::Up;
use artgs_physical::export::{CollisionSource, ExportError, ExportEvent, ExportOptions, ExportStep};
use std::path::Path;
use std::time::Instant;

pub(crate) fn run(args: &Export, style: Style) -> Result<(), Failure> {
    use_threads(args.threads)?;
    let report = report(args, style, &mut |text| note(text, style))?;
    if style.json || !style.quiet {
        report.show(style.json)?;
    }
    note(&format!("artgs check {} tests what was written", args.out.display()), style);
    Ok(())
}

/// Exports, and reports what was decided; `remark` gets what is unexpected.
pub(crate) fn report(args: &Export, style: Style, remark: &mut dyn FnMut(&str)) -> Result<Report, Failure> {
    let run = RunFolder::new(&args.out);
    let up = args.up.or_else(|| up_of_recordings(&run)).unwrap_or(UpAxis::Z);
    let options = options(args, up);
    options.config().map_err(failure)?;
    require_replica(&run)?;
    let lock = lock(&run, "artgs export", style)?;
    let report = export_with(&run, &options, remark, observer(style).as_mut());
    drop(lock);
    report
}

/// Shows the steps, but not between other JSON.
fn observer(style: Style) -> Box<dyn Observer> {
    let quiet = Style { silent: style.silent || style.quiet || style.json, ..style };
    progress::renderer(quiet)
}

/// Upward axis of the recordings that a run aligned; none if it aligned none, they state none, or it is no axis.
fn up_of_recordings(run: &RunFolder) -> Option<UpAxis> {
    /// Least cosine between the stated direction and an axis.
    const ALONG: f64 = 0.9;
    let report: serde_json::Value = load_json(&run.aligned().join("report.json")).ok()??;
    let [_, y, z]: [f64; 3] = serde_json::from_value(report.get("up")?.clone()).ok()?;
    if y > ALONG { Some(UpAxis::Y) } else { (z > ALONG).then_some(UpAxis::Z) }
}

/// What the flags ask for.
fn options(args: &Export, up: UpAxis) -> ExportOptions {
    let defaults = ExportOptions::default();
    ExportOptions {
        formats: if args.to.is_empty() { defaults.formats } else { args.to.iter().map(|format| format.0).collect() },
        name: args.name.clone(),
        capture: args.capture.clone(),
        scale: args.scale,
        up: if up == UpAxis::Z { Up::Z } else { Up::Y },
        density: args.density.iter().filter(|(part, _)| part.is_none()).map(|(_, density)| *density).next_back(),
        densities: args.density.iter().filter_map(|(part, density)| Some((part.clone()?, *density))).collect(),
        mass: args.mass,
        collision: match args.collision {
            CollisionKind::Hulls => CollisionSource::Hulls,
            CollisionKind::Coacd => CollisionSource::Coacd,
            CollisionKind::None => CollisionSource::None,
        },
        hulls: args.hulls,
        observed_limits: args.observed_limits,
        triangles: args.triangles,
        texel: args.texel,
        front: args.front,
        part_names: args.part_names,
        write: WriteOptions { actuators: args.actuators, free_base: args.free_base, package: args.package.clone() },
    }
}

/// Writes the formats into a folder that is locked and reports what was decided.
pub(crate) fn export_locked(run: &RunFolder, options: &ExportOptions, style: Style) -> Result<Report, Failure> {
    export_with(run, options, &mut |text| note(text, style), observer(style).as_mut())
}

fn export_with(
    run: &RunFolder,
    options: &ExportOptions,
    remark: &mut dyn FnMut(&str),
    shown: &mut dyn Observer,
) -> Result<Report, Failure> {
    options.config().map_err(failure)?;
    require_replica(run)?;
    let capture = capture(run, options.capture.as_deref(), remark)?;
    let mut steps = Steps::new(shown);
    let report = artgs_physical::export::export(run, options, capture.as_ref(), |event| match event {
        ExportEvent::Warning(warning) => remark(warning),
        ExportEvent::Begins(step) => steps.begin(step),
        ExportEvent::Written(done, all) => steps.written(done, all),
    });
    let report = report.map_err(failure)?;
    steps.end();
    Report::new(&report)
}

/// The steps of an export as stages of a run.
struct Steps<'a> {
    shown: &'a mut dyn Observer,
    current: Option<(ExportStep, Instant)>,
}

impl<'a> Steps<'a> {
    fn new(shown: &'a mut dyn Observer) -> Self {
        Self { shown, current: None }
    }

    fn begin(&mut self, step: ExportStep) {
        self.end();
        self.current = Some((step, Instant::now()));
        self.shown.event(Event::started(step.name()));
    }

    fn written(&mut self, done: usize, all: usize) {
        let stage = ExportStep::Write.name().into();
        self.shown.event(Event::Progress { stage, step: done, total: all, loss: None, psnr: None, gaussians: None });
    }

    fn end(&mut self) {
        if let Some((step, begun)) = self.current.take() {
            self.shown.event(Event::finished(step.name(), begun.elapsed().as_secs_f64(), false));
        }
    }
}

fn failure(error: ExportError) -> Failure {
    match error {
        ExportError::Setting { name, value } => Failure::bad(format!("--{name} is {value}; give a number above 0")),
        ExportError::Front(_) => Failure::bad(format!("--front: {error}")),
        error if error.is_bad_input() => Failure::bad_input(error),
        error => Failure::failed(error),
    }
}

/// The photos of the replica: in the folder that the user named, or else where the run found them.
fn capture(run: &RunFolder, named: Option<&Path>, remark: &mut dyn FnMut(&str)) -> Result<Option<Capture>, Failure> {
    let photos = match named {
        Some(folder) => Some(load_capture(folder)?),
        None => photos_of(run, None).and_then(|folder| load_capture(&folder).ok()),
    };
    match &photos {
        Some(capture) if artgs::run::made_from(run, capture) == Some(false) => {
            remark("the capture is not the one the replica was made of: textures may not fit");
        }
        None => {
            remark("the photos are not where they were: textures hold the colours of the meshes; see --capture");
        }
        Some(_) => {}
    }
    Ok(photos)
}
