//! Flat regions of a surface as prisms.

use super::mask::{Mask, cover, holds};
use super::regions::Region;
use super::slabs::Slabs;
use super::union::stays_within;
use super::{DecomposeOptions, Pieces};
use crate::geometry::hull::Hull;
use crate::geometry::solid::Solid;
use crate::geometry::topology::{corners, twins};
use crate::settings::SheetSettings;
use glam::{DVec2, DVec3};

/// A grid in the plane of a region.
struct Grid {
    origin: DVec3,
    u: DVec3,
    v: DVec3,
    normal: DVec3,
    cell: f64,
    size: [usize; 2],
}

impl Grid {
    /// Cells with edges of at least `finest`, at most `most` per side.
    fn new(solid: &Solid, region: &Region, twins: &[u32], (finest, most): (f64, f64)) -> Self {
        let normal = region.normal;
        let (u, v) = axes(solid, region, twins);
        let plane = normal * region.offset;
        let flat = |p: DVec3| DVec2::new((p - plane).dot(u), (p - plane).dot(v));
        let points = region.triangles.iter().flat_map(|t| corners(&solid.mesh, solid.mesh.triangles[*t as usize]));
        let (low, high) =
            points.map(flat).fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        let cell = finest.max((high - low).max_element() / most);
        // A rim of free cells; the region is in the middle of its cells.
        let size = ((high - low) / cell).ceil() + 2.0;
        let low = (low + high - size * cell) / 2.0;
        Self { origin: plane + u * low.x + v * low.y, u, v, normal, cell, size: [size.x as usize, size.y as usize] }
    }

    /// A point of the plane, given in cells.
    fn point(&self, at: DVec2) -> DVec3 {
        self.origin + (self.u * at.x + self.v * at.y) * self.cell
    }

    fn middle(&self, i: usize) -> DVec3 {
        self.point(DVec2::new((i / self.size[1]) as f64 + 0.5, (i % self.size[1]) as f64 + 0.5))
    }

    /// Cells whose centres are on the triangles.
    fn mask(&self, solid: &Solid, triangles: &[u32]) -> Mask {
        /// Area in cells, and weight of a corner, that are rounding.
        const ROUNDING: [f64; 2] = [1e-12, 1e-9];
        let mut out = Mask::new(self.size);
        for t in triangles {
            let corner = corners(&solid.mesh, solid.mesh.triangles[*t as usize]).map(|p| {
                let p = p - self.origin;
                DVec2::new(p.dot(self.u), p.dot(self.v)) / self.cell - 0.5
            });
            let [a, b, c] = corner;
            let area = (b - a).perp_dot(c - a);
            if area.abs() < ROUNDING[0] {
                continue;
            }
            let (low, high) = (a.min(b).min(c).ceil().max(DVec2::ZERO), a.max(b).max(c).floor());
            for x in low.x as usize..=(high.x.max(0.0) as usize).min(self.size[0] - 1) {
                for y in low.y as usize..=(high.y.max(0.0) as usize).min(self.size[1] - 1) {
                    let p = DVec2::new(x as f64, y as f64);
                    let weights = [(b, c), (c, a), (a, b)].map(|(q, r)| (q - p).perp_dot(r - p) / area);
                    if weights.iter().all(|w| *w >= -ROUNDING[1]) {
                        out.cells[x * self.size[1] + y] = true;
                    }
                }
            }
        }
        out
    }
}

/// Axes of the plane along most of the region's rim.
fn axes(solid: &Solid, region: &Region, twins: &[u32]) -> (DVec3, DVec3) {
    let u = region.normal.any_orthonormal_vector();
    let v = region.normal.cross(u);
    let own: std::collections::BTreeSet<u32> = region.triangles.iter().copied().collect();
    let mut sum = DVec2::ZERO;
    for t in &region.triangles {
        let p = corners(&solid.mesh, solid.mesh.triangles[*t as usize]);
        for k in 0..3 {
            let twin = twins[(3 * t) as usize + k];
            if twin != crate::geometry::topology::NONE && own.contains(&(twin / 3)) {
                continue;
            }
            let edge = p[(k + 1) % 3] - p[k];
            let flat = DVec2::new(edge.dot(u), edge.dot(v));
            // Directions that differ by quarter turns are the same.
            sum += DVec2::from_angle(4.0 * flat.to_angle()) * flat.length_squared();
        }
    }
    let (sin, cos) = (sum.to_angle() / 4.0).sin_cos();
    (u * cos + v * sin, v * cos - u * sin)
}

/// Adds prisms that cover a region where no piece covers it yet. Where it was not observed, only those with the solid behind them.
pub(super) fn add(
    solid: &Solid,
    region: &Region,
    seen: bool,
    twins: &[u32],
    options: &DecomposeOptions,
    pieces: &mut Pieces,
) {
    let settings = &options.settings.sheets;
    let near = settings.covered * options.tolerance;
    let grid = Grid::new(solid, region, twins, (settings.cell * options.tolerance, settings.cells));
    let slack = ((settings.slack * options.tolerance / grid.cell).round() as usize).max(1);
    let own = grid.mask(solid, &region.triangles).closed(slack);
    let (mut todo, slabs) = (own.clone(), Slabs::new(pieces, near));
    for i in 0..todo.cells.len() {
        let is_wall = || seen || solid.is_behind(grid.middle(i), grid.normal);
        todo.cells[i] = own.cells[i] && is_wall() && !slabs.cover(grid.middle(i));
    }
    if !todo.cells.contains(&true) {
        return;
    }
    // A prism may also be where the solid continues in front of the region.
    let mut allowed = own;
    for i in 0..allowed.cells.len() {
        allowed.cells[i] = allowed.cells[i] || solid.signed(grid.middle(i)) < -settings.inside * options.tolerance;
    }
    // Prisms that reach into a notch are replaced by several that follow its rim closer.
    let mut slacks = (0..=slack).rev().peekable();
    while let Some(slack) = slacks.next() {
        let mut left = Mask::new(todo.size);
        for polygon in cover(&allowed, &todo, slack, settings) {
            match prism(solid, &grid, &polygon, slacks.peek().is_none(), options) {
                Some(hull) => pieces.push(hull),
                None => todo.within(&polygon).for_each(|cell| left.cells[cell] = true),
            }
        }
        if !left.cells.contains(&true) {
            return;
        }
        todo = left;
    }
}

/// The prism of a polygon, as thick as fits; if none does, none, or the thinnest one if it is the `last` resort.
fn prism(solid: &Solid, grid: &Grid, polygon: &[DVec2], last: bool, options: &DecomposeOptions) -> Option<Hull> {
    let far = options.settings.union.far * options.tolerance;
    let of = |thickness: f64| {
        let corners = polygon.iter().map(|p| grid.point(*p));
        let points: Vec<DVec3> = corners.flat_map(|p| [p, p - grid.normal * thickness]).collect();
        Hull::of(&points, options.thinnest)
    };
    let fits = |hull: &Hull| stays_within(hull, solid, far, options);
    let [most, least] = thickness(solid, grid, polygon, options);
    of(most).filter(fits).or_else(|| of(least).filter(|hull| last || fits(hull)))
}

/// How thick a prism behind the region may be, so that it sticks out in a few thin places only, and in none: the whole sheet where
/// its other side is near, else the skin.
fn thickness(solid: &Solid, grid: &Grid, polygon: &[DVec2], options: &DecomposeOptions) -> [f64; 2] {
    let SheetSettings { places: side, thin, sheet, near, .. } = options.settings.sheets;
    let (low, high) = polygon.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
    let places = (0..side * side).map(|i| DVec2::new((i / side) as f64 + 0.5, (i % side) as f64 + 0.5) / side as f64);
    let most = sheet * options.skin;
    let depth = |p: DVec2| solid.thickness(grid.point(p), grid.normal, near * options.tolerance, most);
    let mut depths: Vec<f64> =
        places.map(|s| low + (high - low) * s).filter(|p| holds(polygon, *p)).map(depth).collect();
    depths.sort_by(f64::total_cmp);
    [thin, 0.0].map(|share| {
        let found = depths.get((share * depths.len() as f64) as usize).copied().unwrap_or(options.skin);
        (if found < most { found } else { options.skin }).max(options.least)
    })
}

/// Neighbours of the triangles of a solid.
pub(super) fn neighbours(solid: &Solid) -> Vec<u32> {
    twins(&solid.mesh)
}
