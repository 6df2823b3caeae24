//! Differences between two tables of the same objects.

use super::super::{Row, Status};
use super::statistics::{mcnemar, percentile};
use super::words::described;
use serde::Serialize;
use std::collections::BTreeMap;

/// An object that is right in one table and wrong in the other.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Its seed.
    pub seed: u64,
    /// Its sensor.
    pub sensor: String,
    /// Its category.
    pub category: String,
    /// Its features in this table.
    pub features: Vec<String>,
    /// What was found before, in words.
    pub before: String,
    /// What was found now, in words.
    pub after: String,
}

/// How many objects have a property in both tables, in one, or in none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pairs {
    /// In both.
    pub both: usize,
    /// Only in the earlier table.
    pub lost: usize,
    /// Only in this table.
    pub won: usize,
    /// In none.
    pub none: usize,
    /// Two-sided p-value of the exact test of McNemar.
    pub p_value: f64,
}

impl Pairs {
    fn of(pairs: &[(&Row, &Row)], has: impl Fn(&Row) -> bool) -> Self {
        let count = |wanted: (bool, bool)| pairs.iter().filter(|(old, new)| (has(old), has(new)) == wanted).count();
        let (lost, won) = (count((true, false)), count((false, true)));
        Self { both: count((true, true)), lost, won, none: count((false, false)), p_value: mcnemar(lost, won) }
    }
}

/// What differs from an earlier table. Objects are the same if seed, sensor, category and true number of parts are equal.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Changes {
    /// Objects of both tables.
    pub both: usize,
    /// Objects that only this table has.
    pub added: usize,
    /// Objects that only the earlier table has.
    pub removed: usize,
    /// Objects of equal seed and sensor but another category or number of parts; they are not compared.
    pub other_object: usize,
    /// Objects of both tables that are not decidable in one of them; only their times are compared.
    pub undecidable: usize,
    /// Right objects.
    pub right: Pairs,
    /// Right objects with correct joints.
    pub joints_right: Pairs,
    /// Right before and wrong now.
    pub newly_wrong: Vec<Change>,
    /// Wrong before and right now.
    pub newly_right: Vec<Change>,
    /// Objects that are done in both tables.
    pub done_in_both: usize,
    /// Median time of these before and now, seconds; none without one.
    pub seconds: Option<[f64; 2]>,
    /// Median of the time now divided by the time before.
    pub time_ratio: Option<f64>,
    /// Median of the peak memory before and now, MiB.
    pub peak_memory_mib: Option<[f64; 2]>,
}

impl Changes {
    /// Compares two tables.
    pub fn new(before: &[Row], after: &[Row]) -> Self {
        let key = |row: &Row| (row.seed, row.sensor.clone());
        let earlier: BTreeMap<(u64, String), &Row> = before.iter().map(|row| (key(row), row)).collect();
        let found: Vec<(&Row, &Row)> = after.iter().filter_map(|row| Some((*earlier.get(&key(row))?, row))).collect();
        let same: Vec<(&Row, &Row)> = found.iter().copied().filter(is_same).collect();
        let decidable: Vec<(&Row, &Row)> = same.iter().copied().filter(|(o, n)| o.decidable && n.decidable).collect();
        let listed = |wanted: (bool, bool)| {
            decidable.iter().filter(|(old, new)| (old.right, new.right) == wanted).map(change).collect()
        };
        let done: Vec<(&Row, &Row)> = same.iter().copied().filter(|(o, n)| is_done(o) && is_done(n)).collect();
        Self {
            both: same.len(),
            added: after.len() - found.len(),
            removed: earlier.len() - found.len().min(earlier.len()),
            other_object: found.len() - same.len(),
            undecidable: same.len() - decidable.len(),
            right: Pairs::of(&decidable, |row| row.right),
            joints_right: Pairs::of(&decidable, |row| row.joints_right),
            newly_wrong: listed((true, false)),
            newly_right: listed((false, true)),
            done_in_both: done.len(),
            seconds: medians(&done, |row| row.seconds),
            time_ratio: median_ratio(&done),
            peak_memory_mib: medians(&done, |row| row.peak_memory_mib),
        }
    }
}

fn is_same((old, new): &(&Row, &Row)) -> bool {
    (&old.category, old.parts_true) == (&new.category, new.parts_true)
}

fn is_done(row: &Row) -> bool {
    row.status == Status::Done
}

fn change((old, new): &(&Row, &Row)) -> Change {
    Change {
        seed: new.seed,
        sensor: new.sensor.clone(),
        category: new.category.clone(),
        features: new.features.clone(),
        before: described(old),
        after: described(new),
    }
}

/// Medians before and now of the objects that have a positive number in both tables.
fn medians(pairs: &[(&Row, &Row)], of: impl Fn(&Row) -> f64) -> Option<[f64; 2]> {
    let known = pairs.iter().map(|(old, new)| (of(old), of(new))).filter(|(old, new)| *old > 0.0 && *new > 0.0);
    let (before, after): (Vec<f64>, Vec<f64>) = known.unzip();
    Some([percentile(&before, 0.5)?, percentile(&after, 0.5)?])
}

fn median_ratio(pairs: &[(&Row, &Row)]) -> Option<f64> {
    let ratios = pairs.iter().filter(|(old, new)| old.seconds > 0.0 && new.seconds > 0.0);
    let ratios: Vec<f64> = ratios.map(|(old, new)| new.seconds / old.seconds).collect();
    percentile(&ratios, 0.5)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{off, refused, right, wrong_type};
    use super::*;

    #[test]
    fn differences_of_two_known_tables() {
        let phone = |row: Row| Row { sensor: "phone".into(), ..row };
        let before =
            [right(1), right(2), wrong_type(3), refused(4), right(5), phone(wrong_type(1)), right(7), right(8)];
        let after = [
            wrong_type(1),
            off(2),
            Row { seconds: 20.0, ..right(3) },
            wrong_type(4),
            Row { parts_true: 5, ..right(5) },
            phone(right(1)),
            right(6),
            Row { decidable: false, ..wrong_type(8) },
        ];
        let found = Changes::new(&before, &after);
        assert_eq!((found.both, found.added, found.removed, found.other_object), (6, 1, 1, 1));
        assert_eq!(found.undecidable, 1);
        let seeds = |list: &[Change]| list.iter().map(|c| (c.seed, c.sensor.clone())).collect::<Vec<_>>();
        assert_eq!(seeds(&found.newly_wrong), [(1, "exact".into())]);
        assert_eq!(seeds(&found.newly_right), [(3, "exact".into()), (1, "phone".into())]);
        assert_eq!(found.newly_wrong[0].after, "found 2 of 2 parts; joint 2 slide for hinge, confidence 0.93");
        let Pairs { both, lost, won, none, p_value } = found.right;
        assert_eq!((both, lost, won, none, p_value), (1, 1, 2, 1, 1.0));
        assert_eq!((found.joints_right.both, found.joints_right.lost), (0, 2));
        assert_eq!((found.done_in_both, found.seconds, found.time_ratio), (5, Some([10.0, 10.0]), Some(1.0)));
    }

    #[test]
    fn tables_without_a_common_object_have_no_medians() {
        let found = Changes::new(&[right(1)], &[right(2)]);
        assert_eq!((found.both, found.seconds, found.time_ratio, found.right.p_value), (0, None, None, 1.0));
    }
}
