//! Which part carries which: the tree of joints with the least energy. A joint costs the numbers that describe it; a hinge must pass
//! through both parts that it connects, and parts that are joined touch each other.

use super::cloud::{Cloud, IndexedCloud};
use super::joints::{Decided, JointFit};
use artgs_core::{JointEstimate, JointKind, PerState, Rigid, State};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Settings of the energy of a tree of joints. Lengths are fractions of the object's diagonal, energies are nats.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ParentSettings {
    /// Standard deviation of the distance between the axis of a hinge and the surfaces that are seen of both parts.
    pub(crate) pivot: f64,
    /// Standard deviation of the gap that is seen between parts that are joined.
    pub(crate) gap: f64,
    /// Most that a pivot and a gap cost: surfaces there may not be seen. Raising it lets distances decide more.
    pub(crate) most: f64,
    /// Of a part that a moving part carries, and not the static one. Raising it makes chains rarer.
    pub(crate) carried: f64,
    /// Of a motion that is neither a slide nor a hinge, and the most that a joint may fit worse than a free motion. Raising it makes
    /// chains more frequent.
    pub(crate) general: f64,
    /// Parts that move less against another part move with it, depth tolerances.
    pub(crate) least_motion: f64,
}

impl Default for ParentSettings {
    fn default() -> Self {
        Self { pivot: 0.012, gap: 0.02, most: 10.0, carried: 2.3, general: 15.0, least_motion: 3.0 }
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

/// The points of a part in each state.
type Shown<'a> = PerState<IndexedCloud<'a>>;

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
        let motions: Vec<Rigid> = decided.iter().map(|d| d.general.unwrap_or(d.joint).motion).collect();
        let shown: Vec<Shown<'_>> = self.clouds.iter().map(|c| c.as_ref().map(IndexedCloud::new)).collect();
        let on = |child: usize| {
            let base = self.on_base(&shown, child, &decided[child], kinds[child]);
            let on_part = |carrier: usize| {
                let may = carrier != child && (self.numbering == Numbering::ParentsFirst || carrier < child);
                if !may {
                    return f64::INFINITY;
                }
                let gap = self.gap(&shown[child + 1], &shown[carrier + 1]);
                if self.least_carried(&(motions[carrier].inverse() * motions[child])) + gap >= base {
                    return f64::INFINITY;
                }
                let joint = self.carried(child, &motions[child], &motions[carrier], kinds[child]);
                joint.map_or(f64::INFINITY, |(joint, misfit)| {
                    self.settings.carried
                        + misfit
                        + gap
                        + self.joint(&joint, &motions[carrier], &shown[child + 1], &shown[carrier + 1])
                })
            };
            std::iter::once(base).chain((0..decided.len()).map(on_part)).collect()
        };
        let energies: Vec<Vec<f64>> = (0..decided.len()).into_par_iter().map(on).collect();
        self.in_tree(&tree(&energies), decided, &motions, kinds)
    }

    /// Joints of parts with these parents (0 is the static part).
    fn in_tree(
        &self,
        parents: &[usize],
        decided: &[Decided],
        motions: &[Rigid],
        kinds: &[Option<JointKind>],
    ) -> Vec<JointEstimate> {
        let on_base = |k: usize| {
            let general = decided[k].general.filter(|_| kinds[k].is_none());
            general.filter(|g| self.turns_about_itself(k, &g.motion)).unwrap_or(decided[k].joint)
        };
        let mut joints: Vec<Option<JointEstimate>> =
            (0..decided.len()).map(|k| (parents[k] == 0).then(|| on_base(k))).collect();
        // Parents form a tree: each round settles those whose carrier is settled.
        for _ in 0..decided.len() {
            for k in 0..decided.len() {
                let carrier = parents[k].checked_sub(1).and_then(|c| joints[c]);
                if let (None, Some(carrier)) = (joints[k], carrier) {
                    let on_carrier = |joint: JointEstimate| JointEstimate {
                        motion: carrier.motion * joint.motion,
                        parent: parents[k],
                        ..joint
                    };
                    let found = self.carried(k, &motions[k], &carrier.motion, kinds[k]);
                    joints[k] = Some(found.map_or_else(|| on_base(k), |(joint, _)| on_carrier(joint)));
                }
            }
        }
        joints.into_iter().enumerate().map(|(k, joint)| joint.unwrap_or_else(|| on_base(k))).collect()
    }

    /// Energy of part `k` (from 0) on the static part.
    fn on_base(&self, shown: &[Shown<'_>], k: usize, decided: &Decided, known: Option<JointKind>) -> f64 {
        let general = decided.general.filter(|_| known.is_none());
        let price = if general.is_some() { self.settings.general } else { decided.misfit.min(self.settings.general) };
        let (own, base) = (&shown[k + 1], &shown[0]);
        price + self.joint(&general.unwrap_or(decided.joint), &Rigid::IDENTITY, own, base) + self.gap(own, base)
    }

    /// Energy of a part that moves by `relative` against the part that carries it at least, without their gap.
    fn least_carried(&self, relative: &Rigid) -> f64 {
        /// A motion of parts against each other that turns by more is a hinge, degrees.
        const TURNS: f64 = 3.0;
        let kind = if relative.angle().to_degrees() > TURNS { JointKind::Revolute } else { JointKind::Prismatic };
        self.settings.carried + self.numbers(kind)
    }

    /// The joint of part `child` (from 0) as seen from a part with this motion and how badly it fits, nats; none if there is no simple
    /// joint between them.
    fn carried(
        &self,
        child: usize,
        in_world: &Rigid,
        carrier: &Rigid,
        known: Option<JointKind>,
    ) -> Option<(JointEstimate, f64)> {
        // As seen from the carrier, which then does not move.
        let (from_carrier, clouds) = (carrier.inverse(), &self.clouds[child + 1]);
        let own = PerState::new(clouds[State::START].clone(), moved(&clouds[State::END], &from_carrier));
        let guess = JointEstimate::new(JointKind::Screw, from_carrier * *in_world);
        let found = self.fit.decide(&guess, &own, known);
        let travel = mean_motion(&own[State::START], &found.joint.motion);
        let moves = travel >= self.settings.least_motion * self.fit.tolerance;
        let fits = found.general.is_none() && found.misfit < self.settings.general;
        (fits && moves).then_some((found.joint, found.misfit))
    }

    /// Energy of a joint between two parts, as seen from the second one, which moves by `carrier`, without their gap.
    fn joint(&self, joint: &JointEstimate, carrier: &Rigid, own: &Shown<'_>, other: &Shown<'_>) -> f64 {
        self.numbers(joint.kind) + self.pivot(joint, carrier, own, other)
    }

    /// Nats of the numbers that describe a joint, each to the precision that the points of the object give.
    fn numbers(&self, kind: JointKind) -> f64 {
        let points = self.clouds.iter().flat_map(PerState::iter).map(Cloud::len).sum::<usize>().max(2) as f64;
        0.5 * f64::from(kind.numbers()) * points.ln()
    }

    /// Nats of the distance between a hinge and the two parts that it connects, at the place along the axis where it is least.
    fn pivot(&self, joint: &JointEstimate, carrier: &Rigid, own: &Shown<'_>, other: &Shown<'_>) -> f64 {
        /// Places along the axis that are tried.
        const PLACES: usize = 60;
        if joint.kind == JointKind::Prismatic {
            return 0.0;
        }
        let screw = joint.motion.screw();
        let reach = self.farthest(self.settings.pivot) as f32;
        let distance = |state: State| {
            let motion = if state == State::START { Rigid::IDENTITY } else { *carrier };
            let (origin, axis) = (motion.apply(screw.origin), motion.turn(screw.axis));
            let along = own[state].cloud.points.iter().map(|p| (p.as_dvec3() - origin).dot(axis));
            let [lower, upper] = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)]);
            if lower > upper {
                return reach;
            }
            let (first, step) = (lower - f64::from(reach), (upper - lower + 2.0 * f64::from(reach)) / PLACES as f64);
            let at = |place: usize| {
                let p = (origin + axis * (first + (place as f64 + 0.5) * step)).as_vec3();
                f32::max(distance_to(&own[state], p, reach), distance_to(&other[state], p, reach))
            };
            (0..PLACES).map(at).fold(reach, f32::min)
        };
        let nearest = State::ALL.map(distance).into_iter().fold(reach, f32::min);
        self.of_distance(nearest, self.settings.pivot)
    }

    /// Nats of the gap between two parts, the larger one of the states in which both are seen.
    fn gap(&self, own: &Shown<'_>, other: &Shown<'_>) -> f64 {
        /// Points of a part that are asked, and the share of them that touch the other part if it is joined: a few points with a wrong
        /// label are no surface.
        const ASKED: usize = 500;
        const TOUCHING: f32 = 0.01;
        let reach = self.farthest(self.settings.gap) as f32;
        let gap = |state: State| {
            let (own, other) = (&own[state].cloud.points, &other[state]);
            if own.is_empty() || other.cloud.points.is_empty() {
                return 0.0;
            }
            let asked = own.iter().step_by(own.len().div_ceil(ASKED));
            let distances = asked.map(|p| distance_to(other, *p, reach)).collect();
            crate::trimmed::quantile(distances, TOUCHING).unwrap_or(reach)
        };
        let widest = State::ALL.map(gap).into_iter().fold(0.0, f32::max);
        self.of_distance(widest, self.settings.gap)
    }

    /// Nats of a distance in scene units that is usually below `deviation`.
    fn of_distance(&self, distance: f32, deviation: f64) -> f64 {
        let share = f64::from(distance / self.fit.lengths.diagonal);
        (0.5 * (share / deviation).powi(2)).min(self.settings.most)
    }

    /// Distance from which on nothing costs more, scene units.
    fn farthest(&self, deviation: f64) -> f64 {
        (2.0 * self.settings.most).sqrt() * deviation * f64::from(self.fit.lengths.diagonal)
    }

    /// True if the axis of a motion passes through its part or near it, as that of a screw does.
    fn turns_about_itself(&self, k: usize, motion: &Rigid) -> bool {
        /// Near, a share of the diagonal.
        const NEAR: f64 = 0.05;
        let (screw, reach) = (motion.screw(), NEAR * f64::from(self.fit.lengths.diagonal));
        let from_axis = |p: DVec3| (p - screw.origin).reject_from_normalized(screw.axis).length();
        let own = &self.clouds[k + 1][State::START];
        let distances = || own.points.iter().map(|p| from_axis(p.as_dvec3()));
        let mean = distances().sum::<f64>() / own.len().max(1) as f64;
        from_axis(own.middle().as_dvec3()) < 0.5 * mean || distances().fold(f64::INFINITY, f64::min) < reach
    }
}

/// Distance of a point to a part, at most `reach`.
fn distance_to(part: &IndexedCloud<'_>, point: Vec3, reach: f32) -> f32 {
    part.nearest_within(point, reach * reach).map_or(reach, |found| found.1.sqrt())
}

/// Parents (0 is the static part) with the least sum of `energies[child][parent]`: the arborescence of Chu, Liu and Edmonds.
fn tree(energies: &[Vec<f64>]) -> Vec<usize> {
    let cheapest = |own: &Vec<f64>| (0..own.len()).min_by(|a, b| own[*a].total_cmp(&own[*b])).unwrap_or(0);
    let free: Vec<usize> = energies.iter().map(cheapest).collect();
    let Some(circle) = circle_of(&free) else { return free };
    // The circle becomes one part, numbered as its first; what enters it replaces the joint that it has there.
    let outside: Vec<usize> = (0..energies.len()).filter(|k| !circle.contains(k)).collect();
    let saved = |k: usize, parent: usize| energies[k][parent] - energies[k][free[k]];
    let entry = |parent: usize| {
        circle.iter().copied().min_by(|a, b| saved(*a, parent).total_cmp(&saved(*b, parent))).unwrap_or(0)
    };
    let exit = |child: usize| {
        circle.iter().copied().min_by(|a, b| energies[child][a + 1].total_cmp(&energies[child][b + 1])).unwrap_or(0)
    };
    // Parents of the smaller problem: the static part, those outside, the circle.
    let places: Vec<usize> = std::iter::once(0).chain(outside.iter().map(|k| k + 1)).collect();
    let mut smaller: Vec<Vec<f64>> = outside
        .iter()
        .map(|k| places.iter().map(|p| energies[*k][*p]).chain([energies[*k][exit(*k) + 1]]).collect())
        .collect();
    smaller.push(places.iter().map(|p| saved(entry(*p), *p)).chain([f64::INFINITY]).collect());
    let (mut parents, found) = (free.clone(), tree(&smaller));
    for (child, parent) in outside.iter().zip(&found) {
        parents[*child] = places.get(*parent).copied().unwrap_or_else(|| exit(*child) + 1);
    }
    let into = found.last().and_then(|p| places.get(*p)).copied().unwrap_or(0);
    parents[entry(into)] = into;
    parents
}

/// Parts (from 0) that carry each other in a circle, if there is one.
fn circle_of(parents: &[usize]) -> Option<Vec<usize>> {
    (0..parents.len()).find_map(|start| {
        let mut path = vec![start];
        loop {
            let next = parents[*path.last()?].checked_sub(1)?;
            if next == start {
                return Some(path);
            }
            if path.contains(&next) {
                return None;
            }
            path.push(next);
        }
    })
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
    use crate::discover::scene::{HingeBall, Lengths};
    use rand::{RngExt, SeedableRng};

    /// Sum of the least tree by trying all.
    fn least_of_all(energies: &[Vec<f64>]) -> f64 {
        let n = energies.len();
        let all =
            (0..(n + 1).pow(n as u32)).map(|code| (0..n).map(|k| code / (n + 1).pow(k as u32) % (n + 1)).collect());
        let sum = |p: &Vec<usize>| p.iter().zip(energies).map(|(p, e)| e[*p]).sum::<f64>();
        all.filter(|p: &Vec<usize>| circle_of(p).is_none()).map(|p| sum(&p)).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_tree_has_the_least_energy_and_no_circle() {
        let inf = f64::INFINITY;
        // Parts 1 and 2 would each rather hang on the other one.
        assert_eq!(tree(&[vec![9.0, inf, 1.0], vec![5.0, 2.0, inf]]), [2, 0]);
        assert_eq!(tree(&[vec![1.0, inf, 2.0], vec![5.0, 2.0, inf]]), [0, 1]);
        assert!(tree(&[]).is_empty());
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        for n in (1..=4).cycle().take(400) {
            let value = |k: usize, p: usize, rng: &mut rand_pcg::Pcg64Mcg| match rng.random_range(0..4) {
                _ if p == k + 1 => inf,
                0 if p > 0 => inf,
                _ => f64::from(rng.random_range(0..1000)),
            };
            let energies: Vec<Vec<f64>> = (0..n).map(|k| (0..=n).map(|p| value(k, p, &mut rng)).collect()).collect();
            let found = tree(&energies);
            let sum: f64 = found.iter().zip(&energies).map(|(p, e)| e[*p]).sum();
            assert!(circle_of(&found).is_none() && sum == least_of_all(&energies), "{energies:?} {found:?}");
        }
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
            hinges: HingeBall { middle: DVec3::ZERO, radius: 1.6 },
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
            |m: &Rigid| Decided { joint: JointEstimate::new(JointKind::Revolute, *m), general: None, misfit: 0.0 };
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
