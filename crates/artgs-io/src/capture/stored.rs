//! A capture as its files hold it: a run on images in memory sees the numbers that a later run reads from disk.

use super::views::{fault, reduced, where_unmeasured};
use super::write::{counted, depth_scale, folder_of, image_path};
use super::{CaptureError, Layout, Split, check};
use artgs_core::capture::OBJECT_ALPHA;
use artgs_core::{Capture, DepthMap, State, StateViews, View};
use rayon::prelude::*;
use std::collections::HashMap;

/// Name that each view of a stored capture had before, by its image file.
pub type RecordedNames = HashMap<String, String>;

/// The capture that [`load_capture`](super::load_capture) reads, to the last bit, where [`write_capture`](super::write_capture) has written the
/// one returned, and how its views were named before. Images have at most `longest_side` pixels, depth has counts of one size and is that of the
/// object, views are named as their files and views without the object are absent; held-out views have no depth.
pub fn as_stored(mut capture: Capture, longest_side: u32) -> Result<(Capture, RecordedNames), CaptureError> {
    check_images(&capture)?;
    let views = |capture: &mut Capture, change: &(dyn Fn(View) -> View + Sync)| {
        let of_states = capture.states.iter_mut().flat_map(|s| [&mut s.train, &mut s.test]);
        of_states.for_each(|views| *views = std::mem::take(views).into_par_iter().map(change).collect());
    };
    views(&mut capture, &|view| reduced(view, longest_side));
    let scale = depth_scale(&capture);
    views(&mut capture, &|view| rounded(view, scale));
    let mut recorded = RecordedNames::new();
    for state in State::ALL {
        let StateViews { train, test } = &mut capture.states[state];
        for (views, split) in [(train, Split::Train), (test, Split::Test)] {
            views.retain(|view| view.rgba.iter().any(|pixel| pixel[3] > 0));
            if split == Split::Train && views.len() < 2 {
                let file = Layout::ArtGs.camera_file(state, split);
                return Err(CaptureError::TooFewViews { file, usable: views.len() });
            }
            let folder = folder_of(state, split.name());
            for (i, view) in views.iter_mut().enumerate() {
                let file = image_path(&folder, i);
                let before = std::mem::replace(&mut view.name, file.clone());
                recorded.insert(file, before);
            }
            if split == Split::Test {
                views.iter_mut().for_each(|view| (view.depth, view.derived) = (None, None));
            }
        }
    }
    check::states_overlap(&capture.states)?;
    Ok((capture, recorded))
}

/// Refuses images in memory whose arrays do not have the size of their camera, and images that a camera file cannot hold: those of a
/// state have one size and usable intrinsics. Errors name the view.
pub fn check_images(capture: &Capture) -> Result<(), CaptureError> {
    let views = || capture.states.iter().flat_map(|s| [&s.train, &s.test]);
    for views in views() {
        for view in views {
            let fail = |reason: String| CaptureError::Image { place: view.name.clone(), reason };
            fault(&view.camera.intrinsics).map_or(Ok(()), |reason| Err(fail(reason)))?;
            let (w, h) = view.size();
            if view.size() != views[0].size() {
                let (width, height) = views[0].size();
                return Err(fail(format!(
                    "is {w}x{h}, but {} is {width}x{height}; all images of a state must have one size",
                    views[0].name
                )));
            }
            let depths = [&view.depth, &view.derived].into_iter().flatten().map(DepthMap::len);
            if std::iter::once(view.rgba.len()).chain(depths).any(|pixels| pixels != w * h) {
                return Err(fail(format!("colours and depth must have {w}x{h} pixels, as the camera states")));
            }
        }
    }
    Ok(())
}

/// A view with the depth of its files.
fn rounded(view: View, scale: f64) -> View {
    let masked = |depth: DepthMap| {
        let of_object = |(count, pixel): (&u16, &[u8; 4])| if pixel[3] < OBJECT_ALPHA { 0 } else { *count };
        DepthMap::new(depth.counts().iter().zip(&view.rgba).map(of_object).collect(), depth.per_unit())
    };
    let depth = view.depth.as_ref().map(|depth| masked(counted(depth, scale)));
    let derived = view.derived.as_ref().map(|depth| counted(depth, scale));
    where_unmeasured(View { depth, derived, ..view })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::write_capture;
    use crate::load_capture;
    use artgs_core::{Camera, Intrinsics, PerState, Rigid};
    use glam::DVec3;

    fn view(i: usize, unit: f32, alpha: u8) -> View {
        let intrinsics =
            Intrinsics { fx: 20.0 + i as f64, fy: 21.0, cx: 9.0 - i as f64, cy: 8.5, width: 20, height: 18 };
        let pixel = |p: usize| [p as u8, (2 * p) as u8, i as u8, if p % 7 == 5 { 40 } else { alpha }];
        let count = |p: usize| if p % 5 == 1 { 0 } else { (unit * (1.0 + 0.01 * p as f32)) as u16 };
        View {
            name: format!("walk/{i}.jpg"),
            camera: Camera::look_at(intrinsics, DVec3::new(1.0 + i as f64, 0.5, 2.0), DVec3::ZERO, DVec3::Y),
            rgba: (0..360).map(pixel).collect(),
            depth: Some(DepthMap::new((0..360).map(count).collect(), unit)),
            derived: (i > 0).then(|| DepthMap::new((0..360).map(|p| count(p + 1)).collect(), unit)),
        }
    }

    /// A run on a capture in memory, and a later one on its files, must compute the same.
    #[test]
    fn the_stored_capture_is_the_one_that_is_read() {
        let units = |i: usize| [1000.0, 1234.5, 0.7][i % 3] * 4.0;
        let several = (0..4).map(|i| view(i, units(i), 255)).collect::<Vec<_>>();
        let one = (0..4).map(|i| view(i, 2000.0, 255)).collect::<Vec<_>>();
        let empty = View { rgba: vec![[1, 2, 3, 0]; 360], ..view(1, 1000.0, 255) };
        let cases = [
            ("depth of several units", several.clone(), 1600),
            ("depth of one unit", one.clone(), 1600),
            ("smaller images", several, 16),
            ("a view without the object", vec![view(0, 1000.0, 255), empty, view(2, 1000.0, 128)], 1600),
        ];
        for (name, train, side) in cases {
            let states = PerState::from_fn(|_| StateViews { train: train.clone(), test: vec![view(9, 900.0, 255)] });
            let frames = Some(PerState::new(Rigid::IDENTITY, Rigid::about(DVec3::Y, DVec3::X, 0.4)));
            let (stored, recorded) = as_stored(Capture { states, frames, ..Capture::default() }, side).unwrap();
            let dir = tempfile::tempdir().unwrap();
            write_capture(dir.path(), &stored, &recorded).unwrap();
            let file = std::fs::read_to_string(dir.path().join("transforms_train_start.json")).unwrap();
            assert!(file.contains("\"recorded_as\": \"walk/2.jpg\""), "{name}: {file}");
            let read = load_capture(dir.path()).unwrap();
            let all = |capture: &Capture| {
                capture.states.iter().flat_map(|s| s.train.iter().chain(&s.test)).cloned().collect::<Vec<_>>()
            };
            let (a, b) = (all(&stored), all(&read));
            assert_eq!((a.len(), stored.frames), (b.len(), read.frames), "{name}");
            for (a, b) in a.iter().zip(&b) {
                assert_eq!((&a.name, a.camera), (&b.name, b.camera), "{name}");
                assert!(a.rgba == b.rgba && a.depth == b.depth && a.derived == b.derived, "{name}: {}", a.name);
            }
        }
        let wider = |mut view: View| {
            view.camera.intrinsics.width += 2;
            view.camera.intrinsics.height -= 2;
            view.rgba.truncate(352);
            (view.depth, view.derived) = (None, None);
            view
        };
        let mixed = vec![view(0, 1000.0, 255), wider(view(1, 1000.0, 255))];
        let error = as_stored(Capture::new(PerState::from_fn(|_| mixed.clone())), 1600).unwrap_err().to_string();
        assert!(error.contains("walk/1.jpg") && error.contains("22x16, but walk/0.jpg is 20x18"), "{error}");
        let short = View { rgba: vec![[0; 4]; 9], ..view(1, 1000.0, 255) };
        let error = check_images(&Capture::new(PerState::from_fn(|_| vec![short.clone()]))).unwrap_err().to_string();
        assert!(error.contains("walk/1.jpg") && error.contains("must have 20x18 pixels"), "{error}");
        let same = View { depth: one[0].depth.clone(), ..view(0, 2000.0, 255) };
        let kept = rounded(same, depth_scale(&Capture::new(PerState::from_fn(|_| one.clone()))));
        let counts = |view: &View| view.depth.as_ref().unwrap().counts()[0];
        assert_eq!(counts(&kept), counts(&one[0]), "depth of one unit is not rounded again");
    }
}
