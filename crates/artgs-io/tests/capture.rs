//! Tiny captures in both layouts: loading, warnings, and errors that name file, frame and key.

#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

use artgs_core::{Camera, Capture, DepthMap, Intrinsics, State};
use artgs_io::capture::image_sizes;
use artgs_io::image_io::{write_depth, write_rgb, write_rgba};
use artgs_io::{CaptureOptions, load_capture, load_capture_with, summarize};
use glam::{DMat3, DVec3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const W: u32 = 16;
const H: u32 = 12;
const VIEWS: usize = 3;

/// Camera-to-world with OpenGL axes: cameras around the origin, two units away.
fn pose(view: usize) -> Value {
    let angle = 0.7 * view as f64;
    let eye = DVec3::new(2.0 * angle.cos(), 2.0 * angle.sin(), 0.5);
    let k = Intrinsics { fx: 20.0, fy: 20.0, cx: 8.0, cy: 6.0, width: W, height: H };
    let to_world = Camera::look_at(k, eye, DVec3::ZERO, DVec3::Z).world_to_camera.inverse();
    let m = to_world.matrix() * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let rows: Vec<Value> = (0..3).map(|r| json!([m.row(r).x, m.row(r).y, m.row(r).z, eye[r]])).collect();
    json!([rows[0], rows[1], rows[2], [0.0, 0.0, 0.0, 1.0]])
}

/// Everything at a depth in millimetres.
fn depth_of(count: u16, pixels: u32) -> DepthMap {
    DepthMap::new(vec![count; pixels as usize], 1000.0)
}

fn disc() -> Vec<[u8; 4]> {
    let inside = |i: u32| (i % W).abs_diff(W / 2) < 4 && (i / W).abs_diff(H / 2) < 4;
    (0..W * H).map(|i| if inside(i) { [200, 90, 30, 255] } else { [0; 4] }).collect()
}

/// A capture with images under `STATE/train/rgba`, depth under `STATE/train/depth`, and both kinds of camera files.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        for (time, state) in ["start", "end"].into_iter().enumerate() {
            let mut frames = Vec::new();
            let mut paris = json!({"K": [[20.0, 0, 8.0], [0, 20.0, 6.0], [0, 0, 1]]});
            for view in 0..VIEWS {
                let image = format!("{state}/train/rgba/{view:04}.png");
                write_rgba(&folder.path(&image), W, H, &disc()).unwrap();
                let depth = folder.path(&format!("{state}/train/depth/{view:04}.png"));
                write_depth(&depth, W, H, &depth_of(2000, W * H)).unwrap();
                frames.push(json!({"file_path": image, "time": time, "transform_matrix": pose(view)}));
                paris[format!("{view:04}")] = pose(view);
            }
            let root = json!({"fl_x": 20.0, "fl_y": 20.0, "cx": 8.0, "cy": 6.0, "w": W, "h": H,
                              "camera_angle_x": 0.7610127542, "frames": frames});
            folder.write_json(&transforms(state), &root);
            folder.write_json(&format!("{state}/camera_train.json"), &paris);
        }
        folder
    }

    fn dir(&self) -> &Path {
        self.0.path()
    }

    fn path(&self, name: &str) -> PathBuf {
        let path = self.dir().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    fn write_json(&self, name: &str, value: &Value) {
        std::fs::write(self.path(name), serde_json::to_string_pretty(value).unwrap()).unwrap();
    }

    fn edit(&self, name: &str, change: impl FnOnce(&mut Value)) {
        let mut value = serde_json::from_slice(&std::fs::read(self.path(name)).unwrap()).unwrap();
        change(&mut value);
        self.write_json(name, &value);
    }

    fn edit_text(&self, name: &str, from: &str, to: &str) {
        let text = std::fs::read_to_string(self.path(name)).unwrap();
        assert!(text.contains(from), "{from:?} is in {name}");
        std::fs::write(self.path(name), text.replacen(from, to, 1)).unwrap();
    }

    fn remove(&self, name: &str) {
        std::fs::remove_file(self.path(name)).unwrap();
    }

    fn without_depth(self) -> Self {
        for state in ["start", "end"] {
            std::fs::remove_dir_all(self.dir().join(state).join("train/depth")).unwrap();
        }
        self
    }

    fn into_paris(self) -> Self {
        self.remove(&transforms("start"));
        self.remove(&transforms("end"));
        self
    }

    fn load(&self) -> Capture {
        load_capture(self.dir()).unwrap()
    }

    /// Asserts that loading fails with a message that holds all words.
    fn refused(&self, words: &[&str]) {
        let message = load_capture(self.dir()).unwrap_err().to_string();
        for word in words {
            assert!(message.contains(word), "{word:?} is missing in: {message}");
        }
    }
}

fn transforms(state: &str) -> String {
    format!("transforms_train_{state}.json")
}

const START: &str = "transforms_train_start.json";
const FRAME_1: &str = "transforms_train_start.json, frame 1 (start/train/rgba/0001.png)";

fn cameras(capture: &Capture) -> Vec<(String, Camera)> {
    capture.states.iter().flat_map(|s| &s.train).map(|v| (v.name.clone(), v.camera)).collect()
}

#[test]
fn large_images_are_reduced_with_their_cameras_and_depth() {
    let folder = Folder::new();
    let (whole, half) = (
        folder.load(),
        load_capture_with(folder.dir(), &CaptureOptions { longest_side: 8, ..CaptureOptions::default() }).unwrap(),
    );
    assert!(half.warnings.iter().all(|w| w.contains("16x12 pixels are used at 8x6")) && half.warnings.len() == 2);
    for (large, small) in whole.states.iter().flat_map(|s| &s.train).zip(half.states.iter().flat_map(|s| &s.train)) {
        assert_eq!(small.size(), (8, 6));
        // A point is at half its pixel.
        let point = DVec3::new(0.1, -0.2, 0.05);
        let (at, there) = (large.camera.project(point).0, small.camera.project(point).0);
        assert!((at * 0.5 - there).length() < 1e-9);
        let depth = small.depth.as_ref().unwrap();
        assert!(depth.iter().all(|d| d == 0.0 || d == 2.0));
        let (shown, masked) =
            (depth.iter().filter(|d| *d > 0.0).count(), small.rgba.iter().filter(|p| p[3] > 127).count());
        assert!(shown > 0 && shown.abs_diff(masked) <= 12, "{shown} {masked}");
        assert!(small.rgba.iter().all(|p| p[3] == 0 || p[..3] == [200, 90, 30]));
    }
    let sizes = image_sizes(folder.dir()).unwrap();
    assert_eq!((sizes.train, sizes.test), (vec![(16, 12); 6], vec![]));
}

#[test]
fn both_layouts_load_to_equal_captures() {
    let folder = Folder::new();
    let artgs = folder.load();
    assert!(artgs.warnings.is_empty(), "{:?}", artgs.warnings);
    assert!(artgs.has_depth() && artgs.states.iter().all(|s| s.train.len() == VIEWS && s.test.is_empty()));
    let view = &artgs.states[State::END].train[2];
    assert_eq!((view.name.as_str(), view.size()), ("end/train/rgba/0002.png", (16, 12)));
    assert_eq!(view.rgba, disc());
    let depth = view.depth.as_ref().unwrap();
    assert!(
        depth.iter().zip(disc()).all(|(d, p)| d == if p[3] == 255 { 2.0 } else { 0.0 }),
        "depth only on the object"
    );
    assert!((view.camera.project(DVec3::ZERO).0 - glam::DVec2::new(8.0, 6.0)).length() < 1e-9);
    assert!(view.camera.project(DVec3::Z * 0.1).0.y < 6.0, "up is up");

    let paris = folder.into_paris().load();
    assert_eq!(cameras(&artgs), cameras(&paris));
    assert_eq!(paris.states[State::START].train[0].depth, artgs.states[State::START].train[0].depth);
}

#[test]
fn paris_images_may_lie_in_the_split_folder() {
    let folder = Folder::new().into_paris();
    for view in 0..VIEWS {
        let (from, to) = (format!("start/train/rgba/{view:04}.png"), format!("start/train/{view:04}.png"));
        std::fs::rename(folder.path(&from), folder.path(&to)).unwrap();
    }
    let capture = folder.load();
    assert_eq!(capture.states[State::START].train[1].name, "start/train/0001.png");
    assert!(capture.has_depth());
}

#[test]
fn intrinsics_fall_back_on_angles_and_images() {
    let folder = Folder::new();
    folder.edit(START, |root| {
        for key in ["fl_x", "fl_y", "cx", "cy", "w", "h"] {
            root.as_object_mut().unwrap().remove(key);
        }
    });
    let k = folder.load().states[State::START].train[0].camera.intrinsics;
    assert!((k.fx - 20.0).abs() < 1e-6 && k.fy == k.fx, "{k:?}");
    assert_eq!((k.cx, k.cy, k.width, k.height), (8.0, 6.0, 16, 12));
    folder.edit(START, |root| root["camera_angle_y"] = json!(2.0 * (6.0f64 / 30.0).atan()));
    assert!((folder.load().states[State::START].train[0].camera.intrinsics.fy - 30.0).abs() < 1e-9);
    folder.edit(START, |root| drop(root.as_object_mut().unwrap().remove("camera_angle_x")));
    folder.refused(&[START, "key `camera_angle_x`", "missing", "fl_x"]);
}

#[test]
fn listed_paths_may_lack_suffix_and_rgba_folder_and_frames_are_sorted() {
    let folder = Folder::new();
    folder.edit(START, |root| {
        let frames = root["frames"].as_array_mut().unwrap();
        frames[0]["file_path"] = json!("./start/train/rgba/0000");
        frames[1]["file_path"] = json!("start/train/0001");
        frames[2]["file_path"] = json!("start/train/color/0002.jpg");
        frames.reverse();
    });
    let capture = folder.load();
    let names: Vec<&str> = capture.states[State::START].train.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["start/train/rgba/0000.png", "start/train/rgba/0001.png", "start/train/rgba/0002.png"]);
    assert!(capture.has_depth());
}

#[test]
fn test_views_and_depth_scale_are_read() {
    let folder = Folder::new();
    folder.edit(START, |root| root["depth_scale"] = json!(500.0));
    std::fs::copy(folder.path(START), folder.path("transforms_test_start.json")).unwrap();
    let capture = folder.load();
    assert_eq!((capture.states[State::START].test.len(), capture.states[State::END].test.len()), (VIEWS, 0));
    assert_eq!(summarize(&capture).states[State::START].train.depth.unwrap().range, [4.0, 4.0]);
}

#[test]
fn odd_but_usable_captures_warn() {
    let folder = Folder::new();
    folder.remove("end/train/depth/0001.png");
    write_rgb(&folder.path("start/train/rgba/0000.png"), W, H, &[[9; 3]; (W * H) as usize]).unwrap();
    write_rgba(&folder.path("end/train/rgba/0002.png"), W, H, &[[0; 4]; (W * H) as usize]).unwrap();
    folder.edit(START, |root| root["k1"] = json!(0.1));
    folder.edit(START, |root| root["frames"][2]["time"] = json!(1.0));
    let capture = folder.load();
    let all = capture.warnings.join("\n");
    for words in [
        "have no alpha; all pixels count as the object: start/train/rgba/0000.png",
        "1 of 3 images are ignored, their mask (alpha) is empty: end/train/rgba/0002.png",
        "1 of 5 training views have no depth, first end/train/rgba/0001.png",
        "transforms_train_start.json: key `k1`",
        "key `time` of 1 frames (first: frame 2)",
    ] {
        assert!(all.contains(words), "{words:?} is missing in: {all}");
    }
    assert_eq!(capture.warnings.len(), 5, "{all}");
    assert_eq!(capture.states[State::END].train.len(), 2);
    assert!(!capture.has_depth());
}

#[test]
fn stale_field_of_view_warns() {
    let folder = Folder::new();
    folder.edit(START, |root| root["camera_angle_x"] = json!(0.9));
    assert!(folder.load().warnings[0].contains("camera_angle_x"));
}

#[test]
fn folders_that_are_no_captures() {
    let folder = Folder::new();
    let missing = load_capture(&folder.dir().join("nowhere")).unwrap_err().to_string();
    assert!(missing.contains("nowhere: no such directory"), "{missing}");
    let empty = tempfile::tempdir().unwrap();
    let message = load_capture(empty.path()).unwrap_err().to_string();
    assert!(message.contains("the folder is empty") && !message.contains(START), "{message}");
    std::fs::write(empty.path().join("notes.txt"), "x").unwrap();
    let message = load_capture(empty.path()).unwrap_err().to_string();
    assert!(message.contains(START) && message.contains("end/camera_train.json"), "{message}");
    folder.remove("end/camera_train.json");
    folder.remove("transforms_train_end.json");
    folder.refused(&["one state only", START, "transforms_train_end.json does not"]);
    folder.remove(START);
    folder.refused(&["one state only", "start/camera_train.json exists"]);
}

#[test]
fn bad_json_and_missing_keys() {
    let folder = Folder::new();
    folder.edit_text(START, "\"frames\": [", "\"frames\": [[");
    folder.refused(&[START, "line ", "column "]);

    let folder = Folder::new();
    folder.edit(START, |root| drop(root.as_object_mut().unwrap().remove("frames")));
    folder.refused(&[START, "key `frames`", "missing"]);
    for (key, place) in [("file_path", "transforms_train_start.json, frame 1"), ("transform_matrix", FRAME_1)] {
        let folder = Folder::new();
        folder.edit(START, |root| drop(root["frames"][1].as_object_mut().unwrap().remove(key)));
        folder.refused(&[place, &format!("key `{key}`"), "missing"]);
    }
    for (key, value) in [("fl_x", json!(-3)), ("fl_y", json!("20")), ("w", json!(1.5)), ("depth_scale", json!(0))] {
        let folder = Folder::new();
        folder.edit(START, |root| root[key] = value);
        folder.refused(&[START, &format!("key `{key}`")]);
    }
    let folder = Folder::new();
    folder.edit(START, |root| root["frames"][1]["file_path"] = json!(7));
    folder.refused(&["frame 1", "key `file_path`", "expected a string"]);

    let folder = Folder::new().into_paris();
    folder.edit("end/camera_train.json", |root| drop(root.as_object_mut().unwrap().remove("K")));
    folder.refused(&["end/camera_train.json", "key `K`", "missing"]);
    folder.edit("end/camera_train.json", |root| root["K"] = json!([[20, 3, 8], [0, 20, 6], [0, 0, 1]]));
    folder.refused(&["end/camera_train.json", "key `K`", "skew"]);
}

#[test]
fn bad_poses() {
    let edit = |change: &dyn Fn(&mut Value)| {
        let folder = Folder::new();
        folder.edit(START, |root| change(&mut root["frames"][1]["transform_matrix"]));
        folder
    };
    let key = "key `transform_matrix`";
    edit(&|m| drop(m.as_array_mut().unwrap().pop())).refused(&[FRAME_1, key, "4x4"]);
    edit(&|m| drop(m[2].as_array_mut().unwrap().pop())).refused(&[FRAME_1, key, "4x4"]);
    edit(&|m| m[3][0] = json!(0.5)).refused(&[FRAME_1, key, "last row"]);
    edit(&|m| m[0][0] = json!(5.0)).refused(&[FRAME_1, key, "not orthonormal"]);
    for word in ["NaN", "Infinity", "-Infinity"] {
        let folder = edit(&|m| m[1][3] = json!(123456));
        folder.edit_text(START, "123456", word);
        folder.refused(&[FRAME_1, key, "row 1, column 3 is not a finite number"]);
    }
    let scaled = edit(&|m| {
        for r in 0..3 {
            for c in 0..3 {
                m[r][c] = json!(m[r][c].as_f64().unwrap() * 2.5);
            }
        }
    });
    scaled.refused(&[FRAME_1, key, "uniform scale of 2.500000", "divide"]);

    let folder = Folder::new().into_paris();
    folder.edit("start/camera_train.json", |root| root["0002"] = json!([1, 2]));
    folder.refused(&["start/camera_train.json, frame 0002", "key `0002`", "4x4"]);
}

#[test]
fn bad_images() {
    let folder = Folder::new();
    folder.remove("start/train/rgba/0001.png");
    folder.refused(&[FRAME_1, "key `file_path`", "no image"]);
    folder.into_paris().refused(&["start/camera_train.json, frame 0001", "start/train/0001.png"]);

    let folder = Folder::new();
    let path = folder.path("start/train/rgba/0001.png");
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    folder.refused(&[FRAME_1, "start/train/rgba/0001.png", "not a complete, readable PNG"]);

    let folder = Folder::new();
    write_rgba(&folder.path("start/train/rgba/0001.png"), 8, 8, &[[1, 2, 3, 255]; 64]).unwrap();
    folder.refused(&[FRAME_1, "8x8", "key `w` says 16"]);
    folder.edit(START, |root| {
        root.as_object_mut().unwrap().remove("w");
        root.as_object_mut().unwrap().remove("h");
    });
    std::fs::remove_file(folder.path("start/train/depth/0001.png")).unwrap();
    folder.refused(&[FRAME_1, "0001.png is 8x8", "start/train/rgba/0000.png is 16x12"]);

    let folder = Folder::new();
    for view in 0..VIEWS {
        let path = folder.path(&format!("start/train/rgba/{view:04}.png"));
        write_rgba(&path, W, H, &[[5, 5, 5, 0]; (W * H) as usize]).unwrap();
    }
    folder.refused(&[START, "mask (alpha) is empty in every frame", "start/train/rgba/0002.png"]);
}

#[test]
fn too_few_views() {
    let folder = Folder::new();
    folder.edit("transforms_train_end.json", |root| root["frames"].as_array_mut().unwrap().truncate(1));
    folder.refused(&["transforms_train_end.json", "key `frames`", "1 usable", "at least 2"]);
    folder.edit("transforms_train_end.json", |root| root["frames"] = json!([]));
    folder.refused(&["transforms_train_end.json", "0 usable"]);
}

#[test]
fn bad_depth() {
    let depth = "start/train/depth/0001.png";
    let folder = Folder::new();
    write_depth(&folder.path(depth), 4, 4, &depth_of(1000, 16)).unwrap();
    folder.refused(&[FRAME_1, depth, "4x4", "16x12"]);

    let folder = Folder::new();
    write_rgb(&folder.path(depth), W, H, &[[9; 3]; (W * H) as usize]).unwrap();
    folder.refused(&[FRAME_1, depth, "16-bit one-channel"]);

    let folder = Folder::new();
    folder.edit(START, |root| root["frames"][1]["depth_path"] = json!("start/train/z/0001.png"));
    folder.refused(&[FRAME_1, "key `depth_path`", "start/train/z/0001.png"]);

    let folder = Folder::new();
    for view in 0..VIEWS {
        // Depth outside the mask is ignored.
        let off = disc().iter().map(|p| if p[3] == 0 { 2000 } else { 0 }).collect();
        let off = DepthMap::new(off, 1000.0);
        write_depth(&folder.path(&format!("start/train/depth/{view:04}.png")), W, H, &off).unwrap();
    }
    folder.refused(&[START, "depth is zero", "start/train/rgba/0000.png", "not inverted"]);
}

#[test]
fn states_in_different_places() {
    let shift = |folder: &Folder, by: f64| {
        folder.edit("transforms_train_end.json", |root| {
            for frame in root["frames"].as_array_mut().unwrap() {
                let x = frame["transform_matrix"][0][3].as_f64().unwrap();
                frame["transform_matrix"][0][3] = json!(x + by);
            }
        });
    };
    for folder in [Folder::new(), Folder::new().without_depth()] {
        shift(&folder, 0.3);
        folder.load();
        shift(&folder, 10.0);
        folder.refused(&["no overlap between the states", "one world frame"]);
    }
}

#[test]
fn a_capture_without_depth_loads_without_a_word() {
    let capture = Folder::new().without_depth().load();
    assert!(capture.warnings.is_empty() && capture.states[State::START].train[0].depth.is_none());
}

#[test]
fn nothing_is_written_into_the_folder() {
    let folder = Folder::new();
    let list = || {
        let mut all = Vec::new();
        let mut open = vec![folder.dir().to_path_buf()];
        while let Some(dir) = open.pop() {
            for entry in std::fs::read_dir(dir).unwrap() {
                let path = entry.unwrap().path();
                let modified = path.metadata().unwrap().modified().unwrap();
                if path.is_dir() {
                    open.push(path.clone());
                }
                all.push((path, modified));
            }
        }
        all.sort();
        all
    };
    let before = list();
    summarize(&folder.load());
    assert_eq!(before, list());
}

#[test]
fn the_summary_counts_and_prints() {
    let folder = Folder::new();
    let summary = summarize(&folder.load());
    let state = &summary.states[State::START];
    assert_eq!((state.train.views, state.test.views), (3, 0));
    assert_eq!(state.train.image_sizes, [[16, 12]]);
    assert!((state.train.mask_coverage - 49.0 / 192.0).abs() < 1e-12);
    let [x, y] = state.train.field_of_view_deg.unwrap();
    assert!((x - 2.0 * 0.4f64.atan().to_degrees()).abs() < 1e-9 && (y - 2.0 * 0.3f64.atan().to_degrees()).abs() < 1e-9);
    let depth = state.train.depth.unwrap();
    assert_eq!((depth.views, depth.range, depth.valid_fraction), (3, [2.0, 2.0], 1.0));
    let bounds = state.object_box.unwrap();
    assert!(bounds.min.cmplt(DVec3::ZERO).all() && bounds.max.cmpgt(DVec3::ZERO).all(), "{bounds:?}");
    let text = summary.to_string();
    for words in ["state start", "3 views, 16x12", "43.6 x 33.4 deg", "25.5 %", "depth in 3 views", "no views"] {
        assert!(text.contains(words), "{words:?} is missing in:\n{text}");
    }
    assert_eq!(serde_json::to_value(&summary).unwrap()["states"][1]["name"], "end");
}
