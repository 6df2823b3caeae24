//! Reads files back with the `gltf` crate; the file of Gaussians, which the crate refuses, as JSON.

use super::*;
use crate::asset::testing::cabinet;
use artgs_core::{FaceEvidence, JointKind, Rigid};
use glam::{Mat4, Quat, Vec3};
use gltf::animation::util::ReadOutputs;

type Loaded = (gltf::Document, Vec<gltf::buffer::Data>, Vec<gltf::image::Data>);

fn export(asset: &Asset) -> (tempfile::TempDir, Vec<PathBuf>, Loaded) {
    let dir = tempfile::tempdir().unwrap();
    let files = export_glb(dir.path(), asset).unwrap();
    let loaded = gltf::import(&files[0]).unwrap();
    (dir, files, loaded)
}

/// World matrices of the nodes, where `moved` gives nodes another local transform.
fn world(document: &gltf::Document, moved: &dyn Fn(usize) -> Option<Mat4>) -> Vec<Mat4> {
    let mut out = vec![Mat4::IDENTITY; document.nodes().len()];
    let mut stack: Vec<_> = document.default_scene().unwrap().nodes().map(|n| (n, Mat4::IDENTITY)).collect();
    while let Some((node, parent)) = stack.pop() {
        let local = moved(node.index()).unwrap_or(Mat4::from_cols_array_2d(&node.transform().matrix()));
        out[node.index()] = parent * local;
        stack.extend(node.children().map(|c| (c, out[node.index()])));
    }
    out
}

/// The link's frame as a glTF matrix, y up.
fn y_up(pose: &Rigid) -> Mat4 {
    let turn = Mat4::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    turn * Mat4::from_rotation_translation(pose.rotation.as_quat(), pose.translation.as_vec3())
}

/// A node's transform in the last clip that drives it, at key `key`.
fn keyed(loaded: &Loaded, clip: usize, key: usize) -> (usize, Mat4) {
    let animation = loaded.0.animations().nth(clip).unwrap();
    let node = animation.channels().next().unwrap().target().node();
    let (mut shift, mut turn) = (Vec3::from(node.transform().decomposed().0), Quat::IDENTITY);
    for channel in animation.channels() {
        match channel.reader(|b| Some(&loaded.1[b.index()])).read_outputs().unwrap() {
            ReadOutputs::Rotations(all) => turn = Quat::from_array(all.into_f32().nth(key).unwrap()),
            ReadOutputs::Translations(mut all) => shift = all.nth(key).unwrap().into(),
            _ => panic!("a channel of another kind"),
        }
    }
    (node.index(), Mat4::from_rotation_translation(turn, shift))
}

#[test]
fn faces_are_sorted_by_what_they_rest_on() {
    let mut asset = cabinet();
    let count = asset.links[0].visual.mesh.triangles.len();
    let kind = |i: usize| if i < 2 { FaceEvidence::Invented } else { FaceEvidence::Seen };
    asset.links[0].visual.evidence = (0..count).map(kind).collect();
    let (_dir, _, (document, buffers, _)) = export(&asset);
    let mesh = document.nodes().nth(1).unwrap().mesh().unwrap();
    let found: Vec<(String, String, usize)> = mesh
        .primitives()
        .map(|p| {
            let indices = p.reader(|b| Some(&buffers[b.index()])).read_indices().unwrap().into_u32().count();
            (p.material().name().unwrap().into(), p.extras().as_ref().unwrap().get().into(), indices / 3)
        })
        .collect();
    let name = &asset.links[0].name;
    let wanted = [
        (name.clone(), r#"{"evidence":"seen"}"#.into(), count - 2),
        (format!("{name}_invented"), r#"{"evidence":"invented"}"#.into(), 2),
    ];
    assert_eq!(found, wanted);
    // A mesh of which nothing is known is one primitive.
    assert_eq!(document.nodes().nth(2).unwrap().mesh().unwrap().primitives().len(), 1);
}

#[test]
fn meshes_textures_and_notes_come_back() {
    let asset = cabinet();
    let (_dir, files, (document, buffers, images)) = export(&asset);
    assert!(files[0].ends_with("cabinet.glb") && files[1].ends_with("cabinet_splats.glb"));
    assert_eq!((document.nodes().len(), document.animations().len(), images.len()), (4, 2, 3));
    assert_eq!(images[0].pixels, asset.links[0].visual.texture.clone().unwrap().rgb.as_flattened());
    for (node, link) in document.nodes().skip(1).zip(&asset.links) {
        assert_eq!(node.name(), Some(link.name.as_str()));
        let primitive = node.mesh().unwrap().primitives().next().unwrap();
        let reader = primitive.reader(|b| Some(&buffers[b.index()]));
        assert_eq!(reader.read_positions().unwrap().collect::<Vec<_>>(), link.visual.mesh.vertices);
        assert_eq!(reader.read_normals().unwrap().collect::<Vec<_>>(), link.visual.normals);
        assert_eq!(reader.read_tex_coords(0).unwrap().into_f32().collect::<Vec<_>>(), link.visual.uvs);
        assert_eq!(
            reader.read_indices().unwrap().into_u32().collect::<Vec<_>>(),
            link.visual.mesh.triangles.as_flattened()
        );
        assert!(reader.read_colors(0).is_none());
    }
    let extras: Value =
        serde_json::from_str(document.nodes().nth(2).unwrap().extras().as_ref().unwrap().get()).unwrap();
    assert_eq!(extras["joint"]["type"], "revolute");
    assert_eq!(extras["joint"]["axis"], json!([0.0, 0.0, -1.0]));
    assert_eq!(extras["joint"]["observed"], json!([0.0, 1.5]));
    assert_eq!(extras["inertial"]["mass"], json!(2.0));
    assert!(document.nodes().nth(1).unwrap().extras().as_ref().is_some_and(|e| !e.get().contains("joint")));
}

#[test]
fn nodes_and_clips_follow_the_joints() {
    let mut asset = cabinet();
    // A knob that screws out of the door by two turns and a half.
    let mut knob = asset.links[1].clone();
    knob.name = "knob".into();
    knob.parent = Some(1);
    knob.origin += glam::DVec3::new(0.9, -0.05, 0.1);
    let joint = knob.joint.as_mut().unwrap();
    (joint.kind, joint.pitch, joint.limits) = (JointKind::Screw, 0.01, [-0.5, 5.0 * std::f64::consts::PI - 0.5]);
    joint.axis = DVec3::NEG_Y;
    asset.links.push(knob);
    let (_dir, _, loaded) = export(&asset);

    let rest = world(&loaded.0, &|_| None);
    for (pose, matrix) in asset.poses(&[0.0; 4]).iter().zip(&rest[1..]) {
        assert!(y_up(pose).abs_diff_eq(*matrix, 1e-6));
    }
    // Up in the object is up in glTF.
    assert!((rest[1].transform_vector3(Vec3::Z) - Vec3::Y).length() < 1e-6);

    for (clip, link) in [(0, 1), (1, 2), (2, 3)] {
        let joint = asset.links[link].joint.unwrap();
        let count = loaded.0.animations().nth(clip).unwrap().samplers().next().unwrap().input().count();
        assert_eq!(count, [3, 2, 16][clip]);
        for key in 0..count {
            let (node, local) = keyed(&loaded, clip, key);
            assert_eq!(node, link + 1);
            let mut values = [0.0; 4];
            values[link] = joint.limits[0] + (joint.limits[1] - joint.limits[0]) * key as f64 / (count - 1) as f64;
            let moved = world(&loaded.0, &|n| (n == node).then_some(local));
            assert!(y_up(&asset.poses(&values)[link]).abs_diff_eq(moved[node], 1e-5), "clip {clip} key {key}");
        }
    }
}

#[test]
fn without_a_texture_vertex_colours_are_linear_and_empty_links_are_bare() {
    let mut asset = cabinet();
    asset.links[0].visual.texture = None;
    asset.links[1].visual = Default::default();
    asset.links.iter_mut().for_each(|l| l.splats = None);
    let (_dir, files, (document, buffers, _)) = export(&asset);
    assert_eq!(files.len(), 1);
    assert!(document.nodes().nth(2).unwrap().mesh().is_none());
    let primitive = document.nodes().nth(1).unwrap().mesh().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|b| Some(&buffers[b.index()]));
    let color = reader.read_colors(0).unwrap().into_rgba_f32().next().unwrap();
    for (got, want) in color.iter().zip([0.577_580, 0.127_438, 0.031_896, 1.0]) {
        assert!((got - want).abs() < 2e-5, "{color:?}");
    }
    asset.links.truncate(1);
    asset.links[0].visual = Default::default();
    let (_dir, _, (document, ..)) = export(&asset);
    assert_eq!((document.nodes().len(), document.buffers().len()), (2, 0));
}

#[test]
fn gaussians_are_activated_points_under_the_same_nodes() {
    let asset = cabinet();
    let (_dir, files, _) = export(&asset);
    let bytes = std::fs::read(&files[1]).unwrap();
    let length = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], length(4), length(8)), (b"glTF".as_slice(), 2, bytes.len()));
    let json: Value = serde_json::from_slice(&bytes[20..20 + length(12)]).unwrap();
    let binary = &bytes[28 + length(12)..];
    assert_eq!(json["extensionsUsed"], json!(["KHR_gaussian_splatting"]));
    assert_eq!(json["nodes"][2]["name"], "part_1");
    assert_eq!(json["animations"].as_array().unwrap().len(), 2);
    let primitive = &json["meshes"][1]["primitives"][0];
    assert_eq!(
        (&primitive["mode"], &primitive["extensions"]["KHR_gaussian_splatting"]["kernel"]),
        (&json!(0), &json!("ellipse"))
    );
    let read = |name: &str, width: usize, i: usize| -> Vec<f32> {
        let accessor = &json["accessors"][primitive["attributes"][name].as_u64().unwrap() as usize];
        assert_eq!((accessor["count"].as_u64(), accessor["componentType"].as_u64()), (Some(2), Some(5126)), "{name}");
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let at = view["byteOffset"].as_u64().unwrap() as usize + 4 * width * i;
        let floats = binary[at..at + 4 * width].as_chunks::<4>().0;
        floats.iter().map(|b| f32::from_le_bytes(*b)).collect()
    };
    let splats = asset.links[1].splats.clone().unwrap();
    assert_eq!(read("POSITION", 3, 1), splats.means[1]);
    assert_eq!(read("KHR_gaussian_splatting:ROTATION", 4, 1), [0.5, -0.5, 0.5, 0.5]);
    assert_eq!(read("KHR_gaussian_splatting:SCALE", 3, 0), [-4f32, -4.5, -5.0].map(f32::exp));
    assert!((read("KHR_gaussian_splatting:OPACITY", 1, 1)[0] - 0.268_941_4).abs() < 1e-6);
    assert_eq!(read("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", 3, 1), splats.sh[12..15]);
    assert_eq!(read("KHR_gaussian_splatting:SH_DEGREE_1_COEF_2", 3, 1), splats.sh[21..24]);
    assert!(primitive["attributes"].get("KHR_gaussian_splatting:SH_DEGREE_2_COEF_0").is_none());
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let spoilers: [fn(&mut Asset); 4] = [
        |a| a.links[1].visual.mesh.vertices[3][1] = f32::NAN,
        |a| a.links[1].inertial.mass = f64::INFINITY,
        |a| a.links[1].joint.as_mut().unwrap().limits[1] = f64::INFINITY,
        |a| a.links[1].splats.as_mut().unwrap().log_scales[0][0] = 1e9,
    ];
    for edit in spoilers {
        let mut asset = cabinet();
        edit(&mut asset);
        let message = export_glb(dir.path(), &asset).unwrap_err().to_string();
        assert!(message.contains("not finite") && message.contains("cabinet"), "{message}");
    }
}
