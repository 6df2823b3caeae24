//! Hinges of parts so narrow that errors of depth can turn them.

use super::Discovery;
use super::cloud::principal_axes;
use artgs_core::{JointKind, State};

/// Angle by which errors of depth can turn a part, radians, up to which its hinge is not doubted.
const LARGEST: f64 = 0.1;

/// What was found, with less confidence in hinges of parts that errors of depth at their sides can turn by much, and a warning for each.
/// Of 23 hinges in rooms before a LiDAR (photo seed 8), the parts of 22 were at least 15 times as wide as these errors, and their axes
/// were off by at most 1.25 times this angle; the part of the other one, scissors, was as wide as they are, its axis off by 18 degrees.
pub(super) fn with_doubts_of_narrow(mut found: Discovery) -> Discovery {
    for k in 0..found.parts.len() {
        let Some(width) = width(&found, k).filter(|_| found.parts[k].kind != JointKind::Prismatic) else { continue };
        let angle = found.tolerance.atan2(width);
        if angle <= LARGEST {
            continue;
        }
        let part = &mut found.parts[k];
        part.confidence = part.confidence.map(|confidence| confidence * LARGEST / angle);
        found.warnings.push(format!(
            "part {} is narrow for the errors of depth: its axis may be off by {:.0} degrees; record it from a shorter distance",
            k + 1,
            angle.to_degrees()
        ));
    }
    found
}

/// Second largest extent of part `k` from 0, as of a uniform spread, in the state that shows less of it; none if too few points show it.
fn width(found: &Discovery, k: usize) -> Option<f64> {
    /// Fewer points of a state have no extents.
    const LEAST: usize = 24;
    let in_state = |s: State| {
        let cloud = &found.clouds[s];
        let own: Vec<usize> = (0..cloud.len()).filter(|i| usize::from(found.labels[s][*i]) == k + 1).collect();
        if own.len() < LEAST {
            return None;
        }
        let [_, short, _] = principal_axes(cloud, &own);
        let along = || own.iter().map(|i| f64::from(cloud.points[*i].dot(short)));
        let mean = along().sum::<f64>() / own.len() as f64;
        let variance = along().map(|a| (a - mean).powi(2)).sum::<f64>() / own.len() as f64;
        Some((12.0 * variance).sqrt())
    };
    State::ALL.into_iter().filter_map(in_state).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::cloud::Cloud;
    use artgs_core::{JointEstimate, PerState, Rigid};
    use glam::Vec3;

    /// A strip of 1 m with a part of this width and kind, and depth that errs by 2 cm.
    fn strip(width: f32, kind: JointKind) -> Discovery {
        let points =
            (0..100).flat_map(|i| (0..20).map(move |j| Vec3::new(i as f32 / 99.0, width * j as f32 / 19.0, 0.0)));
        let cloud = Cloud { points: points.collect(), ..Cloud::default() };
        Discovery {
            labels: PerState::from_fn(|_| vec![1; cloud.len()]),
            clouds: PerState::from_fn(|_| cloud.clone()),
            parts: vec![JointEstimate { confidence: Some(0.8), ..JointEstimate::new(kind, Rigid::IDENTITY) }],
            tolerance: 0.02,
            ..Discovery::default()
        }
    }

    #[test]
    fn hinges_of_parts_as_narrow_as_errors_of_depth_are_doubted() {
        let confidence = |found: &Discovery| found.parts[0].confidence.unwrap();
        let wide = with_doubts_of_narrow(strip(0.4, JointKind::Revolute));
        assert!(confidence(&wide) == 0.8 && wide.warnings.is_empty());
        let narrow = with_doubts_of_narrow(strip(0.02, JointKind::Revolute));
        assert!(
            (confidence(&narrow) - 0.8 * 0.1 / std::f64::consts::FRAC_PI_4).abs() < 0.01,
            "{}",
            confidence(&narrow)
        );
        assert!(narrow.warnings[0].starts_with("part 1 is narrow") && narrow.warnings[0].contains("off by 4"));
        // Slides keep their direction from long sides.
        assert_eq!(confidence(&with_doubts_of_narrow(strip(0.02, JointKind::Prismatic))), 0.8);
        // What no state shows has no width.
        let mut hidden = strip(0.02, JointKind::Revolute);
        hidden.labels = hidden.labels.map(|labels| vec![0; labels.len()]);
        assert_eq!(confidence(&with_doubts_of_narrow(hidden)), 0.8);
    }
}
