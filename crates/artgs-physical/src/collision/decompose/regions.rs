//! Flat regions of a surface.

use crate::geometry::topology::{NONE, corners, cross, points, twins};
use crate::settings::RegionSettings;
use artgs_core::Mesh;
use glam::DVec3;

/// Connected triangles near a plane.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// Outward unit normal.
    pub(crate) normal: DVec3,
    /// Distance of the plane from the origin along the normal.
    pub(crate) offset: f64,
    /// Area.
    pub(crate) area: f64,
    /// Indices of the triangles.
    pub(crate) triangles: Vec<u32>,
}

/// Flat regions that are large enough for a tolerance, largest first: connected triangles with corners near a plane.
/// `mesh` has no doubled vertices.
pub(crate) fn regions(mesh: &Mesh, tolerance: f64, settings: &RegionSettings) -> Vec<Region> {
    let flat = settings.flat * tolerance;
    let least = (settings.least * tolerance) * (settings.least * tolerance);
    let twins = twins(mesh);
    let crosses: Vec<DVec3> = mesh.triangles.iter().map(|t| cross(mesh, *t)).collect();
    let corner: Vec<DVec3> = points(mesh).collect();
    let mut seeds: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    seeds.sort_by(|a, b| crosses[*b as usize].length().total_cmp(&crosses[*a as usize].length()).then(a.cmp(b)));
    let faces = Faces { mesh, twins: &twins, crosses: &crosses, corners: &corner };
    let mut free = vec![true; mesh.triangles.len()];
    let mut out = Vec::new();
    for seed in seeds {
        let Some(normal) = crosses[seed as usize].try_normalize().filter(|_| free[seed as usize]) else { continue };
        let mut plane = (normal, normal.dot(corner[mesh.triangles[seed as usize][0] as usize]));
        let mut grown = Vec::new();
        // The plane of one triangle is not that of the region.
        for _ in 0..settings.rounds {
            grown = faces.grow(&free, seed, plane, (flat, settings.agrees));
            plane = fit(mesh, &crosses, &grown).unwrap_or(plane);
        }
        let area = grown.iter().map(|t| 0.5 * crosses[*t as usize].length()).sum::<f64>();
        // A small region around this seed can still be part of a larger one.
        let taken: &[u32] = if area >= least { &grown } else { &[seed] };
        taken.iter().for_each(|t| free[*t as usize] = false);
        if area >= least {
            out.push(Region { normal: plane.0, offset: plane.1, area, triangles: grown });
        }
    }
    out.sort_by(|a, b| b.area.total_cmp(&a.area));
    out
}

/// Triangles with what connects them.
struct Faces<'a> {
    mesh: &'a Mesh,
    /// Half edge on the other side of each half edge.
    twins: &'a [u32],
    /// Normals, as long as twice the areas.
    crosses: &'a [DVec3],
    /// Places of the vertices.
    corners: &'a [DVec3],
}

impl Faces<'_> {
    /// Free triangles that connect to `seed` within `flat` of a plane, at an angle with a cosine above `agrees`.
    fn grow(&self, free: &[bool], seed: u32, (normal, offset): (DVec3, f64), (flat, agrees): (f64, f64)) -> Vec<u32> {
        let fits = |t: usize| {
            let corners = self.mesh.triangles[t].map(|v| self.corners[v as usize]);
            let near = corners.iter().all(|corner| (normal.dot(*corner) - offset).abs() <= flat);
            near && self.crosses[t].dot(normal) > agrees * self.crosses[t].length()
        };
        let (mut seen, mut out) = (std::collections::BTreeSet::from([seed]), vec![seed]);
        let mut at = 0;
        while at < out.len() {
            let t = out[at];
            at += 1;
            for h in 3 * t..3 * t + 3 {
                let twin = self.twins[h as usize];
                if twin == NONE {
                    continue;
                }
                let next = twin / 3;
                if free[next as usize] && !seen.contains(&next) && fits(next as usize) {
                    seen.insert(next);
                    out.push(next);
                }
            }
        }
        out
    }
}

/// Mean plane of triangles.
fn fit(mesh: &Mesh, crosses: &[DVec3], triangles: &[u32]) -> Option<(DVec3, f64)> {
    let normal = triangles.iter().map(|t| crosses[*t as usize]).sum::<DVec3>().try_normalize()?;
    let (mut sum, mut weight) = (0.0, 0.0);
    for t in triangles {
        let [a, b, c] = corners(mesh, mesh.triangles[*t as usize]);
        let area = crosses[*t as usize].length();
        sum += area * normal.dot((a + b + c) / 3.0);
        weight += area;
    }
    (weight > 0.0).then(|| (normal, sum / weight))
}
