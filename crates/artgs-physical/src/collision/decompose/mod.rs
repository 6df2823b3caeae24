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
use crate::settings::{CollisionSettings, DecomposeSettings, RegionSettings};
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
    /// How pieces are chosen.
    pub settings: DecomposeSettings,
}

impl DecomposeOptions {
    /// Settings for an object with this diagonal and walls of this thickness, metres, whose links may have `most` pieces at the end.
    pub(crate) fn of(settings: &CollisionSettings, diagonal: f64, wall: f64, most: u32) -> Self {
        let cover = settings.cover_of(diagonal);
        let thinnest = settings.thinnest_share * diagonal;
        Self {
            tolerance: settings.followed * cover,
            most: CollisionSettings::before_cuts(most),
            corners: settings.corners,
            rounding: settings.rounding * cover,
            skin: wall,
            least: settings.least * thinnest,
            thinnest,
            settings: settings.decompose,
        }
    }
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
    Solid::new(mesh, observed).map_or(Vec::new(), |mut solid| {
        solid.need_floors(&options.settings.floor);
        decompose_solid(&mut solid, options)
    })
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
    let DecomposeSettings { regions: of_regions, rest: of_rest, union: of_union, .. } = &options.settings;
    let mut pieces = Pieces::default();
    let neighbours = sheets::neighbours(solid);
    let regions = regions::regions(&solid.mesh, options.tolerance, of_regions);
    let seen: Vec<bool> = regions.iter().map(|region| is_seen(solid, region, of_regions.seen)).collect();
    for (region, seen) in regions.iter().zip(seen) {
        if seen || is_large(region, options) {
            region.triangles.iter().for_each(|t| solid.seen[*t as usize] = true);
            sheets::add(solid, region, seen, &neighbours, options, &mut pieces);
        }
    }
    rest::add(solid, &axes(&regions, of_regions), [of_rest.covered * options.tolerance, 0.0], options, &mut pieces);
    let needed = union::Needed::of(solid, options);
    let most = options.most as usize;
    let hulls = union::joined(needed.pruned(pieces.hulls, most, options.tolerance, options), solid, options);
    let mut hulls =
        union::reduced(needed.pruned(hulls, most, of_union.speck * options.tolerance, options), solid, options);
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
    let near = options.settings.rest.patched * options.tolerance;
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

/// True for regions of which more than a share `least` was observed.
fn is_seen(solid: &Solid, region: &regions::Region, least: f64) -> bool {
    let area =
        |t: &u32| 0.5 * crate::geometry::topology::cross(&solid.mesh, solid.mesh.triangles[*t as usize]).length();
    let seen: f64 = region.triangles.iter().filter(|t| solid.seen[**t as usize]).map(area).sum();
    seen > least * region.area
}

/// True for regions that have pieces also if they were not observed: caps of bodies that stand on a floor or at a wall.
fn is_large(region: &regions::Region, options: &DecomposeOptions) -> bool {
    let side = options.settings.regions.large * options.tolerance;
    region.area > side * side
}

/// Directions across which the rest is cut: normals of the largest regions, and the axes of the mesh.
fn axes(regions: &[regions::Region], settings: &RegionSettings) -> Vec<DVec3> {
    let mut out: Vec<DVec3> = Vec::new();
    let normals = regions.iter().take(settings.sources).map(|r| r.normal);
    for axis in normals.chain([DVec3::X, DVec3::Y, DVec3::Z]) {
        if out.len() < settings.axes && out.iter().all(|other| other.dot(axis).abs() < settings.distinct) {
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
