//! The most important numbers as text for terminals.

use super::groups::FEATURELESS;
use super::summary::Summary;
use super::tables::{changed, confidences, described, share};
use crate::counted::counted;

/// Features that are named.
const FEATURES: usize = 3;

/// The headline, the features that lose most, the calibration, and the changes; a line each.
pub fn overview(summary: &Summary) -> String {
    let undecidable = &summary.undecidable.right;
    let mut lines = vec![
        format!("right           {}", share(&summary.right)),
        format!("joints correct  {}", share(&summary.joints_right)),
        format!(
            "{} refused, {} failed; {} apart, {} of them right{}",
            summary.refused,
            summary.failed,
            counted(undecidable.of, "undecidable object"),
            undecidable.count,
            if summary.not_made > 0 { format!("; {} not made", summary.not_made) } else { String::new() }
        ),
    ];
    lines.extend(summary.kinds.iter().map(|kind| format!("{:8}  {}", kind.count, kind.kind.name())));
    let losing = summary.features.iter().filter(|group| group.lost > 0.0 && group.name != FEATURELESS).take(FEATURES);
    lines.extend(losing.map(|group| format!("feature {}", described(group))));
    lines.push(confidences(&summary.calibration));
    lines.extend(
        summary
            .changes
            .as_ref()
            .map(|changes| format!("{}; times {}", changed(&changes.right), times(changes.time_ratio))),
    );
    lines.join("\n")
}

fn times(ratio: Option<f64>) -> String {
    ratio.map_or("not compared".into(), |ratio| format!("{ratio:.2} of those before (median)"))
}

#[cfg(test)]
mod tests {
    use super::super::super::Row;
    use super::super::testing::{not_made, refused, right, wrong_type};
    use super::*;

    #[test]
    fn the_overview_has_known_lines() {
        let thin = Row { features: vec!["thin".into()], ..wrong_type(1) };
        let before = [right(1), right(2)];
        let text = overview(&Summary::new(&[thin, right(2), right(3), refused(4)], Some(&before)));
        for line in [
            "right           2 of 4, 50.0 % (15.0 to 85.0 %)",
            "1 refused, 0 failed; 0 undecidable objects apart, 0 of them right",
            "       1  joint type wrong",
            "feature thin: 0 of 1 right (0.0 %, others 66.7 %), 0.5 wrong objects above average",
            "1 from right to wrong, 0 from wrong to right (p = 1); times 1.00 of those before (median)",
        ] {
            assert!(text.lines().any(|l| l == line), "{text}");
        }
        assert!(overview(&Summary::new(&[], None)).contains("right           none"));
        let hidden = Row { decidable: false, ..right(5) };
        let text = overview(&Summary::new(&[wrong_type(1), hidden, not_made(6)], None));
        let line = "0 refused, 0 failed; 1 undecidable object apart, 1 of them right; 1 not made";
        assert!(text.lines().any(|l| l == line) && !text.contains("feature"), "{text}");
    }
}
