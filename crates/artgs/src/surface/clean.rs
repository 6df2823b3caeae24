//! Mesh cleaning: coincident vertices welded, degenerate triangles, small components and unused vertices dropped.

use crate::connected::connected_components;
use artgs_core::Mesh;

/// Cleans a mesh. Components (triangles joined by vertices) stay if they have at least `keep_fraction` of the largest
/// one's triangles. Order is kept; an empty mesh stays empty.
pub fn clean(mesh: &Mesh, keep_fraction: f64) -> Mesh {
    let representative = weld(&mesh.vertices);
    let mut triangles: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .map(|t| t.map(|i| representative[i as usize]))
        .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
        .collect();
    let edges = triangles.iter().flat_map(|t| [t[1], t[2]].map(|i| (t[0] as usize, i as usize)));
    let components = connected_components(mesh.vertices.len(), edges);
    let mut sizes = vec![0usize; mesh.vertices.len()];
    for t in &triangles {
        sizes[components[t[0] as usize] as usize] += 1;
    }
    let least = keep_fraction * sizes.iter().copied().max().unwrap_or(0) as f64;
    triangles.retain(|t| sizes[components[t[0] as usize] as usize] as f64 >= least);
    compact(mesh, triangles)
}

/// For every vertex the first one at exactly the same place.
fn weld(vertices: &[[f32; 3]]) -> Vec<u32> {
    let bits = |i: u32| vertices[i as usize].map(|v| (v + 0.0).to_bits());
    let mut order: Vec<u32> = (0..vertices.len() as u32).collect();
    order.sort_unstable_by_key(|i| (bits(*i), *i));
    let mut out = vec![0; vertices.len()];
    for run in order.chunk_by(|a, b| bits(*a) == bits(*b)) {
        for i in run {
            out[*i as usize] = run[0];
        }
    }
    out
}

/// The mesh with only these triangles and their vertices.
pub(super) fn compact(mesh: &Mesh, mut triangles: Vec<[u32; 3]>) -> Mesh {
    let mut used = vec![false; mesh.vertices.len()];
    triangles.iter().flatten().for_each(|i| used[*i as usize] = true);
    let coloured = mesh.colors.len() == mesh.vertices.len();
    let mut place = vec![0u32; used.len()];
    let (mut vertices, mut colors) = (Vec::new(), Vec::new());
    for i in (0..used.len()).filter(|i| used[*i]) {
        place[i] = vertices.len() as u32;
        vertices.push(mesh.vertices[i]);
        if coloured {
            colors.push(mesh.colors[i]);
        }
    }
    triangles.iter_mut().flatten().for_each(|i| *i = place[*i as usize]);
    Mesh { vertices, colors, triangles }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip of `n` triangles from `x`.
    fn strip(n: u32, x: f32) -> Mesh {
        let vertices = (0..n + 2).map(|i| [x + i as f32, (i % 2) as f32, 0.0]).collect();
        Mesh { vertices, colors: vec![], triangles: (0..n).map(|i| [i, i + 1, i + 2]).collect() }
    }

    #[test]
    fn specks_go_and_fair_pieces_stay() {
        let mut mesh = strip(40, 0.0);
        mesh.append(&strip(4, 100.0));
        mesh.append(&strip(3, 200.0));
        let out = clean(&mesh, 0.1);
        assert_eq!((out.triangles.len(), out.vertices.len()), (44, 48));
        assert!(out.vertices.iter().all(|v| v[0] < 150.0));
    }

    #[test]
    fn coincident_vertices_are_welded_and_slivers_between_them_dropped() {
        let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, 0.0], [9.0, 9.0, 9.0]];
        let mesh = Mesh { vertices, colors: vec![[7; 3]; 5], triangles: vec![[0, 1, 2], [0, 3, 1]] };
        let out = clean(&mesh, 0.1);
        assert_eq!((out.vertices.len(), out.colors.len()), (3, 3));
        assert_eq!(out.triangles, [[0, 1, 2]]);
    }

    #[test]
    fn nothing_stays_nothing() {
        assert!(clean(&Mesh::default(), 0.1).is_empty());
        let flat = Mesh { vertices: vec![[0.0; 3]; 3], colors: vec![], triangles: vec![[0, 1, 2]] };
        assert!(clean(&flat, 0.1).vertices.is_empty());
    }
}
