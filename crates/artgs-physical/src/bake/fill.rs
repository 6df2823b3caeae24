//! Colours of texels that no view sees.

use super::atlas::Texel;
use crate::repair::trimesh;
use artgs_core::Mesh;
use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use parry3d::math::Vector;
use parry3d::query::PointQueryWithLocation;
use rayon::prelude::*;
use std::num::NonZero;

/// Number of known texels that are mixed for an unknown one.
const NEIGHBOURS: NonZero<usize> = NonZero::new(12).expect("12 is not 0");

/// Gives texels without a colour the mean of those nearest in space, weighted by the inverse square of the distance.
/// False if no texel has a colour.
pub(super) fn from_neighbours(texels: &[Texel], colors: &mut [Option<Vec3>], size: [u32; 2]) -> bool {
    let sources: Vec<&Texel> = texels.iter().filter(|t| is_source(colors, t.index, size)).collect();
    let points: Vec<[f32; 3]> = sources.iter().map(|t| t.point.as_vec3().to_array()).collect();
    let Some(tree) = ImmutableKdTree::<f32, 3>::new_from_slice(&points).ok().filter(|_| !points.is_empty()) else {
        return false;
    };
    let blend = |texel: &Texel| -> Vec3 {
        let query = texel.point.as_vec3().to_array();
        let found = tree.query(&query).nearest_n::<SquaredEuclidean<f32>>(NEIGHBOURS).execute();
        let mut sum = (Vec3::ZERO, 0.0);
        for hit in found {
            let weight = 1.0 / (hit.distance + 1e-12);
            sum.0 += colors[sources[hit.item as usize].index].unwrap_or_default() * weight;
            sum.1 += weight;
        }
        sum.0 / sum.1
    };
    let unknown: Vec<&Texel> = texels.iter().filter(|t| colors[t.index].is_none()).collect();
    let filled: Vec<Vec3> = unknown.par_iter().map(|t| blend(t)).collect();
    unknown.iter().zip(filled).for_each(|(t, c)| colors[t.index] = Some(c));
    true
}

/// Known texels used as sources: every fourth in both directions, and all at the border of the known area.
fn is_source(colors: &[Option<Vec3>], index: usize, size: [u32; 2]) -> bool {
    let [width, height] = size.map(|s| s as usize);
    let (x, y) = (index % width, index / width);
    let unknown = |x: usize, y: usize| x < width && y < height && colors[y * width + x].is_none();
    let at_rim =
        || unknown(x.wrapping_sub(1), y) || unknown(x + 1, y) || unknown(x, y.wrapping_sub(1)) || unknown(x, y + 1);
    colors[index].is_some() && ((x % 4 == 0 && y % 4 == 0) || at_rim())
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
