//! `--seeds`: a number of runs, or the seeds of random objects.

use std::str::FromStr;

/// Value of `--seeds`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Seeds {
    /// Seeds 0, 1, ... of every object: `N`, at least 1.
    Count(u64),
    /// Random objects, at least one, in rising order: `A..B` without `B`, `A..=B` with it, or several of these and of single seeds,
    /// separated by commas.
    Of(Vec<u64>),
}

/// Most seeds that a list may hold.
const MOST: u64 = 1_000_000;

impl FromStr for Seeds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if !text.contains("..") && !text.contains(',') {
            return match number(text)? {
                0 => Err("at least 1".into()),
                count => Ok(Self::Count(count)),
            };
        }
        let mut seeds = Vec::new();
        for entry in text.split(',') {
            seeds.extend(range(entry)?);
        }
        seeds.sort_unstable();
        seeds.dedup();
        Ok(Self::Of(seeds))
    }
}

fn number(text: &str) -> Result<u64, String> {
    text.trim().parse::<u64>().map_err(|_| "N, A..B, A..=B, or a list such as 3,5,8..=10, of whole numbers".to_string())
}

/// The seeds of an entry of a list: one, or a range.
fn range(entry: &str) -> Result<std::ops::Range<u64>, String> {
    let Some((from, to)) = entry.split_once("..") else {
        let seed = number(entry)?;
        return Ok(seed..seed.checked_add(1).ok_or("a smaller number")?);
    };
    let from = number(from)?;
    let to = match to.strip_prefix('=') {
        Some(last) => number(last)?.checked_add(1).ok_or("a smaller number")?,
        None => number(to)?,
    };
    match () {
        () if from >= to => Err(format!("no seed is in {entry}")),
        () if to - from > MOST => Err(format!("more than {MOST} seeds are in {entry}")),
        () => Ok(from..to),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_ranges_are_read() {
        for (text, seeds) in [
            ("3", Seeds::Count(3)),
            ("0..3", Seeds::Of(vec![0, 1, 2])),
            ("5..=5", Seeds::Of(vec![5])),
            ("10..=12", Seeds::Of(vec![10, 11, 12])),
            ("7,3, 3..5", Seeds::Of(vec![3, 4, 7])),
        ] {
            assert_eq!(text.parse(), Ok(seeds));
        }
        for text in [
            "",
            "0",
            "-1",
            "x",
            "3..3",
            "4..2",
            "1..",
            "..4",
            "1...4",
            "0..=18446744073709551615",
            "3,",
            "1,x",
            "0..2000000",
        ] {
            assert!(text.parse::<Seeds>().is_err(), "{text}");
        }
    }
}
