//! `--seeds`: a number of runs, or a range of objects.

use std::ops::Range;
use std::str::FromStr;

/// Value of `--seeds`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Seeds {
    /// Seeds 0, 1, ... of every object: `N`, at least 1.
    Count(u64),
    /// Random objects, at least one: `A..B` without `B`, or `A..=B` with it.
    Range(Range<u64>),
}

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number =
            |text: &str| text.trim().parse::<u64>().map_err(|_| "N, A..B or A..=B, of whole numbers".to_string());
        let Some((from, to)) = text.split_once("..") else {
            return match number(text)? {
                0 => Err("at least 1".into()),
                count => Ok(Self::Count(count)),
            };
        };
        let from = number(from)?;
        let to = match to.strip_prefix('=') {
            Some(last) => number(last)?.checked_add(1).ok_or("a smaller number")?,
            None => number(to)?,
        };
        if from < to { Ok(Self::Range(from..to)) } else { Err(format!("no seed is in {text}")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_ranges_are_read() {
        for (text, seeds) in [
            ("3", Seeds::Count(3)),
            ("0..3", Seeds::Range(0..3)),
            ("5..=5", Seeds::Range(5..6)),
            ("10..=12", Seeds::Range(10..13)),
        ] {
            assert_eq!(text.parse(), Ok(seeds));
        }
        for text in ["", "0", "-1", "x", "3..3", "4..2", "1..", "..4", "1...4", "0..=18446744073709551615"] {
            assert!(text.parse::<Seeds>().is_err(), "{text}");
        }
    }
}
