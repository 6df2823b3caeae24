//! `OUT/corrections.json`: what a person corrects after initialisation, in the page or by hand.
//!
//! ```json
//! {"format": "artgs-corrections", "version": 1,
//!  "centres": [{"action": "move", "part": 1, "position": [0.1, 0, 0.4]}, {"action": "add", "position": [0, 0, 1]},
//!              {"action": "delete", "part": 2}, {"action": "merge", "part": 3, "into": 1},
//!              {"action": "split", "part": 4, "plane": {"point": [0, 0, 0.3], "normal": [0, 0, 1]}}],
//!  "joints": [{"part": 1, "type": "revolute"},
//!             {"part": 4, "type": "prismatic", "joint": {"axis": [0, -1, 0], "origin": [0, 0, 0], "value": 0.2}}],
//!  "classes": [{"part": 1, "class": "door"}]}
//! ```
//! Positions are in the capture's frame and unit, parts at the start state; `part` is the `id` of the `replica.json` that
//! was made without corrections. Parts that are added, also by a split, have the numbers after those, in the order in which
//! they are added. Classes are applied by the next export, the others by the next run that resumes.

use crate::error::read_bytes;
use crate::{FileError, without_mark, write_atomic};
use artgs_core::{JointKind, PartClass};
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
    /// Classes of parts, at most one per part; exports use them.
    pub classes: Vec<ClassMark>,
}

/// A change of the part centres. Parts are movable ones, so counted from 1; added ones have the next numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// A part that is two; what is cut off is a new part. Exactly one of `plane` and `points` says where.
    Split {
        /// The part.
        part: usize,
        /// The new part is on the side that the normal points to.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        plane: Option<CutPlane>,
        /// Surface points of the new part, capture's frame and unit.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        points: Vec<[f64; 3]>,
    },
}

/// A plane that cuts a part at the start state, capture's frame and unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CutPlane {
    /// A point of the plane.
    pub point: [f64; 3],
    /// Perpendicular to it, of any length but 0.
    pub normal: [f64; 3],
}

impl CentreEdit {
    /// The part that does not exist after the edit.
    pub fn removed_part(&self) -> Option<usize> {
        match *self {
            Self::Delete { part } | Self::Merge { part, .. } => Some(part),
            Self::Add { .. } | Self::Move { .. } | Self::Split { .. } => None,
        }
    }

    /// True if the edit makes a new part, which has the next number.
    pub fn adds_part(&self) -> bool {
        matches!(self, Self::Add { .. } | Self::Split { .. })
    }

    /// The same edit of parts with other numbers; none if a part has no other number.
    pub fn renumbered(&self, number: impl Fn(usize) -> Option<usize>) -> Option<Self> {
        let mut edit = self.clone();
        for part in edit.part_numbers() {
            *part = number(*part)?;
        }
        Some(edit)
    }

    /// The parts that it names.
    fn part_numbers(&mut self) -> Vec<&mut usize> {
        match self {
            Self::Add { .. } => vec![],
            Self::Move { part, .. } | Self::Delete { part } | Self::Split { part, .. } => vec![part],
            Self::Merge { part, into } => vec![part, into],
        }
    }

    /// What is wrong with its numbers.
    fn fault(&self) -> Option<String> {
        let finite = |p: &[f64; 3]| p.iter().all(|x| x.is_finite());
        let coordinates = match self {
            Self::Add { position } | Self::Move { position, .. } => finite(position),
            Self::Merge { part, into } if part == into => return Some(format!("part {part} into itself")),
            Self::Delete { .. } | Self::Merge { .. } => true,
            Self::Split { plane, points, .. } if plane.is_some() != points.is_empty() => {
                return Some("a split has either a `plane` or `points`".into());
            }
            Self::Split { plane: Some(plane), .. } if plane.normal == [0.0; 3] => {
                return Some("`normal` has no direction".into());
            }
            Self::Split { plane, points, .. } => {
                plane.is_none_or(|p| finite(&p.point) && finite(&p.normal)) && points.iter().all(finite)
            }
        };
        (!coordinates).then(|| "a coordinate is not finite".into())
    }
}

/// The class that a part is known to have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassMark {
    /// The part.
    pub part: usize,
    /// What it is.
    pub class: PartClass,
}

/// The type that a joint is known to have, and where the joint is if that is known, too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointMark {
    /// The part that the joint moves.
    pub part: usize,
    /// How it moves.
    #[serde(rename = "type")]
    pub kind: JointKind,
    /// The joint, roughly: the part is registered again, beginning with it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint: Option<MarkedJoint>,
}

/// A joint at the start state, capture's frame and unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MarkedJoint {
    /// Direction of the axis, of any length but 0.
    pub axis: [f64; 3],
    /// A point of the axis.
    pub origin: [f64; 3],
    /// Motion from start to end about or along the axis, radians or scene units; if absent, as far as the part was found to
    /// move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Slide along the axis per radian of a screw, scene units.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pitch: f64,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl MarkedJoint {
    fn is_usable(&self) -> bool {
        let numbers = self.axis.iter().chain(&self.origin).chain(&self.value).chain([&self.pitch]);
        self.axis != [0.0; 3] && numbers.into_iter().all(|x| x.is_finite())
    }
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
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    classes: Vec<ClassMark>,
}

impl Corrections {
    /// From the text of the file; the error says which field is wrong.
    pub fn parse(text: &[u8]) -> Result<Self, String> {
        let Document { format, version, centres, joints, classes } =
            serde_json::from_slice(without_mark(text)?).map_err(|e| e.to_string())?;
        if format != FORMAT || version != VERSION {
            return Err(format!(
                "field `format` is {format:?} version {version}; expected {FORMAT:?} version {VERSION}"
            ));
        }
        let corrections = Self { centres, joints, classes };
        corrections.check()?;
        Ok(corrections)
    }

    /// The text of the file; an error if a position is not finite.
    pub fn text(&self) -> Result<String, FileError> {
        let Self { centres, joints, classes } = self.clone();
        let document = Document { format: FORMAT.into(), version: VERSION, centres, joints, classes };
        let unwritable = |reason: String| FileError::malformed(Path::new(CORRECTIONS_FILE), reason);
        self.check().map_err(unwritable)?;
        serde_json::to_string_pretty(&document).map(|t| t + "\n").map_err(|e| unwritable(e.to_string()))
    }

    /// True if nothing is changed.
    pub fn is_empty(&self) -> bool {
        self.centres.is_empty() && self.joints.is_empty() && self.classes.is_empty()
    }

    /// Those that change what a run computes: all but the classes.
    pub fn without_classes(self) -> Self {
        Self { classes: Vec::new(), ..self }
    }

    /// Number that a part has in a replica made with these corrections; none if they remove it.
    pub fn number_after(&self, part: usize) -> Option<usize> {
        let removed: Vec<usize> = self.centres.iter().filter_map(CentreEdit::removed_part).collect();
        let before = (1..part).filter(|other| removed.contains(other)).count();
        (!removed.contains(&part)).then(|| part - before)
    }

    /// These, which are of the parts that `earlier` ones left of `found` movable parts, as further ones of what was found.
    /// Numbers that are none stay none.
    pub fn after(&self, earlier: &Self, found: usize) -> Self {
        let added = |edits: &[CentreEdit]| edits.iter().filter(|e| e.adds_part()).count();
        let known = found + added(&earlier.centres);
        let removed = |edits: &[CentreEdit], part: usize| edits.iter().any(|e| e.removed_part() == Some(part));
        // Parts that are left, in the order in which a run numbers them, and then those that these add.
        let left: Vec<usize> = (1..=known).filter(|part| !removed(&earlier.centres, *part)).collect();
        let renumber = |part: usize| match part.checked_sub(1).map(|i| (i, left.get(i))) {
            None => 0,
            Some((_, Some(part))) => *part,
            Some((i, None)) => i - left.len() + known + 1,
        };
        let further = self.centres.iter().filter_map(|edit| edit.renumbered(|part| Some(renumber(part))));
        let centres: Vec<CentreEdit> = earlier.centres.iter().cloned().chain(further).collect();
        let marks: Vec<JointMark> = self.joints.iter().map(|m| JointMark { part: renumber(m.part), ..*m }).collect();
        let kept = |m: &&JointMark| !removed(&centres, m.part) && marks.iter().all(|new| new.part != m.part);
        let joints = earlier.joints.iter().filter(kept).copied().chain(marks.iter().copied()).collect();
        // The page sends all classes that are given.
        let class = |m: &ClassMark| ClassMark { part: renumber(m.part), ..*m };
        let classes = self.classes.iter().map(class).filter(|m| !removed(&centres, m.part)).collect();
        Self { centres, joints, classes }
    }

    /// Refuses parts that do not exist where `found` movable parts were found: numbers above those of found and added parts.
    pub fn check_parts(&self, found: usize) -> Result<(), String> {
        let mut known = found;
        let absent = |field: String, part: usize, known: usize| {
            Err(format!("field `{field}`: there is no part {part}, the largest number is {known}"))
        };
        for (i, edit) in self.centres.iter().enumerate() {
            if let Some(part) = edit.clone().part_numbers().into_iter().map(|part| *part).find(|part| *part > known) {
                return absent(format!("centres[{i}]"), part, known);
            }
            known += usize::from(edit.adds_part());
        }
        if let Some((i, mark)) = self.joints.iter().enumerate().find(|(_, mark)| mark.part > known) {
            return absent(format!("joints[{i}]"), mark.part, known);
        }
        match self.classes.iter().enumerate().find(|(_, mark)| mark.part > known) {
            Some((i, mark)) => absent(format!("classes[{i}]"), mark.part, known),
            None => Ok(()),
        }
    }

    /// Part numbers above 0, finite positions, no part changed after it was removed, one type per joint, axes with a
    /// direction.
    pub fn check(&self) -> Result<(), String> {
        let Self { centres, joints, classes } = self;
        if centres.len() > MOST || joints.len() > MOST || classes.len() > MOST {
            return Err(format!("more than {MOST} corrections"));
        }
        let mut removed: Vec<usize> = Vec::new();
        for (i, edit) in centres.iter().enumerate() {
            let wrong = |reason: String| Err(format!("field `centres[{i}]`: {reason}"));
            if let Some(fault) = edit.fault() {
                return wrong(fault);
            }
            let parts: Vec<usize> = edit.clone().part_numbers().into_iter().map(|part| *part).collect();
            if parts.contains(&0) {
                return wrong("part 0 is the static one and has no centre".into());
            }
            if let Some(part) = parts.iter().find(|p| removed.contains(p)) {
                return wrong(format!("part {part} was deleted or merged before"));
            }
            removed.extend(edit.removed_part());
        }
        for (i, mark) in joints.iter().enumerate() {
            if mark.part == 0 || removed.contains(&mark.part) || joints[..i].iter().any(|m| m.part == mark.part) {
                let part = mark.part;
                return Err(format!("field `joints[{i}]`: part {part} is static, deleted or named twice"));
            }
            if mark.joint.is_some_and(|joint| !joint.is_usable()) {
                return Err(format!("field `joints[{i}].joint`: `axis` has no direction, or a number is not finite"));
            }
        }
        for (i, ClassMark { part, .. }) in classes.iter().enumerate() {
            if *part == 0 || classes[..i].iter().any(|m| m.part == *part) {
                return Err(format!("field `classes[{i}]`: part {part} is static or named twice"));
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

    fn plane() -> CutPlane {
        CutPlane { point: [0.0, 0.1, 0.2], normal: [0.0, 0.0, -2.0] }
    }

    fn joint() -> MarkedJoint {
        MarkedJoint { axis: [0.0, 0.0, 1.0], origin: [0.1, 0.0, 0.0], value: Some(0.5), pitch: 0.01 }
    }

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
                CentreEdit::Split { part: 1, plane: Some(plane()), points: vec![] },
                CentreEdit::Split { part: 4, plane: None, points: vec![[0.5, 0.0, 1.0]] },
            ],
            joints: vec![
                JointMark { part: 1, kind: JointKind::Prismatic, joint: None },
                JointMark { part: 4, kind: JointKind::Screw, joint: Some(joint()) },
            ],
            classes: vec![ClassMark { part: 1, class: PartClass::SlidingDoor }],
        };
        write_corrections(dir.path(), &corrections).unwrap();
        assert_eq!(read_corrections(dir.path()).unwrap(), Some(corrections));
    }

    #[test]
    fn parts_that_do_not_exist_are_named() {
        let add = CentreEdit::Add { position: [0.0; 3] };
        let corrections = |centres| Corrections { centres, ..Corrections::default() };
        let check = |centres| corrections(centres).check_parts(2);
        assert!(check(vec![CentreEdit::Delete { part: 2 }, add.clone(), CentreEdit::Delete { part: 3 }]).is_ok());
        let text = check(vec![CentreEdit::Delete { part: 3 }, add]).unwrap_err();
        assert!(text.contains("centres[0]") && text.contains("part 3"), "{text}");
        let joints = vec![JointMark { part: 4, kind: JointKind::Screw, joint: None }];
        let text = Corrections { joints, ..Corrections::default() }.check_parts(2).unwrap_err();
        assert!(text.contains("joints[0]") && text.contains("part 4"), "{text}");
        let classes = vec![ClassMark { part: 5, class: PartClass::Lid }];
        let text = Corrections { classes, ..Corrections::default() }.check_parts(2).unwrap_err();
        assert!(text.contains("classes[0]") && text.contains("part 5"), "{text}");
    }

    #[test]
    fn later_ones_are_of_what_earlier_ones_left() {
        let at = |x: f64| [x, 0.0, 0.0];
        let mark = |part, kind| JointMark { part, kind, joint: None };
        let earlier = Corrections {
            centres: vec![CentreEdit::Delete { part: 1 }, CentreEdit::Add { position: at(1.0) }],
            joints: vec![mark(2, JointKind::Screw), mark(3, JointKind::Prismatic)],
            ..Corrections::default()
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
            classes: vec![ClassMark { part: 2, class: PartClass::Door }],
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
            classes: vec![ClassMark { part: 3, class: PartClass::Door }],
        };
        assert_eq!(both, expected);
        assert_eq!(both.check(), Ok(()));
        assert_eq!([1, 2, 3, 4].map(|part| both.number_after(part)), [None, None, Some(1), Some(2)]);
        assert!(both.without_classes().classes.is_empty());
        assert_eq!(Corrections::default().after(&earlier, 3), earlier);
        assert_eq!(later.after(&Corrections::default(), 3), later);
        let nobody = Corrections { centres: vec![CentreEdit::Delete { part: 0 }], ..Corrections::default() };
        assert!(nobody.after(&earlier, 3).check().is_err());
    }

    #[test]
    fn what_is_cut_off_is_a_further_part() {
        let split = |part| CentreEdit::Split { part, plane: Some(plane()), points: vec![] };
        let corrections = |centres| Corrections { centres, ..Corrections::default() };
        // Two were found; the split makes 3, which is then deleted by the number that the next run gives it.
        let earlier = corrections(vec![split(1)]);
        let later = corrections(vec![CentreEdit::Delete { part: 3 }, split(2), CentreEdit::Merge { part: 4, into: 1 }]);
        let both = later.after(&earlier, 2);
        let merged = CentreEdit::Merge { part: 4, into: 1 };
        assert_eq!(both.centres, [split(1), CentreEdit::Delete { part: 3 }, split(2), merged]);
        assert_eq!(both.check(), Ok(()));
        let marked = JointMark { part: 3, kind: JointKind::Screw, joint: Some(joint()) };
        let marks = Corrections { joints: vec![marked], ..Corrections::default() };
        assert_eq!(marks.after(&earlier, 2).joints, [marked]);
    }

    #[test]
    fn by_hand_and_wrong() {
        let parse = |body: &str| Corrections::parse(format!("{{\"format\":\"artgs-corrections\",{body}}}").as_bytes());
        let marked = parse(r#""version":1,"joints":[{"part":2,"type":"screw"}]"#).unwrap();
        assert_eq!(marked.joints, [JointMark { part: 2, kind: JointKind::Screw, joint: None }]);
        let split = r#""version":1,"centres":[{"action":"split","part":1,"points":[[0,0,1]]}],
            "joints":[{"part":2,"type":"revolute","joint":{"axis":[0,0,1],"origin":[0,0,0]}}]"#;
        let split = parse(split).unwrap();
        assert_eq!((split.centres[0].adds_part(), split.joints[0].joint.unwrap().value), (true, None));
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
            (r#""version":1,"centres":[{"action":"split","part":1}]"#, "either a `plane` or `points`"),
            (
                r#""version":1,"centres":[{"action":"split","part":1,"plane":{"point":[0,0,0],"normal":[0,0,0]}}]"#,
                "`normal` has no direction",
            ),
            (r#""version":1,"centres":[{"action":"split","part":0,"points":[[0,0,0]]}]"#, "part 0"),
            (
                r#""version":1,"joints":[{"part":1,"type":"screw","joint":{"axis":[0,0,0],"origin":[0,0,0]}}]"#,
                "`joints[0].joint`: `axis`",
            ),
            (r#""version":1,"classes":[{"part":1,"class":"gate"}]"#, "unknown variant `gate`"),
            (r#""version":1,"classes":[{"part":1,"class":"door"},{"part":1,"class":"lid"}]"#, "`classes[1]`: part 1"),
            (r#""version":1,"centers":[]"#, "unknown field `centers`"),
            (r#""version":1,"joints":[{"part":1,"type":"fixed"}]"#, "unknown variant `fixed`"),
            (r#""version":1,"joints":[{"part":1,"type":"screw"},{"part":1,"type":"screw"}]"#, "named twice"),
        ] {
            let message = parse(body).unwrap_err();
            assert!(message.contains(words), "{body}: {message}");
        }
    }
}
