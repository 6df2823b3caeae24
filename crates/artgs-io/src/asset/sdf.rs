//! SDFormat 1.10, as Gazebo reads it: `model.sdf`, `model.config` and `meshes/`; `scene.sdf` is a world with the same model, a floor, light
//! and a camera.
//!
//! Poses of joints are relative to the parent link, poses of links to their joint; a fixed joint connects the base to the
//! world. A screw is a `screw` joint. Handles are frames, as in [`artgs_core::Handle`].
//!
//! Limitations: Gazebo computes no contacts between links of a model unless `self_collide` is set. It is not set here,
//! because only some engines then ignore contacts with the parent. Observed states, splats and vertex colours are not
//! written; a link without texture gets its mean colour.

use super::check::{check_asset, sound_inertia};
use super::meshes::{LinkFiles, mean_color, write_link_meshes};
use super::scene::{self, SCENE};
use super::xml::{roll_pitch_yaw, row, triple};
use crate::{FileError, write_atomic};
use artgs_core::{Asset, AssetJoint, AssetLink, ContactMaterial, Handle, Inertial, JointKind};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Writes `DIR/model.sdf`, `DIR/scene.sdf`, `DIR/model.config` and `DIR/meshes/`; returns what was written, `model.sdf` first.
pub fn export_sdf(dir: &Path, asset: &Asset) -> Result<Vec<PathBuf>, FileError> {
    let (path, config) = (dir.join("model.sdf"), dir.join("model.config"));
    check_asset(asset).map_err(|reason| FileError::malformed(&path, reason))?;
    let (files, meshes) = write_link_meshes(&dir.join("meshes"), asset)?;
    let name = &asset.name;
    let about = format!(
        "<?xml version=\"1.0\"?>\n<model>\n  <name>{name}</name>\n  <version>1.0</version>\n\
         \x20 <sdf version=\"1.10\">model.sdf</sdf>\n  <author>\n    <name>artgs {}</name>\n  </author>\n\
         \x20 <description>Replica of an articulated object.</description>\n</model>\n",
        env!("CARGO_PKG_VERSION")
    );
    write_atomic(&config, about.as_bytes())?;
    let model = model(asset, &files);
    write_atomic(&path, format!("<?xml version=\"1.0\"?>\n<sdf version=\"1.10\">\n{model}</sdf>\n").as_bytes())?;
    let world = dir.join(format!("{SCENE}.sdf"));
    write_atomic(&world, scene::sdf(asset, &model).as_bytes())?;
    Ok([path, config, world].into_iter().chain(meshes).collect())
}

/// The element of the model.
fn model(asset: &Asset, files: &[LinkFiles]) -> String {
    let mut out = format!("  <model name=\"{}\">\n", asset.name);
    for (link, files) in asset.links.iter().zip(files) {
        write_link(&mut out, link, files);
        for Handle { name, frame, .. } in &link.handles {
            let (at, turn) = (triple(frame.translation), row(&roll_pitch_yaw(frame.rotation)));
            let carrier = &link.name;
            let _ = writeln!(
                out,
                "    <frame name=\"{name}\" attached_to=\"{carrier}\">\n      <pose>{at} {turn}</pose>\n    </frame>"
            );
        }
    }
    for link in &asset.links {
        match (link.parent, &link.joint) {
            (Some(parent), Some(joint)) => write_joint(&mut out, &asset.links[parent], link, joint),
            _ => {
                let name = &link.name;
                let _ = writeln!(
                    out,
                    "    <joint name=\"{name}_joint\" type=\"fixed\">\n      <parent>world</parent>\n      \
                     <child>{name}</child>\n    </joint>"
                );
            }
        }
    }
    out + "  </model>\n"
}

fn write_link(out: &mut String, link: &AssetLink, files: &LinkFiles) {
    let Inertial { mass, center, inertia } = link.inertial;
    let [xx, yy, zz, xy, xz, yz] = sound_inertia(inertia);
    let (name, center) = (&link.name, triple(center));
    let pose = match link.joint {
        Some(_) => format!("<pose relative_to=\"{name}_joint\">0 0 0 0 0 0</pose>"),
        None => format!("<pose>{} 0 0 0</pose>", triple(link.origin)),
    };
    let _ = write!(
        out,
        "    <link name=\"{name}\">\n      {pose}\n      <inertial>\n        <pose>{center} 0 0 0</pose>\n        \
         <mass>{mass}</mass>\n        <inertia><ixx>{xx}</ixx><ixy>{xy}</ixy><ixz>{xz}</ixz><iyy>{yy}</iyy>\
         <iyz>{yz}</iyz><izz>{zz}</izz></inertia>\n      </inertial>\n"
    );
    if let Some(file) = &files.visual {
        // The MTL file defines the material of a textured mesh.
        let material = match files.texture {
            Some(_) => String::new(),
            None => {
                let color = row(&mean_color(&link.visual));
                format!("        <material><ambient>{color} 1</ambient><diffuse>{color} 1</diffuse></material>\n")
            }
        };
        write_shape(out, "visual", &format!("{name}_visual"), file, &material);
    }
    let ContactMaterial { friction, restitution } = link.contact;
    let surface = format!(
        "        <surface>\n          <friction><ode><mu>{friction}</mu><mu2>{friction}</mu2></ode>\
         <bullet><friction>{friction}</friction><friction2>{friction}</friction2></bullet></friction>\n          \
         <bounce><restitution_coefficient>{restitution}</restitution_coefficient></bounce>\n        </surface>\n"
    );
    for (i, file) in files.collision.iter().enumerate() {
        write_shape(out, "collision", &format!("{name}_collision_{i}"), file, &surface);
    }
    *out += "    </link>\n";
}

/// A visual or collision shape; `surface` is its material.
fn write_shape(out: &mut String, tag: &str, name: &str, file: &str, surface: &str) {
    let _ = writeln!(
        out,
        "      <{tag} name=\"{name}\">\n        <geometry><mesh><uri>meshes/{file}</uri></mesh></geometry>\n{surface}      </{tag}>"
    );
}

fn write_joint(out: &mut String, parent: &AssetLink, link: &AssetLink, joint: &AssetJoint) {
    let AssetJoint { kind, axis, pitch, limits: [lower, upper], effort, velocity, damping, friction, .. } = *joint;
    let (tag, thread) = match kind {
        JointKind::Revolute => ("revolute", String::new()),
        JointKind::Prismatic => ("prismatic", String::new()),
        JointKind::Screw => {
            // Metres per revolution.
            let pitch = pitch * std::f64::consts::TAU;
            ("screw", format!("      <screw_thread_pitch>{pitch}</screw_thread_pitch>\n"))
        }
    };
    let (name, mother, at, axis) = (&link.name, &parent.name, triple(link.origin - parent.origin), triple(axis));
    let _ = write!(
        out,
        "    <joint name=\"{name}_joint\" type=\"{tag}\">\n      <pose relative_to=\"{mother}\">{at} 0 0 0</pose>\n      \
         <parent>{mother}</parent>\n      <child>{name}</child>\n{thread}      <axis>\n        <xyz>{axis}</xyz>\n        \
         <limit><lower>{lower}</lower><upper>{upper}</upper><effort>{effort}</effort><velocity>{velocity}</velocity></limit>\n        \
         <dynamics><damping>{damping}</damping><friction>{friction}</friction></dynamics>\n      </axis>\n    </joint>\n"
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::testing::cabinet;
    use roxmltree::{Document, Node};

    fn find<'a>(tree: &'a Document, tag: &str, name: &str) -> Node<'a, 'a> {
        tree.descendants().find(|n| n.has_tag_name(tag) && n.attribute("name") == Some(name)).unwrap()
    }

    fn text<'a>(node: Node<'a, 'a>, tag: &str) -> &'a str {
        node.descendants().find(|n| n.has_tag_name(tag)).unwrap().text().unwrap()
    }

    #[test]
    fn another_reader_reads_frames_limits_and_files() {
        let dir = tempfile::tempdir().unwrap();
        let mut asset = cabinet();
        asset.links[2].parent = Some(1);
        let written = export_sdf(dir.path(), &asset).unwrap();
        let content = std::fs::read_to_string(&written[0]).unwrap();
        let tree = Document::parse(&content).unwrap();
        assert_eq!(tree.root_element().attribute("version"), Some("1.10"));
        let base = find(&tree, "joint", "base_joint");
        assert_eq!(
            (base.attribute("type"), text(base, "parent"), text(base, "child")),
            (Some("fixed"), "world", "base")
        );
        let slide = find(&tree, "joint", "part_2_joint");
        let pose = slide.children().find(|n| n.has_tag_name("pose")).unwrap();
        assert_eq!((pose.attribute("relative_to"), pose.text()), (Some("part_1"), Some("0.5 0 -0.5 0 0 0")));
        assert_eq!([text(slide, "lower"), text(slide, "upper"), text(slide, "effort")], ["0", "0.42", "50"]);
        assert_eq!(find(&tree, "frame", "part_1_handle").attribute("attached_to"), Some("part_1"));
        let link = find(&tree, "link", "part_2");
        assert_eq!(link.first_element_child().unwrap().attribute("relative_to"), Some("part_2_joint"));
        assert_eq!([text(link, "mass"), text(link, "iyy"), text(link, "iyz")], ["2", "0.12", "0.003"]);
        let hull = find(&tree, "collision", "part_2_collision_1");
        assert_eq!([text(hull, "mu"), text(hull, "mu2"), text(hull, "restitution_coefficient")], ["0.6", "0.6", "0.1"]);
        let uris: Vec<_> = tree.descendants().filter(|n| n.has_tag_name("uri")).map(|n| n.text().unwrap()).collect();
        assert_eq!(uris.len(), 3 + 8);
        assert!(uris.iter().all(|u| written.contains(&dir.path().join(u))), "{uris:?}");
        let world = std::fs::read_to_string(&written[2]).unwrap();
        let world = Document::parse(&world).unwrap();
        assert!(world.descendants().any(|n| n.has_tag_name("model") && n.attribute("name") == Some("cabinet")));
        assert_eq!(world.descendants().filter(|n| n.has_tag_name("uri")).count(), uris.len());
        let config = std::fs::read_to_string(&written[1]).unwrap();
        assert_eq!(text(Document::parse(&config).unwrap().root(), "sdf"), "model.sdf");
    }

    #[test]
    fn a_screw_is_threaded_in_metres_per_turn() {
        let mut asset = cabinet();
        let joint = asset.links[1].joint.as_mut().unwrap();
        (joint.kind, joint.pitch) = (JointKind::Screw, 0.25 / std::f64::consts::PI);
        asset.links[1].visual.texture = None;
        let content = model(&asset, &vec![LinkFiles { visual: Some("v.obj".into()), ..Default::default() }; 3]);
        let tree = Document::parse(&content).unwrap();
        let screw = find(&tree, "joint", "part_1_joint");
        assert_eq!((screw.attribute("type"), text(screw, "screw_thread_pitch")), (Some("screw"), "0.5"));
        assert_eq!(text(find(&tree, "link", "part_1"), "diffuse"), "0.7843 0.3922 0.1961 1");
    }

    #[test]
    fn the_text_of_a_joint() {
        let asset = cabinet();
        let mut out = String::new();
        write_joint(&mut out, &asset.links[0], &asset.links[1], asset.links[1].joint.as_ref().unwrap());
        assert_eq!(
            out,
            "    <joint name=\"part_1_joint\" type=\"revolute\">\n      <pose relative_to=\"base\">-0.5 -0.26 0.75 0 0 0</pose>\n\
             \x20     <parent>base</parent>\n      <child>part_1</child>\n      <axis>\n        <xyz>0 0 -1</xyz>\n        \
             <limit><lower>0</lower><upper>1.6</upper><effort>50</effort><velocity>3</velocity></limit>\n        \
             <dynamics><damping>0.2</damping><friction>0.1</friction></dynamics>\n      </axis>\n    </joint>\n"
        );
    }
}
