//! Saved corrections that are not applied to the shown replica; the page loads them into its controls.

use artgs_io::Corrections;

/// The inverse of [`Corrections::after`]: the corrections that, applied after `earlier`, result in `all`. Parts are numbered
/// as they remain of `found` movable parts after `earlier`. None if there are none, for example if a user removed one of
/// `earlier` from the file.
pub(crate) fn pending(all: &Corrections, earlier: &Corrections, found: usize) -> Option<Corrections> {
    let further = all.centres.strip_prefix(earlier.centres.as_slice())?;
    let known = found + earlier.centres.iter().filter(|e| e.adds_part()).count();
    let left: Vec<usize> =
        (1..=known).filter(|p| earlier.centres.iter().all(|e| e.removed_part() != Some(*p))).collect();
    let renumber = |part: usize| match part.checked_sub(known + 1) {
        Some(added) => Some(left.len() + 1 + added),
        None => left.iter().position(|p| *p == part).map(|i| i + 1),
    };
    let centres = further.iter().map(|edit| edit.renumbered(renumber)).collect::<Option<_>>()?;
    let mut joints = Vec::new();
    for mark in all.joints.iter().filter(|mark| !earlier.joints.contains(mark)) {
        joints.push(artgs_io::JointMark { part: renumber(mark.part)?, ..*mark });
    }
    let mut classes = Vec::new();
    for mark in &all.classes {
        classes.push(artgs_io::ClassMark { part: renumber(mark.part)?, ..*mark });
    }
    let rest = Corrections { centres, joints, classes };
    (sorted(rest.after(earlier, found)) == sorted(all.clone())).then_some(rest)
}

/// The order of joints has no meaning.
fn sorted(mut corrections: Corrections) -> Corrections {
    corrections.joints.sort_by_key(|mark| mark.part);
    corrections.classes.sort_by_key(|mark| mark.part);
    corrections
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{JointKind, PartClass};
    use artgs_io::{CentreEdit, JointMark};

    #[test]
    fn is_the_inverse_of_after() {
        let at = |x: f64| [x, 0.0, 0.0];
        let mark = |part, kind| JointMark { part, kind, joint: None };
        let earlier = Corrections {
            centres: vec![CentreEdit::Delete { part: 1 }, CentreEdit::Add { position: at(1.0) }],
            joints: vec![mark(2, JointKind::Screw), mark(3, JointKind::Prismatic)],
            classes: vec![],
        };
        let later = Corrections {
            centres: vec![
                CentreEdit::Move { part: 3, position: at(2.0) },
                CentreEdit::Merge { part: 1, into: 2 },
                CentreEdit::Add { position: at(3.0) },
                CentreEdit::Split { part: 3, plane: None, points: vec![at(4.0)] },
                CentreEdit::Delete { part: 5 },
            ],
            joints: vec![mark(2, JointKind::Revolute), mark(3, JointKind::Screw)],
            classes: vec![artgs_io::ClassMark { part: 2, class: PartClass::Door }],
        };
        let all = later.after(&earlier, 3);
        assert_eq!(pending(&all, &earlier, 3), Some(later.clone()));
        assert_eq!(pending(&earlier, &earlier, 3), Some(Corrections::default()));
        assert_eq!(pending(&later, &Corrections::default(), 3), Some(later));
        // Later corrections cannot withdraw a centre or a joint of earlier ones.
        let fewer = Corrections { centres: vec![], ..earlier.clone() };
        assert_eq!(pending(&fewer, &earlier, 3), None);
        let unmarked = Corrections { joints: vec![mark(2, JointKind::Screw)], ..earlier.clone() };
        assert_eq!(pending(&unmarked, &earlier, 3), None);
        let gone = Corrections { joints: vec![mark(1, JointKind::Screw)], ..earlier.clone() };
        assert_eq!(pending(&gone, &earlier, 3), None);
    }
}
