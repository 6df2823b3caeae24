//! The rows of a population on disk: one file per object, and two tables of all.

use super::row::Row;
use super::table::{parquet_bytes, row_of};
use crate::batch::TableError;
use crate::batch::{guarded, parquet_fields};
use artgs_io::{FileError, write_atomic};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};

/// Names of the tables in the folder of a bench.
const TABLES: [&str; 2] = ["results.parquet", "results.jsonl"];
/// What to do about a damaged table or row.
const REMEDY: &str = "run the same `artgs bench population` again, which writes it again";

/// The rows at a path, by seed: the folder of a bench, its folder `rows`, `results.parquet`, or `results.jsonl`.
pub fn read_rows(path: &Path) -> Result<Vec<Row>, TableError> {
    let fail = |reason: String| TableError { path: path.into(), reason };
    let mut rows = if path.is_dir() {
        let inner = path.join("rows");
        let table = TABLES.map(|name| path.join(name)).into_iter().find(|table| table.is_file());
        match table {
            _ if inner.is_dir() => rows_of_folder(&inner)?,
            Some(table) => return read_rows(&table),
            None => rows_of_folder(path)?,
        }
    } else {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        match extension.as_str() {
            "jsonl" | "ndjson" => rows_of_lines(path).map_err(fail)?,
            "parquet" => guarded(|| rows_of_parquet(path), REMEDY).map_err(fail)?,
            _ => {
                let kinds =
                    "is no table of a population; give the folder of the bench, results.parquet or results.jsonl";
                return Err(fail(kinds.into()));
            }
        }
    };
    if rows.is_empty() {
        return Err(fail("there is no row in it; give the folder that `artgs bench population -o` wrote".into()));
    }
    // Stable: a table of several sensors keeps their order.
    rows.sort_by_key(|row| row.seed);
    Ok(rows)
}

/// The rows of a folder of one file per object, in the order of their seeds.
pub(super) fn rows_of_folder(folder: &Path) -> Result<Vec<Row>, TableError> {
    // Files of another folder may be anything.
    let remove = if folder.file_name().is_some_and(|name| name == "rows") { "remove the file, and " } else { "" };
    let read = |path: PathBuf| {
        let text = std::fs::read(&path).map_err(|e| e.to_string());
        let row = text.and_then(|text| serde_json::from_slice::<Row>(&text).map_err(|e| e.to_string()));
        row.map_err(|reason| TableError { path, reason: format!("{reason}; {remove}{REMEDY}") })
    };
    row_files(folder)?.into_iter().map(|(_, path)| read(path)).collect()
}

/// Seeds and files of the rows in a folder, by seed; none if there is no such folder. Files with other names are no rows.
pub(super) fn row_files(folder: &Path) -> Result<Vec<(u64, PathBuf)>, TableError> {
    let fail = |e: std::io::Error| TableError { path: folder.into(), reason: e.to_string() };
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        let seed = path.file_name().and_then(|n| n.to_str()?.strip_suffix(".json")?.parse().ok());
        files.extend(seed.map(|seed: u64| (seed, path)));
    }
    files.sort();
    Ok(files)
}

fn rows_of_lines(path: &Path) -> Result<Vec<Row>, String> {
    let bytes = std::fs::read(path).map_err(|e| e.to_string())?;
    let text = artgs_io::without_mark(&bytes).map_err(|e| e.to_string())?;
    let filled = text.split(|b| *b == b'\n').zip(1_u64..).filter(|(line, _)| !line.trim_ascii().is_empty());
    let read = |(line, number): (&[u8], u64)| {
        serde_json::from_slice(line).map_err(|e| format!("line {number}: {e}; {REMEDY}"))
    };
    filled.map(read).collect()
}

fn rows_of_parquet(path: &Path) -> Result<Vec<Row>, String> {
    let read = |(fields, number): (Map<String, Value>, u64)| {
        row_of(fields).map_err(|reason| format!("row {number}: {reason}; {REMEDY}"))
    };
    parquet_fields(path, REMEDY)?.into_iter().zip(1_u64..).map(read).collect()
}

/// Why the tables could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// A file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The table itself.
    #[error("{0}")]
    Table(String),
}

/// Writes both tables into the folder of a bench; returns their paths, Parquet first.
pub fn write_rows(folder: &Path, rows: &[Row]) -> Result<[PathBuf; 2], WriteError> {
    let paths = TABLES.map(|name| folder.join(name));
    write_atomic(&paths[0], &parquet_bytes(rows).map_err(WriteError::Table)?)?;
    let lines: String = rows.iter().map(|row| format!("{}\n", json!(row))).collect();
    write_atomic(&paths[1], lines.as_bytes())?;
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::population::row::{JointRow, Status};

    fn rows() -> Vec<Row> {
        let joint = JointRow {
            truth: Some(1),
            kind: "revolute".into(),
            kind_true: "revolute".into(),
            overlap: 0.875,
            axis_deg: Some(0.1),
            position: None,
            motion: Some(1.0 / 3.0),
            axis_of_interval: Some(0.5),
            position_of_interval: None,
            motion_of_interval: Some(1.5),
            confidence: None,
            correct: true,
        };
        let extra = JointRow { kind: "screw".into(), overlap: 0.25, ..JointRow::default() };
        let done = Row {
            seed: 3,
            category: "desk-lamp".into(),
            sensor: "exact".into(),
            features: vec!["equal-motion".into(), "look-alike".into()],
            decidable: true,
            parts_true: 2,
            parts_found: 2,
            missing: 1,
            extra: 1,
            joints: vec![joint, extra],
            warnings: 4,
            seconds: 12.25,
            peak_memory_mib: 512.5,
            program: "0.1.0 (5893882)".into(),
            ..Row::default()
        };
        let refused = Row {
            seed: 7,
            status: Status::Refused,
            reason: "exit code 2: \"no depth\"\n".into(),
            undecidable: vec!["unseen".into()],
            ..Row::default()
        };
        let still = Row { seed: 11, count_right: true, right: true, joints_right: true, ..Row::default() };
        vec![done, refused, still]
    }

    #[test]
    fn tables_and_folders_are_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let paths = write_rows(dir.path(), &rows()).unwrap();
        for path in &paths {
            assert_eq!(read_rows(path).unwrap(), rows(), "{}", path.display());
        }
        assert_eq!(read_rows(dir.path()).unwrap(), rows());
        for row in rows() {
            let text = json!({ "settings": "others", "seed": row.seed, "right": row.right }).to_string();
            write_atomic(&dir.path().join(format!("rows/{}.json", row.seed)), text.as_bytes()).unwrap();
        }
        std::fs::write(dir.path().join("rows/.3.json.new"), "unfinished").unwrap();
        for path in [dir.path().to_path_buf(), dir.path().join("rows")] {
            let read = read_rows(&path).unwrap();
            let seeds: Vec<(u64, bool)> = read.iter().map(|row| (row.seed, row.right)).collect();
            assert_eq!(seeds, [(3, false), (7, false), (11, true)], "in the order of the numbers");
        }
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::write(at("a.jsonl"), "{\"seed\": 1}\n\n{\"seed\": \"x\"}\n").unwrap();
        std::fs::write(at("b.parquet"), "PAR1").unwrap();
        std::fs::write(at("c.csv"), "").unwrap();
        std::fs::write(at("d.jsonl"), "\n").unwrap();
        std::fs::create_dir(at("e")).unwrap();
        for (name, words) in [
            ("a.jsonl", "line 3: invalid type"),
            ("b.parquet", "cannot be read as Parquet"),
            ("c.csv", "is no table of a population"),
            ("d.jsonl", "there is no row in it"),
            ("e", "there is no row in it"),
        ] {
            let error = read_rows(&at(name)).unwrap_err().to_string();
            assert!(error.contains(words) && error.contains(name), "{error}");
        }
        for (folder, removes) in [("e", false), ("rows", true)] {
            std::fs::create_dir_all(at(folder)).unwrap();
            std::fs::write(at(folder).join("5.json"), "{").unwrap();
            let error = read_rows(&at(folder)).unwrap_err().to_string();
            assert!(error.contains("5.json") && error.contains("remove the file") == removes, "{error}");
        }
    }

    #[test]
    fn lines_of_other_programs_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.ndjson");
        std::fs::write(&path, "\u{feff}{\"seed\": 4}\n").unwrap();
        assert_eq!(read_rows(&path).unwrap()[0].seed, 4);
    }

    #[test]
    fn damaged_parquet_is_refused_or_read() {
        let dir = tempfile::tempdir().unwrap();
        let bytes = parquet_bytes(&rows()).unwrap();
        let path = dir.path().join("t.parquet");
        for at in (0..bytes.len()).step_by(7) {
            std::fs::write(&path, &bytes[..at]).unwrap();
            assert!(read_rows(&path).is_err(), "cut at {at}");
            let mut altered = bytes.clone();
            altered[at] ^= 0x55;
            std::fs::write(&path, &altered).unwrap();
            // Only that it ends: altered numbers may be read.
            let _ = read_rows(&path);
        }
    }
}
