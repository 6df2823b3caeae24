//! Relative motions of pairs of links over all poses in which they must not collide.

use crate::geometry::hull::Hull;
use crate::geometry::topology::points;
use crate::limits::Range;
use crate::settings::PoseSettings;
use artgs_core::{Asset, AssetJoint, JointKind, Mesh, Rigid, State};
use glam::DVec3;
use std::collections::BTreeSet;

/// Poses of the second link of a pair in the frame of the first one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RelativeMotion {
    /// First pose.
    pub start: Rigid,
    /// Translation from there, in the frame of the second link; zero for a single pose.
    pub way: DVec3,
}

/// Different motions of two links relative to each other, long slides first.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PairMotions {
    /// First and second link.
    pub links: [usize; 2],
    /// At least one.
    pub motions: Vec<RelativeMotion>,
}

/// Link poses in the frame of the object, and a translation of some links from there.
#[derive(Clone, Debug)]
pub(crate) struct Stance {
    /// One pose per link.
    pub poses: Vec<Rigid>,
    /// The links that slide, and how far.
    pub slide: Option<(Vec<bool>, DVec3)>,
}

impl Stance {
    /// Poses in which nothing slides.
    pub(crate) fn still(poses: Vec<Rigid>) -> Self {
        Self { poses, slide: None }
    }

    fn between(&self, a: usize, b: usize) -> RelativeMotion {
        let start = self.poses[a].inverse() * self.poses[b];
        let way = match &self.slide {
            Some((moved, way)) => *way * (f64::from(moved[b]) - f64::from(moved[a])),
            None => DVec3::ZERO,
        };
        RelativeMotion { start, way: self.poses[b].inverse().turn(way) }
    }
}

impl RelativeMotion {
    /// The volume through which a hull of the second link slides, in the frame of this link; none if it does not, or if it is
    /// thinner than `thinnest`.
    pub(crate) fn swept(&self, hull: &Hull, thinnest: f64) -> Option<Hull> {
        if self.way == DVec3::ZERO {
            return None;
        }
        let ends = hull.points().iter().flat_map(|p| [*p, *p + self.way]);
        Hull::of(&ends.collect::<Vec<_>>(), thinnest)
    }

    /// Key for distinct motions.
    fn bits(&self) -> [u64; 10] {
        let ([x, y, z, w], [tx, ty, tz]) = (self.start.rotation.to_array(), self.start.translation.to_array());
        let [u, v, r] = self.way.to_array();
        [x, y, z, w, tx, ty, tz, u, v, r].map(f64::to_bits)
    }
}

/// The different relative motions of every pair of `links` links. Two links have the same relative pose in many stances: it
/// occurs once.
pub(crate) fn pair_motions(stances: &[Stance], links: usize) -> Vec<PairMotions> {
    let pairs = (0..links).flat_map(|a| (a + 1..links).map(move |b| [a, b]));
    let of_pair = |[a, b]: [usize; 2]| {
        let mut seen = BTreeSet::new();
        let all = stances.iter().map(|stance| stance.between(a, b));
        let mut motions: Vec<RelativeMotion> = all.filter(|motion| seen.insert(motion.bits())).collect();
        motions.sort_by(|x, y| y.way.length().total_cmp(&x.way.length()));
        PairMotions { links: [a, b], motions }
    };
    pairs.map(of_pair).collect()
}

/// Stances in which no penetration is allowed: both observed states, and every joint across its limits while the others are at
/// zero, or across its free range while they are in either observed state. A slide is one stance, a hinge is many.
pub(crate) fn stances(asset: &Asset, ranges: &[Option<Range>], settings: &PoseSettings) -> Vec<Stance> {
    let zero = vec![0.0; asset.links.len()];
    let observed = State::ALL.map(|state| asset.observed(state));
    let mut out: Vec<Stance> =
        observed.iter().chain([&zero]).map(|values| Stance::still(asset.poses(values))).collect();
    for (i, _, joint) in asset.movable() {
        let [least, most] = settings.hinge;
        let arc = (joint.limits[1] - joint.limits[0]) * arm(joint, &asset.links[i].visual.mesh);
        let alone = ((arc / settings.step) as usize + 1).clamp(least, most);
        let free =
            |state: State| ranges.get(i).and_then(Option::as_ref).map_or(joint.limits, |range| range.free[state]);
        let with_others = State::ALL.map(|state| (&observed[state.index()], free(state), settings.with_others));
        for (others, [lower, upper], poses) in std::iter::once((&zero, joint.limits, alone)).chain(with_others) {
            let at = |value: f64| {
                let mut values = others.clone();
                values[i] = value;
                asset.poses(&values)
            };
            match joint.kind {
                JointKind::Prismatic => out.push(slide(asset, i, at(lower), &at(upper))),
                _ => out.extend(
                    (0..poses)
                        .map(|step| Stance::still(at(lower + (upper - lower) * step as f64 / (poses - 1) as f64))),
                ),
            }
        }
    }
    out
}

/// The slide of a link and all that it carries from one stance to another.
fn slide(asset: &Asset, link: usize, from: Vec<Rigid>, to: &[Rigid]) -> Stance {
    let carried = |mut q: usize| loop {
        match asset.links[q].parent {
            _ if q == link => return true,
            Some(parent) => q = parent,
            None => return false,
        }
    };
    let way = to[link].translation - from[link].translation;
    Stance { slide: Some(((0..from.len()).map(carried).collect(), way)), poses: from }
}

/// Distance of the farthest point of a part from its axis, metres.
pub(crate) fn arm(joint: &AssetJoint, mesh: &Mesh) -> f64 {
    points(mesh).map(|p| p.reject_from_normalized(joint.axis).length()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(angle: f64) -> Rigid {
        Rigid::about(DVec3::Z, DVec3::new(0.3, 0.1, 0.0), angle)
    }

    #[test]
    fn a_relative_motion_occurs_once_and_slides_come_first() {
        // A base, a drawer that slides by half a metre, and a door.
        let poses = |door: f64| vec![Rigid::IDENTITY, Rigid::shift(DVec3::Y), turned(door)];
        let slide = (vec![false, true, false], DVec3::new(0.0, -0.5, 0.0));
        let stances =
            [Stance::still(poses(0.0)), Stance::still(poses(0.4)), Stance { poses: poses(0.4), slide: Some(slide) }];
        let pairs = pair_motions(&stances, 3);
        assert_eq!(pairs.iter().map(|p| p.links).collect::<Vec<_>>(), [[0, 1], [0, 2], [1, 2]]);
        assert_eq!(pairs.iter().map(|p| p.motions.len()).collect::<Vec<_>>(), [2, 2, 3]);
        assert_eq!(pairs[0].motions[0].way, DVec3::new(0.0, -0.5, 0.0));
        // In the frame of the door, the drawer goes one way if the door goes the other.
        let RelativeMotion { start, way } = pairs[2].motions[0];
        let end = start * Rigid::shift(way);
        let wanted = Rigid::shift(DVec3::new(0.0, 0.5, 0.0)).inverse() * turned(0.4);
        assert!(end.apply(DVec3::ONE).distance(wanted.apply(DVec3::ONE)) < 1e-12);
    }

    #[test]
    fn a_swept_hull_holds_all_places_of_the_way() {
        let corners = (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2 & 1)));
        let cube = Hull::of(&corners.collect::<Vec<_>>(), 1e-3).unwrap();
        let motion = RelativeMotion { start: Rigid::IDENTITY, way: DVec3::new(2.0, 0.0, 0.0) };
        let swept = motion.swept(&cube, 1e-3).unwrap();
        assert!((swept.volume() - 3.0).abs() < 1e-9 && swept.bounds() == [DVec3::ZERO, DVec3::new(3.0, 1.0, 1.0)]);
        assert!(RelativeMotion { way: DVec3::ZERO, ..motion }.swept(&cube, 1e-3).is_none());
    }
}
