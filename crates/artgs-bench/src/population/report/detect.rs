//! Distinguishes tables of a population from those of a batch.

use crate::marker::{Kind, is_of};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Fields that only rows of a population have together.
const POPULATION: [&str; 2] = ["seed", "category"];
/// Fields that only rows of a batch have together.
const BATCH: [&str; 2] = ["id", "status"];

/// True for the table of a population: a folder of rows, or one with `rows` or a table in it, a file of one JSON object per line, or a
/// Parquet file. The first row that has the fields of a population or of a batch decides; if a folder has no such row, the file that
/// marks the folder of a bench. False for anything else, and for what cannot be read.
pub fn is_population(table: &Path) -> bool {
    if table.is_dir() {
        return is_population_folder(table);
    }
    match extension(table).as_str() {
        "jsonl" | "ndjson" => lines_decide(table).unwrap_or(false),
        "parquet" => has_columns(table),
        _ => false,
    }
}

fn extension(file: &Path) -> String {
    file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase()
}

fn is_population_folder(folder: &Path) -> bool {
    let (rows, is_rows) = (folder.join("rows"), folder.file_name().is_some_and(|name| name == "rows"));
    let decided = row_files(if rows.is_dir() { &rows } else { folder })
        .into_iter()
        .find_map(|file| kind_of(&std::fs::read(file).ok()?));
    let inside = ["results.jsonl", "results.parquet"].map(|name| folder.join(name));
    let decided = decided.or_else(|| inside.iter().find(|table| table.is_file()).map(|table| is_population(table)));
    let marked = |bench: &Path| is_of(bench, Kind::Population);
    decided.unwrap_or_else(|| marked(folder) || (is_rows && folder.parent().is_some_and(marked)))
}

/// The JSON files of a folder by name.
fn row_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let files = entries.filter_map(Result::ok).map(|entry| entry.path());
    let hidden = |file: &Path| file.file_name().and_then(|n| n.to_str()).is_some_and(|name| name.starts_with('.'));
    let mut files: Vec<PathBuf> = files.filter(|file| extension(file) == "json" && !hidden(file)).collect();
    files.sort();
    files
}

/// What the first line that is a row says, without a byte order mark.
fn lines_decide(file: &Path) -> Option<bool> {
    let lines = BufReader::new(std::fs::File::open(file).ok()?).split(b'\n');
    lines.map_while(Result::ok).find_map(|line| kind_of(line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&line)))
}

/// True for a row of a population, false for one of a batch, none for anything else.
fn kind_of(row: &[u8]) -> Option<bool> {
    let row: Value = serde_json::from_slice(row).ok()?;
    let has = |fields: [&str; 2]| fields.iter().all(|field| row.get(field).is_some());
    if has(POPULATION) { Some(true) } else { has(BATCH).then_some(false) }
}

fn has_columns(file: &Path) -> bool {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    // The crate may panic on a damaged file; the reader of the table then reports it.
    let columns = || {
        let file = std::fs::File::open(file).map_err(|e| e.to_string())?;
        let reader = SerializedFileReader::new(file).map_err(|e| e.to_string())?;
        let schema = reader.metadata().file_metadata().schema().get_fields().to_vec();
        Ok(POPULATION.iter().all(|field| schema.iter().any(|column| column.name() == *field)))
    };
    crate::batch::guarded(columns, "").unwrap_or(false)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn populations_and_batches_are_distinguished() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, text).unwrap();
        };
        let (ours, theirs) = ("{\"seed\": 1, \"category\": \"cabinet\"}\n", "{\"id\": \"a\", \"status\": \"done\"}\n");
        write("population/rows/1.json", ours);
        write("population/rows/.0.json", "unfinished");
        write("batch/rows/1.json", theirs);
        write("inside/results.jsonl", ours);
        write("ours.jsonl", &format!("\u{feff}{ours}"));
        write("theirs.jsonl", theirs);
        write("damaged.parquet", "PAR1");
        // Rows that say nothing are passed over.
        write("cut/rows/1.json", "{\"seed\"");
        write("cut/rows/2.json", ours);
        write("theirs-cut/rows/1.json", "{\"id\"");
        write("theirs-cut/rows/2.json", theirs);
        write("cut.jsonl", &format!("{{\"seed\"\n{ours}"));
        // Without any row the marker of the bench decides.
        let marker = |kind: &str| format!("{{\"program\": \"artgs bench\", \"kind\": \"{kind}\"}}");
        write("marked/rows/1.json", "{");
        write("marked/bench.json", &marker("population"));
        write("earlier/rows/1.json", "{");
        write("earlier/bench.json", "{\"program\": \"artgs bench\"}");
        write("suites/bench.json", &marker("suites"));
        std::fs::write(folder.path().join("t.parquet"), include_bytes!("../../batch/fixtures/results.parquet"))
            .unwrap();
        for (name, expected) in [
            ("population", true),
            ("population/rows", true),
            ("inside", true),
            ("ours.jsonl", true),
            ("cut", true),
            ("cut/rows", true),
            ("cut.jsonl", true),
            ("theirs-cut", false),
            ("marked", true),
            ("marked/rows", true),
            ("earlier", true),
            ("suites", false),
            ("batch", false),
            ("theirs.jsonl", false),
            ("damaged.parquet", false),
            ("t.parquet", false),
            ("absent", false),
            ("absent.jsonl", false),
        ] {
            assert_eq!(is_population(&folder.path().join(name)), expected, "{name}");
        }
    }
}
