//! Meshes from the true depth and part masks of a capture, scored against its true meshes: the ceiling of what any
//! reconstruction can reach with this fusion. Needs `ARTGS_DATASETS` or `../shared/datasets`.

use artgs::evaluate::{EvaluateConfig, MeshScore, Truth, evaluate};
use artgs::surface::{BACKGROUND, FusionView, SurfaceConfig, part_meshes};
use artgs_core::{PerState, Replica, View};
use artgs_io::{image_io::read_rgba, load_capture, load_ground_truth};
use std::path::PathBuf;

fn dataset(name: &str) -> Option<PathBuf> {
    let beside = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/datasets");
    let dir = std::env::var_os("ARTGS_DATASETS").map_or(beside, PathBuf::from).join(name);
    dir.is_dir().then_some(dir)
}

#[test]
fn true_depth_gives_surfaces_near_the_floor() {
    let Some(dir) = dataset("mini_fridge_habitat_200") else {
        eprintln!("SKIPPED: no data set; set ARTGS_DATASETS");
        return;
    };
    let capture = load_capture(&dir).unwrap();
    let found = load_ground_truth(&dir.join("gt")).unwrap();
    let truth = Truth {
        joints: found.joints,
        parents: found.parents,
        whole: found.whole,
        fixed: found.fixed,
        movable: found.movable,
    };
    let views = PerState::from_fn(|state| {
        let view = |(i, view): (usize, &View)| {
            let file = dir.join(format!("gt/part_masks/{}/train/{i:04}.png", state.name()));
            let label = |p: &[u8; 4]| if p[0] == 0 { BACKGROUND } else { u16::from(p[0]) - 1 };
            let labels: Vec<u16> = read_rgba(&file).unwrap().pixels.iter().map(label).collect();
            let depth: Vec<f32> = view.depth.as_ref().unwrap().iter().collect();
            let (rgba, labels) = (Some(view.rgba.clone().into()), Some(labels.into()));
            FusionView { rgba, labels, ..FusionView::new(view.camera, depth) }
        };
        capture.states[state].train.iter().enumerate().map(view).collect::<Vec<_>>()
    });
    // The truth starts at 0, the canonical frame lies midway: parts are scored in the world frames of the states.
    let mut half = vec![artgs_core::Rigid::IDENTITY];
    half.extend(truth.joints.iter().map(|j| j.start_to_end().power(0.5)));
    let surface = SurfaceConfig { resolution: 250.0, ..SurfaceConfig::default() };
    let out = part_meshes(views.as_ref().map(|views| &views[..]), &half, &surface).unwrap();
    let mut config = EvaluateConfig::default();
    config.geometry.dense_samples = 0;
    config.geometry.seeds = vec![0];
    let scores = evaluate(&Replica::new(&truth.joints), &out.meshes, &truth, &config);
    eprintln!("{scores}");
    assert!(scores.counts.found == 1 && scores.counts.missing_meshes == 0);
    // What is left above the floor is the truth's interior, which no camera sees.
    let above = |m: &MeshScore| m.mean.chamfer - m.mean.floor;
    assert!(above(&scores.movable) < 0.2 && above(&scores.fixed) < 2.3 && above(&scores.whole) < 1.8);
}
