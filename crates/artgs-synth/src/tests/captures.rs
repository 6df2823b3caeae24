//! Captures: images, files, ground truth.

use super::small;
use crate::render::{Renderer, planned_views};
use crate::write::StatePair;
use crate::{CaptureOptions, Layout, SynthError, capture_info, object, render_capture, write_object};
use artgs_core::{Capture, Mesh, State};
use artgs_io::{load_capture, load_ground_truth};
use glam::{DVec2, DVec3, Vec3};
use std::collections::BTreeMap;
use std::path::Path;

/// Distance of a point from a triangle.
fn to_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a).normalize();
    let inside = [(a, b), (b, c), (c, a)].iter().all(|(s, e)| (e - s).cross(p - s).dot(normal) >= 0.0);
    if inside {
        return (p - a).dot(normal).abs();
    }
    let to_edge = |(s, e): &(DVec3, DVec3)| {
        let t = ((p - s).dot(e - s) / (e - s).length_squared()).clamp(0.0, 1.0);
        (p - s.lerp(*e, t)).length()
    };
    [(a, b), (b, c), (c, a)].iter().map(to_edge).fold(f64::INFINITY, f64::min)
}

fn to_mesh(p: DVec3, mesh: &Mesh) -> f64 {
    let vertex = |i: u32| Vec3::from(mesh.vertices[i as usize]).as_dvec3();
    mesh.triangles.iter().map(|t| to_triangle(p, t.map(vertex))).fold(f64::INFINITY, f64::min)
}

#[test]
fn depth_back_projects_onto_the_true_mesh_of_the_part_seen() {
    for name in ["washer", "scissor", "storage_2d4o", "door_with_drawer", "screw_cap"] {
        let object = object(name, 3).unwrap();
        let options = CaptureOptions { seed: 3, ..small() };
        let renderer = Renderer::new(&object, &options);
        let mut pixels = vec![0; object.parts.len()];
        for planned in &renderer.planned_views {
            let (view, labels) = renderer.render(planned);
            let meshes: Vec<Mesh> = (0..object.parts.len()).map(|p| object.mesh(p, planned.state)).collect();
            let depth = view.depth.unwrap();
            for (i, d) in depth.iter().enumerate() {
                assert_eq!(d > 0.0, labels[i] > 0, "{name}: labels are where depth is");
                if d > 0.0 {
                    let pixel = DVec2::new((i % 48) as f64 + 0.5, (i / 48) as f64 + 0.5);
                    let part = usize::from(labels[i]) - 1;
                    let distance = to_mesh(view.camera.unproject(pixel, f64::from(d)), &meshes[part]);
                    assert!(distance < 0.001, "{name} {} {pixel}: {distance} from part {part}", view.name);
                    pixels[part] += 1;
                }
            }
        }
        assert!(pixels.iter().all(|n| *n > 40), "{name}: every part is seen: {pixels:?}");
    }
}

#[test]
fn the_whole_object_is_in_every_view_and_fills_it() {
    for info in crate::objects() {
        let object = object(info.name, 0).unwrap();
        for planned in planned_views(&object, &CaptureOptions { views: 8, ..small() }, StatePair(0)) {
            let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            for part in 0..object.parts.len() {
                for p in object.mesh(part, planned.state).vertices {
                    let (pixel, _) = planned.stated.project(Vec3::from(p).as_dvec3());
                    (low, high) = (low.min(pixel), high.max(pixel));
                }
            }
            assert!(
                low.min_element() > 1.0 && high.max_element() < 47.0,
                "{} {}: {low} {high}",
                info.name,
                planned.name
            );
            assert!((high - low).max_element() > 10.0, "{} {}: {low} {high}", info.name, planned.name);
        }
    }
}

/// Relative path and content of every file under a folder.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap().map(|e| e.unwrap().path()) {
            if entry.is_dir() {
                folders.push(entry);
            } else {
                let name = entry.strip_prefix(folder).unwrap().display().to_string();
                found.insert(name, std::fs::read(entry).unwrap());
            }
        }
    }
    found
}

#[test]
fn same_seed_same_bytes_on_any_number_of_threads() {
    let mut options = small();
    options.degradation.set("depth=0.003").unwrap();
    options.degradation.set("pose=0.2,0.004").unwrap();
    let write = |threads: usize, options: CaptureOptions| {
        let dir = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| write_object("usb", &options, dir.path())).unwrap();
        files(dir.path())
    };
    let once = write(1, options);
    // Images, masks, cameras and meshes of each state; ground truth, marker and the list of all files.
    assert_eq!(once.len(), 2 * (3 * 4 + 2 + 3) + 3);
    assert!(once == write(3, options));
    assert!(once != write(1, CaptureOptions { seed: 1, ..options }));
}

fn assert_same(a: &Capture, b: &Capture) {
    for (a, b) in a.states.iter().zip(&b.states) {
        assert_eq!((a.train.len(), a.test.len()), (b.train.len(), b.test.len()));
        // The depth of held-out views is not read.
        assert!(a.train.iter().zip(&b.train).all(|(a, b)| a.depth == b.depth && a.depth.is_some()));
        for (a, b) in a.train.iter().chain(&a.test).zip(b.train.iter().chain(&b.test)) {
            assert!(a.rgba == b.rgba, "{}", a.name);
            let (ka, kb) = (a.camera.intrinsics, b.camera.intrinsics);
            let close = |x: f64, y: f64| (x - y).abs() < 1e-9;
            assert!(close(ka.fx, kb.fx) && close(ka.fy, kb.fy) && close(ka.cx, kb.cx) && close(ka.cy, kb.cy));
            let p = DVec3::new(0.3, 0.1, 0.7);
            let off = a.camera.world_to_camera.apply(p) - b.camera.world_to_camera.apply(p);
            assert!(off.length() < 1e-9, "{} {off}", a.name);
        }
    }
}

#[test]
fn both_layouts_read_back_as_rendered() {
    let in_memory = render_capture(&object("laptop", 0).unwrap(), &small()).unwrap();
    for layout in [Layout::ArtGs, Layout::Paris] {
        let dir = tempfile::tempdir().unwrap();
        write_object("laptop", &CaptureOptions { layout, ..small() }, dir.path()).unwrap();
        assert_eq!(dir.path().join("start/camera_train.json").is_file(), layout == Layout::Paris);
        let back = load_capture(dir.path()).unwrap();
        assert_eq!(back.warnings, Vec::<String>::new());
        assert_same(&in_memory, &back);
    }
}

#[test]
fn the_ground_truth_reads_back_with_chains_and_screws() {
    for name in ["door_with_drawer", "screw_cap", "table_2d2o"] {
        let dir = tempfile::tempdir().unwrap();
        let made = write_object(name, &small(), dir.path()).unwrap();
        let object = object(name, 0).unwrap();
        let truth = load_ground_truth(&dir.path().join("gt")).unwrap();
        assert_eq!((truth.joints.len() + 1, made.parts), (object.parts.len(), object.parts.len()));
        for (i, joint) in truth.joints.iter().enumerate() {
            assert_eq!(joint.kind, object.parts[i + 1].joint.unwrap().kind);
            assert_eq!(truth.parents[i].map(|p| p + 1), object.parts[i + 1].parent);
            let moved = truth.movable[i][State::START].moved(&truth.start_to_end(i));
            for (a, b) in moved.vertices.iter().zip(&truth.movable[i][State::END].vertices) {
                assert!((Vec3::from(*a) - Vec3::from(*b)).length() < 1e-5, "{name} part {i}");
            }
        }
        assert_eq!(truth.fixed[State::START], object.mesh(0, State::START));
        let triangles: usize = (0..object.parts.len()).map(|p| object.mesh(p, State::END).triangles.len()).sum();
        assert_eq!(truth.whole[State::END].triangles.len(), triangles);
        let mask = artgs_io::image_io::read_rgba(&dir.path().join("gt/part_masks/end/train/0002.png")).unwrap();
        let ids: std::collections::BTreeSet<u8> = mask.pixels.iter().map(|p| p[0]).collect();
        assert!(ids.contains(&0) && ids.contains(&1) && *ids.last().unwrap() as usize <= object.parts.len());
    }
}

#[test]
fn an_interrupted_capture_is_replaced_and_a_complete_one_kept() {
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(capture_info(dir.path()), None);
    let first = write_object("blade", &small(), dir.path()).unwrap();
    assert!(first.complete && capture_info(dir.path()) == Some(first.clone()));
    let image = dir.path().join("start/train/rgba/0002.png");
    std::fs::remove_file(&image).unwrap();
    write_object("blade", &small(), dir.path()).unwrap();
    assert!(!image.exists(), "a complete capture is not rendered again");

    let marker = dir.path().join("synth.json");
    let text = std::fs::read_to_string(&marker).unwrap();
    std::fs::write(&marker, text.replace("true", "false")).unwrap();
    std::fs::write(dir.path().join("notes.txt"), "mine").unwrap();
    assert!(!capture_info(dir.path()).unwrap().complete);
    write_object("blade", &small(), dir.path()).unwrap();
    assert!(image.exists() && capture_info(dir.path()).unwrap().complete);

    write_object("blade", &CaptureOptions { views: 2, ..small() }, dir.path()).unwrap();
    assert!(!image.exists(), "images of an earlier capture are removed");
    assert!(dir.path().join("notes.txt").exists());

    let mine = dir.path().join("start/train/rgba/mine.png");
    std::fs::write(&mine, "mine").unwrap();
    let error = write_object("blade", &small(), dir.path()).unwrap_err();
    assert!(error.to_string().contains("mine.png"), "{error}");
    assert!(mine.exists() && dir.path().join("start/train/rgba/0001.png").exists(), "nothing is removed");
}

#[test]
fn impossible_options_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let mut noisy = small();
    noisy.degradation.depth_noise = f64::NAN;
    for options in [CaptureOptions { views: 0, ..small() }, CaptureOptions { size: 4, ..small() }, noisy] {
        let error = write_object("blade", &options, dir.path()).unwrap_err();
        assert!(matches!(error, SynthError::Options(_)), "{error}");
    }
    assert!(write_object("sofa", &small(), dir.path()).is_err());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}
