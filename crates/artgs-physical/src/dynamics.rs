//! What drives a joint and what holds it: effort (force limit), speed, damping and friction.

use crate::settings::DynamicsSettings;
use artgs_core::{AssetJoint, Inertial, JointKind};

/// Standard gravity, m/s^2.
const GRAVITY: f64 = 9.81;

/// Effort, speed, damping and friction of a joint whose part reaches `arm` from the axis. Friction holds the part of an upright
/// hinge or a level slide where it is put although the upright direction, and with it the axis, has an error.
pub(crate) fn dynamics(joint: AssetJoint, inertial: &Inertial, arm: f64, settings: &DynamicsSettings) -> AssetJoint {
    let mass = inertial.mass;
    let hand = settings.hand;
    // The frame of the link lies on the axis.
    let lever = inertial.center.reject_from_normalized(joint.axis).length();
    match joint.kind {
        JointKind::Prismatic => AssetJoint {
            effort: settings.force.max(settings.weights * mass * GRAVITY),
            velocity: settings.speed,
            damping: (mass / settings.settle).min(hand / settings.hand_speed),
            friction: (settings.friction.max(settings.holds.sin()) * mass * GRAVITY).min(hand),
            ..joint
        },
        JointKind::Revolute | JointKind::Screw => AssetJoint {
            effort: settings.torque.max(settings.weights * mass * GRAVITY * arm),
            velocity: settings.turn_rate,
            // At the speed of a hand at the far end, damping needs no more than the force of the hand there.
            damping: (mass * arm * arm / 3.0 / settings.settle).min(hand * arm * arm / settings.hand_speed),
            friction: (mass * GRAVITY * (settings.friction * settings.lever * arm).max(lever * settings.holds.sin()))
                .min(hand * arm),
            ..joint
        },
    }
}
