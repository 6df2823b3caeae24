//! Part discovery on a procedural cabinet: joints and the part of every surface point, against the truth.

use artgs::discover::{DepthPicture, DiscoverConfig, Discovery, Scene, discover};
use artgs_core::{Capture, JointKind, State, View};
use artgs_synth::cabinet::{Cabinet, CabinetOptions, cabinet_capture, render};
use glam::Vec3;

fn pictures(views: &[View]) -> Vec<DepthPicture<'_>> {
    views.iter().map(|view| DepthPicture { view, depth: view.depth.as_ref().expect("cabinets have depth") }).collect()
}

/// The true part at a surface point, by the view whose depth agrees best with it.
fn true_part(cabinet: &Cabinet, state: State, views: &[View], points: &[Vec3]) -> Vec<Option<usize>> {
    let truth: Vec<_> = views.iter().map(|v| render(cabinet, state, &v.camera)).collect();
    let part = |p: &Vec3| {
        let seen = views.iter().zip(&truth).filter_map(|(view, truth)| {
            let (pixel, depth) = view.camera.project(p.as_dvec3());
            let (width, height) = view.size();
            let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < width as f64 && pixel.y < height as f64;
            let index = inside.then(|| pixel.y as usize * width + pixel.x as usize)?;
            (truth.labels[index] > 0).then(|| ((truth.depth[index] - depth).abs(), truth.labels[index] - 1))
        });
        seen.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, part)| usize::from(part))
    };
    points.iter().map(part).collect()
}

fn found(options: &CabinetOptions, movable: usize) -> (Capture, Cabinet, Discovery) {
    let (capture, cabinet) = cabinet_capture(options).expect("the cabinet is drawn");
    let config = DiscoverConfig::default();
    let states = capture.states.as_ref().map(|s| pictures(&s.train));
    let scene = Scene::new(states.as_ref().map(Vec::as_slice), &config).expect("there are surface points");
    let discovery = discover(&scene, movable..=movable, &config).expect("two parts moved");
    (capture, cabinet, discovery)
}

/// Shares of all points and of the movable ones that carry the right part.
fn right_labels(capture: &Capture, cabinet: &Cabinet, found: &Discovery) -> (f64, f64) {
    // True part of each found one: the door turns, the drawer slides.
    let kinds: Vec<JointKind> = found.parts.iter().map(|p| p.kind).collect();
    let of_kind = |kind| kinds.iter().position(|k| *k == kind).map_or(0, |k| k + 1);
    let (mut right, mut all) = ([0usize; 2], [0usize; 2]);
    for s in State::ALL {
        let truth = true_part(cabinet, s, &capture.states[s].train, &found.clouds[s].points);
        for (truth, label) in truth.iter().zip(&found.labels[s]) {
            let Some(truth) = *truth else { continue };
            let wanted = cabinet.parts[truth].joint.map_or(0, |j| of_kind(j.kind));
            let movable = usize::from(truth > 0);
            all[movable] += 1;
            right[movable] += usize::from(usize::from(*label) == wanted);
        }
    }
    ((right[0] + right[1]) as f64 / (all[0] + all[1]) as f64, right[1] as f64 / all[1] as f64)
}

fn check(options: &CabinetOptions, axis_deg: f64, share: f64) {
    let (capture, cabinet, found) = found(options, 2);
    assert!(found.parts.len() == 2 && found.warnings.is_empty(), "{:?} {:?}", found.parts, found.warnings);
    for part in &cabinet.parts[1..] {
        let truth = part.joint.expect("movable parts have joints");
        let part = found.parts.iter().find(|p| p.kind == truth.kind).expect("a door and a drawer");
        let motion = truth.start_to_end();
        let turned = (part.motion.inverse() * motion).angle().to_degrees();
        let at = cabinet.ball().0;
        let shifted = part.motion.apply(at).distance(motion.apply(at));
        assert!(
            turned < axis_deg && shifted < 0.003 * found.diagonal,
            "{:?}: off by {turned:.4} degrees, {shifted:.5} at the middle",
            truth.kind
        );
    }
    let (all, movable) = right_labels(&capture, &cabinet, &found);
    assert!(all > share && movable > share, "{all} of all points, {movable} of movable ones");
}

#[test]
fn a_door_and_a_drawer_are_found_with_nearly_every_point() {
    check(&CabinetOptions { views: 32, size: 128, ..CabinetOptions::default() }, 0.3, 0.97);
}

#[test]
fn noisy_depth_is_survived() {
    check(
        &CabinetOptions { views: 32, size: 128, depth_noise: 0.002, seed: 3, ..CabinetOptions::default() },
        1.0,
        0.95,
    );
}

#[test]
fn a_wrong_number_of_parts_is_doubted() {
    let options = CabinetOptions { views: 20, size: 96, ..CabinetOptions::default() };
    let doubts = |movable: usize| found(&options, movable).2.warnings.join(" ");
    assert!(doubts(1).contains("more parts than these"), "{}", doubts(1));
    let too_many = doubts(3);
    assert!(too_many.contains("may not be a part") || too_many.contains("only 2"), "{too_many}");
}
