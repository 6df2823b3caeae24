//! Meshes, hulls and solids as every question needs them.

pub(crate) mod convert;
pub(crate) mod hull;
pub(crate) mod solid;
pub(crate) mod topology;
pub(crate) mod weld;

use glam::DVec3;

/// Whether a point of a mesh was observed. What was not, such as the inner side of a wall that was seen from one side, needs
/// no piece of its own, but floors do: things are put on them.
pub type Observed<'a> = dyn Fn(DVec3) -> bool + Sync + 'a;
