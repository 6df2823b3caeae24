//! Welding, debris and orientation.

use super::RepairOptions;
use crate::geometry::topology::{components, cross, ends, split_to_manifold, twins};
use crate::geometry::weld::{compact, welded, without_doubles};
use artgs_core::Mesh;
use std::collections::VecDeque;

/// Welded, oriented, each vertex with one fan of triangles, without islands.
pub(super) fn clean(mesh: &Mesh, options: &RepairOptions) -> Mesh {
    let finite = |t: &&[u32; 3]| {
        t.iter().all(|v| mesh.vertices.get(*v as usize).is_some_and(|p| p.iter().all(|x| x.is_finite())))
    };
    let usable: Vec<[u32; 3]> = mesh.triangles.iter().filter(finite).copied().collect();
    let mut mesh = welded(&compact(mesh, &usable), options.weld.max(f64::MIN_POSITIVE));
    orient(&mut mesh);
    let mesh = split_to_manifold(&mesh, 0.0);
    without_islands(&mesh, options.settings.island)
}

/// Flips triangles until neighbours agree; each component keeps the orientation of the larger area.
fn orient(mesh: &mut Mesh) {
    let edges = neighbours(&mesh.triangles);
    let mut flipped: Vec<Option<bool>> = vec![None; mesh.triangles.len()];
    for seed in 0..mesh.triangles.len() {
        if flipped[seed].is_some() {
            continue;
        }
        flipped[seed] = Some(false);
        let mut component = vec![seed];
        let mut queue = VecDeque::from([seed]);
        while let Some(t) = queue.pop_front() {
            for (other, disagrees) in edges[3 * t..3 * t + 3].iter().flatten() {
                if flipped[*other].is_none() {
                    flipped[*other] = Some(flipped[t].unwrap_or(false) ^ disagrees);
                    component.push(*other);
                    queue.push_back(*other);
                }
            }
        }
        let side = |t: usize| if flipped[t] == Some(true) { -1.0 } else { 1.0 };
        let balance: f64 = component.iter().map(|t| side(*t) * cross(mesh, mesh.triangles[*t]).length()).sum();
        for t in component {
            if (flipped[t] == Some(true)) != (balance < 0.0) {
                mesh.triangles[t].swap(1, 2);
            }
        }
    }
}

/// For every half-edge that exactly two triangles share: the other triangle and whether both run in the same direction.
fn neighbours(triangles: &[[u32; 3]]) -> Vec<Option<(usize, bool)>> {
    let mut keyed: Vec<(u32, u32, u32, bool)> = (0..3 * triangles.len() as u32)
        .map(|h| {
            let [a, b] = ends(triangles, h);
            (a.min(b), a.max(b), h, a < b)
        })
        .collect();
    keyed.sort_unstable();
    let mut out = vec![None; 3 * triangles.len()];
    for run in keyed.chunk_by(|p, q| (p.0, p.1) == (q.0, q.1)) {
        if let [p, q] = run {
            let same = p.3 == q.3;
            out[p.2 as usize] = Some((q.2 as usize / 3, same));
            out[q.2 as usize] = Some((p.2 as usize / 3, same));
        }
    }
    out
}

fn without_islands(mesh: &Mesh, fraction: f64) -> Mesh {
    let component = components(&twins(mesh));
    let mut areas = vec![0.0; mesh.triangles.len()];
    for (t, c) in mesh.triangles.iter().zip(&component) {
        areas[*c as usize] += cross(mesh, *t).length();
    }
    let least = fraction * areas.iter().copied().fold(0.0, f64::max);
    let stays = |(t, c): (&[u32; 3], &u32)| (areas[*c as usize] >= least).then_some(*t);
    let kept: Vec<[u32; 3]> = mesh.triangles.iter().zip(&component).filter_map(stays).collect();
    compact(mesh, &kept)
}

/// Only the given triangles, without pairs that cancel, and the vertices they use; closed meshes stay closed.
pub(crate) fn reduced(mesh: &Mesh, triangles: &[[u32; 3]]) -> Mesh {
    compact(mesh, &without_doubles(triangles, usize::MAX))
}
