//! Camera intrinsics in files beside a recording, or one level above it.

use super::depth::Measured;
use super::files::{loose_numbers, names, text};
use super::lens::Lens;
use super::options::parse_intrinsics;
use super::warp::DepthCamera;
use super::{RecordingError, RecordingOptions};
use crate::capture::json::object_of_bytes;
use artgs_core::{Intrinsics, Rigid};
use glam::DVec3;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Names of files with intrinsics, the usual ones first.
const FILES: [&str; 24] = [
    "intrinsics.txt",
    "calibration.txt",
    "camera-intrinsics.txt",
    "camera_intrinsics.txt",
    "intrinsic.txt",
    "info.txt",
    "_info.txt",
    "cam_K.txt",
    "K.txt",
    "camera.txt",
    "calib.txt",
    "intrinsic/intrinsic_color.txt",
    "intrinsic_color.txt",
    "intrinsics_color.txt",
    "camera_matrix.csv",
    "intrinsic.json",
    "intrinsics.json",
    "camera_intrinsic.json",
    "camera_intrinsics.json",
    "cam_params.json",
    "camera.json",
    "calibration.yaml",
    "camera.yaml",
    "intrinsics.yaml",
];

/// Files with the intrinsics of the depth camera where it has its own.
const OF_DEPTH: [&str; 3] = ["intrinsic/intrinsic_depth.txt", "intrinsic_depth.txt", "intrinsics_depth.txt"];

/// What the files of a recording state about its cameras.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cameras {
    pub(super) lens: Lens,
    /// The depth camera if it is another one.
    depth: Option<DepthCamera>,
    /// Stored numbers of depth per metre, where they are stated.
    pub(super) per_metre: Option<f32>,
}

impl Cameras {
    /// One camera for colour and depth.
    pub(super) fn of_lens(lens: Lens) -> Self {
        Self { lens, depth: None, per_metre: None }
    }

    fn of_color(k: &Intrinsics) -> Self {
        Self::of_lens(Lens::pinhole(k))
    }

    /// Depth of the depth camera if that is not the colour camera.
    pub(super) fn place(&self, depth: Measured) -> Measured {
        let own = self.depth.filter(|own| own.intrinsics.width == 0 || own.intrinsics.width == depth.width);
        let sized = |mut own: DepthCamera| {
            (own.intrinsics.width, own.intrinsics.height) = (depth.width, depth.height);
            own
        };
        Measured { camera: own.map(sized), ..depth }
    }
}

/// Intrinsics from the options, else from a file in `dir` or in the folder above it; none if there is none. Warnings say which of
/// several differing files is used.
pub(super) fn find(
    dir: &Path,
    options: &RecordingOptions,
    warnings: &mut Vec<String>,
) -> Result<Option<Cameras>, RecordingError> {
    if let Some(k) = &options.intrinsics {
        return Ok(Some(Cameras::of_color(k)));
    }
    let above = dir.file_name().and(dir.parent());
    let mut first_error = None;
    for folder in [Some(dir), above].into_iter().flatten() {
        let mut found: Vec<(PathBuf, Cameras)> = Vec::new();
        for path in candidates(folder) {
            match read(&path) {
                Ok(cameras) => found.push((path, cameras)),
                Err(reason) if folder == dir => {
                    first_error.get_or_insert((path, reason));
                }
                Err(_) => {}
            }
        }
        let Some((path, cameras)) = found.first().cloned() else { continue };
        let differs = |other: &Cameras| (other.lens.focal.x / cameras.lens.focal.x - 1.0).abs() > 0.01;
        let others: Vec<String> =
            found.iter().filter(|(_, c)| differs(c)).map(|(p, _)| p.display().to_string()).collect();
        if folder != dir || !others.is_empty() {
            let left = if others.is_empty() { String::new() } else { format!(", not those of {}", others.join(", ")) };
            warnings.push(format!("{}: the intrinsics of {} are used{left}", dir.display(), path.display()));
        }
        return Ok(Some(cameras));
    }
    first_error.map_or(Ok(None), |(path, reason)| Err(RecordingError::malformed(&path, reason)))
}

fn candidates(folder: &Path) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = FILES.iter().map(|name| folder.join(name)).filter(|p| p.is_file()).collect();
    let other = |name: &String| name.ends_with("_calib.yaml") || name.ends_with("_intrinsics.txt");
    all.extend(names(folder).into_iter().filter(other).map(|name| folder.join(name)));
    all
}

/// Reads one file; the error says what is wrong with it.
pub(super) fn read(path: &Path) -> Result<Cameras, String> {
    let content = text(path).map_err(|e| e.to_string())?;
    let suffix = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    let mut cameras = match suffix {
        "json" => of_json(&content, path)?,
        "yaml" | "yml" => of_yaml(&content)?,
        "pincam" => of_pincam(&content)?,
        _ if content.contains("Intrinsic =") || content.contains("fx_color") => of_keys(&content)?,
        _ => Cameras::of_color(&of_numbers(&content)?),
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let beside = OF_DEPTH.iter().filter_map(|name| Path::new(name).file_name()).map(|name| folder.join(name));
    if let Some(depth) = beside.into_iter().find(|p| p.is_file() && *p != path) {
        let own = of_numbers(&text(&depth).map_err(|e| e.to_string())?)?;
        let color = cameras.lens;
        let same = (own.fx - color.focal.x).abs() < 1e-6 && color.center.is_some_and(|c| (c.x - own.cx).abs() < 1e-6);
        cameras.depth = (!same).then_some(DepthCamera { intrinsics: own, color_from_depth: Rigid::IDENTITY });
    }
    Ok(cameras)
}

/// `fx fy cx cy [width height]`, a matrix of 3x3, 3x4 or 4x4, or four numbers with five of distortion.
fn of_numbers(content: &str) -> Result<Intrinsics, String> {
    let lines = content.lines().map(|l| l.split('#').next().unwrap_or("")).collect::<Vec<_>>().join(" ");
    match loose_numbers(&lines).as_deref() {
        Some(&[fx, s, cx, z, fy, cy, a, b, c]) if s.abs() < fx && z == 0.0 && a == 0.0 && b == 0.0 && c == 1.0 => {
            checked([fx, fy, cx, cy], (0, 0))
        }
        Some(&[fx, _, cx, _, _, fy, cy, ..]) if [12, 16].contains(&loose_numbers(&lines).map_or(0, |n| n.len())) => {
            checked([fx, fy, cx, cy], (0, 0))
        }
        _ => parse_intrinsics(&lines),
    }
}

/// ARKitScenes: width, height, then the intrinsics.
fn of_pincam(content: &str) -> Result<Cameras, String> {
    let Some(&[w, h, fx, fy, cx, cy]) = loose_numbers(content).as_deref() else {
        return Err("expected `width height fx fy cx cy`; copy the file again".into());
    };
    Ok(Cameras::of_color(&checked([fx, fy, cx, cy], (w as u32, h as u32))?))
}

fn checked(k: [f64; 4], size: (u32, u32)) -> Result<Intrinsics, String> {
    let [fx, fy, cx, cy] = k;
    parse_intrinsics(&format!("{fx} {fy} {cx} {cy} {} {}", size.0, size.1))
}

/// `key = value` lines: `info.txt` of 7-Scenes, BundleFusion and 3RScan, and the description of a scene of ScanNet.
fn of_keys(content: &str) -> Result<Cameras, String> {
    let values = |key: &str| -> Option<Vec<f64>> {
        let line = content.lines().find(|l| l.split('=').next().is_some_and(|k| k.trim() == key))?;
        loose_numbers(line.split_once('=')?.1)
    };
    let one = |key: &str| values(key).and_then(|v| v.first().copied());
    let size = |w: &str, h: &str| (one(w).unwrap_or(0.0) as u32, one(h).unwrap_or(0.0) as u32);
    let matrix = |key: &str| values(key).filter(|v| v.len() == 16).map(|v| [v[0], v[5], v[2], v[6]]);
    let separate = |suffix: &str| -> Option<[f64; 4]> {
        let value = |name: &str| one(&format!("{name}_{suffix}"));
        Some([value("fx")?, value("fy")?, value("mx")?, value("my")?])
    };
    let color = matrix("m_calibrationColorIntrinsic").or_else(|| separate("color"));
    let color = color.ok_or("states no intrinsics of the colour camera; add them")?;
    let (color_size, depth_size) = if content.contains("m_colorWidth") {
        (size("m_colorWidth", "m_colorHeight"), size("m_depthWidth", "m_depthHeight"))
    } else {
        (size("colorWidth", "colorHeight"), size("depthWidth", "depthHeight"))
    };
    let mut cameras = Cameras::of_color(&checked(color, color_size)?);
    cameras.per_metre = one("m_depthShift").filter(|s| *s > 0.0).map(|s| s as f32);
    let depth = matrix("m_calibrationDepthIntrinsic").or_else(|| separate("depth"));
    if let Some(depth) = depth.filter(|d| depth_size.0 > 0 && !same_view((&color, color_size), (d, depth_size))) {
        let intrinsics = checked(depth, depth_size)?;
        let moved = values("m_calibrationDepthExtrinsic").filter(|v| v.len() == 16);
        let moved = moved.map_or(DVec3::ZERO, |v| DVec3::new(v[3], v[7], v[11]));
        // A shift of metres is one in another unit, or no shift between two cameras of a device.
        let translation = if moved.length() < 0.3 { moved } else { DVec3::ZERO };
        let color_from_depth = Rigid { translation, ..Rigid::IDENTITY };
        cameras.depth = Some(DepthCamera { intrinsics, color_from_depth });
    }
    Ok(cameras)
}

/// True if both cameras look in the same directions: the depth image is the colour image at another size.
fn same_view(color: (&[f64; 4], (u32, u32)), depth: (&[f64; 4], (u32, u32))) -> bool {
    let scaled = |(k, (w, h)): (&[f64; 4], (u32, u32))| {
        let (w, h) = (f64::from(w.max(1)), f64::from(h.max(1)));
        [k[0] / w, k[1] / h, (k[2] + 0.5) / w, (k[3] + 0.5) / h]
    };
    scaled(color).iter().zip(scaled(depth)).all(|(a, b)| (a - b).abs() < 0.005)
}

/// An object with `fx`, `fy`, `cx`, `cy`, or a matrix, at any level; Open3D stores matrices column by column.
fn of_json(content: &str, path: &Path) -> Result<Cameras, String> {
    let root = object_of_bytes(content.as_bytes(), path).map_err(|e| e.to_string())?;
    let missing = "states neither `fx`, `fy`, `cx`, `cy` nor an intrinsic matrix; add them";
    let root = Value::Object(root);
    let (k, holder) = search(&root, 0).ok_or(missing)?;
    let side = |keys: [&str; 3]| {
        let value = keys.iter().find_map(|key| holder.get(*key).or(root.get(*key)));
        value.and_then(Value::as_u64).unwrap_or(0) as u32
    };
    let size = (side(["width", "w", "image_width"]), side(["height", "h", "image_height"]));
    let mut cameras = Cameras::of_color(&checked(k, size)?);
    let scale = ["scale", "depth_scale", "png_depth_scale"].iter().find_map(|key| holder.get(*key).or(root.get(*key)));
    cameras.per_metre = scale.and_then(Value::as_f64).filter(|s| *s > 1.0).map(|s| s as f32);
    Ok(cameras)
}

/// fx, fy, cx, cy and the object that holds them.
fn search(value: &Value, depth: usize) -> Option<([f64; 4], &Value)> {
    let object = value.as_object().filter(|_| depth < 4)?;
    let number = |keys: [&str; 2]| keys.iter().find_map(|k| object.get(*k)?.as_f64());
    let four = [["fx", "fl_x"], ["fy", "fl_y"], ["cx", "ppx"], ["cy", "ppy"]].map(number);
    if let [Some(fx), Some(fy), Some(cx), Some(cy)] = four {
        return Some(([fx, fy, cx, cy], value));
    }
    for key in ["intrinsic_matrix", "camera_matrix", "K", "intrinsic", "intrinsics"] {
        let flat = object.get(key).map(flattened).unwrap_or_default();
        if let &[fx, a, b, _, fy, c, d, e, _] = flat.as_slice() {
            let by_columns = b == 0.0 && c == 0.0 && d != 0.0 && a == 0.0;
            return Some(([fx, fy, if by_columns { d } else { b }, if by_columns { e } else { c }], value));
        }
    }
    object.values().find_map(|inner| search(inner, depth + 1))
}

fn flattened(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(list) => list.iter().flat_map(flattened).collect(),
        Value::Object(object) => object.get("data").map(flattened).unwrap_or_default(),
        other => other.as_f64().into_iter().collect(),
    }
}

/// `camera_matrix` as OpenCV and ROS write it, or `Camera.fx` as ORB-SLAM does.
fn of_yaml(content: &str) -> Result<Cameras, String> {
    let value = |keys: [&str; 2]| {
        let line =
            content.lines().find_map(|l| keys.iter().find_map(|k| l.trim().strip_prefix(k)?.strip_prefix(':')))?;
        line.trim().parse::<f64>().ok()
    };
    let size = |keys| value(keys).filter(|v| (0.0..1e5).contains(v)).unwrap_or(0.0) as u32;
    let sides = (size(["image_width", "Camera.width"]), size(["image_height", "Camera.height"]));
    let matrix = content.split_once("camera_matrix").and_then(|(_, rest)| {
        let list = rest.split_once("data:")?.1.split_once('[')?.1.split_once(']')?.0;
        loose_numbers(list).filter(|n| n.len() == 9)
    });
    let k = match matrix {
        Some(m) => [m[0], m[4], m[2], m[5]],
        None => {
            let keys = [
                ["Camera.fx", "Camera1.fx"],
                ["Camera.fy", "Camera1.fy"],
                ["Camera.cx", "Camera1.cx"],
                ["Camera.cy", "Camera1.cy"],
            ];
            let [Some(fx), Some(fy), Some(cx), Some(cy)] = keys.map(value) else {
                return Err("states no `camera_matrix` with 9 numbers in `data`; add it".into());
            };
            [fx, fy, cx, cy]
        }
    };
    Ok(Cameras::of_color(&checked(k, sides)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(name: &str, content: &str) -> Result<Cameras, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(name);
        std::fs::write(&path, content).unwrap();
        read(&path)
    }

    #[test]
    fn all_notations_give_the_same_camera() {
        for (name, content) in [
            ("intrinsics.txt", "# fx fy cx cy\n500 510 320 240\n"),
            ("cam_K.txt", "500 0 320\n0 510 240\n0 0 1\n"),
            ("intrinsic_color.txt", "500 0 320 0\n0 510 240 0\n0 0 1 0\n0 0 0 1\n"),
            ("camera_matrix.csv", "500.0, 0.0, 320.0\n0.0, 510.0, 240.0\n0.0, 0.0, 1.0\n"),
            (
                "info.txt",
                "m_colorWidth = 640\nm_colorHeight = 480\nm_calibrationColorIntrinsic = 500 0 320 0 0 510 240 0 0 0 1 0 0 0 0 1 \n",
            ),
            (
                "intrinsic.json",
                r#"{"intrinsic_matrix": [500, 0, 0, 0, 510, 0, 320, 240, 1], "width": 640, "height": 480}"#,
            ),
            ("a.json", r#"{"camera": {"fx": 500, "fy": 510, "cx": 320, "cy": 240, "w": 640, "h": 480}}"#),
            (
                "a.yaml",
                "%YAML:1.0\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   data: [ 500., 0., 320., 0., 510., 240., 0., 0., 1. ]\n",
            ),
            ("b.yaml", "Camera.fx: 500.0\nCamera.fy: 510.0\nCamera.cx: 320\nCamera.cy: 240\n"),
        ] {
            let lens = of(name, content).unwrap_or_else(|e| panic!("{name}: {e}")).lens;
            assert_eq!((lens.focal.x, lens.focal.y), (500.0, 510.0), "{name}");
            assert_eq!(lens.center.unwrap().to_array(), [320.5, 240.5], "{name}");
        }
        assert!(of("a.yaml", "x: 1").unwrap_err().contains("camera_matrix"));
    }

    #[test]
    fn a_depth_camera_of_its_own_and_the_unit_are_read() {
        let info = "m_colorWidth = 960\nm_colorHeight = 540\nm_depthWidth = 224\nm_depthHeight = 172\nm_depthShift = 1000\n\
                    m_calibrationColorIntrinsic = 757 0 479 0 0 757 268 0 0 0 1 0 0 0 0 1\n\
                    m_calibrationDepthIntrinsic = 176 0 111 0 0 176 83 0 0 0 1 0 0 0 0 1\n";
        let cameras = of("_info.txt", info).unwrap();
        assert_eq!((cameras.per_metre, cameras.lens.size), (Some(1000.0), Some((960, 540))));
        assert_eq!(cameras.depth.unwrap().intrinsics.fx, 176.0);
    }

    #[test]
    fn files_one_level_up_are_found_and_named() {
        let dir = tempfile::tempdir().unwrap();
        let inside = dir.path().join("seq-01");
        std::fs::create_dir(&inside).unwrap();
        std::fs::write(dir.path().join("camera-intrinsics.txt"), "585 0 320 0 585 240 0 0 1").unwrap();
        let mut warnings = Vec::new();
        let found = find(&inside, &RecordingOptions::default(), &mut warnings).unwrap().unwrap();
        assert_eq!(found.lens.focal.x, 585.0);
        assert!(warnings[0].contains("camera-intrinsics.txt are used"), "{warnings:?}");
        // The folder itself comes first, and a file that contradicts it is named.
        std::fs::write(inside.join("intrinsics.txt"), "500 500 320 240").unwrap();
        std::fs::write(inside.join("info.txt"), "600 600 320 240").unwrap();
        warnings.clear();
        let found = find(&inside, &RecordingOptions::default(), &mut warnings).unwrap().unwrap();
        assert_eq!(found.lens.focal.x, 500.0);
        assert!(warnings[0].contains("not those of") && warnings[0].contains("info.txt"), "{warnings:?}");
    }
}
