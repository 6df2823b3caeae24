//! Brightness of the surface: sky light, sun light and shadows, computed once per state on a lattice over every triangle.
//! Surfaces are matt, so brightness does not depend on the camera.

use crate::trace::Surface;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Distance between lattice points, scene units.
const SPACING: f64 = 0.022;
/// Rays to the sky per lattice point.
const SKY_RAYS: usize = 64;
/// Rays to the sun per lattice point.
const SUN_RAYS: usize = 12;
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

/// Shades of one triangle on a fan from the corner opposite its shortest edge: `(along + 1) * (across + 1)` values, rows
/// outward from that corner. Long thin triangles, as in rods, need few.
#[derive(Clone, Debug)]
struct Fan {
    apex: usize,
    along: usize,
    across: usize,
    shades: Vec<[f32; 2]>,
}

/// Shades of all triangles.
#[derive(Clone, Debug)]
pub(crate) struct LightMap(Vec<Fan>);

impl LightMap {
    /// Computes the light on every triangle; `sun` is the direction to the sun.
    pub(crate) fn measure(surface: &Surface, sun: DVec3) -> Self {
        Self::with_spacing(surface, sun, SPACING)
    }

    /// As [`LightMap::measure`], with this distance between lattice points, scene units.
    pub(crate) fn with_spacing(surface: &Surface, sun: DVec3, spacing: f64) -> Self {
        let sky = sky_directions();
        let disc = sun_directions(sun);
        let fan = |triangle: usize| {
            let corners = surface.corners(triangle);
            let opposite = |k: usize| corners[(k + 1) % 3].distance(corners[(k + 2) % 3]);
            let apex = (0..3).fold(0, |best, k| if opposite(k) < opposite(best) { k } else { best });
            let [a, b, c] = [0, 1, 2].map(|k| corners[(apex + k) % 3]);
            let steps = |length: f64| ((length / spacing).ceil() as usize).clamp(1, 48);
            let (along, across) = (steps(a.distance(b).max(a.distance(c))), steps(b.distance(c)));
            let (normal, middle) = (surface.normal(triangle), (a + b + c) / 3.0);
            let points = (0..=along).flat_map(|i| (0..=across).map(move |j| (i, j)));
            let shade = |(i, j): (usize, usize)| {
                let p = a.lerp(b.lerp(c, j as f64 / across as f64), i as f64 / along as f64);
                // Off the edges, where two faces meet, and off the face itself.
                let p = p.lerp(middle, 0.01) + normal * 4e-4;
                let shade = shade(surface, p, normal, &sky, &disc);
                [shade.sky as f32, shade.sun as f32]
            };
            Fan { apex, along, across, shades: points.map(shade).collect() }
        };
        Self((0..surface.len()).into_par_iter().map(fan).collect())
    }

    /// Shade at the point of a triangle with weights `u` and `v` of its second and third corner.
    pub(crate) fn at(&self, triangle: usize, u: f64, v: f64) -> Shade {
        let Fan { apex, along, across, shades } = &self.0[triangle];
        let weights = [1.0 - u - v, u, v];
        let (second, third) = (weights[(apex + 1) % 3].max(0.0), weights[(apex + 2) % 3].max(0.0));
        let out = second + third;
        let x = out.min(1.0) * *along as f64;
        let y = if out > 0.0 { third / out } else { 0.0 } * *across as f64;
        let (i, j) = ((x as usize).min(along - 1), (y as usize).min(across - 1));
        let (fx, fy) = (x - i as f64, y - j as f64);
        let get = |i: usize, j: usize| shades[i * (across + 1) + j].map(f64::from);
        let (near, far) = ([get(i, j), get(i, j + 1)], [get(i + 1, j), get(i + 1, j + 1)]);
        let mix = |k: usize| {
            let row = |pair: [[f64; 2]; 2]| pair[0][k] + fy * (pair[1][k] - pair[0][k]);
            row(near) + fx * (row(far) - row(near))
        };
        Shade { sky: mix(0), sun: mix(1) }
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
fn sky_directions() -> Vec<DVec3> {
    let golden = (5_f64.sqrt() - 1.0) / 2.0;
    let at = |k: usize| {
        let squared = (k as f64 + 0.5) / SKY_RAYS as f64;
        let turn = TAU * (k as f64 * golden).fract();
        DVec3::new(squared.sqrt() * turn.cos(), squared.sqrt() * turn.sin(), (1.0 - squared).sqrt())
    };
    (0..SKY_RAYS).map(at).collect()
}

fn sun_directions(sun: DVec3) -> Vec<DVec3> {
    let (x, y) = sun.any_orthonormal_pair();
    let golden = (5_f64.sqrt() - 1.0) / 2.0;
    let at = |k: usize| {
        let radius = SUN_RADIUS * ((k as f64 + 0.5) / SUN_RAYS as f64).sqrt();
        let turn = TAU * (k as f64 * golden).fract();
        (sun + radius * (x * turn.cos() + y * turn.sin())).normalize()
    };
    (0..SUN_RAYS).map(at).collect()
}
