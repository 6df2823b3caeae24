//! URDF: `NAME.urdf` and `meshes/`.
//!
//! The root link `world` carries the base on a fixed joint, so the object does not fall. Link frames are joint frames. A
//! handle is a link without mass and shapes, on a fixed joint to the link that has it. `semantics.txt` has a line per link
//! as in PartNet-Mobility: its name, its joint (`heavy`, `hinge` or `slider`) and its class. Without frames
//! ([`Frames::None`]) the base is the root, unless its origin is not that of the object; then readers have to fix it.
//!
//! Limitations: a screw is a revolute joint with its pitch in a comment; the observed states are in a comment, too. Splats
//! are not written. A link without texture has its colours in the OBJ, which many loaders ignore; it has no `<material>`,
//! because SAPIEN needs a renderer for materials even if nothing is drawn. PyBullet ignores contacts within a robot unless
//! a flag is set. MuJoCo ignores those between a body and its parent, but not if the parent is fixed to the world (MJCF has
//! excludes for that). URDF cannot declare hulls convex; every engine uses the convex hull of each collision mesh, which is
//! equal to the mesh here.

use super::check::{check_asset, sound_inertia};
use super::format::{Frames, WriteOptions};
use super::meshes::{LinkFiles, write_link_meshes};
use super::xml::{observed_note, roll_pitch_yaw, row, screw_note, triple};
use crate::{FileError, write_atomic};
use artgs_core::{Asset, AssetJoint, AssetLink, Handle, Inertial, JointKind, PartClass};
use glam::DVec3;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The root link, which has no body, and the pose of the base relative to it.
pub(super) struct Root {
    /// Its name.
    pub(super) name: &'static str,
    /// Origin of the base.
    pub(super) xyz: DVec3,
    /// Roll, pitch and yaw of the base.
    pub(super) rpy: [f64; 3],
}

/// Writes `DIR/NAME.urdf` and `DIR/meshes/`; returns what was written, the URDF first.
pub fn export_urdf(dir: &Path, asset: &Asset) -> Result<Vec<PathBuf>, FileError> {
    export_urdf_with(dir, asset, &WriteOptions::default())
}

/// The same with options. With a package, mesh paths begin with `package://PACKAGE/`, so that `DIR` is the folder of the
/// package.
pub fn export_urdf_with(dir: &Path, asset: &Asset, options: &WriteOptions) -> Result<Vec<PathBuf>, FileError> {
    let path = dir.join(format!("{}.urdf", asset.name));
    check_asset(asset).map_err(|reason| FileError::malformed(&path, reason))?;
    let (files, mut written) = write_link_meshes(&dir.join("meshes"), asset)?;
    // PyBullet treats a link of this name as the ground; it warns of any other link without mass.
    let root = Root { name: "world", xyz: asset.links[0].origin, rpy: [0.0; 3] };
    let root = (options.frames == Frames::All || root.xyz != DVec3::ZERO).then_some(root);
    let folder = options.package.as_ref().map_or("meshes".into(), |package| format!("package://{package}/meshes"));
    write_atomic(&path, document(asset, &folder, &files, root.as_ref()).as_bytes())?;
    let semantics = dir.join("semantics.txt");
    write_atomic(&semantics, semantics_of(asset).as_bytes())?;
    written.insert(0, path);
    written.push(semantics);
    Ok(written)
}

/// The text, for an asset that passed [`check_asset`]. Without `root` the base is the root link.
pub(super) fn document(asset: &Asset, folder: &str, files: &[LinkFiles], root: Option<&Root>) -> String {
    let mut out = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", asset.name);
    // Without this MuJoCo searches the meshes beside the URDF; other readers ignore the element.
    out += "  <mujoco><compiler strippath=\"false\"/></mujoco>\n";
    if let Some(root) = root {
        let _ = writeln!(out, "  <link name=\"{}\"/>", root.name);
    }
    for (link, files) in asset.links.iter().zip(files) {
        write_link(&mut out, link, folder, files);
        link.handles.iter().for_each(|handle| write_handle_link(&mut out, handle));
    }
    for link in &asset.links {
        match (link.parent, &link.joint) {
            (Some(parent), Some(joint)) => {
                let parent = &asset.links[parent];
                open_joint(&mut out, kind(joint), &link.name, &parent.name, link.origin - parent.origin, [0.0; 3]);
                write_motion(&mut out, joint);
                out += "  </joint>\n";
            }
            _ => {
                if let Some(root) = root {
                    open_joint(&mut out, "fixed", &link.name, root.name, root.xyz, root.rpy);
                    out += "  </joint>\n";
                }
            }
        }
        for Handle { name, frame, .. } in &link.handles {
            open_joint(&mut out, "fixed", name, &link.name, frame.translation, roll_pitch_yaw(frame.rotation));
            out += "  </joint>\n";
        }
    }
    out + "</robot>\n"
}

/// A frame. The inertial of zeros keeps PyBullet from giving it a kilogram.
fn write_handle_link(out: &mut String, handle: &Handle) {
    let Handle { name, width, length, depth, .. } = handle;
    let _ = write!(
        out,
        "  <link name=\"{name}\">\n    <!-- grasp: z approaches, fingers close along y; width {width}, length {length}, depth \
         {depth} -->\n    <inertial>\n      <mass value=\"0\"/>\n      <inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" \
         izz=\"0\"/>\n    </inertial>\n  </link>\n"
    );
}

/// Joint of a link in `semantics.txt`.
pub(super) fn joint_word(joint: Option<&AssetJoint>) -> &'static str {
    match joint.map(|j| j.kind) {
        None => "heavy",
        Some(JointKind::Prismatic) => "slider",
        Some(JointKind::Revolute | JointKind::Screw) => "hinge",
    }
}

/// Class of a link in `semantics.txt`.
pub(super) fn class_word(link: &AssetLink) -> &'static str {
    link.semantics.map_or(PartClass::Part, |s| s.class).name()
}

fn semantics_of(asset: &Asset) -> String {
    let line = |link: &AssetLink| format!("{} {} {}\n", link.name, joint_word(link.joint.as_ref()), class_word(link));
    asset.links.iter().map(line).collect()
}

fn kind(joint: &AssetJoint) -> &'static str {
    match joint.kind {
        JointKind::Prismatic => "prismatic",
        JointKind::Revolute | JointKind::Screw => "revolute",
    }
}

fn write_link(out: &mut String, link: &AssetLink, folder: &str, files: &LinkFiles) {
    let Inertial { mass, center, inertia } = link.inertial;
    let [xx, yy, zz, xy, xz, yz] = sound_inertia(inertia);
    let (name, center) = (&link.name, triple(center));
    let _ = write!(
        out,
        "  <link name=\"{name}\">\n    <inertial>\n      <origin xyz=\"{center}\" rpy=\"0 0 0\"/>\n      <mass value=\"{mass}\"/>\n\
         \x20     <inertia ixx=\"{xx}\" ixy=\"{xy}\" ixz=\"{xz}\" iyy=\"{yy}\" iyz=\"{yz}\" izz=\"{zz}\"/>\n    </inertial>\n"
    );
    if let Some(file) = &files.visual {
        write_shape(out, "visual", &format!("{name}_visual"), &format!("{folder}/{file}"));
    }
    for (i, file) in files.collision.iter().enumerate() {
        write_shape(out, "collision", &format!("{name}_collision_{i}"), &format!("{folder}/{file}"));
    }
    *out += "  </link>\n";
}

fn write_shape(out: &mut String, tag: &str, name: &str, file: &str) {
    let _ = writeln!(
        out,
        "    <{tag} name=\"{name}\">\n      <origin xyz=\"0 0 0\" rpy=\"0 0 0\"/>\n      <geometry><mesh filename=\"{file}\"/>\
         </geometry>\n    </{tag}>"
    );
}

fn open_joint(out: &mut String, kind: &str, child: &str, parent: &str, xyz: DVec3, rpy: [f64; 3]) {
    let (xyz, rpy) = (triple(xyz), row(&rpy));
    let _ = write!(
        out,
        "  <joint name=\"{child}_joint\" type=\"{kind}\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n\
         \x20   <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>\n"
    );
}

fn write_motion(out: &mut String, joint: &AssetJoint) {
    let AssetJoint { kind, axis, pitch, limits: [lower, upper], observed, effort, velocity, damping, friction } =
        *joint;
    let _ = writeln!(out, "    {}", observed_note(observed));
    if let Some(note) = screw_note(kind, pitch) {
        let _ = writeln!(out, "    {note}");
    }
    let axis = triple(axis);
    let _ = write!(
        out,
        "    <axis xyz=\"{axis}\"/>\n    <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"{effort}\" velocity=\"{velocity}\"/>\n\
         \x20   <dynamics damping=\"{damping}\" friction=\"{friction}\"/>\n"
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::testing::cabinet;
    use artgs_core::Mesh;
    use glam::DMat3;

    fn read(asset: &Asset) -> (tempfile::TempDir, Vec<PathBuf>, urdf_rs::Robot, String) {
        let dir = tempfile::tempdir().unwrap();
        let written = export_urdf(dir.path(), asset).unwrap();
        let text = std::fs::read_to_string(&written[0]).unwrap();
        (dir, written.clone(), urdf_rs::read_file(&written[0]).unwrap(), text)
    }

    #[test]
    fn without_frames_every_link_has_a_mass_and_the_base_is_the_root() {
        let dir = tempfile::tempdir().unwrap();
        let mut asset = cabinet();
        let options = WriteOptions { frames: Frames::None, ..WriteOptions::default() };
        let links = |asset: &Asset| {
            let files = crate::asset::Format::Urdf.write(dir.path(), asset, &options).unwrap();
            urdf_rs::read_file(&files[0]).unwrap()
        };
        let shift = asset.links[0].origin;
        asset.links.iter_mut().for_each(|link| link.origin -= shift);
        let robot = links(&asset);
        let names: Vec<&str> = robot.links.iter().map(|l| l.name.as_str()).collect();
        assert_eq!(names, ["base", "part_1", "part_2"]);
        assert!(robot.links.iter().all(|l| l.inertial.mass.value > 0.0));
        assert_eq!((robot.joints.len(), robot.joints[0].parent.link.as_str()), (2, "base"));
        // A base elsewhere keeps the link that says where.
        asset.links[0].origin = DVec3::X;
        assert_eq!(links(&asset).links[0].name, "world");
    }

    #[test]
    fn another_reader_reads_links_joints_limits_and_masses() {
        let (dir, written, robot, _) = read(&cabinet());
        assert_eq!(written[0], dir.path().join("cabinet.urdf"));
        assert!(written.iter().all(|f| f.is_file()));
        let names: Vec<&str> = robot.links.iter().map(|l| l.name.as_str()).collect();
        assert_eq!(names, ["world", "base", "part_1", "part_1_handle", "part_2"]);
        assert_eq!(robot.joints[0].joint_type, urdf_rs::JointType::Fixed);
        assert_eq!((robot.joints[0].parent.link.as_str(), robot.joints[0].child.link.as_str()), ("world", "base"));
        let door = &robot.joints[1];
        assert_eq!(door.joint_type, urdf_rs::JointType::Revolute);
        assert_eq!((door.axis.xyz.0, door.origin.xyz.0), ([0.0, 0.0, -1.0], [-0.5, -0.26, 0.75]));
        assert_eq!((door.limit.lower, door.limit.upper, door.limit.effort, door.limit.velocity), (0.0, 1.6, 50.0, 3.0));
        let dynamics = door.dynamics.as_ref().unwrap();
        assert_eq!((dynamics.damping, dynamics.friction), (0.2, 0.1));
        let grasp = &robot.joints[2];
        assert_eq!((grasp.parent.link.as_str(), &grasp.joint_type), ("part_1", &urdf_rs::JointType::Fixed));
        assert_eq!(grasp.origin.xyz.0, [0.9, -0.04, 0.0]);
        let [roll, pitch, yaw] = grasp.origin.rpy.0;
        let turn = DMat3::from_rotation_z(yaw) * DMat3::from_rotation_y(pitch) * DMat3::from_rotation_x(roll);
        assert!((turn.z_axis - DVec3::Y).length() < 1e-9 && (turn.y_axis - DVec3::X).length() < 1e-9);
        assert_eq!(robot.joints[3].joint_type, urdf_rs::JointType::Prismatic);
        let semantics = std::fs::read_to_string(dir.path().join("semantics.txt")).unwrap();
        assert_eq!(semantics, "base heavy body\npart_1 hinge door\npart_2 slider drawer\n");
        let inertial = &robot.links[1].inertial;
        assert_eq!((inertial.mass.value, inertial.inertia.ixx, inertial.inertia.iyz), (2.0, 0.1, 0.003));
        assert_eq!(robot.links.iter().map(|l| l.visual.len()).collect::<Vec<_>>(), [0, 1, 1, 0, 1]);
        assert_eq!(robot.links.iter().map(|l| l.collision.len()).collect::<Vec<_>>(), [0, 5, 1, 0, 2]);
        let shapes = robot
            .links
            .iter()
            .flat_map(|l| l.visual.iter().map(|v| &v.geometry).chain(l.collision.iter().map(|c| &c.geometry)));
        for shape in shapes {
            let urdf_rs::Geometry::Mesh { filename, .. } = shape else { panic!("only meshes were written") };
            assert!(filename.starts_with("meshes/") && written.contains(&dir.path().join(filename)), "{filename}");
        }
    }

    #[test]
    fn the_pose_of_a_child_is_relative_to_its_parent_and_a_screw_has_a_comment() {
        let mut asset = cabinet();
        asset.links[2].parent = Some(1);
        asset.links[0].origin = DVec3::new(0.1, 0.0, -0.0);
        let joint = asset.links[2].joint.as_mut().unwrap();
        (joint.kind, joint.pitch) = (JointKind::Screw, -0.01);
        asset.links[2].visual.texture = None;
        asset.links[1].handles.clear();
        asset.links[1].visual = Default::default();
        asset.links[1].collision = Vec::<Mesh>::new();
        let (_dir, _, robot, text) = read(&asset);
        assert_eq!(robot.joints[2].parent.link, "part_1");
        let at = DVec3::from_array(robot.joints[2].origin.xyz.0);
        assert!((at - DVec3::new(0.5, 0.0, -0.5)).length() < 1e-12, "{at}");
        assert_eq!(robot.joints[2].joint_type, urdf_rs::JointType::Revolute);
        assert!(text.contains("<!-- screw: slides -0.01 m per radian along its axis -->"));
        assert!(text.contains("<origin xyz=\"0.1 0 0\" rpy=\"0 0 0\"/>"));
        assert!(!text.contains("<material"), "{text}");
        assert!(robot.links[2].visual.is_empty() && robot.links[2].collision.is_empty());
    }

    #[test]
    fn the_text_of_a_joint() {
        let (_dir, _, _, text) = read(&cabinet());
        let joint = text.split("<joint name=\"part_2_joint\"").nth(1).unwrap();
        assert_eq!(
            joint,
            " type=\"prismatic\">\n    <parent link=\"base\"/>\n    <child link=\"part_2\"/>\n    <origin xyz=\"0 -0.26 0.25\" \
             rpy=\"0 0 0\"/>\n    <!-- observed: 0 0.4 -->\n    <axis xyz=\"0 -1 0\"/>\n\
             \x20   <limit lower=\"0\" upper=\"0.42\" effort=\"50\" velocity=\"3\"/>\n\
             \x20   <dynamics damping=\"0.2\" friction=\"0.1\"/>\n  </joint>\n</robot>\n"
        );
    }

    #[test]
    fn mesh_paths_may_begin_with_a_package() {
        let dir = tempfile::tempdir().unwrap();
        let options = WriteOptions { package: Some("my_cabinet".into()), ..WriteOptions::default() };
        let written = export_urdf_with(dir.path(), &cabinet(), &options).unwrap();
        let text = std::fs::read_to_string(&written[0]).unwrap();
        assert_eq!(text.matches("filename=\"package://my_cabinet/meshes/").count(), text.matches("filename=").count());
    }

    #[test]
    fn a_bad_asset_leaves_no_files() {
        let dir = tempfile::tempdir().unwrap();
        let mut asset = cabinet();
        asset.links[1].joint.as_mut().unwrap().axis = DVec3::ZERO;
        let message = export_urdf(dir.path(), &asset).unwrap_err().to_string();
        assert!(message.contains("cabinet.urdf: link 1 `part_1`: joint.axis"), "{message}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
