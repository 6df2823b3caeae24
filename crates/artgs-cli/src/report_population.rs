//! `artgs report` of the table of a population: a page, and its tables as Markdown.

use crate::args::Report;
use crate::commands::Style;
use crate::failure::Failure;
use crate::output::say;
use crate::process;
use crate::report::page_file;
use artgs_bench::batch::TableError;
use artgs_bench::population::Row;
use artgs_bench::population::report::{self, Origin, Summary};
use artgs_io::write_atomic;
use serde_json::json;
use std::path::{Path, PathBuf};

pub(crate) fn run(args: &Report, style: Style) -> Result<(), Failure> {
    if args.cpu_price.is_some() {
        return Err(Failure::bad("--cpu-price is for tables of artgs batch; this one is of artgs bench population"));
    }
    let rows = read(&args.table)?;
    let before = args.before.as_deref().map(read).transpose()?;
    let summary = Summary::new(&rows, before.as_deref());
    let base = base(&args.table);
    let html = page_file(args.out.as_deref(), &base);
    let markdown = html.with_extension("md");
    let origin = Origin { command: process::line(), base };
    let page = report::page(&rows, &summary, &origin);
    write_atomic(&html, page.as_bytes()).map_err(Failure::failed)?;
    write_atomic(&markdown, report::markdown(&summary, &origin).as_bytes()).map_err(Failure::failed)?;
    if style.json {
        return say(json!({ "event": "result", "html": html, "markdown": markdown, "summary": summary }));
    }
    let lines = || format!("{}\n{}\n{}", report::overview(&summary), html.display(), markdown.display());
    if style.quiet { Ok(()) } else { say(lines()) }
}

fn read(table: &Path) -> Result<Vec<Row>, Failure> {
    if !report::is_population(table) {
        let reason = "is no table of artgs bench population: its first row has no seed and category";
        return Err(Failure::bad(format!("{}: {reason}", table.display())));
    }
    read_rows(table).map_err(Failure::bad_input)
}

/// The folder of the benchmark, in which previews are.
fn base(table: &Path) -> PathBuf {
    let is_rows = table.is_dir() && table.file_name().is_some_and(|name| name == "rows");
    if table.is_dir() && !is_rows { table.into() } else { table.parent().unwrap_or(Path::new("")).into() }
}

// To be replaced by `artgs_bench::population::read_rows`, which also reads Parquet.
fn read_rows(table: &Path) -> Result<Vec<Row>, TableError> {
    let fail = |path: &Path, reason: String| TableError { path: path.into(), reason };
    let bytes = |path: &Path| std::fs::read(path).map_err(|e| fail(path, e.to_string()));
    if table.is_dir() {
        let inner = table.join("rows");
        let folder = if inner.is_dir() { &inner } else { table };
        let listed = std::fs::read_dir(folder).map_err(|e| fail(folder, e.to_string()))?;
        let mut files: Vec<PathBuf> = listed.filter_map(|entry| Some(entry.ok()?.path())).collect();
        files.retain(|file| file.extension().is_some_and(|e| e == "json"));
        files.sort();
        let row = |file: PathBuf| serde_json::from_slice(&bytes(&file)?).map_err(|e| fail(&file, e.to_string()));
        return files.into_iter().map(row).collect();
    }
    let content = bytes(table)?;
    let lines = content.split(|b| *b == b'\n').zip(1_u64..).filter(|(line, _)| !line.trim_ascii().is_empty());
    let row = |(line, number): (&[u8], u64)| {
        serde_json::from_slice(line).map_err(|e| fail(table, format!("line {number}: {e}")))
    };
    lines.map(row).collect()
}
