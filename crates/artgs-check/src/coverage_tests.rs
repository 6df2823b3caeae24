use super::*;
use crate::model::Shape;
use crate::model::{Model, Motion};
use artgs_core::{JointKind, Mesh, Rigid};
use rapier3d::parry::transformation::try_convex_hull;

fn shape(mesh: &Mesh) -> Shape {
    let points = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
    Shape { points, triangles: mesh.triangles.clone() }
}

fn hull(mesh: &Mesh) -> SharedShape {
    let points: Vec<_> = shape(mesh).points.iter().map(|p| vector(*p)).collect();
    let (points, triangles) = try_convex_hull(&points).unwrap();
    SharedShape::new(ConvexPolyhedron::from_convex_mesh(points, &triangles).unwrap())
}

/// No other link.
fn nothing() -> Passing<'static> {
    Passing::of(&Model::default(), &[], 0)
}

/// Compares boxes that are drawn with boxes that collide.
fn compared(drawn: &[Mesh], colliding: &[Mesh]) -> CoverageFinding {
    let mut body = Link::new("body", None, Rigid::IDENTITY);
    body.visuals = drawn.iter().map(shape).collect();
    let hulls: Vec<SharedShape> = colliding.iter().map(hull).collect();
    link(&body, &hulls, Drawn::new(&body.visuals).as_ref(), None, &nothing(), 0, &CheckOptions::default()).unwrap()
}

/// Floor and four walls, 1 cm thick and 5 mm apart, around a cavity that is open above.
fn tray() -> Vec<Mesh> {
    vec![
        Mesh::cuboid([0.0, 0.0, 0.0], [0.6, 0.4, 0.01]),
        Mesh::cuboid([0.0, 0.0, 0.01], [0.01, 0.4, 0.2]),
        Mesh::cuboid([0.59, 0.0, 0.01], [0.6, 0.4, 0.2]),
        Mesh::cuboid([0.01, 0.0, 0.01], [0.59, 0.01, 0.2]),
        Mesh::cuboid([0.01, 0.39, 0.01], [0.59, 0.4, 0.2]),
    ]
}

#[test]
fn a_box_with_its_own_hull_matches() {
    let cuboid = Mesh::cuboid([0.0; 3], [0.5, 0.3, 0.2]);
    let found = compared(std::slice::from_ref(&cuboid), std::slice::from_ref(&cuboid));
    assert_eq!((found.visual, found.hulls, found.missed, found.extra), (1.0, 1.0, 0.0, 0.0), "{found:?}");
    assert_eq!((found.hole, found.phantom_volume, found.problems.len()), (0.0, 0.0, 0), "{found:?}");
}

#[test]
fn a_shifted_hull_misses_a_side() {
    let cuboid = Mesh::cuboid([0.0; 3], [0.4; 3]);
    let found = compared(&[cuboid], &[Mesh::cuboid([0.0, 0.0, 0.05], [0.4, 0.4, 0.45])]);
    // The lower face and the lower eighth of the sides, less 5 mm, have no hull.
    assert!((found.visual - (1.0 - (1.0 + 4.0 * 0.045 / 0.4) / 6.0)).abs() < 5e-3, "{found:?}");
    assert!((found.hole - 0.4).abs() < 5e-3 && (found.obstacle - 0.4).abs() < 5e-3, "{found:?}");
    assert!((found.phantom_depth - 0.05).abs() < 4e-3, "{found:?}");
    // Where: below, and above the drawn box.
    let at = [found.hole_at, found.phantom_at].map(|at| DVec3::from_array(at.unwrap()));
    assert!(at[0].distance(DVec3::new(0.2, 0.2, 0.0)) < 5e-3 && (0.43..0.46).contains(&at[1].z), "{at:?}");
    assert!(found.problems[0].contains(", at (0."), "{found:?}");
    // What is more than 1 cm away: 4 cm of the 5 cm.
    assert!((found.phantom_volume - 0.4 * 0.4 * 0.04).abs() < 1.5e-3, "{found:?}");
}

#[test]
fn a_filled_tray_has_a_phantom_and_a_tray_of_walls_has_none() {
    let good = compared(&tray(), &tray());
    assert!(good.visual == 1.0 && good.hulls == 1.0 && good.hole == 0.0 && good.phantom_volume == 0.0, "{good:?}");
    let filled = compared(&tray(), &[Mesh::cuboid([0.0; 3], [0.6, 0.4, 0.2])]);
    let cavity = 0.58 * 0.38 * 0.19;
    assert!(filled.phantom_volume > 0.8 * cavity && filled.phantom_volume < cavity, "{filled:?}");
    assert!((0.17..0.19).contains(&filled.phantom_depth) && filled.obstacle > 0.3, "{filled:?}");
    assert_eq!(filled.hole, 0.0);
    assert!(filled.warnings[0].contains("where nothing is drawn"), "{filled:?}");
}

#[test]
fn space_behind_what_was_observed_may_be_filled_unless_another_link_passes() {
    // A bell, of which images show the outside only: closing the mesh gave its walls an inner side.
    let outside = Mesh::cuboid([0.0; 3], [0.3, 0.3, 0.3]);
    let walls: Vec<Mesh> = [[0.0, 0.0], [0.27, 0.0]]
        .map(|[x, y]| Mesh::cuboid([x, y, 0.0], [x + 0.03, 0.3, 0.27]))
        .into_iter()
        .chain([0.0, 0.27].map(|y| Mesh::cuboid([0.03, y, 0.0], [0.27, y + 0.03, 0.27])))
        .chain([Mesh::cuboid([0.0, 0.0, 0.27], [0.3; 3])])
        .collect();
    let mut observed = outside.clone();
    observed.triangles.retain(|t| t.iter().any(|i| outside.vertices[*i as usize][2] > 0.0));
    let observed = Observed::new(&observed, 1.0, &Rigid::IDENTITY).unwrap();
    let mut bell = Link::new("bell", None, Rigid::IDENTITY);
    bell.visuals = walls.iter().map(shape).collect();
    let found = |observed: Option<&Observed>, passing: &Passing| {
        let drawn = Drawn::new(&bell.visuals);
        link(&bell, &[hull(&outside)], drawn.as_ref(), observed, passing, 0, &CheckOptions::default()).unwrap()
    };
    assert!(found(None, &nothing()).phantom_depth > 0.1);
    assert_eq!(found(Some(&observed), &nothing()).phantom_depth, 0.0);
    // A clapper that slides into the bell.
    let mut clapper = Link::new("clapper", Some(0), Rigid::IDENTITY);
    clapper.visuals = vec![shape(&Mesh::cuboid([0.1, 0.1, -0.2], [0.2, 0.2, 0.0]))];
    clapper.motion = Some(Motion { limits: [0.0, 0.2], ..Motion::new("slide", JointKind::Prismatic, DVec3::Z) });
    let model = Model { links: vec![bell.clone(), clapper], ..Model::default() };
    let drawn: Vec<Option<Drawn>> = model.links.iter().map(|link| Drawn::new(&link.visuals)).collect();
    let passed = found(Some(&observed), &Passing::of(&model, &drawn, 0));
    assert!(passed.phantom_depth > 0.05 && passed.phantom_volume < 0.11 * 0.11 * 0.22, "{passed:?}");
}

#[test]
fn a_tray_without_its_floor_has_a_hole_and_fails() {
    let found = compared(&tray(), &tray()[1..]);
    assert!((found.hole - 0.38).abs() < 0.01, "{found:?}");
    assert!(found.problems[0].contains("a hole 3"), "{found:?}");
    // A slot of 8 mm is tolerated, one of 80 mm is not.
    for (slot, fails) in [(0.008_f32, false), (0.08, true)] {
        let mut walls = tray();
        walls[0] = Mesh::cuboid([0.0, 0.0, 0.0], [0.3, 0.4, 0.01]);
        walls.push(Mesh::cuboid([0.3 + slot, 0.0, 0.0], [0.6, 0.4, 0.01]));
        let found = compared(&tray(), &walls);
        assert_eq!(!found.problems.is_empty(), fails, "{slot}: {found:?}");
        assert!((found.hole - f64::from(slot)).abs() < 3e-3, "{slot}: {found:?}");
    }
}

#[test]
fn a_plate_with_a_hole_in_both_meshes_matches() {
    let frame = [
        Mesh::cuboid([0.0, 0.0, 0.0], [0.2, 0.02, 1.0]),
        Mesh::cuboid([0.8, 0.0, 0.0], [1.0, 0.02, 1.0]),
        Mesh::cuboid([0.2, 0.0, 0.0], [0.8, 0.02, 0.2]),
        Mesh::cuboid([0.2, 0.0, 0.8], [0.8, 0.02, 1.0]),
    ];
    let good = compared(&frame, &frame);
    assert!(good.hole == 0.0 && good.obstacle == 0.0 && good.problems.is_empty(), "{good:?}");
    let closed = compared(&frame, &[Mesh::cuboid([0.0; 3], [1.0, 0.02, 1.0])]);
    assert!((closed.obstacle - 0.6).abs() < 0.02 && closed.hole == 0.0, "{closed:?}");
    assert!(closed.phantom_depth > 0.25, "{closed:?}");
}

#[test]
fn a_lost_piece_is_a_warning() {
    let cuboid = Mesh::cuboid([0.0; 3], [0.5, 0.3, 0.2]);
    let mut body = Link::new("body", None, Rigid::IDENTITY);
    body.visuals = vec![shape(&cuboid)];
    let found = link(
        &body,
        &[hull(&cuboid)],
        Drawn::new(&body.visuals).as_ref(),
        None,
        &nothing(),
        2,
        &CheckOptions::default(),
    )
    .unwrap();
    assert!(found.warnings[0].contains("2 places of the surface lost"), "{found:?}");
}

#[test]
fn a_surface_that_rays_graze_has_no_hole_and_a_sheet_inside_a_solid_makes_no_phantom() {
    // A door that stands 6 degrees open, drawn 1.5 mm in front of its hull: rays along it meet the hull 14 mm later.
    let open = Rigid { rotation: glam::DQuat::from_rotation_z(0.105), translation: DVec3::ZERO };
    let [drawn, door] = [-0.0015, 0.0].map(|front| Mesh::cuboid([0.0, front, 0.0], [0.5, 0.02, 0.6]).moved(&open));
    let found = compared(std::slice::from_ref(&drawn), std::slice::from_ref(&door));
    assert!(found.hole < 0.01 && found.obstacle < 0.01 && found.warnings.is_empty(), "{found:?}");
    // A leftover of another wall inside a plinth.
    let plinth = Mesh::cuboid([0.0; 3], [0.6, 0.4, 0.1]);
    let sheet = Mesh::cuboid([0.1, 0.2, 0.02], [0.5, 0.202, 0.14]);
    let found = compared(&[plinth.clone(), sheet.clone()], &[plinth, sheet]);
    assert_eq!((found.phantom_volume, found.hulls), (0.0, 1.0), "{found:?}");
}

#[test]
fn a_hole_is_none_where_another_link_passes() {
    // A door whose hinge is 5 cm inside its edge turns that edge into the side wall of its body.
    let wall = Mesh::cuboid([-0.1, 0.0, 0.0], [0.0, 0.4, 0.6]);
    // The wall belongs to the carrier of the door, or to another link that this one carries.
    let mut model = Model::default();
    let mut body = Link::new("body", None, Rigid::IDENTITY);
    let mut side = Link::new("side", Some(0), Rigid::IDENTITY);
    for link in [&mut body, &mut side] {
        link.visuals = vec![shape(&wall)];
    }
    let mut door = Link::new("door", Some(0), Rigid::shift(DVec3::new(-0.05, -0.02, 0.0)));
    door.visuals = vec![shape(&Mesh::cuboid([-0.1, -0.02, 0.0], [0.5, 0.02, 0.6]))];
    door.motion = Some(Motion { limits: [-1.57, 0.0], ..Motion::new("hinge", JointKind::Revolute, DVec3::Z) });
    model.links = vec![body, side, door];
    let drawn: Vec<Option<Drawn>> = model.links.iter().map(|link| Drawn::new(&link.visuals)).collect();
    let rest = hull(&Mesh::cuboid([-0.1, 0.12, 0.0], [0.0, 0.4, 0.6]));
    let compared = |passing: &Passing| {
        link(
            &model.links[0],
            std::slice::from_ref(&rest),
            drawn[0].as_ref(),
            None,
            passing,
            0,
            &CheckOptions::default(),
        )
        .unwrap()
    };
    let blind = compared(&nothing());
    assert!((blind.hole - 0.12).abs() < 0.01 && blind.passed == 0.0, "{blind:?}");
    // Only the door passes: the side never moves and lies where the body does.
    for (link, other) in [(0, 1), (1, 0)] {
        let drawn: Vec<Option<Drawn>> =
            model.links.iter().enumerate().map(|(i, l)| Drawn::new(&l.visuals).filter(|_| i != other)).collect();
        let found = compared(&Passing::of(&model, &drawn, link));
        // The edge passes through most of the front of the wall, which is 10 cm wide, but not through its sides.
        assert!((0.06..0.11).contains(&found.passed) && found.missed < 0.9 * blind.missed, "{found:?}");
        assert!((found.hole - 0.12).abs() < 0.01 && found.visual > blind.visual + 0.01, "{found:?}");
    }
}
