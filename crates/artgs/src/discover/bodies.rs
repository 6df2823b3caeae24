//! Parts as bodies: hypotheses that each hold for a region of space (`face_motions`) are chosen together, so that the
//! motion of one drawer cannot explain a piece of another one.

use super::candidates::Search;
use super::cloud::IndexedCloud;
use super::config::StepSettings;
use super::face_motions::{Hypothesis, Region};
use super::landing::StatePair;
use super::scene::Scene;
use super::selection::{SelectionSettings, Table};
use artgs_core::{PerState, Rigid, State};
use glam::Vec3;
use rayon::prelude::*;

/// Settings of bodies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodySettings {
    /// Hypotheses that are compared.
    pub(crate) hypotheses: usize,
    /// A body must explain at least this share of the moved points that no other one does.
    pub(crate) least_share: f64,
    /// Weight of the implausibility of a motion. An exchange of the places of two equal doors explains all that is seen of
    /// them, so only its implausibility speaks against it.
    pub(crate) implausible: f32,
    /// Motions that take the points of a region to places this close are the same, spacings.
    pub(crate) same: f32,
}

impl Default for BodySettings {
    fn default() -> Self {
        Self { hypotheses: 240, least_share: 0.01, implausible: 2.0, same: 1.0 }
    }
}

/// A motion from start to end and the space in which it may explain points.
#[derive(Clone, Debug)]
struct Body {
    motion: Rigid,
    regions: Vec<Region>,
}

impl Body {
    /// True if a point of a state is in one of its regions.
    fn contains(&self, state: State, point: Vec3) -> bool {
        self.regions.iter().any(|r| r.contains(state, point, &self.motion))
    }
}

impl BodySettings {
    /// Motions, start to end, of the bodies that explain both states best, of as many as each explain enough.
    pub(super) fn motions(
        &self,
        search: &Search<'_>,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        settings: &StepSettings,
    ) -> Vec<Rigid> {
        // Noise takes points of the floor of a drawer below the lower edge of its front.
        let margin = if scene.spreading { scene.tolerance } else { 0.0 };
        let widened = |h: Hypothesis| Hypothesis { region: h.region.widened(margin), ..h };
        let hypotheses = search.hypotheses_of_faces(&settings.facets, self.hypotheses);
        let hypotheses: Vec<Hypothesis> = hypotheses.into_iter().map(widened).collect();
        // The face of a body is seen in parts, in one state more of it than in the other.
        let reach = f64::from(self.same * scene.lengths.spacing);
        let bodies: Vec<Body> = hypotheses.par_iter().map(|h| united(clouds, h, &hypotheses, reach)).collect();
        let table = self.tabulated(search, scene, clouds, (&hypotheses, &bodies), &settings.selection);
        let moved = search.states.iter().map(|s| s.moved.len() as f64).sum::<f64>();
        let mut motions: Vec<usize> = Vec::new();
        for c in table.worth(self.least_share * moved, &settings.selection) {
            if !motions.iter().any(|&m| continues(clouds, &hypotheses[m], &hypotheses[c], reach)) {
                motions.push(c);
            }
        }
        motions.into_iter().map(|c| bodies[c].motion).collect()
    }

    /// Costs of moved points under rest and every body; outside of its regions a body explains nothing.
    fn tabulated(
        &self,
        search: &Search<'_>,
        scene: &Scene,
        clouds: &PerState<IndexedCloud<'_>>,
        (hypotheses, bodies): (&[Hypothesis], &[Body]),
        settings: &SelectionSettings,
    ) -> Table {
        /// Cost of what a body does not explain.
        const OUTSIDE: f32 = 2.0;
        let nothing = vec![Vec::new(); bodies.len()];
        let mut table = Table { rest: Vec::new(), costs: nothing, weights: Vec::new(), confirmed: Vec::new() };
        for (s, state) in search.states.enumerate() {
            let stride = state.moved.len().div_ceil(settings.sample).max(1);
            let picked: Vec<usize> = state.moved.iter().copied().step_by(stride).collect();
            let own = state.points.cloud.select(&picked);
            let landings = |members: &[usize], motion: &Rigid| {
                let own = own.select(members);
                let own = IndexedCloud::new(&own);
                StatePair { own: &own, ..scene.pair(clouds, s) }
                    .with_few_views()
                    .landings(&[motion.away_from(s)], &settings.costs)
            };
            let all: Vec<usize> = (0..own.len()).collect();
            table.rest.extend(landings(&all, &Rigid::IDENTITY).iter().map(|l| l.plain_cost(true, &settings.costs)));
            for ((costs, body), hypothesis) in table.costs.iter_mut().zip(bodies).zip(hypotheses) {
                let inside: Vec<usize> = (0..own.len()).filter(|&i| body.contains(s, own.points[i])).collect();
                let first = costs.len();
                costs.resize(first + own.len(), OUTSIDE);
                for (i, landing) in inside.iter().zip(landings(&inside, &body.motion)) {
                    let implausibility = self.implausible * hypothesis.candidate.implausibility;
                    costs[first + i] = landing.cost(&settings.costs) + implausibility;
                }
            }
            table.weights.extend(vec![stride as f32; picked.len()]);
        }
        table
    }
}

/// The body of a hypothesis: its region and those of all hypotheses that continue it.
fn united(clouds: &PerState<IndexedCloud<'_>>, hypothesis: &Hypothesis, others: &[Hypothesis], reach: f64) -> Body {
    let others = others.iter().filter(|other| continues(clouds, hypothesis, other, reach));
    let regions = std::iter::once(hypothesis.region).chain(others.map(|other| other.region)).collect();
    Body { motion: hypothesis.candidate.motion, regions }
}

/// True if two hypotheses take the points that they explain to the same places, up to `reach` (scene units), and their
/// regions overlap.
fn continues(clouds: &PerState<IndexedCloud<'_>>, a: &Hypothesis, b: &Hypothesis, reach: f64) -> bool {
    /// Every so many points are compared.
    const STRIDE: usize = 17;
    /// Least share of the points that one explains in the region of the other.
    const SHARED: f64 = 0.25;
    let (m, n) = (a.candidate.motion, b.candidate.motion);
    let explained = |h: &Hypothesis| -> Vec<(State, Vec3)> {
        let of_state = |s: State| {
            let points = h.candidate.explained[s].iter().step_by(STRIDE);
            points.map(move |&i| (s, clouds[s].cloud.points[i])).collect::<Vec<_>>()
        };
        State::ALL.into_iter().flat_map(of_state).collect()
    };
    let (of_a, of_b) = (explained(a), explained(b));
    let same = |(s, p): &(State, Vec3)| {
        let p = p.as_dvec3();
        m.away_from(*s).apply(p).distance(n.away_from(*s).apply(p)) < reach
    };
    let shared = of_b.iter().filter(|(s, p)| a.region.contains(*s, *p, &m)).count();
    shared as f64 > SHARED * of_b.len() as f64 && of_a.iter().chain(&of_b).all(same)
}

#[cfg(test)]
mod tests {
    use super::super::Cloud;
    use super::super::candidates::Candidate;
    use super::super::face_motions::tests::face;
    use super::super::facets::Facet;
    use super::*;
    use glam::DVec3;

    #[test]
    fn only_hypotheses_with_one_motion_and_overlapping_regions_continue_each_other() {
        let (mut cloud, left) = face(0.0);
        let (beside, _) = face(31.0);
        cloud.append(&beside);
        let right = |first: usize, last: usize| {
            let members: Vec<usize> = (600 + first..600 + last).collect();
            let centre = cloud.select(&members).middle();
            Facet { members, centre, normal: Vec3::NEG_Y }
        };
        let hypothesis = |facet: &Facet, shift: f64| Hypothesis {
            candidate: Candidate {
                motion: Rigid::shift(DVec3::NEG_Y * shift),
                explained: PerState::new(facet.members.clone(), Vec::new()),
                gain: 1.0,
                implausibility: 0.0,
                turned_over: false,
            },
            region: Region::around(&cloud, facet, State::START, 1.0, 40.0),
        };
        let empty = Cloud::default();
        let clouds = PerState::new(IndexedCloud::new(&cloud), IndexedCloud::new(&empty));
        let continues = |a: &Hypothesis, b: &Hypothesis| continues(&clouds, a, b, 1.0);
        let whole = hypothesis(&right(0, 600), 9.0);
        assert!(continues(&whole, &hypothesis(&right(0, 300), 9.4)));
        assert!(!continues(&whole, &hypothesis(&right(0, 300), 11.0)));
        assert!(!continues(&whole, &hypothesis(&left, 9.0)));
        let body = united(&clouds, &whole, &[hypothesis(&left, 9.0), hypothesis(&right(0, 300), 9.4)], 1.0);
        assert_eq!(body.regions.len(), 2);
        assert!(!body.contains(State::START, Vec3::new(12.0, 0.0, 6.0)));
    }
}
