//! Welding, debris and orientation.

use super::RepairOptions;
use crate::topology::{NONE, components, cross, ends, split_to_manifold, twins};
use artgs_core::Mesh;
use std::collections::VecDeque;

/// Merges vertices in the same cell of size `cell` (scene units, positive) and removes triangles that become degenerate,
/// duplicate or cancelling, and unused vertices.
pub(crate) fn welded(mesh: &Mesh, cell: f64) -> Mesh {
    let key = |v: &[f32; 3]| v.map(|x| (f64::from(x) / cell).round() as i64);
    let mut order: Vec<([i64; 3], u32)> = mesh.vertices.iter().enumerate().map(|(i, v)| (key(v), i as u32)).collect();
    order.sort_unstable();
    let mut representative = vec![0; mesh.vertices.len()];
    for run in order.chunk_by(|a, b| a.0 == b.0) {
        run.iter().for_each(|(_, i)| representative[*i as usize] = run[0].1);
    }
    let mut triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|i| representative[i as usize])).collect();
    triangles.retain(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
    compact(mesh, &without_doubles(&triangles, 1))
}

/// Triangles on the same three vertices cancel in pairs with opposite orientation; of the rest at most `most` stay.
fn without_doubles(triangles: &[[u32; 3]], most: usize) -> Vec<[u32; 3]> {
    // Corners sorted, whether the order was an even permutation, and the index.
    let mut keyed: Vec<([u32; 3], bool, usize)> = triangles
        .iter()
        .enumerate()
        .map(|(i, t)| {
            let mut sorted = *t;
            sorted.sort_unstable();
            let lowest = t.iter().position(|v| *v == sorted[0]).unwrap_or(0);
            (sorted, t[(lowest + 1) % 3] == sorted[1], i)
        })
        .collect();
    keyed.sort_unstable();
    let mut kept: Vec<usize> = Vec::with_capacity(triangles.len());
    for run in keyed.chunk_by(|a, b| a.0 == b.0) {
        let even = run.iter().filter(|(_, even, _)| *even).count();
        let (majority, left) = (2 * even > run.len(), (2 * even).abs_diff(run.len()).min(most));
        kept.extend(run.iter().filter(|(_, even, _)| *even == majority).take(left).map(|(_, _, i)| *i));
    }
    kept.sort_unstable();
    kept.into_iter().map(|i| triangles[i]).collect()
}

/// Only the given triangles and the vertices they use, in the order of the mesh.
pub(crate) fn compact(mesh: &Mesh, triangles: &[[u32; 3]]) -> Mesh {
    let mut index = vec![NONE; mesh.vertices.len()];
    triangles.iter().flatten().for_each(|v| index[*v as usize] = 0);
    let mut out = Mesh::default();
    for (i, slot) in index.iter_mut().enumerate().filter(|(_, slot)| **slot != NONE) {
        *slot = out.vertices.len() as u32;
        out.vertices.push(mesh.vertices[i]);
        if mesh.colors.len() == mesh.vertices.len() {
            out.colors.push(mesh.colors[i]);
        }
    }
    out.triangles = triangles.iter().map(|t| t.map(|i| index[i as usize])).collect();
    out
}

/// Welded, oriented, each vertex with one fan of triangles, without islands.
pub(super) fn clean(mesh: &Mesh, options: &RepairOptions) -> Mesh {
    let finite = |t: &&[u32; 3]| {
        t.iter().all(|v| mesh.vertices.get(*v as usize).is_some_and(|p| p.iter().all(|x| x.is_finite())))
    };
    let usable: Vec<[u32; 3]> = mesh.triangles.iter().filter(finite).copied().collect();
    let mut mesh = welded(&compact(mesh, &usable), options.weld.max(f64::MIN_POSITIVE));
    orient(&mut mesh);
    let mesh = split_to_manifold(&mesh, 0.0);
    without_islands(&mesh, options.island_fraction)
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
