//! Depth maps with labelled surface points to part meshes.

use super::points::label_pixels;
use crate::discover::{self, DepthPicture, Discovery};
use crate::surface::{LabelledDepth, PartMeshes, SurfaceConfig, SurfaceError, part_meshes};
use artgs_core::{Camera, PerState, Rigid, State};
use rayon::prelude::*;
use std::borrow::Cow;

/// A view as fusion reads it.
struct FusionView<'p> {
    camera: Camera,
    rgba: Cow<'p, [[u8; 4]]>,
    depth: Vec<f32>,
}

impl FusionView<'_> {
    fn labelled<'v>(&'v self, labels: &'v [u16]) -> LabelledDepth<'v> {
        LabelledDepth { camera: self.camera, depth: &self.depth, rgba: Some(&self.rgba), labels }
    }
}

/// Part meshes from depth maps. Every pixel belongs to the part of the nearest labelled point of its state;
/// `half_motions` lead from the canonical state to the end, one per part.
pub(super) fn fuse_labelled(
    pictures: &PerState<Vec<DepthPicture<'_>>>,
    found: &Discovery,
    half_motions: &[Rigid],
    config: &SurfaceConfig,
) -> Result<PartMeshes, SurfaceError> {
    let views = thinned(pictures, config);
    let labels = PerState::from_fn(|state| {
        let depths: Vec<&[f32]> = views[state].iter().map(|v| &v.depth[..]).collect();
        let cameras: Vec<Camera> = views[state].iter().map(|v| v.camera).collect();
        label_pixels(&cameras, &depths, &found.clouds[state], &found.labels[state])
    });
    let labelled = State::ALL.map(|state| {
        let pixels = views[state].iter().zip(&labels[state]);
        pixels.map(|(v, labels)| v.labelled(labels)).collect::<Vec<LabelledDepth>>()
    });
    Ok(part_meshes([&labelled[0], &labelled[1]], half_motions, config)?.meshes)
}

/// Views at the size that voxels ask for.
fn thinned<'p>(pictures: &PerState<Vec<DepthPicture<'p>>>, config: &SurfaceConfig) -> PerState<Vec<FusionView<'p>>> {
    // A pixel may be a little larger than a voxel.
    const PIXEL_PER_VOXEL: f64 = 1.2;
    let fitting = || discover::pixel_step(PerState::from_fn(|s| &pictures[s][..]), PIXEL_PER_VOXEL / config.resolution);
    let step = if config.voxel.is_none() { fitting() } else { 1 };
    let fusion_view = |picture: &DepthPicture<'p>| {
        let (camera, depth) = picture.thinned_depth(step);
        FusionView { camera, rgba: picture.thinned_colors(step), depth: depth.iter().collect() }
    };
    pictures.as_ref().map(|pictures| pictures.par_iter().map(fusion_view).collect())
}
