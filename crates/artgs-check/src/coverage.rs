//! How well the hulls of a link match its visual mesh: shares of the surfaces, holes, and volume where nothing is drawn.

use crate::CheckOptions;
use crate::drawn::Drawn;
use crate::model::{Link, bounds};
use crate::observed::Observed;
use crate::passing::Passing;
use crate::poses::vector;
use crate::report::CoverageFinding;
use crate::shadow::{Shadow, Triangles};
use glam::DVec3;
use rapier3d::parry::query::PointQuery as _;
use rapier3d::parry::shape::ConvexPolyhedron;
use rapier3d::prelude::SharedShape;

/// A hull with the planes of its faces.
struct Piece<'a> {
    shape: &'a ConvexPolyhedron,
    low: DVec3,
    high: DVec3,
    planes: Vec<(DVec3, f64)>,
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl<'a> Piece<'a> {
    fn new(shape: &'a ConvexPolyhedron) -> Self {
        let (points, triangles) = shape.to_trimesh();
        let points: Vec<DVec3> = points.iter().map(|p| DVec3::from_array(p.to_array().map(f64::from))).collect();
        let plane = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| points[i as usize]);
            let normal = (b - a).cross(c - a).try_normalize()?;
            Some((normal, normal.dot(a)))
        };
        let planes = triangles.iter().filter_map(plane).collect();
        let [low, high] = bounds(points.iter().copied()).unwrap_or_default();
        Self { shape, low, high, planes, points, triangles }
    }

    /// True if the hull contains the point, at least `depth` deep.
    fn holds(&self, p: DVec3, depth: f64) -> bool {
        p.cmpge(self.low).all() && p.cmple(self.high).all() && self.planes.iter().all(|(n, o)| n.dot(p) <= o - depth)
    }

    /// True if the hull is within `reach` behind a point of a surface with this outward normal, or as far before it.
    fn is_behind(&self, p: DVec3, normal: DVec3, reach: f64) -> bool {
        /// Places on the way, of which the hull is within half the distance between two.
        const PLACES: i32 = 11;
        let around = p.cmpge(self.low - reach).all() && p.cmple(self.high + reach).all();
        let step = 2.0 * reach / f64::from(PLACES - 1);
        around && (0..PLACES).any(|k| self.is_near(p + normal * (reach - f64::from(k) * step), 0.5 * step))
    }

    fn is_near(&self, p: DVec3, distance: f64) -> bool {
        let around = p.cmpge(self.low - distance).all() && p.cmple(self.high + distance).all();
        around && f64::from(self.shape.distance_to_local_point(vector(p), true)) <= distance
    }
}

/// Compares the hulls of a link with its visual mesh `drawn`; none if either is absent. Of the visual mesh, only what is `observed`
/// needs hulls, all of it if that is not known, and only where no other link is `passing`. Space behind observed surfaces, such as the
/// inside of walls that closing the mesh made hollow, may be filled where no other link is `passing`. `lost` is the number of pieces
/// that the export reports as lost.
pub(crate) fn link(
    link: &Link,
    hulls: &[SharedShape],
    drawn: Option<&Drawn>,
    observed: Option<&Observed>,
    passing: &Passing,
    lost: usize,
    options: &CheckOptions,
) -> Option<CoverageFinding> {
    let pieces: Vec<Piece> = hulls.iter().filter_map(|h| h.as_convex_polyhedron()).map(Piece::new).collect();
    let visuals: Vec<Triangles> = link.visuals.iter().map(|s| (&s.points[..], &s.triangles[..])).collect();
    let [low, high] = bounds(link.visuals.iter().flat_map(|s| &s.points).copied())?;
    if pieces.is_empty() {
        return None;
    }
    let drawn = drawn?;
    let tolerance = options.cover.min(0.01 * (high - low).length());
    let hole = options.hole.min(0.02 * (high - low).length());
    let mut out = CoverageFinding { link: link.name.clone(), lost, ..CoverageFinding::default() };
    let holds = |p: &DVec3| observed.is_none_or(|observed| observed.holds(*p));
    let seen: Vec<DVec3> = samples(&visuals, options.samples).into_iter().filter(holds).collect();
    let (near, far): (Vec<DVec3>, Vec<DVec3>) =
        seen.into_iter().partition(|p| pieces.iter().any(|h| h.is_near(*p, tolerance)));
    let bare = far.iter().filter(|p| !passing.holds(**p)).count();
    out.visual = near.len() as f64 / (near.len() + bare).max(1) as f64;
    out.hulls = covered_hulls(&pieces, drawn, tolerance, options);
    let is_cavity = |p: DVec3| observed.is_none_or(|observed| !observed.hides(p)) || passing.holds(p);
    phantom(&pieces, (drawn, &is_cavity), hole, &mut out);
    // Triangles that close the visual mesh.
    let closing: Vec<Vec<[u32; 3]>> = visuals
        .iter()
        .map(|(points, triangles)| {
            let middle = |t: &[u32; 3]| t.iter().map(|i| points[*i as usize]).sum::<DVec3>() / 3.0;
            triangles.iter().filter(|t| !holds(&middle(t))).copied().collect()
        })
        .collect();
    let closing: Vec<Triangles> = visuals.iter().zip(&closing).map(|((points, _), t)| (*points, &t[..])).collect();
    shadows([&visuals, &closing], &pieces, (drawn, passing), [low, high], [hole, tolerance], &mut out);
    judge(&mut out, hole, options);
    Some(out)
}

/// Share of the surface of the hulls that is near the visual mesh or behind it. What other hulls of the link cover does not
/// count.
fn covered_hulls(pieces: &[Piece], drawn: &Drawn, tolerance: f64, options: &CheckOptions) -> f64 {
    /// Touching hulls cover each other.
    const TOUCH: f64 = 1e-4;
    let surfaces: Vec<Triangles> = pieces.iter().map(|h| (&h.points[..], &h.triangles[..])).collect();
    let (mut outer, mut near) = (0, 0);
    for p in samples(&surfaces, options.samples) {
        if pieces.iter().any(|h| h.holds(p, TOUCH)) {
            continue;
        }
        outer += 1;
        near += usize::from(drawn.is_near(p, tolerance) || drawn.outside(p) <= tolerance);
    }
    f64::from(near as u32) / f64::from(outer.max(1) as u32)
}

/// Volume of the hulls more than `depth` in front of the visual mesh, in a cavity, the largest such distance, and where it is.
fn phantom(
    pieces: &[Piece],
    (drawn, is_cavity): (&Drawn, &dyn Fn(DVec3) -> bool),
    depth: f64,
    out: &mut CoverageFinding,
) {
    for (i, piece) in pieces.iter().enumerate() {
        let size = piece.high - piece.low;
        let step = (0.5 * depth).max(size.max_element() / 80.0);
        let counts = (size / step).ceil().max(DVec3::ONE);
        let cell = size / counts;
        for x in 0..counts.x as usize {
            for y in 0..counts.y as usize {
                for z in 0..counts.z as usize {
                    let p = piece.low + (DVec3::new(x as f64, y as f64, z as f64) + 0.5) * cell;
                    // A point in several hulls counts once.
                    if !piece.holds(p, 0.0) || pieces[..i].iter().any(|h| h.holds(p, 0.0)) {
                        continue;
                    }
                    let far = drawn.outside(p);
                    if far > depth && is_cavity(p) {
                        out.phantom_volume += cell.element_product();
                        if far > out.phantom_depth {
                            (out.phantom_depth, out.phantom_at) = (far, Some(p.to_array()));
                        }
                    }
                }
            }
        }
    }
}

/// Parallel rays along the axes, of the visual mesh and of its triangles that were not observed: those that first meet one of the
/// latter need not meet a hull. A ray that passes a surface at a small angle can meet the hull right behind it much later: it
/// misses nothing if the two are within `tolerance` of each other across the surface.
fn shadows(
    [visuals, closing]: [&[Triangles]; 2],
    pieces: &[Piece],
    (drawn, passing): (&Drawn, &Passing),
    [low, high]: [DVec3; 2],
    [hole, tolerance]: [f64; 2],
    out: &mut CoverageFinding,
) {
    /// Rays per side of the box at most.
    const MOST: f64 = 800.0;
    let hulls: Vec<Triangles> = pieces.iter().map(|h| (&h.points[..], &h.triangles[..])).collect();
    let step = (0.2 * hole).max((high - low).max_element() / MOST);
    let around = [low - 4.0 * step, high + 4.0 * step];
    let (mut hits, mut missed, mut extra) = (0, 0, 0);
    for axis in 0..3 {
        let [seen, unseen, solid] = [visuals, closing, &hulls].map(|s| Shadow::new(axis, around, step, s));
        for side in 0..2 {
            let along = DVec3::AXES[axis] * if side == 0 { 1.0 } else { -1.0 };
            let covered = |p: DVec3| {
                let normal = drawn.normal(p - along * tolerance, along, 2.0 * tolerance);
                normal.is_some_and(|normal| pieces.iter().any(|piece| piece.is_behind(p, normal, tolerance)))
            };
            let mut holes = seen.missed_by(&solid, side, hole);
            let observed = seen.missed_by(&unseen, side, 0.0);
            let mut passed = vec![false; holes.len()];
            for (ray, hole) in holes.iter_mut().enumerate().filter(|(_, hole)| **hole) {
                let at = seen.point(seen.place(ray), side);
                *hole = observed[ray] && !covered(at);
                if *hole && passing.holds(at) {
                    (*hole, passed[ray]) = (false, true);
                }
            }
            out.passed = out.passed.max(seen.widest(&passed).cells as f64 * step);
            let mut before = solid.missed_by(&seen, side, hole);
            for (ray, before) in before.iter_mut().enumerate().filter(|(_, before)| **before) {
                *before = !drawn.is_near(solid.point(solid.place(ray), side), tolerance);
            }
            hits += seen.hits();
            missed += holes.iter().filter(|m| **m).count();
            extra += before.iter().filter(|m| **m).count();
            let square = seen.widest(&holes);
            if square.cells as f64 * step > out.hole {
                out.hole = square.cells as f64 * step;
                out.hole_at = Some(seen.point(square.middle, side).to_array());
            }
            out.obstacle = out.obstacle.max(seen.widest(&before).cells as f64 * step);
        }
    }
    out.missed = f64::from(missed as u32) / f64::from(hits.max(1) as u32);
    out.extra = f64::from(extra as u32) / f64::from(hits.max(1) as u32);
}

/// Evenly spread points on triangles, about `count`.
pub(crate) fn samples(surfaces: &[Triangles], count: usize) -> Vec<DVec3> {
    let corners = |(points, t): (&[DVec3], &[u32; 3])| t.map(|i| points[i as usize]);
    let all = || surfaces.iter().flat_map(|(points, triangles)| triangles.iter().map(|t| corners((points, t))));
    let area = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
    let step = all().map(area).sum::<f64>() / count.max(1) as f64;
    let (mut out, mut left) = (Vec::with_capacity(count + 1), 0.5 * step);
    for t in all() {
        left += area(t);
        while left >= step && step > 0.0 {
            left -= step;
            // The additive recurrence of the plastic number.
            let n = out.len() as f64;
            let (mut s, mut r) = ((0.754_877_666 * n).fract(), (0.569_840_291 * n).fract());
            if s + r > 1.0 {
                (s, r) = (1.0 - s, 1.0 - r);
            }
            out.push(t[0] + (t[1] - t[0]) * s + (t[2] - t[0]) * r);
        }
    }
    out
}

fn judge(out: &mut CoverageFinding, hole: f64, options: &CheckOptions) {
    /// A hole of this many times the allowed width fails the check.
    const WIDE: f64 = 5.0;
    let mm = |v: f64| format!("{:.0} mm", 1e3 * v);
    let place = |at: Option<[f64; 3]>| {
        at.map_or(String::new(), |[x, y, z]| format!(", at ({x:.3}, {y:.3}, {z:.3}) in the frame of the link"))
    };
    if out.lost > 0 {
        let places = if out.lost == 1 { "1 place".into() } else { format!("{} places", out.lost) };
        out.warnings.push(format!("{places} of the surface lost the hull to the clearance between links"));
    }
    if out.hole > hole {
        let what = format!("the hulls have a hole {} wide that the visual mesh does not have", mm(out.hole));
        let text = what + &place(out.hole_at);
        if out.hole > WIDE * hole { out.problems.push(text) } else { out.warnings.push(text) }
    }
    if out.phantom_depth > hole && out.obstacle > hole {
        let litres = 1e3 * out.phantom_volume;
        let text = "hulls fill space where nothing is drawn";
        let deepest = mm(out.phantom_depth) + " from the surface" + &place(out.phantom_at);
        out.warnings.push(format!("{text}: {litres:.2} l, up to {deepest}"));
    }
    let least = 100.0 * options.covered;
    for (what, share) in
        [("visual surface has a hull", out.visual), ("surface of the hulls is near the visual", out.hulls)]
    {
        if share < options.covered {
            out.warnings.push(format!("{:.1} % of the {what}, expected {least:.0} %", 100.0 * share));
        }
    }
}

#[cfg(test)]
#[path = "coverage_tests.rs"]
mod tests;
