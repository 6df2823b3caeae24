//! Shares of right objects by what the objects are: features, categories, sensors, numbers of parts.

use super::super::Row;
use super::kinds::seeds;
use super::statistics::Share;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Ranges of the number of parts.
const PARTS: [(u32, u32); 5] = [(1, 1), (2, 2), (3, 4), (5, 8), (9, 20)];

/// Name of the group of objects that have no feature. It is no feature.
pub(super) const FEATURELESS: &str = "without a feature";

/// Decidable objects with something in common.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// What they have in common.
    pub name: String,
    /// Right objects of the group.
    pub right: Share,
    /// Objects of the group whose joints are correct as well.
    pub joints_right: Share,
    /// Right objects outside the group.
    pub others: Share,
    /// Share right of the group less that of the others; none if one of them has no objects.
    pub difference: Option<f64>,
    /// Wrong objects of the group above the average: how many less there were if as large a share of the group as of all objects were
    /// right. Negative for groups that are better than the average.
    pub lost: f64,
    /// Right objects of the group that do not have the feature that loses most: what remains if that one is repaired. None where groups do
    /// not overlap.
    pub without_first: Option<Share>,
    /// Seeds of the wrong objects in rising order.
    pub wrong: Vec<u64>,
}

/// Groups of decidable objects by a name; the one that loses most first.
fn groups(rows: &[Row], names: impl Fn(&Row) -> BTreeSet<String>) -> Vec<Group> {
    let decidable: Vec<&Row> = rows.iter().filter(|row| row.decidable).collect();
    let all = Share::among(&decidable, |row| row.right);
    let mut members: BTreeMap<String, Vec<&Row>> = BTreeMap::new();
    for row in &decidable {
        names(row).into_iter().for_each(|name| members.entry(name).or_default().push(row));
    }
    let mut groups: Vec<Group> = members.into_iter().map(|(name, rows)| group(name, &rows, all)).collect();
    groups.sort_by(|a, b| b.lost.total_cmp(&a.lost));
    groups
}

fn group(name: String, rows: &[&Row], all: Share) -> Group {
    let right = Share::among(rows, |row| row.right);
    let others = Share::new(all.count - right.count, all.of - right.of);
    let wrong: Vec<&Row> = rows.iter().filter(|row| !row.right).copied().collect();
    Group {
        name,
        right,
        joints_right: Share::among(rows, |row| row.joints_right),
        others,
        difference: right.share.zip(others.share).map(|(a, b)| a - b),
        lost: all.share.map_or(0.0, |share| right.rest() as f64 - right.of as f64 * (1.0 - share)),
        without_first: None,
        wrong: seeds(&wrong),
    }
}

/// By feature; an object counts for each of its features.
pub(super) fn by_feature(rows: &[Row]) -> Vec<Group> {
    let mut groups = groups(rows, names_of_features);
    let Some(first) = first_feature(&groups).map(|group| group.name.clone()) else { return groups };
    for group in &mut groups {
        let others = rows.iter().filter(|row| {
            row.decidable && names_of_features(row).contains(&group.name) && !row.features.contains(&first)
        });
        group.without_first = Some(Share::among(&others.collect::<Vec<_>>(), |row| row.right));
    }
    groups
}

fn names_of_features(row: &Row) -> BTreeSet<String> {
    match row.features.as_slice() {
        [] => BTreeSet::from([FEATURELESS.to_string()]),
        features => features.iter().cloned().collect(),
    }
}

/// The feature that loses most of groups in this order; none if no object has a feature.
pub(super) fn first_feature(groups: &[Group]) -> Option<&Group> {
    groups.iter().find(|group| group.name != FEATURELESS)
}

/// By category.
pub(super) fn by_category(rows: &[Row]) -> Vec<Group> {
    groups(rows, |row| BTreeSet::from([row.category.clone()]))
}

/// By sensor.
pub(super) fn by_sensor(rows: &[Row]) -> Vec<Group> {
    groups(rows, |row| BTreeSet::from([row.sensor.clone()]))
}

/// By the true number of movable parts, in rising order.
pub(super) fn by_parts(rows: &[Row]) -> Vec<Group> {
    let mut groups = groups(rows, |row| BTreeSet::from([range(row.parts_true)]));
    let most = PARTS[PARTS.len() - 1].1 + 1;
    groups.sort_by_key(|group| (0..=most).find(|parts| range(*parts) == group.name));
    groups
}

/// The name of the range of a number of parts.
fn range(parts: u32) -> String {
    match PARTS.iter().find(|(low, high)| (*low..=*high).contains(&parts)) {
        Some((low, high)) if low == high => low.to_string(),
        Some((low, high)) => format!("{low}-{high}"),
        None if parts == 0 => "none".into(),
        None => format!("more than {}", PARTS[PARTS.len() - 1].1),
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{right, wrong_type};
    use super::*;

    fn with(row: Row, features: &[&str]) -> Row {
        Row { features: features.iter().map(ToString::to_string).collect(), ..row }
    }

    #[test]
    fn the_feature_that_loses_most_is_first() {
        // 10 objects, 4 wrong. `bad`: 3 of 4 wrong, the average would be 1.6.
        let mut rows = vec![with(wrong_type(3), &["bad"]), with(wrong_type(1), &["bad", "mild"])];
        rows.extend([with(wrong_type(2), &["bad"]), with(right(4), &["bad"]), with(wrong_type(5), &["mild"])]);
        rows.extend((6..11).map(|seed| with(right(seed), &["good"])));
        rows.push(Row { decidable: false, ..with(wrong_type(20), &["good"]) });
        let found = by_feature(&rows);
        let names: Vec<&str> = found.iter().map(|g| g.name.as_str()).collect();
        assert_eq!(names, ["bad", "mild", "good"]);
        assert_eq!(
            (found[0].right, found[0].others, found[0].wrong.clone()),
            (Share::new(1, 4), Share::new(5, 6), vec![1, 2, 3])
        );
        assert!((found[0].lost - 1.4).abs() < 1e-12 && (found[2].lost + 2.0).abs() < 1e-12, "{found:?}");
        assert!((found[0].difference.unwrap() - (0.25 - 5.0 / 6.0)).abs() < 1e-12);
        let category = &by_category(&rows)[0];
        assert_eq!((category.difference, category.lost, category.others.share), (None, 0.0, None));
        assert!(by_feature(&[]).is_empty());
        assert_eq!(by_feature(&[right(1)])[0].name, "without a feature");
    }

    #[test]
    fn objects_without_a_feature_are_no_feature() {
        let rows = [wrong_type(1), wrong_type(2), with(right(3), &["thin"]), with(right(4), &["thin"])];
        let found = by_feature(&rows);
        assert_eq!((found[0].name.as_str(), first_feature(&found).unwrap().name.as_str()), (FEATURELESS, "thin"));
        let without: Vec<(&str, Option<Share>)> = found.iter().map(|g| (g.name.as_str(), g.without_first)).collect();
        assert_eq!(without[0], (FEATURELESS, Some(Share::new(0, 2))), "none of them is thin");
        assert!(without[1..].iter().all(|(_, share)| *share == Some(Share::new(0, 0))), "{without:?}");
        assert_eq!(by_feature(&[right(1)])[0].without_first, None);
    }

    #[test]
    fn numbers_of_parts_are_in_rising_order() {
        let rows: Vec<Row> = [25, 9, 4, 1, 20, 3, 8, 0].map(|parts_true| Row { parts_true, ..right(1) }).to_vec();
        let found = by_parts(&rows);
        let names: Vec<(&str, usize)> = found.iter().map(|g| (g.name.as_str(), g.right.of)).collect();
        assert_eq!(names, [("none", 1), ("1", 1), ("3-4", 2), ("5-8", 1), ("9-20", 2), ("more than 20", 1)]);
    }
}
