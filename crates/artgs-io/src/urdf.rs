//! URDF for simulators.
//!
//! The root link `world` carries the base on a fixed joint, so the object does not fall. Every part is a link whose
//! frame is its joint's frame: at the joint's origin, axes parallel to the world, joint value 0 at the start state.
//!
//! Limitations: a screw joint is written as a revolute one (URDF has no screw), its pitch in a comment. Collision
//! meshes are the visual ones unless the caller has convex pieces; engines replace each by its convex hull, so hollow
//! bodies collide as if filled. PyBullet ignores contacts within a robot by default; MuJoCo ignores those between a body
//! and its parent, but not where the parent is fixed to the world, so a drawer there needs convex pieces or an
//! `<exclude>` pair against the cabinet it slides in.
//! A mesh without volume (fewer than four points that span space) is drawn but does not collide; an empty one is
//! not referred to, since engines refuse it.

use crate::{FileError, write_atomic, write_mesh_obj};
use artgs_core::{Joint, JointKind, Mesh, Replica};
use glam::DVec3;
use std::fmt::Write;
use std::path::Path;

/// Name of the root link.
const ROOT: &str = "world";
/// Joints narrower than this (radians or scene units) are widened to it: engines refuse `lower = upper`.
const NARROWEST: f64 = 1e-4;

/// Mass and inertia of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// Kilograms, above 0.
    pub mass: f64,
    /// Centre of mass in the link frame, scene units.
    pub center: DVec3,
    /// `ixx iyy izz ixy ixz iyz` about the centre of mass, kg times squared scene units.
    pub inertia: [f64; 6],
}

impl Inertial {
    /// A solid box the size of the mesh's bounding box, of the given density (kg per cubic scene unit). Sides count as
    /// at least a thousandth of the longest, so that flat parts have inertia; an empty mesh counts as a cube of side
    /// 0.01.
    pub fn of_box(mesh: &Mesh, density: f64) -> Self {
        let vertices = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from)));
        let bounds = crate::summary::Bounds::of(vertices);
        let (center, size) = bounds.map_or((DVec3::ZERO, DVec3::ZERO), |b| ((b.min + b.max) * 0.5, b.max - b.min));
        let longest = if size.max_element() > 0.0 { size.max_element() } else { 0.01 };
        let floor = if mesh.is_empty() { longest } else { 1e-3 * longest };
        let size = size.max(DVec3::splat(floor));
        let mass = density * size.x * size.y * size.z;
        let sq = size * size;
        let about = |a: f64, b: f64| mass / 12.0 * (a + b);
        Self { mass, center, inertia: [about(sq.y, sq.z), about(sq.x, sq.z), about(sq.x, sq.y), 0.0, 0.0, 0.0] }
    }
}

/// What a link looks like and weighs.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Mesh file to draw, in the link frame, relative to the URDF; none for an empty part.
    pub visual: Option<String>,
    /// Mesh files to collide with, each taken as its convex hull; none if there is no volume.
    pub collision: Vec<String>,
    /// Mass and inertia.
    pub inertial: Inertial,
}

/// What a capture does not tell.
#[derive(Clone, Debug, PartialEq)]
pub struct UrdfOptions {
    /// Name of the robot.
    pub name: String,
    /// Kilograms per cubic scene unit of the parts' bounding boxes.
    pub density: f64,
    /// Largest force (N) or torque (N m) of a joint.
    pub effort: f64,
    /// Largest velocity of a joint, scene units or radians per second.
    pub velocity: f64,
    /// Viscous damping of a joint.
    pub damping: f64,
    /// Dry friction of a joint.
    pub friction: f64,
}

impl Default for UrdfOptions {
    /// Furniture in metres, mostly hollow: 100 kg/m^3, 100 N, 10 m/s, damping 0.1, friction 0.
    fn default() -> Self {
        Self { name: "replica".into(), density: 100.0, effort: 100.0, velocity: 10.0, damping: 0.1, friction: 0.0 }
    }
}

/// A part's mesh in its link frame, from the one in the world at the start state.
pub fn link_mesh(replica: &Replica, part: usize, world_start: &Mesh) -> Mesh {
    world_start.moved(&artgs_core::Rigid::shift(-link_origin(replica, part)))
}

/// Origin of a part's link frame in the world at the start state.
fn link_origin(replica: &Replica, part: usize) -> DVec3 {
    replica.joint(part).map_or(DVec3::ZERO, |j| j.origin)
}

/// Writes `FOLDER/NAME.urdf` and one OBJ per part in `FOLDER/meshes/`. `world_start[i]` is the mesh of part `i` in the
/// world at the start state. Inertia is that of bounding boxes.
pub fn export_urdf(
    folder: &Path,
    replica: &Replica,
    world_start: &[Mesh],
    options: &UrdfOptions,
) -> Result<(), FileError> {
    let urdf = folder.join(format!("{}.urdf", options.name));
    if world_start.len() != replica.parts.len() {
        let (n, m) = (replica.parts.len(), world_start.len());
        return Err(FileError::malformed(&urdf, format!("{n} parts but {m} meshes")));
    }
    let mut links = Vec::new();
    for (part, mesh) in world_start.iter().enumerate() {
        let mesh = link_mesh(replica, part, mesh);
        let file = format!("meshes/part_{part}.obj");
        if !mesh.is_empty() {
            write_mesh_obj(&folder.join(&file), &mesh)?;
        }
        links.push(Link {
            visual: (!mesh.is_empty()).then(|| file.clone()),
            collision: has_volume(&mesh).then_some(file).into_iter().collect(),
            inertial: Inertial::of_box(&mesh, options.density),
        });
    }
    write_urdf(&urdf, replica, &links, options)
}

/// True if a mesh has triangles and its vertices span space, which convex hulls need.
pub fn has_volume(mesh: &Mesh) -> bool {
    let points: Vec<DVec3> = mesh.vertices.iter().map(|v| DVec3::from_array(v.map(f64::from))).collect();
    let farthest = |measure: &dyn Fn(DVec3) -> f64| {
        points.iter().copied().max_by(|a, b| measure(*a).total_cmp(&measure(*b))).unwrap_or_default()
    };
    let Some(&a) = points.first() else { return false };
    let ab = farthest(&|p| (p - a).length_squared()) - a;
    let along = ab.normalize_or_zero();
    let ac = farthest(&|p| (p - a).reject_from_normalized(along).length_squared()) - a;
    let normal = along.cross(ac).normalize_or_zero();
    let height = farthest(&|p| (p - a).dot(normal).abs()) - a;
    !mesh.is_empty() && height.dot(normal).abs() > 1e-5 * ab.length()
}

/// Writes a URDF with one link per part; `links[i]` belongs to part `i`.
pub fn write_urdf(path: &Path, replica: &Replica, links: &[Link], options: &UrdfOptions) -> Result<(), FileError> {
    let text = urdf(replica, links, options).map_err(|reason| FileError::malformed(path, reason))?;
    write_atomic(path, text.as_bytes())
}

fn urdf(replica: &Replica, links: &[Link], options: &UrdfOptions) -> Result<String, String> {
    replica.validate().map_err(|e| e.to_string())?;
    check(replica, links, options)?;
    let mut out = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", escape(&options.name));
    // MuJoCo would otherwise look for the meshes beside the URDF; other readers skip the element.
    out += "  <mujoco><compiler strippath=\"false\" balanceinertia=\"true\"/></mujoco>\n";
    let _ = writeln!(out, "  <link name=\"{ROOT}\"/>");
    for (part, link) in replica.parts.iter().zip(links) {
        write_link(&mut out, &part.name, link);
    }
    for (index, part) in replica.parts.iter().enumerate() {
        let parent = part.parent.map_or(ROOT, |p| &replica.parts[p].name);
        let origin = link_origin(replica, index) - part.parent.map_or(DVec3::ZERO, |p| link_origin(replica, p));
        write_joint(&mut out, &part.name, parent, origin, replica.joint(index), options);
    }
    Ok(out + "</robot>\n")
}

fn check(replica: &Replica, links: &[Link], options: &UrdfOptions) -> Result<(), String> {
    if links.len() != replica.parts.len() {
        return Err(format!("{} parts but {} links", replica.parts.len(), links.len()));
    }
    for (name, value) in [("effort", options.effort), ("velocity", options.velocity)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(format!("option `{name}` is {value}, must be above 0"));
        }
    }
    for (i, (part, link)) in replica.parts.iter().zip(links).enumerate() {
        if part.name == ROOT || part.name.is_empty() || replica.parts[..i].iter().any(|p| p.name == part.name) {
            return Err(format!("part {i}: name {:?} is taken or empty; links need names of their own", part.name));
        }
        let Inertial { mass, center, inertia } = link.inertial;
        let numbers_are_finite = center.is_finite() && inertia.iter().all(|v| v.is_finite());
        if !(mass.is_finite() && mass > 0.0 && numbers_are_finite) {
            return Err(format!("part {i}: mass {mass} and inertia must be finite, the mass above 0"));
        }
    }
    Ok(())
}

fn write_link(out: &mut String, name: &str, link: &Link) {
    let Inertial { mass, center, inertia: [xx, yy, zz, xy, xz, yz] } = link.inertial;
    let _ = write!(
        out,
        "  <link name=\"{}\">\n    <inertial>\n      <origin xyz=\"{}\" rpy=\"0 0 0\"/>\n      <mass value=\"{mass}\"/>\n\
         \x20     <inertia ixx=\"{xx}\" ixy=\"{xy}\" ixz=\"{xz}\" iyy=\"{yy}\" iyz=\"{yz}\" izz=\"{zz}\"/>\n    </inertial>\n",
        escape(name),
        triple(center)
    );
    let visual = link.visual.iter().map(|file| ("visual", file));
    for (tag, file) in visual.chain(link.collision.iter().map(|file| ("collision", file))) {
        let file = escape(file);
        let _ = writeln!(
            out,
            "    <{tag}>\n      <origin xyz=\"0 0 0\" rpy=\"0 0 0\"/>\n      <geometry><mesh filename=\"{file}\"/>\
             </geometry>\n    </{tag}>"
        );
    }
    *out += "  </link>\n";
}

fn write_joint(out: &mut String, child: &str, parent: &str, at: DVec3, joint: Option<Joint>, options: &UrdfOptions) {
    let kind = match joint.map(|j| j.kind) {
        None => "fixed",
        Some(JointKind::Prismatic) => "prismatic",
        Some(JointKind::Revolute | JointKind::Screw) => "revolute",
    };
    let (child, parent) = (escape(child), escape(parent));
    let _ = write!(
        out,
        "  <joint name=\"{child}_joint\" type=\"{kind}\">\n    <parent link=\"{parent}\"/>\n    <child link=\"{child}\"/>\n\
         \x20   <origin xyz=\"{}\" rpy=\"0 0 0\"/>\n",
        triple(at)
    );
    if let Some(joint) = joint {
        if joint.kind == JointKind::Screw {
            let _ = writeln!(
                out,
                "    <!-- screw; pitch {} scene units per radian, not expressible in URDF -->",
                joint.pitch
            );
        }
        let [lower, upper] = limits(&joint);
        let UrdfOptions { effort, velocity, damping, friction, .. } = options;
        let _ = write!(
            out,
            "    <axis xyz=\"{}\"/>\n    <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"{effort}\" \
             velocity=\"{velocity}\"/>\n    <dynamics damping=\"{damping}\" friction=\"{friction}\"/>\n",
            triple(joint.axis.normalize())
        );
    }
    *out += "  </joint>\n";
}

/// Limits that hold the observed values, counted from the start state, and never empty.
fn limits(joint: &Joint) -> [f64; 2] {
    let all = [joint.limits, joint.state_values].concat();
    let lower = all.iter().copied().fold(f64::INFINITY, f64::min) - joint.state_values[0];
    let upper = all.iter().copied().fold(f64::NEG_INFINITY, f64::max) - joint.state_values[0];
    [lower, upper.max(lower + NARROWEST)]
}

fn triple(v: DVec3) -> String {
    // Adding zero turns -0 into 0.
    let v = v + DVec3::ZERO;
    format!("{} {} {}", v.x, v.y, v.z)
}

/// Text for an XML attribute; characters that XML cannot hold become `_`.
fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&apos;",
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push('_'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests;
