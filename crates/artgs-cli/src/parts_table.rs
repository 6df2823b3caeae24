//! The parts of a replica as a table for people: what moves how far, how certain that is, and what to look at.

use artgs::run::{DOUBTFUL, Reconstructed};
use artgs_core::{Joint, JointKind, Replica, State};

/// Joints of at least this confidence are correct in nearly all cases: see the reliability diagram in BENCHMARKS.md.
const CERTAIN: f64 = 0.9;

/// One line per movable part under a heading; empty if nothing moves.
pub(crate) fn of_result(made: &Reconstructed) -> String {
    let hidden = |part: usize| made.meshes.parts.get(part).is_some_and(|m| m[State::START].is_empty());
    table(&made.replica, &hidden)
}

fn table(replica: &Replica, hidden: &dyn Fn(usize) -> bool) -> String {
    let rows: Vec<[String; 5]> = (1..replica.parts.len()).filter_map(|number| row(replica, number, hidden)).collect();
    if rows.is_empty() {
        return String::new();
    }
    let heading = ["part", "type", "travel", "confidence", "check"].map(String::from);
    let width = |column: usize| rows.iter().chain([&heading]).map(|row| row[column].len()).max().unwrap_or(0);
    let widths: [usize; 5] = std::array::from_fn(width);
    let line = |row: &[String; 5]| {
        let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_string() + "\n"
    };
    std::iter::once(&heading).chain(&rows).map(line).collect()
}

fn row(replica: &Replica, number: usize, hidden: &dyn Fn(usize) -> bool) -> Option<[String; 5]> {
    let (joint, part) = (replica.joint(number)?, &replica.parts[number]);
    let carrier = part.parent.filter(|parent| *parent > 0);
    let on = carrier.map(|parent| format!(" on part {parent}")).unwrap_or_default();
    let doubtful = part.confidence.is_some_and(|c| c < DOUBTFUL);
    let check = match (hidden(number), part.alternatives.first(), doubtful) {
        (true, _, _) => "its surface is hardly seen".to_string(),
        (_, Some(other), _) if other.joint().kind != joint.kind => format!("may be {}", other.joint().kind.name()),
        (_, Some(_), _) => "another motion explains it, too".to_string(),
        (_, None, true) => "its joint and its shape".to_string(),
        (_, None, false) => String::new(),
    };
    Some([
        number.to_string(),
        format!("{}{on}", joint.kind.name()),
        travel(&joint),
        confidence(part.confidence).into(),
        check,
    ])
}

/// Motion between the two states.
fn travel(joint: &Joint) -> String {
    let amount = (joint.state_values[State::END] - joint.state_values[State::START]).abs();
    match joint.kind {
        JointKind::Prismatic => format!("{amount:.3} units"),
        JointKind::Revolute => format!("{:.1} deg", amount.to_degrees()),
        JointKind::Screw => format!("{:.1} deg, {:.3} units", amount.to_degrees(), (joint.pitch * amount).abs()),
    }
}

/// The probability that a joint is correct, in words.
fn confidence(probability: Option<f64>) -> &'static str {
    match probability {
        None => "unknown",
        Some(p) if p >= CERTAIN => "high",
        Some(p) if p >= DOUBTFUL => "medium",
        Some(_) => "low",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Alternative, JointAlternative, Rigid};
    use glam::DVec3;

    #[test]
    fn parts_are_listed_with_what_to_check() {
        let hinge = Joint::from_motion(JointKind::Revolute, &Rigid::about(DVec3::Z, DVec3::X, 0.7));
        let slide = Joint::from_motion(JointKind::Prismatic, &Rigid::shift(DVec3::new(0.0, -0.25, 0.0)));
        let mut replica = Replica::new(&[hinge, slide, hinge, slide]);
        for (part, p) in replica.parts[1..].iter_mut().zip([0.97, 0.7, 0.2, 0.3]) {
            part.confidence = Some(p);
        }
        replica.parts[2].parent = Some(1);
        let other = JointAlternative {
            kind: JointKind::Prismatic,
            motion: Rigid::shift(DVec3::X),
            cost: 0.1,
            what: String::new(),
            advice: String::new(),
        };
        replica.parts[3].alternatives = vec![Alternative::near(&other, DVec3::ZERO)];
        let text = table(&replica, &|part| part == 4);
        let expected = "\
part  type                 travel       confidence  check
1     revolute             40.1 deg     high
2     prismatic on part 1  0.250 units  medium
3     revolute             40.1 deg     low         may be prismatic
4     prismatic            0.250 units  low         its surface is hardly seen
";
        assert_eq!(text, expected);
        assert!(text.lines().all(|line| line.len() <= 80), "{text}");
    }

    #[test]
    fn nothing_that_moves_gives_no_table() {
        assert_eq!(table(&Replica::new(&[]), &|_| false), "");
    }
}
