//! Checks of a small cabinet, with valid and damaged exports.

#![allow(missing_docs, clippy::unwrap_used)]

use artgs_check::{CheckError, CheckOptions, CheckReport, FormatFinding, Verdict, check};
use artgs_core::{
    Asset, AssetJoint, AssetLink, Inertial, Joint, JointKind, Mesh, PerState, Replica, Splats, State, Texture,
    TexturedMesh,
};
use artgs_io::RunFolder;
use artgs_io::asset::{Format, WriteOptions, export_mjcf, export_partnet, export_sdf, export_urdf, glb, splats, usd};
use artgs_io::export_report::ExportReport;
use glam::DVec3;
use std::path::Path;
use tempfile::TempDir;

/// A link of boxes with a mass of 2 kg and the inertia of one box around them.
fn link(name: &str, parent: Option<usize>, origin: DVec3, boxes: &[Mesh], joint: Option<AssetJoint>) -> AssetLink {
    let mut mesh = Mesh::default();
    boxes.iter().for_each(|b| mesh.append(b));
    let points = || mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from)));
    let (low, high) = points().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
    let s = (high - low) * (high - low) / 6.0;
    let inertial =
        Inertial { mass: 2.0, center: (low + high) / 2.0, inertia: [s.y + s.z, s.x + s.z, s.x + s.y, 0.0, 0.0, 0.0] };
    let n = mesh.vertices.len();
    let visual = TexturedMesh {
        uvs: vec![[0.5, 0.5]; n],
        normals: vec![[0.0, 0.0, 1.0]; n],
        texture: Some(Texture { width: 2, height: 2, rgb: vec![[200, 100, 50]; 4] }),
        evidence: Vec::new(),
        mesh,
    };
    let splats = Splats {
        means: vec![[0.1, 0.2, 0.3]; 2],
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; 2],
        log_scales: vec![[-4.0; 3]; 2],
        logit_opacities: vec![1.0; 2],
        sh_degree: 0,
        sh: vec![0.1; 6],
    };
    let (name, splats) = (name.to_string(), Some(splats));
    AssetLink {
        name,
        parent,
        joint,
        origin,
        visual,
        collision: boxes.to_vec(),
        inertial,
        splats,
        ..AssetLink::default()
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

/// A cabinet away from the origin with a door above, a drawer below and a flap with a horizontal hinge on the door.
fn cabinet() -> Asset {
    let walls = [
        Mesh::cuboid([-0.5, -0.25, 0.0], [-0.48, 0.25, 1.0]),
        Mesh::cuboid([0.48, -0.25, 0.0], [0.5, 0.25, 1.0]),
        Mesh::cuboid([-0.48, -0.25, 0.0], [0.48, 0.25, 0.02]),
        Mesh::cuboid([-0.48, -0.25, 0.98], [0.48, 0.25, 1.0]),
        Mesh::cuboid([-0.48, 0.23, 0.02], [0.48, 0.25, 0.98]),
    ];
    let at = DVec3::new(0.3, 0.2, 0.05);
    let door = [Mesh::cuboid([0.0, -0.02, -0.25], [1.0, 0.0, 0.25])];
    let drawer =
        [Mesh::cuboid([-0.47, -0.02, -0.2], [0.47, 0.0, 0.2]), Mesh::cuboid([-0.45, 0.0, -0.2], [0.45, 0.45, -0.18])];
    let flap = [Mesh::cuboid([-0.1, -0.02, 0.0], [0.1, 0.0, 0.1])];
    let opens = joint(JointKind::Revolute, DVec3::NEG_Z, [0.0, 1.6], [0.0, 1.5]);
    let slides = joint(JointKind::Prismatic, DVec3::NEG_Y, [0.0, 0.42], [0.0, 0.4]);
    let tips = joint(JointKind::Revolute, DVec3::X, [0.0, 1.2], [0.2, 1.0]);
    let links = vec![
        link("base", None, at, &walls, None),
        link("part_1", Some(0), at + DVec3::new(-0.5, -0.26, 0.75), &door, Some(opens)),
        link("part_2", Some(0), at + DVec3::new(0.0, -0.26, 0.25), &drawer, Some(slides)),
        link("flap", Some(1), at + DVec3::new(0.0, -0.285, 0.75), &flap, Some(tips)),
    ];
    Asset { name: "cabinet".into(), links, ..Asset::default() }
}

/// A replica that corresponds to the asset.
fn write_replica(out: &Path, asset: &Asset) {
    let joints: Vec<Joint> = asset
        .movable()
        .map(|(_, link, j)| Joint {
            kind: j.kind,
            axis: j.axis,
            origin: link.origin,
            pitch: j.pitch,
            state_values: j.observed,
            limits: j.limits,
        })
        .collect();
    let replica = Replica::new(&joints);
    artgs_io::write_replica(out, &replica).unwrap();
    let meshes = replica.parts.iter().map(|p| &p.meshes).chain([&replica.whole]);
    for mesh in meshes.flat_map(|m| m.iter()) {
        artgs_io::write_atomic(&out.join(mesh), b"").unwrap();
    }
}

fn folder(asset: &Asset) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    write_replica(dir.path(), asset);
    dir
}

/// Exports only URDF.
fn driven(asset: &Asset) -> CheckReport {
    let dir = folder(asset);
    export_urdf(&dir.path().join("exports/urdf"), asset).unwrap();
    check(dir.path(), &CheckOptions::default()).unwrap()
}

fn all_formats(asset: &Asset) -> TempDir {
    let dir = folder(asset);
    let exports = dir.path().join("exports");
    export_urdf(&exports.join("urdf"), asset).unwrap();
    export_mjcf(&exports.join("mjcf"), asset).unwrap();
    export_sdf(&exports.join("sdf"), asset).unwrap();
    export_partnet(&exports.join("partnet"), asset).unwrap();
    usd::export_usd(&exports.join("usd"), asset).unwrap();
    usd::export_usdz(&exports.join("usdz"), asset).unwrap();
    glb::export_glb(&exports.join("glb"), asset).unwrap();
    splats::export_splats(&exports.join("splats"), asset, artgs_io::asset::SpzVersion::default()).unwrap();
    dir
}

fn of<'a>(report: &'a CheckReport, format: &str) -> &'a FormatFinding {
    report.formats.iter().find(|f| f.format == format || f.file.ends_with(format)).unwrap()
}

fn has_problem(problems: &[String], words: &str) {
    assert!(problems.iter().any(|p| p.contains(words)), "{words:?} is not in {problems:#?}");
}

#[test]
fn a_sound_cabinet_passes_in_every_format() {
    let dir = all_formats(&cabinet());
    let report = check(dir.path(), &CheckOptions::default()).unwrap();
    let text = report.to_string();
    assert!(report.passed(), "{text}");
    let formats: Vec<&str> = report.formats.iter().map(|f| f.format.as_str()).collect();
    let splats = ["ply", "ply", "ply", "ply", "spz", "spz", "spz", "spz"];
    let scenes = ["urdf", "mjcf", "usda", "usdc", "usdc", "usdz", "glb", "glb", "sdf", "partnet"];
    assert_eq!(formats, [scenes.as_slice(), &splats].concat());
    for format in ["urdf", "mjcf", "usda", "usdc", "usdz", "sdf", "partnet"] {
        let found = of(&report, format);
        let counts = (found.links, found.joints, found.meshes, found.hulls, found.textures);
        assert_eq!(counts, (4, 3, 4, 9, 4), "{format}: {text}");
    }
    assert_eq!((of(&report, "glb").meshes, of(&report, "glb").textures, report.formats[7].splats), (4, 4, 8));
    assert_eq!(report.formats[4].splats, 8, "{text}");
    for (found, upper) in report.joints.iter().zip([1.6, 0.42, 1.2]) {
        assert_eq!((found.reached, found.blocked_by.clone()), ([true; 2], [None, None]), "{text}");
        assert!((found.stopped[1].unwrap() - upper).abs() < 2e-3 && found.force < 50.0 && found.force > 0.1, "{text}");
        assert!(found.drift.iter().all(|d| d.is_some_and(|d| d < 2e-3)), "{text}");
    }
    assert_eq!(report.joints[1].observed, Some(PerState::new(0.0, 0.4)));
    assert_eq!(report.states.len(), 2);
    assert!(
        text.contains("part_1_joint") && text.contains("0.0 deg to 91.7 deg") && text.contains("420.0 mm"),
        "{text}"
    );
    assert!(text.ends_with("\nall checks passed\n"), "{text}");
    assert_eq!(report, check(dir.path(), &CheckOptions::default()).unwrap(), "twice the same");
    assert!(serde_json::to_string(&report).unwrap().contains("\"blocked_by\":[null,null]"));
}

/// URDF and SimReady.
fn with_simready(asset: &Asset) -> (TempDir, std::path::PathBuf) {
    let dir = folder(asset);
    let exports = dir.path().join("exports");
    export_urdf(&exports.join("urdf"), asset).unwrap();
    Format::Simready.write(&exports.join("simready"), asset, &WriteOptions::default()).unwrap();
    let files = exports.join("simready/cabinet/simready_usd");
    (dir, files)
}

#[test]
fn simready_is_read_with_its_engines_and_its_rules_are_in_the_report() {
    let (dir, files) = with_simready(&Asset { front: Some(DVec3::NEG_Y), ..cabinet() });
    let report = check(dir.path(), &CheckOptions::default()).unwrap();
    let found = of(&report, "simready");
    assert!(found.problems.is_empty(), "{found:?}");
    let counts = (found.links, found.joints, found.meshes, found.hulls, found.textures, found.splats);
    assert_eq!(counts, (4, 3, 4, 9, 4, 8));
    let rules = report.rules();
    let verdict = |id: &str| rules.iter().find(|rule| rule.id == id).unwrap_or_else(|| panic!("no {id}")).verdict;
    for id in ["NP.005", "SR.004", "SL.001", "PMT.001", "AF.001", "RV.006", "RV.011", "joint.upper", "hulls.hole"] {
        assert_eq!(verdict(id), Verdict::Passed, "{id}");
    }
    // No handle was found, and the options have no picture.
    assert_eq!((verdict("GSP.001"), verdict("SR.002")), (Verdict::Skipped, Verdict::Warning));
    assert!(report.passed(), "{report}");
    let page = report.page("cabinet");
    assert_eq!(page.matches("<tr class=").count(), rules.len());
    roxmltree::Document::parse_with_options(
        &page,
        roxmltree::ParsingOptions { allow_dtd: true, ..roxmltree::ParsingOptions::default() },
    )
    .unwrap();

    let edit = |file: &str, from: &str, to: &str, words: &str| {
        let path = files.join(file);
        let whole = std::fs::read_to_string(&path).unwrap();
        assert!(whole.contains(from), "{from}");
        std::fs::write(&path, whole.replacen(from, to, 1)).unwrap();
        let report = check(dir.path(), &CheckOptions::default()).unwrap();
        has_problem(&of(&report, "simready").problems, words);
        let failed = report.rules().into_iter().filter(|rule| rule.verdict == Verdict::Failed).count();
        assert_eq!(failed, 1, "{words}");
        std::fs::write(&path, whole).unwrap();
    };
    edit(
        "runnables/physics/newton.usda",
        "newton:friction = 0.1",
        "newton:friction = 0.2",
        "Newton has another friction",
    );
    edit("runnables/physics/mujoco.usda", "mjc:frictionloss = 0.1", "mjc:other = 0.1", "MuJoCo has no friction");
    edit("runnables/physics/physx.usda", "\"PhysxJointAxisAPI", "\"NewtonJointAPI\", \"PhysxJointAxisAPI", "RV.003");
    edit("cabinet.usda", "int rigid_body_count = 4", "int rigid_body_count = 5", "SR.004: rigid_body_count is not 4");
    edit("cabinet.usda", "(0.0, -1.0, 0.0)", "(0.0, -2.0, 0.0)", "AF.001");
    std::fs::copy(files.join("cabinet.usda"), files.join("other.usda")).unwrap();
    let report = check(dir.path(), &CheckOptions::default()).unwrap();
    has_problem(&of(&report, "simready").problems, "NP.005: 2 stages");
}

#[test]
fn a_screw_and_links_without_texture_pass_too() {
    let mut asset = cabinet();
    asset.links.iter_mut().for_each(|l| (l.visual.texture, l.visual.uvs) = (None, vec![]));
    let knob = asset.links[3].joint.as_mut().unwrap();
    (knob.kind, knob.pitch) = (JointKind::Screw, -0.002);
    let report = check(all_formats(&asset).path(), &CheckOptions::default()).unwrap();
    assert!(report.passed(), "{report}");
    assert!(report.notes.iter().any(|n| n.contains("screws were driven as hinges")), "{report}");
}

#[test]
fn a_drawer_whose_hull_overlaps_its_cabinet_is_reported() {
    let mut asset = cabinet();
    // Two centimetres into the right wall, all the way.
    asset.links[2].collision[0] = Mesh::cuboid([-0.47, 0.0, -0.2], [0.5, 0.02, 0.2]);
    asset.links[2].collision[1] = Mesh::cuboid([-0.45, 0.02, -0.2], [0.5, 0.45, -0.18]);
    let report = driven(&asset);
    let drawer = &report.joints[1];
    assert!(drawer.penetration > 0.015 && drawer.penetration < 0.025, "{report}");
    assert_eq!(drawer.penetration_between, Some(["base".to_string(), "part_2".to_string()]));
    // Its front would have to be a centimetre inside the wall; the side cannot push it out along the slide.
    assert_eq!((drawer.reached, drawer.blocked_by[0].as_deref()), ([false, true], Some("base")), "{report}");
    assert!((drawer.stopped[0].unwrap() - 0.009).abs() < 1e-3, "{report}");
    has_problem(&drawer.problems, "`base` and `part_2` penetrate each other by 20.0 mm");
    assert!(report.joints[0].problems.is_empty() && !report.passed(), "{report}");
}

#[test]
fn overlaps_below_a_millimetre_do_not_jam() {
    let mut asset = cabinet();
    asset.links[2].collision[1] = Mesh::cuboid([-0.45, 0.0, -0.2], [0.4805, 0.45, -0.18]);
    let report = driven(&asset);
    assert!(report.passed(), "{report}");
    assert!((report.joints[1].penetration - 5e-4).abs() < 1e-4, "{report}");
}

#[test]
fn limits_beyond_an_obstacle_are_blocked_by_its_name() {
    let mut asset = cabinet();
    // The back wall is 49 cm behind the joint, the drawer 45 cm deep.
    asset.links[2].joint.as_mut().unwrap().limits[0] = -0.2;
    // A bar on the door, 10 cm in front of the drawer.
    asset.links[1].collision.push(Mesh::cuboid([0.3, -0.14, -0.6], [0.7, -0.12, -0.25]));
    let report = driven(&asset);
    let drawer = &report.joints[1];
    assert_eq!(drawer.reached, [false, false], "{report}");
    assert_eq!(drawer.blocked_by, [Some("base".to_string()), Some("part_1".to_string())], "{report}");
    assert!((drawer.stopped[0].unwrap() + 0.04).abs() < 5e-3, "{report}");
    assert!((drawer.stopped[1].unwrap() - 0.1).abs() < 5e-3, "{report}");
    has_problem(&drawer.problems, "on the way to its upper limit 420.0 mm: `part_1` blocks it");
    has_problem(&drawer.problems, "on the way to its lower limit -200.0 mm: `base` blocks it");
    assert!(drawer.penetration > 0.01, "{report}");
}

#[test]
fn what_is_thinner_than_the_way_between_two_poses_is_found() {
    let mut asset = cabinet();
    // A fin that touches a bar between 199.3 and 202.9 mm; poses are at 199.0 and 203.4 mm.
    asset.links[2].collision.push(Mesh::cuboid([-0.1, 0.4482, -0.18], [0.1, 0.45, -0.1]));
    asset.links[0].collision.push(Mesh::cuboid([-0.1, -0.0129, 0.08], [0.1, -0.0111, 0.14]));
    let report = driven(&asset);
    let drawer = &report.joints[1];
    assert_eq!((drawer.reached, drawer.blocked_by[1].as_deref()), ([true, false], Some("base")), "{report}");
    assert!(
        (drawer.stopped[1].unwrap() - 0.2).abs() < 1e-3 && (drawer.penetration_at - 0.201).abs() < 1e-3,
        "{report}"
    );
    assert!(drawer.penetration > 1.5e-3 && drawer.penetration < 1.9e-3, "{report}");
}

#[test]
fn a_joint_too_weak_for_its_weight_is_reported() {
    let mut asset = cabinet();
    asset.links[3].joint.as_mut().unwrap().effort = 0.2;
    let report = driven(&asset);
    let flap = &report.joints[2];
    // Gravity moves it to one limit, and the force cannot move it back.
    assert_eq!((flap.reached, flap.blocked_by.clone()), ([false, true], [None, None]), "{report}");
    has_problem(&flap.problems, "0.200 N m do not move it");
}

#[test]
fn what_was_observed_must_be_within_reach() {
    let dir = all_formats(&cabinet());
    let path = dir.path().join("exports/mjcf/cabinet.xml");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("<key name=\"end\" qpos=\"1.5 1 0.4\"/>"), "{text}");
    std::fs::write(&path, text.replace("qpos=\"1.5 1 0.4\"", "qpos=\"1.5 1 0.5\"")).unwrap();
    let report = check(dir.path(), &CheckOptions::default()).unwrap();
    has_problem(&report.joints[1].problems, "was observed at 500.0 mm (end), which is not reachable");
    has_problem(&of(&report, "usda").problems, "link `part_2`: value observed at the end is 0.4, in the urdf 0.5");
}

/// Changes a file of a valid export and returns the report.
fn damaged(file: &str, changed: impl FnOnce(&Path)) -> CheckReport {
    let dir = all_formats(&cabinet());
    let path = dir.path().join("exports").join(file);
    assert!(path.is_file(), "{file}");
    changed(&path);
    check(dir.path(), &CheckOptions::default()).unwrap()
}

fn replaced(file: &str, from: &str, to: &str) -> CheckReport {
    damaged(file, |path| {
        let text = std::fs::read_to_string(path).unwrap();
        assert!(text.contains(from), "{from} is not in {text}");
        std::fs::write(path, text.replacen(from, to, 1)).unwrap();
    })
}

fn removed(path: &Path) {
    std::fs::remove_file(path).unwrap();
}

fn halved(path: &Path) {
    let bytes = std::fs::read(path).unwrap();
    std::fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
}

/// Asserts that this format fails and no other.
fn only(report: &CheckReport, format: &str, words: &str) {
    has_problem(&of(report, format).problems, words);
    let others = report
        .formats
        .iter()
        .filter(|f| f.format != format && !f.file.ends_with(format) && !f.problems.is_empty())
        .count();
    assert_eq!(others, 0, "{report}");
    assert!(!report.passed());
}

#[test]
fn files_that_are_missing_or_broken_are_named() {
    let report = damaged("urdf/meshes/part_1_collision_0.obj", removed);
    only(&report, "urdf", "meshes/part_1_collision_0.obj: the file does not exist");
    only(&damaged("mjcf/assets/part_1_visual.png", removed), "mjcf", "texture part_1_visual.png");
    only(
        &damaged("sdf/meshes/part_2_visual.png", halved),
        "sdf",
        "meshes/part_2_visual.obj: texture part_2_visual.png",
    );
    only(&damaged("partnet/semantics.txt", removed), "partnet", "semantics.txt");
    only(&damaged("glb/cabinet.glb", halved), "glb", "does not open");
    only(&damaged("glb/cabinet_splats.glb", halved), "_splats.glb", "does not open");
    only(&damaged("usd/cabinet.usda", halved), "usda", "does not open");
    only(&damaged("usdz/cabinet.usdz", halved), "usdz", "does not open");
    only(&damaged("splats/flap.spz", halved), "flap.spz", "does not open");
    only(&damaged("splats/flap.ply", halved), "flap.ply", "does not open");
    let broken = replaced("sdf/meshes/part_2_collision_1.obj", "f 1 ", "f 99 ");
    only(&broken, "sdf", "meshes/part_2_collision_1.obj");
    only(&replaced("urdf/meshes/base_visual.obj", "v -0.5", "v NaN"), "urdf", "vertex 0 is not finite");
}

/// The cabinet with all lengths multiplied.
fn scaled(factor: f64) -> Asset {
    let mut asset = cabinet();
    let mesh = |m: &mut Mesh| m.vertices.iter_mut().flatten().for_each(|v| *v *= factor as f32);
    for link in &mut asset.links {
        link.origin *= factor;
        mesh(&mut link.visual.mesh);
        link.collision.iter_mut().for_each(mesh);
        link.inertial.center *= factor;
        link.inertial.inertia.iter_mut().for_each(|i| *i *= factor * factor);
        if let Some(joint) = link.joint.as_mut().filter(|j| j.kind == JointKind::Prismatic) {
            joint.limits = joint.limits.map(|v| v * factor);
            joint.observed = joint.observed.map(|v| v * factor);
        }
    }
    asset
}

#[test]
fn an_object_of_a_size_that_cannot_be_simulated_is_one_problem_and_not_driven() {
    for (factor, words) in [(1e-7, "nanometres"), (1e-4, "micrometres"), (1e5, "kilometres")] {
        let report = driven(&scaled(factor));
        has_problem(&of(&report, "urdf").problems, words);
        assert!(!report.passed() && report.joints.is_empty() && report.links.is_empty(), "{report}");
        assert!(report.notes.iter().any(|n| n.contains("no joint was driven")), "{report}");
        assert_eq!(report.failures, 1, "{report}");
    }
}

#[test]
fn a_mesh_that_is_cut_anywhere_is_a_finding() {
    let dir = folder(&cabinet());
    let urdf = dir.path().join("exports/urdf");
    export_urdf(&urdf, &cabinet()).unwrap();
    for name in ["part_1_visual.obj", "part_1_visual.mtl", "part_1_collision_0.obj"] {
        let path = urdf.join("meshes").join(name);
        let whole = std::fs::read(&path).unwrap();
        let run = RunFolder::new(dir.path());
        let mut report = ExportReport { files: vec![path.clone()], ..ExportReport::default() };
        report.record_digests(&run, &[Format::Urdf]).unwrap();
        report.save(&run).unwrap();
        for cut in (0..whole.len()).step_by(whole.len() / 12 + 1) {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let report = check(dir.path(), &quick()).unwrap();
            let problems = &report.files.as_ref().unwrap().problems;
            assert_eq!(problems.len(), 1, "{report}");
            has_problem(problems, &format!("meshes/{name} was altered: {cut} bytes"));
        }
        std::fs::remove_file(&path).unwrap();
        let report = check(dir.path(), &quick()).unwrap();
        has_problem(&report.files.as_ref().unwrap().problems, &format!("meshes/{name} is missing; export again"));
        has_problem(&of(&report, "urdf").problems, name.split('.').next().unwrap());
        std::fs::write(&path, &whole).unwrap();
        assert!(check(dir.path(), &quick()).unwrap().files.unwrap().problems.is_empty());
    }
}

/// As few steps of the engine as possible.
fn quick() -> CheckOptions {
    CheckOptions { poses: 2, travel: 0.05, hold: 0.01, ..CheckOptions::default() }
}

#[test]
fn altered_and_missing_files_of_every_format_are_found() {
    let dir = all_formats(&cabinet());
    let run = RunFolder::new(dir.path());
    let report = check(dir.path(), &quick()).unwrap();
    assert!(report.files.is_none() && report.notes.iter().any(|n| n.contains("no digests")), "{report}");
    let names = ["glb/cabinet.glb", "usd/cabinet.usda", "splats/flap.ply", "urdf/meshes/base_visual.png"];
    let path = |name: &str| run.exports().join(name);
    let mut written = ExportReport { files: names.iter().map(|n| path(n)).collect(), ..ExportReport::default() };
    written.record_digests(&run, &Format::ALL).unwrap();
    written.save(&run).unwrap();
    let report = check(dir.path(), &quick()).unwrap();
    assert_eq!((report.files.as_ref().unwrap().written, report.failures), (4, 0), "{report}");
    assert!(report.to_string().contains("exports/export.json"), "{report}");
    for name in names {
        let whole = std::fs::read(path(name)).unwrap();
        let mut changed = whole.clone();
        // Such a change opens in most formats.
        *changed.last_mut().unwrap() ^= 1;
        std::fs::write(path(name), changed).unwrap();
        let report = check(dir.path(), &quick()).unwrap();
        has_problem(&report.files.as_ref().unwrap().problems, &format!("{name} was altered"));
        assert!(!report.passed());
        std::fs::remove_file(path(name)).unwrap();
        let report = check(dir.path(), &quick()).unwrap();
        has_problem(&report.files.as_ref().unwrap().problems, &format!("{name} is missing"));
        std::fs::write(path(name), whole).unwrap();
    }
    artgs_io::write_atomic(&dir.path().join("meshes/start/part_1.ply"), b"another").unwrap();
    let report = check(dir.path(), &quick()).unwrap();
    has_problem(&report.files.unwrap().problems, "the replica has changed since it was exported");
}

#[test]
fn formats_that_disagree_are_reported() {
    let report = replaced("mjcf/cabinet.xml", "range=\"0 1.6\"", "range=\"0 1.5\"");
    only(&report, "mjcf", "link `part_1`: upper limit is 1.5, in the urdf 1.6");
    let report = replaced("sdf/model.sdf", "<mass>2</mass>", "<mass>3</mass>");
    only(&report, "sdf", "link `base`: mass is 3, in the urdf 2");
    let report = replaced("partnet/mobility.urdf", "axis xyz=\"0 -1 0\"", "axis xyz=\"0 1 0\"");
    only(&report, "partnet", "link `part_1`: axis is [0, 0, 1], in the urdf [0, 0, -1]");
    let report = replaced("sdf/model.sdf", "<xyz>0 -1 0</xyz>", "<xyz>0 0 0</xyz>");
    only(&report, "sdf", "axis of the joint has length 0");
    let report = replaced("usd/cabinet.usda", "physics:mass = 2.0", "physics:mass = 2.5");
    only(&report, "usda", "mass is 2.5, in the urdf 2");
    let report = replaced("urdf/cabinet.urdf", "mass value=\"2\"", "mass value=\"NaN\"");
    has_problem(&of(&report, "urdf").problems, "link `base`: mass is NaN");
    assert!(report.joints.is_empty() && report.to_string().contains("no joint was driven"), "{report}");
}

#[test]
fn bodies_that_make_no_sense_are_reported() {
    let report = damaged("urdf/meshes/flap_collision_0.obj", |path| {
        std::fs::write(path, "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n").unwrap();
    });
    has_problem(&report.links[3].problems, "hull 0 is flat or invalid");
    has_problem(&of(&report, "mjcf").problems, "link `flap`: upper corner of the hulls is");
    let report = replaced("urdf/cabinet.urdf", "izz=\"", "izz=\"1");
    has_problem(&report.links[0].problems, "no body has that");
}

#[test]
fn what_cannot_be_checked_is_refused_with_the_reason() {
    let refused = |dir: &TempDir| check(dir.path(), &CheckOptions::default()).unwrap_err();
    let asset = cabinet();
    let dir = folder(&asset);
    let error = refused(&dir);
    assert!(matches!(error, CheckError::NoExports { .. }) && error.to_string().contains("artgs export"), "{error}");
    let replica_with = |from: &str, to: &str| {
        let dir = all_formats(&asset);
        let path = dir.path().join("replica.json");
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{from} is not in {text}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        dir
    };
    assert!(refused(&replica_with("\"version\": 1", "\"version\": 7")).to_string().contains("version"));
    let dir = all_formats(&asset);
    std::fs::remove_file(dir.path().join("meshes/start/part_1.ply")).unwrap();
    assert!(refused(&dir).to_string().contains("there is no mesh meshes/start/part_1.ply"));
}

#[test]
fn exports_of_another_replica_are_reported() {
    let dir = all_formats(&cabinet());
    let mut other = cabinet();
    other.links[1].joint.as_mut().unwrap().observed[State::END] = 1.2;
    write_replica(dir.path(), &other);
    let report = check(dir.path(), &CheckOptions::default()).unwrap();
    has_problem(&of(&report, "glb").problems, "hinges turned by [45.8, 85.9] deg, in the replica by [45.8, 68.8] deg");
    other.links.pop();
    write_replica(dir.path(), &other);
    let report = check(dir.path(), &CheckOptions::default()).unwrap();
    has_problem(&of(&report, "mjcf").problems, "4 links, but the replica has 3 parts");
}

#[test]
fn without_a_urdf_nothing_is_driven_and_without_observations_that_is_said() {
    let asset = cabinet();
    let dir = folder(&asset);
    glb::export_glb(&dir.path().join("exports/glb"), &asset).unwrap();
    let report = check(dir.path(), &CheckOptions::default()).unwrap();
    assert!(report.passed() && report.joints.is_empty(), "{report}");
    assert!(report.to_string().contains("note: no readable URDF"), "{report}");
    assert!(report.to_string().ends_with("all checks that ran passed; no joint was driven\n"), "{report}");
    let report = driven(&asset);
    assert!(report.passed() && report.notes.iter().any(|n| n.contains("observed values")), "{report}");
    std::fs::create_dir_all(dir.path().join("exports/urdf")).unwrap();
    let report = check(dir.path(), &CheckOptions::default()).unwrap();
    has_problem(&of(&report, "urdf").problems, "the folder has no .urdf file");
}

#[test]
fn balls_fall_through_a_drawer_without_a_floor_and_do_not_fit_into_a_filled_one() {
    let drawer = |report: &CheckReport| report.drops.iter().find(|d| d.link == "part_2").unwrap().clone();
    let sound = driven(&cabinet());
    let found = drawer(&sound);
    assert!(found.places >= 1 && found.dropped >= 2 && found.problems.is_empty(), "{sound}");
    assert!(sound.drops.iter().any(|d| d.link == "base" && d.problems.is_empty()), "{sound}");
    let mut asset = cabinet();
    asset.links[2].collision.pop();
    let report = driven(&asset);
    has_problem(&drawer(&report).problems, "fall through");
    assert_eq!(drawer(&report).fell, drawer(&report).dropped, "{report}");
    assert!(!report.passed());
    asset.links[2].collision = vec![Mesh::cuboid([-0.47, -0.02, -0.2], [0.47, 0.45, 0.2])];
    let report = driven(&asset);
    has_problem(&drawer(&report).problems, "start inside a hull where nothing is drawn");
}
