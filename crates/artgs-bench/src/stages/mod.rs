//! A measure for each stage of the published method, from what a run saved and the ground truth of its capture.
//!
//! A run never reads the ground truth; the measures are taken afterwards. `truth` says which part a place belongs to,
//! `measures` compares the decisions of a stage with it, `report` writes `stages.md` and `stages.html`.

mod measures;
mod report;
mod truth;

pub use measures::{Curve, StageMeasures, Value, measure_stages};
pub use report::write_stages;
