//! Nearest points within a few spacings, by cells.

use glam::{IVec3, Vec3};

/// Points sorted by cubic cells, for searches that ask for a few points within a short distance: of a thinned surface a search
/// reads few short runs of points. It takes a fifth of the time of a search tree.
#[derive(Debug)]
pub(super) struct NearGrid {
    origin: Vec3,
    edge: f32,
    size: IVec3,
    /// Where the points of each cell start, x fastest, and the end: `[cells + 1]`.
    first: Vec<u32>,
    points: Vec<Vec3>,
    /// Index of each sorted point in the list given.
    index: Vec<u32>,
}

/// Points found at most.
pub(super) const MOST: usize = 4;

/// Longest distance that is searched, cells.
const FARTHEST: f32 = 3.0;

/// Cells per point at most: those of sparse points are enlarged.
const CELLS_PER_POINT: f32 = 32.0;

impl NearGrid {
    /// Cells of about `edge` (scene units). None if there are no points, or some are not finite.
    pub(super) fn new(points: &[Vec3], edge: f32) -> Option<Self> {
        let lower = points.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let upper = points.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        let extent = upper - lower;
        if !(points.iter().all(|p| p.is_finite()) && extent.is_finite() && edge.is_finite() && edge > 0.0) {
            return None;
        }
        let most = (CELLS_PER_POINT * points.len() as f32).max(64.0);
        let mut edge = edge;
        let count = |edge: f32| (extent / edge).floor() + Vec3::ONE;
        while count(edge).element_product() > most {
            edge *= 1.25;
        }
        let size = count(edge).as_ivec3();
        let mut grid = Self { origin: lower, edge, size, first: Vec::new(), points: Vec::new(), index: Vec::new() };
        let cells: Vec<usize> = points.iter().map(|p| grid.cell(grid.coordinates(*p))).collect();
        let mut first = vec![0u32; size.element_product() as usize + 1];
        cells.iter().for_each(|c| first[c + 1] += 1);
        (1..first.len()).for_each(|c| first[c] += first[c - 1]);
        let mut next = first.clone();
        grid.points = vec![Vec3::ZERO; points.len()];
        grid.index = vec![0; points.len()];
        for (i, (p, cell)) in points.iter().zip(&cells).enumerate() {
            let slot = next[*cell] as usize;
            next[*cell] += 1;
            (grid.points[slot], grid.index[slot]) = (*p, i as u32);
        }
        grid.first = first;
        Some(grid)
    }

    /// True if a search for `n` points within the squared distance `limit` is faster here than in a tree.
    pub(super) fn suits(&self, n: usize, limit: f32) -> bool {
        (1..=MOST).contains(&n) && limit <= (FARTHEST * self.edge).powi(2)
    }

    fn coordinates(&self, p: Vec3) -> IVec3 {
        // Past the upper side by rounding, a point is in the last cell.
        ((p - self.origin) / self.edge).floor().as_ivec3().min(self.size - 1)
    }

    fn cell(&self, c: IVec3) -> usize {
        (c.z as usize * self.size.y as usize + c.y as usize) * self.size.x as usize + c.x as usize
    }

    /// Calls `visit(index, squared distance)` for the `n` (at most [`MOST`]) nearest points within the squared distance `limit`,
    /// nearest first, equally far ones in the order of their indices.
    pub(super) fn nearest_n(&self, q: Vec3, n: usize, limit: f32, mut visit: impl FnMut(usize, f32)) {
        let at = (q - self.origin) / self.edge;
        let reach = limit.sqrt() / self.edge;
        let size = self.size.as_vec3();
        // Compared as floats: a distant query has no integer coordinates. NaN is outside, too.
        if !((at + reach).cmpge(Vec3::ZERO).all() && (at - reach).cmple(size).all()) {
            return;
        }
        let last_cell = self.size - 1;
        // Cut to integers, which is the floor of what is not negative and needs no call of a function.
        let cell = |at: Vec3| at.max(Vec3::ZERO).as_ivec3().min(last_cell);
        let (lo, hi) = (cell(at - reach), cell(at + reach));
        let centre = cell(at);
        let mut found = [(f32::INFINITY, u32::MAX); MOST];
        let last = n.min(MOST) - 1;
        // Squared distance of the query from the cells of one coordinate, scene units.
        let apart = |c: i32, at: f32| {
            let gap = (c as f32 - at).max(at - (c + 1) as f32).max(0.0) * self.edge;
            // A point may be across the side of its cell by rounding.
            ROUNDING * gap * gap
        };
        for z in outwards(lo.z, centre.z, hi.z) {
            let far = apart(z, at.z);
            if far > limit.min(found[last].0) {
                continue;
            }
            for y in outwards(lo.y, centre.y, hi.y) {
                if far + apart(y, at.y) > limit.min(found[last].0) {
                    continue;
                }
                let row = self.cell(IVec3::new(0, y, z));
                let run = self.first[row + lo.x as usize] as usize..self.first[row + hi.x as usize + 1] as usize;
                for (p, &i) in self.points[run.clone()].iter().zip(&self.index[run]) {
                    let hit = (p.distance_squared(q), i);
                    if hit.0 <= limit && hit < found[last] {
                        found[last] = hit;
                        let mut slot = last;
                        while slot > 0 && found[slot] < found[slot - 1] {
                            found.swap(slot, slot - 1);
                            slot -= 1;
                        }
                    }
                }
            }
        }
        found.iter().take_while(|hit| hit.1 != u32::MAX).for_each(|hit| visit(hit.1 as usize, hit.0));
    }
}

/// Less than one by more than the rounding errors of cells.
const ROUNDING: f32 = 0.999;

/// The numbers `lo..=hi`, those next to `centre` first.
fn outwards(lo: i32, centre: i32, hi: i32) -> impl Iterator<Item = i32> {
    let widest = (hi - centre).max(centre - lo);
    let both = (1..=widest).flat_map(move |d| [centre - d, centre + d]);
    std::iter::once(centre).chain(both.filter(move |c| (lo..=hi).contains(c)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::neighbours::PointTree;

    #[test]
    fn finds_what_a_search_tree_finds() {
        let noise =
            |i: usize| Vec3::new((i as f32 * 0.618).fract(), (i as f32 * 0.755).fract(), (i as f32 * 0.57).fract());
        let points: Vec<Vec3> = (0..4000).map(|i| noise(i) * Vec3::new(2.0, 1.0, 0.5)).collect();
        let coordinates: Vec<[f32; 3]> = points.iter().map(|p| p.to_array()).collect();
        let (tree, reach) = (PointTree::new(&coordinates), 0.08);
        let grid = NearGrid::new(&points, 0.6 * reach).unwrap();
        assert!(grid.suits(4, reach * reach) && !grid.suits(5, 0.0) && !grid.suits(1, 4.0 * reach * reach));
        let mut some = 0;
        for i in 0..2000 {
            let q = noise(7 * i + 3) * Vec3::new(2.4, 1.2, 0.6) - 0.1;
            let (mut a, mut b) = (Vec::new(), Vec::new());
            grid.nearest_n(q, 4, reach * reach, |j, d| a.push((j, d)));
            tree.nearest_n(&q.to_array(), 4, reach * reach, |j, d| b.push((j, d)));
            assert_eq!(a.len(), b.len(), "{q}");
            assert!(a.iter().zip(&b).all(|(a, b)| (a.1 - b.1).abs() < 1e-6), "{q}: {a:?} {b:?}");
            some += usize::from(a.len() > 1);
        }
        assert!(some > 500, "{some}");
    }

    #[test]
    fn distant_queries_and_odd_points_are_survived() {
        let grid = NearGrid::new(&[Vec3::ZERO, Vec3::ONE], 1e-3).unwrap();
        assert!(grid.edge > 1e-3);
        for q in [Vec3::splat(1e30), Vec3::splat(-1e30), Vec3::NAN, Vec3::splat(0.5)] {
            grid.nearest_n(q, 1, 1e-6, |j, _| panic!("{j}"));
        }
        let mut found = Vec::new();
        grid.nearest_n(Vec3::ONE, 1, 1e-6, |j, d| found.push((j, d)));
        assert_eq!(found, [(1, 0.0)]);
        assert!(NearGrid::new(&[], 1.0).is_none() && NearGrid::new(&[Vec3::NAN], 1.0).is_none());
    }
}
