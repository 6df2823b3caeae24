//! Mesh simplification with a measured error.

use crate::geometry::convert::trimesh;
use crate::geometry::topology::{NUDGE, open_edges, point, split_to_manifold};
use crate::looks::spread::spread;
use crate::settings::SimplifySettings;
use artgs_core::Mesh;
use glam::DVec3;
use meshopt::{SimplifyOptions, VertexDataAdapter};
use parry3d::math::Vector;
use parry3d::query::PointQuery;
use parry3d::shape::TriMesh;
use rayon::prelude::*;

/// Distance between two surfaces, both ways, scene units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceError {
    /// Largest over all samples.
    pub max: f64,
    /// 99th percentile.
    pub most: f64,
    /// Mean over all samples.
    pub mean: f64,
}

/// A mesh of fewer triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Simplified {
    /// The mesh; closed if the original is closed.
    pub mesh: Mesh,
    /// Error against the original.
    pub error: SurfaceError,
}

/// A mesh that is simplified several times.
pub(crate) struct Original<'a> {
    mesh: &'a Mesh,
    shape: Option<TriMesh>,
    samples: Vec<DVec3>,
    settings: &'a SimplifySettings,
}

impl<'a> Original<'a> {
    /// Prepares measuring distances.
    pub(crate) fn new(mesh: &'a Mesh, settings: &'a SimplifySettings) -> Self {
        Self { mesh, shape: trimesh(mesh), samples: samples(mesh, settings.samples), settings }
    }

    /// Reduces the mesh to about `budget` triangles; where that would move more than a hundredth of the surface by more than
    /// `max_error` (scene units), it keeps more of them. Borders stay, a closed mesh stays closed. Vertices are some of the old
    /// ones, with their colours.
    pub(crate) fn simplified(&self, budget: usize, max_error: f64) -> Simplified {
        self.attempts(budget, max_error, usize::MAX).unwrap_or_default()
    }

    /// The same if that leaves at most `most` triangles and keeps the error within the bound, else none.
    pub(crate) fn simplified_to(&self, budget: usize, max_error: f64, most: usize) -> Option<Simplified> {
        self.attempts(budget, max_error, most).filter(|done| done.error.most <= max_error)
    }

    fn attempts(&self, budget: usize, max_error: f64, most: usize) -> Option<Simplified> {
        if self.mesh.triangles.len() <= budget {
            return Some(Simplified { mesh: self.mesh.clone(), error: SurfaceError::default() });
        }
        let tighter = self.settings.tighter;
        let mut bound = max_error;
        let mut done = None;
        // The library limits only an estimate of the error, so the measured error decides.
        for _ in 0..self.settings.attempts {
            let mesh = collapsed(self.mesh, budget, bound);
            if mesh.triangles.len() > most {
                // A smaller bound needs even more.
                return None;
            }
            let error = self.error(&mesh);
            done = Some(Simplified { mesh, error });
            if error.most <= max_error {
                break;
            }
            bound *= (tighter * max_error / error.most).min(tighter);
        }
        done
    }

    /// Distances from points of each surface to the other. Points are vertices and spread over triangles by area.
    fn error(&self, other: &Mesh) -> SurfaceError {
        /// Of `SurfaceError::most`.
        const PERCENTILE: usize = 99;
        let one_way = |points: &[DVec3], to: Option<&TriMesh>| -> Vec<f64> {
            let Some(shape) = to else { return Vec::new() };
            points.par_iter().map(|p| distance(shape, *p)).collect()
        };
        let there = one_way(&self.samples, trimesh(other).as_ref());
        let mut all = [there, one_way(&samples(other, self.settings.samples), self.shape.as_ref())].concat();
        all.sort_unstable_by(f64::total_cmp);
        SurfaceError {
            max: all.last().copied().unwrap_or(0.0),
            most: all.get(all.len() * PERCENTILE / 100).copied().unwrap_or(0.0),
            mean: all.iter().sum::<f64>() / all.len().max(1) as f64,
        }
    }
}

fn collapsed(mesh: &Mesh, budget: usize, max_error: f64) -> Mesh {
    let bytes = meshopt::typed_to_bytes(&mesh.vertices);
    let Ok(adapter) = VertexDataAdapter::new(bytes, size_of::<[f32; 3]>(), 0) else { return mesh.clone() };
    let options = SimplifyOptions::ErrorAbsolute | SimplifyOptions::LockBorder;
    let indices = mesh.triangles.as_flattened();
    let kept = meshopt::simplify(indices, &adapter, 3 * budget, max_error as f32, options, None);
    let closed = open_edges(&mesh.triangles) == 0;
    let mut simpler = crate::looks::repair::reduced(mesh, kept.as_chunks::<3>().0);
    // Thin parts may have collapsed.
    if closed && open_edges(&simpler.triangles) > 0 {
        simpler = split_to_manifold(&simpler, NUDGE);
    }
    simpler
}

fn distance(solid: &TriMesh, p: DVec3) -> f64 {
    f64::from(solid.distance_to_local_point(Vector::from_array(p.as_vec3().to_array()), false))
}

/// Up to `most` points on a surface: some vertices, then points evenly spread by area.
fn samples(mesh: &Mesh, most: usize) -> Vec<DVec3> {
    let stride = mesh.vertices.len().div_ceil(most / 2).max(1);
    let mut points: Vec<DVec3> = (0..mesh.vertices.len() as u32).step_by(stride).map(|v| point(mesh, v)).collect();
    points.extend(spread(mesh, most / 2).into_iter().map(|[point, _]| point));
    points
}

/// Smooths the steps of marching cubes: Taubin's two passes, which do not shrink, `rounds` times; no vertex
/// moves by more than `reach` (scene units). Borders stay.
pub(crate) fn smoothed(mesh: &Mesh, rounds: usize, reach: f64) -> Mesh {
    /// Way of each pass to the mean of the neighbours.
    const PASSES: [f64; 2] = [0.5, -0.53];
    let around = Around::new(mesh);
    let was: Vec<DVec3> = (0..mesh.vertices.len() as u32).map(|v| point(mesh, v)).collect();
    let mut now = was.clone();
    for step in (0..rounds).flat_map(|_| PASSES) {
        now = (0..now.len())
            .into_par_iter()
            .map(|i| {
                let neighbours = around.of(i);
                if neighbours.is_empty() {
                    return now[i];
                }
                let mean = neighbours.iter().map(|k| now[*k as usize]).sum::<DVec3>() / neighbours.len() as f64;
                was[i] + (now[i] + (mean - now[i]) * step - was[i]).clamp_length_max(reach)
            })
            .collect();
    }
    let vertices = now.iter().map(|p| p.as_vec3().to_array()).collect();
    Mesh { vertices, ..mesh.clone() }
}

/// Neighbours of every vertex; none for those at borders.
struct Around {
    starts: Vec<usize>,
    neighbours: Vec<u32>,
}

impl Around {
    fn new(mesh: &Mesh) -> Self {
        let directed = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
        let mut edges: Vec<[u32; 2]> = mesh.triangles.iter().flat_map(directed).collect();
        edges.sort_unstable();
        let mut border = vec![false; mesh.vertices.len()];
        for [a, b] in edges.iter().filter(|[a, b]| edges.binary_search(&[*b, *a]).is_err()) {
            border[*a as usize] = true;
            border[*b as usize] = true;
        }
        edges.retain(|[a, _]| !border[*a as usize]);
        let starts = (0..=mesh.vertices.len() as u32).map(|v| edges.partition_point(|e| e[0] < v)).collect();
        Self { starts, neighbours: edges.iter().map(|e| e[1]).collect() }
    }

    fn of(&self, vertex: usize) -> &[u32] {
        &self.neighbours[self.starts[vertex]..self.starts[vertex + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::topology::corners;
    use crate::geometry::topology::testing::{open_box, sphere};
    use crate::geometry::weld::welded;

    #[test]
    fn a_sphere_is_simplified_within_the_error_it_states() {
        let fine = welded(&sphere(1.0, 60), 1e-6);
        let done = Original::new(&fine, &SimplifySettings::DEFAULT).simplified(2000, 0.02);
        assert!(done.mesh.triangles.len() <= 2000 && open_edges(&done.mesh.triangles) == 0);
        // What a sphere of so many triangles has by theory: area per triangle a, sagitta about 0.385 a / r.
        let sagitta = 0.385 * 4.0 * std::f64::consts::PI / done.mesh.triangles.len() as f64;
        let deepest = done
            .mesh
            .triangles
            .iter()
            .map(|t| 1.0 - (corners(&done.mesh, *t).iter().sum::<DVec3>() / 3.0).length())
            .fold(0.0, f64::max);
        assert!((done.error.max - deepest).abs() < 0.3 * deepest, "{:?}, {deepest}", done.error);
        assert!(done.error.mean > 0.2 * sagitta && done.error.mean < 2.0 * sagitta, "{:?}, {sagitta}", done.error);
        assert!(done.error.max <= 0.02);
        // A small error bound needs more triangles than the budget.
        let careful = Original::new(&fine, &SimplifySettings::DEFAULT).simplified(100, 0.002);
        assert!(careful.error.most <= 0.002 && careful.mesh.triangles.len() > 2000);
    }

    #[test]
    fn a_bound_that_needs_too_many_triangles_is_given_up() {
        let fine = welded(&sphere(1.0, 60), 1e-6);
        let original = Original::new(&fine, &SimplifySettings::DEFAULT);
        let done = original.simplified(100, 0.002);
        let count = done.mesh.triangles.len();
        assert_eq!(original.simplified_to(100, 0.002, count), Some(done));
        assert_eq!(original.simplified_to(100, 0.002, count / 2), None);
    }

    #[test]
    fn a_box_needs_twelve_triangles_and_a_sheet_keeps_its_border() {
        let fine = welded(&open_box(DVec3::ONE, 20, [true; 6]), 1e-6);
        let done = Original::new(&fine, &SimplifySettings::DEFAULT).simplified(12, 1e-3);
        assert!(done.mesh.triangles.len() <= 40 && done.error.max < 1e-3, "{}", done.mesh.triangles.len());
        assert_eq!(done.mesh.colors.len(), done.mesh.vertices.len());
        let sheet = welded(&open_box(DVec3::ONE, 20, [false, true, false, false, false, false]), 1e-6);
        let done = Original::new(&sheet, &SimplifySettings::DEFAULT).simplified(12, 1e-3);
        assert_eq!(open_edges(&done.mesh.triangles), 80);
    }

    #[test]
    fn smoothing_evens_steps_and_keeps_the_volume() {
        let mut steps = welded(&sphere(1.0, 40), 1e-6);
        for (i, v) in steps.vertices.iter_mut().enumerate() {
            *v = v.map(|x| x * (1.0 + 0.01 * (i % 3) as f32));
        }
        let spread = |m: &Mesh| {
            let radii: Vec<f64> = (0..m.vertices.len() as u32).map(|v| point(m, v).length()).collect();
            let mean = radii.iter().sum::<f64>() / radii.len() as f64;
            (mean, (radii.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / radii.len() as f64).sqrt())
        };
        let smooth = smoothed(&steps, 5, 0.02);
        let ((mean, rough), (kept, fine)) = (spread(&steps), spread(&smooth));
        assert!(fine < 0.4 * rough && (kept - mean).abs() < 2e-3, "{rough} {fine}, {mean} {kept}");
        let held = smoothed(&steps, 5, 0.001);
        let moved = |m: &Mesh, v: u32| point(m, v).distance(point(&steps, v));
        assert!((0..steps.vertices.len() as u32).all(|v| moved(&held, v) < 0.00101));
    }
}
