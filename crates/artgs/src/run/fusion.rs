//! Depth maps with labelled surface points to part meshes.

use super::points::label_pixels;
use crate::discover::{self, DepthPicture, Discovery};
use crate::surface::{FusionView, PartMeshes, SurfaceConfig, SurfaceError, part_meshes};
use artgs_core::{Camera, PerState, Rigid, State};
use rayon::prelude::*;

/// Part meshes from depth maps. Every pixel belongs to the part of the nearest labelled point of its state;
/// `half_motions` lead from the canonical state to the end, one per part.
pub(super) fn fuse_labelled(
    pictures: &PerState<Vec<DepthPicture<'_>>>,
    found: &Discovery,
    half_motions: &[Rigid],
    config: &SurfaceConfig,
) -> Result<PartMeshes, SurfaceError> {
    let mut views = thinned(pictures, config);
    for state in State::ALL {
        let depths: Vec<&[f32]> = views[state].iter().map(|v| &v.depth[..]).collect();
        let cameras: Vec<Camera> = views[state].iter().map(|v| v.camera).collect();
        let labels = label_pixels(&cameras, &depths, &found.clouds[state], &found.labels[state]);
        views[state].iter_mut().zip(labels).for_each(|(view, labels)| view.labels = Some(labels.into()));
    }
    Ok(part_meshes(views.as_ref().map(|views| &views[..]), half_motions, config)?.meshes)
}

/// Views at the size that voxels ask for.
fn thinned<'p>(pictures: &PerState<Vec<DepthPicture<'p>>>, config: &SurfaceConfig) -> PerState<Vec<FusionView<'p>>> {
    // A pixel may be a little larger than a voxel.
    const PIXEL_PER_VOXEL: f64 = 1.2;
    let fitting = || discover::pixel_step(pictures.as_ref().map(Vec::as_slice), PIXEL_PER_VOXEL / config.resolution);
    let step = if config.voxel.is_none() { fitting() } else { 1 };
    let fusion_view = |picture: &DepthPicture<'p>| {
        let (camera, depth) = picture.thinned_depth(step);
        let depth: Vec<f32> = depth.iter().collect();
        FusionView { rgba: Some(picture.thinned_colors(step)), ..FusionView::new(camera, depth) }
    };
    pictures.as_ref().map(|pictures| pictures.par_iter().map(fusion_view).collect())
}
