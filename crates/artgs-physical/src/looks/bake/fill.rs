//! Colours of texels that no view sees, or only beside edges.

use super::atlas::Texel;
use crate::geometry::convert::trimesh;
use crate::settings::FillSettings;
use artgs_core::Mesh;
use glam::{DVec3, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use parry3d::math::Vector;
use parry3d::query::PointQueryWithLocation;
use rayon::prelude::*;

/// What views show of a texel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// sRGB in [0, 255].
    pub(super) color: Vec3,
    /// False if all views show it beside an edge, where pixels mix two surfaces.
    pub(super) certain: bool,
}

/// Gives texels without a colour the mean of certain ones that are near in space and have a similar normal, weighted by the
/// inverse square of the distance, and the colour of the part where these are far. False if no texel has a colour.
pub(super) fn from_similar(
    texels: &[Texel],
    seen: &[Option<Seen>],
    colors: &mut [Option<Vec3>],
    size: [u32; 2],
    settings: &FillSettings,
) -> bool {
    /// Extent that guards a division.
    const TINY: f64 = 1e-12;
    let known = || texels.iter().zip(seen).filter_map(|(t, seen)| Some((t, (*seen)?)));
    let any_certain = known().any(|(_, seen)| seen.certain);
    let usable = |seen: &Seen| seen.certain || !any_certain;
    let mut usable_at = vec![false; colors.len()];
    known().for_each(|(t, seen)| usable_at[t.index] = usable(&seen));
    let is_source = |t: &Texel| is_source(&usable_at, t.index, size, settings.grid);
    let sources: Vec<(&Texel, Vec3)> = known().filter(|(t, _)| is_source(t)).map(|(t, seen)| (t, seen.color)).collect();
    if sources.is_empty() {
        return false;
    }
    let [low, high] = texels
        .iter()
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], t| [low.min(t.point), high.max(t.point)]);
    let extent = low.distance(high).max(TINY);
    let index = Index::new(&sources, extent, settings);
    let part = (median(sources.iter().map(|(_, color)| *color)), 1.0 / (settings.far * settings.far) as f32);
    let blend = |texel: &&Texel| -> Vec3 {
        let mut parts = vec![part];
        parts.extend(index.near(texel));
        let total: f32 = parts.iter().map(|(_, weight)| weight).sum();
        parts.iter().map(|(color, weight)| *color * (weight / total)).sum()
    };
    let unseen: Vec<&Texel> = texels.iter().zip(seen).filter(|(_, seen)| seen.is_none()).map(|(t, _)| t).collect();
    let filled: Vec<Vec3> = unseen.par_iter().map(blend).collect();
    known().for_each(|(t, seen)| colors[t.index] = Some(seen.color));
    unseen.iter().zip(filled).for_each(|(t, color)| colors[t.index] = Some(color));
    true
}

/// Sources by the direction that they face.
struct Index<'a> {
    sources: &'a [(&'a Texel, Vec3)],
    /// Those that face along +x, -x, +y, -y, +z, -z, more or less, with their places; the last has all.
    sides: Vec<Option<(ImmutableKdTree<f32, 3>, Vec<usize>)>>,
    extent: f64,
    settings: &'a FillSettings,
}

impl<'a> Index<'a> {
    fn new(sources: &'a [(&'a Texel, Vec3)], extent: f64, settings: &'a FillSettings) -> Self {
        let side = |axis: DVec3| {
            let facing = |i: &usize| axis == DVec3::ZERO || sources[*i].0.normal.dot(axis) > settings.facing;
            let places: Vec<usize> = (0..sources.len()).filter(facing).collect();
            let point = |i: &usize| (sources[*i].0.point / extent).as_vec3().to_array();
            let points: Vec<[f32; 3]> = places.iter().map(point).collect();
            let tree = ImmutableKdTree::new_from_slice(&points).ok().filter(|_| !points.is_empty())?;
            Some((tree, places))
        };
        let axes = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]).chain([DVec3::ZERO]);
        Self { sources, sides: axes.map(side).collect(), extent, settings }
    }

    /// Colours near a texel with weights; those of similar surfaces at a distance of 1 extent weigh 1 together.
    fn near(&self, texel: &Texel) -> Vec<(Vec3, f32)> {
        /// Cosine of a side and a texel below which what it shows weighs next to nothing.
        const ASIDE: f64 = 0.05;
        /// Squared distance that guards a division.
        const TINY: f64 = 1e-10;
        let FillSettings { neighbours, turn, .. } = *self.settings;
        let query = (texel.point / self.extent).as_vec3().to_array();
        let mut out = Vec::new();
        for (k, side) in self.sides.iter().enumerate() {
            let any = k == 6;
            let facing = if any { 1.0 } else { texel.normal[k / 2] * if k % 2 == 0 { 1.0 } else { -1.0 } };
            let Some((tree, places)) = side.as_ref().filter(|_| facing > ASIDE) else { continue };
            let found = tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(neighbours).execute();
            for hit in found {
                let (source, color) = self.sources[places[hit.item as usize]];
                let distance = f64::from(hit.distance).sqrt() + if any { turn } else { 0.0 };
                let alike = if any { 1.0 } else { source.normal.dot(texel.normal).max(0.0).powi(2) };
                let weight = (facing * facing * alike) / (distance * distance + TINY) / neighbours.get() as f64;
                out.push((color, weight as f32));
            }
        }
        out
    }
}

/// Median of each channel.
fn median(colors: impl Iterator<Item = Vec3>) -> Vec3 {
    let colors: Vec<Vec3> = colors.collect();
    let of = |channel: usize| {
        let mut values: Vec<f32> = colors.iter().map(|color| color[channel]).collect();
        values.sort_unstable_by(f32::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    Vec3::new(of(0), of(1), of(2))
}

/// Usable texels that are sources: one in `grid` in both directions, and all at the border of the usable area.
fn is_source(usable: &[bool], index: usize, size: [u32; 2], grid: usize) -> bool {
    let [width, height] = size.map(|s| s as usize);
    let (x, y) = (index % width, index / width);
    let other = |x: usize, y: usize| x < width && y < height && !usable[y * width + x];
    let at_rim = || other(x.wrapping_sub(1), y) || other(x + 1, y) || other(x, y.wrapping_sub(1)) || other(x, y + 1);
    usable[index] && ((x % grid == 0 && y % grid == 0) || at_rim())
}

/// Gives every texel the interpolated vertex colours at the nearest point of a mesh. False if the mesh has no colours.
pub(super) fn from_vertices(texels: &[Texel], colors: &mut [Option<Vec3>], dense: &Mesh) -> bool {
    let Some(solid) = trimesh(dense).filter(|_| dense.colors.len() == dense.vertices.len()) else { return false };
    let color = |texel: &Texel| -> Vec3 {
        let p = Vector::from_array(texel.point.as_vec3().to_array());
        let (_, (face, place)) = solid.project_local_point_and_get_location(p, false);
        let weights = place.barycentric_coordinates().unwrap_or([1.0, 0.0, 0.0]);
        let t = dense.triangles[face as usize % dense.triangles.len()];
        let corner = |k: usize| Vec3::from_array(dense.colors[t[k] as usize].map(f32::from));
        (0..3).map(|k| corner(k) * weights[k]).sum()
    };
    let found: Vec<Vec3> = texels.par_iter().map(color).collect();
    texels.iter().zip(found).for_each(|(t, c)| colors[t.index] = Some(c));
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Vec3 = Vec3::new(200.0, 20.0, 20.0);
    const BLUE: Vec3 = Vec3::new(20.0, 20.0, 200.0);

    /// Texels of the two sides of a panel of 40 x 20, 1 thick: its upper side red, its lower side blue.
    fn panel() -> Vec<Texel> {
        let texel = |index: usize| {
            let (x, y) = (index % 40, index / 40);
            let up = y < 20;
            let point = DVec3::new(x as f64, (y % 20) as f64, if up { 1.0 } else { 0.0 });
            Texel { index, point, normal: if up { DVec3::Z } else { DVec3::NEG_Z } }
        };
        (0..40 * 40).map(texel).collect()
    }

    fn filled(seen: impl Fn(&Texel) -> Option<Seen>) -> (bool, Vec<Option<Vec3>>) {
        let texels = panel();
        let seen: Vec<Option<Seen>> = texels.iter().map(seen).collect();
        let mut colors = vec![None; texels.len()];
        (from_similar(&texels, &seen, &mut colors, [40, 40], &FillSettings::DEFAULT), colors)
    }

    fn side(t: &Texel) -> Vec3 {
        if t.normal.z > 0.0 { RED } else { BLUE }
    }

    #[test]
    fn unseen_texels_take_the_colour_of_their_side() {
        // The lower side is seen beyond x = 4 only; the upper side is nearer to the rest.
        let seen = |t: &Texel| (side(t) == RED || t.point.x > 4.0).then_some(Seen { color: side(t), certain: true });
        let (any, colors) = filled(seen);
        let lower = |x: usize| colors[30 * 40 + x].unwrap();
        assert!(any && lower(4).z > 150.0 && lower(3).z > 110.0, "{} {}", lower(4), lower(3));
        assert_eq!((lower(20), colors[5].unwrap()), (BLUE, RED));
        assert_eq!(filled(|_| None), (false, vec![None; 1600]));
    }

    #[test]
    fn pixels_beside_edges_do_not_spread() {
        let white = Vec3::splat(255.0);
        let seen = |t: &Texel| {
            let rim = t.point.x < 12.0;
            (t.point.x >= 10.0).then_some(Seen { color: if rim { white } else { side(t) }, certain: !rim })
        };
        let (_, colors) = filled(seen);
        // What is seen stays; what is not comes from behind the rim.
        assert_eq!(colors[10 * 40 + 11], Some(white));
        assert!(colors[10 * 40 + 9].unwrap().distance(RED) < 60.0, "{:?}", colors[10 * 40 + 9]);
        // Without certain texels the others do.
        let (any, colors) = filled(|t| (t.point.x >= 10.0).then_some(Seen { color: white, certain: false }));
        assert!(any && colors[10 * 40 + 9].unwrap().distance(white) < 1e-3);
    }
}
