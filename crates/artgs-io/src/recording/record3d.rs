//! Record3D: a folder with JPG and EXR files, or a `.r3d` archive (JPG, LZFSE). One JSON file has `K` (column by column, for images
//! of `w` x `h`) and `poses` (qx qy qz qw tx ty tz, camera-to-world, OpenGL axes, metres), addressed by the numbers in file names.
//! +Y is up.

use super::RecordingError;
use super::depth::Measured;
use super::exr_depth;
use super::files::natural;
use super::format::begins_with;
use super::index::{Entry, Gaps, Index, LOST, Load};
use super::lens::{Distortion, Lens};
use super::pixels::decode_color;
use super::pose::{Axes, is_lost, upright};
use super::store::Store;
use super::values::{list, numbers, size};
use super::write::{self, SensorDepth, write_jpeg, write_json};
use crate::capture::json::{Object, key_error, object_of_bytes};
use artgs_core::{DepthMap, Recording};
use glam::{DQuat, DVec2, DVec3};
use lzfse_rust::LzfseRingDecoder;
use serde_json::{Value, json};
use std::io::Read;
use std::path::Path;

/// Largest size of a depth image, pixels.
const LARGEST: u32 = 1 << 14;

pub(super) fn matches(path: &Path) -> bool {
    find(path).is_ok_and(|found| found.is_some())
}

/// A recording with its camera file.
struct Found {
    store: Store,
    /// Path of the camera file in messages.
    place: String,
    root: Object,
    names: Vec<String>,
}

/// Finds the camera file in an archive, a folder, or the only folder in it.
fn find(path: &Path) -> Result<Option<Found>, RecordingError> {
    let mut stores = Vec::new();
    if path.is_dir() {
        stores.push(Store::Folder(path.into()));
        let folders = super::files::names(path).into_iter().map(|n| path.join(n)).filter(|p| p.is_dir());
        stores.extend(folders.take(4).map(Store::Folder));
    } else if begins_with(path, b"PK") {
        stores.push(Store::Zip(path.into()));
    }
    for store in stores {
        let names = store.names()?;
        let camera_file = |n: &&String| !n.contains('/') && (n.starts_with("metadata") || n.ends_with(".json"));
        for name in names.iter().filter(camera_file) {
            let shown = store.shown(name);
            let Ok(root) = object_of_bytes(&store.read(name)?, &shown) else { continue };
            if root.contains_key("poses") && root.contains_key("K") {
                return Ok(Some(Found { place: shown.display().to_string(), store, root, names }));
            }
        }
    }
    Ok(None)
}

/// A frame's files of a kind: the number at the end of the name, and the path. One file per number.
fn numbered<'a>(names: &'a [String], suffixes: &[&str]) -> Vec<(usize, &'a str)> {
    let parse = |name: &'a String| {
        let (stem, suffix) = name.rsplit('/').next()?.rsplit_once('.')?;
        let digits = &stem[stem.trim_end_matches(|c: char| c.is_ascii_digit()).len()..];
        let wanted = suffixes.contains(&suffix.to_ascii_lowercase().as_str());
        Some((digits.parse().ok().filter(|_| wanted)?, name.as_str()))
    };
    let mut found: Vec<(usize, &str)> = names.iter().filter_map(parse).collect();
    found.sort_by_cached_key(|(number, name)| (*number, natural(name)));
    found.dedup_by_key(|(number, _)| *number);
    found
}

pub(super) fn index(path: &Path) -> Result<Index, RecordingError> {
    let Some(Found { store, place, root, names }) = find(path)? else {
        let reason =
            "contains no camera file with `K` and `poses`; export as EXR + JPG sequence or as .r3d in Record3D";
        return Err(RecordingError::incomplete(path, reason));
    };
    let Some(Value::Array(poses)) = root.get("poses") else {
        return Err(key_error(&place, "poses", "expected a list of poses; export the recording again").into());
    };
    let depth_size = size(&root, &place, ["dw", "dh"])?;
    let (depths, levels) = (numbered(&names, &["exr", "depth"]), numbered(&names, &["conf"]));
    let file_of = |list: &[(usize, &str)], number: usize| {
        list.iter().find(|(n, _)| *n == number).map(|(_, name)| String::from(*name))
    };
    let times: Vec<Option<f64>> = match root.get("frameTimestamps") {
        Some(Value::Array(times)) => times.iter().map(Value::as_f64).collect(),
        _ => Vec::new(),
    };
    let mut index = Index { up: Some(DVec3::Y), metric: true, ..Index::default() };
    let images = numbered(&names, &["jpg", "jpeg", "png"]);
    if let Some(video) = names.iter().find(|n| images.is_empty() && is_video(n)) {
        let reason = format!(
            "holds the video {video} but no images: this is the video export of Record3D, whose depth is a picture of colours; export \
             as EXR + JPG sequence or share the .r3d file in Record3D"
        );
        return Err(RecordingError::incomplete(path, reason));
    }
    let (mut no_pose, mut lost, mut gaps) = (Vec::new(), Vec::new(), Gaps::default());
    for &(number, name) in &images {
        let Some(pose) = poses.get(number) else {
            no_pose.push(name.to_string());
            continue;
        };
        if !is_known(pose) {
            lost.push(name.to_string());
            continue;
        }
        let depth = file_of(&depths, number).map(|d| depth_of(&store, d, file_of(&levels, number), depth_size));
        if depth.is_none() {
            gaps.unnamed.push(name.to_string());
        }
        let (image, inside) = (store.clone(), name.to_string());
        index.entries.push(Entry {
            name: name.into(),
            time: times.get(number).copied().flatten(),
            world_to_camera: pose_of(pose, &format!("{place}, pose {number}"))?,
            lens: lens(&root, &place, number)?,
            color: Box::new(move || decode_color(&image.shown(&inside), &image.read(&inside)?)),
            depth,
            mask: None,
        });
    }
    let has_image = |number: &usize| images.binary_search_by_key(number, |(n, _)| *n).is_ok();
    let no_image: Vec<String> = depths.iter().filter(|(n, _)| !has_image(n)).map(|(_, d)| d.to_string()).collect();
    index.warn(path, "depth images have no colour image and are ignored", &no_image);
    index.skip(path, "images have no pose", &no_pose);
    index.skip(path, LOST, &lost);
    index.warn_gaps(path, &gaps);
    Ok(index)
}

fn is_video(name: &str) -> bool {
    let suffix = name.rsplit_once('.').map_or("", |(_, s)| s);
    suffix.eq_ignore_ascii_case("mp4") || suffix.eq_ignore_ascii_case("mov")
}

/// False for a pose with `null` or with a quaternion of zeros.
fn is_known(pose: &Value) -> bool {
    let Some(cells) = pose.as_array() else { return true };
    let numbers: Vec<f64> =
        cells.iter().map(|c| if c.is_null() { f64::NAN } else { c.as_f64().unwrap_or(1.0) }).collect();
    numbers.len() != 7 || !is_lost(&numbers[4..], &numbers[..4])
}

fn pose_of(value: &Value, place: &str) -> Result<artgs_core::Rigid, RecordingError> {
    let fail = |reason: String| key_error(place, "poses", reason);
    let expected = || fail("expected 7 finite numbers qx qy qz qw tx ty tz; export the recording again".into());
    let [qx, qy, qz, qw, x, y, z] = list(Some(value)).ok_or_else(expected)?;
    Ok(Axes::OpenGl.world_to_camera_of_quaternion([qx, qy, qz, qw], DVec3::new(x, y, z)).map_err(fail)?)
}

/// Intrinsics of a frame if they are stated, else of the recording.
fn lens(root: &Object, place: &str, number: usize) -> Result<Lens, RecordingError> {
    let own = root.get("perFrameIntrinsicCoeffs").and_then(Value::as_array).and_then(|l| list(l.get(number)));
    let [fx, fy, cx, cy] = match own {
        Some(own) => own,
        None => {
            let k = numbers::<9>(root, place, "K")?;
            [k[0], k[4], k[6], k[7]]
        }
    };
    if fx <= 0.0 || fy <= 0.0 {
        return Err(key_error(place, "K", "focal lengths must be above 0; export the recording again").into());
    }
    Ok(Lens {
        focal: DVec2::new(fx, fy),
        center: Some(DVec2::new(cx, cy)),
        size: size(root, place, ["w", "h"])?,
        distortion: Distortion::None,
    })
}

/// EXR files state their size; LZFSE files have that of the camera file.
fn depth_of(store: &Store, name: String, levels: Option<String>, size: Option<(u32, u32)>) -> Load<Measured> {
    let store = store.clone();
    Box::new(move || {
        let shown = store.shown(&name);
        let bytes = store.read(&name)?;
        let measured = if name.ends_with(".depth") {
            let (width, height) = sized(&shown, size)?;
            let raw = unpack(&shown, &bytes, width as usize * height as usize * 4)?;
            let depths: Vec<f32> = raw.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
            Measured::new(&shown, width, height, DepthMap::nearest(&depths), 1.0)
        } else {
            exr_depth::decode(&shown, &bytes)?
        };
        let Some(levels) = &levels else { return Ok(measured) };
        let shown = store.shown(levels);
        let (width, height) = (measured.width, measured.height);
        let raw = unpack(&shown, &store.read(levels)?, width as usize * height as usize)?;
        measured.without_untrusted(width, height, raw.into_iter(), &shown.display().to_string())
    })
}

fn sized(path: &Path, size: Option<(u32, u32)>) -> Result<(u32, u32), RecordingError> {
    size.filter(|(w, h)| *w.max(h) <= LARGEST)
        .ok_or_else(|| RecordingError::malformed(path, "its size is unknown; the camera file must state `dw` and `dh`"))
}

/// Unpacks LZFSE data of a known length.
fn unpack(path: &Path, bytes: &[u8], length: usize) -> Result<Vec<u8>, RecordingError> {
    let mut raw = Vec::with_capacity(length + 1);
    // One byte more than expected, so that data of another size are recognised without unpacking all of them.
    let most = length as u64 + 1;
    LzfseRingDecoder::default().reader_bytes(bytes).take(most).read_to_end(&mut raw).map_err(|e| {
        RecordingError::malformed(path, format!("not complete LZFSE data ({e}); export the recording again"))
    })?;
    if raw.len() != length {
        let found = if raw.len() > length { "more".into() } else { raw.len().to_string() };
        let reason =
            format!("{found} bytes unpacked, expected {length} from `dw` and `dh`; export the recording again");
        return Err(RecordingError::malformed(path, reason));
    }
    Ok(raw)
}

/// JPG and EXR files in a folder.
pub(super) fn write(dir: &Path, recording: &Recording) -> Result<(), RecordingError> {
    let Some(first) = recording.frames.first() else {
        return Err(RecordingError::incomplete(dir, "a recording without frames cannot be written"));
    };
    let (width, height) = write::size(&first.view);
    if recording.frames.iter().any(|f| write::size(&f.view) != (width, height)) {
        return Err(RecordingError::incomplete(dir, "Record3D recordings have images of one size; use another format"));
    }
    let turn = upright(recording.up);
    let (mut poses, mut coefficients, mut depth_size) = (Vec::new(), Vec::new(), (width, height));
    for (i, frame) in recording.frames.iter().enumerate() {
        let (r, t) = Axes::OpenGl.camera_to_world(&frame.view.camera, turn);
        let q = DQuat::from_mat3(&r);
        poses.push([q.x, q.y, q.z, q.w, t.x, t.y, t.z]);
        let k = &frame.view.camera.intrinsics;
        coefficients.push([k.fx, k.fy, k.cx, k.cy]);
        write_jpeg(&dir.join(format!("rgb/{i}.jpg")), &frame.view)?;
        if let Some(depth) = SensorDepth::new(frame) {
            exr_depth::write(&dir.join(format!("depth/{i}.exr")), depth.width, depth.height, &depth.depths())?;
            depth_size = (depth.width, depth.height);
        }
    }
    let [fx, fy, cx, cy] = coefficients[0];
    let times: Vec<f64> = (0..).zip(&recording.frames).map(|(i, f)| f.time.unwrap_or(f64::from(i) / 60.0)).collect();
    let metadata = json!({
        "w": width, "h": height, "dw": depth_size.0, "dh": depth_size.1, "fps": 60, "cameraType": 1,
        "K": [fx, 0.0, 0.0, 0.0, fy, 0.0, cx, cy, 1.0],
        "poses": poses,
        "initPose": poses[0],
        "frameTimestamps": times,
        "perFrameIntrinsicCoeffs": coefficients,
    });
    write_json(&dir.join("metadata.json"), &metadata)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_addressed_by_their_last_number() {
        let names = ["rgb/10.jpg", "rgb/2.jpg", "x/2.jpg", "frame_7.JPG", "depth/2.exr", "cover.jpg"].map(String::from);
        assert_eq!(numbered(&names, &["jpg"]), [(2, "rgb/2.jpg"), (7, "frame_7.JPG"), (10, "rgb/10.jpg")]);
        assert_eq!(numbered(&names, &["exr"]), [(2, "depth/2.exr")]);
    }
}
