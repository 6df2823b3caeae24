//! The surface that is decomposed: distances, rays and samples.

use crate::geometry::convert::to_parry;
use crate::geometry::topology::{bounds, corners, cross};
use crate::geometry::weld::welded;
use crate::settings::FloorSettings;
use artgs_core::{Inside, Mesh};
use glam::DVec3;
use parry3d::query::{PointQuery as _, Ray, RayCast as _};
use parry3d::shape::{TriMesh, TriMeshFlags};
use std::sync::OnceLock;

/// A surface with its inside.
pub(crate) struct Solid {
    /// The surface without doubled vertices.
    pub(crate) mesh: Mesh,
    /// Whether each triangle needs pieces: because it was observed, or see [`Self::need_floors`].
    pub(crate) seen: Vec<bool>,
    shape: TriMesh,
    /// Diagonal of the box around it.
    size: f64,
    /// Least distance of the rays that decide what is inside.
    finest: f64,
    inside: OnceLock<Option<Inside>>,
}

/// A point on a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub(crate) point: DVec3,
    /// Unit normal.
    pub(crate) normal: DVec3,
    /// Whether its triangle needs a piece.
    pub(crate) seen: bool,
}

/// True for a place that faces up (+Z), at an angle of at least this cosine, with free room above it.
fn is_floor(shape: &TriMesh, p: DVec3, normal: DVec3, level: f64, room: f64) -> bool {
    /// Start above the place, as a share of the room: the place itself is not in the way.
    const ABOVE: f64 = 0.02;
    normal.z > level * normal.length() && {
        let ray = Ray::new(to_parry(p + DVec3::Z * (ABOVE * room)), to_parry(DVec3::Z));
        !shape.intersects_local_ray(&ray, ((1.0 - ABOVE) * room) as f32)
    }
}

fn middle(mesh: &Mesh, t: [u32; 3]) -> DVec3 {
    corners(mesh, t).iter().sum::<DVec3>() / 3.0
}

impl Solid {
    /// None if the mesh has no surface. What was observed needs pieces.
    pub(crate) fn new(mesh: &Mesh, observed: &super::Observed) -> Option<Self> {
        /// Least distance of the rays that decide what is inside, as a share of the size.
        const FINEST: f64 = 1e-3;
        /// Vertices that rounding separates are one, as a share of the size.
        const SAME: f64 = 1e-6;
        let [low, high] = bounds(mesh)?;
        let size = (high - low).length();
        if !(size > 0.0 && size.is_finite()) {
            return None;
        }
        let mesh = welded(&Mesh { colors: Vec::new(), ..mesh.clone() }, SAME * size);
        let vertices = mesh.vertices.iter().map(|v| to_parry(DVec3::from_array(v.map(f64::from)))).collect();
        let shape = TriMesh::with_flags(vertices, mesh.triangles.clone(), TriMeshFlags::ORIENTED).ok()?;
        let seen = mesh.triangles.iter().map(|t| observed(middle(&mesh, *t))).collect();
        Some(Self { mesh, seen, shape, size, finest: FINEST * size, inside: OnceLock::new() })
    }

    /// Floors on which things can lie need pieces from then on, also where they were not observed.
    pub(crate) fn need_floors(&mut self, settings: &FloorSettings) {
        let Self { mesh, shape, size, .. } = self;
        let is_floor =
            |t: &[u32; 3]| is_floor(shape, middle(mesh, *t), cross(mesh, *t), settings.level, settings.room * *size);
        let triangles = mesh.triangles.iter();
        self.seen.iter_mut().zip(triangles).for_each(|(seen, t)| *seen = *seen || is_floor(t));
    }

    /// Built when it is needed first: samples of the surface do not need it.
    fn inside(&self) -> Option<&Inside> {
        let build = || {
            let points: Vec<DVec3> = crate::geometry::topology::points(&self.mesh).collect();
            Inside::of(&points, &self.mesh.triangles, self.finest)
        };
        self.inside.get_or_init(build).as_ref()
    }

    /// Distance of a point from the surface, negative inside.
    pub(crate) fn signed(&self, p: DVec3) -> f64 {
        let near = f64::from(self.shape.distance_to_local_point(to_parry(p), false));
        self.inside().map_or(near, |inside| inside.signed(p, near))
    }

    /// True if the solid is behind a point of the surface with this outward normal.
    pub(crate) fn is_behind(&self, p: DVec3, normal: DVec3) -> bool {
        self.inside().is_none_or(|inside| inside.holds(p - normal * 2.0 * inside.step()))
    }

    /// Distance along a unit direction to the surface; none beyond `reach`.
    pub(crate) fn ray(&self, from: DVec3, along: DVec3, reach: f64) -> Option<f64> {
        let ray = Ray::new(to_parry(from), to_parry(along));
        self.shape.cast_local_ray(&ray, reach as f32, false).map(f64::from)
    }

    /// Thickness of the solid at a surface point near `p` against the outward `normal`, at most `most`; less than half of the
    /// free way where the surface is a sheet. `slack`: how far `p` may be from the surface.
    pub(crate) fn thickness(&self, p: DVec3, normal: DVec3, slack: f64, most: f64) -> f64 {
        /// Distance behind the surface at which a ray begins that is not to meet it.
        const EPSILON: f64 = 1e-5;
        /// Share of the free way behind a sheet: less than half, so that what stands on both sides of it does not meet.
        const FREE: f64 = 0.4;
        let outer = self.ray(p + normal * slack, -normal, 2.0 * slack).map_or(0.0, |d| d - slack);
        let from = p - normal * (outer + EPSILON);
        let depth = self.ray(from, -normal, 2.0 * most).unwrap_or(2.0 * most);
        let inside = self.signed(from - normal * (0.5 * depth.min(most))) < 0.0;
        depth.min(most) * if inside { 1.0 } else { FREE }
    }

    /// Points about `spacing` apart, at least one per triangle if `every`.
    pub(crate) fn samples(&self, spacing: f64, every: bool) -> Vec<Sample> {
        let mut out = Vec::new();
        let mut left = 0.5 * spacing * spacing;
        for (t, seen) in self.mesh.triangles.iter().zip(&self.seen) {
            let [a, b, c] = corners(&self.mesh, *t);
            let cross = (b - a).cross(c - a);
            let normal = cross.normalize_or_zero();
            if normal == DVec3::ZERO {
                continue;
            }
            let before = out.len();
            left += 0.5 * cross.length();
            while left >= spacing * spacing {
                left -= spacing * spacing;
                let n = out.len() as f64;
                let [s, r] = super::in_triangle(n);
                out.push(Sample { point: a + (b - a) * s + (c - a) * r, normal, seen: *seen });
            }
            if every && out.len() == before {
                out.push(Sample { point: (a + b + c) / 3.0, normal, seen: *seen });
            }
        }
        out
    }
}
