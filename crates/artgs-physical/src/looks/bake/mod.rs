//! Bakes textures from the photos of a capture.
//!
//! Every texel samples all views of both states in which the depth agrees with its point. The weight of a sample falls with
//! viewing angle and distance, and towards edges of depth and mask, where pixels mix two surfaces. Samples far from the
//! weighted median (highlights, wrong masks) get smoothly decreasing weights, so that no seams appear.

mod atlas;
mod blend;
mod fill;
mod gains;
mod photo;
mod solve;
mod view;
mod zbuffer;

pub(crate) use gains::equalise;
pub(crate) use photo::Photo;
pub(crate) use view::BakeView;
pub(crate) use zbuffer::depth_of;
pub use zbuffer::{Hit, visible};

use crate::settings::BakeSettings;
use artgs_core::{Mesh, Texture, TexturedMesh};
use atlas::Texel;
use blend::blend;
use fill::Seen;
use glam::Vec3;
use rayon::prelude::*;
use view::Sample;

/// Settings of [`bake`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BakeOptions {
    /// Largest difference between a view's depth and a visible point, scene units.
    pub tolerance: f64,
    /// How colours are chosen.
    pub settings: BakeSettings,
}

impl BakeOptions {
    /// Settings for surfaces with an accuracy of about `voxel` (scene units).
    pub(crate) fn at_resolution(voxel: f64, settings: &BakeSettings) -> Self {
        Self { tolerance: settings.tolerance * voxel, settings: *settings }
    }
}

/// Result of [`bake`].
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Baked {
    /// The texture, of the requested size.
    pub texture: Texture,
    /// Colour of every vertex, sampled from the texture.
    pub colors: Vec<[u8; 3]>,
    /// Texels on the surface.
    pub texels: usize,
    /// Texels on the surface that a view sees.
    pub seen: usize,
}

/// Bakes a texture of `size` texels (width, height) for a mesh with texture coordinates and normals. Texels that no view
/// sees get colours of near surfaces of similar orientation; if no view sees the mesh, all get the vertex colours of `dense`, the
/// mesh before simplification. Colours spread over `padding` texels around charts.
pub(crate) fn bake(
    mesh: &TexturedMesh,
    size: [u32; 2],
    views: &[BakeView],
    (dense, padding): (&Mesh, u32),
    options: &BakeOptions,
) -> Baked {
    let n = mesh.mesh.vertices.len();
    if mesh.uvs.len() != n || mesh.normals.len() != n || size.contains(&0) {
        return Baked::default();
    }
    let texels = atlas::texels(mesh, size);
    let found = blended(&texels, size[0], views, options);
    let mut colors: Vec<Option<Vec3>> = vec![None; size[0] as usize * size[1] as usize];
    let seen = found.iter().flatten().count();
    if !fill::from_similar(&texels, &found, &mut colors, size, &options.settings.fill) {
        fill::from_vertices(&texels, &mut colors, dense);
    }
    let rgb = atlas::pad(&mut colors, size, padding);
    let texture = Texture { width: size[0], height: size[1], rgb };
    let colors = mesh.uvs.iter().map(|uv| texel_at(&texture, *uv)).collect();
    Baked { texture, colors, texels: texels.len(), seen }
}

/// The blended samples of all views for every texel, in squares of the atlas: neighbours are near each other in images, too, which
/// are too large for the caches of a processor.
fn blended(texels: &[Texel], width: u32, views: &[BakeView], options: &BakeOptions) -> Vec<Option<Seen>> {
    /// Side of a square, texels.
    const SQUARE: usize = 32;
    let place = |i: usize| {
        let (x, y) = (texels[i].index % width as usize, texels[i].index / width as usize);
        (y / SQUARE, x / SQUARE)
    };
    let mut order: Vec<usize> = (0..texels.len()).collect();
    order.sort_by_key(|i| place(*i));
    let squares: Vec<&[usize]> = order.chunk_by(|a, b| place(*a) == place(*b)).collect();
    let blend_square = |samples: &mut Vec<Vec<Sample>>, square: &&[usize]| -> Vec<Option<Seen>> {
        samples.resize_with(square.len().max(samples.len()), Vec::new);
        samples.iter_mut().for_each(Vec::clear);
        for view in views {
            for (texel, samples) in square.iter().map(|i| &texels[*i]).zip(samples.iter_mut()) {
                samples.extend(view.sample(texel.point, texel.normal, options));
            }
        }
        let seen = |samples: &mut Vec<Sample>| {
            let color = blend(samples, options.settings.outlier as f32, options.settings.rounds)?;
            Some(Seen { color, certain: samples.iter().any(|sample| sample.clear) })
        };
        samples.iter_mut().take(square.len()).map(seen).collect()
    };
    let found: Vec<Vec<Option<Seen>>> = squares.par_iter().map_init(Vec::new, blend_square).collect();
    let mut out = vec![None; texels.len()];
    order.iter().zip(found.into_iter().flatten()).for_each(|(i, color)| out[*i] = color);
    out
}

fn texel_at(texture: &Texture, uv: [f32; 2]) -> [u8; 3] {
    let at = |t: f32, n: u32| ((t * n as f32).max(0.0) as usize).min(n as usize - 1);
    texture.rgb[at(uv[1], texture.height) * texture.width as usize + at(uv[0], texture.width)]
}

#[cfg(test)]
mod tests;
