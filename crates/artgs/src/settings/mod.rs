//! The table of all settings: section, key, accepted values, unit and meaning. [`Config::check`](crate::Config::check) refuses by it, and
//! `artgs settings` and the page of the book are made from it.

mod document;
mod entry;
mod error;
mod parts;
mod recordings;
mod training;

pub use document::{Listed, Listing, markdown};
pub use entry::Allowed;
pub use error::ConfigError;
pub(crate) use error::bad;

use entry::Entry;
use std::ops::Bound::Included;

/// Sections in the order of `config.toml`, with the entries of their types.
const SECTIONS: &[(&str, &[Entry])] = &[
    ("", parts::TOP),
    ("align", recordings::ALIGN),
    ("align.grid", recordings::GRID),
    ("align.bundle", recordings::BUNDLE),
    ("align.global", recordings::GLOBAL),
    ("align.consistent", recordings::CONSISTENT),
    ("align.complete", recordings::COMPLETE),
    ("align.correct", recordings::CORRECT),
    ("align.color", recordings::COLOR),
    ("align.exposure", recordings::EXPOSURE),
    ("align.object", recordings::OBJECT),
    ("align.object.planes", recordings::PLANES),
    ("align.extract", recordings::EXTRACT),
    ("single", training::SINGLE),
    ("single.random", training::RANDOM),
    ("single.depth", training::DEPTH),
    ("single.loss", training::LOSS),
    ("single.rates", training::RATES),
    ("single.adam", training::ADAM),
    ("single.densify", training::DENSIFY),
    ("single.plateau", training::PLATEAU),
    ("discover", parts::DISCOVER),
    ("start", parts::START),
    ("canonical", parts::CANONICAL),
    ("canonical.random", training::RANDOM),
    ("canonical.static_rule", parts::STATIC_RULE),
    ("canonical.cluster", parts::CLUSTER),
    ("canonical.cluster.affinity", parts::AFFINITY),
    ("types", parts::TYPES),
    ("types.train", training::ARTICULATE),
    ("types.train.loss", training::LOSS),
    ("types.train.rates", training::RATES),
    ("types.train.adam", training::ADAM),
    ("types.train.densify", training::DENSIFY),
    ("types.train.plateau", training::PLATEAU),
    ("types.train.joint_rate", training::FALL),
    ("types.train.assign_rate", training::FALL),
    ("types.train.assign", training::ASSIGN),
    ("types.train.assign.slots", training::SLOTS),
    ("types.train.assign.grid", training::HASH_GRID),
    ("registration", parts::REGISTRATION),
    ("registration.cluster", parts::CLUSTER),
    ("registration.cluster.affinity", parts::AFFINITY),
    ("articulate", training::ARTICULATE),
    ("articulate.loss", training::LOSS),
    ("articulate.rates", training::RATES),
    ("articulate.adam", training::ADAM),
    ("articulate.densify", training::DENSIFY),
    ("articulate.plateau", training::PLATEAU),
    ("articulate.joint_rate", training::FALL),
    ("articulate.assign_rate", training::FALL),
    ("articulate.assign", training::ASSIGN),
    ("articulate.assign.slots", training::SLOTS),
    ("articulate.assign.grid", training::HASH_GRID),
    ("surface", parts::SURFACE),
];

/// A setting of [`Config`](crate::Config).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Setting {
    /// Section of `config.toml`, such as `align.grid`; empty for settings outside all sections.
    pub section: &'static str,
    /// Key within the section.
    pub key: &'static str,
    /// Values that it accepts.
    pub allowed: Allowed,
    /// Unit of the number; empty where there is none.
    pub unit: &'static str,
    /// What it sets, without a full stop.
    pub meaning: &'static str,
}

impl Setting {
    /// Section and key, as a dotted key of TOML.
    pub fn path(&self) -> String {
        if self.section.is_empty() { self.key.into() } else { format!("{}.{}", self.section, self.key) }
    }

    /// The value in a table of all settings; none if it is absent.
    pub fn value<'t>(&self, settings: &'t toml::Table) -> Option<&'t toml::Value> {
        let mut names = self.section.split('.').filter(|name| !name.is_empty());
        let section = names.try_fold(settings, |table, name| table.get(name)?.as_table())?;
        section.get(self.key)
    }

    /// What a refused value has to be.
    fn rule(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" ({})", self.unit) };
        match self.allowed {
            Allowed::Whole { .. } => format!("must be a whole number from {}{unit}", self.allowed),
            Allowed::Number { low: Included(_), high: Included(_) } => format!("must be from {}{unit}", self.allowed),
            _ => format!("must be {}{unit}", self.allowed),
        }
    }
}

/// All settings, in the order of `config.toml`.
pub fn all() -> impl Iterator<Item = Setting> {
    let of = |section, e: &Entry| Setting { section, key: e.key, allowed: e.allowed, unit: e.unit, meaning: e.meaning };
    SECTIONS.iter().flat_map(move |(section, entries)| entries.iter().map(move |e| of(section, e)))
}

/// Refuses numbers out of range in a table of settings. Values of a wrong type and unknown keys are left to the types.
pub(crate) fn check(settings: &toml::Table) -> Result<(), ConfigError> {
    for setting in all() {
        if let Some(value) = setting.value(settings).filter(|v| !setting.allowed.accepts(v)) {
            let (section, key) = (setting.section.into(), setting.key.into());
            return Err(ConfigError::Value { section, key, value: document::exact(value), rule: setting.rule() });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
