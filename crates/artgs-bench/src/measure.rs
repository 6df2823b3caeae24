//! Numbers of a finished run: its own metrics, and scores against the ground truth.

use crate::record::{Measured, RunMetrics};
use artgs::evaluate::{Lpips, Scores, score_replica};
use artgs_io::recording::RecordingFormat;
use artgs_io::run_folder::load_json;
use artgs_io::{RunFolder, load_capture, write_atomic};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Measures the replica in the first folder against the ground truth of the capture in the second; the error says why
/// it cannot.
pub type Measure = Arc<dyn Fn(&Path, &Path) -> Result<Measured, String> + Send + Sync>;

/// Reads `metrics.json`, scores joints, surfaces and held-out views, and writes the scores to `scores.json`. Of a run that
/// stopped after discovery, it scores joints and labelled points.
pub fn measure(folder: &Path, capture: &Path, lpips: Option<&Lpips>) -> Result<Measured, String> {
    let run = RunFolder::new(folder);
    let truth = capture.join("gt");
    let (mut metrics, scores) = match run.has_replica() {
        true => (read_metrics(folder)?, artgs::run::evaluate(&run, &truth).map(Some)),
        false => (found_metrics(&run), artgs::run::evaluate_found(&run, &truth)),
    };
    let scores = scores.map_err(|e| format!("cannot be scored: {e}"))?.ok_or("the run left no result")?;
    let text = format!("{:#}\n", json!(scores));
    // JSON has no infinity: scores that cannot be read back are not finite.
    serde_json::from_str::<Scores>(&text).map_err(|e| format!("scores are not finite: {e}"))?;
    write_atomic(&run.scores(), text.as_bytes()).map_err(|e| e.to_string())?;
    // Recordings have no held-out views.
    if run.has_splats() && RecordingFormat::of_two_states(capture).is_none() {
        let views = load_capture(capture).map_err(|e| e.to_string())?;
        let pictures = score_replica(&run, &views, lpips).map_err(|e| format!("pictures cannot be scored: {e}"))?;
        for (test, seen) in metrics.test.iter_mut().zip(pictures) {
            if let (Some(test), Some(seen)) = (test, seen) {
                (test.flip, test.lpips) = (Some(seen.flip), seen.lpips);
            }
        }
    }
    Ok(Measured { metrics, scores })
}

/// The metrics of a run that stopped after discovery.
fn found_metrics(run: &RunFolder) -> RunMetrics {
    let times: BTreeMap<String, f64> = load_json(&run.stage_times()).ok().flatten().unwrap_or_default();
    let found = artgs::run::found_parts(run).unwrap_or_default();
    RunMetrics {
        parts: found.parts.len() + 1,
        total_seconds: times.values().sum(),
        seconds: times.into_iter().collect(),
        warnings: found.warnings,
        ..RunMetrics::default()
    }
}

/// The metrics that the run wrote.
pub(crate) fn read_metrics(folder: &Path) -> Result<RunMetrics, String> {
    let path = RunFolder::new(folder).metrics();
    let metrics = load_json(&path).map_err(|e| e.to_string())?;
    metrics.ok_or_else(|| format!("{}: there is no such file", path.display()))
}
