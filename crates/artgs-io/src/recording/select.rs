//! Which frames of a long recording are kept: evenly along the path of the camera, the sharpest of their neighbours.

use super::index::Entry;
use super::{RecordingError, pixels::Color};
use artgs_core::Rigid;
use glam::DVec3;
use rayon::prelude::*;

/// Frames whose sharpness is compared for one that is kept.
const CANDIDATES: usize = 3;
/// Longest side of the image that sharpness is measured in, pixels.
const THUMBNAIL: u32 = 480;

/// Indices of the kept entries, ascending: all of them, or `wanted` with about equal steps along the path of the camera.
/// Decodes at most three images per kept frame.
pub(super) fn keyframes(entries: &[Entry], wanted: usize) -> Result<Vec<usize>, RecordingError> {
    if entries.len() <= wanted {
        return Ok((0..entries.len()).collect());
    }
    let poses: Vec<Rigid> = entries.iter().map(|e| e.world_to_camera.inverse()).collect();
    let slots = slots(&path_lengths(&poses, wanted), wanted);
    let best = |slot: &Vec<usize>| -> Result<usize, RecordingError> {
        if let [only] = slot.as_slice() {
            return Ok(*only);
        }
        let mut best = (f64::NEG_INFINITY, slot[0]);
        for &i in slot {
            let sharp = sharpness(&(entries[i].color)()?);
            if sharp > best.0 {
                best = (sharp, i);
            }
        }
        Ok(best.1)
    };
    slots.par_iter().map(best).collect()
}

/// Distance that the camera covered until each frame: metres over the extent of the path plus radians. Movement about a place
/// that stays within a fraction of the step between kept frames does not count, so a camera that rests does not collect frames.
fn path_lengths(camera_to_world: &[Rigid], wanted: usize) -> Vec<f64> {
    let mean = camera_to_world.iter().map(|p| p.translation).sum::<DVec3>() / camera_to_world.len() as f64;
    let spread = camera_to_world.iter().map(|p| p.translation.distance_squared(mean)).sum::<f64>();
    let extent = (spread / camera_to_world.len() as f64).sqrt().max(f64::MIN_POSITIVE);
    let apart = |a: &Rigid, b: &Rigid| a.translation.distance(b.translation) / extent + (a.inverse() * *b).angle();
    let total: f64 = camera_to_world.windows(2).map(|w| apart(&w[0], &w[1])).sum();
    let rest = 0.25 * total / wanted as f64;
    let (mut anchor, mut length) = (camera_to_world[0], 0.0);
    let along = |pose: &Rigid| {
        let step = apart(&anchor, pose);
        if step > rest {
            (anchor, length) = (*pose, length + step);
        }
        length
    };
    camera_to_world.iter().map(along).collect()
}

/// For every kept frame the frames to choose from, at most [`CANDIDATES`], all of one stretch of the path. Stretches without
/// frames take the middle of the largest gap in the order of recording instead.
fn slots(lengths: &[f64], wanted: usize) -> Vec<Vec<usize>> {
    let total = lengths.last().copied().unwrap_or(0.0);
    let slot_of = |i: usize| {
        if total > 0.0 {
            ((lengths[i] / total * wanted as f64) as usize).min(wanted - 1)
        } else {
            i * wanted / lengths.len()
        }
    };
    let mut slots: Vec<Vec<usize>> = vec![Vec::new(); wanted];
    (0..lengths.len()).for_each(|i| slots[slot_of(i)].push(i));
    // The candidates are the frames in the middle of the stretch: steps between kept frames stay alike.
    let mut chosen: Vec<Vec<usize>> = slots.into_iter().filter(|s| !s.is_empty()).map(|s| middle(&s)).collect();
    let mut used: Vec<usize> = chosen.concat();
    used.sort_unstable();
    while chosen.len() < wanted {
        let bounds = [0].into_iter().chain(used.iter().map(|i| i + 1)).zip(used.iter().copied().chain([lengths.len()]));
        let Some((begin, end)) = bounds.max_by_key(|(begin, end)| end.saturating_sub(*begin)).filter(|(b, e)| e > b)
        else {
            break;
        };
        let at = begin + (end - begin) / 2;
        used.insert(used.partition_point(|i| *i < at), at);
        chosen.push(vec![at]);
    }
    chosen.sort_unstable();
    chosen
}

fn middle(frames: &[usize]) -> Vec<usize> {
    let begin = frames.len().saturating_sub(CANDIDATES) / 2;
    frames[begin..(begin + CANDIDATES).min(frames.len())].to_vec()
}

/// Variance of the Laplacian of the brightness of a thumbnail, relative to the variance of the brightness: larger is sharper.
pub(super) fn sharpness(image: &Color) -> f64 {
    let scale = (f64::from(THUMBNAIL) / f64::from(image.width.max(image.height))).min(1.0);
    let size = |n: u32| ((f64::from(n) * scale).round() as u32).max(1);
    let small = image.reduced(size(image.width), size(image.height));
    let (w, h) = (small.width as usize, small.height as usize);
    let gray: Vec<f64> = small
        .rgba
        .iter()
        .map(|p| 0.299 * f64::from(p[0]) + 0.587 * f64::from(p[1]) + 0.114 * f64::from(p[2]))
        .collect();
    let laplacian = (1..h.saturating_sub(1)).flat_map(|y| (1..w.saturating_sub(1)).map(move |x| y * w + x));
    let laplacian = laplacian.map(|i| 4.0 * gray[i] - gray[i - 1] - gray[i + 1] - gray[i - w] - gray[i + w]);
    variance(laplacian) / (variance(gray.iter().copied()) + 1.0)
}

fn variance(values: impl Iterator<Item = f64>) -> f64 {
    let (n, sum, squares) = values.fold((0.0, 0.0, 0.0), |(n, s, q), v| (n + 1.0, s + v, q + v * v));
    if n == 0.0 { 0.0 } else { squares / n - (sum / n) * (sum / n) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::lens::{Distortion, Lens};

    fn entry(position: DVec3, blurred: bool) -> Entry {
        let step = if blurred { 16 } else { 2 };
        let pixels = (0..64 * 64).map(|i| if i % 64 / step % 2 == 0 { [0, 0, 0, 255] } else { [255; 4] });
        let image = Color::new(64, 64, pixels.collect());
        let lens = Lens { focal: glam::DVec2::ONE, center: None, size: None, distortion: Distortion::None };
        Entry {
            name: String::new(),
            time: None,
            world_to_camera: Rigid::shift(position).inverse(),
            lens,
            color: Box::new(move || Ok(image.clone())),
            depth: None,
            mask: None,
        }
    }

    #[test]
    fn sharp_frames_evenly_along_the_path() {
        // The camera rests for 40 frames with jitter and then moves over 60.
        let place = |i: usize| match i {
            0..40 => DVec3::new(0.0005 * (i % 2) as f64, 0.0, 0.0),
            _ => DVec3::new((i - 39) as f64 / 60.0, 0.0, 0.0),
        };
        let entries: Vec<Entry> = (0..100).map(|i| entry(place(i), i % 3 != 0)).collect();
        let kept = keyframes(&entries, 15).unwrap();
        assert_eq!(kept.len(), 15);
        assert!(kept.is_sorted() && kept.iter().filter(|i| **i < 40).count() <= 2, "{kept:?}");
        assert!(kept.iter().filter(|i| *i % 3 == 0).count() >= 12, "{kept:?}");
        let moving: Vec<usize> = kept.iter().copied().filter(|i| *i >= 40).collect();
        assert!(moving.windows(2).all(|w| w[1] - w[0] <= 8), "{kept:?}");
    }

    #[test]
    fn few_frames_are_all_kept_and_resting_cameras_give_as_many_as_wanted() {
        let entries: Vec<Entry> = (0..10).map(|_| entry(DVec3::ZERO, false)).collect();
        assert_eq!(keyframes(&entries, 10).unwrap().len(), 10);
        assert_eq!(keyframes(&entries, 4).unwrap().len(), 4);
        let jump: Vec<Entry> = (0..10).map(|i| entry(DVec3::X * (i / 9) as f64, false)).collect();
        assert_eq!(keyframes(&jump, 6).unwrap().len(), 6);
    }
}
