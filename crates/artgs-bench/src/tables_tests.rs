use super::*;
use crate::collect::Collected;
use crate::table::Row;
use crate::testing::{collected, failed, record};

fn find<'a>(tables: &'a [Table], title: &str) -> &'a Table {
    tables.iter().find(|t| t.title.starts_with(title)).unwrap_or_else(|| panic!("no table {title}"))
}

fn rows_of<'a>(table: &'a Table, words: &[&str]) -> Vec<&'a Row> {
    let starts = |r: &&Row| words.iter().zip(&r.cells).all(|(w, c)| w == c);
    table.rows.iter().filter(starts).collect()
}

/// The fridge of the paper, and stand-ins for a blade and both objects of the ablation.
fn papery() -> Collected {
    let names = ["fridge", "blade", "storage", "oven"];
    let mut records = Vec::new();
    for variant in ["full", "paper"] {
        for (i, name) in names.iter().enumerate() {
            records.extend([0, 1].map(|seed| record(variant, name, seed, 0.1 * (i + 1) as f64 + 0.02 * seed as f64)));
        }
    }
    *records.last_mut().unwrap() = failed("paper", "oven", 1, "bang | bong");
    let mut all = collected(&["full", "paper"], &names, records);
    let ids = ["paris/fridge", "paris/blade", "artgs_multi/storage_47648", "artgs_multi/oven_101908"];
    for (object, id) in all.objects.iter_mut().zip(ids) {
        (object.stands_for, object.same_object) = (paper::find(id), id == "paris/fridge");
    }
    all
}

#[test]
fn the_papers_numbers_are_beside_ours_and_stand_ins_are_marked() {
    let tables = tables(&papery());
    let paris = find(&tables, "PARIS");
    assert_eq!(paris.head, ["Metric", "Method", "Fridge", "Blade"]);
    let angle = rows_of(paris, &["Axis Ang"]);
    let cells: Vec<String> = angle.iter().map(|r| r.cells[1..].join(" ")).collect();
    assert_eq!(
        cells,
        [
            "Ditto 89.30 79.54",
            "PARIS* 2.93±5.3 41.28±31.4",
            "CSG-reg 0.27±0.0 7.64±5.0",
            "3Dseg-reg - 9.40±7.5",
            "DTA 0.09±0.0 0.20±0.1",
            "ArtGS 0.03±0.0 0.03±0.0",
            "artgs full 0.11±0.01 -",
            "artgs full (stand-in) - 0.21±0.01",
            "artgs paper 0.11±0.01 -",
            "artgs paper (stand-in) - 0.21±0.01",
        ]
    );
    assert_eq!((angle[5].origin, angle[6].origin, angle[7].origin), (Origin::Paper, Origin::Ours, Origin::StandIn));
    assert!(paris.notes.iter().any(|n| n == STAND_IN) && STAND_IN.contains("not comparable"));

    let multi = find(&tables, "ArtGS-Multi");
    let storage = rows_of(multi, &["Storage 47648 (7 parts)"]);
    assert_eq!(storage[1].cells[1..].join(" "), "ArtGS 0.14 0.02 0.62 0.67 3.70 0.70 8");
    assert_eq!(storage[2].cells[1], "artgs full (stand-in)");

    let ablation = find(&tables, "Ablation: Oven");
    assert_eq!(ablation.rows.len(), 7 + 2);
    assert_eq!(ablation.rows[8].cells[..3].join(" "), "artgs artgs paper (stand-in) 0.40 (1 F)");
    let failures = find(&tables, "Failed runs");
    assert_eq!(failures.rows[0].cells.join(" "), "paper oven 1 bang | bong runs/paper/oven/seed_1.log");
}

#[test]
fn columns_of_means_need_all_their_objects() {
    let ids: Vec<&str> = paper::PARIS_COLUMNS[..10].to_vec();
    let names: Vec<&str> = ids.iter().map(|id| id.trim_start_matches("paris/")).collect();
    let records = names.iter().enumerate().map(|(i, name)| record("full", name, 0, i as f64)).collect();
    let mut all = collected(&["full"], &names, records);
    for (object, id) in all.objects.iter_mut().zip(&ids) {
        object.stands_for = paper::find(id);
    }
    let table = paris(&all).unwrap();
    assert_eq!(table.head.last().unwrap(), "all synthetic");
    let ours = rows_of(&table, &["Axis Ang", "artgs full (stand-in)"])[0];
    assert_eq!(ours.cells.last().unwrap(), "4.50");
    assert_eq!(rows_of(&table, &["Axis Ang", "ArtGS"])[0].cells.last().unwrap(), "0.02±0.0");
    all.objects.pop();
    assert_eq!(paris(&all).unwrap().head.last().unwrap(), "Blade");
}

#[test]
fn own_objects_fill_no_table_of_the_paper() {
    let all = collected(&["full"], &["a"], vec![record("full", "a", 0, 0.123)]);
    let titles: Vec<String> = tables(&all).into_iter().map(|t| t.title).collect();
    assert_eq!(titles, ["Every object", "Surfaces at both states"]);
    let every = every_object(&all);
    assert_eq!(every.rows[0].cells.last().unwrap(), "none");
    assert_eq!(every.rows[0].cells[3], "0.123");
    assert!(
        !every.head.iter().any(|h| h == "LPIPS" || h == "Parts found/true" || h == "Motion (length)"),
        "{:?}",
        every.head
    );
}

#[test]
fn a_found_number_of_parts_is_beside_the_true_one() {
    let mut records: Vec<_> = (0..3).map(|seed| record("full", "a", seed, 0.1)).collect();
    records.push(record("full", "b", 0, 0.1));
    records.push(record("paper", "b", 0, 0.1));
    for (record, parts) in records.iter_mut().zip([2, 4, 2, 3]) {
        record.settings.parts = None;
        if let Outcome::Done(m) = &mut record.outcome {
            m.metrics.parts = parts;
        }
    }
    let all = collected(&["full", "paper"], &["a", "b"], records);
    let every = every_object(&all);
    let column = every.head.iter().position(|h| h == "Parts found/true").unwrap();
    let cells: Vec<&str> = every.rows.iter().map(|r| r.cells[column].as_str()).collect();
    assert_eq!(cells, ["2, 4/2", "-", "3/3", "-"]);
    let means = variants(&all).unwrap();
    let column = means.head.iter().position(|h| h == "Right number of parts").unwrap();
    assert_eq!(means.rows.iter().map(|r| r.cells[column].as_str()).collect::<Vec<_>>(), ["3 of 4 runs", "-"]);
}

#[test]
fn a_variant_whose_runs_all_failed_has_f_and_a_reason() {
    let mut records = vec![record("full", "a", 0, 0.1)];
    records.extend([0, 1].map(|seed| failed("paper", "a", seed, "bang")));
    let all = collected(&["full", "paper"], &["a"], records);
    let every = every_object(&all);
    assert_eq!(every.rows[1].cells[3], "F");
    assert_eq!(every.rows[1].cells.last().unwrap(), "2 failed");
    let means = variants(&all).unwrap();
    assert_eq!(means.rows[1].cells[..3], ["paper", "2", "-"]);
    assert_eq!(failures(&all).unwrap().rows.len(), 2);
}
