//! What was found before training, as JSON for users.

use crate::discover::Discovery;
use artgs_core::{JointAlternative, JointInterval, JointKind};
use serde::Serialize;

/// Parts and warnings of a discovery.
#[derive(Debug, Serialize)]
pub struct FoundReport<'a> {
    /// Movable parts, part 1 first.
    parts: Vec<FoundPart<'a>>,
    warnings: &'a [String],
}

#[derive(Debug, Serialize)]
struct FoundPart<'a> {
    #[serde(rename = "type")]
    kind: JointKind,
    /// Number of the part that carries it; 0 is the static part.
    parent: usize,
    confidence: Option<f64>,
    interval: Option<JointInterval>,
    /// Other joints that explain it nearly as well.
    alternatives: &'a [JointAlternative],
}

impl<'a> FoundReport<'a> {
    /// Of what was found.
    pub fn new(found: &'a Discovery) -> Self {
        let part = |(k, part): (usize, &artgs_core::JointEstimate)| FoundPart {
            kind: part.kind,
            parent: part.parent,
            confidence: part.confidence,
            interval: part.interval,
            alternatives: found.alternatives.get(k).map_or(&[][..], Vec::as_slice),
        };
        Self { parts: found.parts.iter().enumerate().map(part).collect(), warnings: &found.warnings }
    }
}
