//! What a made object truly is: its description as a member of the population, and where its meshes are.

use artgs_core::Mesh;
use artgs_io::run_folder::load_json;
use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// The key `population` of `gt/trans.json`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default)]
pub(super) struct Description {
    /// Seed of the object.
    pub(super) seed: u64,
    /// What it is, such as `cabinet`.
    pub(super) category: String,
    /// `exact`, or the device of the room.
    pub(super) sensor: String,
    /// Properties that results are grouped by.
    pub(super) features: Vec<String>,
    /// What the views cannot decide.
    pub(super) undecidable: Vec<Undecidable>,
}

/// Something that the views of an object cannot decide.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(default)]
pub(super) struct Undecidable {
    /// The parts, as `part_id` in `gt/trans.json`.
    pub(super) parts: Vec<u64>,
    /// `equal-motion`, `unseen` or `revolution`.
    pub(super) reason: String,
    /// The same as a sentence.
    pub(super) why: String,
}

impl Description {
    /// Why the views cannot decide between the truth and another answer: each reason once, sorted.
    pub(super) fn reasons(&self) -> Vec<String> {
        let mut reasons: Vec<String> = self.undecidable.iter().map(|u| u.reason.clone()).collect();
        reasons.sort();
        reasons.dedup();
        reasons
    }

    /// Reads the description of a capture. Objects without one have the name of the object as category.
    pub(super) fn load(capture: &Path) -> Result<Self, String> {
        let path = capture.join("gt/trans.json");
        let truth: Value = load_json(&path).map_err(|e| e.to_string())?.unwrap_or_default();
        let wrong = |e: serde_json::Error| format!("{}: key `population`: {e}", path.display());
        let mut found: Self = match truth.get("population") {
            Some(value) => serde_json::from_value(value.clone()).map_err(wrong)?,
            None => Self::default(),
        };
        if found.category.is_empty() {
            found.category = truth["input"]["object"].as_str().unwrap_or_default().into();
        }
        found.features.sort();
        found.features.dedup();
        Ok(found)
    }
}

/// Lower and upper corner of the box around a mesh; both the origin if it has no vertices.
pub(super) fn corners(mesh: &Mesh) -> [DVec3; 2] {
    let points = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from)));
    let around = points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| [low.min(p), high.max(p)]);
    if around[0].is_finite() { around } else { [DVec3::ZERO; 2] }
}

/// Centre of the box around a mesh.
pub(super) fn middle(mesh: &Mesh) -> DVec3 {
    let [low, high] = corners(mesh);
    0.5 * (low + high)
}

/// Diagonal of the box around a mesh.
pub(super) fn diagonal(mesh: &Mesh) -> f64 {
    let [low, high] = corners(mesh);
    low.distance(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn description(trans: &Value) -> Result<Description, String> {
        let capture = tempfile::tempdir().unwrap();
        artgs_io::write_atomic(&capture.path().join("gt/trans.json"), trans.to_string().as_bytes()).unwrap();
        Description::load(capture.path())
    }

    #[test]
    fn descriptions_are_read_and_objects_without_one_have_their_name() {
        let undecidable = |reason: &str| json!({ "parts": [2, 3], "reason": reason, "why": "They move alike." });
        let population = json!({ "seed": 17, "category": "cabinet", "sensor": "lidar", "features": ["b", "a", "b"],
            "undecidable": [undecidable("unseen"), undecidable("equal-motion"), undecidable("unseen")] });
        let found = description(&json!({ "trans_info": [], "population": population })).unwrap();
        assert_eq!((found.seed, &*found.category, &*found.sensor), (17, "cabinet", "lidar"));
        assert_eq!((found.features.join(" "), found.reasons().join(" ")), ("a b".into(), "equal-motion unseen".into()));
        assert_eq!(found.undecidable[0].parts, [2, 3]);
        assert_eq!(description(&json!({ "input": { "object": "fridge2" } })).unwrap().category, "fridge2");
        let wrong = description(&json!({ "population": { "seed": "x" } })).unwrap_err();
        assert!(wrong.contains("key `population`"), "{wrong}");
    }
}
