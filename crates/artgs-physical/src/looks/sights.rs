//! Measured depth of both states, asked about the surface of a part.

use crate::looks::bake::{BakeOptions, BakeView};
use crate::looks::{Placed, views};
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
        let of = |state: State| views(part, replica, photos.iter().filter(move |(of, ..)| *of == state));
        Self { views: PerState::from_fn(of), options }
    }

    /// True if at least so many views of a state show a point of a surface, with its unit normal, where it is.
    pub(super) fn show(&self, state: State, point: DVec3, normal: DVec3, least: usize) -> bool {
        let shows = |view: &&BakeView| view.measures(point, normal, &self.options) == Some(true);
        self.views[state].iter().filter(shows).take(least).count() == least
    }

    /// True if at least so many views measure something behind a point.
    pub(super) fn look_through(&self, point: DVec3, least: usize) -> bool {
        let views = State::ALL.into_iter().flat_map(|state| &self.views[state]);
        views.filter(|view| view.looks_through(point, &self.options)).take(least).count() == least
    }
}
