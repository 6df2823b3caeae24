//! The result of a reconstruction: parts, joints and paths of meshes. Serialises to `replica.json`, version 1.

use crate::{FrameError, Joint, JointAlternative, JointInterval, JointKind, PerState, Rigid, State, Upward};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Value of `format` in `replica.json`.
pub const REPLICA_FORMAT: &str = "artgs-replica";
/// Value of `version` in `replica.json`.
pub const REPLICA_VERSION: u32 = 1;

/// A reason why a replica cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum ReplicaError {
    /// The file is not a replica.
    #[error("field `format` is {0:?}, expected {REPLICA_FORMAT:?}")]
    Format(String),
    /// Written by another version.
    #[error("field `version` is {0}, this program reads version {REPLICA_VERSION}")]
    Version(u32),
    /// An upward direction of another length than 1.
    #[error("field `up.direction` is no unit vector")]
    Up,
    /// Inconsistent parts.
    #[error("part {part}: {reason}")]
    Part {
        /// Index in `parts`.
        part: usize,
        /// What is wrong.
        reason: String,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Limits {
    lower: f64,
    upper: f64,
}

/// A joint in the form of `replica.json`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointRecord {
    #[serde(rename = "type")]
    kind: JointKind,
    axis: [f64; 3],
    origin: [f64; 3],
    #[serde(default, skip_serializing_if = "is_zero")]
    pitch: f64,
    state_values: PerState<f64>,
    limits: Limits,
}

fn is_zero(v: &f64) -> bool {
    *v == 0.0
}

impl From<Joint> for JointRecord {
    fn from(j: Joint) -> Self {
        Self {
            kind: j.kind,
            axis: j.axis.to_array(),
            origin: j.origin.to_array(),
            pitch: j.pitch,
            state_values: j.state_values,
            limits: Limits { lower: j.limits[0], upper: j.limits[1] },
        }
    }
}

impl From<JointRecord> for Joint {
    fn from(r: JointRecord) -> Self {
        Self {
            kind: r.kind,
            axis: DVec3::from_array(r.axis),
            origin: DVec3::from_array(r.origin),
            pitch: r.pitch,
            state_values: r.state_values,
            limits: [r.limits.lower, r.limits.upper],
        }
    }
}

/// Another joint that explains what was seen of a part nearly as well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Alternative {
    /// The joint.
    pub joint: JointRecord,
    /// How much worse it explains the part, as a share of the part's evidence; 0: as well.
    pub cost: f64,
    /// What it means for the part, one sentence.
    pub what: String,
    /// What further capture would decide, one sentence; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub advice: String,
}

impl Alternative {
    /// An alternative with the origin of its joint near `point`, world frame.
    pub fn near(found: &JointAlternative, point: DVec3) -> Self {
        let JointAlternative { cost, what, advice, .. } = found.clone();
        Self { joint: found.joint_near(point).into(), cost, what, advice }
    }

    /// The joint.
    pub fn joint(&self) -> Joint {
        self.joint.into()
    }
}

/// One rigid part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Part {
    /// Position in `parts`; 0 is the static part.
    pub id: usize,
    /// `base` or `part_1`, ...
    pub name: String,
    /// Parent part; none for the base.
    pub parent: Option<usize>,
    /// Joint to the parent; none for the base.
    pub joint: Option<JointRecord>,
    /// Joint confidence, 0 to 1: the probability that the joint is correct (type, axis to 5 degrees, place to 5 % of the part's size,
    /// motion to 5 % of the true motion or of the part's size), from its fit, its visibility and the margin to the best different motion. None if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
    /// How far the joint may be off if its type is right; none if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<JointInterval>,
    /// Other joints that explain it nearly as well, the most likely first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alternatives: Vec<Alternative>,
    /// Meshes in world coordinates of each state.
    pub meshes: PerState<String>,
}

/// An articulated object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Replica {
    /// Always [`REPLICA_FORMAT`].
    pub format: String,
    /// Always [`REPLICA_VERSION`].
    pub version: u32,
    /// Names of the states.
    pub states: [String; 2],
    /// Meshes of the whole object.
    pub whole: PerState<String>,
    /// Motion from the world of each state's recording into the world of the replica, where the states were recorded in
    /// worlds of their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<PerState<Rigid>>,
    /// What these motions leave, because poses were refined one by one; none where that is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame_errors: Option<PerState<FrameError>>,
    /// Which way is up; none where nothing was found out about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<Upward>,
    /// Parts, the static one first.
    pub parts: Vec<Part>,
}

impl Replica {
    /// A replica whose meshes lie at the standard paths `meshes/STATE/{whole,part_I}.ply`.
    /// `joints[i]` belongs to part `i + 1`; the parent of every part is the base.
    pub fn new(joints: &[Joint]) -> Self {
        let file = |name: &str| PerState::from_fn(|state| format!("meshes/{}/{name}.ply", state.name()));
        let part = |id: usize| Part {
            id,
            name: if id == 0 { "base".into() } else { format!("part_{id}") },
            parent: (id > 0).then_some(0),
            joint: (id > 0).then(|| joints[id - 1].into()),
            confidence: None,
            interval: None,
            alternatives: Vec::new(),
            meshes: file(&format!("part_{id}")),
        };
        Self {
            format: REPLICA_FORMAT.into(),
            version: REPLICA_VERSION,
            states: State::ALL.map(|state| state.name().into()),
            whole: file("whole"),
            frames: None,
            frame_errors: None,
            up: None,
            parts: (0..=joints.len()).map(part).collect(),
        }
    }

    /// Joint of a part, if it has one.
    pub fn joint(&self, part: usize) -> Option<Joint> {
        self.parts.get(part)?.joint.map(Joint::from)
    }

    /// Motion of a part from start to end in the world: the motion of its joint, then those of its ancestors. The
    /// joint is in its position at the start state; parts without a joint do not move.
    pub fn world_motion(&self, part: usize) -> Rigid {
        let own = self.joint(part).map_or(Rigid::IDENTITY, |joint| joint.start_to_end());
        // In valid replicas a parent precedes its children, so the recursion ends.
        match self.parts.get(part).and_then(|p| p.parent).filter(|parent| *parent < part) {
            Some(parent) => self.world_motion(parent) * own,
            None => own,
        }
    }

    /// Motion of a part from where it is at the start to where it is when every joint has its value of `values` (radians or
    /// scene units; `values[k]` is of part `k`, the value of part 0 is ignored), world frame. Missing values are those of the
    /// start.
    pub fn pose(&self, part: usize, values: &[f64]) -> Rigid {
        let own = self.joint(part).map_or(Rigid::IDENTITY, |joint| {
            let start = joint.state_values[State::START];
            joint.motion(values.get(part).map_or(0.0, |value| value - start))
        });
        // In valid replicas a parent precedes its children, so the recursion ends.
        match self.parts.get(part).and_then(|p| p.parent).filter(|parent| *parent < part) {
            Some(parent) => self.pose(parent, values) * own,
            None => own,
        }
    }

    /// Motion of a part from the start to `state` in the world; the identity for the start.
    pub fn motion_to(&self, part: usize, state: State) -> Rigid {
        if state == State::START { Rigid::IDENTITY } else { self.world_motion(part) }
    }

    /// Checks format, version, numbering, parents, and that every joint is finite with a unit axis and ordered limits.
    pub fn validate(&self) -> Result<(), ReplicaError> {
        if self.format != REPLICA_FORMAT {
            return Err(ReplicaError::Format(self.format.clone()));
        }
        if self.version != REPLICA_VERSION {
            return Err(ReplicaError::Version(self.version));
        }
        if self.up.is_some_and(|up| !up.direction.is_normalized()) {
            return Err(ReplicaError::Up);
        }
        for (index, part) in self.parts.iter().enumerate() {
            let fail = |reason: &str| Err(ReplicaError::Part { part: index, reason: reason.into() });
            if part.id != index {
                return fail("field `id` is not its position in `parts`");
            }
            if !is_name(&part.name) {
                return fail("field `name` must be 1 to 100 characters without `/`, `\\` and control characters");
            }
            if self.parts[..index].iter().any(|other| other.name == part.name) {
                return fail("field `name` is that of another part");
            }
            if part.parent.is_some_and(|p| p >= index) {
                return fail("field `parent` must name an earlier part");
            }
            if part.parent.is_some() != part.joint.is_some() {
                return fail("fields `parent` and `joint` must be given together");
            }
            if part.confidence.is_some_and(|c| !(0.0..=1.0).contains(&c)) {
                return fail("field `confidence` is not between 0 and 1");
            }
            if part.joint.is_none() && !part.alternatives.is_empty() {
                return fail("field `alternatives` is of a part without a joint");
            }
            if part.alternatives.iter().any(|other| !other.cost.is_finite()) {
                return fail("field `cost` is not finite");
            }
            for joint in self.joint(index).into_iter().chain(part.alternatives.iter().map(Alternative::joint)) {
                fault(&joint).map_or(Ok(()), fail)?;
            }
        }
        Ok(())
    }
}

/// Names become parts of the names of files.
fn is_name(name: &str) -> bool {
    let usable = |c: char| !c.is_control() && c != '/' && c != '\\';
    (1..=100).contains(&name.chars().count()) && !name.trim_matches(['.', ' ']).is_empty() && name.chars().all(usable)
}

/// Largest coordinate and value of a joint.
const LARGEST: f64 = 1e9;

/// What is wrong with the numbers of a joint.
fn fault(joint: &Joint) -> Option<&'static str> {
    let values = || joint.state_values.iter().chain(&joint.limits);
    if !joint.axis.is_finite() || !joint.origin.is_finite() || !joint.pitch.is_finite() {
        Some("field `joint` has a number that is not finite")
    } else if values().copied().any(|v: f64| !v.is_finite()) {
        Some("fields `state_values` and `limits` must be finite")
    } else if joint.origin.abs().max_element() > LARGEST || values().copied().any(|v| v.abs() > LARGEST) {
        Some("field `joint` has a number above 1e9: `origin`, `state_values` or `limits`")
    } else if (joint.axis.length() - 1.0).abs() > 1e-3 {
        Some("field `axis` is not a unit vector")
    } else if joint.limits[0] > joint.limits[1] {
        Some("field `limits` has lower above upper")
    } else if joint.state_values.iter().any(|value| !within(*value, joint.limits)) {
        Some("field `limits` does not contain the `state_values`")
    } else {
        None
    }
}

/// True for values between the limits, or beside them by rounding.
fn within(value: f64, [lower, upper]: [f64; 2]) -> bool {
    let slack = 1e-6 * (1.0 + lower.abs().max(upper.abs()));
    value >= lower - slack && value <= upper + slack
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Replica {
        let hinge = Rigid::about(DVec3::Z, DVec3::new(0.1, 0.2, 0.0), 0.7);
        Replica::new(&[Joint::from_motion(JointKind::Revolute, &hinge)])
    }

    #[test]
    fn a_fresh_replica_is_valid() {
        assert_eq!(sample().validate(), Ok(()));
    }

    #[test]
    fn a_drawer_in_a_door_slides_and_moves_with_the_door() {
        let slide = Joint::from_motion(JointKind::Prismatic, &Rigid::shift(DVec3::new(0.0, 0.2, 0.0)));
        let hinge = sample().joint(1).unwrap();
        let mut r = Replica::new(&[hinge, slide]);
        r.parts[2].parent = Some(1);
        let x = DVec3::new(0.5, 0.6, 0.7);
        let expected = hinge.start_to_end().apply(x + DVec3::new(0.0, 0.2, 0.0));
        assert!((r.world_motion(2).apply(x) - expected).length() < 1e-12);
        assert_eq!((r.world_motion(0), r.world_motion(9)), (Rigid::IDENTITY, Rigid::IDENTITY));
        let values = [f64::NAN, hinge.state_values[State::END], 0.2];
        assert!((r.pose(2, &values).apply(x) - expected).length() < 1e-12);
        assert!((r.pose(2, &[]).apply(x) - x).length() < 1e-12);
    }

    #[test]
    fn bad_axis_version_and_numbers_are_refused() {
        let mut r = sample();
        r.version = 7;
        assert_eq!(r.validate(), Err(ReplicaError::Version(7)));
        let mut r = sample();
        r.parts[1].confidence = Some(1.5);
        assert!(matches!(r.validate(), Err(ReplicaError::Part { part: 1, .. })));
        let mut other = sample().joint(1).unwrap();
        other.axis = DVec3::ZERO;
        let alternative = Alternative { joint: other.into(), cost: 0.1, what: String::new(), advice: String::new() };
        let mut r = sample();
        r.parts[1].alternatives.push(alternative);
        assert!(matches!(r.validate(), Err(ReplicaError::Part { part: 1, .. })));
        r.parts[1].alternatives[0].joint = sample().parts[1].joint.unwrap();
        assert_eq!(r.validate(), Ok(()));
        r.parts[1].alternatives[0].cost = f64::NAN;
        assert!(matches!(r.validate(), Err(ReplicaError::Part { part: 1, .. })));
        for edit in [
            (|j: &mut Joint| j.axis = DVec3::ZERO) as fn(&mut Joint),
            |j| j.limits[1] = f64::NAN,
            |j| j.limits = [1.0, 0.0],
            |j| j.origin.x = f64::INFINITY,
        ] {
            let mut r = sample();
            let mut joint = r.joint(1).unwrap();
            edit(&mut joint);
            r.parts[1].joint = Some(joint.into());
            assert!(matches!(r.validate(), Err(ReplicaError::Part { part: 1, .. })));
        }
    }
}
