//! From a run's folder to exported files: reads the replica, builds the asset, writes every format and `export.json`.

mod date;
mod error;
mod options;
mod portrait;
mod report;
mod run;

pub use crate::step::ExportStep;
pub use error::{ExportError, ExportEvent};
pub use options::{CollisionSource, ExportOptions, FrontAxis};
pub use run::{export_run, export_with_photos, upward};

use crate::GivenClass;
use crate::build::{BuiltAsset, Parts, build};
use crate::collision::coacd;
use crate::settings::PortraitSettings;
use artgs_core::{Capture, Mesh, State, odd_size};
use artgs_io::asset::{Format, Provenance, WriteOptions, check_asset};
use artgs_io::export_report::ExportReport;
use artgs_io::run_folder::load_text;
use artgs_io::{Corrections, FileError, RunFolder, read_corrections};
use date::today;
use portrait::portrait;
use report::report;

/// Exports the replica in a folder into its folder `exports`. Textures are baked from the training views of `capture`,
/// without it they hold the colours of the meshes. `watch` gets what happens meanwhile.
pub fn export(
    folder: &RunFolder,
    options: &ExportOptions,
    capture: Option<&Capture>,
    mut watch: impl FnMut(ExportEvent<'_>),
) -> Result<ExportReport, ExportError> {
    let mut config = options.config()?;
    if let Some(format) = options.formats.iter().find(|format| !format.is_available()) {
        return Err(ExportError::NotBuiltIn(*format));
    }
    let replica = artgs_io::read_replica(folder.root())?;
    config.classes = given_classes(folder, replica.parts.len())?;
    let meshes = folder.load_meshes(&replica, State::START).map_err(ExportError::Input)?;
    let splats = folder.load_part_splats(replica.parts.len()).map_err(ExportError::Input)?;
    let parts = Parts { replica: &replica, meshes: &meshes, splats: splats.as_deref() };
    let by_coacd = |mesh: &Mesh| coacd::decompose(mesh);
    let decomposer =
        (options.collision == CollisionSource::Coacd).then_some(&by_coacd as &crate::collision::decompose::Decomposer);
    let mut begins = |step| watch(ExportEvent::Begins(step));
    let built = build(&options.name, &parts, capture, &config, decomposer, &mut begins).map_err(ExportError::Build)?;
    let warnings = built.surfaces.iter().flat_map(|surface| &surface.warnings);
    for warning in odd_size(built.asset.bounds_diagonal()).iter().chain(warnings) {
        watch(ExportEvent::Warning(warning));
    }
    check_asset(&built.asset).map_err(|reason| ExportError::Asset { path: folder.replica(), reason })?;
    let again = formats_of_other_options(folder, options);
    if !again.is_empty() {
        let names = again.iter().map(|format| format.name()).collect::<Vec<_>>().join(", ");
        watch(ExportEvent::Warning(&format!("exported earlier with other options, so written again: {names}")));
    }
    let options = &ExportOptions { formats: [options.formats.clone(), again].concat(), ..options.clone() };
    watch(ExportEvent::Begins(ExportStep::Write));
    let write = write_options(folder, options, &built, &config.settings.portrait);
    let mut files = Vec::new();
    for (i, format) in options.formats.iter().enumerate() {
        files.extend(format.replace_with(&folder.exports(), &built.asset, &write).map_err(ExportError::Output)?);
        watch(ExportEvent::Written(i + 1, options.formats.len()));
    }
    let decided = report(&built, &replica, options, capture, &config.settings.looks.sides);
    let mut report = ExportReport { options: options.requested(), files, density: config.density, ..decided };
    report.record_digests(folder, &options.formats).map_err(ExportError::Output)?;
    report.save(folder).map_err(ExportError::Output)?;
    Ok(report)
}

/// What formats are asked for, with what this export knows of the provenance.
fn write_options(
    folder: &RunFolder,
    options: &ExportOptions,
    built: &BuiltAsset,
    settings: &PortraitSettings,
) -> WriteOptions {
    if !options.formats.contains(&Format::Simready) {
        return options.write.clone();
    }
    let source = folder.replica().file_name().map(|name| name.to_string_lossy().into_owned());
    let (date, picture) = (Some(today()), portrait(&built.asset, settings));
    WriteOptions {
        provenance: Provenance { source, date, picture, ..options.write.provenance.clone() },
        ..options.write.clone()
    }
}

/// Formats in the folder that are not written now and were exported with other options: exports of one folder agree.
fn formats_of_other_options(folder: &RunFolder, options: &ExportOptions) -> Vec<Format> {
    // A report that cannot be read says nothing about options.
    let Some(last) = ExportReport::load(folder).ok().flatten() else { return Vec::new() };
    let same = last.options == options.requested() && last.scale == options.scale && last.up == options.up.to_string();
    let left = |format: &Format| !same && !options.formats.contains(format) && folder.has_export(*format);
    Format::ALL.into_iter().filter(|format| format.is_available() && left(format)).collect()
}

/// Classes in `corrections.json`, by the parts of the replica. The file counts parts as they were found.
fn given_classes(folder: &RunFolder, parts: usize) -> Result<Vec<GivenClass>, ExportError> {
    let wanted = read_corrections(folder.root()).map_err(ExportError::Input)?.unwrap_or_default().classes;
    let applied = load_text(&folder.replica_corrections()).map_err(ExportError::Input)?;
    let applied = applied.and_then(|text| Corrections::parse(text.as_bytes()).ok()).unwrap_or_default();
    let mut out = Vec::new();
    for (i, mark) in wanted.iter().enumerate() {
        match applied.number_after(mark.part) {
            Some(part) if part < parts => out.push(GivenClass { part, class: mark.class }),
            Some(part) => {
                let reason =
                    format!("field `classes[{i}]`: there is no part {part}, the largest number is {}", parts - 1);
                return Err(ExportError::Input(FileError::malformed(&folder.corrections(), reason)));
            }
            // The part was removed after its class was given.
            None => {}
        }
    }
    Ok(out)
}
