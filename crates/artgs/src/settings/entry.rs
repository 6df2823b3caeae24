//! One setting: what it holds, which values it accepts, in which unit.

use std::fmt;
use std::ops::Bound;

/// Most steps that a schedule may have, and the largest step that a setting may name.
pub(super) const MOST_STEPS: i64 = 1_000_000_000;

/// Values that a setting accepts. NaN and infinity are never accepted.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Allowed {
    /// Whole numbers of a range, both ends included.
    Whole {
        /// Least number.
        least: i64,
        /// Largest number.
        most: i64,
    },
    /// Numbers of a range.
    Number {
        /// Lower end.
        low: Bound<f64>,
        /// Upper end.
        high: Bound<f64>,
    },
    /// `true` or `false`.
    Switch,
    /// One of these words.
    Words(&'static [&'static str]),
    /// What [`PartCount`](crate::PartCount) reads.
    Parts,
}

impl Allowed {
    /// True if a TOML value is accepted, or has a type that is refused elsewhere; of an array, if all elements are.
    pub(super) fn accepts(self, value: &toml::Value) -> bool {
        match (self, value) {
            (_, toml::Value::Array(values)) => values.iter().all(|v| self.accepts(v)),
            (Self::Whole { least, most }, toml::Value::Integer(v)) => (least..=most).contains(v),
            (Self::Whole { .. }, toml::Value::Float(_)) => false,
            (Self::Whole { .. } | Self::Number { .. }, toml::Value::Boolean(_) | toml::Value::String(_)) => false,
            (Self::Number { low, high }, toml::Value::Integer(v)) => within(low, high, *v as f64),
            (Self::Number { low, high }, toml::Value::Float(v)) => within(low, high, *v),
            _ => true,
        }
    }
}

/// True for finite numbers of the range.
fn within(low: Bound<f64>, high: Bound<f64>, v: f64) -> bool {
    // A setting of single precision holds an end of the range as rounded to that.
    let is = |end: f64| v as f32 == end as f32;
    let above = match low {
        Bound::Included(low) => v >= low || is(low),
        Bound::Excluded(low) => v > low,
        Bound::Unbounded => true,
    };
    let below = match high {
        Bound::Included(high) => v <= high || is(high),
        Bound::Excluded(high) => v < high,
        Bound::Unbounded => true,
    };
    v.is_finite() && above && below
}

/// The range in words, such as `0 to 1` or `more than 0, at most 1`.
impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole { least, most } => write!(f, "{least} to {most}"),
            Self::Number { low: Bound::Included(low), high: Bound::Included(high) } => write!(f, "{low} to {high}"),
            Self::Number { low, high } => {
                match low {
                    Bound::Included(low) => write!(f, "at least {low}")?,
                    Bound::Excluded(low) => write!(f, "more than {low}")?,
                    Bound::Unbounded => f.write_str("any number")?,
                }
                match high {
                    Bound::Included(high) => write!(f, ", at most {high}"),
                    Bound::Excluded(high) => write!(f, ", less than {high}"),
                    Bound::Unbounded => Ok(()),
                }
            }
            Self::Switch => f.write_str("true or false"),
            Self::Words(words) => match words.split_last() {
                Some((last, others)) if !others.is_empty() => write!(f, "{} or {last}", others.join(", ")),
                _ => f.write_str(&words.join("")),
            },
            Self::Parts => f.write_str("2 to 64, a range such as 3..8, or auto"),
        }
    }
}

/// A setting of a type, wherever that type is used.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) key: &'static str,
    pub(super) allowed: Allowed,
    pub(super) unit: &'static str,
    pub(super) meaning: &'static str,
}

/// A whole number, both ends included.
pub(super) const fn whole(
    key: &'static str,
    least: i64,
    most: i64,
    unit: &'static str,
    meaning: &'static str,
) -> Entry {
    Entry { key, allowed: Allowed::Whole { least, most }, unit, meaning }
}

/// A number, both ends included.
pub(super) const fn number(key: &'static str, low: f64, high: f64, unit: &'static str, meaning: &'static str) -> Entry {
    ranged(key, Bound::Included(low), Bound::Included(high), unit, meaning)
}

/// A number, the lower end excluded.
pub(super) const fn above(key: &'static str, low: f64, high: f64, unit: &'static str, meaning: &'static str) -> Entry {
    ranged(key, Bound::Excluded(low), Bound::Included(high), unit, meaning)
}

/// A number, the upper end excluded.
pub(super) const fn below(key: &'static str, low: f64, high: f64, unit: &'static str, meaning: &'static str) -> Entry {
    ranged(key, Bound::Included(low), Bound::Excluded(high), unit, meaning)
}

/// A number, both ends excluded.
pub(super) const fn between(
    key: &'static str,
    low: f64,
    high: f64,
    unit: &'static str,
    meaning: &'static str,
) -> Entry {
    ranged(key, Bound::Excluded(low), Bound::Excluded(high), unit, meaning)
}

const fn ranged(
    key: &'static str,
    low: Bound<f64>,
    high: Bound<f64>,
    unit: &'static str,
    meaning: &'static str,
) -> Entry {
    Entry { key, allowed: Allowed::Number { low, high }, unit, meaning }
}

/// `true` or `false`.
pub(super) const fn switch(key: &'static str, meaning: &'static str) -> Entry {
    Entry { key, allowed: Allowed::Switch, unit: "", meaning }
}

/// One of some words.
pub(super) const fn words(key: &'static str, words: &'static [&'static str], meaning: &'static str) -> Entry {
    Entry { key, allowed: Allowed::Words(words), unit: "", meaning }
}

/// A number of parts.
pub(super) const fn parts(key: &'static str, unit: &'static str, meaning: &'static str) -> Entry {
    Entry { key, allowed: Allowed::Parts, unit, meaning }
}
