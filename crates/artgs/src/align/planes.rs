//! Planes that bound the scene: floor, walls, the top of a table. Nothing that was recorded lies behind them.

use super::cloud::FusedCloud;
use glam::{DVec3, Vec3};
use nalgebra::{Matrix3, SymmetricEigen};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Search for planes that bound the scene. Lengths are in units of the median depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlaneConfig {
    /// Distance from the plane within which a point belongs to it.
    pub tolerance: f64,
    /// Share of all points that a plane needs, 0 to 1.
    pub least_share: f64,
    /// Points behind the plane that are allowed, as a share of its points: reflections, a view through a door.
    pub behind: f64,
    /// Largest number of planes.
    pub count: usize,
    /// Random trials per plane.
    pub trials: usize,
}

impl Default for PlaneConfig {
    fn default() -> Self {
        Self { tolerance: 0.012, least_share: 0.02, behind: 0.1, count: 8, trials: 400 }
    }
}

/// Points are not behind a plane within this many tolerances of it.
pub(super) const NOT_BEHIND: f64 = 3.0;

/// Points `p` with `normal . p = offset`; the recorded scene is on the side of the normal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Plane {
    /// Unit normal into the scene.
    pub normal: DVec3,
    /// Distance from the origin along the normal, scene units.
    pub offset: f64,
    /// Standard deviation of its points, scene units.
    pub spread: f64,
}

impl Plane {
    /// Signed distance of a point, positive inside the scene.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }
}

/// Planes that bound the scene, those with the most points first. `unit` is the median depth.
pub(crate) fn bounding_planes(cloud: &FusedCloud, unit: f64, config: &PlaneConfig, seed: u64) -> Vec<Plane> {
    let tolerance = (config.tolerance * unit) as f32;
    let least = (config.least_share * cloud.len() as f64) as usize;
    let mut left: Vec<usize> = (0..cloud.len()).collect();
    let mut planes = Vec::new();
    // Large planes inside the scene, such as the front of the object, use up trials but are not kept.
    for round in 0..3 * config.count {
        let Some((point, normal)) = most_points(cloud, &left, tolerance, config.trials, seed + round as u64) else {
            break;
        };
        let near = |i: &usize| belongs(cloud, *i, point, normal, tolerance);
        let members: Vec<usize> = left.iter().copied().filter(near).collect();
        if members.len() < least.max(10) || planes.len() == config.count {
            break;
        }
        left.retain(|i| !near(i));
        let plane = fitted(cloud, &members);
        let behind =
            cloud.points.iter().filter(|p| plane.distance(p.as_dvec3()) < -NOT_BEHIND * f64::from(tolerance)).count();
        if behind as f64 <= config.behind * members.len() as f64 {
            planes.push(plane);
        }
    }
    planes
}

fn belongs(cloud: &FusedCloud, i: usize, point: Vec3, normal: Vec3, tolerance: f32) -> bool {
    (cloud.points[i] - point).dot(normal).abs() < tolerance && cloud.normals[i].dot(normal) > 0.8
}

/// Point and normal of the trial plane with the most points of `left`.
fn most_points(cloud: &FusedCloud, left: &[usize], tolerance: f32, trials: usize, seed: u64) -> Option<(Vec3, Vec3)> {
    if left.is_empty() {
        return None;
    }
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let picks: Vec<usize> = (0..trials).map(|_| left[rng.random_range(0..left.len())]).collect();
    let stride = left.len().div_ceil(4000).max(1);
    let count = |&i: &usize| {
        let (p, n) = (cloud.points[i], cloud.normals[i]);
        let found = left.iter().step_by(stride).filter(|&&j| belongs(cloud, j, p, n, tolerance)).count();
        (found, std::cmp::Reverse(i))
    };
    let best = picks.par_iter().map(count).max()?.1.0;
    Some((cloud.points[best], cloud.normals[best]))
}

/// Least-squares plane of some points, its normal on the side of theirs.
fn fitted(cloud: &FusedCloud, members: &[usize]) -> Plane {
    let n = members.len() as f64;
    let middle = members.iter().map(|&i| cloud.points[i].as_dvec3()).sum::<DVec3>() / n;
    let mut moments = Matrix3::<f64>::zeros();
    let mut facing = DVec3::ZERO;
    for &i in members {
        let d = cloud.points[i].as_dvec3() - middle;
        let d = nalgebra::Vector3::new(d.x, d.y, d.z);
        moments += d * d.transpose() / n;
        facing += cloud.normals[i].as_dvec3();
    }
    let eigen = SymmetricEigen::new(moments);
    let smallest = eigen.eigenvalues.imin();
    let v = eigen.eigenvectors.column(smallest);
    let normal = DVec3::new(v[0], v[1], v[2]);
    let normal = if normal.dot(facing) < 0.0 { -normal } else { normal };
    Plane { normal, offset: normal.dot(middle), spread: eigen.eigenvalues[smallest].max(0.0).sqrt() }
}
