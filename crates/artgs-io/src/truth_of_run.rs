//! Ground truth where a run sees it: runs of recordings refine poses, which moves their world.

use crate::recording::natural;
use crate::run_folder::load_json;
use crate::{FileError, GroundTruth, RunFolder, load_ground_truth};
use artgs_core::{Joint, Mesh, PerState, Rigid, State};
use glam::{DMat3, DQuat, DVec3, DVec4};
use serde_json::Value;
use std::path::Path;

/// Fewest frames from which the place of a world follows.
const LEAST_FRAMES: usize = 3;

/// Reads the ground truth of a capture in the world of the run in a folder. That is the world of the capture except for recordings,
/// whose poses the run refined.
pub fn load_ground_truth_of_run(capture: &Path, run: &RunFolder) -> Result<GroundTruth, FileError> {
    let truth = load_ground_truth(&capture.join("gt"))?;
    let vertices = &truth.whole[State::START].vertices;
    let near = vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).sum::<DVec3>() / vertices.len() as f64;
    Ok(match world_of_run(capture, run, near) {
        Some(motion) => moved(&truth, &motion),
        None => truth,
    })
}

/// Motion from the true world of a recorded capture into the world of its run, which follows the refined poses of the start
/// state. Poses that drift and are refined can leave that world a centimetre beside the true one, which is no error of a joint.
/// None for captures that are no recordings, and for too few frames. The motion is exact near the point `near`, true world.
fn world_of_run(capture: &Path, run: &RunFolder, near: DVec3) -> Option<Rigid> {
    let alignment: Value = load_json(&capture.join("gt/alignment.json")).ok()??;
    let poses = alignment["start"]["true_poses"].as_array()?;
    let aligned: Value = load_json(&run.aligned().join("transforms_train_start.json")).ok()??;
    let frames = aligned["frames"].as_array()?;
    let names = images_like(&capture.join(frames.first()?["recorded_as"].as_str()?))?;
    let motions = frames.iter().filter_map(|frame| {
        let name = Path::new(frame["recorded_as"].as_str()?).file_name()?.to_str()?;
        let truth = pose(poses.get(names.binary_search(&natural(name)).ok()?)?)?;
        Some(pose(&frame["transform_matrix"])? * truth.inverse())
    });
    let motions: Vec<Rigid> = motions.collect();
    (motions.len() >= LEAST_FRAMES).then(|| mean_motion(&motions, near))
}

/// The keys by which all images of a recording are sorted that are named like one of them but for its numbers: the place of a name is the index
/// of its pose. Some formats count from 1, and some number images by their time.
fn images_like(image: &Path) -> Option<Vec<String>> {
    let words = |name: &str| name.replace(|c: char| c.is_ascii_digit(), "");
    let own = words(image.file_name()?.to_str()?);
    let listed = std::fs::read_dir(image.parent()?).ok()?.flatten();
    let names = listed.filter_map(|entry| entry.file_name().into_string().ok());
    let mut keys: Vec<String> = names.filter(|name| words(name) == own).map(|name| natural(&name)).collect();
    keys.sort();
    Some(keys)
}

/// A pose of four rows, which may have other axes on its side of the camera.
fn pose(value: &Value) -> Option<Rigid> {
    let rows = value.as_array()?.iter().map(|row| {
        let numbers: Vec<f64> = row.as_array()?.iter().filter_map(Value::as_f64).collect();
        (numbers.len() == 4).then(|| DVec4::from_slice(&numbers))
    });
    let rows: Vec<DVec4> = rows.collect::<Option<_>>()?;
    let [x, y, z, ..] = rows[..] else { return None };
    let rotation = DMat3::from_cols(x.truncate(), y.truncate(), z.truncate()).transpose();
    Some(Rigid::from_matrix(rotation, DVec3::new(x.w, y.w, z.w)))
}

/// The mean of similar motions, by what they do to the point `near`.
fn mean_motion(motions: &[Rigid], near: DVec3) -> Rigid {
    let first = motions[0].rotation;
    let aligned = |m: &Rigid| if m.rotation.dot(first) < 0.0 { -m.rotation } else { m.rotation };
    let sum = motions.iter().fold(DVec4::ZERO, |sum, m| sum + DVec4::from(aligned(m)));
    let rotation = DQuat::from_vec4(sum).normalize();
    let place = motions.iter().map(|m| m.apply(near)).sum::<DVec3>() / motions.len() as f64;
    Rigid { rotation, translation: place - rotation * near }
}

/// The same truth in another frame.
fn moved(truth: &GroundTruth, motion: &Rigid) -> GroundTruth {
    let joint = |j: &Joint| Joint { axis: motion.turn(j.axis), origin: motion.apply(j.origin), ..*j };
    let meshes = |m: &PerState<Mesh>| m.as_ref().map(|mesh| moved_mesh(mesh, motion));
    GroundTruth {
        joints: truth.joints.iter().map(joint).collect(),
        parents: truth.parents.clone(),
        whole: meshes(&truth.whole),
        fixed: meshes(&truth.fixed),
        movable: truth.movable.iter().map(meshes).collect(),
    }
}

fn moved_mesh(mesh: &Mesh, motion: &Rigid) -> Mesh {
    let mut mesh = mesh.clone();
    for vertex in &mut mesh.vertices {
        *vertex = motion.apply(DVec3::from_array(vertex.map(f64::from))).as_vec3().to_array();
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn rows(m: &Rigid) -> Value {
        let (r, t) = (m.matrix().transpose(), m.translation);
        let row = |a: DVec3, t: f64| json!([a.x, a.y, a.z, t]);
        json!([row(r.x_axis, t.x), row(r.y_axis, t.y), row(r.z_axis, t.z), [0, 0, 0, 1]])
    }

    #[test]
    fn the_world_of_a_run_follows_from_its_poses() {
        let dir = tempfile::tempdir().unwrap();
        let run = RunFolder::new(dir.path().join("run"));
        let true_poses: Vec<Rigid> = (0..12).map(|i| Rigid::about(DVec3::Y, DVec3::X, 0.3 * f64::from(i))).collect();
        let apart = Rigid { translation: DVec3::new(0.3, 0.0, -0.1), ..Rigid::about(DVec3::Z, DVec3::ONE, 0.2) };
        // The frames are counted from 1, and beside them are images of depth.
        let name = |i: usize| format!("start/f2/frame_{:05}.jpg", i + 1);
        let frame = |i: usize| json!({ "recorded_as": name(i), "transform_matrix": rows(&(apart * true_poses[i])) });
        let save = |path: &Path, value: Value| crate::write_atomic(path, value.to_string().as_bytes()).unwrap();
        for i in 0..true_poses.len() {
            save(&dir.path().join(name(i)), json!(i));
            save(&dir.path().join(name(i).replace("frame_", "depth_")), json!(i));
        }
        let truth = json!({ "start": { "true_poses": true_poses.iter().map(rows).collect::<Vec<_>>() } });
        assert_eq!(world_of_run(dir.path(), &run, DVec3::ONE), None);
        save(&dir.path().join("gt/alignment.json"), truth);
        let aligned = run.aligned().join("transforms_train_start.json");
        save(&aligned, json!({ "frames": [frame(2), frame(3)] }));
        assert_eq!(world_of_run(dir.path(), &run, DVec3::ONE), None, "two frames");
        save(&aligned, json!({ "frames": [frame(1), frame(5), frame(11)] }));
        let found = world_of_run(dir.path(), &run, DVec3::new(4.0, 1.0, 0.0)).unwrap();
        let error = found.inverse() * apart;
        assert!(error.angle() < 1e-7 && error.translation.length() < 1e-7, "{error:?}");
    }

    #[test]
    fn joints_move_with_the_frame() {
        let motion = Rigid { translation: DVec3::X, ..Rigid::about(DVec3::Z, DVec3::ZERO, 0.5) };
        let own = Rigid::about(DVec3::Y, DVec3::new(0.2, 0.0, 0.7), 1.1);
        let truth = GroundTruth {
            joints: vec![Joint::from_motion(artgs_core::JointKind::Revolute, &own)],
            parents: vec![None],
            whole: PerState::default(),
            fixed: PerState::default(),
            movable: vec![PerState::from_fn(|_| Mesh { vertices: vec![[1.0, 2.0, 3.0]], ..Mesh::default() })],
        };
        let there = moved(&truth, &motion);
        let p = DVec3::new(0.4, -0.3, 0.2);
        let error = there.joints[0].start_to_end().apply(motion.apply(p)).distance(motion.apply(own.apply(p)));
        assert!(error < 1e-9, "{error}");
        let vertex = there.movable[0][State::END].vertices[0];
        assert!(DVec3::from_array(vertex.map(f64::from)).distance(motion.apply(DVec3::new(1.0, 2.0, 3.0))) < 1e-6);
    }
}
