//! Adjacency of triangles, and splitting of meshes into manifolds.

use artgs_core::Mesh;
use glam::DVec3;

/// Marks a missing twin or index.
pub(crate) const NONE: u32 = u32::MAX;

/// A vertex in double precision.
pub(crate) fn point(mesh: &Mesh, vertex: u32) -> DVec3 {
    DVec3::from_array(mesh.vertices[vertex as usize].map(f64::from))
}

/// All vertices in double precision.
pub(crate) fn points(mesh: &Mesh) -> impl Iterator<Item = DVec3> + '_ {
    mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from)))
}

/// Lowest and highest corner of the box around a mesh; none without vertices.
pub(crate) fn bounds(mesh: &Mesh) -> Option<[DVec3; 2]> {
    points(mesh).map(|p| [p, p]).reduce(|[low, high], [p, _]| [low.min(p), high.max(p)])
}

/// Corners of a triangle in double precision.
pub(crate) fn corners(mesh: &Mesh, triangle: [u32; 3]) -> [DVec3; 3] {
    triangle.map(|v| point(mesh, v))
}

/// Half-edge after `h` in its triangle; half-edge `3 t + k` runs from corner `k` of triangle `t` to the next corner.
pub(crate) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// Start and end vertex of a half-edge.
pub(crate) fn ends(triangles: &[[u32; 3]], h: u32) -> [u32; 2] {
    let t = triangles[h as usize / 3];
    [t[h as usize % 3], t[next(h) as usize % 3]]
}

/// Half-edges sorted by their edge, in either direction.
fn by_edge(triangles: &[[u32; 3]]) -> Vec<(u64, u32)> {
    let key = |h: u32| {
        let [a, b] = ends(triangles, h);
        u64::from(a.min(b)) << 32 | u64::from(a.max(b))
    };
    // Sorted into a bucket per lower vertex first: a vertex has few edges.
    let lower = |h: u32| (key(h) >> 32) as usize;
    let vertices = triangles.iter().flatten().max().map_or(0, |most| *most as usize + 1);
    let mut next_of = vec![0_u32; vertices + 1];
    (0..3 * triangles.len() as u32).for_each(|h| next_of[lower(h) + 1] += 1);
    (0..vertices).for_each(|v| next_of[v + 1] += next_of[v]);
    let mut keyed = vec![(0, 0); 3 * triangles.len()];
    for h in 0..3 * triangles.len() as u32 {
        let place = &mut next_of[lower(h)];
        keyed[*place as usize] = (key(h), h);
        *place += 1;
    }
    keyed.chunk_by_mut(|a, b| a.0 >> 32 == b.0 >> 32).for_each(<[(u64, u32)]>::sort_unstable);
    keyed
}

/// The half-edge that runs the other way along the same edge, for every half-edge; [`NONE`] at borders. Where more than two
/// triangles meet, pairs with solid between them are joined, so that solids that touch along an edge are separated.
pub(crate) fn twins(mesh: &Mesh) -> Vec<u32> {
    let mut twins = vec![NONE; 3 * mesh.triangles.len()];
    let mut join = |a: u32, b: u32| {
        twins[a as usize] = b;
        twins[b as usize] = a;
    };
    for run in by_edge(&mesh.triangles).chunk_by(|a, b| a.0 == b.0) {
        let forward = |h: u32| ends(&mesh.triangles, h)[0] == (run[0].0 >> 32) as u32;
        match run {
            [_] => {}
            [a, b] if forward(a.1) != forward(b.1) => join(a.1, b.1),
            _ => pair_around(mesh, run, &forward, &mut join),
        }
    }
    twins
}

/// Pairs the half-edges of an edge with many triangles: going around the edge, one that runs backward opens solid and the
/// forward one that follows closes it.
fn pair_around(mesh: &Mesh, run: &[(u64, u32)], forward: &dyn Fn(u32) -> bool, join: &mut dyn FnMut(u32, u32)) {
    let [a, b] = [(run[0].0 >> 32) as u32, run[0].0 as u32];
    let (origin, along) = (point(mesh, a), (point(mesh, b) - point(mesh, a)).normalize_or(DVec3::X));
    let x = along.any_orthonormal_vector();
    let y = along.cross(x);
    let angle = |h: u32| {
        let apex = ends(&mesh.triangles, next(h))[1];
        let d = point(mesh, apex) - origin;
        d.dot(y).atan2(d.dot(x))
    };
    let mut around: Vec<(f64, u32)> = run.iter().map(|(_, h)| (angle(*h), *h)).collect();
    around.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
    let mut ring: Vec<u32> = around.into_iter().map(|(_, h)| h).collect();
    while let Some(i) = (0..ring.len()).find(|i| !forward(ring[*i]) && forward(ring[(i + 1) % ring.len()])) {
        let j = (i + 1) % ring.len();
        join(ring[i], ring[j]);
        ring.remove(i.max(j));
        ring.remove(i.min(j));
    }
}

/// Disjoint sets; the root of a set is its smallest member.
pub(crate) struct Sets(Vec<u32>);

impl Sets {
    pub(crate) fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    pub(crate) fn find(&mut self, mut i: u32) -> u32 {
        while self.0[i as usize] != i {
            self.0[i as usize] = self.0[self.0[i as usize] as usize];
            i = self.0[i as usize];
        }
        i
    }

    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

/// Share of the distance by which vertices are moved apart, so that other programs do not weld them.
pub(crate) const NUDGE: f64 = 1e-3;

/// The same triangles with vertices split until every vertex has one fan of triangles, each of which meets the next at an
/// edge; unused vertices are removed. A `nudge` above 0 moves copies towards their own fan by that share of the distance, so
/// that other programs do not weld them.
pub(crate) fn split_to_manifold(mesh: &Mesh, nudge: f64) -> Mesh {
    let twins = twins(mesh);
    let mut fans = Sets::new(twins.len());
    for (h, twin) in twins.iter().enumerate().filter(|(_, t)| **t != NONE) {
        fans.join(h as u32, next(*twin));
        fans.join(next(h as u32), *twin);
    }
    let colored = mesh.colors.len() == mesh.vertices.len();
    let mut first_of = vec![NONE; mesh.vertices.len()];
    let mut index = vec![NONE; twins.len()];
    let mut out = Mesh::default();
    let mut copies = Vec::new();
    for h in 0..twins.len() as u32 {
        let (root, vertex) = (fans.find(h) as usize, ends(&mesh.triangles, h)[0] as usize);
        if index[root] == NONE {
            index[root] = out.vertices.len() as u32;
            if first_of[vertex] == NONE {
                first_of[vertex] = index[root];
            } else {
                copies.extend([first_of[vertex], index[root]]);
            }
            out.vertices.push(mesh.vertices[vertex]);
            if colored {
                out.colors.push(mesh.colors[vertex]);
            }
        }
        index[h as usize] = index[root];
    }
    out.triangles = index.as_chunks::<3>().0.to_vec();
    if nudge > 0.0 && !copies.is_empty() {
        pull_to_fans(&mut out, &copies, nudge);
    }
    if nudge > 0.0 {
        part_double_edges(&mut out, twins, nudge);
    }
    out
}

/// If two pairs of triangles still share both ends of their edge, one pair gets its own vertex in the middle.
fn part_double_edges(mesh: &mut Mesh, twins: Vec<u32>, nudge: f64) {
    let mut touched = vec![false; mesh.triangles.len()];
    let mut middles = Vec::new();
    let keyed = by_edge(&mesh.triangles);
    for run in keyed.chunk_by(|a, b| a.0 == b.0).filter(|run| run.len() > 2) {
        // The first pair keeps the edge.
        let kept = [run[0].1, twins[run[0].1 as usize]];
        for h in run.iter().map(|(_, h)| *h).filter(|h| !kept.contains(h)) {
            let twin = twins[h as usize];
            if twin != NONE && h < twin && ![h, twin].iter().any(|h| touched[*h as usize / 3]) {
                [h, twin].iter().for_each(|h| touched[*h as usize / 3] = true);
                middles.push([h, twin]);
            }
        }
    }
    for pair in middles {
        let middle = split_edge(mesh, &pair);
        let apexes = pair.map(|h| ends(&mesh.triangles, next(h))[1]);
        let inward = (point(mesh, apexes[0]) + point(mesh, apexes[1])) / 2.0;
        mesh.vertices[middle as usize] = point(mesh, middle).lerp(inward, nudge).as_vec3().to_array();
    }
}

/// Splits an edge, given as its one or two half-edges, at its middle and halves their triangles. The first halves keep their
/// indices and half-edges, the second halves are appended. Returns the new vertex.
fn split_edge(mesh: &mut Mesh, edge: &[u32]) -> u32 {
    let [a, b] = ends(&mesh.triangles, edge[0]);
    let middle = mesh.vertices.len() as u32;
    mesh.vertices.push(((point(mesh, a) + point(mesh, b)) / 2.0).as_vec3().to_array());
    if !mesh.colors.is_empty() {
        let [p, q] = [a, b].map(|v| mesh.colors[v as usize]);
        mesh.colors.push([0, 1, 2].map(|k| p[k].midpoint(q[k])));
    }
    for h in edge {
        let (t, k) = (*h as usize / 3, *h as usize % 3);
        let mut second = mesh.triangles[t];
        second[k] = middle;
        mesh.triangles[t][(k + 1) % 3] = middle;
        mesh.triangles.push(second);
    }
    middle
}

/// Halves edges, longest first, until none is longer than `longest` (scene units, positive).
pub(crate) fn refine(mesh: &mut Mesh, longest: f64) {
    // Every round halves many edges; thirty rounds reduce a kilometre to a micrometre.
    for _ in 0..30 {
        let twins = twins(mesh);
        let length = |h: u32| {
            let [a, b] = ends(&mesh.triangles, h).map(|v| point(mesh, v));
            a.distance(b)
        };
        let single = (0..twins.len() as u32).filter(|h| twins[*h as usize] > *h);
        let mut long: Vec<(f64, u32)> = single.map(|h| (length(h), h)).filter(|(l, _)| *l > longest).collect();
        if long.is_empty() {
            return;
        }
        long.sort_unstable_by(|p, q| q.0.total_cmp(&p.0).then(p.1.cmp(&q.1)));
        let mut touched = vec![false; mesh.triangles.len()];
        for (_, h) in long {
            let twin = twins[h as usize];
            let edge: Vec<u32> = [h, twin].into_iter().filter(|h| *h != NONE).collect();
            if edge.iter().any(|h| touched[*h as usize / 3]) {
                continue;
            }
            edge.iter().for_each(|h| touched[*h as usize / 3] = true);
            split_edge(mesh, &edge);
        }
    }
}

fn pull_to_fans(mesh: &mut Mesh, vertices: &[u32], by: f64) {
    let mut sums = vec![(DVec3::ZERO, 0.0); mesh.vertices.len()];
    for t in &mesh.triangles {
        let [a, b, c] = corners(mesh, *t);
        for v in t {
            sums[*v as usize].0 += (a + b + c) / 3.0;
            sums[*v as usize].1 += 1.0;
        }
    }
    let mut vertices = vertices.to_vec();
    vertices.sort_unstable();
    vertices.dedup();
    for v in vertices {
        let (sum, count) = sums[v as usize];
        let p = point(mesh, v);
        mesh.vertices[v as usize] = p.lerp(sum / count, by).as_vec3().to_array();
    }
}

/// Edges that are not shared by exactly two triangles running along them in opposite directions: 0 for a closed mesh.
pub(crate) fn open_edges(triangles: &[[u32; 3]]) -> usize {
    let keyed = by_edge(triangles);
    let runs = keyed.chunk_by(|a, b| a.0 == b.0);
    let proper = |run: &[(u64, u32)]| run.len() == 2 && ends(triangles, run[0].1)[0] != ends(triangles, run[1].1)[0];
    runs.filter(|run| !proper(run)).count()
}

/// Volume inside a closed mesh, scene units cubed; negative if it is inside out.
pub(crate) fn signed_volume(mesh: &Mesh) -> f64 {
    // Relative to the first vertex, so that meshes far from the origin lose no digits.
    let Some(o) = mesh.triangles.first().map(|t| point(mesh, t[0])) else { return 0.0 };
    let six = |t: &[u32; 3]| {
        let [a, b, c] = corners(mesh, *t).map(|p| p - o);
        a.cross(b).dot(c)
    };
    mesh.triangles.iter().map(six).sum::<f64>() / 6.0
}

/// Twice the area of a triangle along its normal.
pub(crate) fn cross(mesh: &Mesh, triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = corners(mesh, triangle);
    (b - a).cross(c - a)
}

/// Smallest triangle of every triangle's component (joined at edges).
pub(crate) fn components(twins: &[u32]) -> Vec<u32> {
    let mut sets = Sets::new(twins.len() / 3);
    for (h, twin) in twins.iter().enumerate().filter(|(_, t)| **t != NONE) {
        sets.join(h as u32 / 3, twin / 3);
    }
    (0..twins.len() as u32 / 3).map(|t| sets.find(t)).collect()
}

/// Unit normals of the vertices, triangles weighted by their angle at the vertex; zero for unused vertices.
pub(crate) fn vertex_normals(mesh: &Mesh) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; mesh.vertices.len()];
    for t in &mesh.triangles {
        let p = corners(mesh, *t);
        let n = (p[1] - p[0]).cross(p[2] - p[0]).normalize_or_zero();
        for k in 0..3 {
            normals[t[k] as usize] += n * corner_angle(p, k);
        }
    }
    normals.iter().map(|n| n.normalize_or_zero()).collect()
}

/// Angle of a triangle at corner `k`, radians; 0 if it is degenerate.
pub(crate) fn corner_angle(p: [DVec3; 3], k: usize) -> f64 {
    let (u, v) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
    u.cross(v).length().atan2(u.dot(v))
}

/// Diagonal of the box around all meshes.
pub(crate) fn diagonal(meshes: &[&Mesh]) -> f64 {
    let boxes = meshes.iter().filter_map(|m| bounds(m));
    boxes.reduce(|[l, h], [low, high]| [l.min(low), h.max(high)]).map_or(0.0, |[low, high]| low.distance(high))
}

#[cfg(test)]
pub(crate) mod testing {
    use super::*;

    /// The faces of an axis-aligned box that `keep` keeps (-x, +x, -y, +y, -z, +z), each of `n` by `n` quads, outward.
    pub(crate) fn open_box(size: DVec3, n: u32, keep: [bool; 6]) -> Mesh {
        let mut mesh = Mesh::default();
        for face in (0..6).filter(|f| keep[*f]) {
            let axis = face / 2;
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let base = mesh.vertices.len() as u32;
            for i in 0..=n {
                for j in 0..=n {
                    let mut p = DVec3::ZERO;
                    p[axis] = (face % 2) as f64;
                    p[u] = f64::from(i) / f64::from(n);
                    p[v] = f64::from(j) / f64::from(n);
                    mesh.vertices.push((p * size).as_vec3().to_array());
                    mesh.colors.push([40 * face as u8, 100, 200]);
                }
            }
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let at = |i: u32, j: u32| base + i * (n + 1) + j;
                let q = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let pair = if face % 2 == 1 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
                mesh.triangles.extend(pair.map(|t| t.map(|k: usize| q[k])));
            }
        }
        mesh
    }

    /// A sphere around the origin: a cube of `n` by `n` quads per face, projected to the sphere.
    pub(crate) fn sphere(radius: f64, n: u32) -> Mesh {
        let mut mesh = open_box(DVec3::splat(2.0), n, [true; 6]);
        for v in &mut mesh.vertices {
            let p = DVec3::from_array(v.map(f64::from)) - DVec3::ONE;
            *v = (p.normalize() * radius).as_vec3().to_array();
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::testing::*;
    use super::*;

    #[test]
    fn half_edges_are_in_the_order_of_their_edges() {
        let mut mesh = sphere(1.0, 7);
        // Vertices without triangles, and triangles that share an edge twice.
        mesh.vertices.splice(0..0, [[9.0; 3]; 5]);
        mesh.triangles.iter_mut().for_each(|t| *t = t.map(|v| v + 5));
        mesh.triangles.extend(mesh.triangles[..4].to_vec());
        let found = by_edge(&mesh.triangles);
        assert!(found.is_sorted() && found.len() == 3 * mesh.triangles.len());
        let mut half_edges: Vec<u32> = found.iter().map(|(_, h)| *h).collect();
        half_edges.sort_unstable();
        assert!(half_edges.into_iter().eq(0..3 * mesh.triangles.len() as u32));
        assert_eq!(by_edge(&[]), []);
    }

    #[test]
    fn long_edges_are_halved_and_nothing_opens() {
        let mut block = crate::geometry::weld::welded(&open_box(DVec3::new(1.0, 2.0, 0.3), 1, [true; 6]), 1e-6);
        refine(&mut block, 0.2);
        let lengths = (0..3 * block.triangles.len() as u32).map(|h| {
            let [a, b] = ends(&block.triangles, h).map(|v| point(&block, v));
            a.distance(b)
        });
        assert!(lengths.fold(0.0, f64::max) <= 0.2 && open_edges(&block.triangles) == 0);
        assert!((signed_volume(&block) - 0.6).abs() < 1e-6 && block.triangles.len() < 2000);
    }

    #[test]
    fn two_boxes_that_touch_along_an_edge_come_apart() {
        let one = crate::geometry::weld::welded(&open_box(DVec3::ONE, 1, [true; 6]), 1e-6);
        assert_eq!((one.vertices.len(), open_edges(&one.triangles)), (8, 0));
        let mut two = one.clone();
        two.append(&one.moved(&artgs_core::Rigid::shift(DVec3::new(1.0, 1.0, 0.0))));
        let touching = crate::geometry::weld::welded(&two, 1e-6);
        assert_eq!((touching.vertices.len(), open_edges(&touching.triangles)), (14, 1));
        let apart = split_to_manifold(&touching, 1e-3);
        assert_eq!((apart.vertices.len(), open_edges(&apart.triangles)), (16, 0));
        assert_eq!(open_edges(&crate::geometry::weld::welded(&apart, 1e-6).triangles), 0, "also when welded again");
        assert!((signed_volume(&apart) - 2.0).abs() < 0.02);
        let parts = components(&twins(&apart));
        assert!(parts.iter().all(|p| *p == parts[0] || *p == 12) && parts[0] == 0);
    }
}
