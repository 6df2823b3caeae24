//! The energy of an explanation.

use super::cost::{Context, Cost, Prices, cost, mean_nats};
use super::evidence::{Look, Seen};
use super::motion::{Registered, Residuals, registered};
use super::noise::Noise;
use super::settings::ExplainSettings;
use crate::discover::Cloud;
use crate::discover::cloud::IndexedCloud;
use crate::discover::scene::Scene;
use crate::discover::segmentation::GraphSettings;
use artgs_core::{PerState, Rigid, State};
use std::collections::HashMap;
use std::sync::Arc;

/// Motions of the parts and a part for every surfel.
#[derive(Clone, Debug)]
pub struct Explanation {
    /// Motion of parts 1.. from start to end, world frame.
    pub motions: Vec<Rigid>,
    /// Numbers that each motion needs, as [`artgs_core::JointKind::numbers`]; fewer where other parts give its direction.
    pub numbers: Vec<u8>,
    /// Part of every surfel of each state; 0 is static.
    pub labels: PerState<Vec<u16>>,
}

impl Explanation {
    /// Nothing moves; for so many surfels of each state.
    pub fn without_parts(surfels: PerState<usize>) -> Self {
        Self { motions: Vec::new(), numbers: Vec::new(), labels: surfels.map(|n| vec![0; n]) }
    }

    /// With the surfels of part `k` given to part `j`, both from 1.
    pub(super) fn joined(&self, j: usize, k: usize) -> Self {
        let mut out = self.clone();
        out.labels.iter_mut().flatten().filter(|l| usize::from(**l) == k).for_each(|l| *l = j as u16);
        out.without(k)
    }

    /// Without part `k` (from 1); its surfels become static.
    pub fn without(&self, k: usize) -> Self {
        let mut out = self.clone();
        out.motions.remove(k - 1);
        out.numbers.remove(k - 1);
        let k = k as u16;
        let fewer = |l: u16| if l == k { 0 } else { l - u16::from(l > k) };
        out.labels.iter_mut().flatten().for_each(|l| *l = fewer(*l));
        out
    }
}

/// Energy by term, nats.
#[derive(Clone, Copy, Debug, Default)]
pub struct Terms {
    /// Surfels whose place is seen.
    pub visible: f64,
    /// Surfels whose place no view shows.
    pub hidden: f64,
    /// Borders between parts.
    pub border: f64,
    /// Numbers of the motions.
    pub length: f64,
}

impl Terms {
    /// The energy.
    pub fn total(&self) -> f64 {
        self.visible + self.hidden + self.border + self.length
    }
}

/// The surfels of both states.
pub struct Surfels {
    /// World frame of each state.
    pub clouds: PerState<Cloud>,
}

impl Surfels {
    /// The points of a scene, thinned.
    pub fn new(scene: &Scene, settings: &ExplainSettings) -> Self {
        let voxel = settings.spacing * scene.lengths.spacing;
        let thinned = |cloud: &Cloud| if settings.spacing > 1.0 { cloud.thinned(voxel) } else { cloud.clone() };
        Self { clouds: scene.states.as_ref().map(|s| thinned(&s.cloud)) }
    }
}

/// Two surfels that are neighbours, and how much a border between them costs.
pub(super) type Edge = (u32, u32, f32);

/// What the views of the other state say about every surfel of each state under one motion.
pub(super) type Evidence = Arc<PerState<Vec<Seen>>>;

/// Identifies a motion.
fn key(motion: &Rigid) -> [u64; 7] {
    let (q, t) = (motion.rotation, motion.translation);
    [q.x, q.y, q.z, q.w, t.x, t.y, t.z].map(f64::to_bits)
}

/// Both states, their noise, and what has been found out about motions.
pub struct Problem<'a> {
    pub(super) scene: &'a Scene,
    pub(super) settings: ExplainSettings,
    pub(super) clouds: PerState<IndexedCloud<'a>>,
    pub(super) edges: PerState<Vec<Edge>>,
    /// Measured in each state.
    pub(super) noise: PerState<Noise>,
    /// Of surfels that are not where they are predicted.
    pub(super) prices: Prices,
    /// Neighbouring surfels that count as one.
    pub shared: f32,
    /// Deviation of the distance by which the states disagree where nothing moved, beyond that, scene units.
    pub(super) common: f32,
    /// How far each surfel is to be believed, 0 to 1: less where views of its own state contradict it.
    pub(super) weights: PerState<Vec<f32>>,
    known: HashMap<[u64; 7], Evidence>,
}

impl<'a> Problem<'a> {
    /// Measures the noise of both states.
    pub fn new(scene: &'a Scene, surfels: &'a Surfels, settings: ExplainSettings) -> Self {
        let noise = PerState::from_fn(|s| Noise::measured(scene, &surfels.clouds[s], s, &settings));
        let spacing = settings.spacing * scene.lengths.spacing;
        let edges = surfels.clouds.as_ref().map(|cloud| GraphSettings::default().graph(cloud, spacing).into_edges());
        let mut problem = Self {
            scene,
            settings,
            clouds: surfels.clouds.as_ref().map(|cloud| IndexedCloud::gridded(cloud, spacing)),
            edges,
            prices: Prices::measured(&noise, scene.lengths.diagonal),
            shared: noise.iter().map(|n| n.shared).sum::<f32>() / 2.0,
            noise,
            common: 0.0,
            weights: PerState::default(),
            known: HashMap::new(),
        };
        problem.common = problem.common_error();
        for noise in problem.noise.iter_mut() {
            noise.add(problem.common);
        }
        problem.prices = Prices::measured(&problem.noise, scene.lengths.diagonal);
        problem.weights = PerState::from_fn(|s| problem.weights_of(s));
        problem
    }

    /// Weights of the surfels of a state from what its own views say about them.
    fn weights_of(&self, state: State) -> Vec<f32> {
        let own = self.look(state, state).all(&Rigid::IDENTITY);
        own.iter().map(|seen| (-mean_nats(seen, &self.prices)).exp()).collect()
    }

    /// Diagonal of the object, scene units.
    pub(super) fn diagonal(&self) -> f32 {
        self.scene.lengths.diagonal
    }

    /// Number of surfels of each state.
    pub fn surfels(&self) -> PerState<usize> {
        self.clouds.as_ref().map(|c| c.cloud.len())
    }

    /// What the views say under a motion.
    pub(super) fn evidence(&mut self, motion: &Rigid) -> Evidence {
        let key = key(motion);
        if let Some(known) = self.known.get(&key) {
            return known.clone();
        }
        let of = |s: State| self.look(s, s.other()).all(&motion.away_from(s));
        let evidence = Arc::new(PerState::from_fn(of));
        self.known.insert(key, evidence.clone());
        evidence
    }

    /// What surfel `i` of a state costs in part `part`.
    pub(super) fn cost(&self, evidence: &[Evidence], context: &Context, s: State, i: usize, part: u16) -> Cost {
        let seen = &evidence[usize::from(part)][s][i];
        cost(seen, part, context.believed(part, i), context, &self.prices, &self.settings)
    }

    /// What an explanation says about the surfels of a state.
    pub(super) fn context(&self, explanation: &Explanation, evidence: &[Evidence], state: State) -> Context {
        Context::new(explanation, evidence, state, (&self.edges[state], self.shared), &self.settings)
    }

    /// Evidence of the static part and of every motion.
    pub(super) fn all(&mut self, motions: &[Rigid]) -> Vec<Evidence> {
        std::iter::once(&Rigid::IDENTITY).chain(motions).map(|m| self.evidence(m)).collect()
    }

    /// Surfels of each part, the static part first, with the nats of those that are seen and of those that are hidden.
    pub fn by_part(&mut self, explanation: &Explanation) -> Vec<(usize, f64, f64)> {
        let evidence = self.all(&explanation.motions);
        let mut out = vec![(0, 0.0, 0.0); evidence.len()];
        for s in State::ALL {
            let context = self.context(explanation, &evidence, s);
            for (i, label) in explanation.labels[s].iter().enumerate() {
                let weight = f64::from(self.weights[s][i] / self.shared);
                let sum = &mut out[usize::from(*label)];
                sum.0 += 1;
                match self.cost(&evidence, &context, s, i, *label) {
                    Cost::Visible(nats) => sum.1 += weight * f64::from(nats),
                    Cost::Hidden(nats) => sum.2 += weight * f64::from(nats),
                }
            }
        }
        out
    }

    /// The energy by term.
    pub fn terms(&mut self, explanation: &Explanation) -> Terms {
        let parts = self.by_part(explanation);
        let mut terms = Terms::default();
        parts.iter().for_each(|(_, visible, hidden)| {
            terms.visible += visible;
            terms.hidden += hidden;
        });
        for s in State::ALL {
            let labels = &explanation.labels[s];
            let cut = self.edges[s].iter().filter(|(i, j, _)| labels[*i as usize] != labels[*j as usize]);
            terms.border += f64::from(self.settings.border / self.shared) * cut.map(|e| f64::from(e.2)).sum::<f64>();
        }
        terms.length = explanation.numbers.iter().map(|n| self.nats_of_numbers(*n)).sum();
        terms
    }

    /// Nats of the numbers of a motion.
    pub(super) fn nats_of_numbers(&self, numbers: u8) -> f64 {
        let independent = self.surfels().iter().sum::<usize>() as f64 / f64::from(self.shared);
        0.5 * f64::from(numbers) * independent.max(2.0).ln()
    }

    /// Nats of every surfel.
    pub(super) fn costs(&mut self, explanation: &Explanation) -> PerState<Vec<f32>> {
        let evidence = self.all(&explanation.motions);
        PerState::from_fn(|s| {
            let context = self.context(explanation, &evidence, s);
            let of =
                |(i, label): (usize, &u16)| self.weights[s][i] * self.cost(&evidence, &context, s, i, *label).nats();
            explanation.labels[s].iter().enumerate().map(of).collect()
        })
    }

    /// Nats that the surfels `asked` would save in sum if each moved by `motion` where that is better for it than its own, before borders.
    pub(super) fn gain(
        &self,
        costs: &PerState<Vec<f32>>,
        asked: &PerState<Vec<usize>>,
        contexts: &PerState<Context>,
        motion: &Rigid,
    ) -> f64 {
        let mut saved = 0.0;
        for s in State::ALL {
            let look = self.look(s, s.other());
            let motion = motion.away_from(s);
            for &i in &asked[s] {
                let seen = look.seen(i, &motion);
                // The part has no surfels that could hide it.
                let new = cost(&seen, u16::MAX, 1.0, &contexts[s], &self.prices, &self.settings).nats();
                saved += f64::from((costs[s][i] - self.weights[s][i] * new).max(0.0));
            }
        }
        saved / f64::from(self.shared)
    }

    /// What an explanation says about the surfels of each state.
    pub(super) fn contexts(&mut self, explanation: &Explanation) -> PerState<Context> {
        let evidence = self.all(&explanation.motions);
        PerState::from_fn(|s| self.context(explanation, &evidence, s))
    }

    /// Forgets what is known about motions that the explanation does not have.
    pub(super) fn forget_all_but(&mut self, explanation: &Explanation) {
        let kept: Vec<_> = std::iter::once(&Rigid::IDENTITY).chain(&explanation.motions).map(key).collect();
        self.known.retain(|key, _| kept.contains(key));
    }

    /// The views of a state, asked about surfels of another one or its own.
    fn look(&self, from: State, to: State) -> Look<'_> {
        Look {
            cloud: self.clouds[from].cloud,
            shown: &self.clouds[to],
            views: &self.scene.states[to].views,
            noise: &self.noise[to],
            settings: &self.settings,
            spacing: self.spacing(),
            thickness: self.settings.thickness * self.diagonal(),
        }
    }

    /// Distance between neighbouring surfels, scene units.
    pub(super) fn spacing(&self) -> f32 {
        self.settings.spacing * self.scene.lengths.spacing
    }

    /// Points of a part in each state.
    pub(super) fn members(&self, explanation: &Explanation, part: u16) -> PerState<Vec<usize>> {
        explanation.labels.as_ref().map(|labels| (0..labels.len()).filter(|&i| labels[i] == part).collect())
    }

    /// Nats of the motion of part `part` (from 1) if errors that the states have in common were the cause of it; infinite without such
    /// errors.
    pub fn drift(&self, explanation: &Explanation, part: usize) -> f64 {
        if self.common <= 0.0 {
            return f64::INFINITY;
        }
        let members = self.members(explanation, part as u16);
        let (mut sum, mut count) = (0.0, 0.0);
        for s in State::ALL {
            let motion = explanation.motions[part - 1].away_from(s);
            for &i in &members[s] {
                let p = self.clouds[s].cloud.points[i].as_dvec3();
                sum += motion.apply(p).distance_squared(p);
                count += 1.0;
            }
        }
        0.5 * sum / f64::max(count, 1.0) / f64::from(self.common).powi(2)
    }

    /// The motion of part `part` (from 1), registered to what the views show.
    pub fn registered(&self, explanation: &Explanation, part: usize) -> Registered {
        let members = self.members(explanation, part as u16);
        registered(&self.residuals(&members), explanation.motions[part - 1])
    }

    /// Depth residuals of the surfels `members` of a part.
    pub(super) fn residuals<'b>(&'b self, members: &'b PerState<Vec<usize>>) -> Residuals<'b> {
        let Self { scene, clouds, noise, shared, settings, .. } = self;
        Residuals { scene, clouds, noise, shared: *shared, members, settings }
    }
}
