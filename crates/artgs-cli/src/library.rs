//! Where the command line meets the libraries: their types end here.

use crate::args::Preset;
use crate::failure::Failure;
use crate::output::Report;
use artgs::ablation;
use artgs::evaluate::pictures::has_splats;
use artgs::evaluate::{Lpips, PictureReport, Scores, score_replica};
use artgs::fit::{Devices, FitError};
use artgs::observer::Observer;
use artgs_core::{Capture, JointEstimate};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

pub(crate) use artgs::Config;

/// What the command line says about the method.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    pub(crate) preset: Preset,
    pub(crate) schedule: Option<f64>,
    pub(crate) variant: Option<String>,
    pub(crate) file: Option<PathBuf>,
    pub(crate) parts: Option<usize>,
    pub(crate) seed: Option<u64>,
}

/// Reads a capture.
pub(crate) fn load(capture: &Path) -> Result<Capture, Failure> {
    artgs_io::load_capture(capture).map_err(|error| Failure::BadInput(error.into()))
}

/// What a capture contains.
pub(crate) fn inspect(capture: &Path) -> Result<Report, Failure> {
    Report::new(&artgs_io::summarize(&load(capture)?))
}

/// The preset, less what a variant takes away, overridden by the file, overridden by the flags.
pub(crate) fn configure(settings: &Settings) -> Result<Config, Failure> {
    let mut config = match (settings.preset, settings.schedule) {
        (Preset::Paper, schedule) => Config::paper_scaled(schedule.unwrap_or(1.0)).map_err(Failure::bad)?,
        (_, Some(_)) => return Err(Failure::bad("--schedule shortens the published method: add --preset paper")),
        (Preset::Default, None) => Config::default(),
        (Preset::Registration, None) => Config::registration(),
    };
    if let Some(variant) = &settings.variant {
        config = ablation::apply(variant, config).map_err(|e| Failure::bad(without(&e)))?;
    }
    if let Some(file) = &settings.file {
        let text = std::fs::read_to_string(file).map_err(|e| Failure::bad(format!("{}: {e}", file.display())))?;
        config = config.overridden_by(&text).map_err(|e| Failure::bad(format!("{}: {e}", file.display())))?;
    }
    config.parts = settings.parts.or(config.parts);
    config.seed = settings.seed.unwrap_or(config.seed);
    config.check().map_err(Failure::bad)?;
    if config.parts.is_none() {
        return Err(Failure::bad(artgs::Error::PartsMissing));
    }
    Ok(config)
}

/// Why there is no such variant, and what each does if none was named rightly.
fn without(error: &ablation::AblationError) -> String {
    let mut text = error.to_string();
    if matches!(error, ablation::AblationError::Unknown { .. }) {
        ablation::variants().iter().for_each(|(name, what)| text.push_str(&format!("\n  {name:17} {what}")));
    }
    text
}

/// Runs the method on a capture; files go to `out`.
pub(crate) fn reconstruct(
    capture: &Capture,
    out: &Path,
    config: &Config,
    resume: bool,
    devices: &dyn Devices,
    observer: &mut dyn Observer,
) -> Result<Report, Failure> {
    Report::new(&artgs::reconstruct(capture, out, config, resume, devices, observer).map_err(failure)?)
}

/// Finds the parts of a capture and no more; files go to `out`.
pub(crate) fn find_parts(
    capture: &Capture,
    out: &Path,
    config: &Config,
    resume: bool,
    devices: &dyn Devices,
    observer: &mut dyn Observer,
) -> Result<Report, Failure> {
    let found = artgs::run::find_parts(capture, out, config, resume, devices, observer).map_err(failure)?;
    let kind = |p: &JointEstimate| serde_json::to_value(p.kind).unwrap_or_default();
    let sure = |p: &JointEstimate| {
        p.confidence.map_or(String::new(), |c| format!(", {:.0} % of its points fit", (100.0 * c).floor()))
    };
    let line = |(k, p): (usize, &JointEstimate)| {
        format!("part {}: {}{}\n", k + 1, kind(p).as_str().unwrap_or_default(), sure(p))
    };
    let text = found.parts.iter().enumerate().map(line).collect();
    let told = found.parts.iter().map(|p| json!({ "type": kind(p), "confidence": p.confidence }));
    Ok(Report { text, json: json!({ "parts": told.collect::<Value>(), "warnings": found.warnings }) })
}

/// The settings that the run in a folder was made with; the error says why they cannot be used.
pub(crate) fn settings_of(out: &Path) -> Result<Config, String> {
    let file = out.join("config.toml");
    let text = std::fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    Config::default().overridden_by(&text).map_err(|e| format!("{}: {e}", file.display()))
}

/// What a check found.
pub(crate) struct Checked {
    pub(crate) shown: Report,
    pub(crate) passed: bool,
}

/// Opens the exports of a replica and drives its joints.
pub(crate) fn check(out: &Path) -> Result<Checked, Failure> {
    let report = artgs_check::check(out, &artgs_check::CheckOptions::default());
    let report = report.map_err(|e| Failure::BadInput(e.into()))?;
    Ok(Checked { passed: report.passed(), shown: Report::new(&report)? })
}

/// Scores a replica against the truth.
pub(crate) fn evaluate(out: &Path, gt: &Path) -> Result<Report, Failure> {
    score(out, Some(gt), None)
}

/// Weights for LPIPS, if there are any.
pub(crate) fn weights(file: Option<&Path>) -> Result<Option<Lpips>, Failure> {
    file.map(|file| Lpips::load(file).map_err(|e| Failure::BadInput(e.into()))).transpose()
}

/// Why a replica cannot be compared with the held-out views of a capture.
pub(crate) fn no_pictures(out: &Path, capture: &Capture) -> Option<String> {
    if !has_splats(out) {
        return Some(format!("{} has no Gaussians to draw, splats/canonical.ply is missing", out.display()));
    }
    capture.states.iter().all(|s| s.test.is_empty()).then(|| "the capture has no held-out views".into())
}

/// Scores a replica against the truth, against the held-out views of a capture, or both.
pub(crate) fn score(
    out: &Path,
    truth: Option<&Path>,
    capture: Option<(&Capture, Option<&Lpips>)>,
) -> Result<Report, Failure> {
    // Whatever is wrong with files that only are read is the caller's to mend.
    let bad = |e: artgs::Error| Failure::BadInput(e.into());
    let pictures = capture.map(|(capture, lpips)| score_replica(out, capture, lpips));
    let pictures = pictures.transpose().map_err(|e| Failure::BadInput(e.into()))?;
    match (truth, pictures) {
        (None, pictures) => Report::new(&PictureReport { pictures: pictures.unwrap_or_default() }),
        (Some(truth), pictures) => Report::new(&Scores { pictures, ..artgs::run::evaluate(out, truth).map_err(bad)? }),
    }
}

fn failure(error: artgs::Error) -> Failure {
    if matches!(error, artgs::Error::Fit(FitError::Device(_))) {
        let remedy = "with --device auto the CPU would go on in its place";
        return Failure::Failed(anyhow::anyhow!("{error}; {remedy}"));
    }
    if error.is_bad_input() { Failure::BadInput(error.into()) } else { Failure::Failed(error.into()) }
}
