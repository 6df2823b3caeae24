//! Batches as schedulers run them: exit codes, rows, and what is skipped.

use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn batch(manifest: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_artgs"));
    command.arg("batch").arg(manifest).args(args).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn row(out: &Path, id: &str) -> Value {
    let bytes = std::fs::read(out.join(format!("rows/{id}.json"))).expect("there is a row");
    serde_json::from_slice(&bytes).expect("rows are JSON")
}

/// A folder with a small capture, quick settings, and a manifest that names the capture as `good` and nothing as `broken`.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("there is room");
    let options = CabinetOptions { views: 16, test_views: 0, size: 96, ..CabinetOptions::default() };
    write_cabinet(&folder.path().join("capture"), &options).expect("it is written");
    std::fs::write(folder.path().join("quick.toml"), "[articulate]\nsteps = 20\n[surface]\nresolution = 60.0\n")
        .expect("it is written");
    let rows = "id,start,parts,config,device\ngood,capture,3,quick.toml,cpu\nbroken,absent,,,\n";
    std::fs::write(folder.path().join("m.csv"), rows).expect("it is written");
    folder
}

#[test]
fn a_finished_capture_is_skipped_until_it_changes() {
    let folder = folder();
    let (manifest, out) = (folder.path().join("m.csv"), folder.path().join("out"));
    let run = |args: &[&str]| batch(&manifest, &[&["-o", out.to_str().unwrap()], args].concat());
    assert_eq!(text(&batch(&manifest, &[]).stdout), "2\n");
    let first = run(&["--index", "0", "--to", "urdf"]);
    assert_eq!(first.status.code(), Some(0), "{}", text(&first.stderr));
    let made = row(&out, "good");
    assert_eq!(
        (made["status"].as_str(), made["parts"].as_u64(), made["attempts"].as_u64()),
        (Some("done"), Some(3), Some(1))
    );
    assert!(made["joints"].as_str().is_some_and(|kinds| kinds.contains("revolute") && kinds.contains("prismatic")));
    assert!(out.join("replicas/good/exports/urdf").is_dir());
    let written = |name: &str| std::fs::metadata(out.join(name)).unwrap().modified().unwrap();
    let before = [written("rows/good.json"), written("replicas/good/replica.json")];
    let again = run(&["--index", "0", "--to", "urdf"]);
    assert!(again.status.code() == Some(0) && text(&again.stdout).contains("earlier run"), "{}", text(&again.stdout));
    assert_eq!(before, [written("rows/good.json"), written("replicas/good/replica.json")]);
    std::fs::write(folder.path().join("quick.toml"), "[articulate]\nsteps = 25\n[surface]\nresolution = 60.0\n")
        .unwrap();
    let changed = run(&["--index", "0"]);
    assert_eq!(changed.status.code(), Some(0), "{}", text(&changed.stderr));
    assert_ne!(row(&out, "good")["content"], made["content"]);
}

#[test]
fn wrong_captures_are_rows_that_need_no_retry() {
    let folder = folder();
    let (manifest, out) = (folder.path().join("m.csv"), folder.path().join("out"));
    let run = |args: &[&str]| batch(&manifest, &[&["-o", out.to_str().unwrap()], args].concat());
    let all = run(&["--json"]);
    assert_eq!(all.status.code(), Some(2), "{}", text(&all.stderr));
    assert!(text(&all.stderr).contains("1 of 2 captures failed, first broken: "), "{}", text(&all.stderr));
    let broken = row(&out, "broken");
    assert!(broken["reason"].as_str().is_some_and(|reason| reason.contains("absent")), "{broken}");
    assert_eq!((broken["retry"].as_bool(), broken["status"].as_str()), (Some(false), Some("failed")));
    let table = std::fs::read_to_string(out.join("results.jsonl")).unwrap();
    let ids: Vec<Value> =
        table.lines().map(|line| serde_json::from_str::<Value>(line).unwrap()["id"].clone()).collect();
    assert_eq!(ids, ["good", "broken"]);
    let outside = run(&["--index", "2"]);
    assert!(outside.status.code() == Some(2) && text(&outside.stderr).contains("captures 0 to 1"));
}

#[cfg(unix)]
#[test]
fn a_killed_run_is_a_row_and_an_interrupted_batch_continues() {
    use std::time::{Duration, Instant};
    let folder = folder();
    let (manifest, out) = (folder.path().join("m.csv"), folder.path().join("out"));
    let start = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_artgs"));
        command.arg("batch").arg(&manifest).arg("-o").arg(&out).args(["--index", "0"]);
        command.stderr(std::process::Stdio::piped()).spawn().unwrap()
    };
    // The settings make a run long.
    std::fs::write(folder.path().join("quick.toml"), "").unwrap();
    let kill = |signal: &str, process: u64| {
        let sent = Command::new("kill").args([signal, &process.to_string()]).status().unwrap();
        assert!(sent.success());
    };
    let runner = || -> u64 {
        let begun = Instant::now();
        loop {
            let owner = std::fs::read(out.join("replicas/good/.artgs.owner.json")).unwrap_or_default();
            let owner: Value = serde_json::from_slice(&owner).unwrap_or_default();
            if let Some(process) = owner["pid"].as_u64() {
                return process;
            }
            assert!(begun.elapsed() < Duration::from_secs(60), "no run has begun");
            std::thread::sleep(Duration::from_millis(20));
        }
    };
    let killed = start();
    kill("-KILL", runner());
    let killed = killed.wait_with_output().unwrap();
    assert_eq!(killed.status.code(), Some(75), "{}", text(&killed.stderr));
    let first = row(&out, "good");
    assert!(
        first["retry"].as_bool() == Some(true) && first["reason"].as_str().is_some_and(|r| r.contains("signal: 9"))
    );
    std::fs::remove_file(out.join("replicas/good/.artgs.owner.json")).unwrap();
    let ended = start();
    let process = runner();
    kill("-TERM", u64::from(ended.id()));
    let ended = ended.wait_with_output().unwrap();
    assert_eq!(ended.status.code(), Some(130), "{}", text(&ended.stderr));
    assert_eq!(row(&out, "good"), first, "an interruption is no result");
    let gone = Command::new("kill").args(["-0", &process.to_string()]).output().unwrap();
    assert!(!gone.status.success(), "the run has ended as well");
}
