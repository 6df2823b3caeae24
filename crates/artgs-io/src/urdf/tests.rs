use super::*;
use artgs_core::Rigid;

/// An axis-aligned box.
fn cuboid(min: [f32; 3], max: [f32; 3]) -> Mesh {
    let corner = |i: usize| [0, 1, 2].map(|a| if i >> a & 1 == 0 { min[a] } else { max[a] });
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Mesh {
        vertices: (0..8).map(corner).collect(),
        colors: vec![[200, 100, 50]; 8],
        triangles: quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect(),
    }
}

/// A cabinet with a door, a drawer, a screw, a flat part and an empty one.
fn sample() -> (Replica, Vec<Mesh>) {
    let door = Joint::from_motion(JointKind::Revolute, &Rigid::about(-DVec3::Z, DVec3::new(0.5, -0.5, 0.0), 1.2))
        .with_origin_near(DVec3::new(0.0, 0.0, 0.3));
    let drawer = Joint::from_motion(JointKind::Prismatic, &Rigid::shift(DVec3::new(0.0, -0.4, 0.0)));
    let screw = Joint {
        kind: JointKind::Screw,
        axis: DVec3::X,
        origin: DVec3::new(0.0, 0.2, 0.9),
        pitch: -0.01,
        state_values: [0.5, 0.5],
        limits: [0.5, 0.5],
    };
    let mut replica = Replica::new(&[door, drawer.with_origin_near(DVec3::new(0.0, -0.5, -0.3)), screw, drawer]);
    replica.parts[1].name = "door <&\"left\">".into();
    let meshes = vec![
        cuboid([-0.5, -0.4, -0.5], [0.5, 0.5, 0.5]),
        cuboid([-0.5, -0.5, 0.0], [0.5, -0.45, 0.5]),
        cuboid([-0.5, -0.5, -0.5], [0.5, -0.45, -0.1]),
        cuboid([0.0, 0.1, 0.8], [0.3, 0.3, 0.8]),
        Mesh::default(),
    ];
    (replica, meshes)
}

#[test]
fn another_reader_sees_links_joints_and_limits() {
    let dir = tempfile::tempdir().unwrap();
    let (replica, meshes) = sample();
    export_urdf(dir.path(), &replica, &meshes, &UrdfOptions::default()).unwrap();
    let robot = urdf_rs::read_file(dir.path().join("replica.urdf")).unwrap();
    assert_eq!((robot.links.len(), robot.joints.len()), (6, 5));
    let names: Vec<&str> = robot.links.iter().map(|l| l.name.as_str()).collect();
    assert_eq!(names, ["world", "base", "door <&\"left\">", "part_2", "part_3", "part_4"]);
    assert_eq!(robot.joints[0].joint_type, urdf_rs::JointType::Fixed);
    let door = &robot.joints[1];
    assert_eq!(door.joint_type, urdf_rs::JointType::Revolute);
    assert_eq!((door.axis.xyz.0, door.child.link.as_str()), ([0.0, 0.0, -1.0], "door <&\"left\">"));
    let at = DVec3::from_array(door.origin.xyz.0);
    assert!((at - DVec3::new(0.5, -0.5, 0.3)).length() < 1e-9, "{at}");
    assert!(door.limit.lower.abs() < 1e-12 && (door.limit.upper - 1.2).abs() < 1e-9);
    assert_eq!((door.limit.effort, door.limit.velocity), (100.0, 10.0));
    let screw = &robot.joints[3];
    assert_eq!((screw.limit.lower, screw.limit.upper), (0.0, NARROWEST));
    // Nothing for the empty part, nothing to collide with for the flat one; every other file exists.
    assert_eq!(robot.links.iter().map(|l| l.visual.len()).collect::<Vec<_>>(), [0, 1, 1, 1, 1, 0]);
    assert_eq!(robot.links.iter().map(|l| l.collision.len()).collect::<Vec<_>>(), [0, 1, 1, 1, 0, 0]);
    for visual in robot.links.iter().flat_map(|l| &l.visual) {
        let urdf_rs::Geometry::Mesh { filename, .. } = &visual.geometry else { panic!("a mesh was written") };
        assert!(dir.path().join(filename).is_file(), "{filename}");
    }
    let text = std::fs::read_to_string(dir.path().join("replica.urdf")).unwrap();
    assert!(text.contains("<!-- screw; pitch -0.01 "));
}

#[test]
fn a_child_of_a_part_is_placed_against_it() {
    let (mut replica, meshes) = sample();
    replica.parts[3].parent = Some(1);
    let links: Vec<Link> = meshes
        .iter()
        .map(|m| Link { visual: None, collision: Vec::new(), inertial: Inertial::of_box(m, 1.0) })
        .collect();
    let robot = urdf_rs::read_from_string(&urdf(&replica, &links, &UrdfOptions::default()).unwrap()).unwrap();
    let at = DVec3::from_array(robot.joints[3].origin.xyz.0);
    assert!((at - DVec3::new(-0.5, 0.7, 0.6)).length() < 1e-9, "{at}");
    assert_eq!(robot.joints[3].parent.link, "door <&\"left\">");
}

#[test]
fn the_link_frame_is_the_joint_frame() {
    let (replica, meshes) = sample();
    let door = link_mesh(&replica, 1, &meshes[1]);
    for (index, expected) in [(0, [-1.0, 0.0, -0.3]), (7, [0.0, 0.05, 0.2])] {
        let off = (0..3).map(|c| (door.vertices[index][c] - expected[c]).abs());
        assert!(off.fold(0.0, f32::max) < 1e-6, "{:?}", door.vertices[index]);
    }
    assert_eq!(link_mesh(&replica, 0, &meshes[0]), meshes[0]);
}

#[test]
fn a_box_has_the_inertia_of_a_box_and_a_plate_has_some() {
    let solid = Inertial::of_box(&cuboid([0.0; 3], [1.0, 2.0, 3.0]), 2.0);
    assert_eq!((solid.mass, solid.center), (12.0, DVec3::new(0.5, 1.0, 1.5)));
    assert_eq!(solid.inertia, [13.0, 10.0, 5.0, 0.0, 0.0, 0.0]);
    let plate = Inertial::of_box(&cuboid([0.0; 3], [1.0, 1.0, 0.0]), 1.0);
    assert!((plate.mass - 1e-3).abs() < 1e-12 && plate.inertia[..3].iter().all(|i| *i > 0.0));
    assert!((Inertial::of_box(&Mesh::default(), 100.0).mass - 1e-4).abs() < 1e-12);
}

#[test]
fn volume_needs_four_points_that_span_space() {
    assert!(has_volume(&cuboid([0.0; 3], [1.0, 1.0, 0.01])));
    assert!(!has_volume(&cuboid([0.0; 3], [1.0, 1.0, 0.0])));
    assert!(!has_volume(&cuboid([0.0; 3], [1.0, 0.0, 0.0])));
    assert!(!has_volume(&cuboid([0.0; 3], [0.0; 3])));
    assert!(!has_volume(&Mesh::default()));
}

#[test]
fn duplicate_names_and_bad_masses_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (mut replica, meshes) = sample();
    let no_mass = UrdfOptions { density: 0.0, ..UrdfOptions::default() };
    assert!(export_urdf(dir.path(), &replica, &meshes, &no_mass).unwrap_err().to_string().contains("part 0: mass"));
    replica.parts[2].name = "part_3".into();
    let message = export_urdf(dir.path(), &replica, &meshes, &UrdfOptions::default()).unwrap_err().to_string();
    assert!(message.contains("part 3") && message.contains("replica.urdf"), "{message}");
    assert!(export_urdf(dir.path(), &replica, &meshes[1..], &UrdfOptions::default()).is_err());
}
