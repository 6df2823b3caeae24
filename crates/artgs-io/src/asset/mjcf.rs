//! MJCF, MuJoCo's own format: `NAME.xml` and `assets/`.
//!
//! The base is a body without joint, so it is fixed to the world, unless a free base is asked for. Each joint has sensors of
//! its position and velocity. Handles are sites: their Z axis is the direction of approach, fingers close along Y, sizes are
//! half of those of the handle. A screw is a hinge and a slide along it, coupled by an
//! equality. The observed states are the keyframes `start` and `end`.
//!
//! `scene.xml` includes it, with a floor, light, sky, the camera `front`, and the keyframes `closed` and `open`: all joints at their lower and
//! upper limits. `env.py` is a Gymnasium environment of the scene, in which a part is to be opened.
//!
//! Geoms have the friction of contacts. MuJoCo has no restitution.
//!
//! Limitations: splats are not written. MJCF has no vertex colours, so a link without texture gets its mean colour. Visual
//! meshes with fewer than four vertices are not written, because MuJoCo refuses them. Contacts between a link and its parent
//! are excluded (MuJoCo does that automatically only if the parent is not fixed to the world), so only the limits stop a link
//! that moves through its parent. There are no actuators unless asked for; `actuatorfrcrange` contains the effort for
//! actuators that users add. A model with a free base has no floor.

use super::check::{check_asset, sound_inertia};
use super::format::{Actuators, WriteOptions};
use super::meshes::{LinkFiles, mean_color, write_link_meshes};
use super::scene::{self, SCENE};
use super::xml::{row, triple};
use crate::{FileError, write_atomic};
use artgs_core::{Asset, AssetJoint, AssetLink, Handle, JointKind, State};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The Gymnasium environment; it reads everything from the scene.
const ENVIRONMENT: &str = include_str!("env.py");

/// MuJoCo refuses meshes with fewer vertices.
const FEWEST_VERTICES: usize = 4;

/// Torsional and rolling friction of contacts, metres: the defaults of MuJoCo.
const TORSION: f64 = 0.005;
const ROLLING: f64 = 0.0001;

/// Seconds per step.
const TIMESTEP: f64 = 0.002;

/// `implicitfast` applies damping at the end of the step, so that it cannot make a light part unstable. Limits are springs;
/// these are as stiff as the step allows and yield by less than a millimetre at rest under the largest effort. The defaults
/// yield by centimetres.
const SETTINGS: &str = "  <default>
    <joint solreflimit=\"0.004 1\" solimplimit=\"0.98 0.999 0.001\"/>
    <equality solref=\"0.004 1\" solimp=\"0.98 0.999 0.001\"/>
    <default class=\"visual\">
      <mesh inertia=\"shell\"/>
      <geom type=\"mesh\" group=\"2\" contype=\"0\" conaffinity=\"0\"/>
    </default>
    <default class=\"collision\">
      <mesh inertia=\"convex\"/>
      <geom type=\"mesh\" group=\"3\" rgba=\"0.6 0.7 0.8 0.5\"/>
    </default>
  </default>
";

/// Writes `DIR/NAME.xml`, `DIR/scene.xml`, `DIR/env.py` and `DIR/assets/`; returns what was written, the XML first.
pub fn export_mjcf(dir: &Path, asset: &Asset) -> Result<Vec<PathBuf>, FileError> {
    export_mjcf_with(dir, asset, &WriteOptions::default())
}

/// The same with options.
pub fn export_mjcf_with(dir: &Path, asset: &Asset, options: &WriteOptions) -> Result<Vec<PathBuf>, FileError> {
    let path = dir.join(format!("{}.xml", asset.name));
    check_asset(asset).map_err(|reason| FileError::malformed(&path, reason))?;
    let (mut files, mut written) = write_link_meshes(&dir.join("assets"), asset)?;
    for (link, files) in asset.links.iter().zip(&mut files) {
        if link.visual.mesh.vertices.len() < FEWEST_VERTICES {
            (files.visual, files.texture) = (None, None);
        }
    }
    write_atomic(&path, document(asset, &files, options).as_bytes())?;
    written.insert(0, path);
    if asset.name != SCENE {
        let path = dir.join(format!("{SCENE}.xml"));
        write_atomic(&path, scene::mjcf(asset, &limit_keys(asset, options.free_base)).as_bytes())?;
        written.push(path);
        if asset.movable().next().is_some() {
            let path = dir.join("env.py");
            write_atomic(&path, ENVIRONMENT.as_bytes())?;
            written.push(path);
        }
    }
    Ok(written)
}

fn document(asset: &Asset, files: &[LinkFiles], options: &WriteOptions) -> String {
    let mut out = format!(
        "<mujoco model=\"{}\">\n  <compiler angle=\"radian\" autolimits=\"true\" meshdir=\"assets\" texturedir=\"assets\"/>\n",
        asset.name
    );
    let _ = writeln!(out, "  <option timestep=\"{TIMESTEP}\" integrator=\"implicitfast\"/>");
    out += SETTINGS;
    write_assets(&mut out, asset, files);
    out += "  <worldbody>\n";
    write_body(&mut out, asset, files, 0, "    ", options.free_base);
    out += "  </worldbody>\n";
    write_pairs(&mut out, asset);
    if let Some(kind) = options.actuators {
        write_actuators(&mut out, asset, kind);
    }
    write_sensors(&mut out, asset);
    write_keyframes(&mut out, asset, options.free_base);
    out + "</mujoco>\n"
}

fn write_assets(out: &mut String, asset: &Asset, files: &[LinkFiles]) {
    *out += "  <asset>\n";
    for (link, files) in asset.links.iter().zip(files) {
        let name = &link.name;
        if let Some(file) = &files.texture {
            let _ = writeln!(out, "    <texture name=\"{name}_texture\" type=\"2d\" file=\"{file}\"/>");
            let _ = writeln!(
                out,
                "    <material name=\"{name}_material\" texture=\"{name}_texture\" specular=\"0\" shininess=\"0\"/>"
            );
        }
        if let Some(file) = &files.visual {
            let _ = writeln!(out, "    <mesh class=\"visual\" name=\"{name}_visual\" file=\"{file}\"/>");
        }
        for (i, file) in files.collision.iter().enumerate() {
            let _ = writeln!(out, "    <mesh class=\"collision\" name=\"{name}_collision_{i}\" file=\"{file}\"/>");
        }
    }
    *out += "  </asset>\n";
}

fn write_body(out: &mut String, asset: &Asset, files: &[LinkFiles], index: usize, indent: &str, free: bool) {
    let link = &asset.links[index];
    let name = &link.name;
    let at = link.origin - link.parent.map_or(glam::DVec3::ZERO, |p| asset.links[p].origin);
    let _ = writeln!(out, "{indent}<body name=\"{name}\" pos=\"{}\">", triple(at));
    let inside = format!("{indent}  ");
    let inertial = &link.inertial;
    let (mass, center, inertia) = (inertial.mass, triple(inertial.center), row(&sound_inertia(inertial.inertia)));
    let _ = writeln!(out, "{inside}<inertial mass=\"{mass}\" pos=\"{center}\" fullinertia=\"{inertia}\"/>");
    if let Some(joint) = &link.joint {
        write_joint(out, name, joint, &inside);
    } else if free {
        let _ = writeln!(out, "{inside}<freejoint name=\"{name}_free\"/>");
    }
    link.handles.iter().for_each(|handle| write_site(out, handle, &inside));
    write_geoms(out, link, &files[index], &inside);
    for (child, _, _) in asset.movable().filter(|(_, l, _)| l.parent == Some(index)) {
        write_body(out, asset, files, child, &inside, free);
    }
    let _ = writeln!(out, "{indent}</body>");
}

fn write_site(out: &mut String, handle: &Handle, indent: &str) {
    let Handle { name, frame, width, length, depth } = handle;
    let [x, y, z, w] = frame.rotation.to_array();
    // MuJoCo refuses boxes without extent.
    let half = row(&[*length, *width, *depth].map(|size| (0.5 * size).max(1e-4)));
    let _ = writeln!(
        out,
        "{indent}<site name=\"{name}\" type=\"box\" group=\"4\" pos=\"{}\" quat=\"{}\" size=\"{half}\" rgba=\"1 0.6 0 0.4\"/>",
        triple(frame.translation),
        row(&[w, x, y, z])
    );
}

fn write_joint(out: &mut String, name: &str, joint: &AssetJoint, indent: &str) {
    let AssetJoint { kind, axis, limits, effort, damping, friction, .. } = *joint;
    let (axis, range) = (triple(axis), row(&limits));
    if kind == JointKind::Screw {
        let _ = writeln!(out, "{indent}<joint name=\"{name}_thread\" type=\"slide\" axis=\"{axis}\"/>");
    }
    let kind = if kind == JointKind::Prismatic { "slide" } else { "hinge" };
    // The inertia that this damping stops within one step. MuJoCo solves limits without damping, so without this armature
    // parts of a few grams oscillate at their limits. It is negligible compared with the inertia of a door.
    let armature = damping * TIMESTEP;
    let _ = writeln!(
        out,
        "{indent}<joint name=\"{name}_joint\" type=\"{kind}\" axis=\"{axis}\" range=\"{range}\" armature=\"{armature}\" \
         damping=\"{damping}\" frictionloss=\"{friction}\" actuatorfrcrange=\"{}\"/>",
        row(&[-effort, effort])
    );
}

fn write_geoms(out: &mut String, link: &AssetLink, files: &LinkFiles, indent: &str) {
    let name = &link.name;
    if files.visual.is_some() {
        let look = match files.texture {
            Some(_) => format!("material=\"{name}_material\""),
            None => format!("rgba=\"{} 1\"", row(&mean_color(&link.visual))),
        };
        let _ = writeln!(out, "{indent}<geom class=\"visual\" name=\"{name}_visual\" mesh=\"{name}_visual\" {look}/>");
    }
    let friction = row(&[link.contact.friction, TORSION, ROLLING]);
    for i in 0..files.collision.len() {
        let mesh = format!("{name}_collision_{i}");
        let _ = writeln!(
            out,
            "{indent}<geom class=\"collision\" name=\"{mesh}\" mesh=\"{mesh}\" friction=\"{friction}\"/>"
        );
    }
}

/// One actuator per joint, within its effort. Position actuators use the whole effort at this share of the range.
fn write_actuators(out: &mut String, asset: &Asset, kind: Actuators) {
    const SHARE: f64 = 0.1;
    *out += "  <actuator>\n";
    for (_, link, joint) in asset.movable() {
        let (name, [lower, upper], effort) = (&link.name, joint.limits, joint.effort);
        let force = row(&[-effort, effort]);
        let _ = match kind {
            Actuators::Motor => {
                writeln!(out, "    <motor name=\"{name}_motor\" joint=\"{name}_joint\" ctrlrange=\"{force}\"/>")
            }
            Actuators::Position => writeln!(
                out,
                "    <position name=\"{name}_position\" joint=\"{name}_joint\" kp=\"{}\" dampratio=\"1\" ctrlrange=\"{}\" \
                 forcerange=\"{force}\"/>",
                effort / (SHARE * (upper - lower)),
                row(&joint.limits)
            ),
        };
    }
    *out += "  </actuator>\n";
}

fn write_sensors(out: &mut String, asset: &Asset) {
    if asset.movable().next().is_none() {
        return;
    }
    *out += "  <sensor>\n";
    for (_, link, _) in asset.movable() {
        for (sensor, what) in [("jointpos", "position"), ("jointvel", "velocity")] {
            let name = &link.name;
            let _ = writeln!(out, "    <{sensor} name=\"{name}_joint_{what}\" joint=\"{name}_joint\"/>");
        }
    }
    *out += "  </sensor>\n";
}

/// Excluded contacts, and the couplings of screws.
fn write_pairs(out: &mut String, asset: &Asset) {
    *out += "  <contact>\n";
    for (_, link, _) in asset.movable() {
        let parent = &asset.links[link.parent.unwrap_or(0)].name;
        let _ = writeln!(out, "    <exclude body1=\"{parent}\" body2=\"{}\"/>", link.name);
    }
    for pair in &asset.apart {
        let [a, b] = pair.map(|link| &asset.links[link].name);
        let _ = writeln!(out, "    <exclude body1=\"{a}\" body2=\"{b}\"/>");
    }
    *out += "  </contact>\n";
    let mut screws = asset.movable().filter(|(_, _, j)| j.kind == JointKind::Screw).peekable();
    if screws.peek().is_none() {
        return;
    }
    *out += "  <equality>\n";
    for (_, link, joint) in screws {
        let (name, pitch) = (&link.name, joint.pitch);
        let _ = writeln!(
            out,
            "    <joint name=\"{name}_pitch\" joint1=\"{name}_thread\" joint2=\"{name}_joint\" polycoef=\"0 {pitch} 0 0 0\"/>"
        );
    }
    *out += "  </equality>\n";
}

fn write_keyframes(out: &mut String, asset: &Asset, free: bool) {
    if asset.movable().next().is_none() {
        return;
    }
    *out += "  <keyframe>\n";
    for state in State::ALL {
        write_key(out, state.name(), asset, free, &asset.observed(state));
    }
    *out += "  </keyframe>\n";
}

/// Keyframes with all joints at their lower and at their upper limits; nothing without joints.
fn limit_keys(asset: &Asset, free: bool) -> String {
    let mut out = String::new();
    if asset.movable().next().is_some() {
        out += "  <keyframe>\n";
        for (end, name) in ["closed", "open"].into_iter().enumerate() {
            let values: Vec<f64> = asset.links.iter().map(|l| l.joint.map_or(0.0, |j| j.limits[end])).collect();
            write_key(&mut out, name, asset, free, &values);
        }
        out += "  </keyframe>\n";
    }
    out
}

/// A keyframe with the joint values of all links.
fn write_key(out: &mut String, name: &str, asset: &Asset, free: bool, values: &[f64]) {
    let mut order = Vec::new();
    depth_first(asset, 0, &mut order);
    let joints = order.iter().filter_map(|i| Some((asset.links[*i].joint?, values[*i])));
    let values = joints.flat_map(|(joint, value)| {
        let thread = (joint.kind == JointKind::Screw).then_some(joint.pitch * value);
        thread.into_iter().chain([value])
    });
    let [x, y, z] = asset.links[0].origin.to_array();
    let base = if free { vec![x, y, z, 1.0, 0.0, 0.0, 0.0] } else { Vec::new() };
    let values: Vec<f64> = base.into_iter().chain(values).collect();
    let _ = writeln!(out, "    <key name=\"{name}\" qpos=\"{}\"/>", row(&values));
}

/// Links in the order in which MuJoCo numbers them and their joints.
fn depth_first(asset: &Asset, index: usize, order: &mut Vec<usize>) {
    order.push(index);
    for (child, _, _) in asset.movable().filter(|(_, l, _)| l.parent == Some(index)) {
        depth_first(asset, child, order);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::testing::cabinet;
    use mjcf_rs::Model;
    use mjcf_rs::body::{Body, InertiaSpec, JointType};

    fn read(asset: &Asset) -> (tempfile::TempDir, Vec<PathBuf>, Model, String) {
        let dir = tempfile::tempdir().unwrap();
        let written = export_mjcf(dir.path(), asset).unwrap();
        let text = std::fs::read_to_string(&written[0]).unwrap();
        let model = Model::from_file(&written[0]).unwrap();
        (dir, written, model, text)
    }

    #[test]
    fn another_reader_reads_bodies_joints_geoms_and_keys() {
        let (dir, written, model, _) = read(&cabinet());
        assert_eq!(written[0], dir.path().join("cabinet.xml"));
        let names: Vec<_> = model.bodies_iter().map(|(_, e)| e.body.name.as_deref().unwrap()).collect();
        assert_eq!(names, ["base", "part_1", "part_2"]);
        let [base, door, drawer] = [1, 2, 3].map(|i| &model.bodies[i].body);
        assert!(base.joints.is_empty() && model.bodies[2].parent == Some(1) && model.bodies[3].parent == Some(1));
        let hinge = &door.joints[0];
        assert_eq!((hinge.type_, hinge.axis, hinge.range), (JointType::Hinge, [0.0, 0.0, -1.0], Some([0.0, 1.6])));
        assert_eq!((hinge.damping, hinge.frictionloss, hinge.armature), (0.2, 0.1, 0.0004));
        assert_eq!((drawer.joints[0].type_, drawer.joints[0].range), (JointType::Slide, Some([0.0, 0.42])));
        let inertial = drawer.inertial.as_ref().unwrap();
        assert_eq!(inertial.mass, 2.0);
        assert!(matches!(inertial.inertia, InertiaSpec::Full([0.1, 0.12, 0.08, 0.001, -0.002, 0.003])));
        let kinds = |b: &Body| b.geoms.iter().map(|g| g.contype).collect::<Vec<_>>();
        assert_eq!((kinds(base), kinds(drawer)), (vec![0, 1, 1, 1, 1, 1], vec![0, 1, 1]));
        let excludes: Vec<[&str; 2]> =
            model.contact.excludes.iter().map(|e| [e.body1.as_str(), e.body2.as_str()]).collect();
        assert_eq!(excludes, [["base", "part_1"], ["base", "part_2"], ["part_1", "part_2"]]);
        assert_eq!(model.keyframes.len(), 2);
        assert_eq!(model.keyframes[1].qpos, [1.5, 0.4]);
    }

    #[test]
    fn every_file_named_exists_and_the_base_is_written_like_this() {
        let mut asset = cabinet();
        asset.links[0].inertial.center = glam::DVec3::new(0.0, 0.046, 0.5);
        let (dir, written, _, text) = read(&asset);
        let tree = roxmltree::Document::parse(&text).unwrap();
        let files: Vec<_> = tree.descendants().filter_map(|n| n.attribute("file")).collect();
        assert_eq!(files.len(), 3 + 3 + 8);
        assert!(files.iter().all(|f| written.contains(&dir.path().join("assets").join(f))), "{files:?}");
        let base = text.split("<worldbody>\n").nth(1).unwrap();
        assert!(
            base.starts_with(
                "    <body name=\"base\" pos=\"0 0 0\">\n      <inertial mass=\"2\" pos=\"0 0.046 0.5\" \
                 fullinertia=\"0.1 0.12 0.08 0.001 -0.002 0.003\"/>\n      <geom class=\"visual\" name=\"base_visual\" \
                 mesh=\"base_visual\" material=\"base_material\"/>\n      <geom class=\"collision\" \
                 name=\"base_collision_0\" mesh=\"base_collision_0\" friction=\"0.6 0.005 0.0001\"/>\n"
            ),
            "{base}"
        );
    }

    #[test]
    fn sites_sensors_actuators_and_a_free_base() {
        let dir = tempfile::tempdir().unwrap();
        let (_dir, _, _, plain) = read(&cabinet());
        assert!(plain.contains("<site name=\"part_1_handle\"") && plain.contains("pos=\"0.9 -0.04 0\""), "{plain}");
        assert!(plain.contains("<jointvel name=\"part_2_joint_velocity\" joint=\"part_2_joint\"/>"));
        assert!(!plain.contains("<actuator>") && !plain.contains("freejoint"));
        for kind in Actuators::ALL {
            let options = WriteOptions { actuators: Some(kind), free_base: true, ..WriteOptions::default() };
            let written = export_mjcf_with(dir.path(), &cabinet(), &options).unwrap();
            let text = std::fs::read_to_string(&written[0]).unwrap();
            let model = Model::from_file(&written[0]).unwrap();
            assert_eq!(text.matches(&format!("<{} name=", kind.name())).count(), 2);
            assert_eq!(model.bodies[1].body.joints[0].type_, JointType::Free);
            assert_eq!(model.keyframes[1].qpos, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.5, 0.4]);
        }
        let text = std::fs::read_to_string(dir.path().join("cabinet.xml")).unwrap();
        // 50 N m at a tenth of 1.6 rad.
        let servo = text.lines().find(|line| line.contains("<position name=\"part_1_position\"")).unwrap();
        let kp: f64 = servo.split("kp=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap().parse().unwrap();
        assert!((kp - 312.5).abs() < 1e-6 && servo.contains("ctrlrange=\"0 1.6\" forcerange=\"-50 50\""), "{servo}");
    }

    #[test]
    fn the_scene_includes_the_model_and_has_keys_at_the_limits() {
        let (dir, written, _, _) = read(&cabinet());
        let path = dir.path().join("scene.xml");
        assert!(written.ends_with(&[path.clone(), dir.path().join("env.py")]), "{written:?}");
        let text = std::fs::read_to_string(&path).unwrap();
        let tree = roxmltree::Document::parse(&text).unwrap();
        let find = |tag: &str, name: &str| {
            tree.descendants().find(|n| n.has_tag_name(tag) && n.attribute("name") == Some(name)).unwrap()
        };
        let included = tree.descendants().find(|n| n.has_tag_name("include")).unwrap().attribute("file").unwrap();
        assert!(dir.path().join(included).is_file());
        assert_eq!(find("key", "closed").attribute("qpos"), Some("0 0"));
        assert_eq!(find("key", "open").attribute("qpos"), Some("1.6 0.42"));
        assert!(find("camera", "front").attribute("xyaxes").is_some() && find("geom", "floor").has_attribute("size"));
        // A model of this name is written, without a scene in its place.
        let asset = Asset { name: "scene".into(), ..cabinet() };
        let (_dir, written, model, _) = read(&asset);
        assert_eq!(written.iter().filter(|p| p.extension().is_some_and(|e| e == "xml")).count(), 1);
        assert_eq!(model.keyframes.len(), 2);
    }

    #[test]
    fn keys_follow_the_tree_and_screws_are_threaded() {
        let mut asset = cabinet();
        // A knob on the door comes before the drawer in MuJoCo, after it in the asset.
        let mut knob = asset.links[1].clone();
        (knob.name, knob.parent, knob.visual) = ("knob".into(), Some(1), Default::default());
        knob.handles.clear();
        let joint = knob.joint.as_mut().unwrap();
        (joint.kind, joint.pitch, joint.observed) = (JointKind::Screw, 0.5, artgs_core::PerState::new(0.0, 1.0));
        asset.links.push(knob);
        asset.links[0].visual.mesh.vertices.truncate(3);
        asset.links[0].visual.mesh.triangles = vec![[0, 1, 2]];
        asset.links[0].visual.normals.truncate(3);
        asset.links[0].visual.mesh.colors.truncate(3);
        (asset.links[0].visual.uvs, asset.links[0].visual.texture) = (vec![], None);
        asset.links[2].visual.texture = None;
        let (_dir, _, model, text) = read(&asset);
        assert_eq!(model.keyframes[1].qpos, [1.5, 0.5, 1.0, 0.4]);
        let knob = &model.bodies[model.body_id_by_name("knob").unwrap()];
        assert_eq!(knob.parent, model.body_id_by_name("part_1"));
        assert_eq!(knob.body.joints.iter().map(|j| j.type_).collect::<Vec<_>>(), [JointType::Slide, JointType::Hinge]);
        assert!(text.contains("joint1=\"knob_thread\" joint2=\"knob_joint\" polycoef=\"0 0.5 0 0 0\""));
        assert!(text.contains("<exclude body1=\"part_1\" body2=\"knob\"/>"));
        assert!(text.contains("mesh=\"part_2_visual\" rgba=\"0.7843 0.3922 0.1961 1\""), "{text}");
        assert!(!text.contains("base_visual"), "three vertices are too few");
    }
}
