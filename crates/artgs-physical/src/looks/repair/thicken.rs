//! Shells: adds an inner side to open components.

use super::{Obstacles, Others, RepairOptions};
use crate::geometry::convert::trimesh;
use crate::geometry::topology::{NONE, components, ends, point, twins, vertex_normals};
use crate::settings::RepairSettings;
use artgs_core::Mesh;
use glam::DVec3;
use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;
use rayon::prelude::*;

/// Gives every open component an inner side, the thickness of shells behind the surface or less where another surface, also of `others`, or an
/// obstacle is nearer, joined to the outer one along the rims.
pub(super) fn thicken(mesh: &mut Mesh, obstacles: &Obstacles, others: &Others, options: &RepairOptions) {
    let twins = twins(mesh);
    let component = components(&twins);
    let mut open = vec![false; mesh.triangles.len()];
    let rims: Vec<u32> = (0..twins.len() as u32).filter(|h| twins[*h as usize] == NONE).collect();
    rims.iter().for_each(|h| open[component[*h as usize / 3] as usize] = true);
    let outer: Vec<[u32; 3]> =
        (0..mesh.triangles.len()).filter(|t| open[component[*t] as usize]).map(|t| mesh.triangles[t]).collect();
    let mut inner = vec![NONE; mesh.vertices.len()];
    let mut vertices: Vec<u32> = outer.iter().flatten().copied().collect();
    vertices.sort_unstable();
    vertices.dedup();
    let normals = evened(vertex_normals(mesh), &outer, options.settings.even);
    let depths = depths(mesh, &vertices, &outer, &normals, (obstacles, others), options);
    let colored = mesh.colors.len() == mesh.vertices.len();
    for (v, depth) in vertices.iter().zip(depths) {
        inner[*v as usize] = mesh.vertices.len() as u32;
        let p = point(mesh, *v) - normals[*v as usize] * depth;
        mesh.vertices.push(p.as_vec3().to_array());
        if colored {
            mesh.colors.push(mesh.colors[*v as usize]);
        }
    }
    let behind = |v: u32| inner[v as usize];
    let rim_edges: Vec<[u32; 2]> = rims.iter().map(|h| ends(&mesh.triangles, *h)).collect();
    mesh.triangles.extend(outer.iter().map(|t| [behind(t[0]), behind(t[2]), behind(t[1])]));
    mesh.triangles.extend(rim_edges.iter().flat_map(|[a, b]| [[*b, *a, behind(*a)], [*b, behind(*a), behind(*b)]]));
}

/// Normals smoothed `rounds` times.
fn evened(mut normals: Vec<DVec3>, triangles: &[[u32; 3]], rounds: usize) -> Vec<DVec3> {
    for _ in 0..rounds {
        let mut sums = normals.clone();
        for t in triangles {
            let mean: DVec3 = t.iter().map(|v| normals[*v as usize]).sum();
            t.iter().for_each(|v| sums[*v as usize] += mean / 3.0);
        }
        normals = sums.iter().map(|n| n.normalize_or_zero()).collect();
    }
    normals
}

/// Depth of the wall behind each of `vertices`.
fn depths(
    mesh: &Mesh,
    vertices: &[u32],
    triangles: &[[u32; 3]],
    normals: &[DVec3],
    (obstacles, others): (&Obstacles, &Others),
    options: &RepairOptions,
) -> Vec<f64> {
    /// Distance behind the surface at which rays begin, and least depth, in thicknesses: a wall has two sides.
    const TINY: f64 = 1e-3;
    let (thickness, settings) = (options.thickness, &options.settings);
    let RepairSettings { share, steps, least, shrink, .. } = *settings;
    let solid = trimesh(mesh);
    let allowed = |v: &u32| -> f64 {
        let (p, n) = (point(mesh, *v), normals[*v as usize]);
        let mut depth = thickness;
        let from = p - n * (TINY * thickness);
        let [origin, along] = [from, -n].map(|q| Vector::from_array(q.as_vec3().to_array()));
        let reach = (thickness / share) as f32;
        let ray = Ray::new(origin, along);
        let own = solid.iter().filter_map(|surface| surface.cast_local_ray(&ray, reach, false));
        let of_others = others.iter().filter_map(|(surface, pose)| surface.cast_ray(pose, &ray, reach, false));
        depth = own.chain(of_others).map(|hit| share * f64::from(hit)).fold(depth, f64::min);
        let least = (least * thickness).min(depth);
        // Another part can be narrower than the wall. Empty space is looked for at its end only: asking all views at each step took a quarter of an export.
        let step = thickness / steps;
        let free = (1..).map(|k| k as f64 * step).take_while(|d| *d < depth).find(|d| (obstacles.passed)(p - n * *d));
        depth = free.map_or(depth, |met| (met - step).max(least));
        while depth > least && obstacles.hold(p - n * depth) {
            depth *= shrink;
        }
        depth.max(least).max(TINY * thickness)
    };
    let allowed: Vec<f64> = vertices.par_iter().map(allowed).collect();
    let mut at = vec![0.0; mesh.vertices.len()];
    vertices.iter().zip(allowed).for_each(|(v, d)| at[*v as usize] = d);
    lower_to_neighbours(&mut at, triangles, settings);
    if let Some(solid) = &solid {
        lower_where_it_cuts(&mut at, mesh, triangles, normals, (solid, settings.cuts));
    }
    vertices.iter().map(|v| at[*v as usize]).collect()
}

/// Halves the depth of triangles of the inner side with an edge that cuts through the outer one, up to `rounds` times.
fn lower_where_it_cuts(
    at: &mut [f64],
    mesh: &Mesh,
    triangles: &[[u32; 3]],
    normals: &[DVec3],
    (solid, rounds): (&TriMesh, usize),
) {
    let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(edges_of).collect();
    edges.sort_unstable();
    edges.dedup();
    let mut cuts = vec![false; edges.len()];
    let mut changed = vec![true; at.len()];
    for _ in 0..rounds {
        let inner = |v: u32| point(mesh, v) - normals[v as usize] * at[v as usize];
        // An edge of which no end has moved is as it was.
        let is_cutting = |([a, b], was): (&[u32; 2], &bool)| {
            if !changed[*a as usize] && !changed[*b as usize] {
                return *was;
            }
            let (from, to) = (inner(*a), inner(*b));
            let [origin, way] = [from, to - from].map(|p| Vector::from_array(p.as_vec3().to_array()));
            solid.intersects_local_ray(&Ray::new(origin, way), 1.0)
        };
        cuts = edges.par_iter().zip(&cuts).map(is_cutting).collect();
        changed = vec![false; at.len()];
        let cutting = |edge: &[u32; 2]| edges.binary_search(edge).is_ok_and(|i| cuts[i]);
        let low = triangles.iter().filter(|t| edges_of(t).iter().any(cutting)).flatten();
        low.for_each(|v| changed[*v as usize] = true);
        at.iter_mut().zip(&changed).filter(|(_, changed)| **changed).for_each(|(depth, _)| *depth *= 0.5);
    }
}

/// The edges of a triangle, lower vertex first.
fn edges_of(t: &[u32; 3]) -> [[u32; 2]; 3] {
    [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|[a, b]| [a.min(b), a.max(b)])
}

/// Limits each depth by the least depth of its neighbours.
fn lower_to_neighbours(at: &mut [f64], triangles: &[[u32; 3]], settings: &RepairSettings) {
    for _ in 0..settings.spikes {
        let was = at.to_vec();
        for t in triangles {
            let lowest = t.iter().map(|v| was[*v as usize]).fold(f64::INFINITY, f64::min);
            t.iter().for_each(|v| at[*v as usize] = at[*v as usize].min(settings.spike * lowest));
        }
    }
}
