//! What depth says about a state: oriented surface points, and which places were seen to be empty.

use artgs_core::{Camera, DepthMap};
use glam::{DVec2, Mat3, Vec3};
use nalgebra::{Matrix3, SymmetricEigen};
use rayon::prelude::*;
use std::borrow::Cow;

/// Change of depth from pixel to pixel, in footprints of a pixel, of a surface seen at 80 degrees.
const STEEPEST: f32 = 5.7;

/// One depth map with the lookups that visibility tests need.
pub struct DepthView {
    /// Pose and intrinsics.
    pub camera: Camera,
    /// Planar depth, 0 where there is none.
    pub depth: DepthMap,
    rotation: Mat3,
    translation: Vec3,
    /// One per pixel, and one for points beside the image.
    around: Vec<Around>,
}

/// Depths seen in the 3x3 neighbourhood of a pixel, in counts of its depth map: where it is torn, a surface in front
/// and one behind.
#[derive(Clone, Copy, Debug)]
struct Around {
    /// Nothing is nearer than this; 0 where a pixel of the object has no depth, [`ENDLESS`] where nothing is seen.
    clear: u16,
    nearest: u16,
    front: u16,
    back: u16,
    farthest: u16,
}

/// Stands for a depth beyond all others.
const ENDLESS: u16 = u16::MAX;

impl DepthView {
    /// From depth and mask (`true` = object); pixels of the object without depth hide everything.
    pub fn new(camera: Camera, depth: DepthMap, mask: &[bool]) -> Self {
        let (w, h) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
        let counts = depth.counts();
        let mut around = Vec::with_capacity(w * h + 1);
        for y in 0..h {
            for x in 0..w {
                let rows = y.saturating_sub(1)..(y + 2).min(h);
                let columns = x.saturating_sub(1)..(x + 2).min(w);
                let pixels = rows.flat_map(|yy| columns.clone().map(move |xx| yy * w + xx));
                around.push(Around::of(pixels.map(|i| (counts[i], mask[i])), camera.intrinsics.fx as f32));
            }
        }
        around.push(Around::BESIDE);
        let m = camera.world_to_camera;
        Self { camera, depth, rotation: m.matrix().as_mat3(), translation: m.translation.as_vec3(), around }
    }

    /// Pixel index and view depth of a world point, if it falls into the image.
    pub fn locate(&self, point: Vec3) -> Option<(usize, f32)> {
        let p = self.rotation * point + self.translation;
        if p.z <= 0.0 {
            return None;
        }
        let k = &self.camera.intrinsics;
        let (u, v) = (k.fx as f32 * p.x / p.z + k.cx as f32, k.fy as f32 * p.y / p.z + k.cy as f32);
        let inside = u >= 0.0 && v >= 0.0 && u < k.width as f32 && v < k.height as f32;
        // Through i32: the machine has no instruction for the unsigned kind.
        inside.then(|| (v as i32 as usize * k.width as usize + u as i32 as usize, p.z))
    }

    /// Index of what is around a point, and its view depth in counts; without branches, so that many points go at once.
    #[inline(always)]
    fn pixel(&self, point: Vec3) -> (u32, f32) {
        let p = self.rotation * point + self.translation;
        let k = &self.camera.intrinsics;
        let (u, v) = (k.fx as f32 * p.x / p.z + k.cx as f32, k.fy as f32 * p.y / p.z + k.cy as f32);
        let inside = (p.z > 0.0) & (u >= 0.0) & (v >= 0.0) & (u < k.width as f32) & (v < k.height as f32);
        // Through i32: there is no instruction for the unsigned kind.
        let pixel = (v as i32).wrapping_mul(k.width as i32).wrapping_add(u as i32);
        // A depth of 0 is never before anything.
        if inside { (pixel as u32, p.z * self.depth.per_unit()) } else { (k.width * k.height, 0.0) }
    }
}

impl Around {
    /// Where nothing is known.
    const BESIDE: Self = Self { clear: 0, nearest: ENDLESS, front: 0, back: ENDLESS, farthest: 0 };

    /// Whether a point at depth `z` is looked through, to something behind or to nothing, and whether a surface is there.
    /// The whole neighbourhood must agree that it is looked through; between the two surfaces of a torn one nothing is
    /// known. Both are in counts.
    #[inline(always)]
    fn says(&self, z: f32, tolerance: f32) -> (bool, bool) {
        let within = |lo: u16, hi: u16| (z >= f32::from(lo) - tolerance) & (z <= f32::from(hi) + tolerance);
        let clear = if self.clear == ENDLESS { f32::INFINITY } else { f32::from(self.clear) };
        let through = z < clear - tolerance;
        (through, !through & (within(self.nearest, self.front) | within(self.back, self.farthest)))
    }

    fn of(pixels: impl Iterator<Item = (u16, bool)> + Clone, focal: f32) -> Self {
        let seen = pixels.clone().map(|p| p.0.min(ENDLESS - 1)).filter(|d| *d > 0);
        let (lo, hi) = seen.clone().fold((ENDLESS, 0), |(lo, hi), d| (lo.min(d), hi.max(d)));
        // Across two diagonal steps a surface seen at 80 degrees changes by this much.
        let reach = 2.0 * std::f32::consts::SQRT_2 * STEEPEST * f32::from(lo) / focal;
        let near = |a: u16, b: u16| f32::from(a.abs_diff(b)) <= reach;
        let front = seen.clone().filter(|d| near(*d, lo)).max().unwrap_or(0);
        let back = seen.filter(|d| near(*d, hi)).min().unwrap_or(ENDLESS);
        let blind = pixels.clone().any(|(d, object)| object && d == 0);
        Self { clear: if blind { 0 } else { lo }, nearest: lo, front, back, farthest: hi }
    }
}

/// Points whose sights are collected together.
pub const SIGHTED_TOGETHER: usize = 512;

/// How many views look through a point and how many see a surface there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sightings {
    /// Views that look through.
    pub through: u32,
    /// Views that see a surface.
    pub surface: u32,
}

impl Sightings {
    /// Collects the sight of all views for each of a few points. Those next to each other in the list should be so in
    /// space: view after view, their pixels then come from near caches.
    pub fn of_each(views: &[DepthView], points: &[Vec3], tolerance: f32, out: &mut [Self]) {
        out.fill(Self::default());
        let mut pixels = [(0, 0.0); SIGHTED_TOGETHER];
        for view in views {
            let tolerance = tolerance * view.depth.per_unit();
            for (points, out) in points.chunks(SIGHTED_TOGETHER).zip(out.chunks_mut(SIGHTED_TOGETHER)) {
                points.iter().zip(&mut pixels).for_each(|(point, pixel)| *pixel = view.pixel(*point));
                for ((pixel, z), out) in pixels.iter().zip(out) {
                    let (through, surface) = view.around[*pixel as usize].says(*z, tolerance);
                    out.through += u32::from(through);
                    out.surface += u32::from(surface);
                }
            }
        }
    }

    /// The same for any number of points, in parallel.
    pub fn of_all(views: &[DepthView], points: &[Vec3], tolerance: f32) -> Vec<Self> {
        let mut out = vec![Self::default(); points.len()];
        out.par_chunks_mut(SIGHTED_TOGETHER)
            .zip(points.par_chunks(SIGHTED_TOGETHER))
            .for_each(|(out, points)| Self::of_each(views, points, tolerance, out));
        out
    }

    /// Seen to be empty: at least two views look through, and clearly more than see a surface.
    pub fn is_empty_space(&self) -> bool {
        self.through >= 2 && self.through > 2 * self.surface
    }

    /// Seen to be occupied.
    pub fn is_surface(&self) -> bool {
        self.surface >= 1 && self.surface >= self.through
    }
}

/// Oriented, coloured surface points.
#[derive(Clone, Debug, Default)]
pub struct Cloud {
    /// Positions, world frame of the state.
    pub points: Vec<Vec3>,
    /// Unit normals towards the cameras.
    pub normals: Vec<Vec3>,
    /// sRGB in [0, 1].
    pub colors: Vec<Vec3>,
    /// Root mean square distance of the neighbourhood from its plane, scene units.
    pub roughness: Vec<f32>,
}

impl Cloud {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    fn push(&mut self, point: Vec3, normal: Vec3, color: Vec3, roughness: f32) {
        self.points.push(point);
        self.normals.push(normal);
        self.colors.push(color);
        self.roughness.push(roughness);
    }

    /// Concatenates another cloud.
    pub fn append(&mut self, other: &Self) {
        self.points.extend(&other.points);
        self.normals.extend(&other.normals);
        self.colors.extend(&other.colors);
        self.roughness.extend(&other.roughness);
    }

    /// The points `indices`, in that order.
    pub fn select(&self, indices: &[usize]) -> Self {
        let mut out = Self::default();
        for &i in indices {
            out.push(self.points[i], self.normals[i], self.colors[i], self.roughness[i]);
        }
        out
    }

    /// Keeps, of every occupied cube of edge `voxel` and main direction, the point with the smoothest neighbourhood.
    /// Two sides of a thin plate are kept apart by the main axis of their normals. Sorted by cube.
    pub fn thinned(&self, voxel: f32) -> Self {
        let key = |i: usize| {
            let (c, n) = ((self.points[i] / voxel).floor().as_ivec3(), self.normals[i]);
            let axis = n.abs().max_position();
            (c.to_array(), 2 * axis as u8 + u8::from(n[axis] < 0.0))
        };
        let mut order: Vec<_> = (0..self.len()).map(|i| (key(i), i)).collect();
        order.par_sort_unstable();
        let mut keep = Vec::new();
        for run in order.chunk_by(|a, b| a.0 == b.0) {
            let best = run.iter().min_by(|a, b| self.roughness[a.1].total_cmp(&self.roughness[b.1]));
            keep.extend(best.map(|b| b.1));
        }
        self.select(&keep)
    }
}

/// Surface points of one view by back-projection, with normals from a plane through the 5x5 neighbourhood.
/// `stride` skips pixels. Pixels whose neighbourhood is torn (fewer than 12 of 25 on the surface) are left out.
pub fn surface_points(view: &DepthView, rgba: &[[u8; 4]], stride: usize) -> Cloud {
    let k = view.camera.intrinsics;
    let (w, h) = (k.width as usize, k.height as usize);
    let eye = view.camera.position().as_vec3();
    let world =
        |x: usize, y: usize, d: f32| view.camera.unproject(DVec2::new(x as f64 + 0.5, y as f64 + 0.5), d.into());
    let depth: Vec<f32> = view.depth.iter().collect();
    let mut cloud = Cloud::default();
    let mut patch = Vec::with_capacity(25);
    for y in (2..h.saturating_sub(2)).step_by(stride) {
        for x in (2..w.saturating_sub(2)).step_by(stride) {
            let d = depth[y * w + x];
            if d <= 0.0 {
                continue;
            }
            let reach = 2.0 * STEEPEST * d / k.fx as f32;
            let centre = world(x, y, d);
            patch.clear();
            for yy in y - 2..=y + 2 {
                for xx in x - 2..=x + 2 {
                    let dd = depth[yy * w + xx];
                    if dd > 0.0 && (dd - d).abs() < reach {
                        patch.push((world(xx, yy, dd) - centre).as_vec3());
                    }
                }
            }
            if patch.len() < 12 {
                continue;
            }
            let (normal, roughness) = fit_plane(&patch);
            let p = centre.as_vec3();
            let normal = if normal.dot(eye - p) < 0.0 { -normal } else { normal };
            let c = rgba[y * w + x];
            let color = Vec3::new(c[0].into(), c[1].into(), c[2].into()) / 255.0;
            cloud.push(p, normal, color, roughness);
        }
    }
    cloud
}

/// Unit normal of the least-squares plane and the root mean square distance from it.
pub fn fit_plane(points: &[Vec3]) -> (Vec3, f32) {
    let mean = points.iter().sum::<Vec3>() / points.len() as f32;
    let mut c = Matrix3::<f64>::zeros();
    for p in points {
        let d = (*p - mean).as_dvec3();
        let v = nalgebra::Vector3::new(d.x, d.y, d.z);
        c += v * v.transpose();
    }
    let eigen = SymmetricEigen::new(c / points.len() as f64);
    let i = eigen.eigenvalues.imin();
    let v = eigen.eigenvectors.column(i);
    (Vec3::new(v[0] as f32, v[1] as f32, v[2] as f32), eigen.eigenvalues[i].max(0.0).sqrt() as f32)
}

/// All views of one state: depth maps and their thinned points.
pub struct Observation {
    /// Depth maps.
    pub views: Vec<DepthView>,
    /// Back-projected points, one per cube of the sampling distance.
    pub cloud: Cloud,
}

impl Observation {
    /// Back-projects all views and thins the points to one per `voxel`. `colors` are the pixels of a view.
    pub fn new<'c>(views: Vec<DepthView>, colors: impl Fn(usize) -> Cow<'c, [[u8; 4]]> + Sync, voxel: f32) -> Self {
        let points = |(i, view): (usize, &DepthView)| surface_points(view, &colors(i), 1).thinned(voxel);
        let clouds: Vec<Cloud> = views.par_iter().enumerate().map(points).collect();
        let mut cloud = Cloud::default();
        clouds.iter().for_each(|c| cloud.append(c));
        Self { views, cloud: cloud.thinned(voxel) }
    }

    /// Median size of a pixel on the object, scene units.
    pub fn pixel_size(views: &[DepthView]) -> f32 {
        let mut sizes: Vec<f32> = views
            .iter()
            .flat_map(|v| {
                let fx = v.camera.intrinsics.fx as f32;
                v.depth.iter().step_by(37).filter(|d| *d > 0.0).map(move |d| d / fx)
            })
            .collect();
        sizes.sort_unstable_by(f32::total_cmp);
        sizes.get(sizes.len() / 2).copied().unwrap_or(0.0)
    }

    /// Typical disagreement between views about the depth of the same point: the median over flat points of the
    /// distance along the normal between a point and the surface another view sees at its pixel.
    pub fn depth_noise(&self) -> f32 {
        let stride = (self.cloud.len() / 2000).max(1);
        let mut errors: Vec<f32> = (0..self.cloud.len())
            .step_by(stride)
            .flat_map(|i| {
                let (p, n) = (self.cloud.points[i], self.cloud.normals[i]);
                self.views.iter().filter_map(move |v| {
                    let (pixel, z) = v.locate(p)?;
                    let d = v.depth.at(pixel);
                    let towards = (v.camera.position().as_vec3() - p).normalize();
                    let cosine = towards.dot(n);
                    let footprint = z / v.camera.intrinsics.fx as f32;
                    (d > 0.0 && cosine > 0.5 && (d - z).abs() < 20.0 * footprint).then(|| (d - z).abs() * cosine)
                })
            })
            .collect();
        errors.sort_unstable_by(f32::total_cmp);
        errors.get(errors.len() / 2).copied().unwrap_or(0.0)
    }
}
