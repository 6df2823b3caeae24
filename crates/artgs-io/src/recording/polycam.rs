//! Polycam raw data: `keyframes/{images,cameras,depth,confidence}/T.*`, and `corrected_images`, `corrected_cameras` after a loop
//! was closed. Camera-to-world, rows `t_00` to `t_23`, OpenGL axes, metres; +Y is up.

use super::RecordingError;
use super::depth::Measured;
use super::depth_file;
use super::files::{between, names, natural};
use super::index::{Entry, Gaps, Index, LOST};
use super::lens::{Distortion, Lens};
use super::pixels::read_color;
use super::pose::{Axes, upright};
use super::values::{is_lost_pose, needed, size};
use super::write::{SensorDepth, write_jpeg, write_json};
use crate::capture::json::{key_error, read_object};
use artgs_core::Recording;
use glam::{DVec2, DVec3};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Folders of cameras, the better one first, each with the folders that its images may be in.
const CAMERAS: [(&str, [&str; 3]); 2] = [
    ("corrected_cameras", ["corrected_images", "images", "raw_images"]),
    ("cameras", ["images", "raw_images", "corrected_images"]),
];

pub(super) fn matches(path: &Path) -> bool {
    keyframes(path).is_some()
}

/// A folder of cameras with the images that exist for them.
struct Candidate {
    cameras: &'static str,
    /// Stem, image and folder of the image.
    frames: Vec<(String, PathBuf, &'static str)>,
    /// Stems without an image.
    no_image: Vec<String>,
}

/// The folder `keyframes`, given itself or by the folder that contains it, if it has folders of cameras and images.
fn keyframes(path: &Path) -> Option<PathBuf> {
    let posed = |dir: &PathBuf| {
        CAMERAS.iter().any(|(cameras, images)| {
            let first = names(&dir.join(cameras)).into_iter().find(|n| n.ends_with(".json"));
            let root = first.map(|n| dir.join(cameras).join(n)).and_then(|f| read_object(&f, &f).ok());
            root.is_some_and(|o| o.contains_key("t_00")) && images.iter().any(|i| dir.join(i).is_dir())
        })
    };
    [path.join("keyframes"), path.to_path_buf()].into_iter().find(posed)
}

fn candidate(dir: &Path, cameras: &'static str, images: [&'static str; 3]) -> Candidate {
    let mut stems = names(&dir.join(cameras));
    stems.retain(|n| n.ends_with(".json"));
    stems.sort_by_cached_key(|n| natural(n));
    let mut candidate = Candidate { cameras, frames: Vec::new(), no_image: Vec::new() };
    for name in &stems {
        let stem = between(name, "", ".json").unwrap_or(name);
        let files = images
            .iter()
            .flat_map(|folder| ["jpg", "jpeg", "png"].map(|s| (dir.join(folder).join(format!("{stem}.{s}")), *folder)));
        match files.into_iter().find(|(path, _)| path.is_file()) {
            Some((path, folder)) => candidate.frames.push((stem.into(), path, folder)),
            None => candidate.no_image.push(stem.into()),
        }
    }
    candidate
}

/// Of the folders of cameras the corrected one, unless most of its frames have no image; says what is used instead of the usual.
fn chosen(path: &Path, dir: &Path, warnings: &mut Vec<String>) -> Candidate {
    let [corrected, plain] = CAMERAS.map(|(cameras, images)| candidate(dir, cameras, images));
    let enough = corrected.frames.len() >= 2 && 2 * corrected.frames.len() >= plain.frames.len();
    let (used, other) = if enough { (corrected, plain) } else { (plain, corrected) };
    let shown = path.display();
    if used.cameras == "cameras" && !(other.frames.is_empty() && other.no_image.is_empty()) {
        warnings.push(format!(
            "{shown}: corrected_cameras has {} frames with an image, cameras {}; cameras is used, whose poses may drift",
            other.frames.len(),
            used.frames.len()
        ));
    }
    let usual = if enough { "corrected_images" } else { "images" };
    let elsewhere = used.frames.iter().filter(|(_, _, folder)| *folder != usual).count();
    if let Some((_, _, folder)) = used.frames.iter().find(|(_, _, folder)| *folder != usual) {
        warnings.push(format!(
            "{shown}: {elsewhere} frames of {} have their image in {folder}, not in {usual}",
            used.cameras
        ));
    }
    used
}

pub(super) fn index(path: &Path) -> Result<Index, RecordingError> {
    let Some(dir) = keyframes(path) else {
        let reason = "contains no keyframes with cameras and images; export raw data in Polycam";
        return Err(RecordingError::incomplete(path, reason));
    };
    let mut index = Index { up: Some(DVec3::Y), metric: true, ..Index::default() };
    let Candidate { cameras, frames, no_image } = chosen(path, &dir, &mut index.warnings);
    let (mut lost, mut gaps) = (Vec::new(), Gaps::default());
    for (stem, image, folder) in frames {
        let file = dir.join(cameras).join(format!("{stem}.json"));
        let Some(mut entry) = entry(&file, image, format!("{folder}/{stem}"))? else {
            lost.push(stem);
            continue;
        };
        if let Some(depth) = depth_file::find(&dir.join("depth"), &[&stem]) {
            let confidence = Some(dir.join("confidence").join(format!("{stem}.png"))).filter(|p| p.is_file());
            entry.depth = Some(Box::new(move || Measured::read_phone(&depth, confidence.as_deref())));
        } else {
            gaps.unnamed.push(stem);
        }
        index.entries.push(entry);
    }
    index.skip(path, "images do not exist", &no_image);
    index.skip(path, LOST, &lost);
    index.warn_gaps(path, &gaps);
    Ok(index)
}

/// None if the phone did not know its pose.
fn entry(file: &Path, image: PathBuf, name: String) -> Result<Option<Entry>, RecordingError> {
    let place = file.display().to_string();
    let root = read_object(file, file)?;
    let cells: Value =
        (0..12).map(|i| root.get(&format!("t_{}{}", i / 4, i % 4)).cloned().unwrap_or(json!(1))).collect();
    if is_lost_pose(&cells) {
        return Ok(None);
    }
    let mut pose = [0.0; 12];
    for (i, value) in pose.iter_mut().enumerate() {
        *value = needed(&root, &place, &format!("t_{}{}", i / 4, i % 4))?;
    }
    let world_to_camera = Axes::OpenGl.world_to_camera_of_rows(&pose).map_err(|e| key_error(&place, "t_00", e))?;
    let value = |key| needed(&root, &place, key);
    let lens = Lens {
        focal: DVec2::new(value("fx")?, value("fy")?),
        center: Some(DVec2::new(value("cx")?, value("cy")?)),
        size: size(&root, &place, ["width", "height"])?,
        distortion: Distortion::None,
    };
    Ok(Some(Entry {
        name,
        time: None,
        world_to_camera,
        lens,
        color: Box::new(move || read_color(&image)),
        depth: None,
        mask: None,
    }))
}

pub(super) fn write(dir: &Path, recording: &Recording) -> Result<(), RecordingError> {
    let turn = upright(recording.up);
    let dir = dir.join("keyframes");
    for (i, frame) in recording.frames.iter().enumerate() {
        let stem = format!("{}", 1_000_000 + i);
        let k = &frame.view.camera.intrinsics;
        let mut object =
            json!({ "fx": k.fx, "fy": k.fy, "cx": k.cx, "cy": k.cy, "width": k.width, "height": k.height });
        for (row, values) in Axes::OpenGl.rows(&frame.view.camera, turn).iter().take(3).enumerate() {
            for (column, value) in values.iter().enumerate() {
                object[format!("t_{row}{column}")] = json!(value);
            }
        }
        write_json(&dir.join(format!("cameras/{stem}.json")), &object)?;
        write_jpeg(&dir.join(format!("images/{stem}.jpg")), &frame.view)?;
        let Some(depth) = SensorDepth::new(frame) else { continue };
        depth.write_png(&dir.join(format!("depth/{stem}.png")))?;
        depth.write_confidence(&dir.join(format!("confidence/{stem}.png")), 255)?;
    }
    Ok(())
}
