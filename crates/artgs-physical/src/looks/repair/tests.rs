use super::*;
use crate::geometry::convert::trimesh;
use crate::geometry::topology::testing::{open_box, sphere};

const EDGE: f64 = 0.1;

fn options() -> RepairOptions {
    RepairOptions { thickness: 8.0 * EDGE, ..RepairOptions::at_resolution(EDGE, &RepairSettings::DEFAULT) }
}

fn nothing(_: DVec3) -> bool {
    false
}

const FREE: Obstacles<'static> = Obstacles { passed: &nothing, empty: &nothing };

#[test]
fn a_closed_box_stays_what_it_is() {
    let done = repair(&open_box(DVec3::new(1.0, 2.0, 3.0), 10, [true; 6]), &FREE, &[], &options());
    assert_eq!((done.watertight, done.capped, done.thickened, done.mesh.triangles.len()), (true, 0, false, 1200));
    assert!((done.volume - 6.0).abs() < 1e-4 && done.mesh.colors.len() == done.mesh.vertices.len());
}

#[test]
fn the_missing_side_of_a_box_is_closed() {
    let size = DVec3::new(10.0, 5.0, 5.0);
    let done = repair(&open_box(size, 50, [true, false, true, true, true, true]), &FREE, &[], &options());
    assert_eq!((done.watertight, done.capped, done.left_open, done.thickened), (true, 1, 0, false));
    assert!((done.volume - 250.0).abs() < 1.0, "{}", done.volume);
}

#[test]
fn a_mouth_through_which_something_moves_stays_open_and_the_walls_get_thick() {
    // The compartment is open at +y, where the drawer moves, and has no back.
    let size = DVec3::new(6.0, 8.0, 4.0);
    let mut inside = open_box(size, 40, [true, true, false, false, true, true]);
    // The compartment is seen from inside.
    inside.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let drawer = |p: DVec3| p.cmpgt(DVec3::new(0.3, 0.5, 0.3)).all() && p.x < 5.7 && p.z < 3.7;
    let done = repair(&inside, &Obstacles { passed: &drawer, ..FREE }, &[], &options());
    assert_eq!((done.watertight, done.capped, done.left_open, done.thickened), (true, 1, 1, true));
    // Walls of 0.8 around the compartment and behind its back, corners full or cut.
    let (full, cut) = (7.6 * 8.8 * 5.6 - 192.0, 2.0 * 0.8 * (48.0 + 32.0) + 0.8 * 24.0);
    assert!(done.volume > 0.98 * cut && done.volume < 1.02 * full, "{cut} {} {full}", done.volume);
    let in_the_way = done.mesh.vertices.iter().filter(|v| drawer(DVec3::from_array(v.map(f64::from)))).count();
    assert_eq!(in_the_way, 0);
}

#[test]
fn walls_leave_room_for_what_is_behind() {
    // Two sheets half a unit apart, back to back: thickness 0.8 would make them cross.
    let mut sheets = open_box(DVec3::new(5.0, 5.0, 0.5), 25, [false, false, false, false, true, true]);
    let done = repair(&sheets, &FREE, &[], &options());
    assert!(done.watertight && done.thickened);
    assert!(done.volume < 0.7 * 12.5 && done.volume > 0.5 * 12.5, "{}", done.volume);
    // An obstacle inside limits the thickness.
    sheets.triangles.truncate(sheets.triangles.len() / 2);
    let there = |p: DVec3| p.z > 0.1;
    let done = repair(&sheets, &Obstacles { passed: &there, ..FREE }, &[], &options());
    assert!(done.watertight && done.mesh.vertices.iter().all(|v| v[2] <= 0.101), "{:?}", done.volume);
}

#[test]
fn walls_end_before_other_parts_and_narrow_obstacles() {
    let mut sheet = open_box(DVec3::new(5.0, 5.0, 0.5), 25, [false, false, false, false, true, true]);
    sheet.triangles.truncate(sheet.triangles.len() / 2);
    let highest = |obstacles: &Obstacles, others: &Others| {
        let done = repair(&sheet, obstacles, others, &options());
        assert!(done.watertight && done.thickened);
        done.mesh.vertices.iter().map(|v| f64::from(v[2])).fold(0.0, f64::max)
    };
    let free = highest(&FREE, &[]);
    assert!(free > 0.75, "{free}");
    // The wall of another part, half a unit behind the sheet.
    let other = trimesh(&Mesh::cuboid([-1.0, -1.0, 0.5], [6.0, 6.0, 0.6])).unwrap();
    let before = highest(&FREE, &[(&other, Pose3::IDENTITY)]);
    assert!(before < 0.2 && before > 0.1, "{before}");
    // What moves there is narrower than the wall would be.
    let slab = |p: DVec3| p.z > 0.3 && p.z < 0.4;
    let before = highest(&Obstacles { passed: &slab, ..FREE }, &[]);
    assert!(before <= 0.3 && before > 0.2, "{before}");
}

#[test]
fn a_rim_around_two_missing_sides_is_closed_in_two_planes() {
    let size = DVec3::new(8.0, 5.0, 6.0);
    let done = repair(&open_box(size, 30, [true, false, true, true, true, false]), &FREE, &[], &options());
    assert_eq!((done.watertight, done.capped, done.thickened), (true, 1, false));
    assert!((done.volume - 240.0).abs() < 5.0, "{}", done.volume);
}

#[test]
fn jagged_concave_rims_are_capped() {
    // A letter U without a top face and without some triangles at the rim.
    let mut mesh = open_box(DVec3::new(9.0, 9.0, 1.0), 90, [true, true, true, true, true, true]);
    let gone = |m: &Mesh, t: &[u32; 3]| {
        let c = crate::geometry::topology::corners(m, *t).iter().sum::<DVec3>() / 3.0;
        let removed = ((c.x * 7.0).sin() + (c.y * 9.0).cos()) * 0.2;
        c.z > 0.9 && (c.x - 4.5).abs().max((c.y - 4.5).abs()) < 3.0 + removed && !((c.x - 4.5).abs() < 1.0 && c.y > 4.0)
    };
    let kept: Vec<[u32; 3]> = mesh.triangles.iter().filter(|t| !gone(&mesh, t)).copied().collect();
    mesh.triangles = kept;
    let done = repair(&mesh, &FREE, &[], &options());
    assert!(done.watertight && done.capped >= 1 && done.left_open == 0, "{} {}", done.capped, done.left_open);
    assert!((done.volume - 81.0).abs() < 0.8, "{}", done.volume);
}

#[test]
fn debris_goes_and_triangles_that_face_the_wrong_way_turn() {
    let mut mesh = sphere(1.0, 20);
    (0..mesh.triangles.len()).step_by(7).for_each(|t| mesh.triangles[t].swap(0, 1));
    mesh.append(&sphere(0.01, 2));
    mesh.triangles.push(mesh.triangles[3]);
    mesh.triangles.push([5, 5, 6]);
    let done = repair(&mesh, &FREE, &[], &options());
    assert!(done.watertight && !done.thickened && done.mesh.triangles.len() == 6 * 20 * 20 * 2);
    assert!((done.volume - 4.19).abs() < 0.05, "{}", done.volume);
    let empty = repair(&Mesh::default(), &FREE, &[], &options());
    assert!(!empty.watertight && empty.mesh.is_empty());
    let broken = Mesh { vertices: vec![[f32::NAN; 3]; 3], colors: vec![], triangles: vec![[0, 1, 2], [0, 1, 9]] };
    assert!(repair(&broken, &FREE, &[], &options()).mesh.is_empty());
}

#[test]
fn a_hole_through_which_views_look_gets_no_cap() {
    // A box with a window in its front and its back: small holes.
    let mut mesh = open_box(DVec3::new(5.0, 1.0, 5.0), 50, [true; 6]);
    let aside = |m: &Mesh, t: &[u32; 3]| {
        let c = crate::geometry::topology::corners(m, *t).iter().sum::<DVec3>() / 3.0;
        (c.x - 2.5).abs().max((c.z - 2.5).abs())
    };
    let kept: Vec<[u32; 3]> = mesh.triangles.iter().filter(|t| aside(&mesh, t) > 0.4).copied().collect();
    mesh.triangles = kept;
    let in_window = |m: &Mesh| m.triangles.iter().filter(|t| aside(m, t) < 0.3).count();
    let capped = repair(&mesh, &FREE, &[], &options());
    assert!(capped.watertight && capped.capped == 2 && !capped.thickened && in_window(&capped.mesh) > 0);
    let through = |p: DVec3| (p.x - 2.5).abs().max((p.z - 2.5).abs()) < 0.3;
    let open = repair(&mesh, &Obstacles { empty: &through, ..FREE }, &[], &options());
    assert_eq!((open.watertight, open.left_open, open.thickened, in_window(&open.mesh)), (true, 2, true, 0));
}
