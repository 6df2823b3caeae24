use super::*;
use crate::model::{Link, Shape};
use artgs_core::Mesh;

fn shape(mesh: &Mesh) -> Shape {
    let points = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
    Shape { points, triangles: mesh.triangles.clone() }
}

#[test]
fn an_enclosed_cavity_is_no_gap() {
    let mut body = drawn(0.03);
    body.push(Mesh::cuboid([-0.1, -0.03, 0.02], [0.1, 0.001, 0.03]));
    body.push(Mesh::cuboid([-0.1, -0.03, -0.03], [0.1, 0.001, -0.02]));
    assert!(found_in(0.03, &body, &body).is_none());
}

/// A panel with a bar `gap` in front of it, which two posts hold; `hulls` collide.
fn found(gap: f32, hulls: &[Mesh]) -> Option<FingerFinding> {
    found_in(gap, &drawn(gap), hulls)
}

fn found_in(gap: f32, visuals: &[Mesh], hulls: &[Mesh]) -> Option<FingerFinding> {
    let mut body = Link::new("door", None, Rigid::IDENTITY);
    body.visuals = visuals.iter().map(shape).collect();
    body.hulls = hulls.iter().map(shape).collect();
    let model = Model { links: vec![body], has_hulls: true };
    let (scene, _) = Scene::of(&model);
    // The gripper approaches along +Y and closes along Z.
    let turn = glam::DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
    let handle = HandleReport {
        position: [0.0, f64::from(-gap - 0.01), 0.0],
        orientation: DQuat::from_mat3(&turn).to_array(),
        length: 0.2,
        ..HandleReport::default()
    };
    let all = [Drawn::new(&model.links[0].visuals)];
    link(&model, &scene, 0, &all, &[handle], &CheckOptions::default())
}

fn drawn(gap: f32) -> Vec<Mesh> {
    vec![
        Mesh::cuboid([-0.3, 0.0, -0.3], [0.3, 0.02, 0.3]),
        Mesh::cuboid([-0.1, -gap - 0.01, -0.005], [0.1, -gap, 0.005]),
        Mesh::cuboid([-0.1, -gap - 0.005, -0.005], [-0.09, 0.001, 0.005]),
        Mesh::cuboid([0.09, -gap - 0.005, -0.005], [0.1, 0.001, 0.005]),
    ]
}

#[test]
fn a_finger_enters_behind_a_bar_and_not_behind_a_filled_one() {
    let open = found(0.03, &drawn(0.03)).unwrap();
    assert_eq!((open.gaps, open.blocked, open.problems.len()), (5, 0, 0), "{open:?}");
    let filled = [drawn(0.03)[0].clone(), Mesh::cuboid([-0.1, -0.04, -0.005], [0.1, 0.0, 0.005])];
    let closed = found(0.03, &filled).unwrap();
    assert_eq!((closed.gaps, closed.blocked, closed.problems.len()), (5, 5, 1), "{closed:?}");
    assert!(closed.deepest > 5e-3, "{closed:?}");
    let mut partly = drawn(0.03);
    partly.push(Mesh::cuboid([-0.1, -0.04, -0.005], [-0.045, 0.0, 0.005]));
    let partly = found_in(0.03, &drawn(0.03), &partly).unwrap();
    assert_eq!((partly.gaps, partly.blocked), (5, 1), "{partly:?}");
    assert_eq!((partly.problems.len(), partly.warnings.len()), (0, 1), "{partly:?}");
}

#[test]
fn gaps_below_15_mm_hold_no_finger() {
    assert!(found(0.013, &drawn(0.013)).is_none());
    assert_eq!(found(0.017, &drawn(0.017)).unwrap().blocked, 0);
}
