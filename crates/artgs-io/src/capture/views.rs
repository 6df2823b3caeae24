//! Decodes the images of listed frames into views.

use super::CaptureError;
use crate::FileError;
use crate::image_io::{RgbaImage, read_depth, read_rgba};
use crate::reduce::{nearest, reduced_rgba, reduced_size};
use artgs_core::capture::{HIDDEN_ALPHA, OBJECT_ALPHA};
use artgs_core::{Camera, DepthMap, Intrinsics, Rigid, View};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// A focal length in the form of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Focal {
    /// In pixels.
    Pixels(f64),
    /// Field of view, radians.
    Angle(f64),
}

impl Focal {
    fn pixels(self, extent: u32) -> f64 {
        match self {
            Self::Pixels(f) => f,
            Self::Angle(a) => f64::from(extent) / (2.0 * (a / 2.0).tan()),
        }
    }
}

/// Intrinsics of a camera file; image sizes complete them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lens {
    pub(super) x: Focal,
    /// None: pixels are square.
    pub(super) y: Option<Focal>,
    /// None: the image centre.
    pub(super) cx: Option<f64>,
    pub(super) cy: Option<f64>,
    pub(super) width: Option<u32>,
    pub(super) height: Option<u32>,
}

impl Lens {
    fn intrinsics(&self, width: u32, height: u32) -> Intrinsics {
        let fx = self.x.pixels(width);
        let fy = self.y.map_or(fx, |y| y.pixels(height));
        let (cx, cy) = (self.cx.unwrap_or(f64::from(width) / 2.0), self.cy.unwrap_or(f64::from(height) / 2.0));
        Intrinsics { fx, fy, cx, cy, width, height }
    }
}

/// Focal lengths of usable images, relative to their larger side: fields of view from a twentieth to 178 degrees.
const FOCAL: std::ops::RangeInclusive<f64> = 0.008..=600.0;
/// The principal point of a usable image is at most this many images away from it: images may be cut out of larger ones.
const OUTSIDE: f64 = 2.0;

/// What is wrong with intrinsics.
pub(super) fn fault(k: &Intrinsics) -> Option<String> {
    let (w, h) = (f64::from(k.width), f64::from(k.height));
    for (key, focal) in [("fl_x", k.fx), ("fl_y", k.fy)] {
        if !FOCAL.contains(&(focal / w.max(h))) {
            return Some(format!(
                "key `{key}` (or `K`, `camera_angle_x`): a focal length of {focal:e} pixels is not that of an image of \
                 {w}x{h}; correct the intrinsics"
            ));
        }
    }
    for (key, center, size) in [("cx", k.cx, w), ("cy", k.cy, h)] {
        if !(-OUTSIDE * size..=(1.0 + OUTSIDE) * size).contains(&center) {
            return Some(format!(
                "key `{key}` (or `K`): a principal point at {center} is far outside of the image of {w}x{h}; correct the \
                 intrinsics"
            ));
        }
    }
    None
}

/// A frame of a camera file.
#[derive(Debug)]
pub(super) struct Entry {
    /// Camera file and frame, for messages.
    pub(super) place: String,
    /// Key by which frames are sorted.
    pub(super) sort_key: String,
    /// Colour image, relative to the capture.
    pub(super) image: PathBuf,
    /// Depth image, relative to the capture.
    pub(super) depth: Option<PathBuf>,
    /// Derived depth, relative to the capture; of the scale of depth.
    pub(super) derived: Option<PathBuf>,
    /// Depth values per scene unit.
    pub(super) depth_scale: f64,
    pub(super) lens: Lens,
    pub(super) world_to_camera: Rigid,
}

impl Entry {
    fn fail(&self, reason: String) -> CaptureError {
        CaptureError::Image { place: self.place.clone(), reason }
    }

    /// Error of an unreadable file, named relative to the capture.
    fn file_error(&self, name: &Path, error: FileError) -> CaptureError {
        let name = name.display();
        self.fail(match error {
            FileError::Read { source, .. } | FileError::Write { source, .. } => format!("{name}: {source}"),
            FileError::Malformed { reason, .. } => format!("{name}: {reason}"),
            other => other.to_string(),
        })
    }
}

struct Decoded {
    view: View,
    /// Width and height of the file, pixels.
    size: (u32, u32),
    has_alpha: bool,
    was_16_bit: bool,
    /// True if no pixel has any alpha.
    empty: bool,
    largest_alpha: u8,
}

/// Decodes frames in parallel, in their order, with images of at most `longest_side` pixels. Frames with an empty mask are ignored with a warning. A training split must
/// have two usable views. Depth of other splits is not read, because it is not used.
pub(super) fn load(
    dir: &Path,
    file: &Path,
    entries: &[Entry],
    training: bool,
    longest_side: u32,
    warnings: &mut Vec<String>,
) -> Result<Vec<View>, CaptureError> {
    let decoded: Vec<_> = entries.par_iter().map(|entry| decode(dir, entry, training, longest_side)).collect();
    let decoded = decoded.into_iter().collect::<Result<Vec<Decoded>, _>>()?;
    same_size(entries, &decoded)?;
    if let Some(d) = decoded.first().filter(|d| d.view.size() != (d.size.0 as usize, d.size.1 as usize)) {
        let ((w, h), (width, height)) = (d.view.size(), d.size);
        warnings.push(format!("{}: images of {width}x{height} pixels are used at {w}x{h}", file.display()));
    }
    let names = |pick: fn(&Decoded) -> bool| -> Vec<&str> {
        decoded.iter().filter(|d| pick(d)).map(|d| d.view.name.as_str()).collect()
    };
    let shown = file.display();
    let empty = names(|d| d.empty);
    if !empty.is_empty() && empty.len() == decoded.len() {
        return Err(CaptureError::EmptyMasks { file: file.into(), frames: listing(&empty) });
    }
    let largest = decoded.iter().map(|d| d.largest_alpha).max().unwrap_or(0);
    if (1..OBJECT_ALPHA).contains(&largest) {
        return Err(CaptureError::FaintMasks { file: file.into(), largest });
    }
    for (odd, what) in [
        (empty, "are ignored, their mask (alpha) is empty"),
        (names(|d| !d.has_alpha), "have no alpha; all pixels count as the object"),
        (names(|d| d.was_16_bit), "have 16 bits per channel and were rounded to 8"),
    ] {
        if !odd.is_empty() {
            warnings.push(format!("{shown}: {} of {} images {what}: {}", odd.len(), decoded.len(), listing(&odd)));
        }
    }
    let views: Vec<View> = decoded.into_iter().filter(|d| !d.empty).map(|d| d.view).collect();
    if training && views.len() < 2 {
        return Err(CaptureError::TooFewViews { file: file.into(), usable: views.len() });
    }
    some_depth(file, &views)?;
    Ok(views)
}

/// Up to five names and the number of others.
fn listing(names: &[&str]) -> String {
    let head = names[..names.len().min(5)].join(", ");
    if names.len() > 5 { format!("{head} and {} more", names.len() - 5) } else { head }
}

fn decode(dir: &Path, entry: &Entry, training: bool, longest_side: u32) -> Result<Decoded, CaptureError> {
    let image = read_rgba(&dir.join(&entry.image)).map_err(|e| entry.file_error(&entry.image, e))?;
    let RgbaImage { width, height, pixels, has_alpha, was_16_bit } = image;
    for (key, stated, found) in [("w", entry.lens.width, width), ("h", entry.lens.height, height)] {
        if let Some(stated) = stated.filter(|s| *s != found) {
            let name = entry.image.display();
            return Err(entry.fail(format!(
                "{name} is {width}x{height}, but key `{key}` says {stated}; rescale the image or correct the intrinsics"
            )));
        }
    }
    let read = |path: &Option<PathBuf>, masked: bool| match path.as_ref().filter(|_| training) {
        Some(path) => depth_map(dir, entry, path, masked.then_some(&pixels), width, height).map(Some),
        None => Ok(None),
    };
    let (depth, derived) = (read(&entry.depth, true)?, read(&entry.derived, false)?);
    let largest_alpha = pixels.iter().map(|p| p[3]).max().unwrap_or(0);
    let intrinsics = entry.lens.intrinsics(width, height);
    if let Some(fault) = fault(&intrinsics) {
        return Err(entry.fail(fault));
    }
    let camera = Camera { intrinsics, world_to_camera: entry.world_to_camera };
    let view = View { name: entry.image.display().to_string(), camera, rgba: pixels, depth, derived };
    let view = where_unmeasured(reduced(view, longest_side));
    Ok(Decoded { view, size: (width, height), has_alpha, was_16_bit, empty: largest_alpha == 0, largest_alpha })
}

/// A view with images of at most `longest_side` pixels.
pub(super) fn reduced(view: View, longest_side: u32) -> View {
    let Intrinsics { width, height, .. } = view.camera.intrinsics;
    let (size, to) = ((width, height), reduced_size(width, height, longest_side));
    if to == size {
        return view;
    }
    let View { name, camera, rgba: whole, mut depth, mut derived } = view;
    let mut rgba = reduced_rgba(&whole, size, to);
    [&mut depth, &mut derived].into_iter().flatten().for_each(|map| *map = map.select(nearest(size, to)));
    for (pixel, from) in rgba.iter_mut().zip(nearest(size, to)) {
        // A mean of the object and of what hides it is no background.
        if whole[from][3] == HIDDEN_ALPHA && pixel[3] < OBJECT_ALPHA {
            pixel[3] = HIDDEN_ALPHA;
        }
    }
    derived = derived.map(|map| {
        let beside = |(from, pixel): (usize, &[u8; 4])| whole[from][3] < OBJECT_ALPHA && pixel[3] >= OBJECT_ALPHA;
        without(&map, nearest(size, to).zip(&rgba).map(beside))
    });
    let camera = Camera { intrinsics: camera.intrinsics.resized(to.0, to.1), ..camera };
    View { name, camera, rgba, depth, derived }
}

/// A view whose derived depth has nothing where depth was measured.
pub(super) fn where_unmeasured(mut view: View) -> View {
    if let (Some(depth), Some(map)) = (&view.depth, &view.derived) {
        view.derived = Some(without(map, depth.counts().iter().map(|count| *count > 0)));
    }
    view
}

/// Depth without that of the pixels that are true.
fn without(map: &DepthMap, removed: impl Iterator<Item = bool>) -> DepthMap {
    let counts = map.counts().iter().zip(removed).map(|(count, removed)| if removed { 0 } else { *count });
    DepthMap::new(counts.collect(), map.per_unit())
}

/// Depth of pixels of the object, of all pixels without their colours.
fn depth_map(
    dir: &Path,
    entry: &Entry,
    path: &Path,
    rgba: Option<&Vec<[u8; 4]>>,
    width: u32,
    height: u32,
) -> Result<DepthMap, CaptureError> {
    let mut image = read_depth(&dir.join(path)).map_err(|e| entry.file_error(path, e))?;
    if (image.width, image.height) != (width, height) {
        let (w, h, path) = (image.width, image.height, path.display());
        return Err(entry.fail(format!(
            "depth image {path} is {w}x{h}, its colour image {width}x{height}; rescale the depth image (nearest)"
        )));
    }
    for (count, pixel) in image.counts.iter_mut().zip(rgba.into_iter().flatten()) {
        if pixel[3] < OBJECT_ALPHA {
            *count = 0;
        }
    }
    Ok(DepthMap::new(image.counts, entry.depth_scale as f32))
}

/// All images of a camera file share its intrinsics, so they must share one size.
fn same_size(entries: &[Entry], decoded: &[Decoded]) -> Result<(), CaptureError> {
    let Some(first) = decoded.first() else { return Ok(()) };
    let (w, h) = first.size;
    for (entry, d) in entries.iter().zip(decoded) {
        let (w1, h1) = d.size;
        if (w1, h1) != (w, h) {
            return Err(entry.fail(format!(
                "{} is {w1}x{h1}, but {} is {w}x{h}; all images of one camera file must have one size",
                d.view.name, first.view.name
            )));
        }
    }
    Ok(())
}

fn some_depth(file: &Path, views: &[View]) -> Result<(), CaptureError> {
    let mut with_depth = views.iter().filter_map(|v| Some((v, v.depth.as_ref()?))).peekable();
    let Some((first, _)) = with_depth.peek() else { return Ok(()) };
    let frame = first.name.clone();
    if with_depth.all(|(_, depth)| depth.counts().iter().all(|count| *count == 0)) {
        return Err(CaptureError::NoDepth { file: file.into(), frame });
    }
    Ok(())
}
