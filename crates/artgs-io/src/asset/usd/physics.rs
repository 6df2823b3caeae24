//! Bodies, joints and the scene of USD Physics.

use super::layer::{Prim, float3, quaternion, token};
use artgs_core::{Asset, AssetJoint, AssetLink, Handle, Inertial, JointKind, State};
use glam::{DMat3, DQuat, DVec3};
use openusd::sdf::Value;

/// A physics engine with schemas of its own for what USD Physics does not express.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Engine {
    PhysX,
    Newton,
    MuJoCo,
}

pub(super) fn float(value: f64) -> Value {
    Value::Float(value as f32)
}

/// Gravity of the Earth along -Z.
pub(super) fn scene() -> Prim {
    Prim::new("PhysicsScene", "PhysicsScene").attr("vector3f", "physics:gravityDirection", float3(DVec3::NEG_Z)).attr(
        "float",
        "physics:gravityMagnitude",
        float(9.81),
    )
}

/// The rigid body of link `i`, a child of the prim `root`, without visual and collision meshes.
pub(super) fn body(root: &str, asset: &Asset, i: usize) -> Result<Prim, String> {
    let link = &asset.links[i];
    let Inertial { mass, center, .. } = link.inertial;
    let (moments, axes) = principal(link.inertial.inertia);
    let at = link.origin;
    let prim = Prim::new("Xform", link.name.clone())
        .api("PhysicsRigidBodyAPI")
        .api("PhysicsMassAPI")
        .placed(at, DQuat::IDENTITY)
        .attr("bool", "physics:rigidBodyEnabled", Value::Bool(true))
        .attr("float", "physics:mass", float(mass))
        .attr("point3f", "physics:centerOfMass", float3(center))
        .attr("float3", "physics:diagonalInertia", float3(moments))
        .attr("quatf", "physics:principalAxes", quaternion(axes));
    let prim = link.semantics.iter().fold(prim, |prim, semantics| {
        let class = token(semantics.class.name());
        prim.custom("token", "artgs:class", class)
    });
    let prim = link.handles.iter().fold(prim, |prim, handle| prim.child(grasp(handle)));
    // A link and its parent may touch at their joint; others cannot touch at all.
    let apart = asset.apart.iter().filter(|pair| pair[1] == i).map(|pair| pair[0]);
    let filtered: Vec<String> = link
        .parent
        .into_iter()
        .chain(apart)
        .filter_map(|p| asset.links.get(p))
        .map(|p| format!("{root}/{}", p.name))
        .collect();
    if filtered.is_empty() {
        return Ok(prim);
    }
    prim.api("PhysicsFilteredPairsAPI").rels("physics:filteredPairs", &filtered)
}

/// The grasp frame of a handle.
fn grasp(handle: &Handle) -> Prim {
    let Handle { name, frame, width, length, depth } = handle;
    let sizes = [("artgs:width", width), ("artgs:length", length), ("artgs:depth", depth)];
    let prim = Prim::new("Xform", name.clone()).placed(frame.translation, frame.rotation);
    sizes.into_iter().fold(prim, |prim, (name, size)| prim.custom("double", name, Value::Double(*size)))
}

/// The joint of link `i` to its parent, without schemas of engines; for a link without parent a fixed joint to the world.
pub(super) fn joint(root: &str, asset: &Asset, i: usize) -> Result<Prim, String> {
    let link = &asset.links[i];
    let child = format!("{root}/{}", link.name);
    let (Some(parent), Some(joint)) = (link.parent.and_then(|p| asset.links.get(p)), &link.joint) else {
        return fixed(root, asset, link);
    };
    let turns = joint.kind != JointKind::Prismatic;
    let kind = if turns { "PhysicsRevoluteJoint" } else { "PhysicsPrismaticJoint" };
    let (motion, unit) = motion(joint);
    // USD knows joint axes X, Y and Z only; the joint's frame turns X to ours.
    let frame = DQuat::from_rotation_arc(DVec3::X, joint.axis.normalize_or(DVec3::X));
    let prim = Prim::new(kind, joint_name(link))
        .rel("physics:body0", &format!("{root}/{}", parent.name))?
        .rel("physics:body1", &child)?
        .attr("point3f", "physics:localPos0", float3(link.origin - parent.origin))
        .attr("quatf", "physics:localRot0", quaternion(frame))
        .attr("point3f", "physics:localPos1", float3(DVec3::ZERO))
        .attr("quatf", "physics:localRot1", quaternion(frame))
        .attr("bool", "physics:collisionEnabled", Value::Bool(false))
        .uniform("token", "physics:axis", token("X"))
        .attr("float", "physics:lowerLimit", float(joint.limits[0] * unit))
        .attr("float", "physics:upperLimit", float(joint.limits[1] * unit));
    Ok(notes(passive(prim, joint, motion, unit), joint, unit))
}

/// Name of the prim of a movable joint.
pub(super) fn joint_name(link: &AssetLink) -> String {
    format!("{}_joint", link.name)
}

/// What a joint is driven by, and degrees or metres per unit of the asset.
fn motion(joint: &AssetJoint) -> (&'static str, f64) {
    if joint.kind == JointKind::Prismatic { ("linear", 1.0) } else { ("angular", 1f64.to_degrees()) }
}

fn fixed(root: &str, asset: &Asset, link: &AssetLink) -> Result<Prim, String> {
    let parent = link.parent.and_then(|p| asset.links.get(p));
    let name = if parent.is_none() { "fixed_base".into() } else { format!("{}_joint", link.name) };
    let mut prim = Prim::new("PhysicsFixedJoint", name);
    if let Some(parent) = parent {
        prim = prim.rel("physics:body0", &format!("{root}/{}", parent.name))?;
    }
    let at = link.origin - parent.map_or(DVec3::ZERO, |p| p.origin);
    Ok(prim
        .rel("physics:body1", &format!("{root}/{}", link.name))?
        .attr("point3f", "physics:localPos0", float3(at))
        .attr("quatf", "physics:localRot0", quaternion(DQuat::IDENTITY))
        .attr("point3f", "physics:localPos1", float3(DVec3::ZERO))
        .attr("quatf", "physics:localRot1", quaternion(DQuat::IDENTITY)))
}

/// A drive that only damps.
fn passive(prim: Prim, joint: &AssetJoint, motion: &str, unit: f64) -> Prim {
    let drive = |what: &str| format!("drive:{motion}:physics:{what}");
    prim.api(format!("PhysicsDriveAPI:{motion}"))
        .uniform("token", &drive("type"), token("force"))
        .attr("float", &drive("stiffness"), float(0.0))
        .attr("float", &drive("damping"), float(joint.damping / unit))
        .attr("float", &drive("targetVelocity"), float(0.0))
        .attr("float", &drive("maxForce"), float(joint.effort))
}

/// Dry friction of a joint and its largest speed in the schemas of an engine. MuJoCo has no largest speed, but damping.
pub(super) fn resistance(prim: Prim, joint: &AssetJoint, engine: Engine) -> Prim {
    let (motion, unit) = motion(joint);
    let (friction, velocity) = (float(joint.friction), float(joint.velocity * unit));
    match engine {
        Engine::PhysX => {
            let axis = |what: &str| format!("physxJointAxis:{motion}:{what}");
            prim.api(format!("PhysxJointAxisAPI:{motion}"))
                .attr("float", &axis("maxJointVelocity"), velocity)
                .attr("float", &axis("staticFrictionEffort"), friction.clone())
                .attr("float", &axis("dynamicFrictionEffort"), friction)
        }
        Engine::Newton => prim.api("NewtonJointAPI").attr("float", "newton:velocityLimit", velocity).attr(
            "float",
            "newton:friction",
            friction,
        ),
        Engine::MuJoCo => prim
            .api("MjcJointAPI")
            .uniform("double", "mjc:frictionloss", Value::Double(joint.friction))
            .uniform("double", "mjc:damping", Value::Double(joint.damping)),
    }
}

/// Custom attributes for values that USD has no schema for.
fn notes(prim: Prim, joint: &AssetJoint, unit: f64) -> Prim {
    let observed = State::ALL.map(|state| joint.observed[state] * unit);
    let prim = prim.custom("double2", "artgs:observed", Value::Vec2d(observed.into()));
    match joint.kind {
        JointKind::Screw => prim.custom("double", "artgs:pitch", Value::Double(joint.pitch / unit)),
        _ => prim,
    }
}

/// Moments of inertia about the principal axes, and the rotation from these axes to the body's, for
/// `ixx iyy izz ixy ixz iyz`: Jacobi rotations until the matrix is diagonal.
fn principal([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> (DVec3, DQuat) {
    let mut m = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let mut axes = DMat3::IDENTITY;
    let size = xx.abs().max(yy.abs()).max(zz.abs());
    for round in 0..60 {
        let (p, q) = [(0, 1), (0, 2), (1, 2)][round % 3];
        if m[p][q].abs() <= 1e-15 * size {
            continue;
        }
        let theta = 0.5 * (2.0 * m[p][q]).atan2(m[q][q] - m[p][p]);
        let (s, c) = theta.sin_cos();
        let mut turn = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        (turn[p][p], turn[q][q], turn[p][q], turn[q][p]) = (c, c, s, -s);
        // Rows of `turn` as columns of the matrix: glam is column-major.
        let turn = DMat3::from_cols_array_2d(&turn).transpose();
        axes *= turn;
        m = (turn.transpose() * DMat3::from_cols_array_2d(&m) * turn).to_cols_array_2d();
    }
    (DVec3::new(m[0][0], m[1][1], m[2][2]), DQuat::from_mat3(&axes).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_axes_make_the_tensor_again() {
        for t in [
            [0.1, 0.12, 0.08, 0.001, -0.002, 0.003],
            [2.0, 2.0, 2.0, 0.5, 0.5, 0.5],
            [1.0, 3.0, 2.0, 0.0, 0.0, 0.0],
            [1e-6, 2e-6, 2.5e-6, 8e-7, -5e-7, 1e-7],
        ] {
            let (moments, axes) = principal(t);
            let r = DMat3::from_quat(axes);
            let back = r * DMat3::from_diagonal(moments) * r.transpose();
            let want = DMat3::from_cols_array(&[t[0], t[3], t[4], t[3], t[1], t[5], t[4], t[5], t[2]]);
            assert!(back.abs_diff_eq(want, 1e-12 * t[0].max(t[1])), "{back} {want}");
        }
    }
}
