//! Recordings in containers of ROS messages: small bags and MCAP files are built byte by byte.
#![allow(clippy::unwrap_used, reason = "helpers of tests are tests")]

use artgs_io::recording::{RecordingFormat, RecordingOptions, load_recording};
use glam::DVec3;
use std::path::{Path, PathBuf};

/// Encodes values as ROS 1 does, or aligned as ROS 2 does (CDR).
struct Writer {
    bytes: Vec<u8>,
    cdr: bool,
}

impl Writer {
    fn new(cdr: bool) -> Self {
        Self { bytes: if cdr { vec![0, 1, 0, 0] } else { Vec::new() }, cdr }
    }

    /// Values are aligned to their size, counted from the end of the four bytes that state the kind.
    fn put<const N: usize>(&mut self, value: [u8; N]) {
        while self.cdr && !(self.bytes.len() - 4).is_multiple_of(N) {
            self.bytes.push(0);
        }
        self.bytes.extend(value);
    }

    fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }

    fn f64(&mut self, value: f64) {
        self.put(value.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.u32(text.len() as u32 + u32::from(self.cdr));
        self.bytes.extend(text.as_bytes());
        if self.cdr {
            self.bytes.push(0);
        }
    }

    fn header(&mut self, time: f64) {
        if !self.cdr {
            self.u32(0);
        }
        self.u32(time as u32);
        self.u32((time.fract() * 1e9).round() as u32);
        self.text("camera");
    }

    fn image(cdr: bool, time: f64, width: u32, height: u32, encoding: &str, pixels: &[u8]) -> Vec<u8> {
        let mut w = Self::new(cdr);
        w.header(time);
        w.u32(height);
        w.u32(width);
        w.text(encoding);
        w.bytes.push(0);
        w.u32(pixels.len() as u32 / height);
        w.u32(pixels.len() as u32);
        w.bytes.extend(pixels);
        w.bytes
    }

    fn camera(cdr: bool, width: u32, height: u32, focal: f64) -> Vec<u8> {
        let mut w = Self::new(cdr);
        w.header(0.0);
        w.u32(height);
        w.u32(width);
        w.text("plumb_bob");
        w.u32(5);
        [0.0; 5].iter().for_each(|v| w.f64(*v));
        let center = (f64::from(width) / 2.0 - 0.5, f64::from(height) / 2.0 - 0.5);
        [focal, 0.0, center.0, 0.0, focal, center.1, 0.0, 0.0, 1.0].iter().for_each(|v| w.f64(*v));
        w.bytes
    }

    fn transform(x: f64) -> Vec<u8> {
        let mut w = Self::new(false);
        [x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0].iter().for_each(|v| w.f64(*v));
        w.bytes
    }
}

/// Topic, type, time and content.
type Message = (&'static str, &'static str, f64, Vec<u8>);

const FRAMES: usize = 3;

/// Colour of 32x24 pixels, and depth of 64x48 by a camera 40 cm to the left that sees a wall at a distance of 2 m.
fn messages(cdr: bool) -> Vec<Message> {
    let (color, depth) = ("/device_0/sensor_1/Color_0", "/device_0/sensor_0/Depth_0");
    let names: [&'static str; 6] = [
        "/device_0/sensor_1/Color_0/info/camera_info",
        "/device_0/sensor_0/Depth_0/info/camera_info",
        "/device_0/sensor_1/Color_0/tf/0",
        "/device_0/sensor_0/Depth_0/tf/0",
        "/device_0/sensor_1/Color_0/image/data",
        "/device_0/sensor_0/Depth_0/image/data",
    ];
    assert!(names[0].starts_with(color) && names[1].starts_with(depth));
    let mut list = vec![
        (names[0], "sensor_msgs/CameraInfo", 0.0, Writer::camera(cdr, 32, 24, 30.0)),
        (names[1], "sensor_msgs/CameraInfo", 0.0, Writer::camera(cdr, 64, 48, 50.0)),
    ];
    if !cdr {
        list.push((names[2], "geometry_msgs/Transform", 0.0, Writer::transform(-0.4)));
        list.push((names[3], "geometry_msgs/Transform", 0.0, Writer::transform(0.0)));
        let unit = (0.0005_f32).to_le_bytes().to_vec();
        list.push(("/device_0/sensor_0/option/Depth Units/value", "std_msgs/Float32", 0.0, unit));
    }
    for i in 0..FRAMES {
        let time = 50.0 + 0.1 * i as f64;
        let pixels: Vec<u8> = (0..32 * 24).flat_map(|p| [(p % 32) as u8, i as u8, 7]).collect();
        list.push((names[4], "sensor_msgs/Image", time, Writer::image(cdr, time, 32, 24, "bgr8", &pixels)));
        let (size, encoding, count) = if cdr { ((32, 24), "16UC1", 2000_u16) } else { ((64, 48), "mono16", 4000) };
        let depths: Vec<u8> = (0..size.0 * size.1).flat_map(|_| count.to_le_bytes()).collect();
        let late = time + 0.004;
        list.push((names[5], "sensor_msgs/Image", late, Writer::image(cdr, late, size.0, size.1, encoding, &depths)));
    }
    list
}

fn field(out: &mut Vec<u8>, name: &str, value: &[u8]) {
    out.extend((name.len() as u32 + 1 + value.len() as u32).to_le_bytes());
    out.extend(name.as_bytes());
    out.push(b'=');
    out.extend(value);
}

fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let mut head = Vec::new();
    fields.iter().for_each(|(n, v)| field(&mut head, n, v));
    let mut out = (head.len() as u32).to_le_bytes().to_vec();
    out.extend(head);
    out.extend((data.len() as u32).to_le_bytes());
    out.extend(data);
    out
}

fn bag(packed: bool) -> Vec<u8> {
    let mut chunk = Vec::new();
    for (i, (topic, kind, time, content)) in messages(false).iter().enumerate() {
        let id = (i as u32).to_le_bytes();
        let mut connection = Vec::new();
        field(&mut connection, "topic", topic.as_bytes());
        field(&mut connection, "type", kind.as_bytes());
        chunk.extend(record(&[("op", &[7]), ("conn", &id), ("topic", topic.as_bytes())], &connection));
        let mut stamp = (*time as u32).to_le_bytes().to_vec();
        stamp.extend(((time.fract() * 1e9) as u32).to_le_bytes());
        chunk.extend(record(&[("op", &[2]), ("conn", &id), ("time", &stamp)], content));
    }
    let mut out = b"#ROSBAG V2.0\n".to_vec();
    out.extend(record(&[("op", &[3]), ("index_pos", &[0; 8])], b"    "));
    let (name, data) = if packed {
        let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
        std::io::Write::write_all(&mut encoder, &chunk).unwrap();
        (&b"lz4"[..], encoder.finish().unwrap())
    } else {
        (&b"none"[..], chunk)
    };
    out.extend(record(&[("op", &[5]), ("compression", name), ("size", &[0; 4])], &data));
    out
}

fn mcap_record(kind: u8, data: &[u8]) -> Vec<u8> {
    let mut out = vec![kind];
    out.extend((data.len() as u64).to_le_bytes());
    out.extend(data);
    out
}

fn block(out: &mut Vec<u8>, data: &[u8]) {
    out.extend((data.len() as u32).to_le_bytes());
    out.extend(data);
}

fn mcap() -> Vec<u8> {
    let mut records = Vec::new();
    for (i, (topic, kind, time, content)) in messages(true).iter().enumerate() {
        let id = (i as u16 + 1).to_le_bytes();
        let mut schema = id.to_vec();
        block(&mut schema, kind.replace('/', "/msg/").as_bytes());
        block(&mut schema, b"ros2msg");
        block(&mut schema, b"");
        let mut channel = [id, id].concat();
        block(&mut channel, topic.as_bytes());
        block(&mut channel, b"cdr");
        block(&mut channel, b"");
        let mut message = id.to_vec();
        message.extend([0; 4]);
        message.extend(((time * 1e9) as u64).to_le_bytes());
        message.extend([0; 8]);
        message.extend(content);
        for (op, data) in [(3, schema), (4, channel), (5, message)] {
            records.extend(mcap_record(op, &data));
        }
    }
    let mut chunk = vec![0; 28];
    block(&mut chunk, b"");
    chunk.extend((records.len() as u64).to_le_bytes());
    chunk.extend(records);
    let mut out = b"\x89MCAP0\r\n".to_vec();
    out.extend(mcap_record(1, &[0; 8]));
    out.extend(mcap_record(6, &chunk));
    out.extend(mcap_record(15, &[0; 4]));
    out
}

/// A file and poses: the camera moves 10 cm along x from frame to frame.
fn store(dir: &Path, name: &str, bytes: &[u8]) -> (PathBuf, RecordingOptions) {
    let (file, poses) = (dir.join(name), dir.join("poses.txt"));
    std::fs::write(&file, bytes).unwrap();
    let table: String =
        (0..FRAMES).map(|i| format!("{} {} 0 0 0 0 0 1\n", 50.0 + 0.1 * i as f64, 0.1 * i as f64)).collect();
    std::fs::write(&poses, table).unwrap();
    (file, RecordingOptions { poses: Some(poses), ..RecordingOptions::default() })
}

fn check(file: &Path, options: &RecordingOptions, format: RecordingFormat) {
    assert_eq!(RecordingFormat::detect(file), Some(format));
    let back = load_recording(file, options).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((back.frames.len(), back.metric), (FRAMES, true));
    assert!(back.warnings.is_empty(), "{:?}", back.warnings);
    for (i, frame) in back.frames.iter().enumerate() {
        let k = frame.view.camera.intrinsics;
        assert_eq!((k.width, k.height, k.fx, k.cx, k.cy), (32, 24, 30.0, 16.0, 12.0));
        assert_eq!(frame.view.rgba[5], [7, i as u8, 5, 255]);
        assert!(frame.view.camera.position().distance(DVec3::X * 0.1 * i as f64) < 1e-6);
        let depth = frame.view.depth.as_ref().unwrap();
        assert!((depth.at(12 * 32 + 16) - 2.0).abs() < 1e-3, "{}", depth.at(12 * 32 + 16));
    }
}

#[test]
fn bags_are_read() {
    for packed in [false, true] {
        let dir = tempfile::tempdir().unwrap();
        let (file, options) = store(dir.path(), "a.bag", &bag(packed));
        check(&file, &options, RecordingFormat::RealsenseBag);
    }
}

/// Depth of the other camera: the right border of the colour image is beyond its view, the left one is not.
#[test]
fn depth_is_moved_to_the_colour_camera() {
    let dir = tempfile::tempdir().unwrap();
    let (file, options) = store(dir.path(), "a.bag", &bag(false));
    let back = load_recording(&file, &options).unwrap();
    let depth = back.frames[0].view.depth.as_ref().unwrap();
    let seen = |x: usize| depth.at(12 * 32 + x) > 0.0;
    // At 2 m the depth camera sees 1.26 m to either side of itself, the colour camera 1.07 m, 40 cm farther to the right.
    assert!(seen(0) && seen(28) && !seen(30));
    assert_eq!(back.frames[0].depth_step, 1.0);
}

/// Colour and depth that were recorded at different times do not form frames.
#[test]
fn depth_of_another_time_is_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let mut bytes = bag(false);
    // 50.004 s, 50.104 s and 50.204 s become 50.044 s and so on.
    for i in 0..FRAMES as u32 {
        let (was, now) = (i * 100_000_000 + 4_000_000, i * 100_000_000 + 44_000_000);
        let pattern = |n: u32| [50_u32.to_le_bytes(), n.to_le_bytes()].concat();
        let all: Vec<usize> = (0..bytes.len() - 8).filter(|at| near(&bytes[*at..*at + 8], &pattern(was))).collect();
        assert!(!all.is_empty());
        all.iter().for_each(|at| bytes[*at..*at + 8].copy_from_slice(&pattern(now)));
    }
    let (file, options) = store(dir.path(), "a.bag", &bytes);
    let back = load_recording(&file, &options).unwrap();
    assert!(!back.has_depth() && back.warnings[0].contains("no depth image within 20 ms"), "{:?}", back.warnings);
}

/// True for time stamps that differ by rounding.
fn near(a: &[u8], b: &[u8]) -> bool {
    let nanoseconds = |t: &[u8]| u32::from_le_bytes([t[4], t[5], t[6], t[7]]);
    a[..4] == b[..4] && nanoseconds(a).abs_diff(nanoseconds(b)) < 100
}

#[test]
fn mcap_files_are_read() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = mcap();
    let (file, options) = store(dir.path(), "a.mcap", &bytes);
    let text = load_recording(&file, &options).map(|r| r.format).unwrap_err().to_string();
    assert!(text.contains("a.mcap") && text.contains("aligned to colour"), "{text}");
    let (file, options) = store(dir.path(), "a.mcap", &aligned_mcap());
    check(&file, &options, RecordingFormat::Mcap);
}

/// Depth that is aligned to colour.
fn aligned_mcap() -> Vec<u8> {
    let names = [&b"/device_0/sensor_0/Depth_0/image/data"[..], &b"/device_0/sensor_0/aligned/image/data"[..]];
    let mut renamed = mcap();
    while let Some(at) = renamed.windows(37).position(|w| w == names[0]) {
        renamed[at..at + 37].copy_from_slice(names[1]);
    }
    renamed
}

/// Other tests damage these files. `ARTGS_UPDATE=1` writes them.
#[test]
fn the_corpus_has_these_files() {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/containers");
    for (name, bytes) in [("small.bag", bag(false)), ("packed.bag", bag(true)), ("small.mcap", aligned_mcap())] {
        if std::env::var_os("ARTGS_UPDATE").is_some() {
            std::fs::create_dir_all(&corpus).unwrap();
            store(&corpus, name, &bytes);
        }
        let (file, options) = (corpus.join(name), RecordingOptions::default());
        assert!(std::fs::read(&file).unwrap() == bytes, "{name} differs; ARTGS_UPDATE=1 writes it");
        let options = RecordingOptions { poses: Some(corpus.join("poses.txt")), ..options };
        assert_eq!(load_recording(&file, &options).unwrap().frames.len(), FRAMES);
    }
}

#[test]
fn incomplete_containers_and_absent_poses_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in [("a.bag", bag(true)), ("b.bag", bag(false)), ("a.mcap", mcap())] {
        let (file, options) = store(dir.path(), name, &bytes[..bytes.len() * 2 / 3]);
        let text = load_recording(&file, &options).unwrap_err().to_string();
        assert!(text.contains(name) && text.contains("damaged or incomplete"), "{text}");
        let text = load_recording(&file, &RecordingOptions::default()).unwrap_err().to_string();
        assert!(text.contains(name) && text.contains("contains no poses"), "{text}");
    }
    let (file, options) = store(dir.path(), "a.bag", &bag(false));
    std::fs::write(options.poses.as_ref().unwrap(), "9000 0 0 0 0 0 0 1\n").unwrap();
    let text = load_recording(&file, &options).unwrap_err().to_string();
    assert!(text.contains("poses.txt") && text.contains("50.000 to 50.200"), "{text}");
}
