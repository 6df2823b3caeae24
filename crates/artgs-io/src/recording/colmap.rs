//! COLMAP: `cameras`, `images`, `points3D`, as `.txt` or `.bin`. World-to-camera quaternion (w x y z) and translation, OpenCV axes;
//! the scale is arbitrary. Depth and masks beside the images are read: `depth/` or `depths/` (PNG, mm), `masks/`.

use super::RecordingError;
use super::colmap_model::{Model, Shot};
use super::colmap_scale;
use super::depth::Measured;
use super::files::{first_file, natural};
use super::index::{Entry, Index, Load};
use super::pixels::read_color;
use super::write::{write_depth_png, write_png};
use crate::write_atomic;
use artgs_core::Recording;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Folders of a model below the folder of a recording.
const MODELS: [&str; 7] = ["", "sparse/0", "sparse", "reconstruction", "model", "colmap/sparse/0", "dense/sparse"];

pub(super) fn matches(path: &Path) -> bool {
    model_folder(path).is_some()
}

/// The folder of the model.
fn model_folder(path: &Path) -> Option<PathBuf> {
    let complete = |dir: &PathBuf| ["txt", "bin"].iter().any(|s| Model::files(dir, s).iter().all(|f| f.is_file()));
    MODELS.iter().map(|m| path.join(m)).find(complete)
}

pub(super) fn index(path: &Path) -> Result<Index, RecordingError> {
    let Some(folder) = model_folder(path) else {
        let reason = "contains no COLMAP model; give the folder that contains the images and `sparse`";
        return Err(RecordingError::incomplete(path, reason));
    };
    let mut model = Model::read(&folder)?;
    model.shots.sort_by_cached_key(|s| natural(&s.name));
    // Images and depth are beside the model or above it.
    let roots: Vec<PathBuf> =
        [path, &folder].into_iter().flat_map(Path::ancestors).take(4).map(PathBuf::from).collect();
    let mut index = Index::default();
    let (mut no_image, mut no_depth) = (Vec::new(), Vec::new());
    let mut shots = Vec::new();
    for shot in std::mem::take(&mut model.shots) {
        let Some(image) =
            beside(&roots, &["images", "", "rgb", "image", "images_undistorted"], std::slice::from_ref(&shot.name))
        else {
            no_image.push(shot.name);
            continue;
        };
        let entry = entry(&shot, &model, image, &roots)?;
        if entry.depth.is_none() {
            no_depth.push(shot.name.clone());
        }
        index.entries.push(entry);
        shots.push(shot);
    }
    index.warn(&folder, "images do not exist, their frames are ignored", &no_image);
    if no_depth.len() < index.entries.len() {
        index.warn(&folder, "frames have no depth image", &no_depth);
        colmap_scale::apply(&mut index, &shots, &model, &folder)?;
    }
    Ok(index)
}

fn entry(shot: &Shot, model: &Model, image: PathBuf, roots: &[PathBuf]) -> Result<Entry, RecordingError> {
    let stem = shot.name.rsplit_once('.').map_or(shot.name.as_str(), |s| s.0);
    let depth = beside(roots, &["depth", "depths"], &[format!("{stem}.png"), format!("{}.png", shot.name)]);
    let mask = beside(roots, &["masks", "mask"], &[format!("{}.png", shot.name), format!("{stem}.png")]);
    let Some(lens) = model.cameras.get(&shot.camera) else {
        let reason = format!("image {}: there is no camera {}; export the model again", shot.name, shot.camera);
        return Err(RecordingError::malformed(&model.images_file, reason));
    };
    Ok(Entry {
        name: shot.name.clone(),
        time: None,
        world_to_camera: shot.world_to_camera,
        lens: *lens,
        color: Box::new(move || read_color(&image)),
        depth: depth.map(|d| -> Load<Measured> { Box::new(move || Measured::read_png(&d, 1000.0, false)) }),
        mask: mask.map(|m| -> Load<_> { Box::new(move || read_color(&m)) }),
    })
}

/// The first of these files in one of these folders of one of the roots.
fn beside(roots: &[PathBuf], folders: &[&str], names: &[String]) -> Option<PathBuf> {
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    roots.iter().find_map(|root| folders.iter().find_map(|f| first_file(&root.join(f), &names)))
}

/// A text model with one PINHOLE camera per intrinsics.
pub(super) fn write(dir: &Path, recording: &Recording) -> Result<(), RecordingError> {
    let mut cameras = Vec::new();
    let mut images = String::from("# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n");
    for (i, frame) in recording.frames.iter().enumerate() {
        let k = frame.view.camera.intrinsics;
        let camera = cameras.iter().position(|c| *c == k).unwrap_or_else(|| {
            cameras.push(k);
            cameras.len() - 1
        });
        let (q, t) = (frame.view.camera.world_to_camera.rotation, frame.view.camera.world_to_camera.translation);
        let name = format!("{i:06}.png");
        let pose = format!("{} {} {} {} {} {} {}", q.w, q.x, q.y, q.z, t.x, t.y, t.z);
        // The line of observations is empty.
        let _ = writeln!(images, "{} {pose} {} {name}\n", i + 1, camera + 1);
        write_png(&dir.join("images").join(&name), &frame.view)?;
        if let Some(depth) = &frame.view.depth {
            write_depth_png(&dir.join("depth").join(&name), &frame.view, depth, 1000.0)?;
        }
    }
    let mut table = String::from("# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n");
    for (i, k) in cameras.iter().enumerate() {
        let _ = writeln!(table, "{} PINHOLE {} {} {} {} {} {}", i + 1, k.width, k.height, k.fx, k.fy, k.cx, k.cy);
    }
    let points = "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]\n".to_string();
    for (name, text) in [("cameras.txt", table), ("images.txt", images), ("points3D.txt", points)] {
        write_atomic(&dir.join("sparse/0").join(name), text.as_bytes())?;
    }
    Ok(())
}
