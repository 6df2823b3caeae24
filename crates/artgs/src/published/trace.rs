//! What the stages of the published method decided, kept so that it can be printed, saved and scored afterwards.

use crate::articulation::Trained;
use crate::fit::{Deformation, Follow, StepStats, TrainState};
use crate::published::canonical::Canonical;
use artgs_core::{Rigid, State};
use glam::DQuat;
use serde::{Deserialize, Serialize};

/// Samples of a training at most, the first and the last step included.
const SAMPLES: usize = 20;
/// Gaussians of a sample at most.
const POINTS: usize = 1000;

/// The decisions of every stage after the Gaussians of each state. Positions are in scene units of the capture; part 0 is
/// the static one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PublishedTrace {
    /// Index of the state whose Gaussians are the source of static Gaussians and of centres.
    pub state: usize,
    /// Positions of the matched Gaussians at start and end.
    pub pairs: Vec<[[f32; 3]; 2]>,
    /// Which Gaussians of that state were copied as static, by index.
    pub copied: Vec<usize>,
    /// Which Gaussians of the start and of the end have moved, by index, and the part that their cluster became.
    pub clusters: [Vec<(usize, u16)>; 2],
    /// Centre of every part, `[K]`.
    pub centres: Vec<[f32; 3]>,
    /// Radius of every part, `[K]`.
    pub radii: Vec<f32>,
    /// Samples of the training that decides the kinds of joints; empty if it is left out.
    pub types: Vec<TraceSample>,
    /// Whether each movable part was taken for one that turns, `[K - 1]`.
    pub turns: Vec<bool>,
    /// Samples of the joint optimisation.
    pub articulate: Vec<TraceSample>,
}

/// A training at one step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TraceSample {
    /// Steps done.
    pub step: usize,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Half motions of the movable parts, `[K - 1]`, world frame.
    pub half_motions: Vec<Rigid>,
    /// Canonical positions of some Gaussians that are more than half opaque, or of any if none is, evenly chosen.
    pub points: Vec<[f32; 3]>,
    /// Most probable part of each, as many as points.
    pub labels: Vec<u16>,
}

impl PublishedTrace {
    /// What the canonical start decided.
    pub(crate) fn of_start(canonical: &Canonical) -> Self {
        Self {
            state: canonical.more_motion_state.index(),
            pairs: canonical.pairs.clone(),
            copied: canonical.copied.clone(),
            clusters: State::ALL.map(|s| canonical.movable_clusters[s].clone()),
            centres: canonical.centres.clone(),
            radii: canonical.radii.clone(),
            ..Self::default()
        }
    }

    /// The state of the static Gaussians and of the centres.
    pub fn source(&self) -> State {
        State::from_index(self.state).unwrap_or(State::END)
    }
}

impl TraceSample {
    fn of(step: usize, positions: &[[f32; 3]], opacities: &[f32], labels: &[u16], half_motions: Vec<Rigid>) -> Self {
        let opaque: Vec<usize> = (0..positions.len()).filter(|&i| opacities[i] > 0.0).collect();
        // A reset of opacities leaves none.
        let opaque = if opaque.is_empty() { (0..positions.len()).collect() } else { opaque };
        let every = opaque.len().div_ceil(POINTS).max(1);
        let chosen: Vec<usize> = opaque.into_iter().step_by(every).collect();
        let points = chosen.iter().map(|&i| positions[i]).collect();
        let labels = chosen.iter().map(|&i| labels[i]).collect();
        Self { step, gaussians: positions.len(), half_motions, points, labels }
    }

    /// The end of a training.
    pub(crate) fn last(step: usize, trained: &Trained) -> Self {
        let half_motions = trained.half_motions().split_off(1);
        Self::of(step, &trained.splats.means, &trained.splats.logit_opacities, &trained.labels, half_motions)
    }

    fn during(state: &TrainState) -> Option<Self> {
        let Deformation::Articulated(parts) = &state.deformation else { return None };
        let motion = |q: &crate::articulation::DualQuaternion| Rigid::from_dual_quaternion(q.real, q.dual);
        let half_motions = parts.half_motions()[1..].iter().map(motion).collect();
        let splats = &state.splats;
        Some(Self::of(state.step, &splats.means, &splats.logit_opacities, &parts.labels(splats), half_motions))
    }

    /// Turns of the half motions, degrees, `[K - 1]`.
    pub fn half_angles_deg(&self) -> Vec<f64> {
        let angle = |m: &Rigid| 2.0 * m.rotation.dot(DQuat::IDENTITY).abs().min(1.0).acos().to_degrees();
        self.half_motions.iter().map(angle).collect()
    }
}

/// Follows a training, and takes samples of it. Everything is passed on.
pub(crate) struct Sampling<'f> {
    pub(crate) inner: &'f mut dyn Follow,
    pub(crate) samples: Vec<TraceSample>,
    /// Step from which the next sample is due.
    next: usize,
    due: bool,
}

impl<'f> Sampling<'f> {
    pub(crate) fn new(inner: &'f mut dyn Follow) -> Self {
        Self { inner, samples: Vec::new(), next: 1, due: false }
    }

    /// All samples, that of the end included.
    pub(crate) fn ended(mut self, steps: usize, trained: &Trained) -> Vec<TraceSample> {
        self.samples.retain(|s| s.step < steps);
        self.samples.push(TraceSample::last(steps, trained));
        self.samples
    }
}

impl Follow for Sampling<'_> {
    fn step(&mut self, stats: StepStats) {
        if stats.step >= self.next && stats.step < stats.total {
            self.due = true;
            let every = stats.total.div_ceil(SAMPLES - 1).max(1);
            self.next = (stats.step / every + 1) * every;
        }
        self.inner.step(stats);
    }

    fn stage(&mut self, name: &'static str) {
        self.inner.stage(name);
    }

    fn note(&mut self, message: String) {
        self.inner.note(message);
    }

    fn wants_snapshot(&mut self) -> bool {
        // Asked before the other, which counts how often it is asked.
        self.inner.wants_snapshot() || self.due
    }

    fn snapshot(&mut self, state: &TrainState, total: usize) {
        if self.due {
            self.samples.extend(TraceSample::during(state));
            self.due = false;
        }
        if self.inner.wants_snapshot() {
            self.inner.snapshot(state, total);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_few_even_and_opaque() {
        let positions: Vec<[f32; 3]> = (0..5000).map(|i| [i as f32, 0.0, 0.0]).collect();
        let opacities: Vec<f32> = (0..5000).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let labels: Vec<u16> = (0..5000).map(|i| (i % 3) as u16).collect();
        let sample = TraceSample::of(7, &positions, &opacities, &labels, vec![Rigid::IDENTITY]);
        assert_eq!((sample.step, sample.gaussians), (7, 5000));
        assert_eq!(sample.points.len(), 834);
        for (p, label) in sample.points.iter().zip(&sample.labels) {
            assert!((p[0] as usize).is_multiple_of(2) && p[0] as usize % 3 == usize::from(*label));
        }
        assert_eq!(sample.half_angles_deg(), [0.0]);
        let reset = TraceSample::of(7, &positions, &vec![-4.6; 5000], &labels, Vec::new());
        assert_eq!((reset.points.len(), reset.labels.len()), (1000, 1000));
        let text = serde_json::to_string(&sample).unwrap();
        assert_eq!(serde_json::from_str::<TraceSample>(&text).unwrap(), sample);
    }

    #[test]
    fn a_training_is_sampled_at_its_first_step_and_then_evenly() {
        let mut inner = |_: StepStats| {};
        let mut sampling = Sampling::new(&mut inner);
        let mut steps = Vec::new();
        for step in 1..=100 {
            sampling.step(StepStats { step, total: 100, ..StepStats::default() });
            if sampling.wants_snapshot() {
                steps.push(step);
                sampling.snapshot(&TrainState::default(), 100);
            }
        }
        assert_eq!(steps[..4], [1, 6, 12, 18]);
        assert_eq!((steps.len(), steps.last()), (17, Some(&96)));
    }
}
