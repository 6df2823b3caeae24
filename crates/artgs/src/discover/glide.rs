//! Panels that slide within their plane. Where their borders are hidden, surfaces do not hold the slide: it fits after any shift within
//! the plane. Such a panel keeps the shift that explains what moved, along the rails of a slide that surfaces do hold.

use super::cloud::IndexedCloud;
use super::rails::angle_deg;
use super::refinement::points_of_part;
use super::registration::{Matching, free_directions};
use super::scene::Scene;
use artgs_core::{JointEstimate, JointKind, PerState, Rigid, State};
use glam::DVec3;

/// Settings of panels. Calibrated on a cupboard with two sliding doors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GlideSettings {
    /// A direction is free if the mean squared cosine between it and the normals of matched surfaces is below this: normals of a
    /// plane that are wrong by three degrees reach it.
    pub(crate) free: f64,
    /// Points this close match, spacings.
    pub(crate) reach: f64,
    /// Points of each state that are compared.
    pub(crate) points: usize,
    /// Slides whose directions differ by less share their rails, degrees.
    pub(crate) rails_deg: f64,
    /// Largest angle between the slide of a panel and its plane, degrees.
    pub(crate) in_plane_deg: f64,
}

impl Default for GlideSettings {
    fn default() -> Self {
        Self { free: 0.003, reach: 1.5, points: 6000, rails_deg: 10.0, in_plane_deg: 6.0 }
    }
}

impl GlideSettings {
    /// Directions in which surfaces do not hold the slide of a part of which both states show `points`.
    fn free_directions(&self, points: &PerState<IndexedCloud<'_>>, shift: DVec3, spacing: f64) -> Vec<DVec3> {
        let matching = Matching::mutual(&points[State::START], &points[State::END]);
        free_directions(matching, shift, self.reach * spacing, self.points, self.free)
    }

    /// The slide of a panel where its surfaces leave directions free: `fit`, but along those the shift `guess`; none if surfaces
    /// hold it, or if `guess` leaves its plane.
    pub(super) fn held(
        &self,
        points: &PerState<IndexedCloud<'_>>,
        guess: DVec3,
        fit: DVec3,
        spacing: f64,
    ) -> Option<DVec3> {
        let free = self.free_directions(points, fit, spacing);
        self.is_within(&free, guess).then(|| fit + along(&free, guess - fit))
    }

    /// True if a shift is nearly along some of the `free` directions.
    fn is_within(&self, free: &[DVec3], shift: DVec3) -> bool {
        !free.is_empty() && angle_deg(along(free, shift), shift) < self.in_plane_deg
    }

    /// For every part that is a panel, the direction of the rails that it shares with another slide, which surfaces hold.
    pub(super) fn rails(
        &self,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        labels: &PerState<Vec<u16>>,
        parts: &[JointEstimate],
    ) -> Vec<Option<DVec3>> {
        let spacing = f64::from(scene.lengths.spacing);
        let slides = |part: &JointEstimate| part.kind == JointKind::Prismatic && part.parent == 0;
        let free: Vec<Vec<DVec3>> = parts
            .iter()
            .enumerate()
            .map(|(k, part)| {
                if !slides(part) {
                    return Vec::new();
                }
                let own = points_of_part(clouds, labels, k as u16 + 1);
                let own = own.as_ref().map(IndexedCloud::new);
                self.free_directions(&own, part.motion.translation, spacing)
            })
            .collect();
        let shared = |k: usize| {
            let shift = parts[k].motion.translation;
            if !self.is_within(&free[k], shift) {
                return None;
            }
            let held = (0..parts.len()).filter(|&other| other != k && slides(&parts[other]) && free[other].is_empty());
            let off = |other: &usize| angle_deg(parts[*other].motion.translation, shift);
            let nearest = held.min_by(|a, b| off(a).total_cmp(&off(b)))?;
            (off(&nearest) < self.rails_deg).then(|| parts[nearest].motion.translation.normalize())
        };
        (0..parts.len()).map(shared).collect()
    }

    /// Gives panels the direction of their rails.
    pub(super) fn align(
        &self,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        labels: &PerState<Vec<u16>>,
        parts: &mut [JointEstimate],
    ) {
        let rails = self.rails(scene, clouds, labels, parts);
        for (part, rail) in parts.iter_mut().zip(rails) {
            if let Some(rail) = rail {
                part.motion = Rigid::shift(rail * part.motion.translation.dot(rail));
            }
        }
    }
}

/// What a shift does along orthonormal directions.
fn along(directions: &[DVec3], shift: DVec3) -> DVec3 {
    directions.iter().map(|d| *d * d.dot(shift)).sum()
}

#[cfg(test)]
mod tests {
    use super::super::cloud::Cloud;
    use super::*;
    use glam::Vec3;

    const SPACING: f64 = 0.01;

    /// What a state shows of a panel of 60 by 40 points, with errors of depth that differ between states; with its borders if `whole`.
    fn panel(shift: DVec3, whole: bool) -> Cloud {
        let mut cloud = Cloud::default();
        let mut add = |x: f32, y: f32, z: f32, normal: Vec3| {
            cloud.points.push(Vec3::new(x, y, z) + shift.as_vec3());
            cloud.normals.push(normal);
            cloud.colors.push(Vec3::ONE);
            cloud.roughness.push(0.0);
        };
        for i in 0..60 {
            for k in 0..40 {
                let error = 1e-4 * (0.7 * i as f32 + 1.3 * k as f32 + 40.0 * shift.x as f32).sin();
                add(SPACING as f32 * i as f32, error, SPACING as f32 * k as f32, Vec3::NEG_Y);
            }
        }
        if whole {
            (0..40).for_each(|k| add(0.0, 0.01, SPACING as f32 * k as f32, Vec3::NEG_X));
            (0..60).for_each(|i| add(SPACING as f32 * i as f32, 0.01, 0.0, Vec3::NEG_Z));
        }
        cloud
    }

    #[test]
    fn a_panel_without_borders_keeps_the_shift_within_its_plane_that_it_began_with() {
        let clouds = PerState::new(panel(DVec3::ZERO, false), panel(DVec3::new(-0.2, 0.003, 0.0), false));
        let indexed = clouds.as_ref().map(IndexedCloud::new);
        let (guess, fit) = (DVec3::new(-0.2, 0.0, 0.0), DVec3::new(-0.19, 0.003, 0.04));
        let held = GlideSettings::default().held(&indexed, guess, fit, SPACING).expect("free directions");
        assert!(held.distance(DVec3::new(-0.2, 0.003, 0.0)) < 1e-6, "{held}");
    }

    #[test]
    fn surfaces_hold_a_panel_whose_borders_are_seen() {
        let shift = DVec3::new(-0.2, 0.0, 0.0);
        let clouds = PerState::new(panel(DVec3::ZERO, true), panel(shift, true));
        let indexed = clouds.as_ref().map(IndexedCloud::new);
        assert_eq!(GlideSettings::default().held(&indexed, shift, shift, SPACING), None);
    }
}
