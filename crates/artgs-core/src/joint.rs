//! One-degree-of-freedom joints between a part and the part that carries it, in the world frame of the start state.

use crate::{PerState, Rigid, State};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// How a part moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JointKind {
    /// Turns about a line; values in radians.
    Revolute,
    /// Slides along a direction; values in scene units.
    Prismatic,
    /// Turns about a line while sliding along it; values in radians.
    Screw,
}

impl JointKind {
    /// Its name in files and messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Revolute => "revolute",
            Self::Prismatic => "prismatic",
            Self::Screw => "screw",
        }
    }

    /// Numbers that describe a joint of this kind and one motion on it: a direction and a length; an axis, its place and an angle; both.
    pub const fn numbers(self) -> u8 {
        match self {
            Self::Prismatic => 3,
            Self::Revolute => 5,
            Self::Screw => 6,
        }
    }
}

/// A joint with the values it has in the two observed states.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// How the part moves.
    pub kind: JointKind,
    /// Unit axis, world frame.
    pub axis: DVec3,
    /// A point of the axis, world frame; for prismatic joints any point, by custom one near the part.
    pub origin: DVec3,
    /// Slide along the axis per radian, scene units; 0 unless `kind` is `Screw`.
    pub pitch: f64,
    /// Values in the observed states.
    pub state_values: PerState<f64>,
    /// Lower and upper limit.
    pub limits: [f64; 2],
}

impl Joint {
    /// Reads a joint of the given kind off the motion from start to end; the value is 0 at the start.
    /// What the kind cannot express (the turn of a prismatic, the slide of a revolute motion) is dropped.
    pub fn from_motion(kind: JointKind, start_to_end: &Rigid) -> Self {
        let screw = start_to_end.screw();
        let (axis, origin, value, pitch) = match kind {
            JointKind::Prismatic => {
                let t = start_to_end.translation;
                (t.normalize_or(DVec3::Z), DVec3::ZERO, t.length(), 0.0)
            }
            JointKind::Revolute => (screw.axis, screw.origin, screw.angle, 0.0),
            JointKind::Screw => (screw.axis, screw.origin, screw.angle, screw.slide / screw.angle.max(1e-12)),
        };
        Self { kind, axis, origin, pitch, state_values: PerState::new(0.0, value), limits: [0.0, value] }
    }

    /// Motion of the part when the joint goes by `amount` (radians or scene units).
    pub fn motion(&self, amount: f64) -> Rigid {
        match self.kind {
            JointKind::Prismatic => Rigid::shift(self.axis * amount),
            JointKind::Revolute => Rigid::about(self.axis, self.origin, amount),
            JointKind::Screw => {
                let m = Rigid::about(self.axis, self.origin, amount);
                Rigid { translation: m.translation + self.axis * (self.pitch * amount), ..m }
            }
        }
    }

    /// Motion of the part from the start to the end state.
    pub fn start_to_end(&self) -> Rigid {
        self.motion(self.state_values[State::END] - self.state_values[State::START])
    }

    /// The same joint with its origin slid along the axis to the point closest to `point`.
    pub fn with_origin_near(mut self, point: DVec3) -> Self {
        self.origin = match self.kind {
            JointKind::Prismatic => point,
            _ => self.origin + self.axis * self.axis.dot(point - self.origin),
        };
        self
    }
}

/// What is known of the joint of one movable part, from discovery to export.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointEstimate {
    /// Type of the joint.
    pub kind: JointKind,
    /// Motion of the part from start to end in the world: that of its joint, then that of the part that carries it.
    pub motion: Rigid,
    /// Part that carries this one, 0 for the static part. Parts are numbered from 1 in the order of their estimates.
    #[serde(default, skip_serializing_if = "is_base")]
    pub parent: usize,
    /// Root mean square distance between the registered surfaces, scene units; none where too little of the part was
    /// seen to register it.
    pub rms: Option<f64>,
    /// Joint confidence, 0 to 1: the probability that the joint is correct (type, axis to 5 degrees, place to 5 % of the part's size,
    /// motion to 5 % of the true motion or of the part's size), from its fit, its visibility and the margin to the best different motion. None if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
    /// How far the joint may be off if its type is right; none if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<JointInterval>,
}

/// How far a joint may be from the true one of the same type: half widths that hold in 95 of 100 joints each.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointInterval {
    /// Angle between the axes, degrees.
    pub axis_deg: f64,
    /// Distance between the axes near the part, scene units; none for prismatic joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position: Option<f64>,
    /// Motion from the start to the end: radians, for prismatic joints scene units.
    pub motion: f64,
}

impl JointEstimate {
    /// An estimate without measures of its quality, carried by the static part.
    pub fn new(kind: JointKind, motion: Rigid) -> Self {
        Self { kind, motion, parent: 0, rms: None, confidence: None, interval: None }
    }

    /// Joint to the part that carries this one, with value 0 and the world frame at the start, its origin near `point` (world
    /// frame, start). `parts` are the estimates of all parts. What the kind cannot express is dropped.
    pub fn joint_near(&self, parts: &[Self], point: DVec3) -> Joint {
        let Some(carrier) = self.carrier(parts) else {
            return Joint::from_motion(self.kind, &self.motion).with_origin_near(point);
        };
        let own = carrier.motion.inverse() * self.motion;
        // The shift where the part is: a small turn must not change it.
        let own = if self.kind == JointKind::Prismatic { Rigid::shift(own.apply(point) - point) } else { own };
        Joint::from_motion(self.kind, &own).with_origin_near(point)
    }

    /// The estimate of the part that carries this one; none for the static part.
    pub fn carrier<'a>(&self, parts: &'a [Self]) -> Option<&'a Self> {
        self.parent.checked_sub(1).and_then(|k| parts.get(k))
    }
}

fn is_base(part: &usize) -> bool {
    *part == 0
}

/// Another joint that explains what was seen of a part nearly as well as the one that was chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointAlternative {
    /// Type of the joint.
    pub kind: JointKind,
    /// Motion from start to end, world frame.
    pub motion: Rigid,
    /// How much worse it explains the part, as a share of the part's evidence; 0: as well.
    pub cost: f64,
    /// What it means for the part, one sentence.
    pub what: String,
    /// What further capture would decide between the two, one sentence; may be empty.
    #[serde(default)]
    pub advice: String,
}

impl JointAlternative {
    /// The joint, with value 0 at the start and its origin near `point` (world frame).
    pub fn joint_near(&self, point: DVec3) -> Joint {
        Joint::from_motion(self.kind, &self.motion).with_origin_near(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_reproduces_the_motion_it_was_read_from() {
        let x = DVec3::new(0.3, -0.4, 0.9);
        let axis = DVec3::new(1.0, 2.0, -1.0).normalize();
        let hinge = Rigid::about(axis, DVec3::new(0.2, 0.0, 0.5), 1.3);
        let slide = Rigid::shift(DVec3::new(0.0, -0.2, 0.1));
        let screw = Rigid { translation: hinge.translation + axis * 0.05, ..hinge };
        for (kind, m) in [(JointKind::Revolute, hinge), (JointKind::Prismatic, slide), (JointKind::Screw, screw)] {
            let joint = Joint::from_motion(kind, &m).with_origin_near(DVec3::new(5.0, 1.0, 2.0));
            assert!((joint.start_to_end().apply(x) - m.apply(x)).length() < 1e-12, "{kind:?}");
        }
    }

    #[test]
    fn the_joint_of_a_carried_part_is_the_one_against_its_carrier() {
        let door = Rigid::about(DVec3::Z, DVec3::new(0.4, 0.1, 0.0), 0.9);
        let middle = DVec3::new(0.7, 0.2, 0.3);
        let knob = Rigid::about(DVec3::Y, DVec3::new(0.8, 0.0, 0.3), 0.5);
        let slide = Rigid::shift(DVec3::new(0.0, -0.2, 0.0));
        for (kind, own) in [(JointKind::Revolute, knob), (JointKind::Prismatic, slide)] {
            let carried = JointEstimate { parent: 1, ..JointEstimate::new(kind, door * own) };
            let parts = [JointEstimate::new(JointKind::Revolute, door), carried];
            let joint = carried.joint_near(&parts, middle);
            assert!((joint.start_to_end().apply(middle) - own.apply(middle)).length() < 1e-12, "{kind:?}");
            assert!((joint.axis.cross(DVec3::Y)).length() < 1e-12, "{kind:?}: {joint:?}");
            // A part on the base keeps its motion.
            assert_eq!(
                parts[0].joint_near(&parts, middle).start_to_end(),
                Joint::from_motion(JointKind::Revolute, &door).with_origin_near(middle).start_to_end()
            );
        }
    }
}
