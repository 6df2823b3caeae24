//! One capture of a batch, as its row describes it.

use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Fields that are no scores.
const OTHERS: [&str; 5] = ["attempts", "started", "exit_code", "content", "source"];

/// What became of a capture. Fields that a row does not have are none or empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// Name in the manifest.
    pub id: String,
    /// True if there is a replica, false if the capture failed.
    pub done: bool,
    /// Why it failed.
    pub reason: String,
    /// True if the same command may succeed later.
    pub retry: bool,
    /// Version of the program.
    pub program: String,
    /// Hash of the capture and its options.
    pub content: String,
    /// Begin of the run, seconds since 1970.
    pub started: Option<f64>,
    /// Wall-clock time, seconds.
    pub seconds: Option<f64>,
    /// Time of all processors together, seconds.
    pub cpu_seconds: Option<f64>,
    /// Path or address of the replica.
    pub replica: Option<String>,
    /// Number of parts, the static one included.
    pub parts: Option<f64>,
    /// Joint types in the order of the parts, separated by blanks.
    pub joints: Option<String>,
    /// Least confidence of a joint, 0 to 1.
    pub confidence: Option<f64>,
    /// Largest resident memory, MiB.
    pub peak_memory_mib: Option<f64>,
    /// Number of warnings.
    pub warnings: Option<f64>,
    /// Every other number of the row by name: `psnr`, and what was added to the table. Those of an object have the names of both, such as
    /// `scores.axis`.
    pub scores: BTreeMap<String, f64>,
}

impl Row {
    /// A row from its JSON fields; or which one is wrong.
    pub(super) fn new(mut fields: Map<String, Value>) -> Result<Self, String> {
        let anything = (f64::NEG_INFINITY, f64::INFINITY);
        let positive = (0.0, f64::INFINITY);
        let id = text(&mut fields, "id")?.filter(|id| !id.is_empty()).ok_or("`id` is missing")?;
        let done = match text(&mut fields, "status")?.as_deref() {
            Some("done") => true,
            Some("failed") => false,
            Some(other) => return Err(format!("`status` is {other:?}, expected \"done\" or \"failed\"")),
            None => return Err("`status` is missing".into()),
        };
        let mut row = Self {
            id,
            done,
            reason: text(&mut fields, "reason")?.unwrap_or_default(),
            retry: flag(&mut fields, "retry")?,
            program: text(&mut fields, "program")?.unwrap_or_default(),
            content: text(&mut fields, "content")?.unwrap_or_default(),
            started: number(&mut fields, "started", positive)?,
            seconds: number(&mut fields, "seconds", positive)?,
            cpu_seconds: number(&mut fields, "cpu_seconds", positive)?,
            replica: text(&mut fields, "replica")?,
            parts: number(&mut fields, "parts", positive)?,
            joints: text(&mut fields, "joints")?,
            confidence: number(&mut fields, "confidence", (0.0, 1.0))?,
            peak_memory_mib: number(&mut fields, "peak_memory_mib", positive)?,
            warnings: number(&mut fields, "warnings", positive)?,
            scores: BTreeMap::new(),
        };
        number(&mut fields, "psnr", anything)?.and_then(|psnr| row.scores.insert("psnr".into(), psnr));
        fields.retain(|name, _| !OTHERS.contains(&name.as_str()));
        add_scores(&mut row.scores, "", &fields);
        Ok(row)
    }
}

fn add_scores(scores: &mut BTreeMap<String, f64>, before: &str, fields: &Map<String, Value>) {
    for (name, value) in fields {
        match value {
            Value::Number(number) => {
                number.as_f64().and_then(|number| scores.insert(format!("{before}{name}"), number));
            }
            Value::Object(inner) => add_scores(scores, &format!("{before}{name}."), inner),
            _ => {}
        }
    }
}

fn text(fields: &mut Map<String, Value>, name: &str) -> Result<Option<String>, String> {
    match fields.remove(name) {
        None | Some(Value::Null) => Ok(None),
        Some(Value::String(text)) => Ok(Some(text)),
        Some(other) => Err(format!("`{name}` is {other}, expected a text")),
    }
}

fn flag(fields: &mut Map<String, Value>, name: &str) -> Result<bool, String> {
    match fields.remove(name) {
        None | Some(Value::Null) => Ok(false),
        Some(Value::Bool(value)) => Ok(value),
        Some(other) => Err(format!("`{name}` is {other}, expected true or false")),
    }
}

fn number(fields: &mut Map<String, Value>, name: &str, (low, high): (f64, f64)) -> Result<Option<f64>, String> {
    let expected = |found: &Value| {
        let range = match (low.is_finite(), high.is_finite()) {
            (true, true) => format!(" from {low} to {high}"),
            (true, false) => format!(" of at least {low}"),
            _ => String::new(),
        };
        format!("`{name}` is {found}, expected a number{range}")
    };
    match fields.remove(name) {
        None | Some(Value::Null) => Ok(None),
        Some(value) => match value.as_f64() {
            Some(number) if (low..=high).contains(&number) => Ok(Some(number)),
            _ => Err(expected(&value)),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn row(value: Value) -> Result<Row, String> {
        Row::new(value.as_object().unwrap().clone())
    }

    #[test]
    fn numbers_that_are_not_of_artgs_are_scores() {
        let made = row(json!({
            "id": "a", "status": "done", "psnr": 31.5, "started": 17, "attempts": 2, "note": "x", "axis": 0.5,
            "scores": { "joints": { "angle": 2, "each": [1, 2] }, "name": "y" }, "confidence": null
        }))
        .unwrap();
        let scores: Vec<(&str, f64)> = made.scores.iter().map(|(name, value)| (name.as_str(), *value)).collect();
        assert_eq!(scores, [("axis", 0.5), ("psnr", 31.5), ("scores.joints.angle", 2.0)]);
        assert_eq!((made.done, made.confidence, made.started), (true, None, Some(17.0)));
    }

    #[test]
    fn wrong_fields_are_named() {
        for (value, words) in [
            (json!({ "status": "done" }), "`id` is missing"),
            (json!({ "id": "a" }), "`status` is missing"),
            (json!({ "id": "a", "status": "running" }), "`status` is \"running\", expected \"done\""),
            (
                json!({ "id": "a", "status": "done", "seconds": "3" }),
                "`seconds` is \"3\", expected a number of at least 0",
            ),
            (
                json!({ "id": "a", "status": "done", "confidence": 1.5 }),
                "`confidence` is 1.5, expected a number from 0 to 1",
            ),
            (json!({ "id": "a", "status": "failed", "retry": "no" }), "`retry` is \"no\", expected true or false"),
            (json!({ "id": 3, "status": "failed" }), "`id` is 3, expected a text"),
        ] {
            let error = row(value).unwrap_err();
            assert!(error.contains(words), "{error}");
        }
    }
}
