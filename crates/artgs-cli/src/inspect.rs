//! `artgs inspect`: what a capture or recordings are, and what is wrong with them.

use crate::args::Inspect;
use crate::failure::Failure;
use crate::output::{Report, say};
use crate::recordings;
use crate::style::Style;
use crate::threads::use_threads;
use artgs::prepare::{self, Inspected};
use artgs_core::State;
use artgs_io::recording::RecordingFormat;
use serde_json::json;

/// Describes a capture, or each of one or two recordings.
pub(crate) fn run(args: &Inspect, style: Style) -> Result<(), Failure> {
    use_threads(args.threads)?;
    let inspected = inspected(args)?;
    match &inspected[..] {
        [one] if one.is_capture() => Report::new(one)?.show(style.json)?,
        all if style.json => say(format!("{:#}", json!(all)))?,
        all => all.iter().try_for_each(|one| say(format!("{}\n{one}", one.path().display())))?,
    }
    let refusals: Vec<String> = inspected.iter().flat_map(named_refusals).collect();
    if refusals.is_empty() {
        return if style.json { Ok(()) } else { say(verdict(&inspected, args)) };
    }
    Err(Failure::bad(format!("{}\nartgs reconstruct refuses this input", refusals.join("\n"))))
}

/// Why a run refuses it, with its name.
fn named_refusals(one: &Inspected) -> Vec<String> {
    let path = one.path().display();
    // Those of a recording begin with its name.
    let named = |text: String| if one.is_capture() { format!("{path}: {text}") } else { text };
    one.refusals().into_iter().map(named).collect()
}

/// Whether the input can be used, and the next command.
fn verdict(inspected: &[Inspected], args: &Inspect) -> String {
    let warnings: usize = inspected.iter().map(Inspected::warnings).sum();
    let usable = match warnings {
        0 => "usable".into(),
        1 => "usable, with the warning above".into(),
        n => format!("usable, with the {n} warnings above"),
    };
    let options = recordings::given_options(&args.recording);
    match inspected {
        [recording] if !recording.is_capture() => {
            let both = match &args.recording.poses[..] {
                // One file would be that of both recordings.
                [own] => options.replace(&format!("--poses {}", own.display()), "--poses CLOSED_POSES OPEN_POSES"),
                _ => options,
            };
            format!(
                "{usable}, as one state: record the other as well, then run artgs reconstruct CLOSED OPEN{both} -o OUT"
            )
        }
        _ => {
            let paths: Vec<String> = args.capture.iter().map(|path| path.display().to_string()).collect();
            let command = format!("artgs reconstruct {}{options} -o OUT", paths.join(" "));
            match inspected {
                [_, _] => format!("{usable}: {command} makes a replica if both show one object"),
                _ => format!("{usable}: {command} makes a replica"),
            }
        }
    }
}

/// The description of a capture, or of each recording; unlike a reconstruction, also of one recording.
fn inspected(args: &Inspect) -> Result<Vec<Inspected>, Failure> {
    if let [path] = &args.capture[..]
        && RecordingFormat::of(path).is_some()
        && !recordings::is_both_states(&args.capture, &args.recording)
    {
        let files = recordings::of_state(path, State::START, &args.recording)?;
        return Ok(vec![Inspected::recording(&files).map_err(Failure::of)?]);
    }
    prepare::inspect(&recordings::input(&args.capture, &args.recording)?).map_err(Failure::of)
}
