//! Where Gaussians start: at random in the region the cameras look at, or on the surface that depth images show.

use super::densify::logit;
use super::images::TrainImage;
use super::{FitError, region::Region};
use artgs_core::Splats;
use artgs_raster::low_level::SH_C0;
use glam::{DVec2, DVec3, Quat, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::{Matrix3, SymmetricEigen};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::num::NonZero;

/// Random start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RandomInit {
    /// Number of Gaussians.
    pub count: usize,
    /// Half side of the cube relative to half the longest side of the object's box; the published cube is
    /// [-1.3, 1.3]^3 for objects in [-1, 1]^3.
    pub margin: f64,
    /// Opacity in (0, 1).
    pub opacity: f32,
}

impl Default for RandomInit {
    fn default() -> Self {
        Self { count: 100_000, margin: 1.3, opacity: 0.1 }
    }
}

/// Start on back-projected depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DepthInit {
    /// Number of Gaussians aimed at (met within a tenth or so); sets the voxel size.
    pub count: usize,
    /// Opacity in (0, 1); published: 0.1.
    pub opacity: f32,
    /// Voxels seen by fewer pixels are taken for noise.
    pub min_pixels: usize,
    /// Standard deviation along the normal relative to that along the surface; 1, as published: round.
    pub flatten: f32,
    /// Standard deviation relative to the root mean square distance of the three nearest neighbours; published: 1.
    pub spread: f32,
}

impl Default for DepthInit {
    fn default() -> Self {
        Self { count: 30_000, opacity: 0.9, min_pixels: 2, flatten: 0.2, spread: 0.7 }
    }
}

/// Near-grey Gaussians, uniform in a cube around the object.
pub(crate) fn random_cube(
    region: &Region,
    config: &RandomInit,
    sh_degree: usize,
    rng: &mut Pcg64Mcg,
) -> Result<Splats, FitError> {
    let half = DVec3::splat(region.half_side() * config.margin);
    random_box(&Region { low: region.centre() - half, high: region.centre() + half }, config, sh_degree, rng)
}

/// Near-grey Gaussians, uniform in a box; the margin of `config` does not matter.
pub(crate) fn random_box(
    region: &Region,
    config: &RandomInit,
    sh_degree: usize,
    rng: &mut Pcg64Mcg,
) -> Result<Splats, FitError> {
    let (centre, half) = (region.centre(), 0.5 * (region.high - region.low));
    let mut point = || std::array::from_fn(|i| (centre[i] + half[i] * (2.0 * rng.random::<f64>() - 1.0)) as f32);
    let means: Vec<[f32; 3]> = (0..config.count).map(|_| point()).collect();
    let colors: Vec<[f32; 3]> =
        (0..config.count).map(|_| std::array::from_fn(|_| 0.5 + SH_C0 * rng.random::<f32>() / 255.0)).collect();
    let scales = neighbour_distances(&means, (half.max_element() * 1e-4) as f32)?;
    Ok(isotropic(means, &colors, &scales, config.opacity, sh_degree))
}

/// A point of the surface.
#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    position: [f32; 3],
    color: [f32; 3],
}

/// Gaussians on the back-projected depths of all images, averaged over voxels.
pub(crate) fn from_depth(images: &[TrainImage], config: &DepthInit, sh_degree: usize) -> Result<Splats, FitError> {
    let samples = back_project(images);
    if samples.is_empty() {
        return Err(FitError::NoDepth);
    }
    let points = downsample(&samples, config);
    let means: Vec<[f32; 3]> = points.iter().map(|p| p.position).collect();
    let colors: Vec<[f32; 3]> = points.iter().map(|p| p.color).collect();
    let distances = neighbour_distances(&means, 0.0)?;
    let mut sorted = distances.clone();
    sorted.sort_unstable_by(f32::total_cmp);
    let typical = sorted[sorted.len() / 2].max(f32::MIN_POSITIVE);
    let scales: Vec<f32> = distances.iter().map(|d| config.spread * d.clamp(0.1 * typical, 3.0 * typical)).collect();
    let mut splats = isotropic(means, &colors, &scales, config.opacity, sh_degree);
    if config.flatten != 1.0 {
        flatten(&mut splats, config.flatten)?;
    }
    Ok(splats)
}

/// World points and colours of the pixels that have depth and are wholly covered by the mask.
fn back_project(images: &[TrainImage]) -> Vec<Sample> {
    let one = |image: &TrainImage| {
        let mut out = Vec::new();
        for (i, z) in (0..image.area()).map(|i| (i, image.depth_at(i))).filter(|(_, z)| *z > 0.0) {
            let [r, g, b, a] = image.rgba[i];
            if a < 250 {
                continue;
            }
            let pixel = DVec2::new((i % image.width) as f64 + 0.5, (i / image.width) as f64 + 0.5);
            let position = image.camera.unproject(pixel, f64::from(z)).as_vec3().to_array();
            out.push(Sample { position, color: [r, g, b].map(|v| f32::from(v) / 255.0) });
        }
        out
    };
    images.par_iter().map(one).collect::<Vec<_>>().concat()
}

/// Voxel of a point: 21 bits per axis.
fn key(p: &[f32; 3], origin: &[f32; 3], voxel: f32) -> u64 {
    let cell = |i: usize| (((p[i] - origin[i]) / voxel) as u64).min((1 << 21) - 1);
    cell(0) << 42 | cell(1) << 21 | cell(2)
}

/// Mean point of every voxel, the voxel chosen to leave about `count` points.
fn downsample(samples: &[Sample], config: &DepthInit) -> Vec<Sample> {
    let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
    for (s, i) in samples.iter().flat_map(|s| (0..3).map(move |i| (s, i))) {
        low[i] = low[i].min(s.position[i]);
        high[i] = high[i].max(s.position[i]);
    }
    let side = (0..3).map(|i| high[i] - low[i]).fold(f32::MIN_POSITIVE, f32::max);
    let sorted_keys = |voxel: f32| {
        let mut keys: Vec<(u64, u32)> =
            samples.par_iter().enumerate().map(|(i, s)| (key(&s.position, &low, voxel), i as u32)).collect();
        keys.par_sort_unstable();
        keys
    };
    let groups =
        |keys: &[(u64, u32)]| keys.chunk_by(|a, b| a.0 == b.0).filter(|g| g.len() >= config.min_pixels).count().max(1);
    // Voxels on a surface go with the inverse square of their size.
    let mut voxel = side / (config.count.max(1) as f32).sqrt();
    let mut keys = sorted_keys(voxel);
    for _ in 0..4 {
        let ratio = groups(&keys) as f32 / config.count.max(1) as f32;
        if (0.93..1.07).contains(&ratio) {
            break;
        }
        voxel = (voxel * ratio.sqrt()).max(side * 1e-6);
        keys = sorted_keys(voxel);
    }
    let enough = |g: &&[(u64, u32)]| g.len() >= config.min_pixels;
    let mut points: Vec<Sample> = keys.chunk_by(|a, b| a.0 == b.0).filter(enough).map(|g| mean(samples, g)).collect();
    if points.is_empty() {
        points = keys.chunk_by(|a, b| a.0 == b.0).map(|g| mean(samples, g)).collect();
    }
    points
}

fn mean(samples: &[Sample], group: &[(u64, u32)]) -> Sample {
    let mut sum = [0.0_f64; 6];
    for &(_, i) in group {
        let s = &samples[i as usize];
        for (sum, v) in sum.iter_mut().zip(s.position.iter().chain(&s.color)) {
            *sum += f64::from(*v);
        }
    }
    let at = |i: usize| (sum[i] / group.len() as f64) as f32;
    Sample { position: [at(0), at(1), at(2)], color: [at(3), at(4), at(5)] }
}

fn tree(points: &[[f32; 3]]) -> Result<ImmutableKdTree<f32, 3>, FitError> {
    ImmutableKdTree::new_from_slice(points).map_err(|e| FitError::Neighbours(e.to_string()))
}

/// Indices and squared distances of the `count` nearest points, the point itself included.
fn nearest(tree: &ImmutableKdTree<f32, 3>, point: &[f32; 3], count: usize) -> Vec<(usize, f32)> {
    let count = NonZero::new(count).unwrap_or(NonZero::<usize>::MIN);
    let hits = tree.query(point).nearest_n::<SquaredEuclidean<f32>>(count).execute();
    hits.into_iter().map(|hit| (hit.item as usize, hit.distance)).collect()
}

/// Root mean square distance of every point to its three nearest neighbours, at least `floor`.
fn neighbour_distances(points: &[[f32; 3]], floor: f32) -> Result<Vec<f32>, FitError> {
    if points.len() < 2 {
        return Err(FitError::Empty);
    }
    let tree = tree(points)?;
    let distance = |p: &[f32; 3]| {
        let hits = nearest(&tree, p, 4);
        let others = (hits.len() - 1).max(1) as f32;
        (hits.iter().map(|h| h.1).sum::<f32>() / others).sqrt().max(floor).max(f32::MIN_POSITIVE.sqrt())
    };
    Ok(points.par_iter().with_min_len(256).map(distance).collect())
}

fn isotropic(means: Vec<[f32; 3]>, colors: &[[f32; 3]], scales: &[f32], opacity: f32, sh_degree: usize) -> Splats {
    let n = means.len();
    let mut splats = Splats {
        means,
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
        log_scales: scales.iter().map(|s| [s.ln(); 3]).collect(),
        logit_opacities: vec![logit(opacity); n],
        ..Splats::empty(sh_degree)
    };
    let stride = splats.sh_stride();
    splats.sh = vec![0.0; n * stride];
    for (sh, color) in splats.sh.chunks_exact_mut(stride).zip(colors) {
        for c in 0..3 {
            sh[c] = (color[c] - 0.5) / SH_C0;
        }
    }
    splats
}

/// Turns each Gaussian's third axis to the normal of its neighbourhood and thins it by `ratio`.
fn flatten(splats: &mut Splats, ratio: f32) -> Result<(), FitError> {
    let tree = tree(&splats.means)?;
    let means = &splats.means;
    let turn = |p: &[f32; 3]| {
        let hits = nearest(&tree, p, 13);
        let points: Vec<Vec3> = hits.iter().map(|h| Vec3::from_array(means[h.0])).collect();
        let normal = plane_normal(&points);
        let q = Quat::from_rotation_arc(Vec3::Z, normal);
        [q.w, q.x, q.y, q.z]
    };
    splats.rotations = means.par_iter().with_min_len(256).map(turn).collect();
    splats.log_scales.iter_mut().for_each(|s| s[2] += ratio.ln());
    Ok(())
}

/// Direction in which points spread least, of unit length.
fn plane_normal(points: &[Vec3]) -> Vec3 {
    let centre = points.iter().sum::<Vec3>() / points.len() as f32;
    let mut m = Matrix3::<f64>::zeros();
    for p in points {
        let d = (*p - centre).as_dvec3();
        let v = nalgebra::Vector3::new(d.x, d.y, d.z);
        m += v * v.transpose();
    }
    let eigen = SymmetricEigen::new(m);
    let v = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    Vec3::new(v[0] as f32, v[1] as f32, v[2] as f32).normalize_or(Vec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::images::DepthPick;
    use artgs_core::{Camera, DepthMap, Intrinsics, State, View};
    use glam::DVec3;
    use rand::SeedableRng;

    /// A red plane z = 1 seen from above by two cameras.
    fn views() -> [View; 2] {
        let k = Intrinsics { fx: 60.0, fy: 60.0, cx: 32.0, cy: 32.0, width: 64, height: 64 };
        let view = |x: f64| {
            let camera = Camera::look_at(k, DVec3::new(x, 0.3, 5.0), DVec3::new(0.0, 0.0, 1.0), DVec3::Y);
            let eye = camera.position();
            let depth: Vec<f32> = (0..64 * 64)
                .map(|i| {
                    let pixel = DVec2::new(f64::from(i % 64) + 0.5, f64::from(i / 64) + 0.5);
                    let ray = camera.unproject(pixel, 1.0) - eye;
                    ((1.0 - eye.z) / ray.z) as f32
                })
                .collect();
            View {
                name: String::new(),
                camera,
                rgba: vec![[255, 0, 51, 255]; 64 * 64],
                depth: Some(DepthMap::nearest(&depth)),
                derived: None,
            }
        };
        [-1.0, 1.0].map(view)
    }

    fn images(views: &[View]) -> Vec<TrainImage<'_>> {
        views.iter().map(|view| TrainImage::new(view, State::START, 1, DepthPick::Median)).collect()
    }

    #[test]
    fn depth_puts_flat_coloured_gaussians_on_the_surface() {
        let config = DepthInit { count: 400, ..DepthInit::default() };
        let splats = from_depth(&images(&views()), &config, 1).unwrap();
        assert!((300..500).contains(&splats.len()), "{}", splats.len());
        let mut upright = 0;
        for i in 0..splats.len() {
            assert!((splats.means[i][2] - 1.0).abs() < 1e-4);
            let [w, x, y, z] = splats.rotations[i];
            let normal = Quat::from_xyzw(x, y, z, w) * Vec3::Z;
            upright += usize::from(normal.z.abs() > 0.999);
            assert!((splats.log_scales[i][2] - splats.log_scales[i][0] - 0.2_f32.ln()).abs() < 1e-5);
            let color = |c: usize| 0.5 + SH_C0 * splats.sh[i * 12 + c];
            assert!((color(0) - 1.0).abs() < 1e-5 && color(1).abs() < 1e-5 && (color(2) - 0.2).abs() < 1e-5);
        }
        assert_eq!(upright, splats.len());
    }

    #[test]
    fn the_random_cube_follows_the_region() {
        let region = Region { low: DVec3::new(10.0, 20.0, 30.0), high: DVec3::new(14.0, 22.0, 31.0) };
        let config = RandomInit { count: 3000, ..RandomInit::default() };
        let splats = random_cube(&region, &config, 0, &mut Pcg64Mcg::seed_from_u64(3)).unwrap();
        let bounds = |axis: usize| {
            let values = splats.means.iter().map(|m| m[axis]);
            (values.clone().fold(f32::MAX, f32::min), values.fold(f32::MIN, f32::max))
        };
        let (low, high) = bounds(1);
        assert!((low - (21.0 - 2.6)).abs() < 0.02 && (high - (21.0 + 2.6)).abs() < 0.02, "{low} {high}");
        // Uniform points of density d have their third neighbour near (9 / (4 pi d))^(1/3).
        let third = (9.0 / (4.0 * std::f64::consts::PI * 3000.0 / 5.2_f64.powi(3))).cbrt() as f32;
        let scale = splats.log_scales.iter().map(|s| s[0].exp()).sum::<f32>() / 3000.0;
        assert!((0.6..1.2).contains(&(scale / third)), "{scale} {third}");
    }
}
