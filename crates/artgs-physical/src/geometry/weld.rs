//! Vertices that are one.

use super::topology::NONE;
use artgs_core::Mesh;

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
pub(crate) fn without_doubles(triangles: &[[u32; 3]], most: usize) -> Vec<[u32; 3]> {
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
