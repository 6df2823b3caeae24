//! The table as text and as a page of the book.

use super::{ConfigError, SECTIONS, Setting, all};
use serde::Serialize;
use std::fmt::{self, Write};

const HEAD: &str = "# Settings

<!-- Written by `ARTGS_UPDATE=1 cargo test -p artgs --lib settings`; the table is in crates/artgs/src/settings. -->

Every setting of `config.toml`, with its value in the default preset and in `--preset paper`. A file for `--config` may hold any of
them; [Reconstruction](reconstruct.md#settings) shows one. Values are checked before any work: NaN and infinity are refused
everywhere, and so is a number out of its range or a key that is not listed here. `artgs settings` prints every key with its value and range, and
`cargo doc --open` has the full documentation of each field (type `artgs::config::Config`).

`--preset registration` differs from the default in `method` alone. A setting without a value is absent, or is the alternative of
another.
";

/// A setting with a value.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Listed {
    /// Section and key, as a dotted key of TOML.
    pub setting: String,
    /// Its value; none if it is absent.
    pub value: Option<toml::Value>,
    /// Accepted values in words.
    pub allowed: String,
    /// Unit of the number; empty where there is none.
    pub unit: &'static str,
    /// What it sets, without a full stop.
    pub meaning: &'static str,
}

/// All settings with their values. As text, a line for each: `discover.rounds = 3  (0 to 100, rounds)`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Listing {
    /// In the order of `config.toml`.
    pub settings: Vec<Listed>,
}

impl Listing {
    /// The settings with the values of a file that has all of them, `Config::to_toml`.
    pub fn new(config: &str) -> Result<Self, ConfigError> {
        let values: toml::Table = config.parse()?;
        let listed = |s: Setting| Listed {
            setting: s.path(),
            value: s.value(&values).cloned(),
            allowed: s.allowed.to_string(),
            unit: s.unit,
            meaning: s.meaning,
        };
        Ok(Self { settings: all().map(listed).collect() })
    }
}

impl fmt::Display for Listing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for Listed { setting, value, allowed, unit, .. } in &self.settings {
            let value = value.as_ref().map_or("absent".into(), short);
            let comma = if unit.is_empty() { "" } else { ", " };
            writeln!(f, "{setting} = {value}  ({allowed}{comma}{unit})")?;
        }
        Ok(())
    }
}

/// The page of the book, with the values of the default preset and of the published method, each as a file that has all settings.
pub fn markdown(presets: [&str; 2]) -> Result<String, ConfigError> {
    let presets: [toml::Table; 2] = [presets[0].parse()?, presets[1].parse()?];
    let mut page = HEAD.to_owned();
    for (section, _) in SECTIONS {
        let title = if section.is_empty() { "Outside all sections".into() } else { format!("`[{section}]`") };
        // Writing to a string cannot fail.
        let _ = write!(
            page,
            "\n## {title}\n\n| key | default | paper | range | unit | meaning |\n|---|---|---|---|---|---|\n"
        );
        for s in all().filter(|s| s.section == *section) {
            let value = |table| s.value(table).map_or(String::new(), |v| format!("`{}`", short(v)));
            let [default, paper] = presets.each_ref().map(value);
            let _ =
                writeln!(page, "| `{}` | {default} | {paper} | {} | {} | {} |", s.key, s.allowed, s.unit, s.meaning);
        }
    }
    Ok(page)
}

/// A value as one writes it in TOML, floats with at most six digits.
fn short(value: &toml::Value) -> String {
    let rounded = |v: &f64| format!("{v:.5e}").parse().map(toml::Value::Float);
    match value.as_float().as_ref().map(rounded) {
        Some(Ok(rounded)) => exact(&rounded),
        _ => exact(value),
    }
}

/// A value as one writes it in TOML.
pub(super) fn exact(value: &toml::Value) -> String {
    match value {
        toml::Value::Float(v) if v.is_nan() => "nan".into(),
        // One that single precision holds exactly is most likely a setting of single precision.
        toml::Value::Float(v) if f64::from(*v as f32) == *v => format!("{:?}", *v as f32),
        toml::Value::Float(v) => format!("{v:?}"),
        other => other.to_string(),
    }
}
