//! Tables of a report.

use super::causes::{Cause, Retry};
use super::changes::{Change, Changes};
use super::row::Row;
use super::summary::{FIELDS, Spread, Summary};
use crate::histogram::short;
use crate::table::{NOTHING, Table, fill, table};
use std::collections::BTreeMap;

/// Done, failed, time, cost.
pub(super) fn totals(rows: &[Row], summary: &Summary) -> Table {
    let mut versions: BTreeMap<&str, usize> = BTreeMap::new();
    for row in rows.iter().filter(|row| !row.program.is_empty()) {
        *versions.entry(&row.program).or_default() += 1;
    }
    let versions: Vec<String> = versions.iter().map(|(version, count)| format!("{version} ({count})")).collect();
    let of_all = |count: usize| format!("{count} ({:.1} %)", 100.0 * count as f64 / summary.captures.max(1) as f64);
    let counted = rows.iter().filter(|row| row.cpu_seconds.is_some()).count();
    let mut cells = vec![
        ("captures", summary.captures.to_string()),
        ("done", of_all(summary.done)),
        ("failed", of_all(summary.failed)),
        ("failed, and a retry makes sense", of_all(summary.retry)),
        ("time of all runs", duration(summary.seconds)),
        (
            "processor time",
            summary.cpu_seconds.map_or("not in the table".into(), |s| format!("{} of {counted} captures", duration(s))),
        ),
    ];
    let mean = summary.cpu_seconds.map(|s| s / counted.max(1) as f64);
    cells.extend(mean.map(|mean| ("processor time per capture", format!("{} s", short(mean)))));
    cells.extend(summary.cost.map(|cost| ("cost of the processor time", format!("{cost:.2}"))));
    cells.extend((!versions.is_empty()).then(|| ("version of the program (captures)", versions.join(", "))));
    let head = table("Totals", "", &["", "value"]);
    fill(head, &cells, |(what, value)| vec![(*what).into(), value.clone()])
}

/// Seconds as hours or minutes.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s >= 3600.0 => format!("{} h", short(s / 3600.0)),
        s if s >= 60.0 => format!("{} min", short(s / 60.0)),
        s => format!("{} s", short(s)),
    }
}

/// Failures by cause.
pub(super) fn causes(causes: &[Cause]) -> Table {
    let note = "Reasons without paths, numbers, quoted texts and ids, so that equal causes are one group. Retry: yes, the same command may \
                succeed; no, the capture or an option has to be changed; some, see the failed captures.";
    let head = table("Failures by cause", note, &["captures", "retry", "cause", "ids", "first reason"]);
    fill(head, causes, |cause| {
        let more = if cause.count > cause.ids.len() { ", …" } else { "" };
        let retry = match cause.retry {
            Retry::Yes => "yes",
            Retry::No => "no",
            Retry::Some => "some",
        };
        let ids = format!("{}{more}", cause.ids.join(", "));
        vec![cause.count.to_string(), retry.into(), cause.cause.clone(), ids, cause.reason.clone()]
    })
}

fn spreads<'a>(title: &str, note: &str, spreads: impl Iterator<Item = (&'a str, &'a Spread)>) -> Table {
    let head = ["", "captures", "least", "10 %", "median", "mean", "90 %", "99 %", "largest"];
    let spreads: Vec<(&str, &Spread)> = spreads.collect();
    fill(table(title, note, &head), &spreads, |(name, s)| {
        let numbers = [s.min, s.p10, s.median, s.mean, s.p90, s.p99, s.max].map(short);
        [vec![(*name).to_string(), s.count.to_string()], numbers.to_vec()].concat()
    })
}

/// Distributions of time, memory and confidence.
pub(super) fn distributions(summary: &Summary) -> Table {
    let named = FIELDS.iter().filter_map(|(field, name, _)| Some((*name, summary.spreads.get(*field)?)));
    spreads("Distributions", "Finished captures. Columns with % are quantiles.", named)
}

/// Distributions of scores.
pub(super) fn scores(summary: &Summary) -> Table {
    let note = "Numbers of the rows that artgs batch does not write itself, and the PSNR of held-out images in dB.";
    spreads("Scores", note, summary.scores.iter().map(|(name, spread)| (name.as_str(), spread)))
}

/// Captures that failed.
pub(super) fn failed(rows: &[Row]) -> Table {
    let rows: Vec<&Row> = rows.iter().filter(|row| !row.done).collect();
    let head = table("Failed captures", "In the order of the table.", &["id", "retry", "seconds", "reason"]);
    fill(head, &rows, |row| {
        let retry = if row.retry { "yes" } else { "no" };
        vec![row.id.clone(), retry.into(), row.seconds.map_or(NOTHING.into(), short), row.reason.clone()]
    })
}

/// What is different from an earlier table; the first one counts.
pub(super) fn changes(changes: &Changes) -> Vec<Table> {
    let lists: [(&str, &str, &[Change]); 6] = [
        ("Newly failed", "", &changes.newly_failed),
        ("Newly done", "", &changes.newly_done),
        ("Other parts or joint types", "Done in both tables.", &changes.structure),
        ("Other confidence", "Changes of at least 0.05, the largest fall first.", &changes.confidence),
        ("Slower", "At least 25 % and one second, the largest factor first.", &changes.slower),
        ("Faster", "At least 25 % and one second, the largest factor first.", &changes.faster),
    ];
    let mut counts = vec![
        ("captures of both tables", changes.both.to_string()),
        ("of these, the same run", changes.same_run.to_string()),
        ("only in this table", changes.added.len().to_string()),
        ("only in the earlier table", named(&changes.removed)),
    ];
    counts.extend(lists.iter().map(|(title, _, list)| (*title, list.len().to_string())));
    counts.extend(changes.time_ratio.map(|ratio| ("time, divided by time before: median", format!("{ratio:.2}"))));
    let head = table("Changes", "", &["", "value"]);
    let mut tables = vec![fill(head, &counts, |(what, value)| vec![(*what).into(), value.clone()])];
    for (title, note, list) in lists.iter().filter(|(_, _, list)| !list.is_empty()) {
        let head = table(title, note, &["id", "before", "now"]);
        tables.push(fill(head, list, |c| vec![c.id.clone(), c.before.clone(), c.after.clone()]));
    }
    if !changes.scores.is_empty() {
        let note = "Means of the captures that have the score in both tables.";
        let head = table("Scores in both tables", note, &["score", "captures", "before", "now"]);
        tables.push(fill(head, &changes.scores, |s| {
            vec![s.name.clone(), s.captures.to_string(), short(s.before), short(s.after)]
        }));
    }
    tables
}

/// A count with the first ids.
fn named(ids: &[String]) -> String {
    const SHOWN: usize = 10;
    let more = if ids.len() > SHOWN { ", …" } else { "" };
    let shown = ids.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    if ids.is_empty() { "0".into() } else { format!("{}: {shown}{more}", ids.len()) }
}
