//! Closed surfaces to build parts from: boxes, extruded outlines, lathed profiles.

use artgs_core::Rigid;
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// A closed surface: triangles, counter-clockwise seen from outside, whose edges meet without gaps.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Solid(pub(crate) Vec<[DVec3; 3]>);

impl Solid {
    /// The surface moved rigidly.
    pub(crate) fn moved(mut self, motion: &Rigid) -> Self {
        self.0.iter_mut().for_each(|t| *t = t.map(|p| motion.apply(p)));
        self
    }

    /// The surface shifted.
    pub(crate) fn shifted(self, by: [f64; 3]) -> Self {
        self.moved(&Rigid::shift(by.into()))
    }

    /// Turned so that what pointed along z points to the front (-y), and what pointed along y points up.
    pub(crate) fn facing_front(self) -> Self {
        self.moved(&Rigid::about(DVec3::X, DVec3::ZERO, PI / 2.0))
    }

    /// Turned so that what pointed along z points along x, and what pointed along x points down.
    pub(crate) fn along_x(self) -> Self {
        self.moved(&Rigid::about(DVec3::Y, DVec3::ZERO, PI / 2.0))
    }

    fn quad(&mut self, a: DVec3, b: DVec3, c: DVec3, d: DVec3) {
        self.0.extend([[a, b, c], [a, c, d]]);
    }
}

/// The box between two corners.
pub(crate) fn cuboid(low: [f64; 3], high: [f64; 3]) -> Solid {
    let [x0, y0, z0] = low;
    let [x1, y1, z1] = high;
    prism(&[DVec2::new(x0, y0), DVec2::new(x1, y0), DVec2::new(x1, y1), DVec2::new(x0, y1)], z0, z1)
}

/// An outline in the xy plane, counter-clockwise and without crossings, extruded from `low` to `high` along z.
pub(crate) fn prism(outline: &[DVec2], low: f64, high: f64) -> Solid {
    let mut solid = Solid::default();
    for [a, b, c] in triangulate(outline) {
        solid.0.push([outline[a].extend(high), outline[b].extend(high), outline[c].extend(high)]);
        solid.0.push([outline[c].extend(low), outline[b].extend(low), outline[a].extend(low)]);
    }
    for (i, a) in outline.iter().enumerate() {
        let b = outline[(i + 1) % outline.len()];
        solid.quad(a.extend(low), b.extend(low), b.extend(high), a.extend(high));
    }
    solid
}

/// The region between two outlines of equally many points, the inner one inside the outer one and both
/// counter-clockwise, extruded from `low` to `high` along z. Points of the same index are joined.
pub(crate) fn frame(outer: &[DVec2], inner: &[DVec2], low: f64, high: f64) -> Solid {
    let mut solid = Solid::default();
    for i in 0..outer.len().min(inner.len()) {
        let j = (i + 1) % outer.len();
        let (a, b, c, d) = (outer[i], outer[j], inner[j], inner[i]);
        solid.quad(a.extend(high), b.extend(high), c.extend(high), d.extend(high));
        solid.quad(d.extend(low), c.extend(low), b.extend(low), a.extend(low));
        solid.quad(a.extend(low), b.extend(low), b.extend(high), a.extend(high));
        solid.quad(c.extend(low), d.extend(low), d.extend(high), c.extend(high));
    }
    solid
}

/// A closed profile of (radius, z), counter-clockwise and with radii of at least 0, turned about the z axis.
pub(crate) fn lathe(profile: &[DVec2], segments: usize) -> Solid {
    let mut solid = Solid::default();
    let at = |p: DVec2, k: usize| {
        let angle = TAU * (k % segments) as f64 / segments as f64;
        DVec3::new(p.x * angle.cos(), p.x * angle.sin(), p.y)
    };
    for (i, p) in profile.iter().enumerate() {
        let q = profile[(i + 1) % profile.len()];
        for k in 0..segments {
            match (p.x > 0.0, q.x > 0.0) {
                (true, true) => solid.quad(at(*p, k), at(*p, k + 1), at(q, k + 1), at(q, k)),
                (true, false) => solid.0.push([at(*p, k), at(*p, k + 1), at(q, k)]),
                (false, true) => solid.0.push([at(*p, k), at(q, k + 1), at(q, k)]),
                (false, false) => {}
            }
        }
    }
    solid
}

/// A rod around the z axis.
pub(crate) fn cylinder(radius: f64, low: f64, high: f64) -> Solid {
    lathe(&[DVec2::new(0.0, low), DVec2::new(radius, low), DVec2::new(radius, high), DVec2::new(0.0, high)], 32)
}

/// A rod between two points.
pub(crate) fn rod(from: [f64; 3], to: [f64; 3], radius: f64) -> Solid {
    let (from, to) = (DVec3::from(from), DVec3::from(to));
    let turn = DQuat::from_rotation_arc(DVec3::Z, (to - from).normalize_or(DVec3::Z));
    cylinder(radius, 0.0, from.distance(to)).moved(&Rigid { rotation: turn, translation: from })
}

/// A pipe around the z axis.
pub(crate) fn tube(inner: f64, outer: f64, low: f64, high: f64) -> Solid {
    let corner = |r, z| DVec2::new(r, z);
    lathe(&[corner(inner, low), corner(outer, low), corner(outer, high), corner(inner, high)], 48)
}

/// Points of a circle, counter-clockwise.
pub(crate) fn circle(center: DVec2, radius: f64, points: usize) -> Vec<DVec2> {
    (0..points).map(|k| center + radius * DVec2::from_angle(TAU * k as f64 / points as f64)).collect()
}

/// Points of the rectangle between two corners that lie in the directions of as many points of a [`circle`] around
/// its middle; the corners are among them if `points` is a multiple of 8.
pub(crate) fn rectangle(low: DVec2, high: DVec2, points: usize) -> Vec<DVec2> {
    let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
    let at = |k: usize| {
        let ray = DVec2::from_angle(TAU * k as f64 / points as f64);
        middle + half * (ray / ray.abs().max_element()).clamp(DVec2::NEG_ONE, DVec2::ONE)
    };
    (0..points).map(at).collect()
}

/// Triangulates a simple outline by ear clipping.
fn triangulate(outline: &[DVec2]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..outline.len()).collect();
    let mut triangles = Vec::new();
    let turn = |a: usize, b: usize, c: usize| (outline[b] - outline[a]).perp_dot(outline[c] - outline[a]);
    while left.len() > 3 {
        let n = left.len();
        let corner = |i: usize| [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
        let is_ear = |i: &usize| {
            let [a, b, c] = corner(*i);
            let holds = |p: &usize| turn(a, b, *p) >= 0.0 && turn(b, c, *p) >= 0.0 && turn(c, a, *p) >= 0.0;
            turn(a, b, c) > 1e-12 && !left.iter().filter(|p| ![a, b, c].contains(p)).any(holds)
        };
        // The ear with the largest height relative to its base, so that thin triangles are rare.
        let height = |i: usize| {
            let [a, b, c] = corner(i);
            turn(a, b, c) / (outline[a] - outline[c]).length_squared().max(1e-12)
        };
        let best = (0..n).filter(is_ear).max_by(|i, j| height(*i).total_cmp(&height(*j)));
        let Some(i) = best else { break };
        triangles.push(corner(i));
        left.remove(i);
    }
    if let [a, b, c] = left[..] {
        triangles.push([a, b, c]);
    }
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(solid: &Solid) -> f64 {
        solid.0.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum()
    }

    #[test]
    fn volumes_are_those_of_the_textbook() {
        let l_shape = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)].map(DVec2::from);
        let n = 32.0;
        // Area of a regular polygon inside the unit circle.
        let disc = n / 2.0 * (TAU / n).sin();
        let square = [DVec2::new(-2.0, -1.5), DVec2::new(2.0, 1.5)];
        for (solid, expected) in [
            (cuboid([0.0, 1.0, 2.0], [1.0, 3.0, 5.0]), 6.0),
            (prism(&l_shape, -1.0, 1.0), 8.0),
            (cylinder(1.0, 0.0, 3.0), 3.0 * disc),
            (frame(&rectangle(square[0], square[1], 32), &circle(DVec2::ZERO, 1.0, 32), 0.0, 0.5), 6.0 - disc / 2.0),
            (cuboid([0.0; 3], [1.0, 2.0, 3.0]).facing_front().along_x(), 6.0),
        ] {
            assert!((volume(&solid) - expected).abs() < 1e-9, "{} {expected}", volume(&solid));
        }
    }

    #[test]
    fn facing_front_brings_z_to_the_front_and_y_up() {
        let [a, ..] = Solid(vec![[DVec3::new(1.0, 2.0, 3.0); 3]]).facing_front().0[0];
        assert!((a - DVec3::new(1.0, -3.0, 2.0)).length() < 1e-12, "{a}");
    }
}
