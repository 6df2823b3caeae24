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

impl Default for FrontSettings {
    fn default() -> Self {
        Self { outliers: 0.01, margin: 0.02, least_share: 0.15 }
    }
}

impl FrontSettings {
    /// Unit direction towards which most of the moved points stand out of the resting ones; none if few do (sliding doors,
    /// tools). World frame.
    pub(super) fn direction(
        &self,
        clouds: &PerState<IndexedCloud<'_>>,
        occupancy: &PerState<Vec<Occupancy>>,
        poses: &PoseSettings,
        diagonal: f32,
    ) -> Option<Vec3> {
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
            Some(heights(Occupancy::Empty).into_iter().filter(|h| *h > top).count())
        };
        let faces = poses.face_directions(clouds[State::END].cloud);
        let sides = faces.into_iter().flat_map(|f| [f, -f]).filter_map(|d| Some((standing_out(d)?, d)));
        let (count, direction) = sides.max_by_key(|(count, _)| *count)?;
        (count as f32 >= self.least_share * total as f32).then_some(direction.normalize())
    }
}
