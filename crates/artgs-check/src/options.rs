//! Every threshold of the check, in one place.

use serde::{Deserialize, Serialize};

/// When a check fails. Lengths in metres, angles in radians.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct CheckOptions {
    /// A slide that stops this close to a limit has reached it.
    pub length: f64,
    /// A hinge that stops this close to a limit has reached it.
    pub angle: f64,
    /// Largest penetration of hulls of two links, at any pose looked at.
    pub penetration: f64,
    /// Poses per joint at which penetration is looked for, both limits included: the 20 at which hulls are cleared when they
    /// are made, and four between each two of those.
    pub poses: usize,
    /// Formats may differ by this much: lengths and angles absolutely, masses, moments and forces by this share.
    pub agreement: f64,
    /// Overlaps shallower than this do not stop a joint: engines are not exact to it, and hulls that touch would jam.
    pub touch: f64,
    /// Times the force that weight, friction, damping and inertia need with which a joint is driven.
    pub reserve: f64,
    /// Seconds from one limit to the other.
    pub travel: f64,
    /// Seconds for which a joint is held at a limit.
    pub hold: f64,
    /// Coefficient of friction between hulls.
    pub friction: f64,
    /// Seconds per step of the engine.
    pub step: f64,
    /// Mass over the volume of the box around a link, kg/m^3: least and most that is believed.
    pub density: [f64; 2],
}

impl Default for CheckOptions {
    fn default() -> Self {
        Self {
            length: 2e-3,
            angle: 0.5_f64.to_radians(),
            penetration: 2e-3,
            poses: 96,
            agreement: 1e-4,
            touch: 1e-3,
            reserve: 2.0,
            travel: 2.0,
            hold: 1.0,
            friction: 0.3,
            step: 1.0 / 240.0,
            density: [0.5, 25_000.0],
        }
    }
}
