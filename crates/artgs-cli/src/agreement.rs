//! What the consistency check of `artgs` found, as errors, warnings and lines of `inspect`.

use crate::failure::Failure;
use artgs::consistency::{Consistency, Finding, StateConsistency, check_aligned, check_capture, check_recording};
use artgs_core::{Capture, PerState, Recording, State};
use std::path::Path;

/// Refuses a capture whose views or states contradict each other, and removes single views that contradict the others, unless
/// `forced`; warnings go to the capture.
pub(crate) fn require(capture: &mut Capture, forced: bool) -> Result<(), Failure> {
    let found = check_capture(capture);
    capture.warnings.extend(accepted(found.findings(), forced)?);
    for (state, own) in found.states.enumerate() {
        capture.states[state].train.retain(|view| forced || !own.ignores(&view.name));
    }
    Ok(())
}

/// Why the views of a state are refused, if they contradict each other.
pub(crate) fn refusal(capture: &Capture) -> Option<String> {
    let found = check_capture(capture);
    let alone = Consistency { across: None, across_shown: None, end_scale: None, copied: 0.0, ..found };
    let refused =
        alone.findings().into_iter().filter_map(|f| if let Finding::Refused(text) = f { Some(text) } else { None });
    refused.reduce(|all, text| all + "\n" + &text)
}

/// Refuses recordings whose frames contradict each other, and removes single ones, unless `forced`; warnings go to the recordings.
pub(crate) fn require_recordings(recordings: &mut PerState<Recording>, forced: bool) -> Result<(), Failure> {
    for state in State::ALL {
        let found = check_recording(recordings[state].frames.iter().map(|f| &f.view));
        let findings = found.findings(&format!("the recording of the {} state", state.name()));
        let warnings = accepted(findings, forced)?;
        recordings[state].warnings.extend(warnings);
        recordings[state].frames.retain(|frame| forced || !found.ignores(&frame.view.name));
    }
    Ok(())
}

/// Refuses aligned recordings of different objects, unless `forced`; warnings go to the capture.
pub(crate) fn require_one_object(capture: &mut Capture, forced: bool) -> Result<(), Failure> {
    capture.warnings.extend(accepted(check_aligned(capture), forced)?);
    Ok(())
}

/// Warnings, those of refusals included if they are `forced`.
fn accepted(findings: Vec<Finding>, forced: bool) -> Result<Vec<String>, Failure> {
    let refused = |f: &Finding| match f {
        Finding::Refused(text) => Some(format!("{}.", text.trim_end_matches('.'))),
        Finding::Warning(_) => None,
    };
    let refusals: Vec<String> = findings.iter().filter_map(refused).collect();
    if !refusals.is_empty() && !forced {
        let what = refusals.join("\n");
        return Err(Failure::bad(format!("{what}\n--force-input uses the capture as it is")));
    }
    Ok(findings
        .into_iter()
        .map(|f| match f {
            Finding::Refused(text) | Finding::Warning(text) => text,
        })
        .collect())
}

/// Lines of `inspect` about a capture.
pub(crate) fn described(found: &Consistency) -> String {
    let mut text = String::new();
    for (state, own) in found.states.enumerate() {
        text.push_str(&line(
            &format!("agreement {}", state.name()),
            own.agreement,
            "of the depth points agree between views",
        ));
    }
    text.push_str(&line("agreement of both", found.across, "of the surfaces agree between the states"));
    text.push_str(&findings(found.findings()));
    text
}

/// Lines of `inspect` about the recording at `path`.
pub(crate) fn described_recording(found: &StateConsistency, path: &Path) -> String {
    let share = line("agreement", found.agreement, "of the depth points agree between frames");
    share + &findings(found.findings(&path.display().to_string()))
}

/// True if `reconstruct` refuses what these were found in.
pub(crate) fn are_refusals(found: &[Finding]) -> bool {
    found.iter().any(|finding| matches!(finding, Finding::Refused(_)))
}

fn line(name: &str, share: Option<f64>, of_what: &str) -> String {
    share.map_or(String::new(), |s| format!("{name:<18}{:.0} % {of_what}\n", 100.0 * s))
}

fn findings(found: Vec<Finding>) -> String {
    let line = |f: Finding| match f {
        Finding::Refused(text) => format!("error: {text}\n"),
        Finding::Warning(text) => format!("warning: {text}\n"),
    };
    found.into_iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_of_a_refusal_end_with_a_full_stop() {
        let findings = ["select it by --box", "both are one."].map(|text| Finding::Refused(text.into()));
        let refused = accepted(findings.to_vec(), false).unwrap_err().to_string();
        assert_eq!(refused, "select it by --box.\nboth are one.\n--force-input uses the capture as it is");
        assert_eq!(accepted(findings.to_vec(), true).unwrap(), ["select it by --box", "both are one."]);
    }
}
