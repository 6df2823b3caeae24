//! The program as its users meet it: exit codes, messages, streams.

use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use std::path::Path;
use std::process::{Command, Output};

fn artgs(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_artgs"))
        .args(args)
        .env_remove("NO_COLOR")
        .env_remove("XDG_RUNTIME_DIR")
        .output()
        .expect("the program starts")
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
        (&["reconstruct", "x", "-o", "y", "--parts", "two"], "`two` is not a number of parts"),
        (&["reconstruct", "x", "-o", "y", "--parts", "8..3"], "least number"),
        (&["reconstruct", "x", "-o", "y", "--preset", "paper"], "--preset paper needs --parts K"),
        (&["reconstruct", "x", "-o", "y", "--preset", "registration", "--parts", "2..4"], "needs --parts K"),
        (&["reconstruct", "x", "-o", "y", "--resume", "--force"], "--force"),
        (&["reconstruct", "x", "-o", "y", "--preset", "magic"], "default, paper, registration"),
        (&["reconstruct", "x", "-o", "y", "--parts", "2", "--variant", "magic"], "random-centres"),
        (&["reconstruct", "x", "-o", "y", "--parts", "2", "--schedule", "0.1"], "--preset paper"),
        (
            &["reconstruct", "x", "-o", "y", "--parts", "2", "--preset", "paper", "--schedule", "2"],
            "schedule = 2: must be",
        ),
        (&["reconstruct", "x", "-o", "y", "--method", "registration", "--variant", "mlp"], "trains nothing"),
        (&["reconstruct", "x", "-o", "y", "--box", "0,0,0,1,1,1"], "x is one capture, whose masks select it"),
        (&["reconstruct", "a", "b", "-o", "y", "--box", "-1,0,0,1,1"], "--box -1,0,0,1,1: a box is six numbers"),
        (
            &["reconstruct", "a", "b", "-o", "y", "--box", "-1,0,0,1,0,1"],
            "the upper y (0) must be above the lower one (0)",
        ),
        (&["reconstruct", "a", "b", "-o", "y", "--box", "0,0,0,1,1,inf"], "`inf` is not a finite number"),
        (
            &["reconstruct", "a", "b", "-o", "y", "--box", "absent.json"],
            "--box absent.json: cannot be read: No such file or directory (os error 2); give six numbers",
        ),
        (&["view", "absent"], "give a replica, a capture or a recording"),
        (&["view", "tests", "--frames", "3"], "--frames is for a recording of one state, and tests is none"),
        (&["view", "tests", "--save-box", "x"], "--save-box is for a recording of one state, and tests is none"),
        (&["demo", "--threads", "0"], "--threads"),
        (&["export", "x", "--scale", "1e30"], "a number from"),
        (&["export", "x", "--scale", "nan"], "a number from"),
        (&["export", "x", "--density", "1e300"], "a number from"),
        (&["demo", "--device", "cuda"], "auto, cpu, gpu, or gpu:N"),
        (&["reconstruct", "x", "-o", "y", "--parts", "2", "--device", "gpu:9999"], "graphics processor"),
        (&["bench", "fridge", "-o", "y", "--device", "gpu:9999"], "graphics processor"),
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
fn settings_are_listed_and_checked_before_any_work() {
    let shown = text(&artgs(&["settings"]).stdout);
    assert!(shown.lines().any(|l| l == "discover.rounds = 3  (0 to 100, rounds)"), "{shown}");
    let paper: serde_json::Value =
        serde_json::from_slice(&artgs(&["settings", "--preset", "paper", "--json"]).stdout).unwrap();
    let steps = paper["settings"].as_array().unwrap().iter().find(|s| s["setting"] == "single.steps").unwrap();
    assert_eq!(steps["value"], 10_000);

    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (folder.path().join("wrong.toml"), folder.path().join("out"));
    for (setting, words) in [
        ("[articulate.loss]\nssim = nan\n", "[articulate.loss] ssim = nan: must be from 0 to 1 (share)"),
        ("[articulate]\nsteps = -3\n", "[articulate] steps = -3: must be a whole number from 0"),
        ("[surface]\nno_such_key = 1\n", "no_such_key"),
    ] {
        std::fs::write(&file, setting).unwrap();
        let output = artgs(&["demo", "-o", str(&out), "--config", str(&file)]);
        assert_eq!(output.status.code(), Some(2));
        assert!(text(&output.stderr).contains(words), "{}", text(&output.stderr));
        assert!(!out.exists());
    }
}

/// The program on a machine without any driver.
fn without_drivers(args: &[&str]) -> Output {
    let nowhere = "/nonexistent/driver.json";
    let mut command = Command::new(env!("CARGO_BIN_EXE_artgs"));
    command.args(args).env("VK_DRIVER_FILES", nowhere).env("VK_ICD_FILENAMES", nowhere);
    command.output().expect("the program starts")
}

#[test]
fn devices_are_listed_with_and_without_drivers() {
    for output in [artgs(&["devices"]), artgs(&["devices", "--json"]), without_drivers(&["devices"])] {
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let shown = text(&output.stdout);
        assert!(shown.contains("cpu") && shown.contains("thread"), "{shown}");
        assert!(!text(&output.stderr).contains("XDG_RUNTIME_DIR"), "{}", text(&output.stderr));
    }
    let json: serde_json::Value = serde_json::from_slice(&artgs(&["devices", "--json"]).stdout).unwrap();
    for (index, adapter) in json["adapters"].as_array().unwrap().iter().enumerate() {
        assert_eq!(adapter["index"].as_u64(), Some(index as u64));
        assert!(adapter["name"].as_str().is_some_and(|name| !name.is_empty()), "{adapter}");
    }
}

/// Drivers of other systems are not found through files that a variable could hide.
#[cfg(target_os = "linux")]
#[test]
fn without_a_driver_the_processor_trains_unless_a_graphics_processor_is_asked_for() {
    let shown = text(&without_drivers(&["devices"]).stdout);
    assert!(!shown.contains("gpu:0") && shown.contains("graphics processor"), "{shown}");
    let folder = tempfile::tempdir().unwrap();
    let (capture, out) = (folder.path().join("capture"), folder.path().join("out"));
    write_cabinet(&capture, &CabinetOptions { views: 8, test_views: 1, size: 48, ..CabinetOptions::default() })
        .unwrap();
    let run = |device: &str| {
        let settings = folder.path().join("quick.toml");
        std::fs::write(&settings, "[articulate]\nsteps = 5\n[surface]\nresolution = 40.0\n").unwrap();
        let args = ["reconstruct", str(&capture), "-o", str(&out), "--parts", "3", "--config", str(&settings)];
        without_drivers(&[&args[..], &["--force", "--device", device]].concat())
    };
    let refused = run("gpu");
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("graphics processor") && !out.exists(), "{}", text(&refused.stderr));
    let done = run("auto");
    let progress = text(&done.stderr);
    assert_eq!(done.status.code(), Some(0), "{progress}");
    let lines: Vec<&str> = progress.lines().filter(|l| l.starts_with("device: ")).collect();
    assert!(lines.len() == 1 && lines[0].contains("CPU") && lines[0].contains("graphics processor"), "{progress}");
    assert!(!progress.contains("warning: device"), "no driver is nothing odd");
    let metrics: serde_json::Value = serde_json::from_slice(&std::fs::read(out.join("metrics.json")).unwrap()).unwrap();
    assert!(metrics["device"].as_str().is_some_and(|d| d.starts_with("CPU (")), "{metrics}");
}

#[test]
fn a_still_cabinet_becomes_a_static_replica_that_every_command_takes() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, out) = (folder.path().join("capture"), folder.path().join("out"));
    let options = CabinetOptions { views: 40, test_views: 0, size: 96, ..CabinetOptions::default() };
    write_cabinet(&capture, &options).unwrap();
    // Both states are at the start, from different cameras.
    let file = |state: &str| capture.join(format!("transforms_train_{state}.json"));
    let all: serde_json::Value = serde_json::from_slice(&std::fs::read(file("start")).unwrap()).unwrap();
    for (state, odd) in [("start", 0), ("end", 1)] {
        let mut half = all.clone();
        let frames = all["frames"].as_array().unwrap().iter().enumerate();
        half["frames"] = frames.filter(|(i, _)| i % 2 == odd).map(|(_, frame)| frame.clone()).collect();
        std::fs::write(file(state), half.to_string()).unwrap();
    }
    let settings = folder.path().join("quick.toml");
    std::fs::write(&settings, "[articulate]\nsteps = 30\n[surface]\nresolution = 80.0\n").unwrap();
    let done = |args: &[&str]| {
        let output = artgs(args);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", text(&output.stderr));
        text(&output.stderr)
    };
    let place = ["reconstruct", str(&capture), "-o", str(&out), "--config", str(&settings), "--device", "cpu"];
    assert!(done(&[&place[..], &["--stop-after", "discover"]].concat()).contains("nothing moved"));
    let page = folder.path().join("page.html");
    done(&["view", str(&out), "--export", str(&page)]);
    assert!(done(&[&place[..], &["--resume"]].concat()).contains("nothing moved"));
    let replica = artgs_io::read_replica(&out).unwrap();
    assert_eq!(replica.parts.len(), 1);
    done(&["export", str(&out)]);
    #[cfg(feature = "check")]
    done(&["check", str(&out)]);
    std::fs::remove_file(&page).unwrap();
    // Photos of a user are in a page only if they are asked for.
    let photos = || std::fs::read_to_string(&page).unwrap().matches("data-file=\"cameras/").count();
    done(&["view", str(&out), "--export", str(&page)]);
    assert_eq!(photos(), 0);
    done(&["view", str(&out), "--export", str(&page), "--photos", "--title", "Cupboard"]);
    assert!(photos() > 4);
    done(&["evaluate", str(&out), "--gt", str(&capture.join("gt"))]);
}

#[test]
fn the_alignment_of_two_recordings_is_part_of_the_events_and_times_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let (room, out) = (folder.path().join("room"), folder.path().join("out"));
    let done = |args: &[&str]| {
        let output = artgs(args);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {}", text(&output.stderr));
    };
    let size = ["--views", "16", "--size", "200", "--layout", "nerfstudio", "-q"];
    done(&[&["synth", "storage2", "--scene", "room", "-o", str(&room)], &size[..]].concat());
    let recordings = [room.join("start"), room.join("end")];
    let last = ["-o", str(&out), "--stop-after", "discover", "--device", "cpu", "-q"];
    done(&[&["reconstruct", str(&recordings[0]), str(&recordings[1])], &last[..]].concat());
    let events = std::fs::read_to_string(out.join("events.jsonl")).unwrap();
    let events: Vec<serde_json::Value> = events.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let place = |event: &str, stage: &str| events.iter().position(|e| e["event"] == event && e["stage"] == stage);
    let aligned = place("stage_finished", "align").unwrap();
    assert!(
        place("stage_started", "align").unwrap() < aligned && aligned < place("stage_started", "discover").unwrap()
    );
    assert!(events.iter().any(|e| e["message"].as_str().is_some_and(|m| m.contains("its box is --box"))));
    let times = std::fs::read(out.join("stages/times.json")).unwrap();
    let times: serde_json::Value = serde_json::from_slice(&times).unwrap();
    assert_eq!(times["align"], events[aligned]["seconds"]);
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
fn captures_with_wrong_poses_or_depth_are_refused_and_the_mistake_is_named() {
    use serde_json::{Value, json};
    let folder = tempfile::tempdir().unwrap();
    let (capture, out) = (folder.path().join("capture"), folder.path().join("out"));
    write_cabinet(&capture, &CabinetOptions { views: 10, test_views: 0, size: 96, ..CabinetOptions::default() })
        .unwrap();
    let file = |state: &str| capture.join(format!("transforms_train_{state}.json"));
    let right = ["start", "end"].map(|state| std::fs::read_to_string(file(state)).unwrap());
    let flip = |all: &mut Value| {
        for frame in all["frames"].as_array_mut().unwrap() {
            for row in frame["transform_matrix"].as_array_mut().unwrap().iter_mut().take(3) {
                for column in [1, 2] {
                    row[column] = json!(-row[column].as_f64().unwrap());
                }
            }
        }
    };
    let still = |all: &mut Value| {
        let pose = all["frames"][0]["transform_matrix"].clone();
        all["frames"].as_array_mut().unwrap().iter_mut().for_each(|f| f["transform_matrix"] = pose.clone());
    };
    let depth = |all: &mut Value| all["depth_scale"] = json!(1.0);
    let fisheye = |all: &mut Value| all["camera_model"] = json!("OPENCV_FISHEYE");
    type Mistake<'a> = (&'a dyn Fn(&mut Value), &'a str);
    let mistakes: [Mistake<'_>; 4] = [
        (&flip, "are these OpenCV poses"),
        (&still, "all camera poses are the same"),
        (&depth, "with depth multiplied by 0.001"),
        (&fisheye, "undistort the images"),
    ];
    for (mistake, words) in mistakes {
        for (state, text) in ["start", "end"].iter().zip(&right) {
            let mut all: Value = serde_json::from_str(text).unwrap();
            mistake(&mut all);
            std::fs::write(file(state), all.to_string()).unwrap();
        }
        let output = artgs(&["reconstruct", str(&capture), "-o", str(&out)]);
        assert_eq!(output.status.code(), Some(2), "{words}");
        assert!(text(&output.stderr).contains(words), "{words}: {}", text(&output.stderr));
        assert!(!out.exists(), "{words}");
        let shown = artgs(&["inspect", str(&capture)]);
        let all = text(&shown.stdout) + &text(&shown.stderr);
        assert!(all.contains(words), "{words}: {all}");
        assert_eq!(shown.status.code(), Some(2), "{words}: inspect ends as reconstruct does");
    }
    // What is wrong can be used on demand.
    let changed: Value = serde_json::from_str(&right[0]).unwrap();
    std::fs::write(file("start"), changed.to_string()).unwrap();
    let mut end: Value = serde_json::from_str(&right[1]).unwrap();
    flip(&mut end);
    std::fs::write(file("end"), end.to_string()).unwrap();
    let place = ["reconstruct", str(&capture), "-o", str(&out), "--stop-after", "discover", "--device", "cpu"];
    assert!(text(&artgs(&place).stderr).contains("the end state"));
    let forced = artgs(&[&place[..], &["--force-input"]].concat());
    assert!(text(&forced.stderr).contains("warning: the end state"), "{}", text(&forced.stderr));
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
