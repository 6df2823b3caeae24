//! Convex decomposition of surfaces: V-HACD on the voxels of the surface only, so that cavities stay empty.

use crate::hull::{Hull, from_parry};
use crate::topology::{points, vertex_normals};
use artgs_core::Mesh;
use glam::DVec3;
use parry3d::math::Vec3;
use parry3d::transformation::vhacd::{VHACD, VHACDParameters};
use parry3d::transformation::voxelization::FillMode;

/// Settings of [`decompose`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecomposeOptions {
    /// Edge of a voxel, in units of the mesh.
    pub voxel: f64,
    /// Largest relative concavity of a piece, as V-HACD measures it.
    pub concavity: f64,
    /// Largest number of pieces.
    pub most: u32,
    /// Approximate largest number of corners of a piece; some engines fail above 64.
    pub corners: usize,
    /// Inward thickness of surfaces: a sheet alone has no volume.
    pub skin: f64,
    /// Pieces thinner than this are removed.
    pub thinnest: f64,
}

/// Decomposition of a mesh by another program: the corners of each piece, or the reason of a failure.
pub(crate) type Decomposer<'a> = dyn Fn(&Mesh) -> Result<Vec<Vec<DVec3>>, String> + Sync + 'a;

/// Pieces of `other`, without those that have no volume, largest first.
pub(crate) fn decompose_with(mesh: &Mesh, other: &Decomposer, options: &DecomposeOptions) -> Result<Vec<Hull>, String> {
    if mesh.is_empty() {
        return Ok(Vec::new());
    }
    let pieces = other(mesh)?;
    let mut hulls: Vec<Hull> = pieces.iter().filter_map(|corners| Hull::of(corners, options.thinnest)).collect();
    hulls.sort_by(|a, b| b.volume().total_cmp(&a.volume()));
    Ok(hulls)
}

/// Convex pieces that together cover a surface, largest first.
pub fn decompose(mesh: &Mesh, options: &DecomposeOptions) -> Vec<Hull> {
    let mesh = &with_inside(mesh, options.skin);
    let points: Vec<Vec3> = mesh.vertices.iter().map(|v| Vec3::from_array(*v)).collect();
    let (low, high) =
        points.iter().fold((Vec3::splat(f32::INFINITY), Vec3::splat(f32::NEG_INFINITY)), |(low, high), p| {
            (low.min(*p), high.max(*p))
        });
    if mesh.is_empty() || !(high - low).is_finite() {
        return Vec::new();
    }
    let longest = f64::from((high - low).max_element());
    let resolution = (longest / options.voxel).ceil().clamp(8.0, 160.0) as u32;
    let parameters = VHACDParameters {
        concavity: options.concavity as f32,
        resolution,
        max_convex_hulls: options.most,
        fill_mode: FillMode::SurfaceOnly,
        plane_downsampling: 2,
        convex_hull_downsampling: 2,
        ..VHACDParameters::default()
    };
    let parts = VHACD::decompose(&parameters, &points, &mesh.triangles, true);
    let corners = parts.compute_exact_convex_hulls(&points, &mesh.triangles);
    let hull = |(points, _): &(Vec<Vec3>, Vec<[u32; 3]>)| {
        let points: Vec<_> = points.iter().map(|p| from_parry(*p)).collect();
        // Flat pieces need corners along their rims, which are extreme in few of the directions.
        Hull::of(&points, options.thinnest)?.coarser(2 * options.corners, options.thinnest)
    };
    let mut hulls: Vec<Hull> = corners.iter().filter_map(hull).collect();
    hulls.sort_by(|a, b| b.volume().total_cmp(&a.volume()));
    hulls
}

/// The surface and a copy moved against its normals.
fn with_inside(mesh: &Mesh, depth: f64) -> Mesh {
    let moved = points(mesh).zip(vertex_normals(mesh)).map(|(p, n)| (p - n * depth).as_vec3().to_array());
    let inside = Mesh { vertices: moved.collect(), colors: Vec::new(), ..mesh.clone() };
    let mut both = Mesh { colors: Vec::new(), ..mesh.clone() };
    both.append(&inside);
    both
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of five walls, open above.
    fn tray() -> Mesh {
        let (mut mesh, wall) = (Mesh::default(), 0.05);
        let mut add = |low: DVec3, high: DVec3| {
            let corner = |i: usize| [0, 1, 2].map(|a| if i >> a & 1 == 0 { low[a] } else { high[a] } as f32);
            let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
            let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
            mesh.append(&Mesh { vertices: (0..8).map(corner).collect(), colors: Vec::new(), triangles });
        };
        add(DVec3::ZERO, DVec3::new(1.0, 0.8, wall));
        add(DVec3::new(0.0, 0.0, wall), DVec3::new(wall, 0.8, 0.5));
        add(DVec3::new(1.0 - wall, 0.0, wall), DVec3::new(1.0, 0.8, 0.5));
        add(DVec3::new(wall, 0.0, wall), DVec3::new(1.0 - wall, wall, 0.5));
        add(DVec3::new(wall, 0.8 - wall, wall), DVec3::new(1.0 - wall, 0.8, 0.5));
        mesh
    }

    #[test]
    fn a_tray_stays_hollow_and_is_covered() {
        let options =
            DecomposeOptions { voxel: 0.02, concavity: 0.004, most: 32, corners: 32, skin: 0.01, thinnest: 1e-3 };
        let hulls = decompose(&tray(), &options);
        let inside = |p: DVec3, slack: f64| hulls.iter().any(|h| h.planes().iter().all(|f| f.distance(p) < slack));
        assert!((5..=45).contains(&hulls.len()), "{}", hulls.len());
        for x in 1..10 {
            for y in 1..8 {
                let at = |z: f64| DVec3::new(x as f64 * 0.1, y as f64 * 0.1, z);
                assert!(!inside(at(0.15), -0.01) && !inside(at(0.4), -0.01), "something in the way at {}", at(0.4));
                assert!(inside(at(0.0), 0.01), "no floor at {}", at(0.0));
            }
        }
        assert!(hulls.iter().all(|h| h.points().len() <= 64));
    }

    #[test]
    fn an_empty_mesh_has_no_pieces_and_a_sheet_becomes_a_plate() {
        let options =
            DecomposeOptions { voxel: 0.02, concavity: 0.004, most: 32, corners: 32, skin: 0.01, thinnest: 1e-3 };
        assert!(decompose(&Mesh::default(), &options).is_empty());
        let flat = Mesh {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            colors: vec![],
            triangles: vec![[0, 1, 2]],
        };
        // A sheet gets the thickness `skin`.
        let sheet = decompose(&flat, &options);
        assert!((sheet.iter().map(Hull::volume).sum::<f64>() - 0.005).abs() < 1e-3, "{sheet:?}");
    }
}
