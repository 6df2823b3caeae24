//! Which places the depth maps of a state show as a surface, as empty, or not at all.

use artgs_core::{Camera, DepthMap};
use glam::{Mat3, Vec3};
use rayon::prelude::*;

/// Change of depth from pixel to pixel, in footprints of a pixel, of a surface seen at 80 degrees. Larger steps are
/// taken for two surfaces, one behind the other.
pub(super) const STEEPEST: f32 = 5.7;

/// One depth map with the lookups that visibility tests need.
pub(crate) struct DepthLookup {
    /// Pose and intrinsics.
    pub(crate) camera: Camera,
    /// Planar depth, 0 where there is none.
    pub(crate) depth: DepthMap,
    /// Pixels of the object, or of what may be it; nothing is known behind those without depth.
    object: Vec<bool>,
    rotation: Mat3,
    translation: Vec3,
    /// One per pixel, and one for points outside the image.
    neighbourhoods: Vec<Neighbourhood>,
}

/// Depths in the 3x3 neighbourhood of a pixel, in counts of its depth map. Across an edge there are two surfaces, one in
/// front of the other.
#[derive(Clone, Copy, Debug)]
struct Neighbourhood {
    /// Nothing is nearer than this; 0 where a pixel of the object has no depth, [`INFINITE`] where nothing is seen.
    clear: u16,
    front_min: u16,
    front_max: u16,
    back_min: u16,
    back_max: u16,
}

/// Stands for a depth beyond all others.
const INFINITE: u16 = u16::MAX;

impl DepthLookup {
    /// From depth and mask (`true` = object); nothing is known behind pixels of the object without depth.
    pub(super) fn new(camera: Camera, depth: DepthMap, mask: &[bool]) -> Self {
        let (w, h) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
        let counts = depth.counts();
        let mut neighbourhoods = Vec::with_capacity(w * h + 1);
        for y in 0..h {
            for x in 0..w {
                let columns = x.saturating_sub(1)..(x + 2).min(w);
                let (mut depths, mut count, mut without_depth) = ([0; 9], 0, false);
                for row in y.saturating_sub(1)..(y + 2).min(h) {
                    let pixels = row * w + columns.start..row * w + columns.end;
                    for (&depth, &object) in counts[pixels.clone()].iter().zip(&mask[pixels]) {
                        depths[count] = depth.min(INFINITE - 1);
                        count += usize::from(depth > 0);
                        without_depth |= object && depth == 0;
                    }
                }
                // `count` is at most 9: the slot after the last is written only if another pixel follows.
                neighbourhoods.push(Neighbourhood::of(&depths[..count], without_depth, camera.intrinsics.fx as f32));
            }
        }
        neighbourhoods.push(Neighbourhood::OUTSIDE);
        let m = camera.world_to_camera;
        let (rotation, translation) = (m.matrix().as_mat3(), m.translation.as_vec3());
        Self { camera, depth, object: mask.to_vec(), rotation, translation, neighbourhoods }
    }

    /// Rotation and translation from the world to the camera.
    pub(crate) fn pose(&self) -> (Mat3, Vec3) {
        (self.rotation, self.translation)
    }

    /// True if a pixel of the object has no depth.
    pub(crate) fn is_unknown(&self, pixel: usize) -> bool {
        self.object[pixel] && self.depth.at(pixel) == 0.0
    }

    /// Pixel index and view depth of a world point, if it falls into the image.
    pub(crate) fn locate(&self, point: Vec3) -> Option<(usize, f32)> {
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

    /// Index of the neighbourhood of a point, and its view depth in counts; without branches, so that many points are
    /// computed at once.
    #[inline(always)]
    fn pixel(&self, point: Vec3) -> (u32, f32) {
        let p = self.rotation * point + self.translation;
        let k = &self.camera.intrinsics;
        let (u, v) = (k.fx as f32 * p.x / p.z + k.cx as f32, k.fy as f32 * p.y / p.z + k.cy as f32);
        let inside = (p.z > 0.0) & (u >= 0.0) & (v >= 0.0) & (u < k.width as f32) & (v < k.height as f32);
        // Through i32: there is no instruction for the unsigned kind.
        let pixel = (v as i32).wrapping_mul(k.width as i32).wrapping_add(u as i32);
        // A depth of 0 is never in front of anything.
        if inside { (pixel as u32, p.z * self.depth.per_unit()) } else { (k.width * k.height, 0.0) }
    }
}

impl Neighbourhood {
    /// Where nothing is known.
    const OUTSIDE: Self = Self { clear: 0, front_min: INFINITE, front_max: 0, back_min: INFINITE, back_max: 0 };

    /// Whether the view looks through a point at depth `z`, to something behind or to nothing, and whether it sees a
    /// surface there. It looks through only if the whole neighbourhood does; between the two surfaces of an edge nothing
    /// is known. Both arguments are in counts.
    #[inline(always)]
    fn vote(&self, z: f32, tolerance: f32) -> (bool, bool) {
        let within = |lo: u16, hi: u16| (z >= f32::from(lo) - tolerance) & (z <= f32::from(hi) + tolerance);
        let clear = if self.clear == INFINITE { f32::INFINITY } else { f32::from(self.clear) };
        let through = z < clear - tolerance;
        (through, !through & (within(self.front_min, self.front_max) | within(self.back_min, self.back_max)))
    }

    /// From the depths of pixels, those of 0 left out, and whether a pixel of the object has none.
    fn of(depths: &[u16], without_depth: bool, focal: f32) -> Self {
        let clear = |lo: u16| if without_depth { 0 } else { lo };
        let (lo, hi) = depths.iter().fold((INFINITE, 0), |(lo, hi), d| (lo.min(*d), hi.max(*d)));
        if lo >= hi {
            // Nothing, or one depth.
            return Self { clear: clear(lo), front_min: lo, front_max: hi, back_min: lo, back_max: hi };
        }
        // Across two diagonal steps a surface seen at 80 degrees changes by this much.
        let reach = 2.0 * std::f32::consts::SQRT_2 * STEEPEST * f32::from(lo) / focal;
        let near = |a: u16, b: u16| f32::from(a.abs_diff(b)) <= reach;
        let front_max = depths.iter().copied().filter(|d| near(*d, lo)).max().unwrap_or(0);
        let back_min = depths.iter().copied().filter(|d| near(*d, hi)).min().unwrap_or(INFINITE);
        Self { clear: clear(lo), front_min: lo, front_max, back_min, back_max: hi }
    }
}

/// Points whose votes are collected together.
pub(super) const CHUNK: usize = 512;

/// How many views look through a point and how many see a surface there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ViewVotes {
    /// Views that look through.
    pub(crate) through: u32,
    /// Views that see a surface.
    pub(crate) surface: u32,
}

impl ViewVotes {
    /// Collects the votes of all views for each of a few points. Those next to each other in the list should be so in
    /// space: view after view, their pixels are then in the cache.
    pub(super) fn of_each<'v>(
        views: impl IntoIterator<Item = &'v DepthLookup>,
        points: &[Vec3],
        tolerance: f32,
        out: &mut [Self],
    ) {
        out.fill(Self::default());
        let mut pixels = [(0, 0.0); CHUNK];
        for view in views {
            let tolerance = tolerance * view.depth.per_unit();
            for (points, out) in points.chunks(CHUNK).zip(out.chunks_mut(CHUNK)) {
                points.iter().zip(&mut pixels).for_each(|(point, pixel)| *pixel = view.pixel(*point));
                for ((pixel, z), out) in pixels.iter().zip(out) {
                    let (through, surface) = view.neighbourhoods[*pixel as usize].vote(*z, tolerance);
                    out.through += u32::from(through);
                    out.surface += u32::from(surface);
                }
            }
        }
    }

    /// The same for any number of points, in parallel.
    pub(crate) fn of_all(views: &[DepthLookup], points: &[Vec3], tolerance: f32) -> Vec<Self> {
        let mut out = vec![Self::default(); points.len()];
        out.par_chunks_mut(CHUNK)
            .zip(points.par_chunks(CHUNK))
            .for_each(|(out, points)| Self::of_each(views, points, tolerance, out));
        out
    }

    /// Shown as empty: at least two views look through, and clearly more than see a surface.
    pub(crate) fn is_empty_space(&self) -> bool {
        self.through >= 2 && self.through > 2 * self.surface
    }

    /// Shown as occupied.
    pub(crate) fn is_surface(&self) -> bool {
        self.surface >= 1 && self.surface >= self.through
    }

    /// The verdict of all views.
    pub(crate) fn occupancy(self) -> Occupancy {
        match (self.is_empty_space(), self.is_surface()) {
            (true, _) => Occupancy::Empty,
            (_, true) => Occupancy::Surface,
            _ => Occupancy::Unseen,
        }
    }
}

/// What a state shows at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Occupancy {
    /// Its views look through the place. A point of another state that is there has moved.
    Empty,
    /// Its views do not show the place.
    Unseen,
    /// Its views show a surface there.
    Surface,
}
