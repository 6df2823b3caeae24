//! Brightness of the surface: sky light, sun light and shadows, computed once per state on a lattice over every triangle that is seen.
//! Surfaces are matt, so brightness does not depend on the camera.

use crate::trace::Surface;
use glam::DVec3;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicU64, Ordering};

/// How finely light is computed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightQuality {
    /// Distance between lattice points, scene units.
    pub(crate) spacing: f64,
    /// Rays to the sky per lattice point.
    pub(crate) sky_rays: usize,
    /// Rays to the sun per lattice point.
    pub(crate) sun_rays: usize,
}

impl LightQuality {
    /// Of objects of diagonal 1.
    pub(crate) const FINE: Self = Self { spacing: 0.022, sky_rays: 64, sun_rays: 12 };
    /// A third of the rays, for many objects.
    pub(crate) const COARSE: Self = Self { spacing: 0.03, sky_rays: 24, sun_rays: 5 };
}

/// Angular radius of the sun, radians: the softness of shadows.
const SUN_RADIUS: f64 = 0.16;
/// Light along a ray that hits another surface, relative to a ray to the zenith: indirect light.
const BOUNCE: f64 = 0.42;

/// Brightness of a point of the surface, 1 = white in full light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Shade {
    /// From the sky and indirect, in [0, 1].
    pub(crate) sky: f64,
    /// From the sun: visible fraction times cosine, in [0, 1].
    pub(crate) sun: f64,
}

/// The lattice of one triangle, a fan from the corner opposite its shortest edge: `(along + 1) * (across + 1)` points, rows outward
/// from that corner. Long thin triangles, as in rods, need few.
#[derive(Clone, Debug)]
struct Fan {
    apex: usize,
    along: usize,
    across: usize,
    /// Index of its first point among all.
    first: usize,
}

/// Shades of all triangles. A point is computed when it is first asked for: most surfaces are inside of furniture, and never seen.
#[derive(Debug)]
pub(crate) struct LightMap {
    fans: Vec<Fan>,
    /// Two `f32` each: sky and sun.
    shades: Vec<AtomicU64>,
    sky: Vec<DVec3>,
    disc: Vec<DVec3>,
}

/// A shade that is not computed yet: two numbers that are none.
const UNKNOWN: u64 = u64::MAX;

impl LightMap {
    /// The light on a surface; `sun` is the direction to the sun.
    pub(crate) fn new(surface: &Surface, sun: DVec3, quality: LightQuality) -> Self {
        let mut first = 0;
        let fan = |triangle: usize| {
            let corners = surface.corners(triangle);
            let opposite = |k: usize| corners[(k + 1) % 3].distance(corners[(k + 2) % 3]);
            let apex = (0..3).fold(0, |best, k| if opposite(k) < opposite(best) { k } else { best });
            let [a, b, c] = [0, 1, 2].map(|k| corners[(apex + k) % 3]);
            let steps = |length: f64| ((length / quality.spacing).ceil() as usize).clamp(1, 48);
            let fan = Fan { apex, along: steps(a.distance(b).max(a.distance(c))), across: steps(b.distance(c)), first };
            first += (fan.along + 1) * (fan.across + 1);
            fan
        };
        let fans = (0..surface.len()).map(fan).collect();
        let shades = (0..first).map(|_| AtomicU64::new(UNKNOWN)).collect();
        Self { fans, shades, sky: sky_directions(quality.sky_rays), disc: sun_directions(sun, quality.sun_rays) }
    }

    /// Shade at the point of a triangle of the surface with weights `u` and `v` of its second and third corner.
    pub(crate) fn at(&self, surface: &Surface, triangle: usize, u: f64, v: f64) -> Shade {
        let Fan { apex, along, across, .. } = &self.fans[triangle];
        let weights = [1.0 - u - v, u, v];
        let (second, third) = (weights[(apex + 1) % 3].max(0.0), weights[(apex + 2) % 3].max(0.0));
        let out = second + third;
        let x = out.min(1.0) * *along as f64;
        let y = if out > 0.0 { third / out } else { 0.0 } * *across as f64;
        let (i, j) = ((x as usize).min(along - 1), (y as usize).min(across - 1));
        let (fx, fy) = (x - i as f64, y - j as f64);
        let get = |i: usize, j: usize| self.point(surface, triangle, i, j).map(f64::from);
        let (near, far) = ([get(i, j), get(i, j + 1)], [get(i + 1, j), get(i + 1, j + 1)]);
        let mix = |k: usize| {
            let row = |pair: [[f64; 2]; 2]| pair[0][k] + fy * (pair[1][k] - pair[0][k]);
            row(near) + fx * (row(far) - row(near))
        };
        Shade { sky: mix(0), sun: mix(1) }
    }

    /// Sky and sun at a point of the lattice. Threads that ask for it at once compute the same.
    fn point(&self, surface: &Surface, triangle: usize, i: usize, j: usize) -> [f32; 2] {
        let Fan { apex, along, across, first } = &self.fans[triangle];
        let place = &self.shades[first + i * (across + 1) + j];
        let known = place.load(Ordering::Relaxed);
        if known != UNKNOWN {
            return [f32::from_bits((known >> 32) as u32), f32::from_bits(known as u32)];
        }
        let corners = surface.corners(triangle);
        let [a, b, c] = [0, 1, 2].map(|k| corners[(apex + k) % 3]);
        let (normal, middle) = (surface.normal(triangle), (a + b + c) / 3.0);
        let p = a.lerp(b.lerp(c, j as f64 / *across as f64), i as f64 / *along as f64);
        // Off the edges, where two faces meet, and off the face itself.
        let p = p.lerp(middle, 0.01) + normal * 4e-4;
        let shade = shade(surface, p, normal, &self.sky, &self.disc);
        let [sky, sun] = [shade.sky as f32, shade.sun as f32];
        place.store(u64::from(sky.to_bits()) << 32 | u64::from(sun.to_bits()), Ordering::Relaxed);
        [sky, sun]
    }
}

fn shade(surface: &Surface, p: DVec3, normal: DVec3, sky: &[DVec3], disc: &[DVec3]) -> Shade {
    let (x, y) = normal.any_orthonormal_pair();
    let from_sky = |d: &DVec3| {
        let ray = x * d.x + y * d.y + normal * d.z;
        if surface.is_hidden(p, ray) { BOUNCE } else { 0.8 + 0.2 * ray.z }
    };
    let from_sun = |d: &&DVec3| d.dot(normal) > 0.0 && !surface.is_hidden(p, **d);
    let sun: f64 = disc.iter().filter(from_sun).map(|d| d.dot(normal)).sum();
    Shade { sky: sky.iter().map(from_sky).sum::<f64>() / sky.len() as f64, sun: sun / disc.len() as f64 }
}

/// Directions around z with a density proportional to the cosine of the angle to z.
fn sky_directions(rays: usize) -> Vec<DVec3> {
    let golden = (5_f64.sqrt() - 1.0) / 2.0;
    let at = |k: usize| {
        let squared = (k as f64 + 0.5) / rays as f64;
        let turn = TAU * (k as f64 * golden).fract();
        DVec3::new(squared.sqrt() * turn.cos(), squared.sqrt() * turn.sin(), (1.0 - squared).sqrt())
    };
    (0..rays).map(at).collect()
}

fn sun_directions(sun: DVec3, rays: usize) -> Vec<DVec3> {
    let (x, y) = sun.any_orthonormal_pair();
    let golden = (5_f64.sqrt() - 1.0) / 2.0;
    let at = |k: usize| {
        let radius = SUN_RADIUS * ((k as f64 + 0.5) / rays as f64).sqrt();
        let turn = TAU * (k as f64 * golden).fract();
        (sun + radius * (x * turn.cos() + y * turn.sin())).normalize()
    };
    (0..rays).map(at).collect()
}
