//! All settings of a reconstruction in one place; reads and writes TOML.

use crate::articulate::{ArticulateConfig, TypeConfig};
use crate::canonical::init::CanonicalConfig;
use crate::discover::DiscoverConfig;
use crate::fit::single::SingleConfig;
use crate::run::points::StartConfig;
use crate::surface::SurfaceConfig;
use serde::{Deserialize, Serialize};

/// How parts and joints are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// From depth: moved points, registration, labels; then Gaussians are trained on the found parts.
    #[default]
    Registration,
    /// As published: matched Gaussians, clustered centres, learned assignment and motions.
    Paper,
}

/// Settings of a reconstruction. Every field may be left out of a file; unknown fields are refused.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Number of rigid parts, the static part included.
    pub parts: Option<usize>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// How parts and joints are found.
    pub method: Method,
    /// Gaussians of each state alone. `registration` needs them only where a capture has no depth.
    pub single: SingleConfig,
    /// Part discovery of `registration`.
    pub discover: DiscoverConfig,
    /// First canonical Gaussians of `registration`.
    pub start: StartConfig,
    /// First canonical Gaussians and part centres of `paper`.
    pub canonical: CanonicalConfig,
    /// Joint types of `paper`.
    pub types: TypeConfig,
    /// Training of the articulated Gaussians.
    pub articulate: ArticulateConfig,
    /// Meshes.
    pub surface: SurfaceConfig,
}

/// A configuration file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// Not TOML.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    /// An unknown field, or a value of the wrong type.
    #[error("{0}")]
    Field(String),
    /// A value out of range.
    #[error("setting `{field}` is {value}: {rule}")]
    Value {
        /// Path of the field.
        field: &'static str,
        /// What it holds.
        value: String,
        /// What it should hold.
        rule: &'static str,
    },
}

impl Config {
    /// The published method with its constants.
    pub fn paper() -> Self {
        Self {
            method: Method::Paper,
            single: SingleConfig::paper(),
            canonical: CanonicalConfig::paper(),
            types: TypeConfig::paper(),
            articulate: ArticulateConfig::paper(),
            surface: SurfaceConfig { keep_fraction: 0.1, min_weight: 0.5, ..SurfaceConfig::default() },
            ..Self::default()
        }
    }

    /// These settings with those replaced that the TOML text gives.
    pub fn overridden_by(&self, text: &str) -> Result<Self, ConfigError> {
        let changes: toml::Table = text.parse()?;
        let mut table = toml::Table::try_from(self).unwrap_or_default();
        merge(&mut table, changes);
        // Its line number would be that of the merged table, which nobody wrote.
        let config: Self = table.try_into().map_err(|e: toml::de::Error| ConfigError::Field(told(&e)))?;
        config.check()?;
        Ok(config)
    }

    /// As TOML, complete.
    pub fn to_toml(&self) -> String {
        toml::to_string_pretty(self).unwrap_or_default()
    }

    /// Refuses values that no stage can work with.
    pub fn check(&self) -> Result<(), ConfigError> {
        let bad = |field, value: String, rule| Err(ConfigError::Value { field, value, rule });
        if let Some(parts) = self.parts.filter(|p| *p < 2) {
            return bad("parts", parts.to_string(), "K counts the static part, so it is 2 or more");
        }
        let lengths = [("discover.spacing", self.discover.spacing), ("discover.voxel", self.discover.voxel)];
        for (field, value) in lengths {
            if !(value > 0.0 && value < 0.2) {
                return bad(field, value.to_string(), "a fraction of the object's diagonal between 0 and 0.2");
            }
        }
        for (field, value) in [
            ("single.image_divisor", self.single.image_divisor),
            ("articulate.image_divisor", self.articulate.image_divisor),
        ] {
            if value == 0 {
                return bad(field, value.to_string(), "images are divided by this, so it is 1 or more");
            }
        }
        Ok(())
    }
}

/// What is wrong and in which section, on one line.
fn told(error: &toml::de::Error) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

fn merge(into: &mut toml::Table, changes: toml::Table) {
    for (key, value) in changes {
        match (into.get_mut(&key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(change)) if !is_choice(inner, &change) => {
                merge(inner, change);
            }
            (_, value) => {
                into.insert(key, value);
            }
        }
    }
}

/// True if both tables hold one key and not the same: alternatives such as `rbf = 1.0` for `neighbours = 7`.
fn is_choice(inner: &toml::Table, change: &toml::Table) -> bool {
    inner.len() == 1 && change.len() == 1 && inner.keys().ne(change.keys())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_survive_toml_and_single_fields_can_be_replaced() {
        for config in [Config::default(), Config::paper()] {
            assert_eq!(Config::default().overridden_by(&config.to_toml()).unwrap(), config);
        }
        let changed = Config::paper().overridden_by("parts = 3\n[discover]\nrounds = 7\n").unwrap();
        assert_eq!((changed.parts, changed.discover.rounds, changed.method), (Some(3), 7, Method::Paper));
        assert_eq!(changed.single, SingleConfig::paper());
    }

    #[test]
    fn unknown_fields_and_bad_values_are_named() {
        let message = |text: &str| Config::default().overridden_by(text).unwrap_err().to_string();
        assert!(message("[discover]\nspacin = 1").contains("spacin"));
        assert!(message("parts = 1").contains("`parts`"));
        assert!(message("[discover]\nspacing = -1.0").contains("discover.spacing"));
        assert!(message("seed = \"x\"").contains("seed"));
    }
}
