//! The ArtGS layout: `transforms_{split}_{state}.json` with intrinsics at the top level and one object per frame.

use super::CaptureError;
use super::json::{Object, key_error, number, positive, text};
use super::pose::{exact, world_to_camera};
use super::views::{Entry, Focal, Lens};
use super::write::EXACT_POSE;
use artgs_core::State;
use serde_json::Value;
use std::path::{Component, Path, PathBuf};

/// Default if a file has no `depth_scale`: millimetres.
const DEFAULT_DEPTH_SCALE: f64 = 1000.0;

/// Depth scales that can be meant.
const DEPTH_SCALES: std::ops::RangeInclusive<f64> = 1e-6..=1e9;

/// The frames of a camera file, with paths of existing images.
pub(super) fn entries(
    dir: &Path,
    file: &Path,
    root: &Object,
    state: State,
    warnings: &mut Vec<String>,
) -> Result<Vec<Entry>, CaptureError> {
    let shown = file.display().to_string();
    require_pinhole(root, &shown)?;
    let lens = lens(root, &shown)?;
    warn_of_stale_angle(root, &lens, &shown, warnings)?;
    let depth_scale = positive(root, &shown, "depth_scale")?.unwrap_or(DEFAULT_DEPTH_SCALE);
    if !DEPTH_SCALES.contains(&depth_scale) {
        let reason =
            format!("is {depth_scale:e}; it must be the number of depth counts per scene unit, 1000 for millimetres");
        return Err(key_error(&shown, "depth_scale", reason));
    }
    for key in ["k1", "k2", "k3", "k4", "p1", "p2"] {
        if number(root, &shown, key)?.is_some_and(|v| v != 0.0) {
            warnings.push(format!("{shown}: key `{key}`: lens distortion is ignored; undistort the images"));
        }
    }
    let frames = match root.get("frames") {
        Some(Value::Array(frames)) => frames,
        Some(_) => return Err(key_error(&shown, "frames", "expected a list of frames")),
        None => return Err(key_error(&shown, "frames", "is missing; add the list of frames")),
    };
    let mut wrong_time = Vec::new();
    let mut entries = Vec::with_capacity(frames.len());
    for (index, frame) in frames.iter().enumerate() {
        let place = format!("{shown}, frame {index}");
        let Value::Object(frame) = frame else { return Err(key_error(&place, "frames", "a frame must be an object")) };
        let listed = text(frame, &place, "file_path")?.ok_or_else(|| missing(&place, "file_path", "the image"))?;
        let place = format!("{place} ({listed})");
        require_pinhole(frame, &place)?;
        let pose = frame.get("transform_matrix").ok_or_else(|| missing(&place, "transform_matrix", "the pose"))?;
        let image = find_image(dir, listed).ok_or_else(|| CaptureError::Image {
            place: place.clone(),
            reason: format!("key `file_path`: no image {listed} exists (also not with .png or in an `rgba` folder)"),
        })?;
        if number(frame, &place, "time")?.is_some_and(|t| (t - state.index() as f64).abs() > 1e-6) {
            wrong_time.push(index);
        }
        let pose = world_to_camera(pose, &place, "transform_matrix")?;
        entries.push(Entry {
            world_to_camera: exact(frame.get(EXACT_POSE), &pose).unwrap_or(pose),
            depth: find_depth(dir, &image, text(frame, &place, "depth_path")?, &place)?,
            derived: listed_depth(dir, text(frame, &place, "derived_depth_path")?, "derived_depth_path", &place)?,
            sort_key: listed.into(),
            lens: own_lens(root, frame, &place, lens)?,
            place,
            image,
            depth_scale,
        });
    }
    if let Some(first) = wrong_time.first() {
        let (n, number, name) = (wrong_time.len(), state.index(), state.name());
        warnings
            .push(format!("{shown}: key `time` of {n} frames (first: frame {first}) is not {number}, read as {name}"));
    }
    Ok(entries)
}

/// Intrinsics of a frame: those of the file, with the values that the frame has itself.
fn own_lens(root: &Object, frame: &Object, place: &str, of_file: Lens) -> Result<Lens, CaptureError> {
    const KEYS: [&str; 8] = ["camera_angle_x", "camera_angle_y", "fl_x", "fl_y", "cx", "cy", "w", "h"];
    if !KEYS.iter().any(|key| frame.contains_key(*key)) {
        return Ok(of_file);
    }
    // Only these keys: the file also holds a list of all frames.
    let mut merged: Object = KEYS.iter().filter_map(|key| Some((key.to_string(), root.get(*key)?.clone()))).collect();
    merged.extend(KEYS.iter().filter_map(|key| Some((key.to_string(), frame.get(*key)?.clone()))));
    lens(&merged, place)
}

/// Refuses images of lenses that are no pinhole, such as fisheyes.
fn require_pinhole(object: &Object, place: &str) -> Result<(), CaptureError> {
    const PINHOLE: [&str; 8] =
        ["PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "OPENCV", "FULL_OPENCV", "RADIAL", "SIMPLE_RADIAL", "BLENDER"];
    match text(object, place, "camera_model")? {
        Some(model) if !PINHOLE.contains(&model.to_ascii_uppercase().as_str()) => {
            let reason =
                format!("is {model}; undistort the images, then state PINHOLE: this layout has pinhole cameras only");
            Err(key_error(place, "camera_model", reason))
        }
        _ => Ok(()),
    }
}

fn missing(place: &str, key: &str, what: &str) -> CaptureError {
    key_error(place, key, format!("is missing; it must contain {what}"))
}

fn lens(root: &Object, shown: &str) -> Result<Lens, CaptureError> {
    let get = |key| positive(root, shown, key);
    let angle = |key| match get(key)? {
        Some(v) if v >= std::f64::consts::PI => Err(key_error(shown, key, format!("is {v}, must be radians below pi"))),
        v => Ok(v),
    };
    let size = |key| match get(key)? {
        Some(v) if v.fract() != 0.0 || v > 1e6 => Err(key_error(shown, key, format!("is {v}, must be whole pixels"))),
        v => Ok(v.map(|v| v as u32)),
    };
    let (angle_x, angle_y) = (angle("camera_angle_x")?, angle("camera_angle_y")?);
    let x = match (get("fl_x")?, angle_x) {
        (Some(f), _) => Focal::Pixels(f),
        (None, Some(a)) => Focal::Angle(a),
        (None, None) => {
            return Err(missing(shown, "camera_angle_x", "the horizontal field of view (or `fl_x`, pixels)"));
        }
    };
    let y = get("fl_y")?.map(Focal::Pixels).or(angle_y.map(Focal::Angle));
    let (cx, cy) = (number(root, shown, "cx")?, number(root, shown, "cy")?);
    Ok(Lens { x, y, cx, cy, width: size("w")?, height: size("h")? })
}

/// Tools that rescale images often update only one of `camera_angle_x` and `fl_x`; `fl_x` is used.
fn warn_of_stale_angle(
    root: &Object,
    lens: &Lens,
    shown: &str,
    warnings: &mut Vec<String>,
) -> Result<(), CaptureError> {
    let (Focal::Pixels(f), Some(w)) = (lens.x, lens.width) else { return Ok(()) };
    let Some(stated) = number(root, shown, "camera_angle_x")? else { return Ok(()) };
    let angle = 2.0 * (f64::from(w) / (2.0 * f)).atan();
    if (angle - stated).abs() > 0.01 * angle {
        warnings.push(format!(
            "{shown}: key `camera_angle_x` is {stated:.4}, but `fl_x` and `w` imply {angle:.4}; `fl_x` is used"
        ));
    }
    Ok(())
}

/// The image of a `file_path`, relative to the capture: an `rgba` folder beside the listed one or in it is preferred,
/// the suffix is optional.
fn find_image(dir: &Path, listed: &str) -> Option<PathBuf> {
    let path: PathBuf = Path::new(listed).components().filter(|c| *c != Component::CurDir).collect();
    let name = path.file_name()?.to_str()?;
    let lower = name.to_ascii_lowercase();
    let suffix = [".png", ".jpg", ".jpeg"].into_iter().find(|s| lower.ends_with(s)).map_or(0, str::len);
    let png = format!("{}.png", &name[..name.len() - suffix]);
    let folder = path.parent()?;
    let beside = folder.parent().map(|p| p.join("rgba").join(&png));
    let candidates = [beside, Some(folder.join("rgba").join(&png)), Some(path.clone()), Some(folder.join(&png))];
    candidates.into_iter().flatten().find(|p| dir.join(p).is_file())
}

/// The depth image that a key of a frame lists; it must exist.
fn listed_depth(
    dir: &Path,
    listed: Option<&str>,
    key: &'static str,
    place: &str,
) -> Result<Option<PathBuf>, CaptureError> {
    let Some(listed) = listed else { return Ok(None) };
    let mut found = [PathBuf::from(listed), PathBuf::from(format!("{listed}.png"))].into_iter();
    found.find(|p| dir.join(p).is_file()).map(Some).ok_or_else(|| CaptureError::Image {
        place: place.into(),
        reason: format!("key `{key}`: no depth image {listed} exists; add it or remove the key"),
    })
}

/// The depth image of a frame: `depth_path` if given, else the image path with `rgba` replaced by `depth` if that is a
/// file. Only the path inside the capture is substituted.
fn find_depth(dir: &Path, image: &Path, listed: Option<&str>, place: &str) -> Result<Option<PathBuf>, CaptureError> {
    if listed.is_some() {
        return listed_depth(dir, listed, "depth_path", place);
    }
    let path = image.to_str().filter(|p| p.contains("rgba")).map(|p| PathBuf::from(p.replace("rgba", "depth")));
    Ok(path.filter(|p| dir.join(p).is_file()))
}
