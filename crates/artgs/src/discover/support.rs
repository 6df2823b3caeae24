//! What supports each joint: points that only its motion explains, the best different explanation, and how firmly the
//! seen surfaces hold the motion.

use super::Evidence;
use super::candidates::Candidate;
use super::cloud::IndexedCloud;
use super::landing::{Landing, StatePair};
use super::refinement::{Parts, points_of_part};
use super::registration::{Matching, stiffness};
use super::same_joint::ComparedPart;
use super::scene::Scene;
use super::segmentation::LabelCosts;
use super::visibility::Occupancy;
use artgs_core::{PerState, Rigid, State};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Settings of the measures.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SupportSettings {
    /// Points of a part and state that are compared with all candidates.
    pub(crate) sample: usize,
    /// Points of a part and state that are compared with the other parts only.
    pub(crate) part_sample: usize,
    /// Least points that only the motion of a part explains; with fewer it is no part.
    pub(crate) least_exclusive: f64,
    /// Least share of the points that moved for certain that the motion of a part explains.
    pub(crate) least_explained: f64,
    /// Least stiffness of a part.
    pub(crate) least_stiffness: f64,
    /// A motion explains a point at a lower cost than this.
    pub(crate) explained: f32,
    /// Another motion does not explain it if it costs more than this beyond.
    pub(crate) fall: f32,
    /// Motions that take the part's points to places closer than this are the same, spacings.
    pub(crate) same: f32,
    /// Motions that turn less are slides, degrees.
    pub(crate) turn_deg: f64,
    /// Costs of landings.
    pub(crate) costs: LabelCosts,
}

impl Default for SupportSettings {
    fn default() -> Self {
        let costs = LabelCosts { hidden_static: 0.25, hidden_moved: 0.1, mismatch: 0.5, ..LabelCosts::default() };
        Self {
            sample: 400,
            part_sample: 4000,
            least_exclusive: 8.0,
            least_explained: 0.5,
            least_stiffness: 0.03,
            explained: 0.35,
            fall: 0.5,
            same: 4.0,
            turn_deg: 3.0,
            costs,
        }
    }
}

/// What supports the joint of one part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Support {
    /// Points of the part that moved for certain: the other state shows their place as empty.
    pub moved: f64,
    /// Share of these that the motion takes onto a surface of the other state.
    pub explained: f64,
    /// Of the part's points that the motion takes onto a movable part of the other state, the share that it takes onto another
    /// part: two bodies in one place.
    #[serde(default)]
    pub contested: f64,
    /// Share of these that no other part's motion explains.
    pub exclusive: f64,
    /// Mean cost of the part's points under the motion, 0 (all land on surfaces that look the same) to 1 (empty space).
    pub cost: f64,
    /// Mean cost under the best different motion beyond [`Self::cost`].
    pub margin: f64,
    /// Index of that motion among the candidates.
    pub rival: Option<usize>,
    /// The same of the best motion of another joint: of another type, or with an axis, a place or a motion that differs by more than
    /// a correct joint may. 1 if there is none.
    #[serde(default)]
    pub other_margin: f64,
    /// Index of that motion among the candidates.
    #[serde(default)]
    pub other_joint: Option<usize>,
    /// The same of the best different motion if landing on another part counts as landing in empty space: two bodies are not in one
    /// place.
    #[serde(default)]
    pub fair_rival: Option<usize>,
    /// Displacement of the part in the direction that the matched surfaces hold least, as a root mean square distance
    /// between the surfaces per unit: 0 if the part slides freely in some direction, 1 at most.
    pub stiffness: f64,
    /// Root mean square distance of the matched surfaces, depth tolerances.
    pub residual: f64,
    /// Mean distance that the part's points move, spacings.
    pub shift: f64,
    /// Diagonal of the part's box, spacings.
    pub size: f64,
    /// Share of all points that moved for certain that no part explains; the same for every part.
    pub unexplained: f64,
}

impl SupportSettings {
    /// Measures every part. `pool` are the candidate motions.
    pub(super) fn measure(
        &self,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        evidence: &Evidence,
        found: &Parts,
        pool: &[Candidate],
    ) -> Vec<Support> {
        evidence.samples.begin();
        let of_part = |k: usize| self.measure_part(scene, clouds, evidence, found, pool, (k, self.sample));
        let mut all: Vec<Support> = (0..found.parts.len()).map(of_part).collect();
        let total = evidence.occupancy.iter().flatten().filter(|o| **o == Occupancy::Empty).count() as f64;
        let explained: f64 = all.iter().map(|s| s.explained * s.moved).sum();
        all.iter_mut().for_each(|s| s.unexplained = (1.0 - explained / total.max(1.0)).clamp(0.0, 1.0));
        all
    }

    /// Measures every part against the other parts only.
    pub(super) fn of_parts(
        &self,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        evidence: &Evidence,
        found: &Parts,
    ) -> Vec<Support> {
        evidence.samples.begin();
        let of_part = |k: usize| self.measure_part(scene, clouds, evidence, found, &[], (k, self.part_sample));
        (0..found.parts.len()).map(of_part).collect()
    }

    fn measure_part(
        &self,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        evidence: &Evidence,
        found: &Parts,
        pool: &[Candidate],
        (k, sample): (usize, usize),
    ) -> Support {
        /// Cost of a place that another part takes.
        const IN_EMPTY: f64 = 1.0;
        let Evidence { occupancy, samples: known, .. } = evidence;
        let Parts { parts, labels } = found;
        let own = parts[k].motion;
        let is_another = |j: u32, s: State| {
            let there = usize::from(labels[s][j as usize]);
            there > 0 && there != k + 1
        };
        let of_parts: Vec<Rigid> = parts.iter().map(|p| p.motion).collect();
        let motions: Vec<Rigid> = of_parts.iter().copied().chain(pool.iter().map(|c| c.motion)).collect();
        let count = parts.len();
        let mut out = Support::default();
        let mut costs = vec![0.0f64; motions.len()];
        let mut fair_costs = vec![0.0f64; motions.len()];
        let mut onto_own = 0.0f64;
        let mut row: Vec<f32> = Vec::with_capacity(motions.len());
        let (mut weight, mut farthest) = (0.0f64, vec![0.0f64; motions.len()]);
        let (mut shift, mut lower, mut upper) = (0.0f64, Vec3::INFINITY, Vec3::NEG_INFINITY);
        for s in State::ALL {
            let members: Vec<usize> = (0..labels[s].len()).filter(|&i| usize::from(labels[s][i]) == k + 1).collect();
            let stride = members.len().div_ceil(sample).max(1);
            let picked: Vec<usize> = members.iter().copied().step_by(stride).collect();
            let cloud = clouds[s].cloud.select(&picked);
            let points = IndexedCloud::new(&cloud);
            let pair = StatePair { own: &points, ..scene.pair(clouds, s) }.with_few_views();
            let to_other: Vec<Rigid> = motions.iter().map(|m| m.away_from(s)).collect();
            let landings = known.rows(&scene.pair(clouds, s).with_few_views(), s, &picked, &of_parts, &self.costs);
            let of_pool = if pool.is_empty() { Vec::new() } else { pair.landings(&to_other[count..], &self.costs) };
            let each = stride as f64;
            // Where noise spreads points, a motion that takes a moved point onto a moved point explains it alone if the others
            // only hide it.
            let confirmed = |landing: Landing| match landing {
                Landing::Surface(j, _) => scene.spreading && occupancy[s.other()][j as usize] == Occupancy::Empty,
                _ => false,
            };
            for (n, (landings, i)) in landings.chunks_exact(count).zip(&picked).enumerate() {
                let of_pool = &of_pool[n * pool.len()..(n + 1) * pool.len()];
                row.clear();
                row.extend(landings.iter().chain(of_pool).map(|landing| landing.cost(&self.costs)));
                weight += each;
                if let Landing::Surface(j, _) = landings[k] {
                    match usize::from(labels[s.other()][j as usize]) {
                        0 => {}
                        there if there == k + 1 => onto_own += each,
                        _ => out.contested += each,
                    }
                }
                costs.iter_mut().zip(&row).for_each(|(sum, cost)| *sum += each * f64::from(*cost));
                for ((sum, cost), landing) in fair_costs.iter_mut().zip(&row).zip(landings.iter().chain(of_pool)) {
                    let taken = matches!(landing, Landing::Surface(j, _) if is_another(*j, s.other()));
                    *sum += each * if taken { IN_EMPTY } else { f64::from(*cost) };
                }
                if occupancy[s][*i] == Occupancy::Empty {
                    out.moved += each;
                    let fits = row[k] < self.explained;
                    out.explained += if fits { each } else { 0.0 };
                    let mut others = (0..count).filter(|j| *j != k);
                    let alone = others.clone().map(|j| row[j]).all(|cost| cost > row[k] + self.fall)
                        || confirmed(landings[k]) && others.all(|j| !matches!(landings[j], Landing::Surface(..)));
                    out.exclusive += if fits && alone { each } else { 0.0 };
                }
            }
            for p in &cloud.points {
                let home = own.away_from(s).apply(p.as_dvec3());
                shift += each * home.distance(p.as_dvec3());
                for (far, motion) in farthest.iter_mut().zip(&to_other) {
                    *far = far.max(motion.apply(p.as_dvec3()).distance(home));
                }
                let at_start = if s == State::START { *p } else { home.as_vec3() };
                (lower, upper) = (lower.min(at_start), upper.max(at_start));
            }
        }
        let spacing = f64::from(scene.lengths.spacing);
        let same = f64::from(self.same) * spacing;
        let mean = |sum: f64| sum / weight.max(1.0);
        out.explained /= out.moved.max(1.0);
        out.exclusive /= out.moved.max(1.0);
        out.contested /= (out.contested + onto_own).max(1.0);
        out.cost = mean(costs[k]);
        let plausible = |c: usize| f64::from(pool[c].implausibility);
        let best = |costs: &[f64], wanted: &dyn Fn(usize) -> bool| {
            let different = (0..pool.len()).filter(|c| farthest[count + c] > same && wanted(*c));
            different.map(|c| (mean(costs[count + c]) + plausible(c), c)).min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let extent = (upper - lower).max(Vec3::ZERO).length().into();
        let part = ComparedPart { middle: (0.5 * (lower + upper)).as_dvec3(), size: extent, turn_deg: self.turn_deg };
        let other = best(&costs, &|c| !part.is_same_joint(&own, &pool[c].motion));
        out.fair_rival = best(&fair_costs, &|_| true).map(|r| r.1);
        let rival = best(&costs, &|_| true);
        out.margin = rival.map_or(1.0, |r| r.0 - out.cost);
        out.rival = rival.map(|r| r.1);
        out.other_margin = other.map_or(1.0, |r| r.0 - out.cost);
        out.other_joint = other.map(|r| r.1);
        out.shift = mean(shift) / spacing;
        out.size = f64::from((upper - lower).max(Vec3::ZERO).length()) / spacing;
        out.residual = parts[k].rms.unwrap_or(0.0) / f64::from(scene.tolerance);
        out.stiffness = self.stiffness(clouds, labels, k, &own, spacing);
        out
    }

    fn stiffness(
        &self,
        clouds: &PerState<IndexedCloud<'_>>,
        labels: &PerState<Vec<u16>>,
        k: usize,
        motion: &Rigid,
        spacing: f64,
    ) -> f64 {
        let own = points_of_part(clouds, labels, k as u16 + 1);
        let own = own.as_ref().map(IndexedCloud::new);
        stiffness(Matching::mutual(&own[State::START], &own[State::END]), motion, 2.0 * spacing, 2000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discover::config::StepSettings;
    use crate::discover::test_scene::cabinet_scene;
    use crate::discover::{DiscoverConfig, discover};
    use glam::DVec3;

    #[test]
    fn parts_that_land_on_other_parts_are_contested() {
        let config = DiscoverConfig::default();
        let scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &config).unwrap();
        let evidence = Evidence::new(&scene, &StepSettings::default()).unwrap();
        let (clouds, settings) = (scene.indexed_clouds(), StepSettings::default().support);
        let with = |labels: &PerState<Vec<u16>>| Parts { parts: found.parts.clone(), labels: labels.clone() };
        let contested = |labels: &PerState<Vec<u16>>| {
            let all = settings.of_parts(&scene, &clouds, &evidence, &with(labels));
            [all[0].contested, all[1].contested]
        };
        let right = contested(&found.labels);
        assert!(right.iter().all(|share| *share < 0.1), "{right:?}");
        // The first part is given to the second one in the end state only.
        let mut mixed = found.labels.clone();
        mixed[State::END].iter_mut().filter(|label| **label == 1).for_each(|label| *label = 2);
        let share = contested(&mixed);
        assert!(share[0] > 0.5, "{share:?}");
        // Of a motion onto the other part and rest, the other part leaves only rest.
        let candidate = |motion: Rigid| Candidate {
            motion,
            explained: PerState::default(),
            gain: 1.0,
            implausibility: 0.0,
            turned_over: false,
        };
        let aside = Rigid::shift(DVec3::Z * f64::from(6.0 * scene.lengths.spacing));
        let pool = [candidate(found.parts[0].motion * aside), candidate(Rigid::IDENTITY)];
        let rivals = |labels: &PerState<Vec<u16>>| {
            let all = settings.measure(&scene, &clouds, &evidence, &with(labels), &pool);
            (all[0].rival, all[0].fair_rival)
        };
        assert_eq!(rivals(&found.labels), (Some(0), Some(0)));
        assert_eq!(rivals(&mixed), (Some(0), Some(1)));
    }

    #[test]
    fn where_depth_is_noisy_motions_that_only_hide_points_do_not_explain_them() {
        let config = DiscoverConfig::default();
        let mut scene = cabinet_scene(16, 96);
        let found = discover(&scene, 2..=2, &config).unwrap();
        let found = Parts { parts: found.parts, labels: found.labels };
        let mut exclusive = |spreading: bool| {
            let evidence = Evidence::new(&scene, &StepSettings::default()).unwrap();
            scene.spreading = spreading;
            let (clouds, settings) = (scene.indexed_clouds(), StepSettings::default().support);
            let all = settings.of_parts(&scene, &clouds, &evidence, &found);
            [all[0].exclusive, all[1].exclusive]
        };
        let (exact, noisy) = (exclusive(false), exclusive(true));
        assert!((0..2).all(|k| noisy[k] >= exact[k] && noisy[k] <= 1.0), "{exact:?} {noisy:?}");
        assert!(noisy.iter().sum::<f64>() > exact.iter().sum::<f64>() + 0.01, "{exact:?} {noisy:?}");
    }
}
