//! Connected groups of surfaces, and which of them are the object.

use super::ObjectConfig;
use super::cloud::{FusedCloud, cube};
use super::planes::Plane;
use glam::{DVec3, IVec3, Vec3};
use std::collections::{HashMap, HashSet};

/// A cube and those within `reach` cubes of it along every axis.
pub(super) fn around(c: IVec3, reach: i32) -> impl Iterator<Item = IVec3> {
    let side = 2 * reach + 1;
    (0..side.pow(3)).map(move |i| c + IVec3::new(i % side, i / side % side, i / (side * side)) - reach)
}

/// Connected groups of cubes that hold points.
pub(crate) struct Components {
    numbers: HashMap<IVec3, usize>,
    edge: f32,
    /// Number of groups.
    pub(crate) count: usize,
}

impl Components {
    /// Connects cubes with at most `gap` empty cubes between them. Numbered in the order of their first cube.
    pub(crate) fn new(points: &[Vec3], edge: f32, gap: i32) -> Self {
        let mut cubes: Vec<IVec3> = points.iter().map(|p| cube(*p, edge)).collect();
        cubes.sort_by_key(|c| c.to_array());
        cubes.dedup();
        let filled: HashSet<IVec3> = cubes.iter().copied().collect();
        let mut numbers: HashMap<IVec3, usize> = HashMap::new();
        let mut count = 0;
        for &c in &cubes {
            if numbers.contains_key(&c) {
                continue;
            }
            let mut stack = vec![c];
            numbers.insert(c, count);
            while let Some(c) = stack.pop() {
                for n in around(c, gap + 1) {
                    if filled.contains(&n) && !numbers.contains_key(&n) {
                        numbers.insert(n, count);
                        stack.push(n);
                    }
                }
            }
            count += 1;
        }
        Self { numbers, edge, count }
    }

    /// Group of a point whose cube holds points.
    pub(crate) fn of(&self, point: Vec3) -> Option<usize> {
        self.numbers.get(&cube(point, self.edge)).copied()
    }
}

/// Shares of the points of each component that moved: of its own ones, and with those of components near it that moved as a whole, because
/// depth cameras see thin things in pieces.
pub(super) fn moved_shares(
    points: &[Vec3],
    numbers: &[Option<usize>],
    moved: &[bool],
    count: usize,
) -> Vec<(f64, f64)> {
    /// Share of the points of a component from which it moved as a whole.
    const WHOLE: f64 = 0.5;
    /// Distance of a piece, as a share of the diagonal of the box of the component.
    const REACH: f32 = 0.3;
    let points = points_of(points, numbers, count);
    let mut counts = vec![0_usize; count];
    numbers.iter().zip(moved).filter(|(_, moved)| **moved).flat_map(|(n, _)| *n).for_each(|n| counts[n] += 1);
    let is_whole = |n: usize| counts[n] as f64 >= WHOLE * points[n].len().max(1) as f64;
    let pieces: Vec<usize> = (0..count).filter(|n| is_whole(*n)).collect();
    let share = |n: usize| {
        let of = pieces.iter().filter(|piece| **piece != n && is_near(&points[n], &points[**piece], REACH));
        let (moved, all) =
            of.fold((counts[n], points[n].len()), |(m, a), piece| (m + counts[*piece], a + points[*piece].len()));
        (counts[n] as f64 / points[n].len().max(1) as f64, moved as f64 / all.max(1) as f64)
    };
    (0..count).map(share).collect()
}

/// The points of each of `count` components.
fn points_of(points: &[Vec3], numbers: &[Option<usize>], count: usize) -> Vec<Vec<Vec3>> {
    let mut out = vec![Vec::new(); count];
    for (p, n) in points.iter().zip(numbers) {
        if let Some(n) = n {
            out[*n].push(*p);
        }
    }
    out
}

/// True if the points of another component come nearer to those of one than this share of the diagonal of its box.
fn is_near(own: &[Vec3], others: &[Vec3], share: f32) -> bool {
    let (lower, upper) = own.iter().fold((Vec3::MAX, Vec3::MIN), |(l, u), p| (l.min(*p), u.max(*p)));
    let reach = (share * lower.distance(upper)).powi(2);
    others.iter().any(|p| own.iter().any(|q| q.distance_squared(*p) < reach))
}

/// The component that the cameras look at most. If nothing of it moved, that of the others that moved, if they look at it, too:
/// things around a slender object may be larger than the object. `moved` are the shares of each component that moved, alone and with its
/// pieces.
pub(super) fn most_attended(attention: &[f64], moved: &[(f64, f64)]) -> Option<usize> {
    /// Share of the points of a component up to which nothing of it moved.
    const STILL: f64 = 0.005;
    /// Share of the points from which it moved.
    const MOVED: f64 = 0.1;
    /// Share of the attention of all components from which the cameras look at one.
    const NOTICED: f64 = 0.05;
    let total: f64 = attention.iter().sum();
    let most = |may: &dyn Fn(usize) -> bool| {
        let order = |a: &usize, b: &usize| attention[*a].total_cmp(&attention[*b]).then(b.cmp(a));
        (0..attention.len()).filter(|n| may(*n)).max_by(order)
    };
    let first = most(&|_| true)?;
    let other = most(&|n| moved[n].1 >= MOVED && attention[n] >= NOTICED * total);
    Some(if moved[first].0 <= STILL { other.unwrap_or(first) } else { first })
}

/// Components near `best` that touch no plane: parts that are too thin for depth cameras hold them. If `best` touches no plane either,
/// such parts hold it too, and may be longer.
pub(super) fn with_held(
    cloud: &FusedCloud,
    numbers: &[Option<usize>],
    best: usize,
    planes: &[Plane],
    edge: f64,
) -> Vec<bool> {
    /// Share of its points that another component must have; smaller ones are errors of depth.
    const LEAST: f64 = 0.1;
    /// Distance from every plane, cubes.
    const CLEAR: f64 = 4.0;
    /// Distances, as shares of the diagonal of the box of `best`: if it touches a plane, and if not.
    const REACHES: [f32; 2] = [0.3, 0.6];
    let count = numbers.iter().flatten().max().map_or(0, |n| n + 1);
    let points = points_of(&cloud.points, numbers, count);
    let own = &points[best];
    let is_clear = |points: &[Vec3]| {
        let clear = |p: &Vec3| planes.iter().all(|plane| plane.distance(p.as_dvec3()) > CLEAR * edge);
        points.iter().all(clear)
    };
    let reach = REACHES[usize::from(is_clear(own))];
    let held = |others: &Vec<Vec3>| {
        others.len() as f64 >= LEAST * own.len() as f64 && is_clear(others) && is_near(own, others, reach)
    };
    points.iter().enumerate().map(|(n, others)| n == best || held(others)).collect()
}

/// The component `best`, and those that are mostly above its footprint and near it: what an open door shows inside, a
/// top whose edges have no depth.
pub(super) fn with_enclosed(
    cloud: &FusedCloud,
    components: &Components,
    numbers: &[Option<usize>],
    best: usize,
    up: Option<DVec3>,
    config: &ObjectConfig,
) -> Vec<bool> {
    /// Share of a component's points.
    const MOSTLY: f64 = 0.9;
    let up = up.map_or(Vec3::Z, |u| u.as_vec3());
    let (a, b) = up.any_orthonormal_pair();
    let flat = |p: Vec3| (p.dot(a), p.dot(b));
    let own: Vec<Vec3> = cloud.points.iter().zip(numbers).filter(|(_, n)| **n == Some(best)).map(|(p, _)| *p).collect();
    let hull = convex_hull(own.iter().map(|p| flat(*p)).collect());
    let heights = own.iter().map(|p| p.dot(up));
    let (low, high) = heights.fold((f32::MAX, f32::MIN), |(l, h), z| (l.min(z), h.max(z)));
    let reach = (config.gap + 2) as f32 * components.edge;
    let mut counts = vec![(0, 0, f32::MAX); components.count];
    for (p, n) in cloud.points.iter().zip(numbers) {
        if let Some(n) = n {
            let (count, z) = (&mut counts[*n], p.dot(up));
            count.1 += 1;
            count.0 += usize::from(z > low && in_hull(&hull, flat(*p)));
            count.2 = count.2.min(z);
        }
    }
    let belongs = |n: usize| {
        let (inside, all, lowest) = counts[n];
        n == best || (inside as f64 >= MOSTLY * all as f64 && lowest < high + reach)
    };
    (0..components.count).map(belongs).collect()
}

/// Corners of the convex hull of points in the plane, counter-clockwise (Andrew's monotone chain).
fn convex_hull(mut points: Vec<(f32, f32)>) -> Vec<(f32, f32)> {
    points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let half = |points: &mut dyn Iterator<Item = (f32, f32)>| {
        let mut chain: Vec<(f32, f32)> = Vec::new();
        for p in points {
            while chain.len() >= 2 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    hull
}

/// Positive if `c` is on the left of the line from `a` to `b`.
fn turn(a: (f32, f32), b: (f32, f32), c: (f32, f32)) -> f32 {
    (b.0 - a.0) * (c.1 - a.1) - (b.1 - a.1) * (c.0 - a.0)
}

fn in_hull(hull: &[(f32, f32)], p: (f32, f32)) -> bool {
    hull.len() >= 3 && (0..hull.len()).all(|i| turn(hull[i], hull[(i + 1) % hull.len()], p) >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_moved_is_the_object_if_nothing_of_what_is_looked_at_most_did() {
        let attention = [0.1, 0.6, 0.2, 0.01];
        let best = |shares: [f64; 4]| most_attended(&attention, &shares.map(|share| (share, share)));
        assert_eq!(best([0.0; 4]), Some(1));
        assert_eq!(best([0.9, 0.02, 0.9, 0.0]), Some(1));
        assert_eq!(best([0.9, 0.0, 0.3, 0.0]), Some(2));
        // Nobody looks at the thing that moved.
        assert_eq!(best([0.0, 0.0, 0.0, 1.0]), Some(1));
        assert_eq!(most_attended(&[], &[]), None);
    }

    #[test]
    fn a_thin_thing_moved_if_its_pieces_did() {
        // A box that the cameras look at most, a rod of which the end bends, and that end, which is apart from it.
        let row = |corner: Vec3, count: usize| (0..count).map(move |i| corner + Vec3::X * 0.02 * i as f32);
        let groups = [(Vec3::new(-1.3, 0.0, 0.0), 60), (Vec3::ZERO, 40), (Vec3::new(0.85, 0.0, 0.0), 6)];
        let points: Vec<Vec3> = groups.into_iter().flat_map(|(corner, count)| row(corner, count)).collect();
        let numbers: Vec<Option<usize>> = (0..3).flat_map(|n| std::iter::repeat_n(Some(n), groups[n].1)).collect();
        let moved: Vec<bool> = (0..106).map(|i| i >= 98).collect();
        let shares = moved_shares(&points, &numbers, &moved, 3);
        assert_eq!(shares[0], (0.0, 0.0));
        assert_eq!(shares[1], (0.05, 8.0 / 46.0));
        assert_eq!(most_attended(&[0.7, 0.29, 0.01], &shares), Some(1));
        // Without the piece, its share is that of errors of depth.
        assert_eq!(moved_shares(&points[..100], &numbers[..100], &moved[..100], 2)[1], (0.05, 0.05));
    }

    #[test]
    fn what_touches_nothing_belongs_to_what_is_near() {
        let sheet =
            |corner: Vec3| (0..100).map(move |i| corner + Vec3::new((i % 10) as f32, 0.0, (i / 10) as f32) * 0.05);
        let corners = [
            Vec3::new(0.0, 0.5, 0.0),
            Vec3::new(0.0, 0.65, 0.1),
            Vec3::new(0.6, 0.0, 0.0),
            Vec3::new(3.0, 0.7, 0.0),
            Vec3::new(0.0, 0.78, 0.0),
        ];
        let points: Vec<Vec3> = corners.into_iter().flat_map(sheet).collect();
        let cloud = FusedCloud { points, normals: Vec::new(), colors: Vec::new() };
        let numbers: Vec<Option<usize>> = (0..500).map(|i| Some(i / 100)).collect();
        let held = |height: f64| {
            let floor = Plane { normal: DVec3::Y, offset: height, spread: 0.005 };
            with_held(&cloud, &numbers, 0, &[floor], 0.02)
        };
        assert_eq!(held(0.45), [true, true, false, false, false]);
        // What holds a thing in mid-air is longer.
        assert_eq!(held(0.0), [true, true, false, false, true]);
    }
}
