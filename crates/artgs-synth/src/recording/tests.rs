//! Recordings: the room, the walk, the relation of the two states, files.

use super::path::Walk;
use super::room::Room;
use super::*;
use crate::catalog::object_in_metres;
use crate::objects;
use crate::trace::Surface;
use artgs_core::Mesh;
use artgs_io::load_ground_truth;
use artgs_io::recording::{RecordingOptions, load_recording};
use glam::{DVec2, Vec3};

fn small() -> RecordingCaptureOptions {
    RecordingCaptureOptions { views: 6, width: 64, ..RecordingCaptureOptions::default() }
}

fn exact() -> RecordingCaptureOptions {
    RecordingCaptureOptions { drift: Drift::default(), ..small() }
}

fn room(name: &str, seed: u64) -> Room {
    Room::new(object_in_metres(name, seed).unwrap(), true, seed).unwrap()
}

#[test]
fn every_object_stands_on_the_floor_and_touches_nothing() {
    let toward = DVec3::new(0.31, 0.52, 0.79);
    for (seed, info) in (0..).zip(objects()) {
        let room = room(info.name, seed);
        let (mut lowest, mut all) = (f64::INFINITY, 0);
        for state in State::ALL {
            let surface = Surface::new(&room.all, state);
            for triangle in 0..surface.len() {
                let [a, b, c] = surface.corners(triangle);
                let own = surface.owner(triangle).0;
                if own < room.object.parts.len() {
                    lowest = lowest.min(a.z).min(b.z).min(c.z);
                }
                // The room's own sheets are not closed.
                if room.labels[own] == 0 {
                    continue;
                }
                let inside = (room.low - 1e-9).cmple(a).all() && a.cmple(room.high).all();
                assert!(inside, "{}: {a} of part {own} is outside of the room", info.name);
                for p in [a, (a + b) / 2.0, (a + b + c) / 3.0] {
                    let kind = |part: usize| (part >= room.object.parts.len()).then_some(part);
                    let others = (0..room.labels.len()).filter(|o| room.labels[*o] != 0 && kind(*o) != kind(own));
                    for other in others {
                        let hit = surface.depth_inside(p, toward, other) > 0;
                        assert!(!hit, "{} {}: part {own} is in part {other}", info.name, state.name());
                        all += 1;
                    }
                }
            }
        }
        assert!(lowest.abs() < 1e-9 && all > 1000, "{}: {lowest}", info.name);
        let (low, high) = room.object.closed_bounds();
        assert!((0.59..1.51).contains(&(high - low).length()), "{}", info.name);
    }
}

#[test]
fn the_walk_goes_around_the_front_inside_the_walls() {
    for (name, seed) in [("storage2", 0), ("fridge2", 1), ("laptop", 2), ("counter_7", 3)] {
        let room = room(name, seed);
        let (middle, _) = room.object.ball();
        let front = room.object.placement.turn(DVec3::NEG_Y);
        for state in State::ALL {
            let walk = Walk::new(&room, state, seed);
            let surface = Surface::new(&room.all, state);
            let poses: Vec<Rigid> = (0..90).map(|i| walk.at(f64::from(i) / 90.0, DURATION)).collect();
            let (mut least, mut most, mut seen) = (0.0_f64, 0.0_f64, 0);
            for pose in &poses {
                let camera = pose.inverse();
                let eye = camera.translation;
                assert!(room.low.cmplt(eye).all() && eye.cmplt(room.high).all(), "{name}: {eye}");
                let away = (eye - middle).with_z(0.0);
                let turn = front.cross(away).z.atan2(front.dot(away)).to_degrees();
                (least, most) = (least.min(turn), most.max(turn));
                // Nothing is near the camera, in any direction.
                for k in 0..60 {
                    let z = 1.0 - (f64::from(k) + 0.5) / 30.0;
                    let turn = 2.4 * f64::from(k);
                    let flat = (1.0 - z * z).sqrt();
                    let ray = DVec3::new(flat * turn.cos(), flat * turn.sin(), z);
                    let near = surface.cast(eye, ray).is_some_and(|hit| hit.t < 0.1);
                    assert!(!near, "{name} {}: something is in front of the camera at {eye}", state.name());
                }
                let ahead = surface.cast(eye, camera.turn(DVec3::Z));
                seen += i32::from(ahead.is_some_and(|h| surface.owner(h.triangle).0 < room.object.parts.len()));
            }
            assert!(least < -80.0 && most > 80.0, "{name}: {least} to {most} degrees");
            assert!(seen > 30, "{name}: {seen} of 90 frames look at the object");
            // Neighbouring frames are a step of a person apart.
            let step = poses.windows(2).map(|w| (w[0].inverse().translation - w[1].inverse().translation).length());
            assert!(step.fold(0.0, f64::max) < 0.6);
        }
    }
}

fn distance_to(p: DVec3, mesh: &Mesh) -> f64 {
    let corner = |i: u32| Vec3::from(mesh.vertices[i as usize]).as_dvec3();
    let to_edge = |a: DVec3, b: DVec3| {
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        p.distance(a.lerp(b, t))
    };
    let to_triangle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(corner);
        let normal = (b - a).cross(c - a).normalize_or(DVec3::Z);
        let inside = [(a, b), (b, c), (c, a)].iter().all(|(s, e)| (e - s).cross(p - s).dot(normal) >= 0.0);
        if inside { (p - a).dot(normal).abs() } else { to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a)) }
    };
    mesh.triangles.iter().map(to_triangle).fold(f64::INFINITY, f64::min)
}

/// Median distance of the points that frames of a state see of a part from the true mesh, world frame of the start state.
fn median_error(recordings: &PerState<Recording>, truth: &RecordingTruth, state: State, part: usize) -> f64 {
    let to_start = if state == State::END { truth.end_to_start } else { Rigid::IDENTITY };
    let mesh = truth.object.mesh(part, state);
    let mut errors = Vec::new();
    for ((frame, camera), labels) in
        recordings[state].frames.iter().zip(&truth.cameras[state]).zip(&truth.labels[state])
    {
        let width = frame.view.size().0;
        for (i, depth) in frame.view.depth.as_ref().unwrap().iter().enumerate().step_by(2) {
            if depth > 0.0 && usize::from(labels.colour[i]) == part + 1 {
                let pixel = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
                errors.push(distance_to(to_start.apply(camera.unproject(pixel, f64::from(depth))), &mesh));
            }
        }
    }
    assert!(errors.len() > 20, "part {part}: {} points", errors.len());
    errors.sort_by(f64::total_cmp);
    errors[errors.len() / 2]
}

#[test]
fn points_of_both_states_lie_on_the_true_meshes() {
    for world in [WorldAxes::YUp, WorldAxes::Any] {
        let options = RecordingCaptureOptions { world, seed: 4, ..exact() };
        let (recordings, truth) = render_recording("storage2", &options).unwrap();
        for state in State::ALL {
            for part in 0..truth.object.parts.len() {
                let error = median_error(&recordings, &truth, state, part);
                assert!(error < 0.012, "{} part {part}: {error}", state.name());
            }
            let ups = [DVec3::Y, truth.room_to_world[state].turn(DVec3::Z)];
            assert_eq!(recordings[state].up.is_some(), world == WorldAxes::YUp);
            assert_eq!(ups[0].distance(ups[1]) < 1e-9, world == WorldAxes::YUp);
            for (frame, camera) in recordings[state].frames.iter().zip(&truth.cameras[state]) {
                let apart = frame.view.camera.world_to_camera * camera.world_to_camera.inverse();
                assert!(apart.translation.length() < 1e-9 && apart.angle() < 1e-9, "there is no drift");
            }
        }
        assert!(truth.end_to_start.translation.length() > 0.3 && truth.end_to_start.angle() > 0.1);
    }
}

#[test]
fn stated_poses_drift_and_images_do_not() {
    let (clean, _) = render_recording("blade", &exact()).unwrap();
    let (drifted, truth) = render_recording("blade", &small()).unwrap();
    for state in State::ALL {
        let mut largest = 0.0_f64;
        for ((a, b), camera) in clean[state].frames.iter().zip(&drifted[state].frames).zip(&truth.cameras[state]) {
            assert!(a.view.rgba == b.view.rgba && a.view.depth == b.view.depth);
            largest = largest.max(b.view.camera.position().distance(camera.position()));
        }
        assert!((0.007..0.014).contains(&largest), "{largest}");
    }
}

#[test]
fn states_share_a_frame_unless_each_has_its_own() {
    let options = RecordingCaptureOptions { own_frames: false, ..small() };
    let (_, truth) = render_recording("blade", &options).unwrap();
    assert!(truth.end_to_start.angle() < 1e-9 && truth.end_to_start.translation.length() < 1e-9);
}

#[test]
fn the_bystander_moves_and_clutter_stays() {
    let room = room("storage", 5);
    let part = |label: u8| room.labels.iter().position(|l| *l == label).unwrap();
    let motion = |part: usize| room.all.start_to_end(part);
    assert!(motion(part(CLUTTER_LABEL)).angle() < 1e-12);
    let (low, high) = crate::object::bounds(room.all.parts[part(BYSTANDER_LABEL)].points());
    let middle = room.all.placement.apply((low + high) / 2.0);
    let moved = motion(part(BYSTANDER_LABEL));
    assert!((0.14..0.32).contains(&moved.apply(middle).distance(middle)), "{}", moved.apply(middle) - middle);
    assert!((14.0..41.0).contains(&moved.angle().to_degrees()));

    let seen = |bystander: bool| -> std::collections::BTreeSet<u8> {
        let (_, truth) = render_recording("storage", &RecordingCaptureOptions { bystander, ..small() }).unwrap();
        truth.labels.iter().flatten().flat_map(|l| l.colour.iter().copied()).collect()
    };
    let (with, without) = (seen(true), seen(false));
    assert!(with.is_superset(&[0, 1, 2, CLUTTER_LABEL, BYSTANDER_LABEL].into()), "{with:?}");
    assert!(!without.contains(&BYSTANDER_LABEL) && without.contains(&CLUTTER_LABEL));
}

#[test]
fn same_seed_same_frames_on_any_number_of_threads() {
    let render = |threads: usize, seed: u64| {
        let options = RecordingCaptureOptions { views: 3, seed, bystander: true, sensor: Sensor::Kinect, ..small() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (recordings, _) = pool.install(|| render_recording("usb", &options)).unwrap();
        let views = recordings.iter().flat_map(|r| &r.frames);
        views.map(|f| (f.view.rgba.clone(), f.view.depth.clone(), f.view.camera)).collect::<Vec<_>>()
    };
    let once = render(1, 7);
    assert!(once == render(3, 7));
    assert!(once != render(1, 8));
}

#[test]
fn written_recordings_are_read_back_with_their_truth() {
    let dir = tempfile::tempdir().unwrap();
    let options = RecordingCaptureOptions { width: 320, views: 3, ..small() };
    for (format, sensor) in [(RecordingFormat::ScannerApp, Sensor::Lidar), (RecordingFormat::Tum, Sensor::Lidar)] {
        let options = RecordingCaptureOptions { sensor, fixed_focus: format == RecordingFormat::Tum, ..options };
        let folder = dir.path().join(format.name());
        let info = write_recorded_object("storage2", &options, format, &folder).unwrap();
        assert_eq!((info.parts, recording_info(&folder)), (3, Some(info.clone())));
        let options = RecordingCaptureOptions { world: WorldAxes::of(format), ..options };
        let (made, truth) = render_recording("storage2", &options).unwrap();
        for state in State::ALL {
            let read = load_recording(&folder.join(state.name()), &RecordingOptions::default()).unwrap();
            assert_eq!((read.recorded, read.up.is_some()), (3, made[state].up.is_some()));
            for (a, b) in read.frames.iter().zip(&made[state].frames) {
                let apart = a.view.camera.world_to_camera * b.view.camera.world_to_camera.inverse();
                assert!(apart.translation.length() < 1e-4 && apart.angle() < 1e-4, "{}", a.view.name);
            }
        }
        let loaded = load_ground_truth(&folder.join("gt")).unwrap();
        assert_eq!(loaded.joints.len(), 2);
        for i in 0..2 {
            let joint = truth.object.world_joint(i + 1).unwrap();
            assert!(loaded.joints[i].axis.dot(joint.axis) > 1.0 - 1e-9);
            let moved = loaded.movable[i][State::START].moved(&loaded.start_to_end(i));
            for (a, b) in moved.vertices.iter().zip(&loaded.movable[i][State::END].vertices) {
                assert!((Vec3::from(*a) - Vec3::from(*b)).length() < 1e-5);
            }
        }
        let alignment: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join("gt/alignment.json")).unwrap()).unwrap();
        let x = alignment["end_to_start"][0][3].as_f64().unwrap();
        assert!((x - truth.end_to_start.translation.x).abs() < 1e-12);
        assert_eq!(alignment["end"]["true_poses"].as_array().unwrap().len(), 3);
        assert!(folder.join("gt/part_masks/end/depth/frame_00002.png").is_file());
    }
}

#[test]
fn a_folder_with_the_recordings_of_both_states_is_not_one_recording() {
    use RecordingFormat::{Colmap, Nerfstudio, Polycam, Record3d, ScannerApp, Tum};
    let dir = tempfile::tempdir().unwrap();
    let options = RecordingCaptureOptions { views: 2, ..small() };
    for format in [ScannerApp, Tum, Record3d, Polycam, Nerfstudio, Colmap] {
        let folder = dir.path().join(format.name());
        write_recorded_object("blade", &options, format, &folder).unwrap();
        assert_eq!(RecordingFormat::of(&folder), None, "{}", format.name());
        assert!(RecordingFormat::of_two_states(&folder).is_some(), "{}", format.name());
        assert_eq!(RecordingFormat::of(&folder.join("start")), Some(format));
    }
}

#[test]
fn complete_recordings_are_kept_and_others_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let options = RecordingCaptureOptions { views: 3, ..small() };
    let write = |options: &RecordingCaptureOptions| {
        write_recorded_object("blade", options, RecordingFormat::ScannerApp, dir.path())
    };
    write(&options).unwrap();
    let image = dir.path().join("start/frame_00002.jpg");
    std::fs::remove_file(&image).unwrap();
    write(&options).unwrap();
    assert!(!image.exists(), "complete recordings are not rendered again");
    write(&RecordingCaptureOptions { seed: 1, ..options }).unwrap();
    assert!(image.exists());
    write(&RecordingCaptureOptions { views: 2, ..options }).unwrap();
    assert!(!image.exists(), "frames of an earlier recording are removed");
    assert!(crate::capture_info(dir.path()).is_none());
}

#[test]
fn impossible_options_are_refused() {
    let drift = Drift { metres: f64::NAN, degrees: 0.0 };
    for options in [
        RecordingCaptureOptions { views: 1, ..small() },
        RecordingCaptureOptions { width: 66, ..small() },
        RecordingCaptureOptions { drift, ..small() },
    ] {
        assert!(matches!(render_recording("blade", &options), Err(SynthError::Options(_))));
    }
    assert!(matches!(render_recording("sofa", &small()), Err(SynthError::Unknown { .. })));
}
