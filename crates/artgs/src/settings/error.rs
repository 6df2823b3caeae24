//! Why settings cannot be used.

use std::fmt::Display;
use std::path::PathBuf;

/// Settings that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// Not TOML.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    /// Settings that TOML cannot hold, for example a number beyond its range.
    #[error("settings cannot be written: {0}")]
    Unwritable(#[from] toml::ser::Error),
    /// An unknown field, or a value of the wrong type.
    #[error("{0}")]
    Field(String),
    /// A file of settings cannot be used.
    #[error("{}: {reason}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The number of parts is neither given nor found.
    #[error(
        "{0} needs --parts K (or `parts` in the configuration): it cannot find the number of parts; K counts the static \
         part, so a cabinet with two drawers has K = 3"
    )]
    PartsNeeded(&'static str),
    /// A value out of range.
    #[error("{}{key} = {value}: {rule}", header(section))]
    Value {
        /// Section of the configuration; empty for settings outside all sections.
        section: String,
        /// Key within the section.
        key: String,
        /// What it holds.
        value: String,
        /// What it should hold.
        rule: String,
    },
}

/// A value that is refused.
pub(crate) fn bad(section: &str, key: &str, value: impl Display, rule: &str) -> ConfigError {
    ConfigError::Value { section: section.into(), key: key.into(), value: value.to_string(), rule: rule.into() }
}

/// What a message has before the key.
fn header(section: &str) -> String {
    if section.is_empty() { String::new() } else { format!("[{section}] ") }
}
