//! The folder of an object of PartNet-Mobility, as SAPIEN, ManiSkill and the vision literature read it: `mobility.urdf`,
//! `textured_objs/`, `semantics.txt`, `mobility_v2.json`, `result.json`, `meta.json` and `bounding_box.json`.
//!
//! Links are `link_0` (the static one), `link_1`, ... below a link `base`; their frames have +Y up, and the joint of
//! `link_0` turns them upright by the angles that all objects of the data set have. So the URDF has the same orientation as
//! the asset, and the JSON files are in the frame of `link_0`, with angles in degrees.
//!
//! Limitations: lengths are metres; the data set scales objects to a sphere. The front of the asset, -Y, is not turned to -X
//! as in the data set. Semantics are the classes of the links; `artgs_name` in `mobility_v2.json` is the name of a
//! link in the other formats. The category is `Unknown`. Handles have no meshes of their own, so tasks that need one
//! (ManiSkill's `OpenCabinetDrawer`) find none. A screw is written as a hinge; the data set
//! has few screws, written as two joints. Observed states and splats are not written.

use super::meshes::{LinkFiles, write_link_meshes};
use super::urdf::{class_word, joint_word};
use super::{check_asset, urdf};
use crate::{FileError, write_atomic};
use artgs_core::{Asset, Inertial, JointKind, Mesh};
use glam::{DMat3, DVec3};
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

/// Roll, pitch and yaw from `base` to `link_0`, those that every object of the data set has.
const UPRIGHT: [f64; 3] = [FRAC_PI_2, 0.0, -FRAC_PI_2];
const FOLDER: &str = "textured_objs";

/// Writes the folder; returns what was written, `mobility.urdf` first.
pub fn export_partnet(dir: &Path, asset: &Asset) -> Result<Vec<PathBuf>, FileError> {
    let path = dir.join("mobility.urdf");
    check_asset(asset).map_err(|reason| FileError::malformed(&path, reason))?;
    let lying = renamed(&turned(asset));
    let (files, meshes) = write_link_meshes(&dir.join(FOLDER), &lying)?;
    let root = urdf::Root { name: "base", xyz: asset.links[0].origin, rpy: UPRIGHT };
    let texts = [
        ("semantics.txt", semantics(asset)),
        ("mobility_v2.json", pretty(&mobility(&lying, asset))),
        ("result.json", pretty(&result(asset, &files))),
        ("bounding_box.json", pretty(&bounding_box(&lying))),
        ("meta.json", pretty(&meta(asset))),
        ("mobility.urdf", urdf::document(&lying, FOLDER, &files, Some(&root))),
    ];
    for (name, text) in &texts {
        write_atomic(&dir.join(name), text.as_bytes())?;
    }
    let others = texts.iter().rev().skip(1).map(|(name, _)| dir.join(name));
    Ok(std::iter::once(path).chain(others).chain(meshes).collect())
}

fn pretty(value: &Value) -> String {
    format!("{value:#}\n")
}

/// From the object's frame (+Z up) to that of `link_0` (+Y up), the inverse of [`UPRIGHT`]: a permutation, so exact.
fn lay(v: DVec3) -> DVec3 {
    DVec3::new(-v.y, v.z, -v.x)
}

fn turned(asset: &Asset) -> Asset {
    let mut asset = asset.clone();
    let points = |vs: &mut Vec<[f32; 3]>| vs.iter_mut().for_each(|v| *v = [-v[1], v[2], -v[0]]);
    for link in &mut asset.links {
        link.origin = lay(link.origin);
        if let Some(joint) = &mut link.joint {
            joint.axis = lay(joint.axis);
        }
        points(&mut link.visual.mesh.vertices);
        points(&mut link.visual.normals);
        link.collision.iter_mut().for_each(|hull| points(&mut hull.vertices));
        let Inertial { center, inertia: [xx, yy, zz, xy, xz, yz], .. } = link.inertial;
        let tensor = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let turn = DMat3::from_cols(lay(DVec3::X), lay(DVec3::Y), lay(DVec3::Z));
        let [x, y, z] = (turn * tensor * turn.transpose()).to_cols_array_2d();
        link.inertial.center = lay(center);
        link.inertial.inertia = [x[0], y[1], z[2], x[1], x[2], y[2]];
        link.splats = None;
        link.handles.clear();
    }
    asset
}

fn renamed(asset: &Asset) -> Asset {
    let links = asset.links.iter().enumerate().map(|(i, link)| {
        let mut link = link.clone();
        link.name = format!("link_{i}");
        link
    });
    Asset { name: asset.name.clone(), links: links.collect(), apart: asset.apart.clone(), front: asset.front }
}

fn semantics(asset: &Asset) -> String {
    let line = |(i, link): (usize, &artgs_core::AssetLink)| {
        format!("link_{i} {} {}\n", joint_word(link.joint.as_ref()), class_word(link))
    };
    asset.links.iter().enumerate().map(line).collect()
}

/// The kinematic tree: axes in the frame of `link_0` at the zero pose, limits in degrees or metres.
fn mobility(lying: &Asset, asset: &Asset) -> Value {
    let nodes = lying.links.iter().zip(&asset.links).enumerate().map(|(i, (link, named))| {
        let data = link.joint.map_or(json!({}), |joint| {
            let origin = link.origin - lying.links[0].origin;
            let [a, b] =
                if joint.kind == JointKind::Prismatic { joint.limits } else { joint.limits.map(f64::to_degrees) };
            json!({
                "axis": { "origin": origin.to_array(), "direction": joint.axis.to_array() },
                "limit": { "a": a, "b": b, "noLimit": false },
            })
        });
        json!({
            "id": i,
            "parent": link.parent.map_or(-1, |p| p as i64),
            "joint": joint_word(link.joint.as_ref()),
            "name": class_word(named),
            "artgs_name": named.name,
            "parts": [{ "id": i + 1, "name": class_word(named), "children": [] }],
            "jointData": data,
        })
    });
    Value::Array(nodes.collect())
}

/// The hierarchy of parts: the object, and below it the links with their meshes.
fn result(asset: &Asset, files: &[LinkFiles]) -> Value {
    let children = asset.links.iter().zip(files).enumerate().map(|(i, (link, files))| {
        let objs: Vec<&str> = files.visual.iter().map(|f| f.trim_end_matches(".obj")).collect();
        json!({ "id": i + 1, "name": class_word(link), "text": link.name, "objs": objs })
    });
    json!([{ "id": 0, "name": asset.name, "text": asset.name, "children": children.collect::<Vec<_>>() }])
}

fn meta(asset: &Asset) -> Value {
    json!({
        "model_id": asset.name,
        "anno_id": asset.name,
        "model_cat": "Unknown",
        "version": "v0",
        "user_id": format!("artgs {}", env!("CARGO_PKG_VERSION")),
    })
}

/// Bounding box of the visual meshes (of the collision meshes if there are none), zero pose, frame of `link_0`.
fn bounding_box(lying: &Asset) -> Value {
    let drawn = lying.links.iter().any(|l| !l.visual.mesh.is_empty());
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for link in &lying.links {
        let visual = drawn.then_some(&link.visual.mesh);
        let hulls = link.collision.iter().filter(|_| !drawn);
        for mesh in visual.into_iter().chain(hulls) {
            for v in used(mesh) {
                let at = v + link.origin - lying.links[0].origin;
                (min, max) = (min.min(at), max.max(at));
            }
        }
    }
    json!({ "min": min.to_array(), "max": max.to_array() })
}

fn used(mesh: &Mesh) -> impl Iterator<Item = DVec3> {
    mesh.triangles.as_flattened().iter().map(|i| DVec3::from_array(mesh.vertices[*i as usize].map(f64::from)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::testing::cabinet;

    fn read(dir: &Path, name: &str) -> Value {
        serde_json::from_slice(&std::fs::read(dir.join(name)).unwrap()).unwrap()
    }

    #[test]
    fn the_urdf_has_the_orientation_of_the_asset() {
        let dir = tempfile::tempdir().unwrap();
        let mut asset = cabinet();
        asset.links[0].origin = DVec3::new(0.1, 0.2, 0.3);
        let written = export_partnet(dir.path(), &asset).unwrap();
        assert!(written.iter().all(|f| f.is_file()) && written[0].ends_with("mobility.urdf"));
        let robot = urdf_rs::read_file(&written[0]).unwrap();
        let names: Vec<&str> = robot.links.iter().map(|l| l.name.as_str()).collect();
        assert_eq!(names, ["base", "link_0", "link_1", "link_2"]);
        let fixed = &robot.joints[0].origin;
        assert_eq!(fixed.xyz.0, [0.1, 0.2, 0.3]);
        // URDF turns about the fixed axes x, y, z in that order.
        let [r, p, y] = fixed.rpy.0;
        let turn = DMat3::from_rotation_z(y) * DMat3::from_rotation_y(p) * DMat3::from_rotation_x(r);
        let stand = |v: [f64; 3]| turn * DVec3::from_array(v);
        let near = |a: DVec3, b: DVec3| (a - b).length() < 1e-12;
        for i in [1, 2] {
            let (link, joint) = (&asset.links[i], &robot.joints[i]);
            assert!(near(stand(joint.axis.xyz.0), link.joint.unwrap().axis), "{:?}", joint.axis);
            assert!(near(stand(joint.origin.xyz.0), link.origin - asset.links[0].origin), "{:?}", joint.origin);
            let inertial = &robot.links[i + 1].inertial;
            assert!(near(stand(inertial.origin.xyz.0), link.inertial.center));
            let t = &inertial.inertia;
            let lying = DMat3::from_cols_array(&[t.ixx, t.ixy, t.ixz, t.ixy, t.iyy, t.iyz, t.ixz, t.iyz, t.izz]);
            let back = (turn * lying * turn.transpose()).to_cols_array();
            let pick = [back[0], back[4], back[8], back[1], back[2], back[5]];
            assert!((0..6).all(|k| (pick[k] - link.inertial.inertia[k]).abs() < 1e-15), "{pick:?}");
        }
        let first = turned(&asset).links[1].visual.mesh.vertices[0].map(f64::from);
        let upright = DVec3::from_array(asset.links[1].visual.mesh.vertices[0].map(f64::from));
        assert!(near(stand(first), upright));
    }

    #[test]
    fn the_other_files_of_the_folder() {
        let dir = tempfile::tempdir().unwrap();
        export_partnet(dir.path(), &cabinet()).unwrap();
        let semantics = std::fs::read_to_string(dir.path().join("semantics.txt")).unwrap();
        assert_eq!(semantics, "link_0 heavy body\nlink_1 hinge door\nlink_2 slider drawer\n");
        let tree = read(dir.path(), "mobility_v2.json");
        assert_eq!(
            (&tree[0]["parent"], &tree[0]["joint"], &tree[1]["parent"]),
            (&json!(-1), &json!("heavy"), &json!(0))
        );
        assert_eq!((&tree[1]["name"], &tree[1]["artgs_name"]), (&json!("door"), &json!("part_1")));
        let door = &tree[1]["jointData"];
        assert_eq!(door["axis"], json!({ "origin": [0.26, 0.75, 0.5], "direction": [0.0, -1.0, 0.0] }));
        assert!((door["limit"]["b"].as_f64().unwrap() - 91.673_247_2).abs() < 1e-6);
        assert_eq!(tree[2]["jointData"]["limit"], json!({ "a": 0.0, "b": 0.42, "noLimit": false }));
        let parts = read(dir.path(), "result.json");
        assert_eq!(parts[0]["children"][2]["objs"], json!(["link_2_visual"]));
        assert!(dir.path().join("textured_objs/link_2_visual.obj").is_file());
        let bounds = read(dir.path(), "bounding_box.json");
        // Y is up: from the floor to the top of the cabinet, a metre.
        assert_eq!((&bounds["min"][1], &bounds["max"][1]), (&json!(0.0), &json!(1.0)));
        assert!((bounds["max"][0].as_f64().unwrap() - 0.28).abs() < 1e-6);
        assert_eq!(read(dir.path(), "meta.json")["model_cat"], "Unknown");
    }
}
