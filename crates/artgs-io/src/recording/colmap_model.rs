//! The files of a COLMAP model.

use super::RecordingError;
use super::binary::{Bytes, Ends};
use super::files::{Row, rows, text};
use super::lens::{Distortion, Lens};
use super::pose::unit;
use crate::error::read_bytes;
use artgs_core::Rigid;
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Cameras, posed images and points.
pub(super) struct Model {
    pub(super) cameras: BTreeMap<u32, Lens>,
    pub(super) shots: Vec<Shot>,
    /// Path of the file with the images, for messages.
    pub(super) images_file: PathBuf,
}

/// A posed image.
pub(super) struct Shot {
    pub(super) name: String,
    pub(super) world_to_camera: Rigid,
    /// Number of its camera.
    pub(super) camera: u32,
    /// Where a point was observed: pixel and number of the point.
    pub(super) observations: Vec<(DVec2, u64)>,
}

/// Names and numbers of parameters in the order of COLMAP's model numbers.
const MODELS: [(&str, usize); 11] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
];

impl Model {
    /// The files of cameras and images with a suffix.
    pub(super) fn files(dir: &Path, suffix: &str) -> [PathBuf; 2] {
        [dir.join(format!("cameras.{suffix}")), dir.join(format!("images.{suffix}"))]
    }

    /// Reads the binary files if they exist, else the text files.
    pub(super) fn read(dir: &Path) -> Result<Self, RecordingError> {
        let [cameras_file, images_file] = Self::files(dir, "bin");
        if cameras_file.is_file() && images_file.is_file() {
            let cameras = parse(&cameras_file, binary_cameras)?;
            let shots = parse(&images_file, binary_shots)?;
            return Ok(Self { cameras, shots, images_file });
        }
        let [cameras_file, images_file] = Self::files(dir, "txt");
        let cameras = rows(&cameras_file)?.iter().map(text_camera).collect::<Result<_, _>>();
        let cameras = cameras.map_err(|e| RecordingError::malformed(&cameras_file, e))?;
        let shots = text_shots(&text(&images_file)?).map_err(|e| RecordingError::malformed(&images_file, e))?;
        Ok(Self { cameras, shots, images_file })
    }
}

/// Positions of points by their numbers, from the file beside the images; empty if there is none.
pub(super) fn points(dir: &Path) -> Result<BTreeMap<u64, DVec3>, RecordingError> {
    let binary = dir.join("points3D.bin");
    if binary.is_file() {
        return parse(&binary, binary_points);
    }
    let path = dir.join("points3D.txt");
    if !path.is_file() {
        return Ok(BTreeMap::new());
    }
    let point = |row: &Row| {
        let words: Vec<&str> = row.words().collect();
        let position: Option<Vec<f64>> = words.get(1..4).map(|w| w.iter().filter_map(|v| v.parse().ok()).collect());
        match (words.first().and_then(|w| w.parse().ok()), position.as_deref()) {
            (Some(id), Some(&[x, y, z])) => Ok((id, DVec3::new(x, y, z))),
            _ => Err(format!("line {}: expected a number and a position; export the model again", row.line)),
        }
    };
    let points: Result<_, String> = rows(&path)?.iter().map(point).collect();
    points.map_err(|e| RecordingError::malformed(&path, e))
}

fn parse<T>(path: &Path, parser: fn(&mut Bytes) -> Result<T, Problem>) -> Result<T, RecordingError> {
    let bytes = read_bytes(path)?;
    parser(&mut Bytes::new(&bytes)).map_err(|problem| {
        let reason = match problem {
            Problem::Ends => "ends inside an entry; export the model again".into(),
            Problem::Other(reason) => reason,
        };
        RecordingError::malformed(path, reason)
    })
}

enum Problem {
    Ends,
    Other(String),
}

impl From<Ends> for Problem {
    fn from(_: Ends) -> Self {
        Self::Ends
    }
}

impl From<String> for Problem {
    fn from(reason: String) -> Self {
        Self::Other(reason)
    }
}

fn lens(model: &str, width: u32, height: u32, p: &[f64]) -> Result<Lens, String> {
    let Some((_, count)) = MODELS.iter().find(|m| m.0 == model) else {
        return Err(format!("camera model `{model}` is unknown; undistort the images with COLMAP's image_undistorter"));
    };
    if p.len() != *count || p.iter().any(|v| !v.is_finite()) {
        return Err(format!("camera model {model} has {} parameters, expected {count} finite numbers", p.len()));
    }
    let (one, two) = (DVec2::splat(p[0]), DVec2::new(p[0], p[1]));
    let (focal, center, distortion) = match (model, p) {
        ("SIMPLE_PINHOLE", _) => (one, &p[1..3], Distortion::None),
        ("PINHOLE", _) => (two, &p[2..4], Distortion::None),
        ("SIMPLE_RADIAL", &[_, _, _, k]) => (one, &p[1..3], Distortion::radial([k, 0., 0., 0., 0., 0.], [0.; 2])),
        ("RADIAL", &[_, _, _, k1, k2]) => (one, &p[1..3], Distortion::radial([k1, k2, 0., 0., 0., 0.], [0.; 2])),
        ("OPENCV", &[.., k1, k2, p1, p2]) => (two, &p[2..4], Distortion::radial([k1, k2, 0., 0., 0., 0.], [p1, p2])),
        ("FULL_OPENCV", &[_, _, _, _, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            (two, &p[2..4], Distortion::radial([k1, k2, k3, k4, k5, k6], [p1, p2]))
        }
        ("OPENCV_FISHEYE", &[.., k1, k2, k3, k4]) => (two, &p[2..4], Distortion::Fisheye([k1, k2, k3, k4])),
        ("SIMPLE_RADIAL_FISHEYE", &[_, _, _, k]) => (one, &p[1..3], Distortion::Fisheye([k, 0., 0., 0.])),
        ("RADIAL_FISHEYE", &[_, _, _, k1, k2]) => (one, &p[1..3], Distortion::Fisheye([k1, k2, 0., 0.])),
        _ => {
            let remedy = "undistort the images with COLMAP's image_undistorter";
            return Err(format!("camera model {model} is not supported; {remedy}"));
        }
    };
    Ok(Lens { focal, center: Some(DVec2::new(center[0], center[1])), size: Some((width, height)), distortion })
}

fn text_camera(row: &Row) -> Result<(u32, Lens), String> {
    let words: Vec<&str> = row.words().collect();
    let fail = |what: &str| format!("line {}: {what}; export the model again", row.line);
    let [id, model, width, height, parameters @ ..] = words.as_slice() else { return Err(fail("too few values")) };
    let (Ok(id), Ok(width), Ok(height)) = (id.parse(), width.parse(), height.parse()) else {
        return Err(fail("number, width and height must be whole numbers"));
    };
    let parameters: Result<Vec<f64>, _> = parameters.iter().map(|p| p.parse::<f64>()).collect();
    let parameters = parameters.map_err(|_| fail("a parameter is not a number"))?;
    let lens = lens(model, width, height, &parameters).map_err(|e| format!("line {}: {e}", row.line))?;
    Ok((id, lens))
}

/// Every image has two lines; the second, with observations, may be empty.
fn text_shots(text: &str) -> Result<Vec<Shot>, String> {
    let mut lines = text.lines().enumerate().filter(|(_, l)| !l.trim_start().starts_with('#'));
    let mut shots = Vec::new();
    while let Some((i, line)) = lines.next() {
        if line.trim().is_empty() {
            continue;
        }
        let fail = |what: &str| format!("line {}: {what}; export the model again", i + 1);
        let words: Vec<&str> = line.split_whitespace().collect();
        // Names may contain spaces.
        if words.len() < 10 {
            return Err(fail("expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME"));
        }
        let pose: Option<Vec<f64>> = words[1..8].iter().map(|w| w.parse().ok()).collect();
        let (Some(pose), Ok(camera)) = (pose, words[8].parse()) else { return Err(fail("a value is not a number")) };
        let world_to_camera = world_to_camera(&pose).map_err(|e| format!("line {}: {e}", i + 1))?;
        let seen = lines.next().map_or("", |(_, l)| l);
        let seen: Vec<f64> = seen.split_whitespace().map_while(|w| w.parse().ok()).collect();
        let observations = seen.as_chunks::<3>().0.iter().filter(|o| o[2] >= 0.0);
        shots.push(Shot {
            name: words[9..].join(" "),
            world_to_camera,
            camera,
            observations: observations.map(|o| (DVec2::new(o[0], o[1]), o[2] as u64)).collect(),
        });
    }
    Ok(shots)
}

/// QW QX QY QZ TX TY TZ.
fn world_to_camera(p: &[f64]) -> Result<Rigid, String> {
    let translation = DVec3::new(p[4], p[5], p[6]);
    if !translation.is_finite() {
        return Err("the pose is not finite; remove or repair the image".into());
    }
    Ok(Rigid { rotation: unit([p[1], p[2], p[3], p[0]])?, translation })
}

fn binary_cameras(bytes: &mut Bytes) -> Result<BTreeMap<u32, Lens>, Problem> {
    let camera = |bytes: &mut Bytes| -> Result<(u32, Lens), Problem> {
        let (id, model) = (bytes.u32()?, bytes.i32()?);
        let (width, height) = (bytes.u64()?, bytes.u64()?);
        let known = usize::try_from(model).ok().and_then(|m| MODELS.get(m));
        let Some((name, count)) = known else {
            return Err(format!("camera model {model} is unknown; use the text format").into());
        };
        let parameters: Result<Vec<f64>, Ends> = (0..*count).map(|_| bytes.f64()).collect();
        let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
            return Err(format!("camera {id} is {width}x{height}; export the model again").into());
        };
        Ok((id, lens(name, width, height, &parameters?).map_err(|e| format!("camera {id}: {e}"))?))
    };
    let count = bytes.count(24)?;
    (0..count).map(|_| camera(bytes)).collect()
}

fn binary_shots(bytes: &mut Bytes) -> Result<Vec<Shot>, Problem> {
    let shot = |bytes: &mut Bytes| -> Result<Shot, Problem> {
        let id = bytes.u32()?;
        let world_to_camera = world_to_camera(&bytes.f64s::<7>()?).map_err(|e| format!("image {id}: {e}"))?;
        let (camera, name) = (bytes.u32()?, bytes.zero_ended()?);
        let count = bytes.count(24)?;
        let mut observations = Vec::new();
        for _ in 0..count {
            let ([x, y], point) = (bytes.f64s::<2>()?, bytes.u64()?);
            // The largest number is "no point".
            if point != u64::MAX {
                observations.push((DVec2::new(x, y), point));
            }
        }
        Ok(Shot { name, world_to_camera, camera, observations })
    };
    let count = bytes.count(64)?;
    (0..count).map(|_| shot(bytes)).collect()
}

fn binary_points(bytes: &mut Bytes) -> Result<BTreeMap<u64, DVec3>, Problem> {
    let point = |bytes: &mut Bytes| -> Result<(u64, DVec3), Problem> {
        let (id, [x, y, z]) = (bytes.u64()?, bytes.f64s::<3>()?);
        // Colour and error, then the track.
        bytes.take(3 + 8)?;
        let track = bytes.count(8)?;
        bytes.take(8 * track)?;
        Ok((id, DVec3::new(x, y, z)))
    };
    let count = bytes.count(43)?;
    (0..count).map(|_| point(bytes)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera_bytes(model: i32, parameters: &[f64]) -> Vec<u8> {
        let mut bytes = 1_u64.to_le_bytes().to_vec();
        bytes.extend(7_u32.to_le_bytes());
        bytes.extend(model.to_le_bytes());
        bytes.extend(640_u64.to_le_bytes());
        bytes.extend(480_u64.to_le_bytes());
        bytes.extend(parameters.iter().flat_map(|p| p.to_le_bytes()));
        bytes
    }

    fn problem<T>(result: Result<T, Problem>) -> String {
        match result {
            Ok(_) => "none".into(),
            Err(Problem::Ends) => "ends".into(),
            Err(Problem::Other(reason)) => reason,
        }
    }

    #[test]
    fn binary_and_text_cameras_agree() {
        let p = [500.0, 510.0, 321.0, 239.0, 0.1, -0.02, 0.001, 0.002];
        let bytes = camera_bytes(4, &p);
        let Ok(cameras) = binary_cameras(&mut Bytes::new(&bytes)) else { panic!("unreadable") };
        let line = Row { line: 1, text: "7 OPENCV 640 480 500 510 321 239 0.1 -0.02 0.001 0.002".into() };
        assert_eq!(text_camera(&line).unwrap(), (7, cameras[&7]));
        assert_eq!(cameras[&7].distortion, Distortion::radial([0.1, -0.02, 0.0, 0.0, 0.0, 0.0], [0.001, 0.002]));
        assert_eq!(problem(binary_cameras(&mut Bytes::new(&bytes[..bytes.len() - 1]))), "ends");
        assert!(problem(binary_cameras(&mut Bytes::new(&camera_bytes(7, &[0.0; 5])))).contains("image_undistorter"));
        assert!(problem(binary_cameras(&mut Bytes::new(&camera_bytes(99, &[])))).contains("model 99"));
    }

    #[test]
    fn binary_and_text_images_agree() {
        let mut bytes = 1_u64.to_le_bytes().to_vec();
        bytes.extend(3_u32.to_le_bytes());
        let pose = [1.0, 0.0, 0.0, 0.0, 0.5, -0.25, 2.0];
        bytes.extend(pose.iter().flat_map(|p: &f64| p.to_le_bytes()));
        bytes.extend(7_u32.to_le_bytes());
        bytes.extend(b"a b.jpg\0");
        bytes.extend(2_u64.to_le_bytes());
        for (x, y, id) in [(10.5_f64, 20.5_f64, 4_u64), (1.0, 2.0, u64::MAX)] {
            bytes.extend(x.to_le_bytes().iter().chain(&y.to_le_bytes()).chain(&id.to_le_bytes()));
        }
        let Ok(binary) = binary_shots(&mut Bytes::new(&bytes)) else { panic!("unreadable") };
        let text = "# head\n3 1 0 0 0 0.5 -0.25 2 7 a b.jpg\n10.5 20.5 4 1 2 -1\n5 1 0 0 0 0 0 0 7 c.jpg\n\n";
        let from_text = text_shots(text).unwrap();
        assert_eq!((from_text.len(), from_text[1].name.as_str()), (2, "c.jpg"));
        for shot in [&binary[0], &from_text[0]] {
            assert_eq!((shot.name.as_str(), shot.camera), ("a b.jpg", 7));
            assert_eq!(shot.world_to_camera.translation, DVec3::new(0.5, -0.25, 2.0));
            assert_eq!(shot.observations, [(DVec2::new(10.5, 20.5), 4)]);
        }
        assert_eq!(problem(binary_shots(&mut Bytes::new(&bytes[..50]))), "ends");
        assert!(text_shots("3 1 0 0 0 0.5 x 2 7 a.jpg\n\n").err().unwrap().contains("line 1"));
    }

    #[test]
    fn binary_points_skip_their_tracks() {
        let mut bytes = 2_u64.to_le_bytes().to_vec();
        for id in [5_u64, 9] {
            bytes.extend(id.to_le_bytes());
            bytes.extend([1.0_f64, 2.0, id as f64].iter().flat_map(|v| v.to_le_bytes()));
            bytes.extend([0; 11]);
            bytes.extend(1_u64.to_le_bytes());
            bytes.extend([0; 8]);
        }
        let Ok(points) = binary_points(&mut Bytes::new(&bytes)) else { panic!("unreadable") };
        assert_eq!((points.len(), points[&9]), (2, DVec3::new(1.0, 2.0, 9.0)));
    }
}
