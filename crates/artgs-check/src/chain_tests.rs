//! Chains of links in every format: where each link is in the world when several joints move at once.

use crate::readers::open_all;
use artgs_core::{Asset, AssetJoint, AssetLink, JointKind, Mesh, PerState, Rigid, State, TexturedMesh};
use artgs_io::asset::{Format, WriteOptions};
use artgs_io::export_report::{ExportReport, LinkReport};
use glam::DVec3;

fn link(name: &str, parent: Option<usize>, origin: DVec3, joint: Option<AssetJoint>) -> AssetLink {
    let mesh = Mesh::cuboid([-0.1, -0.02, -0.1], [0.1, 0.0, 0.1]);
    let visual = TexturedMesh { normals: vec![[0.0, 0.0, 1.0]; mesh.vertices.len()], mesh, ..TexturedMesh::default() };
    let collision = vec![visual.mesh.clone()];
    AssetLink { name: name.into(), parent, joint, origin, visual, collision, ..AssetLink::default() }
}

fn joint(kind: JointKind, axis: DVec3, pitch: f64, limits: [f64; 2]) -> Option<AssetJoint> {
    let observed = PerState::new(0.0, 0.5 * limits[1]);
    let (effort, velocity, damping, friction) = (20.0, 2.0, 0.1, 0.05);
    Some(AssetJoint { kind, axis: axis.normalize(), pitch, limits, observed, effort, velocity, damping, friction })
}

/// A door on a base, a drawer in the door, a screw in the front of the drawer, and a flap on the screw.
fn chain() -> Asset {
    let at = DVec3::new(0.3, 0.2, 0.05);
    let door = joint(JointKind::Revolute, DVec3::new(0.1, 0.0, -1.0), 0.0, [0.0, 1.4]);
    let drawer = joint(JointKind::Prismatic, DVec3::new(0.0, -1.0, 0.1), 0.0, [-0.05, 0.3]);
    let knob = joint(JointKind::Screw, DVec3::new(0.1, -1.0, 0.0), -0.01, [0.0, 5.0]);
    let flap = joint(JointKind::Revolute, DVec3::X, 0.0, [-0.2, 1.0]);
    let links = vec![
        link("base", None, at, None),
        link("door", Some(0), at + DVec3::new(-0.5, -0.26, 0.75), door),
        link("drawer", Some(1), at + DVec3::new(0.0, -0.3, 0.7), drawer),
        link("knob", Some(2), at + DVec3::new(0.1, -0.4, 0.7), knob),
        link("flap", Some(3), at + DVec3::new(0.1, -0.5, 0.75), flap),
    ];
    Asset { name: "chain".into(), links, ..Asset::default() }
}

/// The same with hinges in place of screws, as formats without screws hold it.
fn without_threads(asset: &Asset) -> Asset {
    let mut out = asset.clone();
    for joint in out.links.iter_mut().filter_map(|l| l.joint.as_mut()) {
        joint.pitch = 0.0;
    }
    out
}

/// What the joints do to every link: from where it is at zero to where it is at `values`.
fn motions(poses: impl Fn(&[f64]) -> Vec<Rigid>, zero: &[f64], values: &[f64]) -> Vec<Rigid> {
    poses(values).into_iter().zip(poses(zero)).map(|(now, rest)| now * rest.inverse()).collect()
}

#[test]
fn links_of_a_chain_are_at_the_same_places_in_every_format() {
    let asset = chain();
    let dir = tempfile::tempdir().unwrap();
    let formats = Format::ALL.into_iter().filter(|format| *format != Format::Splats);
    for format in formats {
        format.write(&dir.path().join(format.name()), &asset, &WriteOptions::default()).unwrap();
    }
    let mut read = Vec::new();
    for opened in open_all(dir.path()) {
        assert!(opened.finding.problems.is_empty(), "{:?}", opened.finding);
        let (name, Some(model)) = (opened.finding.format, opened.model) else { continue };
        // URDF says the pitch in a comment only; its joints, and those of PartNet, are hinges.
        let threaded = model.links.iter().any(|l| l.motion.as_ref().is_some_and(|m| m.pitch.is_some()));
        assert_eq!(threaded, !["urdf", "partnet"].contains(&name.as_str()), "{name}");
        let truth = if threaded { asset.clone() } else { without_threads(&asset) };
        for values in [[0.0, 0.7, 0.0, 0.0, 0.0], [0.0, 0.4, 0.2, 3.0, 0.6], [0.0, 1.3, -0.05, 5.0, -0.2]] {
            let own: Vec<f64> = model.links.iter().map(|l| index(&asset, &l.name).map_or(0.0, |i| values[i])).collect();
            let found = motions(|v| model.poses(v), &vec![0.0; own.len()], &own);
            let wanted = motions(|v| truth.poses(v), &[0.0; 5], &values);
            for (link, found) in model.links.iter().zip(found) {
                let Some(i) = index(&asset, &link.name) else { continue };
                for corner in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
                    let (is, was) = (found.apply(corner), wanted[i].apply(corner));
                    assert!(is.distance(was) < 1e-5, "{name}, link {}, {values:?}: {is} instead of {was}", link.name);
                }
            }
        }
        read.push(name);
    }
    assert_eq!(read, ["urdf", "mjcf", "usda", "usdc", "usdz", "glb", "sdf", "partnet", "simready"]);
}

#[test]
fn observed_values_that_urdf_does_not_hold_come_from_the_report() {
    let asset = chain();
    let dir = tempfile::tempdir().unwrap();
    Format::Urdf.write(&dir.path().join(Format::Urdf.name()), &asset, &WriteOptions::default()).unwrap();
    let mut model = open_all(dir.path()).into_iter().find_map(|opened| opened.model).unwrap();
    let values = |model: &crate::model::Model| -> Vec<Option<PerState<f64>>> {
        model.links.iter().filter_map(|l| Some(l.motion.as_ref()?.observed)).collect()
    };
    assert_eq!(values(&model), [None; 4]);
    let report = |link: &AssetLink| LinkReport {
        name: link.name.clone(),
        observed: link.joint.map(|j| [j.observed[State::START], j.observed[State::END]]),
        ..LinkReport::default()
    };
    let exported = ExportReport { links: asset.links.iter().map(report).collect(), ..ExportReport::default() };
    crate::add_observed(&mut model, &exported);
    let wanted: Vec<_> = asset.movable().map(|(_, _, joint)| Some(joint.observed)).collect();
    assert_eq!(values(&model), wanted);
}

fn index(asset: &Asset, name: &str) -> Option<usize> {
    asset.links.iter().position(|l| l.name == name)
}
