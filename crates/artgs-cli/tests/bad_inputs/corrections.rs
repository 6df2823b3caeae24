//! Corrections of parts, by hand.

use crate::case::{bad, check};
use crate::folder::Folder;

const FILE: &str = "corrections.json";
/// Resumes with the capture of the run, which is beside it.
const RESUME: &str = "reconstruct IN/capture -o IN/out --resume --device cpu --stop-after discover";

fn with(f: &Folder, text: &str) {
    f.write(&format!("out/{FILE}"), text);
}

fn centres(f: &Folder, list: &str) {
    with(f, &format!("{{\"format\": \"artgs-corrections\", \"version\": 1, \"centres\": [{list}]}}"));
}

fn joints(f: &Folder, list: &str) {
    with(f, &format!("{{\"format\": \"artgs-corrections\", \"version\": 1, \"joints\": [{list}]}}"));
}

#[test]
fn files() {
    check(&[
        bad("empty", "found", RESUME, &[FILE, "correct the file or remove it"], |f| with(f, "")),
        bad("cut", "found", RESUME, &[FILE, "correct the file or remove it"], |f| with(f, "{\"format\": \"artgs-corr")),
        bad("a list", "found", RESUME, &[FILE], |f| with(f, "[]")),
        bad("not text", "found", RESUME, &[FILE], |f| f.write(&format!("out/{FILE}"), [0xff; 64])),
        bad("another format", "found", RESUME, &[FILE, "`format`", "expected"], |f| {
            with(f, "{\"format\": \"x\", \"version\": 1}")
        }),
        bad("version 99", "found", RESUME, &[FILE, "version 99"], |f| {
            with(f, "{\"format\": \"artgs-corrections\", \"version\": 99}")
        }),
        bad("an unknown key", "found", RESUME, &[FILE, "unknown field", "centers"], |f| {
            with(f, "{\"format\": \"artgs-corrections\", \"version\": 1, \"centers\": []}")
        }),
        bad("a folder", "found", RESUME, &[FILE], |f| f.write(&format!("out/{FILE}/x"), "")),
        bad("too many", "found", RESUME, &[FILE, "more than 256"], |f| {
            centres(f, &vec!["{\"action\": \"add\", \"position\": [0, 0, 0]}"; 300].join(","))
        }),
    ]);
}

#[test]
fn parts() {
    check(&[
        bad("a part that does not exist is deleted", "found", RESUME, &[FILE, "part 77"], |f| {
            centres(f, "{\"action\": \"delete\", \"part\": 77}")
        }),
        bad("a part that does not exist is moved", "found", RESUME, &[FILE, "part 77"], |f| {
            centres(f, "{\"action\": \"move\", \"part\": 77, \"position\": [0, 0, 0]}")
        }),
        bad("a merge into a part that does not exist", "found", RESUME, &[FILE, "part 77"], |f| {
            centres(f, "{\"action\": \"merge\", \"part\": 1, \"into\": 77}")
        }),
        bad("a merge with itself", "found", RESUME, &[FILE, "centres[0]", "part 1 into itself"], |f| {
            centres(f, "{\"action\": \"merge\", \"part\": 1, \"into\": 1}")
        }),
        bad("the static part", "found", RESUME, &[FILE, "part 0 is the static one"], |f| {
            centres(f, "{\"action\": \"delete\", \"part\": 0}")
        }),
        bad("a part is deleted twice", "found", RESUME, &[FILE, "centres[1]", "deleted or merged before"], |f| {
            centres(f, "{\"action\": \"delete\", \"part\": 1}, {\"action\": \"delete\", \"part\": 1}")
        }),
        bad("a negative part", "found", RESUME, &[FILE], |f| centres(f, "{\"action\": \"delete\", \"part\": -1}")),
        bad("half a part", "found", RESUME, &[FILE], |f| centres(f, "{\"action\": \"delete\", \"part\": 1.5}")),
        bad("an unknown action", "found", RESUME, &[FILE, "paint"], |f| {
            centres(f, "{\"action\": \"paint\", \"part\": 1}")
        }),
        bad("no action", "found", RESUME, &[FILE, "action"], |f| centres(f, "{\"part\": 1}")),
        bad("a position of two numbers", "found", RESUME, &[FILE], |f| {
            centres(f, "{\"action\": \"add\", \"position\": [0, 0]}")
        }),
        bad("a position of null", "found", RESUME, &[FILE], |f| {
            centres(f, "{\"action\": \"add\", \"position\": [0, 0, null]}")
        }),
        bad("a position of 1e999", "found", RESUME, &[FILE, "out of range"], |f| {
            centres(f, "{\"action\": \"add\", \"position\": [0, 0, 1e999]}")
        }),
        bad("a split without a plane", "found", RESUME, &[FILE, "either a `plane` or `points`"], |f| {
            centres(f, "{\"action\": \"split\", \"part\": 1}")
        }),
        bad("a split of both kinds", "found", RESUME, &[FILE, "either a `plane` or `points`"], |f| {
            centres(
                f,
                "{\"action\": \"split\", \"part\": 1, \"plane\": {\"point\": [0,0,0], \"normal\": [0,0,1]}, \"points\": [[0,0,0]]}",
            )
        }),
        bad("a plane without a normal", "found", RESUME, &[FILE, "`normal` has no direction"], |f| {
            centres(f, "{\"action\": \"split\", \"part\": 1, \"plane\": {\"point\": [0,0,0], \"normal\": [0,0,0]}}")
        }),
        bad("a joint of a part that does not exist", "found", RESUME, &[FILE, "part 77"], |f| {
            joints(f, "{\"part\": 77, \"type\": \"revolute\"}")
        }),
        bad("a joint of the static part", "found", RESUME, &[FILE, "joints[0]"], |f| {
            joints(f, "{\"part\": 0, \"type\": \"revolute\"}")
        }),
        bad("two joints of a part", "found", RESUME, &[FILE, "joints[1]"], |f| {
            joints(f, "{\"part\": 1, \"type\": \"revolute\"}, {\"part\": 1, \"type\": \"prismatic\"}")
        }),
        bad("an unknown type", "found", RESUME, &[FILE, "ball"], |f| joints(f, "{\"part\": 1, \"type\": \"ball\"}")),
        bad("an axis of zero", "found", RESUME, &[FILE, "`axis` has no direction"], |f| {
            joints(f, "{\"part\": 1, \"type\": \"revolute\", \"joint\": {\"axis\": [0,0,0], \"origin\": [0,0,0]}}")
        }),
    ]);
}
