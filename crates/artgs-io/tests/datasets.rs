//! Tests on complete datasets, if available: `ARTGS_DATASETS` or `../shared/datasets` beside the repository.

#![allow(clippy::unwrap_used, clippy::print_stderr, reason = "helpers of tests are tests")]

use artgs_core::{Capture, State, View};
use artgs_io::summary::depth_bounds;
use artgs_io::{load_capture, load_ground_truth, summarize};
use glam::{DVec2, DVec3};
use std::path::{Path, PathBuf};

const NAMES: [&str; 4] =
    ["mini_fridge_habitat_200", "mini_table_calvin_A_200", "table_calvin_A3_wb", "storage_45940_wb"];

/// The available datasets; prints a note if there are none.
fn datasets() -> Vec<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/datasets");
    let root = std::env::var_os("ARTGS_DATASETS").map_or(beside, PathBuf::from);
    let found: Vec<PathBuf> = NAMES.iter().map(|n| root.join(n)).filter(|d| d.is_dir()).collect();
    if found.is_empty() {
        eprintln!("SKIPPED: no datasets in {}; set ARTGS_DATASETS", root.display());
    }
    found
}

fn load(dir: &Path) -> Capture {
    load_capture(dir).unwrap_or_else(|e| panic!("{e}"))
}

/// Number of depth points of `from` that project onto a smooth surface in `to`, and the fraction whose depth agrees within
/// `within`.
fn agreement(from: &View, to: &View, within: f64) -> (usize, f64) {
    let (w, _) = from.size();
    let (w2, h2) = to.size();
    let target = to.depth.as_ref().unwrap();
    let (mut seen, mut agree) = (0usize, 0usize);
    for (i, d) in from.depth.as_ref().unwrap().iter().enumerate().filter(|(_, d)| *d > 0.0) {
        let pixel = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
        let (uv, z) = to.camera.project(from.camera.unproject(pixel, f64::from(d)));
        let (u, v) = (uv.x.floor(), uv.y.floor());
        if z <= 0.0 || u < 1.0 || v < 1.0 || u >= (w2 - 1) as f64 || v >= (h2 - 1) as f64 {
            continue;
        }
        let at = |du: usize, dv: usize| f64::from(target.at((v as usize + dv - 1) * w2 + u as usize + du - 1));
        // The depth of an inclined surface changes within a pixel, so the neighbourhood must contain the point's depth. Points
        // at depth edges and occluded points are ignored.
        let around: Vec<f64> = (0..9).map(|k| at(k % 3, k / 3)).collect();
        let (low, high) = around.iter().fold((f64::MAX, f64::MIN), |(a, b), d| (a.min(*d), b.max(*d)));
        if low == 0.0 || high - low > 0.05 || z > high + 0.03 {
            continue;
        }
        seen += 1;
        agree += usize::from(z > low - within && z < high + within);
    }
    (seen, agree as f64 / seen.max(1) as f64)
}

/// The other view with the most similar camera.
fn neighbour(views: &[View], of: usize) -> &View {
    let gaze = |v: &View| v.camera.world_to_camera.inverse().turn(DVec3::Z);
    let others = views.iter().enumerate().filter(|(i, _)| *i != of).map(|(_, v)| v);
    others.max_by(|a, b| gaze(a).dot(gaze(&views[of])).total_cmp(&gaze(b).dot(gaze(&views[of])))).unwrap()
}

#[test]
fn depth_of_one_view_lands_on_depth_of_its_neighbour() {
    for dir in datasets() {
        let capture = load(&dir);
        assert!(capture.warnings.is_empty(), "{:?}", capture.warnings);
        for state in &capture.states {
            assert_eq!((state.train.len(), state.test.len()), (64, 16));
            let (seen, fraction) = agreement(&state.train[0], neighbour(&state.train, 0), 0.003);
            eprintln!("{}: {seen} points, {:.1} % agree", dir.display(), 100.0 * fraction);
            assert!(seen > 500 && fraction > 0.9, "{}: {seen} points, {fraction}", dir.display());
        }
        eprintln!("{}", summarize(&capture));
    }
}

#[test]
fn depth_fills_the_true_mesh() {
    for dir in datasets() {
        let (capture, truth) = (load(&dir), load_ground_truth(&dir.join("gt")).unwrap());
        assert_eq!(truth.joints.len(), truth.movable.len());
        for s in State::ALL {
            let vertices = truth.whole[s].vertices.iter().map(|v| DVec3::from_array(v.map(f64::from)));
            let mesh = artgs_io::summary::Bounds::of(vertices).unwrap();
            let seen = depth_bounds(&capture.states[s].train).unwrap();
            let off = (seen.min - mesh.min).abs().max((seen.max - mesh.max).abs()).max_element();
            eprintln!("{}: boxes differ by {off:.4}", dir.display());
            assert!(off < 0.05, "{}: depth {seen:?}, mesh {mesh:?}", dir.display());
        }
        // The ground-truth joints move the parts from the start to the end.
        for (joint, meshes) in truth.joints.iter().zip(&truth.movable) {
            let (start, end) = (&meshes[State::START], &meshes[State::END]);
            let moved = start.moved(&joint.start_to_end());
            // Both meshes have the same vertices in different orders.
            let far = |a: &[f32; 3]| {
                let distance = |b: &[f32; 3]| (0..3).map(|c| (a[c] - b[c]).abs()).fold(0.0, f32::max);
                end.vertices.iter().map(distance).fold(f32::MAX, f32::min)
            };
            let worst = moved.vertices.iter().map(far).fold(0.0, f32::max);
            assert!(worst < 1e-3, "{}: {joint:?} is off by {worst}", dir.display());
        }
    }
}

#[cfg(unix)]
#[test]
fn the_paris_files_of_a_dataset_give_the_same_cameras() {
    for dir in datasets().into_iter().take(1) {
        let paris = tempfile::tempdir().unwrap();
        for state in ["start", "end"] {
            std::fs::create_dir(paris.path().join(state)).unwrap();
            for name in ["camera_train.json", "camera_test.json"] {
                std::fs::copy(dir.join(state).join(name), paris.path().join(state).join(name)).unwrap();
            }
            for split in ["train", "test"] {
                let to = paris.path().join(state).join(split);
                std::os::unix::fs::symlink(dir.canonicalize().unwrap().join(state).join(split), to).unwrap();
            }
        }
        let (a, b) = (load(&dir), load(paris.path()));
        for (a, b) in a.states.iter().flat_map(|s| &s.train).zip(b.states.iter().flat_map(|s| &s.train)) {
            assert_eq!((&a.name, &a.rgba, &a.depth), (&b.name, &b.rgba, &b.depth));
            assert_eq!(a.camera, b.camera);
        }
    }
}
