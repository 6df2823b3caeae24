//! Parts are looked at and corrected before the rest is made, and the page makes the rest.

#![allow(clippy::unwrap_used, reason = "tests")]

use artgs_core::{Camera, DepthMap, Intrinsics, JointKind, RecordedFrame, Recording, View};
use artgs_io::{BoxBounds, RecordingFormat, read_replica, write_recording};
use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use glam::DVec3;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

fn artgs(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_artgs"));
    command.args(args).stdin(Stdio::null());
    command
}

/// `artgs view`, ended when it is dropped.
struct Viewer {
    child: Child,
    port: String,
}

impl Viewer {
    fn open(out: &Path) -> Self {
        Self::open_with(out, &[])
    }

    fn open_with(out: &Path, options: &[&str]) -> Self {
        let fixed = ["view", out.to_str().unwrap(), "--no-open", "--port", "0", "--json"];
        let mut child =
            artgs(&[&fixed[..], options].concat()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let first: Value = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
        let port = first["url"].as_str().unwrap().trim_end_matches('/').rsplit(':').next().unwrap().to_string();
        // Output of a run must be read, or the pipe fills up.
        std::thread::spawn(move || lines.for_each(drop));
        Self { child, port }
    }

    fn ask(&self, request: &str) -> String {
        let mut stream = TcpStream::connect(format!("127.0.0.1:{}", self.port)).unwrap();
        stream.write_all(request.replace("{}", &self.port).as_bytes()).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    fn json(&self, path: &str) -> Value {
        let answer = self.ask(&format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{{}}\r\n\r\n"));
        serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap()
    }

    fn post(&self, path: &str, body: &str) -> String {
        let length = body.len();
        let head = "Host: 127.0.0.1:{}\r\nOrigin: http://127.0.0.1:{}\r\nContent-Type: application/json";
        // The braces of the body are no place for the port.
        let answer = self.ask(&format!("POST {path} HTTP/1.1\r\n{head}\r\nContent-Length: {length}\r\n\r\n{body}"));
        answer.split(' ').nth(1).unwrap().to_string()
    }

    /// Waits until the run has this state.
    fn until(&self, state: &str) -> Value {
        let begun = Instant::now();
        loop {
            let live = self.json("/live.json");
            if live["state"] == state {
                return live;
            }
            assert!(live["state"] == "running" && begun.elapsed() < Duration::from_secs(300), "{live}");
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn parts_are_corrected_before_the_rest_is_made_and_the_page_makes_it() {
    let root = tempfile::tempdir().unwrap();
    let (capture, out) = (root.path().join("capture"), root.path().join("out"));
    let options = CabinetOptions { views: 20, test_views: 0, size: 96, ..CabinetOptions::default() };
    write_cabinet(&capture, &options).unwrap();
    let quick = root.path().join("quick.toml");
    std::fs::write(&quick, "[surface]\nresolution = 90.0\n").unwrap();
    let places = ["reconstruct", capture.to_str().unwrap(), "-o", out.to_str().unwrap()];
    let method = ["--parts", "3", "--method", "registration", "--config", quick.to_str().unwrap()];
    let stopped = artgs(&[&places[..], &method, &["--stop-after", "discover", "--json"]].concat()).output().unwrap();
    assert_eq!(stopped.status.code(), Some(0), "{}", String::from_utf8_lossy(&stopped.stderr));
    let output = String::from_utf8_lossy(&stopped.stdout);
    let result: Value = serde_json::from_str(output.lines().last().unwrap()).unwrap();
    let types: Vec<&str> =
        result["found"]["parts"].as_array().unwrap().iter().map(|p| p["type"].as_str().unwrap()).collect();
    assert!(types.contains(&"prismatic") && types.contains(&"revolute") && types.len() == 2, "{result}");
    assert!(!out.join("replica.json").exists());

    let viewer = Viewer::open(&out);
    let scene = viewer.json("/scene.json");
    assert_eq!((scene["links"].as_array().unwrap().len(), scene["clouds"].as_array().unwrap().len()), (3, 2));
    assert!(scene["links"][1]["mesh"].is_null() && scene["links"][1]["joint"]["confidence"].as_f64().unwrap() > 0.5);
    assert_eq!((&scene["corrections"], &scene["rerun"]["refused"]), (&true.into(), &Value::Null));

    // The drawer is deleted as a part; then the run continues.
    let drawer = 1 + types.iter().position(|t| *t == "prismatic").unwrap();
    let delete = |part: usize| {
        format!(r#"{{"format":"artgs-corrections","version":1,"centres":[{{"action":"delete","part":{part}}}]}}"#)
    };
    assert_eq!(viewer.post("/corrections", &delete(drawer)), "200");
    assert_eq!(viewer.post("/rerun", "{ }"), "202");
    let live = viewer.until("finished");
    let stages: Vec<&str> = live["stages"].as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(stages, ["register", "correct", "surface", "assemble", "export"]);
    assert_eq!(live["stages"][0]["reused"], true);
    let replica = read_replica(&out).unwrap();
    assert_eq!((replica.parts.len(), replica.joint(1).unwrap().kind), (2, JointKind::Revolute));
    let scene = viewer.json("/scene.json");
    assert_eq!((scene["links"].as_array().unwrap().len(), scene["live"].is_null()), (2, true));
    assert!(scene["links"][1]["mesh"]["file"].is_string());

    // The one part that is left is the door; without it there is nothing, which is said, and what was there stays.
    assert_eq!(viewer.post("/corrections", &delete(1)), "200");
    assert_eq!(viewer.post("/rerun", "{ }"), "202");
    assert!(viewer.until("failed")["message"].as_str().unwrap().contains("every movable part"));
    assert_eq!(viewer.json("/scene.json")["links"].as_array().unwrap().len(), 2);
    drop(viewer);

    std::fs::remove_dir_all(&capture).unwrap();
    let viewer = Viewer::open(&out);
    let refused = viewer.json("/scene.json")["rerun"]["refused"].clone();
    assert!(refused.as_str().unwrap().contains("--capture"), "{refused}");
    assert_eq!(viewer.post("/rerun", "{ }"), "403");
}

/// Frames about a point at the origin of a world with +Y up, with depth of a wall behind it.
fn recorded() -> Recording {
    let intrinsics = Intrinsics { fx: 40.0, fy: 40.0, cx: 24.0, cy: 16.0, width: 48, height: 32 };
    let frame = |k: usize| {
        let eye = DVec3::new(-0.8 + 0.4 * k as f64, 0.6, 2.0);
        let camera = Camera::look_at(intrinsics, eye, DVec3::ZERO, DVec3::Y);
        let rgba = (0..48 * 32).map(|i| [(40 * k) as u8, (i % 48 * 5) as u8, (i / 48 * 7) as u8, 255]).collect();
        let depth = Some(DepthMap::nearest(&[2.1; 48 * 32]));
        let view = View { name: format!("{k}.png"), camera, rgba, depth, derived: None };
        RecordedFrame { view, time: None, depth_step: 1.0 }
    };
    Recording {
        up: Some(DVec3::Y),
        metric: true,
        frames: (0..5).map(frame).collect(),
        recorded: 5,
        ..Recording::default()
    }
}

#[test]
fn a_recording_is_shown_and_its_box_saved_for_reconstruct() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("closed");
    write_recording(&folder, &recorded(), RecordingFormat::Nerfstudio).unwrap();
    let names = || {
        let all = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
        all.collect::<std::collections::BTreeSet<String>>()
    };
    let before = names();
    let viewer = Viewer::open(&folder);
    let scene = viewer.json("/scene.json");
    let count = |key: &str| scene[key].as_array().unwrap().len();
    assert_eq!((count("links"), count("cameras"), count("clouds")), (0, 5, 1));
    assert!(scene["clouds"][0]["count"].as_u64().unwrap() > 300 && scene["cameras"][0]["photo"].is_string());
    assert_eq!((&scene["name"], &scene["corrections"]), (&"closed".into(), &false.into()));
    let begun = &scene["object_box"];
    let file = folder.join("object_box.json");
    assert_eq!((&begun["saved"], &begun["file"]), (&false.into(), &file.to_str().unwrap().into()));
    assert!(begun["lower"][0].as_f64().unwrap() < -0.1 && begun["upper"][0].as_f64().unwrap() > 0.1, "{begun}");
    assert_eq!(names(), before, "nothing is written before the user saves");
    let good = r#"{"format":"artgs-box","version":1,"lower":[5,5,5],"upper":[6,6,6] }"#;
    assert_eq!(viewer.post("/box", &good.replace("6,6,6", "6,6,4")), "400");
    assert_eq!(viewer.post("/box", good), "200");
    drop(viewer);
    let saved = BoxBounds { lower: [5.0; 3], upper: [6.0; 3] };
    assert_eq!(BoxBounds::read(&file).unwrap(), saved);
    let added: Vec<String> = names().difference(&before).cloned().collect();
    assert_eq!(added, ["object_box.json"]);

    // The recording is still read, and its page begins with the saved box; another file can be named.
    let elsewhere = root.path().join("other.json");
    let viewer = Viewer::open_with(&folder, &["--save-box", elsewhere.to_str().unwrap(), "--frames", "3"]);
    let scene = viewer.json("/scene.json");
    assert_eq!((scene["cameras"].as_array().unwrap().len(), &scene["object_box"]["saved"]), (3, &false.into()));
    assert_eq!((viewer.post("/box", good), elsewhere.exists()), ("200".to_string(), true));
    drop(viewer);
    let viewer = Viewer::open(&folder);
    assert_eq!(viewer.json("/scene.json")["object_box"]["lower"], serde_json::json!([5.0, 5.0, 5.0]));
}
