//! Writes an object of the population with its truth.

use super::record::{RandomCapture, RandomOptions, random_capture};
use super::undecidable::{self, Undecidable};
use super::{RandomObject, random_object, still_object};
use crate::recording::write_recorded_states;
use crate::replace::replace;
use crate::write::{GENERATOR, MARKER, StatePair, ground_truth, write_json, write_views};
use crate::{CaptureOptions, Object, SynthError};
use artgs_core::{JointKind, State};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::Path;

/// What a folder made by [`write_random`] holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RandomInfo {
    /// Seed of the object.
    pub random: u64,
    /// What it is, such as `chest`.
    pub category: String,
    /// Number of its parts, the static part included.
    pub parts: usize,
    /// Number of its states.
    pub states: usize,
    /// Nothing moves.
    #[serde(default)]
    pub still: bool,
    /// How it was recorded.
    pub capture: RandomCapture,
    /// False while it is being written.
    pub complete: bool,
}

/// The marker of a folder that [`write_random`] wrote or began to write; None for any other folder.
pub fn random_info(folder: &Path) -> Option<RandomInfo> {
    serde_json::from_slice(&std::fs::read(folder.join(MARKER)).ok()?).ok()
}

/// Draws the object of a seed, records it and writes capture or recordings into `folder`, the truth under `gt`. States after the end
/// are written beside it in the same layout as `state_2`, `state_3` and so on. An earlier capture of this function is kept if it is
/// complete and the same, else replaced.
pub fn write_random(seed: u64, options: &RandomOptions, folder: &Path) -> Result<RandomInfo, SynthError> {
    let states = options.states.unwrap_or(2);
    let drawn = if options.still { still_object(seed, states)? } else { random_object(seed, states)? };
    let (capture, mut features) = random_capture(seed, options);
    match &capture {
        RandomCapture::Exact(options) => options.check()?,
        RandomCapture::Room { options, .. } => options.check()?,
    }
    features.extend(drawn.features.iter().copied());
    let marker = |complete| RandomInfo {
        random: seed,
        category: drawn.category.into(),
        parts: drawn.object.parts.len(),
        states,
        still: options.still,
        capture,
        complete,
    };
    if random_info(folder) == Some(marker(true)) {
        return Ok(marker(true));
    }
    replace(
        folder,
        |complete| json!(marker(complete)),
        |new| {
            let (seen, object) = write_states(&drawn, &capture, new)?;
            write_truth(&drawn, &object, &capture, &features, &seen, new)
        },
    )?;
    Ok(marker(true))
}

/// Writes all states. Returns the number of depth pixels per state and part, and the object in the world of the truth.
fn write_states(
    drawn: &RandomObject,
    capture: &RandomCapture,
    folder: &Path,
) -> Result<(Vec<Vec<usize>>, Object), SynthError> {
    let (mut seen, mut placed) = (Vec::new(), drawn.object.clone());
    for first in (0..drawn.states()).step_by(2) {
        let last = (first + 1).min(drawn.states() - 1);
        let object = drawn.with_states(first, last);
        let states = if last > first { &State::ALL[..] } else { &State::ALL[..1] };
        match capture {
            RandomCapture::Exact(options) => {
                seen.extend(write_views(&object, options, StatePair(first), states, folder)?);
            }
            RandomCapture::Room { options, format } => {
                let (counts, in_world) =
                    write_recorded_states(folder, object, options, format.format(), StatePair(first), states)?;
                seen.extend(counts);
                if first == 0 {
                    placed = in_world;
                }
            }
        }
    }
    Ok((seen, placed))
}

/// Writes `gt/trans.json`.
fn write_truth(
    drawn: &RandomObject,
    object: &Object,
    capture: &RandomCapture,
    features: &BTreeSet<&'static str>,
    seen: &[Vec<usize>],
    folder: &Path,
) -> Result<(), SynthError> {
    let mut undecidable = undecidable::of_geometry(object, pixel(object, capture));
    undecidable.extend(undecidable::of_views(object, seen));
    let mut features = features.clone();
    features.extend(undecidable.iter().filter(|u| u.reason == undecidable::Reason::Revolution).map(|_| "symmetric"));
    let input = json!({ "generator": GENERATOR, "object": drawn.category, "random": object.seed, "capture": capture });
    let mut truth = ground_truth(object, input);
    if drawn.states() > 2 {
        // A pair of states holds the values of all states as further ones; the object as drawn holds each once.
        add_further(&drawn.object, &mut truth);
    }
    truth["population"] = json!({
        "seed": object.seed,
        "category": drawn.category,
        "sensor": capture.sensor(),
        "features": features,
        "undecidable": undecidable.iter().map(entry).collect::<Vec<_>>(),
        "states": drawn.states(),
        "pixels": seen,
    });
    Ok(write_json(&folder.join("gt/trans.json"), &truth)?)
}

/// An entry of `undecidable`; `parts` are what part masks hold.
fn entry(undecidable: &Undecidable) -> Value {
    let parts: Vec<usize> = undecidable.parts.iter().map(|part| part + 1).collect();
    json!({ "parts": parts, "reason": undecidable.reason, "why": undecidable.why })
}

/// Adds the values of joints in all states: degrees or scene units.
fn add_further(object: &Object, truth: &mut Value) {
    let moving = object.parts.iter().filter_map(|part| Some((part, part.joint?)));
    for (index, (part, joint)) in moving.enumerate() {
        let first = [joint.state_values[State::START], joint.state_values[State::END]];
        let unit = |v: f64| if joint.kind == JointKind::Prismatic { v } else { v.to_degrees() };
        let all: Vec<f64> = first.into_iter().chain(part.further.iter().copied()).map(unit).collect();
        truth["trans_info"][index]["states"] = json!(all);
    }
}

/// Width of a depth pixel at the middle of the object, metres.
fn pixel(object: &Object, capture: &RandomCapture) -> f64 {
    let (_, radius) = object.ball();
    match capture {
        // The image just holds the ball around the object.
        RandomCapture::Exact(CaptureOptions { size, .. }) => 2.1 * radius / f64::from(*size),
        // A person is about three radii away; depth images show about 60 degrees.
        RandomCapture::Room { options, .. } => {
            let (columns, _) = options.sensor.depth_size(options.width, options.height());
            3.0 * radius * 1.15 / f64::from(columns)
        }
    }
}
