//! Convex polyhedra that can be cut by planes, in double precision.

use super::in_triangle;
use artgs_core::{Mesh, Rigid};
use glam::DVec3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::{Pose3, Rot3, Vec3};
use parry3d_f64::query::PointQuery as _;
use parry3d_f64::shape::{ConvexPolyhedron, Shape as _};
use parry3d_f64::transformation::try_convex_hull;

/// A half space: points with `normal . x <= offset` are inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit normal, pointing outside.
    pub normal: DVec3,
    /// Distance of the plane from the origin along the normal.
    pub offset: f64,
}

impl Plane {
    /// Signed distance, positive outside.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }

    /// The plane moved rigidly.
    pub fn moved(&self, motion: &Rigid) -> Self {
        let normal = motion.turn(self.normal);
        Self { normal, offset: self.offset + normal.dot(motion.translation) }
    }
}

/// True if the hull that the library finds in single precision has nearly this volume.
fn has_hull(points: &[parry3d::math::Vec3], volume: f64) -> bool {
    /// Least share of the volume.
    const LEAST: f64 = 0.8;
    let Ok((points, faces)) = parry3d::transformation::try_convex_hull(points) else { return false };
    let at = |i: u32| crate::geometry::convert::from_parry(points[i as usize] - points[0]);
    let found: f64 = faces.iter().map(|f| at(f[0]).dot(at(f[1]).cross(at(f[2]))) / 6.0).sum();
    found > LEAST * volume && parry3d::shape::ConvexPolyhedron::from_convex_mesh(points, &faces).is_some()
}

/// A convex polyhedron with volume.
#[derive(Clone, Debug)]
pub struct Hull {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    shape: ConvexPolyhedron,
}

impl Hull {
    /// Convex hull of points; none if it has no volume or is thinner than `thinnest`. Corners are at least half of that apart:
    /// engines report false contacts at the needles between closer corners.
    pub fn of(points: &[DVec3], thinnest: f64) -> Option<Self> {
        /// Least distances of corners that are tried, in multiples of `thinnest`.
        const APART: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
        if points.len() < 4 || points.iter().any(|p| !p.is_finite()) {
            return None;
        }
        // Nearly flat corners can be beyond the library: fewer of them, farther apart, span almost the same hull.
        let (vertices, triangles, shape) = APART.into_iter().find_map(|least| {
            let single: Vec<Vec3> = apart(points, least * thinnest).into_iter().map(to_parry).collect();
            let (vertices, triangles) = try_convex_hull(&single).ok()?;
            let shape = ConvexPolyhedron::from_convex_mesh(vertices.clone(), &triangles)?;
            Some((vertices, triangles, shape))
        })?;
        let hull = Self { points: vertices.iter().map(|v| from_parry(*v)).collect(), triangles, shape };
        (hull.is_thick(thinnest) && hull.volume() > 0.0).then_some(hull)
    }

    /// True if no two parallel planes around it are closer than `thinnest`.
    fn is_thick(&self, thinnest: f64) -> bool {
        /// Least ratio of the mean thickness of a piece, twice its volume by its surface, to its width: a third in a tetrahedron. Planes of
        /// flat pieces can all be too narrow to count.
        const MEAN: f64 = 0.15;
        let thickness = self.planes().iter().map(|plane| self.depth(plane)).fold(f64::INFINITY, f64::min);
        thickness >= thinnest && 2.0 * self.volume() >= MEAN * thinnest * self.area()
    }

    /// A hull inside this one with at most `most` of its corners: first those of a large tetrahedron, then always the one farthest
    /// from the hull of those before, until none is farther than `within`.
    pub fn with_fewer_corners(self, most: usize, within: f64, thinnest: f64) -> Option<Self> {
        let mut kept = tetrahedron(&self.points)?;
        let mut left: Vec<DVec3> = self.points.iter().copied().filter(|p| !kept.contains(p)).collect();
        let mut out = Self::of(&kept, 0.0);
        while kept.len() < most.min(self.points.len()) && !left.is_empty() {
            let distances: Vec<f64> = match &out {
                Some(hull) => left.iter().map(|p| hull.before(*p)).collect(),
                None => vec![f64::INFINITY; left.len()],
            };
            let farthest = (0..left.len()).max_by(|a, b| distances[*a].total_cmp(&distances[*b]));
            let Some(next) = farthest.filter(|i| distances[*i] > within) else { break };
            kept.push(left.swap_remove(next));
            out = Self::of(&kept, 0.0);
        }
        // A thin piece keeps its corners rather than being lost.
        let whole = self.points.len() <= most;
        out.filter(|hull| hull.is_thick(thinnest)).or_else(|| whole.then_some(self))
    }

    /// Largest distance of a point from the plane of a face, negative inside.
    fn before(&self, p: DVec3) -> f64 {
        self.planes().iter().map(|plane| plane.distance(p)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Unit normal of the face with the largest area: of all triangles whose normals are nearly the same.
    pub fn widest_face(&self) -> Option<DVec3> {
        /// Cosine of the largest angle between the normals of one face.
        const SAME: f64 = 0.9999;
        let crosses: Vec<DVec3> = self
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| self.points[i as usize]);
                (b - a).cross(c - a)
            })
            .collect();
        let area = |normal: DVec3| -> f64 {
            crosses.iter().filter(|c| c.dot(normal) > SAME * c.length()).map(|c| c.length()).sum()
        };
        let normals = crosses.iter().filter_map(|c| c.try_normalize());
        normals.max_by(|a, b| area(*a).total_cmp(&area(*b)))
    }

    /// Edges of the triangles, from corner to corner.
    pub fn edges(&self) -> impl Iterator<Item = DVec3> {
        let edge = |[i, j]: [u32; 2]| self.points[j as usize] - self.points[i as usize];
        self.triangles.iter().flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]).map(edge)
    }

    /// The hull with so few corners, at most `most`, that it is also one in single precision, which engines use; inside this hull.
    /// Corners that stand out by less than `within` are left out: narrow faces between them slow engines down, and their normals
    /// are wrong in single precision.
    pub fn for_engines(self, most: usize, within: f64, thinnest: f64) -> Option<Self> {
        let mut out = self.with_fewer_corners(most, within, thinnest)?;
        while !out.is_hull_in_single_precision() {
            // Always fewer than before, so that this ends.
            let fewer = 3 * out.points.len() / 4;
            out = out.with_fewer_corners(fewer, within, thinnest).filter(|hull| hull.points.len() >= 4)?;
        }
        Some(out)
    }

    /// True if the library of engines, in single precision, finds about the same hull of the corners, also of those in the frame of the
    /// middle and in another order: importers move and sort them.
    fn is_hull_in_single_precision(&self) -> bool {
        let [low, high] = self.bounds();
        let moved = |by: DVec3| self.points.iter().map(move |p| crate::geometry::convert::to_parry(*p - by));
        let is_hull = |points: Vec<_>| has_hull(&points, self.volume());
        let centred = || moved((low + high) / 2.0);
        is_hull(moved(DVec3::ZERO).collect()) && is_hull(centred().collect()) && is_hull(centred().rev().collect())
    }

    /// Lowest and highest corner of the box around it.
    pub fn bounds(&self) -> [DVec3; 2] {
        let start = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        self.points.iter().fold(start, |[low, high], p| [low.min(*p), high.max(*p)])
    }

    /// Area of the surface.
    pub fn area(&self) -> f64 {
        let corners = |t: &[u32; 3]| t.map(|i| self.points[i as usize]);
        self.triangles.iter().map(corners).map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum()
    }

    /// About `count` points evenly spread on the surface.
    pub fn samples(&self, count: usize) -> Vec<DVec3> {
        let corners = |t: &[u32; 3]| t.map(|i| self.points[i as usize]);
        let area = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
        let step = self.triangles.iter().map(|t| area(corners(t))).sum::<f64>() / count.max(1) as f64;
        let (mut out, mut left) = (Vec::with_capacity(count + 1), 0.5 * step);
        for [a, b, c] in self.triangles.iter().map(corners) {
            left += area([a, b, c]);
            while left >= step && step > 0.0 {
                left -= step;
                let n = out.len() as f64;
                let [s, r] = in_triangle(n);
                out.push(a + (b - a) * s + (c - a) * r);
            }
        }
        out
    }

    /// Corners.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Axis-aligned box around the posed hull.
    pub fn around(&self, pose: &Pose3) -> Aabb {
        self.shape.compute_aabb(pose)
    }

    /// Distance of a point from the hull, 0 inside.
    pub fn distance(&self, p: DVec3) -> f64 {
        self.shape.distance_to_local_point(to_parry(p), true)
    }

    /// The hull as a closed mesh without colours.
    pub fn mesh(&self) -> Mesh {
        let vertices = self.points.iter().map(|p| p.as_vec3().to_array()).collect();
        Mesh { vertices, colors: Vec::new(), triangles: self.triangles.clone() }
    }

    /// Planes of the faces, without triangles so narrow that their normal is wrong.
    pub fn planes(&self) -> Vec<Plane> {
        /// Corners outside a plane by more than this share of the size show that its normal is wrong.
        const ROUNDING: f64 = 1e-5;
        let [low, high] = self.bounds();
        let most = ROUNDING * low.distance(high);
        let plane = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.points[i as usize]);
            let normal = (b - a).cross(c - a).try_normalize()?;
            Some(Plane { normal, offset: normal.dot(a) })
        };
        let bounds = |plane: &Plane| self.points.iter().all(|p| plane.distance(*p) <= most);
        self.triangles.iter().filter_map(plane).filter(bounds).collect()
    }

    /// How far the hull reaches inside a plane.
    pub fn depth(&self, plane: &Plane) -> f64 {
        -self.points.iter().map(|p| plane.distance(*p)).fold(f64::INFINITY, f64::min)
    }

    /// Volume.
    pub fn volume(&self) -> f64 {
        let origin = self.points.first().copied().unwrap_or_default();
        let six = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| self.points[i as usize] - origin);
            a.dot(b.cross(c))
        };
        self.triangles.iter().map(six).sum::<f64>() / 6.0
    }

    /// The part inside the plane; none if it is thinner than `thinnest`.
    pub fn clipped(&self, plane: &Plane, thinnest: f64) -> Option<Self> {
        let mut kept: Vec<DVec3> = self.points.iter().copied().filter(|p| plane.distance(*p) <= 0.0).collect();
        if kept.len() == self.points.len() {
            return Some(self.clone());
        }
        for t in &self.triangles {
            for (i, j) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let (a, b) = (self.points[i as usize], self.points[j as usize]);
                let (da, db) = (plane.distance(a), plane.distance(b));
                // Every edge occurs twice, once in each direction; one is enough.
                if da <= 0.0 && db > 0.0 {
                    kept.push(a + (b - a) * (da / (da - db)));
                }
            }
        }
        Self::of(&kept, thinnest)
    }

    /// How far another hull is short of `gap` metres from this one, both posed in one frame; more than `gap` where they
    /// penetrate, 0 where they are far enough apart.
    pub fn shortfall(&self, pose: &Pose3, other: &Self, other_pose: &Pose3, gap: f64) -> f64 {
        match parry3d_f64::query::contact(pose, &self.shape, other_pose, &other.shape, gap) {
            Ok(Some(contact)) if contact.dist < gap => {
                // The query reports penetrations of thin hulls that a face of one of them separates.
                let apart = self.separation(pose, other, other_pose).max(other.separation(other_pose, self, pose));
                (gap - apart.max(contact.dist)).max(0.0)
            }
            _ => 0.0,
        }
    }

    /// Largest distance of another hull from the plane of a face of this one, negative if it is behind all of them. Two hulls are
    /// at least so far apart, or penetrate at most so deep.
    fn separation(&self, pose: &Pose3, other: &Self, other_pose: &Pose3) -> f64 {
        let relative = pose.inv_mul(other_pose);
        let points: Vec<DVec3> = other.points.iter().map(|p| from_parry(relative * to_parry(*p))).collect();
        let before = |plane: Plane| points.iter().map(|p| plane.distance(*p)).fold(f64::INFINITY, f64::min);
        self.planes().into_iter().map(before).fold(f64::NEG_INFINITY, f64::max)
    }

    /// [`Self::shortfall`] that also finds penetrations which the query for contacts within a distance misses near thin pieces.
    pub fn sure_shortfall(&self, pose: &Pose3, other: &Self, other_pose: &Pose3, gap: f64) -> f64 {
        let penetration = self.shortfall(pose, other, other_pose, 0.0);
        let least = if penetration > 0.0 { gap + penetration } else { 0.0 };
        self.shortfall(pose, other, other_pose, gap).max(least)
    }
}

/// Four points that span a large volume; none if all lie in a plane.
fn tetrahedron(points: &[DVec3]) -> Option<Vec<DVec3>> {
    let farthest = |from: &dyn Fn(DVec3) -> f64| points.iter().copied().max_by(|p, q| from(*p).total_cmp(&from(*q)));
    let first = *points.first()?;
    let a = farthest(&|p| p.distance_squared(first))?;
    let b = farthest(&|p| p.distance_squared(a))?;
    let along = (b - a).try_normalize()?;
    let c = farthest(&|p| (p - a).reject_from_normalized(along).length_squared())?;
    let normal = along.cross(c - a).try_normalize()?;
    let d = farthest(&|p| (p - a).dot(normal).abs())?;
    ((d - a).dot(normal).abs() > 0.0).then(|| vec![a, b, c, d])
}

/// Those points that are at least `least` from all kept before them.
fn apart(points: &[DVec3], least: f64) -> Vec<DVec3> {
    let mut kept: Vec<DVec3> = Vec::with_capacity(points.len());
    for p in points {
        if kept.iter().all(|k| k.distance_squared(*p) >= least * least) {
            kept.push(*p);
        }
    }
    kept
}

/// A point as a vector of the collision library, which uses another version of the vector crate.
fn to_parry(p: DVec3) -> Vec3 {
    Vec3::from_array(p.to_array())
}

/// From a point of the collision library.
fn from_parry(p: Vec3) -> DVec3 {
    DVec3::from_array(p.to_array())
}

/// A motion as a pose of the collision library.
pub(crate) fn pose(motion: &Rigid) -> Pose3 {
    let [x, y, z, w] = motion.rotation.to_array();
    Pose3::from_parts(to_parry(motion.translation), Rot3::from_xyzw(x, y, z, w))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Hull {
        let corners: Vec<DVec3> =
            (0..8).map(|i| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64)).collect();
        Hull::of(&corners, 1e-6).unwrap()
    }

    #[test]
    fn a_cut_cube_keeps_the_rest() {
        let plane = Plane { normal: DVec3::X, offset: 0.25 };
        let half = cube().clipped(&plane, 1e-6).unwrap();
        assert!((half.volume() - 0.25).abs() < 1e-6 && (cube().volume() - 1.0).abs() < 1e-6);
        assert!(half.points().iter().all(|p| p.x <= 0.25 + 1e-6));
        let corner = Plane { normal: DVec3::ONE.normalize(), offset: 2.5 / 3f64.sqrt() };
        let cut = cube().clipped(&corner, 1e-6).unwrap();
        // The corner beyond x + y + z = 2.5 is a pyramid with legs of a half.
        assert!((cut.volume() - (1.0 - 0.125 / 6.0)).abs() < 1e-6, "{}", cut.volume());
        assert!(cube().clipped(&Plane { normal: DVec3::X, offset: 0.001 }, 0.01).is_none());
        assert!((cube().clipped(&Plane { normal: DVec3::X, offset: 2.0 }, 0.01).unwrap().volume() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn planes_move_with_hulls() {
        let motion = Rigid::about(DVec3::Z, DVec3::new(1.0, 2.0, 0.0), 0.7);
        let plane = Plane { normal: DVec3::X, offset: 0.25 }.moved(&motion);
        assert!(plane.distance(motion.apply(DVec3::new(0.25, 9.0, -3.0))).abs() < 1e-12);
        assert!((plane.distance(motion.apply(DVec3::new(1.25, 9.0, -3.0))) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_ball_is_reduced_to_the_corners_allowed() {
        let ball: Vec<DVec3> = (0..600)
            .map(|i| {
                let z = 1.0 - (2 * i + 1) as f64 / 600.0;
                let (sin, cos) = (2.4 * i as f64).sin_cos();
                DVec3::new(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z)
            })
            .collect();
        let whole = Hull::of(&ball, 1e-3).unwrap();
        let few = whole.clone().with_fewer_corners(64, 0.0, 1e-3).unwrap();
        assert!(whole.points().len() > 64 && few.points().len() <= 64 && few.volume() > 0.8 * whole.volume());
        assert_eq!(few.bounds().map(|p| p.length() < 2.0), [true; 2]);
        assert!(few.samples(200).iter().all(|p| p.length() < 1.0 + 1e-6) && few.samples(200).len().abs_diff(200) < 3);
    }

    #[test]
    fn corners_that_hardly_stand_out_are_left_out() {
        let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, 0.1 * (i >> 2 & 1) as f64);
        let mut points: Vec<DVec3> = (0..8).map(corner).collect();
        // Above the middle of the upper face, and a little beyond an edge.
        points.extend([DVec3::new(0.5, 0.5, 0.1002), DVec3::new(-2e-4, 0.4, 0.1), DVec3::new(0.3, 0.6, 0.1001)]);
        let hull = Hull::of(&points, 1e-4).unwrap();
        assert!(hull.points().len() > 8);
        let few = hull.clone().with_fewer_corners(64, 5e-4, 1e-4).unwrap();
        assert_eq!(few.points().len(), 8);
        assert!(hull.points().iter().all(|p| few.before(*p) <= 5e-4));
        assert_eq!(hull.clone().with_fewer_corners(64, 0.0, 1e-4).unwrap().points().len(), hull.points().len());
        assert!(few.widest_face().unwrap().z.abs() > 0.999);
        // Without the corners that make it thicker than the least, the plate would be lost.
        assert_eq!(hull.clone().with_fewer_corners(64, 5e-4, 0.10015).unwrap().points().len(), hull.points().len());
    }

    #[test]
    fn a_long_thin_hull_keeps_few_corners_for_engines() {
        // A strip of which the library of engines finds no hull.
        let corners = [
            [0.5728755, -0.020939115, 0.22079329],
            [0.5565982, -0.022825975, 0.47290632],
            [0.54590994, -0.024194848, 0.22284634],
            [0.5545035, -0.02337135, -0.46270174],
            [0.57017964, -0.021185879, 0.47289777],
            [0.57233, -0.020984827, 0.2853048],
            [0.5724721, -0.021203281, -0.46853992],
            [0.56687814, -0.021878812, -0.46853805],
            [0.5494158, -0.023939779, -0.3156471],
            [0.5558346, -0.023212386, -0.468396],
            [0.53957725, -0.025011828, 0.05569251],
            [0.5471928, -0.02202747, -0.25015855],
            [0.572215, -0.019074004, -0.46845526],
            [0.5391218, -0.022906912, 0.054465506],
            [0.55459666, -0.021200264, -0.46415997],
            [0.5710445, -0.018921139, 0.47289637],
            [0.54431677, -0.022236712, 0.19158818],
            [0.57269555, -0.018759323, 0.35269672],
            [0.5724355, -0.018781118, 0.3834548],
            [0.5587035, -0.020705663, -0.46845073],
            [0.55584437, -0.021050919, -0.46841395],
            [0.55634105, -0.02069673, 0.47290567],
        ];
        let strip = Hull::of(&corners.map(DVec3::from_array), 1e-4).unwrap();
        let volume = strip.volume();
        let found = strip.for_engines(64, 0.0, 1e-4).unwrap();
        assert!(found.is_hull_in_single_precision() && found.volume() > 0.8 * volume, "{}", found.volume() / volume);
    }

    #[test]
    fn a_shortfall_counts_from_the_gap() {
        let (a, b) = (cube(), cube());
        let at = |x: f64| pose(&Rigid::shift(DVec3::new(x, 0.1, 0.2)));
        assert!((a.shortfall(&at(0.0), &b, &at(0.9), 0.0) - 0.1).abs() < 1e-5);
        assert!((a.shortfall(&at(0.0), &b, &at(1.1), 0.3) - 0.2).abs() < 1e-5);
        assert_eq!(a.shortfall(&at(0.0), &b, &at(1.1), 0.05), 0.0);
    }

    #[test]
    fn flat_or_broken_points_are_no_hull() {
        let flat: Vec<DVec3> = (0..4).map(|i| DVec3::new((i & 1) as f64, (i >> 1) as f64, 0.0)).collect();
        assert!(Hull::of(&flat, 1e-6).is_none());
        assert!(Hull::of(&[DVec3::NAN; 5], 1e-6).is_none());
        assert!(Hull::of(&[], 1e-6).is_none());
        // A rim with a depth of 0.06 mm, of which all planes are too narrow to measure its thickness.
        let rim = [
            [-0.00516356, 0.02835752, -0.08844684],
            [-0.00519412, 0.02877178, -0.06252924],
            [-0.00517532, 0.03019597, -0.05311456],
            [-0.00517525, 0.03131881, -0.05394103],
            [-0.00517365, 0.03278462, -0.05620506],
            [-0.00517192, 0.03303907, -0.05774904],
            [-0.00516783, 0.03355096, -0.06133624],
            [-0.00514545, 0.03249334, -0.08409224],
            [-0.00513392, 0.03183458, -0.08699615],
            [-0.00513183, 0.03078576, -0.08793292],
            [-0.00515763, 0.02938926, -0.08846958],
        ];
        assert!(Hull::of(&rim.map(DVec3::from_array), 1e-3).is_none());
        assert!(!cube().is_thick(1.01) && cube().is_thick(0.99));
    }
}
