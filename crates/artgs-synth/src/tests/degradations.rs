//! Simulated errors.

use super::small;
use crate::{CaptureOptions, object, render_capture};
use artgs_core::{Capture, State, View};
use glam::DVec3;

fn rendered(settings: &[&str]) -> Capture {
    let mut options = CaptureOptions { views: 4, size: 64, ..small() };
    settings.iter().for_each(|s| options.degradation.set(s).unwrap());
    render_capture(&object("storage2", 0).unwrap(), &options).unwrap()
}

fn train(capture: &Capture) -> impl Iterator<Item = &View> {
    capture.states.iter().flat_map(|s| &s.train)
}

fn depths(capture: &Capture) -> Vec<f64> {
    train(capture).flat_map(|v| v.depth.as_ref().unwrap().iter().map(f64::from)).collect()
}

fn kept(capture: &Capture) -> f64 {
    let depths = depths(capture);
    depths.iter().filter(|d| **d > 0.0).count() as f64
}

#[test]
fn depth_noise_grows_with_the_square_of_the_distance() {
    let (clean, noisy) = (depths(&rendered(&[])), depths(&rendered(&["depth=0.01"])));
    // Errors over the squared distance have the requested spread at every distance; rays are up to 6 % longer
    // than planar depth.
    let mut errors: Vec<(f64, f64)> =
        clean.iter().zip(&noisy).filter(|(c, _)| **c > 0.0).map(|(c, n)| (*c, (n - c) / (c * c))).collect();
    errors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = errors.len() / 2;
    for part in [&errors[..half], &errors[half..]] {
        let spread = (part.iter().map(|e| e.1 * e.1).sum::<f64>() / part.len() as f64).sqrt();
        assert!((0.0097..0.0115).contains(&spread), "{spread}");
    }
    assert!(errors[errors.len() - 1].0 > 1.3 * errors[0].0);
}

#[test]
fn depth_is_lost_at_edges_and_on_gloss() {
    let all = kept(&rendered(&[]));
    let fraction = |settings: &[&str]| kept(&rendered(settings)) / all;
    let edges = fraction(&["edges=on"]);
    assert!((0.5..0.95).contains(&edges), "{edges}");
    assert!(fraction(&["edges=50"]) < edges - 0.05);
    let gloss = fraction(&["gloss=0.3"]);
    assert!((gloss - 0.7).abs() < 0.1, "{gloss}");
    assert!(rendered(&["no-depth"]).states[State::END].train[0].depth.is_none());
}

#[test]
fn stated_cameras_have_errors_but_images_do_not() {
    let (clean, jitter, misaligned) = (rendered(&[]), rendered(&["pose=0.5,0.01"]), rendered(&["misalign=2,0.03"]));
    for other in [&jitter, &misaligned] {
        assert!(train(&clean).zip(train(other)).all(|(a, b)| a.rgba == b.rgba && a.depth == b.depth));
    }
    let turned =
        |a: &View, b: &View| (b.camera.world_to_camera * a.camera.world_to_camera.inverse()).angle().to_degrees();
    let turns: Vec<f64> = train(&clean).zip(train(&jitter)).map(|(a, b)| turned(a, b)).collect();
    let rms = (turns.iter().map(|t| t * t).sum::<f64>() / turns.len() as f64).sqrt();
    assert!((0.25..0.9).contains(&rms), "{turns:?}");
    for state in State::ALL {
        let pairs = clean.states[state].train.iter().zip(&misaligned.states[state].train);
        let offs: Vec<DVec3> = pairs
            .clone()
            .map(|(a, b)| {
                let motion = a.camera.world_to_camera.inverse() * b.camera.world_to_camera;
                motion.apply(DVec3::new(0.1, 0.2, 0.3))
            })
            .collect();
        assert!(offs.iter().all(|o| o.distance(offs[0]) < 1e-9), "one motion for all cameras");
        for (a, b) in pairs {
            assert!((turned(a, b) - 2.0 * state.index() as f64).abs() < 1e-6);
        }
    }
}

#[test]
fn cameras_stay_in_front_if_asked() {
    let object = object("storage2", 0).unwrap();
    let (middle, front) = (object.ball().0, object.placement.turn(DVec3::NEG_Y));
    let sides = |capture: &Capture| -> Vec<f64> {
        let flat = |v: DVec3| DVec3::new(v.x, v.y, 0.0);
        train(capture).map(|v| flat(v.camera.position() - middle).angle_between(flat(front)).to_degrees()).collect()
    };
    let options = CaptureOptions { views: 24, size: 16, ..small() };
    let around = render_capture(&object, &options).unwrap();
    let mut in_front = options;
    in_front.degradation.set("front=on").unwrap();
    let in_front = render_capture(&object, &in_front).unwrap();
    assert!(sides(&around).iter().any(|a| *a > 150.0) && sides(&in_front).iter().all(|a| *a < 61.0));
}

/// Mean difference between the colours of points that two neighbouring cameras both see, 0 to 255.
fn change_of_colour(a: &View, b: &View) -> f64 {
    let (width, height) = a.size();
    let (depth_a, depth_b) = (a.depth.as_ref().unwrap(), b.depth.as_ref().unwrap());
    let (mut sum, mut count) = (0.0, 0.0);
    for i in (0..width * height).filter(|i| depth_a.at(*i) > 0.0 && a.rgba[*i][3] == 255) {
        let pixel = glam::DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        let (seen, z) = b.camera.project(a.camera.unproject(pixel, f64::from(depth_a.at(i))));
        let (x, y) = (seen.x as usize, seen.y as usize);
        if seen.min_element() < 0.0 || x >= width || y >= height {
            continue;
        }
        let j = y * width + x;
        if (f64::from(depth_b.at(j)) - z).abs() < 0.005 && b.rgba[j][3] == 255 {
            sum += (0..3).map(|c| f64::from(a.rgba[i][c].abs_diff(b.rgba[j][c]))).sum::<f64>() / 3.0;
            count += 1.0;
        }
    }
    assert!(count > 100.0, "{count} pixels are in both views");
    sum / count
}

#[test]
fn light_is_fixed_in_the_world_unless_it_is_on_the_camera() {
    let change = |settings: &[&str]| {
        let mut options = CaptureOptions { views: 13, test_views: 0, size: 64, ..small() };
        settings.iter().for_each(|s| options.degradation.set(s).unwrap());
        let capture = render_capture(&object("laptop", 0).unwrap(), &options).unwrap();
        // Eight steps of the golden angle are almost full turns: the azimuth changes by thirteen degrees.
        change_of_colour(&capture.states[State::START].train[0], &capture.states[State::START].train[8])
    };
    let (world, camera) = (change(&[]), change(&["light=camera"]));
    assert!(world < 9.0 && camera > world + 6.0, "{world} {camera}");
}
