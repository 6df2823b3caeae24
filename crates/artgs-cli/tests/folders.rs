//! Output folders: one run at a time, nothing of others removed, nothing left that stops the next run.

#![allow(clippy::unwrap_used, reason = "tests")]

use artgs_io::{FolderLock, RunFolder};
use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn command(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_artgs"));
    command.args(args).stdin(Stdio::null());
    command
}

fn artgs(args: &[&str]) -> Output {
    command(args).output().unwrap()
}

fn str(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[track_caller]
fn succeeds(output: &Output) {
    assert_eq!(output.status.code(), Some(0), "{}", errors(output));
}

/// A capture, and how it is reconstructed in seconds.
struct Bench {
    root: tempfile::TempDir,
    capture: PathBuf,
    out: PathBuf,
    quick: PathBuf,
}

impl Bench {
    fn new() -> Self {
        let root = tempfile::tempdir().unwrap();
        let (capture, out) = (root.path().join("capture"), root.path().join("out"));
        let options = CabinetOptions { views: 16, test_views: 0, size: 96, ..CabinetOptions::default() };
        write_cabinet(&capture, &options).unwrap();
        let quick = root.path().join("quick.toml");
        fs::write(&quick, "[surface]\nresolution = 60.0\n").unwrap();
        Self { root, capture, out, quick }
    }

    fn reconstruct(&self, capture: &Path, flags: &[&str]) -> Output {
        let places = ["reconstruct", str(capture), "-o", str(&self.out), "--config", str(&self.quick)];
        artgs(&[&places[..], &["--parts", "3", "--method", "registration"], flags].concat())
    }
}

#[test]
fn a_folder_in_use_is_refused_and_that_of_a_killed_run_is_taken_over() {
    let bench = Bench::new();
    fs::create_dir(&bench.out).unwrap();
    let lock = FolderLock::take(&bench.out, "artgs reconstruct").unwrap();
    for flags in [&[][..], &["--resume"], &["--force"]] {
        let refused = bench.reconstruct(&bench.capture, flags);
        let message = errors(&refused);
        assert_eq!(refused.status.code(), Some(2), "{message}");
        assert!(message.contains("in use by process") && message.contains("wait until it ends"), "{message}");
        assert_eq!(message.lines().filter(|line| line.starts_with("error")).count(), 1, "{message}");
    }
    let synth = artgs(&["synth", "storage2", "-o", str(&bench.out), "--force"]);
    assert!(synth.status.code() == Some(2) && errors(&synth).contains("in use by process"), "{}", errors(&synth));
    drop(lock);
    assert_eq!(fs::read_dir(&bench.out).unwrap().count(), 0);

    let places = ["reconstruct", str(&bench.capture), "-o", str(&bench.out), "--parts", "3"];
    let mut killed = command(&places).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let begun = Instant::now();
    while !bench.out.join(".artgs.owner.json").exists() {
        assert!(begun.elapsed() < Duration::from_secs(60));
        std::thread::sleep(Duration::from_millis(5));
    }
    let other = artgs(&["reconstruct", str(&bench.capture), "-o", str(&bench.out), "--force"]);
    assert!(errors(&other).contains(&format!("process {} on ", killed.id())), "{}", errors(&other));
    killed.kill().unwrap();
    killed.wait().unwrap();
    // What a write leaves that is killed before its file has its name.
    let unfinished = bench.out.join("stages/.artgs-a1b2c3.tmp");
    artgs_io::write_atomic(&unfinished, b"half").unwrap();
    let next = bench.reconstruct(&bench.capture, &["--resume"]);
    succeeds(&next);
    assert!(errors(&next).contains("is taken over"), "{}", errors(&next));
    assert!(!unfinished.exists() && !bench.out.join(".artgs.owner.json").exists());
}

#[test]
fn input_that_is_refused_does_not_stop_the_next_run() {
    let bench = Bench::new();
    let bad = bench.root.path().join("bad");
    let options = CabinetOptions { views: 16, test_views: 0, size: 96, ..CabinetOptions::default() };
    write_cabinet(&bad, &options).unwrap();
    for state in ["start", "end"] {
        let cameras = bad.join(format!("transforms_train_{state}.json"));
        let mut value: serde_json::Value = serde_json::from_slice(&fs::read(&cameras).unwrap()).unwrap();
        for frame in value["frames"].as_array_mut().unwrap() {
            frame.as_object_mut().unwrap().remove("depth_path");
        }
        fs::write(&cameras, value.to_string()).unwrap();
        fs::remove_dir_all(bad.join(state).join("train/depth")).unwrap();
    }
    for capture in [&bad, &bench.root.path().join("nowhere")] {
        let refused = bench.reconstruct(capture, &[]);
        assert_eq!(refused.status.code(), Some(2), "{}", errors(&refused));
    }
    succeeds(&bench.reconstruct(&bench.capture, &[]));
    let blocked = bench.reconstruct(&bench.capture, &[]);
    assert!(blocked.status.code() == Some(2) && errors(&blocked).contains("--resume"), "{}", errors(&blocked));

    // A replica that changes takes its exports along, one that does not keeps them.
    let run = RunFolder::new(&bench.out);
    succeeds(&artgs(&["export", str(&bench.out), "--to", "urdf", "-q"]));
    fs::write(bench.out.join("meshes/start/part_9.ply"), "old").unwrap();
    succeeds(&bench.reconstruct(&bench.capture, &["--resume"]));
    assert!(run.export_report().is_file() && !bench.out.join("meshes/start/part_9.ply").exists());
    let one = r#"{"format":"artgs-corrections","version":1,"centres":[{"action":"delete","part":1}]}"#;
    fs::write(run.corrections(), one).unwrap();
    succeeds(&bench.reconstruct(&bench.capture, &["--resume"]));
    assert!(!run.exports().exists() && !bench.out.join("meshes/start/part_2.ply").exists());

    // A folder that cannot be written is shown all the same: here a file is in the place of the exports.
    fs::write(run.exports(), "").unwrap();
    let mut viewer = command(&["view", str(&bench.out), "--no-open", "--port", "0", "--json"]);
    let mut viewer = viewer.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut first = String::new();
    BufReader::new(viewer.stdout.take().unwrap()).read_line(&mut first).unwrap();
    let url: serde_json::Value = serde_json::from_str(&first).unwrap();
    let address = url["url"].as_str().unwrap().trim_start_matches("http://").trim_end_matches('/').to_string();
    let mut answer = String::new();
    let mut stream = TcpStream::connect(&address).unwrap();
    write!(stream, "GET /scene.json HTTP/1.1\r\nHost: {address}\r\n\r\n").unwrap();
    stream.read_to_string(&mut answer).unwrap();
    viewer.kill().unwrap();
    viewer.wait().unwrap();
    let scene: serde_json::Value = serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap();
    assert_eq!(scene["links"].as_array().unwrap().len(), 2, "{scene}");
}

#[test]
fn a_capture_inside_the_folder_that_is_emptied_is_refused() {
    let bench = Bench::new();
    let capture = bench.out.join("stages/aligned");
    fs::create_dir_all(bench.out.join("stages")).unwrap();
    fs::rename(&bench.capture, &capture).unwrap();
    fs::write(bench.out.join("events.jsonl"), "").unwrap();
    let refused = bench.reconstruct(&capture, &["--force"]);
    assert!(refused.status.code() == Some(2) && errors(&refused).contains("is inside"), "{}", errors(&refused));
    assert!(capture.join("transforms_train_start.json").is_file());
}

#[test]
fn synth_removes_only_what_it_wrote() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("capture");
    let synth = |views: &str, flags: &[&str]| {
        let args = ["synth", "blade", "-o", str(&out), "--size", "16", "--test-views", "0", "-q", "--views", views];
        artgs(&[&args[..], flags].concat())
    };
    succeeds(&synth("3", &[]));
    let mine = out.join("start/train/rgba/holiday.png");
    fs::write(&mine, "mine").unwrap();
    for flags in [&[][..], &["--force"]] {
        let refused = synth("2", flags);
        assert!(refused.status.code() == Some(2) && errors(&refused).contains("holiday.png"), "{}", errors(&refused));
        assert!(mine.exists() && out.join("start/train/rgba/0002.png").exists());
    }
    fs::rename(&mine, out.join("holiday.png")).unwrap();
    succeeds(&synth("2", &[]));
    assert!(out.join("holiday.png").exists() && !out.join("start/train/rgba/0002.png").exists());
}
