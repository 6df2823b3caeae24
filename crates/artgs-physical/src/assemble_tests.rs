use super::*;
use crate::looks::surfaces;
use crate::settings::{Front, Up};
use artgs_core::{Joint, JointKind, PerState};

fn cuboid(low: DVec3, high: DVec3) -> Mesh {
    let [low, high] = [low, high].map(|p| p.as_vec3().to_array());
    let mut mesh = Mesh { colors: vec![[90, 60, 30]; 8], ..Mesh::cuboid(low, high) };
    // The corners alone are too few samples of the surface.
    for _ in 0..3 {
        mesh = finer(&mesh);
    }
    mesh
}

fn finer(mesh: &Mesh) -> Mesh {
    let mut out = Mesh { triangles: Vec::new(), ..mesh.clone() };
    let mut known = std::collections::BTreeMap::new();
    for t in &mesh.triangles {
        let middle = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])].map(|(a, b)| {
            *known.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let [p, q] = [a, b].map(|i| mesh.vertices[i as usize]);
                out.vertices.push([0, 1, 2].map(|c| 0.5 * (p[c] + q[c])));
                out.colors.push(mesh.colors[a as usize]);
                out.vertices.len() as u32 - 1
            })
        });
        let [ab, bc, ca] = middle;
        out.triangles.extend([[t[0], ab, ca], [ab, t[1], bc], [ca, bc, t[2]], [ab, bc, ca]]);
    }
    out
}

/// A box with an opening towards -Y, a drawer that is open at the start and closed at the end, and a door on the front that
/// is closed at the start.
fn replica() -> (Replica, Vec<Mesh>) {
    let mut base = cuboid(DVec3::new(-0.5, 0.0, 0.0), DVec3::new(-0.45, 0.6, 1.0));
    base.append(&cuboid(DVec3::new(0.45, 0.0, 0.0), DVec3::new(0.5, 0.6, 1.0)));
    base.append(&cuboid(DVec3::new(-0.45, 0.55, 0.0), DVec3::new(0.45, 0.6, 1.0)));
    let drawer = cuboid(DVec3::new(-0.4, -0.3, 0.05), DVec3::new(0.4, 0.2, 0.4));
    let door = cuboid(DVec3::new(-0.45, -0.04, 0.5), DVec3::new(0.45, -0.02, 0.95));
    let slide = Joint::from_motion(JointKind::Prismatic, &Rigid::shift(DVec3::new(0.0, 0.3, 0.0)))
        .with_origin_near(DVec3::new(0.0, -0.3, 0.2));
    let hinge =
        Joint::from_motion(JointKind::Revolute, &Rigid::about(DVec3::NEG_Z, DVec3::new(-0.46, -0.03, 0.0), 1.2))
            .with_origin_near(DVec3::new(0.0, 0.0, 0.7));
    let mut replica = Replica::new(&[slide, hinge]);
    replica.parts[1].name = "Drawer, lower".into();
    replica.parts[2].name = "world".into();
    (replica, vec![base, drawer, door])
}

/// Position of a point of the start state in the object's frame when the asset has the given joint values.
fn placed(asset: &Asset, decisions: &Decisions, link: usize, point: DVec3, values: &[f64]) -> DVec3 {
    asset.poses(values)[link].apply(decisions.to_link[link].apply(point * decisions.scale))
}

#[test]
fn the_volume_behind_invented_walls_does_not_limit_the_mass() {
    let (replica, meshes) = replica();
    let config = PhysicalConfig::default();
    let mut surfaces = surfaces(&replica, &meshes, None, &config);
    let door = |surfaces: &[PartSurface]| {
        limited("cabinet", &replica, surfaces, &config).unwrap().0.links[2].inertial.mass / config.density
    };
    // Walls of both sides and of the rim weigh more than the solid door.
    let volume = 0.9 * 0.02 * 0.45;
    let solid = door(&surfaces);
    surfaces[2].thickened = true;
    let walls = door(&surfaces);
    assert!((solid - volume).abs() < 0.05 * volume && walls > 1.05 * solid, "{solid} {walls}");
}

#[test]
fn observed_states_keep_their_positions_and_positive_values_open() {
    let (replica, meshes) = replica();
    for (up, scale) in [(Up::Z, 1.0), (Up::Y, 2.5)] {
        let config = PhysicalConfig { up, scale, front: Front::Captured, ..PhysicalConfig::default() };
        let surfaces = surfaces(&replica, &meshes, None, &config);
        let (asset, decisions) = assemble("A cabinet", &replica, &surfaces, &config, None, &mut |_| {}).unwrap();
        assert_eq!(asset.name, "a_cabinet");
        let names: Vec<&str> = asset.links.iter().map(|l| l.name.as_str()).collect();
        assert_eq!(names, ["base", "drawer_lower", "world_2"]);
        let upright = |p: DVec3| scale * if up == Up::Z { p } else { DVec3::new(p.x, -p.z, p.y) };
        for state in State::ALL {
            let values = asset.observed(state);
            for link in 0..3 {
                let point = DVec3::new(0.3, -0.1, 0.6);
                let motion = replica.motion_to(link, state);
                let (found, want) = (placed(&asset, &decisions, link, point, &values), upright(motion.apply(point)));
                assert!(found.distance(want) < 1e-9, "{up:?} {state:?} link {link}: {found} {want}");
            }
        }
        if up == Up::Z {
            // The drawer is closed at the end, the door at the start.
            assert_eq!(decisions.nearer_state, [None, Some(State::END), Some(State::START)]);
            let [drawer, door] = [1, 2].map(|i| asset.links[i].joint.unwrap());
            let near = |v: PerState<f64>, start: f64, end: f64| {
                (v[State::START] - start).abs() < 1e-12 && (v[State::END] - end).abs() < 1e-12
            };
            assert!(near(drawer.observed, 0.3, 0.0), "{drawer:?}");
            assert!((drawer.axis - DVec3::NEG_Y).length() < 1e-12);
            assert!(near(door.observed, 0.0, 1.2), "{door:?}");
        }
        for (_, link, joint) in asset.movable() {
            let [low, high] = joint.limits;
            assert!(joint.observed.iter().all(|v| (low..=high).contains(v)), "{joint:?}");
            assert!(link.inertial.mass > 0.1 && joint.effort > 0.0 && joint.damping > 0.0);
            assert!(!link.collision.is_empty());
        }
    }
}

#[test]
fn a_carried_part_and_a_screw_keep_their_places() {
    let (mut replica, mut meshes) = replica();
    // A knob on the door that turns and comes out while the door swings, and a cover that slides on the door.
    let knob = Joint {
        pitch: 0.02,
        ..Joint::from_motion(JointKind::Screw, &Rigid::about(DVec3::NEG_Y, DVec3::new(0.3, -0.06, 0.7), 2.0))
    };
    let cover = Joint::from_motion(JointKind::Prismatic, &Rigid::shift(DVec3::new(0.0, 0.0, -0.1)));
    for (joint, at) in [(knob, DVec3::new(0.3, -0.06, 0.7)), (cover, DVec3::new(-0.2, -0.06, 0.8))] {
        let (id, mesh) = (replica.parts.len(), cuboid(at - 0.02, at + 0.02));
        let part = artgs_core::replica::Part {
            id,
            name: format!("part_{id}"),
            parent: Some(2),
            joint: Some(joint.with_origin_near(at).into()),
            ..replica.parts[2].clone()
        };
        replica.parts.push(part);
        meshes.push(mesh);
    }
    replica.validate().unwrap();
    let config = PhysicalConfig { scale: 2.5, front: Front::Captured, ..PhysicalConfig::default() };
    let (asset, decisions) =
        assemble("a", &replica, &surfaces(&replica, &meshes, None, &config), &config, None, &mut |_| {}).unwrap();
    assert_eq!(asset.links.iter().map(|l| l.parent).collect::<Vec<_>>(), [None, Some(0), Some(0), Some(2), Some(2)]);
    let turned = asset.links[3].joint.unwrap();
    assert_eq!(turned.kind, JointKind::Screw);
    assert!((turned.pitch - 0.05).abs() < 1e-12, "metres per radian: {}", turned.pitch);
    for state in State::ALL {
        let values = asset.observed(state);
        for link in 0..5 {
            let point = DVec3::new(0.3, -0.1, 0.6);
            let want = 2.5 * replica.motion_to(link, state).apply(point);
            let found = placed(&asset, &decisions, link, point, &values);
            assert!(found.distance(want) < 1e-9, "{state:?} link {link}: {found} {want}");
        }
    }
}

#[test]
fn no_pose_has_collisions() {
    let (replica, meshes) = replica();
    let config = PhysicalConfig::default();
    let (asset, decisions) =
        assemble("a", &replica, &surfaces(&replica, &meshes, None, &config), &config, None, &mut |_| {}).unwrap();
    assert!(decisions.penetration < 1e-4, "{}", decisions.penetration);
    // The back wall limits the drawer.
    let drawer = asset.links[1].joint.unwrap();
    assert!(drawer.limits[0] > -0.1, "{drawer:?}");
    let none = PhysicalConfig { collision: Collision::None, ..config.clone() };
    let (bare, _) =
        assemble("a", &replica, &surfaces(&replica, &meshes, None, &none), &none, None, &mut |_| {}).unwrap();
    assert!(bare.links.iter().all(|l| l.collision.is_empty()));
}

#[test]
fn a_part_without_a_surface_is_a_light_link() {
    let (replica, mut meshes) = replica();
    meshes[2] = Mesh::default();
    let config = PhysicalConfig::default();
    let surfaces = surfaces(&replica, &meshes, None, &config);
    assert!(surfaces[2].warnings[0].contains("world has no surface"));
    let (asset, _) = assemble("a", &replica, &surfaces, &config, None, &mut |_| {}).unwrap();
    assert!(asset.links[2].visual.mesh.is_empty() && asset.links[2].inertial.mass == config.settings.mass.least_mass);
}

#[test]
fn names_are_to_identifier_for_every_format() {
    assert_eq!(to_identifier("Tür links!", "part"), "t_r_links");
    assert_eq!(to_identifier("3 doors", "part"), "part_3_doors");
    assert_eq!(to_identifier("---", "part"), "part");
}

#[test]
fn a_decomposer_makes_the_pieces_or_fails() {
    let (replica, meshes) = replica();
    // Nothing is cut off between the observed states.
    let config = PhysicalConfig { extend_limits: false, ..PhysicalConfig::default() };
    let surfaces = surfaces(&replica, &meshes, None, &config);
    let boxes = |mesh: &Mesh| {
        let points = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from)));
        Ok(vec![points.collect::<Vec<_>>(), vec![DVec3::ZERO; 5]])
    };
    let (asset, _) = assemble("a", &replica, &surfaces, &config, Some(&boxes), &mut |_| {}).unwrap();
    assert_eq!(asset.links[2].collision.len(), 1);
    let failing = |_: &Mesh| Err("no such program".to_string());
    assert_eq!(
        assemble("a", &replica, &surfaces, &config, Some(&failing), &mut |_| {}).unwrap_err(),
        "no such program"
    );
}

#[test]
fn densities_and_masses_are_those_asked_for_and_a_hand_moves_every_part() {
    let (replica, meshes) = replica();
    let config = PhysicalConfig::default();
    let surfaces = surfaces(&replica, &meshes, None, &config);
    let built =
        |config: &PhysicalConfig| assemble("a", &replica, &surfaces, config, None, &mut |_| {}).map(|(asset, _)| asset);
    let masses = |asset: &Asset| asset.links.iter().map(|l| l.inertial.mass).collect::<Vec<f64>>();
    let plain = built(&config).unwrap();
    let oak = PhysicalConfig { densities: vec![("world_2".into(), 1300.0)], mass: Some(60.0), ..config.clone() };
    let asked = built(&oak).unwrap();
    assert!((masses(&asked).iter().sum::<f64>() - 60.0).abs() < 1e-9, "{:?}", masses(&asked));
    let share = |asset: &Asset| asset.links[2].inertial.mass / asset.links[1].inertial.mass;
    assert!((share(&asked) / share(&plain) - 2.0).abs() < 1e-9);
    let wrong = PhysicalConfig { densities: vec![("wing".into(), 1300.0)], ..config };
    assert!(
        built(&wrong)
            .unwrap_err()
            .contains("`wing`, but the parts are base, drawer_lower (Drawer, lower), world_2 (world)")
    );
    for asset in [&plain, &asked] {
        // The door is 90 cm wide.
        for (_, _, joint) in asset.movable() {
            let arm = if joint.kind == JointKind::Prismatic { 1.0 } else { 0.95 };
            let needed = (joint.friction + joint.damping * 0.5 / arm) / arm;
            assert!(needed > 0.1 && needed < 10.5, "{joint:?}: {needed} N");
        }
    }
}

#[test]
fn texels_have_the_edge_that_was_asked_for() {
    let (replica, meshes) = replica();
    let texels = |texel: f64, scale: f64| -> Vec<f64> {
        let config = PhysicalConfig { texel: Some(texel), scale, ..PhysicalConfig::default() };
        surfaces(&replica, &meshes, None, &config).iter().map(|surface| surface.texels[0] as f64).collect()
    };
    let (coarse, fine, larger) = (texels(0.02, 1.0), texels(0.01, 1.0), texels(0.02, 2.0));
    for ((coarse, fine), larger) in coarse.iter().zip(&fine).zip(&larger) {
        assert!((3.6..4.4).contains(&(fine / coarse)), "{coarse} {fine}");
        assert!((larger / fine - 1.0).abs() < 0.02, "{larger} {fine}");
    }
}

#[test]
fn crumbs_are_short_and_small() {
    let piece = |x: f64, y: f64, z: f64| {
        let corners =
            (0..8).map(|i| DVec3::new(f64::from(i & 1) * x, f64::from(i >> 1 & 1) * y, f64::from(i >> 2) * z));
        Hull::of(&corners.collect::<Vec<_>>(), 1e-4).unwrap()
    };
    // A sliver at a corner, a rim, and a knob.
    let found = [(0.02, 0.009, 0.004), (0.2, 0.009, 0.004), (0.02, 0.02, 0.02)]
        .map(|(x, y, z)| is_crumb(&piece(x, y, z), 5e-3, &CollisionSettings::DEFAULT));
    assert_eq!(found, [true, false, false]);
}
