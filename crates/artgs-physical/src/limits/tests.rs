//! Limits of boxes whose contacts are known.

use super::range::{Flush, Range, Source, Stop, extend};
use super::search::Found;
use super::sweep::Surface;
use crate::geometry::solid::Solid;
use crate::settings::{PhysicalConfig, SweepSettings};
use artgs_core::{Asset, AssetJoint, AssetLink, JointKind, Mesh, PerState, State};
use glam::DVec3;

pub(super) fn cuboid(low: [f64; 3], high: [f64; 3]) -> Mesh {
    Mesh::cuboid(low.map(|x| x as f32), high.map(|x| x as f32))
}

fn movable(kind: JointKind, axis: DVec3, origin: DVec3, open: f64) -> AssetLink {
    let joint = AssetJoint {
        kind,
        axis,
        pitch: 0.0,
        limits: [0.0, open],
        observed: PerState::new(0.0, open),
        effort: 1.0,
        velocity: 1.0,
        damping: 0.0,
        friction: 0.0,
    };
    let name = format!("{kind:?}").to_lowercase();
    AssetLink { name, parent: Some(0), joint: Some(joint), origin, ..AssetLink::default() }
}

/// Two side walls and a back, a drawer between them that is open by `out` at value 0 and
/// was seen up to value `open`, a door before its left neighbour;
/// everything opens along -Y.
fn cabinet(drawer: [f64; 2]) -> (Asset, Vec<Surface>) {
    cabinet_with_front(drawer, 0.48)
}

/// The same with a front of the drawer that is this wide to both sides: the gap between the walls is 0.45 wide.
fn cabinet_with_front([out, open]: [f64; 2], wide: f64) -> (Asset, Vec<Surface>) {
    let mut base = cuboid([-0.5, 0.0, 0.0], [-0.45, 1.0, 1.0]);
    base.append(&cuboid([0.45, 0.0, 0.0], [0.5, 1.0, 1.0]));
    base.append(&cuboid([-0.45, 0.95, 0.0], [0.45, 1.0, 1.0]));
    let mut drawer = cuboid([-0.4, 0.0, 0.0], [0.4, 0.8, 0.4]);
    drawer.append(&cuboid([-wide, -0.02, 0.0], [wide, 0.0, 0.4]));
    let door = cuboid([0.0, -0.04, 0.0], [0.95, 0.0, 0.4]);
    let links = vec![
        AssetLink { name: "base".into(), ..AssetLink::default() },
        movable(JointKind::Prismatic, DVec3::NEG_Y, DVec3::new(0.0, -out, 0.1), open),
        movable(JointKind::Revolute, DVec3::NEG_Z, DVec3::new(-0.45, -0.01, 0.55), 1.2),
    ];
    let surface = |mesh: &Mesh| {
        Surface::of(Solid::new(mesh, &|_| true).as_ref(), &|_| true, 4e-3 * 1.7, &SweepSettings::default())
    };
    (Asset { name: "a".into(), links, ..Asset::default() }, [base, drawer, door].iter().map(surface).collect())
}

fn ranges(drawer: [f64; 2], config: &PhysicalConfig) -> Vec<Option<Range>> {
    let (asset, surfaces) = cabinet(drawer);
    extend(&asset, &surfaces, &[None, Some(State::START), Some(State::START)], 1.7, config)
}

#[test]
fn a_front_between_walls_closes_until_it_is_flush_though_its_rims_overlap_them() {
    // Seen open by 3 cm or flush, but for an overlap with the walls of 4 mm.
    for out in [0.03, -0.02] {
        let (asset, surfaces) = cabinet_with_front([out, 0.3], 0.454);
        let found = extend(&asset, &surfaces, &[None, Some(State::START), None], 1.7, &PhysicalConfig::default());
        let drawer = found[1].clone().unwrap();
        assert!((drawer.limits[0] + out + 0.02).abs() < 2e-3, "{drawer:?}");
        assert_eq!((&drawer.stops[0], drawer.closed), (&Stop::Flush("base".into()), out < 0.0));
    }
}

#[test]
fn parts_close_until_contact_and_slides_open_until_they_lose_support() {
    let config = PhysicalConfig::default();
    for (out, open, closed) in [(0.002, 0.3, true), (0.15, 0.3, false)] {
        let found = ranges([out, open], &config);
        assert_eq!(found[0], None);
        let drawer = found[1].clone().unwrap();
        assert_eq!(drawer.stops, [Stop::Contact("base".into()), Stop::Support]);
        assert!((drawer.limits[0] + out).abs() < 1e-3, "{drawer:?}");
        let closing = if closed { Source::Contact } else { Source::Inferred };
        assert_eq!((drawer.sources, drawer.closed), ([closing, Source::Inferred], closed));
        // A quarter of 82 cm stays inside.
        assert!((drawer.limits[1] + out - 0.595).abs() < 0.02, "{drawer:?}");
    }
    // It was seen farther open than that.
    let drawer = ranges([0.002, 0.7], &config)[1].clone().unwrap();
    assert_eq!((drawer.limits[1], &drawer.stops[1], drawer.sources[1]), (0.7, &Stop::Observed, Source::Observed));
    let door = ranges([0.002, 0.5], &config)[2].clone().unwrap();
    // Its front edge meets the wall beside it where the cosine is -1 / 4.
    assert_eq!((&door.stops[1], door.sources[1]), (&Stop::Contact("base".into()), Source::Contact));
    assert!((1.7..1.95).contains(&door.limits[1]) && door.closed, "{door:?}");
    let fixed = PhysicalConfig { extend_limits: false, ..config };
    let fixed = ranges([0.002, 0.5], &fixed)[1].clone().unwrap();
    assert_eq!((fixed.limits, fixed.sources), ([0.0, 0.5], [Source::Observed; 2]));
}

#[test]
fn slides_without_contact_close_until_their_front_is_flush() {
    // An inset front, between side walls whose front edges are at y = 0; its neighbour overlaps the walls.
    let (mut asset, mut surfaces) = cabinet([0.2, 0.6]);
    let drawer = cuboid([-0.4, 0.0, 0.0], [0.4, 0.3, 0.4]);
    surfaces[1] =
        Surface::of(Solid::new(&drawer, &|_| true).as_ref(), &|_| true, 4e-3 * 1.7, &SweepSettings::default());
    let nearer = [None, Some(State::START), Some(State::START)];
    let closing = |asset: &Asset, surfaces: &[Surface]| {
        let found = extend(asset, surfaces, &nearer, 1.7, &PhysicalConfig::default())[1].clone().unwrap();
        (found.limits[0], found.stops[0].clone(), found.sources[0], found.closed)
    };
    let (limit, stop, source, closed) = closing(&asset, &surfaces);
    assert_eq!((stop, source, closed), (Stop::Flush("base".into()), Source::Inferred, false));
    assert!((limit + 0.2).abs() < 0.005, "{limit}");
    // Nearly flush: closed.
    asset.links[1].origin.y = -0.005;
    let (limit, stop, _, closed) = closing(&asset, &surfaces);
    assert!(limit.abs() < 0.01 && stop == Stop::Flush("base".into()) && closed, "{limit} {stop:?}");
    // Without walls, the front of a closed drawer beside it shows where it closes.
    asset.links[1].origin.y = -0.2;
    let base = cuboid([-0.5, 0.3, 0.55], [0.5, 0.35, 1.0]);
    surfaces[0] = Surface::of(Solid::new(&base, &|_| true).as_ref(), &|_| true, 4e-3 * 1.7, &SweepSettings::default());
    asset.links[2] = movable(JointKind::Prismatic, DVec3::NEG_Y, DVec3::new(0.0, -0.001, 0.55), 0.3);
    asset.links[2].name = "closed".into();
    surfaces[2] =
        Surface::of(Solid::new(&drawer, &|_| true).as_ref(), &|_| true, 4e-3 * 1.7, &SweepSettings::default());
    let (limit, stop, source, closed) = closing(&asset, &surfaces);
    assert_eq!((stop, source, closed), (Stop::Flush("closed".into()), Source::Inferred, false), "{limit}");
    assert!((limit + 0.2).abs() < 0.005, "{limit}");
}

#[test]
fn what_closes_a_part_is_a_contact_a_flush_face_or_what_was_seen() {
    let range = |limit: f64, source: Source| Range {
        limits: [limit, 1.0],
        stops: [Stop::Contact("base".into()), Stop::Observed],
        sources: [source, Source::Observed],
        free: PerState::new([0.0; 2], [0.0; 2]),
        closed: false,
    };
    let closed_with = |narrow: Option<f64>, limit: f64, source: Source, flush: Option<f64>| {
        let flush = flush.map(|value| Flush { value, link: "base".into(), precision: 0.03, closed: false });
        let found = |way| Found { way, stop: Stop::Contact("frame".into()), source: Source::Inferred };
        let mut range = range(limit, source);
        range.close(0, flush, narrow.map(found), [0.26, 0.02]);
        range.limits[0]
    };
    let closed = |limit: f64, source: Source, flush: Option<f64>| closed_with(None, limit, source, flush);
    // A contact just behind the flush place, before it, and far behind it.
    assert_eq!(closed(-0.72, Source::Inferred, Some(-0.7)), -0.72);
    assert_eq!(closed(-0.5, Source::Inferred, Some(-0.7)), -0.5);
    assert_eq!(closed(-1.2, Source::Inferred, Some(-0.7)), -0.7);
    // Nothing was met: only what is flush says more than what was seen, also beyond what would be assumed.
    assert_eq!(closed(-0.78, Source::Assumed, Some(-1.1)), -1.1);
    assert_eq!(closed(-0.78, Source::Assumed, None), 0.0);
    // Contacts of parts that are flush nowhere.
    assert_eq!(closed(-0.2, Source::Inferred, None), -0.2);
    assert_eq!(closed(-0.9, Source::Inferred, None), 0.0);
    // A narrow contact before a wide one or a flush place, at its beginning, far before it, and alone.
    assert_eq!(closed_with(Some(0.19), -0.2, Source::Inferred, None), -0.19);
    assert_eq!(closed_with(Some(0.21), -0.5, Source::Inferred, Some(-0.2)), -0.2);
    assert_eq!(closed_with(Some(0.1), -0.2, Source::Inferred, None), -0.2);
    assert_eq!(closed_with(Some(0.1), -0.5, Source::Inferred, Some(-0.2)), -0.2);
    assert_eq!(closed_with(Some(0.1), -1.5, Source::Inferred, Some(-1.5)), -0.1);
    assert_eq!(closed_with(Some(0.1), -0.78, Source::Assumed, None), -0.1);
    assert_eq!(closed_with(Some(0.1), -0.5, Source::Inferred, Some(0.0)), 0.0);
}

#[test]
fn an_open_neighbour_stops_a_part_only_where_it_is_open() {
    let (mut asset, surfaces) = cabinet([0.0, 0.5]);
    // The door is below the drawer's top: the open drawer is in its way.
    asset.links[2].origin.z = 0.2;
    let door =
        extend(&asset, &surfaces, &[None, Some(State::START), Some(State::START)], 1.7, &PhysicalConfig::default());
    let door = door[2].clone().unwrap();
    assert!(door.limits[0] > -0.05 && door.limits[1] > 1.2, "{door:?}");
    // At the end state the drawer is open by half a metre.
    assert!(door.free[State::END][0] > 0.3, "{door:?}");
    assert!((door.free[State::START][0] - door.limits[0]).abs() < 1e-3, "{door:?}");
}
