//! Depth maps with labelled surface points to part meshes.

use super::points::label_pixels;
use crate::discover::{self, DepthPicture, Discovery};
use crate::observer::{Share, within};
use crate::surface::{FusionView, PartMeshes, SurfaceConfig, SurfaceError, part_meshes_with_progress};
use artgs_core::capture::{OBJECT_ALPHA, may_hold_object};
use artgs_core::{Camera, PerState, Rigid, State};
use rayon::prelude::*;

/// Part meshes from depth maps. Every pixel belongs to the part of the nearest labelled point of its state;
/// `half_motions` lead from the canonical state to the end, one per part.
pub(super) fn fuse_labelled(
    pictures: &PerState<Vec<DepthPicture<'_>>>,
    found: &Discovery,
    half_motions: &[Rigid],
    config: &SurfaceConfig,
    done: Share<'_>,
) -> Result<PartMeshes, SurfaceError> {
    /// Share of the work until pixels are labelled.
    const LABELLED: f64 = 0.2;
    done(0.0);
    let mut views = thinned(pictures, config);
    for state in State::ALL {
        let depths: Vec<&[f32]> = views[state].iter().map(|v| &v.depth[..]).collect();
        let cameras: Vec<Camera> = views[state].iter().map(|v| v.camera).collect();
        let labels = label_pixels(&cameras, &depths, &found.clouds[state], &found.labels[state]);
        for (view, mut labels) in views[state].iter_mut().zip(labels) {
            keep_unmeasured(view, &mut labels);
            view.labels = Some(labels.into());
        }
    }
    let views = views.as_ref().map(|views| &views[..]);
    Ok(part_meshes_with_progress(views, half_motions, config, &mut within(done, LABELLED, 1.0))?.meshes)
}

/// Pixels of the object without depth, and those in which something else hides it, say nothing: any part as their label keeps their rays from
/// being carved.
fn keep_unmeasured(view: &FusionView<'_>, labels: &mut [u16]) {
    let Some(rgba) = &view.rgba else { return };
    for (i, label) in labels.iter_mut().enumerate().filter(|(i, _)| view.depth[*i] <= 0.0) {
        if may_hold_object(&rgba[i]) {
            *label = 0;
        }
    }
}

/// Gives pixels of the object without measured depth their derived one; returns which pixels, also of the background, are derived.
fn fill_derived(depth: &mut [f32], derived: &[f32], rgba: &[[u8; 4]]) -> Vec<bool> {
    let fill = |((depth, derived), pixel): ((&mut f32, &f32), &[u8; 4])| {
        let missing = *depth <= 0.0 && *derived > 0.0;
        if missing && pixel[3] >= OBJECT_ALPHA {
            *depth = *derived;
        }
        missing
    };
    depth.iter_mut().zip(derived).zip(rgba).map(fill).collect()
}

/// Views at the size that voxels ask for.
fn thinned<'p>(pictures: &PerState<Vec<DepthPicture<'p>>>, config: &SurfaceConfig) -> PerState<Vec<FusionView<'p>>> {
    // A pixel may be a little larger than a voxel.
    const PIXEL_PER_VOXEL: f64 = 1.2;
    let fitting = || discover::pixel_step(pictures.as_ref().map(Vec::as_slice), PIXEL_PER_VOXEL / config.resolution);
    let step = if config.voxel.is_none() { fitting() } else { 1 };
    let fusion_view = |picture: &DepthPicture<'p>| {
        let (camera, depth) = picture.thinned_depth(step, step / 2);
        let mut depth: Vec<f32> = depth.iter().collect();
        let rgba = picture.thinned_colors(step);
        let derived = picture.thinned_derived(step).map(|derived| fill_derived(&mut depth, &derived, &rgba).into());
        FusionView { rgba: Some(rgba), derived, ..FusionView::new(camera, depth) }
    };
    pictures.as_ref().map(|pictures| pictures.par_iter().map(fusion_view).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::BACKGROUND;
    use artgs_core::Intrinsics;
    use glam::DVec3;

    #[test]
    fn pixels_of_the_object_without_depth_are_not_background() {
        let intrinsics = Intrinsics { fx: 2.0, fy: 2.0, cx: 1.0, cy: 1.0, width: 2, height: 2 };
        let camera = Camera::look_at(intrinsics, DVec3::Z, DVec3::ZERO, DVec3::Y);
        let rgba = vec![[9, 9, 9, 255], [9, 9, 9, 0], [9, 9, 9, 255], [9, 9, 9, 0]];
        let view = FusionView { rgba: Some(rgba.into()), ..FusionView::new(camera, vec![0.0, 0.0, 1.0, 0.0]) };
        let mut labels = [BACKGROUND, BACKGROUND, 3, BACKGROUND];
        keep_unmeasured(&view, &mut labels);
        assert_eq!(labels, [0, BACKGROUND, 3, BACKGROUND]);
    }

    #[test]
    fn derived_depth_fills_pixels_of_the_object() {
        let rgba = [255, 255, 0, 255].map(|alpha| [9, 9, 9, alpha]);
        let mut depth = [1.0, 0.0, 0.0, 0.0];
        let derived = fill_derived(&mut depth, &[0.5, 2.0, 3.0, 0.0], &rgba);
        assert_eq!((depth, derived), ([1.0, 2.0, 0.0, 0.0], vec![false, true, true, false]));
    }
}
