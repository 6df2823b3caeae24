//! Caps: triangulations of rims.

use super::loops::{Flat, flatten};
use super::{Obstacles, RepairOptions};
use crate::geometry::convert::to_parry;
use crate::geometry::convert::trimesh;
use crate::geometry::topology::{components, corners, cross, ends, point, twins};
use crate::settings::RepairSettings;
use artgs_core::Mesh;
use glam::{DVec2, DVec3};
use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast, RayCullingMode};
use parry3d::shape::TriMesh;
use std::collections::HashSet;

/// Triangles that close a hole.
pub(super) struct Cap {
    /// Triangles of the pieces that other parts do not move through and that do not pass through the surface.
    pub(super) triangles: Vec<[u32; 3]>,
    /// True if no piece is missing.
    pub(super) whole: bool,
    /// Distance of the points at which a large cap is tested; none for small ones, which stay.
    step: Option<f64>,
}

impl Cap {
    /// A cap without pieces.
    fn none(whole: bool) -> Self {
        Self { triangles: Vec::new(), whole, step: None }
    }

    /// Removes the triangles that hide the outer side of the surface from a large cap that passes through it: with the solid behind
    /// more than a fraction of it, and nothing but air behind as much. Air only is behind the back of a compartment: it
    /// becomes a wall. `noise`: distance from the cap at which its sides are looked at.
    fn remove_crossing(&mut self, mesh: &Mesh, surface: &TriMesh, noise: f64, settings: &RepairSettings) {
        let (least, Some(step)) = (settings.obstructed, self.step) else { return };
        // Behind a cap is the solid if its inner side looks at the inner side of the surface.
        let is_solid = |p: DVec3, normal: DVec3| meets_outside(surface, p - normal * noise, -normal) == Some(false);
        let solid = share(mesh, &self.triangles, step, is_solid);
        if solid <= least || solid >= 1.0 - least {
            return;
        }
        let before = self.triangles.len();
        // What is before the cap was seen.
        let hides = |p: DVec3, normal: DVec3| meets_outside(surface, p + normal * noise, normal) == Some(true);
        let stays = |p: DVec3, normal: DVec3| is_solid(p, normal) || !hides(p, normal);
        self.triangles.retain(|t| share(mesh, std::slice::from_ref(t), step, stays) >= settings.hidden);
        self.whole &= self.triangles.len() == before;
    }
}

/// True if a ray first meets the outer side of the surface; none if it meets nothing.
fn meets_outside(surface: &TriMesh, from: DVec3, along: DVec3) -> Option<bool> {
    /// Factor of a distance that holds it in spite of rounding.
    const BEYOND: f32 = 1.01;
    let ray = Ray::new(to_parry(from), to_parry(along));
    let first = surface.cast_local_ray(&ray, f32::MAX, false)?;
    let back = surface.cast_local_ray_with_culling(&ray, first * BEYOND, RayCullingMode::IgnoreFrontfaces);
    Some(back.is_none_or(|back| back.time_of_impact > first))
}

/// Caps for all holes, without the pieces that other parts move through and what hides the surface of caps that pass through it. A
/// component gets no caps if they would enclose less than half of a wall: a sheet, or a compartment seen from inside.
pub(super) fn close(mesh: &mut Mesh, holes: &[Vec<u32>], obstacles: &Obstacles, options: &RepairOptions) -> Vec<Cap> {
    let settings = &options.settings;
    let component = components(&twins(mesh));
    let mut of_vertex = vec![0; mesh.vertices.len()];
    for (t, c) in mesh.triangles.iter().zip(&component) {
        t.iter().for_each(|v| of_vertex[*v as usize] = *c as usize);
    }
    let mut book = Caps::new(mesh, holes);
    let mut caps: Vec<Cap> = holes.iter().map(|hole| book.close(mesh, hole, obstacles, options)).collect();
    let mut all = Mesh { colors: Vec::new(), ..mesh.clone() };
    caps.iter().for_each(|cap| all.triangles.extend(&cap.triangles));
    if let Some(surface) = trimesh(&all) {
        let noise = settings.noise * options.rim_smoothing;
        caps.iter_mut().for_each(|cap| cap.remove_crossing(mesh, &surface, noise, settings));
    }
    let mut volumes = vec![[0.0; 2]; mesh.triangles.len()];
    let about = mesh.triangles.first().map_or(DVec3::ZERO, |t| point(mesh, t[0]));
    let mut add = |c: usize, t: &[u32; 3]| {
        let [a, b, c3] = corners(mesh, *t).map(|p| p - about);
        volumes[c][0] += a.cross(b).dot(c3) / 6.0;
        volumes[c][1] += (b - a).cross(c3 - a).length() / 2.0;
    };
    mesh.triangles.iter().zip(&component).for_each(|(t, c)| add(*c as usize, t));
    let owner = |hole: &[u32]| of_vertex[hole[0] as usize];
    let mut partly = vec![false; mesh.triangles.len()];
    for (hole, cap) in holes.iter().zip(&caps) {
        cap.triangles.iter().for_each(|t| add(owner(hole), t));
        partly[owner(hole)] |= !cap.whole;
    }
    for (hole, cap) in holes.iter().zip(&mut caps) {
        let [volume, area] = volumes[owner(hole)];
        if !partly[owner(hole)] && volume < settings.sheet * options.thickness * area {
            *cap = Cap::none(false);
        }
    }
    caps
}

/// Edges and surfaces that caps must not intersect.
struct Caps {
    /// Existing edges, which caps must not use again.
    taken: HashSet<[u32; 2]>,
    /// The mesh without caps.
    surface: Option<TriMesh>,
}

impl Caps {
    /// For a mesh with these rims.
    fn new(mesh: &Mesh, holes: &[Vec<u32>]) -> Self {
        let mut on_rim = vec![false; mesh.vertices.len()];
        holes.iter().flatten().for_each(|v| on_rim[*v as usize] = true);
        let edges = (0..3 * mesh.triangles.len() as u32).map(|h| ends(&mesh.triangles, h));
        let both = edges.filter(|e| e.iter().all(|v| on_rim[*v as usize]));
        Self { taken: both.map(|[a, b]| [a.min(b), a.max(b)]).collect(), surface: trimesh(mesh) }
    }

    /// Closes a hole in pieces that nearly lie in planes. Vertices that pieces need are added to the mesh.
    fn close(&mut self, mesh: &mut Mesh, hole: &[u32], obstacles: &Obstacles, o: &RepairOptions) -> Cap {
        let settings = &o.settings;
        let width = flatten(mesh, hole).width;
        let hole_is_large = width > o.small_hole;
        let mut closed = Cap { step: hole_is_large.then_some(width / settings.tested), ..Cap::none(true) };
        let mut rest = vec![hole.to_vec()];
        while let Some(piece) = rest.pop() {
            let flat = flatten(mesh, &piece);
            let large = flat.width > o.small_hole;
            let allowed = settings.planarity * flat.width;
            let crooked = large && (flat.deviation > allowed || flat.farthest > settings.corner * allowed);
            let mut cap = None;
            if !crooked {
                cap = Some(clip_ears(&piece, &flat, &self.taken, mesh.vertices.len() as u32));
            }
            // A cap that cuts through the part is divided into smaller pieces as long as its rim can be halved.
            let cuts = |(cap, center): &(Vec<[u32; 3]>, bool)| {
                large && !center && self.pierces_any(mesh, cap, settings.chord_end)
            };
            if cap.as_ref().is_none_or(cuts)
                && let Some((i, j)) = self.narrowest(mesh, &piece, settings)
            {
                self.taken.insert([piece[i].min(piece[j]), piece[i].max(piece[j])]);
                rest.push(piece[i..=j].to_vec());
                rest.push(piece[j..].iter().chain(&piece[..=i]).copied().collect());
                continue;
            }
            let (cap, center) =
                cap.unwrap_or_else(|| clip_ears(&piece, &flat, &self.taken, mesh.vertices.len() as u32));
            if center {
                push_mean(mesh, &piece);
            }
            let edges = cap.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
            self.taken.extend(edges.map(|[a, b]| [a.min(b), a.max(b)]));
            let harmless = !hole_is_large || mean_width(mesh, &piece, &cap) < settings.strip * o.small_hole;
            // Not finer than the mesh.
            let step = (flat.width / settings.tested).max(o.small_hole / settings.small_hole);
            let is_taken = |p: DVec3, _| (obstacles.empty)(p) || !harmless && (obstacles.passed)(p);
            if share(mesh, &cap, step, is_taken) <= settings.obstructed {
                closed.triangles.extend(cap);
            } else {
                closed.whole = false;
            }
        }
        closed
    }

    /// The chord between two corners of a rim with the smallest ratio of its length to the path along the rim, if possible one
    /// that does not cut through the surface; neither side is a short part of the rim, and the edge is unused.
    fn narrowest(&self, mesh: &Mesh, rim: &[u32], settings: &RepairSettings) -> Option<(usize, usize)> {
        let n = rim.len();
        let points: Vec<DVec3> = rim.iter().map(|v| point(mesh, *v)).collect();
        let mut along = vec![0.0];
        for i in 0..n {
            along.push(along[i] + points[i].distance(points[(i + 1) % n]));
        }
        let all = along[n];
        // On long rims only a few hundred corners are tested.
        let stride = n.div_ceil(settings.chord_ends);
        let mut chords = Vec::new();
        for i in (0..n).step_by(stride) {
            for j in (i + 2..n).step_by(stride) {
                let way = (along[j] - along[i]).min(all - along[j] + along[i]);
                if way >= settings.chord_way * all && (i, j) != (0, n - 1) {
                    chords.push((points[i].distance_squared(points[j]) / (way * way), i, j));
                }
            }
        }
        let free = |c: &&(f64, usize, usize)| !self.taken.contains(&[rim[c.1].min(rim[c.2]), rim[c.1].max(rim[c.2])]);
        let first = chords.len().min(settings.chords);
        if first < chords.len() {
            chords.select_nth_unstable_by(first, |a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        }
        chords.truncate(first);
        chords.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let clear = chords.iter().filter(free).find(|c| !self.pierces(points[c.1], points[c.2], settings.chord_end));
        clear.or_else(|| chords.iter().find(free)).map(|c| (c.1, c.2))
    }

    /// True if an edge of a cap cuts through the surface.
    fn pierces_any(&self, mesh: &Mesh, cap: &[[u32; 3]], end: f64) -> bool {
        let edges = cap.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]);
        let mut inner = edges.filter(|[a, b]| !self.taken.contains(&[*a.min(b), *a.max(b)]));
        inner.any(|[a, b]| self.pierces(point(mesh, a), point(mesh, b), end))
    }

    /// True if a straight line, shortened by the share `end` at both ends, cuts through the surface.
    fn pierces(&self, a: DVec3, b: DVec3, end: f64) -> bool {
        let [from, way] =
            [a.lerp(b, end), (b - a) * (1.0 - 2.0 * end)].map(|p| Vector::from_array(p.as_vec3().to_array()));
        self.surface.as_ref().is_some_and(|s| s.intersects_local_ray(&Ray::new(from, way), 1.0))
    }
}

/// Adds a vertex in the middle of others.
fn push_mean(mesh: &mut Mesh, of: &[u32]) {
    let n = of.len() as f32;
    let mean = |get: &dyn Fn(usize) -> f32| of.iter().map(|v| get(*v as usize)).sum::<f32>() / n;
    let position = [0, 1, 2].map(|k| mean(&|v| mesh.vertices[v][k]));
    if mesh.colors.len() == mesh.vertices.len() {
        let color = [0, 1, 2].map(|k| mean(&|v| f32::from(mesh.colors[v][k])).round() as u8);
        mesh.colors.push(color);
    }
    mesh.vertices.push(position);
}

/// Width of a long strip with the same area and rim: twice the area divided by the rim.
fn mean_width(mesh: &Mesh, rim: &[u32], cap: &[[u32; 3]]) -> f64 {
    let twice: f64 = cap.iter().map(|t| cross(mesh, *t).length()).sum();
    let around: f64 = (0..rim.len()).map(|i| point(mesh, rim[i]).distance(point(mesh, rim[(i + 1) % rim.len()]))).sum();
    twice / around.max(f64::MIN_POSITIVE)
}

/// Fraction of the area for which a test of points and unit normals is true, sampled about every `step`.
fn share(mesh: &Mesh, triangles: &[[u32; 3]], step: f64, is_true: impl Fn(DVec3, DVec3) -> bool) -> f64 {
    /// Divisions of an edge at most.
    const MOST: f64 = 60.0;
    let (mut hit, mut all) = (0.0, 0.0);
    for t in triangles {
        let [a, b, c] = corners(mesh, *t);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let n = (longest / step).ceil().clamp(1.0, MOST) as usize;
        let normal = (b - a).cross(c - a);
        let weight = normal.length() / (n * n) as f64;
        let normal = normal.normalize_or_zero();
        for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
            // Centres of the small triangles: those oriented like the large one, then, except in the last row, inverted ones.
            for third in if i + j + 1 < n { &[1.0, 2.0][..] } else { &[1.0][..] } {
                let at = |k: usize| (k as f64 + third / 3.0) / n as f64;
                let p: DVec3 = a + (b - a) * at(i) + (c - a) * at(j);
                all += weight;
                hit += if is_true(p, normal) { weight } else { 0.0 };
            }
        }
    }
    if all > 0.0 { hit / all } else { 0.0 }
}

/// A corner of the remaining polygon.
#[derive(Clone, Copy)]
struct Corner {
    before: usize,
    after: usize,
    /// Quality of its ear, 0 if it is none.
    quality: f64,
}

/// Triangulates a polygon that may be concave, best ears first, without edges that are `taken`. If no ear is left, because
/// the rim crosses itself in its plane or all ears are taken, the rest is a fan around a new vertex `next_vertex`; true if so.
fn clip_ears(hole: &[u32], flat: &Flat, taken: &HashSet<[u32; 2]>, next_vertex: u32) -> (Vec<[u32; 3]>, bool) {
    let n = hole.len();
    let mut ring: Vec<Corner> =
        (0..n).map(|i| Corner { before: (i + n - 1) % n, after: (i + 1) % n, quality: 0.0 }).collect();
    let mut left: Vec<usize> = (0..n).collect();
    left.iter().for_each(|i| ring[*i].quality = ear_quality(*i, &ring, &left, hole, flat, taken));
    let mut triangles = Vec::with_capacity(n - 2);
    while left.len() > 3 {
        let best = |left: &[usize], ring: &[Corner]| {
            (0..left.len()).max_by(|a, b| ring[left[*a]].quality.total_cmp(&ring[left[*b]].quality)).unwrap_or(0)
        };
        let mut at = best(&left, &ring);
        if ring[left[at]].quality <= 0.0 {
            let again: Vec<f64> = left.iter().map(|i| ear_quality(*i, &ring, &left, hole, flat, taken)).collect();
            left.iter().zip(again).for_each(|(i, q)| ring[*i].quality = q);
            at = best(&left, &ring);
        }
        let i = left[at];
        let Corner { before, after, quality } = ring[i];
        if quality <= 0.0 {
            let fan = left.iter().map(|i| [hole[*i], hole[ring[*i].after], next_vertex]);
            triangles.extend(fan);
            return (triangles, true);
        }
        triangles.push([hole[before], hole[i], hole[after]]);
        left.remove(at);
        ring[before].after = after;
        ring[after].before = before;
        for k in [before, after] {
            ring[k].quality = ear_quality(k, &ring, &left, hole, flat, taken);
        }
    }
    triangles.push([hole[ring[left[0]].before], hole[left[0]], hole[ring[left[0]].after]]);
    (triangles, false)
}

/// Twice the area over the squared sides, positive for an ear that may be clipped.
fn ear_quality(i: usize, ring: &[Corner], left: &[usize], hole: &[u32], flat: &Flat, taken: &HashSet<[u32; 2]>) -> f64 {
    /// Quality of a corner that is straight but for rounding.
    const STRAIGHT: f64 = 1e-9;
    let (u, w) = (ring[i].before, ring[i].after);
    let [a, b, c] = [u, i, w].map(|k| flat.points[k]);
    let sides = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
    let quality = (b - a).perp_dot(c - a) / sides.max(f64::MIN_POSITIVE);
    if quality <= STRAIGHT || taken.contains(&[hole[u].min(hole[w]), hole[u].max(hole[w])]) {
        return 0.0;
    }
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let inside = |p: DVec2| {
        p.cmpge(low).all()
            && p.cmple(high).all()
            && (b - a).perp_dot(p - a) >= 0.0
            && (c - b).perp_dot(p - b) >= 0.0
            && (a - c).perp_dot(p - c) >= 0.0
    };
    if left.iter().any(|k| ![u, i, w].contains(k) && inside(flat.points[*k])) { 0.0 } else { quality }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::topology::testing::open_box;

    #[test]
    fn a_cap_that_passes_through_the_surface_loses_what_is_before_it() {
        // A block without its top, and the lower side of a shelf. Squares that face up: the top, the back of a compartment beside the
        // block, both, one that hides the shelf, the top and this one, the top and one that faces down.
        let mut mesh = open_box(DVec3::splat(2.0), 10, [true, true, true, true, true, false]);
        let corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let mut square = |[x, y, z]: [f32; 3]| {
            let at = mesh.vertices.len() as u32;
            mesh.vertices.extend(corners.map(|[u, v]| [x + u, y + v, z]));
            [[at, at + 1, at + 2], [at, at + 2, at + 3]]
        };
        let [top, beside, under, shelf] =
            [[0.0, 0.0, 2.0], [3.0, 0.0, 2.0], [5.0, 0.0, 2.5], [5.0, 0.0, 3.0]].map(&mut square);
        mesh.triangles.extend(shelf.map(|[a, b, c]| [a, c, b]));
        let turned = |of: [[u32; 3]; 2]| of.map(|[a, b, c]| [a, c, b]);
        for (squares, kept) in [
            (vec![top], 2),
            (vec![beside], 2),
            (vec![top, beside], 4),
            (vec![under], 2),
            (vec![top, under], 2),
            (vec![top, turned(under)], 4),
        ] {
            let mut all = mesh.clone();
            let triangles: Vec<[u32; 3]> = squares.into_iter().flatten().collect();
            all.triangles.extend(&triangles);
            let count = triangles.len();
            let mut cap = Cap { triangles, whole: true, step: Some(0.05) };
            cap.remove_crossing(&mesh, &trimesh(&all).unwrap(), 0.05, &RepairSettings::DEFAULT);
            assert_eq!((cap.triangles.len(), cap.whole), (kept, kept == count));
        }
    }
}
