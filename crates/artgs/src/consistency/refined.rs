//! Whether a small mistake is still needed once poses were refined: jitter and drift of poses look like wrong factors of depth.

use super::agreement::agreement;
use super::causes::Cause;
use super::samples::{Reading, chosen, coarse_views};
use super::{LEAST_SHOWN, LEFT};
use crate::align::frames::DepthFrame;
use crate::align::refine::refine_poses;
use crate::align::{BundleConfig, GridConfig};
use artgs_core::{DepthMap, View};

/// True if the views still agree much better with the correction after poses were refined under both readings. Causes that are not
/// factors are not tried: no drift looks like them.
pub(super) fn is_needed<'v>(views: impl Iterator<Item = &'v View>, cause: Cause) -> bool {
    let (depth, focal) = match cause {
        Cause::DepthScale(s) => (s, 1.0),
        Cause::FocalLength(s) => (1.0, s),
        _ => return true,
    };
    let views = chosen(views);
    let (Some(stated), Some(corrected)) = (refined_share(&views, 1.0, 1.0), refined_share(&views, depth, focal)) else {
        return true;
    };
    1.0 - corrected < LEFT * (1.0 - stated)
}

/// Agreement of the views after their poses were refined, with all depths and focal lengths multiplied; none if they show too little
/// of each other.
fn refined_share(views: &[&View], depth: f64, focal: f64) -> Option<f64> {
    let mut read: Vec<View> = views.iter().map(|view| with_factors(view, depth, focal)).collect();
    let mut frames = DepthFrame::of_views(&read, &GridConfig::default());
    let order: Vec<(usize, usize)> = (0..frames.len()).map(|i| (0, i)).collect();
    refine_poses(&mut frames, &order, &BundleConfig::default());
    for (view, frame) in read.iter_mut().zip(&frames) {
        view.camera.world_to_camera = frame.camera.world_to_camera;
    }
    let coarse = coarse_views(read.iter());
    let found = agreement(&coarse, &coarse, [Reading::STATED; 2]);
    (found.shown() >= LEAST_SHOWN).then(|| found.share())
}

fn with_factors(view: &View, depth: f64, focal: f64) -> View {
    let mut out = view.clone();
    out.depth = view.depth.as_ref().map(|d| DepthMap::new(d.counts().to_vec(), d.per_unit() / depth as f32));
    out.camera.intrinsics.fx *= focal;
    out.camera.intrinsics.fy *= focal;
    out
}
