//! `BENCHMARKS.md`.

use crate::escape::markdown as escape;
use crate::table::{Origin, Table};
use std::fmt::Write;

/// The report as Markdown: a title, how it was made, the tables.
pub(crate) fn document(title: &str, intro: &[String], command: &str, tables: &[Table]) -> String {
    let mut out = format!("# {}\n\n", escape(title));
    // Four spaces make a code block of text without line breaks.
    let line: String = command.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let _ = writeln!(out, "Made by\n\n    {line}\n");
    for paragraph in intro {
        let _ = writeln!(out, "{}\n", escape(paragraph));
    }
    tables.iter().for_each(|t| table(&mut out, t));
    format!("{}\n", out.trim_end())
}

fn table(out: &mut String, table: &Table) {
    let _ = writeln!(out, "## {}\n", escape(&table.title));
    for note in &table.notes {
        let _ = writeln!(out, "{}\n", escape(note));
    }
    let line = |cells: &mut dyn Iterator<Item = String>| format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "));
    out.push_str(&line(&mut table.head.iter().map(|h| escape(h))));
    out.push_str(&line(&mut table.head.iter().map(|_| "---".into())));
    for row in &table.rows {
        // Rows of this benchmark are bold among those of the paper.
        let beside_others = table.rows.iter().any(|r| r.origin != row.origin);
        let cell = |c: &String| match row.origin {
            Origin::Ours if beside_others => format!("**{}**", escape(c)),
            Origin::StandIn => format!("*{}*", escape(c)),
            Origin::Ours | Origin::Paper => escape(c),
        };
        out.push_str(&line(&mut row.cells.iter().map(cell)));
    }
    out.push('\n');
}
