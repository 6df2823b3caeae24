//! Truth against what was found, and against an adversary that looks for an explanation below the truth.

use super::energy::{Explanation, Problem, Terms};
use super::search::SearchSettings;
use artgs_core::{PerState, Rigid, State};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Energies of the explanations of one capture.
#[derive(Clone, Debug)]
pub struct Judgement {
    /// The truth, labels cut.
    pub truth: Terms,
    /// What was found, labels cut.
    pub found: Terms,
    /// The lowest that the adversary found.
    pub adversary: Terms,
    /// Motions that the adversary added, and what each saved.
    pub added: Vec<(String, f64)>,
    /// The explanations of `truth`, `found` and `adversary`.
    pub explanations: [Explanation; 3],
}

impl Problem<'_> {
    /// Compares explanations, and lets the adversary try `count` distracting motions.
    pub fn judged(&mut self, truth: &Explanation, found: &Explanation, count: usize, seed: u64) -> Judgement {
        let best = self.relabelled(truth);
        let found = self.relabelled(found);
        let pool = distractions(&best, &found, &self.middles(&best), self.scene.lengths.diagonal.into(), count, seed);
        let (lowest, added) = self.attacked(&best, &pool);
        let (truth, seen) = (self.terms(&best), self.terms(&found));
        Judgement { truth, found: seen, adversary: self.terms(&lowest), added, explanations: [best, found, lowest] }
    }

    /// Nats by which one more part that moves so changes the total of an explanation, as the search would add it: with its first labels, and
    /// with its motion fitted, all labels cut, and parts removed that no longer pay. Of both first labels the lower ones.
    pub fn change_by(&mut self, explanation: &Explanation, motion: Rigid) -> [f64; 2] {
        let search = SearchSettings::default();
        let now = self.total(explanation, &search);
        let changes = [0.0, search.yielded].map(|yielded| {
            let rough = self.roughly_with(explanation, motion, yielded);
            let fitted = self.fitted(&rough, rough.motions.len());
            let fewer = self.without_surplus_parts(&fitted, &search);
            [self.total(&rough, &search) - now, self.total(&fewer, &search) - now]
        });
        let [first, other] = changes;
        if first[1] <= other[1] { first } else { other }
    }

    /// Nats by which part `part` (from 1) of another explanation changes the total with all the surfels that it has there, once labels are cut
    /// and parts removed that no longer pay. Where this lowers the total and [`Self::change_by`] does not, the first labels are at fault.
    pub fn change_by_part(&mut self, explanation: &Explanation, other: &Explanation, part: usize) -> f64 {
        let search = SearchSettings::default();
        let mut with = explanation.with(other.motions[part - 1]);
        let new = with.motions.len() as u16;
        for s in State::ALL {
            let theirs = other.labels[s].iter().map(|l| usize::from(*l));
            with.labels[s].iter_mut().zip(theirs).filter(|(_, l)| *l == part).for_each(|(own, _)| *own = new);
        }
        let cut = self.relabelled(&with);
        let fewer = self.without_surplus_parts(&cut, &search);
        self.total(&fewer, &search) - self.total(explanation, &search)
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
            if explanation.motions == best.motions {
                // Better labels of the same motions are no wrong explanation.
                (best, least) = (explanation, total);
                continue;
            }
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

/// The true explanation from the true motions and points of the true surfaces in each state, static first.
pub fn truth(
    problem: &Problem<'_>,
    motions: Vec<Rigid>,
    numbers: Vec<u8>,
    surfaces: &PerState<Vec<Vec<[f64; 3]>>>,
) -> Explanation {
    let labels = PerState::from_fn(|s| {
        let parts = surfaces[s].iter().enumerate();
        let known: (Vec<[f32; 3]>, Vec<u16>) =
            parts.flat_map(|(part, points)| points.iter().map(move |p| (p.map(|x| x as f32), part as u16))).unzip();
        problem.nearest_labels(s, &known.0, &known.1)
    });
    Explanation { motions, numbers, labels }
}

impl Problem<'_> {
    /// Number of surfels of a part (0 is the static one) that cost more than `nats`: what an explanation does not explain.
    pub fn unexplained(&mut self, explanation: &Explanation, part: u16, nats: f32) -> usize {
        let costs = self.costs(explanation);
        let of =
            |s: State| costs[s].iter().zip(&explanation.labels[s]).filter(|(c, l)| **l == part && **c > nats).count();
        State::ALL.map(of).into_iter().sum()
    }
}
