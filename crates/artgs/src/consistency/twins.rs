//! Images that both states have.

use artgs_core::capture::OBJECT_ALPHA;
use artgs_core::{Capture, Rigid, State, View};
use rayon::prelude::*;
use std::collections::HashMap;
use std::hash::Hasher;
use twox_hash::XxHash3_64;

/// Share of the images of the end state that are equal to an image of the start state with another pose. A camera never takes
/// the same image twice: files were copied.
pub(super) fn copied_images(capture: &Capture) -> f64 {
    let start: HashMap<u64, Rigid> = marks(&capture.states[State::START].train).into_iter().flatten().collect();
    let end = marks(&capture.states[State::END].train);
    let moved = |a: &Rigid, b: &Rigid| {
        a.translation.distance(b.translation) > 1e-6 || (a.rotation * b.rotation.inverse()).w.abs() < 1.0 - 1e-9
    };
    let copied = end.iter().flatten().filter(|(mark, pose)| start.get(mark).is_some_and(|other| moved(pose, other)));
    copied.count() as f64 / end.len().max(1) as f64
}

/// A hash of the pixels with the pose, of each view that shows something.
fn marks(views: &[View]) -> Vec<Option<(u64, Rigid)>> {
    let mark = |view: &View| {
        view.rgba.iter().any(|pixel| pixel[3] >= OBJECT_ALPHA).then(|| {
            let mut hash = XxHash3_64::new();
            hash.write(view.rgba.as_flattened());
            (hash.finish(), view.camera.world_to_camera)
        })
    };
    views.par_iter().map(mark).collect()
}
