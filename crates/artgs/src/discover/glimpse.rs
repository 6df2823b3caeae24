//! What can be seen of a capture before any reconstruction.

use super::label::AtRest;
use super::observe::Cloud;
use super::{DepthPicture, DiscoverConfig, DiscoverError, Scene};
use artgs_core::Capture;

/// Surface points of a state.
#[derive(Clone, Debug, Default)]
pub struct Glimpse {
    /// World frame of the state.
    pub cloud: Cloud,
    /// True for points that the other state looks through: they have moved.
    pub moved: Vec<bool>,
}

/// Surface points of both states from the depth of the training views; states without depth in all of them are empty.
pub fn glimpse(capture: &Capture, config: &DiscoverConfig) -> Result<[Glimpse; 2], DiscoverError> {
    let pictures = [0, 1].map(|s| {
        let views = capture.states[s].train.iter();
        views.map(|view| Some(DepthPicture { view, depth: view.depth.as_ref()? })).collect::<Option<Vec<_>>>()
    });
    let [Some(start), Some(end)] = &pictures else { return Ok(Default::default()) };
    let scene = Scene::new([start, end], config)?;
    Ok([0, 1].map(|s| {
        let moved = scene.at_rest(s).into_iter().map(|at| at == AtRest::Gone).collect();
        Glimpse { cloud: scene.states[s].cloud.clone(), moved }
    }))
}
