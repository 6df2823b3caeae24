//! The direction in which an object opens: its open drawers and doors stand out of what stays.

use super::cloud::IndexedCloud;
use super::poses::PoseSettings;
use super::visibility::Occupancy;
use artgs_core::{PerState, State};
use glam::Vec3;

/// Settings of the search for the front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrontSettings {
    /// Fraction of the resting points that may stand out of what stays, on each side: mislabelled ones.
    pub(crate) outliers: f32,
    /// Least distance of a point that stands out, fraction of the diagonal.
    pub(crate) margin: f32,
    /// Least fraction of the moved points that stands out on the side of the front.
    pub(crate) least_share: f32,
}

/// The side on which an object opens, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Front {
    /// Unit direction.
    pub(crate) direction: Vec3,
    /// Points beyond this height along `direction` stand out of what stays, scene units.
    pub(crate) height: f32,
}

impl Front {
    /// Share of the points that stand out.
    pub(super) fn share_standing_out(&self, points: impl ExactSizeIterator<Item = Vec3>) -> f32 {
        let total = points.len().max(1) as f32;
        points.filter(|p| p.dot(self.direction) > self.height).count() as f32 / total
    }
}

impl Default for FrontSettings {
    fn default() -> Self {
        Self { outliers: 0.01, margin: 0.02, least_share: 0.15 }
    }
}

impl FrontSettings {
    /// The side on which most of the moved points stand out of the resting ones; none if few do (sliding doors, tools).
    pub(super) fn find(
        &self,
        clouds: &PerState<IndexedCloud<'_>>,
        occupancy: &PerState<Vec<Occupancy>>,
        poses: &PoseSettings,
        diagonal: f32,
    ) -> Option<Front> {
        let total = occupancy.iter().flatten().filter(|o| **o == Occupancy::Empty).count();
        let standing_out = |direction: Vec3| {
            let heights = |what: Occupancy| {
                let of_state = move |s: State| {
                    let points = clouds[s].cloud.points.iter().zip(&occupancy[s]);
                    points.filter(move |(_, o)| **o == what).map(move |(p, _)| p.dot(direction))
                };
                State::ALL.into_iter().flat_map(of_state).collect::<Vec<f32>>()
            };
            let mut resting = heights(Occupancy::Surface);
            let last = resting.len().checked_sub(1)?;
            let index = last - (self.outliers * last as f32) as usize;
            let top = *resting.select_nth_unstable_by(index, f32::total_cmp).1 + self.margin * diagonal;
            Some((heights(Occupancy::Empty).into_iter().filter(|h| *h > top).count(), top))
        };
        let faces = poses.face_directions(clouds[State::END].cloud);
        let sides = faces.into_iter().flat_map(|f| [f.normalize(), -f.normalize()]);
        let sides = sides.filter_map(|direction| Some((standing_out(direction)?, direction)));
        let ((count, height), direction) = sides.max_by_key(|((count, _), _)| *count)?;
        (count as f32 >= self.least_share * total as f32).then_some(Front { direction, height })
    }
}
