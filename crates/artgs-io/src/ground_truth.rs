//! Ground-truth joints and meshes of a capture: `gt/trans.json` and `gt/{start,end}/*_rotate.ply`.
//!
//! In addition to the entries of the benchmark's `trans_info`, an entry may be a screw (`"type": "screw"`, `"screw": {"l", "r",
//! "pitch"}`: degrees and slide per radian, scene units) and may have another movable part as parent (`"parent"`: the
//! `part_id` of that part, which is its index in the list plus 2).
//!
//! Only for scores: the reconstruction must not use this.

use crate::error::read_bytes;
use crate::{FileError, read_mesh_ply, without_mark};
use artgs_core::{Joint, JointKind, Mesh, PerState, Rigid, State};
use glam::DVec3;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The ground truth of an articulated object.
#[derive(Clone, Debug, PartialEq)]
pub struct GroundTruth {
    /// Joints of the movable parts, in the order of `trans_info`, in their positions at the start state. Values are 0 there.
    pub joints: Vec<Joint>,
    /// Index into `joints` of the parent of each part; None: the static part.
    pub parents: Vec<Option<usize>>,
    /// The whole object at start and end, world frame.
    pub whole: PerState<Mesh>,
    /// The static part at start and end.
    pub fixed: PerState<Mesh>,
    /// Movable parts at start and end, in the order of `joints`.
    pub movable: Vec<PerState<Mesh>>,
}

impl GroundTruth {
    /// World motion of a movable part from start to end: the motion of its joint, then those of its ancestors.
    pub fn start_to_end(&self, part: usize) -> Rigid {
        let own = self.joints[part].start_to_end();
        self.parents[part].map_or(own, |parent| self.start_to_end(parent) * own)
    }
}

/// Reads a `gt` folder. Degrees become radians, axis directions are normalised; a zero axis is an error.
pub fn load_ground_truth(gt_dir: &Path) -> Result<GroundTruth, FileError> {
    let (joints, parents): (Vec<_>, Vec<_>) = read_joints(&gt_dir.join("trans.json"))?.into_iter().unzip();
    let both = |name: &str| PerState::from_fn(|state| surface(&mesh_path(gt_dir, state, name))).transpose();
    let movable = (0..joints.len()).map(|i| {
        let numbered = format!("_dynamic_{i}");
        let single = joints.len() == 1 && !mesh_path(gt_dir, State::START, &numbered).is_file();
        both(if single { "_dynamic" } else { &numbered })
    });
    let movable = movable.collect::<Result<_, _>>()?;
    Ok(GroundTruth { movable, whole: both("")?, fixed: both("_static")?, joints, parents })
}

/// A mesh, which must have a surface: distances to nothing would be scores.
fn surface(path: &Path) -> Result<Mesh, FileError> {
    let mesh = read_mesh_ply(path)?;
    if mesh.triangles.is_empty() {
        return Err(FileError::malformed(path, "has no triangles; export the true mesh again"));
    }
    Ok(mesh)
}

/// `_rotate` in the names means turned to z-up.
fn mesh_path(gt_dir: &Path, state: State, name: &str) -> PathBuf {
    let state = state.name();
    gt_dir.join(state).join(format!("{state}{name}_rotate.ply"))
}

/// Reads only the joints of a `gt` folder.
pub fn read_true_joints(gt_dir: &Path) -> Result<Vec<Joint>, FileError> {
    Ok(read_joints(&gt_dir.join("trans.json"))?.into_iter().map(|(joint, _)| joint).collect())
}

/// Joint value, relative to the start state, at which each value of the file is 0, in the order of [`GroundTruth::joints`]: objects of
/// PartNet-Mobility are closed there. None of parts that pass it between their states.
pub fn read_true_zeros(gt_dir: &Path) -> Result<Vec<Option<f64>>, FileError> {
    let entries = read_entries(&gt_dir.join("trans.json"), &|info| {
        let ([start, end], _, _) = values(info)?;
        Ok((start * end >= 0.0).then_some(-start))
    })?;
    Ok(entries.into_iter().map(|(zero, _)| zero).collect())
}

/// Joints and their parents.
fn read_joints(path: &Path) -> Result<Vec<(Joint, Option<usize>)>, FileError> {
    read_entries(path, &joint)
}

/// What `read` says of each part, and the parents.
fn read_entries<T>(
    path: &Path,
    read: &dyn Fn(&Value) -> Result<T, String>,
) -> Result<Vec<(T, Option<usize>)>, FileError> {
    let bytes = read_bytes(path)?;
    let text = without_mark(&bytes).map_err(|reason| FileError::malformed(path, reason))?;
    let root: Value = serde_json::from_slice(text).map_err(|e| FileError::malformed(path, e.to_string()))?;
    let joints = match root.get("trans_info") {
        Some(Value::Array(list)) => {
            let entry = |(i, v)| Ok((read(v)?, parent(v, i, list.len())?));
            let named = |(i, v)| entry((i, v)).map_err(|e: String| format!("trans_info[{i}]: {e}"));
            list.iter().enumerate().map(named).collect::<Result<Vec<_>, _>>().and_then(without_cycles)
        }
        Some(one @ Value::Object(_)) => {
            read(one).map(|entry| vec![(entry, None)]).map_err(|e| format!("trans_info: {e}"))
        }
        _ => Err("key `trans_info` must be an object or a list of objects".to_string()),
    };
    joints.map_err(|reason| FileError::malformed(path, reason))
}

/// Parent of part `index` of `count`.
fn parent(info: &Value, index: usize, count: usize) -> Result<Option<usize>, String> {
    let Some(parent) = info.get("parent").filter(|v| !v.is_null()) else { return Ok(None) };
    match parent.as_u64() {
        Some(1) => Ok(None),
        Some(id) if id >= 2 && id < count as u64 + 2 && id != index as u64 + 2 => Ok(Some(id as usize - 2)),
        _ => Err(format!("key `parent` is {parent}; it must be the `part_id` of another part, 2 to {}", count + 1)),
    }
}

/// Refuses cycles of parents.
fn without_cycles<T>(joints: Vec<(T, Option<usize>)>) -> Result<Vec<(T, Option<usize>)>, String> {
    for start in 0..joints.len() {
        let mut above = joints[start].1;
        for _ in 0..joints.len() {
            above = above.and_then(|p| joints[p].1);
        }
        if above.is_some() {
            return Err(format!("trans_info[{start}]: key `parent` is part of a cycle"));
        }
    }
    Ok(joints)
}

fn joint(info: &Value) -> Result<Joint, String> {
    let axis = info.get("axis").ok_or("key `axis` is missing")?;
    let direction = vector(axis, "d")?;
    let axis_length = direction.length();
    if axis_length < 1e-9 {
        return Err("key `axis.d` is zero; it must be a direction".into());
    }
    let ([start, end], kind, pitch) = values(info)?;
    let moved = end - start;
    Ok(Joint {
        kind,
        axis: direction / axis_length,
        origin: vector(axis, "o")?,
        pitch,
        state_values: PerState::new(0.0, moved),
        limits: [moved.min(0.0), moved.max(0.0)],
    })
}

/// Values of a joint at start and end, radians or scene units, with its kind and pitch.
fn values(info: &Value) -> Result<([f64; 2], JointKind, f64), String> {
    let (kind, name, unit) = match info.get("type").and_then(Value::as_str) {
        Some("rotate") => (JointKind::Revolute, "rotate", std::f64::consts::PI / 180.0),
        Some("translate") => (JointKind::Prismatic, "translate", 1.0),
        Some("screw") => (JointKind::Screw, "screw", std::f64::consts::PI / 180.0),
        _ => return Err("key `type` must be \"rotate\", \"translate\" or \"screw\"".into()),
    };
    let value = |key: &str| {
        let number = info.get(name).and_then(|v| v.get(key)).and_then(Value::as_f64);
        number.ok_or_else(|| format!("key `{name}.{key}` must be a number"))
    };
    let pitch = if kind == JointKind::Screw { value("pitch")? } else { 0.0 };
    Ok(([value("l")? * unit, value("r")? * unit], kind, pitch))
}

fn vector(axis: &Value, key: &str) -> Result<DVec3, String> {
    let numbers: Option<Vec<f64>> =
        axis.get(key).and_then(Value::as_array).and_then(|a| a.iter().map(Value::as_f64).collect());
    match numbers.as_deref() {
        Some(&[x, y, z]) => Ok(DVec3::new(x, y, z)),
        _ => Err(format!("key `axis.{key}` must be three numbers")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::write_mesh_ply;

    fn point(x: f32) -> Mesh {
        Mesh { vertices: vec![[x, 0.0, 0.0]], triangles: vec![[0; 3]], ..Mesh::default() }
    }

    fn folder(trans: &str, parts: &[&str]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("trans.json"), trans).unwrap();
        for state in State::ALL {
            for (i, name) in ["", "_static"].iter().chain(parts).enumerate() {
                write_mesh_ply(&mesh_path(dir.path(), state, name), &point((10 * state.index() + i) as f32)).unwrap();
            }
        }
        dir
    }

    const HINGE: &str =
        r#"{"axis": {"o": [1, 2, 3], "d": [0, 0, -2]}, "type": "rotate", "rotate": {"l": 30, "r": -60}, "link": "x"}"#;
    const SLIDE: &str = r#"{"axis": {"o": [0, 0, 0], "d": [0, 1, 0]}, "type": "translate",
                            "translate": {"l": 0.1, "r": 0.35}}"#;

    #[test]
    fn one_part_as_an_object() {
        let dir = folder(&format!(r#"{{"input": 3, "trans_info": {HINGE}}}"#), &["_dynamic"]);
        let truth = load_ground_truth(dir.path()).unwrap();
        let joint = truth.joints[0];
        assert_eq!((joint.kind, joint.axis, joint.origin), (JointKind::Revolute, -DVec3::Z, DVec3::new(1.0, 2.0, 3.0)));
        assert!((joint.state_values[State::END] + std::f64::consts::FRAC_PI_2).abs() < 1e-12 && joint.limits[1] == 0.0);
        // -90 degrees about -z takes the x direction to y.
        let moved = joint.start_to_end().apply(DVec3::new(2.0, 2.0, 0.0));
        assert!((moved - DVec3::new(1.0, 3.0, 0.0)).length() < 1e-12, "{moved}");
        assert_eq!(
            (&truth.whole[State::END], &truth.fixed[State::START], &truth.movable),
            (&point(10.0), &point(1.0), &vec![PerState::new(point(2.0), point(12.0))])
        );
    }

    #[test]
    fn several_parts_as_a_list() {
        let dir = folder(&format!(r#"{{"trans_info": [{HINGE}, {SLIDE}]}}"#), &["_dynamic_0", "_dynamic_1"]);
        let truth = load_ground_truth(dir.path()).unwrap();
        let shift = truth.joints[1].start_to_end().translation;
        assert!((shift - DVec3::new(0.0, 0.25, 0.0)).length() < 1e-12, "{shift}");
        assert_eq!(truth.movable[1], PerState::new(point(3.0), point(13.0)));
        std::fs::remove_file(dir.path().join("end/end_dynamic_1_rotate.ply")).unwrap();
        assert!(load_ground_truth(dir.path()).unwrap_err().to_string().contains("end_dynamic_1_rotate.ply"));
    }

    #[test]
    fn screws_and_chains_compose() {
        let screw = HINGE.replace("rotate", "screw").replace("-60", "-60, \"pitch\": -0.5");
        let carried = SLIDE.replacen('{', "{\"parent\": 2,", 1);
        let dir = folder(&format!(r#"{{"trans_info": [{screw}, {carried}]}}"#), &["_dynamic_0", "_dynamic_1"]);
        let truth = load_ground_truth(dir.path()).unwrap();
        assert_eq!((truth.joints[0].kind, truth.joints[0].pitch), (JointKind::Screw, -0.5));
        assert_eq!(truth.parents, [None, Some(0)]);
        // A slide by 0.25 along y, then -90 degrees about -z through (1, 2, .) and pi / 4 along -z.
        let moved = truth.start_to_end(1).apply(DVec3::new(1.0, 2.0, 3.0));
        let expected = DVec3::new(0.75, 2.0, 3.0 - std::f64::consts::FRAC_PI_4);
        assert!((moved - expected).length() < 1e-12, "{moved}");
    }

    #[test]
    fn bad_entries_are_named() {
        for (from, to, words) in [
            ("\"type\"", "\"parent\": 3, \"type\"", "trans_info[1]: key `parent` is 3"),
            ("\"type\"", "\"parent\": 9, \"type\"", "trans_info[1]: key `parent` is 9"),
            ("-2", "0", "trans_info[1]: key `axis.d` is zero"),
            ("\"rotate\",", "\"twist\",", "trans_info[1]: key `type`"),
            ("\"l\"", "\"left\"", "trans_info[1]: key `rotate.l`"),
            ("[1, 2, 3]", "[1, 2]", "trans_info[1]: key `axis.o`"),
        ] {
            let dir = folder(&format!(r#"{{"trans_info": [{SLIDE}, {}]}}"#, HINGE.replace(from, to)), &[]);
            let message = load_ground_truth(dir.path()).unwrap_err().to_string();
            assert!(message.contains("trans.json") && message.contains(words), "{message}");
        }
    }
}
