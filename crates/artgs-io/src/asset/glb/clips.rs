//! Animation clips: a joint from its lower to its upper limit.

use super::buffer::{Buffer, Use};
use super::joint_name;
use artgs_core::{AssetJoint, AssetLink, JointKind};
use glam::DVec3;
use serde_json::{Value, json};

/// Seconds from the lower to the upper limit.
pub(super) const DURATION: f64 = 2.0;

/// Largest turn between two keys, radians: players interpolate the shorter way, which is correct below half a turn.
const LARGEST_TURN: f64 = std::f64::consts::FRAC_PI_3;

/// Values of a joint at its keys: the limits, and values between them for rotations.
fn keys(joint: &AssetJoint) -> Vec<f64> {
    let [lower, upper] = joint.limits;
    let steps = match joint.kind {
        JointKind::Prismatic => 1.0,
        JointKind::Revolute | JointKind::Screw => ((upper - lower).abs() / LARGEST_TURN).ceil().clamp(1.0, 1e4),
    };
    (0..=steps as usize).map(|i| lower + (upper - lower) * i as f64 / steps).collect()
}

/// The clip of a link whose node `node` rests at `rest` in its parent's frame.
pub(super) fn clip(buffer: &mut Buffer, link: &AssetLink, joint: &AssetJoint, node: usize, rest: DVec3) -> Value {
    let values = keys(joint);
    let last = (values.len() - 1) as f64;
    let times: Vec<[f32; 1]> = (0..values.len()).map(|i| [(DURATION * i as f64 / last) as f32]).collect();
    let input = buffer.floats(&times, Use::Other, true);
    let (mut samplers, mut channels) = (Vec::new(), Vec::new());
    let mut drive = |path: &str, output: usize| {
        channels.push(json!({"sampler": samplers.len(), "target": {"node": node, "path": path}}));
        samplers.push(json!({"input": input, "output": output, "interpolation": "LINEAR"}));
    };
    if joint.kind != JointKind::Prismatic {
        let turns: Vec<[f32; 4]> = values.iter().map(|v| joint.motion(*v).rotation.as_quat().to_array()).collect();
        drive("rotation", buffer.floats(&turns, Use::Other, false));
    }
    if joint.kind != JointKind::Revolute {
        let shifts: Vec<[f32; 3]> =
            values.iter().map(|v| (rest + joint.motion(*v).translation).as_vec3().to_array()).collect();
        drive("translation", buffer.floats(&shifts, Use::Other, false));
    }
    json!({"name": joint_name(link), "samplers": samplers, "channels": channels})
}
