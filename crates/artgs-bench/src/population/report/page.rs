//! The page of a population, one HTML file that refers to no other, and the tables as Markdown.

use super::super::Row;
use super::drawings::{bar, reliability};
use super::groups::Group;
use super::summary::Summary;
use super::{tables, worst};
use crate::html::{Page, Picture};
use crate::table::{MOST, Table};
use std::path::PathBuf;

const TITLE: &str = "Population benchmark";

/// Where a report comes from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// The command.
    pub command: String,
    /// The folder of the benchmark, in which `previews/SEED.png` are.
    pub base: PathBuf,
}

/// The page, HTML. Previews of the worst objects are part of it. The same rows and previews give the same bytes.
pub fn page(rows: &[Row], summary: &Summary, origin: &Origin) -> String {
    let mut page = Page::new(TITLE, &origin.command);
    let bars = [bar(&summary.right, None), bar(&summary.joints_right, None)];
    page.table_with(&tables::headline(summary), Some(("0 to 100 %", &bars)));
    page.table(&tables::kinds(summary));
    if !summary.confusions.is_empty() {
        page.table(&tables::confusions(&summary.confusions));
    }
    for (table, groups) in by_group(summary) {
        let bars: Vec<String> = groups.iter().take(MOST).map(|g| bar(&g.right, summary.right.share)).collect();
        page.table_with(&table, Some(("0 to 100 %", &bars)));
    }
    page.table(&tables::calibration(&summary.calibration));
    page.drawings([reliability(&summary.calibration)]);
    if let Some(changes) = &summary.changes {
        tables::changes(changes).iter().for_each(|table| page.table(table));
    }
    pictures(&mut page, rows, origin);
    if !summary.causes.is_empty() {
        page.table(&tables::causes(&summary.causes));
    }
    page.table(&tables::numbers(summary));
    page.finish()
}

/// True for text that [`markdown`] returned.
pub fn is_markdown(text: &[u8]) -> bool {
    text.split(|byte| *byte == b'\n').next() == Some(format!("# {TITLE}").as_bytes())
}

/// The main tables as Markdown.
pub fn markdown(summary: &Summary, origin: &Origin) -> String {
    let mut all = vec![tables::headline(summary), tables::numbers(summary), tables::kinds(summary)];
    if !summary.confusions.is_empty() {
        all.push(tables::confusions(&summary.confusions));
    }
    all.extend(by_group(summary).map(|(table, _)| table));
    all.push(tables::calibration(&summary.calibration));
    all.extend(summary.changes.iter().flat_map(tables::changes));
    if !summary.causes.is_empty() {
        all.push(tables::causes(&summary.causes));
    }
    crate::markdown::document(TITLE, &[], &origin.command, &all)
}

/// Tables of shares by what objects are.
fn by_group(summary: &Summary) -> [(Table, &[Group]); 4] {
    let note = "What loses most first. Lost: wrong objects above the number that the share right of all objects would give. To others: \
                difference to the share of the objects without it, percentage points.";
    let bars = "Bars: share right with interval, red if all of the interval is below the share of all objects (line).";
    let features = format!(
        "{note} An object counts for each of its features; the column \
                            \"right without\" leaves out the objects with the feature that loses most. {bars}"
    );
    let rising = "In rising order.";
    [
        (tables::groups("By feature", "feature", &features, &summary.features), summary.features.as_slice()),
        (tables::groups("By category", "category", "", &summary.categories), summary.categories.as_slice()),
        (tables::groups("By number of movable parts", "parts", rising, &summary.parts), summary.parts.as_slice()),
        (tables::groups("By sensor", "sensor", "", &summary.sensors), summary.sensors.as_slice()),
    ]
}

fn pictures(page: &mut Page, rows: &[Row], origin: &Origin) {
    let worst = worst::worst(rows);
    if worst.is_empty() {
        return;
    }
    let of = if worst.len() > worst::SHOWN { format!("{} of {}. ", worst::SHOWN, worst.len()) } else { String::new() };
    let note = format!(
        "{of}Decidable objects with something wrong: first those with the largest confidence of a joint that is not correct, then those that are \
         right with a joint off, refused ones last. From left to right: photo, true parts, found parts in the colours of the true parts that \
         they cover (magenta and pink: they cover none), axes at the start; above the start, below the end. Joint 1 is that of the first \
         movable part that was found."
    );
    page.section("Worst objects", &[note]);
    let shown: Vec<Picture> =
        worst.into_iter().take(worst::SHOWN).map(|row| worst::picture(row, &origin.base)).collect();
    page.pictures(&shown);
}

#[cfg(test)]
mod tests {
    use super::super::super::Status;
    use super::super::testing::{off, refused, right, synthetic, wrong_type};
    use super::*;

    const HOSTILE: &str = "<script>alert('1')</script>\u{1}\"&|";

    fn hostile(row: Row) -> Row {
        let names = [HOSTILE; 3].map(String::from);
        let [category, sensor, feature] = names;
        Row { category, sensor, features: vec![feature], reason: HOSTILE.into(), program: HOSTILE.into(), ..row }
    }

    fn well_formed(text: &str) -> roxmltree::Document<'_> {
        let options = roxmltree::ParsingOptions { allow_dtd: true, ..roxmltree::ParsingOptions::default() };
        roxmltree::Document::parse_with_options(text, options).unwrap()
    }

    #[test]
    fn the_page_is_well_formed_and_refers_to_nothing_outside() {
        let base = tempfile::tempdir().unwrap();
        std::fs::create_dir(base.path().join("previews")).unwrap();
        artgs_io::image_io::write_rgb(&base.path().join("previews/3.png"), 12, 4, &[[9, 8, 7]; 48]).unwrap();
        let mut wrong = hostile(wrong_type(3));
        wrong.joints[1].kind = HOSTILE.into();
        let unseen = Row { decidable: false, undecidable: vec![HOSTILE.into()], ..right(6) };
        let failed = Row { status: Status::Failed, ..hostile(refused(7)) };
        let rows = [right(1), off(2), wrong, refused(4), unseen, failed];
        let before = [right(1), hostile(right(3))];
        let summary = Summary::new(&rows, Some(&before));
        let origin = Origin { command: format!("artgs report {HOSTILE}"), base: base.path().into() };
        let text = page(&rows, &summary, &origin);
        let document = well_formed(&text);
        let all = |name: &'static str| document.descendants().filter(move |n| n.has_tag_name(name));
        assert_eq!((all("script").count(), all("link").count(), all("a").count()), (0, 0, 0));
        assert_eq!((all("img").count(), all("figure").count()), (1, 4));
        for node in document.descendants().filter(roxmltree::Node::is_element) {
            for attribute in node.attributes().filter(|a| matches!(a.name(), "src" | "href" | "data" | "style")) {
                assert!(attribute.value().starts_with("data:image/png;base64,"), "{attribute:?}");
            }
        }
        assert!(!text.contains("url(") && !text.contains("<script") && !text.contains("NaN"));
        let places =
            ["seed 3", "seed 2", "seed 7", "seed 4"].map(|s| text.find(&format!("<figcaption>{s}<br />")).unwrap());
        assert!(places.is_sorted(), "{places:?}");
        assert!(text.contains("From right to wrong") && !text.contains("From wrong to right<"));
        assert_eq!(text, page(&rows, &summary, &origin));
        let markdown = markdown(&summary, &origin);
        assert!(is_markdown(markdown.as_bytes()) && !is_markdown(b"# My thesis\n") && !is_markdown(b""));
        assert!(markdown.contains("## By feature") && markdown.contains("\\<script\\>"), "{markdown}");
        assert!(
            !markdown.contains('\u{1}') && !markdown.lines().any(|line| line.starts_with('|') && line.contains("&|"))
        );
    }

    /// `ARTGS_PAGE=FILE.html` keeps the page, to look at it; previews are those beside the file.
    #[test]
    fn the_page_of_many_objects_shows_what_is_worst_first() {
        let (rows, before) = (synthetic(200, 1), synthetic(200, 2));
        let summary = Summary::new(&rows, Some(&before));
        assert_eq!(summary.features[0].name, "thin");
        let kept = std::env::var_os("ARTGS_PAGE").map(PathBuf::from);
        let base = kept.as_deref().and_then(std::path::Path::parent).unwrap_or(std::path::Path::new("")).to_path_buf();
        let text = page(&rows, &summary, &Origin { command: "artgs report OUT".into(), base });
        let shown = worst::worst(&rows).len().min(worst::SHOWN);
        assert_eq!(well_formed(&text).descendants().filter(|n| n.has_tag_name("figure")).count(), shown);
        if let Some(file) = kept {
            std::fs::write(file, text).unwrap();
        }
    }

    #[test]
    fn pages_of_few_or_no_objects_are_well_formed() {
        for rows in [vec![], vec![right(1)], vec![refused(1)], vec![Row::default()]] {
            let summary = Summary::new(&rows, Some(&rows));
            let text = page(&rows, &summary, &Origin::default());
            well_formed(&text);
            assert!(!text.contains("NaN") && !text.contains("inf%") && text.contains("none"));
        }
    }
}
