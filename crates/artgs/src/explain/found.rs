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

    /// True if no part of what was found saves what it costs: the states show one body at rest.
    pub fn is_at_rest(&mut self, found: &Discovery) -> bool {
        let settings = SearchSettings::default();
        let explained = self.explained(found, &settings);
        self.without_surplus_parts(&explained, &settings).motions.is_empty()
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
