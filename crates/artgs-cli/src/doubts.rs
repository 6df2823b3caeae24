//! What is doubtful about the joints of a result, one line per part, for people.

use artgs::discover::Discovery;
use artgs::run::DOUBTFUL;
use artgs_core::{Alternative, Joint, JointKind, Replica};
use glam::DVec3;

/// Lines on the parts of a replica; empty if none is uncertain.
pub(crate) fn of_replica(replica: &Replica) -> String {
    let line = |(number, part): (usize, &artgs_core::replica::Part)| {
        line(number, &replica.joint(number)?, part.confidence, &part.alternatives)
    };
    replica.parts.iter().enumerate().filter_map(line).collect()
}

/// Lines on found parts before training.
pub(crate) fn of_found(found: &Discovery) -> String {
    let line = |(k, part): (usize, &artgs_core::JointEstimate)| {
        let others = found.alternatives.get(k).into_iter().flatten();
        let others: Vec<Alternative> = others.map(|other| Alternative::near(other, DVec3::ZERO)).collect();
        line(k + 1, &part.joint_near(&found.parts, DVec3::ZERO), part.confidence, &others)
    };
    found.parts.iter().enumerate().filter_map(line).collect()
}

/// The line on a part; none if it is certain.
fn line(number: usize, joint: &Joint, confidence: Option<f64>, others: &[Alternative]) -> Option<String> {
    let low = confidence.filter(|c| *c < DOUBTFUL);
    if low.is_none() && others.is_empty() {
        return None;
    }
    // Joints that differ in their places only are described with these.
    let alike = |other: &Alternative| {
        other.joint().kind == joint.kind
            && other.joint().axis.dot(joint.axis).abs() > ALIKE
            && joint.kind != JointKind::Prismatic
    };
    let described = |j: &Joint| described(j, others.iter().any(alike));
    let mut text = format!("part {number} is uncertain: {}", described(joint));
    if let Some(confidence) = low {
        text.push_str(&format!(", confidence {confidence:.2}"));
    }
    for other in others {
        text.push_str(&format!("; or {}: {}", described(&other.joint()), other.what.trim_end_matches('.')));
    }
    let mut advice: Vec<&str> =
        others.iter().map(|o| o.advice.trim_end_matches('.')).filter(|a| !a.is_empty()).collect();
    advice.dedup();
    if advice.is_empty() {
        advice.push("artgs view shows it");
    }
    for sentence in advice {
        text.push_str(&format!(". {sentence}"));
    }
    Some(text + "\n")
}

/// Cosine of the angle between axes above which they look equal when they are printed: 5 degrees.
const ALIKE: f64 = 0.996;

/// Type and axis, and on request a point of the axis.
fn described(joint: &Joint, with_place: bool) -> String {
    let by = if joint.kind == JointKind::Prismatic { "along" } else { "about" };
    // No -0.00 in the text.
    let vector = |v: DVec3| {
        let [x, y, z] = v.to_array().map(|v| if v.abs() < 0.005 { 0.0 } else { v });
        format!("({x:.2}, {y:.2}, {z:.2})")
    };
    let place = if with_place { format!(" through {}", vector(joint.origin)) } else { String::new() };
    format!("{} {by} {}{place}", joint.kind.name(), vector(joint.axis))
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{JointAlternative, JointEstimate, Rigid};

    #[test]
    fn only_uncertain_parts_have_a_line_with_what_they_could_be() {
        let part = |confidence| JointEstimate {
            confidence,
            ..JointEstimate::new(JointKind::Revolute, Rigid::about(DVec3::Z, DVec3::ZERO, 0.3))
        };
        let other = JointAlternative {
            kind: JointKind::Prismatic,
            motion: Rigid::shift(DVec3::new(0.0, -0.25, 0.0)),
            cost: 0.1,
            what: "it slides.".into(),
            advice: "Open it further.".into(),
        };
        let parts = vec![part(Some(0.9)), part(Some(0.3)), part(None), part(Some(0.4))];
        let found = Discovery {
            parts,
            alternatives: vec![vec![], vec![], vec![other.clone()], vec![other]],
            ..Discovery::default()
        };
        let text = of_found(&found);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines,
            [
                "part 2 is uncertain: revolute about (0.00, 0.00, 1.00), confidence 0.30. artgs view shows it",
                "part 3 is uncertain: revolute about (0.00, 0.00, 1.00); or prismatic along (0.00, -1.00, 0.00): \
                 it slides. Open it further",
                "part 4 is uncertain: revolute about (0.00, 0.00, 1.00), confidence 0.40; or prismatic along \
                 (0.00, -1.00, 0.00): it slides. Open it further",
            ]
        );
        let beside = JointAlternative {
            kind: JointKind::Revolute,
            motion: Rigid::about(DVec3::Z, DVec3::X, 0.3),
            cost: 0.1,
            what: "it turns.".into(),
            advice: String::new(),
        };
        let place = Alternative::near(&beside, DVec3::ZERO);
        let text = line(1, &found.parts[0].joint_near(&found.parts, DVec3::ZERO), None, &[place]).unwrap();
        assert!(text.contains("(0.00, 0.00, 1.00) through (0.00, 0.00, 0.00); or revolute"), "{text}");
        assert!(text.contains("(0.00, 0.00, 1.00) through (1.00, 0.00, 0.00): it turns"), "{text}");
        let joints: Vec<Joint> = found.parts.iter().map(|p| p.joint_near(&found.parts, DVec3::ZERO)).collect();
        let mut replica = Replica::new(&joints);
        for (part, found) in replica.parts[1..].iter_mut().zip(&found.parts) {
            part.confidence = found.confidence;
        }
        assert_eq!(of_replica(&replica).lines().count(), 2);
    }
}
