//! Slides that are missing, where depth noise spreads points: a motion that takes points to places that nobody sees costs little, so that
//! it may hold the front of a drawer that moves otherwise. Fronts that no motion takes onto a surface show which slide is missing.

use super::Discovery;
use super::confidence::{DOUBTFUL, doubtful};
use super::exchanges::landings;
use super::front::Front;
use super::front_slides::{STEP, all_lengths};
use super::landing::Landing;
use super::refinement::{Parts, Refinement};
use super::visibility::Occupancy;
use artgs_core::{PerState, Rigid, State};
use std::ops::RangeInclusive;

/// Least cosine between the front of the object and the normals of points that face it.
const FACING: f32 = 0.9;

/// What was found with a slide added, or in the place of a doubtful motion, while the parts then explain more for certain.
pub(super) fn with_missing(
    mut found: Discovery,
    movable: &RangeInclusive<usize>,
    work: &Refinement<'_>,
    result: &dyn Fn(Parts) -> Discovery,
) -> Discovery {
    /// Sets of motions that are tried at most: each needs a refinement.
    const TRIALS: usize = 6;
    /// What a change must raise the sum of quality and share of explained fronts by.
    const WORTH: f64 = 0.01;
    /// Share of the explained points that must remain explained.
    const KEPT: f64 = 0.97;
    let Some(front) = work.front else { return found };
    let total = work.evidence.total();
    let mut tried = 0;
    'improved: loop {
        let fronts = Fronts::of(&found, front, work);
        let value = found.quality(total) - fronts.open_share();
        let motions: Vec<Rigid> = found.parts.iter().map(|p| p.motion).collect();
        for slide in fronts.slides(&found, front, work) {
            for motions in sets_with(slide, &motions, &doubtful(&found, DOUBTFUL), *movable.end(), found.spacing) {
                if tried == TRIALS {
                    return found;
                }
                tried += 1;
                let other = result(work.parts(&motions, movable));
                let better = other.quality(total) - Fronts::of(&other, front, work).open_share() > value + WORTH;
                if better && movable.contains(&other.parts.len()) && other.explained() >= KEPT * found.explained() {
                    found = other;
                    continue 'improved;
                }
            }
        }
        return found;
    }
}

/// `motions` with `slide` in the place of each doubtful one, and, if fewer than `most`, with it added. Of parts that move alike, one
/// motion is enough: they are separated later.
fn sets_with(slide: Rigid, motions: &[Rigid], doubtful: &[usize], most: usize, spacing: f64) -> Vec<Vec<Rigid>> {
    /// Slides this close are the same, spacings.
    const SAME: f64 = 2.0;
    let same = |m: &Rigid| m.angle() == 0.0 && m.translation.distance(slide.translation) < SAME * spacing;
    let slide = (!motions.iter().any(same)).then_some(slide);
    let without = |k: usize| motions.iter().enumerate().filter(move |(other, _)| *other != k).map(|(_, m)| *m);
    let mut sets: Vec<Vec<Rigid>> = doubtful.iter().map(|&k| without(k).chain(slide).collect()).collect();
    if slide.is_some() && motions.len() < most {
        sets.push(motions.iter().copied().chain(slide).collect());
    }
    sets
}

/// Points that moved for certain and face the front of the object, and those of them that no motion accounts for.
struct Fronts {
    /// Number of points that face the front.
    facing: usize,
    /// Those that the motion of their part takes neither onto a surface of the part nor onto a moved or hidden one that has no part.
    open: PerState<Vec<usize>>,
}

impl Fronts {
    fn of(found: &Discovery, front: Front, work: &Refinement<'_>) -> Self {
        let facing = PerState::from_fn(|s| {
            let faces = |i: &usize| work.clouds[s].cloud.normals[*i].dot(front.direction) > FACING;
            work.evidence.moved[s].iter().copied().filter(faces).collect::<Vec<usize>>()
        });
        let open = PerState::from_fn(|s| {
            let of_part = |k: usize| {
                let own = facing[s].iter().copied().filter(move |i| usize::from(found.labels[s][*i]) == k);
                open_points(own.collect(), s, k, found, work)
            };
            (0..=found.parts.len()).flat_map(of_part).collect::<Vec<usize>>()
        });
        Self { facing: facing.iter().map(Vec::len).sum(), open }
    }

    fn open_share(&self) -> f64 {
        self.open.iter().map(Vec::len).sum::<usize>() as f64 / self.facing.max(1) as f64
    }

    /// Slides along the front, start to end, that take enough open points onto surfaces that have no other explanation, those that
    /// take most first.
    fn slides(&self, found: &Discovery, front: Front, work: &Refinement<'_>) -> Vec<Rigid> {
        /// Least share of the points that face the front.
        const LEAST: f64 = 0.02;
        /// Least difference of their lengths, spacings.
        const APART: f64 = 4.0;
        /// Slides that are taken at most.
        const MOST: usize = 2;
        /// Points of a state that are tried.
        const SAMPLES: usize = 800;
        let slides = all_lengths(front, work);
        let mut gains = vec![0.0f64; slides.len()];
        for s in State::ALL {
            let stride = self.open[s].len().div_ceil(SAMPLES).max(1);
            let picked: Vec<usize> = self.open[s].iter().copied().step_by(stride).collect();
            let free = self.free(s.other(), found, work);
            let is_free = |landing: &Landing| matches!(landing, Landing::Surface(j, _) if free[*j as usize]);
            let gain = |landing: &Landing| {
                let gained = is_free(landing) && landing.fits(&work.settings.support.costs);
                if gained { stride as f64 } else { 0.0 }
            };
            for row in landings(&picked, s, &slides, work).chunks_exact(slides.len()) {
                gains.iter_mut().zip(row).for_each(|(sum, landing)| *sum += gain(landing));
            }
        }
        let least = LEAST * self.facing as f64;
        let mut order: Vec<usize> = (0..slides.len()).filter(|i| gains[*i] > least).collect();
        order.sort_by(|a, b| gains[*b].total_cmp(&gains[*a]));
        let mut taken: Vec<usize> = Vec::new();
        for i in order {
            if taken.len() < MOST && taken.iter().all(|t| t.abs_diff(i) as f64 * STEP > APART) {
                taken.push(i);
            }
        }
        taken.into_iter().map(|i| slides[i]).collect()
    }

    /// Which points of a state no motion accounts for: open ones, and those that have no part and are not seen at rest.
    fn free(&self, s: State, found: &Discovery, work: &Refinement<'_>) -> Vec<bool> {
        let mut free: Vec<bool> = (0..found.labels[s].len()).map(|i| may_be_of(i, s, 0, found, work)).collect();
        self.open[s].iter().for_each(|i| free[*i] = true);
        free
    }
}

/// True if point `i` of a state belongs to part `k`, or to no part without being seen at rest.
fn may_be_of(i: usize, s: State, k: usize, found: &Discovery, work: &Refinement<'_>) -> bool {
    let label = usize::from(found.labels[s][i]);
    label > 0 && label == k || label == 0 && work.evidence.occupancy[s][i] != Occupancy::Surface
}

/// Those of the points `own` of part `k` in a state that are open; all if they have no part.
fn open_points(mut own: Vec<usize>, s: State, k: usize, found: &Discovery, work: &Refinement<'_>) -> Vec<usize> {
    if k == 0 {
        return own;
    }
    let landings = landings(&own, s, &[found.parts[k - 1].motion], work);
    let most = work.settings.support.explained;
    let explained = |landing: &Landing| match landing {
        Landing::Surface(j, cost) => *cost < most && may_be_of(*j as usize, s.other(), k, found, work),
        _ => false,
    };
    let mut open = landings.iter().map(|landing| !explained(landing));
    own.retain(|_| open.next().unwrap_or(false));
    own
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::test_scene::{cabinet_scene, with_refinement};
    use crate::discover::{DiscoverConfig, discover};
    use artgs_core::JointKind;
    use glam::DVec3;

    #[test]
    fn a_drawer_that_a_door_holds_gets_its_slide() {
        let scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &DiscoverConfig::default()).unwrap();
        with_refinement(&scene, |work| {
            let result =
                |parts: Parts| work.evidence.result(work.scene, work.clouds, parts, Vec::new(), &[], work.settings);
            let door = found.parts.iter().position(|p| p.kind == JointKind::Revolute).unwrap();
            let held = found.labels.as_ref().map(|labels| labels.iter().map(|l| u16::from(*l > 0)).collect());
            let with_door = result(Parts { parts: vec![found.parts[door]], labels: held });
            let completed = |movable| with_missing(with_door.clone(), &movable, work, &result);
            let slide = |found: &Discovery| {
                found.parts.iter().find(|p| p.kind == JointKind::Prismatic).map(|p| p.motion.translation)
            };
            let (right, truth) = (completed(1..=3), slide(&found).unwrap());
            assert_eq!(right.parts.len(), 2);
            assert!(slide(&right).unwrap().distance(truth) < 0.01 * found.diagonal);
            // No more parts than are allowed, and no slide where none is missing.
            assert_eq!(completed(1..=1).parts, with_door.parts);
            assert_eq!(with_missing(found.clone(), &(1..=3), work, &result).parts, found.parts);
        });
    }

    #[test]
    fn a_slide_is_added_or_replaces_a_doubtful_motion_and_is_not_there_twice() {
        let [a, b, c] = [0.1, 0.2, 0.3].map(|x| Rigid::shift(DVec3::X * x));
        let sets = |slide, doubtful: &[usize], most| sets_with(slide, &[a, b], doubtful, most, 0.01);
        assert_eq!(sets(c, &[], 3), [vec![a, b, c]]);
        assert_eq!(sets(c, &[0], 3), [vec![b, c], vec![a, b, c]]);
        assert_eq!(sets(c, &[1], 2), [vec![a, c]]);
        let near = Rigid::shift(DVec3::X * 0.215);
        assert_eq!(sets(near, &[], 3), Vec::<Vec<Rigid>>::new());
        assert_eq!(sets(near, &[0], 3), [vec![b]]);
    }
}
