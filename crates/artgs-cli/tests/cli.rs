//! The program as its users meet it: exit codes, messages, streams.

use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use std::path::Path;
use std::process::{Command, Output};

fn artgs(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_artgs")).args(args).env_remove("NO_COLOR").output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn str(path: &Path) -> &str {
    path.to_str().expect("temporary paths are UTF-8")
}

#[test]
fn help_lists_the_commands_and_the_exit_codes() {
    let output = artgs(&["--help"]);
    assert_eq!(output.status.code(), Some(0));
    let help = text(&output.stdout);
    for word in ["inspect", "reconstruct", "evaluate", "demo", "Exit codes"] {
        assert!(help.contains(word), "{word} is missing:\n{help}");
    }
}

#[test]
fn wrong_usage_exits_2_and_says_what_is_wrong() {
    for (args, words) in [
        (&[][..], "Usage"),
        (&["conjure"], "conjure"),
        (&["reconstruct"], "CAPTURE"),
        (&["reconstruct", "x"], "--out"),
        (&["reconstruct", "x", "-o", "y", "--parts", "0"], "counts the static part"),
        (&["reconstruct", "x", "-o", "y", "--parts", "1"], "counts the static part"),
        (&["reconstruct", "x", "-o", "y", "--parts", "two"], "number of rigid parts"),
        (&["reconstruct", "x", "-o", "y", "--resume", "--force"], "--force"),
        (&["reconstruct", "x", "-o", "y", "--preset", "magic"], "default, paper, registration"),
        (&["reconstruct", "x", "-o", "y", "--parts", "2", "--variant", "magic"], "random-centres"),
        (&["reconstruct", "x", "-o", "y", "--parts", "2", "--schedule", "0.1"], "--preset paper"),
        (&["reconstruct", "x", "-o", "y", "--parts", "2", "--preset", "paper", "--schedule", "2"], "`schedule`"),
        (&["reconstruct", "x", "-o", "y", "--method", "registration", "--variant", "mlp"], "trains nothing"),
        (&["demo", "--threads", "0"], "--threads"),
        (&["evaluate", "x"], "--gt"),
        (&["evaluate", "x", "--gt", "y", "--lpips", "z"], "--capture"),
    ] {
        let output = artgs(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        let message = text(&output.stderr);
        assert!(message.contains(words), "{args:?}: {message}");
        assert!(!message.contains('\u{1b}'), "no colours into a pipe");
    }
}

#[test]
fn bad_input_exits_2_and_names_the_path() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("nowhere");
    let out = folder.path().join("out");
    for args in [
        &["inspect", str(&missing)][..],
        &["reconstruct", str(&missing), "-o", str(&out), "--parts", "2"],
        &["evaluate", str(&missing), "--gt", str(&missing)],
        &["demo", "-o", str(&out), "--config", str(&missing)],
    ] {
        let output = artgs(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", text(&output.stderr));
        assert!(text(&output.stderr).contains("nowhere"), "{args:?}: {}", text(&output.stderr));
    }
    let output = artgs(&["demo", "-o", str(&out), "--views", "0"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("`views`"), "{}", text(&output.stderr));
    assert!(!out.exists(), "nothing is made for input that cannot be used");
}

#[test]
fn foreign_folders_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("capture");
    std::fs::create_dir(&capture).unwrap();
    std::fs::write(capture.join("photo.jpg"), "x").unwrap();
    for force in [&[][..], &["--force"]] {
        let output = artgs(&[&["reconstruct", str(&capture), "-o", str(&capture), "--parts", "2"], force].concat());
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains("did not write"), "{}", text(&output.stderr));
        let output = artgs(&[&["demo", "-o", str(folder.path())], force].concat());
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains("other than a finished demo"), "{}", text(&output.stderr));
    }
    assert_eq!(std::fs::read_dir(&capture).unwrap().count(), 1);
    let photo = capture.join("photo.jpg");
    for (args, words) in [
        (&["demo", "-o", str(&capture)][..], "no demo wrote"),
        (&["demo", "-o", str(&photo)], "is a file"),
        (&["inspect", str(&photo)], "photo.jpg: is a file"),
        (&["evaluate", str(&photo), "--gt", str(&capture)], "photo.jpg: is a file"),
    ] {
        let output = artgs(args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(text(&output.stderr).contains(words), "{}", text(&output.stderr));
    }
    assert_eq!(std::fs::read_dir(&capture).unwrap().count(), 1);
}

#[test]
fn inspect_describes_a_cabinet_for_people_and_for_programs() {
    let folder = tempfile::tempdir().unwrap();
    let options = CabinetOptions { views: 5, test_views: 2, size: 48, ..CabinetOptions::default() };
    write_cabinet(folder.path(), &options).unwrap();
    let output = artgs(&["inspect", str(folder.path())]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let shown = text(&output.stdout);
    assert!(
        shown.contains("state end")
            && shown.contains("5 views, 48x48")
            && shown.contains("boxes share")
            && !shown.contains("warning"),
        "{shown}"
    );
    let output = artgs(&["inspect", "--json", str(folder.path())]);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["states"][1]["train"]["views"], 5);
    assert!(output.stderr.is_empty());
}
