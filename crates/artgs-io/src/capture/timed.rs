//! Captures of ArtGS with both states in one camera file: frames belong to the state that their `time` names.

use super::json::{Object, read_object};
use artgs_core::State;
use serde_json::Value;
use std::path::Path;

/// The state of a frame by its `time`, 0 or 1.
fn state(frame: &Value) -> Option<State> {
    let time = frame.get("time")?.as_f64()?;
    State::ALL.into_iter().find(|state| (time - state.index() as f64).abs() < 1e-6)
}

/// True if all frames of `transforms_train.json` are of a state, and both states have some.
pub(super) fn is_capture(folder: &Path) -> bool {
    let path = folder.join("transforms_train.json");
    if !path.is_file() {
        return false;
    }
    let Ok(root) = read_object(&path, &path) else { return false };
    let Some(Value::Array(frames)) = root.get("frames") else { return false };
    let states: Option<Vec<State>> = frames.iter().map(state).collect();
    states.is_some_and(|states| State::ALL.iter().all(|state| states.contains(state)))
}

/// Keeps the frames of one state.
pub(super) fn keep(root: &mut Object, kept: State) {
    if let Some(Value::Array(frames)) = root.get_mut("frames") {
        frames.retain(|frame| state(frame) == Some(kept));
    }
}
