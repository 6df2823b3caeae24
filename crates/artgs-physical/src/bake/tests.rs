use super::*;
use crate::repair::welded;
use crate::shade::{CREASE, with_normals};
use crate::topology::testing::open_box;
use crate::unwrap::{UnwrapOptions, unwrap};
use artgs_core::Intrinsics;
use glam::DVec3;

/// A checkerboard of squares of 0.25 on all sides of a unit cube.
fn board(p: DVec3) -> Vec3 {
    let cell = (p * 4.0 + 1e-9).floor();
    let odd = (cell.x + cell.y + cell.z).rem_euclid(2.0) > 0.5;
    if odd { Vec3::new(220.0, 40.0, 30.0) } else { Vec3::new(20.0, 60.0, 200.0) }
}

/// Distance to the nearest line of the board inside the side, and to the edges of the cube.
fn from_lines(p: DVec3) -> f64 {
    let mut distances: Vec<f64> = p.to_array().iter().map(|x| (x * 4.0 - (x * 4.0).round()).abs() / 4.0).collect();
    distances.sort_by(f64::total_cmp);
    distances[1]
}

fn cube() -> Mesh {
    welded(&open_box(DVec3::ONE, 4, [true; 6]), 1e-6)
}

fn cameras() -> Vec<Camera> {
    let k = Intrinsics { fx: 400.0, fy: 400.0, cx: 150.0, cy: 150.0, width: 300, height: 300 };
    let from = |i: usize| {
        let angle = i as f64 * 0.9;
        let height = [2.0, -1.5, 0.6][i % 3];
        DVec3::new(3.0 * angle.cos(), 3.0 * angle.sin(), height) + 0.5
    };
    (0..12).map(|i| Camera::look_at(k, from(i), DVec3::splat(0.5), DVec3::Z)).collect()
}

/// Renders photos of the cube by its z-buffer; the photo `wrong` is green.
fn photos(cameras: &[Camera], wrong: Option<usize>) -> Vec<(Vec<[u8; 4]>, DepthMap)> {
    let cube = cube();
    let photo = |(i, camera): (usize, &Camera)| {
        let hits = visible(camera, &[&cube]);
        let color = |h: &Option<Hit>| {
            let Some(h) = h else { return [0; 4] };
            let [a, b, c] = crate::topology::corners(&cube, cube.triangles[h.triangle]);
            let [u, v, w] = h.weights.map(f64::from);
            let normal = (b - a).cross(c - a).normalize();
            let mut rgb = board(a * u + b * v + c * w - normal * 1e-3);
            if wrong == Some(i) {
                rgb = Vec3::new(0.0, 255.0, 0.0);
            }
            let [r, g, b] = rgb.to_array().map(|x| x as u8);
            [r, g, b, 255]
        };
        (hits.iter().map(color).collect(), depth_of(camera, &[&cube]))
    };
    cameras.iter().enumerate().map(photo).collect()
}

fn baked(depth: bool, wrong: Option<usize>, extra: Option<&Mesh>) -> (TexturedMesh, Baked, [u32; 2]) {
    let options = UnwrapOptions { texels_per_unit: 100.0, ..UnwrapOptions::default() };
    let flat = unwrap(&with_normals(&extra.cloned().unwrap_or_else(cube), CREASE), &options).unwrap();
    let cameras = cameras();
    let photos = photos(&cameras, wrong);
    let views: Vec<BakeView> = cameras
        .iter()
        .zip(&photos)
        .map(|(camera, (rgba, map))| BakeView {
            camera: *camera,
            rgba,
            depth: depth.then_some(map),
            labels: None,
            weight: 1.0,
        })
        .collect();
    let done = bake(&flat.mesh, flat.size, &views, &Mesh::default(), &BakeOptions::at_resolution(0.01));
    (flat.mesh, done, flat.size)
}

/// Share of texels away from lines and edges whose colour is the board's within 12 of 255.
fn right(mesh: &TexturedMesh, done: &Baked, size: [u32; 2]) -> f64 {
    let mut counts = (0, 0);
    for t in atlas::texels(mesh, size) {
        if from_lines(t.point) < 0.02 {
            continue;
        }
        let wanted = board(t.point - t.normal * 1e-3);
        let is = Vec3::from_array(done.texture.rgb[t.index].map(f32::from));
        counts.0 += usize::from(wanted.distance(is) < 12.0);
        counts.1 += 1;
    }
    assert!(counts.1 > 10_000);
    f64::from(counts.0 as u32) / f64::from(counts.1)
}

#[test]
fn a_checkerboard_is_baked_in_register() {
    let (mesh, done, size) = baked(true, None, None);
    assert!(right(&mesh, &done, size) > 0.995, "{}", right(&mesh, &done, size));
    assert!(done.seen as f64 > 0.98 * done.texels as f64 && done.colors.len() == mesh.mesh.vertices.len());
    assert!((done.texels as f64 - 60_000.0).abs() < 2000.0);
    let (_, again, _) = baked(true, None, None);
    assert_eq!(done, again);
}

#[test]
fn neither_a_wrong_photo_nor_missing_depth_degrades_it() {
    let (mesh, done, size) = baked(true, Some(3), None);
    assert!(right(&mesh, &done, size) > 0.9, "{}", right(&mesh, &done, size));
    let (mesh, done, size) = baked(false, None, None);
    assert!(right(&mesh, &done, size) > 0.995, "{}", right(&mesh, &done, size));
}

#[test]
fn what_is_hidden_takes_the_colour_next_to_it_and_not_of_what_hides_it() {
    // A small box inside the cube: no view sees it, so its colours come from the sides of the cube.
    let mut mesh = cube();
    let mut hidden = open_box(DVec3::splat(0.1), 1, [true; 6]);
    hidden = hidden.moved(&artgs_core::Rigid::shift(DVec3::new(0.08, 0.08, 0.08)));
    mesh.append(&welded(&hidden, 1e-6));
    let (mesh, done, size) = baked(true, None, Some(&mesh));
    assert!(done.seen < done.texels - 500);
    assert!(right(&mesh, &done, size) > 0.93);
}

#[test]
fn without_views_the_vertex_colours_are_painted() {
    let mut dense = cube();
    let color = |v: &[f32; 3]| [(v[0] * 200.0) as u8, (v[1] * 200.0) as u8, 30];
    dense.colors = dense.vertices.iter().map(color).collect();
    let flat = unwrap(&with_normals(&dense, CREASE), &UnwrapOptions::default()).unwrap();
    let done = bake(&flat.mesh, flat.size, &[], &dense, &BakeOptions::at_resolution(0.01));
    for t in atlas::texels(&flat.mesh, flat.size) {
        let is = done.texture.rgb[t.index].map(f64::from);
        assert!(
            (is[0] - t.point.x * 200.0).abs() < 2.5 && (is[1] - t.point.y * 200.0).abs() < 2.5 && is[2] == 30.0,
            "{is:?} at {}",
            t.point
        );
    }
    let odd = [BakeView { camera: cameras()[0], rgba: &[], depth: None, labels: None, weight: 1.0 }];
    let same = bake(&flat.mesh, flat.size, &odd, &dense, &BakeOptions::at_resolution(0.01));
    assert_eq!((done.seen, same.texture), (0, done.texture));
    assert_eq!(
        bake(&TexturedMesh { uvs: vec![], ..flat.mesh }, [8, 8], &[], &dense, &BakeOptions::at_resolution(0.1)),
        Baked::default()
    );
}
