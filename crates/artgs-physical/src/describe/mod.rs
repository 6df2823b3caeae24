//! What a replica is before anything is added to it: states that are nearer to being closed, link frames, classes and names of the links, and the
//! object's frame with its front along -Y.

pub(crate) mod semantics;

use crate::geometry::topology::{bounds, diagonal, points};
use crate::limits::nearer_state;
use crate::settings::{ClosedSettings, Front, PhysicalConfig};
use artgs_core::{
    Asset, AssetJoint, AssetLink, Joint, JointKind, Mesh, PartSemantics, PerState, Replica, Rigid, State, TexturedMesh,
};
use glam::DVec3;

/// Frames, classes and names of the links of a replica, one entry per link.
pub(crate) struct Described {
    /// State in which each part is nearer to being closed; none if unknown.
    pub nearer: Vec<Option<State>>,
    /// Link frames and joints.
    pub frames: Vec<Frame>,
    /// Unique names that are valid in every format.
    pub names: Vec<String>,
    /// What the links are.
    pub semantics: Vec<PartSemantics>,
    /// From the scaled capture's frame to the object's frame.
    pub object: Rigid,
    /// Front of the object in its frame; none if unknown.
    pub front: Option<DVec3>,
}

/// Describes a valid replica by the meshes of its parts, world frame, start state.
pub(crate) fn describe(replica: &Replica, meshes: &[&Mesh], config: &PhysicalConfig) -> Described {
    let settings = &config.settings.describe;
    let nearer: Vec<Option<State>> =
        (0..replica.parts.len()).map(|part| nearer_state_of(replica, meshes, part, &settings.closed)).collect();
    let upright = Rigid { rotation: config.up.upright(), translation: DVec3::ZERO };
    let captured = posed(replica, meshes, &frames(replica, &nearer, config, upright), config.scale);
    let known: Vec<bool> = nearer.iter().map(Option::is_some).collect();
    let semantics = semantics::classes(&captured, &known, &config.classes, settings);
    let front = match config.front {
        Front::Captured => None,
        Front::Found => semantics::front(&captured, &semantics, settings),
        Front::Towards(direction) => Some(direction),
    };
    let object = if config.front == Front::Captured { upright } else { canonical(&captured, front) * upright };
    let front = front.map(|_| DVec3::NEG_Y);
    let frames = frames(replica, &nearer, config, object);
    let posed = posed(replica, meshes, &frames, config.scale);
    let names = names(replica, semantics::names(&posed, &semantics, settings), config.part_names);
    Described { nearer, frames, names, semantics, object, front }
}

/// Frame and joint of a link.
pub(crate) struct Frame {
    /// From the scaled capture at the start state to the object's frame at the zero pose.
    pub from_start: Rigid,
    /// Object's frame, zero pose.
    pub origin: DVec3,
    /// The joint without its dynamics; none for the base.
    pub joint: Option<AssetJoint>,
}

/// `object` is the motion from the scaled capture's frame to the object's.
fn frames(replica: &Replica, nearer: &[Option<State>], config: &PhysicalConfig, object: Rigid) -> Vec<Frame> {
    let mut out: Vec<Frame> = Vec::new();
    for (i, part) in replica.parts.iter().enumerate() {
        let carried = part.parent.map_or(object, |p| out[p].from_start);
        let Some(joint) = replica.joint(i) else {
            out.push(Frame { from_start: carried, origin: DVec3::ZERO, joint: None });
            continue;
        };
        let joint = metric(joint, config.scale);
        let zero_state = nearer[i].unwrap_or(State::START);
        let zero = joint.state_values[zero_state];
        // Positive values open: from the state that is nearer to being closed towards the other.
        let away = joint.state_values[zero_state.other()] - zero;
        let sign = if away < 0.0 { -1.0 } else { 1.0 };
        let from_start = carried * joint.motion(zero - joint.state_values[State::START]);
        let ordered = |[a, b]: [f64; 2]| [a.min(b), a.max(b)];
        // Adding zero converts -0 to 0.
        let observed = joint.state_values.map(|v| sign * (v - zero) + 0.0);
        let given = ordered(joint.limits.map(|v| sign * (v - zero)));
        let seen = ordered([observed[State::START], observed[State::END]]);
        let limits =
            [given[0].min(seen[0]).min(0.0), given[1].max(seen[1]).max(seen[0] + config.settings.limits.narrowest)];
        let asset_joint = AssetJoint {
            kind: joint.kind,
            axis: from_start.turn(joint.axis * sign).normalize_or(DVec3::Z),
            pitch: joint.pitch,
            limits,
            observed,
            effort: 0.0,
            velocity: 0.0,
            damping: 0.0,
            friction: 0.0,
        };
        out.push(Frame { from_start, origin: from_start.apply(joint.origin), joint: Some(asset_joint) });
    }
    out
}

/// The links with their meshes, joints and origins alone.
pub(crate) fn posed(replica: &Replica, meshes: &[&Mesh], frames: &[Frame], scale: f64) -> Asset {
    let link = |(part, frame): (usize, &Frame)| {
        let to_link = Rigid::shift(-frame.origin) * frame.from_start;
        let vertex = |v: &[f32; 3]| to_link.apply(DVec3::from_array(v.map(f64::from)) * scale).as_vec3().to_array();
        let mesh = Mesh {
            vertices: meshes[part].vertices.iter().map(vertex).collect(),
            colors: Vec::new(),
            triangles: meshes[part].triangles.clone(),
        };
        let visual = TexturedMesh { mesh, ..TexturedMesh::default() };
        let (parent, origin) = (replica.parts[part].parent, frame.origin);
        AssetLink { parent, joint: frame.joint, origin, visual, ..AssetLink::default() }
    };
    Asset { links: frames.iter().enumerate().map(link).collect(), ..Asset::default() }
}

/// From the upright frame of the capture to one with the front along -Y, the lowest point at z = 0, and the origin below the
/// middle of the object's box at joint values 0.
fn canonical(captured: &Asset, front: Option<DVec3>) -> Rigid {
    // The turn about +Z that takes the front to -Y.
    let angle = front.map_or(0.0, |f| (-f.x).atan2(-f.y));
    let turn = Rigid::about(DVec3::Z, DVec3::ZERO, angle);
    let boxes =
        captured.links.iter().filter_map(|link| bounds(&link.visual.mesh.moved(&(turn * Rigid::shift(link.origin)))));
    let Some([low, high]) = boxes.reduce(|[l, h], [low, high]| [l.min(low), h.max(high)]) else { return turn };
    let middle = 0.5 * (low + high);
    Rigid::shift(DVec3::new(-middle.x, -middle.y, -low.z)) * turn
}

/// A joint in metres.
fn metric(joint: Joint, scale: f64) -> Joint {
    let value = |v: f64| if joint.kind == JointKind::Prismatic { v * scale } else { v };
    Joint {
        origin: joint.origin * scale,
        pitch: joint.pitch * scale,
        state_values: joint.state_values.map(value),
        limits: joint.limits.map(value),
        ..joint
    }
}

/// The state in which a part is nearer to being closed; none if it protrudes equally in both.
fn nearer_state_of(replica: &Replica, meshes: &[&Mesh], part: usize, settings: &ClosedSettings) -> Option<State> {
    let parent = replica.parts[part].parent?;
    // Compared with its parent, in the parent's frame.
    let joint = replica.joint(part)?;
    let end = meshes[part].moved(&joint.start_to_end());
    let distances = points(meshes[part]).zip(points(&end)).map(|(a, b)| a.distance(b));
    let mean_motion = distances.sum::<f64>() / end.vertices.len().max(1) as f64;
    let significant = (settings.significant_share * diagonal(meshes)).min(settings.of_motion * mean_motion);
    let (own, carrier) = (PerState::new(meshes[part], &end), PerState::new(meshes[parent], meshes[parent]));
    nearer_state(own, carrier, significant, settings.points)
}

/// Unique names that are valid in every format: `by_class` where the replica has none of its own, unless `keep`.
fn names(replica: &Replica, by_class: Vec<Option<String>>, keep: bool) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    for (i, part) in replica.parts.iter().enumerate() {
        let is_number = part.name == format!("part_{i}");
        let wanted = by_class[i].clone().filter(|_| is_number && !keep);
        let wanted = wanted.unwrap_or_else(|| to_identifier(&part.name, "part"));
        let taken = |name: &String| out.contains(name) || name == "world";
        let name = if taken(&wanted) { format!("{wanted}_{i}") } else { wanted };
        out.push(if taken(&name) { format!("link_{i}") } else { name });
    }
    out
}

/// Lower case letters, digits and `_`, a letter first.
pub(crate) fn to_identifier(text: &str, otherwise: &str) -> String {
    let mut out = String::new();
    for c in text.chars().map(|c| c.to_ascii_lowercase()) {
        match c {
            'a'..='z' | '0'..='9' => out.push(c),
            _ if !out.ends_with('_') => out.push('_'),
            _ => {}
        }
    }
    let out = out.trim_matches('_').to_string();
    match out.chars().next() {
        None => otherwise.into(),
        Some('a'..='z') => out,
        Some(_) => format!("{otherwise}_{out}"),
    }
}
