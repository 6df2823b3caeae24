//! A voxel grid that answers for any place in one state: which surface point is nearest, and is the place empty?

use super::cloud::Cloud;
use super::visibility::{DepthLookup, ViewVotes};
use glam::{IVec3, Vec3};

/// No surface point.
pub(super) const NO_POINT: u32 = u32::MAX;

/// Stands for no surface point in a cell, and marks an empty cell.
const NOTHING: u32 = u32::MAX >> 1;
const EMPTY: u32 = 1 << 31;

/// More than half the diagonal of a cell of edge 1.
const HALF_DIAGONAL: f32 = 0.87;

/// A cell is empty if every place within this many cell edges of its centre is.
const EMPTY_MARGIN: f32 = 0.9;

/// Lookup of surfaces and empty space of one state.
pub(super) struct SpaceGrid {
    origin: Vec3,
    voxel: f32,
    size: IVec3,
    cells: Vec<Cell>,
}

/// One cell; what a lookup reads is in one place of the memory.
#[derive(Clone, Copy)]
struct Cell {
    /// Nearest surface point or [`NOTHING`], with the mark [`EMPTY`].
    nearest: u32,
    /// No place of the cell is closer to that point, scene units.
    gap: f32,
}

impl SpaceGrid {
    /// Builds the grid over the box `lower..upper` with cubes of edge `voxel`.
    pub(super) fn new(
        cloud: &Cloud,
        views: &[DepthLookup],
        lower: Vec3,
        upper: Vec3,
        voxel: f32,
        tolerance: f32,
    ) -> Self {
        let size = ((upper - lower) / voxel).ceil().as_ivec3() + 1;
        let count = (size.x * size.y * size.z) as usize;
        let mut grid = Self { origin: lower, voxel, size, cells: Vec::new() };
        let mut nearest = vec![NO_POINT; count];
        grid.seed(cloud, &mut nearest);
        grid.propagate(cloud, &mut nearest);
        let centres: Vec<Vec3> = (0..count).map(|i| grid.centre(i)).collect();
        let votes = ViewVotes::of_all(views, &centres, tolerance.max(EMPTY_MARGIN * voxel));
        let cell = |((nearest, centre), votes): ((&u32, &Vec3), &ViewVotes)| {
            let apart = cloud.points.get(*nearest as usize).map_or(f32::INFINITY, |p| p.distance(*centre));
            let mark = if votes.is_empty_space() { EMPTY } else { 0 };
            Cell { nearest: (*nearest).min(NOTHING) | mark, gap: apart - HALF_DIAGONAL * voxel }
        };
        grid.cells = nearest.iter().zip(&centres).zip(&votes).map(cell).collect();
        grid
    }

    fn centre(&self, index: usize) -> Vec3 {
        let (i, s) = (index as i32, self.size);
        let cell = IVec3::new(i % s.x, i / s.x % s.y, i / (s.x * s.y));
        self.origin + cell.as_vec3() * self.voxel
    }

    fn index(&self, point: Vec3) -> Option<usize> {
        let c = (point - self.origin) / self.voxel + 0.5;
        // Compared before they are cut to integers, which needs no call of a function.
        let inside = c.cmpge(Vec3::ZERO).all() && c.cmplt(self.size.as_vec3()).all();
        let c = c.as_ivec3();
        inside.then(|| ((c.z * self.size.y + c.y) * self.size.x + c.x) as usize)
    }

    fn seed(&self, cloud: &Cloud, nearest: &mut [u32]) {
        for (i, p) in cloud.points.iter().enumerate() {
            let Some(cell) = self.index(*p) else { continue };
            let centre = self.centre(cell);
            let current = nearest[cell];
            if current == NO_POINT
                || p.distance_squared(centre) < cloud.points[current as usize].distance_squared(centre)
            {
                nearest[cell] = i as u32;
            }
        }
    }

    /// Chamfer-style propagation of the nearest point: two raster sweeps over the 13 preceding neighbours, run twice.
    fn propagate(&self, cloud: &Cloud, nearest: &mut [u32]) {
        let s = self.size;
        let before: Vec<IVec3> = (0..13).map(|i| IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1)).collect();
        let count = nearest.len();
        for pass in 0..4 {
            let forward = pass % 2 == 0;
            for step in 0..count {
                let cell = if forward { step } else { count - 1 - step };
                let i = cell as i32;
                let at = IVec3::new(i % s.x, i / s.x % s.y, i / (s.x * s.y));
                let centre = self.origin + at.as_vec3() * self.voxel;
                let mut best = nearest[cell];
                let mut distance =
                    if best == NO_POINT { f32::INFINITY } else { cloud.points[best as usize].distance_squared(centre) };
                for offset in &before {
                    let n = if forward { at + *offset } else { at - *offset };
                    if n.cmplt(IVec3::ZERO).any() || n.cmpge(s).any() {
                        continue;
                    }
                    let candidate = nearest[((n.z * s.y + n.y) * s.x + n.x) as usize];
                    if candidate == NO_POINT || candidate == best {
                        continue;
                    }
                    let d = cloud.points[candidate as usize].distance_squared(centre);
                    if d < distance {
                        (best, distance) = (candidate, d);
                    }
                }
                nearest[cell] = best;
            }
        }
    }

    /// Index of the (nearly) nearest surface point, and whether the place is shown as empty. A point that is farther than
    /// `reach` (scene units) may be left out. Outside the grid there is no surface, and all is empty.
    pub(super) fn lookup(&self, point: Vec3, reach: f32) -> (u32, bool) {
        let Some(i) = self.index(point) else { return (NO_POINT, true) };
        let cell = self.cells[i];
        let nearest = cell.nearest & !EMPTY;
        let is_near = nearest != NOTHING && cell.gap <= reach;
        (if is_near { nearest } else { NO_POINT }, cell.nearest & EMPTY != 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lookup_finds_nearly_the_nearest_point() {
        let mut cloud = Cloud::default();
        for i in 0..200 {
            let t = i as f32 * 0.37;
            cloud.points.push(Vec3::new(t.sin(), (1.7 * t).cos(), (0.6 * t).sin()));
        }
        let grid = SpaceGrid::new(&cloud, &[], Vec3::splat(-1.2), Vec3::splat(1.2), 0.05, 0.01);
        for i in 0..300 {
            let t = i as f32 * 0.61;
            let p = Vec3::new((1.3 * t).cos(), (0.9 * t).sin(), (2.1 * t).cos());
            let best = cloud.points.iter().map(|q| q.distance(p)).fold(f32::INFINITY, f32::min);
            let (index, empty) = grid.lookup(p, f32::INFINITY);
            let apart = cloud.points[index as usize].distance(p);
            assert!(apart < best + 0.1 && !empty);
            assert_eq!(grid.lookup(p, apart), (index, empty), "a point within reach is never left out");
            assert!(apart < 0.1 || grid.lookup(p, apart - 0.1).0 == NO_POINT);
        }
        assert_eq!(grid.lookup(Vec3::splat(5.0), 9.0), (NO_POINT, true));
    }
}
