//! How far parts close: the limits of an export against the places at which the values of the true joints are 0.

use super::joints::Motion;
use artgs_core::{Joint, JointKind, State};
use artgs_io::export_report::{ExportReport, LinkReport};
use serde::{Deserialize, Serialize};

/// Where a part is closed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Closing {
    /// Where the export lets it close to, along the motion from the start to the end state, from the start state.
    pub limit: Motion,
    /// Where the value of the true joint is 0.
    pub truth: Motion,
}

impl Closing {
    /// Of a link that the export knows to open in one direction, and a true joint whose value is 0 at `zero`, relative to the start state.
    pub(crate) fn of(export: &ExportReport, link: &LinkReport, truth: &Joint, zero: f64) -> Option<Self> {
        link.zero_state.as_ref()?;
        let ([closed, _], [start, end]) = (link.limits?, link.observed?);
        let along = |value: f64, from: f64, to: f64| (value - from) * (to - from).signum();
        let true_values = &truth.state_values;
        let (limit, zero) =
            (along(closed, start, end), along(zero, true_values[State::START], true_values[State::END]));
        Some(match (link.joint?, truth.kind) {
            (JointKind::Prismatic, JointKind::Prismatic) => {
                Self { limit: Motion::Length(limit / export.scale), truth: Motion::Length(zero) }
            }
            (JointKind::Prismatic, _) | (_, JointKind::Prismatic) => return None,
            _ => Self { limit: Motion::Degrees(limit.to_degrees()), truth: Motion::Degrees(zero.to_degrees()) },
        })
    }

    /// Distance between both.
    pub fn error(&self) -> Motion {
        let error = (self.limit.value() - self.truth.value()).abs();
        match self.truth {
            Motion::Degrees(_) => Motion::Degrees(error),
            Motion::Length(_) => Motion::Length(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::PerState;
    use glam::DVec3;

    #[test]
    fn closing_limits_are_compared_along_the_motion_that_was_seen() {
        let joint = |kind, moved: f64| Joint {
            kind,
            axis: DVec3::Z,
            origin: DVec3::ZERO,
            pitch: 0.0,
            state_values: PerState::new(0.0, moved),
            limits: [moved.min(0.0), moved.max(0.0)],
        };
        let link = |kind, limits, observed| LinkReport {
            joint: Some(kind),
            limits: Some(limits),
            observed: Some(observed),
            zero_state: Some("start".into()),
            ..LinkReport::default()
        };
        let export = ExportReport { scale: 2.0, ..ExportReport::default() };
        // A door at 10 degrees, then at 70, whose true axis points the other way: values -10 and -70, 0 at +10 from the start.
        let [ten, seventy] = [10.0_f64, 70.0].map(f64::to_radians);
        let door = link(JointKind::Revolute, [-0.9 * ten, 2.0], [0.0, seventy - ten]);
        let found = Closing::of(&export, &door, &joint(JointKind::Revolute, ten - seventy), ten).unwrap();
        assert!((found.limit.value() + 9.0).abs() < 1e-9 && (found.truth.value() + 10.0).abs() < 1e-9, "{found:?}");
        assert!((found.error().value() - 1.0).abs() < 1e-9);
        // A drawer that is pulled out by 0.3 at the start, and by 0.1 at the end: at the end its joint is at 0.
        let drawer = link(JointKind::Prismatic, [-0.24, 1.0], [0.4, 0.0]);
        let found = Closing::of(&export, &drawer, &joint(JointKind::Prismatic, -0.2), -0.3).unwrap();
        assert!((found.limit.value() - 0.32).abs() < 1e-9 && (found.truth.value() - 0.3).abs() < 1e-9, "{found:?}");
        // Nothing is compared where the direction is unknown, or the kind is wrong.
        let unknown = LinkReport { zero_state: None, ..drawer.clone() };
        assert_eq!(Closing::of(&export, &unknown, &joint(JointKind::Prismatic, -0.2), -0.3), None);
        assert_eq!(Closing::of(&export, &drawer, &joint(JointKind::Revolute, -0.2), -0.3), None);
    }
}
