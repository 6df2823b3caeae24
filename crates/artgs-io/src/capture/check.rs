//! Checks of all states together.

use super::CaptureError;
use crate::summary::{Bounds, depth_bounds, visual_center};
use artgs_core::{STATE_NAMES, StateViews};

/// Warns if only some training views have depth.
pub(super) fn depth_is_everywhere(states: &[StateViews; 2], warnings: &mut Vec<String>) {
    let views = || states.iter().flat_map(|s| &s.train);
    let without: Vec<&str> = views().filter(|v| v.depth.is_none()).map(|v| v.name.as_str()).collect();
    let all = views().count();
    if let Some(first) = without.first().filter(|_| without.len() < all) {
        warnings.push(format!("{} of {all} training views have no depth, first {first}", without.len()));
    }
}

/// The objects of both states must overlap. With depth, the boxes of the depth points must intersect. Otherwise the distance
/// between the visual centres must be smaller than the mean distance of the cameras to them.
pub(super) fn states_overlap(states: &[StateViews; 2]) -> Result<(), CaptureError> {
    let [a, b] = [0, 1].map(|s| depth_bounds(&states[s].train));
    if let (Some(a), Some(b)) = (a, b) {
        return if a.intersects(&b) { Ok(()) } else { Err(CaptureError::NoOverlap(boxes(&a, &b))) };
    }
    let (Some(a), Some(b)) = (visual_center(&states[0].train), visual_center(&states[1].train)) else {
        return Ok(());
    };
    let (apart, reach) = ((a.point - b.point).length(), 0.5 * (a.mean_distance + b.mean_distance));
    if apart > reach {
        return Err(CaptureError::NoOverlap(format!(
            "the cameras of state {} look at {:.3}, those of {} at {:.3}, {apart:.3} apart with cameras {reach:.3} away",
            STATE_NAMES[0], a.point, STATE_NAMES[1], b.point
        )));
    }
    Ok(())
}

fn boxes(a: &Bounds, b: &Bounds) -> String {
    let text = |b: &Bounds| format!("{:.3} to {:.3}", b.min, b.max);
    let (first, second) = (STATE_NAMES[0], STATE_NAMES[1]);
    format!("the depth points of state {first} fill {}, those of {second} {}", text(a), text(b))
}
