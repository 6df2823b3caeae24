//! Measured depth of both states, asked about the surface of a part.

use crate::looks::Placed;
use crate::looks::bake::{BakeOptions, BakeView};
use artgs_core::{PerState, Replica, State};
use glam::DVec3;

/// Views with measured depth in the frame of a part at the start state.
pub(super) struct Sights<'a> {
    pub(super) views: PerState<Vec<BakeView<'a>>>,
    /// For the resolution of the surface.
    pub(super) options: BakeOptions,
}

impl<'a> Sights<'a> {
    /// The photos of both states, which the part's motion takes to the start.
    pub(super) fn of(part: usize, replica: &Replica, photos: &'a [Placed<'a>], options: BakeOptions) -> Self {
        let of = |state: State| {
            let motion = replica.motion_to(part, state);
            let own = photos.iter().filter(|(s, ..)| *s == state);
            own.map(|(_, camera, photo)| BakeView::new(photo, camera.moved_with(&motion))).collect()
        };
        Self { views: PerState::from_fn(of), options }
    }

    /// Number of views of a state that show a point of a surface, with its unit normal, where it is.
    pub(super) fn views_of(&self, state: State, point: DVec3, normal: DVec3) -> usize {
        let shows = |view: &&BakeView| view.measures(point, normal, &self.options) == Some(true);
        self.views[state].iter().filter(shows).count()
    }
}
