//! Findings of a check as data.

use crate::CheckOptions;
use artgs_core::{JointKind, PerState};
use serde::{Serialize, Serializer};

/// Findings of a check. Metres, radians, kilograms, seconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CheckReport {
    /// Thresholds of the check.
    pub options: CheckOptions,
    /// Files as `export.json` recorded them; none if it did not.
    pub files: Option<FilesFinding>,
    /// Every file of `exports/` that describes the object or its Gaussians.
    pub formats: Vec<FormatFinding>,
    /// Links of the URDF.
    pub links: Vec<LinkFinding>,
    /// Hulls of the links of the URDF, compared with the visual meshes.
    pub coverage: Vec<CoverageFinding>,
    /// Balls and boxes dropped into drawers and onto shelves.
    pub drops: Vec<DropFinding>,
    /// Fingers put behind handles.
    pub fingers: Vec<FingerFinding>,
    /// Joints of the URDF, driven one at a time.
    pub joints: Vec<JointFinding>,
    /// Visual meshes at the limits of the joints of the URDF, if the observed values are known.
    pub limits: Vec<LimitFinding>,
    /// The observed states, if a format contains them.
    pub states: Vec<StateFinding>,
    /// What was not checked, and why. Notes are no failures.
    pub notes: Vec<String>,
    /// Number of problems.
    pub failures: usize,
    /// Number of warnings, which do not fail the check.
    pub warnings: usize,
}

/// Exported files, compared with their digests in `export.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FilesFinding {
    /// Files that were written.
    pub written: usize,
    /// Files that are missing or altered, and whether the replica has changed since, one sentence each.
    pub problems: Vec<String>,
}

/// A file of an export.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FormatFinding {
    /// Name of the format: that of the folder, or `usda`, `usdc`.
    pub format: String,
    /// The file, below the replica folder.
    pub file: String,
    /// Library that reads it.
    pub reader: String,
    /// Bodies, without the fixed root of URDF.
    pub links: usize,
    /// Movable joints.
    pub joints: usize,
    /// Visual meshes.
    pub meshes: usize,
    /// Convex collision meshes.
    pub hulls: usize,
    /// Decoded textures.
    pub textures: usize,
    /// Gaussians.
    pub splats: usize,
    /// Problems, one sentence each.
    pub problems: Vec<String>,
    /// Rules of a profile that the format follows.
    pub rules: Vec<RuleFinding>,
}

/// Whether a rule holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It does.
    #[default]
    Passed,
    /// It does not, and that does not fail the check.
    Warning,
    /// It does not.
    Failed,
    /// It was not checked.
    Skipped,
}

/// What a rule asks of a file, a link or a joint, and what was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RuleFinding {
    /// Its name: of artgs, such as `joint.upper`, or of a profile, such as `NP.005`.
    pub id: String,
    /// The file, link, joint or state.
    pub subject: String,
    /// What was checked, in one sentence.
    pub checked: String,
    /// Whether it holds.
    pub verdict: Verdict,
    /// The measured value, if there is one.
    pub measured: Option<f64>,
    /// The largest value that is allowed, or the least one, if it is one number.
    pub limit: Option<f64>,
    /// True if `limit` is the least value.
    pub at_least: bool,
    /// Unit of both; empty for numbers of things and shares.
    pub unit: String,
    /// Why it does not hold or was not checked.
    pub note: String,
    /// What to do if it does not hold.
    pub remedy: String,
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
    /// Problems, one sentence each.
    pub problems: Vec<String>,
}

/// How well the hulls of a link match its visual mesh.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CoverageFinding {
    /// The link.
    pub link: String,
    /// Share of the visual surface that has a hull nearby.
    pub visual: f64,
    /// Share of the outer surface of the hulls that is near the visual mesh, or behind it.
    pub hulls: f64,
    /// Share of parallel rays along the three axes, from both sides, that meet no hull where they meet the visual mesh, ...
    pub missed: f64,
    /// ... and that meet a hull before the visual mesh.
    pub extra: f64,
    /// Side of the largest square of rays that meet no hull where they meet the visual mesh.
    pub hole: f64,
    /// The middle of that square, link frame; none without a hole.
    pub hole_at: Option<[f64; 3]>,
    /// The side of the largest such square through which another link passes, so that no hull can be there.
    pub passed: f64,
    /// The same for rays that meet a hull before the visual mesh.
    pub obstacle: f64,
    /// Volume of hulls in front of the visual mesh, cubic metres, ...
    pub phantom_volume: f64,
    /// ... and how far it reaches from the visual mesh.
    pub phantom_depth: f64,
    /// Where it is farthest from it, link frame; none without such volume.
    pub phantom_at: Option<[f64; 3]>,
    /// Pieces of the surface that lost their hull.
    pub lost: usize,
    /// Problems, one sentence each.
    pub problems: Vec<String>,
    /// What is not as it should be but does not fail the check, one sentence each.
    pub warnings: Vec<String>,
}

/// Balls and boxes dropped onto the flat places of a link.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DropFinding {
    /// The link.
    pub link: String,
    /// Flat places that face up, with room above.
    pub places: usize,
    /// Balls and boxes.
    pub dropped: usize,
    /// Those that start inside a hull, although nothing is drawn there.
    pub blocked: usize,
    /// Those that fall through.
    pub fell: usize,
    /// Those that sink more than 10 mm below the surface and stay there.
    pub sank: usize,
    /// Where those that fall through or sink were dropped, object's frame, joint of the link open if it slides.
    pub lost_at: Vec<[f64; 3]>,
    /// Problems, one sentence each.
    pub problems: Vec<String>,
    /// Findings that do not fail the check.
    pub warnings: Vec<String>,
}

/// Fingers put into the gaps behind the handles of a link: capsules 10 mm thick.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FingerFinding {
    /// The link.
    pub link: String,
    /// Places behind handles where the visual mesh leaves a gap of 15 mm or more, up to five per handle.
    pub gaps: usize,
    /// Those where a hull is in the way.
    pub blocked: usize,
    /// How deep hulls reach into a finger.
    pub deepest: f64,
    /// Problems, one sentence each: most places are blocked.
    pub problems: Vec<String>,
    /// What does not fail the check: a hand finds another place.
    pub warnings: Vec<String>,
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
    /// Value at which it stopped when driven towards each limit; none if the engine computed no finite value.
    pub stopped: [Option<f64>; 2],
    /// Whether each limit was reached.
    pub reached: [bool; 2],
    /// Link that blocked the joint before each limit; none if the limit was reached or the force was too small.
    pub blocked_by: [Option<String>; 2],
    /// Driving force (N) or torque (N m).
    pub force: f64,
    /// Largest motion while held at each limit; none if the limit was not reached.
    pub drift: [Option<f64>; 2],
    /// Deepest penetration of two links within the limits and just beyond the value at which the joint was stopped, other
    /// joints at 0.
    pub penetration: f64,
    /// Joint value of the deepest penetration.
    pub penetration_at: f64,
    /// Links of the deepest penetration.
    pub penetration_between: Option<[String; 2]>,
    /// Values in the observed states, if a format contains them.
    #[serde(serialize_with = "as_array")]
    pub observed: Option<PerState<f64>>,
    /// Problems, one sentence each.
    pub problems: Vec<String>,
}

/// The visual meshes of a link at the limits of its joint.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LimitFinding {
    /// Name of the joint.
    pub joint: String,
    /// How it moves.
    pub kind: Option<JointKind>,
    /// Lower and upper limit.
    pub limits: [f64; 2],
    /// Depth behind an observed surface at which a point is inside of a link, metres.
    pub depth: f64,
    /// Share of the observed surface of the link that is inside of one other link at each limit, and was not at the observed value nearest
    /// to it.
    pub inside: [f64; 2],
    /// Warnings, one sentence each. They are no problems: surfaces that were seen badly can be in the way of a right limit.
    pub warnings: Vec<String>,
}

/// The object in an observed state, all joints together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StateFinding {
    /// `start` or `end`.
    pub state: String,
    /// Deepest penetration of two links.
    pub penetration: f64,
    /// The two links.
    pub between: Option<[String; 2]>,
    /// Problems, one sentence each.
    pub problems: Vec<String>,
}

/// Writes `[start, end]` or null.
fn as_array<S: Serializer>(values: &Option<PerState<f64>>, serializer: S) -> Result<S::Ok, S::Error> {
    values.as_ref().map(PerState::as_slice).serialize(serializer)
}

impl CheckReport {
    /// True if there are no problems.
    pub fn passed(&self) -> bool {
        self.failures == 0
    }

    pub(crate) fn count(&mut self) {
        let files = self.files.iter().map(|f| f.problems.len());
        let formats = self.formats.iter().map(|f| f.problems.len());
        let links = self.links.iter().map(|l| l.problems.len());
        let coverage = self.coverage.iter().map(|c| c.problems.len());
        let drops = self.drops.iter().map(|d| d.problems.len());
        let fingers = self.fingers.iter().map(|f| f.problems.len());
        let joints = self.joints.iter().map(|j| j.problems.len());
        let states = self.states.iter().map(|s| s.problems.len());
        let warnings = self.coverage.iter().map(|c| &c.warnings).chain(self.drops.iter().map(|d| &d.warnings));
        let warnings = warnings.chain(self.fingers.iter().map(|f| &f.warnings));
        let warnings = warnings.chain(self.limits.iter().map(|l| &l.warnings));
        self.warnings = warnings.map(Vec::len).sum();
        self.failures = files
            .chain(formats)
            .chain(links)
            .chain(coverage)
            .chain(drops)
            .chain(fingers)
            .chain(joints)
            .chain(states)
            .sum();
    }
}
