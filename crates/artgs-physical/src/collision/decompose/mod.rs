//! Convex decomposition of surfaces: flat regions become prisms, the rest is split by planes until it is followed closely.
//! Cavities stay empty, because pieces only cover the surface and a skin behind it.

mod boxes;
mod mask;
mod regions;
mod rest;
mod sheets;
mod slabs;
mod union;

use crate::geometry::Observed;
use crate::geometry::hull::Hull;
use crate::geometry::solid::Solid;
use artgs_core::Mesh;
use glam::DVec3;

/// Settings of [`decompose`]; lengths in units of the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecomposeOptions {
    /// Largest distance between the surface and the pieces.
    pub tolerance: f64,
    /// Largest number of pieces.
    pub most: u32,
    /// Largest number of corners of a piece.
    pub corners: usize,
    /// Corners of a piece that stand out by less than this are left out.
    pub rounding: f64,
    /// Thickness of pieces where the solid behind the surface is thicker.
    pub skin: f64,
    /// Least thickness of pieces.
    pub least: f64,
    /// Pieces thinner than this are removed.
    pub thinnest: f64,
}

/// Decomposition of a mesh by another program: the corners of each piece, or the reason of a failure.
pub(crate) type Decomposer<'a> = dyn Fn(&Mesh) -> Result<Vec<Vec<DVec3>>, String> + Sync + 'a;

/// Pieces of `other`, without those that have no volume, largest first.
pub(crate) fn decompose_with(mesh: &Mesh, other: &Decomposer, options: &DecomposeOptions) -> Result<Vec<Hull>, String> {
    if mesh.is_empty() {
        return Ok(Vec::new());
    }
    let pieces = other(mesh)?;
    let mut hulls: Vec<Hull> = pieces.iter().filter_map(|corners| Hull::of(corners, options.thinnest)).collect();
    hulls.sort_by(|a, b| b.volume().total_cmp(&a.volume()));
    Ok(hulls)
}

/// Convex pieces that together cover what was observed of a surface, and large flat regions of the rest, largest first.
pub fn decompose(mesh: &Mesh, observed: &Observed, options: &DecomposeOptions) -> Vec<Hull> {
    Solid::new(mesh, observed).map_or(Vec::new(), |mut solid| decompose_solid(&mut solid, options))
}

/// The same of a solid, which stays as it is.
pub(crate) fn decompose_solid(solid: &mut Solid, options: &DecomposeOptions) -> Vec<Hull> {
    let observed = solid.seen.clone();
    let hulls = pieces_with_regions(solid, options);
    solid.seen = observed;
    hulls
}

/// Convex pieces; large regions count as seen from then on.
fn pieces_with_regions(solid: &mut Solid, options: &DecomposeOptions) -> Vec<Hull> {
    /// Distance of pieces beside which the surface is covered, in tolerances: samples are apart.
    const COVERED: f64 = 0.9;
    let mut pieces = Pieces::default();
    let neighbours = sheets::neighbours(solid);
    let least = (3.0 * options.tolerance) * (3.0 * options.tolerance);
    let regions = regions::regions(&solid.mesh, 0.8 * options.tolerance, least);
    let seen: Vec<bool> = regions.iter().map(|region| is_seen(solid, region)).collect();
    for (region, seen) in regions.iter().zip(seen) {
        if seen || is_large(region, options) {
            region.triangles.iter().for_each(|t| solid.seen[*t as usize] = true);
            sheets::add(solid, region, seen, &neighbours, options, &mut pieces);
        }
    }
    rest::add(solid, &axes(&regions), [COVERED * options.tolerance, 0.0], options, &mut pieces);
    let needed = union::Needed::of(solid, options);
    let most = options.most as usize;
    let hulls = union::joined(needed.pruned(pieces.hulls, most, options.tolerance, options), solid, options);
    let mut hulls = union::reduced(needed.pruned(hulls, most, 1.5 * options.tolerance, options), solid, options);
    hulls = hulls
        .into_iter()
        .map(|hull| boxes::boxed(hull, solid, options))
        .filter_map(|hull| hull.with_fewer_corners(options.corners, options.rounding, options.thinnest))
        .collect();
    hulls.sort_by(|a, b| b.volume().total_cmp(&a.volume()));
    hulls
}

/// Further pieces where `hulls` leave the observed surface uncovered, largest first, as thin as possible: what cuts left open is
/// decomposed again. Together with `hulls` there are at most `options.most`.
pub(crate) fn patches(solid: &Solid, hulls: &[Hull], options: &DecomposeOptions) -> Vec<Hull> {
    /// Distance of pieces beside which the surface is covered, in tolerances: a gap is as wide as what they leave, and twice this. Where
    /// another link passes, pieces are behind the surface.
    const COVERED: f64 = 0.5;
    let near = COVERED * options.tolerance;
    let mut pieces = Pieces::default();
    hulls.iter().for_each(|hull| pieces.push(hull.clone()));
    rest::add(solid, &[DVec3::X, DVec3::Y, DVec3::Z], [near, near], options, &mut pieces);
    let mut added = union::joined(pieces.hulls.split_off(hulls.len()), solid, options);
    let simple = |hull: Hull| hull.with_fewer_corners(options.corners, options.rounding, options.thinnest);
    added = added.into_iter().filter_map(simple).collect();
    added.sort_by(|a, b| b.volume().total_cmp(&a.volume()));
    added
}

/// Points of the observed surface, about `spacing` apart.
pub(crate) fn seen_points(solid: &Solid, observed: &Observed, spacing: f64) -> Vec<DVec3> {
    solid.samples(spacing, false).into_iter().filter(|s| s.seen || observed(s.point)).map(|s| s.point).collect()
}

/// True for regions that were observed.
fn is_seen(solid: &Solid, region: &regions::Region) -> bool {
    const SEEN: f64 = 0.2;
    let area =
        |t: &u32| 0.5 * crate::geometry::topology::cross(&solid.mesh, solid.mesh.triangles[*t as usize]).length();
    let seen: f64 = region.triangles.iter().filter(|t| solid.seen[**t as usize]).map(area).sum();
    seen > SEEN * region.area
}

/// True for regions that have pieces also if they were not observed: caps of bodies that stand on a floor or at a wall.
fn is_large(region: &regions::Region, options: &DecomposeOptions) -> bool {
    const LARGE: f64 = 30.0;
    region.area > (LARGE * options.tolerance) * (LARGE * options.tolerance)
}

/// Directions across which the rest is cut: normals of the largest regions, and the axes of the mesh.
fn axes(regions: &[regions::Region]) -> Vec<DVec3> {
    const MOST: usize = 6;
    let mut out: Vec<DVec3> = Vec::new();
    for axis in regions.iter().take(20).map(|r| r.normal).chain([DVec3::X, DVec3::Y, DVec3::Z]) {
        if out.len() < MOST && out.iter().all(|other| other.dot(axis).abs() < 0.94) {
            out.push(axis);
        }
    }
    out
}

/// Pieces with their boxes.
#[derive(Default)]
struct Pieces {
    hulls: Vec<Hull>,
    boxes: Vec<[DVec3; 2]>,
    planes: Vec<Vec<crate::geometry::hull::Plane>>,
}

impl Pieces {
    fn push(&mut self, hull: Hull) {
        self.boxes.push(hull.bounds());
        self.planes.push(hull.planes());
        self.hulls.push(hull);
    }

    fn is_near(&self, piece: usize, p: DVec3, near: f64) -> bool {
        let [low, high] = self.boxes[piece];
        p.cmpge(low - near).all()
            && p.cmple(high + near).all()
            && self.planes[piece].iter().all(|plane| plane.distance(p) <= near)
    }
}

#[cfg(test)]
mod tests;
