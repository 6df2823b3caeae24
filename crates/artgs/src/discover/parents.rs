//! Which part carries which. A part is first taken to hang on the static part. If no joint there explains its motion, or
//! the joint would be in mid-air, the parts beside it are tried: a drawer in a door moves on a simple joint against the
//! door.

use super::cloud::{Cloud, IndexedCloud};
use super::joints::{Decided, JointFit};
use artgs_core::{JointEstimate, JointKind, PerState, Rigid, State};
use glam::DVec3;

/// Settings of the search for parents. Lengths are fractions of the object's diagonal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ParentSettings {
    /// A hinge passes this close to both parts that it connects, at one place.
    pub(crate) pivot: f64,
    /// A part is beside another if points of it are this close.
    pub(crate) contact: f64,
    /// A part hangs free of the static part if in one of the states no points of it are this close.
    pub(crate) detached: f64,
    /// Fewer points are noise,
    pub(crate) least_points: usize,
    /// and so is a smaller share of the points of a part.
    pub(crate) least_share: f64,
    /// A part that has a possible joint to the static part must move less against its parent: its mean motion must be below
    /// this share of its mean motion in the world.
    pub(crate) smaller: f64,
    /// Parts that move less against another part move with it, depth tolerances.
    pub(crate) least_motion: f64,
    /// A part that turns with another one turns by more than this, degrees,
    pub(crate) least_shared_deg: f64,
    /// and by less than this against it, degrees.
    pub(crate) shared_deg: f64,
}

impl Default for ParentSettings {
    fn default() -> Self {
        Self {
            pivot: 0.05,
            contact: 0.03,
            detached: 0.03,
            least_points: 8,
            least_share: 0.005,
            smaller: 0.7,
            least_motion: 3.0,
            least_shared_deg: 10.0,
            shared_deg: 3.0,
        }
    }
}

/// How parts are numbered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Numbering {
    /// As they are given: only earlier parts carry later ones.
    Kept,
    /// Parts come after the part that carries them.
    ParentsFirst,
}

/// Finds the joints of all parts and what carries them.
pub(super) struct Carriers<'a> {
    pub(super) fit: &'a JointFit<'a>,
    pub(super) settings: &'a ParentSettings,
    /// Points of every part in both states, the static part first.
    pub(super) clouds: Vec<PerState<Cloud>>,
    pub(super) numbering: Numbering,
}

impl Carriers<'_> {
    /// The joints of all parts, of which those against the static part were `decided`. `kinds` are the types that the user
    /// gave.
    pub(super) fn joints(&self, decided: &[Decided], kinds: &[Option<JointKind>]) -> Vec<JointEstimate> {
        let on_base = |(k, d): (usize, &Decided)| {
            let rests = d.general.is_none() && !self.in_mid_air(k, &d.joint) && !self.turns_along(k, decided, kinds);
            rests.then_some(d.joint)
        };
        let mut settled: Vec<Option<JointEstimate>> = decided.iter().enumerate().map(on_base).collect();
        // A part that is carried may carry others.
        while let Some((k, joint)) = self.next_carried(&settled, decided, kinds) {
            settled[k] = Some(joint);
        }
        let otherwise = |(k, joint): (usize, Option<JointEstimate>)| {
            let general = decided[k].general.filter(|_| kinds[k].is_none());
            let screw = general.filter(|g| self.turns_about_itself(k, &g.motion));
            joint.or(screw).unwrap_or(decided[k].joint)
        };
        settled.into_iter().enumerate().map(otherwise).collect()
    }

    /// Of all unsettled parts and all settled ones that may carry them, those that move least against each other.
    fn next_carried(
        &self,
        settled: &[Option<JointEstimate>],
        decided: &[Decided],
        kinds: &[Option<JointKind>],
    ) -> Option<(usize, JointEstimate)> {
        let mut best: Option<(f64, usize, JointEstimate)> = None;
        for child in (0..settled.len()).filter(|&k| settled[k].is_none()) {
            for (carrier, joint) in settled.iter().enumerate() {
                let Some(joint) = joint.filter(|_| self.numbering == Numbering::ParentsFirst || carrier < child) else {
                    continue;
                };
                let found = self.carried(child, &decided[child], carrier, &joint, kinds[child]);
                if let Some((travel, joint)) = found.filter(|f| best.is_none_or(|b| f.0 < b.0)) {
                    best = Some((travel, child, joint));
                }
            }
        }
        best.map(|(_, child, joint)| (child, joint))
    }

    /// The joint of part `child` (from 0) against part `carrier` with its mean motion there; none if there is no simple one.
    fn carried(
        &self,
        child: usize,
        decided: &Decided,
        carrier: usize,
        carrier_joint: &JointEstimate,
        known: Option<JointKind>,
    ) -> Option<(f64, JointEstimate)> {
        let [own, other] = [child, carrier].map(|k| &self.clouds[k + 1]);
        if !State::ALL.iter().all(|s| self.are_near(&own[*s], &other[*s], self.settings.contact)) {
            return None;
        }
        // As seen from the carrier, which then does not move.
        let from_carrier = carrier_joint.motion.inverse();
        let seen = |clouds: &PerState<Cloud>| {
            PerState::new(clouds[State::START].clone(), moved(&clouds[State::END], &from_carrier))
        };
        let (own, other) = (seen(own), seen(other));
        let in_world = decided.general.unwrap_or(decided.joint).motion;
        let guess = JointEstimate::new(JointKind::Screw, from_carrier * in_world);
        let found = self.fit.decide(&guess, &own, known);
        if found.general.is_some() || !found.exact {
            return None;
        }
        let points = &own[State::START];
        let travel = mean_motion(points, &found.joint.motion);
        let most = if decided.general.is_some() {
            f64::INFINITY
        } else {
            self.settings.smaller * mean_motion(points, &in_world)
        };
        let least = self.settings.least_motion * self.fit.tolerance;
        let hinge = found.joint.kind != JointKind::Prismatic;
        if travel < least || travel > most || (hinge && !self.is_pivot(&found.joint.motion, &own, &other)) {
            return None;
        }
        let motion = carrier_joint.motion * found.joint.motion;
        Some((travel, JointEstimate { motion, parent: carrier + 1, ..found.joint }))
    }

    /// True for a hinge (of part `k`, from 0) that connects its part with nothing static, if the part is away from all that
    /// is static in one of the states.
    fn in_mid_air(&self, k: usize, joint: &JointEstimate) -> bool {
        let (own, base) = (&self.clouds[k + 1], &self.clouds[0]);
        joint.kind == JointKind::Revolute
            && own.iter().all(|c| c.len() >= self.settings.least_points)
            && !self.is_pivot(&joint.motion, own, base)
            && State::ALL.iter().any(|s| !self.are_near(&own[*s], &base[*s], self.settings.detached))
    }

    /// True for a hinge (of part `k`, from 0) of a part that slides on a larger one with a hinge: two hinges with equal angles, parallel axes
    /// and parts that stay side by side would be a coincidence.
    fn turns_along(&self, k: usize, decided: &[Decided], kinds: &[Option<JointKind>]) -> bool {
        let is_hinge = |d: &Decided| {
            let turn = d.joint.motion.angle().to_degrees();
            d.general.is_none() && d.joint.kind == JointKind::Revolute && turn > self.settings.least_shared_deg
        };
        let size = |k: usize| self.clouds[k + 1].iter().map(Cloud::len).sum::<usize>();
        let may_carry = |j: usize| {
            let apart = decided[j].joint.motion.inverse() * decided[k].joint.motion;
            (self.numbering == Numbering::ParentsFirst || j < k)
                && is_hinge(&decided[j])
                && size(j) > size(k)
                && apart.angle().to_degrees() < self.settings.shared_deg
        };
        let slides_on =
            |j: usize| self.carried(k, &decided[k], j, &decided[j].joint, Some(JointKind::Prismatic)).is_some();
        kinds[k].is_none()
            && is_hinge(&decided[k])
            && (0..decided.len()).any(|j| j != k && may_carry(j) && slides_on(j))
    }

    /// True if the axis of a motion passes near both parts at one place. The parts are seen from the second one.
    fn is_pivot(&self, motion: &Rigid, own: &PerState<Cloud>, other: &PerState<Cloud>) -> bool {
        let (screw, reach) = (motion.screw(), self.settings.pivot * f64::from(self.fit.lengths.diagonal));
        let along = |clouds: &PerState<Cloud>| {
            let points = clouds.iter().flat_map(|c| &c.points).map(|p| p.as_dvec3() - screw.origin);
            let near = points.filter(|p| p.reject_from_normalized(screw.axis).length() < reach);
            let mut places: Vec<f64> = near.map(|p| p.dot(screw.axis)).collect();
            places.sort_by(f64::total_cmp);
            places
        };
        let (own, other) = (along(own), along(other));
        own.iter().any(|at| {
            let next = other.partition_point(|o| o < at);
            let beside = other[next.saturating_sub(1)..].iter().take(2);
            beside.into_iter().any(|o| (o - at).abs() < 2.0 * reach)
        })
    }

    /// True if enough points of two clouds are closer to each other than a share of the diagonal.
    fn are_near(&self, own: &Cloud, other: &Cloud, share: f64) -> bool {
        let reach = (share * f64::from(self.fit.lengths.diagonal)) as f32;
        let least = self.settings.least_points.max((self.settings.least_share * own.len() as f64) as usize);
        meet(own, other, reach, least)
    }

    /// True if the axis of a motion passes through its part or near it, as that of a screw does.
    fn turns_about_itself(&self, k: usize, motion: &Rigid) -> bool {
        let (screw, reach) = (motion.screw(), self.settings.pivot * f64::from(self.fit.lengths.diagonal));
        let from_axis = |p: DVec3| (p - screw.origin).reject_from_normalized(screw.axis).length();
        let own = &self.clouds[k + 1][State::START];
        let distances = || own.points.iter().map(|p| from_axis(p.as_dvec3()));
        let mean = distances().sum::<f64>() / own.len().max(1) as f64;
        from_axis(own.middle().as_dvec3()) < 0.5 * mean || distances().fold(f64::INFINITY, f64::min) < reach
    }
}

/// True if at least so many points of each cloud are within reach of the other: a few points with a wrong label are near many
/// points, and are not a surface.
fn meet(a: &Cloud, b: &Cloud, reach: f32, least: usize) -> bool {
    let near = |own: &Cloud, other: &Cloud| {
        let other = IndexedCloud::new(other);
        own.points.iter().filter(|p| other.nearest_within(**p, reach * reach).is_some()).take(least).count() >= least
    };
    near(a, b) && near(b, a)
}

fn mean_motion(cloud: &Cloud, motion: &Rigid) -> f64 {
    let points = cloud.points.iter().map(|p| p.as_dvec3());
    points.map(|p| motion.apply(p).distance(p)).sum::<f64>() / cloud.len().max(1) as f64
}

fn moved(cloud: &Cloud, motion: &Rigid) -> Cloud {
    let mut out = cloud.clone();
    out.points.iter_mut().for_each(|p| *p = motion.apply(p.as_dvec3()).as_vec3());
    out.normals.iter_mut().for_each(|n| *n = motion.turn(n.as_dvec3()).as_vec3());
    out
}

/// Numbers parts so that each comes after the one that carries it and else in their order; labels follow.
pub(super) fn parents_first(parts: &mut Vec<JointEstimate>, labels: &mut PerState<Vec<u16>>) {
    // Old numbers in the new order, the static part first.
    let mut order = vec![0usize];
    while let Some(next) = (1..=parts.len()).find(|k| !order.contains(k) && order.contains(&parts[k - 1].parent)) {
        order.push(next);
    }
    // Parents form a tree, so that every part was reached.
    debug_assert_eq!(order.len(), parts.len() + 1);
    let mut number = vec![0usize; parts.len() + 1];
    order.iter().enumerate().for_each(|(new, old)| number[*old] = new);
    *parts = order[1..].iter().map(|old| parts[old - 1]).collect();
    parts.iter_mut().for_each(|p| p.parent = number[p.parent]);
    labels.iter_mut().flatten().for_each(|l| *l = number[usize::from(*l)] as u16);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::DiscoverConfig;
    use crate::discover::joints::JointSettings;
    use crate::discover::scene::Lengths;

    #[test]
    fn stray_points_near_a_part_are_not_a_surface_that_it_touches() {
        let cloud = |points: Vec<glam::Vec3>| Cloud {
            normals: vec![glam::Vec3::Z; points.len()],
            colors: vec![glam::Vec3::ONE; points.len()],
            points,
            ..Cloud::default()
        };
        let sheet = |z: f32| (0..400).map(|i| glam::Vec3::new((i % 20) as f32, (i / 20) as f32, z) * 0.01).collect();
        let (own, far) = (cloud(sheet(0.0)), sheet(30.0));
        let strays = cloud([far, vec![glam::Vec3::splat(0.02); 4]].concat());
        assert!(!meet(&own, &strays, 0.05, 8));
        assert!(meet(&own, &cloud(sheet(1.0)), 0.05, 8));
    }

    #[test]
    fn parts_come_after_what_carries_them() {
        let part = |parent, shift| JointEstimate {
            parent,
            ..JointEstimate::new(JointKind::Prismatic, Rigid::shift(DVec3::X * shift))
        };
        let mut parts = vec![part(3, 1.0), part(0, 2.0), part(2, 3.0), part(0, 4.0)];
        let mut labels = PerState::new(vec![0, 1, 2, 3, 4], vec![4, 3]);
        parents_first(&mut parts, &mut labels);
        let shifts: Vec<f64> = parts.iter().map(|p| p.motion.translation.x).collect();
        assert_eq!(shifts, [2.0, 3.0, 1.0, 4.0]);
        assert_eq!(parts.iter().map(|p| p.parent).collect::<Vec<_>>(), [0, 1, 2, 0]);
        assert_eq!(labels, PerState::new(vec![0, 3, 1, 2, 4], vec![4, 2]));
        let before = (parts.clone(), labels.clone());
        parents_first(&mut parts, &mut labels);
        assert_eq!((parts, labels), before, "the order is kept where it is right");
    }

    /// A plate in the plane y = 0 with a box behind it, in both states.
    fn plate([x0, x1]: [f64; 2], motion: &Rigid) -> PerState<Cloud> {
        let mut start = Cloud::default();
        let mut add = |p: DVec3, n: DVec3| {
            start.points.push(p.as_vec3());
            start.normals.push(n.as_vec3());
            start.colors.push(glam::Vec3::ONE);
            start.roughness.push(0.0);
        };
        let count = ((x1 - x0) / 0.01) as usize;
        for (i, j) in (0..count).flat_map(|i| (0..30).map(move |j| (i, j))) {
            add(DVec3::new(x0 + 0.01 * i as f64, 0.0, 0.01 * j as f64), DVec3::NEG_Y);
        }
        for (i, j) in (0..15).flat_map(|i| (0..30).map(move |j| (i, j))) {
            add(DVec3::new(x0, 0.01 * i as f64, 0.01 * j as f64), DVec3::NEG_X);
            add(DVec3::new(x0 + 0.005 * i as f64, 0.005 * j as f64, 0.0), DVec3::NEG_Z);
        }
        let end = moved(&start, motion);
        PerState::new(start, end)
    }

    /// Joints of a door from x = 0 to 0.6 that turns by 47 degrees and of a second part, given as hinges on posts.
    fn joints_of(second: [f64; 2], motion: Rigid) -> Vec<JointEstimate> {
        let (lengths, settings, config) =
            (Lengths { spacing: 0.01, diagonal: 1.6 }, JointSettings::default(), DiscoverConfig::default());
        let fit = JointFit {
            lengths: &lengths,
            tolerance: 0.012,
            settings: &settings,
            config: &config,
            spreading: false,
            opening: None,
            last: true,
        };
        let motions = [Rigid::about(DVec3::Z, DVec3::ZERO, (-47f64).to_radians()), motion];
        let mut base = Cloud::default();
        for (post, z) in motions.iter().flat_map(|m| (0..60).map(move |z| (m.screw().origin, z))) {
            base.points.push(DVec3::new(post.x, post.y, 0.005 * f64::from(z)).as_vec3());
            base.normals.push(glam::Vec3::NEG_Y);
            base.colors.push(glam::Vec3::ONE);
            base.roughness.push(0.0);
        }
        let clouds =
            vec![PerState::new(base.clone(), base), plate([0.0, 0.6], &motions[0]), plate(second, &motions[1])];
        let hinge =
            |m: &Rigid| Decided { joint: JointEstimate::new(JointKind::Revolute, *m), general: None, exact: true };
        let settings = ParentSettings::default();
        let carriers = Carriers { fit: &fit, settings: &settings, clouds, numbering: Numbering::ParentsFirst };
        carriers.joints(&motions.map(|m| hinge(&m)), &[None, None])
    }

    #[test]
    fn what_turns_with_a_door_and_slides_on_it_is_no_hinge_of_its_own() {
        let door = Rigid::about(DVec3::Z, DVec3::ZERO, (-47f64).to_radians());
        let drawer = joints_of([0.05, 0.35], door * Rigid::shift(DVec3::new(0.0, -0.09, 0.0)))[1];
        assert_eq!((drawer.kind, drawer.parent), (JointKind::Prismatic, 1), "{drawer:?}");
        let slide = (door.inverse() * drawer.motion).translation;
        assert!(slide.distance(DVec3::new(0.0, -0.09, 0.0)) < 0.002, "{slide}");
        // A second door that opens as far, and one that opens by 52 degrees.
        for degrees in [-47f64, -52.0] {
            let other = Rigid::about(DVec3::Z, DVec3::new(0.62, 0.0, 0.0), degrees.to_radians());
            let second = joints_of([0.62, 1.1], other)[1];
            assert_eq!((second.kind, second.parent), (JointKind::Revolute, 0), "{second:?}");
        }
    }
}
