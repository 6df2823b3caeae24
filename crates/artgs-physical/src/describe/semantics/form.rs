//! Measures of a part that its class follows from: extents along its joint, how it lies against the part that carries it.

use crate::geometry::topology::corners;
use crate::settings::DescribeSettings;
use artgs_core::{AssetJoint, AssetLink, JointKind, Mesh, Rigid, State};
use glam::DVec3;

/// A point of a surface with its normal and the area that it stands for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub at: DVec3,
    pub normal: DVec3,
    pub area: f64,
}

/// Points of a mesh at most about `spacing` apart, moved by `motion`. Each triangle is divided into equal ones.
pub(crate) fn samples(mesh: &Mesh, motion: &Rigid, spacing: f64) -> Vec<Sample> {
    /// Divisions of an edge at most.
    const MOST: f64 = 64.0;
    let mut out = Vec::new();
    for triangle in &mesh.triangles {
        let [a, b, c] = corners(mesh, *triangle).map(|p| motion.apply(p));
        let cross = (b - a).cross(c - a);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        if !(longest > 0.0 && longest.is_finite()) {
            continue;
        }
        let n = (longest / spacing).ceil().clamp(1.0, MOST) as usize;
        let (normal, area) = (cross.normalize_or_zero(), 0.5 * cross.length() / (n * n) as f64);
        let (u, v) = ((b - a) / n as f64, (c - a) / n as f64);
        for i in 0..n {
            for j in 0..n - i {
                let corner = a + u * i as f64 + v * j as f64;
                out.push(Sample { at: corner + (u + v) / 3.0, normal, area });
                if i + j + 1 < n {
                    out.push(Sample { at: corner + (u + v) * (2.0 / 3.0), normal, area });
                }
            }
        }
    }
    out
}

/// Lowest and highest coordinate along `axis` between which all but the share `beyond` of the area at each end lies;
/// none without area.
pub(crate) fn span(samples: &[Sample], axis: DVec3, beyond: f64) -> Option<[f64; 2]> {
    let mut along: Vec<(f64, f64)> = samples.iter().map(|s| (s.at.dot(axis), s.area)).collect();
    along.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = along.iter().map(|(_, area)| area).sum();
    let mut before = 0.0;
    let mut ends = [None, None];
    for (at, area) in along {
        before += area;
        if before >= beyond * total {
            ends[0].get_or_insert(at);
        }
        if before >= (1.0 - beyond) * total {
            ends[1].get_or_insert(at);
        }
    }
    (total > 0.0).then_some([ends[0]?, ends[1]?])
}

/// A moving part at joint value 0. Directions and points are in the object's frame (+Z up).
pub(crate) struct Form {
    pub kind: JointKind,
    /// Joint axis; positive values open.
    pub axis: DVec3,
    /// Direction from the axis to the middle of the part; for slides the upright direction across the axis.
    pub reach: DVec3,
    /// Direction in which the middle of the part moves as it opens.
    pub opens: DVec3,
    /// Middle of the surface.
    pub middle: DVec3,
    /// Extents along `axis`, `reach` and the direction across both.
    pub extent: [f64; 3],
    /// Longest extent across the axis, and that across it.
    pub across: [f64; 2],
    /// Farthest distance from the axis, and distance of the middle from it as a share of that; 0 for slides.
    pub radius: f64,
    pub offset: f64,
    /// Surface of the part.
    pub surface: Vec<Sample>,
    /// Largest difference of two observed values, metres or radians.
    pub travel: f64,
}

impl Form {
    /// None for a link without joint or without a surface. `diagonal` is that of the object.
    pub(super) fn of(link: &AssetLink, diagonal: f64, settings: &DescribeSettings) -> Option<Self> {
        /// Length that guards a division, metres.
        const TINY: f64 = 1e-12;
        let joint = link.joint.as_ref()?;
        let surface = samples(&link.visual.mesh, &Rigid::shift(link.origin), settings.spacing_share * diagonal);
        let area: f64 = surface.iter().map(|s| s.area).sum();
        if area <= 0.0 {
            return None;
        }
        let middle = surface.iter().map(|s| s.at * s.area).sum::<DVec3>() / area;
        let AssetJoint { kind, axis, .. } = *joint;
        let (reach, opens) = match kind {
            JointKind::Prismatic => {
                let up = if axis.z.abs() < settings.upright { DVec3::Z } else { DVec3::NEG_Y };
                (up.reject_from_normalized(axis).normalize_or_zero(), axis)
            }
            JointKind::Revolute | JointKind::Screw => {
                let reach =
                    (middle - link.origin).reject_from_normalized(axis).normalize_or(axis.any_orthonormal_vector());
                (reach, axis.cross(reach))
            }
        };
        let mut extent = [0.0; 3];
        for (extent, direction) in extent.iter_mut().zip([axis, reach, axis.cross(reach)]) {
            let [low, high] = span(&surface, direction, settings.beyond)?;
            *extent = high - low;
        }
        let across = longest(&surface, middle, axis, settings.beyond)?;
        let far = |p: DVec3| (p - link.origin).reject_from_normalized(axis).length();
        let radius = surface.iter().map(|s| far(s.at)).fold(0.0, f64::max);
        let turns = kind != JointKind::Prismatic;
        let (radius, offset) = if turns { (radius, far(middle) / radius.max(TINY)) } else { (0.0, 0.0) };
        let travel = (joint.observed[State::END] - joint.observed[State::START]).abs();
        Some(Self { kind, axis, reach, opens, middle, extent, across, radius, offset, surface, travel })
    }

    /// Mean outward normal of the faces that look where the part opens, at an angle with a cosine above `cosine`; [`Form::opens`] if there is
    /// none.
    pub(super) fn facing(&self, cosine: f64) -> DVec3 {
        let fits = self.surface.iter().filter(|s| s.normal.dot(self.opens) > cosine);
        fits.map(|s| s.normal * s.area).sum::<DVec3>().normalize_or(self.opens)
    }
}

/// Extents of a surface across `axis`: along the direction in which it is longest, and along the other.
fn longest(surface: &[Sample], middle: DVec3, axis: DVec3, beyond: f64) -> Option<[f64; 2]> {
    let (u, v) = axis.any_orthonormal_pair();
    let mut moments = [0.0; 3];
    for s in surface {
        let (x, y) = ((s.at - middle).dot(u), (s.at - middle).dot(v));
        for (sum, term) in moments.iter_mut().zip([x * x, y * y, x * y]) {
            *sum += s.area * term;
        }
    }
    let angle = 0.5 * (2.0 * moments[2]).atan2(moments[0] - moments[1]);
    let along = u * angle.cos() + v * angle.sin();
    let width = |direction: DVec3| span(surface, direction, beyond).map(|[low, high]| high - low);
    let [a, b] = [width(along)?, width(axis.cross(along))?];
    Some([a.max(b), a.min(b)])
}

/// Share of the footprint of a panel, in its plane across `normal`, that has a surface of `others` within `depth` on either
/// side; the panel is that without the share `beyond` of its area at each end.
pub(crate) fn covered(panel: &[Sample], normal: DVec3, others: &[DVec3], depth: f64, beyond: f64) -> f64 {
    /// Cells along each side.
    const CELLS: usize = 12;
    /// Length that guards a division, metres.
    const TINY: f64 = 1e-12;
    let (u, v) = normal.any_orthonormal_pair();
    let [Some([u0, u1]), Some([v0, v1]), Some([n0, n1])] = [u, v, normal].map(|axis| span(panel, axis, beyond)) else {
        return 0.0;
    };
    let cell = |p: DVec3| {
        let at = |x: f64, low: f64, high: f64| {
            let i = (x - low) / (high - low).max(TINY) * CELLS as f64;
            (0.0..CELLS as f64).contains(&i).then_some(i as usize)
        };
        Some(CELLS * at(p.dot(v), v0, v1)? + at(p.dot(u), u0, u1)?)
    };
    let (mut own, mut met) = ([false; CELLS * CELLS], [false; CELLS * CELLS]);
    for i in panel.iter().filter_map(|s| cell(s.at)) {
        own[i] = true;
    }
    let near = |p: &&DVec3| (n0 - depth..n1 + depth).contains(&p.dot(normal));
    for i in others.iter().filter(near).filter_map(|p| cell(*p)) {
        met[i] = true;
    }
    let both = own.iter().zip(&met).filter(|(own, met)| **own && **met).count();
    both as f64 / own.iter().filter(|own| **own).count().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_have_the_area_of_the_mesh_and_spans_ignore_loose_triangles() {
        let mut mesh = Mesh::cuboid([0.0; 3], [1.0, 2.0, 3.0]);
        let surface = samples(&mesh, &Rigid::shift(DVec3::X), 0.1);
        let area: f64 = surface.iter().map(|s| s.area).sum();
        assert!((area - 22.0).abs() < 1e-6, "{area}");
        mesh.append(&Mesh::cuboid([9.0; 3], [9.1; 3]));
        let [low, high] = span(&samples(&mesh, &Rigid::IDENTITY, 0.05), DVec3::Z, 0.01).unwrap();
        assert!((0.0..0.1).contains(&low) && (2.9..=3.0).contains(&high), "{low} {high}");
        assert_eq!(span(&[], DVec3::X, 0.01), None);
    }

    #[test]
    fn half_of_a_panel_is_covered_by_a_plate_of_half_its_size() {
        let panel = samples(&Mesh::cuboid([0.0; 3], [1.0, 1.0, 0.02]), &Rigid::IDENTITY, 0.02);
        let plate = samples(&Mesh::cuboid([0.0, 0.0, -0.2], [0.5, 1.0, -0.1]), &Rigid::IDENTITY, 0.02);
        let points: Vec<DVec3> = plate.iter().map(|s| s.at).collect();
        let share = covered(&panel, DVec3::Z, &points, 0.3, 0.01);
        assert!((0.45..0.6).contains(&share), "{share}");
        assert_eq!(covered(&panel, DVec3::Z, &points, 0.05, 0.01), 0.0);
    }
}
