//! `stages.md` and `stages.html`: the measures of all runs, and how they change over the steps.

use super::measures::StageMeasures;
use crate::html::Page;
use crate::markdown;
use crate::plot::{Plot, Point, Series};
use crate::table::{Origin, Table, table};
use artgs_io::{FileError, write_atomic};
use std::path::{Path, PathBuf};

const TITLE: &str = "artgs stages of the published method";
/// Ticks of the axis of steps.
const TICKS: usize = 4;

/// Writes the measures of named runs as `stages.md` and `stages.html` into a folder. Returns the path of the page.
pub fn write_stages(out: &Path, command: &str, runs: &[(String, StageMeasures)]) -> Result<PathBuf, FileError> {
    let tables: Vec<Table> = runs.iter().map(|(name, measures)| values(name, measures)).collect();
    let text = markdown::document(TITLE, &[], command, &tables);
    write_atomic(&out.join("stages.md"), text.as_bytes())?;
    let mut page = Page::new(TITLE, command);
    for ((_, measures), table) in runs.iter().zip(&tables) {
        page.table(table);
        page.drawings(plots(measures).iter().map(Plot::svg));
    }
    let path = out.join("stages.html");
    write_atomic(&path, page.finish().as_bytes())?;
    Ok(path)
}

fn values(name: &str, measures: &StageMeasures) -> Table {
    let mut out = table(name, "", &["stage", "measure", "value"]);
    let mut sorted: Vec<_> = measures.values.iter().collect();
    sorted.sort_by_key(|v| v.stage);
    for value in sorted {
        out.push(Origin::Ours, vec![value.stage.into(), value.what.clone(), number(value.value)]);
    }
    out
}

fn number(value: f64) -> String {
    if value.abs() >= 10.0 { format!("{value:.1}") } else { format!("{value:.3}") }
}

/// A plot for every quantity that was measured over the steps.
fn plots(measures: &StageMeasures) -> Vec<Plot> {
    let mut titles: Vec<&str> = measures.curves.iter().filter(|c| !c.points.is_empty()).map(|c| c.what).collect();
    titles.dedup();
    titles.into_iter().map(|title| plot(title, measures)).collect()
}

fn plot(title: &str, measures: &StageMeasures) -> Plot {
    let curves: Vec<_> = measures.curves.iter().filter(|c| c.what == title).collect();
    let last = curves.iter().flat_map(|c| &c.points).map(|p| p.0).max().unwrap_or(0);
    let point = |&(step, y): &(usize, f64)| Point { x: step as f64, y, spread: None, label: format!("step {step}") };
    let tick = |i: usize| {
        let step = last * i / TICKS;
        (step as f64, step.to_string())
    };
    Plot {
        title: title.into(),
        x_label: "step".into(),
        y_label: title.split(": ").last().unwrap_or(title).into(),
        x_ticks: (0..=TICKS).map(tick).collect(),
        log_y: false,
        series: curves
            .iter()
            .map(|c| Series { name: c.name.clone(), points: c.points.iter().map(point).collect() })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::{Curve, Value};

    #[test]
    fn tables_are_in_the_order_of_the_stages_and_curves_become_plots() {
        let value = |stage, v| Value { stage, what: "a | b".into(), value: v };
        let curve =
            |name: &str| Curve { what: "types: degrees", name: name.into(), points: vec![(1, 0.5), (40, 30.0)] };
        let measures = StageMeasures {
            values: vec![value("3 mask", 0.51234), value("1 single", 31.26)],
            curves: vec![curve("part 1"), curve("part 2")],
        };
        let folder = tempfile::tempdir().unwrap();
        let page = write_stages(folder.path(), "artgs bench", &[("storage2 seed 0".into(), measures)]).unwrap();
        let text = std::fs::read_to_string(folder.path().join("stages.md")).unwrap();
        let (first, second) = (text.find("31.3").unwrap(), text.find("0.512").unwrap());
        assert!(first < second && text.contains("## storage2 seed 0"), "{text}");
        let html = std::fs::read_to_string(page).unwrap();
        assert!(roxmltree::Document::parse(html.trim_start_matches("<!DOCTYPE html>")).is_ok());
        assert_eq!(html.matches("<svg").count(), 1);
    }
}
