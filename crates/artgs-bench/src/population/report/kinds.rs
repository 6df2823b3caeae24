//! What is wrong with an object: one kind of error each.

use super::super::{Row, Status};
use super::words::joint_type;
use serde::Serialize;
use std::collections::BTreeMap;

/// The first thing that is wrong with an object, in the order of the variants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// The program refused the capture.
    Refused,
    /// The run or its scoring failed.
    Failed,
    /// Fewer parts than there are.
    TooFew,
    /// More parts than there are.
    TooMany,
    /// The number of parts is right, but they are not the true parts.
    OtherSplit,
    /// The parts are right; a joint type is wrong.
    Type,
    /// The parts and types are right; a parent is wrong.
    Parent,
    /// The parts are right; a joint type and a parent are wrong.
    TypeAndParent,
    /// Wrong for a reason that the row does not name.
    Other,
    /// Parts, types and parents are right; a joint is not correct. The object counts as right.
    Joint,
}

impl Kind {
    /// What is wrong with an object; none if its joints are correct as well.
    pub fn of(row: &Row) -> Option<Self> {
        let found = row.parts_found.cmp(&row.parts_true);
        match (row.status, row.right) {
            (Status::Refused, _) => Some(Self::Refused),
            (Status::Failed, _) => Some(Self::Failed),
            (Status::Done, true) => (!row.joints_right).then_some(Self::Joint),
            (Status::Done, false) if found.is_lt() => Some(Self::TooFew),
            (Status::Done, false) if found.is_gt() => Some(Self::TooMany),
            (Status::Done, false) if !row.count_right => Some(Self::OtherSplit),
            (Status::Done, false) => Some(match (row.types_right, row.parents_right) {
                (false, true) => Self::Type,
                (true, false) => Self::Parent,
                (false, false) => Self::TypeAndParent,
                (true, true) => Self::Other,
            }),
        }
    }

    /// Its name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Refused => "refused",
            Self::Failed => "failed",
            Self::TooFew => "too few parts",
            Self::TooMany => "too many parts",
            Self::OtherSplit => "right number of parts, split differently",
            Self::Type => "joint type wrong",
            Self::Parent => "parent wrong",
            Self::TypeAndParent => "joint type and parent wrong",
            Self::Other => "another reason",
            Self::Joint => "joint off (the object counts as right)",
        }
    }
}

/// Objects with the same kind of error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct KindCount {
    /// The kind.
    pub kind: Kind,
    /// Decidable objects.
    pub count: usize,
    /// The most frequent categories with their counts, the largest count first.
    pub categories: Vec<(String, usize)>,
    /// Seeds of all of them in rising order.
    pub seeds: Vec<u64>,
}

/// Kinds of errors of decidable objects, the most frequent first; `Joint`, which is no wrong object, last.
pub(super) fn kinds(rows: &[Row]) -> Vec<KindCount> {
    let mut of_kind: BTreeMap<Kind, Vec<&Row>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.decidable) {
        if let Some(kind) = Kind::of(row) {
            of_kind.entry(kind).or_default().push(row);
        }
    }
    let counted = |(kind, rows): (Kind, Vec<&Row>)| KindCount {
        kind,
        count: rows.len(),
        categories: most_frequent(rows.iter().map(|row| row.category.as_str())),
        seeds: seeds(&rows),
    };
    let mut kinds: Vec<KindCount> = of_kind.into_iter().map(counted).collect();
    kinds.sort_by_key(|k| (k.kind == Kind::Joint, std::cmp::Reverse(k.count)));
    kinds
}

/// Joints of one type that were found as another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Confusion {
    /// True type.
    pub truth: String,
    /// Type found.
    pub found: String,
    /// Joints of decidable objects.
    pub count: usize,
    /// Largest confidence of one of them; none if none has one.
    pub confidence: Option<f64>,
    /// Seeds of their objects in rising order.
    pub seeds: Vec<u64>,
}

/// Wrong joint types of found parts that cover a true one, the most frequent first.
pub(super) fn confusions(rows: &[Row]) -> Vec<Confusion> {
    let mut found: BTreeMap<[String; 2], Vec<(&Row, Option<f64>)>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.decidable) {
        for joint in row.joints.iter().filter(|joint| joint.truth.is_some() && joint.kind != joint.kind_true) {
            let types = [&joint.kind_true, &joint.kind].map(|kind| joint_type(kind));
            found.entry(types).or_default().push((row, joint.confidence));
        }
    }
    let confusion = |([truth, found], joints): ([String; 2], Vec<(&Row, Option<f64>)>)| Confusion {
        truth,
        found,
        count: joints.len(),
        confidence: joints.iter().filter_map(|joint| joint.1).filter(|c| c.is_finite()).reduce(f64::max),
        seeds: seeds(&joints.iter().map(|joint| joint.0).collect::<Vec<_>>()),
    };
    let mut confusions: Vec<Confusion> = found.into_iter().map(confusion).collect();
    confusions.sort_by_key(|c| std::cmp::Reverse(c.count));
    confusions
}

/// Seeds in rising order, each once.
pub(super) fn seeds(rows: &[&Row]) -> Vec<u64> {
    let mut seeds: Vec<u64> = rows.iter().map(|row| row.seed).collect();
    seeds.sort_unstable();
    seeds.dedup();
    seeds
}

fn most_frequent<'a>(names: impl Iterator<Item = &'a str>) -> Vec<(String, usize)> {
    const SHOWN: usize = 3;
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    names.for_each(|name| *counts.entry(name).or_default() += 1);
    let mut counts: Vec<(String, usize)> = counts.into_iter().map(|(name, n)| (name.to_string(), n)).collect();
    counts.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    counts.truncate(SHOWN);
    counts
}

#[cfg(test)]
mod tests {
    use super::super::testing::{off, right, wrong_type};
    use super::*;

    #[test]
    fn every_error_has_one_kind() {
        let of = |change: &dyn Fn(&mut Row)| {
            let mut row = Row { right: false, joints_right: false, ..right(1) };
            change(&mut row);
            Kind::of(&row)
        };
        assert_eq!(Kind::of(&right(1)), None);
        assert_eq!(Kind::of(&off(1)), Some(Kind::Joint));
        assert_eq!(of(&|row| row.status = Status::Refused), Some(Kind::Refused));
        assert_eq!(of(&|row| row.status = Status::Failed), Some(Kind::Failed));
        assert_eq!(of(&|row| row.parts_found = 1), Some(Kind::TooFew));
        assert_eq!(of(&|row| row.parts_found = 3), Some(Kind::TooMany));
        assert_eq!(of(&|row| row.count_right = false), Some(Kind::OtherSplit));
        assert_eq!(of(&|row| row.types_right = false), Some(Kind::Type));
        assert_eq!(of(&|row| row.parents_right = false), Some(Kind::Parent));
        assert_eq!(of(&|row| (row.types_right, row.parents_right) = (false, false)), Some(Kind::TypeAndParent));
        assert_eq!(of(&|_| ()), Some(Kind::Other));
    }

    #[test]
    fn kinds_are_counted_for_decidable_objects() {
        let mut rows = vec![off(1), off(2), off(3), wrong_type(9), wrong_type(4), right(5)];
        rows.push(Row { decidable: false, ..wrong_type(6) });
        let found = kinds(&rows);
        let short: Vec<(Kind, usize, Vec<u64>)> = found.iter().map(|k| (k.kind, k.count, k.seeds.clone())).collect();
        assert_eq!(short, [(Kind::Type, 2, vec![4, 9]), (Kind::Joint, 3, vec![1, 2, 3])]);
        assert_eq!(found[0].categories, [("cabinet".to_string(), 2)]);
        let confused = confusions(&rows);
        assert_eq!(confused.len(), 1);
        assert_eq!((confused[0].truth.as_str(), confused[0].found.as_str(), confused[0].count), ("hinge", "slide", 2));
        assert_eq!(confused[0].confidence, Some(0.93));
    }
}
