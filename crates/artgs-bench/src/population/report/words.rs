//! What was found and what is true, in words.

use super::super::{JointRow, Row, Status};

/// Wrong joints that are described at most.
const JOINTS: usize = 4;

/// The name of a joint type for people.
pub(super) fn joint_type(kind: &str) -> String {
    match kind {
        "revolute" => "hinge".into(),
        "prismatic" => "slide".into(),
        "" => "no type".into(),
        other => other.into(),
    }
}

/// What an object ended with: `found 2 of 3 parts: 1 missing; joint 2 slide for hinge, confidence 0.93`.
pub(super) fn described(row: &Row) -> String {
    match row.status {
        Status::Refused => format!("refused: {}", reason(row)),
        Status::Failed => format!("failed: {}", reason(row)),
        Status::Done => {
            let mut facts = vec![parts(row)];
            let wrong = row.joints.iter().zip(1_usize..).filter(|(joint, _)| !joint.correct);
            let wrong: Vec<String> = wrong.map(|(joint, number)| described_joint(joint, number)).collect();
            let more = wrong.len().saturating_sub(JOINTS);
            facts.extend(wrong.into_iter().take(JOINTS));
            facts.extend((more > 0).then(|| format!("{more} more joints wrong")));
            facts.extend((row.count_right && !row.parents_right).then(|| "parents wrong".into()));
            facts.join("; ")
        }
    }
}

fn reason(row: &Row) -> &str {
    if row.reason.is_empty() { "no reason given" } else { &row.reason }
}

fn parts(row: &Row) -> String {
    let Row { parts_found: found, parts_true: all, missing, extra, .. } = *row;
    if row.count_right {
        return format!("found {found} of {all} parts");
    }
    let other = if found == all { ", split differently" } else { "" };
    let counts = [(missing, "missing"), (extra, "extra")];
    let counts: Vec<String> = counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
    let colon = if counts.is_empty() { "" } else { ": " };
    format!("found {found} of {all} parts{other}{colon}{}", counts.join(", "))
}

/// A joint that is not correct. Joint 1 is that of the first movable part.
fn described_joint(joint: &JointRow, number: usize) -> String {
    let kind = joint_type(&joint.kind);
    let what = if joint.truth.is_none() {
        format!("joint {number} {kind} of a part that covers no true one")
    } else if joint.kind != joint.kind_true {
        format!("joint {number} {kind} for {}", joint_type(&joint.kind_true))
    } else {
        let errors = [
            joint.axis_deg.map(|degrees| format!("axis {degrees:.1} degrees")),
            joint.position.map(|share| format!("position {:.0} %", 100.0 * share)),
            joint.motion.map(|share| format!("motion {:.0} %", 100.0 * share)),
        ];
        let errors: Vec<String> = errors.into_iter().flatten().collect();
        format!("joint {number} {kind} off by {}", if errors.is_empty() { "?".into() } else { errors.join(", ") })
    };
    format!("{what}, {}", joint.confidence.map_or("no confidence".into(), |c| format!("confidence {c:.2}")))
}

#[cfg(test)]
mod tests {
    use super::super::testing::{off, refused, right, wrong_type};
    use super::*;

    #[test]
    fn objects_in_words() {
        assert_eq!(described(&right(1)), "found 2 of 2 parts");
        assert_eq!(described(&refused(1)), "refused: OUT/1: nothing moved");
        assert_eq!(described(&wrong_type(1)), "found 2 of 2 parts; joint 2 slide for hinge, confidence 0.93");
        let off = described(&off(1));
        assert_eq!(
            off,
            "found 2 of 2 parts; joint 2 hinge off by axis 7.2 degrees, position 1 %, motion 2 %, confidence 0.80"
        );
        let few = Row { parts_true: 3, missing: 1, count_right: false, ..wrong_type(1) };
        assert_eq!(described(&few), "found 2 of 3 parts: 1 missing; joint 2 slide for hinge, confidence 0.93");
        let split = Row { missing: 1, extra: 1, count_right: false, joints: vec![], ..right(1) };
        assert_eq!(described(&split), "found 2 of 2 parts, split differently: 1 missing, 1 extra");
        let unknown = JointRow { confidence: None, ..JointRow::default() };
        let many = Row { parents_right: false, joints: vec![unknown; 6], ..right(1) };
        let text = described(&many);
        assert!(text.ends_with("2 more joints wrong; parents wrong"), "{text}");
        assert!(text.contains("joint 4 no type of a part that covers no true one, no confidence"), "{text}");
    }
}
