//! Folders of images with poses in text files, as data sets and SLAM programs export them: ScanNet, Replica, RTAB-Map, Open3D, ARKitScenes,
//! slambook. Colour and depth images belong together by their numbers; poses are one matrix per frame, a list of matrices, a trajectory
//! log, or rows of positions and quaternions. Camera-to-world, OpenCV axes, metres; depth in millimetres unless a file states more.

use super::depth_file::{self, Scale};
use super::files::{Odd, names, natural};
use super::folder_poses::{self, Poses};
use super::index::{Entry, Gaps, Index, LOST, Load, Poseless};
use super::intrinsics::{self, Cameras};
use super::lens::Lens;
use super::pixels::{dimensions, read_color};
use super::{RecordingError, RecordingOptions};
use artgs_core::Intrinsics;
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Names of folders with colour images, or their ends.
const COLOR: [&str; 8] = ["color", "rgb", "colour", "results", "image", "images", "lowres_wide", "_rgb"];
/// Names of folders with depth images, or their ends.
const DEPTH: [&str; 5] = ["depth", "depths", "results", "lowres_depth", "_depth"];

/// Counts per metre of Replica's rendered depth.
const REPLICA: f32 = 6553.5;
/// Size and intrinsics of Replica's rendered images.
const REPLICA_CAMERA: ((u32, u32), &str) = ((1200, 680), "600 600 599.5 339.5 1200 680");
/// Size and intrinsics that Open3D assumes for its log files.
const PRIMESENSE: ((u32, u32), &str) = ((640, 480), "525 525 319.5 239.5 640 480");

/// What a folder without intrinsics is, and the option that states them.
const HINT_REPLICA: &str =
    ". This is the layout of Replica, whose images and poses can be read with --intrinsics FX,FY,CX,CY";
const HINT: &str = ". It has folders of images and poses, as exports of ScanNet, Open3D or slambook, which can be read with --intrinsics \
                    FX,FY,CX,CY";

/// What a folder holds.
pub(super) struct Contents {
    /// The folder with the images, the given one or the only folder in it.
    dir: PathBuf,
    pub(super) color: PathBuf,
    pub(super) depth: Option<PathBuf>,
    pub(super) poses: Option<Poses>,
}

fn subfolder(dir: &Path, wanted: &[&str]) -> Option<PathBuf> {
    let all = names(dir);
    let is = |name: &String, w: &&str| name == w || w.starts_with('_') && name.ends_with(w);
    let found = wanted.iter().find_map(|w| all.iter().find(|name| is(name, w) && dir.join(name).is_dir()))?;
    Some(dir.join(found))
}

/// Looks for images, depth and poses in a folder, and in the only folder in it.
pub(super) fn contents(path: &Path) -> Option<Contents> {
    let inside = names(path).into_iter().map(|n| path.join(n)).filter(|p| p.is_dir());
    let below: Vec<PathBuf> = inside.take(2).collect();
    let only = if let [only] = &below[..] { Some(only.clone()) } else { None };
    [Some(path.to_path_buf()), only].into_iter().flatten().find_map(|dir| {
        let color = subfolder(&dir, &COLOR)?;
        let depth = subfolder(&dir, &DEPTH);
        let poses = Poses::find(&dir);
        (!numbered(&color, is_color).is_empty()).then_some(Contents { dir, color, depth, poses })
    })
}

pub(super) fn matches(path: &Path) -> bool {
    path.is_dir() && contents(path).is_some_and(|c| c.poses.is_some())
}

fn is_color(name: &str) -> bool {
    let suffix = name.rsplit_once('.').map_or("", |(_, s)| s).to_ascii_lowercase();
    ["jpg", "jpeg", "png"].contains(&suffix.as_str()) && !name.starts_with("depth")
}

/// The number in a name: its last digits, with their decimals.
fn number(stem: &str) -> Option<&str> {
    let start = stem.trim_end_matches(|c: char| c.is_ascii_digit() || c == '.').len();
    Some(stem[start..].trim_matches('.')).filter(|digits| !digits.is_empty())
}

/// Images of a folder by the numbers in their names.
pub(super) fn numbered(dir: &Path, suits: impl Fn(&str) -> bool) -> Vec<(String, PathBuf)> {
    let mut found: Vec<(String, PathBuf)> = Vec::new();
    for name in names(dir).into_iter().filter(|name| suits(name)) {
        let stem = name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem);
        if let Some(number) = number(stem) {
            found.push((number.to_string(), dir.join(&name)));
        }
    }
    found.sort_by_cached_key(|(number, _)| natural(number));
    found
}

/// Numbers without leading zeros, so that 000007 and 7 are the same.
pub(super) fn key(number: &str) -> String {
    let trimmed = number.trim_start_matches('0');
    if trimmed.is_empty() || trimmed.starts_with('.') { format!("0{trimmed}") } else { trimmed.into() }
}

pub(super) fn index(path: &Path, options: &RecordingOptions) -> Result<Index, RecordingError> {
    let missing = || {
        let reason = "contains no folder of colour images with a file or folder of poses; see the list of formats";
        RecordingError::incomplete(path, reason)
    };
    let Contents { dir, color, depth, poses } = contents(path).ok_or_else(missing)?;
    let mut index = Index { metric: true, ..Index::default() };
    let images = numbered(&color, is_color);
    let poses = match &options.poses {
        Some(file) => Poses::File(file.clone()),
        None => poses.ok_or_else(missing)?,
    };
    let read = folder_poses::read(&poses, &images, &mut index)?;
    if read.gravity {
        index.up = Some(DVec3::Z);
    }
    let is_replica = color.file_name().is_some_and(|n| n == "results");
    let cameras = cameras(&dir, &images, options, is_replica, &mut index.warnings)?;
    let per_metre = cameras.common.and_then(|c| c.per_metre).unwrap_or(if is_replica { REPLICA } else { 1000.0 });
    let scale = Scale::same(per_metre);
    let depths: BTreeMap<String, PathBuf> = depth
        .iter()
        .flat_map(|dir| {
            let suits = |name: &str| !is_replica || name.starts_with("depth");
            numbered(dir, suits).into_iter().map(|(number, file)| (key(&number), file))
        })
        .collect();
    let (mut no_pose, mut lost, mut gaps, mut poseless) =
        (Vec::new(), Vec::new(), Gaps::default(), Poseless::default());
    for (i, (number, image)) in images.iter().enumerate() {
        let name = image.strip_prefix(&dir).unwrap_or(image).display().to_string();
        let pose = match read.of(i, &key(number)) {
            None => {
                no_pose.push(name);
                continue;
            }
            Some(Err(Odd::Lost)) => {
                lost.push(name);
                continue;
            }
            Some(pose) => pose,
        };
        let Some(world_to_camera) = poseless.keep(&name, pose, |e| RecordingError::malformed(read.file(), e)) else {
            continue;
        };
        let own = cameras.of(&key(number))?;
        let depth = depths.get(&key(number)).cloned();
        if depth.is_none() {
            gaps.unnamed.push(name.clone());
        }
        let image = image.clone();
        index.entries.push(Entry {
            name,
            time: None,
            world_to_camera,
            lens: own.lens,
            color: Box::new(move || read_color(&image)),
            depth: depth.map(|d| -> Load<_> { Box::new(move || Ok(own.place(depth_file::read(&d, scale, true)?))) }),
            mask: None,
        });
    }
    index.skip(&dir, "images have no pose", &no_pose);
    index.skip(&dir, LOST, &lost);
    poseless.report(&mut index, &dir, images.len())?;
    index.warn_gaps(&dir, &gaps);
    Ok(index)
}

/// One camera for all images, or a file for each.
struct OfImages {
    common: Option<Cameras>,
    each: BTreeMap<String, PathBuf>,
}

impl OfImages {
    fn of(&self, key: &str) -> Result<Cameras, RecordingError> {
        if let Some(path) = self.each.get(key) {
            return intrinsics::read(path).map_err(|reason| RecordingError::malformed(path, reason));
        }
        let any =
            || self.each.values().next().ok_or("no intrinsics".to_string()).and_then(|path| intrinsics::read(path));
        self.common.map_or_else(any, Ok).map_err(|e| RecordingError::incomplete(Path::new(key), e))
    }
}

/// Intrinsics from the options, files, a file for each image, or those that the layout implies for images of one size.
fn cameras(
    dir: &Path,
    images: &[(String, PathBuf)],
    options: &RecordingOptions,
    is_replica: bool,
    warnings: &mut Vec<String>,
) -> Result<OfImages, RecordingError> {
    let common = intrinsics::find(dir, options, warnings)?;
    let folder = subfolder(dir, &["lowres_wide_intrinsics", "_calib", "intrinsics"]);
    let each: BTreeMap<String, PathBuf> =
        folder.map(|f| numbered(&f, |_| true)).unwrap_or_default().into_iter().map(|(n, p)| (key(&n), p)).collect();
    if common.is_some() || !each.is_empty() {
        return Ok(OfImages { each: if options.intrinsics.is_some() { BTreeMap::new() } else { each }, common });
    }
    let size = images.first().map(|(_, path)| dimensions(path)).transpose()?;
    let (usual, text) = if is_replica { REPLICA_CAMERA } else { PRIMESENSE };
    let is_log = names(dir).iter().any(|n| n.ends_with(".log")) || dir.join("scene/trajectory.log").is_file();
    if size == Some(usual) && (is_replica || is_log) {
        warnings.push(format!(
            "{}: no intrinsics are stated; {text} are used, the usual ones of this layout",
            dir.display()
        ));
        let k: Intrinsics = super::parse_intrinsics(text).map_err(|e| RecordingError::incomplete(dir, e))?;
        return Ok(OfImages { common: Some(Cameras::of_lens(Lens::pinhole(&k))), each });
    }
    let hint = if is_replica { HINT_REPLICA } else { HINT };
    Err(RecordingError::Intrinsics { path: dir.into(), hint })
}
