use super::*;

pub(super) const OPTIONS: DecomposeOptions = DecomposeOptions {
    tolerance: 5e-3,
    most: 64,
    corners: 64,
    rounding: 5e-4,
    skin: 0.01,
    least: 2e-3,
    thinnest: 1e-3,
    settings: DecomposeSettings::DEFAULT,
};

/// A box of five walls, open above.
fn tray() -> Mesh {
    let (mut mesh, wall) = (Mesh::default(), 0.05);
    let mut add = |low: DVec3, high: DVec3| {
        let corner = |i: usize| [0, 1, 2].map(|a| if i >> a & 1 == 0 { low[a] } else { high[a] } as f32);
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        mesh.append(&Mesh { vertices: (0..8).map(corner).collect(), colors: Vec::new(), triangles });
    };
    add(DVec3::ZERO, DVec3::new(1.0, 0.8, wall));
    add(DVec3::new(0.0, 0.0, wall), DVec3::new(wall, 0.8, 0.5));
    add(DVec3::new(1.0 - wall, 0.0, wall), DVec3::new(1.0, 0.8, 0.5));
    add(DVec3::new(wall, 0.0, wall), DVec3::new(1.0 - wall, wall, 0.5));
    add(DVec3::new(wall, 0.8 - wall, wall), DVec3::new(1.0 - wall, 0.8, 0.5));
    mesh
}

#[test]
fn a_tray_stays_hollow_and_is_covered() {
    let hulls = decompose(&tray(), &|_| true, &OPTIONS);
    let inside = |p: DVec3, slack: f64| hulls.iter().any(|h| h.planes().iter().all(|f| f.distance(p) < slack));
    assert!((5..=24).contains(&hulls.len()), "{}", hulls.len());
    for x in 1..10 {
        for y in 1..8 {
            let at = |z: f64| DVec3::new(x as f64 * 0.1, y as f64 * 0.1, z);
            assert!(!inside(at(0.15), -0.01) && !inside(at(0.4), -0.01), "something in the way at {}", at(0.4));
            assert!(inside(at(0.0), 0.01), "no floor at {}", at(0.0));
        }
    }
    assert!(hulls.iter().all(|h| h.points().len() <= 64));
}

#[test]
fn an_empty_mesh_has_no_pieces_and_a_sheet_becomes_a_plate() {
    assert!(decompose(&Mesh::default(), &|_| true, &OPTIONS).is_empty());
    let flat =
        Mesh { vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], colors: vec![], triangles: vec![[0, 1, 2]] };
    // A sheet gets the thickness `skin`.
    let sheet = decompose(&flat, &|_| true, &OPTIONS);
    assert!((sheet.iter().map(Hull::volume).sum::<f64>() - 0.005).abs() < 1e-3, "{sheet:?}");
}

#[test]
fn a_sheet_inside_a_solid_leaves_it_solid() {
    let mut mesh = Mesh::cuboid([0.0; 3], [0.6, 0.4, 0.1]);
    mesh.append(&Mesh::cuboid([0.1, 0.2, 0.02], [0.5, 0.202, 0.09]));
    let solid = Solid::new(&mesh, &|_| true).unwrap();
    // 1 cm before the sheet, 4 cm and 6 cm from the outer sides.
    let distance = solid.signed(DVec3::new(0.3, 0.19, 0.05));
    assert!((distance + 0.01).abs() < 1e-5, "{distance}");
    assert!(solid.signed(DVec3::new(0.3, 0.19, 0.13)) > 0.029);
}

/// Farthest that samples of the pieces are outside a mesh.
fn protrusion(hulls: &[Hull], mesh: &Mesh) -> f64 {
    let solid = Solid::new(mesh, &|_| true).unwrap();
    let samples = hulls.iter().flat_map(|hull| hull.samples(2000));
    samples.map(|p| solid.signed(p)).fold(0.0, f64::max)
}

#[test]
fn pieces_of_a_sheet_reach_into_no_notch_of_its_rim() {
    // A shelf with a slanted rim of teeth, 8 to 26 mm apart, as half-seen sheets have.
    let mut mesh = Mesh::cuboid([0.0; 3], [0.6, 0.3, 0.01]);
    for tooth in 0..12 {
        let (x, gap) = (0.05 * tooth as f32, 0.008 + 0.0015 * tooth as f32);
        mesh.append(&Mesh::cuboid([x, 0.3, 0.0], [x + 0.05 - gap, 0.33 + 0.01 * (tooth % 4) as f32, 0.01]));
    }
    let hulls = decompose(&mesh, &|_| true, &OPTIONS);
    let deepest = protrusion(&hulls, &mesh);
    assert!(deepest < 2.2 * OPTIONS.tolerance, "{deepest}");
    let pieces = super::Pieces::default();
    let pieces = hulls.into_iter().fold(pieces, |mut all, hull| {
        all.push(hull);
        all
    });
    let slabs = super::slabs::Slabs::new(&pieces, 1.5 * OPTIONS.tolerance);
    let solid = Solid::new(&mesh, &|_| true).unwrap();
    let open = solid.samples(0.01, false).iter().filter(|s| !slabs.cover(s.point)).count();
    assert_eq!(open, 0);
}

#[test]
fn small_features_of_a_large_object_have_pieces() {
    // Knobs of 2 cm on a slab of 3 by 3 metres.
    let mut mesh = Mesh::cuboid([0.0; 3], [3.0, 3.0, 0.05]);
    let knobs: Vec<[f32; 2]> = (0..16).map(|i| [0.2 + 0.7 * (i % 4) as f32, 0.3 + 0.7 * (i / 4) as f32]).collect();
    for [x, y] in &knobs {
        mesh.append(&Mesh::cuboid([*x, *y, 0.05], [x + 0.02, y + 0.02, 0.07]));
    }
    let hulls = decompose(&mesh, &|_| true, &OPTIONS);
    for [x, y] in &knobs {
        let top = DVec3::new(f64::from(*x) + 0.01, f64::from(*y) + 0.01, 0.068);
        assert!(hulls.iter().any(|h| h.planes().iter().all(|f| f.distance(top) < OPTIONS.tolerance)), "{top}");
    }
}

#[test]
fn a_long_strip_with_an_angle_is_patched_by_few_long_pieces() {
    // Legs of 20 and 35 mm, 8 mm thick, 1.1 m long: the rim of a door frame. The inner corner is 12 mm from the hull of both legs.
    let profile = [[0.0, 0.0], [0.02, 0.0], [0.02, 0.008], [0.008, 0.008], [0.008, 0.035], [0.0, 0.035]];
    let ends = [0.0, 1.1_f32].map(|z| profile.map(|[x, y]| [x, y, z])).concat();
    let sides = (0..6).flat_map(|i| {
        let j = (i + 1) % 6;
        [[i, j, j + 6], [i, j + 6, i + 6]]
    });
    let caps = [[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 5, 4]];
    let lids = caps.iter().flat_map(|[a, b, c]| [[*a, *b, *c], [a + 6, c + 6, b + 6]]);
    let mesh = Mesh { vertices: ends, colors: Vec::new(), triangles: sides.chain(lids).collect() };
    let solid = Solid::new(&mesh, &|_| true).unwrap();
    let tolerance = 3e-3;
    let options = DecomposeOptions { tolerance, skin: 8e-3, ..OPTIONS };
    let hulls = patches(&solid, &[], &options);
    assert!((2..=12).contains(&hulls.len()), "{}", hulls.len());
    let longest = |hull: &Hull| (hull.bounds()[1] - hull.bounds()[0]).max_element();
    assert!(hulls.iter().map(longest).fold(0.0, f64::max) > 0.5);
    assert!(protrusion(&hulls, &mesh) < 2.0 * tolerance);
    let holds = crate::collision::clearance::covering(&hulls, tolerance);
    assert!(solid.samples(0.01, false).iter().all(|s| holds(&s.point)));
}
