//! Truth against what was found, and against an adversary that looks for an explanation below the truth.

use super::energy::{Explanation, Problem, Terms};
use super::search::SearchSettings;
use crate::discover::Cloud;
use crate::neighbours::PointTree;
use artgs_core::{PerState, Rigid, State};
use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Energies of the explanations of one capture.
#[derive(Clone, Debug)]
pub struct Judgement {
    /// The truth, labels cut.
    pub truth: Terms,
    /// The same without cutting: the true labels.
    pub labelled: Terms,
    /// What was found, labels cut.
    pub found: Terms,
    /// The lowest that the adversary found.
    pub adversary: Terms,
    /// Motions that the adversary added, and what each saved.
    pub added: Vec<(String, f64)>,
    /// The explanations of `truth`, `found` and `adversary`.
    pub explanations: [Explanation; 3],
}

/// A surfel that an explanation does not explain.
#[derive(Clone, Copy, Debug)]
pub struct Unexplained {
    /// What it costs.
    pub nats: f32,
    /// World frame of its state.
    pub point: Vec3,
    /// Unit normal, world frame of its state.
    pub normal: Vec3,
    /// Views of the other state that hit it, look through its place, and are hidden from it.
    pub views: [u16; 3],
}

impl Problem<'_> {
    /// Compares explanations, and lets the adversary try `count` distracting motions.
    pub fn judged(&mut self, truth: &Explanation, found: &Explanation, count: usize, seed: u64) -> Judgement {
        let labelled = self.terms(truth);
        let best = self.relabelled(truth);
        let found = self.relabelled(found);
        let pool = distractions(&best, &found, &self.middles(&best), self.scene.lengths.diagonal.into(), count, seed);
        let (lowest, added) = self.attacked(&best, &pool);
        let (truth, seen) = (self.terms(&best), self.terms(&found));
        Judgement {
            truth,
            labelled,
            found: seen,
            adversary: self.terms(&lowest),
            added,
            explanations: [best, found, lowest],
        }
    }

    /// Adds the distracting motion that lowers the total most, as long as one does; after each, parts that no longer pay go.
    fn attacked(&mut self, truth: &Explanation, pool: &[(String, Rigid)]) -> (Explanation, Vec<(String, f64)>) {
        /// Motions of each round whose labels are cut.
        const TRIED: usize = 6;
        const ROUNDS: usize = 4;
        let search = SearchSettings::default();
        let (mut best, mut least) = (truth.clone(), self.total(truth, &search));
        let mut added = Vec::new();
        for _ in 0..ROUNDS {
            let costs = self.costs(&best);
            let all = costs.as_ref().map(|costs| (0..costs.len()).collect::<Vec<usize>>());
            let contexts = self.contexts(&best);
            let gain = |(m, (_, motion)): (usize, &(String, Rigid))| (self.gain(&costs, &all, &contexts, motion), m);
            let mut bounds: Vec<(f64, usize)> = pool.par_iter().enumerate().map(gain).collect();
            bounds.sort_by(|a, b| b.0.total_cmp(&a.0));
            let mut next: Option<(f64, Explanation, usize)> = None;
            for (_, m) in bounds.into_iter().take(TRIED) {
                let with = self.with_part(&best, pool[m].1);
                let fitted = self.fitted(&with, with.motions.len());
                let fewer = self.without_surplus_parts(&fitted, &search);
                let total = self.total(&fewer, &search);
                if next.as_ref().is_none_or(|n| total < n.0) {
                    next = Some((total, fewer, m));
                }
            }
            let Some((total, explanation, m)) = next.filter(|n| n.0 < least - 1.0) else { break };
            let last = explanation.motions.len();
            let size = |s: State| explanation.labels[s].iter().filter(|l| usize::from(**l) == last).count();
            added.push((format!("{} {:?}", pool[m].0, State::ALL.map(size)), least - total));
            (best, least) = (explanation, total);
        }
        (best, added)
    }
}

/// The screw of a motion, `factor` times as far.
fn scaled(motion: &Rigid, factor: f64) -> Rigid {
    if factor < 0.0 { motion.inverse().power(-factor) } else { motion.power(factor) }
}

/// Wrong motions with names: the inverse, doubled and halved, composed with those of other parts, exchanges of parts that look alike, near
/// copies, the found ones, and slides and hinges by chance.
fn distractions(
    truth: &Explanation,
    found: &Explanation,
    middles: &[DVec3],
    diagonal: f64,
    count: usize,
    seed: u64,
) -> Vec<(String, Rigid)> {
    /// Scales of screws.
    const SCALES: [f64; 5] = [-1.0, -0.5, 0.5, 1.5, 2.0];
    let mut out: Vec<(String, Rigid)> =
        found.motions.iter().enumerate().map(|(k, m)| (format!("found {}", k + 1), *m)).collect();
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    for (k, m) in truth.motions.iter().enumerate() {
        out.extend(SCALES.map(|f| (format!("{f} x {}", k + 1), scaled(m, f))));
        for (j, other) in truth.motions.iter().enumerate().filter(|(j, _)| *j != k) {
            out.push((format!("{} after {}", k + 1, j + 1), *m * *other));
            out.push((format!("{} to {}", k + 1, j + 1), Rigid::shift(middles[j + 1] - middles[k + 1])));
            let end = other.apply(middles[j + 1]);
            out.push((format!("{} to the end of {}", k + 1, j + 1), Rigid::shift(end - middles[k + 1])));
        }
    }
    let mut chance = Vec::new();
    while chance.len() < count / 2 {
        let axis = [DVec3::X, DVec3::Y, DVec3::Z][rng.random_range(0..3)];
        let origin = middles[rng.random_range(0..middles.len())];
        chance.push(if rng.random::<bool>() {
            ("slide".to_string(), Rigid::shift(axis * rng.random_range(-0.3..0.3) * diagonal))
        } else {
            ("hinge".to_string(), Rigid::about(axis, origin, rng.random_range(-1.5..1.5)))
        });
    }
    // The list of exchanges grows with the square of the number of parts.
    while out.len() + chance.len() > count && out.len() > found.motions.len() {
        out.remove(rng.random_range(found.motions.len()..out.len()));
    }
    out.extend(chance);
    out
}

/// True labels of points from the distance to points of the true surfaces, `[part][point]`, static first.
fn nearest_part(points: &[Vec3], surfaces: &[Vec<[f64; 3]>]) -> Vec<u16> {
    let tree = |s: &Vec<[f64; 3]>| PointTree::new(&s.iter().map(|p| p.map(|x| x as f32)).collect::<Vec<_>>());
    let trees: Vec<PointTree> = surfaces.iter().map(tree).collect();
    let label = |p: &Vec3| {
        let of = |tree: &PointTree| tree.nearest_within(&p.to_array(), f32::INFINITY).map_or(f32::INFINITY, |n| n.1);
        let nearest = trees.iter().map(of).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map_or(0, |n| n.0 as u16)
    };
    points.iter().map(label).collect()
}

/// The true explanation from the true motions and points of the true surfaces in each state, static first.
pub fn truth(
    problem: &Problem<'_>,
    motions: Vec<Rigid>,
    numbers: Vec<u8>,
    surfaces: &PerState<Vec<Vec<[f64; 3]>>>,
) -> Explanation {
    let labels = PerState::from_fn(|s| nearest_part(&problem.clouds[s].cloud.points, &surfaces[s]));
    Explanation { motions, numbers, labels }
}

impl Problem<'_> {
    /// Labels of the surfels from the nearest of some labelled points.
    pub fn labels_like(&self, clouds: &PerState<Cloud>, labels: &PerState<Vec<u16>>) -> PerState<Vec<u16>> {
        PerState::from_fn(|s| {
            let points: Vec<[f32; 3]> = clouds[s].points.iter().map(|p| p.to_array()).collect();
            let tree = PointTree::new(&points);
            let nearest = |p: &Vec3| tree.nearest_within(&p.to_array(), f32::INFINITY);
            self.clouds[s].cloud.points.iter().map(|p| nearest(p).map_or(0, |n| labels[s][n.0])).collect()
        })
    }

    /// Positions and normals of the surfels of a part (0 is the static one) that cost more than `nats`, with the views that hit them,
    /// look through them and are hidden from them: what an explanation does not explain.
    pub fn unexplained(&mut self, explanation: &Explanation, part: u16, nats: f32) -> PerState<Vec<Unexplained>> {
        let costs = self.costs(explanation);
        let motion = usize::from(part).checked_sub(1).map_or(Rigid::IDENTITY, |k| explanation.motions[k]);
        let evidence = self.evidence(&motion);
        PerState::from_fn(|s| {
            let own = (0..costs[s].len()).filter(|i| explanation.labels[s][*i] == part && costs[s][*i] > nats);
            let of = |i: usize| {
                let (cloud, seen) = (self.clouds[s].cloud, &evidence[s][i]);
                Unexplained {
                    nats: costs[s][i],
                    point: cloud.points[i],
                    normal: cloud.normals[i],
                    views: [seen.hit, seen.through, seen.hidden],
                }
            };
            own.map(of).collect()
        })
    }
}
