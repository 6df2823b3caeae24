//! Joint confidence from what supports a joint, and the other joints that a part could have.

use super::candidates::Candidate;
use super::front::Front;
use super::support::Support;
use artgs_core::{Joint, JointAlternative, JointEstimate, JointKind};
use glam::DVec3;

/// Settings of the joint confidence: a logistic regression on the measures of [`Support`]. Fitted on 163 joints of 56 captures of
/// stand-ins and hard cases, clean ones and ones with noise, few views, front views, jitter and misalignment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ConfidenceSettings {
    /// Constant of the regression.
    pub(crate) bias: f64,
    /// Weight of the mean cost of the part's points, up to [`Self::most_cost`].
    pub(crate) cost: f64,
    /// Larger costs count as this one.
    pub(crate) most_cost: f64,
    /// Weight of the margin to the best different motion, within [`Self::margins`].
    pub(crate) margin: f64,
    /// Smaller and larger margins count as these.
    pub(crate) margins: [f64; 2],
    /// Weight of the stiffness, up to [`Self::most_stiffness`].
    pub(crate) stiffness: f64,
    /// Larger stiffness counts as this one.
    pub(crate) most_stiffness: f64,
    /// Weight of the decimal logarithm of the number of moved points, up to [`Self::most_moved`].
    pub(crate) moved: f64,
    /// Larger logarithms count as this one.
    pub(crate) most_moved: f64,
    /// Weight of the residual in depth tolerances, within [`Self::residuals`].
    pub(crate) residual: f64,
    /// Smaller and larger residuals count as these.
    pub(crate) residuals: [f64; 2],
    /// Weight of the share of all moved points that no part explains, up to [`Self::most_unexplained`].
    pub(crate) unexplained: f64,
    /// Larger shares count as this one.
    pub(crate) most_unexplained: f64,
    /// Most confidence of a joint that is not visible in both states, or explains less than half of its moved points.
    pub(crate) unsupported: f64,
    /// Parts of a lower confidence, or of a lower margin, get an alternative.
    pub(crate) uncertain: f64,
    /// See [`Self::uncertain`].
    pub(crate) least_margin: f64,
    /// Motions that turn less are slides, degrees.
    pub(crate) turn_deg: f64,
    /// Factor for slides across the front of an object that opens, where depth noise spreads points: drawers that look alike and open by
    /// different amounts are explained by an exchange of places nearly as well. From one simulated recording.
    pub(crate) across: f64,
    /// Slides that differ more from the direction of the front are across it, degrees.
    pub(crate) across_deg: f64,
}

impl Default for ConfidenceSettings {
    fn default() -> Self {
        Self {
            bias: -3.12,
            cost: -1.25,
            most_cost: 0.5,
            margin: 11.2,
            margins: [-0.3, 0.15],
            stiffness: 63.3,
            most_stiffness: 0.1,
            moved: 0.26,
            most_moved: 3.0,
            residual: -10.2,
            residuals: [0.3, 1.0],
            unexplained: -3.08,
            most_unexplained: 0.2,
            unsupported: 0.3,
            uncertain: 0.7,
            least_margin: 0.03,
            turn_deg: 3.0,
            across: 0.3,
            across_deg: 30.0,
        }
    }
}

impl ConfidenceSettings {
    /// Probability that the joint is correct: its type, its axis to 5 degrees, its place to 5 % of the part's size, and its motion to
    /// 5 % of the true motion or of the part's size. `fit` is the share of the visible points that the motion takes onto a surface. Points that land on another
    /// movable part contradict the joint or the extent of the part.
    pub(super) fn confidence(&self, support: &Support, fit: Option<f64>) -> f64 {
        let [least_margin, most_margin] = self.margins;
        let [least_residual, most_residual] = self.residuals;
        let z = self.bias
            + self.cost * support.cost.min(self.most_cost)
            + self.margin * support.margin.clamp(least_margin, most_margin)
            + self.stiffness * support.stiffness.min(self.most_stiffness)
            + self.moved * support.moved.max(1.0).log10().min(self.most_moved)
            + self.residual * support.residual.clamp(least_residual, most_residual)
            + self.unexplained * support.unexplained.min(self.most_unexplained);
        let probability = 1.0 / (1.0 + (-z).exp());
        let supported = fit.is_some() && support.explained >= 0.5;
        let probability = if supported { probability } else { probability.min(self.unsupported) };
        probability * (1.0 - support.contested).powi(2)
    }

    /// Lowers the confidence of a slide that is not along the front, of an object whose points depth noise spreads.
    pub(super) fn doubt_across(&self, part: &mut JointEstimate, front: Front) {
        let along = part.motion.translation.normalize_or_zero().dot(front.direction.as_dvec3()).abs();
        let slides = part.kind == JointKind::Prismatic && part.parent == 0;
        if slides && along < self.across_deg.to_radians().cos() {
            part.confidence = part.confidence.map(|confidence| self.across * confidence);
        }
    }

    /// The best different joint of an uncertain part; `parts` is the number of movable parts.
    pub(super) fn alternatives(
        &self,
        part: &JointEstimate,
        support: &Support,
        parts: usize,
        pool: &[Candidate],
    ) -> Vec<JointAlternative> {
        let uncertain = part.confidence.unwrap_or(0.0) < self.uncertain || support.margin < self.least_margin;
        let Some(rival) = support.other_joint.filter(|_| uncertain) else { return Vec::new() };
        let turns = pool[rival].motion.angle().to_degrees() > self.turn_deg;
        let kind = if turns { JointKind::Revolute } else { JointKind::Prismatic };
        let joint = Joint::from_motion(kind, &pool[rival].motion);
        let [x, y, z] = rounded(joint.axis);
        let amount = joint.start_to_end();
        let what = match kind {
            JointKind::Prismatic => {
                format!("it slides along ({x}, {y}, {z}) by {:.3} scene units", amount.translation.length())
            }
            _ => format!("it turns about ({x}, {y}, {z}) by {:.0} degrees", amount.angle().to_degrees()),
        };
        let advice = self.advice(support, parts).into();
        vec![JointAlternative { kind, motion: amount, cost: support.other_margin.max(0.0), what, advice }]
    }

    /// Which further capture would decide between the joints.
    fn advice(&self, support: &Support, parts: usize) -> &'static str {
        /// Points that moved less say little, spacings.
        const SMALL_MOTION: f64 = 4.0;
        /// Fewer moved points are hardly a part.
        const FEW_POINTS: f64 = 200.0;
        if support.moved < FEW_POINTS {
            "Photos that show more of this part in both states would decide it"
        } else if support.shift < SMALL_MOTION {
            "A state in which this part is opened further would decide it"
        } else if support.stiffness < 0.5 * self.most_stiffness {
            "Photos that show the edges and sides of this part in both states would decide it"
        } else if parts > 1 {
            "A capture in which only this part moves would decide it"
        } else {
            "A state in which this part is opened by another amount would decide it"
        }
    }
}

/// Coordinates with two digits, without a negative zero.
fn rounded(v: DVec3) -> [String; 3] {
    v.to_array().map(|x| format!("{:.2}", if x.abs() < 0.005 { 0.0 } else { x }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{PerState, Rigid};

    fn sure() -> Support {
        Support {
            moved: 3000.0,
            explained: 0.97,
            contested: 0.0,
            exclusive: 0.3,
            cost: 0.08,
            margin: 0.2,
            other_joint: Some(0),
            other_margin: 0.2,
            rival: Some(0),
            fair_rival: None,
            stiffness: 0.2,
            residual: 0.03,
            shift: 20.0,
            size: 80.0,
            unexplained: 0.02,
        }
    }

    #[test]
    fn slides_across_the_front_are_doubtful() {
        let settings = ConfidenceSettings::default();
        let front = Front { direction: glam::Vec3::X, height: 0.0 };
        let doubted = |kind, shift: DVec3| {
            let mut part = JointEstimate { confidence: Some(0.8), ..JointEstimate::new(kind, Rigid::shift(shift)) };
            settings.doubt_across(&mut part, front);
            part.confidence.unwrap()
        };
        assert_eq!(doubted(JointKind::Prismatic, DVec3::new(-0.2, 0.02, 0.0)), 0.8);
        assert!(doubted(JointKind::Prismatic, DVec3::new(0.01, 0.2, 0.0)) < 0.3);
        assert_eq!(doubted(JointKind::Revolute, DVec3::new(0.01, 0.2, 0.0)), 0.8);
    }

    #[test]
    fn every_lack_of_support_lowers_the_confidence() {
        let settings = ConfidenceSettings::default();
        let of = |s: Support| settings.confidence(&s, Some(1.0));
        assert!(of(sure()) > 0.9, "{}", of(sure()));
        for weaker in [
            Support { margin: -0.2, ..sure() },
            Support { explained: 0.3, ..sure() },
            Support { stiffness: 0.0, margin: 0.05, ..sure() },
            Support { residual: 0.9, ..sure() },
            Support { contested: 0.4, ..sure() },
        ] {
            assert!(of(weaker) < 0.5, "{weaker:?}: {}", of(weaker));
        }
        assert!(settings.confidence(&sure(), None) < 0.5);
    }

    #[test]
    fn an_uncertain_part_has_an_alternative_and_advice() {
        let settings = ConfidenceSettings::default();
        let pool = [Candidate {
            motion: Rigid::shift(DVec3::X * 0.25),
            explained: PerState::default(),
            gain: 1.0,
            implausibility: 0.0,
            turned_over: false,
        }];
        let part =
            |c| JointEstimate { confidence: Some(c), ..JointEstimate::new(JointKind::Revolute, Rigid::IDENTITY) };
        assert!(settings.alternatives(&part(0.95), &sure(), 1, &pool).is_empty());
        let found = settings.alternatives(&part(0.3), &Support { shift: 1.0, ..sure() }, 1, &pool);
        assert_eq!(found[0].kind, JointKind::Prismatic);
        assert!(found[0].what.contains("slides along (1.00, 0.00, 0.00) by 0.250"), "{}", found[0].what);
        assert!(found[0].advice.contains("opened further"));
        // What would decide fits the number of parts.
        let advice = |parts| settings.alternatives(&part(0.3), &sure(), parts, &pool)[0].advice.clone();
        assert!(advice(2).contains("only this part moves") && advice(1).contains("by another amount"));
        // The same joint, a little turned, is no other one.
        let alone = Support { other_joint: None, other_margin: 1.0, ..sure() };
        assert!(settings.alternatives(&part(0.3), &alone, 1, &pool).is_empty());
    }
}
