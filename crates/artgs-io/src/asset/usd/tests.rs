//! Reads files back with the stages of the `openusd` crate. `validate/` checks them with Pixar's library.

use super::*;
use crate::asset::testing::cabinet;
use artgs_core::{JointKind, State};
use glam::{DQuat, DVec3};
use openusd::gf;
use openusd::sdf;
use openusd::usd::{Prim as StagePrim, Stage};

fn open(path: &Path) -> Stage {
    Stage::open(path.to_str().unwrap()).unwrap()
}

fn prim(stage: &Stage, path: &str) -> StagePrim {
    stage.prim(sdf::path(path).unwrap())
}

fn get<T: TryFrom<Value>>(prim: &StagePrim, name: &str) -> T
where
    T::Error: std::error::Error + Send + Sync + 'static,
{
    prim.attribute(name).get::<T>().unwrap().unwrap_or_else(|| panic!("no {name}"))
}

fn integers(prim: &StagePrim, name: &str) -> Vec<i32> {
    match get::<Value>(prim, name) {
        Value::IntVec(v) => v,
        other => panic!("{other:?}"),
    }
}

fn targets(prim: &StagePrim, name: &str) -> Vec<String> {
    prim.relationship(name).targets().unwrap().iter().map(ToString::to_string).collect()
}

fn vector(v: gf::Vec3f) -> DVec3 {
    DVec3::new(v.x.into(), v.y.into(), v.z.into())
}

fn schemas(prim: &StagePrim) -> Vec<String> {
    prim.api_schemas().unwrap().iter().map(|t| t.as_str().to_owned()).collect()
}

/// The cabinet with a screw below its door.
fn with_screw() -> Asset {
    let mut asset = cabinet();
    let mut knob = asset.links[1].clone();
    (knob.name, knob.parent) = ("knob".into(), Some(1));
    knob.origin += DVec3::new(0.9, -0.05, 0.1);
    let joint = knob.joint.as_mut().unwrap();
    (joint.kind, joint.pitch, joint.axis) = (JointKind::Screw, 0.01, DVec3::new(1.0, -2.0, 0.5).normalize());
    asset.links.push(knob);
    asset
}

#[test]
fn bodies_and_joints_are_the_same_in_text_and_crate() {
    let dir = tempfile::tempdir().unwrap();
    let asset = with_screw();
    let files = export_usd(dir.path(), &asset).unwrap();
    assert!(files[0].ends_with("cabinet.usda") && files[1].ends_with("cabinet.usdc"));
    assert_eq!(files.len(), 3 + 4 + 1);
    let scene = open(&dir.path().join("scene.usda"));
    assert!(get::<f32>(&prim(&scene, "/World/surroundings/front"), "focalLength") > 20.0);
    // The reference is resolved.
    let base = schemas(&prim(&scene, "/World/cabinet/base"));
    assert_eq!(base, schemas(&prim(&open(&files[1]), "/cabinet/base")));
    assert!(!base.is_empty());
    for file in &files[..2] {
        let stage = open(file);
        assert_eq!(stage.default_prim().as_deref(), Some("cabinet"));
        assert_eq!(schemas(&prim(&stage, "/cabinet")), ["PhysicsArticulationRootAPI"]);
        assert_eq!(targets(&prim(&stage, "/cabinet/Joints/fixed_base"), "physics:body1"), ["/cabinet/base"]);
        for link in &asset.links {
            let body = prim(&stage, &format!("/cabinet/{}", link.name));
            assert!(schemas(&body).contains(&"PhysicsRigidBodyAPI".to_owned()));
            let at: gf::Vec3d = get(&body, "xformOp:translate");
            assert_eq!([at.x, at.y, at.z], link.origin.to_array());
            assert_eq!(get::<f32>(&body, "physics:mass"), 2.0);
            let Some(joint) = link.joint else { continue };
            let parent = &asset.links[link.parent.unwrap()];
            let apart = (link.name == "part_2").then(|| "/cabinet/part_1".to_owned());
            let filtered: Vec<String> = std::iter::once(format!("/cabinet/{}", parent.name)).chain(apart).collect();
            assert_eq!(targets(&body, "physics:filteredPairs"), filtered);

            let hinge = prim(&stage, &format!("/cabinet/Joints/{}_joint", link.name));
            assert_eq!(targets(&hinge, "physics:body0"), [format!("/cabinet/{}", parent.name)]);
            let shift = vector(get(&hinge, "physics:localPos0")) + parent.origin - link.origin;
            assert!(shift.length() < 1e-6);
            for frame in ["physics:localRot0", "physics:localRot1"] {
                let q: gf::Quatf = get(&hinge, frame);
                let q = DQuat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into());
                assert!((q * DVec3::X - joint.axis).length() < 1e-6);
            }
            let unit = if joint.kind == JointKind::Prismatic { 1.0 } else { 180.0 / std::f64::consts::PI };
            let upper = f64::from(get::<f32>(&hinge, "physics:upperLimit"));
            assert!((upper - joint.limits[1] * unit).abs() < 1e-4);
            let observed: gf::Vec2d = get(&hinge, "artgs:observed");
            assert!((observed.y - joint.observed[State::END] * unit).abs() < 1e-9);
        }
        let knob = prim(&stage, "/cabinet/Joints/knob_joint");
        assert!((get::<f64>(&knob, "artgs:pitch") - 0.01 * std::f64::consts::PI / 180.0).abs() < 1e-12);
    }
}

#[test]
fn meshes_textures_and_hulls_are_drawn_as_they_should() {
    let dir = tempfile::tempdir().unwrap();
    let asset = cabinet();
    let files = export_usd(dir.path(), &asset).unwrap();
    for file in &files[..2] {
        let stage = open(file);
        let (seen, link) = (prim(&stage, "/cabinet/part_2/visual"), &asset.links[2]);
        let points: Vec<gf::Vec3f> = get(&seen, "points");
        assert_eq!(points.iter().map(|p| [p.x, p.y, p.z]).collect::<Vec<_>>(), link.visual.mesh.vertices);
        let corners = integers(&seen, "faceVertexIndices");
        assert!(corners.iter().zip(link.visual.mesh.triangles.as_flattened()).all(|(a, b)| *a == *b as i32));
        let st: Vec<gf::Vec2f> = get(&seen, "primvars:st");
        assert!(st.iter().zip(&link.visual.uvs).all(|(a, b)| a.x == b[0] && a.y == 1.0 - b[1]));
        assert_eq!(targets(&seen, "material:binding"), ["/cabinet/Looks/part_2"]);
        let texture: sdf::AssetPath = get(&prim(&stage, "/cabinet/Looks/part_2/texture"), "inputs:file");
        assert_eq!(texture.as_str(), "./textures/part_2.png");
        // Twelve triangles: short enough to be one of the arrays that are repaired.
        let hull = prim(&stage, "/cabinet/part_2/collision_1");
        assert_eq!(integers(&hull, "faceVertexCounts"), [3; 12]);
        assert_eq!(get::<openusd::tf::Token>(&hull, "purpose").as_str(), "guide");
        assert_eq!(schemas(&hull), ["PhysicsCollisionAPI", "PhysicsMeshCollisionAPI", "MaterialBindingAPI"]);
        assert_eq!(targets(&hull, "material:binding:physics"), ["/cabinet/Contacts/part_2"]);
        let contact = prim(&stage, "/cabinet/Contacts/part_2");
        assert_eq!(schemas(&contact), ["PhysicsMaterialAPI"]);
        let found =
            ["staticFriction", "dynamicFriction", "restitution"].map(|w| get::<f32>(&contact, &format!("physics:{w}")));
        assert_eq!(found, [0.6, 0.6, 0.1]);
    }
    assert!(dir.path().join("textures/part_2.png").is_file());
    let mut plain = asset.clone();
    plain.links[0].visual.texture = None;
    let stage = open(&export_usd(dir.path(), &plain).unwrap()[1]);
    let colors: Vec<gf::Vec3f> = get(&prim(&stage, "/cabinet/base/visual"), "primvars:displayColor");
    assert!((colors[0].x - 0.577_580).abs() < 1e-5);
}

#[test]
fn gaussians_replace_the_meshes_in_a_stage_of_their_own() {
    let dir = tempfile::tempdir().unwrap();
    let asset = cabinet();
    let files = export_usd(dir.path(), &asset).unwrap();
    assert!(files[2].ends_with("cabinet_splats.usdc"));
    let stage = open(&files[2]);
    let splats = prim(&stage, "/cabinet/part_1/splats");
    assert_eq!(splats.type_name().unwrap().as_deref(), Some("ParticleField3DGaussianSplat"));
    assert_eq!(get::<Vec<f32>>(&splats, "opacities")[1], 1.0 / (1.0 + 1f32.exp()));
    let sh: Vec<gf::Vec3f> = get(&splats, "radiance:sphericalHarmonicsCoefficients");
    assert_eq!(sh.len(), 8);
    assert_eq!([sh[7].x, sh[7].y, sh[7].z], asset.links[1].splats.as_ref().unwrap().sh[21..24]);
    let turn = get::<Vec<gf::Quatf>>(&splats, "orientations")[1];
    assert_eq!([turn.w, turn.x, turn.y, turn.z], [0.5, 0.5, -0.5, 0.5]);
    // The referenced stage is composed: bodies, joints, and the hidden mesh.
    assert_eq!(get::<f32>(&prim(&stage, "/cabinet/part_1"), "physics:mass"), 2.0);
    assert_eq!(targets(&prim(&stage, "/cabinet/Joints/part_1_joint"), "physics:body1"), ["/cabinet/part_1"]);
    let seen = prim(&stage, "/cabinet/part_1/visual");
    assert_eq!(get::<openusd::tf::Token>(&seen, "visibility").as_str(), "invisible");

    let mut bare = asset;
    bare.links.iter_mut().for_each(|l| l.splats = None);
    bare.name = "bare".into();
    assert!(export_usd(dir.path(), &bare).unwrap().iter().all(|f| !f.ends_with("bare_splats.usdc")));
}

#[test]
fn text_is_what_pixars_parser_wants() {
    let dir = tempfile::tempdir().unwrap();
    let files = export_usd(dir.path(), &cabinet()).unwrap();
    let text = std::fs::read_to_string(&files[0]).unwrap();
    for line in [
        "    defaultPrim = \"cabinet\"\n",
        "    metersPerUnit = 1.0\n",
        "    upAxis = \"Z\"\n",
        "    prepend apiSchemas = [\"PhysicsArticulationRootAPI\"]\n",
        "            rel physics:body0 = </cabinet/base>\n",
        "            float drive:angular:physics:stiffness = 0.0\n",
        "            uniform token physics:axis = \"X\"\n",
        "    float physics:gravityMagnitude = 9.8100",
    ] {
        assert!(text.contains(line), "{line}");
    }
    assert_eq!(text.matches("PhysicsArticulationRootAPI").count(), 1);
    assert_eq!(text.matches("apiSchemas = \"").count(), 0);
    let again = tempfile::tempdir().unwrap();
    for (a, b) in files.iter().zip(export_usd(again.path(), &cabinet()).unwrap()) {
        assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
    }
}

#[test]
fn packages_are_aligned_and_hold_their_textures() {
    let dir = tempfile::tempdir().unwrap();
    let file = export_usdz(dir.path(), &cabinet()).unwrap().remove(0);
    let bytes = std::fs::read(&file).unwrap();
    let number = |at: usize| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
    let (mut at, mut names) = (0, Vec::new());
    while bytes[at..].starts_with(b"PK\x03\x04") {
        let (name, extra) = (number(at + 26), number(at + 28));
        names.push(String::from_utf8(bytes[at + 30..at + 30 + name].to_vec()).unwrap());
        assert_eq!(number(at + 8), 0, "stored");
        let start = at + 30 + name + extra;
        assert_eq!(start % 64, 0);
        at = start + number(at + 18) + 65536 * number(at + 20);
    }
    assert_eq!(names, ["cabinet.usdc", "textures/base.png", "textures/part_1.png", "textures/part_2.png"]);
    let stage = open(&file);
    assert_eq!(get::<f32>(&prim(&stage, "/cabinet/part_2"), "physics:mass"), 2.0);
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let spoilers: [fn(&mut Asset); 4] = [
        |a| a.links[1].visual.mesh.vertices[3][1] = f32::NAN,
        |a| a.links[1].inertial.mass = f64::INFINITY,
        |a| a.links[2].joint.as_mut().unwrap().limits[1] = f64::INFINITY,
        |a| a.links[1].splats.as_mut().unwrap().log_scales[0][0] = 1e9,
    ];
    for edit in spoilers {
        let mut asset = cabinet();
        edit(&mut asset);
        let message = export_usd(dir.path(), &asset).unwrap_err().to_string();
        assert!(message.contains("not finite") && message.contains("cabinet"), "{message}");
    }
    let mut asset = cabinet();
    asset.links[1].name = "not a name".into();
    assert!(export_usd(dir.path(), &asset).is_err());
}
