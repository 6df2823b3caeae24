//! `artgs report` of the table of a population: a page, and its tables as Markdown.

use crate::args::Report;
use crate::commands::Style;
use crate::failure::Failure;
use crate::output::say;
use crate::process;
use crate::report::page_file;
use artgs_bench::population::report::{self, Origin, Summary};
use artgs_bench::population::{Row, read_rows};
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
