//! Values of JSON files.

use super::RecordingError;
use crate::capture::json::{Object, key_error, number};
use serde_json::Value;

/// A list of N finite numbers.
pub(super) fn numbers<const N: usize>(root: &Object, place: &str, key: &str) -> Result<[f64; N], RecordingError> {
    list(root.get(key)).ok_or_else(|| {
        let reason = format!("expected a list of {N} finite numbers; remove the frame or export the recording again");
        key_error(place, key, reason).into()
    })
}

/// N finite numbers of a JSON list.
pub(super) fn list<const N: usize>(value: Option<&Value>) -> Option<[f64; N]> {
    let list: Option<Vec<f64>> = value?.as_array()?.iter().map(Value::as_f64).collect();
    <[f64; N]>::try_from(list?).ok()
}

/// A finite number that must exist.
pub(super) fn needed(root: &Object, place: &str, key: &str) -> Result<f64, RecordingError> {
    let missing = || key_error(place, key, "is missing; add it or export the recording again");
    Ok(number(root, place, key)?.ok_or_else(missing)?)
}

/// Width and height under two keys, if both exist.
pub(super) fn size(root: &Object, place: &str, keys: [&str; 2]) -> Result<Option<(u32, u32)>, RecordingError> {
    let mut size = [0; 2];
    for (side, key) in size.iter_mut().zip(keys) {
        let Some(value) = number(root, place, key)? else { return Ok(None) };
        if !(1.0..=1e5).contains(&value) || value.fract() != 0.0 {
            return Err(key_error(place, key, format!("is {value}, must be a whole number of pixels")).into());
        }
        *side = value as u32;
    }
    Ok(Some((size[0], size[1])))
}

/// True for the pose of a frame in which the device did not know it: a matrix or list with `null` in it, or with nothing but zeros in its
/// first three numbers, which are a row of the rotation.
pub(super) fn is_lost_pose(value: &Value) -> bool {
    let mut cells = Vec::new();
    collect(value, &mut cells);
    let zeros = |from: usize| cells.get(from..from + 3).is_some_and(|row| row.iter().all(|c| c.as_f64() == Some(0.0)));
    cells.iter().any(|cell| cell.is_null()) || cells.len() >= 12 && zeros(0) && zeros(4)
}

fn collect<'a>(value: &'a Value, cells: &mut Vec<&'a Value>) {
    match value {
        Value::Array(list) => list.iter().for_each(|inner| collect(inner, cells)),
        cell => cells.push(cell),
    }
}
