//! Pieces that are nearly boxes become boxes. Engines test boxes and their faces faster, and Rapier computes contacts with the first
//! four corners of a face only: things sink into a floor whose face has more.

use super::DecomposeOptions;
use super::union::stays_within;
use crate::geometry::hull::Hull;
use crate::geometry::solid::Solid;
use glam::DVec3;

/// The box around a piece if no corner of it is farther than the tolerance from the piece and from the solid, else the piece.
pub(super) fn boxed(hull: Hull, solid: &Solid, options: &DecomposeOptions) -> Hull {
    match around(&hull, options.thinnest) {
        Some(found) if fits(&found, &hull, solid, options) => found,
        _ => hull,
    }
}

fn fits(found: &Hull, hull: &Hull, solid: &Solid, options: &DecomposeOptions) -> bool {
    let near = |p: &DVec3| hull.distance(*p) <= options.tolerance;
    found.points().iter().all(near) && stays_within(found, solid, options.tolerance, options)
}

/// The smallest box with one side along the largest face of a hull.
fn around(hull: &Hull, thinnest: f64) -> Option<Hull> {
    let normal = hull.widest_face()?;
    let edges = hull.edges().filter_map(|edge| edge.reject_from_normalized(normal).try_normalize());
    let area = |along: &DVec3| {
        let across = normal.cross(*along);
        let [width, height] = [*along, across].map(|axis| extent(hull, axis)).map(|[low, high]| high - low);
        width * height
    };
    let along = edges.min_by(|a, b| area(a).total_cmp(&area(b)))?;
    let axes = [along, normal.cross(along), normal];
    let sides = axes.map(|axis| extent(hull, axis));
    let corner = |i: usize| (0..3).map(|k| axes[k] * sides[k][i >> k & 1]).sum();
    Hull::of(&(0..8).map(corner).collect::<Vec<DVec3>>(), thinnest)
}

fn extent(hull: &Hull, axis: DVec3) -> [f64; 2] {
    let along = hull.points().iter().map(|p| p.dot(axis));
    along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

#[cfg(test)]
mod tests {
    use super::super::tests::OPTIONS;
    use super::*;
    use artgs_core::Mesh;

    /// A turned plate whose corners are cut off by `cut`.
    fn plate(cut: f64) -> Hull {
        let turned = glam::DQuat::from_rotation_z(0.4) * glam::DQuat::from_rotation_x(0.3);
        let rim = [[0.0, cut], [cut, 0.0], [0.6 - cut, 0.0], [0.6, cut], [0.6, 0.4], [0.0, 0.4]];
        let corners = rim.iter().flat_map(|[x, y]| [0.0, 0.02].map(|z| turned * DVec3::new(*x, *y, z)));
        Hull::of(&corners.collect::<Vec<_>>(), 1e-3).unwrap()
    }

    #[test]
    fn a_plate_with_worn_corners_becomes_a_box_and_one_with_cut_corners_stays() {
        for (cut, corners) in [(0.004, 8), (0.05, 12)] {
            let hull = plate(cut);
            assert_eq!(hull.points().len(), 12);
            let Mesh { vertices, triangles, .. } = hull.mesh();
            let solid = Solid::new(&Mesh { vertices, triangles, colors: Vec::new() }, &|_| true).unwrap();
            let found = boxed(hull.clone(), &solid, &OPTIONS);
            assert_eq!(found.points().len(), corners, "cut {cut}");
            assert!(found.volume() >= hull.volume() - 1e-9 && found.volume() < 1.01 * hull.volume());
        }
    }
}
