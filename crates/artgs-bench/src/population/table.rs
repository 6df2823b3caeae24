//! The rows as a table in Parquet, which data frames read: one row per object. What belongs to a found part is in columns of lists,
//! `axis_deg`, `position`, `motion`, `confidence`, `correct` and others, with one entry for each part.

use super::row::{JointRow, Row};
use parquet::basic::Compression;
use parquet::column::writer::ColumnWriterImpl;
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DataType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::parser::parse_message_type;
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// What a column holds.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Whole,
    Number,
    Flag,
    Text,
}

impl Kind {
    /// Its type in the schema, `NAME` standing for the name of the column.
    fn schema(self, name: &str) -> String {
        match self {
            Self::Whole => format!("INT64 {name}"),
            Self::Number => format!("DOUBLE {name}"),
            Self::Flag => format!("BOOLEAN {name}"),
            Self::Text => format!("BYTE_ARRAY {name} (STRING)"),
        }
    }
}

/// Fields of [`Row`].
const OF_OBJECT: [(&str, Kind); 23] = [
    ("seed", Kind::Whole),
    ("category", Kind::Text),
    ("sensor", Kind::Text),
    ("features", Kind::Text),
    ("status", Kind::Text),
    ("reason", Kind::Text),
    ("decidable", Kind::Flag),
    ("undecidable", Kind::Text),
    ("parts_true", Kind::Whole),
    ("parts_found", Kind::Whole),
    ("missing", Kind::Whole),
    ("extra", Kind::Whole),
    ("count_right", Kind::Flag),
    ("types_right", Kind::Flag),
    ("parents_right", Kind::Flag),
    ("right", Kind::Flag),
    ("joints_right", Kind::Flag),
    ("warnings", Kind::Whole),
    ("make_seconds", Kind::Number),
    ("seconds", Kind::Number),
    ("cpu_seconds", Kind::Number),
    ("peak_memory_mib", Kind::Number),
    ("program", Kind::Text),
];

/// Fields of [`JointRow`], columns of lists.
const OF_JOINTS: [(&str, Kind); 12] = [
    ("truth", Kind::Whole),
    ("kind", Kind::Text),
    ("kind_true", Kind::Text),
    ("overlap", Kind::Number),
    ("axis_deg", Kind::Number),
    ("position", Kind::Number),
    ("motion", Kind::Number),
    ("axis_of_interval", Kind::Number),
    ("position_of_interval", Kind::Number),
    ("motion_of_interval", Kind::Number),
    ("confidence", Kind::Number),
    ("correct", Kind::Flag),
];

/// Texts that are one field of [`Row`] each, separated by blanks.
const WORDS: [&str; 2] = ["features", "undecidable"];

/// A row as its columns.
fn flat(row: &Row) -> Map<String, Value> {
    let Value::Object(mut fields) = json!(row) else { return Map::new() };
    for name in WORDS {
        let words: Vec<&str> = fields[name].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        fields[name] = words.join(" ").into();
    }
    fields.remove("joints");
    let joints: Vec<Value> = row.joints.iter().map(|joint| json!(joint)).collect();
    for (name, _) in OF_JOINTS {
        fields.insert(name.into(), joints.iter().map(|joint| joint[name].clone()).collect());
    }
    fields
}

/// A row from its columns. Columns that are absent have their default, others are ignored.
pub(super) fn row_of(mut fields: Map<String, Value>) -> Result<Row, String> {
    for name in WORDS {
        if let Some(text) = fields.get(name).and_then(Value::as_str) {
            fields[name] = text.split_whitespace().collect();
        }
    }
    let lists: Vec<(&str, Vec<Value>)> = OF_JOINTS
        .iter()
        .filter_map(|(name, _)| match fields.remove(*name) {
            Some(Value::Array(list)) => Some((*name, list)),
            _ => None,
        })
        .collect();
    let count = lists.first().map_or(0, |(_, list)| list.len());
    if let Some((name, list)) = lists.iter().find(|(_, list)| list.len() != count) {
        return Err(format!("`{name}` has {} entries and `{}` has {count}", list.len(), lists[0].0));
    }
    let joint = |index: usize| -> Result<JointRow, String> {
        // None stands for a field with its default.
        let fields = lists.iter().filter(|(_, list)| !list[index].is_null());
        let fields: Map<String, Value> = fields.map(|(name, list)| ((*name).into(), list[index].clone())).collect();
        serde_json::from_value(fields.into()).map_err(|e| e.to_string())
    };
    let joints = (0..count).map(joint).collect::<Result<_, _>>()?;
    let row: Row = serde_json::from_value(fields.into()).map_err(|e| e.to_string())?;
    Ok(Row { joints, ..row })
}

/// The table as a file.
pub(super) fn parquet_bytes(rows: &[Row]) -> Result<Vec<u8>, String> {
    written(rows).map_err(|e| format!("the table cannot be written: {e}"))
}

fn written(rows: &[Row]) -> Result<Vec<u8>, ParquetError> {
    let rows: Vec<Map<String, Value>> = rows.iter().map(flat).collect();
    let schema = Arc::new(parse_message_type(&schema())?);
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for (index, (name, kind)) in OF_OBJECT.iter().chain(&OF_JOINTS).enumerate() {
        let Some(column) = group.next_column()? else { break };
        let cells = || rows.iter().map(|row| &row[*name]);
        if index < OF_OBJECT.len() {
            write_column(column, *kind, &cells().collect::<Vec<_>>(), None)?;
        } else {
            let lists = Lists::of(cells());
            write_column(column, *kind, &lists.values, Some((&lists.defined, &lists.repeated)))?;
        }
    }
    group.close()?;
    writer.into_inner()
}

fn schema() -> String {
    let plain = OF_OBJECT.iter().map(|(name, kind)| format!("REQUIRED {};", kind.schema(name)));
    let list = |(name, kind): &(&str, Kind)| {
        let element = kind.schema("element");
        format!("REQUIRED group {name} (LIST) {{ REPEATED group list {{ OPTIONAL {element}; }} }}")
    };
    let columns: Vec<String> = plain.chain(OF_JOINTS.iter().map(list)).collect();
    format!("message row {{ {} }}", columns.join(" "))
}

/// The entries of a column of lists, and the levels that say which of them is where.
#[derive(Default)]
struct Lists<'a> {
    /// Entries that are there.
    values: Vec<&'a Value>,
    /// 0: an empty list, 1: an entry that is none, 2: an entry.
    defined: Vec<i16>,
    /// 0: the first entry of a list, 1: a further one.
    repeated: Vec<i16>,
}

impl<'a> Lists<'a> {
    fn of(cells: impl Iterator<Item = &'a Value>) -> Self {
        let mut all = Self::default();
        for cell in cells {
            let entries = cell.as_array().map_or(&[][..], Vec::as_slice);
            if entries.is_empty() {
                all.defined.push(0);
                all.repeated.push(0);
            }
            for (index, entry) in entries.iter().enumerate() {
                all.defined.push(if entry.is_null() { 1 } else { 2 });
                all.repeated.push(i16::from(index > 0));
                all.values.extend(Some(entry).filter(|entry| !entry.is_null()));
            }
        }
        all
    }
}

type Levels<'a> = Option<(&'a [i16], &'a [i16])>;

fn write_column(
    mut column: SerializedColumnWriter<'_>,
    kind: Kind,
    values: &[&Value],
    levels: Option<(&Vec<i16>, &Vec<i16>)>,
) -> Result<(), ParquetError> {
    let levels: Levels<'_> = levels.map(|(defined, repeated)| (defined.as_slice(), repeated.as_slice()));
    let text = |v: &&Value| ByteArray::from(v.as_str().unwrap_or_default());
    match kind {
        Kind::Whole => put(column.typed::<Int64Type>(), values, levels, |v| v.as_i64().unwrap_or_default())?,
        Kind::Number => put(column.typed::<DoubleType>(), values, levels, |v| v.as_f64().unwrap_or(f64::NAN))?,
        Kind::Flag => put(column.typed::<BoolType>(), values, levels, |v| v.as_bool().unwrap_or_default())?,
        Kind::Text => put(column.typed::<ByteArrayType>(), values, levels, text)?,
    }
    column.close()
}

fn put<T: DataType>(
    writer: &mut ColumnWriterImpl<'_, T>,
    values: &[&Value],
    levels: Levels<'_>,
    read: impl Fn(&&Value) -> T::T,
) -> Result<(), ParquetError> {
    let values: Vec<T::T> = values.iter().map(read).collect();
    writer.write_batch(&values, levels.map(|l| l.0), levels.map(|l| l.1)).map(drop)
}
