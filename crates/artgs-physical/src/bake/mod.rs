//! Bakes textures from the photos of a capture.
//!
//! Every texel samples all views of both states in which the depth agrees with its point. The weight of a sample falls with
//! viewing angle and distance, and towards edges of depth and mask, where pixels mix two surfaces. Samples far from the
//! weighted median (highlights, wrong masks) get smoothly decreasing weights, so that no seams appear.

mod atlas;
mod blend;
mod fill;
mod view;
mod zbuffer;

pub(crate) use zbuffer::depth_of;
pub use zbuffer::{Hit, visible};

use artgs_core::{Camera, DepthMap, Mesh, Texture, TexturedMesh};
use atlas::Texel;
use blend::blend;
use glam::Vec3;
use rayon::prelude::*;
use view::{PreparedView, Sample};

/// A photo as a source of colours.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BakeView<'a> {
    /// Camera in the frame of the mesh: that of the photo, moved with the part ([`Camera::moved_with`]).
    pub camera: Camera,
    /// Straight colours, `[height * width]`; alpha is the mask of the object.
    pub rgba: &'a [[u8; 4]],
    /// Planar depth, `[height * width]`, scene units. Without it only the mesh itself decides about visibility; [`depth_of`]
    /// renders depth that includes other parts.
    pub depth: Option<&'a DepthMap>,
    /// Part of every pixel, `[height * width]`, and the number of this part; pixels of other parts are ignored.
    pub labels: Option<(&'a [u16], u16)>,
    /// Weight of the view relative to others, usually 1.
    pub weight: f64,
}

impl BakeView<'_> {
    /// True if every buffer has the size of the image.
    fn is_whole(&self) -> bool {
        let pixels = self.camera.intrinsics.width as usize * self.camera.intrinsics.height as usize;
        self.rgba.len() == pixels
            && self.depth.is_none_or(|d| d.len() == pixels)
            && self.labels.is_none_or(|(l, _)| l.len() == pixels)
    }
}

/// Settings of [`bake`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BakeOptions {
    /// Largest difference between a view's depth and a visible point, scene units.
    pub tolerance: f64,
    /// Step of depth between pixels that counts as an edge between two surfaces, scene units.
    pub jump: f64,
    /// Exponent of the cosine between normal and ray in the weight of a view.
    pub sharpness: f64,
    /// Difference in colour, [0, 255], at which a sample has a quarter of its weight.
    pub outlier: f64,
    /// Texels of padding around charts.
    pub padding: u32,
}

impl BakeOptions {
    /// Settings for surfaces with an accuracy of about `voxel` (scene units).
    pub(crate) fn at_resolution(voxel: f64) -> Self {
        Self { tolerance: 2.5 * voxel, jump: 4.0 * voxel, sharpness: 8.0, outlier: 40.0, padding: 4 }
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
/// sees get the colour of the nearest visible surface; if no view sees the mesh, all get the vertex colours of `dense`, the
/// mesh before simplification. Views whose buffers do not have the size of their image are ignored.
pub(crate) fn bake(
    mesh: &TexturedMesh,
    size: [u32; 2],
    views: &[BakeView],
    dense: &Mesh,
    options: &BakeOptions,
) -> Baked {
    let n = mesh.mesh.vertices.len();
    if mesh.uvs.len() != n || mesh.normals.len() != n || size.contains(&0) {
        return Baked::default();
    }
    let texels = atlas::texels(mesh, size);
    let prepared = view::prepare(views, &mesh.mesh, options);
    let found = blended(&texels, size[0], &prepared, options);
    let mut colors: Vec<Option<Vec3>> = vec![None; size[0] as usize * size[1] as usize];
    texels.iter().zip(&found).for_each(|(t, c)| colors[t.index] = *c);
    let seen = found.iter().flatten().count();
    if !fill::from_neighbours(&texels, &mut colors, size) {
        fill::from_vertices(&texels, &mut colors, dense);
    }
    let rgb = atlas::pad(&mut colors, size, options.padding);
    let texture = Texture { width: size[0], height: size[1], rgb };
    let colors = mesh.uvs.iter().map(|uv| texel_at(&texture, *uv)).collect();
    Baked { texture, colors, texels: texels.len(), seen }
}

/// The blended samples of all views for every texel, in squares of the atlas: neighbours are near each other in images, too, which
/// are too large for the caches of a processor.
fn blended(texels: &[Texel], width: u32, views: &[PreparedView], options: &BakeOptions) -> Vec<Option<Vec3>> {
    /// Side of a square, texels.
    const SQUARE: usize = 32;
    let place = |i: usize| {
        let (x, y) = (texels[i].index % width as usize, texels[i].index / width as usize);
        (y / SQUARE, x / SQUARE)
    };
    let mut order: Vec<usize> = (0..texels.len()).collect();
    order.sort_by_key(|i| place(*i));
    let squares: Vec<&[usize]> = order.chunk_by(|a, b| place(*a) == place(*b)).collect();
    let blend_square = |samples: &mut Vec<Vec<Sample>>, square: &&[usize]| -> Vec<Option<Vec3>> {
        samples.resize_with(square.len().max(samples.len()), Vec::new);
        samples.iter_mut().for_each(Vec::clear);
        for view in views {
            for (texel, samples) in square.iter().map(|i| &texels[*i]).zip(samples.iter_mut()) {
                samples.extend(view.sample(texel.point, texel.normal, options));
            }
        }
        samples.iter_mut().take(square.len()).map(|samples| blend(samples, options.outlier as f32)).collect()
    };
    let found: Vec<Vec<Option<Vec3>>> = squares.par_iter().map_init(Vec::new, blend_square).collect();
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
