//! Camera files as JSON values, with errors that name file, frame and key.

use super::CaptureError;
use crate::without_mark;
use glam::{DMat3, DVec3};
use serde_json::{Map, Value};
use std::path::Path;

/// A JSON object.
pub(crate) type Object = Map<String, Value>;

/// Parses a camera file; `shown` is its name in messages. Python's `NaN` and `Infinity`, which are not JSON, become
/// `null`, so that the error can name the frame.
pub(crate) fn read_object(path: &Path, shown: &Path) -> Result<Object, CaptureError> {
    let bytes = std::fs::read(path).map_err(|source| CaptureError::Unreadable { file: shown.into(), source })?;
    object_of_bytes(&bytes, shown)
}

/// Parses the bytes of a camera file, as [`read_object`] does.
pub(crate) fn object_of_bytes(bytes: &[u8], shown: &Path) -> Result<Object, CaptureError> {
    let wrong = |reason: &str| CaptureError::Json { file: shown.into(), line: 1, column: 1, reason: reason.into() };
    let text = null_for_not_finite(without_mark(bytes).map_err(wrong)?);
    let value: Value = serde_json::from_slice(&text).map_err(|e| CaptureError::Json {
        file: shown.into(),
        line: e.line(),
        column: e.column(),
        reason: e.to_string(),
    })?;
    match value {
        Value::Object(object) => Ok(object),
        _ => Err(wrong("expected an object `{...}`")),
    }
}

/// Replaces `NaN`, `Infinity` and `-Infinity` outside strings by `null` padded to the same length.
fn null_for_not_finite(bytes: &[u8]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    let (mut i, mut quoted) = (0, false);
    while i < out.len() {
        match out[i] {
            b'"' => quoted = !quoted,
            b'\\' if quoted => i += 1,
            b'N' | b'I' | b'-' if !quoted => {
                let rest = &out[i..];
                let word = [&b"-Infinity"[..], b"Infinity", b"NaN"].into_iter().find(|w| rest.starts_with(w));
                if let Some(word) = word {
                    let null = if word == b"NaN" { &b"null"[..] } else { b"null     " };
                    let end = i + word.len();
                    out.splice(i..end, null.iter().copied());
                    i += 3;
                }
            }
            _ => {}
        }
        i += 1;
    }
    out
}

/// A [`CaptureError::Key`].
pub(crate) fn key_error(place: &str, key: &str, reason: impl Into<String>) -> CaptureError {
    CaptureError::Key { place: place.into(), key: key.into(), reason: reason.into() }
}

/// A finite number, if the key exists.
pub(crate) fn number(object: &Object, place: &str, key: &str) -> Result<Option<f64>, CaptureError> {
    match object.get(key) {
        None => Ok(None),
        Some(value) => match value.as_f64() {
            Some(v) => Ok(Some(v)),
            None => Err(key_error(place, key, format!("expected a finite number, found {}", kind(value)))),
        },
    }
}

/// A finite number above zero, if the key exists.
pub(crate) fn positive(object: &Object, place: &str, key: &str) -> Result<Option<f64>, CaptureError> {
    match number(object, place, key)? {
        Some(v) if v <= 0.0 => Err(key_error(place, key, format!("is {v}, must be above 0"))),
        v => Ok(v),
    }
}

/// A string, if the key exists.
pub(crate) fn text<'a>(object: &'a Object, place: &str, key: &str) -> Result<Option<&'a str>, CaptureError> {
    match object.get(key) {
        None => Ok(None),
        Some(Value::String(s)) => Ok(Some(s)),
        Some(value) => Err(key_error(place, key, format!("expected a string, found {}", kind(value)))),
    }
}

/// An N x N matrix of finite numbers, row-major.
pub(crate) fn matrix<const N: usize>(value: &Value, place: &str, key: &str) -> Result<[[f64; N]; N], CaptureError> {
    let shape = || key_error(place, key, format!("expected a {N}x{N} matrix as {N} rows of {N} numbers"));
    let rows = value.as_array().filter(|r| r.len() == N).ok_or_else(shape)?;
    let mut out = [[0.0; N]; N];
    for (i, row) in rows.iter().enumerate() {
        let row = row.as_array().filter(|r| r.len() == N).ok_or_else(shape)?;
        for (j, cell) in row.iter().enumerate() {
            out[i][j] = match cell {
                Value::Number(n) => n.as_f64().filter(|v| v.is_finite()).ok_or_else(shape)?,
                Value::Null => {
                    let reason = format!("row {i}, column {j} is not a finite number; remove or repair the frame");
                    return Err(key_error(place, key, reason));
                }
                _ => return Err(shape()),
            };
        }
    }
    Ok(out)
}

/// The upper left 3x3 block and the last column of a 4x4 matrix.
pub(crate) fn block_and_column(m: &[[f64; 4]; 4]) -> (DMat3, DVec3) {
    let column = |c: usize| DVec3::new(m[0][c], m[1][c], m[2][c]);
    (DMat3::from_cols(column(0), column(1), column(2)), column(3))
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null, NaN or infinity",
        Value::Bool(_) => "a truth value",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_bare_words_become_null() {
        let text = br#"{"NaN\" -Infinity": [NaN, -Infinity, Infinity,-1, "NaN"]}"#;
        let value: Value = serde_json::from_slice(&null_for_not_finite(text)).unwrap();
        assert_eq!(value, serde_json::json!({"NaN\" -Infinity": [null, null, null, -1, "NaN"]}));
    }
}
