//! OpenUSD: text, crate and package, as stages of the `openusd` crate.

use super::folder;
use crate::meshes;
use crate::model::{Link, Model, Motion, Shape, moments};
use crate::report::FormatFinding;
use artgs_core::{Inertial, JointKind, PerState, Rigid};
use glam::{DMat3, DQuat, DVec3};
use openusd::gf;
use openusd::sdf::{AssetPath, Value};
use openusd::tf::Token;
use openusd::usd::{Prim, PrimPredicate, Stage};
use std::io::Read;
use std::path::Path;

/// Reads a stage. Of a stage with Gaussians only these are checked: it references the stage with everything else.
pub(super) fn read(path: &Path, finding: &mut FormatFinding) -> Result<Option<Model>, String> {
    let stage = open(path)?;
    let prims = prims(&stage)?;
    if gaussians(&prims, finding)? {
        return Ok(None);
    }
    let model = model(path, &stage, &prims, finding)?;
    for motion in model.links.iter().filter_map(|link| link.motion.as_ref()) {
        if motion.velocity.is_none() || motion.friction.is_none() {
            return Err(format!("{} has no newton:velocityLimit or no newton:friction", motion.name));
        }
    }
    Ok(Some(model))
}

/// A stage that composes without errors.
pub(super) fn open(path: &Path) -> Result<Stage, String> {
    let name = path.to_str().ok_or("the path is not UTF-8")?;
    let stage = Stage::open(name).map_err(|e| format!("{e:#}"))?;
    let mut errors = stage.composition_errors().into_iter().map(|e| format!("{e}"));
    match errors.next() {
        Some(first) => Err(first),
        None => Ok(stage),
    }
}

/// Its prims, parents before children.
pub(super) fn prims(stage: &Stage) -> Result<Vec<Prim>, String> {
    let mut prims = Vec::new();
    let visited = stage.traverse(PrimPredicate::DEFAULT, |at| prims.push(stage.prim(at.clone())));
    visited.map(|()| prims).map_err(|e| format!("{e:#}"))
}

/// The object of a stage, whose textures have paths from the folder of `path`. Speed and friction of joints are those of Newton, none
/// where it has none.
pub(super) fn model(path: &Path, stage: &Stage, prims: &[Prim], finding: &mut FormatFinding) -> Result<Model, String> {
    units(stage, finding);
    let mut model = Model { links: Vec::new(), has_hulls: true };
    let joints: Vec<Joint> = prims.iter().filter_map(|p| Joint::of(p).transpose()).collect::<Result<_, _>>()?;
    let bodies: Vec<&Prim> = prims.iter().filter(|p| has(p, "PhysicsRigidBodyAPI")).collect();
    let roots = prims.iter().filter(|p| has(p, "PhysicsArticulationRootAPI")).count();
    if roots != 1 {
        finding.problems.push(format!("{roots} articulation roots, must be 1"));
    }
    for body in bodies {
        let link = link(body, &joints, &model, prims, finding)?;
        model.links.push(link);
    }
    textures(path, prims, finding);
    Ok(model)
}

fn units(stage: &Stage, finding: &mut FormatFinding) {
    let mut want = |field: &str, fits: &dyn Fn(&Value) -> bool, wanted: &str| match stage.stage_metadata(field) {
        Ok(Some(value)) if fits(&value) => {}
        _ => finding.problems.push(format!("`{field}` of the stage is not {wanted}")),
    };
    want("metersPerUnit", &|v| matches!(v, Value::Double(m) if *m == 1.0), "1");
    want("upAxis", &|v| matches!(v, Value::Token(t) if t.as_str() == "Z"), "Z");
}

pub(super) fn has(prim: &Prim, schema: &str) -> bool {
    prim.api_schemas().is_ok_and(|all| all.iter().any(|s| s.as_str() == schema))
}

pub(super) fn is(prim: &Prim, kind: &str) -> bool {
    prim.type_name().ok().flatten().is_some_and(|t| t.as_str() == kind)
}

pub(super) fn get<T: TryFrom<Value>>(prim: &Prim, name: &str) -> Result<Option<T>, String>
where
    T::Error: std::error::Error + Send + Sync + 'static,
{
    prim.attribute(name).get::<T>().map_err(|e| format!("{}.{name}: {e:#}", prim.path()))
}

fn need<T: TryFrom<Value>>(prim: &Prim, name: &str) -> Result<T, String>
where
    T::Error: std::error::Error + Send + Sync + 'static,
{
    get(prim, name)?.ok_or_else(|| format!("{} has no {name}", prim.path()))
}

fn float(prim: &Prim, name: &str) -> Result<f64, String> {
    need::<f32>(prim, name).map(f64::from)
}

fn vector(v: gf::Vec3f) -> DVec3 {
    DVec3::new(v.x.into(), v.y.into(), v.z.into())
}

fn quaternion(q: gf::Quatf) -> DQuat {
    DQuat::from_xyzw(q.x.into(), q.y.into(), q.z.into(), q.w.into()).normalize()
}

fn target(prim: &Prim, name: &str) -> Option<String> {
    prim.relationship(name).targets().ok()?.first().map(ToString::to_string)
}

/// A joint with the paths of its bodies.
struct Joint {
    parent: Option<String>,
    child: String,
    /// Joint frame in the frames of parent and child.
    frames: [Rigid; 2],
    motion: Option<Motion>,
}

impl Joint {
    /// None for prims of other types.
    fn of(prim: &Prim) -> Result<Option<Self>, String> {
        let kind = match prim.type_name().map_err(|e| format!("{e:#}"))?.as_ref().map(Token::as_str) {
            Some("PhysicsRevoluteJoint") => Some(JointKind::Revolute),
            Some("PhysicsPrismaticJoint") => Some(JointKind::Prismatic),
            Some("PhysicsFixedJoint") => None,
            _ => return Ok(None),
        };
        let frame = |at: &str, turn: &str| -> Result<Rigid, String> {
            Ok(Rigid { rotation: quaternion(need(prim, turn)?), translation: vector(need(prim, at)?) })
        };
        let frames =
            [frame("physics:localPos0", "physics:localRot0")?, frame("physics:localPos1", "physics:localRot1")?];
        let child = target(prim, "physics:body1").ok_or_else(|| format!("{} has no body", prim.path()))?;
        let motion = kind.map(|kind| motion(prim, kind, &frames[1])).transpose()?;
        Ok(Some(Self { parent: target(prim, "physics:body0"), child, frames, motion }))
    }
}

fn motion(prim: &Prim, kind: JointKind, frame: &Rigid) -> Result<Motion, String> {
    let axis = match need::<Token>(prim, "physics:axis")?.as_str() {
        "X" => DVec3::X,
        "Y" => DVec3::Y,
        "Z" => DVec3::Z,
        other => return Err(format!("{}: axis {other:?}", prim.path())),
    };
    // Degrees in USD.
    let (unit, word) = match kind {
        JointKind::Prismatic => (1.0, "linear"),
        JointKind::Revolute | JointKind::Screw => (1f64.to_radians(), "angular"),
    };
    let path = prim.path().to_string();
    let name = path.rsplit('/').next().unwrap_or_default().to_owned();
    let pitch = get::<f64>(prim, "artgs:pitch")?.map(|p| p / unit);
    let observed = get::<gf::Vec2d>(prim, "artgs:observed")?.map(|v| PerState::new(v.x * unit, v.y * unit));
    Ok(Motion {
        limits: [float(prim, "physics:lowerLimit")? * unit, float(prim, "physics:upperLimit")? * unit],
        pitch,
        observed,
        effort: Some(float(prim, &format!("drive:{word}:physics:maxForce"))?),
        velocity: get::<f32>(prim, "newton:velocityLimit")?.map(|v| f64::from(v) * unit),
        damping: Some(float(prim, &format!("drive:{word}:physics:damping"))? / unit),
        friction: get::<f32>(prim, "newton:friction")?.map(f64::from),
        ..Motion::new(&name, if pitch.is_some() { JointKind::Screw } else { kind }, frame.turn(axis))
    })
}

fn link(
    body: &Prim,
    joints: &[Joint],
    model: &Model,
    prims: &[Prim],
    finding: &mut FormatFinding,
) -> Result<Link, String> {
    let path = body.path().to_string();
    let name = path.rsplit('/').next().unwrap_or_default();
    let at: gf::Vec3d = need(body, "xformOp:translate")?;
    let rotation = quaternion(need(body, "xformOp:orient")?);
    let pose = Rigid { rotation, translation: DVec3::new(at.x, at.y, at.z) };
    let joint = joints.iter().find(|j| j.child == path).ok_or_else(|| format!("{path} has no joint"))?;
    let parent = match &joint.parent {
        Some(path_of_parent) => {
            let called = path_of_parent.rsplit('/').next().unwrap_or_default();
            let found = model.links.iter().position(|l| l.name == called);
            Some(found.ok_or_else(|| format!("{path} precedes its parent {path_of_parent}"))?)
        }
        None => None,
    };
    let above = parent.map_or(Rigid::IDENTITY, |p| model.links[p].pose);
    let (from_parent, from_child) = (above * joint.frames[0], pose * joint.frames[1]);
    let apart = (from_parent.translation - from_child.translation).length();
    let turned = (from_parent.rotation * from_child.rotation.conjugate()).xyz().length();
    if apart > 1e-4 || turned > 1e-4 {
        finding.problems.push(format!("link `{name}`: the two frames of its joint are {apart:.4} m apart at value 0"));
    }
    let mut out = Link::new(name, parent, pose);
    out.motion = joint.motion.clone();
    out.inertial = Some(inertial(body)?);
    let below = format!("{path}/");
    for mesh in prims.iter().filter(|p| is(p, "Mesh") && p.path().to_string().starts_with(&below)) {
        let shape = shape(mesh).unwrap_or_else(|reason| {
            finding.problems.push(format!("{}: {reason}", mesh.path()));
            Shape::default()
        });
        if has(mesh, "PhysicsCollisionAPI") { &mut out.hulls } else { &mut out.visuals }.push(shape);
    }
    Ok(out)
}

fn inertial(body: &Prim) -> Result<Inertial, String> {
    let turn = DMat3::from_quat(quaternion(need(body, "physics:principalAxes")?));
    let own = DMat3::from_diagonal(vector(need(body, "physics:diagonalInertia")?));
    let center = vector(need(body, "physics:centerOfMass")?);
    let inertia = moments(turn * own * turn.transpose());
    Ok(Inertial { mass: float(body, "physics:mass")?, center, inertia })
}

fn shape(mesh: &Prim) -> Result<Shape, String> {
    let points: Vec<gf::Vec3f> = need(mesh, "points")?;
    let points: Vec<DVec3> = points.into_iter().map(vector).collect();
    let (Value::IntVec(corners), Value::IntVec(counts)) =
        (need::<Value>(mesh, "faceVertexIndices")?, need::<Value>(mesh, "faceVertexCounts")?)
    else {
        return Err("faces are no integers".into());
    };
    if counts.iter().any(|c| *c != 3) || counts.len() * 3 != corners.len() {
        return Err("faces are not all triangles".into());
    }
    // Negative indices become out of range.
    let corners: Vec<u32> = corners.into_iter().map(|i| u32::try_from(i).unwrap_or(u32::MAX)).collect();
    meshes::triangles(&points, &corners)?;
    Ok(Shape { points, triangles: corners.as_chunks::<3>().0.to_vec() })
}

/// Decodes textures of shaders, from the folder or from the package.
fn textures(path: &Path, prims: &[Prim], finding: &mut FormatFinding) {
    for prim in prims.iter().filter(|p| is(p, "Shader")) {
        let Ok(Some(file)) = get::<AssetPath>(prim, "inputs:file") else { continue };
        let name = file.as_str().trim_start_matches("./").to_owned();
        let packed = path.extension().is_some_and(|e| e == "usdz");
        let bytes = if packed { unpacked(path, &name) } else { bytes(&folder(path).join(&name)) };
        if let Err(reason) = bytes.and_then(|b| meshes::decode(&b, finding)) {
            finding.problems.push(format!("texture {name}: {reason}"));
        }
    }
}

fn bytes(path: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|e| e.to_string())
}

fn unpacked(path: &Path, name: &str) -> Result<Vec<u8>, String> {
    let file = std::fs::File::open(path).map_err(|e| e.to_string())?;
    let mut archive = zip::ZipArchive::new(file).map_err(|e| e.to_string())?;
    let mut entry = archive.by_name(name).map_err(|e| e.to_string())?;
    let mut out = Vec::new();
    entry.read_to_end(&mut out).map_err(|e| e.to_string())?;
    Ok(out)
}

/// Whether the stage has Gaussians; counts them and reports numbers that are not finite.
pub(super) fn gaussians(prims: &[Prim], finding: &mut FormatFinding) -> Result<bool, String> {
    let fields: Vec<&Prim> = prims.iter().filter(|p| is(p, "ParticleField3DGaussianSplat")).collect();
    for prim in &fields {
        let positions: Vec<gf::Vec3f> = need(prim, "positions")?;
        let (scales, opacities): (Vec<gf::Vec3f>, Vec<f32>) = (need(prim, "scales")?, need(prim, "opacities")?);
        let n = positions.len();
        if scales.len() != n || opacities.len() != n {
            finding.problems.push(format!("{}: arrays of different lengths", prim.path()));
        }
        let finite = positions.into_iter().chain(scales).all(|v| vector(v).is_finite());
        if !finite || opacities.iter().any(|v| !v.is_finite()) {
            finding.problems.push(format!("{}: a number is not finite", prim.path()));
        }
        finding.splats += n;
    }
    Ok(!fields.is_empty())
}
