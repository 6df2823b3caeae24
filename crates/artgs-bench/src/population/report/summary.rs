//! Numbers of a population.

use super::super::{Row, Status};
use super::calibration::Calibration;
use super::changes::Changes;
use super::groups::{self, Group};
use super::kinds::{Confusion, KindCount, confusions, kinds};
use super::statistics::{Middle, Share};
use crate::batch::{self, Cause, causes};
use serde::Serialize;
use std::collections::BTreeMap;

/// Objects whose views allow another answer than the truth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Undecidable {
    /// Those that are right, by the row's rule for them.
    pub right: Share,
    /// Refused ones.
    pub refused: usize,
    /// Failed ones.
    pub failed: usize,
    /// Objects by reason; an object counts for each of its reasons.
    pub reasons: BTreeMap<String, usize>,
}

/// Distributions. Errors are those of joints with the right type on right decidable objects, time and memory those of finished objects.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Numbers {
    /// Angle between the axes, degrees.
    pub axis_deg: Option<Middle>,
    /// Distance between the axes, share of the diagonal of the part.
    pub position: Option<Middle>,
    /// Error of the motion, share of the true motion.
    pub motion: Option<Middle>,
    /// Errors of direction, position and motion that are within their 95 % intervals.
    pub covered: [Share; 3],
    /// Wall-clock time of a run, seconds.
    pub seconds: Option<Middle>,
    /// The same by sensor.
    pub seconds_of_sensor: BTreeMap<String, Middle>,
    /// Processor time of a run, seconds.
    pub cpu_seconds: Option<Middle>,
    /// Peak memory, MiB.
    pub peak_memory_mib: Option<Middle>,
}

/// What became of the objects of a population.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// All objects.
    pub objects: usize,
    /// Right ones among the decidable objects.
    pub right: Share,
    /// Decidable objects whose joints are correct as well.
    pub joints_right: Share,
    /// Refused decidable objects.
    pub refused: usize,
    /// Failed decidable objects.
    pub failed: usize,
    /// Objects that could not be made: they are in no other number but those of all objects.
    pub not_made: usize,
    /// All others.
    pub undecidable: Undecidable,
    /// Distributions.
    pub numbers: Numbers,
    /// What is wrong with decidable objects.
    pub kinds: Vec<KindCount>,
    /// Wrong joint types of decidable objects.
    pub confusions: Vec<Confusion>,
    /// Decidable objects by feature; the feature that loses most first.
    pub features: Vec<Group>,
    /// By category.
    pub categories: Vec<Group>,
    /// By sensor.
    pub sensors: Vec<Group>,
    /// By number of movable parts, in rising order.
    pub parts: Vec<Group>,
    /// Confidences of joints of decidable objects.
    pub calibration: Calibration,
    /// Refusals and failures of all objects by cause, those that could not be made included.
    pub causes: Vec<Cause>,
    /// Versions of the program with their numbers of objects.
    pub programs: BTreeMap<String, usize>,
    /// Differences to an earlier table.
    pub changes: Option<Changes>,
}

impl Summary {
    /// Numbers of a table; with an earlier one, the differences.
    pub fn new(all: &[Row], before: Option<&[Row]>) -> Self {
        let rows = &made(all)[..];
        let decidable = || rows.iter().filter(|row| row.decidable);
        let count = |wanted: Status| decidable().filter(|row| row.status == wanted).count();
        let mut programs = BTreeMap::new();
        for row in all.iter().filter(|row| !row.program.is_empty()) {
            *programs.entry(row.program.clone()).or_default() += 1;
        }
        Self {
            objects: all.len(),
            not_made: all.len() - rows.len(),
            right: Share::among(decidable(), |row| row.right),
            joints_right: Share::among(decidable(), |row| row.joints_right),
            refused: count(Status::Refused),
            failed: count(Status::Failed),
            undecidable: undecidable(rows),
            numbers: numbers(rows),
            kinds: kinds(rows),
            confusions: confusions(rows),
            features: groups::by_feature(rows),
            categories: groups::by_category(rows),
            sensors: groups::by_sensor(rows),
            parts: groups::by_parts(rows),
            calibration: Calibration::of_rows(rows),
            causes: causes_of(all),
            programs,
            changes: before.map(|before| Changes::new(&made(before), rows)),
        }
    }
}

/// Rows of objects that could be made. Of others nothing is known but the seed.
fn made(rows: &[Row]) -> Vec<Row> {
    rows.iter().filter(|row| row.is_made()).cloned().collect()
}

fn undecidable(rows: &[Row]) -> Undecidable {
    let undecidable = || rows.iter().filter(|row| !row.decidable);
    let mut reasons = BTreeMap::new();
    for reason in undecidable().flat_map(|row| &row.undecidable) {
        *reasons.entry(reason.clone()).or_default() += 1;
    }
    Undecidable {
        right: Share::among(undecidable(), |row| row.right),
        refused: undecidable().filter(|row| row.status == Status::Refused).count(),
        failed: undecidable().filter(|row| row.status == Status::Failed).count(),
        reasons,
    }
}

fn numbers(rows: &[Row]) -> Numbers {
    let right = rows.iter().filter(|row| row.decidable && row.right).flat_map(|row| &row.joints);
    let joints: Vec<_> = right.filter(|joint| joint.truth.is_some() && joint.kind == joint.kind_true).collect();
    let done: Vec<&Row> = rows.iter().filter(|row| row.status == Status::Done).collect();
    // Zero is an unknown number.
    let positive = |of: fn(&Row) -> f64| {
        let values: Vec<f64> = done.iter().map(|row| of(row)).filter(|v| *v > 0.0).collect();
        Middle::of(&values)
    };
    let mut seconds: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for row in done.iter().filter(|row| row.seconds > 0.0) {
        seconds.entry(&row.sensor).or_default().push(row.seconds);
    }
    let of_sensor = |(sensor, values): (&str, Vec<f64>)| Some((sensor.to_string(), Middle::of(&values)?));
    Numbers {
        axis_deg: Middle::of(&joints.iter().filter_map(|j| j.axis_deg).collect::<Vec<_>>()),
        position: Middle::of(&joints.iter().filter_map(|j| j.position).collect::<Vec<_>>()),
        motion: Middle::of(&joints.iter().filter_map(|j| j.motion).collect::<Vec<_>>()),
        covered: [
            covered(joints.iter().map(|j| j.axis_of_interval)),
            covered(joints.iter().map(|j| j.position_of_interval)),
            covered(joints.iter().map(|j| j.motion_of_interval)),
        ],
        seconds: positive(|row| row.seconds),
        seconds_of_sensor: seconds.into_iter().filter_map(of_sensor).collect(),
        cpu_seconds: positive(|row| row.cpu_seconds),
        peak_memory_mib: positive(|row| row.peak_memory_mib),
    }
}

/// Errors, as shares of the half widths of their intervals, that are within them.
fn covered(errors: impl Iterator<Item = Option<f64>>) -> Share {
    let known: Vec<f64> = errors.flatten().collect();
    Share::among(&known, |error| **error <= 1.0)
}

/// Causes of refusals and failures, with seeds as ids.
fn causes_of(rows: &[Row]) -> Vec<Cause> {
    let failed = rows.iter().filter(|row| row.status != Status::Done);
    let of_batch = |row: &Row| batch::Row {
        id: row.seed.to_string(),
        done: false,
        reason: row.reason.clone(),
        ..batch::Row::default()
    };
    causes(&failed.map(of_batch).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::super::testing::{not_made, off, refused, right, wrong_type};
    use super::*;

    #[test]
    fn numbers_of_a_known_table() {
        let unseen = Row { decidable: false, undecidable: vec!["unseen".into()], ..right(6) };
        let hidden = Row { decidable: false, undecidable: vec!["unseen".into()], ..refused(7) };
        let rows = [right(1), off(2), wrong_type(3), refused(4), unseen, hidden];
        let found = Summary::new(&rows, None);
        assert_eq!((found.objects, found.refused, found.failed), (6, 1, 0));
        assert_eq!((found.right, found.joints_right), (Share::new(2, 4), Share::new(1, 4)));
        assert_eq!((found.undecidable.right, found.undecidable.refused), (Share::new(1, 2), 1));
        assert_eq!(found.undecidable.reasons["unseen"], 2);
        let [axis_in, _, motion_in] = &found.numbers.covered;
        assert!(axis_in.of > 0 && axis_in.count == axis_in.of && motion_in.count == 0, "{axis_in:?} {motion_in:?}");
        let axis = found.numbers.axis_deg.unwrap();
        // Of the two right decidable objects: 0.5, 0.5, 0.5 and 7.25 degrees.
        assert_eq!((axis.count, axis.median), (4, 0.5));
        assert!((axis.p95 - (0.5 + 0.85 * 6.75)).abs() < 1e-9);
        assert_eq!((found.numbers.seconds.unwrap().count, found.numbers.cpu_seconds), (4, None));
        assert_eq!((found.causes.len(), found.causes[0].count), (1, 2));
        assert_eq!(found.causes[0].ids, ["4", "7"]);
    }

    #[test]
    fn objects_that_could_not_be_made_have_no_properties() {
        let rows = [right(1), wrong_type(2), not_made(3)];
        let found = Summary::new(&rows, Some(&[right(1), not_made(2), not_made(3)]));
        assert_eq!((found.objects, found.not_made, found.failed, found.undecidable.right.of), (3, 1, 0, 0));
        assert_eq!((found.right, found.kinds.len()), (Share::new(1, 2), 1));
        for groups in [&found.features, &found.categories, &found.sensors, &found.parts] {
            assert_eq!(groups.iter().map(|group| group.right.of).collect::<Vec<_>>(), [2], "{groups:?}");
        }
        let changes = found.changes.unwrap();
        assert_eq!((changes.both, changes.added, changes.removed), (1, 1, 0));
        assert_eq!(found.causes[0].ids, ["3"]);
    }

    #[test]
    fn no_rows_give_no_numbers() {
        let found = Summary::new(&[], Some(&[]));
        assert_eq!((found.right.share, found.numbers.seconds, found.calibration.error), (None, None, None));
        assert!(!serde_json::to_string(&found).unwrap().contains("NaN"));
    }
}
