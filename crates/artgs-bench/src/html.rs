//! `index.html`: one well-formed file without references to other files.

use crate::escape::html as escape;
use crate::plot::Plot;
use crate::table::{Origin, Table};
use std::fmt::Write;

const STYLE: &str = "
body { font: 14px/1.45 sans-serif; color: #222; background: #fff; margin: 2rem auto; max-width: 1500px; padding: 0 1.5rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; margin-top: 2.2rem; border-bottom: 1px solid #ddd; padding-bottom: .2rem; }
p { max-width: 75ch; } code { background: #f3f3f3; padding: .1rem .3rem; overflow-wrap: anywhere; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: .22rem .6rem; border-bottom: 1px solid #eee; white-space: nowrap; }
.number { text-align: right; } .text { text-align: left; } td.long { white-space: normal; max-width: 60ch; }
th { background: #f6f6f6; position: sticky; top: 0; }
tr.ours td { background: #eaf3ff; } tr.stand-in td { background: #fff6df; font-style: italic; }
tr.next td { border-top: 2px solid #ccc; }
.flow { display: flex; flex-wrap: wrap; gap: 1.2rem; } figure { margin: 0; }
figure img { max-width: 100%; border: 1px solid #ddd; } figcaption { font-size: 12px; color: #555; max-width: 450px; }
.absent { width: 450px; padding: 2rem 0; margin: 0; text-align: center; color: #777; background: #f6f6f6; }
";

/// Characters above which a cell may take several lines.
const LONG: usize = 40;

/// A picture with its caption.
pub(crate) struct Picture {
    /// What it shows; of several lines.
    pub(crate) caption: Vec<String>,
    /// `data:` URL, or why there is none.
    pub(crate) image: Result<String, &'static str>,
}

/// A page that is written from top to bottom.
pub(crate) struct Page(String);

impl Page {
    /// The head of a page, and the command that made it.
    pub(crate) fn new(title: &str, command: &str) -> Self {
        let title = escape(title);
        Self(format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\" />\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\" />\n\
             <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>\n\
             <p>Made by <code>{}</code></p>\n",
            escape(command)
        ))
    }

    /// A heading and the text below it.
    pub(crate) fn section(&mut self, title: &str, texts: &[String]) {
        let _ = writeln!(self.0, "<h2>{}</h2>", escape(title));
        self.paragraphs(texts);
    }

    pub(crate) fn paragraphs(&mut self, texts: &[String]) {
        for text in texts {
            let _ = writeln!(self.0, "<p>{}</p>", escape(text));
        }
    }

    /// `svg` elements side by side.
    pub(crate) fn drawings(&mut self, drawings: impl IntoIterator<Item = String>) {
        self.0.push_str("<div class=\"flow\">\n");
        drawings.into_iter().for_each(|svg| self.0.push_str(&svg));
        self.0.push_str("</div>\n");
    }

    /// Pictures side by side.
    pub(crate) fn pictures(&mut self, pictures: &[Picture]) {
        self.0.push_str("<div class=\"flow\">\n");
        for Picture { caption, image } in pictures {
            let caption: Vec<String> = caption.iter().map(|line| escape(line)).collect();
            let shown = match image {
                Ok(url) => {
                    let name = caption.first().map(String::as_str).unwrap_or_default();
                    format!("<img src=\"{}\" alt=\"{name}\" />", escape(url))
                }
                Err(why) => format!("<p class=\"absent\">{}</p>", escape(why)),
            };
            let _ = writeln!(self.0, "<figure>{shown}<figcaption>{}</figcaption></figure>", caption.join("<br />"));
        }
        self.0.push_str("</div>\n");
    }

    /// A table with its heading.
    pub(crate) fn table(&mut self, table: &Table) {
        self.table_with(table, None);
    }

    /// A table with a last column of `svg` elements or nothing, one for each row, below a heading.
    pub(crate) fn table_with(&mut self, table: &Table, drawn: Option<(&str, &[String])>) {
        self.section(&table.title, &table.notes);
        let out = &mut self.0;
        out.push_str("<div class=\"wide\">\n<table>\n<thead><tr>");
        for (column, name) in table.head.iter().enumerate() {
            let class = if table.rows.iter().all(|r| is_number(&r.cells[column])) { "number" } else { "text" };
            let _ = write!(out, "<th class=\"{class}\">{}</th>", escape(name));
        }
        if let Some((name, _)) = drawn {
            let _ = write!(out, "<th class=\"text\">{}</th>", escape(name));
        }
        out.push_str("</tr></thead>\n<tbody>\n");
        let mixed = table.rows.iter().any(|r| r.origin != Origin::Ours);
        let firsts: Vec<Option<&String>> = table.rows.iter().map(|r| r.cells.first()).collect();
        let grouped = firsts.windows(2).any(|pair| pair[0] == pair[1]);
        let mut before: Option<&str> = None;
        for (number, row) in table.rows.iter().enumerate() {
            let mut classes = match row.origin {
                Origin::Ours if mixed => vec!["ours"],
                Origin::StandIn => vec!["stand-in"],
                Origin::Ours | Origin::Paper => vec![],
            };
            let first = row.cells.first().map(String::as_str);
            if grouped && before.is_some() && before != first {
                classes.push("next");
            }
            before = first;
            let _ = write!(out, "<tr class=\"{}\">", classes.join(" "));
            for cell in &row.cells {
                let class = match cell {
                    c if is_number(c) => "number",
                    c if c.chars().count() > LONG => "text long",
                    _ => "text",
                };
                let _ = write!(out, "<td class=\"{class}\">{}</td>", escape(cell));
            }
            if let Some((_, drawings)) = drawn {
                let _ = write!(out, "<td>{}</td>", drawings.get(number).map(String::as_str).unwrap_or_default());
            }
            out.push_str("</tr>\n");
        }
        out.push_str("</tbody>\n</table>\n</div>\n");
    }

    /// The whole page.
    pub(crate) fn finish(mut self) -> String {
        self.0.push_str("</body>\n</html>\n");
        self.0
    }
}

/// The report of a benchmark as a page.
pub(crate) fn document(
    title: &str,
    intro: &[String],
    command: &str,
    tables: &[Table],
    plots: &[Plot],
    pictures: &[Picture],
) -> String {
    let mut page = Page::new(title, command);
    page.paragraphs(intro);
    let (first, rest) = tables.split_at(tables.len().min(2));
    first.iter().for_each(|t| page.table(t));
    if !plots.is_empty() {
        page.section("Plots", &["Means over seeds, bars of one standard deviation.".into()]);
        page.drawings(plots.iter().map(Plot::svg));
    }
    rest.iter().for_each(|t| page.table(t));
    if !pictures.is_empty() {
        page.section("Pictures", &["Photograph, rendering, and parts with their axes; start above, end below.".into()]);
        page.pictures(pictures);
    }
    page.finish()
}

/// True for `0.03±0.01 (1 F)`, `12.5 %` and for the placeholder of a missing number.
fn is_number(cell: &str) -> bool {
    let (number, rest) = cell.split_once(' ').unwrap_or((cell, "("));
    let mean = number.split('±').next().unwrap_or_default();
    matches!(cell, "-" | "F") || (mean.parse::<f64>().is_ok() && (rest.starts_with('(') || rest == "%"))
}
