//! Which surface points moved, before any reconstruction.

use super::cloud::Cloud;
use super::visibility::Occupancy;
use super::{DepthPicture, DiscoverConfig, DiscoverError, Scene};
use artgs_core::{Capture, PerState};

/// Surface points of a state.
#[derive(Clone, Debug, Default)]
pub struct MovedPoints {
    /// World frame of the state.
    pub cloud: Cloud,
    /// True for points at whose place the other state shows empty space: they have moved.
    pub moved: Vec<bool>,
}

/// Surface points of both states from the depth of the training views; empty where a training view has no depth.
pub fn moved_points(capture: &Capture, config: &DiscoverConfig) -> Result<PerState<MovedPoints>, DiscoverError> {
    let pictures = PerState::try_from_fn(|s| {
        let views = capture.states[s].train.iter();
        views.map(|view| Some(DepthPicture { view, depth: view.depth.as_ref()? })).collect::<Option<Vec<_>>>()
    });
    let Some(pictures) = pictures else { return Ok(PerState::default()) };
    let scene = Scene::new(pictures.as_ref().map(Vec::as_slice), config)?;
    Ok(PerState::from_fn(|s| {
        let moved = scene.occupancy_elsewhere(s).into_iter().map(|at| at == Occupancy::Empty).collect();
        MovedPoints { cloud: scene.states[s].cloud.clone(), moved }
    }))
}
