//! Reading the rows of a batch: `results.jsonl`, the folder `rows`, or the folder of the batch.

use super::row::Row;
use serde_json::{Map, Value};
use std::cell::Cell;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// What to do about a wrong line of a table.
const REMEDY: &str = "correct or remove it, or write the table again with `artgs batch MANIFEST -o OUT`";
/// What to do about a wrong file of a folder `rows`.
const ROW_REMEDY: &str = "remove the file; `artgs batch` then runs its capture again";
/// What to do about a wrong file beside rows in another folder, which may be anything.
const OTHER_REMEDY: &str = "give a folder that holds nothing but rows";
/// About a folder without any row.
const NEITHER: &str = "is neither the folder of `artgs batch` nor that of `artgs bench population`";

/// Why a table cannot be read: file, line and field, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}: {reason}", path.display())]
pub struct TableError {
    /// The file or folder.
    pub path: PathBuf,
    /// The line and field, and what to do.
    pub reason: String,
}

/// The rows of a table in their order, and the folder that relative paths of replicas start at. `path` is a file of one JSON object per line
/// (`.jsonl`), a Parquet file, a folder of rows (`rows`, in the order of the ids), or the folder of a batch, whose `rows` are read if there are any.
pub fn read_rows(path: &Path) -> Result<(Vec<Row>, PathBuf), TableError> {
    let fail = |reason: String| TableError { path: path.into(), reason };
    let parent = || path.parent().unwrap_or(Path::new("")).to_path_buf();
    if path.is_dir() {
        let inner = path.join("rows");
        if inner.is_dir() {
            return Ok((of_folder(&inner)?, path.into()));
        }
        let tables = ["results.jsonl", "results.parquet"].map(|name| path.join(name));
        if let Some(table) = tables.iter().find(|table| table.is_file()) {
            return read_rows(table);
        }
        return Ok((of_folder(path)?, parent()));
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let rows = match extension.as_str() {
        "jsonl" | "ndjson" => {
            let bytes = std::fs::read(path).map_err(|e| fail(e.to_string()))?;
            of_lines(&bytes)
        }
        "parquet" => of_parquet(path),
        _ => Err("is no table of results; give results.jsonl, results.parquet, or the folder of `artgs batch` or `artgs bench population`".into()),
    };
    let rows = rows.map_err(fail)?;
    if rows.is_empty() { Err(fail("there is no row in it".into())) } else { Ok((rows, parent())) }
}

fn of_lines(bytes: &[u8]) -> Result<Vec<Row>, String> {
    let bytes = artgs_io::without_mark(bytes).map_err(|e| e.to_string())?;
    let (mut rows, mut places) = (Vec::new(), BTreeMap::new());
    let filled = bytes.split(|b| *b == b'\n').zip(1_u64..).filter(|(line, _)| !line.trim_ascii().is_empty());
    for (line, number) in filled {
        let row = row_of(line).map_err(|reason| format!("line {number}: {reason}; {REMEDY}"))?;
        add(&mut rows, &mut places, row, format!("line {number}"), REMEDY)?;
    }
    Ok(rows)
}

/// Appends a row. Its place is what messages call it, such as "line 3", and what to do if it is wrong.
fn add(
    rows: &mut Vec<Row>,
    places: &mut BTreeMap<String, String>,
    row: Row,
    place: String,
    todo: &str,
) -> Result<(), String> {
    if let Some(earlier) = places.get(&row.id) {
        return Err(format!("{place}: `id` is {:?}, that of {earlier}; {todo}", row.id));
    }
    places.insert(row.id.clone(), place);
    rows.push(row);
    Ok(())
}

fn row_of(bytes: &[u8]) -> Result<Row, String> {
    let fields: Map<String, Value> = serde_json::from_slice(bytes).map_err(|e| format!("not a JSON object: {e}"))?;
    Row::new(fields)
}

fn of_folder(folder: &Path) -> Result<Vec<Row>, TableError> {
    let fail = |path: &Path, reason: String| TableError { path: path.into(), reason };
    let listed = std::fs::read_dir(folder).map_err(|e| fail(folder, e.to_string()))?;
    let mut files = Vec::new();
    for entry in listed {
        let file = entry.map_err(|e| fail(folder, e.to_string()))?.path();
        let hidden = file.file_name().and_then(|n| n.to_str()).is_some_and(|name| name.starts_with('.'));
        if !hidden && file.extension().is_some_and(|e| e == "json") {
            files.push(file);
        }
    }
    files.sort();
    if files.iter().any(|file| file.file_name().is_some_and(|name| name == "bench.json")) {
        let reason =
            "is a folder of `artgs bench`, whose tables are in BENCHMARKS.md; give the folder of `artgs batch`";
        return Err(fail(folder, reason.into()));
    }
    let (mut rows, mut wrong) = (Vec::new(), None);
    for file in files {
        let bytes = std::fs::read(&file).map_err(|e| fail(&file, e.to_string()))?;
        match row_of(&bytes) {
            Ok(row) => rows.push(row),
            Err(reason) => wrong = wrong.or(Some((file, reason))),
        }
    }
    let is_rows = folder.file_name().is_some_and(|name| name == "rows");
    match wrong {
        None if !rows.is_empty() => Ok(rows),
        None if is_rows => Err(fail(
            folder,
            "there is no row in it; give the folder of `artgs batch` or `artgs bench population`".into(),
        )),
        None => Err(fail(folder, format!("{NEITHER}: there is no row in it"))),
        Some((file, reason)) if rows.is_empty() => {
            let name = file.file_name().unwrap_or_default().display();
            Err(fail(folder, format!("{NEITHER}: no file in it is a row; {name}: {reason}")))
        }
        Some((file, reason)) => {
            Err(fail(&file, format!("{reason}; {}", if is_rows { ROW_REMEDY } else { OTHER_REMEDY })))
        }
    }
}

thread_local! {
    /// True while Parquet is read on this thread.
    static READING: Cell<bool> = const { Cell::new(false) };
}

/// True on a thread that reads Parquet: a panic there means that the file is damaged, and is no error of the program.
pub fn is_reading() -> bool {
    READING.get()
}

/// What to do about a wrong table of `artgs.ray`.
const TABLE: &str = "write the table again with `artgs.ray.reconstruct`";

/// What `read` returns, or that the file is damaged if it panics: the crate asserts what a damaged file may violate. `remedy` says what
/// to do then.
pub(crate) fn guarded<T>(read: impl FnOnce() -> Result<T, String>, remedy: &str) -> Result<T, String> {
    READING.set(true);
    let read = catch_unwind(AssertUnwindSafe(read));
    READING.set(false);
    read.unwrap_or_else(|_| Err(format!("cannot be read as Parquet: the file is damaged; {remedy}")))
}

/// Rows of the table of `artgs.ray`.
fn of_parquet(path: &Path) -> Result<Vec<Row>, String> {
    guarded(|| parquet_rows(path), TABLE)
}

fn parquet_rows(path: &Path) -> Result<Vec<Row>, String> {
    let (mut rows, mut places) = (Vec::new(), BTreeMap::new());
    for (fields, number) in parquet_fields(path, TABLE)?.into_iter().zip(1_u64..) {
        let row = Row::new(fields).map_err(|reason| format!("row {number}: {reason}; {TABLE}"))?;
        add(&mut rows, &mut places, row, format!("row {number}"), TABLE)?;
    }
    Ok(rows)
}

/// The columns of every row of a Parquet file by name, lists included; to be called in [`guarded`].
pub(crate) fn parquet_fields(path: &Path, remedy: &str) -> Result<Vec<Map<String, Value>>, String> {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    let wrong = |error: parquet::errors::ParquetError| format!("cannot be read as Parquet: {error}; {remedy}");
    let file = std::fs::File::open(path).map_err(|e| e.to_string())?;
    let reader = SerializedFileReader::new(file).map_err(wrong)?;
    let mut rows = Vec::new();
    for record in reader.get_row_iter(None).map_err(wrong)? {
        let record = record.map_err(wrong)?;
        rows.push(record.get_column_iter().map(|(name, field)| (name.clone(), json_of(field))).collect());
    }
    Ok(rows)
}

fn json_of(field: &parquet::record::Field) -> Value {
    use parquet::record::Field;
    match field {
        Field::Bool(value) => (*value).into(),
        Field::Byte(value) => (*value).into(),
        Field::Short(value) => (*value).into(),
        Field::Int(value) => (*value).into(),
        Field::Long(value) => (*value).into(),
        Field::UByte(value) => (*value).into(),
        Field::UShort(value) => (*value).into(),
        Field::UInt(value) => (*value).into(),
        Field::ULong(value) => (*value).into(),
        Field::Float(value) => f64::from(*value).into(),
        Field::Double(value) => (*value).into(),
        Field::Str(value) => value.clone().into(),
        Field::Group(row) => Value::Object(row.get_column_iter().map(|(n, f)| (n.clone(), json_of(f))).collect()),
        Field::ListInternal(list) => list.elements().iter().map(json_of).collect(),
        _ => Value::Null,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(name: &str, text: &str) -> Result<Vec<Row>, TableError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        read_rows(&path).map(|(rows, _)| rows)
    }

    #[test]
    fn wrong_lines_and_fields_are_named() {
        let good = "{\"id\": \"a\", \"status\": \"done\"}\n";
        for (name, text, words) in [
            ("t.jsonl", format!("{good}\n{{\"id\": \"b\", \"sta"), "t.jsonl: line 3: not a JSON object: EOF"),
            ("t.jsonl", format!("{good}{good}"), "line 2: `id` is \"a\", that of line 1; correct or remove it"),
            ("t.jsonl", format!("{good}[1]\n"), "line 2: not a JSON object"),
            ("t.jsonl", "{\"id\": \"a\", \"status\": \"done\", \"parts\": -1}".into(), "line 1: `parts` is -1"),
            ("t.jsonl", "\n\n".into(), "there is no row in it"),
            ("t.csv", good.into(), "is no table of results; give results.jsonl"),
            ("t.parquet", "PAR1".into(), "t.parquet: cannot be read as Parquet"),
            ("t.parquet", String::new(), "write the table again with `artgs.ray.reconstruct`"),
        ] {
            let error = read_text(name, &text).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn folders_are_read_in_the_order_of_their_files() {
        let folder = tempfile::tempdir().unwrap();
        let rows = folder.path().join("rows");
        std::fs::create_dir(&rows).unwrap();
        let empty = read_rows(folder.path()).unwrap_err().to_string();
        assert!(empty.contains("there is no row in it"), "{empty}");
        for id in ["b", "a"] {
            std::fs::write(rows.join(format!("{id}.json")), format!("{{\"id\": \"{id}\", \"status\": \"done\"}}"))
                .unwrap();
        }
        std::fs::write(rows.join(".c.json"), "unfinished").unwrap();
        for given in [folder.path(), &rows] {
            let (read, base) = read_rows(given).unwrap();
            let ids: Vec<&str> = read.iter().map(|row| row.id.as_str()).collect();
            assert_eq!((ids, base.as_path()), (vec!["a", "b"], folder.path()));
        }
        std::fs::write(rows.join("c.json"), "{\"id\": \"c\"}").unwrap();
        let error = read_rows(folder.path()).unwrap_err().to_string();
        assert!(error.contains("c.json: `status` is missing; remove the file"), "{error}");
    }

    #[test]
    fn files_of_other_folders_are_not_to_be_removed() {
        let root = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            artgs_io::write_atomic(&root.path().join(name), text.as_bytes()).unwrap();
            read_rows(root.path().join(name).parent().unwrap()).unwrap_err().to_string()
        };
        let row = "{\"id\": \"a\", \"status\": \"done\"}";
        for (name, text, words) in [
            ("capture/transforms.json", "{\"frames\": []}", "capture: is neither the folder of `artgs batch` nor that"),
            ("replica/replica.ply", "ply", "replica: is neither the folder of `artgs batch` nor that"),
            ("other/rows/x.json", "{}", "rows: is neither the folder of `artgs batch` nor that"),
            ("mixed/x.json", "{}", "x.json: `id` is missing"),
        ] {
            if name.starts_with("mixed") {
                artgs_io::write_atomic(&root.path().join("mixed/a.json"), row.as_bytes()).unwrap();
            }
            let error = write(name, text);
            assert!(error.contains(words) && !error.contains("remove"), "{error}");
        }
    }

    #[test]
    fn the_table_of_ray_has_the_same_rows() {
        let folder = tempfile::tempdir().unwrap();
        // Written by pyarrow with the schema of `artgs.ray`.
        let bytes = include_bytes!("fixtures/results.parquet");
        std::fs::write(folder.path().join("results.parquet"), bytes).unwrap();
        let (rows, _) = read_rows(folder.path()).unwrap();
        let lines = concat!(
            "{\"id\": \"a\", \"status\": \"done\", \"program\": \"0.1.0\", \"content\": \"c\", \"started\": 1700000000, \"seconds\": 12.5, ",
            "\"cpu_seconds\": 20.25, \"replica\": \"s3://lab/replicas/a\", \"parts\": 3, \"joints\": \"revolute prismatic\", ",
            "\"confidence\": 0.875, \"psnr\": 31.5, \"peak_memory_mib\": 512.0, \"warnings\": 0}\n",
            "{\"id\": \"b\", \"status\": \"failed\", \"reason\": \"the worker was lost: node 7\", \"retry\": true, \"program\": \"0.1.0\"}\n",
        );
        assert_eq!(rows, read_text("t.jsonl", lines).unwrap());
    }

    #[test]
    fn cut_and_altered_parquet_is_refused_or_read() {
        let bytes = include_bytes!("fixtures/results.parquet");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        for at in 0..bytes.len() {
            std::fs::write(&path, &bytes[..at]).unwrap();
            assert!(read_rows(&path).is_err(), "cut at {at}");
            let mut altered = bytes.to_vec();
            altered[at] ^= 0x55;
            std::fs::write(&path, &altered).unwrap();
            if let Err(error) = read_rows(&path) {
                assert!(error.reason.contains(TABLE), "{error}");
            }
        }
    }
}
