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

#[test]
fn a_point_beside_a_thin_hull_is_outside() {
    // The engine's search takes these points for points up to 9.7 mm inside.
    let corners: [[f32; 3]; 20] = [
        [-0.1932905, 0.12382815, 0.10325525],
        [-0.1962405, 0.13320512, 0.11300414],
        [-0.15662414, 0.13902049, 0.10640426],
        [-0.17108923, 0.13823573, 0.10633628],
        [-0.1694641, 0.13711835, 0.10534445],
        [-0.16335744, 0.14082658, 0.10916049],
        [-0.17315692, 0.13549006, 0.10461353],
        [-0.16080719, 0.1390863, 0.10632659],
        [-0.1683312, 0.13684739, 0.10515838],
        [-0.16287047, 0.1398068, 0.10716252],
        [-0.16014463, 0.13993421, 0.107180245],
        [-0.19422501, 0.13272099, 0.11540747],
        [-0.17411993, 0.1384333, 0.113683216],
        [-0.17421739, 0.13987252, 0.11340657],
        [-0.18019569, 0.13878465, 0.11380062],
        [-0.18833686, 0.13723247, 0.11435099],
        [-0.19643138, 0.13394645, 0.1152368],
        [-0.19590735, 0.13251473, 0.11549895],
        [-0.1894503, 0.13700734, 0.11442875],
        [-0.19486792, 0.13522336, 0.11494093],
    ];
    let points: Vec<Vector> = corners.iter().map(|p| Vector::from_array(*p)).collect();
    let hull = SharedShape::new(hull(&points).unwrap());
    for step in 0..9 {
        let p = DVec3::new(-0.161_077_1 - 0.00125 * f64::from(step), 0.128_666_6, 0.108_008_9);
        assert!(signed(&hull, p) > 4e-3, "{}", signed(&hull, p));
    }
    let middle = corners.iter().map(|p| DVec3::from_array(p.map(f64::from))).sum::<DVec3>() / 20.0;
    assert!(signed(&hull, middle) < 0.0);
}
