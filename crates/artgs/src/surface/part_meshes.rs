//! Meshes of every part and of the whole object from labelled depth maps of both states.
//!
//! A part is fused once, in its canonical frame, from both states: what one state hides the other may show. Pixels of
//! other parts and of the background carve: space before them holds nothing of this part.

use super::evidence::{Cells, Seen, Supported};
use super::{BACKGROUND, FusionView, Selection, Tsdf, TsdfParams, clean, marching_cubes, paint};
use crate::observer::Share;
use crate::trimmed::trimmed_range;
use artgs_core::{Mesh, PerState, Rigid, State};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Where the mesh of the whole object comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum WholeMesh {
    /// The parts, moved to the state: knows what either state shows.
    #[default]
    Union,
    /// A fusion of that state's views alone, as ArtGS does it.
    Fused,
}

/// Settings of the meshes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SurfaceConfig {
    /// Voxel size in scene units; none: the object's diagonal divided by `resolution`.
    pub voxel: Option<f64>,
    /// Voxels along the diagonal of the object's bounding box.
    pub resolution: f64,
    /// Distance before a surface from which on space counts as empty, voxels.
    pub truncation_voxels: f64,
    /// Distance behind a surface up to which a sample is believed, voxels.
    pub behind_voxels: f64,
    /// Depth step between neighbouring pixels that separates two surfaces, voxels; 0 never does.
    pub jump_voxels: f64,
    /// Weight a voxel needs; a view straight onto the surface counts 1.
    pub min_weight: f32,
    /// Components with fewer triangles than this fraction of the largest one's are dropped as specks. Of part meshes, views decide on larger ones.
    pub keep_fraction: f64,
    /// Background pixels say that their rays are empty; turn it off if masks miss parts of the object.
    pub carve_background: bool,
    /// Source of the whole object's mesh.
    pub whole: WholeMesh,
    /// Memory of one volume, MiB; voxels grow until it suffices.
    pub memory_mib: usize,
}

impl Default for SurfaceConfig {
    fn default() -> Self {
        Self {
            voxel: None,
            resolution: 425.0,
            truncation_voxels: 5.0,
            behind_voxels: 3.0,
            jump_voxels: 5.0,
            min_weight: 0.1,
            keep_fraction: 5e-4,
            carve_background: true,
            whole: WholeMesh::Union,
            memory_mib: 2048,
        }
    }
}

impl SurfaceConfig {
    /// Distances of a volume with voxels of this size, scene units.
    pub fn volume(&self, voxel: f64) -> TsdfParams {
        TsdfParams {
            voxel,
            truncation: self.truncation_voxels * voxel,
            behind: self.behind_voxels * voxel,
            jump: self.jump_voxels * voxel,
        }
    }
}

/// A reason why there are no meshes.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum SurfaceError {
    /// A buffer does not fit its image.
    #[error("{} state, view {view}: depth, colours or labels do not have the size of the image", .state.name())]
    Size {
        /// State of the view.
        state: State,
        /// Position among the state's views.
        view: usize,
    },
    /// A setting that makes no volume.
    #[error("surface setting `{0}` must be positive and finite")]
    Setting(&'static str),
}

/// Meshes in world coordinates of both states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PartMeshes {
    /// Per part; empty where nothing of the part was seen.
    pub parts: Vec<PerState<Mesh>>,
    /// The whole object.
    pub whole: PerState<Mesh>,
}

/// What [`part_meshes`] makes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surfaces {
    /// Per part, in its canonical frame.
    pub canonical: Vec<Mesh>,
    /// The same in both states, and the whole.
    pub meshes: PartMeshes,
    /// Voxel size asked for, scene units; a volume short of memory used a larger one.
    pub voxel: f64,
}

/// Fuses every part from both states' views, all with labels. `half_motions[p]` moves part `p` from the canonical frame to
/// the end and its inverse to the start; part 0 is the static one. Deterministic.
pub fn part_meshes(
    states: PerState<&[FusionView]>,
    half_motions: &[Rigid],
    config: &SurfaceConfig,
) -> Result<Surfaces, SurfaceError> {
    part_meshes_with_progress(states, half_motions, config, &mut |_| ())
}

/// The same; `done` takes the share of the parts that are fused.
pub fn part_meshes_with_progress(
    states: PerState<&[FusionView]>,
    half_motions: &[Rigid],
    config: &SurfaceConfig,
    done: Share<'_>,
) -> Result<Surfaces, SurfaceError> {
    check(states, config)?;
    let voxel = config.voxel.unwrap_or_else(|| object_diagonal(states) / config.resolution);
    if voxel.is_nan() || voxel <= 0.0 || half_motions.is_empty() {
        // No pixel shows any surface, or there is no part that it could be of.
        let parts = vec![PerState::<Mesh>::default(); half_motions.len()];
        let canonical = vec![Mesh::default(); half_motions.len()];
        return Ok(Surfaces { canonical, meshes: PartMeshes { parts, ..PartMeshes::default() }, voxel: 0.0 });
    }
    let params = config.volume(voxel);
    let carve_background = config.carve_background;
    let mut canonical = vec![Mesh::default(); half_motions.len()];
    let mut labelled: PerState<Vec<FusionView>> = states.map(|views| views.iter().map(FusionView::borrowed).collect());
    // The static part last: it takes what does not move with the others.
    for (done_parts, part) in (1..half_motions.len()).chain([0]).enumerate() {
        done(done_parts as f64 / half_motions.len() as f64);
        let poses = PerState::from_fn(|state| half_motions[part].towards(state));
        let moved = |state: State| labelled[state].iter().map(move |view| view.moved_with(&poses[state]));
        let views: Vec<FusionView> = State::ALL.into_iter().flat_map(moved).collect();
        let selection = Selection { part: Some(part), carve_background };
        let mesh = fuse(&views, selection, params, config);
        let of_states = labelled.as_ref().map(|views| &views[..]);
        let seen = Seen { part: part as u16, views: of_states, poses, tolerance: params.truncation };
        let Supported { mesh, still } = seen.supported(&mesh);
        canonical[part] = mesh;
        if !still.is_empty() {
            let relabelled = State::ALL.map(|state| {
                let view = |view: &FusionView| {
                    view.labels.as_ref().map(|labels| without(view, labels, part, &poses[state], &still))
                };
                labelled[state].par_iter().map(view).collect::<Vec<_>>()
            });
            for (views, labels) in labelled.iter_mut().zip(relabelled) {
                views.iter_mut().zip(labels).for_each(|(view, labels)| view.labels = labels.map(Cow::Owned));
            }
        }
    }
    let parts: Vec<PerState<Mesh>> = canonical
        .iter()
        .zip(half_motions)
        .map(|(mesh, half)| PerState::from_fn(|state| mesh.moved(&half.towards(state))))
        .collect();
    let all = Selection { part: None, carve_background };
    let whole = PerState::from_fn(|state| match config.whole {
        WholeMesh::Union => union(parts.iter().map(|part: &PerState<Mesh>| &part[state])),
        WholeMesh::Fused => fuse(states[state], all, params, config),
    });
    Ok(Surfaces { canonical, meshes: PartMeshes { parts, whole }, voxel })
}

/// Labels of a view in which pixels of a part that show these cells, in the frame of the part's mesh, are static.
fn without(view: &FusionView, labels: &[u16], part: usize, pose: &Rigid, cells: &Cells) -> Vec<u16> {
    let (width, back) = (view.camera.intrinsics.width as usize, pose.inverse());
    let label = |(i, label): (usize, &u16)| {
        if usize::from(*label) != part || view.depth[i] <= 0.0 {
            return *label;
        }
        let pixel = DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
        let point = view.camera.unproject(pixel, f64::from(view.depth[i]));
        if cells.contains(back.apply(point)) { 0 } else { *label }
    };
    labels.iter().enumerate().map(label).collect()
}

/// Mesh of consistent views in one frame: volume, marching cubes, cleaning, colours. Empty if they show nothing.
pub fn fuse(views: &[FusionView], selection: Selection, params: TsdfParams, config: &SurfaceConfig) -> Mesh {
    // A block holds 8^3 sums and weights.
    let max_blocks = (config.memory_mib << 20) / (512 * 8);
    let mut growth = 1.0;
    let volume = loop {
        let TsdfParams { voxel, truncation, behind, jump } = params;
        let coarser =
            TsdfParams { voxel: voxel * growth, truncation: truncation * growth, behind: behind * growth, jump };
        let mut volume = Tsdf::new(coarser);
        if volume.allocate(views, selection, max_blocks.max(64)) || growth > 1e3 {
            volume.integrate(views, selection);
            break volume;
        }
        growth *= 1.25;
    };
    let mut mesh = clean(&marching_cubes(&volume, config.min_weight), config.keep_fraction);
    paint(&mut mesh, views, selection, volume.params().truncation);
    mesh
}

fn union<'a>(parts: impl Iterator<Item = &'a Mesh>) -> Mesh {
    let mut whole = Mesh::default();
    parts.filter(|m| !m.is_empty()).for_each(|m| whole.append(m));
    whole
}

/// Diagonal of the box around all labelled samples of both states, 0 without any. The outermost thousandth of the
/// samples on each side is left out, so that stray pixels do not coarsen the mesh.
fn object_diagonal(states: PerState<&[FusionView]>) -> f64 {
    const STRIDE: usize = 7;
    let points: Vec<DVec3> = states
        .iter()
        .flat_map(|s| s.iter())
        .flat_map(|view| {
            let k = view.camera.intrinsics;
            let from_camera = view.camera.world_to_camera.inverse();
            let pixels = (0..view.depth.len()).step_by(STRIDE);
            let labels = view.labels.as_deref();
            let labelled = move |i: usize| labels.is_none_or(|labels| labels[i] != BACKGROUND);
            let shown = pixels.filter(move |&i| labelled(i) && view.depth[i] > 0.0 && view.depth[i].is_finite());
            shown.map(move |i| {
                let (x, y) = (i % k.width as usize, i / k.width as usize);
                let d = f64::from(view.depth[i]);
                let ray = DVec3::new((x as f64 + 0.5 - k.cx) / k.fx, (y as f64 + 0.5 - k.cy) / k.fy, 1.0);
                from_camera.apply(ray * d)
            })
        })
        .collect();
    let side = |axis: usize| {
        let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        trimmed_range(&mut values, 1000, f64::total_cmp).map_or(0.0, |[low, high]| high - low)
    };
    DVec3::new(side(0), side(1), side(2)).length()
}

fn check(states: PerState<&[FusionView]>, config: &SurfaceConfig) -> Result<(), SurfaceError> {
    let positive = [
        ("voxel", config.voxel.unwrap_or(1.0)),
        ("resolution", config.resolution),
        ("truncation_voxels", config.truncation_voxels),
        ("behind_voxels", config.behind_voxels),
    ];
    if let Some((name, _)) = positive.iter().find(|(_, v)| !(*v > 0.0 && v.is_finite())) {
        return Err(SurfaceError::Setting(name));
    }
    for (state, views) in states.enumerate() {
        if let Some(view) = views.iter().position(|v| !v.is_consistent() || v.labels.is_none()) {
            return Err(SurfaceError::Size { state, view });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Scene, Shape, orbit};
    use super::*;
    use artgs_core::Camera;

    /// A box with a sliding lid that half covers it at the start: the motion from start to end is `shift`.
    fn scenes(shift: DVec3) -> PerState<Scene> {
        let base = || (Shape::Box(DVec3::new(0.4, 0.3, 0.2)), Rigid::IDENTITY);
        let lid = |at: DVec3| (Shape::Box(DVec3::new(0.2, 0.3, 0.05)), Rigid::shift(at));
        let start = DVec3::new(-0.2, 0.0, 0.26);
        PerState::new(Scene(vec![base(), lid(start)]), Scene(vec![base(), lid(start + shift)]))
    }

    fn fused(config: &SurfaceConfig) -> Surfaces {
        let shift = DVec3::new(0.4, 0.0, 0.2);
        let scenes = scenes(shift);
        let cameras = orbit(24, 160, 2.0);
        let white = vec![[250, 250, 250, 255]; 160 * 160];
        let views = scenes.map(|scene| {
            let view = |camera: &Camera| {
                let (depth, labels) = scene.render(camera);
                let (rgba, labels) = (Some((&white).into()), Some(labels.into()));
                FusionView { rgba, labels, ..FusionView::new(*camera, depth) }
            };
            cameras.iter().map(view).collect::<Vec<_>>()
        });
        let views = views.as_ref().map(|views| &views[..]);
        part_meshes(views, &[Rigid::IDENTITY, Rigid::shift(shift * 0.5)], config).unwrap()
    }

    /// Greatest distance of a vertex from the surface of a box, and the extent of the mesh.
    fn misfit(mesh: &Mesh, half: DVec3, centre: DVec3) -> (f64, DVec3) {
        let mut extent = DVec3::ZERO;
        let mut worst = 0.0f64;
        for v in &mesh.vertices {
            let p = DVec3::from_array(v.map(f64::from)) - centre;
            let q = p.abs() - half;
            let distance = q.max(DVec3::ZERO).length() + q.max_element().min(0.0);
            worst = worst.max(distance.abs());
            extent = extent.max(p.abs());
        }
        (worst, extent)
    }

    #[test]
    fn both_states_complete_each_part_and_others_do_not_leak_in() {
        let config = SurfaceConfig { voxel: Some(0.02), ..SurfaceConfig::default() };
        let out = fused(&config);
        let (base, base_extent) = misfit(&out.meshes.parts[0][State::START], DVec3::new(0.4, 0.3, 0.2), DVec3::ZERO);
        let half = DVec3::new(0.2, 0.3, 0.05);
        let (lid, lid_extent) = misfit(&out.meshes.parts[1][State::END], half, DVec3::new(0.2, 0.0, 0.46));
        // Edges and corners are cut by up to a voxel.
        assert!(base < 0.02 && lid < 0.02, "{base} {lid}");
        assert!((base_extent - DVec3::new(0.4, 0.3, 0.2)).abs().max_element() < 0.02, "{base_extent}");
        assert!((lid_extent - half).abs().max_element() < 0.02, "{lid_extent}");
        let (start, _) = misfit(&out.meshes.parts[1][State::START], half, DVec3::new(-0.2, 0.0, 0.26));
        assert!((start - lid).abs() < 1e-5, "the same mesh moved");
        // The lid's underside is hidden at the start and seen at the end.
        let lowest = out.meshes.parts[1][State::START].vertices.iter().filter(|v| (v[2] - 0.21).abs() < 5e-3).count();
        assert!(lowest > 200, "{lowest} vertices on the underside");
        assert!(out.meshes.parts[0][State::START].colors.iter().all(|c| *c == [250; 3]));
        let sum: usize = out.meshes.parts.iter().map(|p| p[State::START].triangles.len()).sum();
        assert_eq!(out.meshes.whole[State::START].triangles.len(), sum);
    }

    #[test]
    fn whole_from_one_state_is_a_single_fusion() {
        let config = SurfaceConfig { voxel: Some(0.03), whole: WholeMesh::Fused, ..SurfaceConfig::default() };
        let out = fused(&config);
        let top = |m: &Mesh| m.vertices.iter().map(|v| v[2]).fold(f32::MIN, f32::max);
        assert!(
            (top(&out.meshes.whole[State::START]) - 0.31).abs() < 0.02
                && (top(&out.meshes.whole[State::END]) - 0.51).abs() < 0.02
        );
    }

    #[test]
    fn too_little_memory_coarsens_instead_of_failing() {
        let scarce = SurfaceConfig { voxel: Some(0.008), memory_mib: 2, ..SurfaceConfig::default() };
        let out = fused(&scarce);
        let fine = fused(&SurfaceConfig { memory_mib: 2048, ..scarce });
        assert!(!out.canonical[0].is_empty());
        assert!(out.canonical[0].triangles.len() * 2 < fine.canonical[0].triangles.len());
    }

    #[test]
    fn nothing_seen_gives_empty_meshes_and_bad_sizes_an_error() {
        let camera = orbit(1, 8, 2.0)[0];
        let labels = vec![BACKGROUND; 64];
        let view = FusionView { labels: Some((&labels).into()), ..FusionView::new(camera, vec![0.0; 64]) };
        let short = FusionView { labels: Some((&labels[1..]).into()), ..view.clone() };
        let (view, short) = (std::slice::from_ref(&view), std::slice::from_ref(&short));
        let motions = [Rigid::IDENTITY; 2];
        let config = SurfaceConfig::default();
        let out = part_meshes(PerState::new(view, &[]), &motions, &config).unwrap();
        assert!(out.meshes.parts.len() == 2 && out.meshes.whole[State::START].is_empty());
        let coarse = SurfaceConfig { voxel: Some(0.1), ..config.clone() };
        let out = part_meshes(PerState::new(view, &[]), &motions, &coarse).unwrap();
        assert!(out.meshes.parts.iter().all(|p| p[State::START].is_empty()));
        let error = part_meshes(PerState::new(view, short), &motions, &config).unwrap_err();
        assert_eq!(error, SurfaceError::Size { state: State::END, view: 0 });
        let zero = SurfaceConfig { resolution: 0.0, ..config };
        assert_eq!(part_meshes(PerState::default(), &motions, &zero).unwrap_err(), SurfaceError::Setting("resolution"));
    }
}
