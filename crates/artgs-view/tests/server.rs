//! The server answers only its own page.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use artgs_core::{Alternative, Joint, JointKind, PerState, Splats, State};
use artgs_io::{CentreEdit, Corrections};
use artgs_view::{FoundJoint, Live, Page, Placement, Server, ViewError, export_page};
use glam::{DQuat, DVec3};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

/// Runs a server of the sample while `ask` sends requests; `{}` in them is the port.
fn with_server(corrections: bool, ask: impl FnOnce(&Path, &dyn Fn(&str) -> String)) {
    let dir = tempfile::tempdir().unwrap();
    common::write_replica_folder(dir.path());
    let folder = corrections.then(|| dir.path().to_path_buf());
    let server = Server::bind(common::page(dir.path()), Some(0), folder).unwrap();
    asking(&server, |send| ask(dir.path(), send));
}

fn asking(server: &Server, ask: impl FnOnce(&dyn Fn(&str) -> String)) {
    let port = server.url().trim_end_matches('/').rsplit(':').next().unwrap().to_string();
    let send = |request: &str| {
        let mut stream = TcpStream::connect(format!("127.0.0.1:{port}")).unwrap();
        stream.write_all(request.replace("{}", &port).as_bytes()).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        String::from_utf8_lossy(&answer).into_owned()
    };
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| server.run(&stop));
        let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| ask(&send)));
        stop.store(true, Ordering::Relaxed);
        if let Err(panic) = result {
            std::panic::resume_unwind(panic);
        }
    });
}

fn get(path: &str) -> String {
    format!("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{{}}\r\n\r\n")
}

fn status(answer: &str) -> &str {
    answer.split(' ').nth(1).unwrap()
}

#[test]
fn the_page_its_scene_and_its_files() {
    with_server(false, |dir, send| {
        let page = send(&get("/?test"));
        assert!(status(&page) == "200" && page.contains("text/html") && page.contains("viewer.js"), "{page}");
        assert!(page.contains("Content-Security-Policy: default-src 'none';"));
        let scene = send(&get("/scene.json"));
        let scene: serde_json::Value = serde_json::from_str(scene.split("\r\n\r\n").nth(1).unwrap()).unwrap();
        assert_eq!(scene["links"][1]["joint"]["limits"], serde_json::json!([0.0, 1.6]));
        assert_eq!(scene["links"][2]["joint"]["observed"], serde_json::json!([0.3, 0.0]));
        let closed = [0, 1, 2, 3].map(|i| scene["links"][i]["mesh"]["closed"] == true);
        assert_eq!(closed, [false, true, false, false]);
        let knob = &scene["links"][3];
        assert_eq!(
            (&knob["parent"], &knob["joint"]["kind"], &knob["joint"]["pitch"]),
            (&1.into(), &"screw".into(), &0.01.into())
        );
        assert_eq!((&scene["corrections"], &scene["scores"]["parts"]), (&false.into(), &4.into()));
        let sure = [1, 2].map(|i| scene["links"][i]["joint"].get("confidence").cloned());
        assert_eq!(sure, [Some(0.97.into()), None]);
        let file = scene["links"][1]["mesh"]["file"].as_str().unwrap();
        let body = send(&get(&format!("/files/{file}")));
        let disk = std::fs::read_to_string(dir.join("exports/urdf/meshes/door_visual.obj")).unwrap();
        assert_eq!(body.split_once("\r\n\r\n").unwrap().1, disk);
        assert!(send(&get("/files/mesh/door.png")).contains("image/png"));
    });
}

#[test]
fn only_the_page_of_the_server_can_read_a_run() {
    let live = Arc::new(Live::new("lamp", Placement::default()));
    let server = Server::bind_live(Arc::clone(&live), Some(0)).unwrap();
    asking(&server, |send| {
        let body = |path: &str| {
            let answer = send(&get(path));
            assert_eq!(status(&answer), "200", "{path}: {answer}");
            serde_json::from_str::<serde_json::Value>(answer.split_once("\r\n\r\n").unwrap().1).unwrap()
        };
        let scene = body("/scene.json");
        assert_eq!(
            (&scene["live"], &scene["corrections"], &scene["name"]),
            (&true.into(), &false.into(), &"lamp".into())
        );
        assert_eq!(status(&send(&get("/live/splats.spz"))), "404");
        live.event("single", [1, 10], Some(0.5), Some(20.0), Some(1));
        let answer = body("/live.json?since=0");
        assert_eq!((&answer["since"], &answer["points"][0][3]), (&1.into(), &20.0.into()));
        assert_eq!(body("/live.json?since=1")["points"], serde_json::json!([]));
        let mut splats = Splats::empty(0);
        splats.extend_from(common::cabinet().links[1].splats.as_ref().unwrap(), 0..9);
        live.update_splats(&splats, &[]);
        for path in ["/live/splats.spz", "/live/parts.spz"] {
            assert_eq!(status(&send(&get(path))), "200");
        }
        assert_eq!(body("/live.json")["splats"], 1);
        for path in ["/live", "/live/../secret", "/live/splats.ply", "/liver"] {
            assert_eq!(status(&send(&get(path))), "404", "{path}");
        }
        for headers in ["Host: evil.example:{}", "Host: 127.0.0.1:{}\r\nOrigin: http://evil.example"] {
            for path in ["/live.json", "/live/splats.spz"] {
                assert_eq!(status(&send(&format!("GET {path} HTTP/1.1\r\n{headers}\r\n\r\n"))), "403", "{headers}");
            }
        }
        assert_eq!(status(&send("POST /corrections HTTP/1.1\r\nHost: localhost:{}\r\n\r\n")), "403");
    });
}

fn post(path: &str, headers: &str, body: &str) -> String {
    let length = body.len();
    format!("POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{{}}\r\n{headers}Content-Length: {length}\r\n\r\n{body}")
}

#[test]
fn a_run_is_started_by_the_own_page_one_at_a_time_and_its_result_shown() {
    const JSON: &str = "Content-Type: application/json\r\n";
    let dir = tempfile::tempdir().unwrap();
    common::write_replica_folder(dir.path());
    let page = common::page(dir.path());
    let (asked, go) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicBool::new(false)));
    let (times, gate, made) = (Arc::clone(&asked), Arc::clone(&go), page.clone());
    let job = move |live: &Arc<Live>| {
        let nth = times.fetch_add(1, Ordering::SeqCst);
        live.stage_started("articulate");
        while !gate.load(Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(5));
        }
        assert!(nth < 2, "a third run panics");
        if nth == 1 { Err("no depth".into()) } else { Ok(Page { scene: scene_called("after", &made), ..made.clone() }) }
    };
    let server = Server::bind(page, Some(0), Some(dir.path().into())).unwrap().with_rerun(Ok(Box::new(job)));
    asking(&server, |send| {
        let json = |path: &str| -> serde_json::Value {
            serde_json::from_str(send(&get(path)).split_once("\r\n\r\n").unwrap().1).unwrap()
        };
        let over = |state: &str| {
            for _ in 0..2000 {
                if json("/live.json")["state"] == state {
                    return;
                }
                std::thread::sleep(Duration::from_millis(5));
            }
            panic!("the run does not end: {}", json("/live.json"));
        };
        assert_eq!(json("/scene.json")["rerun"], serde_json::json!({ "refused": null }));
        assert_eq!(status(&send(&get("/live.json"))), "404");
        for hostile in ["Origin: http://evil.example\r\n", "Origin: null\r\n", "Sec-Fetch-Site: cross-site\r\n"] {
            assert_eq!(status(&send(&post("/rerun", &format!("{JSON}{hostile}"), "{}"))), "403", "{hostile}");
        }
        let elsewhere = post("/rerun", JSON, "{}").replace("127.0.0.1", "evil.example");
        assert_eq!(status(&send(&elsewhere)), "403");
        assert_eq!(status(&send(&post("/rerun", "Content-Type: text/plain\r\n", "{}"))), "415");
        assert_eq!(status(&send(&get("/rerun"))), "404");
        assert_eq!((asked.load(Ordering::SeqCst), server.is_busy()), (0, false));

        assert_eq!(status(&send(&post("/rerun", JSON, "{}"))), "202");
        assert!(server.is_busy());
        assert_eq!(status(&send(&post("/rerun", JSON, "{}"))), "409");
        let saved = r#"{"format":"artgs-corrections","version":1}"#;
        assert_eq!(status(&send(&post("/corrections", JSON, saved))), "409");
        let scene = json("/scene.json");
        assert_eq!(
            (&scene["live"], &scene["returns"], &scene["name"]),
            (&true.into(), &true.into(), &"cabinet".into())
        );
        go.store(true, Ordering::SeqCst);
        over("finished");
        let scene = json("/scene.json");
        assert_eq!((&scene["name"], &scene["corrections"]), (&"after".into(), &true.into()));
        assert_eq!(scene["rerun"], serde_json::json!({ "refused": null }));

        // A run that fails or panics leaves the page unchanged.
        assert_eq!(status(&send(&post("/rerun", JSON, "{}"))), "202");
        over("failed");
        assert_eq!(json("/live.json")["message"], "no depth");
        assert_eq!(status(&send(&post("/rerun", JSON, "{}"))), "202");
        over("failed");
        assert!(json("/live.json")["message"].as_str().unwrap().contains("error in this program"));
        assert_eq!((json("/scene.json")["name"].as_str(), asked.load(Ordering::SeqCst)), (Some("after"), 3));
        assert_eq!(status(&send(&post("/corrections", JSON, saved))), "200");
    });
}

fn scene_called(name: &str, page: &Page) -> artgs_view::Scene {
    artgs_view::Scene { name: name.into(), ..page.scene.clone() }
}

#[test]
fn a_page_that_can_start_no_run_says_why() {
    const JSON: &str = "Content-Type: application/json\r\n";
    with_server(true, |_, send| assert_eq!(status(&send(&post("/rerun", JSON, "{}"))), "403"));
    let dir = tempfile::tempdir().unwrap();
    common::write_replica_folder(dir.path());
    let server = Server::bind(common::found_page(), Some(0), Some(dir.path().into())).unwrap();
    let server = server.with_rerun(Err("the photos are missing".into()));
    asking(&server, |send| {
        let scene = send(&get("/scene.json"));
        assert!(scene.contains(r#""rerun":{"refused":"the photos are missing"}"#), "{scene}");
        let answer = send(&post("/rerun", JSON, "{}"));
        assert!(status(&answer) == "403" && answer.contains("the photos are missing"), "{answer}");
        assert!(!server.is_busy());
    });
}

#[test]
fn corrections_of_what_was_corrected_follow_the_earlier_ones() {
    let dir = tempfile::tempdir().unwrap();
    common::write_replica_folder(dir.path());
    let mut page = common::page(dir.path());
    let earlier = Corrections { centres: vec![CentreEdit::Delete { part: 1 }], ..Corrections::default() };
    page.corrected = Some((earlier, 4));
    let server = Server::bind(page, Some(0), Some(dir.path().into())).unwrap();
    asking(&server, |send| {
        let body = r#"{"format":"artgs-corrections","version":1,"centres":[{"action":"delete","part":2}]}"#;
        assert_eq!(status(&send(&post("/corrections", "Content-Type: application/json\r\n", body))), "200");
        // A page loaded later gets its own corrections, with its own numbers of parts.
        let answer = send(&get("/corrections"));
        let answer = Corrections::parse(answer.split("\r\n\r\n").nth(1).unwrap().as_bytes()).unwrap();
        assert_eq!(answer, Corrections { centres: vec![CentreEdit::Delete { part: 2 }], ..Corrections::default() });
    });
    let read = artgs_io::read_corrections(dir.path()).unwrap().unwrap();
    assert_eq!(read.centres, [CentreEdit::Delete { part: 1 }, CentreEdit::Delete { part: 3 }]);
}

#[test]
fn corrections_that_cannot_be_shown_stay_and_the_answer_says_why() {
    with_server(false, |_, send| assert_eq!(status(&send(&get("/corrections"))), "404"));
    let dir = tempfile::tempdir().unwrap();
    common::write_replica_folder(dir.path());
    let mut page = common::page(dir.path());
    page.corrected = Some((Corrections { centres: vec![CentreEdit::Delete { part: 1 }], ..Corrections::default() }, 4));
    let server = Server::bind(page, Some(0), Some(dir.path().into())).unwrap();
    let file = dir.path().join("corrections.json");
    asking(&server, |send| {
        assert!(send(&get("/corrections")).contains(r#""centres": []"#), "the file does not exist");
        for (text, code, words) in [
            ("{", "500", "corrections.json"),
            (r#"{"format":"artgs-corrections","version":1}"#, "409", "lacks corrections"),
        ] {
            std::fs::write(&file, text).unwrap();
            let answer = send(&get("/corrections"));
            assert!(status(&answer) == code && answer.contains(words), "{answer}");
            assert_eq!(std::fs::read_to_string(&file).unwrap(), text);
        }
    });
}

#[test]
fn found_parts_are_placed_like_their_points() {
    let joint = Joint {
        kind: JointKind::Prismatic,
        axis: DVec3::Y,
        origin: DVec3::new(1.0, 2.0, 3.0),
        pitch: 0.0,
        state_values: PerState::new(0.0, 4.0),
        limits: [0.0, 4.0],
    };
    let upright = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let other = Alternative { joint: joint.into(), cost: 0.1, what: "It slides.".into(), advice: String::new() };
    let found = FoundJoint { joint, parent: 0, confidence: Some(0.5), alternatives: vec![other] };
    let placement = Placement { scale: 0.1, rotation: upright, ..Placement::default() };
    let page = Page::of_joints("x", &[found.clone(), FoundJoint { parent: 1, ..found }], placement);
    let [base, part, carried] = &page.scene.links[..] else { panic!("three links") };
    assert!(base.joint.is_none() && (base.parent, part.parent, carried.parent) == (None, Some(0), Some(1)));
    let answer = part.joint.as_ref().unwrap();
    let near = |a: [f64; 3], b: [f64; 3]| DVec3::from(a).distance(DVec3::from(b)) < 1e-12;
    assert!(near(part.origin, [0.1, -0.3, 0.2]) && near(answer.axis, [0.0, 0.0, 1.0]), "{part:?}");
    assert!((answer.limits[1] - 0.4).abs() < 1e-12 && (answer.observed[State::END] - 0.4).abs() < 1e-12);
    assert_eq!(answer.confidence, Some(0.5));
    // Corrections are in the capture's frame.
    let other = &answer.alternatives[0];
    assert_eq!(
        (other.joint.axis, other.joint.origin, other.joint.value),
        ([0.0, 1.0, 0.0], [1.0, 2.0, 3.0], Some(4.0))
    );
}

#[test]
fn only_a_live_page_has_a_run() {
    with_server(false, |_, send| assert_eq!(status(&send(&get("/live.json"))), "404"));
}

#[test]
fn hostile_paths_hosts_and_origins_are_refused() {
    with_server(true, |dir, send| {
        std::fs::write(dir.join("secret"), "secret").unwrap();
        for path in [
            "/files/../secret",
            "/files/mesh/../../secret",
            "/files/%2e%2e/secret",
            "/files//etc/passwd",
            "/../../etc/passwd",
            "/replica.json",
            "/files/secret",
            "/files/",
            "http://127.0.0.1/secret",
        ] {
            let answer = send(&get(path));
            assert!(status(&answer) == "404" && !answer.contains("root:"), "{path}: {answer}");
        }
        let head = "GET /scene.json HTTP/1.1\r\n";
        for headers in [
            "",
            "Host: evil.example\r\n",
            "Host: evil.example:{}\r\n",
            "Host: 127.0.0.1\r\n",
            "Host: 127.0.0.1:{}\r\nHost: evil.example\r\n",
            "Host: 127.0.0.1:{}\r\nOrigin: http://evil.example\r\n",
            "Host: 127.0.0.1:{}\r\nOrigin: null\r\n",
            "Host: 127.0.0.1:{}\r\nSec-Fetch-Site: cross-site\r\n",
            "Host: 127.0.0.1:{}\r\nSec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\n",
        ] {
            assert_eq!(status(&send(&format!("{head}{headers}\r\n"))), "403", "{headers}");
        }
        assert_eq!(
            status(&send(&format!("{head}Host: localhost:{{}}\r\nOrigin: http://localhost:{{}}\r\n\r\n"))),
            "200"
        );
        assert_eq!(status(&send("DELETE /scene.json HTTP/1.1\r\nHost: localhost:{}\r\n\r\n")), "405");
        assert_eq!(status(&send("POST /scene.json HTTP/1.1\r\nHost: localhost:{}\r\n\r\n")), "405");
        assert_eq!(status(&send("nonsense\r\n\r\n")), "400");
        assert_eq!(status(&send(&format!("GET /{} HTTP/1.1\r\n", "a".repeat(30_000)))), "431");
    });
}

#[test]
fn corrections_are_checked_and_written_whole() {
    let post =
        |kind: &str, extra: &str, body: &str| post("/corrections", &format!("Content-Type: {kind}\r\n{extra}"), body);
    let good = r#"{"format":"artgs-corrections","version":1,"centres":[{"action":"move","part":1,"position":[0.5,0,1]}],
        "joints":[{"part":2,"type":"prismatic"}]}"#;
    with_server(true, |dir, send| {
        let file = dir.join("corrections.json");
        assert_eq!(status(&send(&post("text/plain", "", good))), "415");
        assert_eq!(status(&send(&post("application/json", "Origin: http://evil.example\r\n", good))), "403");
        assert_eq!(status(&send(&post("application/json", "Sec-Fetch-Site: same-site\r\n", good))), "403");
        let long = format!("{good}{}", " ".repeat(70_000));
        assert_eq!(status(&send(&post("application/json", "", &long))), "413");
        assert_eq!(status(&send(&post("application/json", "Transfer-Encoding: chunked\r\n", good))), "411");
        let wrong = send(&post("application/json", "", &good.replace("\"part\":1", "\"part\":0")));
        assert!(status(&wrong) == "400" && wrong.contains("centres[0]"), "{wrong}");
        assert!(!file.exists());
        let answer = send(&post("application/json; charset=utf-8", "Origin: http://127.0.0.1:{}\r\n", good));
        assert_eq!(status(&answer), "200", "{answer}");
        let read = artgs_io::read_corrections(dir).unwrap().unwrap();
        assert_eq!((read.centres.len(), read.joints[0].part), (1, 2));
    });
    with_server(false, |dir, send| {
        assert_eq!(status(&send(&post("application/json", "", good))), "403");
        assert!(!dir.join("corrections.json").exists());
    });
}

/// Runs a server of a recording whose box is saved in `object_box.json`, or of one that saves none for this reason.
fn with_box(refused: Option<&str>, ask: impl FnOnce(&Path, &dyn Fn(&str) -> String)) {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("object_box.json");
    let server = Server::bind(common::recording_page(), Some(0), None).unwrap();
    let server = server.with_box(refused.map_or(Ok(file.clone()), |reason| Err(reason.into())));
    asking(&server, |send| ask(&file, send));
}

#[test]
fn a_box_is_checked_and_written_whole() {
    const JSON: &str = "Content-Type: application/json\r\n";
    let good = r#"{"format":"artgs-box","version":1,"lower":[-0.5,-1,0],"upper":[0.5,1e-3,2.25]}"#;
    with_box(None, |file, send| {
        let shown = || -> serde_json::Value {
            let answer = send(&get("/scene.json"));
            serde_json::from_str::<serde_json::Value>(answer.split_once("\r\n\r\n").unwrap().1).unwrap()["object_box"]
                .clone()
        };
        let begun = shown();
        assert_eq!((&begun["saved"], &begun["file"]), (&false.into(), &file.to_str().unwrap().into()));
        for (headers, code) in [
            ("Content-Type: text/plain\r\n".to_string(), "415"),
            (String::new(), "415"),
            (format!("{JSON}Origin: http://evil.example\r\n"), "403"),
            (format!("{JSON}Origin: null\r\n"), "403"),
            (format!("{JSON}Sec-Fetch-Site: same-site\r\n"), "403"),
            (format!("{JSON}Transfer-Encoding: chunked\r\n"), "411"),
        ] {
            assert_eq!(status(&send(&post("/box", &headers, good))), code, "{headers}");
        }
        assert_eq!(status(&send(&post("/box", JSON, good).replace("127.0.0.1", "evil.example"))), "403");
        assert_eq!(status(&send(&post("/box", JSON, &format!("{good}{}", " ".repeat(70_000))))), "413");
        assert_eq!(status(&send(&get("/box"))), "404");
        for (from, to, part) in [
            ("[-0.5,-1,0]", "[-0.5,-1]", "field `lower` has 2 numbers"),
            ("[-0.5,-1,0]", "[-0.5,-1,null]", "field `lower`: a number is missing or not finite"),
            ("2.25", "1e999", "out of range"),
            ("2.25", "NaN", "line 1"),
            ("2.25", "0", "field `upper`: z (0) must be above"),
            ("artgs-box", "artgs-corrections", "expected \"artgs-box\" version 1"),
            ("\"version\":1", "\"version\":1,\"file\":\"/etc/passwd\"", "unknown field `file`"),
        ] {
            let answer = send(&post("/box", JSON, &good.replace(from, to)));
            assert!(status(&answer) == "400" && answer.contains(part), "{answer}");
        }
        assert!(!file.exists() && shown() == begun);

        let own = format!("{JSON}Origin: http://127.0.0.1:{{}}\r\n");
        assert_eq!(status(&send(&post("/box", &own, good))), "200");
        let saved = artgs_io::BoxBounds { lower: [-0.5, -1.0, 0.0], upper: [0.5, 1e-3, 2.25] };
        assert_eq!(artgs_io::BoxBounds::read(file).unwrap(), saved);
        assert_eq!(std::fs::read_dir(file.parent().unwrap()).unwrap().count(), 1);
        // A page that is loaded again begins with it.
        let again = shown();
        assert_eq!((&again["saved"], &again["upper"]), (&true.into(), &serde_json::json!(saved.upper)));
        // A file of something else is not replaced.
        std::fs::write(file, "mine").unwrap();
        let answer = send(&post("/box", JSON, good));
        assert!(status(&answer) == "500" && answer.contains("object_box.json: exists and is not a box"), "{answer}");
        assert_eq!(std::fs::read_to_string(file).unwrap(), "mine");
    });
    with_box(Some("the folder is read-only"), |file, send| {
        assert!(send(&get("/scene.json")).contains(r#""file":null,"refused":"the folder is read-only""#));
        assert_eq!(status(&send(&post("/box", JSON, good))), "403");
        assert!(!file.exists());
    });
    with_server(true, |_, send| {
        assert!(!send(&get("/scene.json")).contains("object_box"));
        assert_eq!(status(&send(&post("/box", JSON, good))), "403");
    });
}

#[test]
fn corrections_that_cannot_be_saved_are_refused_with_the_reason() {
    let body = r#"{"format":"artgs-corrections","version":1,"joints":[{"part":2,"type":"prismatic"}]}"#;
    let post = post("/corrections", "Content-Type: application/json\r\n", body);
    with_server(true, |dir, send| {
        // A file cannot replace a folder, not even if root writes it.
        std::fs::create_dir(dir.join("corrections.json")).unwrap();
        let answer = send(&post);
        assert!(status(&answer) == "500" && answer.contains("corrections.json: cannot be written"), "{answer}");
        std::fs::remove_dir(dir.join("corrections.json")).unwrap();
        let lock = artgs_io::FolderLock::take(dir, "artgs reconstruct").unwrap();
        let answer = send(&post);
        assert!(status(&answer) == "409" && answer.contains("in use by process"), "{answer}");
        drop(lock);
        assert_eq!(status(&send(&post)), "200");
    });
}

#[test]
fn a_folder_that_was_not_exported_says_how() {
    let dir = tempfile::tempdir().unwrap();
    assert!(Page::of_replica(dir.path()).unwrap_err().to_string().contains("replica.json"));
    common::write_replica_folder(dir.path());
    std::fs::remove_dir_all(dir.path().join("exports/splats")).unwrap();
    assert!(Page::of_replica(dir.path()).unwrap().scene.links.iter().all(|l| l.splats.is_none()));
    artgs_io::write_atomic(&artgs_io::RunFolder::new(dir.path()).canonical_splats(), b"").unwrap();
    let message = Page::of_replica(dir.path()).unwrap_err().to_string();
    assert!(message.contains("--to urdf,splats"), "{message}");
    std::fs::remove_file(dir.path().join("exports/urdf/meshes/door_visual.obj")).unwrap();
    assert!(Page::of_replica(dir.path()).unwrap_err().to_string().contains("door_visual.obj"));
    std::fs::remove_dir_all(dir.path().join("exports/urdf")).unwrap();
    let error = Page::of_replica(dir.path()).unwrap_err();
    assert!(matches!(error, ViewError::NotExported { .. }) && error.to_string().contains("artgs export"), "{error}");
}

#[test]
fn one_file_holds_everything() {
    let dir = tempfile::tempdir().unwrap();
    common::write_replica_folder(dir.path());
    let page = common::page(dir.path());
    let file = dir.path().join("page.html");
    export_page(&page, &file).unwrap();
    let html = std::fs::read_to_string(&file).unwrap();
    // With the scene and the script.
    assert_eq!(html.matches("<script type=\"text/plain\" data-file=").count(), page.files.len() + 2);
    assert!(!html.contains("src=\"viewer.js\"") && !html.contains("href=\"viewer.css\""));
    assert!(page.files.keys().all(|name| html.contains(&format!("data-file=\"{name}\""))));
}

#[test]
fn a_taken_port_is_named() {
    let dir = tempfile::tempdir().unwrap();
    common::write_replica_folder(dir.path());
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let error = Server::bind(common::page(dir.path()), Some(port), None).err().unwrap().to_string();
    assert!(error.contains(&port.to_string()) && error.contains("--port"), "{error}");
}

#[test]
fn slow_connections_do_not_keep_the_page_from_loading() {
    const PATHS: [&str; 6] = ["/", "/viewer.js", "/viewer.css", "/scene.json", "/corrections", "/files/mesh/door.obj"];
    let dir = tempfile::tempdir().unwrap();
    common::write_replica_folder(dir.path());
    let server = Server::bind(common::page(dir.path()), Some(0), Some(dir.path().into())).unwrap();
    let address = server.url().trim_start_matches("http://").trim_end_matches('/').to_string();
    let starts = [
        "",
        "G",
        "GET / HTTP/1.1\r\nHost: x\r\nX-",
        "POST /corrections HTTP/1.1\r\nHost: x\r\nContent-Length: 60000\r\n\r\n{",
    ];
    let mut slow: Vec<TcpStream> = (0..64).map(|_| TcpStream::connect(&address).unwrap()).collect();
    let done = AtomicBool::new(false);
    asking(&server, |send| {
        for (i, stream) in slow.iter_mut().enumerate() {
            stream.write_all(starts[i % starts.len()].as_bytes()).unwrap();
        }
        // All are accepted before the page is loaded.
        std::thread::sleep(Duration::from_millis(300));
        std::thread::scope(|scope| {
            let streams = &mut slow;
            let done = &done;
            scope.spawn(move || {
                while !done.load(Ordering::Relaxed) {
                    // Those that were closed for the page refuse.
                    streams.iter_mut().skip(1).for_each(|stream| drop(stream.write_all(b"a")));
                    std::thread::sleep(Duration::from_millis(100));
                }
            });
            let begun = std::time::Instant::now();
            let address = &address;
            let load = move |path: &str| {
                let mut stream = TcpStream::connect(address).unwrap();
                write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\n\r\n").unwrap();
                let mut answer = Vec::new();
                stream.read_to_end(&mut answer).unwrap();
                String::from_utf8_lossy(&answer[..12]).into_owned()
            };
            let mut answers = Vec::new();
            for _ in 0..3 {
                let loads: Vec<_> = PATHS.iter().map(|path| scope.spawn(move || load(path))).collect();
                answers.extend(loads.into_iter().map(|load| load.join()));
            }
            let seconds = begun.elapsed().as_secs_f64();
            done.store(true, Ordering::Relaxed);
            assert!(answers.iter().all(|a| a.as_ref().is_ok_and(|a| a == "HTTP/1.1 200")), "{answers:?}");
            assert!(seconds < 2.0, "{seconds} s");
        });
        assert_eq!(status(&send(&get("/"))), "200");
    });
}
