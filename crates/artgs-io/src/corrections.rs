//! `OUT/corrections.json`: what a person corrects after initialisation, in the page or by hand.
//!
//! ```json
//! {"format": "artgs-corrections", "version": 1,
//!  "centres": [{"action": "move", "part": 1, "position": [0.1, 0, 0.4]}, {"action": "add", "position": [0, 0, 1]},
//!              {"action": "delete", "part": 2}, {"action": "merge", "part": 3, "into": 1}],
//!  "joints": [{"part": 1, "type": "revolute"}]}
//! ```
//! Positions are in the capture's frame and unit, parts at the start state; `part` is the `id` of the `replica.json` that
//! was made without corrections. Parts that are added have the numbers after those, in the order in which they are added.

use crate::error::read_bytes;
use crate::{FileError, write_atomic};
use artgs_core::JointKind;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Name of the file in a replica folder.
pub(crate) const CORRECTIONS_FILE: &str = "corrections.json";

const FORMAT: &str = "artgs-corrections";
const VERSION: u32 = 1;
/// More of either list is a mistake.
const MOST: usize = 256;

/// Changes of part centres, in the order in which they are made, and joint types that are known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Corrections {
    /// Changes of part centres.
    pub centres: Vec<CentreEdit>,
    /// Types of joints, at most one per part.
    pub joints: Vec<JointMark>,
}

/// A change of the part centres. Parts are movable ones, so counted from 1; added ones have the next numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "action", rename_all = "lowercase", deny_unknown_fields)]
pub enum CentreEdit {
    /// A part that was missed.
    Add {
        /// Its centre, capture's frame and unit.
        position: [f64; 3],
    },
    /// A part whose centre is elsewhere.
    Move {
        /// The part.
        part: usize,
        /// Its centre, capture's frame and unit.
        position: [f64; 3],
    },
    /// A part that is none.
    Delete {
        /// The part.
        part: usize,
    },
    /// Two parts that are one.
    Merge {
        /// The part that goes.
        part: usize,
        /// The part that stays and takes its points.
        into: usize,
    },
}

impl CentreEdit {
    /// The part that does not exist after the edit.
    pub fn removed_part(&self) -> Option<usize> {
        match *self {
            Self::Delete { part } | Self::Merge { part, .. } => Some(part),
            Self::Add { .. } | Self::Move { .. } => None,
        }
    }
}

/// The type that a joint is known to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointMark {
    /// The part that the joint moves.
    pub part: usize,
    /// How it moves.
    #[serde(rename = "type")]
    pub kind: JointKind,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    version: u32,
    #[serde(default)]
    centres: Vec<CentreEdit>,
    #[serde(default)]
    joints: Vec<JointMark>,
}

impl Corrections {
    /// From the text of the file; the error says which field is wrong.
    pub fn parse(text: &[u8]) -> Result<Self, String> {
        let Document { format, version, centres, joints } = serde_json::from_slice(text).map_err(|e| e.to_string())?;
        if format != FORMAT || version != VERSION {
            return Err(format!(
                "field `format` is {format:?} version {version}; expected {FORMAT:?} version {VERSION}"
            ));
        }
        let corrections = Self { centres, joints };
        corrections.check()?;
        Ok(corrections)
    }

    /// The text of the file; an error if a position is not finite.
    pub fn text(&self) -> Result<String, FileError> {
        let Self { centres, joints } = self.clone();
        let document = Document { format: FORMAT.into(), version: VERSION, centres, joints };
        let unwritable = |reason: String| FileError::malformed(Path::new(CORRECTIONS_FILE), reason);
        self.check().map_err(unwritable)?;
        serde_json::to_string_pretty(&document).map(|t| t + "\n").map_err(|e| unwritable(e.to_string()))
    }

    /// True if nothing is changed.
    pub fn is_empty(&self) -> bool {
        self.centres.is_empty() && self.joints.is_empty()
    }

    /// These, which are of the parts that `earlier` ones left of `found` movable parts, as further ones of what was found.
    /// Numbers that are none stay none.
    pub fn after(&self, earlier: &Self, found: usize) -> Self {
        let added = |edits: &[CentreEdit]| edits.iter().filter(|e| matches!(e, CentreEdit::Add { .. })).count();
        let known = found + added(&earlier.centres);
        let removed = |edits: &[CentreEdit], part: usize| edits.iter().any(|e| e.removed_part() == Some(part));
        // Parts that are left, in the order in which a run numbers them, and then those that these add.
        let left: Vec<usize> = (1..=known).filter(|part| !removed(&earlier.centres, *part)).collect();
        let renumber = |part: usize| match part.checked_sub(1).map(|i| (i, left.get(i))) {
            None => 0,
            Some((_, Some(part))) => *part,
            Some((i, None)) => i - left.len() + known + 1,
        };
        let further = self.centres.iter().map(|edit| match *edit {
            CentreEdit::Add { position } => CentreEdit::Add { position },
            CentreEdit::Move { part, position } => CentreEdit::Move { part: renumber(part), position },
            CentreEdit::Delete { part } => CentreEdit::Delete { part: renumber(part) },
            CentreEdit::Merge { part, into } => CentreEdit::Merge { part: renumber(part), into: renumber(into) },
        });
        let centres: Vec<CentreEdit> = earlier.centres.iter().copied().chain(further).collect();
        let marks: Vec<JointMark> =
            self.joints.iter().map(|m| JointMark { part: renumber(m.part), kind: m.kind }).collect();
        let kept = |m: &&JointMark| !removed(&centres, m.part) && marks.iter().all(|new| new.part != m.part);
        let joints = earlier.joints.iter().filter(kept).copied().chain(marks.iter().copied()).collect();
        Self { centres, joints }
    }

    /// Part numbers above 0, finite positions, no part changed after it was removed, one type per joint.
    pub fn check(&self) -> Result<(), String> {
        let Self { centres, joints } = self;
        if centres.len() > MOST || joints.len() > MOST {
            return Err(format!("more than {MOST} corrections"));
        }
        let mut removed: Vec<usize> = Vec::new();
        for (i, edit) in centres.iter().enumerate() {
            let wrong = |reason: String| Err(format!("field `centres[{i}]`: {reason}"));
            let (position, parts, goes) = match *edit {
                CentreEdit::Add { position } => (Some(position), vec![], None),
                CentreEdit::Move { part, position } => (Some(position), vec![part], None),
                CentreEdit::Delete { part } => (None, vec![part], Some(part)),
                CentreEdit::Merge { part, into } if part == into => return wrong(format!("part {part} into itself")),
                CentreEdit::Merge { part, into } => (None, vec![part, into], Some(part)),
            };
            if position.is_some_and(|p| p.iter().any(|x| !x.is_finite())) {
                return wrong("a coordinate is not finite".into());
            }
            if parts.contains(&0) {
                return wrong("part 0 is the static one and has no centre".into());
            }
            if let Some(part) = parts.iter().find(|p| removed.contains(p)) {
                return wrong(format!("part {part} was deleted or merged before"));
            }
            removed.extend(goes);
        }
        for (i, mark) in joints.iter().enumerate() {
            if mark.part == 0 || removed.contains(&mark.part) || joints[..i].iter().any(|m| m.part == mark.part) {
                let part = mark.part;
                return Err(format!("field `joints[{i}]`: part {part} is static, deleted or named twice"));
            }
        }
        Ok(())
    }
}

/// Reads `DIR/corrections.json`; none if there is no such file.
pub fn read_corrections(dir: &Path) -> Result<Option<Corrections>, FileError> {
    let path = dir.join(CORRECTIONS_FILE);
    if !path.exists() {
        return Ok(None);
    }
    Corrections::parse(&read_bytes(&path)?).map(Some).map_err(|reason| FileError::malformed(&path, reason))
}

/// Checks corrections and writes them as `DIR/corrections.json`.
pub fn write_corrections(dir: &Path, corrections: &Corrections) -> Result<(), FileError> {
    let path = dir.join(CORRECTIONS_FILE);
    corrections.check().map_err(|reason| FileError::malformed(&path, reason))?;
    write_atomic(&path, corrections.text()?.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip_and_absence() {
        let dir = tempfile::tempdir().unwrap();
        assert_eq!(read_corrections(dir.path()).unwrap(), None);
        let corrections = Corrections {
            centres: vec![
                CentreEdit::Move { part: 1, position: [0.1, -2.0, 1e-9] },
                CentreEdit::Add { position: [0.0; 3] },
                CentreEdit::Merge { part: 3, into: 1 },
                CentreEdit::Delete { part: 2 },
            ],
            joints: vec![JointMark { part: 1, kind: JointKind::Prismatic }],
        };
        write_corrections(dir.path(), &corrections).unwrap();
        assert_eq!(read_corrections(dir.path()).unwrap(), Some(corrections));
    }

    #[test]
    fn later_ones_are_of_what_earlier_ones_left() {
        let at = |x: f64| [x, 0.0, 0.0];
        let mark = |part, kind| JointMark { part, kind };
        let earlier = Corrections {
            centres: vec![CentreEdit::Delete { part: 1 }, CentreEdit::Add { position: at(1.0) }],
            joints: vec![mark(2, JointKind::Screw), mark(3, JointKind::Prismatic)],
        };
        // Three were found; left are 2, 3 and the added 4, which a run numbers 1, 2 and 3.
        let later = Corrections {
            centres: vec![
                CentreEdit::Move { part: 3, position: at(2.0) },
                CentreEdit::Merge { part: 1, into: 2 },
                CentreEdit::Add { position: at(3.0) },
                CentreEdit::Delete { part: 4 },
            ],
            joints: vec![mark(2, JointKind::Revolute), mark(3, JointKind::Screw)],
        };
        let both = later.after(&earlier, 3);
        let expected = Corrections {
            centres: vec![
                CentreEdit::Delete { part: 1 },
                CentreEdit::Add { position: at(1.0) },
                CentreEdit::Move { part: 4, position: at(2.0) },
                CentreEdit::Merge { part: 2, into: 3 },
                CentreEdit::Add { position: at(3.0) },
                CentreEdit::Delete { part: 5 },
            ],
            joints: vec![mark(3, JointKind::Revolute), mark(4, JointKind::Screw)],
        };
        assert_eq!(both, expected);
        assert_eq!(both.check(), Ok(()));
        assert_eq!(Corrections::default().after(&earlier, 3), earlier);
        assert_eq!(later.after(&Corrections::default(), 3), later);
        let nobody = Corrections { centres: vec![CentreEdit::Delete { part: 0 }], ..Corrections::default() };
        assert!(nobody.after(&earlier, 3).check().is_err());
    }

    #[test]
    fn by_hand_and_wrong() {
        let parse = |body: &str| Corrections::parse(format!("{{\"format\":\"artgs-corrections\",{body}}}").as_bytes());
        let marked = parse(r#""version":1,"joints":[{"part":2,"type":"screw"}]"#).unwrap();
        assert_eq!(marked.joints, [JointMark { part: 2, kind: JointKind::Screw }]);
        for (body, words) in [
            (r#""version":2"#, "version 2"),
            (r#""version":1,"centres":[{"action":"delete","part":0}]"#, "`centres[0]`: part 0"),
            (r#""version":1,"centres":[{"action":"merge","part":2,"into":2}]"#, "into itself"),
            (
                r#""version":1,"centres":[{"action":"delete","part":2},{"action":"merge","part":1,"into":2}]"#,
                "`centres[1]`: part 2 was deleted",
            ),
            (r#""version":1,"centres":[{"action":"move","part":1,"position":[0,0]}]"#, "invalid length"),
            (r#""version":1,"centres":[{"action":"move","part":1,"position":[0,0,1e999]}]"#, "out of range"),
            (r#""version":1,"centres":[{"action":"fly","part":1}]"#, "unknown variant `fly`"),
            (r#""version":1,"centers":[]"#, "unknown field `centers`"),
            (r#""version":1,"joints":[{"part":1,"type":"fixed"}]"#, "unknown variant `fixed`"),
            (r#""version":1,"joints":[{"part":1,"type":"screw"},{"part":1,"type":"screw"}]"#, "named twice"),
        ] {
            let message = parse(body).unwrap_err();
            assert!(message.contains(words), "{body}: {message}");
        }
    }
}
