//! Exports and their check.

use crate::case::{bad, check};
use crate::folder::Folder;

fn nothing(_: &Folder) {}

fn classes(list: &str) -> String {
    format!("{{\"format\": \"artgs-corrections\", \"version\": 1, \"classes\": [{list}]}}")
}

#[test]
fn options() {
    check(&[
        bad("an unknown format", "replica", "export IN --to step", &["step", "urdf"], nothing),
        bad("an empty format", "replica", "export IN --to=", &["--to"], nothing),
        bad("a known and an unknown format", "replica", "export IN --to urdf,dae", &["dae"], nothing),
        bad("a scale of 0", "replica", "export IN --scale 0", &["--scale", "a number from"], nothing),
        bad("a negative scale", "replica", "export IN --scale=-1", &["--scale"], nothing),
        bad("a scale of NaN", "replica", "export IN --scale nan", &["--scale"], nothing),
        bad("an infinite scale", "replica", "export IN --scale inf", &["--scale"], nothing),
        bad("a scale of text", "replica", "export IN --scale mm", &["--scale"], nothing),
        bad("a huge scale", "replica", "export IN --scale 1e30", &["--scale"], nothing),
        bad("a density of 0", "replica", "export IN --density 0", &["--density"], nothing),
        bad("a negative density", "replica", "export IN --density=-650", &["--density"], nothing),
        bad("a density of NaN", "replica", "export IN --density nan", &["--density"], nothing),
        bad("a huge density", "replica", "export IN --density 1e9", &["--density"], nothing),
        bad("a density of a part in words", "replica", "export IN --density part_1=oak", &["--density"], nothing),
        bad("a density of no part", "replica", "export IN --density wing=450", &["wing", "part_1"], nothing),
        bad("a texel of 0", "replica", "export IN --texel 0", &["--texel", "a number from"], nothing),
        bad("a mass of 0", "replica", "export IN --mass 0", &["--mass"], nothing),
        bad("no hulls", "replica", "export IN --hulls 0", &["--hulls"], nothing),
        bad("hulls in words", "replica", "export IN --hulls many", &["--hulls"], nothing),
        bad("no triangles", "replica", "export IN --triangles 0", &["--triangles"], nothing),
        bad("negative triangles", "replica", "export IN --triangles=-5", &["--triangles"], nothing),
        bad("an empty name", "replica", "export IN --name=", &["--name"], nothing),
        bad("a name of signs", "replica", "export IN --name ///", &["--name"], nothing),
        bad(
            "a name of 300 letters",
            "replica",
            "export IN --name xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx",
            &["--name"],
            nothing,
        ),
        bad("an unknown upward axis", "replica", "export IN --up w", &["--up"], nothing),
        bad("an unknown front", "replica", "export IN --front left", &["--front", "auto, x, -x"], nothing),
        bad("a front that is up", "replica", "export IN --front z", &["--front", "upward axis"], nothing),
        bad("an item without a number", "replica", "export IN --wikidata Qx", &["--wikidata", "Q42177"], nothing),
        bad("an author without a name", "replica", "export IN --author=", &["--author"], nothing),
        bad("a license without terms", "replica", "export IN --license=", &["--license"], nothing),
        bad("an actuator of another kind", "replica", "export IN --actuators servo", &["--actuators"], nothing),
        bad("a package with a slash", "replica", "export IN --package a/b", &["--package"], nothing),
        bad("a class of no part", "replica", "export IN", &["corrections.json", "classes[0]", "no part 9"], |f| {
            f.write("corrections.json", classes("{\"part\": 9, \"class\": \"door\"}"))
        }),
        bad("an unknown class", "replica", "export IN", &["corrections.json", "gate", "sliding_door"], |f| {
            f.write("corrections.json", classes("{\"part\": 1, \"class\": \"gate\"}"))
        }),
        bad("a class given twice", "replica", "export IN", &["corrections.json", "classes[1]"], |f| {
            let mark = "{\"part\": 1, \"class\": \"door\"}";
            f.write("corrections.json", classes(&format!("{mark}, {mark}")))
        }),
        bad("an unknown collision", "replica", "export IN --collision soft", &["--collision"], nothing),
        bad("photos that are missing", "replica", "export IN --capture IN/none", &["none"], nothing),
        bad("photos that are none", "replica", "export IN --capture IN/meshes", &["not a capture"], nothing),
        bad("no threads", "replica", "export IN --threads 0", &["--threads"], nothing),
        bad(
            "a capture in place of a replica",
            "tiny",
            "export IN",
            &["is a capture, not a replica", "artgs reconstruct"],
            nothing,
        ),
        bad(
            "a run that stopped",
            "found",
            "export IN/out",
            &["stopped before there was a replica", "--resume"],
            nothing,
        ),
        bad("exports that are a file", "replica", "export IN --to urdf", &["exports"], |f| f.write("exports", ""))
            .exits(1),
    ]);
}

#[test]
fn checks() {
    check(&[
        bad("a report of another kind", "replica", "check IN --report r.txt", &["--report", ".json or .html"], nothing),
        bad("no exports", "replica", "check IN", &["artgs export"], nothing),
        bad("no replica", "", "check IN", &["in"], nothing),
        bad("no folder", "", "check IN/none", &["none", "no such folder"], nothing),
        bad("a report that is empty", "replica", "check IN", &["artgs export"], |f| f.write("exports/export.json", "")),
        bad("a report that is cut", "replica", "check IN", &["artgs export"], |f| {
            f.write("exports/export.json", "{\"format\": ")
        }),
        bad("a report of another version", "replica", "check IN", &["artgs export"], |f| {
            f.write("exports/export.json", "{\"version\": 99}")
        }),
        bad("a report that is a list", "replica", "check IN", &["artgs export"], |f| {
            f.write("exports/export.json", "[]")
        }),
    ]);
}
