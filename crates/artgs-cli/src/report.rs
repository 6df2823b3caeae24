//! `artgs report`: a page about the results of a batch; `report_population` makes that of a population.

use crate::args::Report;
use crate::failure::Failure;
use crate::output::say;
use crate::page_file::page_file;
use crate::report_population;
use crate::started;
use crate::style::Style;
use artgs_bench::batch::{self, Cause, Origin, Retry, Row, Summary};
use artgs_bench::population::report::is_population;
use artgs_io::write_atomic;
use serde_json::json;
use std::path::Path;

/// Causes that the terminal shows.
const SHOWN: usize = 5;

pub(crate) fn run(args: &Report, style: Style) -> Result<(), Failure> {
    std::iter::once(&args.table).chain(&args.before).try_for_each(|table| check_exists(table))?;
    if is_population(&args.table) {
        return report_population::run(args, style);
    }
    if let Some(before) = args.before.as_deref().filter(|before| is_population(before)) {
        let kinds = "is a table of artgs bench population, and the other one is none; give two tables of one kind";
        return Err(Failure::bad(format!("{}: {kinds}", before.display())));
    }
    let read = |table: &Path| batch::read_rows(table).map_err(Failure::bad_input);
    let (rows, base) = read(&args.table)?;
    let before: Option<Vec<Row>> = args.before.as_deref().map(|table| read(table).map(|(rows, _)| rows)).transpose()?;
    let summary = Summary::new(&rows, before.as_deref(), args.cpu_price);
    let file = page_file(args.out.as_deref(), &base);
    let page = batch::page(&rows, &summary, &Origin { command: started::line(), base });
    write_atomic(&file, page.as_bytes()).map_err(Failure::failed)?;
    if style.json {
        return say(json!({ "event": "result", "html": file, "summary": summary }));
    }
    if style.quiet { Ok(()) } else { say(described(&summary, &file)) }
}

fn check_exists(table: &Path) -> Result<(), Failure> {
    if table.exists() { Ok(()) } else { Err(Failure::bad(format!("{}: No such file or folder", table.display()))) }
}

fn described(summary: &Summary, file: &Path) -> String {
    let Summary { captures, done, failed, retry, .. } = summary;
    let mut text = format!("{captures} captures, {done} done, {failed} failed; a retry makes sense for {retry}\n");
    for Cause { cause, count, retry, .. } in summary.causes.iter().take(SHOWN) {
        let retry = match retry {
            Retry::Yes => " (retry)",
            Retry::Some => " (retry some)",
            Retry::No => "",
        };
        text += &format!("{count:8}  {cause}{retry}\n");
    }
    if let Some(changes) = &summary.changes {
        let (broken, healed) = (changes.newly_failed.len(), changes.newly_done.len());
        let other = changes.structure.len();
        text += &format!("newly failed {broken}, newly done {healed}, other parts or joint types {other}\n");
    }
    text + &file.display().to_string()
}
