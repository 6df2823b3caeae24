//! `artgs export`: a replica as files of simulators, browsers and renderers.

use crate::args::{CollisionKind, Export};
use crate::failure::Failure;
use crate::folder::load_capture;
use crate::output::{Report, note};
use crate::progress;
use crate::style::Style;
use crate::threads::use_threads;
use artgs::observer::{Event, Observer};
use artgs_io::RunFolder;
use artgs_io::asset::{Provenance, WriteOptions};
use artgs_physical::export::{
    CollisionSource, ExportError, ExportEvent, ExportOptions, ExportStep, export_run, export_with_photos,
};
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
fn report(args: &Export, style: Style, remark: &mut dyn FnMut(&str)) -> Result<Report, Failure> {
    let run = RunFolder::new(&args.out);
    let mut shown = observer(style);
    let mut steps = Steps::new(shown.as_mut());
    let report = export_run(&run, options(args), args.up, "artgs export", |event| steps.watch(event, remark));
    let report = report.map_err(|error| match &args.capture {
        // The loader of runs also says what is wrong with the poses or depths.
        Some(photos) if matches!(error, ExportError::Photos(_)) => {
            load_capture(photos).err().unwrap_or_else(|| failure(error))
        }
        _ => failure(error),
    })?;
    steps.end();
    Report::new(&report)
}

/// Shows the steps, but not between other JSON.
fn observer(style: Style) -> Box<dyn Observer> {
    let quiet = Style { silent: style.silent || style.quiet || style.json, ..style };
    progress::renderer(quiet)
}

/// What the flags ask for.
fn options(args: &Export) -> ExportOptions {
    let defaults = ExportOptions::default();
    ExportOptions {
        formats: if args.to.is_empty() { defaults.formats } else { args.to.iter().map(|format| format.0).collect() },
        name: args.name.clone(),
        capture: args.capture.clone(),
        scale: args.scale,
        up: args.up.unwrap_or_default(),
        up_known: None,
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
        write: WriteOptions {
            actuators: args.actuators,
            free_base: args.free_base,
            package: args.package.clone(),
            frames: args.frames,
            spz: args.spz,
            provenance: Provenance {
                author: args.author.clone(),
                license: args.license.clone(),
                item: args.wikidata.clone(),
                ..Provenance::default()
            },
        },
    }
}

/// Writes the formats into a folder that is locked and reports what was decided.
pub(crate) fn export_locked(run: &RunFolder, options: &ExportOptions, style: Style) -> Result<Report, Failure> {
    let mut shown = observer(style);
    let mut steps = Steps::new(shown.as_mut());
    let report = export_with_photos(run, options, |event| steps.watch(event, &mut |text| note(text, style)));
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

    fn watch(&mut self, event: ExportEvent<'_>, remark: &mut dyn FnMut(&str)) {
        match event {
            ExportEvent::Warning(warning) => remark(warning),
            ExportEvent::Begins(step) => self.begin(step),
            ExportEvent::Written(done, all) => self.written(done, all),
        }
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
        ExportError::Setting { name, value, range: [least, most] } => {
            Failure::bad(format!("--{name} is {value:?}; give a number from {least:?} to {most:?}"))
        }
        ExportError::Name(name) => {
            Failure::bad(format!("--name {name:?}: give 1 to 100 characters, one of them a letter or digit"))
        }
        ExportError::UnknownUp => Failure::bad(format!("{error} to --up")),
        ExportError::Front(_) => Failure::bad(format!("--front: {error}")),
        error if error.is_bad_input() => Failure::bad_input(error),
        error => Failure::failed(error),
    }
}
