//! Names of files that are no text, or that would command a terminal.

use crate::case::Trials;
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;

/// A name that clears the screen and sets the title of a terminal.
const ESCAPES: &str = "a\u{1b}[2J\u{1b}]0;title\u{7}b";

#[test]
fn escape_codes_of_names_do_not_reach_the_terminal() {
    let mut trials = Trials::default();
    trials.run("in a path", "", &format!("inspect IN/{ESCAPES}"), 2, &["no such"], &|_| {});
    trials.run(
        "in an output",
        "tiny",
        &format!("reconstruct IN/none{ESCAPES} -o OUT{ESCAPES}"),
        2,
        &["no such"],
        &|_| {},
    );
    trials.run("in a value", "", &format!("reconstruct IN -o OUT --parts {ESCAPES}"), 2, &["--parts"], &|_| {});
    trials.run("in a command", "", ESCAPES, 2, &["unrecognized"], &|_| {});
    trials.run("in a format", "nerfstudio", &format!("inspect IN/start --format {ESCAPES}"), 2, &["--format"], &|_| {});
    let listed = |f: &crate::folder::Folder, value: &str| {
        f.json("transforms_train_start.json", |root| root["frames"][0]["file_path"] = value.into());
    };
    trials.run("in a listed image", "tiny", "reconstruct IN -o OUT", 2, &["file_path"], &|f| listed(f, ESCAPES));
    trials.run("text that is read from right to left", "tiny", "reconstruct IN -o OUT", 2, &["file_path"], &|f| {
        listed(f, "\u{202e}gnp.a")
    });
    trials.run("in a camera model", "tiny", "reconstruct IN -o OUT", 2, &["camera_model"], &|f| {
        f.json("transforms_train_start.json", |root| root["camera_model"] = ESCAPES.into());
    });
    trials.run("in a name of a part", "replica", "export IN --to urdf", 2, &["name"], &|f| {
        f.json("replica.json", |root| root["parts"][1]["name"] = ESCAPES.into());
    });
    trials.run("in a recording", "tum", "inspect IN/start", 2, &["rgb.txt"], &|f| {
        f.write("start/rgb.txt", format!("1000.0{ESCAPES} rgb/000000.png\n"));
    });
    trials.run("in a setting", "", "reconstruct IN -o OUT --config IN/c.toml", 2, &["c.toml"], &|f| {
        f.write("c.toml", format!("\"{}\" = 3\n", ESCAPES.replace('\u{1b}', "\\u001b").replace('\u{7}', "\\u0007")));
    });
    trials.finish();
}

#[test]
fn names_of_other_bytes_and_lengths() {
    let mut trials = Trials::default();
    trials.run("a long name", "", &format!("inspect IN/{}", "x".repeat(300)), 2, &["no such"], &|_| {});
    trials.run("a long path", "", &format!("inspect IN/{}", "x/".repeat(3000)), 2, &["no such"], &|_| {});
    trials.run("a space and quotation marks", "", "inspect IN/my~'first'~\"capture\"", 2, &["no such"], &|_| {});
    trials.run("bytes that are no UTF-8", "tiny", "inspect IN", 0, &["4 views"], &|f| {
        std::fs::write(f.path("").join(OsStr::from_bytes(b"x\xff\xfe.png")), "").unwrap();
    });
    trials.run("frames of other bytes", "scanner-app", "inspect IN/start", 0, &["5 of 5"], &|f| {
        std::fs::write(f.path("start").join(OsStr::from_bytes(b"frame_\xff.json")), "").unwrap();
    });
    trials.run(
        "an output with a long name",
        "tiny",
        &format!("reconstruct IN -o OUT{}", "x".repeat(300)),
        2,
        &["xxx"],
        &|_| {},
    );
    trials.finish();
}
