//! A small scene for tests.

use super::DiscoverConfig;
use super::scene::{DepthPicture, Scene};
use artgs_core::PerState;
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};

/// A cabinet with a door and a drawer, both of which move, in pictures of `size` x `size` pixels.
pub(super) fn cabinet_scene(views: usize, size: u32) -> Scene {
    let options = CabinetOptions { views, size, ..CabinetOptions::default() };
    let (capture, _) = cabinet_capture(&options).unwrap();
    let pictures = PerState::from_fn(|s| {
        let picture = |view| DepthPicture { view, depth: view.depth.as_ref().unwrap() };
        capture.states[s].train.iter().map(picture).collect::<Vec<_>>()
    });
    Scene::new(pictures.as_ref().map(Vec::as_slice), &DiscoverConfig::default()).unwrap()
}
