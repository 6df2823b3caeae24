//! How many rigid parts an object has, as far as the user knows.

use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

/// Number of rigid parts, the static part included. As text and in TOML: `auto`, `4`, or `3..8` (3 to 8, both included).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PartCount {
    /// Not known: discovery decides.
    #[default]
    Auto,
    /// So many.
    Given(usize),
    /// Not exactly known: discovery decides within these bounds.
    Range {
        /// Least number, 2 or more.
        least: usize,
        /// Largest number, at most [`PartCount::MOST`].
        most: usize,
    },
}

/// A text that is no number of parts.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a number of parts: write K (4), a range (3..8) or auto")]
pub struct PartCountError(String);

impl PartCount {
    /// Largest number of parts that can be asked for, the static part included.
    pub const MOST: usize = 64;

    /// The number, if it is known.
    pub fn given(self) -> Option<usize> {
        match self {
            Self::Given(parts) => Some(parts),
            Self::Auto | Self::Range { .. } => None,
        }
    }

    /// Bounds of the number of movable parts: those of the number of parts, less the static one. An automatic count may be 0.
    pub fn movable(self) -> RangeInclusive<usize> {
        match self {
            Self::Auto => 0..=Self::MOST - 1,
            Self::Given(parts) => parts.saturating_sub(1)..=parts.saturating_sub(1),
            Self::Range { least, most } => least.saturating_sub(1)..=most.saturating_sub(1),
        }
    }

    /// Refuses numbers below 2 or above [`PartCount::MOST`], and ranges without a number; the error is the rule.
    pub fn check(self) -> Result<(), &'static str> {
        // The text of the rule names it.
        const { assert!(Self::MOST == 64) };
        let (least, most) = match self {
            Self::Auto => return Ok(()),
            Self::Given(parts) => (parts, parts),
            Self::Range { least, most } => (least, most),
        };
        if least < 2 {
            Err("K counts the static part, so it is 2 or more: 1 static part and at least 1 that moves")
        } else if most > Self::MOST {
            Err("there are at most 64 parts")
        } else if least > most {
            Err("a range begins with its least number, as in 3..8")
        } else {
            Ok(())
        }
    }
}

impl From<usize> for PartCount {
    fn from(parts: usize) -> Self {
        Self::Given(parts)
    }
}

impl fmt::Display for PartCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Given(parts) => parts.fmt(f),
            Self::Range { least, most } => write!(f, "{least}..{most}"),
        }
    }
}

/// Bounds are not checked here; see [`PartCount::check`].
impl FromStr for PartCount {
    type Err = PartCountError;

    fn from_str(text: &str) -> Result<Self, PartCountError> {
        let wrong = || PartCountError(text.into());
        let number = |digits: &str| digits.trim().parse().map_err(|_| wrong());
        match text.split_once("..") {
            None if text == "auto" => Ok(Self::Auto),
            None => Ok(Self::Given(number(text)?)),
            Some((least, most)) => Ok(Self::Range { least: number(least)?, most: number(most)? }),
        }
    }
}

impl Serialize for PartCount {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Given(parts) => serializer.serialize_u64(*parts as u64),
            Self::Auto | Self::Range { .. } => serializer.collect_str(self),
        }
    }
}

impl<'de> Deserialize<'de> for PartCount {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NumberOrText;
        impl Visitor<'_> for NumberOrText {
            type Value = PartCount;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a number of parts: 4, \"3..8\" or \"auto\"")
            }

            fn visit_u64<E: Error>(self, parts: u64) -> Result<PartCount, E> {
                Ok(PartCount::Given(usize::try_from(parts).unwrap_or(usize::MAX)))
            }

            fn visit_i64<E: Error>(self, parts: i64) -> Result<PartCount, E> {
                let count = u64::try_from(parts).map_err(|_| E::custom(PartCountError(parts.to_string())))?;
                self.visit_u64(count)
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<PartCount, E> {
                text.parse().map_err(E::custom)
            }
        }
        deserializer.deserialize_any(NumberOrText)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_read_and_written_alike() {
        let range = PartCount::Range { least: 3, most: 8 };
        for (text, count) in [("auto", PartCount::Auto), ("4", PartCount::Given(4)), ("3..8", range)] {
            assert_eq!(text.parse(), Ok(count));
            assert_eq!((count.to_string().as_str(), count.check()), (text, Ok(())));
        }
        for text in ["", "two", "3..", "..8", "3..=8", "3-8", "-1", "1.5", "AUTO"] {
            let message = text.parse::<PartCount>().unwrap_err().to_string();
            assert!(message.contains(&format!("`{text}`")) && message.contains("3..8"), "{message}");
        }
    }

    #[test]
    fn bounds_are_checked_and_counted_without_the_static_part() {
        let rule = |text: &str| text.parse::<PartCount>().unwrap().check().unwrap_err();
        assert!(rule("0").contains("static part") && rule("1").contains("static part"));
        assert!(rule("1..3").contains("static part") && rule("8..3").contains("least"));
        assert!(rule("65").contains("64") && rule("3..65").contains("64"));
        let movable = |text: &str| text.parse::<PartCount>().unwrap().movable();
        assert_eq!((movable("4"), movable("3..8"), movable("auto")), (3..=3, 2..=7, 0..=63));
        assert_eq!((PartCount::from(3).given(), PartCount::Auto.given()), (Some(3), None));
    }
}
