//! Flat faces of the surface, and the motions that bring a face of one state onto a face of the other one. Neighbouring
//! doors and drawers form one cluster of moved points; their faces are separate.

use super::cloud::{Cloud, IndexedCloud};
use super::plane_fit::fit_plane;
use super::poses::Pose;
use glam::{Mat3, Quat, Vec3};

/// Settings of the search for flat faces. Lengths are in spacings unless said otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FacetSettings {
    /// Points this far from a plane are on it.
    pub(crate) thickness: f32,
    /// Least cosine between the normals of a point and of its plane.
    pub(crate) facing: f32,
    /// Steps between neighbouring points of a face.
    pub(crate) reach: f32,
    /// Least points of a face.
    pub(crate) least_points: usize,
    /// Faces of a state that are used, largest first.
    pub(crate) most: usize,
    /// Faces that turn less are parallel: one slides onto the other, radians.
    pub(crate) parallel: f32,
    /// Faces that turn less give no hinge, and neither do those that turn by nearly half a circle, radians.
    pub(crate) least_turn: f32,
    /// A hinge on the border of a face is at most so far from the other face, fraction of the diagonal.
    pub(crate) hinge_gap: f32,
}

impl Default for FacetSettings {
    fn default() -> Self {
        Self {
            thickness: 0.4,
            facing: 0.97,
            reach: 1.8,
            least_points: 40,
            most: 60,
            parallel: 0.05,
            least_turn: 0.03,
            hinge_gap: 0.04,
        }
    }
}

/// A flat face: connected points on a plane.
#[derive(Clone, Debug)]
pub(super) struct Facet {
    /// Indices into the cloud.
    pub(super) members: Vec<usize>,
    pub(super) centre: Vec3,
    /// Unit normal towards the cameras.
    pub(super) normal: Vec3,
}

impl FacetSettings {
    /// The flat faces among the points `members`, largest first.
    pub(super) fn find(&self, cloud: &Cloud, members: &[usize], spacing: f32) -> Vec<Facet> {
        let own = cloud.select(members);
        let indexed = IndexedCloud::new(&own);
        let mut free = vec![true; own.len()];
        let mut seeds: Vec<usize> = (0..own.len()).collect();
        seeds.sort_by(|a, b| own.roughness[*a].total_cmp(&own.roughness[*b]).then(a.cmp(b)));
        let mut facets = Vec::new();
        for seed in seeds {
            if !free[seed] {
                continue;
            }
            let (grown, centre, normal) = self.grow(&indexed, &free, seed, spacing);
            if grown.len() < self.least_points {
                free[seed] = false;
                continue;
            }
            grown.iter().for_each(|&i| free[i] = false);
            facets.push(Facet { members: grown.into_iter().map(|i| members[i]).collect(), centre, normal });
        }
        facets.sort_by_key(|f| std::cmp::Reverse(f.members.len()));
        facets.truncate(self.most);
        facets
    }

    /// Grows a plane from a point over its free neighbours; it is fitted again each time the face has doubled.
    fn grow(&self, own: &IndexedCloud<'_>, free: &[bool], seed: usize, spacing: f32) -> (Vec<usize>, Vec3, Vec3) {
        /// Neighbours that are looked at.
        const NEIGHBOURS: usize = 12;
        let cloud = own.cloud;
        let (mut centre, mut normal) = (cloud.points[seed], cloud.normals[seed]);
        let mut taken = std::collections::BTreeSet::from([seed]);
        let (mut group, mut next, mut refit) = (vec![seed], 0, 16);
        while next < group.len() {
            let p = cloud.points[group[next]];
            next += 1;
            own.nearest_n(p, NEIGHBOURS, (self.reach * spacing).powi(2), |j, _| {
                let on_plane = (cloud.points[j] - centre).dot(normal).abs() < self.thickness * spacing;
                if free[j] && on_plane && cloud.normals[j].dot(normal) > self.facing && taken.insert(j) {
                    group.push(j);
                }
            });
            if group.len() >= refit {
                (centre, normal) = plane(cloud, &group, normal);
                refit *= 2;
            }
        }
        (centre, normal) = plane(cloud, &group, normal);
        (group, centre, normal)
    }

    /// Poses that bring a face onto another one: along its normal if they are parallel, and about its borders and by its
    /// middle if not.
    pub(super) fn poses(&self, cloud: &Cloud, from: &Facet, to: &Facet, diagonal: f32) -> Vec<Pose> {
        let turn = from.normal.angle_between(to.normal);
        let mut out = Vec::new();
        if turn < self.parallel {
            let shift = from.normal * (to.centre - from.centre).dot(from.normal);
            out.push(Pose { rotation: Mat3::IDENTITY, translation: shift });
        }
        if turn < self.least_turn || turn > std::f32::consts::PI - self.least_turn {
            return out;
        }
        let axis = from.normal.cross(to.normal).normalize();
        let rotation = Mat3::from_quat(Quat::from_axis_angle(axis, turn));
        let across = axis.cross(from.normal);
        let along = || from.members.iter().map(|&i| (cloud.points[i] - from.centre).dot(across));
        let (lo, hi) = along().fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), x| (lo.min(x), hi.max(x)));
        for border in [lo, hi] {
            let pivot = from.centre + across * border;
            let gap = (to.centre - pivot).dot(to.normal);
            if gap.abs() < self.hinge_gap * diagonal {
                out.push(Pose { rotation, translation: pivot + to.normal * gap - rotation * pivot });
            }
        }
        out.push(Pose { rotation, translation: to.centre - rotation * from.centre });
        out
    }
}

/// Middle and normal of a group of points, on the side of `towards`.
fn plane(cloud: &Cloud, group: &[usize], towards: Vec3) -> (Vec3, Vec3) {
    let points: Vec<Vec3> = group.iter().map(|&i| cloud.points[i]).collect();
    let centre = points.iter().sum::<Vec3>() / points.len() as f32;
    if points.len() < 3 {
        return (centre, towards);
    }
    let normal = fit_plane(&points).0;
    (centre, if normal.dot(towards) < 0.0 { -normal } else { normal })
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::Rigid;
    use glam::DVec3;

    /// A leaf of 30 by 20 points at distance 1, moved by `motion`.
    fn add_leaf(cloud: &mut Cloud, motion: &Rigid) {
        for i in 0..600 {
            let p = DVec3::new(f64::from(i % 30), 0.0, f64::from(i / 30));
            cloud.points.push(motion.apply(p).as_vec3());
            cloud.normals.push(motion.turn(DVec3::NEG_Y).as_vec3());
            cloud.colors.push(Vec3::ONE);
            cloud.roughness.push(0.0);
        }
    }

    #[test]
    fn adjacent_leaves_at_different_angles_are_separate_faces() {
        let mut cloud = Cloud::default();
        add_leaf(&mut cloud, &Rigid::IDENTITY);
        // Hinged where the first one ends.
        let turn = Rigid::about(DVec3::Z, DVec3::new(30.0, 0.0, 0.0), -0.3);
        add_leaf(&mut cloud, &(turn * Rigid::shift(DVec3::X * 30.0)));
        let all: Vec<usize> = (0..cloud.len()).collect();
        let facets = FacetSettings::default().find(&cloud, &all, 1.0);
        assert_eq!(facets.len(), 2);
        assert!(facets.iter().all(|f| f.members.len() > 550));
    }

    #[test]
    fn a_leaf_is_brought_onto_its_other_state_by_a_slide_or_a_hinge_on_its_border() {
        let settings = FacetSettings::default();
        let slide = Rigid::shift(DVec3::Y * -7.0);
        let hinge = Rigid::about(DVec3::Z, DVec3::new(29.0, 0.0, 0.0), 1.2);
        for truth in [slide, hinge] {
            let mut cloud = Cloud::default();
            add_leaf(&mut cloud, &Rigid::IDENTITY);
            add_leaf(&mut cloud, &truth);
            let facet = |members: std::ops::Range<usize>| {
                settings.find(&cloud, &members.collect::<Vec<_>>(), 1.0).swap_remove(0)
            };
            let poses = settings.poses(&cloud, &facet(0..600), &facet(600..1200), 100.0);
            let error = |pose: &Pose| {
                let gaps = (0..600).map(|i| pose.apply(cloud.points[i]).distance(cloud.points[600 + i]));
                gaps.fold(0.0, f32::max)
            };
            assert!(poses.iter().any(|p| error(p) < 0.01), "{truth:?}");
        }
    }
}
