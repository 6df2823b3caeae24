//! A small asset for the tests of the writers.

use artgs_core::{
    Asset, AssetJoint, AssetLink, ContactMaterial, Handle, HingeSide, Inertial, JointKind, Mesh, PartClass,
    PartSemantics, PerState, Rigid, Splats, Texture, TexturedMesh,
};
use glam::{DMat3, DVec3};

/// A box with flat normals and a texture of 4 x 2 pixels on every side.
fn textured(mesh: &Mesh) -> TexturedMesh {
    let mut out = TexturedMesh::default();
    for pair in mesh.triangles.chunks(2) {
        let at = out.mesh.vertices.len() as u32;
        let corners = [pair[0][0], pair[0][1], pair[0][2], pair[1][2]].map(|i| mesh.vertices[i as usize]);
        let [a, b, c, _] = corners.map(|v| DVec3::from_array(v.map(f64::from)));
        let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array();
        out.mesh.vertices.extend(corners);
        out.mesh.colors.extend([[200, 100, 50]; 4]);
        out.normals.extend([normal; 4]);
        out.uvs.extend([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        out.mesh.triangles.extend([[at, at + 1, at + 2], [at, at + 2, at + 3]]);
    }
    let rgb = (0..8u8).map(|i| [i * 30, 255 - i * 30, 128]).collect();
    out.texture = Some(Texture { width: 4, height: 2, rgb });
    out
}

fn splats(mean: [f32; 3]) -> Splats {
    Splats {
        means: vec![mean, [mean[0] + 0.01, mean[1], mean[2]]],
        rotations: vec![[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, -0.5, 0.5]],
        log_scales: vec![[-4.0, -4.5, -5.0]; 2],
        logit_opacities: vec![2.0, -1.0],
        sh_degree: 1,
        sh: (0..24).map(|i| i as f32 * 0.02 - 0.2).collect(),
    }
}

fn joint(kind: JointKind, axis: DVec3, limits: [f64; 2], observed: [f64; 2]) -> AssetJoint {
    AssetJoint {
        kind,
        axis,
        pitch: 0.0,
        limits,
        observed: PerState::new(observed[0], observed[1]),
        effort: 50.0,
        velocity: 3.0,
        damping: 0.2,
        friction: 0.1,
    }
}

fn link(name: &str, origin: DVec3, walls: &[Mesh], joint: Option<AssetJoint>) -> AssetLink {
    let mut whole = Mesh::default();
    walls.iter().for_each(|w| whole.append(w));
    let center = DVec3::from_array(
        whole
            .vertices
            .iter()
            .fold([0.0; 3], |s, v| [0, 1, 2].map(|a| s[a] + f64::from(v[a]) / whole.vertices.len() as f64)),
    );
    AssetLink {
        name: name.into(),
        parent: joint.map(|_| 0),
        joint,
        origin,
        visual: textured(&whole),
        collision: walls.to_vec(),
        contact: ContactMaterial { friction: 0.6, restitution: 0.1 },
        inertial: Inertial { mass: 2.0, center, inertia: [0.1, 0.12, 0.08, 0.001, -0.002, 0.003] },
        splats: Some(splats([0.1, 0.2, 0.3])),
        ..AssetLink::default()
    }
}

/// A cabinet of five panels, 1 m x 0.5 m x 1 m, open towards -Y, with a door on a hinge along -Z above and a drawer below
/// that slides along -Y. No links touch at values 0, and the door opens by 1.5 rad, the drawer by 0.4 m.
pub(crate) fn cabinet() -> Asset {
    let walls = [
        Mesh::cuboid([-0.5, -0.25, 0.0], [-0.48, 0.25, 1.0]),
        Mesh::cuboid([0.48, -0.25, 0.0], [0.5, 0.25, 1.0]),
        Mesh::cuboid([-0.48, -0.25, 0.0], [0.48, 0.25, 0.02]),
        Mesh::cuboid([-0.48, -0.25, 0.98], [0.48, 0.25, 1.0]),
        Mesh::cuboid([-0.48, 0.23, 0.02], [0.48, 0.25, 0.98]),
    ];
    let hinge = DVec3::new(-0.5, -0.26, 0.75);
    let door = Mesh::cuboid([0.0, -0.02, -0.25], [1.0, 0.0, 0.25]);
    let slide = DVec3::new(0.0, -0.26, 0.25);
    let drawer =
        [Mesh::cuboid([-0.47, -0.02, -0.2], [0.47, 0.0, 0.2]), Mesh::cuboid([-0.45, 0.0, -0.2], [0.45, 0.45, -0.18])];
    let opens = joint(JointKind::Revolute, DVec3::NEG_Z, [0.0, 1.6], [0.0, 1.5]);
    let slides = joint(JointKind::Prismatic, DVec3::NEG_Y, [0.0, 0.42], [0.0, 0.4]);
    let mut links = vec![
        link("base", DVec3::ZERO, &walls, None),
        link("part_1", hinge, &[door], Some(opens)),
        link("part_2", slide, &drawer, Some(slides)),
    ];
    let classes = [PartClass::Body, PartClass::Door, PartClass::Drawer];
    for (link, class) in links.iter_mut().zip(classes) {
        let hinge = (class == PartClass::Door).then_some(HingeSide::Left);
        link.semantics = Some(PartSemantics { class, hinge, confidence: 0.9, given: false });
    }
    // Approached along +Y, the fingers close along X.
    let frame = Rigid::from_matrix(DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y), DVec3::new(0.9, -0.04, 0.0));
    let name = "part_1_handle".into();
    links[1].handles = vec![Handle { name, frame, width: 0.02, length: 0.2, depth: 0.03 }];
    Asset { name: "cabinet".into(), links, apart: vec![[1, 2]], front: Some(DVec3::NEG_Y) }
}

/// Cases that the cabinet lacks: a base away from the origin, a screw on a part, a slide against gravity, a horizontal hinge,
/// a part of a few grams, links without texture, without a visual mesh and with a flat one.
pub(crate) fn contraption() -> Asset {
    let mut asset = cabinet();
    asset.name = "contraption".into();
    let mut add = |name: &str, parent: usize, at: DVec3, hull: Mesh, mass: f64, joint: AssetJoint| {
        let mut new = link(name, at, &[hull], Some(joint));
        new.parent = Some(parent);
        new.inertial.mass = mass;
        // The inertia of a ball of 2 cm, similar to that of the smallest shape below.
        new.inertial.inertia = [4e-4 * mass, 4e-4 * mass, 4e-4 * mass, 0.0, 0.0, 0.0];
        asset.links.push(new);
    };
    let knob = AssetJoint {
        pitch: 0.002,
        friction: 0.0005,
        damping: 0.0001,
        effort: 2.0,
        ..joint(JointKind::Screw, DVec3::NEG_Y, [0.0, 6.0], [1.0, 5.0])
    };
    let cube = Mesh::cuboid([-0.02; 3], [0.02; 3]);
    add("knob", 1, DVec3::new(0.4, -0.32, 0.75), cube, 0.005, knob);
    let lift = joint(JointKind::Prismatic, DVec3::Z, [-0.005, 0.3], [0.0, 0.25]);
    add("lift", 0, DVec3::new(0.0, 0.0, 1.01), Mesh::cuboid([-0.3, -0.2, 0.0], [0.3, 0.2, 0.02]), 1.5, lift);
    let flap = joint(JointKind::Revolute, DVec3::new(0.0, 0.96, 0.28), [-0.1, 1.4], [0.0, 1.2]);
    add("flap", 0, DVec3::new(-0.56, 0.0, 0.9), Mesh::cuboid([-0.02, -0.15, -0.3], [0.0, 0.15, 0.0]), 0.6, flap);
    asset.links[3].visual.texture = None;
    asset.links[4].visual = TexturedMesh::default();
    // A thin inclined plate: rounding decides whether it violates the triangle inequality.
    asset.links[4].inertial.inertia = [0.3, 0.2, 0.5, 0.1, 0.0, 0.0];
    let flat = &mut asset.links[5].visual;
    flat.mesh.vertices.iter_mut().for_each(|v| v[0] = 0.0);
    for link in &mut asset.links {
        link.origin += DVec3::new(0.3, 0.2, 0.05);
    }
    asset
}

/// Writes the samples to the folder `ARTGS_WRITE_SAMPLE`, for `validate/validate.py`; without the variable it only tests that
/// they can be written.
#[test]
fn the_samples_can_be_written() {
    let scratch = tempfile::tempdir().unwrap();
    let dir = std::env::var_os("ARTGS_WRITE_SAMPLE").map_or(scratch.path().to_path_buf(), Into::into);
    for asset in [cabinet(), contraption()] {
        let dir = dir.join(&asset.name);
        super::export_urdf(&dir.join("urdf"), &asset).unwrap();
        super::export_mjcf(&dir.join("mjcf"), &asset).unwrap();
        super::export_sdf(&dir.join("sdf"), &asset).unwrap();
        super::export_partnet(&dir.join("partnet"), &asset).unwrap();
        assert!(dir.join("partnet/mobility.urdf").is_file());
    }
}
