//! The visual mesh of a link, for distances.

use crate::model::{Shape, bounds};
use crate::poses::vector;
use artgs_core::Inside;
use glam::DVec3;
use rapier3d::parry::query::{PointQuery as _, Ray, RayCast as _};
use rapier3d::parry::shape::{TriMesh, TriMeshFlags};

/// The visual mesh of a link.
pub(crate) struct Drawn {
    shape: TriMesh,
    inside: Option<Inside>,
    low: DVec3,
    high: DVec3,
}

impl Drawn {
    /// None without triangles.
    pub(crate) fn new(visuals: &[Shape]) -> Option<Self> {
        /// Least distance of the rays that decide what is inside, metres.
        const FINEST: f64 = 1e-3;
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for shape in visuals {
            let first = points.len() as u32;
            points.extend(shape.points.iter().map(|p| vector(*p)));
            triangles.extend(shape.triangles.iter().map(|t| t.map(|i| first + i)));
        }
        // Vertices are doubled along the seams of textures.
        let flags = TriMeshFlags::MERGE_DUPLICATE_VERTICES | TriMeshFlags::ORIENTED;
        let all: Vec<DVec3> = visuals.iter().flat_map(|shape| shape.points.iter().copied()).collect();
        let inside = Inside::of(&all, &triangles, FINEST);
        let [low, high] = bounds(all.into_iter())?;
        Some(Self { shape: TriMesh::with_flags(points, triangles, flags).ok()?, inside, low, high })
    }

    /// True for points behind the surface, or less than `near` before it.
    pub(crate) fn holds(&self, p: DVec3, near: f64) -> bool {
        p.cmpge(self.low - near).all() && p.cmple(self.high + near).all() && self.signed(p) < near
    }

    /// Distance of a point from the surface, negative behind it.
    pub(crate) fn signed(&self, p: DVec3) -> f64 {
        let near = f64::from(self.shape.distance_to_local_point(vector(p), false));
        self.inside.as_ref().map_or(near, |inside| inside.signed(p, near))
    }

    /// Distance along a unit direction to the surface; none beyond `reach`.
    pub(crate) fn ray(&self, from: DVec3, along: DVec3, reach: f64) -> Option<f64> {
        let ray = Ray::new(vector(from), vector(along));
        self.shape.cast_local_ray(&ray, reach as f32, false).map(f64::from)
    }

    /// Distance of a point in front of the surface; 0 behind it, where the link is solid.
    pub(crate) fn outside(&self, p: DVec3) -> f64 {
        self.signed(p).max(0.0)
    }

    /// The outward normal where a ray first meets the surface.
    pub(crate) fn normal(&self, from: DVec3, along: DVec3, reach: f64) -> Option<DVec3> {
        let ray = Ray::new(vector(from), vector(along));
        let hit = self.shape.cast_local_ray_and_get_normal(&ray, reach as f32, false)?;
        DVec3::from_array(hit.normal.to_array().map(f64::from)).try_normalize()
    }

    pub(crate) fn is_near(&self, p: DVec3, distance: f64) -> bool {
        self.shape.project_local_point_with_max_dist(vector(p), false, distance as f32).is_some()
    }
}
