//! Slides of flat parts at an angle to their face.

use super::Discovery;
use artgs_core::{JointKind, State};
use glam::DVec3;

/// Angle of a slide to the face of its part or to the normal of the face, radians, up to which it is not doubted.
const LARGEST: f64 = 0.26;
/// Confidence of others at most.
const DOUBTED: f64 = 0.3;

/// What was found, with less confidence in slides of flat parts that go neither across nor along their face, and a warning for each: a
/// panel that slides within its plane behind another one fits a shift from the plane of one onto that of the other. Of 72 slides in rooms
/// of the photo seeds 8 and 9 and of four other objects, the right ones were within 4 degrees; the two of `sliding_doors` before a D435, 26
/// and 44 degrees, were wrong. Slides of parts that other parts carry include the motion of these.
pub(super) fn with_doubts_of_oblique(mut found: Discovery) -> Discovery {
    for k in 0..found.parts.len() {
        let part = &found.parts[k];
        let way = part.motion.translation.normalize_or_zero();
        if part.kind != JointKind::Prismatic || part.parent > 0 || way == DVec3::ZERO {
            continue;
        }
        let Some(normal) = main_normal(&found, k) else { continue };
        let across = normal.dot(way).abs().min(1.0).acos();
        if across.min(std::f64::consts::FRAC_PI_2 - across) <= LARGEST {
            continue;
        }
        let part = &mut found.parts[k];
        part.confidence = part.confidence.map(|confidence| confidence.min(DOUBTED));
        found.warnings.push(format!(
            "part {} slides at {:.0} degrees to the normal of its face, neither across nor along it: direction and length may be wrong; \
             record it so that its borders are seen in both states",
            k + 1,
            across.to_degrees()
        ));
    }
    found
}

/// Unit normal of the face of part `k` from 0; none if less than half of its points are on faces of one direction.
fn main_normal(found: &Discovery, k: usize) -> Option<DVec3> {
    /// Fewer points have no face.
    const LEAST: usize = 50;
    /// Normals that are tried.
    const TRIED: usize = 60;
    /// Cosine of the largest angle of a normal to that of its face: depth is noisy.
    const AGREES: f64 = 0.94;
    /// Least share of the points on the face.
    const FLAT: f64 = 0.5;
    const ROUNDS: usize = 3;
    let of_state = |s: State| {
        let own =
            found.clouds[s].normals.iter().zip(&found.labels[s]).filter(|(_, label)| usize::from(**label) == k + 1);
        own.map(|(normal, _)| normal.as_dvec3().normalize_or_zero())
    };
    let normals: Vec<DVec3> = State::ALL.into_iter().flat_map(of_state).collect();
    if normals.len() < LEAST {
        return None;
    }
    let agree = |face: DVec3| normals.iter().copied().filter(move |n| n.dot(face).abs() > AGREES);
    let tried = normals.iter().copied().step_by(normals.len().div_ceil(TRIED));
    let counted = tried.map(|face| (agree(face).count(), face));
    let (count, mut face) = counted.reduce(|best, other| if other.0 > best.0 { other } else { best })?;
    if (count as f64) < FLAT * normals.len() as f64 {
        return None;
    }
    for _ in 0..ROUNDS {
        let sum: DVec3 = agree(face).map(|n| n * n.dot(face).signum()).sum();
        face = sum.normalize_or(face);
    }
    Some(face)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::cloud::Cloud;
    use artgs_core::{JointEstimate, PerState, Rigid};
    use glam::Vec3;

    /// A panel with a slide along `way`, of which this share of the points is on its face; the others are on two sides.
    fn panel(way: DVec3, share: f64) -> Discovery {
        let normal = |i: usize| {
            if (i as f64) < share * 200.0 { Vec3::new(0.05 * (i % 3) as f32, 0.0, 1.0) } else { Vec3::AXES[i % 2] }
        };
        let points = (0..200).map(|i| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0) * 0.05);
        let cloud = Cloud {
            points: points.collect(),
            normals: (0..200).map(|i| normal(i).normalize()).collect(),
            ..Cloud::default()
        };
        Discovery {
            labels: PerState::from_fn(|_| vec![1; cloud.len()]),
            clouds: PerState::from_fn(|_| cloud.clone()),
            parts: vec![JointEstimate {
                confidence: Some(0.8),
                ..JointEstimate::new(JointKind::Prismatic, Rigid::shift(way))
            }],
            ..Discovery::default()
        }
    }

    #[test]
    fn slides_of_flat_parts_at_an_angle_to_their_face_are_doubted() {
        let confidence = |found: Discovery| with_doubts_of_oblique(found).parts[0].confidence.unwrap();
        assert_eq!(confidence(panel(DVec3::new(0.01, 0.02, 0.3), 0.8)), 0.8);
        assert_eq!(confidence(panel(DVec3::new(0.3, 0.1, 0.03), 0.8)), 0.8);
        let oblique = DVec3::new(0.1, 0.1, 0.14);
        assert_eq!(confidence(panel(oblique, 0.8)), DOUBTED);
        assert!(with_doubts_of_oblique(panel(oblique, 0.8)).warnings[0].starts_with("part 1 slides at 4"));
        // A part without a face, and one that another part carries.
        assert_eq!(confidence(panel(oblique, 0.45)), 0.8);
        let mut carried = panel(oblique, 0.8);
        carried.parts[0].parent = 2;
        assert_eq!(confidence(carried), 0.8);
    }
}
