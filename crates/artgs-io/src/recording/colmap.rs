//! COLMAP: `cameras`, `images`, `points3D`, as `.txt` or `.bin`. World-to-camera quaternion (w x y z) and translation, OpenCV axes;
//! the scale is arbitrary. Depth and masks beside the images are read: `depth/` or `depths/` (PNG, mm), `masks/`.

use super::colmap_model::{Model, Shot};
use super::depth::Measured;
use super::depth_file::{self, Scale};
use super::files::{first_file, natural};
use super::index::{Entry, Gaps, Index, Load};
use super::pixels::read_color;
use super::write::{write_depth_png, write_png};
use super::{RecordingError, RecordingOptions, colmap_models, colmap_scale};
use crate::write_atomic;
use artgs_core::Recording;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Folders of images beside a model; reduced images are used if there are no others.
const IMAGES: [&str; 9] =
    ["images", "", "rgb", "image", "images_undistorted", "input", "images_2", "images_4", "images_8"];

pub(super) fn matches(path: &Path) -> bool {
    colmap_models::any(path)
}

/// True for a model of which files are missing.
pub(super) fn is_incomplete(path: &Path) -> bool {
    colmap_models::incomplete(path).is_some()
}

/// Folders beside a model and above it, in which images and depth are.
fn roots(path: &Path, folder: &Path) -> Vec<PathBuf> {
    // Images of a model in `dense/0/sparse` are in `dense/0/images`.
    let own = folder.ancestors().take_while(|dir| dir.starts_with(path));
    own.chain(path.ancestors().take(4)).map(PathBuf::from).collect()
}

fn image(roots: &[PathBuf], shot: &Shot) -> Option<PathBuf> {
    beside(roots, &IMAGES, std::slice::from_ref(&shot.name))
}

pub(super) fn index(path: &Path, options: &RecordingOptions) -> Result<Index, RecordingError> {
    let mut index = Index::default();
    let usable = |folder: &Path, model: &Model| {
        let roots = roots(path, folder);
        model.shots.iter().filter(|shot| image(&roots, shot).is_some()).count()
    };
    let (folder, mut model) = colmap_models::best(path, usable, &mut index.warnings)?;
    model.shots.sort_by_cached_key(|s| natural(&s.name));
    let roots = roots(path, &folder);
    let (mut no_image, mut gaps, mut shots) = (Vec::new(), Gaps::default(), Vec::new());
    for shot in std::mem::take(&mut model.shots) {
        let Some(image) = image(&roots, &shot) else {
            no_image.push(shot.name);
            continue;
        };
        let entry = entry(&shot, &model, image, &roots)?;
        if entry.depth.is_none() {
            gaps.unnamed.push(shot.name.clone());
        }
        index.entries.push(entry);
        shots.push(shot);
    }
    index.skip(&folder, "images do not exist", &no_image);
    index.warn_gaps(&folder, &gaps);
    if gaps.unnamed.len() < index.entries.len() {
        index.state_depth_unit(options.depth_unit);
        colmap_scale::apply(&mut index, &shots, &model, &folder)?;
    }
    Ok(index)
}

fn entry(shot: &Shot, model: &Model, image: PathBuf, roots: &[PathBuf]) -> Result<Entry, RecordingError> {
    let stem = shot.name.rsplit_once('.').map_or(shot.name.as_str(), |s| s.0);
    let folders = ["depth", "depths"];
    let depth =
        roots.iter().find_map(|root| folders.iter().find_map(|f| depth_file::find(&root.join(f), &[stem, &shot.name])));
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
        depth: depth.map(|d| -> Load<Measured> { Box::new(move || depth_file::read(&d, Scale::MILLIMETRES, false)) }),
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
