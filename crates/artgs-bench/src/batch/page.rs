//! The page of a batch: one HTML file that refers to no other.

use super::row::Row;
use super::summary::{FIELDS, Summary, of_done};
use super::tables;
use crate::histogram::{Histogram, short};
use crate::html::{Page, Picture};
use crate::picture::preview_url;
use crate::table::MOST;
use artgs_io::RunFolder;
use std::path::{Path, PathBuf};

/// Where a report comes from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// The command.
    pub command: String,
    /// Folder that relative paths of replicas start at.
    pub base: PathBuf,
}

/// The page of a table, HTML. Previews of the worst captures are part of it. The same rows and previews give the same bytes.
pub fn page(rows: &[Row], summary: &Summary, origin: &Origin) -> String {
    let mut page = Page::new("artgs batch", &origin.command);
    page.table(&tables::totals(rows, summary));
    if summary.failed > 0 {
        page.table(&tables::causes(&summary.causes));
    }
    page.table(&tables::distributions(summary));
    page.drawings(histograms(rows).iter().map(Histogram::svg));
    if !summary.scores.is_empty() {
        page.table(&tables::scores(summary));
    }
    if let Some(changes) = &summary.changes {
        tables::changes(changes).iter().for_each(|table| page.table(table));
    }
    let worst = worst(rows);
    if !worst.is_empty() {
        let of = if summary.done > worst.len() { format!("{MOST} of {}. ", summary.done) } else { String::new() };
        let note = format!(
            "{of}Finished captures without a joint, then those with the least confidence of a joint. Photograph, rendering, and parts with \
             their axes; start above, end below."
        );
        page.section("Least confident captures", &[note]);
        let pictures: Vec<Picture> = worst.into_iter().map(|row| picture(row, &origin.base)).collect();
        page.pictures(&pictures);
    }
    if summary.failed > 0 {
        page.table(&tables::failed(rows));
    }
    page.finish()
}

fn histograms(rows: &[Row]) -> Vec<Histogram> {
    let mut histograms = Vec::new();
    for (field, name, of) in FIELDS.iter().filter(|(field, ..)| *field != "warnings") {
        let values = of_done(rows, *of);
        if *field == "confidence" && !values.is_empty() {
            histograms.insert(0, Histogram::between("Confidence", name, &values, (0.0, 1.0)));
        } else if *field != "confidence" {
            let title = name.split(',').next().unwrap_or(name);
            let title = title[..1].to_uppercase() + &title[1..];
            histograms.extend(Histogram::of(&title, name, &values));
        }
    }
    histograms
}

/// Finished captures, the least confident first; equal ones in the order of the table.
fn worst(rows: &[Row]) -> Vec<&Row> {
    let mut done: Vec<&Row> = rows.iter().filter(|row| row.done).collect();
    let confidence = |row: &Row| row.confidence.unwrap_or(-1.0);
    done.sort_by(|a, b| confidence(a).total_cmp(&confidence(b)));
    done.truncate(MOST);
    done
}

fn picture(row: &Row, base: &Path) -> Picture {
    let confidence = row.confidence.map_or("no confidence".into(), |c| format!("confidence {c:.2}"));
    let parts = row.parts.map(|parts| format!("{parts} parts"));
    let joints = row.joints.clone().filter(|joints| !joints.is_empty());
    let seconds = row.seconds.map(|s| format!("{} s", short(s)));
    let warnings = row.warnings.filter(|n| *n > 0.0).map(|n| format!("warnings: {n}"));
    let facts: Vec<String> = [Some(confidence), parts, joints, seconds, warnings].into_iter().flatten().collect();
    let mut caption = vec![row.id.clone(), facts.join(", ")];
    caption.extend(row.replica.clone());
    Picture { caption, image: image(row.replica.as_deref(), base) }
}

fn image(replica: Option<&str>, base: &Path) -> Result<String, &'static str> {
    let replica = replica.ok_or("the row names no replica")?;
    let local = replica.strip_prefix("file://").unwrap_or(replica);
    if local.contains("://") {
        return Err("no preview: the replica is not on this computer");
    }
    let preview = RunFolder::new(base.join(local)).preview();
    preview_url(&preview).ok_or("no preview: preview.png of the replica is missing or cannot be read")
}

#[cfg(test)]
mod tests {
    use super::super::read_rows;
    use super::*;

    const HOSTILE: &str = "<script>alert('1')</script>\u{1}\"&";

    fn example() -> Vec<Row> {
        let done = |id: &str, confidence: Option<f64>| Row {
            id: id.into(),
            done: true,
            confidence,
            parts: Some(2.0),
            joints: Some("revolute".into()),
            seconds: Some(3.5),
            replica: Some(format!("replicas/{id}")),
            ..Row::default()
        };
        let mut rows =
            vec![done("sure", Some(0.9)), done("none", None), done("doubt", Some(0.2)), done(HOSTILE, Some(0.5))];
        rows.push(Row { id: format!("{HOSTILE}2"), reason: HOSTILE.into(), ..Row::default() });
        rows
    }

    #[test]
    fn the_page_is_well_formed_and_refers_to_nothing_outside() {
        let base = tempfile::tempdir().unwrap();
        let preview = base.path().join("replicas/doubt/preview.png");
        artgs_io::image_io::write_rgb(&preview, 12, 4, &[[9, 8, 7]; 48]).unwrap();
        let rows = example();
        let before = [Row { reason: String::new(), done: true, ..rows[4].clone() }];
        let summary = Summary::new(&rows, Some(&before), None);
        let origin = Origin { command: format!("artgs report {HOSTILE}"), base: base.path().into() };
        let text = page(&rows, &summary, &origin);
        let options = roxmltree::ParsingOptions { allow_dtd: true, ..roxmltree::ParsingOptions::default() };
        let document = roxmltree::Document::parse_with_options(&text, options).unwrap();
        let all = |name: &'static str| document.descendants().filter(move |n| n.has_tag_name(name));
        assert_eq!((all("script").count(), all("link").count(), all("a").count()), (0, 0, 0));
        assert_eq!((all("img").count(), all("figure").count()), (1, 4));
        for node in document.descendants().filter(roxmltree::Node::is_element) {
            for attribute in node.attributes().filter(|a| matches!(a.name(), "src" | "href" | "data" | "style")) {
                assert!(attribute.value().starts_with("data:image/png;base64,"), "{attribute:?}");
            }
        }
        assert!(!text.contains("url(") && !text.contains("<script"));
        let shown = HOSTILE.replace('\u{1}', "\u{fffd}");
        assert!(document.descendants().any(|n| n.text() == Some(&shown)), "shown as it is");
        // Without a joint first, then by confidence.
        let places = ["none", "doubt", "sure"].map(|id| text.find(&format!("<figcaption>{id}<br />")).unwrap());
        assert!(places.is_sorted(), "{places:?}");
        assert_eq!(text, page(&rows, &summary, &origin));
    }

    #[test]
    fn long_tables_are_cut() {
        let folder = tempfile::tempdir().unwrap();
        let line = |i: usize| format!("{{\"id\": \"c{i}\", \"status\": \"failed\", \"reason\": \"bang {i}\"}}\n");
        std::fs::write(folder.path().join("results.jsonl"), (0..120).map(line).collect::<String>()).unwrap();
        let (rows, base) = read_rows(folder.path()).unwrap();
        let summary = Summary::new(&rows, None, None);
        assert_eq!(
            (summary.causes.len(), summary.causes[0].count, summary.causes[0].cause.as_str()),
            (1, 120, "bang N")
        );
        let text = page(&rows, &summary, &Origin { command: String::new(), base });
        assert!(text.contains("50 of 120.") && text.contains(">c49<") && !text.contains(">c50<"));
    }
}
