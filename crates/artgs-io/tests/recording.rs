//! Recordings: every format is written and read back, and damaged ones are refused with a helpful message.
#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

use artgs_core::{Camera, DepthMap, Intrinsics, RecordedFrame, Recording, View};
use artgs_io::recording::{RecordingFormat, RecordingOptions, load_recording, write_recording};
use glam::{DVec2, DVec3};
use std::path::Path;

const K: Intrinsics = Intrinsics { fx: 70.0, fy: 70.0, cx: 31.0, cy: 25.0, width: 64, height: 48 };
const UP: DVec3 = DVec3::Y;

/// Frames around a slanted plane with smooth colours. Depth is exact to 0.2 mm.
fn sample(count: usize) -> Recording {
    let frame = |i: usize| {
        let angle = 0.2 * i as f64;
        let eye = DVec3::new(angle.sin(), 0.6 + 0.01 * i as f64, angle.cos());
        let camera = Camera::look_at(K, eye, DVec3::new(0.05, 0.1, 0.0), UP);
        let pixels = (0..48).flat_map(|y| (0..64).map(move |x| (x, y)));
        let depth = |(x, y): (u32, u32)| {
            let near = camera.unproject(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), 1.0) - eye;
            // The plane y = 0.1 z - 0.3.
            let normal = DVec3::new(0.0, 1.0, -0.1);
            let depth = (-0.3 - normal.dot(eye)) / normal.dot(near);
            if (0.0..5.0).contains(&depth) { (depth * 5000.0).round() as u16 } else { 0 }
        };
        let view = View {
            name: format!("{i}"),
            camera,
            rgba: pixels.clone().map(|(x, y)| [2 * x as u8 + 40, 3 * y as u8 + 20, 10 * i as u8, 255]).collect(),
            depth: Some(DepthMap::new(pixels.map(depth).collect(), 5000.0)),
            derived: None,
        };
        RecordedFrame { view, time: Some(100.0 + 0.25 * i as f64), depth_step: 1.0 }
    };
    Recording { up: Some(UP), metric: true, frames: (0..count).map(frame).collect(), ..Recording::default() }
}

fn read(dir: &Path) -> Recording {
    load_recording(dir, &RecordingOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn message(dir: &Path) -> String {
    load_recording(dir, &RecordingOptions::default()).map(|r| r.format).unwrap_err().to_string()
}

/// Tolerances of a format.
struct Loss {
    /// Largest difference of a colour channel.
    color: u8,
    /// Largest difference of depth, metres.
    depth: f32,
    /// True if time stamps are kept.
    time: bool,
}

fn round_trip(format: RecordingFormat, loss: &Loss) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let written = sample(6);
    write_recording(dir.path(), &written, format).unwrap();
    assert_eq!(RecordingFormat::detect(dir.path()), Some(format));
    let back = read(dir.path());
    assert_eq!((back.format, back.frames.len(), back.recorded), (format.name(), 6, 6));
    assert!(back.warnings.is_empty(), "{:?}", back.warnings);
    for (a, b) in written.frames.iter().zip(&back.frames) {
        let (ka, kb) = (a.view.camera.intrinsics, b.view.camera.intrinsics);
        assert_eq!((ka.width, ka.height), (kb.width, kb.height));
        for (p, q) in [(ka.fx, kb.fx), (ka.fy, kb.fy), (ka.cx, kb.cx), (ka.cy, kb.cy)] {
            assert!((p - q).abs() < 1e-4, "{ka:?} {kb:?}");
        }
        let off = a.view.camera.world_to_camera.inverse() * b.view.camera.world_to_camera;
        assert!(off.translation.length() < 1e-4 && off.angle() < 1e-4, "{off:?}");
        let worst = a.view.rgba.iter().zip(&b.view.rgba).flat_map(|(p, q)| (0..4).map(|c| p[c].abs_diff(q[c]))).max();
        assert!(worst.unwrap() <= loss.color, "{worst:?}");
        if loss.time {
            assert!((a.time.unwrap() - b.time.unwrap()).abs() < 1e-4);
        }
        let (da, db) = (a.view.depth.as_ref().unwrap(), b.view.depth.as_ref().unwrap());
        assert_eq!(b.depth_step, 1.0);
        for (p, q) in da.iter().zip(db.iter()) {
            assert!((p - q).abs() <= loss.depth, "{p} {q}");
        }
    }
    dir
}

#[test]
fn scanner_app() {
    let dir = round_trip(RecordingFormat::ScannerApp, &Loss { color: 8, depth: 5.1e-4, time: true });
    assert_eq!(read(dir.path()).up, Some(DVec3::Y));
    let path = |name: &str| dir.path().join(name);

    std::fs::remove_file(path("depth_00002.png")).unwrap();
    std::fs::remove_file(path("frame_00004.jpg")).unwrap();
    let fewer = read(dir.path());
    assert_eq!(fewer.frames.len(), 4);
    assert!(fewer.warnings.iter().any(|w| w.contains("frame_00004.jpg")), "{:?}", fewer.warnings);
    assert!(fewer.warnings.iter().any(|w| w.contains("no depth") && w.contains("frame_00002.jpg")));

    let image = std::fs::read(path("frame_00003.jpg")).unwrap();
    std::fs::write(path("frame_00003.jpg"), &image[..image.len() / 2]).unwrap();
    let text = message(dir.path());
    assert!(text.contains("frame_00003.jpg") && text.contains("export it again"), "{text}");
    std::fs::write(path("frame_00003.jpg"), image).unwrap();

    let json = std::fs::read_to_string(path("frame_00001.json")).unwrap();
    for (from, to, part) in [
        ("\"intrinsics\"", "\"intrinsic\"", "key `intrinsics`"),
        ("\"cameraPoseARFrame\": [", "\"cameraPoseARFrame\": [0.5,", "key `cameraPoseARFrame`"),
        ("{", "", "not valid JSON"),
    ] {
        std::fs::write(path("frame_00001.json"), json.replacen(from, to, 1)).unwrap();
        let text = message(dir.path());
        assert!(text.contains("frame_00001.json") && text.contains(part), "{text}");
    }
    std::fs::write(path("frame_00001.json"), json).unwrap();

    artgs_io::image_io::write_gray(&path("conf_00001.png"), 2, 2, &[2; 4]).unwrap();
    let text = message(dir.path());
    assert!(text.contains("conf_00001.png") && text.contains("2x2"), "{text}");
}

/// Depth of a small image and low confidence, as phones write them.
#[test]
fn scanner_app_with_small_depth() {
    let dir = tempfile::tempdir().unwrap();
    write_recording(dir.path(), &sample(3), RecordingFormat::ScannerApp).unwrap();
    for i in 0..3 {
        let path = |kind: &str| dir.path().join(format!("{kind}_{i:05}.png"));
        let counts: Vec<u16> = (0..16 * 12).map(|p| 900 + p / 16).collect();
        artgs_io::image_io::write_depth(&path("depth"), 16, 12, &DepthMap::new(counts, 1000.0)).unwrap();
        let levels: Vec<u8> = (0..16 * 12).map(|p| if p % 16 < 4 { 0 } else { 1 }).collect();
        artgs_io::image_io::write_gray(&path("conf"), 16, 12, &levels).unwrap();
    }
    let back = read(dir.path());
    let depth = back.frames[0].view.depth.as_ref().unwrap();
    assert_eq!(back.frames[0].depth_step, 4.0);
    assert!((0..48).all(|y| depth.at(y * 64 + 10) == 0.0 && (0.89..0.92).contains(&depth.at(y * 64 + 40))));
}

/// Depth of a smaller sensor is written at the size of the sensor; the reader interpolates between its pixels.
#[test]
fn phone_formats_keep_the_size_of_the_depth_sensor() {
    let mut written = sample(2);
    for frame in &mut written.frames {
        frame.depth_step = 4.0;
        let full = frame.view.depth.as_ref().unwrap();
        let blocks = (0..48 * 64).map(|i| full.counts()[(i / 64 / 4 * 4 + 2) * 64 + i % 64 / 4 * 4 + 2]).collect();
        frame.view.depth = Some(DepthMap::new(blocks, full.per_unit()));
    }
    use RecordingFormat::{Polycam, Record3d, ScannerApp, Stray};
    for format in [ScannerApp, Polycam, Record3d, Stray] {
        let dir = tempfile::tempdir().unwrap();
        write_recording(dir.path(), &written, format).unwrap();
        for (a, b) in written.frames.iter().zip(&read(dir.path()).frames) {
            assert_eq!(b.depth_step, 4.0, "{format:?}");
            let (da, db) = (a.view.depth.as_ref().unwrap(), b.view.depth.as_ref().unwrap());
            let centers = (0..12 * 16).map(|i| (i / 16 * 4 + 2) * 64 + i % 16 * 4 + 2);
            let both = centers.map(|i| (da.at(i), db.at(i))).filter(|(p, q)| *p > 0.0 && *q > 0.0);
            let near: Vec<bool> = both.map(|(p, q)| (p - q).abs() <= 0.1 * p).collect();
            assert!(near.len() > 60 && near.iter().all(|n| *n), "{format:?}: {near:?}");
        }
    }
}

#[test]
fn tum() {
    let dir = round_trip(RecordingFormat::Tum, &Loss { color: 0, depth: 1e-6, time: true });
    let path = |name: &str| dir.path().join(name);
    assert_eq!(read(dir.path()).up, None);

    let rgb = std::fs::read_to_string(path("rgb.txt")).unwrap();
    std::fs::write(path("rgb.txt"), rgb.replace("100.500000", "107.0")).unwrap();
    let fewer = read(dir.path());
    assert_eq!(fewer.frames.len(), 5);
    assert!(
        fewer.warnings[0].contains("no pose") && fewer.warnings[0].contains("rgb/000002.png"),
        "{:?}",
        fewer.warnings
    );
    std::fs::write(path("rgb.txt"), rgb.replace("100.500000", "x")).unwrap();
    let fewer = read(dir.path());
    assert!(fewer.frames.len() == 5 && fewer.warnings[0].contains("rgb.txt") && fewer.warnings[0].contains("line 4"));
    std::fs::write(path("rgb.txt"), &rgb).unwrap();

    std::fs::remove_file(path("intrinsics.txt")).unwrap();
    let text = message(dir.path());
    assert!(text.contains("fx,fy,cx,cy") && text.contains("535.4,539.2,320.1,247.6"), "{text}");
    let options = RecordingOptions { intrinsics: Some(K), every: 2, offset: 1, ..RecordingOptions::default() };
    let odd = load_recording(dir.path(), &options).unwrap();
    assert_eq!(odd.frames.iter().map(|f| f.time.unwrap()).collect::<Vec<_>>(), [100.25, 100.75, 101.25]);
    assert_eq!(odd.frames[0].view.camera.intrinsics, K);
    let wrong = RecordingOptions { every: 2, offset: 2, ..options };
    assert!(load_recording(dir.path(), &wrong).unwrap_err().to_string().contains("offset"));
}

/// Images with indices instead of time stamps: rows of the poses belong to them.
#[test]
fn tum_with_indices() {
    let dir = tempfile::tempdir().unwrap();
    write_recording(dir.path(), &sample(4), RecordingFormat::Tum).unwrap();
    let path = |name: &str| dir.path().join(name);
    let expected = read(dir.path());
    for name in ["rgb", "depth"] {
        let list: String = (0..4).map(|i| format!("{i} {name}/{i:06}.png\n")).collect();
        std::fs::write(path(&format!("{name}.txt")), list).unwrap();
    }
    std::fs::rename(path("groundtruth.txt"), path("truth_cam_poses.txt")).unwrap();
    let back = read(dir.path());
    for (a, b) in expected.frames.iter().zip(&back.frames) {
        assert_eq!((a.view.camera, a.time), (b.view.camera, b.time));
    }
    let poses = std::fs::read_to_string(path("truth_cam_poses.txt")).unwrap();
    // A lost pose does not shift the others.
    let lost: Vec<String> = poses
        .lines()
        .enumerate()
        .map(|(i, l)| if i == 2 { "1 nan nan nan 0 0 0 1".into() } else { l.into() })
        .collect();
    std::fs::write(path("truth_cam_poses.txt"), lost.join("\n")).unwrap();
    let some = read(dir.path());
    assert_eq!(some.frames.len(), 3);
    assert_eq!(some.frames[2].view.camera, expected.frames[3].view.camera);
    let fewer: Vec<&str> = poses.lines().take(3).collect();
    std::fs::write(path("truth_cam_poses.txt"), fewer.join("\n")).unwrap();
    let text = message(dir.path());
    assert!(text.contains("truth_cam_poses.txt") && text.contains("2 poses for 4 images"), "{text}");

    // Some of the images: with all poses, or with one per image.
    for name in ["rgb", "depth"] {
        let list: String = [1, 3].map(|i| format!("{i} {name}/{i:06}.png\n")).concat();
        std::fs::write(path(&format!("{name}.txt")), list).unwrap();
    }
    let lines: Vec<&str> = poses.lines().collect();
    for kept in [lines.clone(), vec![lines[0], lines[2], lines[4]]] {
        std::fs::write(path("truth_cam_poses.txt"), kept.join("\n")).unwrap();
        let some = read(dir.path());
        let cameras = |frames: &[usize]| frames.iter().map(|i| expected.frames[*i].view.camera).collect::<Vec<_>>();
        assert_eq!(some.frames.iter().map(|f| f.view.camera).collect::<Vec<_>>(), cameras(&[1, 3]));
    }
}

#[test]
fn long_recordings_are_thinned_and_large_images_reduced() {
    let dir = tempfile::tempdir().unwrap();
    write_recording(dir.path(), &sample(20), RecordingFormat::Tum).unwrap();
    let options = RecordingOptions { frames: 7, longest_side: 32, ..RecordingOptions::default() };
    let back = load_recording(dir.path(), &options).unwrap();
    assert_eq!((back.frames.len(), back.recorded), (7, 20));
    let k = back.frames[0].view.camera.intrinsics;
    assert_eq!((k.width, k.height, k.fx, k.cx), (32, 24, 35.0, 15.5));
    assert_eq!(back.frames[0].view.depth.as_ref().unwrap().len(), 32 * 24);
    let times: Vec<f64> = back.frames.iter().map(|f| f.time.unwrap()).collect();
    assert!(times.windows(2).all(|w| (0.25..1.3).contains(&(w[1] - w[0]))), "{times:?}");
}

#[test]
fn other_folders_are_no_recordings() {
    let dir = tempfile::tempdir().unwrap();
    let text = message(dir.path());
    assert!(text.contains("not a recording") && text.contains("scanner-app"), "{text}");
    assert!(message(&dir.path().join("nothing")).contains("no such file"));
    for format in RecordingFormat::ALL {
        assert_eq!(RecordingFormat::from_name(format.name()), Some(format));
    }
}

#[test]
fn nerfstudio() {
    let dir = round_trip(RecordingFormat::Nerfstudio, &Loss { color: 0, depth: 5.1e-4, time: false });
    let path = |name: &str| dir.path().join(name);
    let json = std::fs::read_to_string(path("transforms.json")).unwrap();
    for (from, to, part) in [
        ("\"transform_matrix\"", "\"matrix\"", "frame 0: key `transform_matrix`"),
        ("\"fl_x\"", "\"f\"", "key `fl_x`"),
        ("\"OPENCV\"", "\"EQUIRECTANGULAR\"", "key `camera_model`"),
        ("\"w\": 64", "\"w\": 90", "its intrinsics are for 90x48"),
    ] {
        std::fs::write(path("transforms.json"), json.replacen(from, to, 1)).unwrap();
        let text = message(dir.path());
        assert!(text.contains(part), "{text}");
    }
    std::fs::write(path("transforms.json"), &json).unwrap();
    std::fs::remove_file(path("images/000002.png")).unwrap();
    let fewer = read(dir.path());
    assert!(fewer.frames.len() == 5 && fewer.warnings[0].contains("images/000002.png"), "{:?}", fewer.warnings);
    assert_eq!(read(&path("transforms.json")).frames.len(), 5);
    std::fs::write(path("images/000003.png"), b"\x89PNG\r\n").unwrap();
    assert!(message(dir.path()).contains("000003.png"));
}

#[test]
fn nerfstudio_with_masks_and_distortion() {
    let dir = tempfile::tempdir().unwrap();
    let mut recording = sample(2);
    for pixel in &mut recording.frames[0].view.rgba[..640] {
        pixel[3] = 0;
    }
    write_recording(dir.path(), &recording, RecordingFormat::Nerfstudio).unwrap();
    let back = read(dir.path());
    assert!(back.has_masks());
    assert!(back.frames[0].view.depth.as_ref().unwrap().iter().take(640).all(|d| d == 0.0));

    let path = dir.path().join("transforms.json");
    let json = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, json.replacen('{', "{ \"k1\": -0.1,", 1)).unwrap();
    let flat = read(dir.path());
    let (k, was) = (flat.frames[1].view.camera.intrinsics, back.frames[1].view.camera.intrinsics);
    // Barrel distortion: the largest rectangle is narrower than the image, seen at the corners.
    assert!(k != was && (k.width, k.height) == (64, 48), "{k:?}");
    assert_ne!(flat.frames[1].view.rgba, back.frames[1].view.rgba);
}

#[test]
fn polycam() {
    let dir = round_trip(RecordingFormat::Polycam, &Loss { color: 8, depth: 5.1e-4, time: false });
    assert_eq!(read(dir.path()).up, Some(DVec3::Y));
    let path = |name: &str| dir.path().join("keyframes").join(name);
    std::fs::remove_file(path("depth/1000001.png")).unwrap();
    std::fs::remove_file(path("images/1000003.jpg")).unwrap();
    let fewer = read(dir.path());
    assert_eq!((fewer.frames.len(), fewer.warnings.len()), (4, 2), "{:?}", fewer.warnings);
    let json = std::fs::read_to_string(path("cameras/1000002.json")).unwrap();
    std::fs::write(path("cameras/1000002.json"), json.replace("\"t_12\"", "\"t\"")).unwrap();
    let text = message(dir.path());
    assert!(text.contains("1000002.json") && text.contains("key `t_12`"), "{text}");
}

#[test]
fn record3d() {
    let dir = round_trip(RecordingFormat::Record3d, &Loss { color: 8, depth: 2.1e-3, time: true });
    let path = |name: &str| dir.path().join(name);
    let json = std::fs::read_to_string(path("metadata.json")).unwrap();
    // Without intrinsics per frame those of the recording count; they are stored column by column.
    std::fs::write(path("metadata.json"), json.replace("perFrameIntrinsicCoeffs", "other")).unwrap();
    assert_eq!(read(dir.path()).frames[0].view.camera.intrinsics, K);
    std::fs::write(path("metadata.json"), json.replacen("\"poses\": [", "\"poses\": [[1],", 1)).unwrap();
    assert!(message(dir.path()).contains("pose 0: key `poses`"));
    std::fs::write(path("metadata.json"), json).unwrap();
    std::fs::remove_file(path("rgb/1.jpg")).unwrap();
    let fewer = read(dir.path());
    let [warning] = &fewer.warnings[..] else { panic!("{:?}", fewer.warnings) };
    assert!(fewer.frames.len() == 5 && warning.contains("no colour image") && warning.contains("1.exr"), "{warning}");
    let depth = std::fs::read(path("depth/3.exr")).unwrap();
    std::fs::write(path("depth/3.exr"), &depth[..depth.len() / 2]).unwrap();
    let text = message(dir.path());
    assert!(text.contains("3.exr") && text.contains("not a complete"), "{text}");
}

/// The archive of the app: LZFSE instead of EXR, with confidence.
fn archive(file: &Path) {
    let dir = tempfile::tempdir().unwrap();
    write_recording(dir.path(), &sample(3), RecordingFormat::Record3d).unwrap();
    let mut archive = zip::ZipWriter::new(std::fs::File::create(file).unwrap());
    let mut add = |name: &str, bytes: &[u8]| {
        archive.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        std::io::Write::write_all(&mut archive, bytes).unwrap();
    };
    let packed = |bytes: &[u8]| {
        let mut packed = Vec::new();
        lzfse_rust::encode_bytes(bytes, &mut packed).unwrap();
        packed
    };
    add("metadata", &std::fs::read(dir.path().join("metadata.json")).unwrap());
    for i in 0..3 {
        add(&format!("rgbd/{i}.jpg"), &std::fs::read(dir.path().join(format!("rgb/{i}.jpg"))).unwrap());
        let depth: Vec<u8> = (0..64 * 48).flat_map(|p| (0.5 + p as f32 * 1e-4).to_le_bytes()).collect();
        add(&format!("rgbd/{i}.depth"), &packed(&depth));
        add(&format!("rgbd/{i}.conf"), &packed(&(0..64 * 48).map(|p| (p % 3) as u8).collect::<Vec<_>>()));
    }
    archive.finish().unwrap();
}

#[test]
fn record3d_archive() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("scan.r3d");
    archive(&file);
    assert_eq!(RecordingFormat::detect(&file), Some(RecordingFormat::Record3d));
    let back = read(&file);
    assert_eq!(back.frames.len(), 3);
    let depth = back.frames[2].view.depth.as_ref().unwrap();
    for p in 0..64 * 48 {
        let expected = if p % 3 == 0 { 0.0 } else { 0.5 + p as f32 * 1e-4 };
        assert!((depth.at(p) - expected).abs() < 1e-4);
    }
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    let options = RecordingOptions { format: Some(RecordingFormat::Record3d), ..RecordingOptions::default() };
    let text = load_recording(&file, &options).unwrap_err().to_string();
    assert!(text.contains("scan.r3d") && text.contains("zip"), "{text}");
}

/// Other tests damage this file. `ARTGS_UPDATE=1` writes it.
#[test]
fn the_corpus_has_an_archive() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/containers/small.r3d");
    if std::env::var_os("ARTGS_UPDATE").is_some() {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        archive(&file);
    }
    assert_eq!(read(&file).frames.len(), 3);
}

#[test]
fn stray() {
    let dir = round_trip(RecordingFormat::Stray, &Loss { color: 8, depth: 5.1e-4, time: true });
    let path = |name: &str| dir.path().join(name);
    let table = std::fs::read_to_string(path("odometry.csv")).unwrap();
    std::fs::write(path("odometry.csv"), table.replacen(", qx", ", q", 1)).unwrap();
    assert!(message(dir.path()).contains("no column `qx`"));
    let short: Vec<&str> = table.lines().enumerate().map(|(i, l)| if i == 3 { &l[..20] } else { l }).collect();
    std::fs::write(path("odometry.csv"), short.join("\n")).unwrap();
    let fewer = read(dir.path());
    assert_eq!(fewer.frames.len(), 5);
    assert!(fewer.warnings[0].contains("odometry.csv") && fewer.warnings[0].contains("line 4"), "{:?}", fewer.warnings);
    // Columns of intrinsics may be absent or empty.
    let without: Vec<String> = table.lines().map(|l| l.split(", ").take(9).collect::<Vec<_>>().join(", ")).collect();
    std::fs::write(path("odometry.csv"), without.join("\n")).unwrap();
    assert_eq!(read(dir.path()).frames[3].view.camera.intrinsics, K);
    // A video is needed where there are no images, and this one is none.
    std::fs::remove_dir_all(path("rgb")).unwrap();
    std::fs::write(path("rgb.mp4"), b"no video").unwrap();
    let text = message(dir.path());
    assert!(text.contains("rgb.mp4") && text.contains("ffmpeg"), "{text}");
}

#[test]
fn seven_scenes() {
    let dir = round_trip(RecordingFormat::SevenScenes, &Loss { color: 0, depth: 5.1e-4, time: false });
    let path = |name: &str| dir.path().join(name);
    let counts = vec![65535_u16; 64 * 48];
    artgs_io::image_io::write_depth(&path("frame-000001.depth.png"), 64, 48, &DepthMap::new(counts, 1.0)).unwrap();
    let back = read(dir.path());
    assert!(back.frames[1].view.depth.as_ref().unwrap().iter().all(|d| d == 0.0));
    assert!(back.warnings[0].contains("frame-000001"), "{:?}", back.warnings);
    std::fs::write(path("frame-000002.pose.txt"), "1 0 0 0\n0 1 0\n0 0 1 0\n0 0 0 1\n").unwrap();
    let fewer = read(dir.path());
    assert_eq!(fewer.frames.len(), 5);
    assert!(fewer.warnings.iter().any(|w| w.contains("frame-000002.pose.txt") && w.contains("15 numbers")));
    std::fs::write(path("frame-000003.pose.txt"), "-inf -inf -inf -inf\n".repeat(4)).unwrap();
    let fewer = read(dir.path());
    assert_eq!(fewer.frames.len(), 4);
    assert!(fewer.warnings.iter().any(|w| w.contains("1 poses are lost") && w.contains("frame-000003.pose.txt")));
}

#[test]
fn colmap() {
    let dir = tempfile::tempdir().unwrap();
    let written = sample(4);
    write_recording(dir.path(), &written, RecordingFormat::Colmap).unwrap();
    assert_eq!(RecordingFormat::detect(dir.path()), Some(RecordingFormat::Colmap));
    let back = read(dir.path());
    assert!(back.metric && back.up.is_none());
    for (a, b) in written.frames.iter().zip(&back.frames) {
        assert_eq!(a.view.camera.intrinsics, b.view.camera.intrinsics);
        let off = a.view.camera.world_to_camera.inverse() * b.view.camera.world_to_camera;
        assert!(off.translation.length() < 1e-9 && off.angle() < 1e-6);
        assert_eq!(a.view.rgba, b.view.rgba);
    }
    let path = |name: &str| dir.path().join("sparse/0").join(name);
    let images = std::fs::read_to_string(path("images.txt")).unwrap();
    std::fs::write(path("images.txt"), images.replace(" 1 000002.png", " 5 000002.png")).unwrap();
    let text = message(dir.path());
    assert!(text.contains("images.txt") && text.contains("no camera 5"), "{text}");
    std::fs::write(path("images.txt"), &images).unwrap();
    std::fs::remove_dir_all(dir.path().join("depth")).unwrap();
    let back = read(dir.path());
    assert!(!back.metric && back.frames[0].view.depth.is_none());
}

/// A model of half the size, with points that have depth: poses become metric.
#[test]
fn colmap_is_scaled_to_depth() {
    let dir = tempfile::tempdir().unwrap();
    let mut recording = sample(4);
    for frame in &mut recording.frames {
        frame.view.camera.world_to_camera.translation *= 0.5;
    }
    write_recording(dir.path(), &recording, RecordingFormat::Colmap).unwrap();
    let (mut points, mut id) = (String::new(), 0);
    let images = std::fs::read_to_string(dir.path().join("sparse/0/images.txt")).unwrap();
    let mut lines: Vec<String> = images.lines().map(String::from).collect();
    for (i, frame) in recording.frames.iter().enumerate() {
        for p in (0..64 * 48).step_by(97) {
            let depth = f64::from(frame.view.depth.as_ref().unwrap().at(p));
            if depth > 0.0 {
                let pixel = DVec2::new((p % 64) as f64 + 0.5, (p / 64) as f64 + 0.5);
                let point = frame.view.camera.unproject(pixel, 0.5 * depth);
                points += &format!("{id} {} {} {} 0 0 0 0.5\n", point.x, point.y, point.z);
                lines[2 + 2 * i] += &format!("{} {} {id} ", pixel.x, pixel.y);
                id += 1;
            }
        }
    }
    std::fs::write(dir.path().join("sparse/0/points3D.txt"), points).unwrap();
    std::fs::write(dir.path().join("sparse/0/images.txt"), lines.join("\n")).unwrap();
    let back = read(dir.path());
    for (a, b) in recording.frames.iter().zip(&back.frames) {
        let (a, b) = (a.view.camera.position() * 2.0, b.view.camera.position());
        assert!(a.distance(b) < 2e-3 * a.length(), "{a} {b}");
    }
    assert!(back.warnings.iter().any(|w| w.contains("scaled by")), "{:?}", back.warnings);
}
