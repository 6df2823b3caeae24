//! Named settings: rows of the tables.

use crate::item::{ItemError, check_name};

/// Settings of the method under a name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Name, also of its folder.
    pub name: String,
    /// One sentence for readers of the tables.
    pub description: String,
    /// `--preset` of the runs.
    pub preset: String,
    /// Settings in TOML that replace those of the preset; may be empty.
    pub overlay: String,
    /// Further arguments of `artgs reconstruct`.
    pub arguments: Vec<String>,
    /// True if it cannot find the number of parts, so that it is always given.
    pub needs_parts: bool,
}

impl Variant {
    /// A preset without changes.
    pub fn preset(name: &str, preset: &str, description: &str) -> Self {
        Self {
            name: name.into(),
            description: description.into(),
            preset: preset.into(),
            overlay: String::new(),
            arguments: Vec::new(),
            needs_parts: preset != "default",
        }
    }

    /// A preset with settings replaced.
    pub fn with_overlay(name: &str, preset: &str, description: &str, overlay: String) -> Self {
        Self { overlay, ..Self::preset(name, preset, description) }
    }
}

/// Refuses names that cannot be folder names, and duplicate names.
pub(crate) fn check_variants(variants: &[Variant]) -> Result<(), VariantError> {
    for (index, variant) in variants.iter().enumerate() {
        check_name(&variant.name).map_err(|_: ItemError| VariantError::Name(variant.name.clone()))?;
        if variants[..index].iter().any(|other| other.name == variant.name) {
            return Err(VariantError::Twice(variant.name.clone()));
        }
    }
    if variants.is_empty() { Err(VariantError::None) } else { Ok(()) }
}

/// Variants that cannot be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VariantError {
    /// No variants at all.
    #[error("no variant to run; `full` is the default")]
    None,
    /// A name that cannot be a folder of the output.
    #[error("`{0}`: the name of a variant may hold letters, digits, `.`, `_` and `-` only")]
    Name(String),
    /// Two of one name.
    #[error("two variants are called `{0}`")]
    Twice(String),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_must_be_plain_and_distinct() {
        let v = |name: &str| Variant::preset(name, "default", "");
        check_variants(&[v("full"), v("paper")]).unwrap();
        assert!(matches!(check_variants(&[v("a"), v("a")]), Err(VariantError::Twice(_))));
        assert!(matches!(check_variants(&[v("a/b")]), Err(VariantError::Name(_))));
        assert!(matches!(check_variants(&[]), Err(VariantError::None)));
    }
}
