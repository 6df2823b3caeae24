//! Meshes of every part and of the whole object from labelled depth maps of both states.
//!
//! A part is fused once, in its canonical frame, from both states: what one state hides the other may show. Pixels of
//! other parts and of the background carve: space before them holds nothing of this part.

use super::{DepthView, PixelUse, Tsdf, TsdfParams, clean, marching_cubes, paint};
use artgs_core::{Camera, Mesh, Rigid};
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Label of pixels that show no part.
pub const BACKGROUND: u16 = u16::MAX;

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
    /// Components with fewer triangles than this fraction of the largest one's are dropped.
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
            keep_fraction: 0.02,
            carve_background: true,
            whole: WholeMesh::Union,
            memory_mib: 2048,
        }
    }
}

/// A reason why there are no meshes.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum SurfaceError {
    /// A buffer does not fit its image.
    #[error("state {state}, view {view}: depth, colours or labels do not have the size of the image")]
    Size {
        /// State, 0 or 1.
        state: usize,
        /// Position among the state's views.
        view: usize,
    },
    /// A setting that makes no volume.
    #[error("surface setting `{0}` must be positive and finite")]
    Setting(&'static str),
}

/// A depth map whose pixels know their part.
#[derive(Clone, Copy, Debug)]
pub struct LabelledDepth<'a> {
    /// Camera in the world frame.
    pub camera: Camera,
    /// Planar depth, scene units, `[height * width]`, 0 where there is none.
    pub depth: &'a [f32],
    /// Straight colours, `[height * width]`; none in any view leaves the meshes uncoloured.
    pub rgba: Option<&'a [[u8; 4]]>,
    /// Part of every pixel, `[height * width]`, [`BACKGROUND`] for none.
    pub labels: &'a [u16],
}

/// Meshes in world coordinates of both states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PartMeshes {
    /// Per part, start and end; empty where nothing of the part was seen.
    pub parts: Vec<[Mesh; 2]>,
    /// The whole object, start and end.
    pub whole: [Mesh; 2],
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

/// Fuses every part from both states' views. `half_motions[p]` moves part `p` from the canonical frame to state 1 and
/// its inverse to state 0; part 0 is the static one. Deterministic.
pub fn part_meshes(
    states: [&[LabelledDepth]; 2],
    half_motions: &[Rigid],
    config: &SurfaceConfig,
) -> Result<Surfaces, SurfaceError> {
    check(states, config)?;
    let voxel = config.voxel.unwrap_or_else(|| object_diagonal(states) / config.resolution);
    if voxel.is_nan() || voxel <= 0.0 {
        // No pixel shows any surface.
        let parts = vec![<[Mesh; 2]>::default(); half_motions.len()];
        let canonical = vec![Mesh::default(); half_motions.len()];
        return Ok(Surfaces { canonical, meshes: PartMeshes { parts, ..PartMeshes::default() }, voxel: 0.0 });
    }
    let params = TsdfParams {
        voxel,
        truncation: config.truncation_voxels * voxel,
        behind: config.behind_voxels * voxel,
        jump: config.jump_voxels * voxel,
    };
    let mut canonical = Vec::new();
    let mut parts = Vec::new();
    for (part, half) in half_motions.iter().enumerate() {
        let poses = [half.inverse(), *half];
        let mut uses = Vec::new();
        let mut cameras = Vec::new();
        for (state, views) in states.iter().enumerate() {
            let label = |l: u16| l as usize == part;
            uses.par_extend(views.par_iter().map(|v| pixel_uses(v, label, config)));
            cameras.extend(views.iter().map(|v| v.camera.moved_with(&poses[state])));
        }
        let views: Vec<DepthView> = states
            .iter()
            .flat_map(|s| s.iter())
            .zip(&uses)
            .zip(cameras)
            .map(|((v, u), camera)| DepthView { camera, depth: v.depth, uses: Some(u), rgba: v.rgba })
            .collect();
        let mesh = fuse(&views, params, config);
        parts.push(poses.map(|pose| mesh.moved(&pose)));
        canonical.push(mesh);
    }
    let whole = match config.whole {
        WholeMesh::Union => [0, 1].map(|state| union(parts.iter().map(|p: &[Mesh; 2]| &p[state]))),
        WholeMesh::Fused => states.map(|views| fuse_state(views, params, config)),
    };
    Ok(Surfaces { canonical, meshes: PartMeshes { parts, whole }, voxel })
}

/// Mesh of consistent views in one frame: volume, marching cubes, cleaning, colours. Empty if they show nothing.
pub fn fuse(views: &[DepthView], params: TsdfParams, config: &SurfaceConfig) -> Mesh {
    // A block holds 8^3 sums and weights.
    let max_blocks = (config.memory_mib << 20) / (512 * 8);
    let mut growth = 1.0;
    let volume = loop {
        let TsdfParams { voxel, truncation, behind, jump } = params;
        let coarser =
            TsdfParams { voxel: voxel * growth, truncation: truncation * growth, behind: behind * growth, jump };
        let mut volume = Tsdf::new(coarser);
        if volume.allocate(views, max_blocks.max(64)) || growth > 1e3 {
            volume.integrate(views);
            break volume;
        }
        growth *= 1.25;
    };
    let mut mesh = clean(&marching_cubes(&volume, config.min_weight), config.keep_fraction);
    paint(&mut mesh, views, volume.params().truncation);
    mesh
}

fn fuse_state(views: &[LabelledDepth], params: TsdfParams, config: &SurfaceConfig) -> Mesh {
    let uses: Vec<Vec<PixelUse>> = views.par_iter().map(|v| pixel_uses(v, |l| l != BACKGROUND, config)).collect();
    let views: Vec<DepthView> = views
        .iter()
        .zip(&uses)
        .map(|(v, u)| DepthView { camera: v.camera, depth: v.depth, uses: Some(u), rgba: v.rgba })
        .collect();
    fuse(&views, params, config)
}

fn union<'a>(parts: impl Iterator<Item = &'a Mesh>) -> Mesh {
    let mut whole = Mesh::default();
    parts.filter(|m| !m.is_empty()).for_each(|m| whole.append(m));
    whole
}

/// What each pixel says about the parts `wanted` accepts.
fn pixel_uses(view: &LabelledDepth, wanted: impl Fn(u16) -> bool, config: &SurfaceConfig) -> Vec<PixelUse> {
    view.labels
        .iter()
        .zip(view.depth)
        .map(|(label, depth)| match (*label, *depth > 0.0) {
            (BACKGROUND, _) if config.carve_background => PixelUse::FreeOnly,
            (BACKGROUND, _) | (_, false) => PixelUse::Ignore,
            (l, true) if wanted(l) => PixelUse::Surface,
            _ => PixelUse::FreeOnly,
        })
        .collect()
}

/// Diagonal of the box around all labelled samples of both states, 0 without any. The outermost thousandth of the
/// samples on each side is left out, so that stray pixels do not coarsen the mesh.
fn object_diagonal(states: [&[LabelledDepth]; 2]) -> f64 {
    const STRIDE: usize = 7;
    let points: Vec<DVec3> = states
        .iter()
        .flat_map(|s| s.iter())
        .flat_map(|view| {
            let k = view.camera.intrinsics;
            let from_camera = view.camera.world_to_camera.inverse();
            let pixels = (0..view.depth.len()).step_by(STRIDE);
            let shown =
                pixels.filter(|i| view.labels[*i] != BACKGROUND && view.depth[*i] > 0.0 && view.depth[*i].is_finite());
            shown.map(move |i| {
                let (x, y) = (i % k.width as usize, i / k.width as usize);
                let d = f64::from(view.depth[i]);
                let ray = DVec3::new((x as f64 + 0.5 - k.cx) / k.fx, (y as f64 + 0.5 - k.cy) / k.fy, 1.0);
                from_camera.apply(ray * d)
            })
        })
        .collect();
    if points.is_empty() {
        return 0.0;
    }
    let side = |axis: usize| {
        let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        let skip = values.len() / 1000;
        values[values.len() - 1 - skip] - values[skip]
    };
    DVec3::new(side(0), side(1), side(2)).length()
}

fn check(states: [&[LabelledDepth]; 2], config: &SurfaceConfig) -> Result<(), SurfaceError> {
    let positive = [
        ("voxel", config.voxel.unwrap_or(1.0)),
        ("resolution", config.resolution),
        ("truncation_voxels", config.truncation_voxels),
        ("behind_voxels", config.behind_voxels),
    ];
    if let Some((name, _)) = positive.iter().find(|(_, v)| !(*v > 0.0 && v.is_finite())) {
        return Err(SurfaceError::Setting(name));
    }
    for (state, views) in states.iter().enumerate() {
        for (view, v) in views.iter().enumerate() {
            let depth = DepthView { camera: v.camera, depth: v.depth, uses: None, rgba: v.rgba };
            if !depth.is_consistent() || v.labels.len() != v.depth.len() {
                return Err(SurfaceError::Size { state, view });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Scene, Shape, orbit};
    use super::*;

    /// A box with a sliding lid that half covers it at the start: the motion from start to end is `shift`.
    fn scenes(shift: DVec3) -> [Scene; 2] {
        let base = || (Shape::Box(DVec3::new(0.4, 0.3, 0.2)), Rigid::IDENTITY);
        let lid = |at: DVec3| (Shape::Box(DVec3::new(0.2, 0.3, 0.05)), Rigid::shift(at));
        let start = DVec3::new(-0.2, 0.0, 0.26);
        [Scene(vec![base(), lid(start)]), Scene(vec![base(), lid(start + shift)])]
    }

    fn fused(config: &SurfaceConfig) -> Surfaces {
        let shift = DVec3::new(0.4, 0.0, 0.2);
        let scenes = scenes(shift);
        let cameras = orbit(24, 160, 2.0);
        let maps: Vec<Vec<_>> = scenes.iter().map(|s| cameras.iter().map(|c| s.render(c)).collect()).collect();
        let white = vec![[250, 250, 250, 255]; 160 * 160];
        let views: Vec<Vec<LabelledDepth>> = maps
            .iter()
            .map(|state| {
                let view = |(c, m): (&Camera, &'_ (Vec<f32>, Vec<u16>))| (*c, m.0.clone(), m.1.clone());
                cameras.iter().zip(state).map(view).collect::<Vec<_>>()
            })
            .map(|state: Vec<(Camera, Vec<f32>, Vec<u16>)>| {
                state
                    .into_iter()
                    .map(|(camera, depth, labels)| LabelledDepth {
                        camera,
                        depth: depth.leak(),
                        rgba: Some(white.clone().leak()),
                        labels: labels.leak(),
                    })
                    .collect()
            })
            .collect();
        part_meshes([&views[0], &views[1]], &[Rigid::IDENTITY, Rigid::shift(shift * 0.5)], config).unwrap()
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
        let (base, base_extent) = misfit(&out.meshes.parts[0][0], DVec3::new(0.4, 0.3, 0.2), DVec3::ZERO);
        let half = DVec3::new(0.2, 0.3, 0.05);
        let (lid, lid_extent) = misfit(&out.meshes.parts[1][1], half, DVec3::new(0.2, 0.0, 0.46));
        // Edges and corners are cut by up to a voxel.
        assert!(base < 0.02 && lid < 0.02, "{base} {lid}");
        assert!((base_extent - DVec3::new(0.4, 0.3, 0.2)).abs().max_element() < 0.02, "{base_extent}");
        assert!((lid_extent - half).abs().max_element() < 0.02, "{lid_extent}");
        let (start, _) = misfit(&out.meshes.parts[1][0], half, DVec3::new(-0.2, 0.0, 0.26));
        assert!((start - lid).abs() < 1e-5, "the same mesh moved");
        // The lid's underside is hidden at the start and seen at the end.
        let lowest = out.meshes.parts[1][0].vertices.iter().filter(|v| (v[2] - 0.21).abs() < 5e-3).count();
        assert!(lowest > 200, "{lowest} vertices on the underside");
        assert!(out.meshes.parts[0][0].colors.iter().all(|c| *c == [250; 3]));
        let sum: usize = out.meshes.parts.iter().map(|p| p[0].triangles.len()).sum();
        assert_eq!(out.meshes.whole[0].triangles.len(), sum);
    }

    #[test]
    fn whole_from_one_state_is_a_single_fusion() {
        let config = SurfaceConfig { voxel: Some(0.03), whole: WholeMesh::Fused, ..SurfaceConfig::default() };
        let out = fused(&config);
        let top = |m: &Mesh| m.vertices.iter().map(|v| v[2]).fold(f32::MIN, f32::max);
        assert!((top(&out.meshes.whole[0]) - 0.31).abs() < 0.02 && (top(&out.meshes.whole[1]) - 0.51).abs() < 0.02);
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
        let (depth, labels) = (vec![0.0; 64], vec![BACKGROUND; 64]);
        let view = LabelledDepth { camera, depth: &depth, rgba: None, labels: &labels };
        let motions = [Rigid::IDENTITY; 2];
        let config = SurfaceConfig::default();
        let out = part_meshes([&[view], &[]], &motions, &config).unwrap();
        assert!(out.meshes.parts.len() == 2 && out.meshes.whole[0].is_empty());
        let out = part_meshes([&[view], &[]], &motions, &SurfaceConfig { voxel: Some(0.1), ..config.clone() }).unwrap();
        assert!(out.meshes.parts.iter().all(|p| p[0].is_empty()));
        let short = LabelledDepth { labels: &labels[1..], ..view };
        let error = part_meshes([&[view], &[short]], &motions, &config).unwrap_err();
        assert_eq!(error, SurfaceError::Size { state: 1, view: 0 });
        let zero = SurfaceConfig { resolution: 0.0, ..config };
        assert_eq!(part_meshes([&[], &[]], &motions, &zero).unwrap_err(), SurfaceError::Setting("resolution"));
    }
}
