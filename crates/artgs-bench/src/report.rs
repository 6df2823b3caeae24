//! The report of a benchmark: `BENCHMARKS.md`, `results.json` and `index.html`.

use crate::collect::{Collected, ObjectInfo};
use crate::html::{self, Picture};
use crate::metric;
use crate::picture::preview_url;
use crate::plots::plots;
use crate::record::Record;
use crate::stats::Aggregate;
use crate::tables::tables;
use crate::{markdown, table};
use artgs_io::{FileError, RunFolder, write_atomic};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const TITLE: &str = "artgs benchmark";
/// Value of `format` in `results.json`.
const FORMAT: &str = "artgs-bench";

/// How the benchmark was run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Circumstances {
    /// The command.
    pub command: String,
    /// Threads a run may use.
    pub threads: usize,
    /// Runs at a time.
    pub jobs: usize,
    /// True if the number of parts was given to every variant, false if only to those that cannot find it.
    pub parts_given: bool,
    /// True if runs stopped when parts and joints were found.
    pub stopped_after_discover: bool,
}

/// Files of a report.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Files {
    /// `BENCHMARKS.md`.
    pub markdown: PathBuf,
    /// `results.json`.
    pub json: PathBuf,
    /// `index.html`.
    pub html: PathBuf,
}

/// Writes `BENCHMARKS.md`, `results.json` and `index.html` into the folder of the bench. The same records give the same
/// bytes.
pub fn write_report(out: &Path, all: &Collected, how: &Circumstances) -> Result<Files, FileError> {
    let files =
        Files { markdown: out.join("BENCHMARKS.md"), json: out.join("results.json"), html: out.join("index.html") };
    let (tables, intro) = (tables(all), intro(all, how));
    write_atomic(&files.json, format!("{:#}\n", results(all, how)).as_bytes())?;
    write_atomic(&files.markdown, markdown::document(TITLE, &intro, &how.command, &tables).as_bytes())?;
    let page = html::document(TITLE, &intro, &how.command, &tables, &plots(all), &pictures(out, all));
    write_atomic(&files.html, page.as_bytes())?;
    Ok(files)
}

fn intro(all: &Collected, how: &Circumstances) -> Vec<String> {
    let failed = all.records.iter().filter(|r| r.measured().is_none()).count();
    let parts = match how.parts_given {
        true => "The number of parts was given.",
        false => "The number of parts was not given, except to variants that cannot find it.",
    };
    let alone = match how.jobs {
        0 | 1 => "one run at a time".to_string(),
        n => format!("{n} runs at a time, so that times are longer than those of a run alone"),
    };
    let (version, runs, threads) = (env!("CARGO_PKG_VERSION"), all.records.len(), how.threads);
    let measured = all.records.iter().filter_map(Record::measured);
    let devices: BTreeSet<&str> = measured.filter_map(|m| m.metrics.device.as_deref()).collect();
    let trained = match devices.is_empty() {
        true => String::new(),
        false => format!(" Trained on {}.", devices.into_iter().collect::<Vec<&str>>().join(", ")),
    };
    let stopped = match how.stopped_after_discover {
        true => " Runs stopped when parts and joints were found; surfaces are those of the labelled points.",
        false => "",
    };
    vec![format!(
        "artgs {version}: {runs} runs, {failed} failed; {threads} threads, {alone}. {parts}{trained}{stopped}"
    )]
}

/// All records with their means and failures.
fn results(all: &Collected, how: &Circumstances) -> Value {
    let mut aggregates = Vec::new();
    for variant in &all.variants {
        for object in &all.objects {
            let mut metrics = Map::new();
            for metric in metric::all() {
                if let Some(Aggregate { mean, std, runs }) = all.aggregate(&variant.name, object, metric) {
                    metrics.insert(metric.key(), json!({ "mean": mean, "std": std, "runs": runs }));
                }
            }
            let failures = all.failures(&variant.name, &object.name);
            aggregates.push(json!({
                "variant": variant.name, "object": object.name, "failures": failures, "metrics": metrics,
            }));
        }
    }
    json!({
        "format": FORMAT, "version": 1, "circumstances": how, "variants": all.variants,
        "objects": all.objects.iter().map(object_json).collect::<Vec<_>>(),
        "aggregates": aggregates, "records": all.records,
    })
}

fn object_json(object: &ObjectInfo) -> Value {
    json!({
        "name": object.name, "parts": object.parts, "paper_object": object.stands_for.map(|o| o.id),
        "same_object": object.same_object,
    })
}

/// One picture for every object, from its first run that has one.
fn pictures(out: &Path, all: &Collected) -> Vec<Picture> {
    let mut pictures = Vec::new();
    for object in &all.objects {
        let runs = all.records.iter().filter(|r| r.object == object.name && r.measured().is_some());
        let picture = |r: &Record| {
            let url = preview_url(&RunFolder::new(out.join(&r.folder)).preview())?;
            Some(Picture { caption: vec![format!("{}, {}, seed {}", object.name, r.variant, r.seed)], image: Ok(url) })
        };
        pictures.extend(runs.into_iter().find_map(picture));
    }
    pictures
}

/// The first table as text, for terminals.
pub fn overview(all: &Collected) -> String {
    let Some(table) = tables(all).into_iter().next() else { return String::new() };
    text_table(&table)
}

fn text_table(table: &table::Table) -> String {
    let lines: Vec<&Vec<String>> = std::iter::once(&table.head).chain(table.rows.iter().map(|r| &r.cells)).collect();
    let length = |s: &String| s.chars().count();
    let widths: Vec<usize> =
        (0..table.head.len()).map(|c| lines.iter().map(|l| length(&l[c])).max().unwrap_or_default()).collect();
    let mut out = String::new();
    for line in lines {
        let padded: Vec<String> = line.iter().zip(&widths).map(|(cell, w)| format!("{cell:<w$}")).collect();
        out.push_str(padded.join("  ").trim_end());
        out.push('\n');
    }
    out
}

#[cfg(test)]
#[path = "report_tests.rs"]
mod tests;
