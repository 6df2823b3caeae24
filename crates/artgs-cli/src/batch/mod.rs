//! `artgs batch`: captures of a manifest, one or all; for schedulers of clusters.

mod manifest;
mod row;
mod worker;

use crate::args::Batch;
use crate::failure::Failure;
use crate::output::say;
use crate::started;
use crate::style::Style;
use anyhow::{Context, anyhow};
use artgs_io::write_atomic;
use manifest::Entry;
use row::Row;
use serde_json::json;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use worker::Worker;

pub(crate) fn run(args: &Batch, style: Style) -> Result<(), Failure> {
    let Some(out) = &args.out else {
        return say(manifest::read(&args.manifest).map_err(Failure::bad)?.len());
    };
    let entries = match args.index {
        None => manifest::read(&args.manifest),
        Some(index) => manifest::read_one(&args.manifest, index).map(|entry| vec![entry]),
    };
    let entries = entries.map_err(Failure::bad)?;
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || flag.store(true, Ordering::Relaxed)).context("cannot watch for Ctrl-C")?;
    let formats = args.to.iter().map(|format| format.0.name()).collect::<Vec<_>>().join(",");
    let worker = Worker {
        program: started::program().context("cannot find the path of this program")?,
        out,
        formats: Some(formats.as_str()).filter(|formats| !formats.is_empty()),
        retry_failed: args.retry_failed,
        stop: &stop,
    };
    let rows = run_all(&worker, &entries, style)?;
    if args.index.is_none() {
        write_table(out, &rows)?;
    }
    conclude(&rows)
}

fn run_all(worker: &Worker<'_>, entries: &[Entry], style: Style) -> Result<Vec<Row>, Failure> {
    let mut rows = Vec::new();
    for entry in entries {
        let (row, earlier) = worker.run(entry)?;
        show(&row, earlier, style)?;
        rows.push(row);
    }
    Ok(rows)
}

fn show(row: &Row, earlier: bool, style: Style) -> Result<(), Failure> {
    if style.json {
        return say(json!({ "event": "result", "earlier": earlier, "row": row }));
    }
    if style.quiet {
        return Ok(());
    }
    let before = if earlier { "earlier run: " } else { "" };
    match row.parts {
        Some(parts) if row.is_done() => say(format!("{}: {before}{parts} parts, {:.1} s", row.id, row.seconds)),
        _ => say(format!("{}: {before}failed: {}", row.id, row.reason)),
    }
}

/// The rows of all captures in the order of the manifest, one JSON object per line.
fn write_table(out: &Path, rows: &[Row]) -> Result<(), Failure> {
    let lines: Result<Vec<String>, _> = rows.iter().map(serde_json::to_string).collect();
    let text = lines.context("a row has no JSON form")?.join("\n") + "\n";
    write_atomic(&out.join("results.jsonl"), text.as_bytes()).map_err(Failure::failed)
}

/// The exit code says whether a retry makes sense.
fn conclude(rows: &[Row]) -> Result<(), Failure> {
    let failed: Vec<&Row> = rows.iter().filter(|row| !row.is_done()).collect();
    let Some(first) = failed.first() else { return Ok(()) };
    let what = match (rows.len(), failed.len()) {
        (1, _) => format!("{}: {}", first.id, first.reason),
        (all, n) => format!("{n} of {all} captures failed, first {}: {}", first.id, first.reason),
    };
    if failed.iter().any(|row| row.retry) { Err(Failure::Retry(anyhow!(what))) } else { Err(Failure::bad(what)) }
}
