//! Cubes about which all views of a state agree: points in them need no lookups.

use super::morton::morton;
use super::visibility::{DepthLookup, ViewVotes};
use glam::{IVec3, Vec3};
use rayon::prelude::*;

/// What the views of a state show in a whole cube.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cube {
    /// A surface is near, or few views see the place: points must be looked up.
    Mixed,
    /// Several views look through, and none sees a surface.
    Empty,
    /// No view looks through or sees a surface.
    Hidden,
}

/// Cubes over a box.
pub(crate) struct CubeVotes {
    origin: Vec3,
    edge: f32,
    size: IVec3,
    cubes: Vec<Cube>,
}

impl CubeVotes {
    /// Cubes of `edge` over the box `lower..upper`. `tolerance` is that of the depth, scene units.
    pub(crate) fn new(views: &[DepthLookup], lower: Vec3, upper: Vec3, edge: f32, tolerance: f32) -> Self {
        /// Half the diagonal of a cube of edge 1.
        const HALF_DIAGONAL: f32 = 0.867;
        /// Views that look through an empty cube: the verdict of a point in it is then clear, also if some do not.
        const LEAST_THROUGH: u32 = 4;
        let size = ((upper - lower) / edge).ceil().as_ivec3().max(IVec3::ONE);
        let count = size.x as usize * size.y as usize * size.z as usize;
        let cell = |index: usize| {
            let (i, s) = (index as i32, size);
            IVec3::new(i % s.x, i / s.x % s.y, i / (s.x * s.y))
        };
        let mut order: Vec<(u64, usize)> = (0..count).map(|i| (morton(cell(i)), i)).collect();
        order.par_sort_unstable();
        let centres: Vec<Vec3> = order.iter().map(|o| lower + (cell(o.1).as_vec3() + 0.5) * edge).collect();
        let cube = |votes: ViewVotes| match (votes.through, votes.surface) {
            (0, 0) => Cube::Hidden,
            (LEAST_THROUGH.., 0) => Cube::Empty,
            _ => Cube::Mixed,
        };
        let votes = ViewVotes::of_all(views, &centres, tolerance + HALF_DIAGONAL * edge);
        let mut cubes = vec![Cube::Mixed; count];
        order.iter().zip(votes).for_each(|(o, votes)| cubes[o.1] = cube(votes));
        Self { origin: lower, edge, size, cubes }
    }

    /// The cube that a point is in; mixed outside the box.
    pub(super) fn at(&self, point: Vec3) -> Cube {
        let c = (point - self.origin) / self.edge;
        // Compared before they are cut to integers, which needs no call of a function.
        let inside = c.cmpge(Vec3::ZERO).all() && c.cmplt(self.size.as_vec3()).all();
        let c = c.as_ivec3();
        if inside { self.cubes[((c.z * self.size.y + c.y) * self.size.x + c.x) as usize] } else { Cube::Mixed }
    }
}
