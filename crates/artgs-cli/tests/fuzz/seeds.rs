//! Valid folders that targets mutate: tiny captures and recordings of the generator, and what the writers of the workspace make.

use artgs_core::{DepthMap, Joint, JointKind, Mesh, Replica, Rigid, Splats, State};
use artgs_io::asset::spz::{SpzVersion, write_spz};
use artgs_io::recording::{RecordingFormat, RecordingOptions, load_recording, write_recording};
use artgs_io::{image_io, write_mesh_ply, write_replica, write_splat_ply};
use glam::DVec3;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Makes a seed in a folder.
pub(crate) fn copy(seed: &str, folder: &Path) {
    fs::create_dir_all(folder).unwrap();
    let shown = folder.to_str().unwrap();
    let room =
        |layout: &str| synth(&["--out", shown, "--scene", "room", "--layout", layout, "--views", "3", "--size", "32"]);
    match seed {
        "capture" => synth(&["--out", shown, "--views", "2", "--test-views", "1", "--size", "24"]),
        "paris" => synth(&["--out", shown, "--views", "2", "--test-views", "1", "--size", "24", "--layout", "paris"]),
        "nerfstudio" | "tum" | "scanner-app" | "record3d" | "polycam" | "colmap" => room(seed),
        "stray" => written(folder, RecordingFormat::Stray),
        "7-scenes" => written(folder, RecordingFormat::SevenScenes),
        "npy" => npy(folder),
        "containers" => containers(folder),
        "replica" => replica(folder),
        "documents" => documents(folder),
        "found" => found(folder),
        "report" => report(folder),
        "requests" => {
            crate::requests::REQUESTS.iter().for_each(|(name, text)| fs::write(folder.join(name), text).unwrap())
        }
        _ => panic!("there is no seed {seed}"),
    }
}

fn synth(args: &[&str]) {
    artgs(&[&["synth", "blade"], args].concat());
}

fn artgs(args: &[&str]) {
    let made = Command::new(env!("CARGO_BIN_EXE_artgs")).args(args).output().unwrap();
    assert!(made.status.success(), "{args:?}: {}", String::from_utf8_lossy(&made.stderr));
}

/// A recording in another format than the generator writes.
fn written(folder: &Path, format: RecordingFormat) {
    let from = tempfile::tempdir().unwrap();
    let shown = from.path().to_str().unwrap();
    synth(&["--out", shown, "--scene", "room", "--layout", "tum", "--views", "3", "--size", "32"]);
    let recording = load_recording(&from.path().join("start"), &RecordingOptions::default()).unwrap();
    write_recording(&folder.join("start"), &recording, format).unwrap();
}

/// A recording whose depth is NumPy arrays.
fn npy(folder: &Path) {
    written(folder, RecordingFormat::Stray);
    for entry in fs::read_dir(folder.join("start/depth")).unwrap().map(|e| e.unwrap().path()) {
        let image = image_io::read_depth(&entry).unwrap();
        let header =
            format!("{{'descr': '<u2', 'fortran_order': False, 'shape': ({}, {}), }}\n", image.height, image.width);
        let mut bytes = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes()].concat();
        bytes.extend(image.counts.iter().flat_map(|c| c.to_le_bytes()));
        fs::write(entry.with_extension("npy"), bytes).unwrap();
        fs::remove_file(entry).unwrap();
    }
}

/// Recordings in one file, which the tests of their readers use, too.
fn containers(folder: &Path) {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("../artgs-io/tests/corpus/containers");
    for entry in fs::read_dir(corpus).unwrap().map(|e| e.unwrap()) {
        fs::copy(entry.path(), folder.join(entry.file_name())).unwrap();
    }
}

/// A replica of three boxes with its ground truth.
fn replica(out: &Path) {
    let joints = [
        Joint::from_motion(JointKind::Revolute, &Rigid::about(DVec3::Z, DVec3::X, 0.7)),
        Joint::from_motion(JointKind::Prismatic, &Rigid::shift(DVec3::Y)),
    ];
    let replica = Replica::new(&joints);
    let mesh = Mesh { colors: vec![[180, 120, 60]; 8], ..Mesh::cuboid([0.0; 3], [1.0, 0.5, 0.2]) };
    for state in State::ALL {
        replica.parts.iter().for_each(|part| write_mesh_ply(&out.join(&part.meshes[state]), &mesh).unwrap());
        write_mesh_ply(&out.join(&replica.whole[state]), &mesh).unwrap();
        let name = state.name();
        for part in ["", "_static", "_dynamic_0", "_dynamic_1"] {
            write_mesh_ply(&out.join(format!("gt/{name}/{name}{part}_rotate.ply")), &mesh).unwrap();
        }
    }
    write_replica(out, &replica).unwrap();
    fs::write(out.join("gt/trans.json"), TRUTH).unwrap();
}

const TRUTH: &str = r#"{"trans_info": [
{"axis": {"d": [0.0, 0.0, 1.0], "o": [1.0, 0.0, 0.0]}, "part_id": 2, "rotate": {"l": 0.0, "r": 40.1}, "type": "rotate"},
{"axis": {"d": [0.0, 1.0, 0.0], "o": [0.0, 0.0, 0.0]}, "part_id": 3, "parent": 2, "screw": {"l": 0.0, "r": 90.0, "pitch": 0.1}, "type": "screw"}
]}"#;

const CORRECTIONS: &str = r#"{"format": "artgs-corrections", "version": 1,
"centres": [{"action": "move", "part": 1, "position": [0.1, 0, 0.4]}, {"action": "add", "position": [0, 0, 1]},
 {"action": "delete", "part": 2}, {"action": "merge", "part": 3, "into": 1},
 {"action": "split", "part": 4, "plane": {"point": [0, 0, 0.3], "normal": [0, 0, 1]}},
 {"action": "split", "part": 1, "points": [[0.5, 0, 0.25]]}],
"joints": [{"part": 1, "type": "revolute"},
 {"part": 4, "type": "screw", "joint": {"axis": [0, -1, 0], "origin": [0, 0, 0], "value": 0.2, "pitch": 0.01}}]}"#;

/// One file of each of the other kinds.
fn documents(folder: &Path) {
    fs::write(folder.join("corrections.json"), CORRECTIONS).unwrap();
    let settings = "seed = 3\nparts = \"2..5\"\n[articulate]\nsteps = 30\n[articulate.loss]\nssim = 0.2\n[surface]\nresolution = 80.0\n";
    fs::write(folder.join("settings.toml"), artgs::Config::default().to_toml().unwrap()).unwrap();
    fs::write(folder.join("few.toml"), settings).unwrap();
    let mut splats = Splats::empty(1);
    for i in 0..12 {
        splats.means.push([i as f32, 0.5, -0.25]);
        splats.rotations.push([1.0, 0.0, 0.1, 0.0]);
        splats.log_scales.push([-3.0; 3]);
        splats.logit_opacities.push(1.0);
        splats.sh.extend([0.1; 12]);
    }
    write_splat_ply(&folder.join("splats.ply"), &splats, None, "world").unwrap();
    write_spz(&folder.join("splats.spz"), &splats, SpzVersion::V3).unwrap();
    write_spz(&folder.join("splats_4.spz"), &splats, SpzVersion::V4).unwrap();
    let rgba: Vec<[u8; 4]> = (0..16 * 12).map(|i| [i as u8, 90, 3, 255]).collect();
    image_io::write_rgba(&folder.join("colour.png"), 16, 12, &rgba).unwrap();
    let counts = DepthMap::new((0..16 * 12).collect(), 1000.0);
    image_io::write_depth(&folder.join("depth.png"), 16, 12, &counts).unwrap();
    let ascii = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
                 property uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                 0 0 0 9 9 9\n1 0 0 9 9 9\n0 1 0 9 9 9\n3 0 1 2\n";
    fs::write(folder.join("ascii.ply"), ascii).unwrap();
    write_mesh_ply(&folder.join("mesh.ply"), &Mesh::cuboid([0.0; 3], [1.0; 3])).unwrap();
    let header = r#"{"a.weight":{"dtype":"F32","shape":[2,3],"data_offsets":[0,24]},"b":{"dtype":"F32","shape":[1],"data_offsets":[24,28]}}"#;
    let tensors = [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), &[0; 28]].concat();
    fs::write(folder.join("weights.safetensors"), tensors).unwrap();
}

/// The report of an export.
fn report(folder: &Path) {
    let report = artgs_io::export_report::ExportReport::default();
    report.save(&artgs_io::RunFolder::new(folder)).unwrap();
}

/// A capture in `capture` and a run in `out` that has found its parts.
fn found(folder: &Path) {
    let [capture, out] = ["capture", "out"].map(|name| folder.join(name).to_str().unwrap().to_string());
    artgs(&["synth", "fridge", "-o", &capture, "--views", "10", "--test-views", "0", "--size", "64"]);
    artgs(&["reconstruct", &capture, "-o", &out, "--stop-after", "discover", "--device", "cpu", "-q"]);
    fs::write(folder.join("out/corrections.json"), CORRECTIONS).unwrap();
}
