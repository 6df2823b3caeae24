//! Reads the folder back with the stages of the `openusd` crate, with variants selected by a session layer.

use super::*;
use crate::asset::testing::{cabinet, contraption};
use artgs_core::Texture;
use openusd::usd::{Prim as StagePrim, PrimPredicate, Stage};
use openusd::{gf, sdf};
use std::collections::HashMap;

/// The stage with some variants selected.
fn open(file: &Path, selected: &[(&str, &str)]) -> Stage {
    let name = file.file_stem().unwrap().to_str().unwrap();
    let chosen: String = selected.iter().map(|(set, option)| format!("string {set} = \"{option}\" ")).collect();
    let session = tempfile::Builder::new().suffix(".usda").tempfile().unwrap();
    let text = format!("#usda 1.0\n\nover \"{name}\" (\n    variants = {{ {chosen} }}\n)\n{{\n}}\n");
    std::fs::write(session.path(), text).unwrap();
    let stage = Stage::builder().session_layer(session.path().to_str().unwrap()).open(file.to_str().unwrap()).unwrap();
    assert_eq!(stage.composition_errors().len(), 0, "{:?}", stage.composition_errors());
    stage
}

fn prims(stage: &Stage) -> Vec<StagePrim> {
    let mut out = Vec::new();
    stage.traverse(PrimPredicate::DEFAULT, |at| out.push(stage.prim(at.clone()))).unwrap();
    out
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

fn schemas(prim: &StagePrim) -> Vec<String> {
    prim.api_schemas().unwrap().iter().map(|t| t.as_str().to_owned()).collect()
}

fn kind(prim: &StagePrim) -> String {
    prim.type_name().unwrap().map(|t| t.as_str().to_owned()).unwrap_or_default()
}

fn map(value: &Value) -> &HashMap<String, Value> {
    match value {
        Value::Dictionary(map) => map,
        other => panic!("{other:?}"),
    }
}

fn provenance() -> Provenance {
    let picture = Some(Texture { width: 2, height: 2, rgb: vec![[9, 8, 7]; 4] });
    let [author, source] = ["Anna", "replica.json"].map(|text| Some(text.to_owned()));
    Provenance { author, source, date: Some("2026-11-28".into()), picture, ..Provenance::default() }
}

#[test]
fn files_are_where_the_profile_looks_for_them() {
    let dir = tempfile::tempdir().unwrap();
    let files = export_simready(dir.path(), &cabinet(), &provenance()).unwrap();
    let names: Vec<_> = files.iter().map(|f| f.strip_prefix(dir.path()).unwrap().to_str().unwrap()).collect();
    let expected = [
        "cabinet/simready_usd/cabinet.usda",
        "cabinet/simready_usd/physics/base.usdc",
        "cabinet/simready_usd/visuals/mesh.usdc",
        "cabinet/simready_usd/visuals/splats.usdc",
        "cabinet/simready_usd/runnables/physics/physx.usda",
        "cabinet/simready_usd/runnables/physics/newton.usda",
        "cabinet/simready_usd/runnables/physics/mujoco.usda",
        "cabinet/simready_usd/textures/base.png",
        "cabinet/simready_usd/textures/part_1.png",
        "cabinet/simready_usd/textures/part_2.png",
        "cabinet/simready_usd/.thumbs/256x256/cabinet.usda.png",
    ];
    assert_eq!(names, expected);
    assert!(files.iter().all(|f| f.is_file()));
    // The folder of the file that is opened has no other stage.
    let beside = std::fs::read_dir(files[0].parent().unwrap()).unwrap();
    assert_eq!(beside.filter(|e| e.as_ref().unwrap().path().is_file()).count(), 1);

    let again = tempfile::tempdir().unwrap();
    for (a, b) in files.iter().zip(export_simready(again.path(), &cabinet(), &provenance()).unwrap()) {
        assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
    }
    let mut bare = cabinet();
    bare.links.iter_mut().for_each(|link| link.splats = None);
    let files = export_simready(again.path(), &bare, &Provenance::default()).unwrap();
    assert_eq!(files.len(), expected.len() - 2, "no picture, no Gaussians");
    let stage = open(&files[0], &[]);
    assert_eq!(kind(&prim(&stage, "/cabinet/part_1/visual")), "Mesh");
}

#[test]
fn metadata_say_where_the_asset_comes_from_and_what_was_measured() {
    let dir = tempfile::tempdir().unwrap();
    let files = export_simready(dir.path(), &cabinet(), &provenance()).unwrap();
    let stage = open(&files[0], &[]);
    let data = stage.stage_metadata("customLayerData").unwrap().unwrap();
    let nested = map(&map(&data)["SimReady_Metadata"]);
    let text = |key: &str| match &nested[key] {
        Value::String(text) => text.clone(),
        other => panic!("{key}: {other:?}"),
    };
    assert_eq!(
        ["author", "asset_license", "source_file", "usd_date_generated", "qcode"].map(text),
        ["Anna", "not stated", "replica.json", "2026-11-28", "Q223557"]
    );
    assert_eq!((&nested["rigid_body_count"], &nested["mass"]), (&Value::Int(3), &Value::Double(6.0)));
    let Value::Vec3f(size) = &nested["asset_extents"] else { panic!("{:?}", nested["asset_extents"]) };
    // The drawer stands out by 3 cm: two of it, and one of the gap to the cabinet.
    assert!((size.x - 1.0).abs() < 1e-6 && (size.y - 0.53).abs() < 1e-6 && (size.z - 1.0).abs() < 1e-6, "{size:?}");
    let variants = map(&nested["Variants"]);
    let physics = map(&variants["Physics"]);
    assert_eq!(map(&physics["Newton"])["activateOption"], Value::String("Enabled".into()));
    let appearance = map(&map(&variants["Representation"])["Representation"]);
    assert_eq!(appearance["default"], Value::String("Mesh".into()));
    let root = prim(&stage, "/cabinet");
    let front: gf::Vec3f = get(&root, "simready:assetFrame:forwardDirection");
    assert_eq!([front.x, front.y, front.z], [0.0, -1.0, 0.0]);

    let unknown = Asset { front: None, ..cabinet() };
    let file = export_simready(dir.path(), &unknown, &Provenance::default()).unwrap().remove(0);
    let text = std::fs::read_to_string(file).unwrap();
    assert!(!text.contains("forwardDirection") && text.contains("string author = \"unknown\""));
}

#[test]
fn the_neutral_stage_has_bodies_labels_and_grasps_and_no_schema_of_an_engine() {
    let dir = tempfile::tempdir().unwrap();
    for asset in [cabinet(), contraption()] {
        let files = export_simready(dir.path(), &asset, &provenance()).unwrap();
        let stage = open(&files[0], &[]);
        let all = prims(&stage);
        let applied = |word: &str| all.iter().flat_map(schemas).filter(|s| s.starts_with(word)).count();
        assert_eq!([applied("Physx"), applied("Newton"), applied("Mjc")], [0; 3]);
        assert_eq!(applied("PhysicsRigidBodyAPI"), asset.links.len());
        assert_eq!(applied("PhysicsCollisionAPI"), asset.links.iter().map(|l| l.collision.len()).sum::<usize>());
        assert_eq!(applied("PhysicsArticulationRootAPI"), 1);
        assert_eq!(stage.root_prims().unwrap().len(), 1);
        for material in all.iter().filter(|p| kind(p) == "Material") {
            assert!(schemas(material).contains(&"SemanticsLabelsAPI:material".to_owned()));
        }
        let door = prim(&stage, &format!("/{}/part_1", asset.name));
        for (taxonomy, label) in [("class", "door"), ("wikidata_qcode", "Q36794")] {
            let found = get::<Value>(&door, &format!("semantics:labels:{taxonomy}"));
            assert_eq!(found, Value::token_vec([label]));
        }
    }
}

#[test]
fn a_grasp_line_goes_through_the_handle_along_the_way_of_the_fingers() {
    let dir = tempfile::tempdir().unwrap();
    let files = export_simready(dir.path(), &cabinet(), &provenance()).unwrap();
    let stage = open(&files[0], &[]);
    let line = prim(&stage, "/cabinet/part_1/part_1_handle_grasp");
    assert_eq!((kind(&line).as_str(), get::<openusd::tf::Token>(&line, "purpose").as_str()), ("BasisCurves", "guide"));
    let ends: Vec<gf::Vec3f> = get(&line, "points");
    // Fingers close along X of the link; the handle is 2 cm wide.
    let x: Vec<f32> = ends.iter().map(|p| p.x).collect();
    assert!((x[0] - 0.885).abs() < 1e-6 && (x[1] - 0.915).abs() < 1e-6, "{x:?}");
    assert!(ends.iter().all(|p| (p.y + 0.04).abs() < 1e-6 && p.z.abs() < 1e-6));
}

#[test]
fn each_engine_finds_its_own_schemas_and_no_others() {
    let dir = tempfile::tempdir().unwrap();
    let asset = contraption();
    let files = export_simready(dir.path(), &asset, &provenance()).unwrap();
    let friction = |engine: &str, joint: &StagePrim| match engine {
        "PhysX" => f64::from(get::<f32>(joint, "physxJointAxis:angular:staticFrictionEffort")),
        "Newton" => f64::from(get::<f32>(joint, "newton:friction")),
        _ => get::<f64>(joint, "mjc:frictionloss"),
    };
    for (engine, word) in [("PhysX", "Physx"), ("Newton", "Newton"), ("MuJoCo", "Mjc")] {
        let stage = open(&files[0], &[(engine, "Enabled")]);
        let own = [("Physx", "Physx"), ("Newton", "Newton"), ("Mjc", "Mjc")].map(|(w, _)| w);
        for prim in prims(&stage) {
            for schema in schemas(&prim) {
                assert!(own.iter().all(|w| *w == word || !schema.starts_with(w)), "{engine}: {} {schema}", prim.path());
            }
        }
        let hinge = prim(&stage, "/contraption/Joints/part_1_joint");
        assert_eq!(kind(&hinge), "PhysicsRevoluteJoint");
        assert!((friction(engine, &hinge) - 0.1).abs() < 1e-6);
        let hull = schemas(&prim(&stage, "/contraption/part_1/collision_0"));
        assert!(hull.contains(&"PhysicsCollisionAPI".to_owned()));
        assert_eq!(hull.iter().any(|s| s.starts_with(word)), engine != "PhysX", "{hull:?}");
    }
}

#[test]
fn gaussians_replace_meshes_where_there_are_some() {
    let dir = tempfile::tempdir().unwrap();
    let mut asset = cabinet();
    asset.links[2].splats = None;
    let files = export_simready(dir.path(), &asset, &provenance()).unwrap();
    let drawn = |option: &str| {
        let stage = open(&files[0], &[("Representation", option)]);
        let shown = prims(&stage).into_iter().filter(|p| {
            let path = p.path().to_string();
            path.ends_with("/visual") || path.ends_with("/splats")
        });
        let kinds: Vec<String> = shown.map(|p| kind(&p)).collect();
        let textures = prims(&stage).iter().filter(|p| p.path().to_string().ends_with("/texture")).count();
        (kinds, textures)
    };
    assert_eq!(drawn("Mesh"), (vec!["Mesh".into(); 3], 3));
    let gaussians = "ParticleField3DGaussianSplat".to_owned();
    assert_eq!(drawn("GaussianSplat"), (vec![gaussians.clone(), gaussians, "Mesh".into()], 1));
    let stage = open(&files[0], &[]);
    let file: sdf::AssetPath = get(&prim(&stage, "/cabinet/Looks/part_1/texture"), "inputs:file");
    assert_eq!(file.as_str(), "../textures/part_1.png");
    let color: Vec<gf::Vec3f> = get(&prim(&stage, "/cabinet/part_1/visual"), "primvars:displayColor");
    assert_eq!(color.len(), 1);
}
