//! Differences between two tables of the same captures.

use super::row::Row;
use super::summary::Spread;
use crate::histogram::short;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Changes of confidence below this are not listed.
const CONFIDENCE: f64 = 0.05;
/// Changes of time below this factor, or below this number of seconds, are not listed.
const TIME: (f64, f64) = (1.25, 1.0);

/// A capture that is different.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// Its id.
    pub id: String,
    /// In the earlier table.
    pub before: String,
    /// In this table.
    pub after: String,
}

/// A score in both tables.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ScoreChange {
    /// Its name.
    pub name: String,
    /// Captures that have it in both.
    pub captures: usize,
    /// Their mean in the earlier table.
    pub before: f64,
    /// Their mean in this table.
    pub after: f64,
}

/// What differs from an earlier table.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Changes {
    /// Captures of both tables.
    pub both: usize,
    /// Of these, those whose row is that of the same run.
    pub same_run: usize,
    /// Ids that only this table has.
    pub added: Vec<String>,
    /// Ids that only the earlier table has.
    pub removed: Vec<String>,
    /// Failed here and done before.
    pub newly_failed: Vec<Change>,
    /// Done here and failed before.
    pub newly_done: Vec<Change>,
    /// Other number of parts or other joint types.
    pub structure: Vec<Change>,
    /// Confidence changed by 0.05 or more; the largest fall first.
    pub confidence: Vec<Change>,
    /// At least 25 % and one second slower; the largest factor first.
    pub slower: Vec<Change>,
    /// At least 25 % and one second faster; the largest factor first.
    pub faster: Vec<Change>,
    /// Median over captures that are done in both tables and were run again: time here, divided by time before.
    pub time_ratio: Option<f64>,
    /// Scores of both tables.
    pub scores: Vec<ScoreChange>,
}

impl Changes {
    /// Compares rows of the same ids.
    pub(super) fn new(before: &[Row], after: &[Row]) -> Self {
        let earlier: BTreeMap<&str, &Row> = before.iter().map(|row| (row.id.as_str(), row)).collect();
        let ids: BTreeSet<&str> = after.iter().map(|row| row.id.as_str()).collect();
        let pairs: Vec<(&Row, &Row)> =
            after.iter().filter_map(|row| Some((*earlier.get(row.id.as_str())?, row))).collect();
        let of = |wanted: (bool, bool)| pairs.iter().filter(move |(old, new)| (old.done, new.done) == wanted);
        let both_done: Vec<(&Row, &Row)> = of((true, true)).copied().collect();
        let listed = |pair: &(&Row, &Row)| change(pair, described);
        let (slower, faster, time_ratio) = times(&both_done);
        Self {
            both: pairs.len(),
            same_run: pairs.iter().filter(|pair| is_same_run(pair)).count(),
            added: after.iter().map(|r| &r.id).filter(|id| !earlier.contains_key(id.as_str())).cloned().collect(),
            removed: before.iter().map(|r| &r.id).filter(|id| !ids.contains(id.as_str())).cloned().collect(),
            newly_failed: of((true, false)).map(listed).collect(),
            newly_done: of((false, true)).map(listed).collect(),
            structure: both_done
                .iter()
                .filter(|(o, n)| (o.parts, &o.joints) != (n.parts, &n.joints))
                .map(listed)
                .collect(),
            confidence: confidence(&both_done),
            slower,
            faster,
            time_ratio,
            scores: scores(&pairs),
        }
    }
}

fn is_same_run((old, new): &(&Row, &Row)) -> bool {
    old.started.is_some() && (old.started, &old.content) == (new.started, &new.content)
}

fn change((old, new): &(&Row, &Row), text: impl Fn(&Row) -> String) -> Change {
    Change { id: new.id.clone(), before: text(old), after: text(new) }
}

/// What a run ended with, in a few words.
fn described(row: &Row) -> String {
    if !row.done {
        return format!("failed: {}", row.reason);
    }
    let joints = row.joints.as_deref().filter(|joints| !joints.is_empty()).unwrap_or("no joints");
    match row.parts {
        Some(parts) => format!("{parts} parts: {joints}"),
        None => joints.into(),
    }
}

fn confidence(pairs: &[(&Row, &Row)]) -> Vec<Change> {
    let mut changed: Vec<(f64, Change)> = Vec::new();
    for pair in pairs {
        let text = |row: &Row| row.confidence.map_or("none".into(), |c| format!("{c:.2}"));
        let rise = match (pair.0.confidence, pair.1.confidence) {
            (Some(old), Some(new)) => new - old,
            (Some(_), None) => -1.0,
            (None, Some(_)) => 1.0,
            (None, None) => 0.0,
        };
        // Tolerance for differences such as 0.95 - 0.9.
        if rise.abs() >= CONFIDENCE - 1e-9 {
            changed.push((rise, change(pair, text)));
        }
    }
    changed.sort_by(|a, b| a.0.total_cmp(&b.0));
    changed.into_iter().map(|(_, change)| change).collect()
}

/// Slower and faster captures, and the median ratio of times.
fn times(pairs: &[(&Row, &Row)]) -> (Vec<Change>, Vec<Change>, Option<f64>) {
    let (factor, least) = TIME;
    let (mut ratios, mut slower, mut faster) = (Vec::new(), Vec::new(), Vec::new());
    for pair in pairs.iter().filter(|pair| !is_same_run(pair)) {
        let (Some(old), Some(new)) = (pair.0.seconds, pair.1.seconds) else { continue };
        if old <= 0.0 || new <= 0.0 {
            continue;
        }
        let ratio = new / old;
        ratios.push(ratio);
        let listed = || change(pair, |row| row.seconds.map_or(String::new(), |s| format!("{} s", short(s))));
        if (new - old).abs() >= least && ratio >= factor {
            slower.push((ratio, listed()));
        } else if (new - old).abs() >= least && ratio <= 1.0 / factor {
            faster.push((1.0 / ratio, listed()));
        }
    }
    let ordered = |mut changes: Vec<(f64, Change)>| {
        changes.sort_by(|a, b| b.0.total_cmp(&a.0));
        changes.into_iter().map(|(_, change)| change).collect()
    };
    (ordered(slower), ordered(faster), Spread::of(ratios).map(|spread| spread.median))
}

fn scores(pairs: &[(&Row, &Row)]) -> Vec<ScoreChange> {
    let mut values: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for (old, new) in pairs {
        for (name, value) in &new.scores {
            if let Some(before) = old.scores.get(name) {
                values.entry(name).or_default().push((*before, *value));
            }
        }
    }
    let mean =
        |values: &[(f64, f64)], of: fn(&(f64, f64)) -> f64| values.iter().map(of).sum::<f64>() / values.len() as f64;
    let change = |(name, values): (&str, Vec<(f64, f64)>)| ScoreChange {
        name: name.into(),
        captures: values.len(),
        before: mean(&values, |v| v.0),
        after: mean(&values, |v| v.1),
    };
    values.into_iter().map(change).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn done(id: &str, started: f64, seconds: f64, confidence: f64, joints: &str) -> Row {
        Row {
            id: id.into(),
            done: true,
            started: Some(started),
            seconds: Some(seconds),
            confidence: Some(confidence),
            parts: Some(2.0),
            joints: Some(joints.into()),
            scores: BTreeMap::from([("psnr".into(), seconds)]),
            ..Row::default()
        }
    }

    fn failed(id: &str) -> Row {
        Row { id: id.into(), reason: "bang".into(), ..Row::default() }
    }

    #[test]
    fn differences_of_two_known_tables() {
        let before = [
            done("same", 1.0, 10.0, 0.9, "revolute"),
            done("breaks", 1.0, 10.0, 0.9, "revolute"),
            failed("heals"),
            done("type", 1.0, 10.0, 0.90, "revolute"),
            done("falls", 1.0, 10.0, 0.9, "revolute"),
            done("slow", 1.0, 10.0, 0.9, "revolute"),
            done("fast", 1.0, 10.0, 0.9, "revolute"),
            failed("gone"),
        ];
        let after = [
            done("new", 2.0, 10.0, 0.9, "revolute"),
            done("fast", 2.0, 5.0, 0.9, "revolute"),
            done("slow", 2.0, 20.0, 0.9, "revolute"),
            done("falls", 2.0, 10.5, 0.2, "revolute"),
            done("type", 2.0, 10.5, 0.94, "prismatic"),
            done("heals", 2.0, 10.0, 0.9, "revolute"),
            failed("breaks"),
            done("same", 1.0, 10.0, 0.9, "revolute"),
        ];
        let changes = Changes::new(&before, &after);
        let ids = |list: &[Change]| list.iter().map(|c| c.id.clone()).collect::<Vec<_>>().join(" ");
        assert_eq!((changes.both, changes.same_run), (7, 1));
        assert_eq!((changes.added.join(" "), changes.removed.join(" ")), ("new".into(), "gone".into()));
        assert_eq!((ids(&changes.newly_failed), ids(&changes.newly_done)), ("breaks".into(), "heals".into()));
        assert_eq!(changes.newly_failed[0].after, "failed: bang");
        assert_eq!((ids(&changes.structure), ids(&changes.confidence)), ("type".into(), "falls".into()));
        assert_eq!(changes.structure[0].after, "2 parts: prismatic");
        assert_eq!((ids(&changes.slower), ids(&changes.faster)), ("slow".into(), "fast".into()));
        assert!((changes.time_ratio.unwrap() - 1.05).abs() < 1e-12, "the run that was not repeated does not count");
        assert_eq!((changes.scores[0].captures, changes.scores[0].before), (5, 10.0));
    }
}
