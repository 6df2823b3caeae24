//! Labels of surfels from labelled points, and the explanation of what discovery found.

use super::energy::{Explanation, Problem};
use super::search::SearchSettings;
use crate::discover::{Cloud, Discovery};
use crate::neighbours::PointTree;
use artgs_core::{PerState, State};

impl Problem<'_> {
    /// The explanation of what discovery found, parts that move alike joined and labels cut.
    pub fn explained(&mut self, found: &Discovery, settings: &SearchSettings) -> Explanation {
        let explanation = Explanation {
            motions: found.parts.iter().map(|p| p.motion).collect(),
            numbers: found.parts.iter().map(|p| p.kind.numbers()).collect(),
            labels: self.labels_like(&found.clouds, &found.labels),
        };
        self.settled(&explanation, settings)
    }

    /// Share of the surfels of a state that no motion explains: those that cost more than a nat, each counted as far as its own state confirms
    /// it; of both states the larger share. A surfel that is hidden, or that shows the other face of a plate, is explained.
    pub fn unexplained_share(&mut self, explanation: &Explanation) -> f64 {
        /// Nats of a surfel that is as likely explained as not.
        const EXPLAINED: f32 = 1.0;
        let costs = self.costs(explanation);
        let share = |s: State| {
            let all = || costs[s].iter().zip(&self.weights[s]);
            let sum: f32 = all().map(|(_, weight)| weight).sum();
            let unexplained: f32 = all().filter(|(cost, weight)| **cost > EXPLAINED * **weight).map(|(_, w)| w).sum();
            f64::from(unexplained / sum.max(f32::MIN_POSITIVE))
        };
        State::ALL.map(share).into_iter().fold(0.0, f64::max)
    }

    /// True if no part saves what it costs: the states show one body at rest.
    pub fn is_at_rest(&mut self, explanation: &Explanation, settings: &SearchSettings) -> bool {
        self.without_surplus_parts(explanation, settings).motions.is_empty()
    }

    /// Labels of the surfels from the nearest of the labelled points of clouds.
    pub(crate) fn labels_like(&self, clouds: &PerState<Cloud>, labels: &PerState<Vec<u16>>) -> PerState<Vec<u16>> {
        PerState::from_fn(|s| {
            let points: Vec<[f32; 3]> = clouds[s].points.iter().map(|p| p.to_array()).collect();
            self.nearest_labels(s, &points, &labels[s])
        })
    }

    /// Labels of the surfels of a state from the nearest of some labelled points, 0 if there are none.
    pub(super) fn nearest_labels(&self, state: State, points: &[[f32; 3]], labels: &[u16]) -> Vec<u16> {
        let tree = PointTree::new(points);
        let nearest = |p: &glam::Vec3| tree.nearest_within(&p.to_array(), f32::INFINITY);
        self.clouds[state].cloud.points.iter().map(|p| nearest(p).map_or(0, |n| labels[n.0])).collect()
    }
}
