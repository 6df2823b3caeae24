//! What is known of the world of a capture or replica: which way is up, and how well it lies to the worlds of recordings.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// How the upward direction is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum UpSource {
    /// The format of the recording states gravity.
    Format,
    /// A floor or the top of a table was recorded.
    Floor,
    /// Walls or a ceiling were recorded.
    Walls,
    /// A person gave it.
    Option,
    /// An axis of the world, because nothing says more.
    Assumed,
}

impl UpSource {
    /// Where it comes from, for people, after "up is ...".
    pub const fn words(self) -> &'static str {
        match self {
            Self::Format => "as the recording states",
            Self::Floor => "from the floor that was recorded",
            Self::Walls => "from the walls that were recorded",
            Self::Option => "as given",
            Self::Assumed => "assumed",
        }
    }
}

/// Direction opposite to gravity, and how it is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Upward {
    /// Unit vector, world frame.
    pub direction: DVec3,
    /// How it is known.
    pub source: UpSource,
    /// Certainty, 0 to 1; an export asks for the direction below [`Upward::CERTAIN`].
    pub confidence: f64,
}

impl Upward {
    /// Least certainty with which a direction is used without asking.
    pub const CERTAIN: f64 = 0.5;

    /// True if it may be used without asking.
    pub fn is_certain(&self) -> bool {
        self.confidence >= Self::CERTAIN
    }
}

/// What remains after a motion between two worlds that differ by more than a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameError {
    /// Root mean square distance of recorded surface points, scene units.
    pub shift: f64,
    /// Root mean square angle of cameras, radians.
    pub turn: f64,
}
