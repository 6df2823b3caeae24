//! Points spread evenly over a surface.

use crate::geometry::topology::{corners, cross};
use artgs_core::Mesh;
use glam::DVec3;

/// About `count` points spread over the triangles by area, each with the unit normal of its triangle.
pub(crate) fn spread(mesh: &Mesh, count: usize) -> Vec<[DVec3; 2]> {
    let areas: Vec<f64> = mesh.triangles.iter().map(|t| cross(mesh, *t).length()).collect();
    let step = areas.iter().sum::<f64>() / count.max(1) as f64;
    let mut points = Vec::with_capacity(count);
    let mut carried = 0.0;
    for (t, area) in mesh.triangles.iter().zip(&areas) {
        carried += area;
        let [a, b, c] = corners(mesh, *t);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        while step > 0.0 && carried >= step {
            carried -= step;
            // The additive recurrence of the plastic number covers a square evenly; folding it gives the triangle.
            let i = points.len() as f64;
            let (mut u, mut v) = ((i * 0.754_877_666_246_693).fract(), (i * 0.569_840_290_998_053).fract());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            points.push([a + (b - a) * u + (c - a) * v, normal]);
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::topology::testing::open_box;

    #[test]
    fn sides_get_points_by_their_area() {
        let points = spread(&open_box(DVec3::new(1.0, 2.0, 3.0), 2, [true; 6]), 2200);
        assert!((points.len() as i64 - 2200).abs() <= 1, "{}", points.len());
        let facing = |axis: DVec3| points.iter().filter(|[_, n]| n.dot(axis).abs() > 0.99).count() as i64;
        assert!([(DVec3::X, 1200), (DVec3::Y, 600), (DVec3::Z, 400)].iter().all(|(a, n)| (facing(*a) - n).abs() < 5));
        assert!(spread(&Mesh::default(), 10).is_empty());
    }
}
