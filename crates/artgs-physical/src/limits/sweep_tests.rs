use super::*;
use artgs_core::{AssetJoint, AssetLink, PerState};

const SPACING: f64 = 5e-3;

fn precision() -> Precision {
    Precision { points: 10, width: 8e-3, carrier_width: 0.0, overlap: 6e-3, settings: SweepSettings::default() }
}

fn cuboid(low: DVec3, high: DVec3) -> Mesh {
    Mesh::cuboid(low.as_vec3().to_array(), high.as_vec3().to_array())
}

fn asset(kind: JointKind, axis: DVec3, origin: DVec3) -> Asset {
    let joint = AssetJoint {
        kind,
        axis,
        pitch: 0.0,
        limits: [0.0, 1.0],
        observed: PerState::new(0.0, 1.0),
        effort: 1.0,
        velocity: 1.0,
        damping: 0.0,
        friction: 0.0,
    };
    let base = AssetLink { name: "base".into(), ..AssetLink::default() };
    let part = AssetLink { name: "part".into(), parent: Some(0), joint: Some(joint), origin, ..AssetLink::default() };
    Asset { name: "a".into(), links: vec![base, part], ..Asset::default() }
}

/// The free way of the second mesh, link frames.
fn free(asset: &Asset, meshes: [&Mesh; 2], way: f64, observed: &Observed) -> Option<f64> {
    let surface = |mesh: &Mesh, observed: &Observed| {
        Surface::of(Solid::new(mesh, observed).as_ref(), observed, SPACING, &SweepSettings::default())
    };
    let surfaces = [surface(meshes[0], &|_| true), surface(meshes[1], observed)];
    let sweep = Sweep { link: 1, from: 0.0, way, own: Part::Seen, others: Part::Seen };
    let met = first_contact(asset, &surfaces, &[0.0; 2], &sweep, &precision());
    met.map(|contact| contact.way)
}

#[test]
fn a_slide_stops_at_a_wall_to_a_millimetre_and_not_at_its_rails() {
    // The block overlaps the floor by 2 mm and one side wall by 1 mm.
    let mut base = cuboid(DVec3::new(-0.2, -0.5, -0.1), DVec3::new(0.2, 1.0, 0.0));
    base.append(&cuboid(DVec3::new(-0.2, -0.5, 0.0), DVec3::new(-0.1, 1.0, 0.3)));
    base.append(&cuboid(DVec3::new(-0.1, 0.7, 0.0), DVec3::new(0.2, 0.75, 0.3)));
    let block = cuboid(DVec3::new(-0.101, 0.0, -0.002), DVec3::new(0.05, 0.3, 0.2));
    let slide = asset(JointKind::Prismatic, DVec3::Y, DVec3::ZERO);
    let found = free(&slide, [&base, &block], 0.9, &|_| true).unwrap();
    assert!((found - 0.4).abs() < 1e-3, "{found}");
    assert_eq!(free(&slide, [&base, &block], 0.39, &|_| true), None);
    assert_eq!(free(&slide, [&base, &block], -0.4, &|_| true), None);
    // A pin of 1 cm is less than a contact; the same wall with an overlap of 4 mm is one at the beginning.
    let pin = cuboid(DVec3::new(0.0, 0.5, 0.1), DVec3::new(0.01, 0.6, 0.11));
    assert_eq!(free(&slide, [&pin, &block], 0.5, &|_| true), None);
    let near = base.moved(&Rigid::shift(DVec3::new(0.0, -0.404, 0.0)));
    assert_eq!(free(&slide, [&near, &block], 0.5, &|_| true), Some(0.0));
}

#[test]
fn a_rim_that_overlaps_that_of_another_moving_part_by_a_voxel_stops_nothing() {
    // The lower edge of a board reaches below the upper edge of the block, along its whole width.
    let block = cuboid(DVec3::new(0.0, 0.0, 0.0), DVec3::new(0.4, 0.1, 0.2));
    let carried = asset(JointKind::Prismatic, DVec3::Y, DVec3::ZERO);
    let mut beside = carried.clone();
    beside.links.push(AssetLink { name: "board".into(), ..beside.links[1].clone() });
    for (overlap, met) in [(0.004, [true, false]), (0.012, [true; 2])] {
        let board = cuboid(DVec3::new(0.0, 0.3, 0.2 - overlap), DVec3::new(0.4, 0.32, 0.5));
        let surface = |mesh: &Mesh| {
            Surface::of(Solid::new(mesh, &|_| true).as_ref(), &|_| true, SPACING, &SweepSettings::default())
        };
        let surfaces = [surface(&board), surface(&block), surface(&board)];
        let nothing = Surface::of(None, &|_| true, SPACING, &SweepSettings::default());
        let sweep = Sweep { link: 1, from: 0.0, way: 0.5, own: Part::Seen, others: Part::Seen };
        let of_carrier = first_contact(&carried, &surfaces[..2], &[0.0; 2], &sweep, &precision());
        let [_, own, board] = surfaces;
        let of_part = first_contact(&beside, &[nothing, own, board], &[0.0; 3], &sweep, &precision());
        assert_eq!([of_carrier.is_some(), of_part.is_some()], met, "{overlap} {of_carrier:?} {of_part:?}");
        for contact in [of_carrier, of_part].into_iter().flatten() {
            assert!((contact.way - 0.2).abs() < 1e-3, "{contact:?}");
        }
    }
}

#[test]
fn a_door_closes_onto_its_frame() {
    let mut frame = cuboid(DVec3::new(0.0, 0.0, 0.0), DVec3::new(0.6, 0.4, 0.02));
    frame.append(&cuboid(DVec3::new(0.0, 0.0, 0.48), DVec3::new(0.6, 0.4, 0.5)));
    let door = cuboid(DVec3::new(0.0, 0.0, 0.0), DVec3::new(0.6, 0.02, 0.5));
    // The door is 20 degrees open and turns about its front edge.
    let open = Rigid::about(DVec3::NEG_Z, DVec3::ZERO, 20f64.to_radians());
    let hinge = asset(JointKind::Revolute, DVec3::NEG_Z, DVec3::new(0.0, -0.023, 0.0));
    let found = free(&hinge, [&frame, &door.moved(&open)], -1.5, &|_| true).unwrap();
    // It stops where its back is in front of the frame by 3 mm: the way is a little more than 20 degrees.
    let expected = 20f64.to_radians();
    assert!((0.0..0.012).contains(&(found - expected)), "{} {}", found.to_degrees(), expected.to_degrees());
    assert_eq!(free(&hinge, [&frame, &door.moved(&open)], 1.5, &|_| true), None);
}

#[test]
fn only_what_was_seen_stops_a_part() {
    let wall = cuboid(DVec3::new(-1.0, 0.5, -1.0), DVec3::new(1.0, 0.6, 1.0));
    let block = cuboid(DVec3::ZERO, DVec3::new(0.2, 0.2, 0.2));
    let slide = asset(JointKind::Prismatic, DVec3::Y, DVec3::ZERO);
    // The side that would touch the wall only closes the mesh. The wall meets nothing else of the block.
    assert_eq!(free(&slide, [&wall, &block], 0.5, &|p| p.y < 0.1), None);
    assert!(free(&slide, [&wall, &block], 0.5, &|_| true).is_some());
}

#[test]
fn a_panel_that_enters_a_post_from_the_side_crosses_it() {
    // A sheet of 10 mm, whose edge is too narrow for a contact, and a post in its way that reaches 4 or 12 mm over its front.
    let sheet = cuboid(DVec3::new(0.0, 0.0, 0.0), DVec3::new(0.3, 0.01, 0.3));
    let slide = asset(JointKind::Prismatic, DVec3::X, DVec3::ZERO);
    let sweep = Sweep { link: 1, from: 0.0, way: 0.4, own: Part::Seen, others: Part::Seen };
    let precision = Precision { overlap: 5e-3, ..precision() };
    for (overlap, met) in [(0.002, false), (0.008, true)] {
        let post = cuboid(DVec3::new(0.5, -0.05, 0.0), DVec3::new(0.6, overlap, 0.3));
        let surfaces = [&post, &sheet]
            .map(|m| Surface::of(Solid::new(m, &|_| true).as_ref(), &|_| true, SPACING, &SweepSettings::default()));
        let found = first_crossing(&slide, &surfaces, &[0.0; 2], &sweep, &precision);
        assert_eq!(found.is_some(), met, "{found:?}");
        // The way to the post is 0.2; the sheet is inside by less than one step.
        assert!(found.is_none_or(|contact| contact.link == 0 && (0.17..=0.2).contains(&contact.way)), "{found:?}");
    }
}
