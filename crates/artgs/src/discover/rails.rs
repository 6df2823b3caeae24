//! Directions of slides. Rails of one object are parallel, and drawers slide towards its front. Where depth noise spreads points, the surfaces
//! of one drawer determine its direction badly; all of them together, and the front, determine it well.

use super::cloud::IndexedCloud;
use super::front::Front;
use super::refinement::points_of_part;
use super::registration::{Matching, RegistrationOptions, register_along};
use super::scene::Scene;
use artgs_core::{JointEstimate, JointKind, PerState, Rigid, State};
use glam::{DVec3, Vec3};

/// Settings of common directions. Calibrated on simulated recordings of a phone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RailSettings {
    /// Directions that differ by less agree, degrees.
    pub(crate) agree_deg: f64,
    /// Slides that differ by more from what the others agree on keep their direction, degrees.
    pub(crate) largest_deg: f64,
    /// So do those whose end would move by more, depth tolerances.
    pub(crate) tolerances: f64,
    /// The front counts if at least this share of the points of slides faces it or its back, as the front of a drawer does.
    pub(crate) facing_share: f64,
}

impl Default for RailSettings {
    fn default() -> Self {
        Self { agree_deg: 6.0, largest_deg: 20.0, tolerances: 3.0, facing_share: 0.2 }
    }
}

impl RailSettings {
    /// Gives slides that are nearly parallel the direction that they and the front agree on, and fits their lengths again.
    pub(super) fn align(
        &self,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        labels: &PerState<Vec<u16>>,
        parts: &mut [JointEstimate],
        front: Option<Front>,
    ) {
        let slides = |p: &JointEstimate| p.kind == JointKind::Prismatic && p.parent == 0;
        let shifts: Vec<DVec3> = parts.iter().filter(|p| slides(p)).map(|p| p.motion.translation).collect();
        let is_slide = |label: &u16| (*label as usize).checked_sub(1).is_some_and(|k| slides(&parts[k]));
        let normals = |s: State| {
            let all = clouds[s].cloud.normals.iter().zip(&labels[s]);
            all.filter(|(_, label)| is_slide(label)).map(|(n, _)| *n)
        };
        let normals: Vec<Vec3> = State::ALL.into_iter().flat_map(normals).collect();
        let front = front.map(|f| f.direction).filter(|f| self.face(&normals, *f));
        let Some(common) = self.common(&shifts, front.map(|f| f.as_dvec3())) else { return };
        let spacing = f64::from(scene.lengths.spacing);
        for (k, part) in parts.iter_mut().enumerate().filter(|(_, p)| slides(p)) {
            let shift = part.motion.translation;
            let aside = shift.reject_from_normalized(common).length();
            let off = angle_deg(shift, common);
            if off > self.largest_deg || aside > self.tolerances * f64::from(scene.tolerance) {
                continue;
            }
            let own = points_of_part(clouds, labels, k as u16 + 1);
            let own = own.as_ref().map(IndexedCloud::new);
            let points = Matching::mutual(&own[State::START], &own[State::END]);
            let options = RegistrationOptions {
                first_reach: 2.0 * spacing,
                last_reach: spacing,
                iterations: 12,
                max_points: 20_000,
                either_side: false,
            };
            part.motion = Rigid::shift(common * register_along(points, common, shift.dot(common), &options));
        }
    }

    fn face(&self, normals: &[Vec3], front: Vec3) -> bool {
        /// Least cosine between such normals and the front.
        const FACING: f32 = 0.95;
        let facing = normals.iter().filter(|n| n.dot(front).abs() > FACING).count();
        facing as f64 >= self.facing_share * normals.len() as f64
    }

    /// The unit direction that most of the shifts, the longer ones first, and the front agree on; none if no two do.
    fn common(&self, shifts: &[DVec3], front: Option<DVec3>) -> Option<DVec3> {
        let longest = shifts.iter().map(|s| s.length()).fold(0.0, f64::max);
        let voters: Vec<DVec3> = shifts.iter().copied().chain(front.map(|f| f * longest)).collect();
        let apart = |a: &DVec3, b: &DVec3| angle_deg(*a, *b);
        let disagreement =
            |a: &DVec3| -> f64 { voters.iter().map(|b| b.length() * apart(a, b).min(self.largest_deg)).sum() };
        let middle = voters.iter().min_by(|a, b| disagreement(a).total_cmp(&disagreement(b)))?;
        let agreeing = voters.iter().filter(|v| apart(v, middle) < self.agree_deg);
        let (sum, count) = agreeing
            .fold((DVec3::ZERO, 0), |(sum, count), v| (sum + if v.dot(*middle) < 0.0 { -*v } else { *v }, count + 1));
        (count > 1).then(|| sum.try_normalize()).flatten()
    }
}

/// Angle between two lines, degrees; 90 if one has no direction.
fn angle_deg(a: DVec3, b: DVec3) -> f64 {
    let cosine = (a.dot(b) / (a.length() * b.length()).max(1e-300)).abs();
    cosine.min(1.0).acos().to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn most_slides_and_the_front_agree_on_a_direction() {
        let settings = RailSettings::default();
        let tilted = |degrees: f64, length: f64| {
            let angle = degrees.to_radians();
            DVec3::new(length * angle.cos(), 0.0, length * angle.sin())
        };
        // One is pushed in, one is off by 14 degrees, one is a slide of another kind.
        let shifts = [tilted(1.0, 0.2), -tilted(-1.0, 0.2), tilted(14.0, 0.1), DVec3::new(0.0, 0.2, 0.0)];
        let common = settings.common(&shifts, None).unwrap();
        assert!(angle_deg(common, DVec3::X) < 0.1, "{common}");
        let with_front = settings.common(&shifts[2..3], Some(tilted(15.0, 1.0))).unwrap();
        assert!((angle_deg(with_front, DVec3::X) - 14.5).abs() < 0.1, "{with_front}");
        assert_eq!(settings.common(&shifts[2..3], Some(DVec3::X)), None, "no two agree");
        assert_eq!(settings.common(&shifts[3..], None), None, "a single one");
        assert_eq!(settings.common(&[], Some(DVec3::X)), None);
    }

    #[test]
    fn only_parts_with_a_face_to_the_front_follow_it() {
        let settings = RailSettings::default();
        let drawer = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z];
        assert!(settings.face(&drawer, Vec3::X));
        assert!(!settings.face(&[Vec3::Y; 9], Vec3::X), "a blade");
    }
}
