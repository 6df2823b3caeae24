//! `artgs export` and `artgs check` as their users meet them, on a small replica without photos.

use artgs_core::{Joint, JointKind, Mesh, Replica, Rigid};
use artgs_io::{write_mesh_ply, write_replica};
use glam::DVec3;
use serde_json::json;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn artgs(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_artgs")).args(args).env_remove("NO_COLOR").output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn cuboid(low: [f32; 3], high: [f32; 3]) -> Mesh {
    Mesh { colors: vec![[180, 120, 60]; 8], ..Mesh::cuboid(low, high) }
}

/// A cabinet of five walls with a door and a drawer, both shut at the start.
fn write(out: &Path) {
    let walls = [
        cuboid([-0.5, 0.0, 0.0], [-0.46, 0.5, 1.0]),
        cuboid([0.46, 0.0, 0.0], [0.5, 0.5, 1.0]),
        cuboid([-0.46, 0.46, 0.0], [0.46, 0.5, 1.0]),
        cuboid([-0.46, 0.0, 0.0], [0.46, 0.46, 0.04]),
        cuboid([-0.46, 0.0, 0.96], [0.46, 0.46, 1.0]),
    ];
    let mut base = Mesh::default();
    walls.iter().for_each(|w| base.append(w));
    let door = cuboid([-0.5, -0.06, 0.52], [0.5, -0.005, 1.0]);
    let drawer = cuboid([-0.42, -0.06, 0.08], [0.42, 0.4, 0.46]);
    let hinge = Rigid::about(DVec3::NEG_Z, DVec3::new(-0.5, -0.06, 0.0), 1.4);
    let joints = [
        Joint::from_motion(JointKind::Revolute, &hinge).with_origin_near(DVec3::new(0.0, 0.0, 0.76)),
        Joint::from_motion(JointKind::Prismatic, &Rigid::shift(DVec3::new(0.0, -0.3, 0.0)))
            .with_origin_near(DVec3::new(0.0, -0.06, 0.3)),
    ];
    let replica = Replica::new(&joints);
    for (part, mesh) in replica.parts.iter().zip([&base, &door, &drawer]) {
        for state in artgs_core::State::ALL {
            let motion =
                if state == artgs_core::State::START { Rigid::IDENTITY } else { replica.world_motion(part.id) };
            write_mesh_ply(&out.join(&part.meshes[state]), &mesh.moved(&motion))
                .expect("a temporary folder can be written");
        }
    }
    for state in artgs_core::State::ALL {
        write_mesh_ply(&out.join(&replica.whole[state]), &base).expect("a temporary folder can be written");
    }
    write_replica(out, &replica).expect("a temporary folder can be written");
}

#[test]
fn the_upward_axis_is_that_of_the_recordings_unless_one_is_given() {
    let dir = tempfile::tempdir().unwrap();
    let out = &dir.path().join("replica");
    write(out);
    let up = |options: &[&str]| {
        let done = artgs(&[&["export", out.to_str().unwrap(), "--to", "urdf"], options].concat());
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        let report: serde_json::Value =
            serde_json::from_slice(&fs::read(out.join("exports/export.json")).unwrap()).unwrap();
        report["up"].as_str().unwrap().to_owned()
    };
    assert_eq!(up(&[]), "z");
    assert_eq!(up(&["--up", "y"]), "y");
    assert_eq!(up(&["--up", "-x"]), "-x");
    assert_eq!(up(&["--up=0,0,-2"]), "-z");
    let known = |source: &str, confidence: f64| {
        let path = out.join("replica.json");
        let mut replica: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        replica["up"] = serde_json::json!({ "direction": [1, 0, 0], "source": source, "confidence": confidence });
        fs::write(&path, replica.to_string()).unwrap();
    };
    known("floor", 0.9);
    assert_eq!(up(&[]), "x");
    known("assumed", 0.2);
    let done = artgs(&["export", out.to_str().unwrap(), "--to", "urdf"]);
    let said = text(&done.stderr);
    assert_eq!(done.status.code(), Some(2), "{said}");
    assert!(said.contains("to --up") && said.contains("-x"), "{said}");
    assert_eq!(up(&["--up", "y"]), "y");
    let done = artgs(&["export", out.to_str().unwrap(), "--up", "upwards"]);
    assert!(text(&done.stderr).contains("0.1,0,0.99"), "{}", text(&done.stderr));
}

#[test]
fn formats_of_an_earlier_export_with_other_options_are_written_again() {
    let dir = tempfile::tempdir().unwrap();
    let out = &dir.path().join("replica");
    write(out);
    let export = |options: &[&str]| {
        let done = artgs(&[&["export", out.to_str().unwrap()], options].concat());
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        text(&done.stderr).to_owned()
    };
    let masses = |file: &str| -> Vec<String> {
        let written = fs::read_to_string(out.join("exports").join(file)).unwrap();
        written.lines().filter(|line| line.contains("mass")).map(str::to_owned).collect()
    };
    export(&["--to", "urdf,mjcf"]);
    let before = masses("urdf/replica.urdf");
    assert!(!export(&["--to", "mjcf"]).contains("written again"));
    assert_eq!(masses("urdf/replica.urdf"), before);
    let said = export(&["--to", "mjcf", "--mass", "50"]);
    assert!(said.contains("with other options, so written again: urdf"), "{said}");
    assert_ne!(masses("urdf/replica.urdf"), before);
}

#[test]
fn without_frames_the_urdf_begins_with_a_body() {
    let dir = tempfile::tempdir().unwrap();
    let out = &dir.path().join("replica");
    write(out);
    let done = artgs(&["export", out.to_str().unwrap(), "--to", "urdf,sdf,mjcf", "--frames", "none"]);
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let urdf = fs::read_to_string(out.join("exports/urdf/replica.urdf")).unwrap();
    assert!(!urdf.contains("<link name=\"world\"") && !urdf.contains("mass value=\"0\""), "{urdf}");
    assert!(!urdf.contains("type=\"fixed\""), "{urdf}");
    let checked = artgs(&["check", out.to_str().unwrap()]);
    assert_eq!(checked.status.code(), Some(0), "{}{}", text(&checked.stdout), text(&checked.stderr));
}

#[test]
fn every_format_is_written_and_passes_the_check() {
    let dir = tempfile::tempdir().unwrap();
    let out = &dir.path().join("replica");
    let shown = out.to_str().unwrap();
    write(out);
    let done = artgs(&["export", shown, "--name", "My cabinet"]);
    let (said, noted) = (text(&done.stdout), text(&done.stderr));
    assert_eq!(done.status.code(), Some(0), "{said}{noted}");
    assert!(said.contains("seen closed at the start (0)") && said.contains("urdf/my_cabinet.urdf"), "{said}");
    assert!(noted.contains("--capture"), "{noted}");
    for step in ["surfaces", "limits", "hulls", "write"] {
        assert!(noted.contains(&format!("{step}: started\n{step}: ")), "{noted}");
    }
    assert!(said.contains("MB; together ") && said.contains("shared between formats"), "{said}");
    let exports = out.join("exports");
    for file in [
        "urdf/my_cabinet.urdf",
        "mjcf/my_cabinet.xml",
        "usd/my_cabinet.usda",
        "usd/my_cabinet.usdc",
        "usdz/my_cabinet.usdz",
        "glb/my_cabinet.glb",
        "sdf/model.sdf",
        "partnet/mobility.urdf",
        "simready/my_cabinet/simready_usd/my_cabinet.usda",
        "simready/my_cabinet/simready_usd/.thumbs/256x256/my_cabinet.usda.png",
        "export.json",
    ] {
        assert!(exports.join(file).is_file(), "{file}");
    }
    let checked = artgs(&["check", shown]);
    assert_eq!(checked.status.code(), Some(0), "{}{}", text(&checked.stdout), text(&checked.stderr));
    let json = artgs(&["check", shown, "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&json.stdout).unwrap();
    assert!(report.is_object());

    // From a relative path, and with the photos gone.
    let mut relative = Command::new(env!("CARGO_BIN_EXE_artgs"));
    relative.current_dir(out.parent().unwrap()).arg("view").arg(out.file_name().unwrap());
    let shown_page = relative.args(["--export", "page.html"]).output().unwrap();
    assert_eq!(shown_page.status.code(), Some(0), "{}", text(&shown_page.stderr));
    let page = out.parent().unwrap().join("page.html");
    let written = fs::read_to_string(&page).unwrap();
    assert!(written.len() > 1_000_000 && !written.contains("https://"), "{} bytes", written.len());
    fs::remove_file(&page).unwrap();

    // A second export leaves nothing of the first; formats that were written with another name are written again.
    fs::write(exports.join("urdf/stale.obj"), "v 0 0 0\n").unwrap();
    assert_eq!(artgs(&["export", shown, "--to", "urdf", "--observed-limits"]).status.code(), Some(0));
    assert!(!exports.join("urdf/stale.obj").exists() && !exports.join("urdf/my_cabinet.urdf").exists());
    assert!(exports.join("urdf/replica.urdf").is_file() && exports.join("mjcf/replica.xml").is_file());
    assert!(!exports.join("mjcf/my_cabinet.xml").exists());
    let left: Vec<String> =
        fs::read_dir(&exports).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    assert!(left.iter().all(|name| !name.starts_with('.')), "{left:?}");
}

#[test]
#[cfg(feature = "check")]
fn a_report_has_a_line_per_rule_as_data_and_as_a_page() {
    let dir = tempfile::tempdir().unwrap();
    let shown = dir.path().to_str().unwrap();
    write(dir.path());
    let stated = ["--author", "Anna", "--license", "CC0-1.0", "--wikidata", "Q42177"];
    let done = artgs(&[&["export", shown, "--to", "urdf,simready"], stated.as_slice()].concat());
    assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
    let report = fs::read(dir.path().join("exports/export.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    assert_eq!((&report["options"]["author"], &report["options"]["item"]), (&json!("Anna"), &json!("Q42177")));
    let usda = dir.path().join("exports/simready/replica/simready_usd/replica.usda");
    let usda = fs::read_to_string(usda).unwrap();
    for line in ["string author = \"Anna\"", "string asset_license = \"CC0-1.0\"", "string qcode = \"Q42177\""] {
        assert!(usda.contains(line), "{line}");
    }

    let folder = dir.path().join("report");
    let checked = artgs(&["check", shown, "--report", folder.to_str().unwrap()]);
    assert_eq!(checked.status.code(), Some(0), "{}{}", text(&checked.stdout), text(&checked.stderr));
    let data: serde_json::Value = serde_json::from_slice(&fs::read(folder.join("check.json")).unwrap()).unwrap();
    let rules = data["rules"].as_array().unwrap();
    let upper = rules.iter().find(|rule| rule["id"] == "joint.upper" && rule["subject"] == "door_joint").unwrap();
    assert_eq!((&upper["verdict"], &upper["unit"]), (&json!("passed"), &json!("rad")));
    assert!(upper["measured"].as_f64().unwrap() <= upper["limit"].as_f64().unwrap());
    assert!(rules.iter().any(|rule| rule["id"] == "SR.002" && rule["verdict"] == "passed"));
    let page = fs::read_to_string(folder.join("check.html")).unwrap();
    assert_eq!(page.matches("<tr class=").count(), rules.len());
    let one = dir.path().join("one.html");
    assert_eq!(artgs(&["check", shown, "--report", one.to_str().unwrap()]).status.code(), Some(0));
    assert_eq!(fs::read_to_string(one).unwrap(), page);
}

#[test]
#[cfg(feature = "check")]
fn a_broken_export_fails_the_check() {
    let dir = tempfile::tempdir().unwrap();
    let shown = dir.path().to_str().unwrap();
    write(dir.path());
    let early = artgs(&["check", shown]);
    assert_eq!(early.status.code(), Some(2), "{}", text(&early.stderr));
    assert!(text(&early.stderr).contains("artgs export"), "{}", text(&early.stderr));
    assert_eq!(artgs(&["export", shown, "--to", "urdf,glb"]).status.code(), Some(0));
    fs::write(dir.path().join("exports/glb/replica.glb"), "glTF").unwrap();
    let checked = artgs(&["check", shown]);
    assert_eq!(checked.status.code(), Some(3), "{}", text(&checked.stdout));
    assert!(text(&checked.stdout).contains("replica.glb"), "{}", text(&checked.stdout));
}

#[test]
fn names_frames_and_what_is_asked_for_are_in_the_files() {
    let dir = tempfile::tempdir().unwrap();
    let shown = dir.path().to_str().unwrap();
    write(dir.path());
    let exports = dir.path().join("exports");
    let export = |args: &[&str]| {
        let done = artgs(&[&["export", shown, "--to", "urdf,mjcf,partnet"], args].concat());
        assert_eq!(done.status.code(), Some(0), "{}", text(&done.stderr));
        let report = fs::read(exports.join("export.json")).unwrap();
        let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
        let names = report["links"].as_array().unwrap().iter().map(|l| l["name"].as_str().unwrap().to_owned());
        (names.collect::<Vec<_>>(), report)
    };
    let read = |file: &str| fs::read_to_string(exports.join(file)).unwrap();
    let (names, report) = export(&[]);
    assert_eq!(names, ["base", "door", "drawer"]);
    assert_eq!((&report["links"][1]["part"], &report["links"][1]["hinge"]), (&json!("part_1"), &json!("left")));
    // The front is along -Y already, and the cabinet is 0.56 m deep from y = -0.06. Smoothing moves corners by up to 2 cm,
    // because these meshes have few triangles.
    let shift = &report["frame"]["translation"];
    assert!((shift[1].as_f64().unwrap() + 0.22).abs() < 0.03 && shift[2].as_f64().unwrap().abs() < 0.03, "{shift}");
    assert_eq!(read("urdf/semantics.txt"), "base heavy body\ndoor hinge door\ndrawer slider drawer\n");
    assert_eq!(read("partnet/semantics.txt"), "link_0 heavy body\nlink_1 hinge door\nlink_2 slider drawer\n");
    let mjcf = read("mjcf/replica.xml");
    assert!(mjcf.contains("<jointpos name=\"door_joint_position\"") && !mjcf.contains("<actuator>"));

    let asked = ["--actuators", "motor", "--free-base", "--package", "my_cabinet", "--part-names", "--front", "x"];
    let (names, report) = export(&asked);
    assert_eq!(names, ["base", "part_1", "part_2"]);
    assert_eq!(report["options"]["front"], "x");
    assert!(read("urdf/replica.urdf").contains("package://my_cabinet/meshes/part_1_visual.obj"));
    let mjcf = read("mjcf/replica.xml");
    assert!(mjcf.contains("<motor name=\"part_1_motor\"") && mjcf.contains("<freejoint"));
    let checked = artgs(&["check", shown]);
    assert_eq!(checked.status.code(), Some(0), "{}{}", text(&checked.stdout), text(&checked.stderr));
    let page = dir.path().join("page.html");
    let viewed = artgs(&["view", shown, "--export", page.to_str().unwrap()]);
    assert_eq!(viewed.status.code(), Some(0), "{}", text(&viewed.stderr));

    // Another person knows better, and a part keeps a name of its own.
    let classes = r#"{"format": "artgs-corrections", "version": 1, "classes": [{"part": 1, "class": "flap"}]}"#;
    fs::write(dir.path().join("corrections.json"), classes).unwrap();
    let (names, report) = export(&[]);
    assert_eq!(names, ["base", "flap", "drawer"]);
    assert_eq!(
        (&report["links"][1]["class_given"], &report["links"][1]["class_confidence"]),
        (&json!(true), &json!(1.0))
    );
}

#[test]
fn bad_replicas_and_flags_are_refused_with_the_reason() {
    let dir = tempfile::tempdir().unwrap();
    let shown = dir.path().to_str().unwrap();
    let refused = |args: &[&str], words: &str| {
        let output = artgs(args);
        let message = text(&output.stderr);
        assert!(output.status.code() == Some(2) && message.contains(words), "{args:?}: {message}");
        assert!(!dir.path().join("exports").exists(), "nothing is left");
    };
    refused(&["export", shown], "replica.json");
    write(dir.path());
    refused(&["export", shown, "--to", "step"], "step");
    refused(&["export", shown, "--scale", "0"], "--scale");
    refused(&["export", shown, "--density=-3"], "--density");
    refused(&["export", shown, "--capture", "nowhere"], "nowhere");
    let file = dir.path().join("replica.json");
    let whole = fs::read_to_string(&file).unwrap();
    for (from, to, words) in [
        ("\"version\": 1", "\"version\": 9", "field `version` is 9"),
        ("\"upper\": 0.3", "\"upper\": NaN", "replica.json"),
        ("\"lower\": 0.0", "\"lower\": null", "invalid type: null"),
        ("meshes/start/part_1.ply", "meshes/start/part_7.ply", "there is no mesh meshes/start/part_7.ply"),
    ] {
        assert!(whole.contains(from), "{from}");
        fs::write(&file, whole.replacen(from, to, 1)).unwrap();
        refused(&["export", shown], words);
    }
    let zero = whole.replacen("-1.0", "0.0", 1);
    fs::write(&file, zero).unwrap();
    refused(&["export", shown], "field `axis` is not a unit vector");
    fs::write(&file, &whole).unwrap();
    fs::write(dir.path().join("meshes/start/part_1.ply"), "ply\n").unwrap();
    refused(&["export", shown], "part_1.ply");
}
