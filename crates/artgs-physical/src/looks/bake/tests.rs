use super::gains::Gain;
use super::*;
use crate::geometry::topology::testing::open_box;
use crate::geometry::weld::welded;
use crate::looks::shade::with_normals;
use crate::looks::unwrap::{UnwrapOptions, unwrap};
use crate::settings::{AtlasSettings, LookSettings};
use artgs_core::{Camera, DepthMap, Intrinsics};
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
            let [a, b, c] = crate::geometry::topology::corners(&cube, cube.triangles[h.triangle]);
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

type Images = Vec<(Vec<[u8; 4]>, DepthMap)>;

fn prepared<'a>(cameras: &[Camera], images: &'a Images) -> Vec<Photo<'a>> {
    let photo = |(camera, (rgba, map)): (&Camera, &'a (Vec<[u8; 4]>, DepthMap))| {
        Photo::new(rgba, map, camera.intrinsics, (0.04, &BakeSettings::DEFAULT)).unwrap()
    };
    cameras.iter().zip(images).map(photo).collect()
}

fn seen_by<'a>(cameras: &[Camera], photos: &'a [Photo<'a>]) -> Vec<BakeView<'a>> {
    cameras.iter().zip(photos).map(|(camera, photo)| BakeView::new(photo, *camera)).collect()
}

fn flat(mesh: &Mesh) -> (TexturedMesh, [u32; 2]) {
    let options = UnwrapOptions { texels_per_unit: 100.0, settings: AtlasSettings::DEFAULT };
    let flat = unwrap(&with_normals(mesh, LookSettings::DEFAULT.crease), &options).unwrap();
    (flat.mesh, flat.size)
}

fn baked(wrong: Option<usize>, extra: Option<&Mesh>) -> (TexturedMesh, Baked, [u32; 2]) {
    let (mesh, size) = flat(&extra.cloned().unwrap_or_else(cube));
    let cameras = cameras();
    let images = photos(&cameras, wrong);
    let photos = prepared(&cameras, &images);
    let views = seen_by(&cameras, &photos);
    let done =
        bake(&mesh, size, &views, (&Mesh::default(), 4), &BakeOptions::at_resolution(0.01, &BakeSettings::DEFAULT));
    (mesh, done, size)
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
    let (mesh, done, size) = baked(None, None);
    assert!(right(&mesh, &done, size) > 0.995, "{}", right(&mesh, &done, size));
    assert!(done.seen as f64 > 0.98 * done.texels as f64 && done.colors.len() == mesh.mesh.vertices.len());
    assert!((done.texels as f64 - 60_000.0).abs() < 2000.0);
    let (_, again, _) = baked(None, None);
    assert_eq!(done, again);
}

#[test]
fn a_wrong_photo_does_not_degrade_it() {
    let (mesh, done, size) = baked(Some(3), None);
    assert!(right(&mesh, &done, size) > 0.9, "{}", right(&mesh, &done, size));
}

/// The cube's texture from photos changed by factors of their number and the normal, equalised, and whether any view has a gain.
fn equalised(factor: impl Fn(usize, DVec3) -> f64) -> (TexturedMesh, Baked, [u32; 2], bool) {
    let cube = cube();
    let (mesh, size) = flat(&cube);
    let cameras = cameras();
    let mut images = photos(&cameras, None);
    for (i, ((rgba, _), camera)) in images.iter_mut().zip(&cameras).enumerate() {
        for (pixel, hit) in rgba.iter_mut().zip(visible(camera, &[&cube])) {
            let Some(hit) = hit else { continue };
            let [a, b, c] = crate::geometry::topology::corners(&cube, cube.triangles[hit.triangle]);
            let factor = factor(i, (b - a).cross(c - a).normalize());
            let [r, g, b, a] = *pixel;
            *pixel = [
                (f64::from(r) * factor).round() as u8,
                (f64::from(g) * factor).round() as u8,
                (f64::from(b) * factor).round() as u8,
                a,
            ];
        }
    }
    let photos = prepared(&cameras, &images);
    let mut views = [seen_by(&cameras, &photos)];
    let options = BakeOptions::at_resolution(0.01, &BakeSettings::DEFAULT);
    equalise(&mut views, &[crate::looks::spread::spread(&cube, 2000)], &[options]);
    let changed = views[0].iter().any(|view| view.gain != Gain::default());
    let done = bake(&mesh, size, &views[0], (&Mesh::default(), 4), &options);
    (mesh, done, size, changed)
}

#[test]
fn exposures_are_equalised_and_the_brightness_stays() {
    // Factors of alternating views, 0.95 in the mean.
    let factor = |i: usize| 0.95 + [0.15, -0.15, 0.0][i % 3];
    let (mesh, done, size, changed) = equalised(|i, _| factor(i));
    let expected = |t: &Texel| board(t.point - t.normal * 1e-3) * 0.94;
    let texels: Vec<Texel> = atlas::texels(&mesh, size).into_iter().filter(|t| from_lines(t.point) > 0.02).collect();
    let near = |t: &&Texel| expected(t).distance(Vec3::from_array(done.texture.rgb[t.index].map(f32::from))) < 9.0;
    let share = texels.iter().filter(near).count() as f64 / texels.len() as f64;
    assert!(changed && share > 0.98, "{share}");
}

#[test]
fn light_that_changes_with_the_side_and_the_view_is_equalised() {
    // A lamp along +x in even views, along -x in others.
    let lamp = |i: usize, normal: DVec3| 0.85 + if i.is_multiple_of(2) { 0.15 } else { -0.15 } * normal.x;
    let (mesh, done, size, changed) = equalised(lamp);
    let texels: Vec<Texel> = atlas::texels(&mesh, size)
        .into_iter()
        .filter(|t| t.normal.x.abs() > 0.99 && from_lines(t.point) > 0.02)
        .collect();
    let ratio = |t: &Texel| {
        f64::from(
            done.texture.rgb[t.index].map(f32::from).iter().sum::<f32>()
                / board(t.point - t.normal * 1e-3).element_sum(),
        )
    };
    let mut ratios: Vec<f64> = texels.iter().map(ratio).collect();
    ratios.sort_by(f64::total_cmp);
    let at = |share: f64| ratios[(share * ratios.len() as f64) as usize];
    // Unequalised, the sides have 1 and 0.7.
    assert!(changed && at(0.02) > 0.75 && at(0.98) < 0.95, "{} {}", at(0.02), at(0.98));
}

#[test]
fn equal_photos_and_light_that_stays_are_left_as_they_are() {
    let (_, done, _, changed) = equalised(|_, normal| 0.8 + 0.1 * normal.z);
    assert!(!changed);
    let (_, plain, _, changed) = equalised(|_, _| 1.0);
    assert!(!changed && plain == baked(None, None).1 && done != plain);
}

#[test]
fn what_is_hidden_takes_the_colour_next_to_it_and_not_of_what_hides_it() {
    // A small box inside the cube: no view sees it, so its colours come from the sides of the cube.
    let mut mesh = cube();
    let mut hidden = open_box(DVec3::splat(0.1), 1, [true; 6]);
    hidden = hidden.moved(&artgs_core::Rigid::shift(DVec3::new(0.08, 0.08, 0.08)));
    mesh.append(&welded(&hidden, 1e-6));
    let (mesh, done, size) = baked(None, Some(&mesh));
    assert!(done.seen < done.texels - 500);
    assert!(right(&mesh, &done, size) > 0.93);
}

#[test]
fn without_views_the_vertex_colours_are_painted() {
    let mut dense = cube();
    let color = |v: &[f32; 3]| [(v[0] * 200.0) as u8, (v[1] * 200.0) as u8, 30];
    dense.colors = dense.vertices.iter().map(color).collect();
    let flat = unwrap(
        &with_normals(&dense, LookSettings::DEFAULT.crease),
        &UnwrapOptions { texels_per_unit: 200.0, settings: AtlasSettings::DEFAULT },
    )
    .unwrap();
    let done = bake(&flat.mesh, flat.size, &[], (&dense, 4), &BakeOptions::at_resolution(0.01, &BakeSettings::DEFAULT));
    for t in atlas::texels(&flat.mesh, flat.size) {
        let is = done.texture.rgb[t.index].map(f64::from);
        assert!(
            (is[0] - t.point.x * 200.0).abs() < 2.5 && (is[1] - t.point.y * 200.0).abs() < 2.5 && is[2] == 30.0,
            "{is:?} at {}",
            t.point
        );
    }
    assert_eq!(done.seen, 0);
    let empty = DepthMap::nearest(&[]);
    assert!(Photo::new(&[], &empty, cameras()[0].intrinsics, (0.1, &BakeSettings::DEFAULT)).is_none());
    assert_eq!(
        bake(
            &TexturedMesh { uvs: vec![], ..flat.mesh },
            [8, 8],
            &[],
            (&dense, 4),
            &BakeOptions::at_resolution(0.1, &BakeSettings::DEFAULT)
        ),
        Baked::default()
    );
}

#[test]
fn points_that_only_derived_depth_shows_are_not_measured() {
    let cameras = &cameras()[..1];
    let images = photos(cameras, None);
    let derived = DepthMap::new(vec![1; images[0].1.len()], 1.0);
    let options = BakeOptions::at_resolution(0.01, &BakeSettings::DEFAULT);
    let normal = (cameras[0].position() - DVec3::splat(0.5)).dot(DVec3::Z).signum() * DVec3::Z;
    let (top, inside) = (DVec3::new(0.5, 0.5, 0.5 + 0.5 * normal.z), DVec3::splat(0.5));
    for (map, expected) in [(None, true), (Some(&derived), false)] {
        let photo = prepared(cameras, &images).remove(0).with_derived(map);
        let view = BakeView::new(&photo, cameras[0]);
        assert_eq!(view.measures(top, normal, &options), Some(expected));
        assert_eq!(view.measures(inside, normal, &options), None);
    }
}
