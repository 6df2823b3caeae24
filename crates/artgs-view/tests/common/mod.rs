//! A small replica folder for the page: a cabinet with a door, a knob on a screw joint in the door, and a drawer.

use artgs_core::{
    Alternative, Asset, AssetJoint, AssetLink, Camera, FaceEvidence, Inertial, Intrinsics, Joint, JointAlternative,
    JointKind, Mesh, PerState, Replica, Rigid, Splats, State, Texture, TexturedMesh,
};
use artgs_io::asset::{SpzVersion, export_urdf, splats::export_splats};
use artgs_view::{CameraView, Cloud, FoundJoint, Page, Placement, SceneBox};
use glam::DVec3;
use std::path::Path;

/// Gaussians per square metre of surface.
const DENSITY: f32 = 700.0;

/// Boxes with flat normals and stripes of two colours on every side.
fn striped(boxes: &[Mesh], color: [u8; 3]) -> TexturedMesh {
    let mut out = TexturedMesh::default();
    for pair in boxes.iter().flat_map(|b| b.triangles.chunks(2).map(move |t| (b, t))) {
        let (mesh, t) = pair;
        let at = out.mesh.vertices.len() as u32;
        let corners = [t[0][0], t[0][1], t[0][2], t[1][2]].map(|i| mesh.vertices[i as usize]);
        let [a, b, c, _] = corners.map(|v| DVec3::from_array(v.map(f64::from)));
        let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array();
        out.mesh.vertices.extend(corners);
        out.mesh.colors.extend([color; 4]);
        out.normals.extend([normal; 4]);
        out.uvs.extend([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        out.mesh.triangles.extend([[at, at + 1, at + 2], [at, at + 2, at + 3]]);
    }
    let dark = color.map(|c| c / 2);
    let rgb = (0..16 * 16).map(|i| if (i / 16 + i % 16) % 4 < 2 { color } else { dark }).collect();
    out.texture = Some(Texture { width: 16, height: 16, rgb });
    out
}

/// Gaussians on a lattice over every side of the boxes.
fn scattered(boxes: &[Mesh], color: [u8; 3]) -> Splats {
    let mut s = Splats { sh_degree: 0, ..Splats::default() };
    let step = DENSITY.sqrt().recip();
    for (mesh, t) in boxes.iter().flat_map(|b| b.triangles.chunks(2).map(move |t| (b, t))) {
        let [a, b, _, d] = [t[0][0], t[0][1], t[0][2], t[1][2]].map(|i| mesh.vertices[i as usize]);
        let side = |v: [f32; 3]| [0, 1, 2].map(|k| v[k] - a[k]);
        let (u, v) = (side(b), side(d));
        let count = |v: [f32; 3]| ((v.iter().map(|x| x * x).sum::<f32>().sqrt() / step).round() as usize).max(1);
        let (nu, nv) = (count(u), count(v));
        for i in 0..nu * nv {
            let (x, y) = (((i % nu) as f32 + 0.5) / nu as f32, ((i / nu) as f32 + 0.5) / nv as f32);
            s.means.push([0, 1, 2].map(|k| a[k] + x * u[k] + y * v[k]));
            s.rotations.push([1.0, 0.0, 0.0, 0.0]);
            s.log_scales.push([(0.5 * step).ln(); 3]);
            s.logit_opacities.push(3.0);
            s.sh.extend(color.map(|c| (f32::from(c) / 255.0 - 0.5) / 0.282_094_8));
        }
    }
    s
}

fn link(name: &str, parent: Option<usize>, origin: DVec3, boxes: &[Mesh], color: [u8; 3]) -> AssetLink {
    AssetLink {
        name: name.into(),
        parent,
        joint: None,
        origin,
        visual: striped(boxes, color),
        collision: boxes.to_vec(),
        inertial: Inertial::default(),
        splats: Some(scattered(boxes, color)),
        ..AssetLink::default()
    }
}

fn joint(kind: JointKind, axis: DVec3, limits: [f64; 2], observed: [f64; 2]) -> Option<AssetJoint> {
    Some(AssetJoint {
        kind,
        axis,
        pitch: if kind == JointKind::Screw { 0.01 } else { 0.0 },
        limits,
        observed: PerState::new(observed[0], observed[1]),
        effort: 50.0,
        velocity: 3.0,
        damping: 0.2,
        friction: 0.1,
    })
}

/// A cabinet of five panels, open towards -Y, with a door above, a knob on a screw joint in it, and a drawer below.
pub(crate) fn cabinet() -> Asset {
    let walls = [
        Mesh::cuboid([-0.5, -0.25, 0.0], [-0.48, 0.25, 1.0]),
        Mesh::cuboid([0.48, -0.25, 0.0], [0.5, 0.25, 1.0]),
        Mesh::cuboid([-0.48, -0.25, 0.0], [0.48, 0.25, 0.02]),
        Mesh::cuboid([-0.48, -0.25, 0.98], [0.48, 0.25, 1.0]),
        Mesh::cuboid([-0.48, 0.23, 0.02], [0.48, 0.25, 0.98]),
    ];
    let door = [Mesh::cuboid([0.0, -0.02, -0.24], [0.99, 0.0, 0.24])];
    let drawer =
        [Mesh::cuboid([-0.47, -0.02, -0.2], [0.47, 0.0, 0.2]), Mesh::cuboid([-0.45, 0.0, -0.2], [0.45, 0.45, -0.18])];
    let knob = [Mesh::cuboid([-0.03, -0.05, -0.03], [0.03, 0.0, 0.03])];
    let mut links = vec![
        link("base", None, DVec3::ZERO, &walls, [190, 170, 140]),
        link("door", Some(0), DVec3::new(-0.5, -0.26, 0.75), &door, [180, 70, 50]),
        link("drawer", Some(0), DVec3::new(0.0, -0.26, 0.25), &drawer, [60, 100, 180]),
        link("knob", Some(1), DVec3::new(0.4, -0.29, 0.75), &knob, [240, 220, 80]),
    ];
    links[1].joint = joint(JointKind::Revolute, DVec3::NEG_Z, [0.0, 1.6], [0.0, 1.2]);
    links[2].joint = joint(JointKind::Prismatic, DVec3::NEG_Y, [0.0, 0.42], [0.3, 0.0]);
    links[3].joint = joint(JointKind::Screw, DVec3::NEG_Y, [0.0, 6.0], [0.0, 3.0]);
    links[0].visual.texture = None;
    links[0].visual.uvs.clear();
    for (k, kind) in [(1, FaceEvidence::Invented), (2, FaceEvidence::Seen)] {
        links[k].visual.evidence = vec![kind; links[k].visual.mesh.triangles.len()];
    }
    Asset { name: "cabinet".into(), links, ..Asset::default() }
}

/// Writes the outputs of `artgs reconstruct` and `artgs export OUT --to urdf,splats` that the page reads.
pub(crate) fn write_replica_folder(out: &Path) {
    let asset = cabinet();
    let joints: Vec<Joint> = asset
        .movable()
        .map(|(_, l, j)| {
            let AssetJoint { kind, axis, pitch, limits, observed, .. } = *j;
            let zero = observed[State::START];
            let limits = limits.map(|v| v - zero);
            Joint { kind, axis, origin: l.origin, pitch, limits, state_values: observed.map(|v| v - zero) }
        })
        .collect();
    let mut replica = Replica::new(&joints);
    for (part, link) in replica.parts.iter_mut().zip(&asset.links) {
        part.name = link.name.clone();
    }
    replica.parts[1].confidence = Some(0.97);
    replica.parts[1].alternatives.push(slide());
    for state in ["start", "end"] {
        for name in ["whole", "part_0", "part_1", "part_2", "part_3"] {
            let mesh = out.join("meshes").join(state).join(format!("{name}.ply"));
            artgs_io::write_mesh_ply(&mesh, &asset.links[0].visual.mesh).unwrap();
        }
    }
    artgs_io::write_replica(out, &replica).unwrap();
    export_urdf(&out.join("exports/urdf"), &asset).unwrap();
    export_splats(&out.join("exports/splats"), &asset, SpzVersion::default()).unwrap();
    let notes = br#"{"links": [{"name": "door", "watertight": true}, {"name": "drawer", "watertight": false}]}"#;
    artgs_io::write_atomic(&out.join("exports/export.json"), notes).unwrap();
    let metrics = r#"{"parts": 4, "gaussians": 3000,
        "test": [{"psnr": 38.14, "ssim": 0.986, "views": 16}, {"psnr": 36.78, "ssim": 0.984, "views": 16}],
        "train": [{"psnr": 39.0, "ssim": 0.99, "views": 8}, {"psnr": 38.0, "ssim": 0.989, "views": 8}],
        "seconds": [["discover", 21.4], ["articulate", 29.9]], "total_seconds": 59.6, "warnings": []}"#;
    artgs_io::write_atomic(&out.join("metrics.json"), metrics.as_bytes()).unwrap();
}

/// The page of the folder, with a camera of each state and points of both.
pub(crate) fn page(out: &Path) -> Page {
    let mut page = Page::of_replica(out).unwrap();
    let intrinsics = Intrinsics { fx: 150.0, fy: 150.0, cx: 84.0, cy: 60.0, width: 160, height: 120 };
    let views = State::ALL.map(|state| {
        let number = state.index();
        let photo = out.join(format!("photo_{number}.png"));
        let color = [[220, 120, 20], [20, 160, 90]][number];
        artgs_io::image_io::write_rgb(&photo, 160, 120, &vec![color; 160 * 120]).unwrap();
        let mask = out.join(format!("mask_{number}.png"));
        let inside = |i: usize| [u8::from((40..120).contains(&(i % 160))) * 255; 3];
        artgs_io::image_io::write_rgb(&mask, 160, 120, &(0..160 * 120).map(inside).collect::<Vec<_>>()).unwrap();
        let eye = DVec3::new(-1.2 + 2.0 * number as f64, -2.4, 1.3);
        let camera = Camera::look_at(intrinsics, eye, DVec3::new(0.0, 0.0, 0.5), DVec3::Z);
        CameraView {
            name: format!("photo {number}"),
            state,
            camera,
            photo: Some(photo),
            rendering: None,
            mask: Some(mask),
        }
    });
    page.add_cameras(&views, Placement::default()).unwrap();
    add_clouds(&mut page);
    page
}

/// What the door could be instead.
fn slide() -> Alternative {
    let found = JointAlternative {
        kind: JointKind::Prismatic,
        motion: Rigid::shift(DVec3::new(0.25, 0.0, 0.0)),
        cost: 0.08,
        what: "It slides to the right.".into(),
        advice: "Open it further.".into(),
    };
    Alternative::near(&found, DVec3::ZERO)
}

/// Discovered parts of the sample: joints and labelled points.
pub(crate) fn found_page() -> Page {
    let joint = |l: &AssetLink| {
        let AssetJoint { kind, axis, pitch, limits, observed, .. } = l.joint?;
        let joint = Joint { kind, axis, origin: l.origin, pitch, limits, state_values: observed };
        Some(FoundJoint { joint, parent: l.parent?, confidence: Some(0.87), alternatives: vec![slide()] })
    };
    let joints: Vec<_> = cabinet().links.iter().filter_map(joint).collect();
    let mut page = Page::of_joints("cabinet", &joints, Placement::default());
    add_clouds(&mut page);
    page
}

/// The sample as a recording of its start state whose world has +Y up, and a box around it.
pub(crate) fn recording_page() -> Page {
    let rotation = glam::DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let placement = Placement { rotation, ..Placement::default() };
    let recorded = |p: DVec3| placement.rotation.inverse() * p;
    let mut cloud = observed(State::START);
    cloud.points.iter_mut().for_each(|p| *p = recorded(DVec3::from_array(p.map(f64::from))).as_vec3().to_array());
    cloud.marks.clear();
    // A floor around the object.
    for i in 0..60 * 60 {
        let at = DVec3::new(f64::from(i % 60) * 0.05 - 1.5, f64::from(i / 60) * 0.05 - 1.5, -0.05);
        cloud.points.push(recorded(at).as_vec3().to_array());
        cloud.colors.push([120, 100, 80]);
    }
    let mut page = Page::empty("recording");
    let intrinsics = Intrinsics { fx: 140.0, fy: 140.0, cx: 84.0, cy: 60.0, width: 160, height: 120 };
    let views = [-1.2, 0.0, 1.2].map(|x| CameraView {
        name: format!("frame {x}"),
        state: State::START,
        camera: Camera::look_at(
            intrinsics,
            recorded(DVec3::new(x, -2.4, 1.3)),
            recorded(DVec3::new(0.0, 0.0, 0.5)),
            DVec3::Y,
        ),
        photo: None,
        rendering: None,
        mask: None,
    });
    page.add_cameras(&views, placement).unwrap();
    page.add_cloud(&cloud, placement);
    let (lower, upper) = ([-0.6, -0.1, -0.4], [0.6, 1.1, 0.4]);
    page.scene.object_box = Some(SceneBox { lower, upper, saved: false, file: None, refused: None });
    page
}

fn add_clouds(page: &mut Page) {
    for state in State::ALL {
        page.add_cloud(&observed(state), Placement::default());
    }
}

/// Points of the sample in a state.
fn observed(state: State) -> Cloud {
    let asset = cabinet();
    let poses: Vec<Rigid> = asset.poses(&asset.observed(state));
    let mut cloud = Cloud { state, points: vec![], colors: vec![], marks: vec![] };
    for (i, (link, pose)) in asset.links.iter().zip(&poses).enumerate() {
        for mean in link.splats.iter().flat_map(|s| &s.means) {
            cloud.points.push(pose.apply(DVec3::from_array(mean.map(f64::from))).as_vec3().to_array());
            cloud.colors.push(link.visual.mesh.colors[0]);
            cloud.marks.push(i as u8);
        }
    }
    cloud
}
