//! Memory of a reconstruction: predicted from the sizes of the images before they are read, and kept within a limit.

use super::Input;
use artgs_core::{Capture, View};
use artgs_io::capture::{CaptureOptions, ImageSizes, image_sizes};
use bytesize::ByteSize;
use sysinfo::System;

/// Memory without any image, bytes: surfaces, Gaussians, meshes.
const FIXED: f64 = 440.0 * 1024.0 * 1024.0;

/// Memory of a pixel of a training image, bytes: colour, depth, and what is made of them. With the other constants no run on
/// measured depth needed more, of a cabinet with 16 to 80 images of 400 to 1600 pixels, of a storage with 128 images of 400,
/// and of a cabinet with 200 images of 800: they needed 50 to 97 % of it. With 2 cm
/// of noise in its depth the storage needed 116 %.
const PER_TRAINING_PIXEL: f64 = 13.0;

/// The same of an image of a recording, whose alignment derives depth where none was measured: recordings of 180 images of 720 pixels needed
/// 84 to 100 % of what it gives.
const PER_RECORDED_PIXEL: f64 = 18.0;

/// Memory of a pixel of the image that a thread renders, bytes.
const PER_RENDERED_PIXEL: f64 = 90.0;

/// The same of a held-out image, which has colours only.
const PER_HELD_OUT_PIXEL: f64 = 5.0;

/// While images are read: memory without any, bytes, and of a pixel that was read and of one of the file that is read.
const READING: f64 = 64.0 * 1024.0 * 1024.0;
const PER_READ_PIXEL: f64 = 7.0;
const PER_FILE_PIXEL: f64 = 10.0;

/// Share of the available memory that a run may take where no limit is stated.
const OF_AVAILABLE: f64 = 0.9;

/// Images are not reduced further, pixels.
const SMALLEST_SIDE: u32 = 160;

/// Too little memory.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MemoryError {
    /// Of what the caller allows.
    #[error("{allowed} of memory are allowed, at least {needed} are needed; allow more, or use fewer images")]
    Allowed {
        /// The limit.
        allowed: String,
        /// With the smallest images.
        needed: String,
    },
    /// Of what the machine has.
    #[error("{free} of memory are free, at least {needed} are needed; use fewer images, or a machine with more memory")]
    Free {
        /// What there is.
        free: String,
        /// With the smallest images.
        needed: String,
    },
}

/// What a run may and will take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Largest width or height of an image, pixels.
    pub longest_side: u32,
    /// Predicted peak, bytes.
    pub predicted: u64,
    /// Largest memory of one volume of the surfaces, MiB; none: the setting.
    pub volume_mib: Option<usize>,
    reduced: bool,
}

impl Plan {
    /// For a run on the threads of this pool. `allowed` is the limit of the caller, bytes; none: what the system, or the container
    /// that the program runs in, has left.
    pub fn new(input: &Input, allowed: Option<u64>) -> Result<Self, MemoryError> {
        let threads = rayon::current_num_threads();
        let of_sizes = |sizes: ImageSizes| {
            let predict = |side: u32| predicted(&sizes, side, threads);
            Self::within(predict, CaptureOptions::default().longest_side, allowed)
        };
        match input {
            // A folder that is no capture is refused with the reason when it is loaded.
            Input::Capture(folder) => of_sizes(image_sizes(folder).unwrap_or_default()),
            Input::Images(capture) => of_sizes(sizes_of(capture)),
            Input::Recordings(files) => {
                let frames = files.iter().map(|f| f.options.frames).max().unwrap_or(0);
                let predict = |side: u32| predicted_of_recordings(frames, side, threads);
                let largest = files.iter().map(|f| f.options.longest_side).max().unwrap_or(0);
                Self::within(predict, largest, allowed)
            }
        }
    }

    fn within(predict: impl Fn(u32) -> f64, largest: u32, allowed: Option<u64>) -> Result<Self, MemoryError> {
        let limit = allowed.map(|bytes| bytes as f64).or_else(available).unwrap_or(f64::INFINITY);
        let mut side = largest;
        while predict(side) > limit {
            // Smaller in steps of 5 %.
            side = side * 19 / 20;
            if side < SMALLEST_SIDE {
                let (needed, has) = (size(predict(SMALLEST_SIDE)), size(limit));
                return Err(match allowed {
                    Some(_) => MemoryError::Allowed { allowed: has, needed },
                    None => MemoryError::Free { free: has, needed },
                });
            }
        }
        let predicted = predict(side);
        let free_mib = |_| ((limit - predicted).max(0.0) / f64::from(1 << 20)) as usize;
        let volume_mib = allowed.map(free_mib).map(|mib| mib.max(128));
        Ok(Self { longest_side: side, predicted: predicted as u64, volume_mib, reduced: side < largest })
    }

    /// What is to be said if images are reduced.
    pub fn notice(&self) -> Option<String> {
        let (side, needed) = (self.longest_side, size(self.predicted as f64));
        let text = || format!("images are reduced to {side} pixels, so that about {needed} of memory suffice");
        self.reduced.then(text)
    }
}

/// Predicted peak of a run without a limit, bytes.
pub(super) fn unlimited(sizes: &ImageSizes) -> u64 {
    predicted(sizes, CaptureOptions::default().longest_side, rayon::current_num_threads()) as u64
}

/// Sizes of the images of a capture in memory.
pub(super) fn sizes_of(capture: &Capture) -> ImageSizes {
    let size = |view: &View| (view.camera.intrinsics.width, view.camera.intrinsics.height);
    let states = || capture.states.iter();
    ImageSizes {
        train: states().flat_map(|s| s.train.iter().map(size)).collect(),
        test: states().flat_map(|s| s.test.iter().map(size)).collect(),
    }
}

/// Bytes as people read them.
pub(super) fn size(bytes: f64) -> String {
    ByteSize::b(bytes.max(0.0) as u64).display().iec().to_string()
}

/// Peak memory of a run on recordings of at most `frames` images each, reduced to `side`, bytes.
fn predicted_of_recordings(frames: usize, side: u32, threads: usize) -> f64 {
    /// Height of an image relative to its width: that of the cameras of phones.
    const SHAPE: f64 = 0.75;
    let pixels = SHAPE * f64::from(side).powi(2);
    FIXED + PER_RECORDED_PIXEL * pixels * 2.0 * frames as f64 + PER_RENDERED_PIXEL * pixels * threads as f64
}

/// Peak memory of a run on images reduced to `side`, bytes.
fn predicted(sizes: &ImageSizes, side: u32, threads: usize) -> f64 {
    let pixels = |(w, h): (u32, u32)| f64::from(w) * f64::from(h);
    let reduced = |(w, h): (u32, u32)| {
        let shrink = (f64::from(side) / f64::from(w.max(h).max(1))).min(1.0);
        pixels((w, h)) * shrink * shrink
    };
    let train: f64 = sizes.train.iter().copied().map(reduced).sum();
    let test: f64 = sizes.test.iter().copied().map(reduced).sum();
    let read = sizes.train.iter().chain(&sizes.test).copied().map(pixels).fold(0.0, f64::max);
    let reading = READING + PER_READ_PIXEL * (train + test) + PER_FILE_PIXEL * read * threads as f64;
    let rendered = sizes.train.iter().copied().map(reduced).fold(0.0, f64::max) * threads as f64;
    reading.max(FIXED + PER_TRAINING_PIXEL * train + PER_HELD_OUT_PIXEL * test + PER_RENDERED_PIXEL * rendered)
}

/// Memory that a run may take on this system, bytes; none where the system does not say.
fn available() -> Option<f64> {
    let mut system = System::new();
    system.refresh_memory();
    let free = system.available_memory();
    let container = system.cgroup_limits().map(|limits| limits.free_memory);
    let bytes = container.map_or(free, |limit| limit.min(free));
    (bytes > 0).then_some(OF_AVAILABLE * bytes as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn photos(count: usize) -> ImageSizes {
        ImageSizes { train: vec![(4000, 3000); count], test: vec![] }
    }

    #[test]
    fn large_photos_take_the_memory_of_reduced_ones() {
        let bytes = predicted(&photos(16), 1600, 2);
        // 16 images of 1600 x 1200 pixels.
        assert!((1.0e9..1.3e9).contains(&bytes), "{bytes}");
        // On many cores, reading files takes more than training.
        assert!(predicted(&photos(16), 1600, 32) > 3e9);
        assert!(predicted(&photos(200), 1600, 2) < 9e9);
    }

    #[test]
    fn images_are_reduced_until_they_fit() {
        let sizes = photos(200);
        let plan = Plan::within(|side| predicted(&sizes, side, 2), 1600, Some(2 << 30)).unwrap();
        assert!(plan.predicted <= 2 << 30 && plan.reduced, "{plan:?}");
        assert!((500..1000).contains(&plan.longest_side), "{plan:?}");
        let ample = Plan::within(|side| predicted(&sizes, side, 2), 1600, Some(64 << 30)).unwrap();
        assert!(ample.longest_side == 1600 && !ample.reduced);
    }

    #[test]
    fn too_little_memory_is_refused() {
        let sizes = photos(16);
        let error = Plan::within(|side| predicted(&sizes, side, 2), 1600, Some(100 << 20)).unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("100.0 MiB") && text.contains("fewer images"), "{text}");
    }
}
