//! Chooses, among candidate motions, the set of a given size that together explains both states best.

use super::candidates::{Candidate, sample_of};
use super::cloud::IndexedCloud;
use super::front::Front;
use super::landing::{Landing, StatePair};
use super::ranking::{RankingSettings, better_seen};
use super::scene::Scene;
use super::segmentation::LabelCosts;
use artgs_core::{PerState, Rigid, State};
use rayon::prelude::*;
use std::ops::RangeInclusive;

/// Settings of the selection; costs are relative to the cost 1 of a point in empty space. Calibrated on the stand-ins of
/// the paper's objects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SelectionSettings {
    /// First candidates from which sets are grown, beside the best one.
    pub(crate) firsts: usize,
    /// Numbers of candidates by which sets are grown beyond the size asked for, then reduced again.
    pub(crate) extras: [usize; 3],
    /// Points of each state that are compared, moved ones and others each.
    pub(crate) sample: usize,
    /// Weight of points that show no sign of motion: a chance match of a wall must not justify a part.
    pub(crate) static_weight: f32,
    /// Cost of explaining such a point by a motion.
    pub(crate) static_cost: f32,
    /// A motion supports a point if it lowers the cost by more than this. A chance match of a point whose place the other
    /// state hides lowers it by less; one of a point that is seen to have moved by more.
    pub(crate) support_fall: f32,
    /// The same for a point that only this motion takes from a place that is empty in the other state to one that is empty in
    /// this state; where depth noise spreads points. Calibrated on simulated recordings of a phone.
    pub(crate) confirmed_fall: f32,
    /// Least share of the moved points that each motion must support alone, where the number of motions is not given.
    pub(crate) least_support: f64,
    /// The same where depth noise spreads points: chance matches of noise are many. Calibrated on a simulated phone's
    /// recording of a laptop.
    pub(crate) least_noisy_support: f64,
    /// The same in points.
    pub(crate) least_support_points: f64,
    /// Numbers that are tried beyond one with a motion of too little support: two parts may only be found together.
    pub(crate) patience: usize,
    /// Costs of landings. What is hidden in one state is weak evidence against a motion: one to a part that looks the same
    /// would show all of it.
    pub(crate) costs: LabelCosts,
}

impl Default for SelectionSettings {
    fn default() -> Self {
        Self {
            firsts: 6,
            extras: [0, 2, 4],
            sample: 2500,
            static_weight: 0.5,
            static_cost: 0.05,
            support_fall: 0.5,
            confirmed_fall: 0.1,
            least_support: 0.0003,
            least_noisy_support: 0.01,
            least_support_points: 8.0,
            patience: 2,
            costs: LabelCosts { hidden_static: 0.25, hidden_moved: 0.1, mismatch: 0.5, ..LabelCosts::default() },
        }
    }
}

/// Costs of a sample of points of both states under rest and every candidate.
pub(super) struct Table {
    pub(super) rest: Vec<f32>,
    /// Per candidate, `[n]`.
    pub(super) costs: Vec<Vec<f32>>,
    pub(super) weights: Vec<f32>,
    /// Per candidate, `[n]`: it takes a point that moved for certain onto one that moved for certain and looks the same.
    pub(super) confirmed: Vec<Vec<bool>>,
}

/// Chooses sets of candidates.
pub(super) struct Selection {
    table: Table,
    /// Points that a motion must support alone.
    least_support: f64,
    /// True where depth noise spreads points.
    spreading: bool,
    settings: SelectionSettings,
}

impl Selection {
    /// Computes what each candidate costs. A candidate is as plausible as for the points that it explains at last: found for a
    /// few points next to its axis, it may explain a whole part that is far from it.
    pub(super) fn new(
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        moved: &PerState<Vec<usize>>,
        pool: &[Candidate],
        settings: SelectionSettings,
        (ranking, front): (&RankingSettings, Option<Front>),
    ) -> Self {
        /// Points that judge the plausibility, and the least number that can.
        const SAMPLES: (usize, usize) = (300, 12);
        let judge = |motion: &Rigid, explained: &PerState<Vec<usize>>| {
            let s = better_seen(explained);
            let sample = sample_of(clouds[s].cloud, &explained[s], SAMPLES.0);
            // A slide has no axis; what else it seems to explain are parts that look the same.
            let known = sample.len() >= SAMPLES.1 && motion.angle() as f32 > ranking.least_turn;
            known.then(|| ranking.implausibility(&motion.away_from(s), &sample, &scene.lengths, front))
        };
        let table = tabulate(scene, clouds, moved, pool, &settings, &judge);
        let total: f64 = moved.iter().map(|points| points.len() as f64).sum();
        let share = if scene.spreading { settings.least_noisy_support } else { settings.least_support };
        let least_support = (share * total).max(settings.least_support_points);
        Self { table, least_support, spreading: scene.spreading, settings }
    }

    /// Indices of the candidates that explain both states best. The energy is the sum over sampled points of the cheapest
    /// explanation. Of each number in `count` the best set is searched; the largest number is taken of which every motion
    /// explains enough points that no other one does.
    pub(super) fn best(&self, count: RangeInclusive<usize>) -> Vec<usize> {
        let table = &self.table;
        let (least, most) = (*count.start(), (*count.end()).min(table.costs.len()));
        if least >= most {
            return table.best_set(most, &self.settings);
        }
        let (mut chosen, mut supported, mut accepted) = (Vec::new(), Vec::new(), least);
        for number in 1..=most {
            let next = table.next_set(&chosen);
            // Where noise spreads points, the set of least energy may contain a motion that only explains noise.
            let stays = !self.spreading || self.is_supported(&next);
            chosen = if stays { next } else { self.supported_set(&chosen).unwrap_or(next) };
            if self.is_supported(&chosen) {
                accepted = accepted.max(number);
                supported.clone_from(&chosen);
            } else if number > accepted + self.settings.patience {
                break;
            }
        }
        let best = table.best_set(accepted, &self.settings);
        // Of sets of nearly the same energy noise decides.
        let is_noise = self.spreading && supported.len() == accepted && !self.is_supported(&best);
        if is_noise { supported } else { best }
    }

    /// True if each motion explains enough points that no other one does.
    fn is_supported(&self, chosen: &[usize]) -> bool {
        self.table.supports(chosen, &self.settings).into_iter().all(|support| support >= self.least_support)
    }

    /// The set of least energy, of those with one candidate more than `chosen`, in which every motion is supported.
    fn supported_set(&self, chosen: &[usize]) -> Option<Vec<usize>> {
        let open = (0..self.table.costs.len()).into_par_iter().filter(|c| !chosen.contains(c));
        let sets: Vec<(f64, Vec<usize>)> = open
            .filter_map(|c| {
                let set = [chosen, &[c]].concat();
                self.is_supported(&set).then(|| (self.table.energy(&set), set))
            })
            .collect();
        sets.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|best| best.1)
    }
}

/// The two cheapest explanations of a row by rest or a chosen candidate.
#[derive(Clone, Copy)]
struct Cheapest {
    /// Position in the set; none: rest.
    slot: Option<u32>,
    least: f32,
    second: f32,
}

impl Table {
    fn cheapest(&self, chosen: &[usize]) -> Vec<Cheapest> {
        let mut out: Vec<Cheapest> =
            self.rest.iter().map(|c| Cheapest { slot: None, least: *c, second: f32::INFINITY }).collect();
        for (slot, c) in chosen.iter().enumerate() {
            for (best, cost) in out.iter_mut().zip(&self.costs[*c]) {
                if *cost < best.least {
                    *best = Cheapest { slot: Some(slot as u32), least: *cost, second: best.least };
                } else if *cost < best.second {
                    best.second = *cost;
                }
            }
        }
        out
    }

    fn energy_of(&self, cheapest: &[Cheapest]) -> f64 {
        cheapest.iter().zip(&self.weights).map(|(c, weight)| f64::from(c.least * weight)).sum()
    }

    pub(super) fn energy(&self, chosen: &[usize]) -> f64 {
        self.energy_of(&self.cheapest(chosen))
    }

    /// Weighted points of which each chosen candidate lowers the cost by enough. Where it alone takes a moved point onto a moved
    /// point, less is enough: the others only hide the point.
    fn supports(&self, chosen: &[usize], settings: &SelectionSettings) -> Vec<f64> {
        let mut out = vec![0.0; chosen.len()];
        for (i, (best, weight)) in self.cheapest(chosen).iter().zip(&self.weights).enumerate() {
            let Some(slot) = best.slot else { continue };
            let by = |slot: usize| self.confirmed[chosen[slot]][i];
            let alone = by(slot as usize) && (0..chosen.len()).filter(|k| by(*k)).count() == 1;
            let enough = if alone { settings.confirmed_fall } else { settings.support_fall };
            if best.second - best.least > enough {
                out[slot as usize] += f64::from(*weight);
            }
        }
        out
    }

    /// Adds the candidates that lower the energy most, one by one.
    fn grow(&self, chosen: &mut Vec<usize>, count: usize) {
        while chosen.len() < count {
            let cheapest = self.cheapest(chosen);
            let fall = |c: usize| -> f64 {
                let rows = self.costs[c].iter().zip(&cheapest).zip(&self.weights);
                rows.map(|((cost, best), weight)| f64::from((best.least - cost).max(0.0) * weight)).sum()
            };
            let open = (0..self.costs.len()).filter(|c| !chosen.contains(c));
            let Some((_, c)) = open.map(|c| (fall(c), c)).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1))) else {
                break;
            };
            chosen.push(c);
        }
    }

    /// Removes those that raise the energy least, one by one.
    fn shrink(&self, chosen: &mut Vec<usize>, count: usize) {
        while chosen.len() > count {
            let losses = self.losses(&self.cheapest(chosen), chosen.len());
            let Some((slot, _)) = losses.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)) else { break };
            chosen.remove(slot);
        }
    }

    /// How much the energy rises without each of `count` chosen candidates.
    fn losses(&self, cheapest: &[Cheapest], count: usize) -> Vec<f64> {
        let mut out = vec![0.0; count];
        for (best, weight) in cheapest.iter().zip(&self.weights) {
            if let Some(slot) = best.slot {
                out[slot as usize] += f64::from((best.second - best.least) * weight);
            }
        }
        out
    }

    /// Exchanges one for one while that lowers the energy, the best exchange first. The changes of all exchanges with one
    /// candidate need one pass over the rows (FasterPAM, Schubert and Rousseeuw 2021).
    fn exchange(&self, chosen: &mut [usize]) {
        if chosen.is_empty() {
            return;
        }
        loop {
            let cheapest = self.cheapest(chosen);
            let before = self.energy_of(&cheapest);
            let change = |c: usize| -> (f64, usize, usize) {
                let (mut added, mut removed) = (0.0f64, vec![0.0f64; chosen.len()]);
                for ((cost, best), weight) in self.costs[c].iter().zip(&cheapest).zip(&self.weights) {
                    let with = cost.min(best.least);
                    added += f64::from((with - best.least) * weight);
                    if let Some(slot) = best.slot {
                        removed[slot as usize] += f64::from((cost.min(best.second) - with) * weight);
                    }
                }
                let (slot, loss) =
                    removed.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).unwrap_or((0, &f64::INFINITY));
                (added + loss, slot, c)
            };
            let open = (0..self.costs.len()).filter(|c| !chosen.contains(c));
            let best = open.map(change).min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, slot, c)) = best.filter(|best| best.0 < -1e-6 * before) else { break };
            chosen[slot] = c;
        }
    }

    /// A good set with one candidate more than `chosen`: the better of this set grown and of one that is grown beyond and
    /// reduced.
    fn next_set(&self, chosen: &[usize]) -> Vec<usize> {
        let set = |extra: usize| {
            let mut set = chosen.to_vec();
            self.grow(&mut set, chosen.len() + 1 + extra);
            self.exchange(&mut set);
            self.shrink(&mut set, chosen.len() + 1);
            self.exchange(&mut set);
            (self.energy(&set), set)
        };
        let (plain, beyond) = rayon::join(|| set(0), || set(2));
        if beyond.0 < plain.0 { beyond.1 } else { plain.1 }
    }

    /// A good set of candidates of which each lowers the energy by more than `price`.
    pub(super) fn worth(&self, price: f64, settings: &SelectionSettings) -> Vec<usize> {
        let mut chosen = Vec::new();
        while chosen.len() < self.costs.len() {
            let mut more = chosen.clone();
            self.grow(&mut more, chosen.len() + 1);
            if self.energy(&chosen) - self.energy(&more) < price {
                break;
            }
            chosen = more;
        }
        let total = |set: &Vec<usize>| self.energy(set) + price * set.len() as f64;
        let more = (0..=settings.extras[1]).map(|extra| self.best_set(chosen.len() + extra, settings));
        let improved = more.min_by(|a, b| total(a).total_cmp(&total(b))).unwrap_or_default();
        self.without_cheap(improved, price)
    }

    /// Removes candidates that lower the energy by less than `price`, the one that does least first.
    fn without_cheap(&self, mut chosen: Vec<usize>, price: f64) -> Vec<usize> {
        loop {
            let losses = self.losses(&self.cheapest(&chosen), chosen.len());
            let least = losses.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
            let Some((slot, _)) = least.filter(|(_, loss)| **loss < price) else { return chosen };
            chosen.remove(slot);
            self.exchange(&mut chosen);
        }
    }

    /// The best set of `count` that was found. Sets are grown greedily, some beyond `count` and from several first
    /// candidates, reduced, and improved by exchanges of one for one. A single greedy set with exchanges stays at two wrong
    /// motions that share what two right ones explain.
    fn best_set(&self, count: usize, settings: &SelectionSettings) -> Vec<usize> {
        if self.costs.len() <= count {
            return (0..self.costs.len()).collect();
        }
        let firsts = std::iter::once(None).chain((0..settings.firsts.min(self.costs.len())).map(Some));
        let starts: Vec<(Option<usize>, usize)> =
            firsts.flat_map(|first| settings.extras.map(|extra| (first, extra))).collect();
        let ends = starts.par_iter().map(|(first, extra)| {
            let mut chosen: Vec<usize> = first.iter().copied().take(count).collect();
            self.grow(&mut chosen, count + extra);
            if *extra > 0 {
                self.exchange(&mut chosen);
                self.shrink(&mut chosen, count);
            }
            self.exchange(&mut chosen);
            (self.energy(&chosen), chosen)
        });
        let ends: Vec<(f64, Vec<usize>)> = ends.collect();
        ends.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(Vec::new, |best| best.1)
    }
}

/// The implausibility of a motion that explains the given points of each state, where it is to be recomputed.
type Implausibility<'a> = dyn Fn(&Rigid, &PerState<Vec<usize>>) -> Option<f32> + 'a;

fn tabulate(
    scene: &Scene,
    clouds: &PerState<IndexedCloud<'_>>,
    moved: &PerState<Vec<usize>>,
    pool: &[Candidate],
    settings: &SelectionSettings,
    implausibility: &Implausibility<'_>,
) -> Table {
    /// A point that costs less is explained.
    const EXPLAINED: f32 = 0.2;
    let mut explained = vec![PerState::<Vec<usize>>::default(); pool.len()];
    let nothing = vec![Vec::new(); pool.len()];
    let confirmed = vec![Vec::new(); pool.len()];
    let mut table = Table { rest: Vec::new(), costs: nothing, weights: Vec::new(), confirmed };
    let are_moved = PerState::from_fn(|s| {
        let mut is_moved = vec![false; clouds[s].cloud.len()];
        moved[s].iter().for_each(|&i| is_moved[i] = true);
        is_moved
    });
    for s in State::ALL {
        let cloud = clouds[s].cloud;
        let unmoved: Vec<usize> = (0..cloud.len()).filter(|&i| !are_moved[s][i]).collect();
        let moving = pool.iter().map(|c| c.motion.away_from(s));
        let to_other: Vec<Rigid> = std::iter::once(Rigid::IDENTITY).chain(moving).collect();
        let kinds = [(&moved[s], 1.0, 0.0), (&unmoved, settings.static_weight, settings.static_cost)];
        for (members, weight, extra) in kinds {
            let stride = members.len().div_ceil(settings.sample).max(1);
            let picked: Vec<usize> = members.iter().copied().step_by(stride).collect();
            let own = cloud.select(&picked);
            let own = IndexedCloud::new(&own);
            let pair = StatePair { own: &own, ..scene.pair(clouds, s) }.with_few_views();
            let landings = pair.landings(&to_other, &settings.costs);
            let cost = |(k, landing): (usize, &Landing)| landing.plain_cost(k % to_other.len() == 0, &settings.costs);
            let rows: Vec<f32> = landings.iter().enumerate().map(cost).collect();
            let onto_moved = |landing: &Landing| match landing {
                Landing::Surface(j, _) => are_moved[s.other()][*j as usize] && landing.fits(&settings.costs),
                _ => false,
            };
            table.rest.extend(rows.iter().step_by(to_other.len()));
            for (c, (costs, confirmed)) in table.costs.iter_mut().zip(&mut table.confirmed).enumerate() {
                let own = rows.iter().skip(c + 1).step_by(to_other.len());
                costs.extend(own.map(|cost| cost + extra));
                let own = landings.iter().skip(c + 1).step_by(to_other.len());
                confirmed.extend(own.map(|landing| scene.spreading && weight == 1.0 && onto_moved(landing)));
            }
            if weight == 1.0 {
                for (c, explained) in explained.iter_mut().enumerate() {
                    let costs = rows.iter().skip(c + 1).step_by(to_other.len());
                    let fits = costs.zip(&picked).filter(|(cost, _)| **cost < EXPLAINED).map(|(_, i)| *i);
                    explained[s] = fits.collect();
                }
            }
            table.weights.extend(vec![weight * stride as f32; picked.len()]);
        }
    }
    for ((costs, candidate), explained) in table.costs.iter_mut().zip(pool).zip(&explained) {
        let added = implausibility(&candidate.motion, explained).unwrap_or(candidate.implausibility);
        costs.iter_mut().for_each(|cost| *cost += added);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_right_motions_beat_wrong_ones_that_explain_more_at_first() {
        // Candidates 1 and 2 explain four points each; candidate 0 explains six, but leaves two to nothing cheap.
        let explains = [[0, 1, 2, 4, 5, 6].as_slice(), &[0, 1, 2, 3], &[4, 5, 6, 7]];
        let column = |e: &[usize]| (0..8).map(|i| if e.contains(&i) { 0.0 } else { 1.0 }).collect();
        let table = Table {
            rest: vec![1.0; 8],
            costs: explains.map(column).to_vec(),
            weights: vec![1.0; 8],
            confirmed: Vec::new(),
        };
        let mut chosen = Vec::new();
        table.grow(&mut chosen, 2);
        assert!(chosen[0] == 0 && table.energy(&chosen) == 1.0);
        table.grow(&mut chosen, 3);
        table.shrink(&mut chosen, 2);
        chosen.sort_unstable();
        assert_eq!((table.energy(&chosen), &chosen[..]), (0.0, &[1, 2][..]));
    }

    #[test]
    fn a_motion_that_only_hides_points_does_not_take_the_support_of_one_that_explains_them() {
        // Candidate 1 takes moved points onto moved points; candidate 0 takes them to where nothing is seen.
        let column = |e: &[usize]| (0..8).map(|i| if e.contains(&i) { 0.0 } else { 0.25 }).collect();
        let confirmed = [[0, 1, 2, 3].as_slice(), &[4, 5, 6, 7]];
        let marks = |e: &[usize]| (0..8).map(|i| e.contains(&i)).collect();
        let settings = SelectionSettings::default();
        let mut table = Table {
            rest: vec![1.0; 8],
            costs: confirmed.map(column).to_vec(),
            weights: vec![1.0; 8],
            confirmed: confirmed.map(marks).to_vec(),
        };
        assert_eq!(table.supports(&[0, 1], &settings), [4.0, 4.0]);
        table.confirmed = vec![vec![false; 8]; 2];
        assert_eq!(table.supports(&[0, 1], &settings), [0.0, 0.0]);
    }

    #[test]
    fn where_noise_spreads_points_a_motion_without_support_gives_way_to_one_with_support() {
        // Candidate 1 lowers the cost of every point by little; candidate 2 alone explains the last four.
        let costs = vec![
            vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.7, 0.7, 0.7, 0.7],
            vec![0.5; 12],
            vec![1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 0.1],
        ];
        let table = || Table {
            rest: vec![1.0; 12],
            costs: costs.clone(),
            weights: vec![1.0; 12],
            confirmed: vec![vec![false; 12]; 3],
        };
        let settings = SelectionSettings::default();
        let selection = |spreading: bool| Selection { table: table(), least_support: 3.0, spreading, settings };
        assert_eq!(selection(false).best(1..=2), [1]);
        let mut both = selection(true).best(1..=2);
        both.sort_unstable();
        assert_eq!(both, [0, 2]);
    }

    #[test]
    fn candidates_that_are_not_worth_their_price_are_left_out() {
        let explains = [[0, 1, 2, 3].as_slice(), &[4, 5, 6], &[7], &[0, 1, 2]];
        let column = |e: &[usize]| (0..8).map(|i| if e.contains(&i) { 0.0 } else { 2.0 }).collect();
        let table = Table {
            rest: vec![1.0; 8],
            costs: explains.map(column).to_vec(),
            weights: vec![1.0; 8],
            confirmed: Vec::new(),
        };
        let worth = |price: f64| {
            let mut chosen = table.worth(price, &SelectionSettings::default());
            chosen.sort_unstable();
            chosen
        };
        assert_eq!((worth(2.0), worth(0.5), worth(3.5)), (vec![0, 1], vec![0, 1, 2], vec![0]));
    }
}
