//! Decidable objects that are wrong, the most confidently wrong first.

use super::super::{Row, Status};
use super::words::described;
use crate::html::Picture;
use crate::picture::picture_url;
use std::path::Path;

/// Objects that are shown.
pub(super) const SHOWN: usize = 30;

/// Decidable objects with something wrong: by the largest confidence of a joint that is not correct, then those without such a
/// joint, then right ones with a joint off, then failed ones, refused ones last.
pub(super) fn worst(rows: &[Row]) -> Vec<&Row> {
    let mut wrong: Vec<&Row> = rows.iter().filter(|row| row.is_made() && row.decidable && !row.joints_right).collect();
    let place = |row: &Row| match row.status {
        Status::Done => 0,
        Status::Failed => 1,
        Status::Refused => 2,
    };
    wrong.sort_by(|a, b| {
        place(a)
            .cmp(&place(b))
            .then(a.right.cmp(&b.right))
            .then(confidence(b).total_cmp(&confidence(a)))
            .then(a.seed.cmp(&b.seed))
    });
    wrong
}

/// Largest confidence of a joint that is not correct, -1 without one.
fn confidence(row: &Row) -> f64 {
    let wrong = row.joints.iter().filter(|joint| !joint.correct).filter_map(|joint| joint.confidence);
    wrong.filter(|c| c.is_finite()).fold(-1.0, f64::max)
}

/// An object with its preview in the folder `previews` beside the table.
pub(super) fn picture(row: &Row, base: &Path) -> Picture {
    let preview = base.join("previews").join(format!("{}.png", row.seed));
    let place = [&[row.category.clone(), row.sensor.clone()][..], &row.features].concat().join(", ");
    Picture {
        caption: vec![format!("seed {}", row.seed), place, described(row)],
        image: picture_url(&preview).ok_or("no preview"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{not_made, off, refused, right, wrong_type};
    use super::*;

    #[test]
    fn confident_errors_come_first() {
        let few = Row { right: false, joints_right: false, parts_found: 1, ..right(5) };
        let undecidable = Row { decidable: false, ..wrong_type(7) };
        let rows = [refused(1), few, off(2), right(3), wrong_type(4), undecidable, not_made(8)];
        let seeds: Vec<u64> = worst(&rows).iter().map(|row| row.seed).collect();
        assert_eq!(seeds, [4, 5, 2, 1]);
    }
}
