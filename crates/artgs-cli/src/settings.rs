//! The settings of a run, from the flags of the command line and from the folder of an earlier run; `artgs settings`.

use crate::args::{Method, Preset};
use crate::failure::Failure;
use crate::output::Report;
use crate::style::Style;
use artgs::settings::Listing;
use artgs::{Config, PartCount, ablation};
use artgs_io::RunFolder;

/// The preset, changed by the variant, overridden by the file, overridden by the flags. `true_parts` is the number of parts
/// if the capture is known; it is used where parts cannot be counted.
pub(crate) fn configure(method: &Method, true_parts: Option<usize>) -> Result<Config, Failure> {
    let mut config = match (method.preset, method.schedule) {
        (Preset::Paper, schedule) => Config::paper_scaled(schedule.unwrap_or(1.0)).map_err(Failure::bad)?,
        (_, Some(_)) => return Err(Failure::bad("--schedule shortens the published method: add --preset paper")),
        (Preset::Default, None) => Config::default(),
        (Preset::Registration, None) => Config::registration(),
    };
    if let Some(variant) = &method.variant {
        config = ablation::apply(variant, config).map_err(|e| Failure::bad(with_variants(&e)))?;
    }
    if let Some(file) = &method.config {
        config = config.overridden_by_file(file).map_err(Failure::bad)?;
    }
    config.parts = method.parts.unwrap_or(config.parts);
    config.seed = method.seed.unwrap_or(config.seed);
    if let (PartCount::Auto, Err(_), Some(parts)) = (config.parts, config.check_part_count(), true_parts) {
        config.parts = parts.into();
    }
    config.check().and_then(|()| config.check_part_count()).map_err(Failure::bad)?;
    Ok(config)
}

/// The error, with all variants if there is none of the given name.
fn with_variants(error: &ablation::AblationError) -> String {
    let mut text = error.to_string();
    if matches!(error, ablation::AblationError::Unknown { .. }) {
        ablation::variants().iter().for_each(|(name, what)| text.push_str(&format!("\n  {name:17} {what}")));
    }
    text
}

/// The settings of the run in a folder; the error says why they cannot be used.
pub(crate) fn settings_of(run: &RunFolder) -> Result<Config, String> {
    let file = run.config();
    let text = run.load_config().map_err(|e| e.to_string())?;
    let text = text.ok_or_else(|| format!("{}: there is no such file", file.display()))?;
    Config::default().overridden_by(&text).map_err(|e| format!("{}: {e}", file.display()))
}

/// `artgs settings`.
pub(crate) fn list(preset: Preset, style: Style) -> Result<(), Failure> {
    let config = match preset {
        Preset::Default => Config::default(),
        Preset::Paper => Config::paper(),
        Preset::Registration => Config::registration(),
    };
    Report::new(&Listing::new(&config.to_toml().map_err(Failure::failed)?).map_err(Failure::failed)?)?.show(style.json)
}
