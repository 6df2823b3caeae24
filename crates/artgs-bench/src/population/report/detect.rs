//! Distinguishes tables of a population from those of a batch.

use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// Fields that only rows of a population have together.
const FIELDS: [&str; 2] = ["seed", "category"];

/// True if the first row of a table has a seed and a category: a folder of rows, or one with `rows` or a table in it, a file of one JSON
/// object per line, or a Parquet file. False for anything that cannot be read.
pub fn is_population(table: &Path) -> bool {
    if table.is_dir() {
        let rows = table.join("rows");
        let first = first_row(if rows.is_dir() { &rows } else { table });
        let inside = ["results.jsonl", "results.parquet"].map(|name| table.join(name));
        return match first {
            Some(file) => std::fs::read(file).is_ok_and(|bytes| has_fields(&bytes)),
            None => inside.iter().find(|table| table.is_file()).is_some_and(|table| is_population(table)),
        };
    }
    let extension = table.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    match extension.as_str() {
        "jsonl" | "ndjson" => first_line(table).is_some_and(|line| has_fields(&line)),
        "parquet" => has_columns(table),
        _ => false,
    }
}

/// The first JSON file of a folder by name.
fn first_row(folder: &Path) -> Option<PathBuf> {
    let files = std::fs::read_dir(folder).ok()?.filter_map(Result::ok).map(|entry| entry.path());
    let hidden = |file: &Path| file.file_name().and_then(|n| n.to_str()).is_some_and(|name| name.starts_with('.'));
    files.filter(|file| file.extension().is_some_and(|e| e == "json") && !hidden(file)).min()
}

/// The first line that is not empty, without a byte order mark.
fn first_line(file: &Path) -> Option<Vec<u8>> {
    let lines = BufReader::new(std::fs::File::open(file).ok()?).split(b'\n');
    let line = lines.map_while(Result::ok).find(|line| !line.trim_ascii().is_empty())?;
    Some(line.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&line).to_vec())
}

fn has_fields(row: &[u8]) -> bool {
    serde_json::from_slice::<Value>(row).is_ok_and(|row| FIELDS.iter().all(|field| row.get(field).is_some()))
}

fn has_columns(file: &Path) -> bool {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    // The crate may panic on a damaged file; the reader of the table then reports it.
    let columns = || {
        let file = std::fs::File::open(file).map_err(|e| e.to_string())?;
        let reader = SerializedFileReader::new(file).map_err(|e| e.to_string())?;
        let schema = reader.metadata().file_metadata().schema().get_fields().to_vec();
        Ok(FIELDS.iter().all(|field| schema.iter().any(|column| column.name() == *field)))
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
        std::fs::write(folder.path().join("t.parquet"), include_bytes!("../../batch/fixtures/results.parquet"))
            .unwrap();
        for (name, expected) in [
            ("population", true),
            ("population/rows", true),
            ("inside", true),
            ("ours.jsonl", true),
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
