//! `artgs report` of the table of a population: a page, and its tables as Markdown.

use crate::args::Report;
use crate::failure::Failure;
use crate::output::{note, say};
use crate::page_file::page_file;
use crate::started;
use crate::style::Style;
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
    check_free(&markdown)?;
    let origin = Origin { command: started::line(), base };
    let page = report::page(&rows, &summary, &origin);
    write_atomic(&html, page.as_bytes()).map_err(Failure::failed)?;
    write_atomic(&markdown, report::markdown(&summary, &origin).as_bytes()).map_err(Failure::failed)?;
    if summary.changes.as_ref().is_some_and(|changes| changes.both == 0) {
        note("no object is in both tables: nothing can be compared with that of --before", style);
    }
    if style.json {
        return say(json!({ "event": "result", "html": html, "markdown": markdown, "summary": summary }));
    }
    let lines = || format!("{}\n{}\n{}", report::overview(&summary), html.display(), markdown.display());
    if style.quiet { Ok(()) } else { say(lines()) }
}

/// Refuses to replace a file that `artgs report` did not write: its name follows from that of the page.
fn check_free(markdown: &Path) -> Result<(), Failure> {
    match std::fs::read(markdown) {
        Ok(text) if !report::is_markdown(&text) => Err(Failure::bad(format!(
            "the tables of the page are written to {}, which artgs report did not write; give another page to -o",
            markdown.display()
        ))),
        _ => Ok(()),
    }
}

fn read(table: &Path) -> Result<Vec<Row>, Failure> {
    if !report::is_population(table) {
        let reason = "is no table of artgs bench population: no row in it has a seed and a category";
        return Err(Failure::bad(format!("{}: {reason}", table.display())));
    }
    read_rows(table).map_err(Failure::bad_input)
}

/// The folder of the benchmark, in which previews are.
fn base(table: &Path) -> PathBuf {
    let is_rows = table.is_dir() && table.file_name().is_some_and(|name| name == "rows");
    if table.is_dir() && !is_rows { table.into() } else { table.parent().unwrap_or(Path::new("")).into() }
}
