//! Depth rendered from Gaussians, where photos have none or the published method does not use it.

use crate::articulation::Trained;
use crate::fit::score::render_view;
use crate::surface::part_meshes::{PartMeshes, fuse};
use crate::surface::{FusionView, Selection, SurfaceConfig};
use crate::trimmed::trimmed_range;
use artgs_core::capture::OBJECT_ALPHA;
use artgs_core::{Mesh, PerState, Splats, State, View};
use artgs_raster::{Frame, Rasterizer};

/// Depth divided by alpha where the rendering is mostly opaque and the photo shows the object, else 0.
fn opaque_depth(frame: &Frame, view: &View) -> Vec<f32> {
    let pixels = frame.depth.iter().zip(&frame.alpha).zip(&view.rgba);
    pixels.map(|((d, a), p)| if *a > 0.5 && p[3] >= OBJECT_ALPHA { d / a } else { 0.0 }).collect()
}

/// Depth maps of the views rendered from Gaussians of their state, scene units.
pub(super) fn rendered_depths(splats: &Splats, views: &[View]) -> Vec<Vec<f32>> {
    let mut rasterizer = Rasterizer::new();
    views.iter().map(|v| opaque_depth(render_view(&mut rasterizer, splats, &v.camera), v)).collect()
}

/// Meshes as published: each part of each state, and the whole, fused from renderings of its Gaussians alone.
pub(super) fn part_meshes_from_renderings(
    trained: &Trained,
    views: PerState<&[View]>,
    config: &SurfaceConfig,
) -> PartMeshes {
    let mut meshes = PartMeshes { parts: vec![Default::default(); trained.joints.len() + 1], ..PartMeshes::default() };
    for state in State::ALL {
        let splats = trained.at_state(state);
        let voxel = config.voxel.unwrap_or_else(|| diagonal(&splats) / config.resolution);
        for part in 0..meshes.parts.len() {
            meshes.parts[part][state] =
                fuse_renderings(&splats.select(trained.members(part)), views[state], voxel, config);
        }
        meshes.whole[state] = fuse_renderings(&splats, views[state], voxel, config);
    }
    meshes
}

fn fuse_renderings(splats: &Splats, views: &[View], voxel: f64, config: &SurfaceConfig) -> Mesh {
    if splats.is_empty() || voxel <= 0.0 {
        return Mesh::default();
    }
    // Without labels only rendered pixels count: what hides a part in the photo is not in the rendering of the part alone.
    let views: Vec<FusionView> = views
        .iter()
        .zip(rendered_depths(splats, views))
        .map(|(v, depth)| FusionView { rgba: Some(v.rgba.as_slice().into()), ..FusionView::new(v.camera, depth) })
        .collect();
    fuse(&views, Selection::ALL, config.volume(voxel), config)
}

/// Diagonal of the box around the opaque Gaussians without the outermost 1 % on each side.
fn diagonal(splats: &Splats) -> f64 {
    let square: f64 = (0..3)
        .map(|axis| {
            let opaque = (0..splats.len()).filter(|&i| splats.logit_opacities[i] > 0.0);
            let mut xs: Vec<f32> = opaque.map(|i| splats.means[i][axis]).collect();
            trimmed_range(&mut xs, 100, f32::total_cmp).map_or(0.0, |[low, high]| f64::from(high - low).powi(2))
        })
        .sum();
    square.sqrt()
}
