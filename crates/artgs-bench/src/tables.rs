//! The tables of a benchmark: every object, both states, the paper's tables, variants, failures.

use crate::collect::{Collected, Failures, ObjectInfo};
use crate::metric::{At, Metric, Surface};
use crate::paper::{self, PaperObject};
use crate::record::Outcome;
use crate::stats::{Aggregate, aggregate};
use crate::table::{NOTHING, Origin, Table, number};
use std::collections::BTreeSet;

const CD_S: Metric = Metric::Cd(Surface::Fixed, At::Reported);
const CD_M: Metric = Metric::Cd(Surface::Movable, At::Reported);
const CD_W: Metric = Metric::Cd(Surface::Whole, At::Reported);

/// Note of every table in which another object stands in for one of the paper.
pub(crate) const STAND_IN: &str = "Rows marked \"stand-in\" are of another object, with joints like those of the paper's: \
    their numbers are not comparable with the paper's object by object.";

fn named(first: &[&str], metrics: &[Metric]) -> Vec<String> {
    first.iter().map(|s| (*s).to_string()).chain(metrics.iter().map(|m| m.label())).collect()
}

/// All tables for which there are records.
pub(crate) fn tables(all: &Collected) -> Vec<Table> {
    let mut tables = vec![every_object(all)];
    tables.extend(variants(all));
    tables.extend(paris(all));
    tables.extend(dta_multi(all));
    tables.extend(artgs_multi(all));
    tables.extend(ablation(all));
    tables.push(both_states(all));
    tables.extend(failures(all));
    tables
}

fn parts(object: &ObjectInfo) -> String {
    object.parts.map_or_else(|| NOTHING.into(), |k| k.to_string())
}

/// One digit more than the paper for metrics whose values are often below its last digit.
fn finer(metric: Metric) -> usize {
    usize::from(matches!(metric, Metric::AxisAngle | Metric::AxisPosition | Metric::MotionDegrees))
}

/// A cell for every metric, with `more_digits` more digits than the paper.
fn cells(
    all: &Collected,
    variant: &str,
    object: &ObjectInfo,
    metrics: &[Metric],
    more_digits: fn(Metric) -> usize,
) -> Vec<String> {
    let failures = all.failures(variant, &object.name);
    let cell = |m: &Metric| number(all.aggregate(variant, object, *m), failures, *m, more_digits(*m));
    metrics.iter().map(cell).collect()
}

/// Numbers of parts found, each once, and the true one, such as `3, 4/3`; nothing where the number was given.
fn counts(all: &Collected, variant: &str, object: &ObjectInfo) -> String {
    let found: BTreeSet<usize> = all.found_parts(variant, &object.name).into_iter().collect();
    if found.is_empty() {
        return NOTHING.into();
    }
    let found: Vec<String> = found.iter().map(usize::to_string).collect();
    format!("{}/{}", found.join(", "), parts(object))
}

fn summary(failures: &Failures) -> String {
    Some(failures.summary()).filter(|t| !t.is_empty()).unwrap_or_else(|| "none".into())
}

/// Objects and variants as rows.
fn every_object(all: &Collected) -> Table {
    let metrics = [
        Metric::AxisAngle,
        Metric::AxisPosition,
        Metric::MotionDegrees,
        Metric::MotionLength,
        CD_S,
        CD_M,
        CD_W,
        Metric::Psnr,
        Metric::Ssim,
        Metric::Lpips,
        Metric::Flip,
        Metric::Minutes,
        Metric::Memory,
    ];
    let mut head = named(&["Object", "K", "Variant"], &metrics);
    head.extend(["Parts found/true".into(), "Failures".into()]);
    let mut table = Table::new("Every object", head);
    table.notes.push(
        "Mean±standard deviation over seeds. Axis Ang in degrees; Axis Pos in scene units x 10, over parts that turn; \
         Chamfer distances x 1000 at the state the paper reports for the object, else the mean of both; pictures are \
         held-out views of both states. A missing part scores a Chamfer distance of 1000; joint errors are of the parts \
         found. Failed runs are counted, not averaged."
            .into(),
    );
    for object in &all.objects {
        for variant in &all.variants {
            let mut row = vec![object.name.clone(), parts(object), variant.name.clone()];
            row.extend(cells(all, &variant.name, object, &metrics, finer));
            row.push(counts(all, &variant.name, object));
            let failures = all.failures(&variant.name, &object.name);
            row.push(if failures.runs == 0 { "not run".into() } else { summary(&failures) });
            table.push(Origin::Ours, row);
        }
    }
    table.without_empty_columns(3)
}

/// Chamfer distances at start and end.
fn both_states(all: &Collected) -> Table {
    let surfaces = [Surface::Fixed, Surface::Movable, Surface::Whole];
    let states = [At::Start, At::End, At::Reported];
    let metrics: Vec<Metric> = surfaces.iter().flat_map(|s| states.map(|a| Metric::Cd(*s, a))).collect();
    let mut head = named(&["Object", "Variant", "Reported state"], &metrics);
    for (label, metric) in head[3..].iter_mut().zip(&metrics) {
        if matches!(metric, Metric::Cd(_, At::Reported)) {
            label.push_str(" reported");
        }
    }
    let mut table = Table::new("Surfaces at both states", head);
    table.notes.push("Chamfer distances x 1000 of 10,000 samples, as in the paper.".into());
    for object in &all.objects {
        for variant in &all.variants {
            let state = match object.reported() {
                At::Start => "start",
                At::End => "end",
                At::Mean | At::Reported => "mean",
            };
            let mut row = vec![object.name.clone(), variant.name.clone(), state.into()];
            row.extend(cells(all, &variant.name, object, &metrics, |_| 0));
            table.push(Origin::Ours, row);
        }
    }
    table
}

/// Mean over objects of their means over seeds; none until all objects have runs.
fn over_objects(all: &Collected, variant: &str, objects: &[&ObjectInfo], metric: Metric) -> Option<Aggregate> {
    if objects.iter().any(|o| all.failures(variant, &o.name).runs == 0) {
        return None;
    }
    let means = objects.iter().filter_map(|o| all.aggregate(variant, o, metric)).map(|a| a.mean);
    aggregate(&means.collect::<Vec<_>>()).map(|a| Aggregate { std: None, ..a })
}

/// Variants as rows, means over all objects.
fn variants(all: &Collected) -> Option<Table> {
    if all.objects.len() < 2 && all.variants.len() < 2 {
        return None;
    }
    let metrics = [
        Metric::AxisAngle,
        Metric::AxisPosition,
        Metric::MotionDegrees,
        Metric::MotionLength,
        CD_S,
        CD_M,
        CD_W,
        Metric::Psnr,
        Metric::Ssim,
        Metric::Minutes,
    ];
    let mut head = named(&["Variant", "Runs"], &metrics);
    head.extend(["Right number of parts", "Failures", "What it is"].map(String::from));
    let mut table = Table::new("Means over objects", head);
    table.notes.push(
        "Each object counts once, with its mean over seeds; objects of which every run failed are left out.".into(),
    );
    let objects: Vec<&ObjectInfo> = all.objects.iter().collect();
    for variant in &all.variants {
        let failures = all.all_failures(&variant.name);
        let cell = |m: &Metric| {
            let value = over_objects(all, &variant.name, &objects, *m);
            number(value, Default::default(), *m, finer(*m))
        };
        let mut row = vec![variant.name.clone(), failures.runs.to_string()];
        row.extend(metrics.iter().map(cell));
        let counted = match all.right_counts(&variant.name) {
            [_, 0] => NOTHING.into(),
            [right, runs] => format!("{right} of {runs} runs"),
        };
        row.extend([counted, summary(&failures), variant.description.clone()]);
        table.push(Origin::Ours, row);
    }
    Some(table.without_empty_columns(2))
}

/// The object of this benchmark for one of the paper: the same object, or one that stands in for it.
fn ours<'a>(all: &'a Collected, paper: &PaperObject, same: bool) -> Option<&'a ObjectInfo> {
    all.objects.iter().find(|o| o.same_object == same && o.stands_for.is_some_and(|p| p.id == paper.id))
}

fn any_of(all: &Collected, paper: &PaperObject) -> bool {
    [true, false].iter().any(|same| ours(all, paper, *same).is_some())
}

/// Same object or stand-in, with the origin of its rows and the mark of its names.
const KINDS: [(bool, Origin, &str); 2] = [(true, Origin::Ours, ""), (false, Origin::StandIn, " (stand-in)")];

fn note_stand_ins(table: &mut Table) {
    if table.rows.iter().any(|r| r.origin == Origin::StandIn) {
        table.notes.push(STAND_IN.into());
    }
}

/// The PARIS table: metrics and methods as rows, objects as columns.
fn paris(all: &Collected) -> Option<Table> {
    let shown: Vec<usize> = (0..paper::PARIS_COLUMNS.len()).filter(|c| paris_column_is_shown(all, *c)).collect();
    if shown.is_empty() {
        return None;
    }
    let name = |c: &usize| paper::find(paper::PARIS_COLUMNS[*c]).map_or(paper::PARIS_COLUMNS[*c], |o| o.name);
    let head = ["Metric", "Method"].into_iter().chain(shown.iter().map(name)).map(String::from).collect();
    let mut table = Table::new("PARIS objects, two parts", head);
    table.notes.push(
        "Numbers of other methods are those of the ArtGS paper (ICLR 2025): mean±standard deviation of 10 trials at the \
         state with higher visibility; pictures: mean of both states, over other views than ours. F: wrong joint type, \
         or no replica."
            .into(),
    );
    for metric in paper::PARIS_METRICS {
        for row in paper::paris(metric) {
            let mut line = vec![metric.label(), row.method.to_string()];
            line.extend(shown.iter().map(|c| row.values[*c].text.to_string()));
            table.push(Origin::Paper, line);
        }
        for variant in &all.variants {
            for (same, origin, mark) in KINDS {
                let values: Vec<String> =
                    shown.iter().map(|c| paris_cell(all, &variant.name, metric, *c, same)).collect();
                if values.iter().any(|v| v != NOTHING) {
                    let mut line = vec![metric.label(), format!("artgs {}{mark}", variant.name)];
                    line.extend(values);
                    table.push(origin, line);
                }
            }
        }
    }
    note_stand_ins(&mut table);
    Some(table)
}

/// Objects of a column: all objects of a mean, else one.
fn column_members(column: usize) -> Vec<&'static PaperObject> {
    let id = paper::PARIS_COLUMNS[column];
    let real = |o: &PaperObject| o.id.starts_with("paris/real_");
    let members = |pick: &dyn Fn(&PaperObject) -> bool| {
        paper::OBJECTS.iter().filter(|o| o.table == paper::Table::Paris && pick(o)).collect()
    };
    match id {
        paper::ALL_SYNTHETIC => members(&|o| !real(o)),
        paper::ALL_REAL => members(&real),
        _ => members(&|o| o.id == id),
    }
}

/// Columns of means are shown only if all their objects are present.
fn paris_column_is_shown(all: &Collected, column: usize) -> bool {
    column_members(column).iter().all(|o| any_of(all, o))
}

fn paris_cell(all: &Collected, variant: &str, metric: Metric, column: usize, same: bool) -> String {
    let members = column_members(column);
    let objects: Vec<&ObjectInfo> = members.iter().filter_map(|o| ours(all, o, same)).collect();
    match objects.as_slice() {
        [one] if members.len() == 1 => cells(all, variant, one, &[metric], |_| 0).remove(0),
        many if many.len() == members.len() && members.len() > 1 => {
            let mut failures = Failures::default();
            many.iter().for_each(|o| failures.add(&all.failures(variant, &o.name)));
            number(over_objects(all, variant, many, metric), failures, metric, 0)
        }
        _ => NOTHING.into(),
    }
}

/// A table of objects of several parts: objects and methods as rows, metrics as columns.
fn multi(all: &Collected, which: paper::Table, title: &str, note: &str, metrics: &[Metric]) -> Option<Table> {
    let mut table = Table::new(title, named(&["Object", "Method"], metrics));
    table.notes.push(note.into());
    for object in paper::OBJECTS.iter().filter(|o| o.table == which && any_of(all, o)) {
        for row in paper::multi(object) {
            let mut line = vec![object.name.to_string(), row.method.to_string()];
            line.extend(row.values.iter().map(|v| v.text.to_string()));
            table.push(Origin::Paper, line);
        }
        our_rows(all, object, metrics, &mut table, object.name);
    }
    note_stand_ins(&mut table);
    (!table.rows.is_empty()).then_some(table)
}

fn our_rows(all: &Collected, object: &PaperObject, metrics: &[Metric], table: &mut Table, first: &str) {
    for variant in &all.variants {
        for (same, origin, mark) in KINDS {
            let Some(info) = ours(all, object, same) else { continue };
            if all.failures(&variant.name, &info.name).runs > 0 {
                let mut line = vec![first.to_string(), format!("artgs {}{mark}", variant.name)];
                line.extend(cells(all, &variant.name, info, metrics, |_| 0));
                table.push(origin, line);
            }
        }
    }
}

fn dta_multi(all: &Collected) -> Option<Table> {
    let note = "Numbers of other methods are those of the ArtGS paper: means of 10 trials; joints in the order of the \
        truth. The state the paper scores is not stated; ours are means of both.";
    multi(all, paper::Table::DtaMulti, "DTA-Multi objects, three parts", note, &paper::DTA_COLUMNS)
}

fn artgs_multi(all: &Collected) -> Option<Table> {
    let note = "Numbers of other methods are those of the ArtGS paper: means of 3 trials. As there, Axis Pos counts sliding \
        parts as 0 and Part Motion averages degrees and lengths. The state the paper scores is not stated; ours are means \
        of both.";
    multi(all, paper::Table::ArtgsMulti, "ArtGS-Multi objects, four to seven parts", note, &paper::ARTGS_COLUMNS)
}

/// Variants as rows, for every object of the ablation table, beside the paper's variants.
fn ablation(all: &Collected) -> Vec<Table> {
    let objects = paper::ABLATION_OBJECTS.iter().filter_map(|id| paper::find(id));
    let table = |object: &PaperObject| {
        let title = format!("Ablation: {}", object.name);
        let mut table = Table::new(title, named(&["Source", "Variant"], &paper::ABLATION_METRICS));
        table.notes.push("The paper's variants, then ours; averages as in the table of its objects.".into());
        for row in paper::ablation(object) {
            let mut line = vec!["paper".to_string(), row.method.to_string()];
            line.extend(row.values.iter().map(|v| v.text.to_string()));
            table.push(Origin::Paper, line);
        }
        our_rows(all, object, &paper::ABLATION_METRICS, &mut table, "artgs");
        note_stand_ins(&mut table);
        table
    };
    let several = all.variants.len() > 1;
    objects.filter(|o| several && any_of(all, o)).map(table).collect()
}

/// Failed runs with reasons.
fn failures(all: &Collected) -> Option<Table> {
    let head = ["Variant", "Object", "Seed", "Reason", "Log"].map(String::from).to_vec();
    let mut table = Table::new("Failed runs", head);
    for record in &all.records {
        if let Outcome::Failed(reason) = &record.outcome {
            let log = format!("{}.log", record.folder.display());
            let cells = [record.variant.clone(), record.object.clone(), record.seed.to_string(), reason.clone(), log];
            table.push(Origin::Ours, cells.to_vec());
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

#[cfg(test)]
#[path = "tables_tests.rs"]
mod tests;
