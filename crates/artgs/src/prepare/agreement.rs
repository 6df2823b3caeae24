//! What the consistency check found, as errors and warnings; single views that contradict the others are removed.

use super::PrepareError;
use crate::consistency::{Consistency, Finding, check_capture, check_recording};
use artgs_core::{Capture, PerState, Recording, State};
use artgs_io::{CaptureError, CaptureOptions, load_capture_with};
use std::path::{Path, PathBuf};

/// Refuses a capture whose views or states contradict each other, and removes single views that contradict the others, unless
/// `forced`; warnings go to the capture.
pub(super) fn require(capture: &mut Capture, forced: bool) -> Result<(), PrepareError> {
    let found = check_capture(capture);
    capture.warnings.extend(accepted(found.findings(), forced)?);
    for (state, own) in found.states.enumerate() {
        capture.states[state].train.retain(|view| forced || !own.ignores(&view.name));
    }
    Ok(())
}

/// Refuses recordings whose frames contradict each other, and removes single ones, unless `forced`; warnings go to the recordings.
pub(super) fn require_recordings(
    recordings: &mut PerState<Recording>,
    paths: &PerState<PathBuf>,
    forced: bool,
) -> Result<(), PrepareError> {
    for state in State::ALL {
        let found = check_recording(recordings[state].frames.iter().map(|f| &f.view));
        let findings = found.findings(&paths[state].display().to_string());
        let warnings = accepted(findings, forced)?;
        recordings[state].warnings.extend(warnings);
        recordings[state].frames.retain(|frame| forced || !found.ignores(&frame.view.name));
    }
    Ok(())
}

/// Reads the capture in a folder. Where its states do not overlap because the poses or depths of one are wrong, the error says what
/// is wrong with them.
pub fn load_capture(folder: &Path, options: &CaptureOptions) -> Result<Capture, PrepareError> {
    load_capture_with(folder, options).map_err(|error| {
        let apart = CaptureOptions { apart: true, ..*options };
        let is_apart = matches!(error, CaptureError::NoOverlap(_));
        let capture = is_apart.then(|| load_capture_with(folder, &apart).ok()).flatten();
        let cause = capture.and_then(|capture| refusal(&capture));
        cause.map_or_else(|| error.into(), PrepareError::Apart)
    })
}

/// Why the views of a state are refused, if they contradict each other.
fn refusal(capture: &Capture) -> Option<String> {
    let found = check_capture(capture);
    let alone = Consistency { across: None, across_shown: None, end_scale: None, copied: 0.0, ..found };
    refusals(&alone.findings()).map(str::to_string).reduce(|all, text| all + "\n" + &text)
}

pub(super) fn refusals(findings: &[Finding]) -> impl Iterator<Item = &str> {
    findings.iter().filter_map(|finding| match finding {
        Finding::Refused(text) => Some(text.as_str()),
        Finding::Warning(_) => None,
    })
}

/// Warnings, those of refusals included if they are `forced`.
fn accepted(findings: Vec<Finding>, forced: bool) -> Result<Vec<String>, PrepareError> {
    let refused: Vec<String> = refusals(&findings).map(|text| format!("{}.", text.trim_end_matches('.'))).collect();
    if !refused.is_empty() && !forced {
        return Err(PrepareError::Contradiction(refused.join("\n")));
    }
    let text = |finding| match finding {
        Finding::Refused(text) | Finding::Warning(text) => text,
    };
    Ok(findings.into_iter().map(text).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_of_a_refusal_end_with_a_full_stop() {
        let findings = ["select it by --box", "both are one."].map(|text| Finding::Refused(text.into()));
        let refused = accepted(findings.to_vec(), false).unwrap_err().to_string();
        assert_eq!(refused, "select it by --box.\nboth are one.");
        assert_eq!(accepted(findings.to_vec(), true).unwrap(), ["select it by --box", "both are one."]);
    }
}
