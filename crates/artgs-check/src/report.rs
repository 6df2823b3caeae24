//! What a check found, as data.

use crate::CheckOptions;
use artgs_core::JointKind;
use serde::Serialize;

/// Findings of a check. Metres, radians, kilograms, seconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CheckReport {
    /// What it was measured against.
    pub options: CheckOptions,
    /// Every file of `exports/` that describes the object or its Gaussians.
    pub formats: Vec<FormatFinding>,
    /// Links of the URDF.
    pub links: Vec<LinkFinding>,
    /// Joints of the URDF, driven one at a time.
    pub joints: Vec<JointFinding>,
    /// Both observed states, if a format tells them.
    pub states: Vec<StateFinding>,
    /// What was not looked at, and why. No failures.
    pub notes: Vec<String>,
    /// Number of problems.
    pub failures: usize,
}

/// A file of an export.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FormatFinding {
    /// Name of the format: that of the folder, or `usda`, `usdc`.
    pub format: String,
    /// The file, below the replica folder.
    pub file: String,
    /// Library that read it.
    pub reader: String,
    /// Bodies; the fixed root of URDF is none.
    pub links: usize,
    /// Joints that move.
    pub joints: usize,
    /// Meshes that are drawn.
    pub meshes: usize,
    /// Convex pieces to collide with.
    pub hulls: usize,
    /// Textures that could be decoded.
    pub textures: usize,
    /// Gaussians.
    pub splats: usize,
    /// What is wrong.
    pub problems: Vec<String>,
}

/// A link of the URDF.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LinkFinding {
    /// Its name.
    pub link: String,
    /// Kilograms.
    pub mass: f64,
    /// Principal moments of inertia, ascending, kg m^2.
    pub moments: [f64; 3],
    /// Convex pieces.
    pub hulls: usize,
    /// What is wrong.
    pub problems: Vec<String>,
}

/// A joint of the URDF.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointFinding {
    /// Its name.
    pub joint: String,
    /// The link it moves.
    pub link: String,
    /// How.
    pub kind: JointKind,
    /// Lower and upper limit.
    pub limits: [f64; 2],
    /// Where it stopped when driven towards each.
    pub stopped: [f64; 2],
    /// Whether that is the limit.
    pub reached: [bool; 2],
    /// Link that was in the way, where it was not reached; none if the force did not do.
    pub blocked_by: [Option<String>; 2],
    /// Force (N) or torque (N m) it was driven with.
    pub force: f64,
    /// Movement while held at each limit; none where it was not reached.
    pub drift: [Option<f64>; 2],
    /// Deepest penetration of two links across the limits and just beyond where the joint was stopped, the others at 0.
    pub penetration: f64,
    /// At which value.
    pub penetration_at: f64,
    /// Between which links.
    pub penetration_between: Option<[String; 2]>,
    /// Values in the observed states, if a format tells them.
    pub observed: Option<[f64; 2]>,
    /// What is wrong.
    pub problems: Vec<String>,
}

/// The object as it was observed, all joints at once.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StateFinding {
    /// `start` or `end`.
    pub state: String,
    /// Deepest penetration of two links.
    pub penetration: f64,
    /// Between which.
    pub between: Option<[String; 2]>,
    /// What is wrong.
    pub problems: Vec<String>,
}

impl CheckReport {
    /// Whether nothing is wrong.
    pub fn passed(&self) -> bool {
        self.failures == 0
    }

    pub(crate) fn count(&mut self) {
        let formats = self.formats.iter().map(|f| f.problems.len());
        let links = self.links.iter().map(|l| l.problems.len());
        let joints = self.joints.iter().map(|j| j.problems.len());
        let states = self.states.iter().map(|s| s.problems.len());
        self.failures = formats.chain(links).chain(joints).chain(states).sum();
    }
}
