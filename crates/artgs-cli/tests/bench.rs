//! `artgs bench` from the command line to its files.

#![cfg(feature = "bench")]

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn artgs(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_artgs")).args(args).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn str(path: &Path) -> &str {
    path.to_str().expect("temporary paths are UTF-8")
}

/// A capture whose truth is there and whose photographs are not.
fn broken_capture(folder: &Path) {
    let truth = r#"{"trans_info": {"axis": {"o": [0, 0, 0], "d": [0, 0, 1]}, "type": "rotate",
                    "rotate": {"l": 0, "r": 30}}}"#;
    artgs_io::write_atomic(&folder.join("gt/trans.json"), truth.as_bytes()).expect("the truth is written");
}

#[test]
fn a_bench_with_a_bad_capture_is_run_tabulated_and_resumed() {
    let root = tempfile::tempdir().unwrap();
    let (broken, settings, out) = (root.path().join("broken"), root.path().join("quick.toml"), root.path().join("out"));
    broken_capture(&broken);
    std::fs::write(&settings, "[articulate]\nsteps = 30\n[articulate.densify]\nbefore = 10\n").unwrap();
    let quick = format!("quick={}", settings.display());
    let args = [
        "bench",
        "cabinet",
        str(&broken),
        "-o",
        str(&out),
        "--views",
        "16",
        "--size",
        "80",
        "--variant-config",
        &quick,
        "--stand-in",
        "cabinet=dta_multi/storage",
        "--stand-in",
        "broken=paris/laptop",
    ];
    let output = artgs(&args);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("2 runs, 1 failed"), "{}", text(&output.stdout));
    assert!(text(&output.stderr).contains("run 2 of 2"), "{}", text(&output.stderr));

    let results: Value = serde_json::from_slice(&std::fs::read(out.join("results.json")).unwrap()).unwrap();
    let records = results["records"].as_array().unwrap();
    let cabinet = &records[0]["outcome"]["done"];
    assert_eq!(cabinet["scores"]["counts"]["truths"], 2, "{records:#?}");
    assert!(cabinet["metrics"]["test"][0]["psnr"].as_f64().unwrap() > 15.0);
    assert_eq!((&records[0]["facts"]["views"], &records[0]["facts"]["size"]), (&16.into(), &80.into()));
    let reason = records[1]["outcome"]["failed"].as_str().unwrap();
    assert!(reason.starts_with("exit code 2") && reason.contains("broken"), "{reason}");
    let markdown = std::fs::read_to_string(out.join("BENCHMARKS.md")).unwrap();
    for words in ["artgs bench cabinet", "artgs quick (stand-in)", "## Failed runs", "| DTA | 0.17 | 0.40 |"] {
        assert!(markdown.contains(words), "{words} is not in\n{markdown}");
    }
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("data:image/png;base64,") && page.contains("<svg"), "no picture or no plot");

    let again = artgs(&args);
    assert_eq!(again.status.code(), Some(0));
    assert!(text(&again.stderr).contains("2 runs are complete already"), "{}", text(&again.stderr));
    assert_eq!(std::fs::read_to_string(out.join("index.html")).unwrap(), page, "the same data, the same bytes");

    let other = artgs(&[&args[..], &["--threads", "1"]].concat());
    assert_eq!(other.status.code(), Some(2));
    assert!(text(&other.stderr).contains("another threads"), "{}", text(&other.stderr));
}

#[test]
fn wrong_usage_exits_2_and_says_what_is_wrong() {
    let root = tempfile::tempdir().unwrap();
    let (broken, out) = (root.path().join("broken"), root.path().join("out"));
    broken_capture(&broken);
    let b = str(&broken);
    for (args, words) in [
        (&["zoo"][..], "suites are paris"),
        (&[b, "--variants", "magic"], "there are full, paper"),
        (&[b, "--variant-config", "x"], "`=`"),
        (&[b, "--variant-config", "x=/nowhere.toml"], "/nowhere.toml"),
        (&[b, "--same-object", "broken=paris/dog"], "paris/fridge"),
        (&[b, "--stand-in", "dog=paris/fridge"], "no object is called `dog`"),
        (&[b, "--views", "3"], "for suites"),
        (&[b, "--schedule", "0.5"], "--schedule"),
        (&[b, b], "two objects are called `broken`"),
        (&[b, "--seeds", "0"], "--seeds"),
        (&[b, "--seeds", "0..3"], "is for `artgs bench population`"),
        (&[b, "--sensor", "lidar"], "are for `artgs bench population`"),
        (&[b, "--keep"], "are for `artgs bench population`"),
        (&["population"], "add --seeds A..B"),
        (
            &["population", "--seeds", "3"],
            "write --seeds 0..3 for the seeds below 3, or --seeds 3..=3 for seed 3 alone",
        ),
        (&["population", "--seeds", "3..3"], "no seed is in 3..3"),
        (&["population", "--seeds", "x..3"], "A..=B"),
        (&["population", "--seeds", "9000..=10000"], "kept for judging"),
        (&["population", b, "--seeds", "0..3"], "cannot be combined"),
        (&["population", "--seeds", "0..3", "--variants", "full"], "--variants cannot be used"),
        (&["population", "--seeds", "0..3", "--views", "20"], "--views cannot be used"),
        (&["population", "--seeds", "0..3", "--noise", "none"], "--noise cannot be used"),
        (&["population", "--seeds", "0..3", "--parts", "given"], "--parts given cannot be used"),
        (&["population", "--seeds", "0..3", "--photo-seed", "1"], "--photo-seed cannot be used"),
        (&["population", "--seeds", "0..3", "--size", "200,300"], "is one number"),
        (&["population", "--seeds", "0..3", "--sensor", "sonar"], "kinect"),
        (&[b, "--timeout", "0"], "above 0"),
        (&[str(root.path().join("broken/gt").as_path())], "gt/trans.json"),
    ] {
        let output = artgs(&[&["bench", "-o", str(&out)], args].concat());
        assert_eq!(output.status.code(), Some(2), "{args:?}: {}", text(&output.stderr));
        assert!(text(&output.stderr).contains(words), "{args:?}: {}", text(&output.stderr));
    }
    assert!(!out.exists(), "nothing is made for input that cannot be used");
}

#[test]
fn a_bench_of_which_every_run_failed_fails() {
    let root = tempfile::tempdir().unwrap();
    let (broken, out) = (root.path().join("broken"), root.path().join("out"));
    broken_capture(&broken);
    let output = artgs(&["bench", str(&broken), "-o", str(&out)]);
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("every run failed"), "{}", text(&output.stderr));
    assert!(out.join("index.html").is_file());
}

#[cfg(unix)]
#[test]
fn an_interrupted_bench_ends_its_run_and_says_how_to_continue() {
    let root = tempfile::tempdir().unwrap();
    let out = root.path().join("out");
    let mut command = Command::new(env!("CARGO_BIN_EXE_artgs"));
    command.args(["bench", "cabinet", "-o", str(&out), "--views", "16", "--size", "80"]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let started = Instant::now();
    while !out.join("runs/full/cabinet/seed_0/events.jsonl").is_file() {
        assert!(started.elapsed() < Duration::from_secs(120), "no run was started");
        std::thread::sleep(Duration::from_millis(50));
    }
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("1 run left"), "{}", text(&output.stderr));
    assert!(!out.join("runs/full/cabinet/seed_0/run.json").exists());
    // The run itself is gone: it writes nothing any more.
    let size = || std::fs::metadata(out.join("runs/full/cabinet/seed_0.log")).unwrap().len();
    let before = size();
    std::thread::sleep(Duration::from_millis(500));
    assert_eq!(size(), before);
}
