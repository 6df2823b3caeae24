//! Distances of hulls with a known answer.

use super::*;

fn sheet(thickness: f32) -> ConvexPolyhedron {
    let corner = |i: u32, bit: u32| if i >> bit & 1 == 1 { 0.5 } else { -0.5 };
    let points: Vec<Vector> =
        (0..8).map(|i| Vector::new(corner(i, 0), corner(i, 1), thickness * corner(i, 2))).collect();
    hull(&points).unwrap()
}

#[test]
fn hulls_that_are_apart_have_a_distance_and_others_a_penetration() {
    let (a, b) = (sheet(2e-3), sheet(4e-3));
    let origin = Pose::IDENTITY;
    for (height, expected) in [(0.013, 0.010), (0.0035, 0.0005), (0.002, -0.001), (0.001, -0.002)] {
        let raised = Pose::from_parts(Vector::new(0.0, 0.0, height), Rotation::IDENTITY);
        let found = distance([&origin, &raised], [&a, &b]).unwrap();
        assert!((found - expected).abs() < 1e-4, "{height}: {found}");
    }
}
