//! `artgs report`: the page, its place, and messages.

#![cfg(feature = "bench")]

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

const TABLE: &str = concat!(
    "{\"id\": \"a\", \"status\": \"done\", \"seconds\": 10.0, \"cpu_seconds\": 1800.0, \"confidence\": 0.9, \"parts\": 2}\n",
    "{\"id\": \"b\", \"status\": \"failed\", \"reason\": \"x/b: no such directory\"}\n",
    "{\"id\": \"c\", \"status\": \"failed\", \"reason\": \"y/c: no such directory\"}\n",
    "{\"id\": \"d\", \"status\": \"failed\", \"reason\": \"the run ended with signal: 9\", \"retry\": true}\n",
);

fn report(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_artgs"));
    command.arg("report").args(args).current_dir(folder).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_table_becomes_a_page_with_known_numbers() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("results.jsonl"), TABLE).unwrap();
    let before = TABLE.replace("\"failed\", \"reason\": \"x/b: no such directory\"", "\"done\"");
    std::fs::write(folder.path().join("old.jsonl"), before).unwrap();
    let made =
        report(folder.path(), &["results.jsonl", "--before", "old.jsonl", "--cpu-price", "0.05", "-o", "p", "--json"]);
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    let found: Value = serde_json::from_slice(&made.stdout).unwrap();
    let summary = &found["summary"];
    assert_eq!(
        (summary["done"].as_u64(), summary["failed"].as_u64(), summary["retry"].as_u64()),
        (Some(1), Some(3), Some(1))
    );
    assert_eq!(
        (&summary["causes"][0]["cause"], &summary["causes"][0]["count"]),
        (&"PATH: no such directory".into(), &2.into())
    );
    assert_eq!((&summary["causes"][1]["retry"], &summary["cost"]), (&"yes".into(), &0.025.into()));
    assert_eq!((&summary["changes"]["newly_failed"][0]["id"], &found["html"]), (&"b".into(), &"p/report.html".into()));
    let page = std::fs::read_to_string(folder.path().join("p/report.html")).unwrap();
    assert!(page.contains("<code>artgs report results.jsonl --before old.jsonl") && page.contains("Newly failed"));
    let shown = report(folder.path(), &["."]);
    assert!(shown.status.code() == Some(0) && folder.path().join("report.html").is_file(), "{}", text(&shown.stderr));
    let lines = text(&shown.stdout);
    assert!(lines.contains("4 captures, 1 done, 3 failed; a retry makes sense for 1"), "{lines}");
    assert!(lines.contains("       2  PATH: no such directory\n"), "{lines}");
}

#[test]
fn wrong_input_is_one_clear_error() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("good.jsonl", TABLE);
    write("cut.jsonl", &TABLE[..TABLE.len() - 30]);
    write("field.jsonl", &TABLE.replace("0.9", "9.0"));
    for (args, words) in [
        (&["cut.jsonl"][..], "cut.jsonl: line 4: not a JSON object"),
        (&["field.jsonl"], "line 1: `confidence` is 9.0, expected a number from 0 to 1; correct or remove it"),
        (&["good.jsonl", "--before", "cut.jsonl"], "cut.jsonl: line 4"),
        (&["absent.jsonl"], "absent.jsonl: No such file"),
        (&["absent"], "absent: No such file or folder"),
        (&["good.jsonl", "--before", "absent"], "absent: No such file or folder"),
        (&["good.jsonl", "--cpu-price", "much"], "--cpu-price"),
        (&["good.jsonl", "--cpu-price=-1"], "--cpu-price"),
    ] {
        let refused = report(folder.path(), args);
        let said = text(&refused.stderr);
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(said.starts_with("error: ") && said.contains(words), "{said}");
        assert!(!folder.path().join("report.html").exists());
    }
}

#[test]
fn a_foreign_file_beside_the_page_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("t.jsonl", "{\"seed\": 1, \"category\": \"cabinet\", \"decidable\": true, \"right\": true}\n");
    write("thesis.md", "# My thesis\n");
    let refused = report(folder.path(), &["t.jsonl", "-o", "thesis.html"]);
    let said = text(&refused.stderr);
    assert!(refused.status.code() == Some(2) && said.contains("thesis.md, which artgs report did not write"), "{said}");
    assert_eq!(std::fs::read_to_string(folder.path().join("thesis.md")).unwrap(), "# My thesis\n");
    assert!(!folder.path().join("thesis.html").exists());
    for _ in 0..2 {
        let made = report(folder.path(), &["t.jsonl", "-o", "page.html"]);
        assert_eq!(made.status.code(), Some(0), "its own file is replaced: {}", text(&made.stderr));
    }
    let shown = text(&report(folder.path(), &["--help"]).stdout);
    assert!(shown.contains("page.html: page.md"), "{shown}");
}

#[test]
fn damaged_rows_of_a_population_are_those_of_a_population() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    write("pop/rows/1.json", "{\"seed\"");
    write("pop/rows/2.json", "{\"seed\": 2, \"category\": \"cabinet\"}");
    write("pop/bench.json", "{\"program\": \"artgs bench\"}");
    for (args, words) in [
        (&["pop"][..], "run the same `artgs bench population` again"),
        (&["pop/rows"], "run the same `artgs bench population` again"),
        (&["pop/rows/2.json"], "the folder of `artgs batch` or `artgs bench population`"),
    ] {
        let refused = report(folder.path(), args);
        let said = text(&refused.stderr);
        assert!(refused.status.code() == Some(2) && said.contains(words) && !said.contains("capture"), "{said}");
    }
}

#[test]
fn a_table_of_a_population_has_a_page_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let row = |seed: u32, right: bool| {
        format!(
            "{{\"seed\": {seed}, \"category\": \"cabinet\", \"sensor\": \"exact\", \"decidable\": true, \"right\": {right}}}\n"
        )
    };
    write("new.jsonl", &(row(1, true) + &row(2, false)));
    write("old.jsonl", &(row(1, true) + &row(2, true)));
    write("batch.jsonl", TABLE);
    let shown = report(folder.path(), &["new.jsonl", "--before", "old.jsonl"]);
    let lines = text(&shown.stdout);
    assert_eq!(shown.status.code(), Some(0), "{}", text(&shown.stderr));
    assert!(
        lines.contains("1 of 2, 50.0 %") && lines.contains("1 from right to wrong, 0 from wrong to right"),
        "{lines}"
    );
    let page = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert!(page.contains("Population benchmark") && folder.path().join("report.md").is_file());
    let found: Value = serde_json::from_slice(&report(folder.path(), &["new.jsonl", "--json"]).stdout).unwrap();
    assert_eq!((&found["summary"]["right"]["count"], &found["markdown"]), (&1.into(), &"report.md".into()));
    write("elsewhere.jsonl", &row(7, true));
    let apart = report(folder.path(), &["new.jsonl", "--before", "elsewhere.jsonl"]);
    assert_eq!(apart.status.code(), Some(0));
    assert!(text(&apart.stderr).contains("no object is in both tables"), "{}", text(&apart.stderr));
    for (args, words) in [
        (&["batch.jsonl", "--before", "new.jsonl"][..], "new.jsonl: is a table of artgs bench population, and"),
        (&["new.jsonl", "--before", "batch.jsonl"], "batch.jsonl: is no table of artgs bench population"),
        (&["new.jsonl", "--cpu-price", "1"], "--cpu-price is for tables of artgs batch"),
    ] {
        let refused = report(folder.path(), args);
        assert_eq!(refused.status.code(), Some(2));
        assert!(text(&refused.stderr).contains(words), "{}", text(&refused.stderr));
    }
}
