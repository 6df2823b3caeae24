//! Small scenes for tests.

use super::refinement::Refinement;
use super::scene::{DepthPicture, Scene};
use super::{DiscoverConfig, Evidence, StepSettings};
use artgs_core::{Capture, PerState, State};
use artgs_synth::cabinet::{CabinetOptions, cabinet_capture};
use artgs_synth::{CaptureOptions, object, render_capture};

/// A cabinet with a door and a drawer, both of which move, in pictures of `size` x `size` pixels.
pub(super) fn cabinet_scene(views: usize, size: u32) -> Scene {
    let options = CabinetOptions { views, size, ..CabinetOptions::default() };
    scene_of(&cabinet_capture(&options).unwrap().0)
}

/// A procedural object in pictures of `size` x `size` pixels.
pub(super) fn object_scene(name: &str, views: usize, size: u32) -> Scene {
    let options = CaptureOptions { views, size, ..CaptureOptions::default() };
    scene_of(&render_capture(&object(name, 0).unwrap(), &options).unwrap())
}

/// A laptop that is closed at the start and open at the end: closed, the lid hides most of what rests.
pub(super) fn laptop_scene(views: usize, size: u32) -> Scene {
    let options = CaptureOptions { views, size, ..CaptureOptions::default() };
    let object = object("laptop", 0).unwrap().with_values(1, PerState::new(4f64.to_radians(), 95f64.to_radians()));
    scene_of(&render_capture(&object, &options).unwrap())
}

/// One object in the start state, another one in the end state.
pub(super) fn scene_of_two(names: [&str; 2], views: usize, size: u32) -> Scene {
    let options = CaptureOptions { views, size, ..CaptureOptions::default() };
    let [mut capture, other] = names.map(|name| render_capture(&object(name, 0).unwrap(), &options).unwrap());
    capture.states[State::END] = other.states[State::END].clone();
    scene_of(&capture)
}

fn scene_of(capture: &Capture) -> Scene {
    let pictures = PerState::from_fn(|s| {
        let picture = |view| DepthPicture { view, depth: view.depth.as_ref().unwrap() };
        capture.states[s].train.iter().map(picture).collect::<Vec<_>>()
    });
    Scene::new(pictures.as_ref().map(Vec::as_slice), &DiscoverConfig::default()).unwrap()
}

/// What `f` gives for a refinement of the parts of a scene with default settings.
pub(super) fn with_refinement<T>(scene: &Scene, f: impl FnOnce(&Refinement<'_>) -> T) -> T {
    let (config, settings) = (&DiscoverConfig::default(), &StepSettings::default());
    let (clouds, evidence) = (&scene.indexed_clouds(), &Evidence::new(scene, settings).unwrap());
    let front = evidence.front(scene, clouds, settings);
    f(&Refinement { scene, clouds, evidence, config, settings, front, begun: &|| () })
}
