//! Marching cubes with shared vertices on the blocks of a TSDF.
//!
//! The table of triangles is derived, not listed: on every face of a cell each run of inside corners is cut off by one
//! segment, the segments chain into loops, loops become fans. The rule looks at one face only, so neighbours agree.

use super::tsdf::{SIDE, Tsdf, block_origin};
use artgs_core::Mesh;
use rayon::prelude::*;
use std::sync::LazyLock;

/// Corners of the faces, counter-clockwise from outside; bits 0, 1, 2 of a corner are x, y, z.
const FACES: [[usize; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
/// Edges as lower corner and axis.
const EDGES: [(usize, usize); 12] =
    [(0, 0), (2, 0), (4, 0), (6, 0), (0, 1), (1, 1), (4, 1), (5, 1), (0, 2), (1, 2), (2, 2), (3, 2)];

/// Triangles, as edges, for every set of inside corners.
static TRIANGLES: LazyLock<Vec<Vec<[usize; 3]>>> = LazyLock::new(|| (0..256).map(triangles_of).collect());

fn edge_between(a: usize, b: usize) -> usize {
    let (low, axis) = (a & b, (a ^ b).trailing_zeros() as usize);
    EDGES.iter().position(|e| *e == (low, axis)).unwrap_or(0)
}

fn triangles_of(inside: usize) -> Vec<[usize; 3]> {
    let is_inside = |corner: usize| inside >> corner & 1 == 1;
    // Every crossed edge is where the inside begins on one of its two faces and ends on the other.
    let mut next = [usize::MAX; 12];
    for face in FACES {
        for i in 0..4 {
            let (before, here) = (face[(i + 3) % 4], face[i]);
            if is_inside(before) || !is_inside(here) {
                continue;
            }
            let end = (i..i + 3).find(|j| !is_inside(face[(j + 1) % 4])).unwrap_or(i);
            next[edge_between(before, here)] = edge_between(face[end % 4], face[(end + 1) % 4]);
        }
    }
    let mut triangles = Vec::new();
    for start in 0..12 {
        let mut ring = Vec::new();
        let mut edge = start;
        while next[edge] != usize::MAX {
            ring.push(edge);
            edge = std::mem::replace(&mut next[edge], usize::MAX);
        }
        triangles.extend(fan(&ring));
    }
    triangles
}

/// Fan from the apex with the fewest diagonals inside a face, where the neighbour could draw the same one.
fn fan(ring: &[usize]) -> Vec<[usize; 3]> {
    let n = ring.len();
    let on_face = |face: &[usize; 4], e: usize| {
        let (low, axis) = EDGES[e];
        face.contains(&low) && face.contains(&(low | 1 << axis))
    };
    let flat = |a: usize, b: usize| FACES.iter().any(|f| on_face(f, a) && on_face(f, b));
    let cost = |apex: &usize| (2..n - 1).filter(|j| flat(ring[*apex], ring[(apex + j) % n])).count();
    let Some(apex) = (0..n).min_by_key(cost) else { return Vec::new() };
    (1..n - 1).map(|j| [ring[apex], ring[(apex + j) % n], ring[(apex + j + 1) % n]]).collect()
}

/// Zero level of the volume in cells whose eight corners all weigh at least `min_weight`.
/// Vertices are shared, ordered by block and voxel, and uncoloured; triangles are counter-clockwise from outside.
pub fn marching_cubes(volume: &Tsdf, min_weight: f32) -> Mesh {
    let per_block: Vec<Vec<[u64; 3]>> =
        (0..volume.block_count()).into_par_iter().map(|b| block_triangles(volume, b, min_weight)).collect();
    let mut edges: Vec<u64> = per_block.par_iter().flat_map_iter(|t| t.iter().flatten().copied()).collect();
    edges.par_sort_unstable();
    edges.dedup();
    let first: Vec<usize> =
        (0..=volume.block_count()).map(|b| edges.partition_point(|e| (e >> 11) < b as u64)).collect();
    let rank = |edge: u64| {
        let b = (edge >> 11) as usize;
        (first[b] + edges[first[b]..first[b + 1]].partition_point(|e| *e < edge)) as u32
    };
    let triangles = per_block.par_iter().flat_map_iter(|t| t.iter().map(|t| t.map(rank))).collect();
    let vertices = edges.par_iter().map(|e| vertex(volume, *e)).collect();
    Mesh { vertices, colors: Vec::new(), triangles }
}

/// Block, voxel (9 bits) and axis (2 bits) of an edge in one number.
fn edge_key(block: usize, voxel: [usize; 3], axis: usize) -> u64 {
    (block as u64) << 11 | (((voxel[2] * SIDE + voxel[1]) * SIDE + voxel[0]) << 2 | axis) as u64
}

fn block_triangles(volume: &Tsdf, block: usize, min_weight: f32) -> Vec<[u64; 3]> {
    const WIDE: usize = SIDE + 1;
    let key = volume.keys()[block];
    let owners: [Option<usize>; 8] = std::array::from_fn(|i| {
        if i == 0 { Some(block) } else { volume.neighbour(key, [i & 1, i >> 1 & 1, i >> 2].map(|v| v as i64)) }
    });
    // Values of this block and of the first layer of its upper neighbours; NaN where unknown.
    let mut values = [f32::NAN; WIDE * WIDE * WIDE];
    for (i, value) in values.iter_mut().enumerate() {
        let at = [i % WIDE, i / WIDE % WIDE, i / WIDE / WIDE];
        let owner = (0..3).fold(0, |o, a| o | (at[a] / SIDE) << a);
        let local = at.map(|v| v % SIDE);
        let voxel = (local[2] * SIDE + local[1]) * SIDE + local[0];
        *value = owners[owner].and_then(|b| volume.block(b).value(voxel, min_weight)).unwrap_or(f32::NAN);
    }
    let offset = |corner: usize| ((corner >> 2) * WIDE + (corner >> 1 & 1)) * WIDE + (corner & 1);
    let mut out = Vec::new();
    for i in 0..SIDE * SIDE * SIDE {
        let at = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE];
        let base = (at[2] * WIDE + at[1]) * WIDE + at[0];
        let corners: [f32; 8] = std::array::from_fn(|c| values[base + offset(c)]);
        let inside = (0..8).fold(0, |bits, c| bits | usize::from(corners[c] < 0.0) << c);
        if inside == 0 || inside == 255 || corners.iter().any(|v| v.is_nan()) {
            continue;
        }
        let key_of = |edge: usize| {
            let (corner, axis) = EDGES[edge];
            let p = [at[0] + (corner & 1), at[1] + (corner >> 1 & 1), at[2] + (corner >> 2)];
            let owner = (0..3).fold(0, |o, a| o | (p[a] / SIDE) << a);
            edge_key(owners[owner].unwrap_or(block), p.map(|v| v % SIDE), axis)
        };
        out.extend(TRIANGLES[inside].iter().map(|t| t.map(key_of)));
    }
    out
}

/// Zero of the linear function between the two ends of an edge.
fn vertex(volume: &Tsdf, edge: u64) -> [f32; 3] {
    let (block, voxel, axis) = ((edge >> 11) as usize, (edge >> 2 & 511) as usize, (edge & 3) as usize);
    let mut at = [voxel % SIDE, voxel / SIDE % SIDE, voxel / SIDE / SIDE];
    let size = volume.params().voxel;
    let key = volume.keys()[block];
    let mut position = block_origin(key, size) + glam::DVec3::from_array(at.map(|v| v as f64 * size));
    let a = volume.block(block).value(voxel, 0.0).unwrap_or(0.0);
    at[axis] += 1;
    let mut step = [0; 3];
    step[axis] = (at[axis] / SIDE) as i64;
    at[axis] %= SIDE;
    let other = if step[axis] == 0 { Some(block) } else { volume.neighbour(key, step) };
    let end = (at[2] * SIDE + at[1]) * SIDE + at[0];
    let b = other.and_then(|o| volume.block(o).value(end, 0.0)).unwrap_or(-a);
    let (a, b) = (f64::from(a), f64::from(b));
    position[axis] += size * if a == b { 0.5 } else { (a / (a - b)).clamp(0.0, 1.0) };
    position.as_vec3().to_array()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Scene, orbit};
    use super::super::tsdf::TsdfParams;
    use super::super::view::{FusionView, Selection};
    use super::*;
    use glam::DVec3;
    use std::collections::BTreeMap;

    #[test]
    fn every_case_is_a_closed_cut() {
        for inside in 0..256usize {
            let mut directed = BTreeMap::new();
            for t in &TRIANGLES[inside] {
                for i in 0..3 {
                    *directed.entry((t[i], t[(i + 1) % 3])).or_insert(0) += 1;
                }
            }
            for (low, axis) in EDGES {
                let crossed = (inside >> low ^ inside >> (low | 1 << axis)) & 1 == 1;
                let edge = edge_between(low, low | 1 << axis);
                assert_eq!(crossed, TRIANGLES[inside].iter().flatten().any(|e| *e == edge), "case {inside}");
            }
            // Boundary edges of the patch run along faces and never repeat.
            assert!(directed.values().all(|n| *n == 1), "case {inside}");
        }
    }

    fn sphere_mesh(voxel: f64) -> Mesh {
        let scene = Scene::sphere(0.5);
        let cameras = orbit(40, 240, 2.0);
        let depths: Vec<Vec<f32>> = cameras.iter().map(|c| scene.depth(c)).collect();
        let views: Vec<FusionView> = cameras.iter().zip(&depths).map(|(c, d)| FusionView::new(*c, d)).collect();
        let mut volume = Tsdf::new(TsdfParams::with_voxel(voxel));
        assert!(volume.allocate(&views, Selection::ALL, usize::MAX));
        volume.integrate(&views, Selection::ALL);
        marching_cubes(&volume, 0.5)
    }

    #[test]
    fn a_sphere_is_closed_outward_and_exact() {
        let voxel = 0.02;
        let mesh = sphere_mesh(voxel);
        let point = |i: u32| DVec3::from_array(mesh.vertices[i as usize].map(f64::from));
        let (mut area, mut volume) = (0.0, 0.0);
        let mut edges = BTreeMap::new();
        for t in &mesh.triangles {
            let [a, b, c] = t.map(point);
            let n = (b - a).cross(c - a);
            assert!(n.length() < 1e-7 || n.dot(a + b + c) > 0.0);
            area += 0.5 * n.length();
            volume += a.dot(b.cross(c)) / 6.0;
            for i in 0..3 {
                *edges.entry((t[i], t[(i + 1) % 3])).or_insert(0) += 1;
            }
        }
        let tau = std::f64::consts::TAU;
        assert!((area / (2.0 * tau * 0.25) - 1.0).abs() < 0.01, "area {area}");
        assert!((volume / (2.0 * tau * 0.125 / 3.0) - 1.0).abs() < 0.01, "volume {volume}");
        assert!(edges.iter().all(|(&(a, b), n)| *n == 1 && edges.get(&(b, a)) == Some(&1)), "not watertight");
        let worst = mesh.vertices.iter().map(|v| (glam::Vec3::from_array(*v).length() - 0.5).abs()).fold(0.0, f32::max);
        assert!(f64::from(worst) < 0.1 * voxel, "worst {} voxels", f64::from(worst) / voxel);
    }

    #[test]
    fn threads_do_not_matter() {
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| sphere_mesh(0.04));
        let three = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap().install(|| sphere_mesh(0.04));
        assert!(one == three && !one.is_empty());
    }

    #[test]
    fn an_empty_volume_gives_an_empty_mesh() {
        assert!(marching_cubes(&Tsdf::new(TsdfParams::with_voxel(0.1)), 0.0).is_empty());
    }
}
