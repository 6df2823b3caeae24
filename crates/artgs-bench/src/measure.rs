//! Numbers of a finished run: its own metrics, and scores against the ground truth.

use crate::record::{Measured, RunMetrics};
use artgs::evaluate::pictures::has_splats;
use artgs::evaluate::{Lpips, Scores, score_replica};
use artgs_io::{load_capture, write_atomic};
use serde_json::json;
use std::path::Path;
use std::sync::Arc;

/// Measures the replica in the first folder against the ground truth of the capture in the second; the error says why
/// it cannot.
pub type Measure = Arc<dyn Fn(&Path, &Path) -> Result<Measured, String> + Send + Sync>;

/// Reads `metrics.json`, scores joints, surfaces and held-out views, and writes the scores to `scores.json`.
pub fn measure(folder: &Path, capture: &Path, lpips: Option<&Lpips>) -> Result<Measured, String> {
    let mut metrics = read_metrics(folder)?;
    let scores = artgs::run::evaluate(folder, &capture.join("gt")).map_err(|e| format!("cannot be scored: {e}"))?;
    let text = format!("{:#}\n", json!(scores));
    // JSON has no infinity: scores that cannot be read back are not finite.
    serde_json::from_str::<Scores>(&text).map_err(|e| format!("scores are not finite: {e}"))?;
    write_atomic(&folder.join("scores.json"), text.as_bytes()).map_err(|e| e.to_string())?;
    if has_splats(folder) {
        let views = load_capture(capture).map_err(|e| e.to_string())?;
        let pictures = score_replica(folder, &views, lpips).map_err(|e| format!("pictures cannot be scored: {e}"))?;
        for (test, seen) in metrics.test.iter_mut().zip(pictures) {
            if let (Some(test), Some(seen)) = (test, seen) {
                (test.flip, test.lpips) = (Some(seen.flip), seen.lpips);
            }
        }
    }
    Ok(Measured { metrics, scores })
}

/// The metrics that the run wrote.
pub(crate) fn read_metrics(folder: &Path) -> Result<RunMetrics, String> {
    let path = folder.join("metrics.json");
    let bytes = std::fs::read(&path).map_err(|e| format!("{} cannot be read: {e}", path.display()))?;
    serde_json::from_slice(&bytes).map_err(|e| format!("{}: {e}", path.display()))
}
