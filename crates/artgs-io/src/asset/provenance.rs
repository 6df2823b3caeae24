//! Where an asset comes from, for formats whose metadata say it.

use artgs_core::Texture;

/// What a user states about an asset, and when and from what it was written. Nothing of it can be seen in a capture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Who made it; unknown if none.
    pub author: Option<String>,
    /// The terms under which it may be used; not stated if none.
    pub license: Option<String>,
    /// Wikidata item of the kind of object, `Q` and digits; a physical object if none.
    pub item: Option<String>,
    /// Name of the file that it was made from.
    pub source: Option<String>,
    /// Day on which it was written, `YYYY-MM-DD`.
    pub date: Option<String>,
    /// A square picture of it.
    pub picture: Option<Texture>,
}

impl Provenance {
    /// True for `Q` and digits.
    pub fn is_item(text: &str) -> bool {
        text.strip_prefix('Q').is_some_and(|d| !d.is_empty() && d.bytes().all(|b| b.is_ascii_digit()))
    }
}

#[cfg(test)]
mod tests {
    use super::Provenance;

    #[test]
    fn items_are_a_letter_and_digits() {
        assert!(["Q1", "Q36794"].into_iter().all(Provenance::is_item));
        assert!(!["", "Q", "q5", "36794", "Q5a", " Q5"].into_iter().any(Provenance::is_item));
    }
}
