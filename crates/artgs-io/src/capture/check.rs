//! Checks of all states together.

use super::CaptureError;
use crate::summary::{Bounds, cameras_of, depth_bounds, visual_center};
use artgs_core::{PerState, State, StateViews};

/// Warns if only some training views have depth.
pub(super) fn depth_is_everywhere(states: &PerState<StateViews>, warnings: &mut Vec<String>) {
    let views = || states.iter().flat_map(|s| &s.train);
    let without: Vec<&str> = views().filter(|v| v.depth.is_none()).map(|v| v.name.as_str()).collect();
    let all = views().count();
    if let Some(first) = without.first().filter(|_| without.len() < all) {
        warnings.push(format!("{} of {all} training views have no depth, first {first}", without.len()));
    }
}

/// The objects of both states must overlap. With depth, the boxes of the depth points must intersect. Otherwise the distance
/// between the visual centres must be smaller than the mean distance of the cameras to them.
pub(super) fn states_overlap(states: &PerState<StateViews>) -> Result<(), CaptureError> {
    let (start, end) = (State::START, State::END);
    if let Some(boxes) = PerState::try_from_fn(|state| depth_bounds(&states[state].train)) {
        let (a, b) = (&boxes[start], &boxes[end]);
        return if a.intersects(b) { Ok(()) } else { Err(CaptureError::NoOverlap(apart(a, b))) };
    }
    let Some(centers) = PerState::try_from_fn(|state| visual_center(cameras_of(&states[state].train))) else {
        return Ok(());
    };
    let (a, b) = (&centers[start], &centers[end]);
    let (distance, reach) = ((a.point - b.point).length(), 0.5 * (a.mean_distance + b.mean_distance));
    if distance > reach {
        return Err(CaptureError::NoOverlap(format!(
            "the cameras of state {} look at {:.3}, those of {} at {:.3}, {distance:.3} apart with cameras {reach:.3} away",
            start.name(),
            a.point,
            end.name(),
            b.point
        )));
    }
    Ok(())
}

fn apart(a: &Bounds, b: &Bounds) -> String {
    let text = |b: &Bounds| format!("{:.3} to {:.3}", b.min, b.max);
    let (first, second) = (State::START.name(), State::END.name());
    format!("the depth points of state {first} fill {}, those of {second} {}", text(a), text(b))
}
