//! Good inputs that the cases copy: captures and recordings of a few small frames, a replica with its exports, and a run that
//! stopped after it found parts. Made once per run of the tests.

use artgs_core::{Joint, JointKind, Mesh, PerState, Replica, Rigid, State};
use artgs_io::capture::{RecordedNames, write_capture};
use artgs_io::{write_mesh_ply, write_replica};
use artgs_synth::{CaptureOptions, object, render_capture};
use glam::DVec3;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, OnceLock};

/// Where seeds and cases are; emptied when the tests begin.
pub(crate) fn root() -> &'static Path {
    static ROOT: OnceLock<PathBuf> = OnceLock::new();
    ROOT.get_or_init(|| {
        let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bad_inputs");
        let _ = fs::remove_dir_all(&root);
        fs::create_dir_all(&root).unwrap();
        root
    })
}

/// Copies a seed, or makes an empty folder if its name is empty. Files are linked.
pub(crate) fn copy(seed: &str, to: &Path) {
    fs::create_dir_all(to).unwrap();
    if !seed.is_empty() {
        link(&of(seed), to);
    }
}

fn link(from: &Path, to: &Path) {
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if source.is_dir() {
            fs::create_dir_all(&target).unwrap();
            link(&source, &target);
        } else if fs::hard_link(&source, &target).is_err() {
            fs::copy(&source, &target).unwrap();
        }
    }
}

/// The folder of a seed; makes it if this is its first use.
fn of(seed: &str) -> PathBuf {
    static MAKING: Mutex<()> = Mutex::new(());
    // A panic while a seed was made was reported.
    let _one_at_a_time = MAKING.lock().unwrap_or_else(|e| e.into_inner());
    let folder = root().join("seeds").join(seed);
    if !folder.exists() {
        fs::create_dir_all(&folder).unwrap();
        make(seed, &folder);
    }
    folder
}

fn make(seed: &str, folder: &Path) {
    let shown = folder.to_str().unwrap();
    let room = |layout: &str| {
        synth(&["blade", "-o", shown, "--scene", "room", "--layout", layout, "--views", "5", "--size", "64"])
    };
    match seed {
        "tiny" => synth(&["blade", "-o", shown, "--views", "4", "--test-views", "1", "--size", "48"]),
        "paris" => {
            synth(&["blade", "-o", shown, "--views", "4", "--test-views", "1", "--size", "48", "--layout", "paris"])
        }
        "fridge" => synth(&["fridge", "-o", shown, "--views", "12", "--test-views", "0", "--size", "96"]),
        "closed-laptop" => closed_laptop(folder),
        "two-objects" => two_objects(folder),
        "nerfstudio" | "tum" | "scanner-app" | "record3d" | "polycam" | "colmap" => room(seed),
        "containers" => link(&corpus(), folder),
        "replica" => replica(folder),
        "found" => found(folder),
        _ => panic!("there is no seed {seed}"),
    }
}

fn synth(args: &[&str]) {
    artgs(&[&["synth"], args].concat());
}

fn artgs(args: &[&str]) {
    let made = Command::new(env!("CARGO_BIN_EXE_artgs")).args(args).output().unwrap();
    assert!(made.status.success(), "{args:?}: {}", String::from_utf8_lossy(&made.stderr));
}

/// Recordings in one file, which the tests of their readers use, too.
fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../artgs-io/tests/corpus/containers")
}

/// A laptop that is closed at the start and open at the end: closed, the lid hides most of what rests.
fn closed_laptop(folder: &Path) {
    let values = PerState::new(4_f64.to_radians(), 95_f64.to_radians());
    let laptop = object("laptop", 0).unwrap().with_values(1, values);
    let options = CaptureOptions { views: 16, test_views: 0, size: 120, ..CaptureOptions::default() };
    write_capture(folder, &render_capture(&laptop, &options).unwrap(), &RecordedNames::new()).unwrap();
}

/// A shelf at the start, a washing machine at the end.
fn two_objects(folder: &Path) {
    let options = CaptureOptions { views: 12, test_views: 0, size: 64, ..CaptureOptions::default() };
    let [mut capture, other] =
        ["storage", "washer"].map(|name| render_capture(&object(name, 0).unwrap(), &options).unwrap());
    capture.states[State::END] = other.states[State::END].clone();
    write_capture(folder, &capture, &RecordedNames::new()).unwrap();
}

/// A run, in `out`, that has found parts in `capture`.
fn found(folder: &Path) {
    let [capture, out] = ["capture", "out"].map(|name| folder.join(name).to_str().unwrap().to_string());
    synth(&["fridge", "-o", &capture, "--views", "12", "--test-views", "0", "--size", "96"]);
    artgs(&["reconstruct", &capture, "-o", &out, "--stop-after", "discover", "--device", "cpu", "-q"]);
}

/// A box with a lid that turns and a drawer that slides.
fn replica(out: &Path) {
    let cuboid = |low, high| Mesh { colors: vec![[180, 120, 60]; 8], ..Mesh::cuboid(low, high) };
    let base = cuboid([-0.5, 0.0, 0.0], [0.5, 0.5, 1.0]);
    let lid = cuboid([-0.5, -0.06, 0.52], [0.5, -0.02, 1.0]);
    let drawer = cuboid([-0.42, -0.06, 0.08], [0.42, -0.01, 0.46]);
    let hinge = Rigid::about(DVec3::NEG_Z, DVec3::new(-0.5, -0.06, 0.0), 1.4);
    let joints = [
        Joint::from_motion(JointKind::Revolute, &hinge).with_origin_near(DVec3::new(0.0, 0.0, 0.76)),
        Joint::from_motion(JointKind::Prismatic, &Rigid::shift(DVec3::new(0.0, -0.3, 0.0)))
            .with_origin_near(DVec3::new(0.0, -0.06, 0.3)),
    ];
    let replica = Replica::new(&joints);
    for (part, mesh) in replica.parts.iter().zip([&base, &lid, &drawer]) {
        for state in State::ALL {
            let motion = if state == State::START { Rigid::IDENTITY } else { replica.world_motion(part.id) };
            write_mesh_ply(&out.join(&part.meshes[state]), &mesh.moved(&motion)).unwrap();
            write_truth(out, state, part.id, &mesh.moved(&motion));
        }
    }
    for state in State::ALL {
        write_mesh_ply(&out.join(&replica.whole[state]), &base).unwrap();
        write_mesh_ply(&out.join(format!("gt/{0}/{0}_rotate.ply", state.name())), &base).unwrap();
    }
    write_replica(out, &replica).unwrap();
    fs::write(out.join("gt/trans.json"), TRUTH).unwrap();
}

/// The ground truth of the replica, which is exactly the replica.
const TRUTH: &str = r#"{"trans_info": [
    {"axis": {"d": [0.0, 0.0, -1.0], "o": [-0.5, -0.06, 0.0]}, "part_id": 2, "rotate": {"l": 0.0, "r": 80.2140913}, "type": "rotate"},
    {"axis": {"d": [0.0, -1.0, 0.0], "o": [0.0, 0.0, 0.3]}, "part_id": 3, "translate": {"l": 0.0, "r": 0.3}, "type": "translate"}
]}"#;

fn write_truth(out: &Path, state: State, part: usize, mesh: &Mesh) {
    let name = if part == 0 { "static".into() } else { format!("dynamic_{}", part - 1) };
    write_mesh_ply(&out.join(format!("gt/{0}/{0}_{name}_rotate.ply", state.name())), mesh).unwrap();
}
