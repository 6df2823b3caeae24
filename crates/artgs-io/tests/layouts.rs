//! Layouts of data sets and SLAM programs: the same few frames, written in each, are read with the right poses, intrinsics and depth.
#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

use artgs_core::{Camera, DepthMap, Intrinsics, Rigid, State};
use artgs_io::image_io::{write_depth, write_rgb};
use artgs_io::recording::{RecordingFormat, RecordingOptions, load_recording};
use glam::{DMat3, DQuat, DVec3};
use std::fmt::Write;

const K: Intrinsics = Intrinsics { fx: 70.0, fy: 72.0, cx: 31.5, cy: 24.5, width: 64, height: 48 };
const COUNT: usize = 4;

/// Millimetres at a pixel.
fn depth(frame: usize, pixel: usize) -> u16 {
    (900 + 100 * frame + pixel % 64) as u16
}

fn camera(frame: usize) -> Camera {
    let angle = 0.3 * frame as f64;
    Camera::look_at(K, DVec3::new(angle.sin(), 0.6, angle.cos()), DVec3::new(0.05, 0.1, 0.0), DVec3::Y)
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.0.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }

    fn color(&self, name: &str, frame: usize) {
        self.write(name, "");
        write_rgb(&self.0.path().join(name), 64, 48, &vec![[40 * frame as u8 + 10, 90, 30]; 64 * 48]).unwrap();
    }

    fn depth(&self, name: &str, frame: usize, per_metre: f64) {
        self.write(name, "");
        let counts = (0..64 * 48).map(|p| (f64::from(depth(frame, p)) * per_metre / 1000.0).round() as u16).collect();
        write_depth(&self.0.path().join(name), 64, 48, &DepthMap::new(counts, 1.0)).unwrap();
    }

    /// Reads the folder and compares it with the frames.
    fn check(&self, format: RecordingFormat) -> Vec<String> {
        assert_eq!(RecordingFormat::detect(self.0.path()), Some(format));
        self.check_with(&RecordingOptions::default())
    }

    fn check_with(&self, options: &RecordingOptions) -> Vec<String> {
        let back = load_recording(self.0.path(), options).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(back.frames.len(), COUNT, "{:?}", back.warnings);
        for (i, frame) in back.frames.iter().enumerate() {
            let k = frame.view.camera.intrinsics;
            for (found, stated) in [(k.fx, K.fx), (k.fy, K.fy), (k.cx, K.cx), (k.cy, K.cy)] {
                assert!((found - stated).abs() < 1e-6, "{k:?}");
            }
            let off = camera(i).world_to_camera * frame.view.camera.world_to_camera.inverse();
            assert!(off.translation.length() < 1e-5 && off.angle() < 1e-5, "frame {i}: {off:?}");
            assert_eq!(frame.view.rgba[0][0], 40 * i as u8 + 10);
            let found = frame.view.depth.as_ref().unwrap();
            assert!((0..64 * 48).all(|p| (found.at(p) - f32::from(depth(i, p)) / 1000.0).abs() < 2e-4), "frame {i}");
        }
        back.warnings
    }

    fn message(&self, options: &RecordingOptions) -> String {
        load_recording(self.0.path(), options).map(|r| r.format).unwrap_err().to_string()
    }
}

/// Camera-to-world.
fn pose(frame: usize) -> Rigid {
    camera(frame).world_to_camera.inverse()
}

/// The rows of a 4x4 matrix.
fn matrix(pose: Rigid) -> [String; 4] {
    let (m, t) = (pose.matrix(), pose.translation);
    let row = |i: usize| format!("{} {} {} {}", m.x_axis[i], m.y_axis[i], m.z_axis[i], t[i]);
    [row(0), row(1), row(2), "0 0 0 1".into()]
}

/// tx ty tz qx qy qz qw.
fn seven(pose: Rigid) -> String {
    let (t, q) = (pose.translation, pose.rotation);
    format!("{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w)
}

/// As calibration tools count pixels.
fn intrinsics() -> String {
    format!("{} 0 {} 0 0 {} {} 0 0 0 1 0 0 0 0 1", K.fx, K.cx - 0.5, K.fy, K.cy - 0.5)
}

#[test]
fn scannet_export() {
    let folder = Folder::new();
    for i in 0..COUNT {
        // Numbers sort by value, and a lost frame has a pose of -inf.
        folder.color(&format!("color/{}.jpg", 8 + i), i);
        folder.depth(&format!("depth/{}.png", 8 + i), i, 1000.0);
        folder.write(&format!("pose/{}.txt", 8 + i), &matrix(pose(i)).join("\n"));
    }
    folder.color("color/12.jpg", 0);
    folder.write("pose/12.txt", &"-inf -inf -inf -inf\n".repeat(4));
    folder.write("intrinsic/intrinsic_color.txt", &intrinsics());
    folder.write("intrinsic/intrinsic_depth.txt", &intrinsics());
    let warnings = folder.check(RecordingFormat::Folders);
    assert!(
        warnings.len() == 1 && warnings[0].contains("1 poses are lost") && warnings[0].contains("12.jpg"),
        "{warnings:?}"
    );
}

#[test]
fn replica() {
    let folder = Folder::new();
    let mut poses = String::new();
    for i in 0..COUNT {
        folder.color(&format!("results/frame{i:06}.jpg"), i);
        folder.depth(&format!("results/depth{i:06}.png"), i, 6553.5);
        let _ = writeln!(poses, "{}", matrix(pose(i)).join(" "));
    }
    folder.write("traj.txt", &poses);
    let text = folder.message(&RecordingOptions::default());
    assert!(text.contains("no camera intrinsics") && text.contains("--intrinsics"), "{text}");
    folder.write(
        "cam_params.json",
        r#"{"camera": {"fx": 70, "fy": 72, "cx": 31.0, "cy": 24.0, "w": 64, "h": 48, "scale": 6553.5}}"#,
    );
    assert!(folder.check(RecordingFormat::Folders).is_empty());
}

#[test]
fn rtabmap_export() {
    let folder = Folder::new();
    let mut poses = String::from("#timestamp x y z qx qy qz qw id\n");
    for i in 0..COUNT {
        let id = 3 * i + 1;
        folder.color(&format!("scan_rgb/{id}.jpg"), i);
        folder.depth(&format!("scan_depth/{id}.png"), i, 1000.0);
        let data = format!("{}, 0., {}, 0., {}, {}, 0., 0., 1.", K.fx, K.cx - 0.5, K.fy, K.cy - 0.5);
        folder.write(
            &format!("scan_calib/{id}.yaml"),
            &format!("%YAML:1.0\n---\nimage_width: 64\nimage_height: 48\ncamera_matrix:\n   rows: 3\n   cols: 3\n   data: [ {data} ]\n"),
        );
        let _ = writeln!(poses, "{:.6} {} {id}", 1_600_000_000.0 + i as f64, seven(pose(i)));
    }
    folder.write("scan_camera_poses.txt", &poses);
    // Poses of the robot's base, which are not those of the camera.
    folder.write("scan_poses.txt", "0 0 0 0 0 0 0 1 1\n1 0 0 0 0 0 0 1 4\n");
    assert!(folder.check(RecordingFormat::Folders).is_empty());
}

#[test]
fn open3d() {
    let folder = Folder::new();
    let mut log = String::new();
    for i in 0..COUNT {
        folder.color(&format!("color/{i:06}.jpg"), i);
        folder.depth(&format!("depth/{i:06}.png"), i, 1000.0);
        let _ = writeln!(log, "{i} {i} {}\n{}", i + 1, matrix(pose(i)).join("\n"));
    }
    folder.write("scene/trajectory.log", &log);
    folder.write(
        "intrinsic.json",
        r#"{"width": 64, "height": 48, "intrinsic_matrix": [70, 0, 0, 0, 72, 0, 31.0, 24.0, 1]}"#,
    );
    assert!(folder.check(RecordingFormat::Folders).is_empty());
}

#[test]
fn arkitscenes() {
    let folder = Folder::new();
    let mut poses = String::new();
    for i in 0..COUNT {
        let time = 40.5 + 0.1 * i as f64;
        folder.color(&format!("47_frames/lowres_wide/47_{time:.3}.png"), i);
        folder.depth(&format!("47_frames/lowres_depth/47_{time:.3}.png"), i, 1000.0);
        folder.write(
            &format!("47_frames/lowres_wide_intrinsics/47_{time:.3}.pincam"),
            &format!("64 48 {} {} {} {}", K.fx, K.fy, K.cx - 0.5, K.cy - 0.5),
        );
        let Rigid { rotation, translation: t } = camera(i).world_to_camera;
        let a = rotation.to_scaled_axis();
        let _ = writeln!(poses, "{:.6} {} {} {} {} {} {}", time + 0.004, a.x, a.y, a.z, t.x, t.y, t.z);
    }
    folder.write("47_frames/lowres_wide.traj", &poses);
    folder.check(RecordingFormat::Folders);
    let back = load_recording(folder.0.path(), &RecordingOptions::default()).unwrap();
    assert_eq!(back.up, Some(DVec3::Z));
}

#[test]
fn slambook_rows_with_stated_intrinsics() {
    let folder = Folder::new();
    let mut poses = String::new();
    for i in 0..COUNT {
        folder.color(&format!("color/{}.png", i + 1), i);
        folder.depth(&format!("depth/{}.png", i + 1), i, 1000.0);
        let _ = writeln!(poses, "{}", seven(pose(i)));
    }
    folder.write("pose.txt", &poses);
    let k = artgs_io::recording::parse_intrinsics(&format!("{} {} {} {}", K.fx, K.fy, K.cx - 0.5, K.cy - 0.5)).unwrap();
    let options = RecordingOptions { intrinsics: Some(k), ..RecordingOptions::default() };
    assert!(folder.check_with(&options).is_empty());
}

/// Times in the names of images, and poses of a SLAM system, without lists of files.
#[test]
fn images_that_are_named_by_time() {
    let folder = Folder::new();
    let mut poses = String::from("timestamp tx ty tz qx qy qz qw\n");
    for i in 0..COUNT {
        let time = format!("1305031102.{}", 100_000 + 200_000 * i);
        folder.color(&format!("rgb/{time}.png"), i);
        folder.depth(&format!("depth/{time}.png"), i, 1000.0);
        let _ = writeln!(poses, "{time} {}", seven(pose(i)));
    }
    folder.write("trajectory.txt", &poses);
    folder.write("cam_K.txt", &format!("{} 0 {}\n0 {} {}\n0 0 1\n", K.fx, K.cx - 0.5, K.fy, K.cy - 0.5));
    assert!(folder.check(RecordingFormat::Folders).is_empty());
}

#[test]
fn three_r_scan() {
    let folder = Folder::new();
    for i in 0..COUNT {
        folder.color(&format!("frame-{i:06}.color.jpg"), i);
        let mut pgm = b"P5 64 48 65535\n".to_vec();
        pgm.extend((0..64 * 48).flat_map(|p| depth(i, p).to_be_bytes()));
        std::fs::write(folder.0.path().join(format!("frame-{i:06}.depth.pgm")), pgm).unwrap();
        folder.write(&format!("frame-{i:06}.pose.txt"), &matrix(pose(i)).join("\n"));
    }
    folder.write(
        "_info.txt",
        &format!(
            "m_colorWidth = 64\nm_colorHeight = 48\nm_depthWidth = 64\nm_depthHeight = 48\nm_depthShift = 1000\n\
             m_calibrationColorIntrinsic = {0}\nm_calibrationDepthIntrinsic = {0}\n",
            intrinsics()
        ),
    );
    assert!(folder.check(RecordingFormat::SevenScenes).is_empty());
}

/// TUM in other units and axes, which options state.
#[test]
fn options_state_what_a_format_does_not_say() {
    let folder = Folder::new();
    let (mut rgb, mut depths, mut poses) = (String::new(), String::new(), String::new());
    for i in 0..COUNT {
        folder.color(&format!("rgb/{i}.png"), i);
        folder.depth(&format!("depth/{i}.png"), i, 1000.0);
        let _ = writeln!(rgb, "{i}.5 rgb/{i}.png");
        let _ = writeln!(depths, "{i}.5 depth/{i}.png");
        // The base of a robot: x forward, y left, z up.
        let robot = DMat3::from_cols(DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y);
        let pose = pose(i) * Rigid { rotation: DQuat::from_mat3(&robot), translation: DVec3::ZERO };
        let _ = writeln!(poses, "{i}.5 {}", seven(pose));
    }
    folder.write("rgb.txt", &rgb);
    folder.write("depth.txt", &depths);
    folder.write("groundtruth.txt", &poses);
    folder.write("intrinsics.txt", &format!("{} {} {} {}", K.fx, K.fy, K.cx - 0.5, K.cy - 0.5));
    let axes = artgs_io::recording::AxisOrder::parse("robot").ok();
    let depth_unit = artgs_io::recording::parse_depth_unit("mm").ok();
    assert!(folder.check_with(&RecordingOptions { axes, depth_unit, ..RecordingOptions::default() }).is_empty());
}

/// The capture of ArtGS as its authors publish it: both states in one file.
#[test]
fn states_that_are_split_by_time() {
    let folder = Folder::new();
    let frame = |i: usize| {
        let (m, t) = (pose(i).matrix() * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)), pose(i).translation);
        let row = |r: usize| format!("[{}, {}, {}, {}]", m.x_axis[r], m.y_axis[r], m.z_axis[r], t[r]);
        let rows = [row(0), row(1), row(2), "[0, 0, 0, 1]".into()].join(", ");
        format!(
            r#"{{"file_path": "rgba/{i}", "time": {}, "transform_matrix": [{rows}]}}"#,
            if i < 2 { "0.0" } else { "1.0" }
        )
    };
    for i in 0..COUNT {
        folder.color(&format!("rgba/{i}.png"), i);
        folder.depth(&format!("depth/{i}.png"), i, 1000.0);
    }
    let frames: Vec<String> = (0..COUNT).map(frame).collect();
    let json = |frames: &str| {
        format!(r#"{{"fl_x": 70, "fl_y": 72, "cx": 31.5, "cy": 24.5, "w": 64, "h": 48, "frames": [{frames}]}}"#)
    };
    folder.write("transforms_train.json", &json(&frames.join(",\n")));
    assert!(artgs_io::capture::is_capture(folder.0.path()));
    assert_eq!(RecordingFormat::of(folder.0.path()), None);
    let capture = artgs_io::capture::load_capture_with(
        folder.0.path(),
        &artgs_io::capture::CaptureOptions { apart: true, ..Default::default() },
    )
    .unwrap();
    for (state, expected) in [(State::START, [0, 1]), (State::END, [2, 3])] {
        let views = &capture.states[state].train;
        assert_eq!(views.len(), 2);
        for (view, frame) in views.iter().zip(expected) {
            assert!((view.camera.position() - pose(frame).translation).length() < 1e-6);
            assert!(view.depth.is_some());
        }
    }
    // One state in such a file is a recording of nerfstudio.
    folder.write("transforms_train.json", &json(&frames[..2].join(",\n")));
    assert_eq!(RecordingFormat::of(folder.0.path()), Some(RecordingFormat::Nerfstudio));
}
