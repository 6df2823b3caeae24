//! `artgs inspect`: what a capture or recordings are, and what is wrong with them.

use crate::args::Inspect;
use crate::failure::Failure;
use crate::output::{Report, say};
use crate::recordings;
use crate::style::Style;
use artgs::prepare::{self, Inspected};
use artgs_core::State;
use artgs_io::recording::RecordingFormat;
use serde_json::json;

/// Describes a capture, or each of one or two recordings.
pub(crate) fn run(args: &Inspect, style: Style) -> Result<(), Failure> {
    let inspected = inspected(args)?;
    match &inspected[..] {
        [one] if one.is_capture() => Report::new(one)?.show(style.json)?,
        all if style.json => say(format!("{:#}", json!(all)))?,
        all => all.iter().try_for_each(|one| say(format!("{}\n{one}", one.path().display())))?,
    }
    let refused: Vec<String> =
        inspected.iter().filter(|one| one.is_refused()).map(|one| one.path().display().to_string()).collect();
    if refused.is_empty() {
        return Ok(());
    }
    Err(Failure::bad(format!("{}: artgs reconstruct refuses this input for the errors above", refused.join(" and "))))
}

/// The description of a capture, or of each recording; unlike a reconstruction, also of one recording.
fn inspected(args: &Inspect) -> Result<Vec<Inspected>, Failure> {
    if let [path] = &args.capture[..]
        && RecordingFormat::of(path).is_some()
    {
        let files = recordings::of_state(path, State::START, &args.recording)?;
        return Ok(vec![Inspected::recording(&files).map_err(Failure::of)?]);
    }
    prepare::inspect(&recordings::input(&args.capture, &args.recording)?).map_err(Failure::of)
}
