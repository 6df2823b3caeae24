//! How bright each point of the surface is: a soft sky, a soft sun, and shade between, measured once per state on a
//! lattice over every triangle. Surfaces are matt, so that brightness does not depend on where the camera stands.

use crate::trace::Surface;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Distance between lattice points, scene units.
const SPACING: f64 = 0.022;
/// Rays to the sky per lattice point.
const SKY_RAYS: usize = 96;
/// Rays to the sun per lattice point.
const SUN_RAYS: usize = 16;
/// Angle of the sun's disc from its middle to its edge, radians: how soft shadows are.
const SUN_RADIUS: f64 = 0.16;
/// What a ray that another surface stops still brings, against one to the sky overhead: light bounces.
const BOUNCE: f64 = 0.42;

/// Brightness of a point of the surface, 1 = a white card in full light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Shade {
    /// From the sky and by bouncing, in [0, 1].
    pub(crate) sky: f64,
    /// From the sun: visible fraction times cosine, in [0, 1].
    pub(crate) sun: f64,
}

/// A lattice of shades on one triangle: points at `(i, j) / steps` along its two edges.
#[derive(Clone, Debug)]
struct Lattice {
    steps: usize,
    shades: Vec<[f32; 2]>,
}

/// Shades of all triangles.
#[derive(Clone, Debug)]
pub(crate) struct LightMap(Vec<Lattice>);

impl LightMap {
    /// Measures the light on every triangle; `sun` is the direction to the sun.
    pub(crate) fn measure(surface: &Surface, sun: DVec3) -> Self {
        let sky = sky_directions();
        let disc = sun_directions(sun);
        let lattice = |triangle: usize| {
            let [a, b, c] = surface.corners(triangle);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let steps = ((longest / SPACING).ceil() as usize).clamp(1, 48);
            let (normal, middle) = (surface.normal(triangle), (a + b + c) / 3.0);
            let lattice = (0..=steps).flat_map(|i| (0..=steps - i).map(move |j| (i, j)));
            let shade = |(i, j): (usize, usize)| {
                let p = a + (b - a) * (i as f64 / steps as f64) + (c - a) * (j as f64 / steps as f64);
                // Off the edges, where two faces meet, and off the face itself.
                let p = p.lerp(middle, 0.01) + normal * 4e-4;
                let shade = shade(surface, p, normal, &sky, &disc);
                [shade.sky as f32, shade.sun as f32]
            };
            Lattice { steps, shades: lattice.map(shade).collect() }
        };
        Self((0..surface.len()).into_par_iter().map(lattice).collect())
    }

    /// Shade at the point of a triangle with weights `u` and `v` of its second and third corner.
    pub(crate) fn at(&self, triangle: usize, u: f64, v: f64) -> Shade {
        let Lattice { steps, shades } = &self.0[triangle];
        let n = *steps;
        let (x, y) = (u.clamp(0.0, 1.0) * n as f64, v.clamp(0.0, 1.0) * n as f64);
        let (i, j) = ((x as usize).min(n - 1), (y as usize).min(n - 1));
        let (fx, fy) = (x - i as f64, y - j as f64);
        let get = |i: usize, j: usize| {
            let i = i.min(n);
            let j = j.min(n - i);
            // Rows of n + 1, n, n - 1, ... points.
            shades[i * (n + 1) - i * i.saturating_sub(1) / 2 + j].map(f64::from)
        };
        let mix = |p: [f64; 2], q: [f64; 2], r: [f64; 2], s: f64, t: f64| Shade {
            sky: p[0] + s * (q[0] - p[0]) + t * (r[0] - p[0]),
            sun: p[1] + s * (q[1] - p[1]) + t * (r[1] - p[1]),
        };
        if fx + fy <= 1.0 || i + j + 2 > n {
            mix(get(i, j), get(i + 1, j), get(i, j + 1), fx, fy)
        } else {
            mix(get(i + 1, j + 1), get(i, j + 1), get(i + 1, j), 1.0 - fx, 1.0 - fy)
        }
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

/// Directions around z, as dense as the cosine to it.
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
