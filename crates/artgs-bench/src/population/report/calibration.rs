//! How far confidences can be trusted: the share of correct joints by confidence.

use super::super::Row;
use super::statistics::Share;
use serde::Serialize;

/// Bins of equal width from 0 to 1.
const BINS: usize = 10;
/// Joints with a larger confidence are sure.
pub(super) const SURE: f64 = 0.9;

/// Joints with about the same confidence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// Least confidence; it belongs to the bin.
    pub low: f64,
    /// Largest confidence; it belongs to the next bin, 1 to the last one.
    pub high: f64,
    /// Mean confidence; none without joints.
    pub confidence: Option<f64>,
    /// Correct joints.
    pub correct: Share,
}

/// The confidences of joints and how many of these are correct.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// Joints with a confidence.
    pub joints: usize,
    /// Joints without one, which are not part of the other numbers.
    pub without_confidence: usize,
    /// Expected calibration error: the mean over joints of the difference between mean confidence and share of correct joints of
    /// their bin; none without joints.
    pub error: Option<f64>,
    /// Wrong joints among those with a confidence above 0.9.
    pub sure_and_wrong: Share,
    /// From 0 to 1.
    pub bins: Vec<Bin>,
}

impl Calibration {
    /// Of the found joints of decidable objects.
    pub(super) fn of_rows(rows: &[Row]) -> Self {
        let joints = rows.iter().filter(|row| row.decidable).flat_map(|row| &row.joints);
        let pairs: Vec<(Option<f64>, bool)> = joints.map(|joint| (joint.confidence, joint.correct)).collect();
        Self::new(&pairs)
    }

    /// Of joints with their confidence and whether they are correct. A confidence that is not finite is none.
    pub fn new(joints: &[(Option<f64>, bool)]) -> Self {
        let sure: Vec<(f64, bool)> = joints
            .iter()
            .filter_map(|(c, correct)| Some((c.filter(|c| c.is_finite())?.clamp(0.0, 1.0), *correct)))
            .collect();
        let bins: Vec<Bin> = (0..BINS).map(|i| bin(&sure, i)).collect();
        let gap = |bin: &Bin| Some((bin.confidence? - bin.correct.share?).abs() * bin.correct.of as f64);
        let sum: f64 = bins.iter().filter_map(gap).sum();
        Self {
            joints: sure.len(),
            without_confidence: joints.len() - sure.len(),
            error: (!sure.is_empty()).then(|| sum / sure.len() as f64),
            sure_and_wrong: Share::among(sure.iter().filter(|(c, _)| *c > SURE), |(_, correct)| !correct),
            bins,
        }
    }
}

fn bin(joints: &[(f64, bool)], i: usize) -> Bin {
    let edge = |i: usize| i as f64 / BINS as f64;
    let (low, high) = (edge(i), edge(i + 1));
    let within: Vec<&(f64, bool)> = joints.iter().filter(|(c, _)| *c >= low && (*c < high || i + 1 == BINS)).collect();
    let sum: f64 = within.iter().map(|(c, _)| c).sum();
    let confidence = (!within.is_empty()).then(|| sum / within.len() as f64);
    Bin { low, high, confidence, correct: Share::among(within, |(_, correct)| *correct) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(n: usize, confidence: f64, correct: bool) -> Vec<(Option<f64>, bool)> {
        vec![(Some(confidence), correct); n]
    }

    #[test]
    fn the_error_of_known_joints() {
        // 10 joints at 0.95 of which 8 are correct: 0.15. 5 joints at 0.45 of which 3 are correct: 0.15. 5 joints at 0.25, none correct: 0.25.
        let mut joints =
            [times(8, 0.95, true), times(2, 0.95, false), times(3, 0.45, true), times(2, 0.45, false)].concat();
        joints.extend(times(5, 0.25, false));
        joints.extend([(None, true), (Some(f64::NAN), false)]);
        let found = Calibration::new(&joints);
        assert_eq!((found.joints, found.without_confidence), (20, 2));
        assert!((found.error.unwrap() - (10.0 * 0.15 + 5.0 * 0.15 + 5.0 * 0.25) / 20.0).abs() < 1e-12, "{found:?}");
        assert_eq!(found.sure_and_wrong, Share::new(2, 10));
        assert_eq!((found.bins[9].correct, found.bins[4].correct), (Share::new(8, 10), Share::new(3, 5)));
    }

    #[test]
    fn edges_belong_to_one_bin_and_nothing_has_no_error() {
        let joints: Vec<_> = (0..=10).map(|i| (Some(f64::from(i) / 10.0), true)).collect();
        let found = Calibration::new(&joints);
        let counts: Vec<usize> = found.bins.iter().map(|bin| bin.correct.of).collect();
        assert_eq!(counts, [1, 1, 1, 1, 1, 1, 1, 1, 1, 2]);
        assert_eq!(found.sure_and_wrong, Share::new(0, 1), "0.9 is not above 0.9");
        let nothing = Calibration::new(&[]);
        assert_eq!((nothing.error, nothing.bins[0].confidence, nothing.sure_and_wrong.share), (None, None, None));
    }

    #[test]
    fn undecidable_objects_do_not_count() {
        let joints = vec![super::super::super::JointRow { confidence: Some(0.8), ..Default::default() }];
        let row = |decidable| Row { decidable, joints: joints.clone(), ..Row::default() };
        assert_eq!(Calibration::of_rows(&[row(true), row(false)]).joints, 1);
    }
}
