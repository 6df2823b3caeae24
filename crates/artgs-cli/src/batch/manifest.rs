//! The list of captures of a batch: CSV, or JSON with one object per line.

use crate::args::{Cli, Command};
use clap::Parser;
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Columns that are no options of `reconstruct`.
const OWN: [&str; 3] = ["id", "start", "end"];
/// Options of `reconstruct` that a batch decides itself.
const DECIDED: [&str; 7] = ["out", "resume", "force", "view", "json", "quiet", "stop-after"];

/// Options whose values are files.
const FILES: [&str; 2] = ["config", "poses"];

/// One capture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    /// Names its files.
    pub(super) id: String,
    /// A capture, or the recordings of both states.
    pub(super) paths: Vec<PathBuf>,
    /// Options of `reconstruct` with their values; `true` for a flag.
    pub(super) options: BTreeMap<String, String>,
}

impl Entry {
    /// Words of the command that makes its replica.
    pub(super) fn words(&self, out: &Path) -> Vec<OsString> {
        let mut words: Vec<OsString> = ["reconstruct", "--quiet", "--resume", "-o"].map(OsString::from).into();
        words.push(out.into());
        for (option, value) in &self.options {
            words.push(if value == "true" { format!("--{option}") } else { format!("--{option}={value}") }.into());
        }
        words.push("--".into());
        words.extend(self.paths.iter().map(OsString::from));
        words
    }

    /// Its options as text, but for files, whose content counts.
    pub(super) fn described(&self) -> String {
        let own = self.options.iter().filter(|(option, _)| !FILES.contains(&option.as_str()));
        own.map(|(option, value)| format!("{option}={value}\n")).collect()
    }

    /// Files and folders that it is made from.
    pub(super) fn files(&self) -> Vec<PathBuf> {
        let named = FILES.iter().filter_map(|option| self.options.get(*option)).map(PathBuf::from);
        self.paths.iter().cloned().chain(named).collect()
    }
}

/// Reads a manifest and checks all of it. Relative paths in it start at its folder. Errors name the line.
pub(super) fn read(path: &Path) -> Result<Vec<Entry>, String> {
    let (mut entries, mut ids) = (Vec::new(), BTreeSet::new());
    for row in rows(path)? {
        let line = row.0;
        let entry = entry_of(row, path)?;
        if !ids.insert(entry.id.to_ascii_lowercase()) {
            let earlier = format!("line {line}: the id {:?} is that of an earlier line", entry.id);
            return Err(format!("{}: {earlier}", path.display()));
        }
        entries.push(entry);
    }
    Ok(entries)
}

/// Reads one capture of a manifest, counted from 0, and checks only that one: checking a line takes a hundred times as long as reading it, and
/// each job of a scheduler reads the manifest.
pub(super) fn read_one(path: &Path, index: usize) -> Result<Entry, String> {
    let mut rows = rows(path)?;
    let last = rows.len() - 1;
    if index > last {
        return Err(format!("--index {index}: the manifest has captures 0 to {last}"));
    }
    entry_of(rows.swap_remove(index), path)
}

/// The rows of a manifest, at least one.
fn rows(path: &Path) -> Result<Vec<Row>, String> {
    let fail = |reason: String| format!("{}: {reason}", path.display());
    let bytes = std::fs::read(path).map_err(|e| fail(e.to_string()))?;
    let bytes = artgs_io::without_mark(&bytes).map_err(|e| fail(e.to_string()))?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let rows = match extension.as_str() {
        "csv" => csv_rows(bytes),
        "jsonl" | "ndjson" => json_rows(bytes),
        "parquet" => Err("Parquet is read by the Python package, artgs.ray.reconstruct; write it as CSV".into()),
        _ => Err("is no manifest; its name must end in .csv or .jsonl".into()),
    };
    let rows = rows.map_err(fail)?;
    if rows.is_empty() { Err(fail("there is no capture in it".into())) } else { Ok(rows) }
}

fn entry_of((line, fields): Row, path: &Path) -> Result<Entry, String> {
    let folder = path.parent().unwrap_or(Path::new(""));
    entry(fields, folder).map_err(|reason| format!("{}: line {line}: {reason}", path.display()))
}

/// Number of a line, from 1, with its fields.
type Row = (u64, Map<String, Value>);

fn csv_rows(bytes: &[u8]) -> Result<Vec<Row>, String> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let names: Vec<String> = reader.headers().map_err(|e| e.to_string())?.iter().map(String::from).collect();
    let row = |record: Result<csv::StringRecord, csv::Error>| {
        let record = record.map_err(|e| e.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        let fields = names.iter().cloned().zip(record.iter().map(Value::from));
        Ok((line, fields.collect()))
    };
    reader.records().map(row).collect()
}

fn json_rows(bytes: &[u8]) -> Result<Vec<Row>, String> {
    let text = std::str::from_utf8(bytes).map_err(|e| e.to_string())?;
    let lines = text.lines().zip(1..).filter(|(line, _)| !line.trim().is_empty());
    lines
        .map(|(line, number)| {
            let fields = serde_json::from_str(line).map_err(|e| format!("line {number}: not a JSON object: {e}"))?;
            Ok((number, fields))
        })
        .collect()
}

fn entry(fields: Map<String, Value>, folder: &Path) -> Result<Entry, String> {
    let mut texts = BTreeMap::new();
    for (name, value) in fields {
        if let Some(text) = text(&value).map_err(|reason| format!("`{name}`: {reason}"))? {
            texts.insert(name.to_lowercase().replace('_', "-"), text);
        }
    }
    let id = texts.remove("id").ok_or("`id` is missing")?;
    if !is_name(&id) {
        return Err(format!(
            "the id {id:?} must be 1 to 100 letters, digits, `-`, `_` and `.`, and not begin with `.`"
        ));
    }
    let start = texts.remove("start").ok_or("`start` is missing: the folder of a capture, or a recording")?;
    let paths = std::iter::once(start).chain(texts.remove("end")).map(|path| folder.join(path)).collect();
    if let Some(name) = DECIDED.iter().find(|name| texts.contains_key(**name)) {
        return Err(format!("`{name}` is decided by the batch; remove it"));
    }
    for name in FILES {
        if let Some(path) = texts.get_mut(name) {
            *path = folder.join(&*path).to_string_lossy().into_owned();
        }
    }
    let entry = Entry { id, paths, options: texts };
    // The words are checked as the command would check them.
    let words = std::iter::once(OsString::from("artgs")).chain(entry.words(Path::new("out")));
    match Cli::try_parse_from(words).map(|cli| cli.command) {
        Ok(Command::Reconstruct(_)) => Ok(entry),
        Ok(_) => Err("is no reconstruction".into()),
        Err(error) => {
            let text = error.to_string();
            let reason = text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_string();
            Err(format!("{reason}; columns are {} and options of artgs reconstruct", OWN.join(", ")))
        }
    }
}

/// The value of an option; none if it is not given.
fn text(value: &Value) -> Result<Option<String>, String> {
    let text = match value {
        Value::Null | Value::Bool(false) => return Ok(None),
        Value::String(text) if text.is_empty() || text.eq_ignore_ascii_case("false") => return Ok(None),
        Value::String(text) if text.eq_ignore_ascii_case("true") => "true".into(),
        Value::String(text) => text.clone(),
        Value::Bool(true) => "true".into(),
        Value::Number(number) => number.to_string(),
        Value::Array(values) => {
            let texts: Result<Vec<_>, _> =
                values.iter().map(|value| text(value).map(Option::unwrap_or_default)).collect();
            texts?.join(",")
        }
        Value::Object(_) => return Err("an object is no value of an option".into()),
    };
    Ok(Some(text))
}

fn is_name(id: &str) -> bool {
    let usable = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    (1..=100).contains(&id.len()) && !id.starts_with(['.', '-']) && id.chars().all(usable)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(name: &str, text: &str) -> Result<Vec<Entry>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        read(&path).map(|entries| {
            let relative = |p: &PathBuf| p.strip_prefix(folder.path()).unwrap_or(p).to_path_buf();
            entries.into_iter().map(|e| Entry { paths: e.paths.iter().map(relative).collect(), ..e }).collect()
        })
    }

    #[test]
    fn both_forms_give_the_same_captures() {
        let csv = "id,start,end,parts,force_input\na,x,,3,false\n\"b\",\"y,1\",z,,TRUE\n";
        let json = "{\"id\": \"a\", \"start\": \"x\", \"parts\": 3, \"end\": null}\n\n\
                    {\"id\": \"b\", \"start\": \"y,1\", \"end\": \"z\", \"force-input\": true}\n";
        let entries = read_text("m.csv", csv).unwrap();
        assert_eq!(entries, read_text("m.jsonl", json).unwrap());
        assert_eq!(entries[0].options, BTreeMap::from([("parts".into(), "3".into())]));
        assert_eq!(entries[1].paths, ["y,1", "z"].map(PathBuf::from));
        let words: Vec<String> =
            entries[1].words(Path::new("o")).iter().map(|w| w.to_string_lossy().into_owned()).collect();
        assert_eq!(words[..6], ["reconstruct", "--quiet", "--resume", "-o", "o", "--force-input"]);
    }

    #[test]
    fn one_capture_is_read_without_the_others() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.csv");
        std::fs::write(&path, "id,start,parts\na,x,3\nb,y,one\nc,z,\n").unwrap();
        assert_eq!(read_one(&path, 2).map(|entry| entry.id), Ok("c".into()));
        assert!(read_one(&path, 1).unwrap_err().contains("line 3: invalid value 'one'"));
        assert!(read_one(&path, 3).unwrap_err().contains("captures 0 to 2"));
        assert!(read(&path).is_err());
    }

    #[test]
    fn wrong_lines_are_named() {
        for (name, text, words) in [
            ("m.csv", "id,start\na,x\na,y\n", "line 3: the id \"a\" is that of an earlier line"),
            ("m.csv", "id,start\n../a,x\n", "line 2: the id \"../a\" must be"),
            ("m.csv", "id\na\n", "line 2: `start` is missing"),
            ("m.csv", "id,start,parts\na,x,one\n", "line 2: invalid value 'one'"),
            ("m.csv", "id,start,colour\na,x,red\n", "'--colour'"),
            ("m.csv", "id,start,out\na,x,y\n", "`out` is decided by the batch"),
            ("m.csv", "id,start\na\n", "line: 2"),
            ("m.csv", "id,start\n", "there is no capture"),
            ("m.jsonl", "{\"id\": \"a\", \"start\": {}}\n", "line 1: `start`: an object"),
            ("m.jsonl", "[1]\n", "line 1: not a JSON object"),
            ("m.parquet", "", "artgs.ray.reconstruct"),
            ("m.txt", "", ".csv or .jsonl"),
        ] {
            let error = read_text(name, text).unwrap_err();
            assert!(error.contains(words), "{error}");
        }
    }
}
