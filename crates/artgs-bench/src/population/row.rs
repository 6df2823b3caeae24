//! One object of the population and what became of it.

use serde::{Deserialize, Serialize};

/// How the run of an object ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// There is a result, which was scored.
    #[default]
    Done,
    /// The program refused the capture (exit code 2).
    Refused,
    /// The run or its scoring failed, or ran into the time limit.
    Failed,
}

/// One object: what it is, what was found, and how far that is right. A refused or failed object is wrong.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Row {
    /// Seed of `artgs synth --random`.
    pub seed: u64,
    /// What the object is, such as `cabinet` or `desk-lamp`; empty if it could not be made.
    pub category: String,
    /// `exact` for a capture with masks and exact depth, else the device of the room.
    pub sensor: String,
    /// Properties of object and recording that results are grouped by, such as `look-alike`, sorted.
    pub features: Vec<String>,
    /// How the run ended.
    pub status: Status,
    /// Why it was refused or failed; empty if done.
    pub reason: String,
    /// False if the views cannot decide between the truth and another answer, and for an object that could not be made.
    pub decidable: bool,
    /// Why, one entry for each reason: `equal-motion`, `unseen`, `revolution`.
    pub undecidable: Vec<String>,
    /// True number of movable parts.
    pub parts_true: u32,
    /// Number of movable parts found.
    pub parts_found: u32,
    /// True movable parts that no found part covers.
    pub missing: u32,
    /// Found movable parts that cover no true one.
    pub extra: u32,
    /// The number of parts is right, and each true part is covered by one found part of its own.
    pub count_right: bool,
    /// `count_right`, and all joint types are right.
    pub types_right: bool,
    /// `count_right`, and all parents are right.
    pub parents_right: bool,
    /// Number, types and parents are right; of an undecidable object also if they are so in an alternative of the result, and no joint
    /// with a confidence above 0.9 is wrong.
    pub right: bool,
    /// `right`, and every joint is correct.
    pub joints_right: bool,
    /// One entry for each found part, in the order of the result.
    pub joints: Vec<JointRow>,
    /// Number of warnings.
    pub warnings: u32,
    /// Wall-clock time to make the capture, seconds.
    pub make_seconds: f64,
    /// Wall-clock time of the run, seconds.
    pub seconds: f64,
    /// Time of all processors together, seconds; 0 if unknown.
    pub cpu_seconds: f64,
    /// Largest resident memory of the run, MiB; 0 if unknown.
    pub peak_memory_mib: f64,
    /// Version of the program, such as `0.1.0 (5893882)`.
    pub program: String,
}

/// A found part and the true part that it covers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct JointRow {
    /// Position of the true part among the movable ones; none for an extra part.
    pub truth: Option<u32>,
    /// Joint type found: `revolute`, `prismatic` or `screw`.
    pub kind: String,
    /// True joint type; empty for an extra part.
    pub kind_true: String,
    /// Intersection over union of the surface points of both.
    pub overlap: f64,
    /// Angle between the axes, degrees; none for an extra part or a wrong type.
    pub axis_deg: Option<f64>,
    /// Distance between the axes, share of the diagonal of the true part; none where the axis has no position.
    pub position: Option<f64>,
    /// Error of the motion, share of the true motion.
    pub motion: Option<f64>,
    /// Error of the direction of the axis as a share of the half width of its 95 % interval: at most 1 if the interval holds the truth.
    /// None where the error or the interval is unknown.
    pub axis_of_interval: Option<f64>,
    /// The same of its position,
    pub position_of_interval: Option<f64>,
    /// and of the motion.
    pub motion_of_interval: Option<f64>,
    /// Confidence, 0 to 1.
    pub confidence: Option<f64>,
    /// The joint is correct: its part covers a true one, type right, axis to 5 degrees, position to 5 % of the size of the part, motion to
    /// 5 % of the true motion or of the size of the part (the definition of confidence). The size is the diagonal of the box around the
    /// true part. The error of a motion against the size is the largest distance by which it moves a point of the part.
    pub correct: bool,
}

impl Row {
    /// False if the object could not be made: then nothing is known about it.
    pub fn is_made(&self) -> bool {
        self.status != Status::Failed || !self.category.is_empty()
    }
}
