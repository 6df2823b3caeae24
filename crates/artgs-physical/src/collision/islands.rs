//! Pieces of a movable part that are apart from the rest of it and through which another part passes: they belong to something else.

use crate::collision::clearance::covering;
use crate::geometry::convert::to_parry;
use crate::geometry::convert::trimesh;
use crate::geometry::hull::Hull;
use crate::geometry::topology::{Sets, cross};
use artgs_core::{AssetLink, Mesh, TexturedMesh};
use glam::DVec3;
use parry3d::query::PointQueryWithLocation as _;
use std::collections::BTreeMap;

/// Removes islands of a link's visual mesh that have no hull within `near`, of those with points of the observed surface, and these
/// points: the clearance between parts removed their hulls. An island has less than the share `most` of the surface.
pub(crate) fn remove_lost(link: &mut AssetLink, hulls: &[Hull], points: &mut Vec<DVec3>, near: f64, most: f64) {
    let mesh = &mut link.visual.mesh;
    let (islands, area) = areas(mesh);
    let count = area.len();
    let all: f64 = area.iter().sum();
    if count < 2 || area.iter().all(|own| *own >= most * all) {
        return;
    }
    let Some(surface) = trimesh(mesh) else { return };
    let owner = |p: &DVec3| {
        let (_, (triangle, _)) = surface.project_local_point_and_get_location(to_parry(*p), false);
        islands[triangle as usize] as usize
    };
    let owners: Vec<usize> = points.iter().map(owner).collect();
    let is_covered = covering(hulls, near);
    let [mut open, mut covered] = [vec![false; count], vec![false; count]];
    for (p, owner) in points.iter().zip(&owners) {
        let found = if is_covered(p) { &mut covered } else { &mut open };
        found[*owner] = true;
    }
    let lost: Vec<bool> = (0..count).map(|i| open[i] && !covered[i] && area[i] < most * all).collect();
    if !lost.contains(&true) {
        return;
    }
    let (mut is_kept, mut is_known) = (islands.iter().map(|i| !lost[*i as usize]), islands.iter());
    mesh.triangles.retain(|_| is_kept.next().unwrap_or(false));
    link.visual.evidence.retain(|_| is_known.next().is_some_and(|i| !lost[*i as usize]));
    remove_unused(&mut link.visual);
    let mut owner = owners.iter();
    points.retain(|_| owner.next().is_some_and(|i| !lost[*i]));
}

/// A mesh without islands, which have less than the share `most` of its surface; their points are kept. None if it has none.
pub(crate) fn without_islands(mesh: &Mesh, most: f64) -> Option<Mesh> {
    let (islands, area) = areas(mesh);
    let all: f64 = area.iter().sum();
    let is_main = |island: u32| area[island as usize] >= most * all;
    let kept = islands.iter().zip(&mesh.triangles).filter(|(island, _)| is_main(**island)).map(|(_, t)| *t);
    let triangles: Vec<[u32; 3]> = kept.collect();
    (triangles.len() < mesh.triangles.len()).then(|| Mesh { triangles, ..mesh.clone() })
}

/// Number of the island of each triangle, and twice the area of each island.
fn areas(mesh: &Mesh) -> (Vec<u32>, Vec<f64>) {
    let islands = islands(mesh);
    let mut area = vec![0.0; islands.iter().max().map_or(0, |most| *most as usize + 1)];
    islands.iter().zip(&mesh.triangles).for_each(|(i, t)| area[*i as usize] += cross(mesh, *t).length());
    (islands, area)
}

/// Removes vertices without triangles.
fn remove_unused(visual: &mut TexturedMesh) {
    let mut places = vec![u32::MAX; visual.mesh.vertices.len()];
    let mut used = Vec::new();
    for v in visual.mesh.triangles.as_flattened_mut() {
        let place = &mut places[*v as usize];
        if *place == u32::MAX {
            *place = used.len() as u32;
            used.push(*v as usize);
        }
        *v = *place;
    }
    visual.mesh.vertices = picked(&visual.mesh.vertices, &used);
    visual.mesh.colors = picked(&visual.mesh.colors, &used);
    visual.normals = picked(&visual.normals, &used);
    visual.uvs = picked(&visual.uvs, &used);
}

/// Values of some vertices; none if there is none per vertex.
fn picked<T: Copy>(values: &[T], used: &[usize]) -> Vec<T> {
    used.iter().filter_map(|v| values.get(*v).copied()).collect()
}

/// Number of the island of each triangle: triangles with a common corner are of the same one.
fn islands(mesh: &Mesh) -> Vec<u32> {
    let mut sets = Sets::new(mesh.vertices.len());
    // Vertices are doubled along seams.
    let mut first: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    for (i, v) in mesh.vertices.iter().enumerate() {
        let same = *first.entry(v.map(f32::to_bits)).or_insert(i as u32);
        sets.join(same, i as u32);
    }
    mesh.triangles.iter().for_each(|[a, b, c]| {
        sets.join(*a, *b);
        sets.join(*b, *c);
    });
    let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
    let number = |t: &[u32; 3]| {
        let next = numbers.len() as u32;
        *numbers.entry(sets.find(t[0])).or_insert(next)
    };
    mesh.triangles.iter().map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_large_pieces_are_no_islands() {
        let mut mesh = Mesh::cuboid([0.0; 3], [1.0, 0.1, 0.1]);
        assert_eq!(without_islands(&mesh, 0.1), None);
        mesh.append(&Mesh::cuboid([1.1, 0.0, 0.0], [1.3, 0.1, 0.1]));
        assert_eq!(without_islands(&mesh, 0.1), None);
        mesh.append(&Mesh::cuboid([1.4, 0.0, 0.0], [1.45, 0.1, 0.1]));
        assert_eq!(without_islands(&mesh, 0.1).unwrap().triangles, mesh.triangles[..24]);
    }

    #[test]
    fn an_island_without_hulls_goes_and_one_with_hulls_stays() {
        let boxes =
            [[-2.0, 1.0], [1.1, 1.2], [1.3, 1.4]].map(|[low, high]| Mesh::cuboid([low, 0.0, 0.0], [high, 0.1, 0.1]));
        let mut mesh = Mesh::default();
        boxes.iter().for_each(|part| mesh.append(part));
        let hull = |of: &Mesh| Hull::of(&crate::geometry::topology::points(of).collect::<Vec<_>>(), 1e-3).unwrap();
        let middle = |of: &Mesh| crate::geometry::topology::points(of).sum::<DVec3>() / 8.0;
        let front = |of: &Mesh| middle(of) + DVec3::new(0.0, 0.05, 0.0);
        let before: Vec<DVec3> = boxes.iter().map(front).collect();
        // Of the third box no point was observed.
        for (hulls, points, kept) in [
            (vec![&boxes[0], &boxes[1]], &before[..2], 36),
            (vec![&boxes[0]], &before[..2], 24),
            (vec![&boxes[1]], &before[..2], 36),
            (vec![&boxes[0]], &before[..], 12),
        ] {
            let visual = TexturedMesh { mesh: mesh.clone(), ..TexturedMesh::default() };
            let (mut link, mut left) = (AssetLink { visual, ..AssetLink::default() }, points.to_vec());
            let hulls: Vec<Hull> = hulls.into_iter().map(hull).collect();
            remove_lost(&mut link, &hulls, &mut left, 0.02, 0.1);
            assert_eq!(link.visual.mesh.triangles.len(), kept);
            assert_eq!(link.visual.mesh.vertices.len(), 8 * kept / 12);
            assert_eq!(left.len(), points.len() - (36 - kept) / 12);
        }
    }
}
