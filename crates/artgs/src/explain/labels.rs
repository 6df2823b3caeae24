//! Labels that lower the energy: parts grow by graph cuts, and what they take is kept region by region.

use super::energy::{Evidence, Explanation, Problem};
use crate::connected::connected_components;
use crate::discover::graph_cut::{expand_one, expand_only};
use artgs_core::State;
use std::collections::{HashMap, HashSet};

/// An explanation and its energy, nats.
struct Valued {
    explanation: Explanation,
    energy: f64,
}

/// Surfels of a state that a part would take.
struct Region {
    surfels: Vec<usize>,
    /// Nats that it saves if nothing else changes.
    gain: f32,
}

/// Regions that a part did not take, by their last surfel, number of surfels, part and state: they are not tried again.
type Refused = HashSet<(usize, usize, u16, State)>;

impl Problem<'_> {
    /// The same motions with labels that lower the energy, starting from the given ones.
    ///
    /// One part after the other grows in one state, by the best cut if the cost of a surfel did not depend on other labels. As it does, of what
    /// the part would take only those connected regions are kept that lower the energy.
    pub fn relabelled(&mut self, explanation: &Explanation) -> Explanation {
        const ROUNDS: usize = 8;
        let evidence = self.all(&explanation.motions);
        let mut best = self.valued(explanation.clone());
        let mut refused = Refused::new();
        for _ in 0..ROUNDS {
            let begun = best.energy;
            for s in State::ALL {
                for part in 0..evidence.len() as u16 {
                    let (next, regions) = self.regions(&best.explanation, &evidence, s, part);
                    let fresh =
                        regions.into_iter().filter(|r| !refused.contains(&name(r, part, s))).collect::<Vec<_>>();
                    best = self.with_regions(best, &next, s, part, &fresh, &mut refused);
                }
            }
            if best.energy >= begun - 1e-6 {
                break;
            }
        }
        best.explanation
    }

    /// The same motions with the parts `grown` grown once in each state, as if the cost of a surfel did not depend on other labels. A `fresh` one of
    /// them has no surfels yet, and takes those of other moving parts although it explains them worse by so many nats each.
    pub(super) fn grown(&mut self, explanation: &Explanation, grown: &[u16], fresh: Option<(u16, f32)>) -> Explanation {
        let evidence = self.all(&explanation.motions);
        let parts = evidence.len();
        let mut out = explanation.clone();
        for s in State::ALL {
            let mut context = self.context(&out, &evidence, s);
            context.fresh = fresh.map(|f| f.0);
            let labels = &out.labels[s];
            let yielded = |i: usize, k: u16| fresh.filter(|f| f.0 == k && labels[i] > 0).map_or(0.0, |f| f.1);
            let nats = |i: usize, k: u16| self.cost(&evidence, &context, s, i, k).nats() - yielded(i, k);
            let pairs = (0..labels.len()).flat_map(|i| (0..parts as u16).map(move |k| (i, k)));
            let data: Vec<f32> = pairs.map(|(i, k)| self.weights[s][i] * nats(i, k)).collect();
            expand_only(grown, &data, parts, &self.edges[s], self.settings.border, &mut out.labels[s], 1);
        }
        out
    }

    fn valued(&mut self, explanation: Explanation) -> Valued {
        let energy = self.terms(&explanation).total();
        Valued { explanation, energy }
    }

    /// What `part` would take in a state: all labels with that, and its connected regions, those that save most first.
    fn regions(&self, now: &Explanation, evidence: &[Evidence], s: State, part: u16) -> (Vec<u16>, Vec<Region>) {
        let (context, labels) = (self.context(now, evidence, s), &now.labels[s]);
        let of = |i: usize, part: u16| self.weights[s][i] * self.cost(evidence, &context, s, i, part).nats();
        let own: Vec<f32> = labels.iter().enumerate().map(|(i, l)| of(i, *l)).collect();
        let new: Vec<f32> = (0..labels.len()).map(|i| if labels[i] == part { own[i] } else { of(i, part) }).collect();
        let mut next = labels.clone();
        let border = self.settings.border;
        let edges = &self.edges[s];
        expand_one(part, &own, &new, edges, border, &mut next);
        let changed = |i: usize| labels[i] != next[i];
        let ends = edges.iter().map(|(i, j, _)| (*i as usize, *j as usize));
        let groups = connected_components(labels.len(), ends.filter(|(i, j)| changed(*i) && changed(*j)));
        let mut regions: HashMap<u32, Region> = HashMap::new();
        for i in (0..labels.len()).filter(|i| changed(*i)) {
            let region = regions.entry(groups[i]).or_insert(Region { surfels: Vec::new(), gain: 0.0 });
            region.surfels.push(i);
            region.gain += own[i] - new[i];
        }
        for (i, j, weight) in edges.iter().map(|(i, j, w)| (*i as usize, *j as usize, *w)) {
            let group = if changed(i) { groups[i] } else { groups[j] };
            if let Some(region) = regions.get_mut(&group).filter(|_| changed(i) || changed(j)) {
                let cut = |labels: &[u16]| f32::from(u8::from(labels[i] != labels[j]));
                region.gain += border * weight * (cut(labels) - cut(&next));
            }
        }
        let mut regions: Vec<Region> = regions.into_values().collect();
        regions.iter_mut().for_each(|r| r.gain /= self.shared);
        regions.sort_by(|a, b| b.gain.total_cmp(&a.gain).then(a.surfels.cmp(&b.surfels)));
        (next, regions)
    }

    /// With those of the labels `next` in `regions` that lower the energy: all at once, or those of one half and of the other.
    fn with_regions(
        &mut self,
        now: Valued,
        next: &[u16],
        s: State,
        part: u16,
        regions: &[Region],
        refused: &mut Refused,
    ) -> Valued {
        /// Regions that save less together are left, nats.
        const LEAST: f32 = 0.3;
        if regions.iter().map(|r| r.gain).sum::<f32>() < LEAST {
            return now;
        }
        let mut with = now.explanation.clone();
        regions.iter().flat_map(|r| &r.surfels).for_each(|i| with.labels[s][*i] = next[*i]);
        let with = self.valued(with);
        if with.energy < now.energy - 1e-6 {
            return with;
        }
        if let [region] = regions {
            refused.insert(name(region, part, s));
            return now;
        }
        let (a, b) = regions.split_at(regions.len() / 2);
        let now = self.with_regions(now, next, s, part, a, refused);
        self.with_regions(now, next, s, part, b, refused)
    }
}

fn name(region: &Region, part: u16, s: State) -> (usize, usize, u16, State) {
    (region.surfels.last().copied().unwrap_or(0), region.surfels.len(), part, s)
}
